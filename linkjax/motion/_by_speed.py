"""Torques on the crank that depend on its speed: the motor, dampers, resistances, friction.

The kinetic energy of the machine with its rotor, E = ½ (J + J_r) ω², obeys dE/dφ = Q(φ, ω) + T, where T is the torque
of the motor on the crank, less the losses of the transmission, before it accelerates the rotor. Without a motor, T is
the constant torque that gives the wanted mean speed. Friction depends on the acceleration as well, and so on T.
Source: equation of motion as in `linkjax.reduction`, in the form of the work-energy theorem.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_divide, taken
from linkjax._tree import node
from linkjax.drives import MotorDrive
from linkjax.forces import Basis, Contacts, basis_of_pose, contacts_of, friction_of_pose, frictions_of, specks
from linkjax.kinematics import Pose
from linkjax.loads import AbstractLoad
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.motion._grid import Grid, Place
from linkjax.motion._panels import polynomials
from linkjax.motion._rubbed import FRICTION
from linkjax.reduction import Moving, Reduced, by_speed, shares_at
from linkjax.sampling import Sampler


class CrankAcceleration(NamedTuple):
    """What accelerates the crank beside friction: the motor, the torque of all loads less ½ J' ω² (N m), the reduced
    inertia (kg m²), the crank speed (rad/s), and a constant torque (N m) where there is no motor; None at constant
    speed."""

    motor: MotorDrive | None
    torque: Array
    inertia: Array
    speed: Array
    constant: Array | None

    def __call__(self, torque: Array) -> Array:
        """The acceleration (rad/s²) that the torque of friction leaves."""
        if self.constant is None:
            return jnp.zeros_like(torque)
        if self.motor is None:
            return safe_divide(self.torque + torque + self.constant, self.inertia)
        return self.motor.crank_acceleration(self.torque + torque, self.inertia, self.speed)


class FrictionTorque(NamedTuple):
    """The torque of friction, reduced to the crank (N m), at places, whether the machine moves with it, and the
    frictions of the joints with the acceleration, with the axes of the places last (see `Frictions`); None with
    meshes."""

    torque: Array
    moves: Array
    near: Any


@node
class BySpeed:
    """The loads of a scene that depend on the speed, by their numbers, the motor (None: a constant torque), the inertia
    of the rotor on the crank (kg m²), and the scene itself if it has friction."""

    loads: tuple[AbstractLoad, ...]
    motor: MotorDrive | None
    rotor: Array
    rough: ReadyScene | None
    numbers: tuple[int, ...] = eqx.field(static=True)

    @property
    def placed(self) -> bool:
        """Whether they need the pose: see `Moving`."""
        return bool(self.numbers) or self.rough is not None

    def loaded(self, here: Reduced, moving: Moving | None, speed: Array, constant: Array | None = None) -> Reduced:
        """The reduced model with the shares of these loads at the crank speed (rad/s), and with that of friction: at
        the acceleration that follows from the motor and a `constant` torque (N m) of the drive, or at constant speed
        where that is None."""
        return self.with_friction(here, moving, speed, constant)[0]

    def with_friction(
        self, here: Reduced, moving: Moving | None, speed: Array, constant: Array | None = None, near: Any = None,
        linearised: bool = False,
    ) -> tuple[Reduced, FrictionTorque | None]:  # fmt: skip
        """The same, and the frictions, None without any. From frictions and acceleration that are `near`, if known, it
        takes one step of Newton's method; see `frictions_of`. From interpolated ones it takes two."""
        if moving is None:
            return here, None
        here = self._against(here, moving, speed)
        if self.rough is None:
            return here, None
        if near is None and moving.near is not None:
            near = jax.lax.stop_gradient(self._friction(here, moving, speed, constant, moving.near, True).near)
            near = jax.tree.map(lambda new, old: jnp.where(jnp.isfinite(new), new, old), near, moving.near)
        least = None if near is None else specks(jax.lax.stop_gradient(near))
        rubbed = functools.partial(self._friction, linearised=linearised, least=least)
        if jnp.ndim(speed) == 2:
            rubbed = jax.vmap(rubbed, (0, 0, 0, None, 0))
        found = rubbed(here, moving, speed, constant, near)
        return here._replace(torque=here.torque + found.torque, by_load={**here.by_load, FRICTION: found.torque}), found

    def estimate(self, here: Reduced, moving: Moving, speed: Array) -> Array:
        """The torque of friction at constant speed (N m), from the reactions without friction."""
        here = self._against(here, moving, speed)
        contacts = self.contacts(moving, speed)
        none = jnp.zeros_like(contacts.senses)
        c = -contacts.senses * contacts.sizes(contacts.reactions(none, jnp.zeros_like(speed)))
        return contacts.torque(c)

    def _against(self, here: Reduced, moving: Moving, speed: Array) -> Reduced:
        """The reduced model with the loads that depend on the speed."""
        loads = dict(zip(self.numbers, self.loads, strict=True))
        shares = shares_at(loads, moving._replace(basis=None, near=None), speed)
        return here._replace(torque=sum(shares.values(), here.torque), by_load={**here.by_load, **shares})

    def contacts(self, moving: Moving, speed: Array) -> Contacts:
        """The joints with friction at places with one axis or none."""
        assert self.rough is not None
        given = moving.basis, moving.pose, moving.phi, moving.side, moving.active, speed
        return contacts_of(self.rough.scene, self.rough.instant, *given)

    def _friction(
        self, here: Reduced, moving: Moving, speed: Array, constant: Array | None, near: Any, linearised: bool,
        least: tuple[Array, Array] | None = None,
    ) -> FrictionTorque:  # fmt: skip
        """The frictions at places with one axis or none."""
        made, half = self.rough, 0.5 * here.slope * speed**2
        assert made is not None
        left = CrankAcceleration(self.motor, here.torque - half, here.inertia, speed, constant)
        if moving.basis is not None:
            contacts = self.contacts(moving, speed)
            found = frictions_of(contacts, left, near, linearised, least)
            return FrictionTorque(contacts.torque(found.values), found.found, (found.values, found.rate))

        def one(moving: Moving, torque: Array, inertia: Array, speed: Array) -> tuple[Array, Array]:
            at = made.instant(moving.phi, moving.side, speed)
            own = left._replace(torque=torque, inertia=inertia, speed=speed)
            return friction_of_pose(made.scene, moving.pose, at, moving.active, speed, own)

        one = jax.vmap(one) if jnp.ndim(speed) else one
        return FrictionTorque(*one(moving, left.torque, left.inertia, speed), None)

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
    (N m) in addition; its mean torque on the crank (N m); the Floquet multiplier of the cycle (one is neutral, or there
    is no motion; below one is stable), and what the collocation keeps of an error in energy, which is more where a
    motor is too stiff for its nodes; whether a steady-state motion was found, the number of stable ones in the range of
    speeds, and, where there is none, the gain of energy (J) over the nearest cycle; and frictions and accelerations at
    the nodes (see `FrictionTorque`)."""

    torques: BySpeed
    constant: Array
    mean_torque: Array
    multiplier: Array
    kept: Array
    found: Array
    number: Array
    gain: Array
    near: Any

    def rise(self, here: Reduced, moving: Moving | None, speed: Array) -> Array:
        """dE/dφ (N m) at places, at this crank speed (rad/s); `here` is without the loads that depend on it."""
        return self.torques.rise(self.torques.loaded(here, moving, speed, self.constant), speed, self.constant)


def speed_dependent(scene: Scene) -> bool:
    """Whether the motion of a scene depends on torques that depend on the speed."""
    return not scene.mechanism.prescribed and (scene.motor is not None or on_pose(scene))


def on_pose(scene: Scene) -> bool:
    """Whether the torques of a scene that depend on the speed need the pose: loads and friction, but not a motor."""
    return bool(by_speed(scene) or scene.friction)


def torques_of(made: Scene | ReadyScene) -> BySpeed:
    """The torques of a scene that depend on its speed; with friction it must be ready."""
    scene = made.scene if isinstance(made, ReadyScene) else made
    numbers, motor = by_speed(scene), scene.motor
    rotor = jnp.zeros_like(scene.speed) if motor is None else motor.rotor_inertia()
    rough = ready(made) if scene.friction else None
    return BySpeed(tuple(scene.loads[i] for i in numbers), motor, rotor, rough, numbers)


def whole(machine: Sampler) -> Scene | ReadyScene:
    """What `torques_of` needs of a machine."""
    return machine.ready if machine.scene.friction else machine.scene


def moving_at(
    torques: BySpeed, grid: Grid, pose: Pose, phi: Array, panel: Array, active: Array | None = None
) -> Moving | None:
    """What loads that depend on the speed, and friction, need at places in panels of the grid, and which loads act
    there if not those of the panels; None if there are none."""
    if not torques.placed:
        return None
    acts = taken(grid.active, panel) if active is None else active
    found, rough = Moving(pose, phi, taken(grid.middle, panel), acts), torques.rough
    if rough is None:
        return found

    def basis(moving: Moving) -> Basis | None:
        at = rough.instant(moving.phi, moving.side)
        return basis_of_pose(rough.scene, moving.pose, at, moving.active, torques.numbers)

    if jnp.ndim(phi):
        basis = jax.vmap(basis, out_axes=-1)
    if jnp.ndim(phi) == 2:
        basis = jax.vmap(basis)
    return found._replace(basis=basis(found))


def near_by(moving: Moving | None, grid: Grid, near: Any, panel: Array, x: Array) -> Moving | None:
    """The same at coordinates of panels, with frictions and accelerations from those at the nodes."""
    if moving is None or near is None:
        return moving
    near, x = jax.lax.stop_gradient((near, x))
    return moving._replace(near=tuple(between(grid, rows, panel, x) for rows in near))


def between(grid: Grid, rows: Array, panel: Array, x: Array) -> Array:
    """Values at coordinates of panels, axes of places last, from those at the nodes, whose axes are those of panels and
    of nodes, with any between them."""
    values = polynomials(grid.n, x)
    series = taken(rows @ jnp.asarray(grid.rule.series.T), panel)
    if rows.ndim == 3:
        return jnp.moveaxis(jnp.sum(values[..., None, :] * series, axis=-1), -1, 0)
    return jnp.sum(values * series, axis=-1)


def first_of(moving: Moving | None, count: int) -> Moving | None:
    """The same at the first so many of several places."""
    if moving is None:
        return None
    first = jax.tree.map(lambda leaf: leaf[:count], moving._replace(basis=None, near=None))
    rest = jax.tree.map(lambda leaf: leaf[..., :count], (moving.basis, moving.near))
    return first._replace(basis=rest[0], near=rest[1])


def at_speed(
    scene: Scene | ReadyScene, grid: Grid, place: Place, pose: Pose, here: Reduced, speed: Array, constant: Any = None
) -> Reduced:
    """The reduced model at places of the grid with the loads that depend on the speed (rad/s), and with friction; see
    `BySpeed.loaded`."""
    torques = torques_of(scene)
    return torques.loaded(here, moving_at(torques, grid, pose, place.phi, place.panel), speed, constant)
