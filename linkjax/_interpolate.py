"""Interpolation between given values: straight pieces, or monotone cubic ones."""

from __future__ import annotations

from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_divide, taken


def interpolate(x: Array, knots: Array, values: Array, method: Literal["linear", "cubic"] = "cubic") -> Array:
    """Value at `x` of the curve through `values` at the increasing `knots` (both of shape (n,), two or more).

    "linear" is straight between the knots; "cubic" is the monotone cubic interpolant with the slopes of Fritsch and
    Butland: it has no extremes between the knots, and its slope is continuous. Outside of the knots the first or last
    value holds. Sources: F. N. Fritsch, R. E. Carlson, SIAM J. Numer. Anal. 17 (1980) 238-246; F. N. Fritsch,
    J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304.
    """
    x = jnp.minimum(jnp.maximum(x, knots[0]), knots[-1])
    i = jnp.clip(jnp.searchsorted(knots, x, side="right") - 1, 0, knots.size - 2)
    steps, rises = jnp.diff(knots), jnp.diff(values)
    h, t = taken(steps, i), (x - taken(knots, i)) / taken(steps, i)
    y, rise = taken(values, i), taken(rises, i)
    if method == "linear" or knots.size == 2:
        return y + t * rise
    slopes = _slopes(steps, rises / steps)
    first, last = h * taken(slopes, i), h * taken(slopes, i + 1)
    return y + t * (first + t * (3 * rise - 2 * first - last + t * (first + last - 2 * rise)))


def _slopes(steps: Array, secants: Array) -> Array:
    """Slopes at the knots, from the steps between them and the secants; one or more of each."""
    if steps.size == 1:
        return jnp.concatenate([secants, secants])
    h0, h1, d0, d1 = steps[:-1], steps[1:], secants[:-1], secants[1:]
    same = d0 * d1 > 0
    w0, w1 = 2 * h1 + h0, h1 + 2 * h0
    inner = safe_divide((w0 + w1) * d0 * d1, jnp.where(same, w0 * d1 + w1 * d0, 0.0))
    ends = (_end(steps[0], steps[1], secants[0], secants[1]), _end(steps[-1], steps[-2], secants[-1], secants[-2]))
    return jnp.concatenate([ends[0][None], inner, ends[1][None]])


def _end(h0: Array, h1: Array, d0: Array, d1: Array) -> Array:
    """Slope at an end, from three points, limited so that the curve stays monotone."""
    slope = ((2 * h0 + h1) * d0 - h0 * d1) / (h0 + h1)
    slope = jnp.where(slope * d0 <= 0, 0.0, slope)
    return jnp.where((d0 * d1 <= 0) & (jnp.abs(slope) > 3 * jnp.abs(d0)), 3 * d0, slope)
