"""What friction costs: losses by joint, efficiency, and how far a machine is from locking."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide, taken
from linkjax.forces import Forces, JointFriction, locking_of_pose
from linkjax.friction import friction_joints
from linkjax.machine import ReadyScene, Scene
from linkjax.measures._parts import Parts
from linkjax.measures._quantities import QUANTITIES, Vectors, quantity
from linkjax.measures._structure import Elements
from linkjax.motion import At, Grid, Place, Regime, all_loads, is_locked
from linkjax.reduction import Reduced


def rubbing_joints(scene: Scene) -> Elements:
    """The joints with friction."""
    own = {each.joint for each in scene.friction}
    return tuple(dict.fromkeys(joint.name for joint in friction_joints(scene.mechanism) if joint.name in own))


def no_friction(scene: Scene) -> tuple[str, str] | None:
    """What a scene without friction lacks, and a remedy."""
    return None if scene.friction else ("the scene has no friction", "add [friction], or delete it")


def not_useful(scene: Scene) -> tuple[str, str] | None:
    """What a scene without useful loads lacks, and a remedy."""
    if scene.useful:
        return None
    return "no load of the scene is useful work", "add useful = true to the loads that the machine works against"


def loss(of: Parts, joint: str, motion: bool) -> Array:
    """Work (J) that the friction of a joint takes in a cycle of the actual `motion`, or at constant speed; infinite
    where the machine locks."""
    regime = _motion(of, motion)
    forces = regime.forces(of.nodes_in(regime))
    return of.machine.run(_lost, regime.grid, forces.friction[joint], forces.moves)


def efficiency(of: Parts, motion: bool) -> Array:
    """Work on the useful loads over the net work of the drive in a cycle of the actual `motion`, or at constant speed;
    zero where the machine locks, and where the useful loads drive it, or other loads alone do."""
    regime = _motion(of, motion)
    here = all_loads(of.machine, of.grid, of.at, of.steady if motion else None)
    at = of.nodes_in(regime)
    torque = QUANTITIES["drive_power" if of.scene.motor is None else "motor_power"].at(of, ())(regime, at)
    speed, _ = regime.crank(at)
    moves = regime.forces(at).moves if of.scene.friction else None
    return of.machine.run(_efficiency, of.grid, here, regime.grid, torque, speed, moves, useful=of.scene.useful)


def efficiency_at(of: Parts, angle: float, motion: bool) -> Array:
    """Drive torque without friction over that with friction, in the same motion at a crank angle (rad)."""
    regime = _motion(of, motion)
    place = of.machine.run(_places, regime.grid, jnp.asarray(angle))
    forces = regime.forces(regime.at(place))
    return of.machine.run(_ratio, forces)


def _motion(of: Parts, motion: bool) -> Regime:
    found = of.true_motion if motion else of.constant_speed
    return of.with_kinks(found) if of.scene.friction else found


@compiled_soon
def _places(grid: Grid, angle: Array) -> Place:
    return jax.tree.map(lambda part: part[None], grid.place(angle))


@compiled_soon
def _ratio(forces: Forces) -> Array:
    rub = sum((one.value * one.speed for sides in forces.friction.values() for one in sides.values()), jnp.zeros(1))
    ratio = safe_divide(forces.drive_torque + rub, forces.drive_torque, jnp.nan)
    return (ratio if forces.moves is None else jnp.where(forces.moves, ratio, 0.0))[0]


@compiled_soon
def _lost(grid: Grid, sides: dict[str, JointFriction], moves: Array | None) -> Array:
    return jnp.where(is_locked(grid, moves), jnp.inf, lost_in(grid, sides))


def lost_in(grid: Grid, sides: dict[str, JointFriction]) -> Array:
    """The work (J) that the friction of a joint takes in a cycle, from values at the nodes."""
    power = -jnp.sum(jnp.stack([one.value * one.speed for one in sides.values()]), axis=0)
    return jnp.sum(grid.half[:, None] * grid.rule.w[None] * power[: grid.size].reshape(grid.nodes.shape))


@compiled_soon(static=("useful",))
def _efficiency(
    grid: Grid, here: Reduced, divided: Grid, power: Array, speed: Array, moves: Array | None, useful: Sequence[str]
) -> Array:
    """`power` is that of the drive at the nodes of the `divided` grid."""
    work = -jnp.sum(jnp.stack([here.by_load[name] for name in useful]), axis=0)
    torque = safe_divide(power[0, 0], speed)[: divided.size].reshape(divided.nodes.shape)
    given = jnp.sum(divided.half[:, None] * divided.rule.w[None] * torque)
    done = jnp.sum(grid.half[:, None] * grid.rule.w[None] * work)
    none = is_locked(divided, moves) | (done <= 0) | (given <= 0)
    return jnp.where(none, 0.0, safe_divide(done, given, 0.0))


@quantity("1", "", moves=False)
def locking(of: Parts, elements: Elements):
    """One over the common factor of all friction at which the machine locks, quasi-static."""

    def at(regime: Regime, at: At) -> Vectors:
        machine = regime.machine
        design = machine.still if regime.fixed else machine.whole_design
        return machine.run(_inverse, design, regime.grid, at.place, at.pose)

    return at


@compiled_soon
def _inverse(made: ReadyScene, grid: Grid, place: Place, pose) -> Vectors:
    def one(phi, side, here, active):
        at = made.instant(phi, side, jnp.zeros_like(phi))
        return locking_of_pose(made.scene, here, at, active).inverse

    found = jax.vmap(one)(place.phi, place.side, pose, taken(grid.active, place.panel))
    return jnp.stack([found, jnp.zeros_like(found)])[None]
