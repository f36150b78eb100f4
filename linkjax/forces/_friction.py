"""Friction in joints, from the reactions that it changes itself.

Friction of size s(R) in every joint acts against the relative motion, whose direction follows from kinematics.
Reactions R are linear in all couples and forces, so R = R₀ + M c with the frictions c, and c = -σ s(R₀ + M c) is a
small equation with one unknown for every joint. At its solution the determinant of I + σ s' M is positive where it
continues the solution without friction; it is zero where the machine locks. Source: the textbook's method of successive
approximation, by Newton's method; Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 11.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from linkjax import _lapack
from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._vec import Vec, zero
from linkjax.friction import AbstractFriction
from linkjax.groups import FRAME, Joint, Wrench
from linkjax.kinematics import Pose
from linkjax.loads import Instant
from linkjax.mechanism import Mechanism

NEAR = 1e-5  # rad: closer to a reversal than this, the direction of motion is that on the requested side
STILL = 1e-12  # relative to the crank: a slower joint does not move
STEPS = 40  # the most steps of Newton's method
EXACT = 2  # steps with derivatives after it, for the first and second ones
SMALL = 1e-13  # relative: the last step of Newton's method


class Rubbing(NamedTuple):
    """A joint with friction: which one, the other link, its friction, and how it moves at unit crank speed: direction
    of the relative motion (a unit vector in a guide, None in a pin), its sense (1, -1, or zero where there is none) and
    speed (rad or m per rad)."""

    joint: Joint
    by: str
    friction: AbstractFriction
    axis: Vec | None
    sense: Array
    speed: Array

    def wrench(self, size: Array) -> tuple[Vec, Array]:
        """Force and couple on the link of this size, positive along the motion."""
        return (zero(), size) if self.axis is None else (self.axis * size, jnp.zeros_like(size))

    def add(self, acting: dict[str, Wrench], here: Pose, origins: dict[str, str], size: Array) -> tuple[Vec, Array]:
        """Add it on the link, and its opposite on the other; returns `wrench`."""
        force, couple = self.wrench(size)
        for link, sign in ((self.joint.link, 1.0), (self.by, -1.0)):
            if link != FRAME:
                arm = here.points[self.joint.point].r - here.points[origins[link]].r
                moment = acting[link].moment + sign * (couple + arm.cross(force))
                acting[link] = Wrench(acting[link].force + force * sign, moment)
        return force, couple


class JointFriction(NamedTuple):
    """Friction of a joint: the couple (N m) of a pin or the force (N) of a guide, along the relative motion and thus
    negative, and the relative speed of the two links at unit crank speed (rad or m per rad)."""

    value: Array
    speed: Array


class Rubbed(NamedTuple):
    """Frictions of all joints: couples (N m) and forces (N) along the relative motion, negative, and whether they are a
    solution that continues that without friction."""

    values: Float[Array, " joints"]
    found: Bool[Array, ""]


def rubbing(mechanism: Mechanism, friction: tuple[AbstractFriction, ...], here: Pose, at: Instant) -> list[Rubbing]:
    """The joints with friction, and how they move; a sense at a reversal is that on the side of `at`."""
    by_joint, owners, found = {each.joint: each for each in friction}, mechanism.owners(), []
    ahead = jnp.where(at.side >= at.phi, 1.0, -1.0)
    for group in mechanism.groups:
        for joint in group.joints():
            if joint.name in by_joint and (joint.pins or joint.slides):
                by = joint.by or owners[joint.point]
                way = _slides if joint.slides else _turns
                found.append(Rubbing(joint, by, by_joint[joint.name], *way(mechanism, joint, by, here, ahead)))
    return found


def _turns(_: Mechanism, joint: Joint, by: str, here: Pose, ahead: Array) -> tuple[None, Array, Array]:
    one = here.links[joint.link]
    w, e = (one.w, one.e) if by == FRAME else (one.w - here.links[by].w, one.e - here.links[by].e)
    near = jnp.abs(w) <= NEAR * jnp.abs(e)
    nudged = jnp.where(near, w + ahead * NEAR * e, w)
    return None, jnp.where(jnp.abs(nudged) > STILL, jnp.sign(nudged), 0.0), jnp.abs(w)


def _slides(mechanism: Mechanism, joint: Joint, by: str, here: Pose, ahead: Array) -> tuple[Vec, Array, Array]:
    p = here.points[joint.point]
    v, a = p.dr, p.ddr
    if by != FRAME:  # less the coincident point of the other link
        other, base = here.links[by], here.points[mechanism.origins()[by]]
        arm, apart = p.r - base.r, p.dr - base.dr
        v = apart - arm.perp() * other.w
        a = p.ddr - base.ddr - arm.perp() * other.e - apart.perp() * other.w
    near = v.squared() <= NEAR * NEAR * a.squared()
    nudge = jnp.where(near, ahead * NEAR, 0.0)
    way = Vec(v.x + nudge * a.x, v.y + nudge * a.y)
    size = safe_sqrt(way.squared())
    moves = size > 0
    return way * safe_divide(jnp.ones_like(size), size), jnp.where(moves, 1.0, 0.0), safe_sqrt(v.squared())


def rubbed(
    joints: list[Rubbing], reactions: Callable[[Array], tuple[Array, Array, Array]], factor: Any = 1.0
) -> Rubbed:
    """The frictions with which the `reactions` (forces fx, fy and moments, each of shape (joints,)) are those that
    cause them; all times a `factor`."""
    senses = jnp.stack([each.sense for each in joints]) * factor
    none = jnp.zeros_like(senses)
    first, push = jax.linearize(reactions, none)
    by_each = jax.vmap(push)(jnp.eye(none.size, dtype=none.dtype))

    def left(c: Array) -> Array:
        there = [start + c @ part for start, part in zip(first, by_each, strict=True)]
        sizes = [each.friction.size(*(part[i] for part in there)) for i, each in enumerate(joints)]
        return c + senses * jnp.stack(sizes)

    def step(c: Array) -> Array:
        return -_lapack.solve(jax.jacfwd(left)(c), left(c))

    def again(state: tuple) -> tuple:
        count, c, _ = state
        move = step(c)
        return count + 1, c + move, jnp.max(jnp.abs(move)) > SMALL * jnp.max(jnp.abs(c + move))

    fixed = jax.lax.stop_gradient
    begin = (jnp.zeros((), jnp.int32), none, jnp.asarray(True))
    _, c, moves = jax.lax.while_loop(lambda s: s[2] & (s[0] < STEPS), lambda s: fixed(again(fixed(s))), begin)
    found = ~moves & (_lapack.sign_of_determinant(jax.jacfwd(left)(c)) > 0)
    for _ in range(EXACT):
        c = c + step(c)
    return Rubbed(c, found)
