"""Friction in joints, from the reactions that it changes itself.

Friction of size s(R) in every joint acts against the relative motion, whose direction follows from kinematics.
Reactions R are linear in all couples and forces, so R = R₀ + M c with the frictions c, and c = -σ s(R₀ + M c) is a
small equation with one unknown for every joint. At its solution the determinant of I + σ s' M is positive where it
continues the solution without friction; it is zero where the machine locks. Source: the textbook's method of successive
approximation, by Newton's method; Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 11.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from linkjax._numerics import safe_divide
from linkjax.friction import AbstractFriction

STEPS = 40  # the most steps of Newton's method
SMALL = 1e-13  # relative: a step of Newton's method as small as this is that of a solution
MORE = 2  # steps of which the size is small
NEAR = 1e-6  # relative: a last step that found a solution; close to locking rounding errors are as large


Transmitted = tuple[Array, Array, Array]  # forces fx and fy (N) and moments (N m), each of shape (joints,)
Reactions = Callable[[Array, Array], Transmitted]  # of the frictions, shape (joints,), and the acceleration


class JointFriction(NamedTuple):
    """Friction of a joint: the couple (N m) of a pin or the force (N) of a guide, along the relative motion and thus
    negative; the relative speed of the two links at unit crank speed (rad or m per rad); and numbers at whose zeros
    friction has a kink, as the normal force of a guide (see `AbstractFriction.switches`); and, of a pin, the square of
    the force (N²), near whose zeros in the complex plane friction is hardly smooth."""

    value: Array
    speed: Array
    switches: tuple[Array, ...]
    square: Array | None


class Rubbed(NamedTuple):
    """Frictions of all joints: couples (N m) and forces (N), positive where those on the link are; the acceleration of
    the crank (rad/s²); whether they are a solution that continues that without friction; and what the joints transmit
    beside it, forces fx and fy (N) and moments (N m)."""

    values: Float[Array, " joints"]
    acceleration: Array
    found: Bool[Array, ""]
    loads: Transmitted


def linear(reactions: Reactions, joints: int) -> Reactions:
    """Linear reactions, from their values for unit frictions and a unit acceleration."""
    none, still = jnp.zeros(joints), jnp.zeros(())
    first, push = jax.linearize(reactions, none, still)
    by_each = jax.vmap(lambda c: push(c, still))(jnp.eye(joints))
    return combined(first, by_each, push(none, jnp.ones_like(still)))


def combined(first: Transmitted, by_each: Transmitted, by_rate: Transmitted) -> Reactions:
    """Linear reactions: without friction and acceleration, of unit frictions (joints, joints), and of a unit
    acceleration."""

    def given(c: Array, rate: Array) -> Transmitted:
        fx, fy, moment = (a + c @ b + rate * d for a, b, d in zip(first, by_each, by_rate, strict=True))
        return fx, fy, moment

    return given


def rubbed(
    frictions: Sequence[AbstractFriction],
    senses: Array,
    paces: Array,
    reactions: Reactions,
    advance: Callable[[Array], Array],
    factor: Any = 1.0,
    way: Any = 1.0,
) -> Rubbed:
    """The frictions, all of them times a `factor`, and the acceleration with which the `reactions` are those that cause
    the frictions, and the acceleration is that which the torque of friction, reduced to the crank, leaves: `advance`.
    `senses` are those of the relative motions, and `paces` their speeds at unit crank speed, shape (joints,); with the
    `way` -1 the crank turns back."""
    paces = senses * paces

    def left(state: Array) -> Array:
        c, rate = state[:-1], state[-1]
        there = reactions(c, rate)
        sizes = [each.size(*(part[i] for part in there)) for i, each in enumerate(frictions)]
        return jnp.append(c + factor * way * senses * jnp.stack(sizes), rate - advance(paces @ c))

    def solve(left: Callable[[Array], Array], begin: Array) -> tuple[Array, Array]:
        def again(loop: tuple) -> tuple:
            count, state, *_ = loop
            move, sign = eliminated(jax.jacfwd(left)(state), -left(state))
            new, part = state + move, jnp.arange(state.size) < senses.size
            sizes = jnp.where(part, jnp.max(jnp.abs(new[:-1])), jnp.abs(new[-1]))
            last = jnp.max(safe_divide(jnp.abs(move), sizes))
            return count + 1, new, last, sign, loop[4] - jnp.where(last > SMALL, 0, 1)

        loop = jnp.zeros((), jnp.int32), begin, *(jnp.ones_like(begin[0]),) * 2, jnp.asarray(MORE, jnp.int32)
        _, state, last, sign, _ = jax.lax.while_loop(lambda s: (s[4] > 0) & (s[0] < STEPS), again, loop)
        found = (last < NEAR) & (sign > 0)
        return jnp.where(found, state, begin), jnp.where(found, 1.0, 0.0)  # numbers: `custom_root` has no others

    def tangent(linear: Callable[[Array], Array], right: Array) -> Array:
        return eliminated(jax.jacfwd(linear)(jnp.zeros_like(right)), right)[0]

    begin = jax.lax.stop_gradient(jnp.append(jnp.zeros_like(senses), advance(jnp.zeros_like(senses[0]))))
    state, found = jax.lax.custom_root(left, begin, solve, tangent, has_aux=True)
    return Rubbed(state[:-1], state[-1], found > 0, reactions(state[:-1], state[-1]))


def eliminated(a: Array, b: Array) -> tuple[Array, Array]:
    """x of a x = b for one small matrix, and the sign of its determinant, by Gauss and Jordan without pivoting: the
    matrix is close to the unit matrix, unless the machine is close to locking."""
    sign = jnp.ones_like(a[0, 0])
    for k in range(b.size):
        pivot, factor, own = a[k, k], a[:, k], np.arange(b.size) == k
        pivot = jnp.where(pivot == 0, jnp.finfo(a.dtype).tiny ** 0.25, pivot)
        row, right = a[k] / pivot, b[k] / pivot  # apart: b may be a tangent, and a is not
        a = jnp.where(own[:, None], row[None], a - factor[:, None] * row[None])
        b = jnp.where(own, right, b - factor * right)
        sign = sign * jnp.sign(pivot)
    return b, sign
