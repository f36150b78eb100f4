"""From a raw document to the scene: validate, check, build."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from typing import Any

from linkjax._vec import Vec
from linkjax.design import Case, numbers
from linkjax.loads import AbstractLoad, Force, OpposingForce, OpposingTorque, Torque, Window
from linkjax.machine import Scene
from linkjax.measures import MEASURES
from linkjax.mechanism import Counterweight, Flywheel, Link, Mechanism, StructureError, linkage
from linkjax.scenes import _models as file
from linkjax.scenes._check import check
from linkjax.scenes._document import STARTER, Document, load_document, overridden, override, read_document
from linkjax.scenes._errors import SceneError
from linkjax.scenes._explain import explained, from_structure
from linkjax.scenes._keys import split
from linkjax.scenes._optimise import Optimise


def load(name_or_path: str | os.PathLike[str], changes: Mapping[str, Any] | None = None) -> Scene:
    """The scene of a built-in name ("hay-press") or of a file, with single keys changed before it is validated.

    `changes` maps paths of keys to values, e.g. `{"links.rod.length": "1.1 m"}`; see `override`. Raises `SceneError`,
    naming file, key, value and remedy, when the file is missing or anything in it is wrong.
    """
    return build(overridden(load_document(name_or_path), changes))


def load_problem(
    name_or_path: str | os.PathLike[str], changes: Mapping[str, Any] | None = None
) -> tuple[Scene, dict[str, Any]]:
    """The scene of a built-in name or file, and what its section `[optimise]` asks: `optimise(scene, **asked)`.

    Keys under `[optimise.changes]` are changed first, then `changes` (of `optimise` itself, before). Raises
    `SceneError` as `load` does.
    """
    return build_task(load_document(name_or_path), changes)


def build_task(document: Document, changes: Mapping[str, Any] | None = None) -> tuple[Scene, dict[str, Any]]:
    """The scene of a raw document as it is optimised, and the arguments of `optimise`; see `load_problem`."""
    _linkage(document)
    given = dict(changes or {})
    own = {key: given.pop(key) for key in list(given) if split(key)[:1] == ("optimise",)}
    for key, value in own.items():
        document = override(document, key, value)
    asked = explained(file.SceneFile, document.source, document.table).optimise or Optimise()
    for key, value in {**asked.changes, **given}.items():
        if split(key)[:1] == ("optimise",):
            path = f"optimise.changes.{key}"
            raise SceneError(document.source, path, value, "changes what is asked, not the machine", "write it itself")
        document = override(document, key, value)
    arguments: dict[str, Any] = {
        "minimise": asked.minimise, "maximise": asked.maximise, "free": asked.free, "limits": asked.limits,
        "starts": asked.starts, "seed": asked.seed, "solver": asked.solver,
        "cases": [Case(case.name, case.changes) for case in asked.cases] or [Case()],
        "trade_off": None if asked.trade_off is None else (asked.trade_off.limit, asked.trade_off.bounds),
    }  # fmt: skip
    scene = build(document)
    _no_plain_angles(document.source, scene, asked)
    return scene, arguments


def _no_plain_angles(source: str, scene: Scene, asked: Optimise) -> None:
    """Raise `SceneError` where an angle is a number without a unit, as everywhere in scene files."""
    angles = {name for name, at in numbers(scene).items() if at.unit == "rad"}
    ranges = {name: each["range"] if isinstance(each, dict) else each for name, each in asked.free.items()}
    found = [(f"optimise.free.{name}", value) for name, ends in ranges.items() if name in angles for value in ends]
    for i, case in enumerate(asked.cases):
        found += [(f"optimise.cases[{i}].changes.{name}", v) for name, v in case.changes.items() if name in angles]
    if asked.trade_off is not None:
        name = re.sub(" at (most|least)$", "", asked.trade_off.limit)
        if name in angles or (name in MEASURES and MEASURES[name].unit == "rad"):
            found += [("optimise.trade_off.bounds", value) for value in asked.trade_off.bounds]
    for key, value in found:
        if not isinstance(value, str) and value != 0:
            raise SceneError(source, key, value, "an angle without a unit", f'write "{value:.12g} deg"')


def loads_text(text: str, source: str = "<text>") -> Scene:
    """The scene written in a text in TOML; `source` names it in messages. Raises `SceneError` if anything is wrong."""
    return build(read_document(text, source))


def build(document: Document) -> Scene:
    """The scene of a raw document. Raises `SceneError` at the first thing wrong in it."""
    _linkage(document)
    source, table = document.source, document.table
    model = explained(file.SceneFile, source, table)
    check(model, source, table)
    try:
        return Scene(
            _mechanism(model),
            tuple(_load(item) for item in model.loads),
            Vec(*model.gravity) if isinstance(model.gravity, tuple) else Vec(0.0, -model.gravity),
            model.speed,
            model.target_delta,
            mean=model.mean,
            cycle_turns=model.cycle_turns,
            title=model.title,
            constant_speed=model.constant_speed,
        )
    except StructureError as error:
        raise from_structure(error, source, table) from error


def _mechanism(model: file.SceneFile) -> Mechanism:
    fixed = {name: Vec(*at) for name, at in model.fixed.items()}
    links = {name: _link(link) for name, link in model.links.items()}
    rotation, flywheel = model.rotation, Flywheel(model.flywheel.inertia)
    if model.drive is None:
        return Mechanism(fixed, links, [group.build(rotation) for group in model.groups], flywheel)
    slots = [slot.build() for slot in model.slots]
    gears, racks = [gear.build() for gear in model.gears], [rack.build() for rack in model.racks]
    sides = {name: _sides(name, link) for name, link in model.links.items() if link.sides}
    return linkage(
        fixed, links, model.drive.build(rotation), slots, model.sketch, flywheel, gears, racks, sides, model.branch
    )


def _sides(name: str, link: file.Link) -> dict[tuple[str, str], float]:
    """The distances between pins of a link, whose names may have hyphens themselves."""
    found = {}
    for key, length in link.sides.items():
        ends = ((key[:i], key[i + 1 :]) for i, letter in enumerate(key) if letter == "-")
        pair = next((pair for pair in ends if set(pair) <= set(link.pins)), None)
        if pair is None:
            problem = f"{key!r} names no two pins of the link"
            remedy = f'its pins are {", ".join(link.pins)}: write e.g. {"-".join(link.pins[:2])} = "250 mm"'
            raise StructureError(f"links.{name}.sides", problem, remedy)
        found[pair] = length
    return found


def _linkage(document: Document) -> None:
    """Raise `SceneError` for what is no linkage."""
    if document.rolling:
        remedy = "read it with load_rolling, or see it with linkjax analyse; docs/rolling.md tells how it is designed"
        raise SceneError(document.source, "kind", "rolling", "rolling bodies, where a linkage is needed", remedy)


def starter(name: str) -> str:
    """The text of a commented scene to begin with, titled `name`: what `linkjax new NAME` writes."""
    title = "".join(c for c in name if c.isprintable()).replace("\\", "\\\\").replace('"', '\\"')
    return STARTER.read_text(encoding="utf-8").replace("NAME", title or "New machine")


def json_schema() -> dict[str, Any]:
    """JSON Schema of a scene file: keys, types, defaults, descriptions and examples (not the checks across keys)."""
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
        reference_length=reference if link.mass_properties == "scaled" else None,
        area=link.area,
        density=link.density,
        mass_properties=link.mass_properties,
        centre_name=link.centre_name,
        pins=tuple(link.pins),
    )


def _counterweight(piece: file.Counterweight) -> Counterweight:
    return Counterweight(piece.mass, _place(piece.at), piece.inertia, piece.thickness, piece.density, ideal=piece.ideal)


def _place(place: float | file.Polar | file.Cartesian) -> Vec:
    if isinstance(place, file.Polar):
        return Vec(place.at * math.cos(place.turned), place.at * math.sin(place.turned))
    if isinstance(place, file.Cartesian):
        return Vec(place.along, place.across)
    return Vec(place, 0.0)


def _load(load: file.Load) -> AbstractLoad:
    window = None if load.window is None else Window(*load.window)
    always: dict[str, Any] = {"name": load.name, "link": load.link, "window": window, "reacts_on": load.reacts_on}
    if load.torque is not None:
        return (
            OpposingTorque(magnitude=load.torque, **always) if load.opposing else Torque(torque=load.torque, **always)
        )
    always["point"] = load.point
    if isinstance(load.force, tuple):
        return Force(force=Vec(*load.force), **always)
    return OpposingForce(magnitude=load.force, **always)
