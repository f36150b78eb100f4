"""The load of a motor against its type plate, and against the limits of a servo motor."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._display import Numbers
from linkjax._numerics import taken
from linkjax.drives import InductionCircuit, InductionMotor
from linkjax.measures import Asked, Parts, rows
from linkjax.motion import Rows, every_row

OVER = 1e-9  # relative: an excess below it is a rounding error


class Overload(eqx.Module):
    """The motor at its own shaft against its type plate. `rated_torque` and `torque_limit` (the breakdown torque, or
    the limit of a servo motor; N m) and `speed_limit` (rad/s) are None where the plate does not give them.

    `peak_torque` (N m) and `peak_speed` (rad/s) are the largest magnitudes over the continuous cycle, with their crank
    angles (rad). The ratios compare them: `rms_over_rated` above one is too warm in continuous operation,
    `peak_over_limit` and `speed_over_limit` above one are motions that the motor cannot follow.
    """

    rated_torque: Array | None
    torque_limit: Array | None
    speed_limit: Array | None
    peak_torque: Array
    angle_of_peak_torque: Array
    peak_speed: Array | None
    angle_of_peak_speed: Array | None
    rms_over_rated: Array | None
    peak_over_rated: Array | None
    peak_over_limit: Array | None
    speed_over_limit: Array | None


def overload(of: Parts, rms: Array) -> Overload | None:
    """The load of the motor in the motion of these parts, or at constant speed without one, with the root mean square
    of its torque (N m); None where the type plate says nothing."""
    drive = of.scene.motor
    assert drive is not None
    motor = drive.motor
    plate = motor.rated_torque(), motor.torque_limit(), motor.speed_limit()
    if all(one is None for one in plate):
        return None
    names = ["torque"] + ["speed"] * (plate[2] is not None)
    suffix = "" if of.steady_known is not None else "_constant_speed"
    found = every_row([rows(of, Asked(f"peak_motor_{name}{suffix}", "")) for name in names])
    return of.machine.run(_compared, plate, rms, *(of.machine.run(_largest, each) for each in found))


@compiled_soon
def _largest(every: Rows) -> tuple[Array, Array]:
    """The largest of all magnitudes, and its crank angle (rad)."""
    sizes = every.size()
    best = jnp.argmax(sizes)
    return taken(sizes, best), taken(every.angle, best)


@compiled_soon
def _compared(plate: tuple, rms: Array, torque: tuple[Array, Array], speed: Any = None) -> Overload:
    rated, limit, fastest = plate

    def over(value: Any, bound: Array | None) -> Array | None:
        return None if bound is None or value is None else value / bound

    turning, where = (None, None) if speed is None else speed
    return Overload(
        rated, limit, fastest, torque[0], torque[1], turning, where,
        over(rms, rated), over(torque[0], rated), over(torque[0], limit), over(turning, fastest),
    )  # fmt: skip


def overload_document(found: Overload | None, motor: Any) -> dict[str, Any] | None:
    """The same as plain numbers, with what the limit of the torque is."""
    if found is None:
        return None
    limit = "breakdown torque" if isinstance(motor, InductionMotor | InductionCircuit) else "torque limit"
    numbers = {name: None if value is None else float(value) for name, value in vars(found).items()}
    return {**numbers, "limit_is": None if found.torque_limit is None else limit}


def overload_rows(load: dict[str, Any] | None, show: Numbers) -> list[tuple[str, str]]:
    """The load of the motor in words, and a sentence for every limit that is exceeded."""
    if load is None:
        return []
    parts = []
    if load["rated_torque"] is not None:
        rated = show.quantity(load["rated_torque"], "N·m")
        parts.append(f"{load['rms_over_rated']:.4g} rms and {load['peak_over_rated']:.4g} peak of rated torque {rated}")
    if load["torque_limit"] is not None:
        most = show.quantity(load["torque_limit"], "N·m")
        parts.append(f"{load['peak_over_limit']:.4g} peak of {load['limit_is']} {most}")
    if load["speed_limit"] is not None:
        parts.append(f"{load['speed_over_limit']:.4g} of speed limit {show.speed(load['speed_limit'])}")
    return [("motor load", ", ".join(parts)), *(("motor overload", text) for text in [_excess(load, show)] if text)]


def _excess(load: dict[str, Any], show: Numbers) -> str:
    """What is exceeded, by how much and where; empty if nothing is."""
    found = []

    def more(key: str) -> float:
        ratio = load[key]
        return 0.0 if ratio is None or ratio <= 1 + OVER else 100 * (ratio - 1)

    if by := more("peak_over_limit"):
        peak, place = show.quantity(load["peak_torque"], "N·m"), show.turned(load["angle_of_peak_torque"])
        found.append(f"the torque {peak} at {place} exceeds the {load['limit_is']} by {by:.3g} %")
    if by := more("speed_over_limit"):
        peak, place = show.speed(load["peak_speed"]), show.turned(load["angle_of_peak_speed"])
        found.append(f"the speed {peak} at {place} exceeds the speed limit by {by:.3g} %")
    if found:
        found = ["; ".join(found) + ": the motor cannot follow this motion"]
    if by := more("rms_over_rated"):
        found.append(f"the rms torque exceeds the rated torque by {by:.3g} %: too warm in continuous operation")
    return "; ".join(found)
