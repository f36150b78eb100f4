"""Baseline: minimum peak shaking force by counterweights, SciPy SLSQP with finite differences, ten starts.

Problem 1: crank and rocker counterweights as Cartesian mass-radius products (kg m), |crank| <= 30, |rocker| <= 10.
Problem 2: also l2 in 0.9..1.2, l4 in 0.45..0.56, l5 in 0.28..0.36 with |cos(transmission angle)| <= 0.99
(masses, mass centres and the point E do not change). Constant speed 73.27 rad/s, 360 angles; the peak is
minimised as an epigraph (min t, |F_n|^2 <= t^2). A counterweight adds no mass elsewhere and no inertia.
Run: python -m benchmarks.baselines.optimise_slsqp   prints best peak (kN), cycle evaluations and wall time.
"""

import time

import numpy as np
from scipy.optimize import minimize

from benchmarks.baselines.hay_press import DESIGN, MEAN_SPEED

PHI = np.arange(360) * np.pi / 180
CRANK = np.exp(1j * PHI)
SCALE = MEAN_SPEED**2 / 1e3
calls = 0


def shaking(x):
    """Shaking force per angle (complex, kN) and cosine of the transmission angle."""
    global calls
    calls += 1
    l2, l4, l5 = x[4:7] if len(x) >= 7 else (DESIGN["l2"], DESIGN["l4"], DESIGN["l5"])
    b = DESIGN["l1"] * CRANK
    s2 = -b.imag / l2
    c2 = np.sqrt(1 - s2 * s2)
    u, w2 = c2 + 1j * s2, -b.real / (l2 * c2)
    e2 = (b.imag + l2 * s2 * w2**2) / (l2 * c2)
    spin = 1j * e2 - w2**2
    point = (DESIGN["ex"] + 1j * DESIGN["ey"]) * u
    v, acc = 1j * b + 1j * w2 * point, -b + spin * point
    d = DESIGN["fx"] + 1j * DESIGN["fy"] - b - point
    r2 = np.abs(d) ** 2
    cosine = (l4**2 + l5**2 - r2) / (2 * l4 * l5)
    a = (l4**2 - l5**2 + r2) / (2 * r2)
    g = d * (a + 1j * np.sqrt(l4**2 / r2 - a * a))
    h = g - d
    det = g.imag * h.real - h.imag * g.real
    w4, w5 = (v.real * h.real + v.imag * h.imag) / det, (g.imag * v.imag + g.real * v.real) / det
    q = acc - w4**2 * g + w5**2 * h
    e4, e5 = (q.real * h.real + q.imag * h.imag) / det, (g.imag * q.imag + g.real * q.real) / det
    rocker = h / l5 * (1j * e5 - w5**2)
    total = (
        DESIGN["m2"] * (-b + DESIGN["c2"] * spin * u)
        + DESIGN["m3"] * (-b + l2 * spin * u).real
        + DESIGN["m4"] * (acc + DESIGN["c4"] / l4 * g * (1j * e4 - w4**2))
        + DESIGN["m5"] * DESIGN["c5"] * rocker
    )
    return SCALE * (total - (x[0] + 1j * x[1]) * CRANK + (x[2] + 1j * x[3]) * rocker), cosine


def solve(count, start):
    def constraints(z):
        force, cosine = shaking(z[:count])
        slack = (z[count] ** 2 - np.abs(force) ** 2) / 1e3
        slack = np.where(np.isfinite(slack), slack, -1e3)
        limits = [900 - z[0] ** 2 - z[1] ** 2, 100 - z[2] ** 2 - z[3] ** 2]
        return np.concatenate([slack, limits, 0.99 - np.abs(cosine)] if count == 7 else [slack, limits])

    bounds = [(-30, 30)] * 2 + [(-10, 10)] * 2 + [(0.9, 1.2), (0.45, 0.56), (0.28, 0.36)][: count - 4] + [(1, 1e4)]
    peak = np.abs(shaking(start)[0]).max()
    found = minimize(
        lambda z: z[count],
        np.append(start, peak),
        jac=lambda z: np.eye(count + 1)[count],
        method="SLSQP",
        bounds=bounds,
        constraints=[{"type": "ineq", "fun": constraints}],
        options={"maxiter": 300, "ftol": 1e-9},
    )
    return np.abs(shaking(found.x[:count])[0]).max()


if __name__ == "__main__":
    print(f"unbalanced: {np.abs(shaking(np.zeros(4))[0]).max():.3f} kN")
    for problem, count in ((1, 4), (2, 7)):
        rng, calls, begin, best = np.random.default_rng(0), 0, time.perf_counter(), []
        while len(best) < 10:
            polar = rng.random(4) * [30, 2 * np.pi, 10, 2 * np.pi]
            geometry = np.array([0.9, 0.45, 0.28]) + rng.random(3) * [0.3, 0.11, 0.08]
            start = np.array(
                [
                    polar[0] * np.cos(polar[1]),
                    polar[0] * np.sin(polar[1]),
                    polar[2] * np.cos(polar[3]),
                    polar[2] * np.sin(polar[3]),
                    *geometry,
                ]
            )[:count]
            with np.errstate(invalid="ignore"):
                force, cosine = shaking(start)
                if np.isfinite(force).all() and np.abs(cosine).max() < 0.99:
                    best.append(solve(count, start))
        print(
            f"problem {problem}: best {min(best):.6f} kN, reached by {sum(b < min(best) + 1e-4 for b in best)} of 10, "
            f"{calls} cycle evaluations, {time.perf_counter() - begin:.2f} s"
        )
