"""The command line: the only place that prints.

Exit codes: 0 done, 1 the machine cannot do it (cannot be assembled, no periodic regime, no inertia), 2 bad input.
"""

from __future__ import annotations

import csv
import json
import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

import linkjax
from linkjax import __version__
from linkjax._compile import keep_in, stop
from linkjax._config import cache_folder, enable_x64
from linkjax._results import MachineError
from linkjax._types import as_float
from linkjax.analysis import analyse, check_limit, document, explain, pick, plain
from linkjax.machine import Scene
from linkjax.scenes import SceneError, build, load_document, override, scene_names, setting, starter

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None)
console, complaints = Console(), Console(stderr=True)


class Road(StrEnum):
    """How the true motion is found."""

    quadrature = "quadrature"
    diffrax = "diffrax"


SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="A built-in scene or the path of a scene file.")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help='Change a key, e.g. --set links.rod.length="1.1 m".'),
]
Out = Annotated[Path | None, typer.Option(help="Folder for report, figures and animation.")]
JsonFile = Annotated[Path | None, typer.Option("--json", help="Write the whole analysis as JSON.")]
CsvFolder = Annotated[Path | None, typer.Option("--csv", help="Folder for tables over the crank angle.")]


def main() -> None:
    """Entry point of `linkjax`."""
    try:
        app(standalone_mode=True)
    except SceneError as error:
        complaints.print(str(error), markup=False, highlight=False, soft_wrap=True)
        sys.exit(2)
    except OSError as error:
        complaints.print(f"{error.filename or ''}: {error.strerror or error}; choose another place", markup=False,
                         highlight=False, soft_wrap=True)  # fmt: skip
        sys.exit(2)
    except MachineError as error:
        complaints.print(str(error), markup=False, highlight=False, soft_wrap=True)
        sys.exit(1)
    finally:
        stop()  # interrupted: what waits to be compiled is not waited for


def _version(wanted: bool | None) -> None:
    if wanted:
        console.print(f"linkjax {__version__}", highlight=False)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[bool | None, typer.Option("--version", callback=_version, is_eager=True)] = None,
) -> None:
    """Planar machines: a whole working cycle, exact and differentiable."""
    enable_x64()
    keep_in(cache_folder())


@app.command()
def scenes() -> None:
    """List the built-in scenes."""
    table = Table("scene", "title", "structure", box=None, pad_edge=False)
    for name in scene_names():
        scene = build(load_document(name))
        table.add_row(name, Text(scene.title), scene.mechanism.formula())
    console.print(table)


@app.command()
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the new scene; NAME.toml is written.")],
) -> None:
    """Write a commented starter scene NAME.toml."""
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if path.exists():
        raise SceneError(str(path), "", None, "exists already", "choose another name or delete the file")
    path.write_text(starter(path.stem), encoding="utf-8")
    console.print(f"{path} written; next: linkjax analyse {path}", highlight=False)


@app.command()
def show(scene: SceneName, set_: Set = None) -> None:
    """Show a scene: structure, links, loads."""
    machine = _load(scene, set_)
    mechanism = machine.mechanism
    console.print(Text(machine.title or scene, style="bold"))
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
    if isinstance(load, linkjax.Force):
        return f"({float(load.force.x):.6g}, {float(load.force.y):.6g}) N"
    size = load.torque if isinstance(load, linkjax.Torque) else load.magnitude
    return f"{float(size):.6g} {'N' if load.point else 'N m'}"


@app.command(name="analyse")
def analyse_command(
    scene: SceneName,
    out: Out = None,
    json_file: JsonFile = None,
    csv_folder: CsvFolder = None,
    angles: Annotated[int, typer.Option(min=2, help="Uniform crank angles over the cycle.")] = 360,
    at: Annotated[float | None, typer.Option(metavar="DEG", help="Also print everything at this crank angle.")] = None,
    constant_speed: Annotated[bool, typer.Option("--constant-speed", help="Forces at constant nominal speed.")] = False,
    motion: Annotated[Road, typer.Option(help="How the true motion is found.")] = Road.quadrature,
    nodes: Annotated[int, typer.Option(min=8, help="Nodes of the cycle grid per crank turn.")] = 96,
    set_: Set = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Analyse a working cycle: kinematics, motion, forces, flywheel."""
    console.quiet = quiet
    machine = _load(scene, set_)
    if at is not None and not math.isfinite(at):
        raise SceneError("--at", "", at, "is no angle", "give degrees of crank angle, e.g. --at 90")
    for folder in (out, csv_folder, json_file and json_file.parent):
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
    uniform = [i * (machine.cycle / angles) for i in range(angles)]
    extra = [] if at is None else [math.radians(at)]
    with _elapsed("analysing"):
        whole = analyse(machine, angles=as_float(uniform + extra), nodes=nodes, constant_speed=constant_speed,
                        motion=motion.value, throw=False)  # fmt: skip
        cycle = pick(whole, slice(0, angles))
        data = document(cycle, scene, __version__)
    if json_file:
        json_file.write_text(json.dumps(plain(data), allow_nan=False), encoding="utf-8")
    if csv_folder:
        _write_csv(data, csv_folder)
    explain(cycle)
    _print_summary(data, machine)
    if at is not None:
        _print_at(document(pick(whole, slice(angles, angles + 1)), scene, __version__), at)
    if out:
        _write_out(data, machine, out)


def _write_out(data: dict[str, Any], machine: Scene, out: Path) -> None:
    with _elapsed("drawing"):
        figures = linkjax.viz.write_figures(data, machine, out)  # the room loads matplotlib, so only when drawing
        linkjax.viz.animate(data, machine, out / "machine.gif")
        linkjax.report.write_report(data, machine, figures, out / "report.html", out / "machine.gif")
    console.print(f"\n{len(figures)} figures, machine.gif and report.html in {out}", highlight=False)


def _load(name: str, changes: list[str] | None) -> Scene:
    found = load_document(name)
    for change in changes or ():
        key, equals, value = change.partition("=")
        if not equals:
            raise SceneError(name, key, None, "--set needs KEY=VALUE", 'write e.g. --set links.rod.length="1.1 m"')
        found = override(found, key.strip(), setting(value))
    return build(found)


@contextmanager
def _elapsed(what: str) -> Iterator[None]:
    """A spinner with elapsed time, shown only once a second has passed."""
    start = time.perf_counter()
    status = console.status(what, spinner="dots") if console.is_terminal else None
    if status is None:
        yield
        return
    import threading

    done = threading.Event()

    def tick() -> None:
        if done.wait(1.0):
            return
        status.start()
        while not done.wait(0.1):
            status.update(f"{what} … {time.perf_counter() - start:.0f} s")
        status.stop()

    thread = threading.Thread(target=tick, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def _print_summary(data: dict[str, Any], machine: Scene) -> None:
    run, wheel, checks = data["motion"], data["flywheel"], data["checks"]
    rpm = 30 / math.pi
    console.print(Text(machine.title or data["scene"], style="bold"))
    console.print(f"{machine.mechanism.formula()}\n", highlight=False)
    table = Table(box=None, show_header=False, pad_edge=False)
    rows = [
        ("speed fluctuation δ", f"{run['delta']:.10g}  ± {run['delta_error']:.1e}"),
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
    limit = check_limit(data)
    if not all(value <= limit for value in checks.values()):  # a NaN is no pass either
        console.print(f"WARNING: a check is above {limit:g}; do not trust these figures", style="bold red")
    if data["result"]["code"]:
        console.print(f"WARNING: {data['result']['message']}", style="bold", markup=False)
    model = data["model"]
    console.print(f"model      {model['motion']}, {model['nodes']} nodes: {model['why']}", highlight=False)


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
            least, most = (math.degrees(angle) for angle in group["transmission_span"])
            span = f"transmission angle {least:.1f}…{most:.1f}°"
            console.print(f"{group['formula']:5s} {name}: {worst}, {span}", highlight=False)
    stops: dict[str, list[str]] = {}
    for entry in data["dead_centres"]:
        stops.setdefault(entry.get("point") or entry["link"], []).append(f"{math.degrees(entry['angle']):.4f}°")
    for name, places in stops.items():
        console.print(f"dead centres of {name}: {', '.join(places)}", highlight=False)


def _print_at(data: dict[str, Any], degrees: float) -> None:
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


def _write_csv(data: dict[str, Any], folder: Path) -> None:
    """One table per kind, crank angle (rad) in the first column, keys of the JSON document as headings."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("points", "links", "groups", "reduced", "motion", "forces", "forces_constant_speed"):
        columns = {"angle": data["angles"]} | dict(_columns(data[name], len(data["angles"])))
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*(map(repr, map(float, column)) for column in columns.values()), strict=True))


def _columns(tree: dict[str, Any], length: int, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _columns(value, length, f"{prefix}{key}.")
        elif getattr(value, "shape", ()) == (length,):
            yield prefix + key, value
