"""All commands except `optimise`, `export` and `import`."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from linkjax import __version__
from linkjax._config import enable_x64
from linkjax._display import retold
from linkjax._results import MachineError, Result
from linkjax._types import as_float
from linkjax._units import QuantityError, quantity
from linkjax.analysis import (
    analyse,
    asked_harmonics,
    asked_measures,
    at_acceleration,
    document,
    explain,
    harmonics_document,
    pick,
    plain,
)
from linkjax.cli._console import console, elapsed
from linkjax.cli._options import (
    CsvFolder,
    JsonFile,
    Nodes,
    Out,
    Quiet,
    SceneName,
    Set,
    Units,
    changes_of,
    check_places,
    numbers_in,
    write_text,
)
from linkjax.cli._print import print_assemblies, print_scene, print_structure, print_summary
from linkjax.cli._print_at import print_at
from linkjax.cli._rolling import analyse_rolling, refuse, show_rolling
from linkjax.cli._said import messages_in, units_for
from linkjax.cli._write import check_picture, draw, write_csv, write_out
from linkjax.kinematics import assembly_modes, open_at_start
from linkjax.machine import Scene
from linkjax.measures import named
from linkjax.mechanism import StructureError, structure
from linkjax.rolling import RollingMachine, structure_of
from linkjax.scenes import (
    SceneError,
    build,
    json_schema,
    load,
    load_document,
    load_rolling,
    overridden,
    rolling_names,
    rolling_schema,
    rolling_starter,
    scene_names,
    sketched_keys,
    starter,
    starter_like,
)

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None)


class Method(StrEnum):
    """How the actual motion is computed."""

    quadrature = "quadrature"
    diffrax = "diffrax"


class Kind(StrEnum):
    """What a scene file describes."""

    linkage = "linkage"
    rolling = "rolling"


KindOf = Annotated[Kind, typer.Option("--kind", help="A linkage, or rolling bodies between two rings.")]
NODES = 96


def _version(wanted: bool | None) -> None:
    if wanted:
        console.print(f"linkjax {__version__}", highlight=False)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool | None, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = None,
) -> None:
    """Analysis and optimisation of planar machines over the complete working cycle."""
    enable_x64()


@app.command()
def scenes() -> None:
    """List the built-in scenes."""
    table = Table("scene", "title", "structure", box=None, pad_edge=False)
    for name in scene_names():
        scene = build(load_document(name))
        table.add_row(name, Text(scene.title), scene.mechanism.formula())
    for name in rolling_names():
        machine = load_rolling(name)
        table.add_row(name, Text(machine.title), structure_of(machine))
    console.print(table)


@app.command()
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the new scene file, with or without .toml.")],
    kind: KindOf = Kind.linkage,
    like: Annotated[
        str | None, typer.Option(metavar="SCENE", help="Begin with the file of this machine, e.g. hay-press.")
    ] = None,
) -> None:
    """Write a new scene file with comments."""
    if not Path(name).name.removesuffix(".toml").strip():
        raise SceneError("NAME", "", name, "is not the name of a file", "write a name, e.g. press")
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if path.exists():
        raise SceneError(str(path), "", None, "already exists", "choose another name or delete the file")
    if like is None:
        text = (starter if kind is Kind.linkage else rolling_starter)(path.stem)
    elif kind is Kind.linkage:
        text = starter_like(path.stem, like)
    else:
        raise SceneError("--kind", "", kind.value, "is known from the machine of --like", "omit --kind")
    path.write_text(text, encoding="utf-8")
    console.print(f"{path} written; next: linkjax analyse {shlex.quote(str(path))}", highlight=False)


@app.command()
def schema(kind: KindOf = Kind.linkage) -> None:
    """Print the JSON Schema of scene files."""
    found = json_schema() if kind is Kind.linkage else rolling_schema()
    typer.echo(json.dumps(found, indent=1, ensure_ascii=False))


@app.command()
def show(
    scene: SceneName,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also draw the machine to this file: .svg, .png or .pdf.")
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ANGLE",
            help="With --out: crank angle of the drawing (default: where joints are far apart); further ones are thin "
            "lines.",
        ),
    ] = None,
    units: Units = "",
    set_: Set = None,
) -> None:
    """Show structure, links and loads of a scene, and draw the machine without an analysis."""
    places = [angle_of(each) for each in at or ()]
    check_picture(out, bool(at))
    chosen, changes = numbers_in(units), changes_of(scene, set_)
    document = load_document(scene)
    rolling = document.rolling
    with messages_in(chosen):
        machine = load_rolling(scene, changes) if rolling else build(document := overridden(document, changes))
    shown = numbers_in(units_for(scene, changes, units))
    if isinstance(machine, RollingMachine):
        refuse(scene, {"--at": bool(at)})
        show_rolling(machine, scene, shown)
    else:
        print_scene(machine, scene, shown, sketched_keys(document.table))
    if out:
        with elapsed("drawing"), messages_in(shown):
            draw(machine, scene, out, places, shown)
        console.print(f"\n{out} written", highlight=False)


@app.command(name="structure")
def structure_command(scene: SceneName, units: Units = "", set_: Set = None) -> None:
    """Show the structural analysis of a scene.

    Mobility, Assur groups, structural formula, and the assembly modes of groups of higher class.
    """
    shown = numbers_in(units)
    with messages_in(shown):
        mechanism = load(scene, changes_of(scene, set_)).mechanism
    print_structure(structure(mechanism))
    print_assemblies(assembly_modes(mechanism), shown)
    if missing := open_at_start(mechanism):
        console.print(f"WARNING: {retold(missing, shown)}", style="bold", highlight=False, markup=False)


@app.command(name="analyze", hidden=True)
@app.command(name="analyse")
def analyse_command(
    scene: SceneName,
    out: Out = None,
    json_file: JsonFile = None,
    csv_folder: CsvFolder = None,
    angles: Annotated[int, typer.Option(min=2, help="Number of uniform crank angles over the cycle.")] = 360,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ANGLE",
            help="Also print all results at this crank angle: degrees, or with a unit, e.g. 1.2rad. May be repeated.",
        ),
    ] = None,
    acceleration: Annotated[
        str | None,
        typer.Option(
            metavar="VALUE", help='With --at: angular acceleration of the crank at nominal speed, e.g. "10 rad/s^2".'
        ),
    ] = None,
    constant_speed: Annotated[
        bool, typer.Option("--constant-speed", help="Constant nominal crank speed; the actual motion is not computed.")
    ] = False,
    method: Annotated[Method, typer.Option(help="How the actual motion is computed.")] = Method.quadrature,
    measure: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Also give this measure, e.g. stroke.D or x.D@60deg. May be repeated."),
    ] = None,
    harmonics: Annotated[
        int,
        typer.Option(min=0, max=1000, help="Harmonics of torque and speed up to this order; 12 with a motor."),
    ] = 0,
    nodes: Nodes = NODES,
    units: Units = "",
    set_: Set = None,
    quiet: Quiet = False,
) -> None:
    """Analyse a working cycle: kinematics, motion, forces, flywheel."""
    console.quiet = quiet
    changes = changes_of(scene, set_)
    if load_document(scene).rolling:
        refuse(scene, {"--at": bool(at), "--acceleration": acceleration is not None, "--nodes": nodes != NODES,
                       "--constant-speed": constant_speed, "--method": method is not Method.quadrature,
                       "--measure": bool(measure), "--harmonics": bool(harmonics)})  # fmt: skip
        bodies, units = load_rolling(scene, changes), units_for(scene, changes, units)
        check_places(out, csv_folder, json_file)
        with messages_in(shown := numbers_in(units)):
            analyse_rolling(bodies, scene, shown, units, angles, out=out, json_file=json_file, csv_folder=csv_folder)
        return
    with messages_in(numbers_in(units)):
        machine = load(scene, changes)
    units = units_for(scene, changes, units)
    shown = numbers_in(units)
    extra, given = [angle_of(each) for each in at or ()], acceleration_of(acceleration, bool(at))
    check_places(out, csv_folder, json_file)
    check_measures(measure or (), machine, scene)
    uniform = [i * (machine.cycle / angles) for i in range(angles)]
    with elapsed("analysing"), messages_in(shown):
        whole = analyse(machine, angles=as_float(uniform + extra), nodes=nodes, constant_speed=constant_speed or None,
                        method=method.value, throw=not (json_file or csv_folder))  # fmt: skip
        cycle = pick(whole, slice(0, angles))
        data = document(cycle, scene, __version__)
        if measure:
            data["measures"] = asked_measures(cycle, measure, nodes)
        if harmonics and data["result"]["code"] != Result.CANNOT_BE_ASSEMBLED:
            data["harmonics"] = harmonics_document(asked_harmonics(cycle, harmonics, nodes))
    if json_file:
        write_text(json_file, json.dumps(plain(data), allow_nan=False))
    if csv_folder:
        write_csv(data, csv_folder)
    with messages_in(shown):
        explain(cycle)
    print_summary(data, machine, shown)
    for i in range(angles, angles + len(extra)):
        here = pick(whole, slice(i, i + 1))
        here = here if given is None else at_acceleration(here, given)
        print_at(document(here, scene, __version__), machine, shown, given is not None)
    if out:
        write_out(data, machine, out, units=units)
    if cycle.missing is not None and cycle.missing.fails:  # everything else has been printed and written
        title = f"Scene {machine.title!r}: " if machine.title else ""
        raise MachineError(retold(f"{title}{cycle.missing.reason}", shown), Result.NO_PERIODIC_REGIME)
    if data["result"]["code"] == Result.LOCKED:
        title = f"Scene {machine.title!r}: " if machine.title else ""
        raise MachineError(retold(f"{title}{data['result']['message']}", shown), Result.LOCKED)


def check_measures(names: Sequence[str], machine: Scene, scene: str) -> None:
    """Raise `SceneError`, before anything is computed, for a name that is not a measure of this machine."""
    for name in names:
        try:
            named(name).check(machine)
        except StructureError as error:
            raise SceneError(scene, "--measure", name, error.problem, error.remedy) from error


def acceleration_of(text: str | None, at: bool) -> float | None:
    """An angular acceleration in rad/s², from a number or a string with a unit; None if there is none."""
    if text is None:
        return None
    option = "--acceleration"
    if not at:
        problem, remedy = "applies to single crank angles", "add a crank angle, e.g. --at 60"
        raise SceneError(option, "", text, problem, remedy)
    try:
        return quantity(f"{float(text):.17g} rad/s^2", "angular_acceleration")
    except QuantityError as error:
        raise SceneError(option, "", text, error.problem, error.remedy) from error
    except ValueError:
        pass
    try:
        return quantity(text, "angular_acceleration")
    except QuantityError as error:
        raise SceneError(option, "", text, error.problem, error.remedy) from error


def angle_of(text: str) -> float:
    """A crank angle in radians, from degrees or a string with a unit."""
    try:
        return quantity(f"{float(text):.17g} deg", "angle")
    except ValueError as error:
        if isinstance(error, QuantityError):  # a number, but not finite
            raise SceneError("--at", "", text, error.problem, "give degrees of crank angle, e.g. --at 90") from error
    try:
        return quantity(text, "angle")
    except QuantityError as error:
        more = "; for several angles repeat --at" if "," in text else ""
        raise SceneError("--at", "", text, error.problem, error.remedy + more) from error
