"""Force quantities at a place of the cycle grid, stacked so that one search finds all their peaks."""

from __future__ import annotations

import collections

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax.forces import Forces, kinetostatics
from linkjax.kinematics import pose
from linkjax.machine import Scene
from linkjax.motion import Place, Regime
from linkjax.reduction import mass_sums


def shaking(regime: Regime, place: Place) -> Float[Array, "1 2"]:
    """Shaking force (N): the inertia force on the frame."""
    here = pose(regime.scene.mechanism, place.phi)
    first, second = mass_sums(here)
    speed, acceleration = regime.crank(place)
    force = -(second * speed**2 + first * acceleration).once()
    return jnp.stack([force.x, force.y])[None]


def drive(regime: Regime, place: Place) -> Float[Array, "1 1"]:
    """Drive torque (N m) by kinetostatics."""
    return _forces(regime, place).drive_torque[None, None]


def reactions(regime: Regime, place: Place) -> Float[Array, "joints 2"]:
    """Joint and guide forces (N), in the order of `reaction_names`."""
    found = _forces(regime, place).reactions
    return jnp.stack([jnp.stack(found[joint][link][:2]) for joint, link in reaction_names(regime.scene)])


def every_motion(regime: Regime, place: Place) -> tuple[Forces, Float[Array, " motions"], Float[Array, " motions"]]:
    """Forces, crank speed and acceleration in the actual motion (unless the regime is of constant speed) and at
    constant nominal speed, along a leading axis."""
    speed, acceleration = regime.crank(place)
    pairs = [(regime.scene.speed * jnp.ones_like(speed), jnp.zeros_like(acceleration))]
    if regime.steady is not None:
        pairs.insert(0, (speed, acceleration))
    speeds, accelerations = (jnp.stack(part) for part in zip(*pairs, strict=True))
    side = regime.side(place)
    forces = jax.vmap(lambda w, e: kinetostatics(regime.scene, place.phi, w, e, side))(speeds, accelerations)
    return forces, speeds, accelerations


def table(scene: Scene, forces: Forces) -> Float[Array, "*motions quantities 2"]:
    """Shaking force, frame force, shaking moment, drive torque and all reactions, in the order of `peak_names`."""
    zero = jnp.zeros_like(forces.drive_torque)
    rows = [forces.shaking[:2], forces.frame[:2], (forces.shaking.moment, zero), (forces.drive_torque, zero)]
    rows += [forces.net_frame[:2]] if _net(scene) else []
    rows += [forces.reactions[joint][link][:2] for joint, link in reaction_names(scene)]
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def peak_names(scene: Scene) -> list[str]:
    """Names of the rows of `table`; a reaction is `reaction.<joint>.<link>`."""
    joints = [f"reaction.{joint}.{link}" for joint, link in reaction_names(scene)]
    net = ["net_frame_force"] if _net(scene) else []
    return ["shaking_force", "frame_force", "shaking_moment", "drive_torque", *net, *joints]


def _net(scene: Scene) -> bool:
    """Whether the force on the foundation differs from that on the frame."""
    return any(load.reacts_on == "frame" for load in scene.loads)


def reaction_names(scene: Scene) -> list[tuple[str, str]]:
    """One (joint, link) for every joint, since the reaction on the other link is equal and opposite. Where several
    links join one pin, also the link that carries the pin, which bears their sum."""
    joints = [joint for group in scene.mechanism.groups for joint in group.joints()]
    names = [(joint.name, joint.link) for joint in joints]
    owners = scene.mechanism.owners()
    carried = collections.Counter((joint.name, joint.by or owners[joint.point]) for joint in joints)
    names += [(joint, link) for (joint, link), count in carried.items() if count > 1 and link != "frame"]
    return list(dict.fromkeys(names))


def _forces(regime: Regime, place: Place) -> Forces:
    speed, acceleration = regime.crank(place)
    return kinetostatics(regime.scene, place.phi, speed, acceleration, regime.side(place))
