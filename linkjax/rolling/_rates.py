"""How fast rings, line of centres and bodies turn: rolling without slip at both rings, by Willis' equation."""

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
    """Speeds (rad/s, counter-clockwise), or angles turned (rad): the ratios are constant, so one serves for both.

    `carrier` is the line of centres, with which the chain turns; `bodies` are the bodies' own, in the frame. `rubbing`
    is the speed (m/s) at which neighbours rub where they touch, 2 r |inner - carrier|, the same at every contact.
    """

    inner: Scalar
    outer: Scalar
    carrier: Scalar
    bodies: Float[Array, " bodies"]
    rubbing: Scalar


def rates(design: Rolling, *, inner: Any = None, outer: Any = None, carrier: Any = None) -> Rates:
    """All speeds from two of them, e.g. `rates(design, inner=30.0, outer=0.0)` where the outer ring is held.

    Seen from the line of centres the rings have equal surface speeds of opposite sense, r (inner - carrier) =
    -R (outer - carrier), whatever the eccentricity, and a body of radius ρ turns by -r (inner - carrier) / ρ. Given
    angles it returns angles. Raises `ValueError` unless just two are given.
    """
    if sum(value is None for value in (inner, outer, carrier)) != 1:
        raise ValueError("rates needs two of inner, outer, carrier; the third follows from them")
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
