"""Shapes of the moves of a motion law: a rise from zero to one over the unit interval, with two derivatives.

Sources: R. L. Norton, Cam Design and Manufacturing Handbook, ch. 2-4; H. Dresig, I. I. Vul'fson, Dynamik der
Mechanismen, ch. 1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import sincos

PI = jnp.pi


class Rise(NamedTuple):
    """A function on the unit interval, and its first and second derivatives."""

    value: Array
    d: Array
    dd: Array


class Blend(NamedTuple):
    """A rise, and the polynomials that add a unit speed at the beginning and at the end."""

    rise: Rise
    first: Rise
    last: Rise


def _powers(u: Array, coefficients: dict[int, float]) -> Rise:
    """The polynomial with these coefficients by power."""
    terms = coefficients.items()
    value = sum((c * u**n for n, c in terms), jnp.zeros_like(u))
    d = sum((c * n * u ** (n - 1) for n, c in terms), jnp.zeros_like(u))
    dd = sum((c * n * (n - 1) * u ** (n - 2) for n, c in terms if n > 1), jnp.zeros_like(u))
    return Rise(value, d, dd)


def polynomial_345(u: Array) -> Blend:
    """The 3-4-5 polynomial: no acceleration at the ends."""
    return Blend(
        _powers(u, {3: 10.0, 4: -15.0, 5: 6.0}),
        _powers(u, {1: 1.0, 3: -6.0, 4: 8.0, 5: -3.0}),
        _powers(u, {3: -4.0, 4: 7.0, 5: -3.0}),
    )


def polynomial_4567(u: Array) -> Blend:
    """The 4-5-6-7 polynomial: neither acceleration nor jerk at the ends."""
    return Blend(
        _powers(u, {4: 35.0, 5: -84.0, 6: 70.0, 7: -20.0}),
        _powers(u, {1: 1.0, 4: -20.0, 5: 45.0, 6: -36.0, 7: 10.0}),
        _powers(u, {4: -15.0, 5: 39.0, 6: -34.0, 7: 10.0}),
    )


def cycloidal(u: Array) -> Rise:
    """Cycloidal motion: the acceleration is a sine."""
    sine, cosine = sincos(2 * PI * u)
    return Rise(u - sine / (2 * PI), 1 - cosine, 2 * PI * sine)


def modified_sine(u: Array) -> Rise:
    """Modified sine: an eighth of a fast sine, three quarters of a slow one, and an eighth of the fast one."""
    w, mirrored = _half(u)
    top = 4 * PI**2 / (PI + 4)
    begin, v = _begin(w, top), top / (4 * PI)
    sine, cosine = sincos(4 * PI / 3 * (w - 0.125))
    middle = Rise(
        v * (0.125 - 1 / (4 * PI)) + v * (w - 0.125) + 9 * top / (16 * PI**2) * (1 - cosine),
        v * (1 + 3 * sine),
        top * cosine,
    )
    return mirrored(_chosen(w <= 0.125, begin, middle))


def modified_trapezoid(u: Array) -> Rise:
    """Modified trapezoidal acceleration: constant for a quarter on both sides, with eighths of a sine between."""
    w, mirrored = _half(u)
    top = 8 * PI / (PI + 2)
    begin, v = _begin(w, top), top / (4 * PI)
    first, x = v * (0.125 - 1 / (4 * PI)), w - 0.125
    middle = Rise(first + x * (v + 0.5 * top * x), v + top * x, jnp.full_like(w, top))
    sine, cosine = sincos(4 * PI * (w - 0.375))
    second = first + 0.25 * (v + 0.125 * top)
    last = Rise(
        second + (v + 0.25 * top) * (w - 0.375) + top / (16 * PI**2) * (1 - cosine),
        v * (1 + sine) + 0.25 * top,
        top * cosine,
    )
    return mirrored(_chosen(w <= 0.125, begin, _chosen(w <= 0.375, middle, last)))


def trapezoidal(u: Array, ramp: Array) -> Rise:
    """Trapezoidal speed: constant acceleration in the first part `ramp`, constant speed, constant deceleration."""
    w, mirrored = _half(u)
    v = 1 / (1 - ramp)
    a = v / ramp
    begin = Rise(0.5 * a * w**2, a * w, jnp.broadcast_to(a, jnp.shape(w)))
    middle = Rise(v * (w - 0.5 * ramp), jnp.broadcast_to(v, jnp.shape(w)), jnp.zeros_like(w))
    return mirrored(_chosen(w < ramp, begin, middle))


def _half(u: Array) -> tuple[Array, Callable[[Rise], Rise]]:
    """The place in the first half, and what makes the whole of a first half: f(1 - u) = 1 - f(u)."""
    early = u < 0.5
    w = jnp.where(early, u, 1 - u)

    def mirrored(half: Rise) -> Rise:
        return Rise(jnp.where(early, half.value, 1 - half.value), half.d, jnp.where(early, half.dd, -half.dd))

    return w, mirrored


def _begin(w: Array, top: float) -> Rise:
    """An eighth in which the acceleration rises to `top` as a sine."""
    sine, cosine = sincos(4 * PI * w)
    v = top / (4 * PI)
    return Rise(v * (w - sine / (4 * PI)), v * (1 - cosine), top * sine)


def _chosen(where: Array, one: Rise, other: Rise) -> Rise:
    return Rise(*(jnp.where(where, a, b) for a, b in zip(one, other, strict=True)))
