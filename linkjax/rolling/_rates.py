"""Speeds of rings, line of centres and bodies, for rolling without slip at both rings, by the Willis equation."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._numerics import safe_divide
from linkjax._types import Scalar, as_float
from linkjax.rolling._chain import chain
from linkjax.rolling._design import Rolling


class Rates(eqx.Module):
    """Speeds (rad/s, counter-clockwise positive) or angles of rotation (rad); both have the same constant ratios.

    `carrier` is the line of centres, with which the chain turns; `bodies` are the rotations of the bodies in the frame.
    `rubbing` is the sliding speed (m/s) between neighbours, 2 r |inner - carrier|, equal at all contacts.
    """

    inner: Scalar
    outer: Scalar
    carrier: Scalar
    bodies: Float[Array, " bodies"]
    rubbing: Scalar


def rates(design: Rolling, *, inner: Any = None, outer: Any = None, carrier: Any = None) -> Rates:
    """All speeds from two of them, e.g. `rates(design, inner=30.0, outer=0.0)` for a held outer ring.

    Relative to the line of centres, the surface speeds of the rings are equal and opposite, r (inner - carrier) =
    -R (outer - carrier), for any eccentricity, and a body of radius ρ rotates at -r (inner - carrier) / ρ. For angles
    it returns angles. Raises `ValueError` unless exactly two are given.
    """
    if sum(value is None for value in (inner, outer, carrier)) != 1:
        raise ValueError("rates needs exactly two of inner, outer and carrier; omit the third")
    r, big = design.inner_radius, design.outer_radius
    if carrier is None:
        inner, outer = as_float(inner), as_float(outer)
        carrier = (r * inner + big * outer) / (r + big)
    elif outer is None:
        inner, carrier = as_float(inner), as_float(carrier)
        outer = carrier - (inner - carrier) * r / big
    else:
        outer, carrier = as_float(outer), as_float(carrier)
        inner = carrier - (outer - carrier) * big / r
    surface = r * (inner - carrier)
    bodies = carrier - safe_divide(surface, chain(design).radii)
    return Rates(inner, outer, carrier, bodies, 2 * jnp.abs(surface))
