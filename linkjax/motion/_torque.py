"""The drive torque as a function T(φ, ω, ε) of crank angle, speed and acceleration.

A motor, a brake or friction is such a function. A constant is the special case that quadrature takes as well.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import Scalar
from linkjax.drives import MotorDrive
from linkjax.reduction import Reduced

Torque = Callable[[Array, Array, Array], Array]  # N m, at crank angle (rad), speed (rad/s), acceleration (rad/s²)
STEPS = 12  # of Newton's method; the first is exact where the torque is linear in the acceleration
LEFT = 1e-9  # of the torques: what may be left of the equation of motion


def torque_at(here: Reduced, drive: Scalar | Torque, phi: Scalar, speed: Scalar) -> Any:
    """Drive torque (N m) at a crank angle (rad) and speed (rad/s), with the reduced model `here`; of a function it is
    that with the acceleration that solves J ε + ½ J' ω² = Q + T(φ, ω, ε). It is infinite where none was found, or where
    the effective inertia J - dT/dε is not positive. Differentiable to any order."""
    if not callable(drive):
        return drive
    known, phi, speed = here.torque - 0.5 * here.slope * speed**2, jnp.asarray(phi), jnp.asarray(speed)

    def missing(rate: Array) -> tuple[Any, Any]:
        return jax.jvp(lambda rate: known + drive(phi, speed, rate) - here.inertia * rate, (rate,), (ones,))

    def step(_: Any, rate: Array) -> Array:
        left, slope = missing(rate)
        return rate - left / slope

    start = known / here.inertia
    ones = jnp.ones_like(start)
    rate = jax.lax.fori_loop(0, STEPS, step, start)
    torque = drive(phi, speed, rate)
    left, slope = jax.lax.stop_gradient(missing(rate))
    size = jax.lax.stop_gradient(jnp.abs(known) + jnp.abs(torque) + jnp.abs(here.inertia * rate))
    solved = jnp.abs(left) <= max(LEFT, 100 * float(jnp.finfo(size.dtype).eps)) * size
    return jnp.where(solved & (slope < 0), torque, jnp.inf)


def acceleration_at(
    motor: MotorDrive | None, here: Reduced, drive: Scalar | Torque | None, phi: Scalar, speed: Scalar,
    sense: Scalar | None = None,
) -> Array:  # fmt: skip
    """Angular acceleration of the crank (rad/s²), with the reduced model `here` of all loads; `drive` is its torque
    (N m), or None for the `motor`, with its rotor, if there is one. `sense` is that of the rotation (1 or -1), for the
    losses of the transmission; by default that of the speed."""
    speed = jnp.asarray(speed)
    net = here.torque - 0.5 * here.slope * speed**2
    if drive is not None:
        return (net + torque_at(here, drive, phi, speed)) / here.inertia
    if motor is None:
        return net / here.inertia
    return motor.crank_acceleration(net, here.inertia, speed, sense)


def fixed_torque(drive: Scalar | Torque | None) -> Any:
    """The same torque without derivatives with respect to numbers of the design that it contains."""
    if not callable(drive):
        return jax.lax.stop_gradient(drive)
    plain, contained = jax.closure_convert(drive, *[jnp.zeros(())] * 3)
    contained = jax.lax.stop_gradient(contained)
    return lambda *at: plain(*at, *contained)
