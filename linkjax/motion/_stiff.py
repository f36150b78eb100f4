"""Stiff drives: a motor whose speed settles within a small part of a crank turn.

A torque that falls with the speed, T' = dT/dω < 0, brings the speed to its course with the time constant J / |T'|. An
explicit method must take steps of a few time constants, however smooth the motion is; an implicit one need not.
Measured on a slider-crank, `Kvaerno5` takes the time of `Dopri8` where the time constant is 1e-4 of the time of a turn,
and a tenth of it at 4e-5.
Source: Hairer, Wanner, Solving Ordinary Differential Equations II, 1996, ch. IV.1.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._types import Scalar, Tracer
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.motion._by_speed import speed_dependent
from linkjax.motion._torque import Torque, acceleration_at
from linkjax.motion._windows import at_crank_angles
from linkjax.reduction import reduced_model

PART = 1e-4  # of the time of a crank turn: a drive with a shorter time constant is stiff
IMPLICIT = 1e-8  # the least tolerance of an implicit method
ANGLES, SPEEDS = 12, 9  # places in the cycle, and speeds up to twice that of the scene, that are looked at


def is_stiff(scene: Scene | ReadyScene) -> bool:
    """Whether motor and loads of a scene bring the crank to its speed with a time constant that, somewhere in the cycle
    and at some speed up to twice that of the scene, is below 1e-4 of the time of a crank turn at the scene's speed.
    Runs then take the implicit method `Kvaerno5` of diffrax. False where it cannot be decided, inside of jax
    transformations."""
    made = ready(scene)
    if not speed_dependent(made.scene) or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(made)):
        return False
    made = made.of(at_crank_angles(made))
    rate = float(_fastest(made))
    return rate * PART * 2 * np.pi > float(made.scene.speed)


@compiled_soon
def _fastest(made: ReadyScene) -> Array:
    """The greatest rate (1/s) at which the crank speed settles."""
    cycle, nominal = made.scene.cycle, made.scene.speed

    def gain(speed: Array, phi: Array) -> Array:
        return acceleration_at(made.scene.motor, reduced_model(made, phi, speed=speed), None, phi, speed)

    phi = jnp.asarray((np.arange(ANGLES) + 0.37) * (cycle / ANGLES))
    speeds = nominal * jnp.asarray(np.linspace(0.02, 2.0, SPEEDS))
    rates = jax.vmap(lambda phi: jax.vmap(lambda speed: jax.jacfwd(gain)(speed, phi))(speeds))(phi)
    return jnp.max(jnp.where(jnp.isfinite(rates), -rates, 0.0))


def solver_for(made: ReadyScene, drive: Scalar | Torque | None, stiff: bool | None = None) -> Any:
    """The method of diffrax: `Kvaerno5` for a stiff drive, otherwise `Dopri8`; `stiff` if it is known."""
    import diffrax

    stiff = (drive is None and is_stiff(made)) if stiff is None else stiff
    return diffrax.Kvaerno5() if stiff else diffrax.Dopri8()


def control_for(solver: Any, tolerance: Any) -> Any:
    """The step control of diffrax for a relative tolerance; for an implicit method it is at least 1e-8, and the
    absolute tolerance is as large: the residual of its equations has rounding errors times the stiffness."""
    import diffrax

    if isinstance(solver, diffrax.AbstractImplicitSolver):
        tolerance = jnp.maximum(tolerance, IMPLICIT)
        return diffrax.PIDController(rtol=tolerance, atol=tolerance)
    return diffrax.PIDController(rtol=tolerance, atol=tolerance * 1e-3)
