"""What of an analysis is shown: zero for a value that is only a rounding error, no crank angle for a constant.

A sum that should be zero would be shown as its rounding error, `0.0000106581 nN·m`, unless it is compared with its
terms. The document keeps all digits; only printed output is rounded in this way.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from linkjax._display import ROUNDING, Numbers, above
from linkjax.analysis._words import peak_unit
from linkjax.measures import in_motion, motion_of

Data = dict[str, Any]
CONSTANT, SHAKING = "_constant_speed", "_shaking_"
ENOUGH = 8  # the least number of crank angles at which a quantity must be the same to count as constant
SUMS = ("N", "N m", "W")  # units of measures that are sums of forces and may be zero


def acts_text(data: Data, load: str, show: Numbers) -> str:
    """The ranges of crank angle in which a load with a window acts, as found by the analysis."""
    angles = np.asarray(data["angles"], float)
    end = angles[1] * angles.size if angles.size > 1 else 2 * np.pi
    found = [(float(on), float(off)) for on, off in (data.get("windows") or {}).get(load, ())]
    texts = [f"{show.turned(on)} to {show.turned(end if abs(off) < 1e-9 else off)}" for on, off in found]
    return ", ".join(texts) or "never"


def force_scale(data: Data, suffix: str = "") -> float:
    """The largest force (N) of a motion, which smaller ones are compared with."""
    return _largest(peak["value"] for name, peak in _peaks(data, suffix) if peak_unit(name) == "N")


def torque_scale(data: Data, suffix: str = "") -> float:
    """The largest torque (N m) of a motion, or of the terms of torques: forces times the extent of the machine, and
    kinetic energy per radian."""
    places = [np.asarray(point[axis], float) for point in data.get("points", {}).values() for axis in ("x", "y")]
    extent = _largest(np.ptp(np.concatenate(places[axis::2])) for axis in (0, 1)) if places else 0.0
    inertia = _largest(np.ravel(data.get("reduced", {}).get("inertia", ())))
    torques = [peak["value"] for name, peak in _peaks(data, suffix) if peak_unit(name) == "N·m"]
    speed = data["motion"].get("mean_speed") or 0.0
    return _largest([*torques, force_scale(data, suffix) * extent, inertia * float(speed) ** 2])


def power_scale(data: Data) -> float:
    """The largest power (W) of the torques in the actual motion."""
    return torque_scale(data) * abs(data["motion"].get("mean_speed") or 0.0)


def peak_motions(data: Data) -> dict[str, bool]:
    """The motions whose peaks are shown, by name, and whether each is that at constant speed; only one where a motion
    law gives the machine one motion."""
    if data.get("model", {}).get("method") == "prescribed":
        return {"motion law": False}
    found = {constant for name in data.get("peaks", {}) for constant in (motion_of(name)[1],)}
    return {
        name: constant for name, constant in (("actual motion", False), ("constant speed", True)) if constant in found
    }


def peak_names(data: Data) -> list[str]:
    """The quantities whose peaks are shown, without their motion; those of shaking only if something has a mass, and
    none where neither masses nor loads act, so that all are zero."""
    found = dict.fromkeys(motion_of(key)[0] for key in data["peaks"])
    zero = {key: peak_shown(data, key)[0] == 0 for key in data["peaks"]}
    light = not np.any(data["reduced"]["inertia"])
    if light and all(zero.values()):
        return []
    still = light and all(none for key, none in zero.items() if SHAKING in key)
    return [name for name in found if not (still and SHAKING in name)]


def peak_shown(data: Data, key: str) -> tuple[float, float, float]:
    """A peak: its value, zero if it is below its error or only a rounding error; its crank angle, NaN if the quantity
    is zero or constant; and its error, NaN if the value is only a rounding error. Where friction locks the machine a
    largest value is infinite, without an angle, and there is no smallest one."""
    peak, (name, constant) = data["peaks"][key], motion_of(key)
    value, error, suffix = float(peak["value"]), float(peak["error"]), CONSTANT * constant
    if math.isinf(value) and (data.get(f"friction{suffix}") or {}).get("locks"):
        return math.nan if name.startswith("min_") else value, math.nan, math.nan
    scale = (force_scale if peak_unit(name) == "N" else torque_scale)(data, suffix)
    if above(value, scale) == 0 or abs(value) <= error < math.inf:
        return 0.0, math.nan, error if above(error, scale) else math.nan
    room = max(error if math.isfinite(error) else 0.0, ROUNDING * scale)
    largest = max(abs(float(data["peaks"][in_motion(each, constant)]["value"])) for each in _with_signs(name))
    return value, math.nan if _least(data, name, suffix) >= largest - room else float(peak["angle"]), error


def tied(data: Data, key: str) -> float | None:
    """The crank angle of another peak of equal size; None without one, and for a quantity that is constant."""
    return None if math.isnan(peak_shown(data, key)[1]) else data["peaks"][key].get("tied")


def peak_place(data: Data, key: str, show: Numbers) -> str:
    """The crank angle of a peak, and of another one of equal size."""
    other = tied(data, key)
    return show.turned(peak_shown(data, key)[1]) + ("" if other is None else f" and {show.turned(other)}")


def speed_error(data: Data) -> float:
    """An error bound of the largest and the smallest crank speed (rad/s), from that of δ."""
    return float(data["motion"]["delta_error"]) * abs(float(data["motion"]["mean_speed"]))


def uneven(data: Data) -> bool:
    """Whether the speed fluctuates by more than the error of δ; otherwise it has no largest value."""
    delta, error = (data["motion"][key] for key in ("delta", "delta_error"))
    return delta is not None and not float(delta) <= float(error) < math.inf


def measure_scales(optimum: Data) -> dict[str, float]:
    """The largest force, torque and power among the measures of an optimisation's document, by unit."""
    units, both = optimum["units"], (optimum["before"], optimum["after"])
    found = {unit: [m.get(name) for m in both for name in units if units[name] == unit] for unit in SUMS}
    return {unit: _largest(value for value in values if value is not None) for unit, values in found.items()}


def _peaks(data: Data, suffix: str) -> list[tuple[str, Data]]:
    found = data.get("peaks", {}).items()
    named = ((*motion_of(key), peak) for key, peak in found)
    return [(name, peak) for name, constant, peak in named if constant == bool(suffix)]


def _with_signs(name: str) -> list[str]:
    """The peaks of the same quantity: of largest magnitude, and if it has a sign, the largest and smallest value."""
    quantity = name.partition("_")[2]
    return [f"{way}_{quantity}" for way in (("peak", "max", "min") if peak_unit(name) == "N·m" else ("peak",))]


def _largest(values: Iterable[Any]) -> float:
    return max((abs(float(value)) for value in values if math.isfinite(float(value))), default=0.0)


def _least(data: Data, name: str, suffix: str) -> float:
    """The least magnitude of a quantity over the cycle, from the document; minus infinity if it has no values.

    For the drive torque it is the mean, which equals the peak only if the torque is constant.
    """
    name = name.partition("_")[2]
    if name == "drive_torque" and data["motion"].get("mean_drive_torque") is None:
        return float(np.min(np.abs(data["forces_constant_speed"]["drive_torque"])))
    if name == "drive_torque":
        return abs(float(data["motion"].get("mean_drive_torque") or 0.0))
    if np.size(data["angles"]) < ENOUGH or (not suffix and data["model"]["constant_speed"]):
        return -math.inf
    forces = data["forces_constant_speed" if suffix else "forces"]
    if name.startswith("reaction."):
        joint, _, link = name.removeprefix("reaction.").rpartition(".")
        vector = forces["reactions"][joint][link]
    else:
        vector = forces[name.removesuffix("_force").removesuffix("_moment")]
    size = np.abs(vector["moment"]) if name.endswith("_moment") else np.hypot(vector["fx"], vector["fy"])
    return float(np.min(size))
