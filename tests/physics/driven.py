"""Machines driven by motors, and their steady-state motion by SciPy: what the tests of driven motion share."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

import linkjax as lj
from tests.physics import oracle, shooting

Extra = Callable[[float, float], float]  # (crank angle, crank speed) -> torque on the crank


def slider_crank(
    motor: lj.MotorDrive | None = None, flywheel: float = 0.01, pump: float | None = 5.0, **given
) -> lj.Scene:
    """The slider-crank S of Exudyn's test data, with a pump that resists in proportion to the piston's speed."""
    links = {
        "crank": lj.Link(length=0.1, mass=0.2, inertia=0.2 * 0.1**2 / 12, centre=lj.Vec(0.05, 0.0)),
        "rod": lj.Link(length=0.3, mass=0.2, inertia=0.2 * 0.3**2 / 12, centre=lj.Vec(0.15, 0.0)),
        "slider": lj.Link(mass=0.4),
    }
    groups = [lj.Crank("crank", "A", "B"), lj.RRP("rod", "slider", "B", "D", lj.Guide("A"))]
    machine = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, groups, lj.Flywheel(flywheel))
    loads = () if pump is None else (lj.Drag("pump", "slider", "D", linear=pump),)
    return lj.Scene(machine, loads, **{"speed": 25.0, **given}, motor=motor)


def line(no_load: float = 40.0, stall: float = 2.0, **given) -> lj.MotorDrive:
    """A motor with a straight characteristic."""
    return lj.MotorDrive(lj.LineMotor(no_load=no_load, stall=stall), **given)


class Lap(NamedTuple):
    """A periodic motion: speed at the start, period, multiplier of the return map in the speed, and ω(φ) as a function
    of an array of crank angles within one cycle from the start."""

    start: float
    first: float
    period: float
    multiplier: float
    speeds: Callable[[np.ndarray], np.ndarray]


def shoot(
    scene: lj.Scene, extra: Extra, guess: float, more: float = 0.0, method: str = "DOP853", rtol: float = 1e-13
) -> Lap:
    """The periodic motion by a method of SciPy and Newton's method on the start; `extra` is the torque of motor and
    loads that depend on the speed, `more` the inertia that is added to the reduced one."""
    edges = oracle.jumps(scene) if len(scene.loads) else np.zeros(1)
    edges = np.concatenate([edges, edges[:1] + scene.cycle])
    off = 1e-13 * scene.cycle
    panels = [shooting.Fitted(scene, low + off, high - off) for low, high in itertools.pairwise(edges)]

    def rate(phi, state, smooth):
        inertia, slope, torque = smooth(phi)
        w = state[0]
        return [(torque + extra(phi, w) - 0.5 * slope * w * w) / ((inertia + more) * w), 1 / w]

    def lap(speed, dense=False):
        state, ways = [speed, 0.0], []
        for smooth in panels:
            given = {"args": (smooth,), "rtol": rtol, "atol": 0.1 * rtol, "dense_output": dense}
            way = solve_ivp(rate, (smooth.low, smooth.high), state, method, **given)
            state = way.y[:, -1]
            ways.append(way)
        return state, ways

    at, slope = guess, 0.0
    for _ in range(12):
        step = 1e-6 * at
        slope = (lap(at + step)[0][0] - lap(at - step)[0][0]) / (2 * step)
        move = (lap(at)[0][0] - at) / (1 - slope)
        at += move
        if abs(move) < 1e-13 * at:
            break
    end, ways = lap(at, dense=True)

    def speeds(angles: np.ndarray) -> np.ndarray:
        inside = edges[0] + np.mod(angles - edges[0], scene.cycle)
        which = np.clip(np.searchsorted(edges, inside, side="right") - 1, 0, len(ways) - 1)
        return np.asarray([ways[k].sol(phi)[0] for k, phi in zip(which, inside, strict=True)])

    return Lap(float(edges[0]), at, float(end[1]), float(slope), speeds)
