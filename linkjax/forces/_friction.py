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

STEPS, FEWER = 40, 8  # the most steps of Newton's method: for all friction, and for a part of it on the way there
LONGER, SHORTER = 1.5, 0.3  # the next part of friction after a solution, and without one
LEAST, ROUGH = 1e-9, 1e-2  # the least part: where it is smaller the machine locks; and in the search for a motion
CLOSER = 0.01  # of a step of Newton's method: a longer next one may lead to another solution
JUMP = 0.01  # relative: another solution is farther away
SMALL = 1e-10  # relative: after a step of Newton's method as small as this the next one has all digits
MORE = 2  # steps of which the size is small
NEARER = 0.1  # relative: a single step that leads nearer to a solution
NEAR, ROUNDINGS = 1e-6, 1e2  # relative, or roundings: a last step that found a solution
SPECK = 1e-6  # of the largest: a step is not measured by anything smaller


Transmitted = tuple[Array, Array, Array]  # forces fx and fy (N) and moments (N m), each of shape (joints,)
Reactions = Callable[[Array, Array], Transmitted]  # of the frictions, shape (joints,), and the acceleration
Advance = Callable[[Array], Array]  # of the torque of friction reduced to the crank (N m): the acceleration (rad/s²)


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


class Linear(NamedTuple):
    """Linear reactions (fx, fy, moment) of joints with friction at places, whose axes come last: without friction and
    acceleration, shape (joints, *places); of unit frictions, shape (joints, joints with the friction, *places); and of
    a unit acceleration."""

    first: Transmitted
    own: Transmitted
    rate: Transmitted

    def __call__(self, c: Array, rate: Array) -> Transmitted:
        """What the joints transmit beside their frictions `c`, at an acceleration (rad/s²)."""
        fx, fy, moment = (
            sum((c[j][None] * b[:, j] for j in range(c.shape[0])), a + rate[None] * d)
            for a, b, d in zip(self.first, self.own, self.rate, strict=True)
        )
        return fx, fy, moment


def linear(reactions: Reactions, joints: int) -> Linear:
    """Linear reactions, from their values for unit frictions and a unit acceleration."""
    none, still = jnp.zeros(joints), jnp.zeros(())
    first, push = jax.linearize(reactions, none, still)
    by_each = jax.vmap(lambda c: push(c, still), out_axes=1)(jnp.eye(joints))
    return Linear(first, by_each, push(none, jnp.ones_like(still)))


class Contacts(NamedTuple):
    """Joints with friction at places, whose axes come last: frictions; senses of the relative motions, and their speeds
    at unit crank speed (rad or m per rad; with these signs), shape (joints, *places); and their reactions."""

    frictions: tuple[AbstractFriction, ...]
    senses: Array
    paces: Array
    reactions: Linear

    def sizes(self, loads: Transmitted) -> Array:
        """Sizes of the frictions."""
        return jnp.stack([each.size(*(part[i] for part in loads)) for i, each in enumerate(self.frictions)])

    def slopes(self, loads: Transmitted) -> Transmitted:
        """Derivatives of the sizes with respect to the forces and moments of the own joint."""
        found = []
        for i, each in enumerate(self.frictions):
            size, back = jax.vjp(each.size, *(part[i] for part in loads))
            found.append(back(jnp.ones_like(size)))
        fx, fy, moment = (jnp.stack(part) for part in zip(*found, strict=True))
        return fx, fy, moment

    def torque(self, c: Array) -> Array:
        """The torque of friction reduced to the crank (N m)."""
        return sum((p * each for p, each in zip(self.paces, c, strict=True)), jnp.zeros_like(c[0]))

    def left(self, advance: Advance, c: Array, rate: Array) -> tuple[Array, Array]:
        """What is left of the equations."""
        return c + self.senses * self.sizes(self.reactions(c, rate)), rate - advance(self.torque(c))

    def unique(self, advance: Advance) -> Array:
        """Whether there cannot be more than one solution. Sizes are seminorms beside a constant, so that frictions
        change them by no more than those of the reactions that they cause themselves; if the matrix A of these has a
        spectral radius below one, the frictions follow from a contraction. So it is if I - A takes positive numbers to
        ones. Source: Berman and Plemmons, Nonnegative Matrices in the Mathematical Sciences, 1994, ch. 6."""
        zero = jnp.zeros_like(self.paces)
        gain = jax.jvp(advance, (zero[0],), (jnp.ones_like(zero[0]),))[1][None] * self.paces
        fx, fy, m = (
            own + rate[:, None] * gain[None] for own, rate in zip(self.reactions.own, self.reactions.rate, strict=True)
        )
        matrix = jnp.abs(self.senses)[:, None] * (self.sizes((fx, fy, m)) - self.sizes((zero, zero, zero))[:, None])
        unit = jnp.eye(zero.shape[0]).reshape((*matrix.shape[:2], *(1,) * zero[0].ndim))
        return jnp.all(eliminated(unit - matrix, jnp.ones_like(zero))[0] > 0, axis=0)

    def part(self, of: Array) -> Contacts:
        """With so much of all friction: the senses times this number."""
        return self._replace(senses=self.senses * of[None])

    def moved(self, advance: Advance, c: Array, rate: Array, left: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """The change of c and of the acceleration that makes up for what is `left` of the linear equations, and the
        sign of their determinant."""
        slopes = self.slopes(self.reactions(c, rate))
        matrix = self.senses[:, None] * sum(s[:, None] * b for s, b in zip(slopes, self.reactions.own, strict=True))
        by_rate = self.senses * sum(s * b for s, b in zip(slopes, self.reactions.rate, strict=True))
        gain = jax.jvp(advance, (self.torque(c),), (jnp.ones_like(rate),))[1]
        unit = np.eye(c.shape[0]).reshape((*matrix.shape[:2], *(1,) * rate.ndim))
        matrix = unit + matrix + by_rate[:, None] * (gain[None] * self.paces)[None]
        move, sign = eliminated(matrix, by_rate * left[1][None] - left[0])
        return move, gain * self.torque(move) - left[1], sign


class Frictions(NamedTuple):
    """Frictions (N m or N), shape (joints, *places); the acceleration of the crank (rad/s²); and whether they are a
    solution that continues that without friction."""

    values: Array
    rate: Array
    found: Array


@jax.custom_jvp
def _step(contacts: Contacts, advance: Advance, near: tuple[Array, Array]) -> tuple[Array, Array]:
    """One step of Newton's method, with the derivatives of its linear equations."""
    move, more, _ = contacts.moved(advance, *near, contacts.left(advance, *near))
    return near[0] + move, near[1] + more


@_step.defjvp
def _step_rule(given: tuple, moving: tuple) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    contacts, advance, near = given
    left, push = jax.jvp(lambda at, ahead: at.left(ahead, *near), (contacts, advance), moving[:2])
    move, more, _ = contacts.moved(advance, *near, left)
    return (near[0] + move, near[1] + more), contacts.moved(advance, *near, push)[:2]


def specks(near: tuple[Array, Array]) -> tuple[Array, Array]:
    """Sizes of frictions and of the acceleration, a small part of the largest at all places, below which a step of
    Newton's method need not be smaller still: see `frictions_of`."""
    eps = float(jnp.finfo(near[1].dtype).eps)
    part = max(SPECK, 10 * eps / max(NEAR, ROUNDINGS * eps))
    most = [jnp.max(jnp.where(jnp.isfinite(each), jnp.abs(each), 0.0)) for each in near]
    return part * most[0], part * most[1]


def frictions_of(
    contacts: Contacts, advance: Advance, near: tuple[Array, Array] | None = None, linearised: bool = False,
    least: tuple[Array, Array] | None = None,
) -> Frictions:  # fmt: skip
    """The frictions that follow from the reactions that they change, with the acceleration that the torque of friction
    leaves: `advance`, a pytree. With frictions and an acceleration `near` it takes one step of Newton's method from
    there, and keeps these where that leads far away; otherwise it takes as many steps as it needs. A step is measured
    by what it leads to, or by `least` where that is larger: where all forces vanish rounding is not small. Where one is
    `linearised`, derivatives are those of its linear equations: so a search that has other unknowns as well takes one
    step for all."""
    if near is not None and linearised:
        c, rate = _step(contacts, advance, jax.lax.stop_gradient(near))
        return Frictions(c, rate, jnp.ones_like(rate, bool))
    at, ahead = jax.lax.stop_gradient((contacts, advance))

    def step(c: Array, rate: Array, part: Array) -> tuple[Array, Array, Array, Array]:
        some = at.part(part)
        move, more, sign = some.moved(ahead, c, rate, some.left(ahead, c, rate))
        c, rate = c + move, rate + more
        sizes = jnp.max(jnp.abs(c), axis=0), jnp.abs(rate)
        if least is not None:
            sizes = jax.tree.map(jnp.maximum, sizes, least)
        last = jnp.max(safe_divide(jnp.abs(move), sizes[0][None] * jnp.ones_like(c)), axis=0)
        return c, rate, jnp.maximum(last, safe_divide(jnp.abs(more), sizes[1])), sign

    if near is not None:
        c, rate, last, sign = step(*near, jnp.ones_like(near[1]))
        nearer = (last < NEARER) & (sign > 0)
        state = jnp.where(nearer[None], c, near[0]), jnp.where(nearer, rate, near[1])
        return Frictions(*_implicit(contacts, advance, jax.lax.stop_gradient(state)), is_last(last) & (sign > 0))

    none = jnp.zeros_like(at.senses)
    found, *state = continued(step, none, ahead(at.torque(none)), at.unique(ahead), ROUGH if linearised else LEAST)
    return Frictions(*_implicit(contacts, advance, (state[0], state[1])), found)


class _Search(NamedTuple):
    """The part of all friction that was reached with its frictions and acceleration, and the next part to add; and for
    the sum of both the steps of Newton's method so far, the small ones that are still wanted, the size of the last one,
    whether one was hardly shorter than the one before, and where they are."""

    reached: Array
    kept: tuple[Array, Array]
    more: Array
    steps: Array
    spare: Array
    last: Array
    slow: Array
    here: tuple[Array, Array]


def is_last(step: Array) -> Array:
    """Whether a step of Newton's method of this relative size found a solution."""
    return step < max(NEAR, ROUNDINGS * float(jnp.finfo(step.dtype).eps))


def continued(
    step: Callable[[Array, Array, Array], tuple[Array, Array, Array, Array]], none: Array, free: Array, unique: Array,
    least: float = LEAST,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """By continuation: whether there are frictions and an acceleration that continue those without friction, `none` and
    `free`, and these; where there are none, those without friction. Newton's method tries all friction at once; where
    it finds nothing, a part of it, and from there a larger part. A solution far away to which the steps were not soon
    short may be another one, beyond the place where the machine locks: it does not count, unless solutions are
    `unique`. `step` takes one step with a part of friction, and gives the relative change and the sign of the
    determinant as well. Source: Deuflhard, Newton Methods for Nonlinear Problems, 2004, ch. 5."""

    def going(now: _Search) -> Array:
        return (now.reached < 1) & (now.more > least)

    def again(now: _Search) -> _Search:
        part = jnp.minimum(now.reached + now.more, 1.0)
        c, rate, last, sign = step(*now.here, part)
        steps, spare = now.steps + 1, now.spare - jnp.where(last > SMALL, 0, 1).astype(now.spare.dtype)
        ends = going(now) & ((spare <= 0) | (steps >= jnp.where(part < 1, FEWER, STEPS)))
        slow = now.slow | ((last > CLOSER * now.last) & ~is_last(last))
        far = jnp.max(jnp.abs(c - now.kept[0]), axis=0) > JUMP * jnp.max(jnp.abs(c), axis=0)
        good = ends & is_last(last) & (sign > 0) & (unique | ~(slow & far))
        kept = jnp.where(good[None], c, now.kept[0]), jnp.where(good, rate, now.kept[1])
        here = jnp.where(ends[None], kept[0], c), jnp.where(ends, kept[1], rate)
        more = now.more * jnp.where(good, LONGER, jnp.where(ends, SHORTER, 1.0))
        reached = jnp.where(good, part, now.reached)
        steps, spare = jnp.where(ends, 0, steps), jnp.where(ends, MORE, spare)
        return _Search(reached, kept, more, steps, spare, jnp.where(ends, jnp.inf, last), slow & ~ends, here)

    zero = jnp.zeros_like(free)
    number = zero.astype(jnp.int32)
    begin = _Search(zero, (none, free), zero + 1, number, number + MORE, zero + jnp.inf, zero > 0, (none, free))
    end = jax.lax.while_loop(lambda now: jnp.any(going(now)), again, begin)
    found = end.reached >= 1
    return found, jnp.where(found[None], end.kept[0], none), jnp.where(found, end.kept[1], free)


@jax.custom_jvp
def _implicit(contacts: Contacts, advance: Advance, state: tuple[Array, Array]) -> tuple[Array, Array]:
    """A solution with its derivatives, of any order."""
    return state


@_implicit.defjvp
def _rule(given: tuple, moving: tuple) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    contacts, advance, _ = given
    state = _implicit(*given)
    push = jax.jvp(lambda at, ahead: at.left(ahead, *state), (contacts, advance), moving[:2])[1]
    return state, contacts.moved(advance, *state, push)[:2]


def rubbed(
    frictions: Sequence[AbstractFriction],
    senses: Array,
    paces: Array,
    reactions: Reactions,
    advance: Callable[[Array], Array],
    way: Any = 1.0,
) -> Rubbed:
    """The frictions and the acceleration with which the `reactions` are those that cause the frictions, and the
    acceleration is that which the torque of friction, reduced to the crank, leaves: `advance`. `senses` are those of
    the relative motions, and `paces` their speeds at unit crank speed, shape (joints,); with the `way` -1 the crank
    turns back."""
    paces = senses * paces
    if isinstance(reactions, Linear):
        contacts = Contacts(tuple(frictions), way * senses, paces, reactions)
        given, contained = jax.closure_convert(advance, paces[0])
        tree = jax.tree_util.Partial(lambda contained, torque: given(torque, *contained), contained)
        found = frictions_of(contacts, tree)
        return Rubbed(found.values, found.rate, found.found, reactions(found.values, found.rate))

    def left(state: Array) -> Array:
        c, rate = state[:-1], state[-1]
        there = reactions(c, rate)
        sizes = [each.size(*(part[i] for part in there)) for i, each in enumerate(frictions)]
        return jnp.append(c + way * senses * jnp.stack(sizes), rate - advance(paces @ c))

    def solve(left: Callable[[Array], Array], begin: Array) -> tuple[Array, Array]:
        def step(c: Array, rate: Array, part: Array) -> tuple[Array, Array, Array, Array]:
            state, parts = jnp.append(c, rate), jnp.append(jnp.full_like(c, part), jnp.ones_like(rate))

            def some(state: Array) -> Array:
                return state + parts * (left(state) - state)

            move, sign = eliminated(jax.jacfwd(some)(state), -some(state))
            new = state + move
            sizes = jnp.append(jnp.full_like(c, jnp.max(jnp.abs(new[:-1]))), jnp.abs(new[-1]))
            return new[:-1], new[-1], jnp.max(safe_divide(jnp.abs(move), sizes)), sign

        found, c, rate = continued(step, begin[:-1], begin[-1], jnp.zeros((), bool))
        return jnp.append(c, rate), jnp.where(found, 1.0, 0.0)  # numbers: `custom_root` has no others

    def tangent(linear: Callable[[Array], Array], right: Array) -> Array:
        return eliminated(jax.jacfwd(linear)(jnp.zeros_like(right)), right)[0]

    begin = jax.lax.stop_gradient(jnp.append(jnp.zeros_like(senses), advance(jnp.zeros_like(senses[0]))))
    state, found = jax.lax.custom_root(left, begin, solve, tangent, has_aux=True)
    return Rubbed(state[:-1], state[-1], found > 0, reactions(state[:-1], state[-1]))


def eliminated(a: Array, b: Array) -> tuple[Array, Array]:
    """x of a x = b for small matrices, whose axes come first, and the signs of their determinants, by Gauss and Jordan
    without pivoting: the matrix is close to the unit matrix, unless the machine is close to locking."""
    sign = jnp.ones_like(a[0, 0])
    for k in range(b.shape[0]):
        pivot, factor = a[k, k], a[:, k]
        own = (np.arange(b.shape[0]) == k).reshape((-1, *(1,) * sign.ndim))
        pivot = jnp.where(pivot == 0, jnp.finfo(a.dtype).tiny ** 0.25, pivot)
        row, right = a[k] / pivot[None], b[k] / pivot  # apart: b may be a tangent, and a is not
        a = jnp.where(own[:, None], row[None], a - factor[:, None] * row[None])
        b = jnp.where(own, right[None], b - factor * right[None])
        sign = sign * jnp.sign(pivot)
    return b, sign
