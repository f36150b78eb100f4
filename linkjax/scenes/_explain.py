"""Errors of pydantic and of the mechanism, as one clear `SceneError`."""

from __future__ import annotations

import re
import typing
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from linkjax._renamed import renamed
from linkjax._units import kind_of, nearest
from linkjax.mechanism import StructureError
from linkjax.scenes._absent import absent, meant, misshapen
from linkjax.scenes._errors import SceneError, shown
from linkjax.scenes._keys import Path, annotation_at, examples, fields, is_rolling, is_table, join, lookup, settle
from linkjax.scenes._loads import TABLES as LOAD_TABLES
from linkjax.scenes._models import SceneFile
from linkjax.scenes._motors import KINDS as MOTOR_KINDS

File = TypeVar("File", bound=BaseModel)
CHOICES = ("kind", "side", "branch")  # keys that hold no names
DRAWN = {"drive": "[drive]", "slots": "[[slots]]", "gears": "[[gears]]", "racks": "[[racks]]",
         "links": "the [links.…] table of this link", "loads": "[[loads]]", "flywheel": "[flywheel]"}  # fmt: skip
ADD = {
    "fixed": "add a table [fixed] with the points of the frame, e.g. A = [0, 0]",
    "links": 'add a table for each link, e.g. [links.crank] with length = "300 mm"',
}


def fault(source: str, table: Any, path: Path, problem: str, remedy: str) -> SceneError:
    """The error about the value at `path` of the raw document."""
    return SceneError(source, join(path), lookup(table, path) if path else None, problem, remedy)


def from_validation(error: ValidationError, source: str, table: Any) -> SceneError:
    """The first error of pydantic, but unknown keys first: a misspelt key also causes an error about a missing one."""
    found = error.errors(include_url=False)
    first = min(found, key=lambda item: item["type"] != "extra_forbidden")
    path = tuple(part for part in first["loc"] if not (isinstance(part, str) and part.startswith("#")))
    if path and path[-1] == "[key]":
        path = path[:-1]
    kind, given, context = first["type"], first["input"], first.get("ctx", {})
    if kind == "union_tag_not_found" and isinstance(given, dict):
        path, kind = (*path, "kind"), "string_type" if "kind" in given else "missing"
        given = given.get("kind")
    problem, remedy = _say(kind, path, given, context, table, first["msg"])
    if kind == "union_tag_invalid":
        path = (*path, "kind")
    return fault(source, table, path, problem, remedy)


def _say(kind: str, path: Path, given: Any, context: dict[str, Any], table: Any, message: str) -> tuple[str, str]:
    """Problem and remedy."""
    what, last = kind_of(given), str(path[-1]) if path else ""
    shape = "" if is_rolling(table) or not path else misshapen(path, given)
    if kind == "scene":
        return context["problem"], shape or context["remedy"] + _other_law(path, context["problem"])
    if kind == "extra_forbidden":
        return "not a known key", unknown(table, path)
    if kind == "missing":
        return "missing", _addition(table, path)
    if kind == "union_tag_invalid":
        what = _what(path)
        problem = f"not a known kind of {what}"
        if lacking := absent((*path, str(given["kind"]))) if what != "motor" else "":
            return problem, lacking
        kinds = re.findall(r"'#(\w+)'", context["expected_tags"])  # with a hyphen: a further table of a kind
        return problem, _choice(str(given["kind"]), kinds)
    if kind == "literal_error":
        return "not one of the choices", _choice(str(given), re.findall(r"'([^']*)'", context["expected"]))
    if kind == "string_type":
        return f"{what} where a string is needed", shape or f"write it in double quotes, e.g. {_example(table, path)}"
    if kind == "bool_type":
        return f"{what} where true or false is needed", "write true or false, without quotes"
    if shape:
        return f"{what} where a table is needed", shape
    if kind in ("dict_type", "model_type", "union_tag_not_found"):
        name = join(tuple(part for part in path if isinstance(part, str)))
        if path and path[0] in ("groups", "loads", "slots", "drive") and len(path) > 1 and isinstance(path[-1], str):
            return f"{what} where a table is needed", f"write it in braces, {last} = {_inner(table, path)}"
        brackets = f"[[{name}]]" if path[:1] in (("groups",), ("loads",), ("slots",)) else f"[{name}]"
        return f"{what} where a table is needed", f"write {brackets} with its keys below it"
    if kind == "list_type" and path[0] == "optimise" and last != "cases":
        return f"{what} where a list is needed", f"write it in square brackets, {last} = [...]"
    if kind == "list_type" and len(path) > 1:
        return f"{what} where a list is needed", f"write it in square brackets, {last} = [...]"
    if kind == "list_type":
        last = join(path)
        return f"{what} where a list of tables is needed", f"write [[{last}]], in double brackets, once for each"
    return message[:1].lower() + message[1:], "see docs/scenes.md for the values of this key"


def unknown(table: Any, path: Path) -> str:
    """The remedy for an unknown key: the correct spelling or name, the message about a missing feature, or the table to
    which the key belongs."""
    keys, last = known_keys(table, path[:-1]), str(path[-1])
    misspelt = nearest(last, keys)
    if renamed(last, keys):
        return misspelt
    if same := meant(last, keys):
        example = examples(annotation_at(table, path[:-1])).get(same)
        return f"did you mean {same!r}?" + ("" if example is None else f" Write e.g. {same} = {shown(example)}")
    lacking = "" if is_rolling(table) or path[0] == "optimise" else _of_kind(table, path) or absent(path)
    if lacking or misspelt.startswith("did you mean"):
        return lacking or misspelt
    elsewhere = meant(last, [key for key in fields(SceneFile) if key not in ("loads", "links")])
    return _home(table, path) or (_home(table, (*path[:-1], elsewhere)) if elsewhere else "") or misspelt


def _of_kind(table: Any, path: Path) -> str:
    """The kinds of loads or motors that have a key, which this one does not have."""
    key = str(path[-1])
    if path[:-1] == ("motor",):
        own, every = lookup(table, ("motor", "kind")), dict.fromkeys(MOTOR_KINDS.values())
        others = [kind for kind in every if kind != own]
        kinds = [kind for kind in others if key in known_keys({"motor": {"kind": kind, key: None}}, path[:-1])]
        write = f"write kind = {shown(kinds[0])}" if kinds else ""
        remedy = f"{write}, or all keys of this kind at once, motor = {{ kind = {shown(own)}, ... }}"
    elif path[0] == "loads" and len(path) == 3:
        kinds = [kind for kind, model in LOAD_TABLES.values() if kind and key in fields(model)]
        remedy = f"write kind = {shown(kinds[0])}" if kinds else ""
    else:
        return ""
    return f"only a {_what(path)} of the kind {' or '.join(map(shown, kinds))} has this key: {remedy}" if kinds else ""


def _what(path: Path) -> str:
    return {"motor": "motor", "loads": "load"}.get(str(path[0]), "group")


def _home(table: Any, path: Path) -> str:
    """The table to which a misplaced key belongs: a table inside its own, or another one of the scene."""
    key, inside = str(path[-1]), annotation_at(table, path[:-1])
    own = (
        {} if not is_table(inside) else {name: settle(annotation, None) for name, annotation in fields(inside).items()}
    )
    for name, model in own.items():
        if is_table(model) and key in fields(model):
            return f"write it inside of {name}, {name} = {{ {key} = {shown(examples(model).get(key, 'A'))} }}"
    scene = fields(SceneFile)
    if len(path) > 1 and key in scene and not is_rolling(table):
        return f"write {key} at the top of the file, above the first table in brackets"
    for name in DRAWN if "drive" in table else ():
        model = settle(scene[name], None)
        model = settle(typing.get_args(model)[-1], None) if typing.get_args(model) else model
        if is_table(model) and key in fields(model):
            return f"write it under {DRAWN[name]}"
    return ""


def _other_law(path: Path, problem: str) -> str:
    """The other remedy where the law of a drive has lengths, or its stroke has angles."""
    if path[:2] == ("drive", "law") and problem.startswith("a length"):
        return ', or, for a slider, stroke = { start = "0 mm", stop = "120 mm" }'
    if path[:2] == ("drive", "stroke") and problem.startswith("an angle"):
        return ', or, for a link that rotates, law = { start = "20 deg", stop = "140 deg" }'
    return ""


def _choice(given: str, choices: list[str]) -> str:
    if new := renamed(given, choices):
        return f"it is called {shown(new)} now"
    alike = [choice for choice in choices if choice.lower() == given.strip().lower()]
    listed = " or ".join(shown(choice) for choice in choices)
    return f"did you mean {shown(alike[0])}?" if alike else f"write {listed}"


def known_keys(table: Any, path: Path) -> list[str]:
    """The keys of the format in the table at `path`."""
    model = annotation_at(table, path)
    return list(fields(model)) if is_table(model) else []


def _example(table: Any, path: Path) -> str:
    model = annotation_at(table, path[:-1])
    fallback = "crank" if path[-1] == "kind" else "A"
    return shown(examples(model).get(str(path[-1]), fallback) if is_table(model) else fallback)


def _inner(table: Any, path: Path) -> str:
    """A table with an example of its first required key."""
    example = {"law": '{ start = "20 deg", stop = "140 deg" }', "stroke": '{ start = "0 mm", stop = "120 mm" }'}
    return example.get(str(path[-1]), '{ through = "A" }')


def _addition(table: Any, path: Path) -> str:
    if len(path) == 1 and path[0] in ADD:
        return ADD[str(path[0])]
    if path == ("motor", "kind"):
        return 'add kind = "torque", "line", "table", "dc", "induction", "servo", "none" or "balance"'
    if path[-1] == "kind":
        return 'add kind = "crank", "linear_driver", "RRR", "RRP", "RPR", "PRP", "RPP", "gear", "rack" or "pinion"'
    return f"add {path[-1]} = {_example(table, path)}"


def from_structure(error: StructureError, source: str, table: Any) -> SceneError:
    """A `StructureError` at the key that holds the name it quotes, or at its element."""
    path = _element(error.element, table)
    quoted = re.findall(r"'([^']*)'", error.problem)[:1]
    element = lookup(table, path)
    if (
        isinstance(element, dict) and "already" in error.problem
    ):  # the new name is after the names to which it is attached
        element = dict(reversed(element.items()))
    if isinstance(element, dict):  # a link may have the name of a choice, e.g. "left"
        element = dict(sorted(element.items(), key=lambda item: item[0] in CHOICES))
    inner = _holder(element, quoted[0]) if quoted else None
    if own := re.match(r"with this (phase|start|side)\b", error.problem):
        inner = own.groups()
    return fault(source, table, (*path, *(inner or ())), error.problem, error.remedy)


def _element(element: str, table: Any) -> Path:
    """Path of an `element` of a `StructureError`, e.g. "groups[1]", "links.rod" or "slot of slider"."""
    if element.startswith("slot of "):
        block = element.removeprefix("slot of ")
        return ("slots", next(i for i, slot in enumerate(table["slots"]) if slot["block"] == block))
    if element.startswith(("gear of ", "rack ")):
        name = element.split(" ")[-1]
        keys = ("racks", "gears") if element.startswith("rack ") else ("gears", "racks")
        every = [(key, i, entry) for key in keys for i, entry in enumerate(table.get(key, []))]
        return next((key, i) for end in ("link", "to") for key, i, entry in every if entry[end] == name)
    if element == "drive.law" and "stroke" in table["drive"]:
        return ("drive", "stroke")
    steps = re.findall(r"[\w-]+", element.split(" ")[0])
    return tuple(int(step) if step.isdigit() and n == 1 and steps[0] in ("groups", "loads") else step
                 for n, step in enumerate(steps))  # fmt: skip


def _holder(value: Any, name: str, path: Path = ()) -> Path | None:
    """Path inside `value` to the string `name`; a list of names counts as one place."""
    if value == name or (isinstance(value, list) and name in value):
        return path
    items = value.items() if isinstance(value, dict) else ()
    return next((found for key, item in items if (found := _holder(item, name, (*path, key))) is not None), None)


def explained(model: type[File], source: str, table: Any) -> File:
    """The raw document as a validated model; raises `SceneError` for the first error."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        raise from_validation(error, source, table) from error
