"""Gradient-safe primitives. The rule: replace the operand first, operate, then select."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array


def safe_sqrt(x: Array, instead: Array | float = 0.0) -> Array:
    """Square root of `x` where positive, else `instead` with a zero derivative; NaN stays NaN."""
    none = x <= 0
    return jnp.where(none, instead, jnp.sqrt(jnp.where(none, 1.0, x)))


def safe_divide(a: Array, b: Array, instead: Array | float = 0.0) -> Array:
    """`a / b` where `b` is not zero, else `instead` with a zero derivative."""
    ok = b != 0
    return jnp.where(ok, a / jnp.where(ok, b, 1.0), instead)


def wrapped(x: Array, period: Array | float) -> Array:
    """`x` modulo `period`, in [0, period). Arithmetic only, since the library function does not vectorise."""
    rest = x - period * jnp.floor(x / period)
    return jnp.where(rest >= period, rest - period, jnp.where(rest < 0, rest + period, rest))


def nearest_turn(angle: Array, period: Array | float) -> Array:
    """`angle` minus whole periods, within half a period of zero."""
    return angle - period * jnp.round(angle / period)


def taken(values: Array, numbers: Any) -> Array:
    """`values[numbers]` along the first axis, for numbers that are in bounds: shorter in a program than indexing."""
    return values.at[numbers].get(mode="promise_in_bounds", wrap_negative_indices=False)


def highest(values: Array) -> Array:
    """True at the largest value (and at any that equals it to rounding).

    Not `values == max(values)`: XLA may compute the two sides separately and round them differently.
    """
    top = jnp.max(values)
    return values >= top - 50 * jnp.finfo(values.dtype).eps * jnp.abs(top)


def largest(values: Array) -> Array:
    """The largest of some values, with the derivative of one largest entry.

    Not `jnp.max`: its derivative divides by the number of entries that equal the largest. If XLA rounds these
    differently from those compared before, that number is zero and the derivative NaN.
    """
    return values.ravel()[jnp.argmax(jax.lax.stop_gradient(values))]


def smallest(values: Array) -> Array:
    """The smallest of some values, with the derivative of one smallest entry."""
    return values.ravel()[jnp.argmin(jax.lax.stop_gradient(values))]


def root(function: Callable[[Array], Array], start: Array, solve: Callable) -> Array:
    """Scalar root of `function`, found by `solve(function, start)`, differentiated implicitly.

    Forward, reverse and nested derivatives all follow from the implicit function theorem
    (`jax.lax.custom_root`). Where the slope at the root is zero the derivative is zero, not NaN.
    """

    def tangent_solve(linear, value):
        return safe_divide(value, linear(jnp.ones_like(value)))

    return jax.lax.custom_root(function, start, solve, tangent_solve)


def stepped(times: int, body: Callable, state, rolled: bool):
    """`times` rounds of `body(i, state)`: in a loop if `rolled`, which compiles sooner, otherwise one by one, which
    runs faster in large batches."""
    if rolled:
        return jax.lax.fori_loop(0, times, body, state)
    for i in range(times):
        state = body(i, state)
    return state


def repeat(times: int, body: Callable, state):
    """`times` rounds of `body(i, state)`, in a loop, so that the body is compiled once; no loop for a single round."""
    return body(0, state) if times == 1 else jax.lax.fori_loop(0, times, body, state)


@jax.custom_jvp
def envelope(at: Array, moves: Array) -> Array:
    """`at + moves`, an argument of a stationary function: the derivative with respect to `at` is dropped.

    At an interior extremum the first derivative of the extreme value does not depend on the shift of the extremum
    (envelope theorem), so no derivative need pass through its search. `moves` is numerically zero and carries the
    derivative of an extremum on a moving edge.
    """
    return at + moves


@envelope.defjvp
def _envelope_jvp(primals, tangents):
    at, moves = primals
    return at + moves, tangents[1]  # a plain sum, so that second derivatives include the shift of `at`


@jax.custom_jvp
def once(x: Array) -> Array:
    """`x` unchanged, but computed once.

    XLA's CPU fusion repeats cheap arithmetic, and even sines, in every consumer; it never repeats a division. Dividing
    by a 1 that the compiler cannot simplify costs one division and prevents the repetition (measured: factor 5).
    """
    return x / (1.0 + 0.0 * x)


@once.defjvp
def _once_jvp(primals, tangents):
    return once(primals[0]), tangents[0]


@jax.custom_jvp
def sincos(x: Array) -> tuple[Array, Array]:
    """Sine and cosine of `x`, |x| below 1e5, to the last digit or two. Arithmetic only, so that it vectorises.

    XLA calls the C library for every float64 sine on a CPU, a quarter of the time of a whole kinematic analysis.
    Reduction by multiples of π/2 in three parts and the polynomials of fdlibm (Sun Microsystems, 1993).
    """
    quarter = jax.lax.stop_gradient(jnp.round(x * (2 / jnp.pi)))
    r = ((x - quarter * PIO2[0]) - quarter * PIO2[1]) - quarter * PIO2[2]
    z = r * r
    sine = r + r * z * _horner(SIN, z)
    cosine = 1.0 - (0.5 * z - z * z * _horner(COS, z))
    m = quarter - 4 * jnp.floor(0.25 * quarter)  # quadrant 0…3
    odd = (m == 1) | (m == 3)
    sine, cosine = jnp.where(odd, cosine, sine), jnp.where(odd, sine, cosine)
    return jnp.where(m >= 2, -sine, sine), jnp.where((m == 1) | (m == 2), -cosine, cosine)


@sincos.defjvp
def _sincos_jvp(primals, tangents):
    sine, cosine = sincos(primals[0])
    return (sine, cosine), (cosine * tangents[0], -sine * tangents[0])


def _horner(coefficients: tuple[float, ...], z: Array) -> Array:
    value = jnp.full_like(z, coefficients[-1])
    for c in coefficients[-2::-1]:
        value = value * z + c
    return value


PIO2 = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
SIN = (-1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
       2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10)  # fmt: skip
COS = (4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
       -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11)  # fmt: skip
