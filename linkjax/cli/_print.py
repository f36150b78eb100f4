"""Tables of an analysis and of a scene on the screen."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from rich.table import Table
from rich.text import Text

from linkjax._display import NONE, Numbers, above, retold
from linkjax._results import Result
from linkjax.analysis import (
    acts_text,
    check_limit,
    efficiency_rows,
    energy_rows,
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
    still_rows,
    torque_scale,
    uneven,
)
from linkjax.cli._console import console
from linkjax.groups import Harmonic
from linkjax.kinematics import AssemblyModes, crank_ranges
from linkjax.loads import Passage, Window
from linkjax.machine import Scene, friction_text, load_place, load_size, motor_text, speed_text, when_text
from linkjax.measures import in_motion, measure_remark
from linkjax.mechanism import Mechanism
from linkjax.topology import Structure

COARSE = 1e-4  # relative error of δ above which more nodes are advised
EVEN = 1e-9  # error of δ below which nothing is advised


def print_scene(machine: Scene, name: str, show: Numbers, sketched: Collection[tuple[str, ...]] = ()) -> None:
    """Print structure, links and loads, with an asterisk at values from the sketch; see `scenes.sketched_keys`."""
    mechanism = machine.mechanism
    console.print(Text(machine.title or name, style="bold"))
    console.print(f"structure  {mechanism.formula()}", highlight=False)
    target = "" if machine.target_delta is None else f", target δ {float(machine.target_delta):g}"
    frame = ", ".join(f"{name} {show.place((at.x, at.y))}" for name, at in mechanism.fixed.items())
    for key, value in {
        "speed": speed_text(machine, show),
        "gravity": show.place((machine.gravity.x, machine.gravity.y), "m/s²"),
        "flywheel": f"{show.shown(mechanism.flywheel.inertia, 'kg·m²')}{target}",
        "frame": frame,
        "drive": _drive(mechanism, show) + "*" * (("drive",) in sketched),
        **({} if machine.motor is None else {"motor": motor_text(machine.motor, show)}),
    }.items():
        console.print(f"{key:10s} {value}", highlight=False, markup=False)
    if limits := _limits(machine, show):
        console.print(f"range      {limits}", highlight=False, markup=False)
    table = Table("link", "length", "mass", "mass centre", "inertia", "points", box=None, pad_edge=False)
    for name in mechanism.link_names:
        body, link = mechanism.links[name].actual(), mechanism.links[name]
        centre = f"{link.centre_name} {show.place((body.centre.x, body.centre.y))}"
        points = ", ".join(
            f"{point} {show.place((at.x, at.y))}" + "*" * ((name, point) in sketched)
            for point, at in body.points.items()
        )
        length = show.shown(link.length, "m") + "*" * ((name, "length") in sketched)
        table.add_row(
            name, length if float(link.length) > 0 else NONE, show.shown(body.mass, "kg"), centre,
            show.shown(body.inertia, "kg·m²"), points,
        )  # fmt: skip
    console.print(table)
    for name in _at_first_pins(mechanism):
        line = f"{name}: its mass is at its first pin, without inertia; give centre and inertia, or uniform = true"
        console.print(f"note       {line}", highlight=False, markup=False)
    if sketched:
        console.print("* taken from the sketch", highlight=False, markup=False)
    for name in mechanism.link_names:
        for piece, weight in mechanism.links[name].counterweights.items():
            kind = "ideal" if weight.ideal else f"own inertia {show.shown(weight.own_inertia(), 'kg·m²')}"
            where = f"{show.shown(weight.mass, 'kg')} on {name} at {show.place((weight.at.x, weight.at.y))}"
            console.print(f"weight     {piece}: {where}, {kind}", highlight=False)
    for load in machine.loads:
        when = when_text(show, load.window)
        when = f"from {when}" if isinstance(load.window, Window) else when
        told = f"load       {load.name}: {load_size(show, load)}, on {load_place(load)}, {when}"
        console.print(told, highlight=False, markup=False)
    for friction in machine.friction:
        joint, coefficient, more = friction_text(friction, show)
        coefficient = "" if coefficient == NONE else f"coefficient {coefficient}, "
        console.print(f"friction   {joint}: {coefficient}{more}", highlight=False, markup=False)


def _at_first_pins(mechanism: Mechanism) -> list[str]:
    """Bars with a mass that nothing places: it is at their first pin, as a point."""
    found = []
    for name, link in mechanism.links.items():
        body = link.actual()
        placed = float(body.centre.x) or float(body.centre.y) or float(body.inertia) or link.counterweights
        if float(link.length) > 0 and float(body.mass) > 0 and not placed:
            found.append(name)
    return [name for name in mechanism.link_names if name in found]


def _drive(mechanism: Mechanism, show: Numbers) -> str:
    """The driving link and its position at crank angle zero."""
    drive, slides = mechanism.driver.as_drive(), mechanism.driver.drive_slides()
    assert drive is not None  # a mechanism has a driver
    law, on = drive.law, "" if drive.on == "frame" else f" on {drive.on}"
    phase = 0.0 if slides or drive.phase is None else float(drive.phase)
    begins = phase + (0.0 if law is None else law.begins())
    at = show.shown(begins, "m") if slides else show.turned(begins)
    ends = ""
    if isinstance(law, Harmonic):
        ends = f", to {show.shown(law.stop, 'm') if slides else show.turned(phase + float(law.stop))} and back"
    return f"{drive.link}{on}, at {at} at crank angle zero{ends}"


def _limits(machine: Scene, show: Numbers) -> str:
    """The ranges of a crank that cannot rotate fully; "" for others, and for drives with a motion law."""
    mechanism = machine.mechanism
    if mechanism.driver.shaft() is None or mechanism.driver.follows() is not None:
        return ""
    ranges = crank_ranges(mechanism, machine.cycle_turns)
    if not ranges:
        return "none: the machine cannot be assembled at any crank angle"
    if not ranges[0].at_start and not ranges[0].at_stop:
        return ""
    between = " and ".join(f"from {show.turned(r.start)} to {show.turned(r.stop)}" for r in ranges)
    return f"of crank angle: {between}; the machine cannot be assembled beyond their ends"


def print_structure(found: Structure) -> None:
    """Print mobility, structural formulas, and the joints of every group."""
    console.print(f"mobility   {found.mobility_formula()}", highlight=False)
    console.print(f"structure  {found.formula()}", highlight=False)
    console.print(f"numbered   {found.formula(numbers=True)}", highlight=False)
    console.print(f"pairs      {found.formula(letters=True)}\n", highlight=False)
    table = Table("links", "class", "pairs", "outer pairs", "inner pairs", box=None, pad_edge=False)
    for part in found.parts:
        outer = ", ".join(f"{p.name} ({p.one} on {p.other})" for p in part.outer)
        inner = ", ".join(f"{p.name} ({p.one} on {p.other})" for p in part.inner)
        table.add_row(", ".join(part.links), part.kind, part.letters, outer, inner or NONE)
    console.print(table)


def print_assemblies(found: dict[str, AssemblyModes], show: Numbers) -> None:
    """Print the assembly modes of groups of higher class at crank angle zero, as sketches."""
    for name, ways in found.items():
        several = "1 assembly mode" if len(ways.sketches) == 1 else f"{len(ways.sketches)} assembly modes"
        listed = "; as [sketch]:" if ways.sketches else ""
        console.print(f"\n{name} has {several} at 0° ({ways}){listed}",
                      highlight=False, markup=False)  # fmt: skip
        for sketch in ways.sketches:
            size = max((abs(float(value)) for at in sketch.values() for value in (at.x, at.y)), default=0.0)
            places = ", ".join(f"{point} {show.place((at.x, at.y), beside=size)}" for point, at in sketch.items())
            console.print(f"  {places}", highlight=False, markup=False)


def print_summary(data: dict[str, Any], machine: Scene, show: Numbers) -> None:
    """Print motion, flywheel, peaks, margins, limit positions and checks."""
    console.print(Text(machine.title or data["scene"], style="bold"))
    console.print(f"{machine.mechanism.formula()}\n", highlight=False)
    _print_motion(data, machine, show)
    _print_energies(data, show)
    _print_peaks(data, show)
    _print_limits(data, show)
    _print_measures(data, show)
    checks, model, run = data["checks"].items(), data["model"], data["motion"]
    residuals = ", ".join(f"{name.replace('_', ' ')} {value:.0e}" for name, value in checks if value is not None)
    console.print(f"\nchecks     {residuals}", highlight=False)
    print_warnings(data, show)
    if data["model"]["method"] == "constant speed" and machine.target_delta is not None:
        console.print("NOTE: no flywheel is computed at constant speed", highlight=False)
    if moves(data) and run["delta_error"] > max(COARSE * run["delta"], EVEN):
        more = f"δ has an error of {100 * run['delta_error'] / run['delta']:.2g} %: repeat it with more --nodes"
        console.print(f"WARNING: {more}", style="bold", highlight=False)
    if model["indeterminate"]:
        joints = ", ".join(model["indeterminate"])
        more = "are statically indeterminate; redundant links are assumed to carry only their own weight, inertia and "
        more += "loads"
        console.print(f"NOTE: reactions at {joints} {more}", highlight=False, markup=False)
    none = model["method"] == "none"
    how = "constant speed only" if none else model["method"]
    why = "" if none else f": {model['why']}"
    console.print(f"model      {how}, {model['nodes']} nodes{why}", highlight=False, markup=False)


def _print_motion(data: dict[str, Any], machine: Scene, show: Numbers) -> None:
    """Print the actual motion, if there is one, the speed, and the flywheel."""
    run, wheel = data["motion"], data["flywheel"]
    fastest, slowest = (f" at {show.turned(run[f'angle_of_{end}'])}" if uneven(data) else "" for end in ("max", "min"))
    table = Table(box=None, show_header=False, pad_edge=False)
    rows = still_rows(data, float(machine.speed), show) if not moves(data) else [
        ("coefficient of speed fluctuation δ", " ".join(show.measured(run["delta"], run["delta_error"]))),
        ("mean crank speed", f"{show.speed(run['mean_speed'])} ({data['model']['mean']} mean)"),
        ("max crank speed", f"{show.speed(run['max_speed'], error=speed_error(data))}{fastest}"),
        ("min crank speed", f"{show.speed(run['min_speed'], error=speed_error(data))}{slowest}"),
        ("mean drive torque", show.quantity(run["mean_drive_torque"], "N·m", 6, torque_scale(data))),
        ("mean power", show.quantity(run["mean_power"], "W", 6, power_scale(data))),
        *motor_rows(data, show),
    ]  # fmt: skip
    rows += efficiency_rows(data, show)
    rows.append(("flywheel given", show.shown(wheel["given"], "kg·m²")))
    if wheel["for_target_delta"] is not None:
        need, target = wheel["for_target_delta"], wheel["target_delta"]
        exact = show.quantity(need, "kg·m²", 6) if need > 0 else "none needed"
        textbook = show.quantity(wheel["textbook"], "kg·m²", 4)
        torque = ", at a constant torque" if data.get("motor") else ""
        rows.append((f"flywheel for δ = {target:g}", f"{exact}  (textbook ΔA/(δω²){torque}: {textbook})"))
    rows += [
        (f"load {load.name} acts", acts_text(data, load.name, show))
        for load in machine.loads if isinstance(load.window, Passage)
    ]  # fmt: skip
    for name, value in rows:
        table.add_row(name, value)
    console.print(table, highlight=False)


def _print_energies(data: dict[str, Any], show: Numbers) -> None:
    """Print the energies per cycle by source and sink, if there is more than gravity."""
    rows = energy_rows(data, show)
    if rows:
        table = Table(*rows[0], box=None, pad_edge=False)
        for row in rows[1:]:
            table.add_row(*map(Text, row))
        console.print()
        console.print(table, highlight=False)


def print_warnings(data: dict[str, Any], show: Numbers, which: str = "") -> None:
    """Print the warnings of an analysis, or of `which` of several."""
    limit, of = check_limit(data), f"{which}: " if which else ""
    if not all(value <= limit for value in data["checks"].values() if value is not None):  # NaN fails, too
        console.print(f"WARNING: {of}a check is above {limit:g}; do not trust these figures", style="bold red")
    message, still = retold(data["result"]["message"], show), data.get("model", {}).get("method") == "none"
    still |= data["result"]["code"] == Result.LOCKED
    if still and not data["result"]["code"]:
        console.print(f"NOTE: {of}{message}", markup=False, highlight=False)
    elif data["result"]["code"] and (which or not still):  # for one machine this is the last line
        console.print(f"WARNING: {of}{message}", style="bold", markup=False, highlight=False)


def _print_peaks(data: dict[str, Any], show: Numbers) -> None:
    motions, names = peak_motions(data), peak_names(data)
    if not names:
        return
    heads = [cell for motion in motions for cell in (motion, "at")]
    table = Table("peak", *heads, box=None, pad_edge=False)
    for name in names:
        keys = [in_motion(name, constant) for constant in motions.values()]
        values = [show.quantity(peak_shown(data, key)[0], peak_unit(name), 6) for key in keys]
        angles = [peak_place(data, key, show) for key in keys]
        table.add_row(peak_label(name), *(cell for pair in zip(values, angles, strict=True) for cell in pair))
    console.print()
    console.print(table, highlight=False)


def _print_measures(data: dict[str, Any], show: Numbers) -> None:
    """Print the measures that were asked for."""
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, found in data.get("measures", {}).items():
        table.add_row(name, show.told([found["value"]], found["unit"], 8)[0], measure_remark(name, found["value"]))
    if table.row_count:
        console.print()
        console.print(table, highlight=False, markup=False)


def _print_limits(data: dict[str, Any], show: Numbers) -> None:
    console.print()
    for name, group in data["groups"].items():
        if group.get("margin", 1.0) < 1:  # toothed gears have a constant margin of one
            worst = f"min margin {above(group['margin'], 1.0):.4g} at {show.turned(group['margin_angle'])}"
            ends = [show.turned(angle) for angle in group.get("transmission_span", ())]
            span = f", transmission angle {ends[0]} … {ends[1]}" if ends else ""
            console.print(f"{group['formula']:5s} {name}: {worst}{span}", highlight=False)
    stops: dict[tuple[str, str], list[str]] = {}
    for entry in data["dead_centres"]:
        kind, name = ("dead centres", entry["point"]) if "point" in entry else ("limit positions", entry["link"])
        stops.setdefault((kind, name), []).append(show.turned(entry["angle"]))
    for (kind, name), places in stops.items():
        covered = (
            _stroke(data["strokes"].get(name), "stroke", "m", show)
            if kind == "dead centres"
            else _stroke(data["swings"].get(name), "swing", "rad", show)
        )
        console.print(f"{kind} of {name}: {', '.join(places)}{covered}", highlight=False)


def _stroke(covered: dict[str, Any] | None, what: str, unit: str, show: Numbers) -> str:
    if covered is None:
        return ""
    value = show.told([covered["value"]], unit, 6)[0]
    ratio = "" if covered["time_ratio"] is None else f", time ratio {covered['time_ratio']:.4f}"
    return f"; {what} {value}{ratio}"
