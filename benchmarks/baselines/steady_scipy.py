# pyright: basic, reportPossiblyUnboundVariable=false, reportAttributeAccessIssue=false
"""Baseline: the steady cycle with the ODE solvers of SciPy and with 12 to 360 positions as in textbooks.

Run: python steady_scipy.py   prints wall time and the relative error of delta for each method.
"""

import math
import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar, root

from benchmarks.baselines.hay_press import BREAKS, DESIGN, FLYWHEEL, LOAD, MEAN_SPEED, WINDOW, coefficients

REFERENCE = 0.0903376816582


def torque(phi, gravity, slider):
    angle = np.mod(phi, 2 * np.pi)
    return gravity - LOAD * np.abs(slider) * ((angle >= WINDOW[0]) & (angle <= WINDOW[1]))


def trapezoid(count):
    """The method of the textbooks: equal steps, trapezoidal rule for the work, extremes on the grid."""
    phi = np.arange(count) * 2 * np.pi / count
    inertia, _, gravity, slider, *_ = coefficients(DESIGN, phi)
    inertia = inertia + FLYWHEEL
    load = torque(phi, gravity, slider)
    excess = load - load.mean()
    work = np.concatenate([[0.0], np.cumsum((excess[1:] + excess[:-1]) / 2)]) * 2 * np.pi / count
    energy = 0.5 * inertia.mean() * MEAN_SPEED**2 - work.mean()
    for _ in range(8):
        speed = np.sqrt(2 * (energy + work) / inertia)
        mean = 1 / (1 / speed).mean()
        energy -= (mean - MEAN_SPEED) / ((1 / (speed**3 * inertia)).mean() * mean**2)
    return (speed.max() - speed.min()) / MEAN_SPEED


def shooting(method):
    """Integrate a cycle between discontinuities; solve for the drive torque and the starting speed."""

    def rhs(phi, state, drive):
        inertia, slope, gravity, slider, *_ = coefficients(DESIGN, phi, math.sqrt, math.cos, math.sin)
        net = torque(phi, gravity, slider) + drive - 0.5 * slope * state[0] ** 2
        return [net / ((inertia + FLYWHEEL) * state[0]), 1 / state[0]]

    def cycle(drive, start):
        state, pieces = [start, 0.0], []
        for a, b in zip(BREAKS, (*BREAKS[1:], 2 * math.pi), strict=False):
            sol = solve_ivp(
                rhs, (a + 1e-12, b - 1e-12), state, method, args=(drive,), rtol=1e-10, atol=1e-10, dense_output=True
            )
            state = sol.y[:, -1]
            pieces.append((a + 1e-12, b - 1e-12, sol.sol))
        return state, pieces

    def extreme(pieces, sign):
        """The largest of sign * speed: the best of a coarse grid, then polished."""
        best = -np.inf
        for a, b, dense in pieces:
            grid = np.linspace(a, b, 121)
            values = sign * dense(grid)[0]
            k = int(values.argmax())
            near = minimize_scalar(
                lambda x, dense=dense: -sign * dense(x)[0],
                method="bounded",
                options={"xatol": 1e-9},
                bounds=(grid[max(k - 1, 0)], grid[min(k + 1, 120)]),
            )
            best = max(best, values[k], -near.fun)
        return sign * best

    def residual(x):
        (speed, period), _ = cycle(x[0] * 1e3, x[1] * MEAN_SPEED)
        return [40 * (speed / MEAN_SPEED - x[1]), 2 * math.pi / period / MEAN_SPEED - 1]

    found = root(residual, [4.0, 1.0], tol=1e-11).x
    _, pieces = cycle(found[0] * 1e3, found[1] * MEAN_SPEED)
    return (extreme(pieces, 1) - extreme(pieces, -1)) / MEAN_SPEED


if __name__ == "__main__":
    for name, run, repeat in [
        *((f"trapezoid {n}", lambda n=n: trapezoid(n), 20) for n in (12, 24, 36, 360)),
        ("LSODA", lambda: shooting("LSODA"), 3),
        ("DOP853", lambda: shooting("DOP853"), 3),
    ]:
        times = []
        for _ in range(repeat):
            start = time.perf_counter()
            delta = run()
            times.append(time.perf_counter() - start)
        print(f"{name:14s} {1e3 * np.median(times):9.3f} ms   relative error of delta {abs(delta / REFERENCE - 1):.1e}")
