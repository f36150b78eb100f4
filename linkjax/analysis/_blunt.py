"""What is not told at change points: there forces at the joints have no bound."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax.forces import Forces
from linkjax.groups import RRP, RRR
from linkjax.kinematics import named_groups
from linkjax.mechanism import Mechanism

BLUNT = 1e-5  # sine of the transmission angle below which forces at joints are not told: ten digits are gone there


def blunt(transmission: dict[str, Array], mechanism: Mechanism) -> Array:
    """Where a group that continues through change points is at one of them."""
    sines = [
        jnp.abs(jnp.sin(transmission[name]))
        for name, group in named_groups(mechanism).items()
        if isinstance(group, RRR | RRP) and group.branch == "continue"
    ]
    none = [jnp.ones_like(angle) for angle in list(transmission.values())[:1]] or [jnp.ones(())]
    return jnp.min(jnp.stack([*none, *sines]), axis=0) < BLUNT


def without_joints(forces: Forces, lost: Array) -> Forces:
    """The forces, with none at the joints, on the crank and on the frame where they are `lost`: NaN."""

    def told(tree):
        return jax.tree.map(lambda x: jnp.where(lost, jnp.nan, x), tree)

    kept = {name: getattr(forces, name) for name in ("shaking", "weight", "loads")}
    return told(forces)._replace(**kept)


def singular(mechanism: Mechanism, names: list[str]) -> Array:
    """Which of these peaks have no bound: reactions at the joints of a group with a change point, and of what carries
    it."""
    found = {name: jnp.asarray(False) for name in names}
    for number, group in enumerate(mechanism.groups):
        if isinstance(group, RRR | RRP) and group.path is not None:
            joints = {joint.name for before in mechanism.groups[: number + 1] for joint in before.joints()}
            for name in names:
                if name.startswith("reaction.") and any(name.startswith(f"reaction.{joint}.") for joint in joints):
                    found[name] = found[name] | group.path.touches()
    return jnp.stack(list(found.values()))
