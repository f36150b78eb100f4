"""Force quantities at a place of the cycle grid, stacked so that one search finds all their peaks."""

from __future__ import annotations

import collections

import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax.forces import Forces
from linkjax.machine import Scene


def table(scene: Scene, forces: Forces) -> Float[Array, "quantities 2 places"]:
    """Shaking force, frame force, shaking moment, drive torque and all reactions: the rows of `signed_rows`."""
    zero = jnp.zeros_like(forces.drive_torque)
    rows = [forces.shaking[:2], forces.frame[:2], (forces.shaking.moment, zero), (known_torque(forces), zero)]
    rows += [forces.net_frame[:2]] if _net(scene) else []
    rows += [forces.reactions[joint][link][:2] for joint, link in reaction_names(scene)]
    return jnp.stack([jnp.stack(row) for row in rows])


def known_torque(forces: Forces) -> Array:
    """The drive torque (N m), zero where friction locks the machine."""
    return forces.drive_torque if forces.moves is None else jnp.where(forces.moves, forces.drive_torque, 0.0)


def peak_names(scene: Scene) -> list[str]:
    """Names of the peaks of an analysis, without their motion: of the rows of `table` the largest magnitude, and of the
    shaking moment and the drive torque the largest and smallest value. A reaction is `peak_reaction.<joint>.<link>`."""
    joints = [f"reaction.{joint}.{link}" for joint, link in reaction_names(scene)]
    net = ["net_frame_force"] if _net(scene) else []
    rows = ["shaking_force", "frame_force", "shaking_moment", "drive_torque", *net, *joints]
    return [f"{way}_{row}" for row in rows for way in (("peak", "max", "min") if row in SIGNED else ("peak",))]


SIGNED = ("shaking_moment", "drive_torque")  # rows of one number with a sign


def signed_rows(scene: Scene) -> tuple[int, ...]:
    """The rows of `table` that are numbers with a sign."""
    rows = [name.partition("_")[2] for name in peak_names(scene) if name.startswith("peak")]
    return tuple(rows.index(name) for name in SIGNED)


def in_motion(name: str, constant: bool) -> str:
    """The name of a measure in the actual motion, or at constant speed."""
    head, dot, element = name.partition(".")
    return f"{head}{'_constant_speed' * constant}{dot}{element}"


def motion_of(name: str) -> tuple[str, bool]:
    """The name of a measure without its motion, and whether it is at constant speed."""
    head, dot, element = name.partition(".")
    return f"{head.removesuffix('_constant_speed')}{dot}{element}", head.endswith("_constant_speed")


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
