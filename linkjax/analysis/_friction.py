"""What the friction of joints does over the cycle, and where it locks the machine."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from linkjax._compile import compiled_soon
from linkjax._display import Numbers
from linkjax._numerics import safe_divide, taken
from linkjax.forces import Forces, forces_of_pose, locking_of_pose
from linkjax.friction import pairs
from linkjax.kinematics import Pose
from linkjax.loads import joined_ranges
from linkjax.machine import ReadyScene
from linkjax.measures import lost_in
from linkjax.motion import Grid, Place, is_locked
from linkjax.reduction import Reduced

SHOW = Numbers()


class FrictionRun(eqx.Module):
    """Friction over the cycle, in the actual motion or at constant speed without one.

    By joint the `loss` per cycle (J) and the `power` (W) at the crank angles. There, too: the drive torque of the same
    motion without friction `frictionless_torque` (N m), and over that with friction the `efficiency`, above one where
    the loads drive the machine; the drive torque of the same motion backwards `backward_torque` (N m), in which loads
    that oppose a motion are unchanged: where the loads resist forwards and it is negative, they cannot drive the
    machine back; the `locking_factor`, see the measure, and among `joints` the number `locking_joint` of the one that
    takes most of the power there; and whether the machine `moves`: where it does not, friction locks it, no finite
    drive torque keeps up the motion, torques are infinite and the efficiency is zero. `locks` says whether it locks
    anywhere.
    """

    loss: dict[str, Array]
    power: dict[str, Float[Array, " angles"]]
    frictionless_torque: Float[Array, " angles"]
    efficiency: Float[Array, " angles"]
    backward_torque: Float[Array, " angles"]
    locking_factor: Float[Array, " angles"]
    locking_joint: Int[Array, " angles"]
    moves: Bool[Array, " angles"]
    locks: Bool[Array, ""]
    joints: tuple[str, ...] = eqx.field(static=True)


class RubbingAt(NamedTuple):
    """Friction at the crank angles; see `FrictionRun`."""

    power: dict[str, Array]
    frictionless: Array
    efficiency: Array
    backward: Array
    factor: Array
    joint: Array
    moves: Array


@compiled_soon
def rubbing_at(
    made: ReadyScene, grid: Grid, place: Place, pose: Pose, forces: Forces, speed: Array, acceleration: Array
) -> RubbingAt:
    """Friction at places of the cycle, with the forces there, crank speed (rad/s) and acceleration (rad/s²)."""
    scene, active = made.scene, taken(grid.active, place.panel)

    def back(phi, side, here, active, speed, acceleration):
        at = made.instant(phi, side, -speed)
        return forces_of_pose(scene, here, at, active, -speed, acceleration).drive_torque

    def locks(phi, side, here, active):
        return locking_of_pose(scene, here, made.instant(phi, side, jnp.zeros_like(phi)), active)

    spent = {
        joint: -sum(one.value * one.speed for one in sides.values()) for joint, sides in forces.friction.items()
    }  # fmt: skip
    assert forces.moves is not None
    free = forces.drive_torque - sum(spent.values())
    ratio = jnp.where(forces.moves, safe_divide(free, forces.drive_torque, jnp.nan), 0.0)
    given = place.phi, place.side, pose, active
    limit = jax.vmap(locks)(*given)
    return RubbingAt(
        {joint: jnp.where(forces.moves, each * speed, jnp.inf) for joint, each in spent.items()},
        jnp.where(forces.moves, free, jnp.nan), ratio, jax.vmap(back)(*given, speed, acceleration),
        safe_divide(jnp.ones_like(limit.inverse), limit.inverse, jnp.inf), jnp.argmax(limit.shares, axis=1),
        forces.moves,
    )  # fmt: skip


class RubbedOver(NamedTuple):
    """Friction over the cycle: losses by joint (J), and whether the machine locks at a node."""

    loss: dict[str, Array]
    locks: Array


@compiled_soon
def rubbed_over(grid: Grid, forces: tuple[Forces, ...]) -> tuple[RubbedOver, ...]:
    """Friction over the cycle of every motion, from the forces at the nodes."""
    found = []
    for each in forces:
        locks = is_locked(grid, each.moves)
        lost = {joint: lost_in(grid, sides) for joint, sides in each.friction.items()}
        found.append(RubbedOver({joint: jnp.where(locks, jnp.inf, part) for joint, part in lost.items()}, locks))
    return tuple(found)


def known_reduced(shown: Any, motion: Any) -> Reduced:
    """The reduced model at the crank angles in the actual motion, or at constant speed if there is none; with friction
    NaN for the torque where the machine locks."""
    found, moves = shown.reduced[0], shown.friction[0].moves if shown.friction else None
    if motion is not None and len(shown.reduced) > 1:
        exists = motion.steady_state_margin > 0
        found = jax.tree.map(lambda a, b: jnp.where(exists, a, b), *shown.reduced)
        moves = None if moves is None else jnp.where(exists, moves, shown.friction[-1].moves)
    if moves is None:
        return found
    rub = jnp.where(moves, found.by_load["friction"], jnp.nan)
    torque = jnp.where(moves, found.torque, jnp.nan)
    return found._replace(torque=torque, by_load={**found.by_load, "friction": rub})


@compiled_soon
def without_locked(forces: Forces) -> Forces:
    """The forces at many angles, with NaN for reactions where the machine locks."""
    lost, moves = (forces.reactions, forces.frame, forces.net_frame), forces.moves
    assert moves is not None
    reactions, frame, net = jax.tree.map(lambda part: jnp.where(moves, part, jnp.nan), lost)
    return forces._replace(reactions=reactions, frame=frame, net_frame=net)


def friction_runs(scene: Any, shown: tuple[RubbingAt, ...], over: tuple[RubbedOver, ...]) -> list[FrictionRun | None]:
    """Friction over the cycle in every motion; None without friction."""
    joints = tuple(pair.joint.name for pair in pairs(scene.mechanism, scene.friction))
    runs = []
    for at, each in zip(shown, over, strict=True):
        locks = each.locks | ~jnp.all(at.moves)
        runs.append(FrictionRun(each.loss, *at, locks, joints))
    return runs or [None]


def useful_share(cycle: Any) -> float | None:
    """Work on the useful loads over the net work of the drive, per cycle; zero where friction locks the machine, and
    where the useful loads drive it, or other loads alone do; None without useful loads or works."""
    run = cycle.friction or cycle.friction_constant_speed
    if cycle.scene.useful and run is not None and bool(run.locks):
        return 0.0
    works = cycle.energies
    if not cycle.scene.useful or works is None:
        return None
    given = works["drive" if cycle.scene.motor is None else "motor"].net
    done = -sum(works[name].net for name in cycle.scene.useful)
    return float(done / given) if float(done) > 0 and float(given) > 0 else 0.0


def locked_text(cycle: Any) -> str:
    """Where friction locks the machine, and which joint is most responsible; "" if it does not."""
    run = cycle.friction or cycle.friction_constant_speed
    if run is None or not bool(run.locks):
        return ""
    moves, angles = np.asarray(run.moves), np.asarray(cycle.angles)
    where, joint = "between the crank angles shown", ""
    if not moves.all():
        step = np.diff(angles, append=angles[0] + cycle.scene.cycle)
        widths = [(float(a), float(w)) for a, w, ok in zip(angles, step, moves, strict=True) if not ok]
        where = "at " + ", ".join(_range(*each) for each in joined_ranges(widths, cycle.scene.cycle))
        factor = np.where(moves, np.inf, np.asarray(run.locking_factor))
        worst = int(np.argmin(factor))
        if np.isfinite(factor[worst]):
            joint = f", and most power goes into the friction of {run.joints[int(run.locking_joint[worst])]}"
    driver = cycle.scene.mechanism.driving_link
    return (
        f"friction locks the machine {where}: no finite force or torque on {driver} keeps up the motion{joint}. "
        "Lower its coefficient or radius, improve the transmission angle, or drive another link."
    )


def _range(on: float, off: float) -> str:
    return f"{SHOW.turned(on)} to {SHOW.turned(off)}"


def friction_document(run: FrictionRun | None) -> dict[str, Any] | None:
    """Friction as a part of the document of a cycle; None without it."""
    if run is None:
        return None
    names = np.asarray(run.joints, dtype=object)
    return {
        "joints": {
            joint: {"loss": float(loss), "power": np.asarray(run.power[joint])} for joint, loss in run.loss.items()
        },
        "frictionless_torque": run.frictionless_torque, "efficiency": run.efficiency,
        "backward_torque": run.backward_torque, "locking_factor": run.locking_factor,
        "locking_joint": names[np.asarray(run.locking_joint)].tolist(), "moves": np.asarray(run.moves).tolist(),
        "locks": bool(run.locks),
    }  # fmt: skip
