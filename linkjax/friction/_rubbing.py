"""How the links of joints with friction move against each other, and where friction acts."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._vec import Vec, zero
from linkjax.friction._friction import AbstractFriction, friction_joints
from linkjax.groups import FRAME, Joint, Wrench
from linkjax.kinematics import Motion, Pose
from linkjax.mechanism import Mechanism

NEAR = 1e-5  # rad: closer to a reversal than this, the direction of motion is that on the requested side
STILL = 1e-12  # of the fastest link or point: a smaller relative velocity is rounding


class Rubbing(NamedTuple):
    """A joint with friction: see `Pair`; and how it moves at unit crank speed: direction of the relative motion (a unit
    vector where it slides, otherwise None), its sense (1, -1, or zero where there is none) and speed (rad or m per
    rad)."""

    joint: Joint
    by: str
    friction: AbstractFriction
    slides: bool
    axis: Vec | None
    sense: Array
    speed: Array

    def wrench(self, size: Array) -> tuple[Vec, Array]:
        """Force and couple on the link of this size, positive along the motion."""
        return (zero(), size) if self.axis is None else (self.axis * size, jnp.zeros_like(size))

    def switches(self, fx: Array, fy: Array, moment: Array) -> tuple[Array, ...]:
        """Numbers at whose zeros its friction has a kink, from what the joint transmits beside it."""
        if self.joint.meshes:
            return self.friction.switches(fx, moment)
        if self.axis is None:
            return ()
        return self.friction.switches(self.axis.cross(Vec(fx, fy)), moment)

    def driven(self, force: Vec, moment: Array) -> tuple[Array, Array, Array]:
        """What the friction of the joint depends on, from force and moment on the link without friction: both, but what
        drives the link along its motion in a mesh."""
        if not self.joint.meshes:
            return force.x, force.y, moment
        drives = self.sense * (moment if self.axis is None else force.dot(self.axis))
        return drives, jnp.zeros_like(drives), jnp.zeros_like(drives)

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
    """A joint with friction, the other link, and whether one slides along the other. For a mesh these are the gear or
    rack and the link that carries it."""

    joint: Joint
    by: str
    friction: AbstractFriction
    slides: bool


def pairs(mechanism: Mechanism, friction: tuple[AbstractFriction, ...]) -> list[Pair]:
    """The joints with friction; a pin of several links is several joints."""
    by_joint, owners = {each.joint: each for each in friction}, mechanism.owners()
    carried, found = _carried(mechanism), []
    for joint in friction_joints(mechanism):
        if joint.name in by_joint:
            by, slides = carried.get(joint.name) or (joint.by or owners[joint.point], joint.slides)
            found.append(Pair(joint, by, by_joint[joint.name], slides))
    return found


def _carried(mechanism: Mechanism) -> dict[str, tuple[str, bool]]:
    """For every mesh the link that carries its gear or rack, and whether this is a rack."""
    found = {}
    for group in mechanism.groups:
        blocks = {slot.block for slot in group.sliding()}
        meshes = [joint.name for joint in group.joints() if joint.meshes]
        for name, wheel in zip(meshes, group.wheels(), strict=True):
            found[name] = wheel.mates()[-1], wheel.link in blocks
    return found


def rubbing(mechanism: Mechanism, friction: tuple[AbstractFriction, ...], here: Pose, ahead: Array) -> list[Rubbing]:
    """The joints with friction, and how they move at one crank angle; a sense at a reversal is that after it where
    `ahead` is 1, and before it where that is -1."""
    fastest = _fastest(here)[0]
    return [_moves(mechanism, pair, here, ahead, fastest) for pair in pairs(mechanism, friction)]


def reversing(mechanism: Mechanism, friction: tuple[AbstractFriction, ...]) -> list[Pair]:
    """The joints with friction whose relative motion may reverse: all but those of the crank and the frame."""
    fixed = {mechanism.driving_link, FRAME}
    return [p for p in pairs(mechanism, friction) if p.slides or {p.joint.link, p.by} != fixed]


def motions(mechanism: Mechanism, friction: tuple[AbstractFriction, ...], here: Pose) -> tuple[Motion, ...]:
    """The relative motions of these joints, at one crank angle or many; zero where they are rounding errors."""
    found, fastest = [], _fastest(here)
    for pair in reversing(mechanism, friction):
        rates = _relative(mechanism, pair, here)
        tiny = [d.squared() <= (STILL * most[pair.slides]) ** 2 for d, most in zip(rates, fastest, strict=True)]
        v, a = (Vec(*(jnp.where(tiny[0] & tiny[1], 0.0, part) for part in (d.x, d.y))) for d in rates)
        found.append(Motion((v.x, v.y), (a.x, a.y)) if pair.slides else Motion((v.x,), (a.x,)))
    return tuple(found)


def _fastest(here: Pose) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """The greatest velocity of a link and of a point, and the greatest derivative of each."""
    links, points = here.links.values(), here.points.values()
    rates = [jnp.max(jnp.abs(jnp.stack(part)), axis=0) for part in ([on.w for on in links], [on.e for on in links])]
    moved = [
        jnp.sqrt(jnp.max(jnp.stack([d.squared() for d in part]), axis=0))
        for part in ([at.dr for at in points], [at.ddr for at in points])
    ]
    return jax.lax.stop_gradient(((rates[0], moved[0]), (rates[1], moved[1])))


def _relative(mechanism: Mechanism, pair: Pair, here: Pose) -> tuple[Vec, Vec]:
    """Relative velocity and its derivative per unit of crank angle, of a guide as vectors, of a pin in their first
    components."""
    joint, by = pair.joint, pair.by
    if pair.slides:
        p = here.points[joint.point]
        if by == FRAME:
            return p.dr, p.ddr
        other, base = here.links[by], here.points[mechanism.origins()[by]]
        arm, apart = p.r - base.r, p.dr - base.dr
        v = apart - arm.perp() * other.w  # less the coincident point of the other link
        a = p.ddr - base.ddr - arm.perp() * other.e - apart.perp() * other.w
        return v, a
    one, none = here.links[joint.link], jnp.zeros_like(here.links[joint.link].w)
    if by == FRAME:
        return Vec(one.w, none), Vec(one.e, none)
    other = here.links[by]
    return Vec(one.w - other.w, none), Vec(one.e - other.e, none)


def _moves(mechanism: Mechanism, pair: Pair, here: Pose, ahead: Array, fastest: tuple[Array, Array]) -> Rubbing:
    v, a = _relative(mechanism, pair, here)
    nudge = jnp.where(v.squared() <= NEAR * NEAR * a.squared(), ahead * NEAR, 0.0)
    way = Vec(v.x + nudge * a.x, v.y + nudge * a.y)
    pace = safe_sqrt(way.squared())
    moves, speed = pace > STILL * fastest[pair.slides], safe_sqrt(v.squared())
    if not pair.slides:
        return Rubbing(*pair, None, jnp.where(moves, jnp.sign(way.x), 0.0), speed)
    axis = way * safe_divide(jnp.ones_like(pace), pace)
    return Rubbing(*pair, axis, jnp.where(moves, 1.0, 0.0), speed)
