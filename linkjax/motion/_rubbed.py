"""The reduced model with the friction of joints, for motions from any state: from rest, forward and back.

While the crank turns, friction is that of motion; a crank at rest starts against that at rest. Where friction locks the
machine, no acceleration satisfies the equations of motion: it stops there at once, and does not start. Close to such a
place friction grows beyond all bounds; it is limited to what stops the machine as fast.
"""

from __future__ import annotations

from collections.abc import Callable

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import Scalar
from linkjax.forces import friction_of_pose
from linkjax.kinematics import Pose
from linkjax.loads import Instant
from linkjax.machine import Scene
from linkjax.reduction import Reduced

JAM = 1e4  # a machine that locks stops from its speed ω within 1 / (2 JAM) rad: its deceleration is JAM ω²
FRICTION = "friction"


def with_friction(
    scene: Scene, at: Instant, here: Pose, active: Array, model: Reduced, advance: Callable[[Reduced], Array],
    way: Scalar | float = 1.0, at_rest: bool = False,
) -> Reduced:  # fmt: skip
    """The reduced model of a pose with friction, from the one without and the loads that are `active`. `advance` gives
    the acceleration of the crank (rad/s²) for a model, `way` is the sense of its rotation (1 or -1). Unchanged for a
    scene without friction."""
    if not scene.friction:
        return model
    speed = jnp.zeros_like(at.phi) if at.speed is None else jnp.asarray(at.speed)

    def left(torque: Array) -> Array:
        return advance(model._replace(torque=model.torque + torque))

    rub, moves = friction_of_pose(scene, here, at, active, speed, left, way, at_rest)
    most = -jnp.inf if at_rest else -JAM * scene.speed**2 * model.inertia - way * model.torque
    rub = way * jnp.where(moves, jnp.maximum(way * rub, most), most)
    return model._replace(torque=model.torque + rub, by_load={**model.by_load, FRICTION: rub})
