"""The commands `export` and `import`: machines for and from other programs."""

from __future__ import annotations

import json
import shlex
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from linkjax.cli._app import angle_of, app
from linkjax.cli._console import console
from linkjax.cli._options import SceneName, Set, changes_of
from linkjax.exchange import read_pylinkage, to_mjcf, to_pylinkage
from linkjax.machine import Scene
from linkjax.mechanism import StructureError
from linkjax.scenes import SceneError, load, loads_text, text_of


class Format(StrEnum):
    """Formats of other programs."""

    mjcf = "mjcf"
    pylinkage = "pylinkage"


@app.command(name="export")
def export_command(
    scene: SceneName,
    to: Annotated[Format, typer.Option("--format", help="A MuJoCo model (MJCF), or pylinkage's JSON.")] = Format.mjcf,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File to write; by default the export is printed.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(metavar="ANGLE", help="Crank angle of the MuJoCo model: degrees, or with a unit, e.g. 1.2rad."),
    ] = None,
    set_: Set = None,
) -> None:
    """Export a machine to MuJoCo or pylinkage.

    The MuJoCo model (MJCF) has links, masses, joints and drive; pylinkage's JSON has the mechanism alone.
    """
    if at is not None and to is Format.pylinkage:
        raise SceneError("--at", "", at, "pylinkage's mechanisms are at crank angle zero", "omit --at")
    machine, phi = load(scene, changes_of(scene, set_)), 0.0 if at is None else angle_of(at)
    try:
        if to is Format.mjcf:
            text = to_mjcf(machine, phi)
        else:
            text = json.dumps(to_pylinkage(machine.mechanism, name=machine.title), indent=2, ensure_ascii=False) + "\n"
    except StructureError as error:
        raise SceneError(scene, error.element, None, error.problem, error.remedy) from error
    if out is None:
        typer.echo(text, nl=False)
        return
    out.write_text(text, encoding="utf-8")
    console.print(f"{out} written", highlight=False)


@app.command(name="import")
def import_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="JSON file of a pylinkage mechanism.")],
    out: Annotated[
        Path | None, typer.Option(metavar="SCENE", help="Scene file to write; by default FILE with the suffix .toml.")
    ] = None,
) -> None:
    """Import pylinkage's JSON as a scene file.

    Lengths are in metres. Masses are missing, since pylinkage has none. Names that are not allowed in a scene file are
    changed and listed.
    """
    if file.suffix == ".toml" and file.exists():
        raise SceneError(str(file), "", None, "is a scene file, not pylinkage's JSON", "give the JSON file")
    path = out or file.with_suffix(".toml")
    if path.exists():
        raise SceneError(str(path), "", None, "already exists", "choose another name with --out, or delete the file")
    try:
        read = read_pylinkage(file.read_bytes().decode("utf-8-sig"))
        scene = Scene(read.mechanism, speed=1.0)
        text = text_of(scene, f"Imported from {file.name}. Masses, speed, gravity and loads must be added.")
    except UnicodeDecodeError as error:
        problem = f"not encoded in UTF-8 (byte {error.start})"
        raise SceneError(str(file), "", None, problem, "save the file as UTF-8") from error
    except StructureError as error:
        raise SceneError(str(file), error.element, None, error.problem, error.remedy) from error
    loads_text(text, str(file))  # refuse what a scene file cannot hold, before anything is written
    path.write_text(text, encoding="utf-8")
    if renamed := [f"{old} -> {new}" for names in (read.points, read.links) for old, new in names.items()]:
        _say(f"renamed: {', '.join(renamed)}")
    for note in read.notes:
        _say(note)
    _say(f"{path} written; next: linkjax show {shlex.quote(str(path))}")


def _say(line: str) -> None:
    console.print(line, markup=False, highlight=False, soft_wrap=True)
