"""Which rings a chain closes between: Steiner's condition (R - r)² - e² = 4 r R tan²(π turns / bodies), solved.

r, R are the radii of the inner and outer ring, e the distance of their centres. The condition does not depend on where
the chain begins. All closed forms, hence exact gradients.
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
    """How far rings are from their limits: signed and without dimension, negative beyond, smooth at the limit.

    `rings`: (R - r - |e|) / R, which must be positive: there is room for bodies all round. `closing`:
    ((R - r)² - 4 r R t²) / R², the square of the eccentricity that closes the chain over R²; where it is negative the
    rings are too close for so few bodies at any eccentricity.
    """

    rings: Scalar
    closing: Scalar


def closing_outer_radius(inner_radius: Any, bodies: int, eccentricity: Any = 0.0, turns: int = 1) -> Scalar:
    """Radius (m) of the outer ring with which the chain closes; there is one for every inner ring and eccentricity."""
    inner, e, t2 = as_float(inner_radius), as_float(eccentricity), half_tangent(bodies, turns) ** 2
    return (1 + 2 * t2) * inner + jnp.sqrt(4 * t2 * (1 + t2) * inner * inner + e * e)


def closing_inner_radius(outer_radius: Any, bodies: int, eccentricity: Any = 0.0, turns: int = 1) -> Scalar:
    """Radius (m) of the inner ring with which the chain closes; zero or less where |eccentricity| ≥ outer radius."""
    outer, e, t2 = as_float(outer_radius), as_float(eccentricity), half_tangent(bodies, turns) ** 2
    root = jnp.sqrt(4 * t2 * (1 + t2) * outer * outer + e * e)
    return (outer - e) * (outer + e) / ((1 + 2 * t2) * outer + root)


def closing_eccentricity(inner_radius: Any, outer_radius: Any, bodies: int, turns: int = 1) -> Scalar:
    """Distance (m) of the centres with which the chain closes between given rings.

    Its square is what depends smoothly on the radii (`margins(...).closing`, times R²). Zero, with zero derivative,
    where no eccentricity closes the chain, and where the rings are just concentric.
    """
    inner, outer = as_float(inner_radius), as_float(outer_radius)
    return safe_sqrt(_squared(inner, outer, half_tangent(bodies, turns)))


def rings_for(largest: Any, smallest: Any, bodies: int, turns: int = 1, start: Any = 0.0) -> Rolling:
    """The rings between which a chain closes whose largest and smallest body have these radii (m).

    Largest and smallest are those that fit on the line of centres, r_max = (R + e - r) / 2 and r_min = (R - e - r) / 2:
    bodies of the chain itself where one stands there, as with an even number of them and `start` zero.
    """
    big, small, t = as_float(largest), as_float(smallest), half_tangent(bodies, turns)
    width, product = big + small, big * small / t**2  # r² + width r = product, by Steiner's condition
    inner = 2 * product / (width + jnp.sqrt(width * width + 4 * product))
    return Rolling(inner, inner + width, bodies, turns, big - small, start)


def fitting_bodies(design: Rolling) -> Scalar:
    """How many bodies, as a real number, these rings take in that many turns: `bodies` where the chain closes.

    Infinite where the rings touch or cross.
    """
    return safe_divide(jnp.asarray(math.pi * design.turns), half_step(design), jnp.inf)


def margins(design: Rolling) -> Margins:
    """How far the rings are from touching, and from being too close for the chain at any eccentricity."""
    inner, outer, e = design.inner_radius, design.outer_radius, design.eccentricity
    squared = _squared(inner, outer, half_tangent(design.bodies, design.turns))
    return Margins((outer - inner - jnp.abs(e)) / outer, squared / (outer * outer))


def _squared(inner: Scalar, outer: Scalar, t: float) -> Scalar:
    """Square of the eccentricity that closes the chain."""
    return (outer - inner) ** 2 - 4 * t * t * inner * outer
