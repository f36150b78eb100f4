"""The tables of the report, from the document of an analysis and its scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from linkjax.analysis import check_limit
from linkjax.loads import Force, OpposingForce, OpposingTorque, Torque
from linkjax.machine import Scene
from linkjax.report._cells import NONE, Cell, amount, angle, given, measured, quantity, shown, table, words

Data = dict[str, Any]
CONSTANT = "_constant_speed"
CHECKS = {
    "virtual_power": "virtual power: drive torque by kinetostatics against the reduced model",
    "energy_closure": "energy: kinetic energy of the links against the work of every load",
    "force_balance": "force balance: frame force against inertia, weight and loads",
}


def results(data: Data, scene: Scene) -> str:
    """Speed fluctuation, speeds, flywheel and drive."""
    motion, wheel = data["motion"], data.get("flywheel", {})
    delta, error = measured(float(motion["delta"]), float(motion["delta_error"]))
    mean = "mean over time" if scene.mean == "time" else "mean of largest and smallest"
    rows = [
        [words("coefficient of speed fluctuation δ"), Cell(delta, True), words(f"{error}, of the {mean}")],
        [words("mean speed"), _rpm(motion["mean_speed"]), words(f"{mean}; {_rad(motion['mean_speed'])}")],
        [words("largest speed"), _rpm(motion["speed_max"]), words(f"at {angle(motion['angle_of_max']).text}")],
        [words("smallest speed"), _rpm(motion["speed_min"]), words(f"at {angle(motion['angle_of_min']).text}")],
        [words("drive torque, constant"), amount(motion["drive_torque_mean"], "N·m"), words("balances the cycle")],
    ]
    if "period" in motion:
        power = float(motion["mean_power"])
        rows.append([words("drive power, mean"), amount(power, "W"), words("over the cycle")])
        rows.append([words("duration of the cycle"), amount(motion["period"], "s"), words("")])
    rows.append([words("flywheel, given"), amount(wheel.get("given"), "kg·m²"), words("on the crank shaft")])
    if wheel.get("for_target_delta") is not None:
        wanted = wheel.get("target_delta", scene.target_delta)
        note = "" if wanted is None else f"for δ = {float(wanted):g}, exactly"
        rows.append([words("flywheel, needed"), amount(wheel["for_target_delta"], "kg·m²"), words(note)])
    if wheel.get("textbook") is not None:
        note = "textbook, for comparison"
        rows.append([words("flywheel by ΔA/(δω²)"), amount(wheel["textbook"], "kg·m²"), words(note)])
    margin = float(motion["regime_margin"])
    note = "positive: there is a periodic regime at this speed" if margin > 0 else "no periodic regime at this speed"
    rows.append([words("regime margin"), amount(margin, digits=4), words(note)])
    return table(["quantity", "value", "remark"], rows)


def _rpm(speed: float) -> Cell:
    return Cell(quantity(float(speed) * 30 / math.pi, "", 6) + " rpm", True)


def _rad(speed: float) -> str:
    return quantity(float(speed), "", 6) + " rad/s"


def nominal(scene: Scene) -> str:
    """The wanted mean speed in words."""
    return f"{shown(float(scene.speed) * 30 / math.pi)} rpm mean speed"


def peaks(data: Data) -> str:
    """Largest magnitudes over the continuous cycle, in both motions side by side."""
    found = data.get("peaks", {})
    names = dict.fromkeys(name.removesuffix(CONSTANT) for name in found)
    rows = []
    for name in names:
        row = [words(peak_name(name))]
        for key in (name, name + CONSTANT):
            if key in found:
                peak = found[key]
                value, error = measured(float(peak["value"]), float(peak["error"]), peak_unit(name), most=6)
                row += [Cell(value, True), Cell(error, True), angle(float(peak["angle"]))]
            else:
                row += [Cell(NONE, True)] * 3
        rows.append(row)
    return table(["largest", "true motion", "error", "at", "constant speed", "error", "at"], rows)


def peak_name(name: str) -> str:
    """A peak's name in words: `reaction.B.rod` is the joint force at B on the rod."""
    if name.startswith("reaction."):
        joint, _, link = name.removeprefix("reaction.").rpartition(".")
        return f"guide force on {link}" if joint.endswith(".guide") else f"joint force {joint} on {link}"
    return name.replace("_", " ")


def peak_unit(name: str) -> str:
    """SI unit of a peak."""
    turning = not name.startswith("reaction.") and any(word in name for word in ("torque", "moment"))
    return "N·m" if turning else "N"


def links(scene: Scene) -> str:
    """Links with their lengths and masses."""
    rows, kinds = [], {"fixed": "as given", "scaled": "follow the length", "section": "from the section"}
    for name in scene.mechanism.link_names:
        link = scene.mechanism.links[name]
        body, length = link.actual(), float(link.length)
        centre = f"{link.centre_name}: {shown(body.centre.x, 'm')}"
        centre += f", {shown(body.centre.y, 'm')} across" if float(body.centre.y) != 0 else ""
        rows.append([
            words(name), given(length, "m") if length > 0 else Cell(NONE, True), given(body.mass, "kg"), words(centre),
            given(body.inertia, "kg·m²"), words(kinds[link.mass_properties]),
        ])  # fmt: skip
        for piece, weight in link.counterweights.items():
            place = f"{piece}: {shown(weight.at.x, 'm')}, {shown(weight.at.y, 'm')} across"
            rows.append([
                words(f"counterweight {piece} of {name}"), Cell(NONE, True), given(weight.mass, "kg"), words(place),
                given(weight.own_inertia(), "kg·m²"), words("ideal" if weight.ideal else "as given"),
            ])  # fmt: skip
    return table(["link", "length", "mass", "mass centre, along the link", "inertia about it", "mass properties"], rows)


def points(scene: Scene) -> str:
    """Points of the frame, and further points marked on links."""
    rows = [[words(p), words("frame"), given(at.x, "m"), given(at.y, "m")] for p, at in scene.mechanism.fixed.items()]
    for name in scene.mechanism.link_names:
        marked = scene.mechanism.links[name].actual().points
        rows += [[words(p), words(name), given(at.x, "m"), given(at.y, "m")] for p, at in marked.items()]
    return table(["point", "on", "x, or along the link", "y, or across it"], rows)


def groups(data: Data) -> str:
    """Assembly margins and transmission angles of the structural groups."""
    rows = []
    for name, group in data.get("groups", {}).items():
        sides = group.get("margins") or {}
        if not sides and group.get("margin") is not None:
            sides = {"": {"value": group["margin"], "angle": group.get("margin_angle")}}
        margins = "; ".join(
            f"{side} {quantity(float(least['value']), '', 4)} at {angle(least['angle']).text}".strip()
            for side, least in sides.items()
        )
        turned = group.get("transmission_span")
        span = NONE if turned is None else f"{angle(turned[0]).text} … {angle(turned[1]).text}"
        rows.append([words(name), words(group.get("formula", group["kind"])), words(margins or NONE), words(span)])
    return table(["group", "kind", "assembly margin, least over the cycle", "transmission angle"], rows)


def dead_centres(data: Data) -> str:
    """Crank angles at which a point or link reverses."""
    found: dict[str, list[str]] = {}
    for entry in data.get("dead_centres", []):
        name = f"point {entry['point']}" if "point" in entry else f"link {entry['link']}"
        found.setdefault(name, []).append(angle(float(entry["angle"])).text)
    rows = [[words(name), words(",  ".join(angles))] for name, angles in found.items()]
    return table(["reverses", "at crank angle"], rows) if rows else "<p>Nothing reverses over the cycle.</p>"


def loads(scene: Scene) -> str:
    """Working loads and gravity."""
    rows = []
    for load in scene.loads:
        if isinstance(load, Force):
            size = f"({shown(load.force.x, 'N')}, {shown(load.force.y, 'N')})"
        elif isinstance(load, OpposingForce):
            size = f"{shown(load.magnitude, 'N')} against the motion"
        elif isinstance(load, Torque):
            size = shown(load.torque, "N·m")
        elif isinstance(load, OpposingTorque):
            size = f"{shown(load.magnitude, 'N·m')} against the rotation"
        else:
            size = NONE
        window = load.window
        acts = "always" if window is None else f"{angle(float(window.on)).text} … {angle(float(window.off)).text}"
        where = f"{load.link}, at {load.point}" if load.point else load.link
        rows.append([words(load.name), words(where), words(size), words(acts), words(load.reacts_on or NONE)])
    pull = scene.gravity
    size = f"({shown(pull.x, 'm/s²')}, {shown(pull.y, 'm/s²')})"
    rows.append([words("gravity"), words("every link"), words(size), words("always"), words(NONE)])
    return table(["load", "on", "amount", "acts", "reacts on"], rows)


def checks(data: Data) -> str:
    """The analysis's own checks, passed or failed."""
    limit = check_limit(data)
    rows = []
    for name, value in data.get("checks", {}).items():
        passed = float(value) <= limit
        verdict = Cell("✓ pass" if passed else "✗ fail", look="good" if passed else "bad")
        what = CHECKS.get(name, name.replace("_", " "))
        rows.append([words(what), amount(value, digits=2), amount(limit, digits=1), verdict])
    return table(["check", "relative residual", "limit", ""], rows)


def model(data: Data, scene: Scene) -> str:
    """Which model was used and why."""
    used = data.get("model", {})
    rows = [
        [words("structure"), words(scene.mechanism.formula())],
        [words("motion"), words(f"{used.get('motion', NONE)}: {used.get('why', NONE)}")],
        [words("nodes of the cycle grid"), words(used.get("nodes", NONE))],
        [words("crank angles tabulated"), words(np.size(data["angles"]))],
        [words("precision"), words(data.get("precision", NONE))],
        [words("linkjax"), words(data.get("linkjax_version", "") or NONE)],
    ]
    return table(["model", ""], rows)
