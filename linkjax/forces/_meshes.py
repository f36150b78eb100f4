"""What is transmitted through meshes: moments on gears and pulleys, forces along racks.

Where it changes its sign, the other flanks of teeth are loaded, or the other strand of a belt is tight: there the
forces at pins and guides have a kink (see `groups/_mesh.py`).
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax.forces._kinetostatics import Forces
from linkjax.kinematics import Pose
from linkjax.mechanism import Mechanism


class Mesh(NamedTuple):
    """A mesh: the name of its joint, its gear, pulley or rack, whether this is a rack, and how many times as fast as
    the slower gear the faster one turns, rounded up."""

    joint: str
    link: str
    rack: bool
    faster: int


def meshes(mechanism: Mechanism) -> tuple[Mesh, ...]:
    """The meshes of a mechanism."""
    found = []
    for group in mechanism.groups:
        sliding = {joint.link for joint in group.joints() if joint.slides}
        faster = max((wheel.faster() for wheel in group.wheels()), default=1)
        found += [
            Mesh(joint.name, joint.link, joint.link in sliding, faster) for joint in group.joints() if joint.meshes
        ]
    return tuple(found)


def through_meshes(which: tuple[Mesh, ...], pose: Pose, forces: Forces) -> Float[Array, "meshes places"]:
    """The moment on every gear or pulley (N m), and the force on every rack along its guide (N)."""
    rows = []
    for joint, link, rack, _ in which:
        on, axis = forces.reactions[joint][link], pose.links[link].u
        rows.append(on.fx * axis.x + on.fy * axis.y if rack else on.moment)
    return jnp.stack(rows)
