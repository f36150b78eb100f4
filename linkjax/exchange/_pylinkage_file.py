"""The contents of pylinkage's JSON, checked: a document of joints and links, from any version."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from linkjax.exchange._pylinkage_old import OLD, of_old
from linkjax.mechanism import StructureError

Drawn = Mapping[str, Any]
TEXTS = ("type", "name", "motor_joint", "ref_joint1_id", "ref_joint2_id")
NUMBERS = ("distance", "angle", "angular_velocity", "initial_angle", "arc_start", "arc_end")
PLACES = ("position", "axis", "line_point")
TYPES = {"joints": ("ground", "revolute", "prismatic", "tracker"), "links": ("ground", "driver", "arc_driver", "link")}
LARGEST = 1e20  # bound of numbers in a file, as in scene files
WRITE = "write it with pylinkage's mechanism_to_json"
BARE = "build a Mechanism of the topology and its Dimensions with pylinkage's to_mechanism, and write that"
OTHERS = {
    "nodes": ("is a topology without dimensions", BARE),
    "topologies": ("is a catalogue of topologies without dimensions", BARE),
    "instances": ("is a hierarchy of topologies without dimensions", BARE),
    "node_positions": ("holds dimensions without a topology", BARE),
}


def read(document: str | Mapping[str, Any]) -> Drawn:
    """The joints and links of a document, each of them checked: ids are different strings, numbers are finite.

    Old linkages (pylinkage 0.6 to 0.9) are converted to joints and links. Raises `StructureError` for anything else.
    """
    if isinstance(document, str):
        document = _parsed(document)
    if not isinstance(document, Mapping):
        raise StructureError("pylinkage", "has no lists of joints and links", WRITE)
    if isinstance(document.get("joints"), list) and not isinstance(document.get("links"), list):
        kinds = [joint.get("type") for joint in document["joints"] if isinstance(joint, Mapping)]
        if any(isinstance(kind, str) and kind in OLD for kind in kinds):
            document = of_old(document["joints"])
    if not all(isinstance(document.get(key), list) for key in ("joints", "links")):
        for key, (problem, remedy) in OTHERS.items():
            if key in document:
                raise StructureError("pylinkage", f"{problem} (key {key!r})", remedy)
        raise StructureError("pylinkage", "has no lists of joints and links", WRITE)
    for key in ("joints", "links"):
        _check_all(key, document[key])
    return document


def _parsed(text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise StructureError("pylinkage", f"is not valid JSON: {error.msg} in line {error.lineno}", WRITE) from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, thousands of brackets
        raise StructureError("pylinkage", f"is not JSON of a mechanism: {error}", WRITE) from error


def _check_all(key: str, elements: list[Any]) -> None:
    """Raise `StructureError` for the first joint or link that is not valid."""
    seen: set[str] = set()
    for number, each in enumerate(elements):
        if not isinstance(each, Mapping) or not isinstance(each.get("id"), str):
            raise StructureError(f"{key}[{number}]", "has no id", WRITE)
        if any("\ud800" <= character <= "\udfff" for character in each["id"]):
            raise StructureError(f"{key}[{number}]", "its id is not a valid string", "give it another id")
        if each["id"] in seen:
            raise StructureError(each["id"], f"is the id of two {key}", "give one of them another id")
        seen.add(each["id"])
        check(each)
        if each.get("type", TYPES[key][-1]) not in TYPES[key] and each.get("type") is not None:
            problem, remedy = f"has the type {each['type']!r}", f"known here: {', '.join(TYPES[key])}"
            if each["type"] in OLD:
                problem, remedy = f"{problem} of an older format", "read it with pylinkage and write it again"
            raise StructureError(each["id"], problem, remedy)
        if key == "links" and not are(each.get("joints"), str):
            problem = f"joints is {each.get('joints')!r}, which is not a list of ids"
            raise StructureError(each["id"], problem, 'write the ids of its joints, e.g. ["A", "B"]')


def check(element: Drawn) -> None:
    """Raise `StructureError` for a key of a joint or link with a wrong value."""
    for key, value in element.items():
        what, remedy = "", ""
        if key in TEXTS and not isinstance(value, str | None):
            what, remedy = "string", "write it in double quotes"
        elif key in NUMBERS and not are([value], int, float) and (key, value) != ("initial_angle", None):
            what, remedy = "finite number", "write a number"
        elif key in PLACES and not (isinstance(value, list | tuple) and len(value) == 2 and are(value, int, float)):
            what, remedy = "pair of coordinates", "write two numbers, [x, y]"
        if what:
            raise StructureError(element["id"], f"{key} is {value!r}, which is not a {what}", remedy)


def are(values: object, *kinds: type) -> bool:
    """Whether this is a list of strings, or of finite numbers below the bound of scene files."""
    return isinstance(values, list | tuple) and all(
        isinstance(each, kinds) and not isinstance(each, bool) and (isinstance(each, str) or _fits(each))
        for each in values
    )


def _fits(number: int | float) -> bool:
    try:
        return math.isfinite(number) and abs(number) < LARGEST
    except OverflowError:
        return False
