"""What the motor drives: the crank, or the driver that follows a motion law.

With a motion law, the crank angle is the phase of the law. A servo motor does not turn this phase but moves the driver,
whose speed is the first derivative of the law times the crank speed, and which may rest or turn back.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax.drives import MotorDrive
from linkjax.forces import Forces, driven_by_joint
from linkjax.kinematics import Pose
from linkjax.measures._forces import known_torque
from linkjax.mechanism import Mechanism
from linkjax.motion import At, Regime


class AtDriver(NamedTuple):
    """Torque (N m), speed (rad/s) and acceleration (rad/s²) of what the motor drives; a force (N), and m/s, of a driver
    that slides."""

    torque: Array
    speed: Array
    acceleration: Array


def at_driver(
    mechanism: Mechanism, phi: Array, pose: Pose, forces: Forces, speed: Array, acceleration: Array
) -> AtDriver:  # fmt: skip
    """What the motor drives at the crank angles `phi` (rad), with pose and forces there, at crank speed (rad/s) and
    acceleration (rad/s²), all of one shape.

    Without a motion law it is the crank. With one it is the driver: its speed follows from the law, and torque or force
    is the reaction of its joint `<link>.drive`. Power is the same for both.
    """
    law = mechanism.driver.follows()
    if law is None or not driven_by_joint(mechanism):
        return AtDriver(known_torque(forces), speed, acceleration)
    _, d, dd = jax.vmap(law.at)(phi)
    joint = next(joint for joint in mechanism.driver.joints() if joint.drives)
    reaction = forces.reactions[joint.name][joint.link]
    torque = reaction.moment
    if mechanism.driver.drive_slides():
        guide = next(slot.guide for slot in mechanism.driver.sliding() if slot.block == joint.link)
        t = jax.vmap(lambda links, points: guide.line(links, points).t)(pose.links, pose.points)
        torque = reaction.fx * t.x + reaction.fy * t.y
    return AtDriver(torque, d * speed, d * acceleration + dd * speed**2)


class AtMotor(NamedTuple):
    """Speed (rad/s), torque (N m) and power (W) at the motor's own shaft."""

    speed: Array
    torque: Array
    power: Array


@compiled_soon
def at_motor(
    motor: MotorDrive, mechanism: Mechanism | None, phi: Array, pose: Pose | None, forces: Forces,
    speed: Array, acceleration: Array,
) -> AtMotor:  # fmt: skip
    """What the motor does; see `at_driver`. Mechanism and pose are needed where the driver follows a motion law."""
    driven = AtDriver(known_torque(forces), speed, acceleration)
    if mechanism is not None and pose is not None:
        driven = at_driver(mechanism, phi, pose, forces, speed, acceleration)
    turning, torque = motor.motor_speed(driven.speed), motor.required_torque(*driven)
    return AtMotor(turning, torque, torque * turning)


def asked_of_motor(what: str) -> Callable[[Regime, At], Array]:
    """A part of `AtMotor` as vectors of two parts, shape (1, 2, places)."""

    def at(regime: Regime, at: At) -> Array:
        scene = regime.scene
        assert scene.motor is not None
        moved = (scene.mechanism, at.place.phi, at.pose) if scene.mechanism.prescribed else (None, at.place.phi, None)
        found = regime.machine.run(at_motor, scene.motor, *moved, regime.forces(at), *regime.crank(at))
        return regime.machine.run(_stacked, getattr(found, what))

    return at


@compiled_soon
def _stacked(number: Array) -> Array:
    return jnp.stack([number, jnp.zeros_like(number)])[None]
