"""Paths of keys, `loads[0].window`, and the types of the scene format along them."""

from __future__ import annotations

import json
import re
import types
import typing
from typing import Any

from pydantic import BaseModel, Discriminator, Tag

from linkjax.scenes._models import SceneFile
from linkjax.scenes._rolling import RollingFile

Path = tuple[str | int, ...]
PLAIN = re.compile(r"[\w-]+")
STEP = re.compile(r'\.?(?:\[(?P<index>\d+)\]|"(?P<quoted>[^"]*)"|(?P<plain>[^.\[\]"]+))')


def join(path: Path) -> str:
    """The path as a string, e.g. `groups[1].guide.along`."""
    steps = (f"[{p}]" if isinstance(p, int) else "." + (p if PLAIN.fullmatch(p) else json.dumps(p)) for p in path)
    return "".join(steps).removeprefix(".")


def split(key: str) -> tuple[str, ...]:
    """The steps of a path in a string: names between dots, indices in brackets or between dots."""
    steps, at = [], 0
    key = key.strip()
    while at < len(key):
        match = STEP.match(key, at)
        if match is None or (at > 0 and key[at] not in ".["):
            return (key,)
        steps.append(next(group for group in match.groups() if group is not None).strip())
        at = match.end()
    return tuple(steps)


def lookup(table: Any, path: Path) -> Any:
    """The value at a path of the raw document; None where it is missing."""
    for part in path:
        inside = isinstance(table, dict) and part in table
        inside = inside or (isinstance(table, list) and isinstance(part, int) and part < len(table))
        table = typing.cast(Any, table)[part] if inside else None
    return table


def is_rolling(table: Any) -> bool:
    """Whether a raw document describes rolling bodies, not a linkage."""
    return lookup(table, ("kind",)) == "rolling"


def leaves(table: Any, path: Path = ()) -> list[Path]:
    """Paths of all values that are neither table nor list of tables."""
    if isinstance(table, dict):
        return [leaf for key, value in table.items() for leaf in leaves(value, (*path, key))]
    if isinstance(table, list) and any(isinstance(item, dict) for item in table):
        return [leaf for number, value in enumerate(table) for leaf in leaves(value, (*path, number))]
    return [path]


def annotation_at(table: Any, path: Path) -> Any:
    """The type of the format at `path`; the values of the document select the branch of a union. None if unknown."""
    annotation: Any = RollingFile if is_rolling(table) else SceneFile
    for part in path:
        settled = settle(annotation, table)
        origin, arguments = typing.get_origin(settled), typing.get_args(settled)
        if is_table(settled):
            annotation = fields(settled).get(str(part))
        elif origin is dict:
            annotation = arguments[1]
        elif origin in (list, tuple) and isinstance(part, int):
            annotation = arguments[min(part, len(arguments) - 1)]
        else:
            annotation = None
        if annotation is None:
            return None
        table = lookup(table, (part,))
    return settle(annotation, table)


def is_table(annotation: Any) -> bool:
    """Whether a settled type is a table with keys of its own."""
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def fields(model: type[BaseModel]) -> dict[str, Any]:
    """Keys of a table and their types, with everything annotated."""
    hints = typing.get_type_hints(model, include_extras=True)
    return {field.alias or name: hints[name] for name, field in model.model_fields.items()}


def examples(model: type[BaseModel]) -> dict[str, Any]:
    """Keys of a table with an example each, where there is one."""
    named = {field.alias or name: field.examples for name, field in model.model_fields.items()}
    return {key: given[0] for key, given in named.items() if given}


def settle(annotation: Any, value: Any) -> Any:
    """`annotation` without its metadata; of a union, the branch that `value` selects (None where it selects none)."""
    arguments = typing.get_args(annotation)
    if typing.get_origin(annotation) is typing.Annotated:
        choosers = [extra.discriminator for extra in arguments[1:] if isinstance(extra, Discriminator)]
        if not choosers or not callable(choosers[0]):
            return settle(arguments[0], value)
        tag = choosers[0](value)
        branches = [
            b
            for b in typing.get_args(arguments[0])
            if any(isinstance(t, Tag) and t.tag == tag for t in typing.get_args(b))
        ]
        return settle(branches[0], value) if branches else None
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return settle(next(a for a in arguments if a is not type(None)), value)
    return annotation
