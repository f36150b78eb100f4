"""The steady-state motion by an independent method: SciPy's DOP853 on the equation of motion, for the given mean."""

from __future__ import annotations

import bisect
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
    """Work of the reduced torque over a range."""
    return quad(lambda phi: at(scene, phi)[2], low, high, epsabs=1e-11, epsrel=1e-12, limit=400)[0]


class Fitted:
    """Reduced inertia, slope and torque over a range without jumps, by Chebyshev polynomials through the values of
    `oracle.reduction`: as accurate as these, and a hundred times as fast for an integrator with single evaluations."""

    NODES = 24
    SMALLEST = 1e-3  # rad: a function not resolved to rounding at this width has rounding noise of its own

    def __init__(self, scene, low: float, high: float):
        self.low, self.high, self.order = low, high, np.arange(self.NODES)
        self.at_nodes = np.pi * (self.order + 0.5) / self.NODES
        basis = np.cos(np.outer(self.order, self.at_nodes)) * (2 / self.NODES)
        basis[0] /= 2
        self.pieces: list[tuple[float, float, np.ndarray]] = []
        todo = [(low, high)]
        while todo:
            low, high = todo.pop()
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            found = oracle.reduction(scene, middle + half * np.cos(self.at_nodes))
            series = np.stack([found.inertia, found.slope, found.torque]) @ basis.T
            tail = np.max(np.abs(series[:, -3:]), axis=1) > 1e-14 * np.max(np.abs(series), axis=1)
            if half > 0.2 or (half > self.SMALLEST and np.any(tail)):
                todo += [(middle, high), (low, middle)]
            else:
                self.pieces.append((low, high, series))
        self.starts = [low for low, _, _ in self.pieces]
        scan = np.random.default_rng(1).uniform(self.low, self.high, 50)
        known = oracle.reduction(scene, scan)
        wrong = np.abs([self(phi) for phi in scan] - np.stack([known.inertia, known.slope, known.torque], axis=1))
        size = np.max(np.abs([known.inertia, known.slope, known.torque]), axis=1)
        assert np.all(wrong <= 1e-12 * size), np.max(wrong / size)

    def __call__(self, phi: float) -> np.ndarray:
        low, high, series = self.pieces[max(bisect.bisect_right(self.starts, phi) - 1, 0)]
        x = (2 * phi - low - high) / (high - low)
        return series @ np.cos(self.order * np.arccos(min(max(x, -1.0), 1.0)))

    def work(self) -> float:
        """Of the torque, over the whole range."""
        return quad(lambda phi: self(phi)[2], self.low, self.high, epsabs=1e-11, epsrel=1e-12, limit=400)[0]


class Turn(NamedTuple):
    """One cycle: drive torque, δ, extreme speeds and their angles, speed at the start, and the residual at its end."""

    drive: float
    delta: float
    fastest: tuple[float, float]
    slowest: tuple[float, float]
    start: tuple[float, float]
    misfit: float


def shoot(scene, tolerance: float = 1e-12) -> Turn:
    """The steady-state motion for a constant drive torque that balances the cycle (time mean of the speed)."""
    edges = oracle.jumps(scene)
    edges = np.concatenate([edges, edges[:1] + scene.cycle])
    inside = 1e-13 * scene.cycle  # next to the jumps
    panels = [Fitted(scene, low + inside, high - inside) for low, high in itertools.pairwise(edges)]
    drive = -sum(smooth.work() for smooth in panels) / scene.cycle
    mean = float(scene.speed)

    def rate(phi, state, smooth):
        inertia, slope, torque = smooth(phi)
        return [(torque + drive - 0.5 * slope * state[0] ** 2) / (inertia * state[0]), 1 / state[0]]

    def run(smooth, state, high=None, dense=False):
        ends = smooth.low, smooth.high if high is None else high
        return solve_ivp(rate, ends, state, "DOP853", args=(smooth,), rtol=tolerance, atol=1e-14, dense_output=dense)

    def lap(speed):
        state = [speed, 0.0]
        for smooth in panels:
            state = run(smooth, state).y[:, -1]
        return state

    one, two = mean, mean * 1.01
    late = [lap(w)[1] * mean / scene.cycle - 1 for w in (one, two)]
    for _ in range(8):
        one, two = two, two - late[1] * (two - one) / (late[1] - late[0])
        late = [late[1], lap(two)[1] * mean / scene.cycle - 1]
        if abs(late[1]) < 2e-14 or one == two:
            break
    speeds, state = [], [two, 0.0]
    for smooth in panels:
        way = run(smooth, state, dense=True)
        scan = np.linspace(way.t[0], way.t[-1], 300)
        slope = [rate(phi, way.sol(phi), smooth)[0] for phi in scan]
        speeds.append((way.y[0, 0], smooth.low))
        for i in range(len(scan) - 1):
            if slope[i] * slope[i + 1] < 0:
                top = brentq(lambda phi, way=way, of=smooth: rate(phi, way.sol(phi), of)[0], scan[i], scan[i + 1])
                speeds.append((run(smooth, state, top).y[0, -1], top))
        state = way.y[:, -1]
    fastest, slowest = max(speeds), min(speeds)
    delta = (fastest[0] - slowest[0]) / mean
    return Turn(drive, delta, fastest, slowest, (two, edges[0]), abs(state[0] / two - 1))
