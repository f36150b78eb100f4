"""Whether a motor starts its machine from rest, at every crank angle."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import StructureError
from linkjax.motion import Grid, make_grid, reduced_in

PLACES = 33  # in every panel of the cycle grid
GOLDEN, HALVINGS = 0.6180339887498949, 40


class Starting(NamedTuple):
    """The start from rest: torque of the motor on the crank (N m), greatest static torque of the loads against it
    (N m) and its crank angle (rad), the `margin` and whether the motor starts the machine at every angle."""

    motor_torque: Float[Array, ""]
    load_torque: Float[Array, ""]
    angle: Float[Array, ""]
    margin: Float[Array, ""]
    everywhere: Bool[Array, ""]


def starting_torque(scene: Scene | ReadyScene) -> Starting:
    """The starting torque of the motor against the static torque of weight, loads and friction over the cycle.

    The margin is the motor's torque at rest, on the crank with the losses of the transmission, over the greatest static
    load torque, less one: below zero the machine does not start from there. It is infinite where no load resists. All
    opposing loads resist with their full magnitude, friction is static, and where it locks the machine the torque is
    infinite; loads that depend on the speed are those at rest. Its derivatives with respect to the design are exact.
    Raises `StructureError` for a scene without a motor, and if the driver follows a motion law.
    """
    made = ready(scene)
    if made.scene.mechanism.prescribed:
        raise StructureError(
            made.scene.mechanism.driving_link, "has a motion law, so it cannot be started", "delete it"
        )
    if made.scene.motor is None:
        raise StructureError("motor", "there is none to start the machine", "add a motor, e.g. [motor] in a scene file")
    return _starting(made, make_grid(made, 8))


@compiled_soon
def _starting(made: ReadyScene, grid: Grid) -> Starting:
    motor, zero = made.scene.motor, jnp.zeros(())
    assert motor is not None
    torque = motor.crank_torque(zero, zero)

    def resisting(panel: Array, x: Array) -> Array:
        phi = grid.middle[panel] + grid.half[panel] * x
        return -reduced_in(made, grid, phi, panel, speed=zero, advance=lambda _: zero, at_rest=True).torque

    x = jnp.asarray(np.cos(np.pi * (np.arange(PLACES) + 0.5) / PLACES)[::-1] / np.cos(np.pi * 0.5 / PLACES))
    panels = jnp.arange(grid.panels, dtype=jnp.int32)
    values = jax.vmap(lambda panel: jax.vmap(lambda x: resisting(panel, x))(x))(panels)
    values = jnp.where((grid.half > 1e-9 * grid.length)[:, None], values, -jnp.inf)
    best = jnp.argmax(jax.lax.stop_gradient(values))
    panel, k = (best // PLACES).astype(jnp.int32), best % PLACES

    def shrink(_, ends):
        low, high = ends
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        better = resisting(panel, a) > resisting(panel, b)
        return jnp.where(better, low, a), jnp.where(better, b, high)

    ends = x[jnp.maximum(k - 1, 0)], x[jnp.minimum(k + 1, PLACES - 1)]
    low, high = jax.lax.fori_loop(0, HALVINGS, shrink, ends)
    inner = 0.5 * (low + high)
    edge = jnp.where(resisting(panel, x[k]) >= resisting(panel, inner), x[k], inner)
    place = jax.lax.stop_gradient(edge)
    load = resisting(panel, place)
    angle = jnp.mod(grid.middle[panel] + grid.half[panel] * place, grid.length)
    margin = safe_divide(torque, jnp.where(load > 0, load, 0.0), jnp.inf) - 1
    return Starting(torque, load, angle, margin, torque > jnp.maximum(load, 0.0))
