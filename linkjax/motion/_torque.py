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
from linkjax.reduction import Reduced

Torque = Callable[[Array, Array, Array], Array]  # N m, at crank angle (rad), speed (rad/s), acceleration (rad/s²)
STEPS = 4  # of Newton's method; the first is exact where the torque is linear in the acceleration


def torque_at(here: Reduced, drive: Scalar | Torque, phi: Scalar, speed: Scalar) -> Any:
    """Drive torque (N m) at a crank angle (rad) and speed (rad/s), with the reduced model `here`; of a function it is
    that with the acceleration that solves J ε + ½ J' ω² = Q + T(φ, ω, ε). Differentiable to any order."""
    if not callable(drive):
        return drive
    known, phi, speed = here.torque - 0.5 * here.slope * speed**2, jnp.asarray(phi), jnp.asarray(speed)

    def missing(rate: Array) -> tuple[Any, Any]:
        return jax.jvp(lambda rate: known + drive(phi, speed, rate) - here.inertia * rate, (rate,), (ones,))

    rate, ones = known / here.inertia, jnp.ones_like(known / here.inertia)
    for _ in range(STEPS):
        left, slope = missing(rate)
        rate = rate - left / slope
    return drive(phi, speed, rate)


def fixed_torque(drive: Scalar | Torque) -> Any:
    """The same torque without derivatives with respect to numbers of the design that it contains."""
    if not callable(drive):
        return jax.lax.stop_gradient(drive)
    plain, contained = jax.closure_convert(drive, *[jnp.zeros(())] * 3)
    contained = jax.lax.stop_gradient(contained)
    return lambda *at: plain(*at, *contained)
