"""What the motor does over the cycle, at its own shaft."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax.drives import MotorDrive
from linkjax.forces import Forces
from linkjax.measures import Asked, Parts, values_of
from linkjax.motion import AtNodes, Grid, Steady
from linkjax.sampling import Ahead, Sampler

NAMES = ("mean_motor_torque", "rms_motor_torque", "max_motor_torque", "min_motor_torque", "mean_motor_power",
         "max_motor_power", "min_motor_power")  # fmt: skip


class MotorRun(eqx.Module):
    """The motor at its own shaft: `speed` (rad/s), `torque` (N m) and `power` (W) at the crank angles; means over time,
    root mean square, largest and smallest values over the continuous cycle; `energy` at the shaft and `loss` in the
    transmission per cycle (J). In the actual motion, or at constant speed without one.

    `multiplier` is the Floquet multiplier of the cycle: what is left of a small difference in speed after one cycle. It
    is below one where the motion is stable. `stable_states` is the number of stable steady-state motions between 0.02
    and 4 times the nominal speed. Both are None where the drive does not depend on the speed.
    """

    speed: Float[Array, " angles"]
    torque: Float[Array, " angles"]
    power: Float[Array, " angles"]
    mean_torque: Array
    rms_torque: Array
    max_torque: Array
    min_torque: Array
    mean_power: Array
    max_power: Array
    min_power: Array
    energy: Array
    loss: Array
    multiplier: Array | None
    stable_states: Array | None


def motor_run(
    machine: Sampler, grid: Grid, at: AtNodes, steady: Steady | None, forces: Any, speed: Any, rate: Any
) -> MotorRun | None:
    """The motor in the motion that has these forces, crank speeds (rad/s) and accelerations (rad/s²) at the crank
    angles; None without a motor."""
    scene = machine.scene
    if scene.motor is None or isinstance(machine, Ahead):  # these few programs are not compiled ahead
        return None
    of = Parts(machine, 96, grid, at, steady=steady)
    asked = [Asked(name if steady is not None else f"{name}_constant_speed", "") for name in NAMES]
    found = dict(zip((name.replace("_motor", "") for name in NAMES), values_of(of, asked), strict=True))
    shown = machine.run(_at_angles, scene.motor, forces, speed, rate)
    period = scene.cycle / scene.speed if steady is None else steady.period
    return machine.run(_told, shown, found, period, steady, _drive_work(of))


def _drive_work(of: Parts) -> Any:
    """Mean power on the crank times the period: the work of the drive on the crank per cycle (J)."""
    motion = of.true_motion if of.steady_known is not None else of.constant_speed
    at = of.nodes_in(motion)
    return of.machine.run(_work, of.grid, motion.forces(at).drive_torque)


@compiled_soon
def _work(grid: Grid, torque: Array) -> Array:
    weights = grid.half[:, None] * grid.rule.w[None]
    return jnp.sum(weights * torque[: grid.size].reshape(grid.nodes.shape))


@compiled_soon
def _at_angles(motor: MotorDrive, forces: Forces, speed: Array, rate: Array) -> tuple[Array, Array, Array]:
    torque, turning = motor.required_torque(forces.drive_torque, speed, rate), motor.motor_speed(speed)
    return turning, torque, torque * turning


@compiled_soon
def _told(
    shown: tuple[Array, Array, Array], found: dict[str, Array], period: Array, steady: Steady | None, work: Array
):
    energy = found["mean_power"] * period
    driven = None if steady is None else steady.driven
    states = (None, None) if driven is None else (driven.multiplier, driven.number)
    return MotorRun(*shown, **found, energy=energy, loss=energy - work, multiplier=states[0], stable_states=states[1])
