"""Arguments and options shared by several commands."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from linkjax._display import Numbers
from linkjax._units import QuantityError, display_units
from linkjax.scenes import SceneError

SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="Name of a built-in scene, or path of a scene file.")]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help='Change a key of the scene, e.g. --set links.rod.length="1.1 m". May be repeated.',
    ),
]
Out = Annotated[Path | None, typer.Option(help="Folder for report, figures and animation.")]
JsonFile = Annotated[Path | None, typer.Option("--json", help="File for all results as JSON (SI units).")]
CsvFolder = Annotated[Path | None, typer.Option("--csv", help="Folder for CSV tables over the crank angle (SI units).")]
Units = Annotated[str, typer.Option(metavar="UNITS", help="Display units, e.g. mm,rpm,kN; JSON and CSV stay in SI.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print only errors.")]
Nodes = Annotated[int, typer.Option(min=8, help="Nodes of the cycle grid per crank turn.")]


def changes_of(name: str, changes: list[str] | None) -> dict[str, str]:
    """The keys that `--set` changes, with their values. Raises `SceneError` for an option that is not KEY=VALUE."""
    found = {}
    for change in changes or ():
        key, equals, value = change.partition("=")
        if not equals:
            raise SceneError(name, "--set", change, "is not KEY=VALUE", 'write e.g. --set links.rod.length="1.1 m"')
        found[key.strip()] = value
    return found


def numbers_in(units: str) -> Numbers:
    """How numbers are shown in the units of `--units`. Raises `SceneError` naming the option for an unknown unit."""
    try:
        return Numbers(display_units(units))
    except QuantityError as error:
        raise SceneError("--units", "", units, error.problem, error.remedy) from error


def check_places(out: Path | None, csv: Path | None, json: Path | None) -> None:
    """Raise `OSError`, before anything is computed, for a folder that cannot be created or written to. Creates none."""
    for folder in (out, csv, json and json.parent):
        if folder is None:
            continue
        there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
        if not there.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(there))
        with tempfile.TemporaryFile(dir=there):  # fail now and not after a minute of computation
            pass
    if json is not None and json.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(json))


def write_text(path: Path, text: str) -> None:
    """Write a file, and create its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
