"""From a raw document to the scene: validate, check, build."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from linkjax._vec import Vec
from linkjax.design import Case
from linkjax.machine import Scene
from linkjax.mechanism import OF_LENGTH, Counterweight, Flywheel, Link, Mechanism, StructureError, linkage
from linkjax.scenes import _models as file
from linkjax.scenes._asked import check_asked
from linkjax.scenes._check import check
from linkjax.scenes._document import (
    STARTER,
    Document,
    load_document,
    overridden,
    override,
    read_document,
    scene_text,
    titled,
)
from linkjax.scenes._errors import SceneError
from linkjax.scenes._explain import explained
from linkjax.scenes._friction import frictions
from linkjax.scenes._keys import join, split
from linkjax.scenes._located import located, part
from linkjax.scenes._optimise import Optimise

Made = TypeVar("Made")


def load(name_or_path: str | os.PathLike[str], changes: Mapping[str, Any] | None = None) -> Scene:
    """Load a built-in scene by name ("hay-press") or a scene file; single keys may be changed before validation.

    `changes` maps paths of keys to values, e.g. `{"links.rod.length": "1.1 m"}`; see `override`. Raises `SceneError`,
    with file, key, value and remedy, when the file is missing or anything in it is wrong.
    """
    return build(overridden(load_document(name_or_path), changes))


def load_problem(
    name_or_path: str | os.PathLike[str], changes: Mapping[str, Any] | None = None
) -> tuple[Scene, dict[str, Any]]:
    """Load a built-in scene or a scene file, and the problem in its section `[optimise]`: `optimise(scene, **problem)`.

    Keys of `[optimise]` in `changes` are changed first, then the keys under `[optimise.changes]`, then the others in
    `changes`. Raises `SceneError` as `load` does, also for names in `[optimise]` that the scene does not have.
    """
    return build_problem(load_document(name_or_path), changes)


def build_problem(document: Document, changes: Mapping[str, Any] | None = None) -> tuple[Scene, dict[str, Any]]:
    """The scene of a raw document with its changes for the optimisation, and the arguments of `optimise`; see
    `load_problem`."""
    _linkage(document)
    given = dict(changes or {})
    own = {key: given.pop(key) for key in list(given) if split(key)[:1] == ("optimise",)}
    document = overridden(document, own)
    with located(document.source, document.table):
        asked = explained(file.SceneFile, document.source, document.table).optimise or Optimise()
    document = overridden(_as_optimised(document, asked.changes), given)
    arguments: dict[str, Any] = {
        "minimise": asked.minimise, "maximise": asked.maximise, "free": asked.free, "limits": asked.limits,
        "starts": asked.starts, "seed": asked.seed, "solver": asked.solver,
        "cases": [Case(case.name, case.changes) for case in asked.cases] or [Case()],
        "trade_off": None if asked.trade_off is None else (asked.trade_off.limit, asked.trade_off.bounds),
    }  # fmt: skip
    scene = build(document)
    with located(document.source, document.table):
        check_asked(document.source, document.table, scene, asked)
    return scene, arguments


def _as_optimised(document: Document, changes: Mapping[str, Any]) -> Document:
    """The document with the keys under `[optimise.changes]` replaced."""
    for key, value in changes.items():
        path = join(("optimise", "changes", key))
        if split(key)[:1] == ("optimise",):
            problem = "[optimise.changes] may only change the machine"
            raise SceneError(document.source, path, value, problem, "edit [optimise] directly")
        try:
            document = override(document, key, value)
        except SceneError as error:
            raise SceneError(document.source, path, value, error.problem, error.remedy) from error
    return document


def loads_text(text: str, source: str = "<text>") -> Scene:
    """The scene in a TOML string; `source` is its name in messages. Raises `SceneError` if anything is wrong."""
    return build(read_document(text, source))


def build(document: Document) -> Scene:
    """The scene of a raw document. Raises `SceneError` for the first error in it."""
    _linkage(document)
    source, table = document.source, document.table
    with located(source, table):
        model = explained(file.SceneFile, source, table)
        check(model, source, table)
        mechanism = _mechanism(model)
        return Scene(
            mechanism,
            tuple(_each(lambda load: load.build(model.cycle_turns), model.loads, "loads")),
            Vec(*model.gravity) if isinstance(model.gravity, tuple) else Vec(0.0, -model.gravity),
            model.speed,
            model.target_delta,
            mean=model.mean,
            cycle_turns=model.cycle_turns,
            title=model.title,
            constant_speed=model.constant_speed,
            motor=None if model.motor is None else model.motor.build(),
            friction=frictions(model.friction, model.joints, mechanism),
            useful=tuple(load.name for load in model.loads if load.useful),
        )


def _each(make: Callable[[Any], Made], items: Iterable[Any], key: str) -> list[Made]:
    """What is made of each entry of a list of tables."""
    made = []
    for number, item in enumerate(items):
        with part(key, number):
            made.append(make(item))
    return made


def _mechanism(model: file.SceneFile) -> Mechanism:
    fixed = {name: Vec(*at) for name, at in model.fixed.items()}
    links, sides = {}, {}
    for name, link in model.links.items():
        with part("links", name):
            links[name] = _link(link)
            sides |= {name: _sides(name, link)} if link.sides else {}
    rotation, flywheel = model.rotation, Flywheel(model.flywheel.inertia * model.flywheel.ratio**2)
    if model.drive is None:
        return Mechanism(fixed, links, _each(lambda group: group.build(rotation), model.groups, "groups"), flywheel)
    with part("drive"):
        drive = model.drive.build(rotation)
    slots, gears, racks = (
        _each(lambda item: item.build(), items, key)
        for key, items in (("slots", model.slots), ("gears", model.gears), ("racks", model.racks))
    )
    return linkage(fixed, links, drive, slots, model.sketch, flywheel, gears, racks, sides, model.branch)


def _sides(name: str, link: file.Link) -> dict[tuple[str, str], float]:
    """The distances between pins of a link; the names of pins may contain hyphens."""
    found = {}
    for key, length in link.sides.items():
        ends = ((key[:i], key[i + 1 :]) for i, letter in enumerate(key) if letter == "-")
        pair = next((pair for pair in ends if set(pair) <= set(link.pins)), None)
        if pair is None:
            problem = f"{key!r} does not name two pins of the link"
            remedy = f'its pins are {", ".join(link.pins)}: write e.g. {"-".join(link.pins[:2])} = "250 mm"'
            raise StructureError(f"links.{name}.sides", problem, remedy)
        found[pair] = length
    return found


def _linkage(document: Document) -> None:
    """Raise `SceneError` for a scene that is not a linkage."""
    if document.rolling:
        remedy = "load it with load_rolling, or run linkjax analyse; docs/rolling.md describes the design"
        raise SceneError(document.source, "kind", "rolling", "rolling bodies, where a linkage is needed", remedy)


def starter(name: str) -> str:
    """A commented starter scene, titled `name`, as a string: what `linkjax new NAME` writes."""
    return STARTER.read_text(encoding="utf-8").replace("NAME", titled(name))


def starter_like(name: str, scene: str) -> str:
    """The file of a built-in machine, or of a path, titled `name`, as a string: what `linkjax new NAME --like SCENE`
    writes. Raises `SceneError` where it cannot be read."""
    source, text = scene_text(scene)
    read_document(text, source)
    line = f'title = "{titled(name)}"'
    table = re.search(r"^\[", text, re.MULTILINE)
    end = table.start() if table else len(text)
    found, count = re.subn(r"^title\s*=.*$", lambda _: line, text[:end], count=1, flags=re.MULTILINE)
    head = f"# From {source}. All keys: docs/scenes.md, and docs/rolling.md for rolling bodies.\n#\n"
    return head + (found if count else f"{line}\n{found}") + text[end:]


def json_schema() -> dict[str, Any]:
    """JSON Schema of a scene file: keys, types, defaults, descriptions and examples (no checks across keys)."""
    return file.SceneFile.model_json_schema(by_alias=True)


def _link(link: file.Link) -> Link:
    reference = link.length if link.reference_length is None else link.reference_length
    return Link(
        length=link.length,
        mass=link.mass,
        inertia=link.inertia,
        centre=_place(link.centre),
        points={name: _place(at) for name, at in link.points.items()},
        counterweights={name: _counterweight(piece) for name, piece in link.counterweights.items()},
        reference_length=reference if link.mass_properties in OF_LENGTH else None,
        area=link.area,
        density=link.density,
        mass_properties=link.mass_properties,
        centre_name=link.centre_name,
        pins=tuple(link.pins),
        uniform=link.uniform if isinstance(link.uniform, bool) else tuple(link.uniform),
    )


def _counterweight(piece: file.Counterweight) -> Counterweight:
    return Counterweight(piece.mass, _place(piece.at), piece.inertia, piece.thickness, piece.density, ideal=piece.ideal)


def _place(place: float | file.Polar | file.Cartesian) -> Vec:
    if isinstance(place, file.Polar):
        return Vec(place.at * math.cos(place.turned), place.at * math.sin(place.turned))
    if isinstance(place, file.Cartesian):
        return Vec(place.along, place.across)
    return Vec(place, 0.0)
