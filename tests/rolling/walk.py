"""Chains by an independent method: from body to body with 50 digits, only from distances between centres."""

from __future__ import annotations

from typing import Any

import mpmath

mpmath.mp.dps = 50


def radius(inner: Any, outer: Any, e: Any, angle: Any) -> Any:
    """Radius of the body that touches both rings at an angle: the root of its distance to the outer ring."""
    towards = mpmath.expj(angle)

    def gap(r):
        return abs((inner + r) * towards - e) - (outer - r)

    return mpmath.findroot(gap, (mpmath.mpf(0), outer - inner + e), solver="anderson", tol=mpmath.mpf(10) ** -80)


def walk(inner: float, outer: Any, e: float, start: float, bodies: int) -> list[tuple[Any, Any]]:
    """Angles (increasing) and radii of so many bodies, each found from the previous one."""
    r, big, d, angle = (mpmath.mpf(x) for x in (inner, outer, e, start))
    size = radius(r, big, d, angle)
    found = [(angle, size)]
    while len(found) < bodies:
        here, size = found[-1]

        def apart(step, here=here, size=size):
            next_size = radius(r, big, d, here + step)
            a, b = r + size, r + next_size
            squared = a * a + b * b - 2 * a * b * mpmath.cos(step)
            return squared - (size + next_size) ** 2

        low, high = mpmath.mpf("1e-30"), mpmath.pi
        step = mpmath.findroot(apart, (low, high), solver="anderson", tol=mpmath.mpf(10) ** -80)
        found.append((here + step, radius(r, big, d, here + step)))
    return found
