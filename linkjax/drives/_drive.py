"""A motor that drives the crank through a transmission, with the inertia of its rotor.

Crank speed ω and acceleration ε are those of the crank (rad/s, rad/s²), motor speeds those of the motor's own shaft.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_divide
from linkjax._types import as_float
from linkjax.drives._motors import AbstractMotor, NoMotor, check_numbers
from linkjax.drives._transmission import Transmission

STANDARD_GRAVITY = 9.80665  # m/s²; ISO 80000-3


class Breakaway(NamedTuple):
    """Accelerations of a crank at rest (rad/s²) as it would begin to turn `forward` and `backward`. It turns forward if
    the first is above zero, backward if the second is below zero, and `stuck` is true if neither is so."""

    forward: Array
    backward: Array

    @property
    def stuck(self) -> Array:
        """Whether the crank stays at rest."""
        return (self.forward <= 0) & (self.backward >= 0)


class MotorDrive(eqx.Module):
    """A `motor` that drives the crank through a `transmission`; `inertia` is that of the rotor with all that turns on
    the motor's shaft (kg m²).

    The torque that the shaft transmits is τ = T_m(ω_m) - J_m ε_m, and the torque on the crank follows from it with the
    losses of the transmission, by the direction of power. Raises `TypeError` for a motor or transmission of another
    kind, and `ValueError` for a negative inertia.
    """

    motor: AbstractMotor = eqx.field(default_factory=NoMotor)
    transmission: Transmission = eqx.field(default_factory=Transmission)
    inertia: Array = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        for name, kind in (("motor", AbstractMotor), ("transmission", Transmission)):
            given = getattr(self, name)
            if not isinstance(given, kind):
                raise TypeError(f"{name} of a MotorDrive is {given!r}; write e.g. {EXAMPLES[name]}")
        check_numbers("a MotorDrive", {}, {"inertia": self.inertia})

    def motor_speed(self, speed: Array) -> Array:
        """Speed of the motor's shaft (rad/s) at crank speeds (rad/s); the same factor holds for accelerations."""
        return self.transmission.speed_ratio() * speed

    def motor_torque(self, speed: Array) -> Array:
        """Torque of the motor by its characteristic (N m) at crank speeds (rad/s)."""
        return self.motor.torque(self.motor_speed(speed))

    def motor_power(self, speed: Array) -> Array:
        """Mechanical power of the motor (W) at crank speeds (rad/s)."""
        return self.motor_torque(speed) * self.motor_speed(speed)

    def shaft_torque(self, speed: Array, acceleration: Array) -> Array:
        """Torque τ that the motor's shaft transmits (N m), less that which accelerates the rotor."""
        return self.motor_torque(speed) - self.inertia * self.motor_speed(acceleration)

    def crank_torque(self, speed: Array, acceleration: Array, sense: Array | None = None) -> Array:
        """Torque on the crank (N m) at its speed (rad/s) and acceleration (rad/s²). The `sense` of rotation (1 or -1)
        is that of the speed, and forward at rest, unless it is given; see `breakaway`."""
        shaft = self.shaft_torque(speed, acceleration)
        return self.transmission.torque_ratio(shaft * _sense(speed, sense) > 0) * shaft

    def power_loss(self, speed: Array, acceleration: Array, sense: Array | None = None) -> Array:
        """Power loss of the transmission (W), zero or more."""
        shaft = self.shaft_torque(speed, acceleration)
        return shaft * self.motor_speed(speed) - self.crank_torque(speed, acceleration, sense) * speed

    def required_torque(self, crank_torque: Array, speed: Array, acceleration: Array) -> Array:
        """The motor torque (N m) that gives a `crank_torque` (N m) at crank speed and acceleration: the inverse of
        `crank_torque`, whatever the characteristic of the motor."""
        shaft = crank_torque / self.transmission.torque_ratio(crank_torque * _sense(speed) > 0)
        return shaft + self.inertia * self.motor_speed(acceleration)

    def crank_acceleration(self, net: Array, inertia: Array, speed: Array, sense: Array | None = None) -> Array:
        """The crank's acceleration ε (rad/s²) that solves J ε = net + crank_torque(ω, ε), in closed form.

        `net` is Q - ½ J' ω² (N m) and `inertia` the reduced inertia J (kg m²), without the rotor. The right-hand side
        is piecewise linear in ε: power flows to the crank if J T_m exceeds net · J_m · (motor speed / crank speed),
        which decides without a division. The `sense` of rotation (1 or -1) is that of the speed, and forward at rest,
        unless it is given. The result is zero where there is no inertia at all.
        """
        forward = self._forward(net, inertia, speed, _sense(speed, sense))
        return self._solved(net, inertia, speed, forward)

    def effective_inertia(self, net: Array, inertia: Array, speed: Array) -> Array:
        """Reduced inertia with that of the rotor (kg m²), as it resists acceleration in this state: the rotor counts
        with the transmission's losses in the present direction of power."""
        return inertia + self._rotor(self._forward(net, inertia, speed, _sense(speed)))

    def rotor_inertia(self) -> Array:
        """Inertia of the rotor referred to the crank by its kinetic energy (kg m²)."""
        return self.inertia * self.transmission.speed_ratio() ** 2

    def breakaway(self, net: Array, inertia: Array) -> Breakaway:
        """What a crank at rest does under a torque `net` (N m) with the reduced inertia J (kg m²).

        At rest the direction of power does not exist, and the transmission may pass on any torque between those of the
        two directions: for τ > 0 from ratio · efficiency · τ to ratio · τ / efficiency_back. The crank starts forward
        if it accelerates with the losses of forward motion, starts backward if it does so with those of backward
        motion, and otherwise stays at rest. Both cannot be, since forward losses never give a larger torque.
        """
        rest = jnp.zeros_like(net)
        ends = (self._forward(net, inertia, rest, jnp.full_like(net, sense)) for sense in (1.0, -1.0))
        return Breakaway(*(self._solved(net, inertia, rest, end) for end in ends))

    def _forward(self, net: Array, inertia: Array, speed: Array, sense: Array) -> Array:
        """Whether power flows to the crank, for a sense of rotation."""
        rotor = self.inertia * self.transmission.speed_ratio()
        return (inertia * self.motor_torque(speed) - net * rotor) * sense > 0

    def _rotor(self, forward: Array) -> Array:
        return self.transmission.torque_ratio(forward) * self.inertia * self.transmission.speed_ratio()

    def _solved(self, net: Array, inertia: Array, speed: Array, forward: Array) -> Array:
        torque = net + self.transmission.torque_ratio(forward) * self.motor_torque(speed)
        return safe_divide(torque, inertia + self._rotor(forward))


EXAMPLES = {"motor": "DCMotor(24.0, 0.5, 0.1)", "transmission": "Transmission(ratio=5.0, efficiency=0.95)"}


def _sense(speed: Array, given: Array | None = None) -> Array:
    """One for motion forward and for rest, minus one for motion backward, unless it is `given`."""
    return jnp.where(speed < 0, -1.0, 1.0) if given is None else given


def inertia_of_gd2(gd2: Any, weight: bool = False) -> Array:
    """Inertia (kg m²) from the flywheel effect GD²: GD² / 4 in kg m², or GD² / (4 g) if it is a `weight`, in N m²."""
    return as_float(gd2) / (4 * STANDARD_GRAVITY if weight else 4.0)
