"""Reduction to a translating link: m dv/dt + ½ v² dm/ds = F, with mass and force reduced to one of its points.

Source: equivalent (reduced) mass and force, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 15.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import safe_divide
from linkjax._types import Scalar, known
from linkjax._units import nearest
from linkjax.groups import FRAME
from linkjax.kinematics import pose
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import StructureError
from linkjax.reduction._reduction import reduced_model

STOPPED = 1e-10  # rad: closer to a stop of the point than this, the reduced mass is not given


class ReducedMass(NamedTuple):
    """Reduced to a point: the mass m (kg), its slope dm/ds (kg/m) along the path s of the point, and the force F (N) of
    gravity and all loads along its velocity."""

    mass: Array
    slope: Array
    force: Array


def reduced_mass(
    scene: Scene | ReadyScene, phi: Scalar, point: str, side: Scalar | None = None, speed: Scalar | None = None
) -> ReducedMass:
    """Mass and force of the whole machine reduced to a `point`, e.g. of a slider, at the crank angle `phi` (rad).

    The mass has, at the speed v of the point, the kinetic energy of the machine, m = 2 E / v², and the force has the
    power of gravity and loads, F v. Path and force are positive along the velocity of the point, as the crank turns
    forward. A torque T of the drive adds T / (ds/dφ) to the force. With all forces, m dv/dt + ½ v² dm/ds = F. `phi`
    and all results are scalars; `side` and `speed` are as for `reduced_model`, and neither a motor nor its rotor is
    included.

    Where the point stops (at dead centres) its reduced mass is unbounded: raises ValueError, and under jax
    transformations all three are infinite. Raises `StructureError` for a point that the machine does not have, or that
    belongs to the frame.
    """
    made = ready(scene)
    owners = made.scene.mechanism.owners()
    if owners.get(point, FRAME) == FRAME:
        moving = [name for name, link in owners.items() if link != FRAME]
        raise StructureError(point, "is not a point of a moving link", nearest(point, moving))
    here = reduced_model(made, phi, side, speed)
    at = pose(made.mechanism, jnp.asarray(phi)).points[point]
    square = at.dr.squared()
    stops = square <= STOPPED**2 * at.ddr.squared()
    if (found := known(stops)) is not None and np.any(found):
        degrees = math.degrees(float(phi))  # not traced, since what depends on it is not
        problem = f"point {point!r} stops at {degrees:.6g} degrees of crank angle, so that the mass reduced to it is"
        raise ValueError(f"{problem} unbounded there; choose another crank angle or point")
    square = jnp.where(stops, 1.0, square)
    rate = jnp.sqrt(square)  # ds/dφ
    change = here.slope - 2 * here.inertia * safe_divide(at.dr.dot(at.ddr), square)
    values = here.inertia / square, change / (square * rate), here.torque / rate
    return ReducedMass(*(jnp.where(stops, jnp.inf, value) for value in values))
