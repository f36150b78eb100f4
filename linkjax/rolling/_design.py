"""The design of a closed chain of rolling bodies, and the two numbers of its rings on which everything else rests."""

from __future__ import annotations

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._types import Scalar, as_float
from linkjax.mechanism import StructureError


class Rolling(eqx.Module):
    """A chain of `bodies` that roll between an inner and an outer ring, each touching both rings and its neighbours.

    Axes: origin at the centre of the inner ring, x along the line of centres, so that the outer ring has its centre at
    (`eccentricity`, 0); lengths in m. The centre of the first body lies at the angle `start` (rad) from the line of
    centres, the others follow counter-clockwise and close after `turns` turns about the inner ring. Without an
    eccentricity all bodies are equal. Raises `StructureError` for numbers of bodies and turns that make no chain; of
    rings that do not suit each other, `margins` and `check` tell.
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
    """Raise `StructureError` unless a chain of so many bodies can close after so many turns."""
    whole = isinstance(bodies, int) and isinstance(turns, int) and not isinstance(bodies, bool) and turns >= 1
    if not whole:
        raise StructureError("bodies", f"{bodies!r} bodies in {turns!r} turns", "write whole numbers, turns from 1")
    if bodies <= 2 * turns:
        remedy = f"take at least {2 * turns + 1} bodies" + (", or fewer turns" if turns > 1 else "")
        raise StructureError("bodies", f"{bodies} bodies cannot close in {turns} turns", remedy)
    common = math.gcd(bodies, turns)
    if common > 1:
        problem = f"{bodies} bodies in {turns} turns close after {bodies // common} in {turns // common} already"
        raise StructureError("bodies", problem, "take numbers without a common divisor")


def half_tangent(bodies: int, turns: int) -> float:
    """tan(π turns / bodies): of half the step from body to body where the rings are concentric."""
    check_numbers(bodies, turns)
    return math.tan(math.pi * turns / bodies)


def half_step(design: Rolling) -> Scalar:
    """Half the angle from body to body after the inversion that makes the rings concentric (rad).

    tan² of it is ((R - r)² - e²) / (4 r R), Steiner's invariant of two circles; zero, without slope, where the rings
    touch or cross.
    """
    inner, outer, e = design.inner_radius, design.outer_radius, design.eccentricity
    width = (outer - inner - e) * (outer - inner + e)
    return jnp.arctan2(safe_sqrt(width), 2 * safe_sqrt(inner * outer, 1.0))


def half_angle_ratio(design: Rolling) -> Scalar:
    """q in tan(φ/2) = tan(θ/2) / q, with θ the angle of a body after that inversion and φ its angle before it.

    The inversion maps the inner ring to itself. One where the rings are concentric, and where they touch or cross.
    """
    inner, outer, e = design.inner_radius, design.outer_radius, design.eccentricity
    narrow, wide = (outer - inner - e) * (outer + inner + e), (outer - inner + e) * (outer + inner - e)
    return safe_sqrt(safe_divide(narrow, wide), 1.0)


def spread(design: Rolling) -> Scalar:
    """R² - r² - e² of the rings (m²)."""
    inner, outer, e = design.inner_radius, design.outer_radius, design.eccentricity
    return (outer - inner) * (outer + inner) - e * e
