"""Servo drives: the motor follows a motion law, within its limits of speed and torque."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import as_float
from linkjax.drives._drive import MotorDrive
from linkjax.drives._motors import AbstractMotor, check_numbers


class ServoMargins(NamedTuple):
    """How far a servo motor is below its limits, each as a part of the limit: negative where a limit is exceeded."""

    speed: Array
    torque: Array


class Servo(AbstractMotor):
    """A servo motor, which follows a motion law by the torque that it needs: `max_speed` (rad/s) and `max_torque` (N m)
    at its shaft are its limits.

    Its `torque` is the greatest torque that it can give, `max_torque` up to `max_speed` and zero above. Raises
    `ValueError` unless both limits are above zero.
    """

    max_speed: Array = eqx.field(converter=as_float)
    max_torque: Array = eqx.field(converter=as_float)

    def __check_init__(self):
        check_numbers("a servo motor", {"max_speed": self.max_speed, "max_torque": self.max_torque})

    def torque(self, speed):
        return jnp.where(jnp.abs(speed) <= self.max_speed, self.max_torque, 0.0)

    def knots(self):
        return (self.max_speed,)

    def torque_limit(self):
        return self.max_torque

    def speed_limit(self):
        return self.max_speed

    def margins(self, speed: Array, torque: Array) -> ServoMargins:
        """Margins of a motion with these shaft speeds (rad/s) and motor torques (N m), at the same instants."""
        fastest, greatest = jnp.max(jnp.abs(speed)), jnp.max(jnp.abs(torque))
        return ServoMargins(1 - fastest / self.max_speed, 1 - greatest / self.max_torque)


def servo_margins(drive: MotorDrive, crank_torque: Array, speed: Array, acceleration: Array) -> ServoMargins:
    """Margins of the servo motor of a `drive` in a motion with these torques on the crank (N m), crank speeds (rad/s)
    and accelerations (rad/s²), at the same instants. Raises `TypeError` if its motor is not a `Servo`."""
    if not isinstance(drive.motor, Servo):
        raise TypeError(f"only a Servo has limits, not {type(drive.motor).__name__}; write MotorDrive(Servo(...))")
    torque = drive.required_torque(crank_torque, speed, acceleration)
    return drive.motor.margins(drive.motor_speed(speed), torque)
