"""Design of a closed chain of rolling bodies, and basic quantities of its rings."""

from __future__ import annotations

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._types import Scalar, as_float
from linkjax.mechanism import StructureError


class Rolling(eqx.Module):
    """A chain of `bodies` rolling between an inner and an outer ring; each touches both rings and its two neighbours.

    Axes: origin at the centre of the inner ring, x along the line of centres, so that the centre of the outer ring is
    (`eccentricity`, 0); lengths in m. The centre of the first body is at the angle `start` (rad) from the line of
    centres; the others follow counter-clockwise and close after `turns` turns about the inner ring. Without
    eccentricity all bodies are equal. Raises `StructureError` if no chain has these numbers of bodies and turns; use
    `margins` and `check` for the rings.
    """

    inner_radius: Array = eqx.field(converter=as_float)
    outer_radius: Array = eqx.field(converter=as_float)
    bodies: int = eqx.field(static=True)
    turns: int = eqx.field(static=True, default=1)
    eccentricity: Array = eqx.field(converter=as_float, default=0.0)
    start: Array = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        check_numbers(self.bodies, self.turns)


def check_numbers(bodies: int, turns: int) -> None:
    """Raise `StructureError` unless a chain of `bodies` bodies can close after `turns` turns."""
    whole = isinstance(bodies, int) and isinstance(turns, int) and not isinstance(bodies, bool) and turns >= 1
    if not whole:
        raise StructureError("bodies", f"{bodies!r} bodies in {turns!r} turns", "write positive integers")
    if bodies <= 2 * turns:
        remedy = f"use at least {2 * turns + 1} bodies" + (", or fewer turns" if turns > 1 else "")
        raise StructureError("bodies", f"{bodies} bodies cannot close in {turns} turns", remedy)
    common = math.gcd(bodies, turns)
    if common > 1:
        fewer = f"bodies {bodies // common}, turns {turns // common}"
        problem = f"{bodies} bodies in {turns} turns already close with {fewer}"
        raise StructureError("bodies", problem, "use numbers without a common divisor")


def half_tangent(bodies: int, turns: int) -> float:
    """tan(π turns / bodies), the tangent of half the angular step from body to body between concentric rings."""
    check_numbers(bodies, turns)
    return math.tan(math.pi * turns / bodies)


def half_step(design: Rolling) -> Scalar:
    """Half the angular step (rad) from body to body after the inversion that makes the rings concentric.

    Its tan² is ((R - r)² - e²) / (4 r R), Steiner's invariant of two circles. Zero, with zero derivative, if the rings
    touch or intersect.
    """
    inner, outer, e = design.inner_radius, design.outer_radius, design.eccentricity
    width = (outer - inner - e) * (outer - inner + e)
    return jnp.arctan2(safe_sqrt(width), 2 * safe_sqrt(inner * outer, 1.0))


def half_angle_ratio(design: Rolling) -> Scalar:
    """q in tan(φ/2) = tan(θ/2) / q, where φ and θ are the angles of a body before and after this inversion.

    The inversion maps the inner ring to itself. q = 1 if the rings are concentric, and if they touch or intersect.
    """
    inner, outer, e = design.inner_radius, design.outer_radius, design.eccentricity
    narrow, wide = (outer - inner - e) * (outer + inner + e), (outer - inner + e) * (outer + inner - e)
    return safe_sqrt(safe_divide(narrow, wide), 1.0)


def spread(design: Rolling) -> Scalar:
    """R² - r² - e² of the rings (m²)."""
    inner, outer, e = design.inner_radius, design.outer_radius, design.eccentricity
    return (outer - inner) * (outer + inner) - e * e
