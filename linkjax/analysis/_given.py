"""Forces at a given angular acceleration instead of that of the motion."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax.analysis._blunt import without_joints
from linkjax.analysis._cycle import Cycle
from linkjax.forces import Forces, kinetostatics
from linkjax.machine import ReadyScene, ready


def at_acceleration(cycle: Cycle, acceleration: float | Array) -> Cycle:
    """The same cycle with the forces at nominal speed and at this angular acceleration of the crank (rad/s², positive
    if the speed increases)."""
    scene = cycle.scene
    speed = jnp.broadcast_to(scene.speed, cycle.angles.shape)
    slope = jnp.full_like(speed, acceleration)
    forces = without_joints(scene.mechanism, cycle.pose, _at(ready(scene), cycle.angles, speed, slope))
    return dataclasses.replace(cycle, speed=speed, acceleration=slope, forces=forces)


@jax.jit
def _at(made: ReadyScene, angles: Array, speed: Array, acceleration: Array) -> Forces:
    return jax.vmap(lambda phi, w, e: kinetostatics(made, phi, w, e))(angles, speed, acceleration)
