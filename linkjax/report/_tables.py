"""Tables of the report, from the document of an analysis and its scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from linkjax._display import NONE, turning
from linkjax.analysis import (
    acts_text,
    check_limit,
    efficiency_rows,
    motor_rows,
    moves,
    peak_label,
    peak_motions,
    peak_names,
    peak_place,
    peak_shown,
    peak_unit,
    power_scale,
    speed_error,
    tied,
    torque_scale,
    uneven,
)
from linkjax.drives import drive_numbers
from linkjax.loads import Passage
from linkjax.machine import PERMANENT, Scene, friction_text, load_place, load_size, passage_text
from linkjax.measures import in_motion, measure_remark
from linkjax.mechanism import Link
from linkjax.report._cells import Cell, Cells, table, words

Data = dict[str, Any]
MOTORS = {
    "NoMotor": "none: free motion", "ConstantTorque": "constant torque", "LineMotor": "straight characteristic",
    "TableMotor": "characteristic by a table", "DCMotor": "DC motor", "InductionMotor": "induction motor, type plate",
    "InductionCircuit": "induction motor, equivalent circuit", "Servo": "servo motor",
}  # fmt: skip
KINDS = {
    "fixed": "fixed", "scaled": "scaled with the length", "stretched": "stretched with the length",
    "section": "from the cross-section",
}  # fmt: skip
CHECKS = {
    "virtual_power": "virtual power: drive torque from kinetostatics and from the reduced model",
    "energy_closure": "energy: kinetic energy of the links and work of all loads",
    "force_balance": "force balance: frame force and inertia forces, weights and loads",
}


def results(show: Cells, data: Data, scene: Scene, before: Data | None = None) -> str:
    """Speed fluctuation, speeds, drive and flywheel; those of the earlier design in a separate column."""
    old = _values(show, before) if before else {}
    remarks = _remarks(show, data, scene)
    rows, new = [], _values(show, data)
    for name in (*new, *(name for name in old if name not in new)):
        between = [Cell(old.get(name, NONE), True)] if before else []
        rows.append([words(name), *between, Cell(new.get(name, NONE), True), words(remarks.get(name, ""))])
    return table(["quantity", *(["before", "after"] if before else ["value"]), "remark"], rows)


def motor_load(show: Cells, data: Data, before: Data | None = None) -> str:
    """What the motor does in operation, in words; none without a motor."""
    old, new = (dict(motor_rows(each, show)) if each else {} for each in (before, data))
    rows = [
        [words(name), *([words(old.get(name, NONE))] if before else []), words(new.get(name, NONE))]
        for name in dict.fromkeys((*new, *old))
    ]
    return table(["motor", *(["before", "after"] if before else [""])], rows) if rows else ""


def _values(show: Cells, data: Data) -> dict[str, str]:
    """Formatted results of an analysis, by name."""
    motion, wheel = data["motion"], data.get("flywheel", {})
    found = (
        {}
        if not moves(data)
        else {
            "coefficient of speed fluctuation δ": show.measured(float(motion["delta"]), float(motion["delta_error"]))[
                0
            ],
            "mean crank speed": show.speed(motion["mean_speed"]),
            "max crank speed": show.speed(motion["max_speed"], error=speed_error(data)),
            "min crank speed": show.speed(motion["min_speed"], error=speed_error(data)),
            "mean drive torque": show.quantity(float(motion["mean_drive_torque"]), "N·m", beside=torque_scale(data)),
        }
    )
    if motion.get("period") is not None:
        found["mean drive power"] = show.quantity(float(motion["mean_power"]), "W", beside=power_scale(data))
        found["period of the cycle"] = show.quantity(float(motion["period"]), "s")
    found["flywheel inertia, given"] = show.amount(wheel.get("given"), "kg·m²").text
    if wheel.get("for_target_delta") is not None:
        need = float(wheel["for_target_delta"])
        found["flywheel inertia for target δ"] = show.quantity(need, "kg·m²") if need > 0 else "none"
    if wheel.get("textbook") is not None:
        found["flywheel inertia by ΔA/(δω²)"] = show.quantity(float(wheel["textbook"]), "kg·m²")
    found |= {name: value for name, (value, _) in _efficiency(show, data).items()}
    if motion.get("steady_state_margin") is not None:
        found["steady-state margin"] = show.quantity(float(motion["steady_state_margin"]), digits=4)
    if motion.get("speed") is None and motion.get("min_mean_speed") is not None:
        found["min mean speed"] = show.speed(motion["min_mean_speed"])
    return found


def _efficiency(show: Cells, data: Data) -> dict[str, tuple[str, str]]:
    """Value and remark of the efficiency, and of the factor at which friction locks the machine."""
    found = {}
    for name, told in efficiency_rows(data, show):
        value, _, more = told.replace(" (", ", ", 1).partition(", ")
        found[name] = value, more.removesuffix(")")
    return found


def _remarks(show: Cells, data: Data, scene: Scene) -> dict[str, str]:
    """Remarks on the results, by name."""
    motion, runs = data["motion"], moves(data)
    error = show.measured(float(motion["delta"]), float(motion["delta_error"]))[1] if runs else ""
    mean = "time mean" if scene.mean == "time" else "mean of max and min"
    wanted = data.get("flywheel", {}).get("target_delta", scene.target_delta)
    steady = (motion.get("steady_state_margin") or 0.0) > 0
    need = data.get("flywheel", {}).get("for_target_delta") or 0.0
    constant = scene.motor is None and data.get("model", {}).get("method") != "prescribed"
    exact = f"δ = {float(wanted):g}" if wanted is not None else ""
    exact = f"exact value for {exact}" if need > 0 else f"not required for {exact}: δ is smaller without it"
    return {name: remark for name, (_, remark) in _efficiency(show, data).items()} | {
        "coefficient of speed fluctuation δ": f"{error}, based on the {mean}",
        "mean crank speed": f"{mean}; {Cells().quantity(float(motion['mean_speed']), '', 6)} rad/s" if runs else "",
        "max crank speed": f"at {show.turned(motion['angle_of_max'])}" if runs and uneven(data) else "",
        "min crank speed": f"at {show.turned(motion['angle_of_min'])}" if runs and uneven(data) else "",
        "mean drive torque": "constant over the cycle" if constant else "",
        "mean drive power": "over the cycle",
        "flywheel inertia, given": "on the crankshaft",
        "flywheel inertia for target δ": "" if wanted is None else exact,
        "flywheel inertia by ΔA/(δω²)": "textbook formula, for comparison",
        "steady-state margin": f"{'positive: ' if steady else 'no '}steady-state motion at this mean speed",
        "min mean speed": "with steady-state motion",
    }


def nominal(show: Cells, scene: Scene) -> str:
    """The specified mean speed in words."""
    factor, label = turning(show.units)
    return f"{show.shown(factor * float(scene.speed))} {label} mean speed"


def peaks(show: Cells, data: Data, before: Data | None = None) -> str:
    """Peak magnitudes over the continuous cycle, in each motion: side by side, or before and after."""
    found, motions = data.get("peaks", {}), peak_motions(data)
    names = peak_names(data) if found else []
    if not names:
        return ""
    if before is None:
        rows = [
            [words(peak_name(n)), *(cell for c in motions.values() for cell in _peak(show, data, in_motion(n, c)))]
            for n in names
        ]
        return table(["peak", *(head for motion in motions for head in (motion, "error", "at"))], rows)
    text = ""
    for motion, constant in motions.items():
        rows = []
        for name, key in ((n, key) for n in names if (key := in_motion(n, constant)) in found):
            old = peak_shown(before, key)[0] if key in before.get("peaks", {}) else None
            rows.append([words(peak_name(name)), show.amount(old, peak_unit(name)), *_peak(show, data, key)])
        text += table([f"peak, {motion}", "before", "after", "error", "at"], rows) if rows else ""
    return text


def measures(show: Cells, data: Data) -> str:
    """The measures that were asked for."""
    found = data.get("measures", {}).items()
    rows = [[words(name), *show.several([each["value"]], each["unit"], 8)] for name, each in found]
    remarks = [measure_remark(name, each["value"]) for name, each in found]
    if any(remarks):
        rows = [[*row, words(remark)] for row, remark in zip(rows, remarks, strict=True)]
    return table(["measure", "value", *[""] * any(remarks)], rows) if rows else ""


def _peak(show: Cells, data: Data, key: str) -> list[Cell]:
    """Value, error and crank angle of a peak."""
    if key not in data["peaks"]:
        return [Cell(NONE, True)] * 3
    value, angle, error = peak_shown(data, key)
    unit = peak_unit(key)
    told, bound = show.measured(value, 0.0 if math.isnan(error) else error, unit, most=6)
    place = show.angle(angle) if tied(data, key) is None else Cell(peak_place(data, key, show), True)
    return [Cell(told, True), Cell(NONE if math.isnan(error) else bound, True), place]


def peak_name(name: str) -> str:
    """Name of a peak in words: `peak_reaction.B.rod` is the joint force B on the rod."""
    if name.startswith("peak_reaction."):
        joint, _, link = name.removeprefix("peak_reaction.").rpartition(".")
        return f"guide force on {link}" if joint.endswith(".guide") else f"joint force {joint} on {link}"
    return peak_label(name)


def links(show: Cells, scene: Scene) -> str:
    """Links with lengths, mass properties and counterweights."""
    rows = []
    for name in scene.mechanism.link_names:
        link = scene.mechanism.links[name]
        body, length = link.actual(), float(link.length)
        centre = f"{link.centre_name}: {show.shown(body.centre.x, 'm')}"
        centre += f", {show.shown(body.centre.y, 'm')} across" if float(body.centre.y) != 0 else ""
        rows.append([
            words(name), show.given(length, "m") if length > 0 else Cell(NONE, True), show.given(body.mass, "kg"),
            words(centre), show.given(body.inertia, "kg·m²"), words(_mass_properties(link)),
        ])  # fmt: skip
        for piece, weight in link.counterweights.items():
            place = f"{piece}: {show.shown(weight.at.x, 'm')}, {show.shown(weight.at.y, 'm')} across"
            rows.append([
                words(f"counterweight {piece} of {name}"), Cell(NONE, True), show.given(weight.mass, "kg"),
                words(place), show.given(weight.own_inertia(), "kg·m²"),
                words("ideal" if weight.ideal else "fixed"),
            ])  # fmt: skip
    return table(["link", "length", "mass", "mass centre, along the link", "inertia about it", "mass properties"], rows)


def _mass_properties(link: Link) -> str:
    """How the mass properties of a link are given, and how they follow its length."""
    kind = KINDS[link.mass_properties]
    if link.uniform is False:
        return kind
    body = "uniform bar" if link.uniform is True else f"uniform plate {', '.join(link.uniform)}"
    return body if kind == "fixed" else f"{body}, {kind}"


def points(show: Cells, scene: Scene) -> str:
    """Fixed points of the frame, and additional points of links."""
    frame = scene.mechanism.fixed.items()
    rows = [[words(p), words("frame"), show.given(at.x, "m"), show.given(at.y, "m")] for p, at in frame]
    for name in scene.mechanism.link_names:
        marked = scene.mechanism.links[name].actual().points
        rows += [[words(p), words(name), show.given(at.x, "m"), show.given(at.y, "m")] for p, at in marked.items()]
    return table(["point", "on", "x, or along the link", "y, or across it"], rows)


def motor(show: Cells, scene: Scene) -> str:
    """The numbers of the motor and its transmission by their keys; none without a motor."""
    if scene.motor is None:
        return ""
    kind = type(scene.motor.motor).__name__
    rows = [[words("kind"), Cell(MOTORS.get(kind, kind), True)]]
    for number in drive_numbers(scene.motor):
        value = Cell(show.bound(number.where(scene.motor), number.unit), True)
        rows.append([words(number.key.replace("_", " ")), value])
    return table(["motor", ""], rows)


def friction(show: Cells, scene: Scene) -> str:
    """Coefficients and radii of the joints with friction; none without friction."""
    rows = [[*map(words, friction_text(each, show))] for each in scene.friction]
    return table(["friction in", "coefficient", "pin, guide or mesh"], rows) if rows else ""


def groups(show: Cells, data: Data) -> str:
    """Assembly margins and transmission angles of the structural groups."""
    rows = []
    for name, group in data.get("groups", {}).items():
        sides = group.get("margins") or {}
        if not sides and group.get("margin") is not None:
            sides = {"": {"value": group["margin"], "angle": group.get("margin_angle")}}
        margins = "; ".join(
            f"{side} {show.quantity(float(least['value']), '', 4, 1.0)} at {show.turned(least['angle'])}".strip()
            for side, least in sides.items()
        )
        turned = group.get("transmission_span")
        span = NONE if turned is None else f"{show.turned(turned[0])} … {show.turned(turned[1])}"
        rows.append([words(name), words(group.get("formula", group["kind"])), words(margins or NONE), words(span)])
    return table(["group", "class", "min margin over the cycle", "transmission angle"], rows)


def dead_centres(show: Cells, data: Data) -> str:
    """Dead centres of points and limit positions of links: crank angles, and the stroke or angle between them."""
    found: dict[str, list[str]] = {}
    for entry in data.get("dead_centres", []):
        name = f"point {entry['point']}" if "point" in entry else f"link {entry['link']}"
        found.setdefault(name, []).append(show.turned(float(entry["angle"])))
    rows = []
    for name, angles in found.items():
        kind, own = name.split(maxsplit=1)
        table_of, unit = ("strokes", "m") if kind == "point" else ("swings", "rad")
        covered = data.get(table_of, {}).get(own)
        ends = [Cell(NONE, True)] * 2
        if covered:
            ratio = NONE if covered["time_ratio"] is None else f"{covered['time_ratio']:.4f}"
            ends = [*show.several([covered["value"]], unit, 6), Cell(ratio, True)]
        rows.append([words(name), words(",  ".join(angles)), *ends])
    head = ["dead centres or limit positions of", "at crank angle", "stroke or angle", "time ratio"]
    return table(head, rows) if rows else "<p>No point has a dead centre, and no link has a limit position.</p>"


def loads(show: Cells, data: Data, scene: Scene) -> str:
    """Loads and gravity."""
    rows = []
    for load in scene.loads:
        size = load_size(show, load)
        window = load.window
        acts = PERMANENT
        if isinstance(window, Passage):
            acts = f"{passage_text(show, window)}: {acts_text(data, load.name, show)}"
        elif window is not None and np.ndim(window.on):
            acts = acts_text(data, load.name, show)
        elif window is not None:
            acts = f"{show.turned(float(window.on))} … {show.turned(float(window.off))}"
        rows.append(
            [
                words(load.name),
                words(load_place(load, ", at ")),
                words(size),
                words(acts),
                words(load.reacts_on or NONE),
            ]
        )
    pull = scene.gravity
    size = f"({show.shown(pull.x, 'm/s²')}, {show.shown(pull.y, 'm/s²')})"
    rows.append([words("gravity"), words("every link"), words(size), words(PERMANENT), words(NONE)])
    return table(["load", "acts on", "value", "active", "reaction on"], rows)


def checks(show: Cells, data: Data) -> str:
    """Checks of the analysis, passed or failed."""
    limit = check_limit(data)
    rows = []
    for name, value in data.get("checks", {}).items():
        if value is None:
            continue
        passed = float(value) <= limit
        verdict = Cell("✓ pass" if passed else "✗ fail", look="good" if passed else "bad")
        what = CHECKS.get(name, name.replace("_", " "))
        rows.append([words(what), show.amount(value, digits=2), show.amount(limit, digits=1), verdict])
    return table(["check", "relative residual", "tolerance", ""], rows)


def model(data: Data, scene: Scene) -> str:
    """The model, and why it was selected."""
    used = data.get("model", {})
    rows = [
        [words("structure"), words(scene.mechanism.formula())],
        [words("method"), words(f"{used.get('method', NONE)}: {used.get('why', NONE)}")],
        *(
            [[words("statically indeterminate reactions"), words(", ".join(used["indeterminate"]))]]
            if used.get("indeterminate")
            else []
        ),
        [words("nodes of the cycle grid"), words(used.get("nodes", NONE))],
        [words("tabulated crank angles"), words(np.size(data["angles"]))],
        [words("precision"), words(data.get("precision", NONE))],
        [words("linkjax"), words(data.get("linkjax_version", "") or NONE)],
    ]
    return table(["model", ""], rows)
