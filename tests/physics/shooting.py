"""The steady regime by another road: SciPy's DOP853 on the equation of motion, started so that the mean is right."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from tests.physics import oracle


def at(scene, phi: float) -> tuple[float, float, float]:
    """Reduced inertia, slope and torque at one angle."""
    found = oracle.reduction(scene, np.asarray([phi]))
    return found.inertia[0], found.slope[0], found.torque[0]


def work(scene, low: float, high: float) -> float:
    """Work of the reduced torque over a range without jumps."""
    return quad(lambda phi: at(scene, phi)[2], low, high, epsabs=1e-11, epsrel=1e-12, limit=400)[0]


class Turn(NamedTuple):
    """One cycle: drive torque, δ, extreme speeds and their angles, speed at the start, and the misfit at its end."""

    drive: float
    delta: float
    fastest: tuple[float, float]
    slowest: tuple[float, float]
    start: tuple[float, float]
    misfit: float


def shoot(scene, tolerance: float = 1e-12) -> Turn:
    """The steady periodic regime for a constant drive torque that balances the cycle (time mean of the speed)."""
    edges = oracle.jumps(scene)
    edges = np.concatenate([edges, edges[:1] + scene.cycle])
    panels = list(itertools.pairwise(edges))
    drive = -sum(work(scene, low, high) for low, high in panels) / scene.cycle
    mean = float(scene.speed)

    def rate(phi, state):
        inertia, slope, torque = at(scene, phi)
        return [(torque + drive - 0.5 * slope * state[0] ** 2) / (inertia * state[0]), 1 / state[0]]

    def panel(low, high, state, dense=False):
        inside = 1e-13 * (high - low)  # off the jumps themselves
        return solve_ivp(
            rate, (low + inside, high - inside), state, "DOP853", rtol=tolerance, atol=1e-14, dense_output=dense
        )

    def lap(speed):
        state = [speed, 0.0]
        for low, high in panels:
            state = panel(low, high, state).y[:, -1]
        return state

    one, two = mean, mean * 1.01
    late = [lap(w)[1] * mean / scene.cycle - 1 for w in (one, two)]
    for _ in range(8):
        one, two = two, two - late[1] * (two - one) / (late[1] - late[0])
        late = [late[1], lap(two)[1] * mean / scene.cycle - 1]
        if abs(late[1]) < 2e-14 or one == two:
            break
    speeds, state = [], [two, 0.0]
    for low, high in panels:
        run = panel(low, high, state, dense=True)
        scan = np.linspace(run.t[0], run.t[-1], 300)
        slope = [rate(phi, run.sol(phi))[0] for phi in scan]
        speeds.append((run.y[0, 0], low))
        for i in range(len(scan) - 1):
            if slope[i] * slope[i + 1] < 0:
                top = brentq(lambda phi, sol=run.sol: rate(phi, sol(phi))[0], scan[i], scan[i + 1])
                speeds.append((panel(low, top, state).y[0, -1], top))
        state = run.y[:, -1]
    fastest, slowest = max(speeds), min(speeds)
    delta = (fastest[0] - slowest[0]) / mean
    return Turn(drive, delta, fastest, slowest, (two, edges[0]), abs(state[0] / two - 1))
