"""The registered measures of an analysed cycle, without a second computation."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np

from linkjax._results import Result
from linkjax.analysis._cycle import Cycle
from linkjax.measures import MEASURES, evaluate, in_motion, named, no_transmission_angle, peak_names

NONE: Any = SimpleNamespace(
    delta=None, max_speed=None, min_speed=None, steady_state_margin=None, min_inertia_ratio=None, mean_drive_torque=None
)


def measured(cycle: Cycle) -> dict[str, float]:
    """Every measure in `MEASURES` that an analysis holds and the scene has, by name, in their order: those of the
    package. Those that do not exist are omitted: those of an actual motion that is missing, and all but the assembly
    margin of a machine that cannot be assembled."""
    cycle = jax.device_get(cycle)
    motion, wheel, missing = cycle.steady or NONE, cycle.flywheel, cycle.missing
    lost = Result(int(cycle.result)) is Result.CANNOT_BE_ASSEMBLED
    limits = [least.value for sides in cycle.margins.values() for least in sides.values()]
    turned = np.concatenate([np.zeros(0), *map(np.ravel, cycle.transmission_ends.values())])
    none = no_transmission_angle(cycle.scene.mechanism)
    found = {
        "delta": motion.delta,
        "max_crank_speed": motion.max_speed,
        "min_crank_speed": motion.min_speed,
        "slow_down": cycle.steady and 1 - motion.min_speed * motion.period / cycle.scene.cycle,
        "energy_per_cycle": _energy(cycle),
        "steady_state_margin": (missing or motion).steady_state_margin,
        "min_inertia_ratio": motion.min_inertia_ratio,
        "mean_drive_torque": motion.mean_drive_torque,
        "mean_drive_power": cycle.steady and motion.mean_drive_torque * cycle.scene.cycle / motion.period,
        "flywheel_for_target_delta": wheel and wheel.for_target_delta,
        "min_margin": min(limits, default=1.0),
        "min_transmission_angle": (
            None if none else np.min(0.5 * np.pi - np.abs(turned - 0.5 * np.pi), initial=0.5 * np.pi)
        ),
        "rms_shaking_force_constant_speed": cycle.rms_shaking_force_constant_speed,
    }
    for constant, peak in ((False, cycle.peaks), (True, cycle.peaks_constant_speed)):
        if peak is None:
            continue
        by_name = dict(zip(peak_names(cycle.scene), np.asarray(peak.value), strict=True))
        reactions = [value for name, value in by_name.items() if name.startswith("peak_reaction.")]
        by_name["peak_reaction"] = max(reactions, default=0.0)
        found |= {in_motion(name, constant): value for name, value in by_name.items()}
    kept = ("min_margin",) if lost else MEASURES
    return {name: float(found[name]) for name in kept if found.get(name) is not None}


def _energy(cycle: Cycle) -> Any:
    """Net work per cycle at the shaft of the motor, or of the drive (J)."""
    if cycle.steady is None:
        return None
    return cycle.motor.energy if cycle.motor is not None else cycle.steady.mean_drive_torque * cycle.scene.cycle


def asked_measures(cycle: Cycle, names: Sequence[str], nodes: int) -> dict[str, dict[str, Any]]:
    """Measures of the scene of a cycle by name: `value` (SI; None where it does not exist) and `unit`. Raises
    `StructureError` for a name that is not a measure of this scene."""
    asked = [named(name) for name in names]
    for each in asked:
        each.check(cycle.scene)
    lost, still = Result(int(cycle.result)) is Result.CANNOT_BE_ASSEMBLED, cycle.steady is None
    here = [each for each in asked if each.name.startswith("min_margin") or not (lost or (still and each.motion))]
    found = evaluate(cycle.scene, here, nodes) if here else {}
    return {each.name: {"value": maybe(found.get(each.name)), "unit": each.unit} for each in asked}


def maybe(value: Any) -> float | None:
    """A number, or None."""
    return None if value is None else float(value)
