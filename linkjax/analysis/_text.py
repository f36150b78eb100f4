"""A cycle in plain text: what `print(cycle)` shows. Numbers have their units; a dash means: does not exist."""

from __future__ import annotations

from typing import Any

import numpy as np

from linkjax._display import NONE, ROUNDING, Numbers, above, aligned
from linkjax._results import Result
from linkjax.analysis._document import document, moves
from linkjax.analysis._overload import overload_rows
from linkjax.analysis._tidy import (
    acts_text,
    peak_motions,
    peak_names,
    peak_place,
    peak_shown,
    power_scale,
    speed_error,
    torque_scale,
    uneven,
)
from linkjax.analysis._words import peak_label, peak_unit
from linkjax.loads import Passage
from linkjax.measures import in_motion

SHOW = Numbers()
DELTA = "coefficient of speed fluctuation δ"
Data = dict[str, Any]
Rows = list[tuple[str, ...]]


def cycle_text(cycle: Any) -> str:
    """Motion, flywheel, peaks, margins and strokes of a cycle; one line where its numbers are those of several
    designs, traced, or placeholders."""
    title = cycle.scene.title or "Scene"
    try:
        if np.ndim(cycle.result):
            raise TypeError("several designs")
        data = document(cycle)
        tables = [_head(data, cycle.scene)]
        if data["result"]["code"] != Result.CANNOT_BE_ASSEMBLED:
            tables += [energy_rows(data, SHOW), _peaks(data), _strokes(data)]
        tables.append(_groups(data))
        blocks = ["\n".join(aligned(rows)) for rows in tables if rows]
    except (AttributeError, TypeError, ValueError):  # what float() raises for these
        return f"{title}: a working cycle (traced numbers, or several designs)"
    return "\n\n".join([f"{title}: {data['result']['message']}\n{blocks[0]}", *blocks[1:]])


def _head(data: Data, scene: Any) -> Rows:
    """The structure, the actual motion if there is one, and the flywheel."""
    flywheel, count = data["flywheel"], len(data["angles"])
    turns = f"{scene.cycle_turns} turn{'s' * (scene.cycle_turns > 1)} of the crank"
    rows = [("structure", scene.mechanism.formula()), ("cycle", f"{turns}, {count} crank angle{'s' * (count > 1)}")]
    if moves(data):
        rows += _motion(data)
    else:
        rows += still_rows(data, float(scene.speed), SHOW)
        rows += [(DELTA, NONE), ("mean drive torque", f"{NONE} (constant torque of the actual motion)")]
    rows += efficiency_rows(data, SHOW)
    acting = [load.name for load in scene.loads if isinstance(load.window, Passage)]
    rows += [(f"load {name} acts", acts_text(data, name, SHOW)) for name in acting]
    rows.append(("flywheel", SHOW.shown(flywheel["given"], "kg·m²")))
    if flywheel["for_target_delta"] is not None:
        need = flywheel["for_target_delta"]
        rows.append((f"flywheel for δ = {flywheel['target_delta']:g}",
                     SHOW.quantity(need, "kg·m²", 6) if need > 0 else "0 kg·m²"))  # fmt: skip
    return rows


def still_rows(data: Data, speed: float, show: Numbers) -> list[tuple[str, str]]:
    """What is known at a constant crank speed (rad/s): this, and the mean power of the drive."""
    rows = [("crank speed", f"{show.speed(speed)}, constant")]
    works, angles = (data.get("energies") or {}).get("drive"), data["angles"]
    if works is not None and works["supplied"] != works["absorbed"] and len(angles) > 1:
        period = len(angles) * float(angles[1] - angles[0]) / speed
        rows.append(
            ("mean power at constant speed", show.quantity((works["supplied"] - works["absorbed"]) / period, "W", 6))
        )
    return rows


def _motion(data: Data) -> Rows:
    run, model = data["motion"], data["model"]
    fastest, slowest = (f" at {SHOW.turned(run[f'angle_of_{end}'])}" if uneven(data) else "" for end in ("max", "min"))
    torque = SHOW.quantity(run["mean_drive_torque"], "N·m", 6, torque_scale(data))
    constant = model["method"] != "prescribed" and data.get("motor") is None
    return [
        ("mean crank speed", f"{SHOW.speed(run['mean_speed'])} ({model['mean']} mean)"),
        ("max crank speed", f"{SHOW.speed(run['max_speed'], error=speed_error(data))}{fastest}"),
        ("min crank speed", f"{SHOW.speed(run['min_speed'], error=speed_error(data))}{slowest}"),
        (DELTA, " ".join(SHOW.measured(run["delta"], run["delta_error"]))),
        ("mean drive torque", f"{torque}, constant over the cycle" if constant else torque),
        ("mean power", SHOW.quantity(run["mean_power"], "W", 6, power_scale(data))),
        *motor_rows(data, SHOW),
    ]


def motor_rows(data: Data, show: Numbers) -> list[tuple[str, str]]:
    """Torque and power at the shaft of the motor, and whether the motion is stable; none without a motor."""
    run = data.get("motor")
    if run is None:
        return []
    sizes = {"N·m": max(torque_scale(data), abs(run["max_torque"]), abs(run["min_torque"])),
             "W": max(power_scale(data), abs(run["max_power"]), abs(run["min_power"]))}  # fmt: skip

    def shown(key: str, unit: str) -> str:
        return show.quantity(run[key], unit, 6, sizes[unit])

    rows = [
        ("motor torque", f"{shown('mean_torque', 'N·m')} mean, {shown('rms_torque', 'N·m')} rms, "
                         f"{shown('min_torque', 'N·m')} to {shown('max_torque', 'N·m')}"),
        ("motor power", f"{shown('mean_power', 'W')} mean, {shown('min_power', 'W')} to {shown('max_power', 'W')}"),
    ]  # fmt: skip
    rows += overload_rows(run["overload"], show)
    if run["multiplier"] is None:
        return rows
    states = f"{run['stable_states']} stable motions from 0.02 to 4 times `speed`"
    more = "" if run["stable_states"] == 1 else f"; {states}, listed by `linkjax.steady_states`"
    least = 1e-12
    left = f"{run['multiplier']:.3g}" if abs(run["multiplier"]) >= least else f"less than {least:g}"
    kept = f"{left} of a small difference in speed is left after one cycle{more}"
    return [*rows, ("stability", kept)]


def efficiency_rows(data: Data, show: Numbers) -> list[tuple[str, str]]:
    """Efficiency over the cycle, and how far the machine is from locking; none without useful loads or friction."""
    rows, run = [], _rubbing(data)
    if data.get("efficiency") is not None:
        rows.append(("efficiency", f"{100 * data['efficiency']:.4g} %{_no_use(data)}"))
    if run is not None:
        factors = np.asarray(run["locking_factor"], float)
        worst = int(np.argmin(factors))
        if np.isfinite(factors[worst]):
            place = f"first at {show.turned(data['angles'][worst])} of the angles shown"
            place += f", most of the power in {run['locking_joint'][worst]}"
            multiple = "the multiple of all coefficients of friction at which the machine locks"
            rows.append(("locking factor", f"{factors[worst]:.4g}, {multiple}, {place}"))
    return rows


def _no_use(data: Data) -> str:
    """A remark where other loads drive the machine, or no useful work is done although it moves."""
    run, works = _rubbing(data), data["energies"] or {}
    if data["efficiency"] > 1 + 1e-9:
        return " (other loads drive the machine as well: what they supply is not counted)"
    if data["efficiency"] != 0 or (run is not None and run["locks"]):
        return ""
    driven = works.get("motor") or works.get("drive")
    if driven is not None and driven["supplied"] <= driven["absorbed"]:
        return " (over the cycle the drive does no net work: loads drive the machine, or do none; check their windows)"
    return " (over the cycle the useful loads drive the machine, or do no work: check their signs and windows)"


def _rubbing(data: Data) -> Any:
    """Friction in the motion of the energies; None without friction."""
    return data.get("friction") or data.get("friction_constant_speed")


def energy_rows(data: Data, show: Numbers) -> Rows:
    """Energies per cycle by source and sink, with their sums; none where only gravity and inertia act."""
    found = data.get("energies") or {}
    if not found.keys() - {"drive", "gravity"}:
        return []
    sums = {way: sum(work[way] for work in found.values()) for way in ("supplied", "absorbed")}
    largest = max(sums.values())
    rows: Rows = [("energy per cycle" if moves(data) else "energy per cycle, constant speed", *sums)]
    for name, work in (found | {"sum": sums}).items():
        if max(work.values()) > ROUNDING * largest:
            rows.append((name, *(show.quantity(work[way], "J", 6, largest) for way in sums)))
        if name == "friction":
            lost = ((joint, each["loss"]) for joint, each in _rubbing(data)["joints"].items())
            rows += [(f"  in {joint}", "", show.quantity(loss, "J", 6, largest)) for joint, loss in lost]
    return rows if len(rows) > 1 else []


def _peaks(data: Data) -> Rows:
    """Peaks by name in the motions that differ, each with its crank angle."""
    motions = peak_motions(data)
    rows: Rows = [("peak", *(cell for motion in motions for cell in (motion, "at")))]
    for name in peak_names(data):
        cells = [peak_label(name)]
        for key in (in_motion(name, constant) for constant in motions.values()):
            value, angle, _ = peak_shown(data, key) if key in data["peaks"] else (float("nan"),) * 3
            place = peak_place(data, key, SHOW) if key in data["peaks"] else SHOW.turned(angle)
            cells += [SHOW.quantity(value, peak_unit(name), 6), place]
        rows.append(tuple(cells))
    return rows if len(rows) > 1 else []


def _strokes(data: Data) -> Rows:
    """What sliders and links cover, and where they stop."""
    stops: dict[str, list[str]] = {}
    for entry in data["dead_centres"]:
        stops.setdefault(entry.get("point") or entry["link"], []).append(SHOW.turned(entry["angle"]))
    rows = [("of", "stroke or angle", "time ratio", "dead centres or limit positions at")]
    for name, places in stops.items():
        unit = "m" if name in data["points"] else "rad"
        covered = data["strokes" if unit == "m" else "swings"].get(name)
        value, ratio = (None, None) if covered is None else (covered["value"], covered["time_ratio"])
        stroke = SHOW.told([value], unit, 6)[0]
        rows.append((name, stroke, NONE if ratio is None else f"{ratio:.4f}", ", ".join(places)))
    return rows if stops else []


def _groups(data: Data) -> Rows:
    """Minimum assembly margins, and transmission angles."""
    rows = [("group", "class", "min margin", "at", "transmission angle")]
    for name, group in data["groups"].items():
        span = [SHOW.turned(angle) for angle in group.get("transmission_span", ())]
        if "margin" in group:
            margin, at = f"{above(group['margin'], 1.0):.4g}".replace("-", "−"), SHOW.turned(group["margin_angle"])
            rows.append((name, group["formula"], margin, at, " to ".join(span) or NONE))
    return rows if len(rows) > 1 else []
