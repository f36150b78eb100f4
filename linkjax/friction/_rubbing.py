"""How the links of joints with friction move against each other, and where friction acts."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._vec import Vec, zero
from linkjax.friction._friction import AbstractFriction, friction_joints
from linkjax.groups import FRAME, Joint, Wrench
from linkjax.kinematics import Motion, Pose
from linkjax.mechanism import Mechanism

NEAR = 1e-5  # rad: closer to a reversal than this, the direction of motion is that on the requested side
STILL = 1e-12  # of what it is the difference of: a smaller relative velocity is rounding


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

    def switches(self, fx: Array, fy: Array, moment: Array) -> tuple[Array, ...]:
        """Numbers at whose zeros its friction has a kink, from what the joint transmits beside it."""
        if self.axis is None:
            return ()
        return self.friction.switches(self.axis.cross(Vec(fx, fy)), moment)

    def add(self, acting: dict[str, Wrench], here: Pose, origins: dict[str, str], size: Array) -> tuple[Vec, Array]:
        """Add it on the link, and its opposite on the other; returns `wrench`."""
        force, couple = self.wrench(size)
        for link, sign in ((self.joint.link, 1.0), (self.by, -1.0)):
            if link != FRAME:
                arm = here.points[self.joint.point].r - here.points[origins[link]].r
                moment = acting[link].moment + sign * (couple + arm.cross(force))
                acting[link] = Wrench(acting[link].force + force * sign, moment)
        return force, couple


class Pair(NamedTuple):
    """A joint with friction, and the other link."""

    joint: Joint
    by: str
    friction: AbstractFriction


def pairs(mechanism: Mechanism, friction: tuple[AbstractFriction, ...]) -> list[Pair]:
    """The joints with friction; a pin of several links is several joints."""
    by_joint, owners = {each.joint: each for each in friction}, mechanism.owners()
    there = friction_joints(mechanism)
    return [Pair(j, j.by or owners[j.point], by_joint[j.name]) for j in there if j.name in by_joint]


def rubbing(mechanism: Mechanism, friction: tuple[AbstractFriction, ...], here: Pose, ahead: Array) -> list[Rubbing]:
    """The joints with friction, and how they move at one crank angle; a sense at a reversal is that after it where
    `ahead` is 1, and before it where that is -1."""
    return [_moves(mechanism, pair, here, ahead) for pair in pairs(mechanism, friction)]


def reversing(mechanism: Mechanism, friction: tuple[AbstractFriction, ...]) -> list[Pair]:
    """The joints with friction whose relative motion may reverse: all but that of the crank and the frame."""
    fixed = {mechanism.driving_link, FRAME}
    return [p for p in pairs(mechanism, friction) if p.joint.slides or {p.joint.link, p.by} != fixed]


def motions(mechanism: Mechanism, friction: tuple[AbstractFriction, ...], here: Pose) -> tuple[Motion, ...]:
    """The relative motions of these joints, at one crank angle or many."""
    found = []
    for pair in reversing(mechanism, friction):
        v, a, _ = _relative(mechanism, pair, here)
        found.append(Motion((v.x, v.y), (a.x, a.y)) if pair.joint.slides else Motion((v.x,), (a.x,)))
    return tuple(found)


def _relative(mechanism: Mechanism, pair: Pair, here: Pose) -> tuple[Vec, Vec, Array]:
    """Relative velocity and its derivative per unit of crank angle, of a guide as vectors, of a pin in their first
    components; and the size of what they are differences of."""
    joint, by, _ = pair
    if joint.slides:
        p = here.points[joint.point]
        if by == FRAME:
            return p.dr, p.ddr, jnp.zeros_like(p.dr.x)
        other, base = here.links[by], here.points[mechanism.origins()[by]]
        arm, apart = p.r - base.r, p.dr - base.dr
        v = apart - arm.perp() * other.w  # less the coincident point of the other link
        a = p.ddr - base.ddr - arm.perp() * other.e - apart.perp() * other.w
        return v, a, safe_sqrt(p.dr.squared() + base.dr.squared() + arm.squared() * other.w**2)
    one, none = here.links[joint.link], jnp.zeros_like(here.links[joint.link].w)
    if by == FRAME:
        return Vec(one.w, none), Vec(one.e, none), none
    other = here.links[by]
    return Vec(one.w - other.w, none), Vec(one.e - other.e, none), jnp.abs(one.w) + jnp.abs(other.w)


def _moves(mechanism: Mechanism, pair: Pair, here: Pose, ahead: Array) -> Rubbing:
    v, a, size = _relative(mechanism, pair, here)
    nudge = jnp.where(v.squared() <= NEAR * NEAR * a.squared(), ahead * NEAR, 0.0)
    way = Vec(v.x + nudge * a.x, v.y + nudge * a.y)
    pace = safe_sqrt(way.squared())
    moves, speed = pace > STILL * size, safe_sqrt(v.squared())
    if not pair.joint.slides:
        return Rubbing(*pair, None, jnp.where(moves, jnp.sign(way.x), 0.0), speed)
    axis = way * safe_divide(jnp.ones_like(pace), pace)
    return Rubbing(*pair, axis, jnp.where(moves, 1.0, 0.0), speed)
