"""The reason why a cycle has no actual motion, and the cycle without the values of that motion.

Whether a motion exists is known only after it is computed; then no output contains its values. At constant speed, or
where all masses are zero, its stages are neither traced nor compiled (a machine without masses once took 30 to 40 s,
and an error).
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp

from linkjax._results import MESSAGES, Result
from linkjax._types import Tracer, known
from linkjax.analysis._cycle import Cycle, Flywheels, NoMotion
from linkjax.analysis._friction import locked_text
from linkjax.machine import Scene
from linkjax.motion import speed_dependent, steady_motion, textbook_flywheel, with_flywheel

NONE = (Result.INTEGRATION_FAILED, Result.NO_PERIODIC_REGIME, Result.NO_INERTIA)
CLOSE = 1e-3  # relative: a flywheel gives the wanted δ
HEAVY = 1e4  # times the reduced inertia: with a flywheel of so much the speed is nearly constant


def massless(scene: Scene) -> bool:
    """Whether all masses and inertias of a machine are known to be zero."""
    links = scene.mechanism.links.values()
    pieces = [piece for link in links for piece in link.counterweights.values()]
    heavy = [(link.mass, link.inertia, link.area) for link in links]
    heavy += [(piece.mass, piece.own_inertia()) for piece in pieces]
    rotor = None if scene.motor is None else scene.motor.inertia
    numbers = [known(leaf) for leaf in jax.tree.leaves((heavy, scene.mechanism.flywheel, rotor))]
    return all(number is not None and not number.any() for number in numbers)


def only_what_exists(cycle: Cycle) -> Cycle:
    """The cycle, with `missing` and None for the values of an actual motion that does not exist; unchanged under jax
    transformations, where the result is unknown."""
    traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(cycle))
    if traced or cycle.constant_speed or (code := Result(int(cycle.result))) not in NONE:
        return cycle
    wheels, steady = cycle.flywheel, cycle.steady
    needed = None if wheels is None else wheels.for_target_delta
    if needed is not None and not (bool(jnp.isfinite(needed)) and float(needed) > 0):
        needed, wheels = None, None
    if needed is not None and wheels is not None and speed_dependent(cycle.scene):
        wheels = _driven_wheels(cycle.scene, wheels)
        needed = None if wheels is None else needed
    missing = NoMotion(
        _reason(cycle, code, "" if needed is None else _needed(cycle, float(needed))),
        fails=code is not Result.NO_INERTIA or not massless(cycle.scene),
        steady_state_margin=None if steady is None else steady.steady_state_margin,
        min_mean_speed=None if steady is None or code is not Result.NO_PERIODIC_REGIME else steady.min_mean_speed,
    )
    on_grid = None if speed_dependent(cycle.scene) else cycle.on_grid
    result = cycle.result if missing.fails else jnp.zeros_like(cycle.result)
    return dataclasses.replace(
        cycle, result=result, missing=missing, steady=None, speed=None, acceleration=None, time=None, forces=None,
        peaks=None, motor=None, friction=None, on_grid=on_grid, flywheel=None if needed is None else wheels, work=None,
        checks=dataclasses.replace(cycle.checks, energy_closure=None),
    )  # fmt: skip


def _driven_wheels(scene: Scene, wheels: Flywheels) -> Flywheels | None:
    """The flywheels where the needed one does give the wanted δ; None where a motor carries the loads with no flywheel,
    so that the search for one has no meaning."""
    needed, target = wheels.for_target_delta, scene.target_delta
    assert needed is not None and target is not None
    motion = steady_motion(with_flywheel(scene, needed))
    good = motion.driven is not None and bool(motion.driven.found)
    if not good or abs(float(motion.delta) / float(target) - 1) > CLOSE:
        return None
    return dataclasses.replace(wheels, textbook=textbook_flywheel(motion, target))


def _needed(cycle: Cycle, needed: float) -> str:
    assert cycle.scene.target_delta is not None
    return f" (with a flywheel of {needed:.4g} kg m^2 δ is {float(cycle.scene.target_delta):.4g})"


def _not_driven(cycle: Cycle, shaft: bool, flywheel: str) -> str:
    """Why a motor gives no steady-state motion, and a remedy, in one line."""
    steady, nominal = cycle.steady, f"{float(cycle.scene.speed):.6g} rad/s"
    gain, degrees = float(steady.driven.gain), float(jnp.degrees(steady.angle_of_min))
    if cycle.scene.motor is None:
        return (
            f"no steady-state motion at a mean speed of {nominal}: no constant torque of the drive gives it against "
            "the loads. Raise the mean speed, add inertia, or reduce the loads."
        )
    within = f"no steady-state motion between 0.02 and 4 times {nominal}"
    if gain > 0:
        return (
            f"{within}: the drive supplies more energy than the loads take, {gain:.4g} J per cycle too much at the "
            "nearest motion. Check its torque, ratio and the nominal speed, or add what limits the speed."
        )
    more = f" add {f'a flywheel{flywheel}' if shaft else 'inertia'}," if flywheel or _heavier_helps(cycle) else ""
    return (
        f"{within}: the drive cannot carry the loads, {-gain:.4g} J are missing in the cycle of the nearest motion, "
        f"whose speed is lowest at {degrees:.2f} degrees. Choose a stronger motor or another ratio,{more} or reduce "
        "the loads."
    )


def _heavier_helps(cycle: Cycle) -> bool:
    """Whether the motor carries the loads at a nearly constant speed."""
    motion = steady_motion(with_flywheel(cycle.scene, HEAVY * jnp.max(cycle.reduced.inertia)))
    return motion.driven is not None and bool(motion.driven.found)


def _reason(cycle: Cycle, code: Result, flywheel: str) -> str:
    """Why there is no actual motion, and a remedy, in one line."""
    shaft, steady = cycle.scene.mechanism.driver.shaft() is not None, cycle.steady
    if code is Result.NO_INERTIA:
        if steady is None or not bool(jnp.any(cycle.reduced.inertia > 0)):
            why = "no actual motion: nothing has a mass; forces at constant speed are static"
        else:
            degrees = float(jnp.degrees(steady.angle_of_min_inertia))
            why = f"no actual motion: no reduced inertia at {degrees:.2f} degrees of crank angle"
            why += f", so that the {'crank ' if shaft else ''}speed is unbounded there"
        return f"{why}. Give {'the crank or the flywheel' if shaft else 'the driven links'} an inertia{flywheel}."
    if code is Result.INTEGRATION_FAILED or steady is None:
        return f"no actual motion: {MESSAGES[Result.INTEGRATION_FAILED]}"
    if steady.driven is not None:
        locked = locked_text(dataclasses.replace(cycle, friction=None))
        return f"no actual motion: {locked}" if locked else _not_driven(cycle, shaft, flywheel)
    nominal, lowest = (f"{float(speed):.6g} rad/s" for speed in (cycle.scene.speed, steady.min_mean_speed))
    degrees = float(jnp.degrees(steady.angle_of_min_work))
    add = "add a flywheel" if shaft else "add inertia to the driven links"
    return (
        f"no steady-state motion at a mean speed of {nominal}: the kinetic energy falls to zero at {degrees:.2f} "
        f"degrees; the lowest mean speed that has one is {lowest}. Raise the mean speed, {add}{flywheel} or reduce the "
        "loads."
    )
