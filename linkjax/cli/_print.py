"""An analysis and a scene as tables on the screen."""

from __future__ import annotations

import math
from typing import Any

from rich.table import Table
from rich.text import Text

from linkjax.analysis import check_limit
from linkjax.cli._console import console
from linkjax.loads import Force, Torque
from linkjax.machine import Scene

COARSE = 1e-4  # relative error of δ above which more nodes are advised
EVEN = 1e-9  # error of δ that needs no advice, however even the motion


def print_scene(machine: Scene, name: str) -> None:
    """Structure, links, loads."""
    mechanism = machine.mechanism
    console.print(Text(machine.title or name, style="bold"))
    console.print(f"structure  {mechanism.formula()}", highlight=False)
    target = "" if machine.target_delta is None else f", wanted δ {float(machine.target_delta):g}"
    fixed = ", ".join(f"{name} ({float(at.x):.6g}, {float(at.y):.6g})" for name, at in mechanism.fixed.items())
    speed = float(machine.speed)
    for key, value in {
        "speed": f"{speed:.6g} rad/s ({speed * 30 / math.pi:.6g} rpm), {machine.mean} mean",
        "gravity": f"({float(machine.gravity.x):.6g}, {float(machine.gravity.y):.6g}) m/s²",
        "flywheel": f"{float(mechanism.flywheel.inertia):.6g} kg m²{target}",
        "frame": f"{fixed} m",
    }.items():
        console.print(f"{key:10s} {value}", highlight=False, markup=False)
    table = Table(
        "link", "length [m]", "mass [kg]", "centre [m]", "inertia [kg m²]", "points", box=None, pad_edge=False
    )
    for name in mechanism.link_names:
        body, link = mechanism.links[name].actual(), mechanism.links[name]
        centre = f"{link.centre_name} ({float(body.centre.x):.6g}, {float(body.centre.y):.6g})"
        points = ", ".join(f"{p} ({float(at.x):.6g}, {float(at.y):.6g})" for p, at in body.points.items())
        table.add_row(
            name, f"{float(link.length):.6g}", f"{float(body.mass):.6g}", centre, f"{float(body.inertia):.6g}", points
        )
    console.print(table)
    for name in mechanism.link_names:
        for piece, weight in mechanism.links[name].counterweights.items():
            kind = "ideal" if weight.ideal else f"own inertia {float(weight.own_inertia()):.6g} kg m²"
            at = f"({float(weight.at.x):.6g}, {float(weight.at.y):.6g}) m"
            console.print(f"weight     {piece}: {float(weight.mass):.6g} kg on {name} at {at}, {kind}", highlight=False)
    for entry in machine.loads:
        window = "all the time"
        if entry.window is not None:
            on, off = (math.degrees(float(angle)) for angle in (entry.window.on, entry.window.off))
            window = f"from {on:.6g} to {off:.6g} degrees"
        against = " against its motion" if entry.opposing else ""
        size = _size(entry)
        where = f"{entry.link} {entry.point}".strip()
        console.print(f"load       {entry.name}: {size} on {where}{against}, {window}", highlight=False, markup=False)


def _size(load: Any) -> str:
    """How large a load is, with its unit."""
    if isinstance(load, Force):
        return f"({float(load.force.x):.6g}, {float(load.force.y):.6g}) N"
    size = load.torque if isinstance(load, Torque) else load.magnitude
    return f"{float(size):.6g} {'N' if load.point else 'N m'}"


def print_summary(data: dict[str, Any], machine: Scene) -> None:
    """Motion, flywheel, peaks, margins, dead centres, checks."""
    run, wheel, checks = data["motion"], data["flywheel"], data["checks"]
    rpm = 30 / math.pi
    console.print(Text(machine.title or data["scene"], style="bold"))
    console.print(f"{machine.mechanism.formula()}\n", highlight=False)
    table = Table(box=None, show_header=False, pad_edge=False)
    rows = [
        ("speed fluctuation δ", f"{_digits(run['delta'], run['delta_error'])}  ± {run['delta_error']:.1e}"),
        ("mean speed", f"{run['mean_speed'] * rpm:.6g} rpm ({data['model']['mean']} mean)"),
        ("largest speed", f"{run['speed_max'] * rpm:.6g} rpm at {math.degrees(run['angle_of_max']):.3f}°"),
        ("smallest speed", f"{run['speed_min'] * rpm:.6g} rpm at {math.degrees(run['angle_of_min']):.3f}°"),
        ("constant drive torque", f"{run['drive_torque_mean']:.6g} N m"),
        ("mean power", f"{run['mean_power'] / 1e3:.6g} kW"),
        ("flywheel given", f"{wheel['given']:.6g} kg m²"),
    ]
    if wheel["for_target_delta"] is not None:
        need, target = wheel["for_target_delta"], wheel["target_delta"]
        exact = f"{need:.6g} kg m²" if need > 0 else "none needed"
        rows.append((f"flywheel for δ = {target:g}", f"{exact}  (textbook ΔA/(δω²): {wheel['textbook']:.4g} kg m²)"))
    for name, value in rows:
        table.add_row(name, value)
    console.print(table, highlight=False)
    _print_peaks(data)
    _print_limits(data)
    residuals = ", ".join(f"{name.replace('_', ' ')} {value:.0e}" for name, value in checks.items())
    console.print(f"\nchecks     {residuals}", highlight=False)
    print_warnings(data)
    model = data["model"]
    if run["delta_error"] > max(COARSE * run["delta"], EVEN):
        more = f"the motion is too uneven for {model['nodes']} nodes; better: --nodes {4 * model['nodes']}"
        console.print(f"WARNING: {more}", style="bold", highlight=False)
    console.print(f"model      {model['motion']}, {model['nodes']} nodes: {model['why']}", highlight=False)


def print_warnings(data: dict[str, Any], which: str = "") -> None:
    """What is wrong with an analysis, or with `which` of several."""
    limit, of = check_limit(data), f"{which}: " if which else ""
    if not all(value <= limit for value in data["checks"].values()):  # a NaN is no pass either
        console.print(f"WARNING: {of}a check is above {limit:g}; do not trust these figures", style="bold red")
    if data["result"]["code"]:
        console.print(f"WARNING: {of}{data['result']['message']}", style="bold", markup=False)


def _digits(value: float, error: float) -> str:
    """A value with the digits that its error leaves, ten at most, and one more."""
    known = math.log10(value / error) if value > 0 and 0 < error < math.inf else 9.0
    return f"{value:.{min(max(math.ceil(known) + 1, 2), 10)}g}"


def _print_peaks(data: dict[str, Any]) -> None:
    table = Table("peak", "true motion", "at", "constant speed", "at", box=None, pad_edge=False)
    peaks = data["peaks"]
    for name, peak in peaks.items():
        if name.endswith("_constant_speed"):
            continue
        other = peaks[f"{name}_constant_speed"]
        unit, scale = ("N m", 1.0) if name in ("shaking_moment", "drive_torque") else ("kN", 1e-3)
        table.add_row(
            name.replace("_", " "), f"{peak['value'] * scale:.6g} {unit}", f"{math.degrees(peak['angle']):.2f}°",
            f"{other['value'] * scale:.6g} {unit}", f"{math.degrees(other['angle']):.2f}°",
        )  # fmt: skip
    console.print()
    console.print(table, highlight=False)


def _print_limits(data: dict[str, Any]) -> None:
    console.print()
    for name, group in data["groups"].items():
        if "margin" in group:
            worst = f"margin {group['margin']:.4g} at {math.degrees(group['margin_angle']):.2f}°"
            ends = [math.degrees(angle) for angle in group.get("transmission_span", ())]
            span = f", transmission angle {ends[0]:.1f}…{ends[1]:.1f}°" if ends else ""
            console.print(f"{group['formula']:5s} {name}: {worst}{span}", highlight=False)
    stops: dict[str, list[str]] = {}
    for entry in data["dead_centres"]:
        stops.setdefault(entry.get("point") or entry["link"], []).append(f"{math.degrees(entry['angle']):.4f}°")
    for name, places in stops.items():
        covered = data["strokes"].get(name)
        console.print(f"dead centres of {name}: {', '.join(places)}{_stroke(covered)}", highlight=False)


def _stroke(covered: dict[str, Any] | None) -> str:
    if covered is None:
        return ""
    point = covered["unit"] == "m"
    value = f"stroke {1e3 * covered['value']:.6g} mm" if point else f"swing {math.degrees(covered['value']):.6g}°"
    ratio = "" if covered["time_ratio"] is None else f", time ratio {covered['time_ratio']:.4f}"
    return f"; {value}{ratio}"


def print_at(data: dict[str, Any], degrees: float) -> None:
    """Everything at the one crank angle of a document."""
    console.print(f"\nat {degrees:g}° of crank angle", style="bold", highlight=False)
    table = Table("point", "x [m]", "y [m]", "x'", "y'", "x''", "y''", box=None, pad_edge=False)
    for name, point in _without_noise(data["points"]).items():
        table.add_row(name, *map(_number, point.values()))
    console.print(table, highlight=False)
    table = Table("link", "angle [°]", "ω'", "ε'", box=None, pad_edge=False)
    for name, link in _without_noise(data["links"]).items():
        table.add_row(name, _number(math.degrees(link["angle"])), _number(link["d"]), _number(link["dd"]))
    console.print(table, highlight=False)
    table = Table("joint", "on", "by", "fx [N]", "fy [N]", "moment [N m]", box=None, pad_edge=False)
    joints = data["forces"]["reactions"].items()
    sides = {(joint, link): side for joint, links in joints for link, side in links.items()}
    forces = {key: {k: side[k] for k in ("fx", "fy", "moment")} for key, side in sides.items()}
    for (joint, link), force in _without_noise(forces).items():
        table.add_row(joint, link, sides[joint, link]["by"], *map(_number, force.values()))
    console.print(table, highlight=False)
    reduced, run = data["reduced"], data["motion"]
    speed = run["mean_speed"] if data["model"]["constant_speed"] else run["speed"][0]
    console.print(
        f"J {reduced['inertia'][0]:.7g} kg m², J' {reduced['inertia_slope'][0]:.7g} kg m², "
        f"Q {reduced['torque'][0]:.7g} N m, ω {speed:.7g} rad/s, "
        f"drive torque {data['forces']['drive_torque'][0]:.7g} N m",
        highlight=False,
    )


def _without_noise(rows: dict[Any, dict[str, Any]]) -> dict[Any, dict[str, float]]:
    """First value of every cell, with zero for what is only rounding beside the largest of its kind (x and y: one)."""
    largest: dict[str, float] = {}
    for row in rows.values():
        for key, value in row.items():
            largest[key.rstrip("xy")] = max(largest.get(key.rstrip("xy"), 0.0), abs(float(value[0])))

    def clean(key: str, value: Any) -> float:
        return 0.0 if abs(float(value[0])) <= 1e-14 * largest[key.rstrip("xy")] else float(value[0])

    return {name: {key: clean(key, value) for key, value in row.items()} for name, row in rows.items()}


def _number(value: float) -> str:
    return f"{value + 0.0:.6g}"  # adding zero drops the sign of a negative zero
