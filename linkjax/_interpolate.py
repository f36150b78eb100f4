"""Interpolation in tables: straight lines, or a monotone cubic that never overshoots its values.

Source of the cubic: F. N. Fritsch and R. E. Carlson, Monotone piecewise cubic interpolation, SIAM J. Numer. Anal. 17
(1980) 238-246, with the slopes of F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304, as in
SciPy's `PchipInterpolator`.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._numerics import safe_divide, taken, wrapped

Method = Literal["linear", "cubic"]
METHODS = ("linear", "cubic")


class Pieces(NamedTuple):
    """Pieces of a curve between knots: where each begins, its width, the values at its two ends, and the slopes there
    (None for straight lines)."""

    start: Float[Array, " pieces"]
    width: Float[Array, " pieces"]
    low: Float[Array, " pieces"]
    high: Float[Array, " pieces"]
    slopes: tuple[Float[Array, " pieces"], Float[Array, " pieces"]] | None

    def at(self, piece: Array, x: Array) -> Array:
        """The value at `x` of the pieces with these numbers."""
        start, width, low, high = (taken(part, piece) for part in self[:4])
        t = safe_divide(x - start, width)
        if self.slopes is None:
            return low + t * (high - low)
        m0, m1 = (taken(part, piece) for part in self.slopes)
        rise = high - low
        c2, c3 = 3 * rise - width * (2 * m0 + m1), width * (m0 + m1) - 2 * rise
        return low + t * (width * m0 + t * (c2 + t * c3))


def interpolate(
    x: Array, knots: Float[Array, " knots"], values: Float[Array, " knots"], method: Method = "cubic"
) -> Array:
    """The value at `x`, of any shape, of a curve through `values` at the `knots`, which increase; at least two.

    "linear" joins the values by straight lines, "cubic" by a monotone cubic with a continuous first derivative. Beyond
    the first and the last knot the curve holds its end value. The derivative with respect to `x` at a knot is that of
    the piece that begins there.
    """
    slopes = None if method == "linear" else monotone_slopes(knots, values)
    parts = pieces_of(knots, values, slopes)
    inside = jnp.clip(x, knots[0], knots[-1])
    return parts.at(piece_number(inside, knots, knots.shape[0] - 1), inside)


def periodic_interpolate(
    x: Array,
    knots: Float[Array, " knots"],
    values: Float[Array, " knots"],
    period: Array | float,
    method: Method = "cubic",
) -> Array:
    """The same for a curve that repeats after `period`; the knots increase within one period, which the value at the
    first knot ends."""
    first = knots[0]
    ends, heights = closed_knots(knots, values, period)
    slopes = None if method == "linear" else periodic_slopes(knots, values, period)
    inside = first + wrapped(x - first, period)
    return pieces_of(ends, heights, slopes).at(piece_number(inside, ends, knots.shape[0]), inside)


def closed_knots(knots: Array, values: Array, period: Array | float) -> tuple[Array, Array]:
    """Knots and values of one period, with the first knot repeated at the end."""
    return jnp.concatenate([knots, (knots[0] + period)[None]]), jnp.concatenate([values, values[:1]])


def pieces_of(knots: Array, values: Array, slopes: Array | None) -> Pieces:
    """The pieces of a continuous curve, with its slopes at the knots (None for straight lines)."""
    ends = None if slopes is None else (slopes[:-1], slopes[1:])
    return Pieces(knots[:-1], knots[1:] - knots[:-1], values[:-1], values[1:], ends)


def piece_number(x: Array, knots: Array, pieces: int) -> Array:
    """The number of the piece that contains `x`; a knot belongs to the piece that begins there."""
    x = jnp.asarray(x)
    below = jnp.sum(x.ravel()[:, None] >= knots[None, 1:pieces], axis=1)
    return below.reshape(x.shape).astype(jnp.int32)


def monotone_slopes(knots: Float[Array, " knots"], values: Float[Array, " knots"]) -> Float[Array, " knots"]:
    """Slopes at the knots of the monotone cubic: between knots the weighted harmonic mean of the slopes of the two
    chords, zero at an extremum; at the ends the three-point formula, limited so that the curve stays monotone."""
    width = knots[1:] - knots[:-1]
    chord = (values[1:] - values[:-1]) / width
    if knots.shape[0] == 2:
        return jnp.concatenate([chord, chord])
    inner = _mean_slopes(width[:-1], width[1:], chord[:-1], chord[1:])
    ends = [_end_slope(width[i], width[j], chord[i], chord[j]) for i, j in ((0, 1), (-1, -2))]
    return jnp.concatenate([ends[0][None], inner, ends[1][None]])


def periodic_slopes(
    knots: Float[Array, " knots"], values: Float[Array, " knots"], period: Array | float
) -> Float[Array, " ends"]:
    """The same for a curve that repeats after `period`, with the slope at the first knot repeated at the end."""
    ends, heights = closed_knots(knots, values, period)
    width = ends[1:] - ends[:-1]
    chord = (heights[1:] - heights[:-1]) / width
    slopes = _mean_slopes(jnp.roll(width, 1), width, jnp.roll(chord, 1), chord)
    return jnp.concatenate([slopes, slopes[:1]])


def _mean_slopes(before: Array, after: Array, one: Array, two: Array) -> Array:
    """Slopes between two pieces, from their widths and the slopes of their chords."""
    w1, w2 = 2 * after + before, after + 2 * before
    mean = safe_divide((w1 + w2) * one * two, w1 * two + w2 * one)
    return jnp.where(one * two > 0, mean, 0.0)


def _end_slope(near: Array, next_: Array, one: Array, two: Array) -> Array:
    """The slope at an end, from the widths of the first two pieces there and the slopes of their chords."""
    slope = ((2 * near + next_) * one - near * two) / (near + next_)
    slope = jnp.where((jnp.sign(one) != jnp.sign(two)) & (jnp.abs(slope) > 3 * jnp.abs(one)), 3 * one, slope)
    return jnp.where(jnp.sign(slope) != jnp.sign(one), 0.0, slope)
