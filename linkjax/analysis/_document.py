"""The JSON document of an analysis, which reports, plots and other programs read."""

from __future__ import annotations

import math
from typing import Any

import jax
import numpy as np

from linkjax._results import MESSAGES, Result
from linkjax.analysis._friction import friction_document, locked_text
from linkjax.analysis._harmonic_table import harmonics_document
from linkjax.analysis._loads import load_document
from linkjax.analysis._overload import overload_document
from linkjax.analysis._posed import posed
from linkjax.forces import Forces, JointForce, other_sides
from linkjax.friction import indeterminate
from linkjax.kinematics import Reversals, named_groups
from linkjax.measures import in_motion, peak_names
from linkjax.motion import Peak
from linkjax.topology import class_of

SAME = 1e-6  # rad: dead centres so close are one
WHY = {
    "quadrature": "torques depend only on position, so the energy equation is integrated by quadrature",
    "collocation": "torques depend on the speed, so the equation of motion is solved by collocation over the cycle",
    "prescribed": "the driver has a motion law, so the motion is known",
    "constant speed": "as requested: the crank turns at constant nominal speed",
    "none": "there is no actual motion",
    "diffrax": "as requested: diffrax (Dopri8) integrates the equation of motion over the crank angle",
}


def document(cycle: Any, name: str = "", version: str = "") -> dict[str, Any]:
    """A `Cycle` as nested dicts of NumPy arrays and floats (SI), with the keys of `docs/json.md`. Values of
    an actual motion that does not exist, or is not requested, are None. So are the results over the whole cycle of a
    machine that cannot be assembled."""
    given, cycle = cycle, jax.device_get(cycle)
    scene, code = cycle.scene, Result(int(cycle.result))
    found = {
        "scene": name or scene.title,
        "linkjax_version": version,
        "precision": str(np.asarray(cycle.angles).dtype),
        "model": _model(cycle),
        "angles": np.asarray(cycle.angles),
        **posed(scene.mechanism, cycle.pose),
        "groups": _groups(cycle),
        "dead_centres": _dead_centres(cycle),
        **_strokes(cycle),
        "reduced": {
            "inertia": cycle.reduced.inertia, "inertia_slope": cycle.reduced.slope, "torque": cycle.reduced.torque,
            "torque_by_load": dict(cycle.reduced.by_load),
        },
        "motion": _motion(cycle),
        "motor": _motor(cycle),
        "harmonics": {} if cycle.motor is None else harmonics_document(cycle.motor.harmonics),
        "flywheel": {
            "given": float(scene.mechanism.flywheel.inertia),
            "for_target_delta": _maybe(cycle.flywheel and cycle.flywheel.for_target_delta),
            "textbook": _maybe(cycle.flywheel and cycle.flywheel.textbook),
            "target_delta": _maybe(scene.target_delta),
        },
        "windows": _windows(cycle),
        "work": None if cycle.work is None else {name: float(value) for name, value in cycle.work.items()},
        **load_document(given, code is not Result.CANNOT_BE_ASSEMBLED),
        "efficiency": given.efficiency if code is not Result.CANNOT_BE_ASSEMBLED else None,
        "friction": friction_document(cycle.friction),
        "friction_constant_speed": friction_document(cycle.friction_constant_speed),
        "forces": None if cycle.forces is None else _forces(cycle, cycle.forces),
        "forces_constant_speed": _forces(cycle, cycle.forces_constant_speed),
        "peaks": {
            **_peaks(cycle, cycle.peaks, False), **_peaks(cycle, cycle.peaks_constant_speed, True),
        },
        "checks": {
            "virtual_power": float(cycle.checks.virtual_power), "energy_closure": _maybe(cycle.checks.energy_closure),
            "force_balance": float(cycle.checks.force_balance),
        },
        "result": {
            "code": int(code), "name": code.name.lower(),
            "message": _message(cycle, code),
            "per_angle": np.where(cycle.assembled, int(Result.SUCCESS), int(Result.CANNOT_BE_ASSEMBLED)),
        },
    }  # fmt: skip
    return _only_assembled(found) if code is Result.CANNOT_BE_ASSEMBLED else found


def _message(cycle: Any, code: Result) -> str:
    if cycle.missing is not None:
        return cycle.missing.reason
    return locked_text(cycle) if code is Result.LOCKED else MESSAGES[code]


def _only_assembled(data: dict[str, Any]) -> dict[str, Any]:
    """A document without results over the whole cycle: in a machine that cannot be assembled they come from placeholder
    positions."""
    none = dict.fromkeys(("for_target_delta", "textbook"))
    return data | {
        "model": data["model"] | {"method": "none", "why": WHY["none"], "evaluations": None},
        "dead_centres": [], "strokes": {}, "swings": {}, "windows": None,
        "friction": None, "friction_constant_speed": None,
        "motion": dict.fromkeys(data["motion"]), "work": None, "forces": None,
        "flywheel": data["flywheel"] | none, "peaks": {}, "checks": data["checks"] | {"energy_closure": None},
    }  # fmt: skip


def _windows(cycle: Any) -> dict[str, list[tuple[float, float]]]:
    """The ranges of crank angle (rad) in which loads with a window act."""
    loads = [load for load in cycle.scene.loads if load.window is not None]
    return {load.name: cycle.windows.get(load.name, load.window).used(cycle.scene.cycle) for load in loads}


def _model(cycle: Any) -> dict[str, Any]:
    """The method that gave the results, and the reason."""
    scene = cycle.scene
    method = "prescribed" if scene.mechanism.prescribed else cycle.method
    if method == "quadrature" and cycle.steady is not None and cycle.steady.driven is not None:
        method = "collocation"
    why = WHY[method]
    if cycle.steady is None:
        method = "constant speed" if cycle.constant_speed else "none"
        why = WHY[method] if cycle.missing is None else cycle.missing.reason
    return {
        "method": method, "nodes": cycle.nodes,
        "evaluations": None if cycle.steady is None else cycle.steady.evaluations,
        "mean": scene.mean, "why": why, "constant_speed": cycle.constant_speed,
        "indeterminate": list(indeterminate(scene.mechanism)),
    }  # fmt: skip


def _motion(cycle: Any) -> dict[str, Any]:
    """The actual motion; if it does not exist, only its margin and the lowest mean speed."""
    motion, missing = cycle.steady, cycle.missing
    series = {"speed": cycle.speed, "acceleration": cycle.acceleration, "time": cycle.time, "power": cycle.power}
    found = {
        name: None if motion is None else float(getattr(motion, name))
        for name in ("mean_speed", "delta", "delta_error", "max_speed", "min_speed", "angle_of_max", "angle_of_min",
                     "mean_drive_torque", "period")
    }  # fmt: skip
    ends = motion if missing is None else missing
    margins = {key: _maybe(ends and getattr(ends, key)) for key in ("steady_state_margin", "min_mean_speed")}
    return {**series, **found, "mean_power": _maybe(cycle.mean_power), **margins}


def _motor(cycle: Any) -> dict[str, Any] | None:
    """The motor at its own shaft; None without one."""
    run, drive = cycle.motor, cycle.scene.motor
    if run is None:
        return None
    series = {"speed": run.speed, "torque": run.torque, "power": run.power}
    single = {field: _maybe(getattr(run, field)) for field in (
        "mean_torque", "rms_torque", "max_torque", "min_torque", "mean_power", "max_power", "min_power", "energy",
        "loss", "multiplier")}  # fmt: skip
    gear = drive.transmission
    ratio = float(gear.ratio) / (1.0 if gear.creep is None else 1 - float(gear.creep))
    states = None if run.stable_states is None else int(run.stable_states)
    load = overload_document(run.overload, drive.motor)
    return {**series, **single, "stable_states": states, "ratio": ratio, "overload": load}


def moves(data: dict[str, Any]) -> bool:
    """Whether a document has an actual motion."""
    return (data.get("motion") or {}).get("speed") is not None


def check_limit(data: dict[str, Any]) -> float:
    """The largest relative residual of a check in a correct analysis, for the precision of the document."""
    return 1e-10 if data["precision"] == "float64" else 1e-3


def plain(value: Any) -> Any:
    """The document with lists instead of arrays and None for NaN and infinity, ready for `json.dump`."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _maybe(value: Any) -> float | None:
    return None if value is None else float(value)


def _groups(cycle: Any) -> dict[str, Any]:
    found = {}
    for name, group in named_groups(cycle.scene.mechanism).items():
        entry: dict[str, Any] = {"kind": group.kind, "formula": class_of(group)[0]}
        sides = cycle.margins.get(name, {})
        if sides:
            worst = min(sides.values(), key=lambda least: float(least.value))
            entry |= {"margin": float(worst.value), "margin_angle": float(worst.angle)}
            entry["margins"] = {s: {"value": float(m.value), "angle": float(m.angle)} for s, m in sides.items()}
        if name in cycle.transmission:
            angles = cycle.transmission[name]
            every = np.concatenate([np.ravel(angles), np.ravel(cycle.transmission_ends.get(name, angles[:0]))])
            entry["transmission_angle"] = angles
            if Result(int(cycle.result)) is not Result.CANNOT_BE_ASSEMBLED:
                entry["transmission_span"] = [float(np.nanmin(every)), float(np.nanmax(every))]
        found[name] = entry
    return found


def _dead_centres(cycle: Any) -> list[dict[str, Any]]:
    points = cycle.pose.points
    return [{"point" if name in points else "link": name, "angle": float(angle)}
            for name, found in cycle.dead_centres.items() for angle in _stops(cycle, found)]  # fmt: skip


def _stops(cycle: Any, found: Reversals) -> np.ndarray:
    """Crank angles of the actual dead centres, in order."""
    return np.sort(np.mod(np.asarray(found.angle)[np.asarray(found.true)], cycle.scene.cycle))


def _strokes(cycle: Any) -> dict[str, Any]:
    """Strokes of sliders, swings of links, and time ratios at constant crank speed."""
    strokes, swings, law = {}, {}, cycle.scene.mechanism.driver.follows()
    rests, period = law is not None and law.rests(), 2 * math.pi if law is None else law.period()
    for name, value in cycle.strokes.items():
        stops = _stops(cycle, cycle.dead_centres[name])
        if stops.size < 2 or not np.isfinite(value):
            continue
        turn = np.sort(np.mod(stops, period))
        ways = np.diff(turn, append=turn[0] + period)
        ways = ways[ways > SAME]  # a dead centre that repeats in every turn, or period of a law, counts once
        ratio = float(np.max(ways) / np.min(ways)) if ways.size == 2 and not rests else None
        rows = strokes if name in cycle.pose.points else swings
        rows[name] = {"value": float(value), "time_ratio": ratio}
    return {"strokes": strokes, "swings": swings}


def _forces(cycle: Any, forces: Forces) -> dict[str, Any]:
    by = other_sides(cycle.scene)
    return {
        "reactions": {
            joint: {link: {**_vector(forces.reactions[joint][link]), "by": other} for link, other in sides.items()}
            for joint, sides in by.items()
        },
        "drive_torque": forces.drive_torque,
        "shaking": {**_vector(forces.shaking), "about": cycle.scene.mechanism.groups[0].needs()[0]},
        "frame": _vector(forces.frame),
        "net_frame": _vector(forces.net_frame),
    }


def _vector(force: JointForce) -> dict[str, Any]:
    return {"fx": force.fx, "fy": force.fy, "moment": force.moment}


def _peaks(cycle: Any, peak: Peak | None, constant: bool) -> dict[str, Any]:
    if peak is None:
        return {}
    names, values = peak_names(cycle.scene), np.asarray(peak.value)
    run = cycle.friction_constant_speed if constant else cycle.friction
    none = np.isinf(values) & (run is not None and bool(run.locks))  # where it locks they are of no place
    angles, errors, ties = (np.where(none, np.nan, part) for part in (peak.angle, peak.error, peak.tied))
    return {
        in_motion(name, constant): {
            "value": float(values[i]),
            "angle": float(angles[i]),
            "error": float(errors[i]),
            "tied": None if np.isnan(ties[i]) else float(ties[i]),
        }
        for i, name in enumerate(names)
    }
