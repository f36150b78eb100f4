"""What the motor does over the cycle, at its own shaft."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax.analysis._overload import Overload, overload
from linkjax.measures import Asked, AtMotor, Harmonics, Parts, at_motor, harmonic_family, harmonics_of, values_of
from linkjax.motion import AtNodes, Grid, Steady
from linkjax.sampling import Ahead, Sampler

NAMES = ("mean_motor_torque", "rms_motor_torque", "max_motor_torque", "min_motor_torque", "mean_motor_power",
         "max_motor_power", "min_motor_power")  # fmt: skip
CONSTANT = "_constant_speed"
ORDERS = 12  # of harmonics


class MotorRun(eqx.Module):
    """The motor at its own shaft: `speed` (rad/s), `torque` (N m) and `power` (W) at the crank angles; means over time,
    root mean square, largest and smallest values over the continuous cycle; `energy` at the shaft and `loss` in the
    transmission per cycle (J). In the actual motion, or at constant speed without one.

    `multiplier` is the Floquet multiplier of the cycle: what is left of a small difference in speed after one cycle. It
    is below one where the motion is stable. `stable_states` is the number of stable steady-state motions between 0.02
    and 4 times the nominal speed. Both are None where the drive does not depend on the speed.

    `overload` compares torque and speed with those of the type plate, None where it says nothing. `harmonics` are those
    of drive torque and motor torque, and of the crank speed in an actual motion, up to the twelfth order.
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
    overload: Overload | None
    harmonics: dict[str, Harmonics]


def motor_run(
    machine: Sampler, grid: Grid, at: AtNodes, steady: Steady | None, angles: Any, pose: Any, motion: tuple
) -> MotorRun | None:
    """The motor in the `motion` that has these forces, crank speeds (rad/s) and accelerations (rad/s²) at the crank
    angles (rad), with the pose there; None without a motor."""
    scene = machine.scene
    if scene.motor is None or isinstance(machine, Ahead):  # these few programs are not compiled ahead
        return None
    of = Parts(machine, 96, grid, at, steady=steady)
    asked = [Asked(name if steady is not None else f"{name}{CONSTANT}", "") for name in NAMES]
    found = dict(zip((name.replace("_motor", "") for name in NAMES), values_of(of, asked), strict=True))
    moved = (scene.mechanism, angles, pose) if scene.mechanism.prescribed else (None, angles, None)
    shown = machine.run(at_motor, scene.motor, *moved, *motion)
    if scene.friction:
        shown = machine.run(_known, shown, motion[0].moves)
    period = scene.cycle / scene.speed if steady is None else steady.period
    told = machine.run(_told, shown, found, period, steady, _drive_work(of))
    return MotorRun(**told, overload=overload(of, told["rms_torque"]), harmonics=_harmonics(of))


def _harmonics(of: Parts) -> dict[str, Harmonics]:
    """The harmonics of torques and speed."""
    names = [f"{name}{'' if of.steady_known is not None else CONSTANT}" for name in ("drive_torque", "motor_torque")]
    names += ["crank_speed"] if of.steady_known is not None and not of.scene.mechanism.prescribed else []
    asked = [harmonic_family(name, of.scene) for name in names]
    return dict(zip(names, harmonics_of(of, asked, ORDERS), strict=True))


def _drive_work(of: Parts) -> Any:
    """Mean power on the crank times the period: the work of the drive on the crank per cycle (J)."""
    motion = of.true_motion if of.steady_known is not None else of.constant_speed
    at = of.nodes_in(motion)
    return of.machine.run(_work, of.grid, motion.forces(at).drive_torque)


@compiled_soon
def _known(shown: AtMotor, moves: Array) -> AtMotor:
    """NaN for torque and power where friction locks the machine."""
    return shown._replace(**{name: jnp.where(moves, getattr(shown, name), jnp.nan) for name in ("torque", "power")})


@compiled_soon
def _work(grid: Grid, torque: Array) -> Array:
    weights = grid.half[:, None] * grid.rule.w[None]
    return jnp.sum(weights * torque[: grid.size].reshape(grid.nodes.shape))


@compiled_soon
def _told(
    shown: AtMotor, found: dict[str, Array], period: Array, steady: Steady | None, work: Array
) -> dict[str, Any]:  # fmt: skip
    energy = found["mean_power"] * period
    driven = None if steady is None else steady.driven
    states = (None, None) if driven is None else (driven.multiplier, driven.number)
    more = {"energy": energy, "loss": energy - work, "multiplier": states[0], "stable_states": states[1]}
    return {**shown._asdict(), **found, **more}
