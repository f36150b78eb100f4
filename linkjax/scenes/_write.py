"""A scene written as a scene file that gives the same scene when it is read, to the last bit."""

from __future__ import annotations

import re
from typing import Any

from linkjax._vec import Vec
from linkjax.groups import AbstractGroup
from linkjax.machine import Scene
from linkjax.mechanism import Counterweight, Link, StructureError
from linkjax.scenes._build import build
from linkjax.scenes._document import Document
from linkjax.scenes._errors import SceneError
from linkjax.scenes._fields import amount, number_of
from linkjax.scenes._friction import friction_keys
from linkjax.scenes._groups import TABLES
from linkjax.scenes._in_units import in_units, units_in
from linkjax.scenes._joints import drawn_keys, is_drawn, pins_of
from linkjax.scenes._loads import load_keys
from linkjax.scenes._motors import motor_keys

Table = dict[str, Any]


def text_of(scene: Scene, comment: str = "", like: Document | None = None) -> str:
    """The scene file of a scene as a string, below a comment: in SI units, or in those of another file, `like`, without
    zeros and names that are the defaults and that the other file does not give either.

    `loads_text` reads it as the same scene, to the last bit. Raises `StructureError` for groups and loads of kinds that
    scene files do not support, and for scenes that are traced or batched.
    """
    import tomli_w  # imported only when a file is written

    head = "".join(f"# {line}".rstrip() + "\n" for line in comment.splitlines())
    table = table_of(scene)
    if like is not None:
        table = in_units(_slim(table, like.table), units_in(like.table))
    return head + tomli_w.dumps(table, multiline_strings=False)


def table_of(scene: Scene) -> Table:
    """The table that `read_document` gives for the scene's file."""
    mechanism = scene.mechanism
    table: Table = {"title": scene.title} if scene.title else {}
    table["gravity"] = _pair(scene.gravity, "m/s^2")
    table["speed"] = amount(scene.speed, "rad/s")
    if scene.mean != "time":
        table["mean"] = scene.mean
    if scene.constant_speed:
        table["constant_speed"] = True
    if scene.cycle_turns != 1:
        table["cycle_turns"] = scene.cycle_turns
    drive = mechanism.driver.as_drive()
    if drive is not None and drive.rotation == "cw":
        table["rotation"] = "cw"
    if scene.target_delta is not None:
        table["target_delta"] = number_of(scene.target_delta)
    table["fixed"] = {name: _pair(at, "m") for name, at in mechanism.fixed.items()}
    table["links"] = {name: _link(mechanism.links[name]) for name in mechanism.link_names}
    table["flywheel"] = {"inertia": amount(mechanism.flywheel.inertia, "kg m^2")}
    if scene.motor is not None:
        table["motor"] = motor_keys(scene.motor)
    if scene.friction:
        table["joints"] = friction_keys(scene.friction)
    if is_drawn(mechanism):
        for name, pins in pins_of(mechanism).items():
            table["links"][name] = {"pins": pins, **table["links"][name]}
        table |= drawn_keys(mechanism)
        if any(group.numerical() for group in mechanism.groups) and not _fits(table):
            table |= drawn_keys(mechanism, as_sketched=False)
    else:
        table["groups"] = [_group(group) for group in mechanism.groups]
    if scene.loads:
        useful = {name: {"useful": True} for name in scene.useful}
        table["loads"] = [{**load_keys(load), **useful.get(load.name, {})} for load in scene.loads]
    return table


def _slim(table: Table, other: Any) -> Table:
    """The table without defaults that another one does not give, if it still gives the same scene."""
    short = _given(table, other)
    try:
        return short if table_of(build(Document("", short))) == table else table
    except SceneError:
        return table


def _given(table: Table, other: Any) -> Table:
    found: Table = {}
    for key, value in table.items():
        beside = other.get(key) if isinstance(other, dict) else None
        if isinstance(value, dict) and value.keys() == {"along", "across"}:
            value = _given_place(value, beside)
        elif isinstance(value, dict):
            value = _given(value, beside)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            rows = beside if isinstance(beside, list) else []
            value = [_given(row, rows[i] if i < len(rows) else None) for i, row in enumerate(value)]
        if beside is not None or not (value == {} or _is_default(key, value)):
            found[key] = value
    return found


def _given_place(place: Table, other: Any) -> Table:
    """Only along the link where it is not across it either; nothing for its origin."""
    if not _is_default("across", place["across"]) or (isinstance(other, dict) and "across" in other):
        return place
    return {} if other is None and _is_default("along", place["along"]) else {"along": place["along"]}


def _is_default(key: str, value: Any) -> bool:
    """Whether a value may be a default: zero, or the name of a mass centre."""
    if isinstance(value, list):
        return bool(value) and all(_is_default(key, each) for each in value)
    zero = isinstance(value, str) and value.split(" ")[0] in ("0.0", "-0.0", "0")
    return zero or (key == "centre_name" and re.fullmatch(r"S\d+", value) is not None)


def _fits(table: Table) -> bool:
    """Whether the sketch of groups of higher class agrees with the present dimensions."""
    try:
        build(Document("", table))
    except SceneError:
        return False
    return True


def _pair(at: Vec, unit: str) -> list[str]:
    return [amount(at.x, unit), amount(at.y, unit)]


def _place(at: Vec) -> Table:
    return {"along": amount(at.x, "m"), "across": amount(at.y, "m")}


def _link(link: Link) -> Table:
    table: Table = {}
    if number_of(link.length):
        table["length"] = amount(link.length, "m")
    if link.mass_properties != "section":
        table["mass"] = amount(link.mass, "kg")
        if link.uniform is not False and number_of(link.mass) > 0:
            table["uniform"] = link.uniform if link.uniform is True else list(link.uniform)
        else:
            table |= {"inertia": amount(link.inertia, "kg m^2"), "centre": _place(link.centre)}
    table["centre_name"] = link.centre_name
    if link.mass_properties != "fixed":
        table["mass_properties"] = link.mass_properties
    for key, unit in (("reference_length", "m"), ("area", "m^2"), ("density", "kg/m^3")):
        if getattr(link, key) is not None:
            table[key] = amount(getattr(link, key), unit)
    if link.points:
        table["points"] = {name: _place(at) for name, at in link.points.items()}
    if link.counterweights:
        table["counterweights"] = {name: _counterweight(piece) for name, piece in link.counterweights.items()}
    return table


def _counterweight(piece: Counterweight) -> Table:
    table: Table = {"mass": amount(piece.mass, "kg"), "at": _place(piece.at)}
    for key, unit in (("inertia", "kg m^2"), ("thickness", "m"), ("density", "kg/m^3")):
        if getattr(piece, key) is not None:
            table[key] = amount(getattr(piece, key), unit)
    return {**table, "ideal": True} if piece.ideal else table


def _group(group: AbstractGroup) -> Table:
    if group.kind not in TABLES:
        raise StructureError("-".join(group.link_names()), f"scene files do not support groups of kind {group.kind!r}",
                             f"known here: {', '.join(TABLES)}")  # fmt: skip
    return {"kind": group.kind, **TABLES[group.kind].keys_of(group)}
