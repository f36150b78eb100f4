"""Torques on the crank that depend on its speed: the motor, dampers, resistances.

The kinetic energy of the machine with its rotor, E = ½ (J + J_r) ω², obeys dE/dφ = Q(φ, ω) + T, where T is the torque
of the motor on the crank, less the losses of the transmission, before it accelerates the rotor. Without a motor, T is
the constant torque that gives the wanted mean speed.
Source: equation of motion as in `linkjax.reduction`, in the form of the work-energy theorem.
"""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import taken
from linkjax._tree import node
from linkjax.drives import MotorDrive
from linkjax.kinematics import Pose
from linkjax.loads import AbstractLoad
from linkjax.machine import Scene
from linkjax.motion._grid import Grid, Place
from linkjax.reduction import Moving, Reduced, by_speed, shares_at


@node
class BySpeed:
    """The loads of a scene that depend on the speed, by their numbers, the motor (None: a constant torque), and the
    inertia of the rotor on the crank (kg m²)."""

    loads: tuple[AbstractLoad, ...]
    motor: MotorDrive | None
    rotor: Array
    numbers: tuple[int, ...] = eqx.field(static=True)

    def loaded(self, here: Reduced, moving: Moving | None, speed: Array) -> Reduced:
        """The reduced model with the shares of these loads at the crank speed (rad/s)."""
        if moving is None:
            return here
        shares = shares_at(dict(zip(self.numbers, self.loads, strict=True)), moving, speed)
        return here._replace(torque=sum(shares.values(), here.torque), by_load={**here.by_load, **shares})

    def rise(self, here: Reduced, speed: Array, constant: Array) -> Array:
        """dE/dφ (N m): the reduced torque with all loads, and that of the drive. `here` has all loads, and its inertia
        is without the rotor."""
        if self.motor is None:
            return here.torque + constant
        half = 0.5 * here.slope * speed**2
        rate = self.motor.crank_acceleration(here.torque - half, here.inertia, speed)
        return (here.inertia + self.rotor) * rate + half


@node
class Driven:
    """A steady-state motion under torques that depend on the speed: these torques; a constant torque of the drive
    (N m) in addition; its mean torque on the crank (N m); the Floquet multiplier of the cycle (one is neutral, below
    one is stable), and what the collocation keeps of an error in energy, which is more where a motor is too stiff for
    its nodes; whether a steady-state motion was found, the number of stable ones in the range of speeds, and, where
    there is none, the gain of energy (J) over the nearest cycle."""

    torques: BySpeed
    constant: Array
    mean_torque: Array
    multiplier: Array
    kept: Array
    found: Array
    number: Array
    gain: Array

    def rise(self, here: Reduced, moving: Moving | None, speed: Array) -> Array:
        """dE/dφ (N m) at places, at this crank speed (rad/s); `here` is without the loads that depend on it."""
        return self.torques.rise(self.torques.loaded(here, moving, speed), speed, self.constant)


def speed_dependent(scene: Scene) -> bool:
    """Whether the motion of a scene depends on torques that depend on the speed."""
    return not scene.mechanism.prescribed and (scene.motor is not None or bool(by_speed(scene)))


def torques_of(scene: Scene) -> BySpeed:
    """The torques of a scene that depend on its speed."""
    numbers, motor = by_speed(scene), scene.motor
    rotor = jnp.zeros_like(scene.speed) if motor is None else motor.rotor_inertia()
    return BySpeed(tuple(scene.loads[i] for i in numbers), motor, rotor, numbers)


def moving_at(numbers: tuple[int, ...], grid: Grid, pose: Pose, phi: Array, panel: Array) -> Moving | None:
    """What loads that depend on the speed need at places in panels of the grid; None if there are none."""
    if not numbers:
        return None
    return Moving(pose, phi, taken(grid.middle, panel), taken(grid.active, panel))


def at_speed(scene: Scene, grid: Grid, place: Place, pose: Pose, here: Reduced, speed: Array) -> Reduced:
    """The reduced model at places of the grid with the loads that depend on the speed (rad/s)."""
    torques = torques_of(scene)
    return torques.loaded(here, moving_at(torques.numbers, grid, pose, place.phi, place.panel), speed)
