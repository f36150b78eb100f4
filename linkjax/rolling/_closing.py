"""Rings for a closed chain, from Steiner's condition (R - r)² - e² = 4 r R tan²(π turns / bodies).

r and R are the radii of the inner and outer ring, e is the distance of their centres. The condition does not depend on
the position of the first body. All results are in closed form, so gradients are exact.

The condition uses tan² of half the step instead of sin², so both radii that satisfy it are sums or quotients without
cancellation.
"""

from __future__ import annotations

import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._types import Scalar, as_float
from linkjax.rolling._design import Rolling, half_step, half_tangent


class Margins(eqx.Module):
    """Dimensionless margins of the rings: negative if violated, smooth at zero.

    `rings`: (R - r - |e|) / R, positive if the inner ring is inside the outer ring without contact. `closing`:
    ((R - r)² - 4 r R t²) / R², the square of the closing eccentricity over R²; if it is negative, the gap between the
    rings is too narrow to close the chain with this number of bodies at any eccentricity.
    """

    rings: Scalar
    closing: Scalar


def closing_outer_radius(inner_radius: Any, bodies: int, eccentricity: Any = 0.0, turns: int = 1) -> Scalar:
    """Radius (m) of the outer ring that closes the chain; it exists for every inner ring and eccentricity."""
    inner, e, t2 = as_float(inner_radius), as_float(eccentricity), half_tangent(bodies, turns) ** 2
    return (1 + 2 * t2) * inner + jnp.sqrt(4 * t2 * (1 + t2) * inner * inner + e * e)


def closing_inner_radius(outer_radius: Any, bodies: int, eccentricity: Any = 0.0, turns: int = 1) -> Scalar:
    """Radius (m) of the inner ring that closes the chain; zero or negative if |eccentricity| ≥ outer radius."""
    outer, e, t2 = as_float(outer_radius), as_float(eccentricity), half_tangent(bodies, turns) ** 2
    root = jnp.sqrt(4 * t2 * (1 + t2) * outer * outer + e * e)
    return (outer - e) * (outer + e) / ((1 + 2 * t2) * outer + root)


def closing_eccentricity(inner_radius: Any, outer_radius: Any, bodies: int, turns: int = 1) -> Scalar:
    """Distance (m) of the ring centres that closes the chain with given rings.

    Its square, `margins(...).closing` times R², is a smooth function of the radii. Zero, with zero derivative, if no
    eccentricity closes the chain, and if exactly concentric rings close it.
    """
    inner, outer = as_float(inner_radius), as_float(outer_radius)
    return safe_sqrt(_squared(inner, outer, half_tangent(bodies, turns)))


def rings_for(largest: Any, smallest: Any, bodies: int, turns: int = 1, start: Any = 0.0) -> Rolling:
    """The rings of a closed chain for given radii (m) of the largest and the smallest body.

    These are the bodies that fit on the line of centres, with the radii (R + e - r) / 2 and (R - e - r) / 2. The chain
    contains both if it has bodies there, e.g. for an even number of bodies and zero `start`.
    """
    big, small, t = as_float(largest), as_float(smallest), half_tangent(bodies, turns)
    width, product = big + small, big * small / t**2  # r² + width r = product, by Steiner's condition
    inner = 2 * product / (width + jnp.sqrt(width * width + 4 * product))
    return Rolling(inner, inner + width, bodies, turns, big - small, start)


def fitting_bodies(design: Rolling) -> Scalar:
    """Number of bodies (real) that closes a chain between these rings in `turns` turns; equals `bodies` if it closes.

    Infinite if the rings touch or intersect.
    """
    return safe_divide(jnp.asarray(math.pi * design.turns), half_step(design), jnp.inf)


def margins(design: Rolling) -> Margins:
    """Margins against contact of the rings, and against a gap too narrow for the chain at any eccentricity."""
    inner, outer, e = design.inner_radius, design.outer_radius, design.eccentricity
    squared = _squared(inner, outer, half_tangent(design.bodies, design.turns))
    return Margins((outer - inner - jnp.abs(e)) / outer, squared / (outer * outer))


def _squared(inner: Scalar, outer: Scalar, t: float) -> Scalar:
    """Square of the eccentricity that closes the chain."""
    return (outer - inner) ** 2 - 4 * t * t * inner * outer
