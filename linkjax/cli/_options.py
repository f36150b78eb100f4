"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from linkjax.machine import Scene
from linkjax.scenes import Document, SceneError, build, load_document, override, setting

SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="A built-in scene or the path of a scene file.")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help='Change a key, e.g. --set links.rod.length="1.1 m".'),
]
Out = Annotated[Path | None, typer.Option(help="Folder for report, figures and animation.")]
JsonFile = Annotated[Path | None, typer.Option("--json", help="Write the whole analysis as JSON.")]
CsvFolder = Annotated[Path | None, typer.Option("--csv", help="Folder for tables over the crank angle.")]
Units = Annotated[str, typer.Option(metavar="UNITS", help="Units to show, e.g. mm,rpm,kN (files hold SI).")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")]
Nodes = Annotated[int, typer.Option(min=8, help="Nodes of the cycle grid per crank turn.")]


def document_of(name: str, changes: list[str] | None) -> Document:
    """The document of a scene with the keys that `--set` changes."""
    found = load_document(name)
    for change in changes or ():
        key, equals, value = change.partition("=")
        if not equals:
            raise SceneError(name, key, None, "--set needs KEY=VALUE", 'write e.g. --set links.rod.length="1.1 m"')
        found = override(found, key.strip(), setting(value))
    return found


def loaded(name: str, changes: list[str] | None) -> Scene:
    """The scene with the keys that `--set` changes."""
    return build(document_of(name, changes))


def make_folders(*folders: Path | None) -> None:
    """Make the folders that are written to, before anything is computed."""
    for folder in folders:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
