"""The positions of a machine over its cycle, without an analysis: what a drawing needs."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from linkjax._compile import compiled_soon
from linkjax._results import MachineError, Result
from linkjax.analysis._cycle import explain_start
from linkjax.analysis._posed import posed
from linkjax.kinematics import OPEN, Pose, Prepared, margins_of_pose, open_at_start, pose
from linkjax.machine import Scene, ready


def positions(scene: Scene, angles: int = 360) -> dict[str, Any]:
    """The keys `scene`, `angles`, `points`, `links` and `result` of an analysis's document at `angles` uniform crank
    angles over the cycle: positions (m) and first and second kinematic coefficients. `result.per_angle` says at which
    angles the machine cannot be assembled.

    Raises `MachineError` with group and shortfall if it can be assembled at none of them.
    """
    made = ready(scene)
    explain_start(made)
    phi = jnp.arange(angles, dtype=float) * (scene.cycle / angles)
    here, good = jax.device_get(_poses(made.mechanism, phi))
    if not np.any(good):
        title = f"Scene {scene.title!r}: " if scene.title else ""
        why = f"{title}group {open_at_start(made.mechanism)}, nor at any other crank angle."
        raise MachineError(f"{why} Change lengths, or the side of the group.", Result.CANNOT_BE_ASSEMBLED)
    code = np.where(good, int(Result.SUCCESS), int(Result.CANNOT_BE_ASSEMBLED))
    return {
        "scene": scene.title,
        "angles": np.asarray(phi),
        **posed(scene.mechanism, here),
        "result": {"per_angle": code},
    }


@compiled_soon
def _poses(machine: Prepared, phi: Array) -> tuple[Pose, Bool[Array, " angles"]]:
    """The pose at every crank angle, and whether the machine can be assembled there."""

    def at(phi):
        here = pose(machine, phi)
        sides = [margin.value for group in margins_of_pose(machine, here, phi).values() for margin in group.values()]
        return here, jnp.min(jnp.stack([jnp.ones(()), *sides])) > -OPEN

    return jax.vmap(at)(phi)
