"""Values that are omitted at change points, where joint forces are unbounded."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax.forces import Forces, at_change_point
from linkjax.groups import BranchPath
from linkjax.kinematics import Pose, Prepared
from linkjax.mechanism import Mechanism


def continued(mechanism: Mechanism) -> bool:
    """Whether a group continues through change points."""
    return any(group.continues() for group in mechanism.groups)


def without_joints(mechanism: Mechanism, here: Pose, forces: Forces) -> Forces:
    """The forces at many angles, with NaN for joint reactions at change points."""
    lost = jax.vmap(functools.partial(at_change_point, mechanism))(here)
    if lost is None:
        return forces
    return forces._replace(reactions=jax.tree.map(lambda x: jnp.where(lost, jnp.nan, x), forces.reactions))


def singular(ready: Prepared, names: list[str]) -> Array:
    """Which of these peaks are unbounded: reactions at the joints of a group with a change point, and of the groups
    that carry it."""
    found = {name: jnp.asarray(False) for name in names}
    for number, path in enumerate(ready.paths):
        if isinstance(path, BranchPath):
            joints = {joint.name for before in ready.mechanism.groups[: number + 1] for joint in before.joints()}
            for name in names:
                if any(name.startswith(f"peak_reaction.{joint}.") for joint in joints):
                    found[name] = found[name] | path.touches()
    return jnp.stack(list(found.values()))
