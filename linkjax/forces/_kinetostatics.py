"""Kinetostatics: joint reactions, guide forces and drive torque, group by group in reverse order of assembly.

Source: d'Alembert's principle on each structural group, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988,
ch. 13. Forces in N, moments in N m, in the axes of the frame.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_sqrt
from linkjax._types import Scalar
from linkjax._vec import Vec, zero
from linkjax.forces._friction import JointFriction, Reactions, Rubbed, Transmitted, linear, rubbed
from linkjax.friction import AbstractFriction, Rubbing, pairs, rubbing
from linkjax.groups import Joint, Wrench
from linkjax.kinematics import Pose, pose
from linkjax.loads import Applied, Instant, power
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import Mechanism

BLUNT = 1e-5  # sine of the transmission angle below which joint forces are not given: ten digits cancel there


class JointForce(NamedTuple):
    """Force (N) and moment about the joint (N m) that the rest of the machine exerts on a link at a joint."""

    fx: Array
    fy: Array
    moment: Array

    @property
    def magnitude(self) -> Array:
        """Magnitude of the force (N)."""
        return safe_sqrt(self.fx**2 + self.fy**2)


class Reaction(NamedTuple):
    """The force that `by` exerts on `link` at a joint, and its moment about the joint's point (zero at a pin)."""

    joint: Joint
    link: str
    by: str
    force: Vec
    moment: Array


class Forces(NamedTuple):
    """Forces (N) and moments (N m) at one crank angle; moments of the resultants are about the crank pivot.

    `reactions[joint][link]` acts on the link; `other_sides` names the link that exerts it. `shaking` is -Σ m a with the
    moment -dH/dt. `frame` is the resultant on the frame through the joints, without the reaction of the motor, which is
    minus the drive torque. `net_frame` adds the reactions of loads that react on the frame. `weight` and `loads` are
    the resultants of weights and loads. Reactions of joints with friction contain it; `friction[joint][link]` is
    friction alone. `moves` is false where the machine locks: no finite drive torque keeps up this motion, and
    `drive_torque` is infinite. It is false at a change point, too, where friction is not known.
    """

    reactions: dict[str, dict[str, JointForce]]
    drive_torque: Array
    shaking: JointForce
    frame: JointForce
    net_frame: JointForce
    weight: JointForce
    loads: JointForce
    friction: dict[str, dict[str, JointFriction]]
    moves: Array | None


def kinetostatics(
    scene: Scene | ReadyScene, phi: Scalar, speed: Scalar, acceleration: Scalar, side: Scalar | None = None
) -> Forces:
    """All forces at the crank angle `phi` (rad), crank speed (rad/s) and crank acceleration (rad/s²).

    Arguments and results are scalars; use `jax.vmap` for many. At a jump of a load the value is the one-sided limit on
    the side of the angle `side` (rad; default: just after `phi`). With a negative speed friction is that of the motion
    backwards. Reactions follow from equilibrium alone, except those named by `indeterminate`.
    """
    phi = jnp.asarray(phi)
    return _kinetostatics(ready(scene), phi, speed, acceleration, phi if side is None else jnp.asarray(side))


@jax.jit  # traced once per scene topology, however often it is used inside larger functions
def _kinetostatics(made: ReadyScene, phi: Scalar, speed: Scalar, acceleration: Scalar, side: Scalar) -> Forces:
    scene, here = made.scene, pose(made.mechanism, phi)
    return forces_of_pose(
        scene, here, made.instant(phi, jnp.asarray(side), speed), scene.active(side), speed, acceleration
    )


def forces_of_pose(
    scene: Scene, here: Pose, at: Instant, active: Array, speed: Scalar, acceleration: Scalar,
    solve: Callable[..., Rubbed] = rubbed,
) -> Forces:  # fmt: skip
    """The forces for a given pose; see `kinetostatics`. `active` is one for every load that acts, zero otherwise, and
    `solve` finds the frictions."""
    phi, origins = at.phi, scene.mechanism.origins()
    inertia, weight, working, own = applied_to(scene, here, at, active, speed, acceleration)
    acting = acting_on(scene, here, origins, inertia, weight, working)
    ahead = jnp.where(at.side >= phi, 1.0, -1.0)
    joints = rubbing(scene.mechanism, scene.friction, here, ahead) if scene.friction else []
    joints = [each._replace(sense=jnp.where(speed < 0, -each.sense, each.sense)) for each in joints]
    rub = None
    if joints:
        reactions = reactions_of(scene, here, origins, joints, lambda _: acting)
        rub = solve(*friction_numbers(joints), reactions, lambda _: acceleration)
    found, drive = _solve_groups(scene, here, acting, origins, joints, None if rub is None else rub.values)
    about = here.points[scene.mechanism.groups[0].needs()[0]].r
    shaking, weights, loads = (_resultant(here, applied, about) for applied in (inertia, weight, working))
    frame = _on_frame(here, found, about)
    lost = at_change_point(scene.mechanism, here)
    if lost is not None:  # the balance of the whole machine gives these where joints do not
        whole = -power(here, [*inertia, *weight, *working])
        drive = jnp.where(lost, whole, drive)
        own_torque = (
            zero().x if driven_by_joint(scene.mechanism) else here.links[scene.mechanism.driving_link].w * whole
        )
        total = JointForce(*(a + b + c for a, b, c in zip(shaking, weights, loads, strict=True)))
        total = total._replace(moment=total.moment + own_torque)
        frame = JointForce(*(jnp.where(lost, a, b) for a, b in zip(total, frame, strict=True)))
    to_frame = _resultant(here, own, about)
    net = JointForce(*(a - b for a, b in zip(frame, to_frame, strict=True)))
    friction: dict[str, dict[str, JointFriction]] = {}
    if rub is not None:
        for i, each in enumerate(joints):
            fx, fy, moment = (part[i] for part in rub.loads)
            square = fx * fx + fy * fy if each.joint.pins else None
            own = JointFriction(rub.values[i] * each.sense, each.speed, each.switches(fx, fy, moment), square)
            friction.setdefault(each.joint.name, {})[each.joint.link] = own
    moves = None if rub is None else rub.found
    if moves is not None:
        moves = moves if lost is None else moves & ~lost
        drive = jnp.where(moves, drive, jnp.inf)
    return Forces(_by_joint(found), drive, shaking, frame, net, weights, loads, friction, moves)


def friction_of_pose(
    scene: Scene, here: Pose, at: Instant, active: Array, speed: Scalar, advance: Callable[[Array], Array],
    way: Scalar | float = 1.0, at_rest: bool = False,
) -> tuple[Array, Array]:  # fmt: skip
    """The torque of friction reduced to the crank (N m), negative, at the crank speed (rad/s) and the acceleration
    (rad/s²) that follows from this torque by `advance`; and whether the machine moves with it, and does not lock. With
    the `way` -1 of a crank that turns back, and with friction of a machine `at_rest`."""
    origins = scene.mechanism.origins()
    joints = rubbing(scene.mechanism, scene.friction, here, jnp.where(at.side >= at.phi, 1.0, -1.0))

    def acting(acceleration: Array) -> dict[str, Wrench]:
        return acting_on(scene, here, origins, *applied_to(scene, here, at, active, speed, acceleration)[:3])

    frictions, senses, paces = friction_numbers(joints)
    reactions = reactions_of(scene, here, origins, joints, acting)
    frictions = [each.at_rest() for each in frictions] if at_rest else frictions
    found = rubbed(frictions, senses, paces, reactions, advance, way=way)
    return found.values @ (senses * paces), found.found


def friction_numbers(joints: list[Rubbing]) -> tuple[list[AbstractFriction], Array, Array]:
    """Frictions, senses and speeds of joints."""
    senses, paces = (jnp.stack(part) for part in zip(*((j.sense, j.speed) for j in joints), strict=True))
    return [joint.friction for joint in joints], senses, paces


def reactions_of(
    scene: Scene, here: Pose, origins: dict[str, str], joints: list[Rubbing], acting: Callable[[Array], Any]
) -> Reactions:
    """What joints transmit, as a function of frictions and acceleration, with the loads `acting` at an acceleration."""

    def given(c: Array, rate: Array) -> Transmitted:
        return rubbed_by(scene, here, acting(rate), origins, joints, c)

    return linear(given, len(joints)) if has_linear_reactions(scene.mechanism) else given


def has_linear_reactions(mechanism: Mechanism) -> bool:
    """Whether reactions are linear in loads: not those of meshes, whose flanks or strands change."""
    return not any(joint.meshes for group in mechanism.groups for joint in group.joints())


def at_change_point(mechanism: Mechanism, here: Pose) -> Array | None:
    """Whether joint forces have no digits left, because a group that continues through change points is at one; None if
    no group does.

    Reactions are quotients of two numbers that vanish there, and their rounding errors no longer cancel. Drive torque
    and frame forces then follow from the power and the sums of all loads, which remain exact: the whole machine is
    balanced, not its joints.
    """
    angles = (group.transmission(here.links, here.points) for group in mechanism.groups if group.continues())
    sines = [jnp.abs(jnp.sin(angle)) for angle in angles if angle is not None]
    return jnp.min(jnp.stack(sines), axis=0) < BLUNT if sines else None


def driven_by_joint(mechanism: Mechanism) -> bool:
    """Whether the drive is a joint of its own, whose reaction is among the others."""
    return any(joint.drives for joint in mechanism.driver.joints())


def acting_on(scene: Scene, here: Pose, origins: dict[str, str], *applied: list[Applied]) -> dict[str, Wrench]:
    """The resultant on every link, with the moment about its origin."""
    acting = {name: Wrench(zero(), jnp.zeros(())) for name in scene.mechanism.links}
    for link, point, force, couple in itertools.chain(*applied):
        arm = here.points[point].r - here.points[origins[link]].r if point else zero()
        acting[link] = Wrench(acting[link].force + force, acting[link].moment + couple + arm.cross(force))
    return acting


def applied_to(scene: Scene, here: Pose, at: Instant, active: Array, speed, acceleration, but: Sequence[int] = ()):
    """Inertia forces, weights and loads `but` for some, and the loads that react on the frame."""
    inertia, weight, working, own = [], [], [], []
    for name, place, body in here.heavy():
        centre, turn = here.points[place], here.links[name]
        a = centre.ddr * speed**2 + centre.dr * acceleration
        spin = turn.e * speed**2 + turn.w * acceleration
        inertia.append(Applied(name, place, a * (-body.mass), -body.inertia * spin))
        weight.append(Applied(name, place, scene.gravity * body.mass, jnp.zeros_like(spin)))
    crank = scene.mechanism.driving_link
    spin = here.links[crank].e * speed**2 + here.links[crank].w * acceleration
    inertia.append(Applied(crank, None, zero(), -scene.mechanism.flywheel.inertia * spin))
    for i, load in enumerate(scene.loads):
        if i in but:
            continue
        on = active[..., i]
        acting = [w._replace(force=w.force * on, couple=w.couple * on) for w in load.wrenches(here, at)]
        working += acting
        own += acting if load.reacts_on == "frame" else []
    return inertia, weight, working, own


def _solve_groups(
    scene: Scene, here: Pose, loads: dict[str, Wrench], origins: dict[str, str], joints: list[Rubbing], friction: Any
) -> tuple[list[Reaction], Array]:
    """Reactions and drive torque, from the loads on every link and the friction of joints."""
    owners, acting = scene.mechanism.owners(), dict(loads)
    found: list[Reaction] = []
    rubs: dict[Joint, tuple[Vec, Array]] = {}
    in_meshes: list[Reaction] = []  # losses of meshes, which act between gear or rack and its carrier
    for i, each in enumerate(joints):
        joint, (rub, couple) = each.joint, each.add(acting, here, origins, friction[i])
        if joint.meshes:
            in_meshes.append(Reaction(joint, joint.link, each.by, rub, couple))
            if each.by != "frame":
                in_meshes.append(Reaction(joint, each.by, joint.link, -rub, -couple))
        else:
            rubs[joint] = rub, couple
    drive = jnp.zeros(())
    for group in reversed(scene.mechanism.groups):
        wrenches, torque = group.react(acting, here.links, here.points)
        drive = drive if torque is None else torque
        for joint, (force, moment) in zip(group.joints(), wrenches, strict=True):
            by = joint.by or owners[joint.point]
            if by != "frame" and by not in group.link_names():
                arm = here.points[joint.point].r - here.points[origins[by]].r
                acting[by] = Wrench(acting[by].force - force, acting[by].moment - moment - arm.cross(force))
            if joint in rubs:
                rub, couple = rubs[joint]
                force, moment = force + rub, moment + couple
            found.append(Reaction(joint, joint.link, by, force, moment))
            if by != "frame":
                found.append(Reaction(joint, by, joint.link, -force, -moment))
    return found + in_meshes, drive


def rubbed_by(
    scene: Scene, here: Pose, loads: dict[str, Wrench], origins: dict[str, str], joints: list[Rubbing], friction: Array
) -> tuple[Array, Array, Array]:
    """What joints with this friction transmit beside it: forces fx and fy (N), and moments (N m); of meshes what drives
    the gear or rack."""
    found, _ = _solve_groups(scene, here, loads, origins, joints, friction)
    on: dict[Joint, Reaction] = {}
    for reaction in found:  # the loss of a mesh comes after the force of its teeth
        if reaction.link == reaction.joint.link:
            on.setdefault(reaction.joint, reaction)
    rows = []
    for i, rub in enumerate(joints):
        whole, (force, couple) = on[rub.joint], rub.wrench(friction[i])
        if rub.joint.meshes:
            rows.append(rub.driven(whole.force, whole.moment))
        else:
            rows.append(rub.driven(whole.force - force, whole.moment - couple))
    fx, fy, moment = (jnp.stack(part) for part in zip(*rows, strict=True))
    return fx, fy, moment


def _by_joint(found: list[Reaction]) -> dict[str, dict[str, JointForce]]:
    table: dict[str, dict[str, JointForce]] = {}
    for r in found:
        at = table.setdefault(r.joint.name, {})
        old = at.get(r.link)
        new = JointForce(r.force.x, r.force.y, r.moment)
        at[r.link] = new if old is None else JointForce(*(a + b for a, b in zip(old, new, strict=True)))
    return table


def other_sides(scene: Scene) -> dict[str, dict[str, str]]:
    """Which link (or "frame") exerts each reaction: {joint: {link: by}}; several at one pin are joined with "+"."""
    owners, by = scene.mechanism.owners(), {}
    carriers = {pair.joint: pair.by for pair in pairs(scene.mechanism, scene.friction) if pair.joint.meshes}
    for group in scene.mechanism.groups:
        for joint in group.joints():
            other = joint.by or owners[joint.point]
            at = by.setdefault(joint.name, {})
            at[joint.link] = other
            if other != "frame":
                at[other] = f"{at[other]}+{joint.link}" if other in at else joint.link
            if joint in carriers:  # losses act between gear or rack and its carrier
                at[joint.link] = f"{other}+{carriers[joint]}"
                if carriers[joint] != "frame":
                    at[carriers[joint]] = joint.link
    return by


def _resultant(here: Pose, acting, about: Vec) -> JointForce:
    """Resultant of forces and couples, with the moment about a point."""
    total, moment = zero(), jnp.zeros(())
    for _, point, force, couple in acting:
        arm = here.points[point].r - about if point else zero()
        total, moment = total + force, moment + couple + arm.cross(force)
    return JointForce(total.x, total.y, moment)


def _on_frame(here: Pose, found: list[Reaction], about: Vec) -> JointForce:
    total, moment = zero(), jnp.zeros(())
    for r in found:
        if r.by == "frame":
            arm = here.points[r.joint.point].r - about
            total, moment = total - r.force, moment - r.moment - arm.cross(r.force)
    return JointForce(total.x, total.y, moment)
