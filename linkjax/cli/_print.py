"""An analysis and a scene as tables on the screen."""

from __future__ import annotations

import math
from typing import Any

from rich.table import Table
from rich.text import Text

from linkjax._display import NONE, Numbers, above
from linkjax.analysis import check_limit, load_size, peak_told, peak_unit, power_scale, torque_scale, uneven
from linkjax.cli._console import console
from linkjax.kinematics import Assemblies
from linkjax.machine import Scene
from linkjax.mechanism import Structure

COARSE = 1e-4  # relative error of δ above which more nodes are advised
EVEN = 1e-9  # error of δ that needs no advice, however even the motion


def print_scene(machine: Scene, name: str, show: Numbers) -> None:
    """Structure, links, loads."""
    mechanism = machine.mechanism
    console.print(Text(machine.title or name, style="bold"))
    console.print(f"structure  {mechanism.formula()}", highlight=False)
    target = "" if machine.target_delta is None else f", wanted δ {float(machine.target_delta):g}"
    frame = ", ".join(f"{name} {show.place((at.x, at.y))}" for name, at in mechanism.fixed.items())
    for key, value in {
        "speed": f"{show.bound(machine.speed, 'rad/s')}, {machine.mean} mean",
        "gravity": show.place((machine.gravity.x, machine.gravity.y), "m/s²"),
        "flywheel": f"{show.shown(mechanism.flywheel.inertia, 'kg·m²')}{target}",
        "frame": frame,
    }.items():
        console.print(f"{key:10s} {value}", highlight=False, markup=False)
    table = Table("link", "length", "mass", "mass centre", "inertia", "points", box=None, pad_edge=False)
    for name in mechanism.link_names:
        body, link = mechanism.links[name].actual(), mechanism.links[name]
        centre = f"{link.centre_name} {show.place((body.centre.x, body.centre.y))}"
        points = ", ".join(f"{point} {show.place((at.x, at.y))}" for point, at in body.points.items())
        table.add_row(
            name, show.shown(link.length, "m") if float(link.length) > 0 else NONE, show.shown(body.mass, "kg"), centre,
            show.shown(body.inertia, "kg·m²"), points,
        )  # fmt: skip
    console.print(table)
    for name in mechanism.link_names:
        for piece, weight in mechanism.links[name].counterweights.items():
            kind = "ideal" if weight.ideal else f"own inertia {show.shown(weight.own_inertia(), 'kg·m²')}"
            where = f"{show.shown(weight.mass, 'kg')} on {name} at {show.place((weight.at.x, weight.at.y))}"
            console.print(f"weight     {piece}: {where}, {kind}", highlight=False)
    for load in machine.loads:
        window = "all the time"
        if load.window is not None:
            window = f"from {show.bound(load.window.on, 'rad')} to {show.bound(load.window.off, 'rad')}"
        where = f"{load.link} {load.point}".strip()
        told = f"load       {load.name}: {load_size(show, load)}, on {where}, {window}"
        console.print(told, highlight=False, markup=False)


def print_structure(found: Structure) -> None:
    """Mobility, formula, and how every group is attached."""
    console.print(f"mobility   {found.mobility_told()}", highlight=False)
    console.print(f"structure  {found.formula()}", highlight=False)
    console.print(f"numbered   {found.formula(numbers=True)}", highlight=False)
    console.print(f"pairs      {found.formula(letters=True)}\n", highlight=False)
    table = Table("links", "class", "pairs", "attached by", "inside", box=None, pad_edge=False)
    for part in found.parts:
        outer = ", ".join(f"{p.name} ({p.one} on {p.other})" for p in part.outer)
        inner = ", ".join(f"{p.name} ({p.one} on {p.other})" for p in part.inner)
        table.add_row(", ".join(part.links), part.kind, part.letters, outer, inner or NONE)
    console.print(table)


def print_assemblies(found: dict[str, Assemblies], show: Numbers) -> None:
    """The ways to assemble general groups at crank angle zero, as sketches."""
    for name, ways in found.items():
        several = "1 way" if len(ways.sketches) == 1 else f"{len(ways.sketches)} ways"
        listed = "; as [sketch]:" if ways.sketches else ""
        console.print(f"\n{name} can be assembled in {several} at 0° ({ways}){listed}",
                      highlight=False, markup=False)  # fmt: skip
        for sketch in ways.sketches:
            size = max((abs(float(value)) for at in sketch.values() for value in (at.x, at.y)), default=0.0)
            places = ", ".join(f"{point} {show.place((at.x, at.y), beside=size)}" for point, at in sketch.items())
            console.print(f"  {places}", highlight=False, markup=False)


def print_summary(data: dict[str, Any], machine: Scene, show: Numbers) -> None:
    """Motion, flywheel, peaks, margins, dead centres, checks."""
    run, wheel, checks = data["motion"], data["flywheel"], data["checks"]
    fastest, slowest = (f" at {show.turned(run[f'angle_of_{end}'])}" if uneven(data) else "" for end in ("max", "min"))
    console.print(Text(machine.title or data["scene"], style="bold"))
    console.print(f"{machine.mechanism.formula()}\n", highlight=False)
    table = Table(box=None, show_header=False, pad_edge=False)
    rows = [
        ("speed fluctuation δ", f"{_digits(run['delta'], run['delta_error'])}  ± {run['delta_error']:.1e}"),
        ("mean speed", f"{show.speed(run['mean_speed'])} ({data['model']['mean']} mean)"),
        ("largest speed", f"{show.speed(run['speed_max'])}{fastest}"),
        ("smallest speed", f"{show.speed(run['speed_min'])}{slowest}"),
        ("constant drive torque", show.quantity(run["drive_torque_mean"], "N·m", 6, torque_scale(data))),
        ("mean power", show.quantity(run["mean_power"], "W", 6, power_scale(data))),
        ("flywheel given", show.shown(wheel["given"], "kg·m²")),
    ]
    if wheel["for_target_delta"] is not None:
        need, target = wheel["for_target_delta"], wheel["target_delta"]
        exact = show.quantity(need, "kg·m²", 6) if need > 0 else "none needed"
        textbook = show.quantity(wheel["textbook"], "kg·m²", 4)
        rows.append((f"flywheel for δ = {target:g}", f"{exact}  (textbook ΔA/(δω²): {textbook})"))
    for name, value in rows:
        table.add_row(name, value)
    console.print(table, highlight=False)
    _print_peaks(data, show)
    _print_limits(data, show)
    residuals = ", ".join(f"{name.replace('_', ' ')} {value:.0e}" for name, value in checks.items())
    console.print(f"\nchecks     {residuals}", highlight=False)
    print_warnings(data)
    model = data["model"]
    if run["delta_error"] > max(COARSE * run["delta"], EVEN):
        more = f"the motion is too uneven for {model['nodes']} nodes; better: --nodes {4 * model['nodes']}"
        console.print(f"WARNING: {more}", style="bold", highlight=False)
    if model["indeterminate"]:
        joints = ", ".join(model["indeterminate"])
        more = "depend on how tight the passive links fit; given are those of links that do not help the others"
        console.print(f"NOTE: reactions at {joints} {more}", highlight=False, markup=False)
    console.print(f"model      {model['motion']}, {model['nodes']} nodes: {model['why']}", highlight=False)


def print_warnings(data: dict[str, Any], which: str = "") -> None:
    """What is wrong with an analysis, or with `which` of several."""
    limit, of = check_limit(data), f"{which}: " if which else ""
    if not all(value <= limit for value in data["checks"].values()):  # a NaN is no pass either
        console.print(f"WARNING: {of}a check is above {limit:g}; do not trust these figures", style="bold red")
    if data["result"]["code"]:
        console.print(f"WARNING: {of}{data['result']['message']}", style="bold", markup=False)


def _digits(value: float, error: float) -> str:
    """A value with the digits that its error leaves, ten at most, and one more; zero where it is below its error."""
    if value <= error < math.inf:
        return "0"
    known = math.log10(value / error) if value > 0 and 0 < error < math.inf else 9.0
    return f"{value:.{min(max(math.ceil(known) + 1, 2), 10)}g}"


def _print_peaks(data: dict[str, Any], show: Numbers) -> None:
    table = Table("peak", "true motion", "at", "constant speed", "at", box=None, pad_edge=False)
    peaks = data["peaks"]
    for name in (name for name in peaks if not name.endswith("_constant_speed")):
        both = [peak_told(data, key) for key in (name, f"{name}_constant_speed")]
        values = [show.quantity(value, peak_unit(name), 6) for value, _, _ in both]
        angles = [show.turned(angle) for _, angle, _ in both]
        table.add_row(name.replace("_", " "), values[0], angles[0], values[1], angles[1])
    console.print()
    console.print(table, highlight=False)


def _print_limits(data: dict[str, Any], show: Numbers) -> None:
    console.print()
    for name, group in data["groups"].items():
        if group.get("margin", 1.0) < 1:  # wheels with teeth have none that could be less
            worst = f"margin {above(group['margin'], 1.0):.4g} at {show.turned(group['margin_angle'])}"
            ends = [show.turned(angle) for angle in group.get("transmission_span", ())]
            span = f", transmission angle {ends[0]} … {ends[1]}" if ends else ""
            console.print(f"{group['formula']:5s} {name}: {worst}{span}", highlight=False)
    stops: dict[str, list[str]] = {}
    for entry in data["dead_centres"]:
        stops.setdefault(entry.get("point") or entry["link"], []).append(show.turned(entry["angle"]))
    for name, places in stops.items():
        covered = _stroke(data["strokes"].get(name), show)
        console.print(f"dead centres of {name}: {', '.join(places)}{covered}", highlight=False)


def _stroke(covered: dict[str, Any] | None, show: Numbers) -> str:
    if covered is None:
        return ""
    value = show.told([covered["value"]], covered["unit"], 6)[0]
    ratio = "" if covered["time_ratio"] is None else f", time ratio {covered['time_ratio']:.4f}"
    return f"; {'stroke' if covered['unit'] == 'm' else 'swing'} {value}{ratio}"
