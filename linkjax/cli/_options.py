"""Arguments and options that several commands share."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from linkjax.scenes import SceneError

SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="A built-in scene or the path of a scene file.")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help='Change a key, e.g. --set links.rod.length="1.1 m".'),
]
Out = Annotated[Path | None, typer.Option(help="Folder for report, figures and animation.")]
JsonFile = Annotated[Path | None, typer.Option("--json", help="Write everything as JSON.")]
CsvFolder = Annotated[Path | None, typer.Option("--csv", help="Folder for tables over the crank angle.")]
Units = Annotated[str, typer.Option(metavar="UNITS", help="Units of all but JSON and CSV (SI), e.g. mm,rpm,kN.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")]
Nodes = Annotated[int, typer.Option(min=8, help="Nodes of the cycle grid per crank turn.")]


def changes_of(name: str, changes: list[str] | None) -> dict[str, str]:
    """The keys that `--set` changes."""
    found = {}
    for change in changes or ():
        key, equals, value = change.partition("=")
        if not equals:
            raise SceneError(name, key, None, "--set needs KEY=VALUE", 'write e.g. --set links.rod.length="1.1 m"')
        found[key.strip()] = value
    return found


def check_places(out: Path | None, csv: Path | None, json: Path | None) -> None:
    """Raise `OSError` where a folder cannot be made or written to, before anything is computed; makes none."""
    for folder in (out, csv, json and json.parent):
        if folder is None:
            continue
        there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
        if not there.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(there))
        with tempfile.TemporaryFile(dir=there):  # now, and not after a minute, is the time to say that it cannot be
            pass
    if json is not None and json.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(json))


def write_text(path: Path, text: str) -> None:
    """Write a file, and make the folder that it is in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
