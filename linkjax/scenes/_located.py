"""Errors of the layers below the scene reader, at their place in the scene file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from linkjax.mechanism import StructureError
from linkjax.scenes._errors import SceneError
from linkjax.scenes._explain import fault, from_structure
from linkjax.scenes._keys import Path, lookup

OWN = re.compile(r"([^\n]{1,300}); ([^;\n]{1,200})")  # a message of linkjax: problem and remedy
REPORT = "change or delete this value; if it is correct, report the error with the file as a bug of linkjax"
LONGEST = 200  # characters of a message from other programs
TABLES = ("drive", "slots", "gears", "racks", "groups", "loads")


class PartError(Exception):
    """An error in the part of a scene at `path`; its cause says what it is."""

    def __init__(self, path: Path):
        self.path = path
        super().__init__(path)


@contextmanager
def part(*path: str | int) -> Iterator[None]:
    """Adds the path of a part of the scene to errors raised inside that do not name it."""
    try:
        yield
    except (PartError, SceneError, StructureError):
        raise
    except Exception as error:
        raise PartError(path) from error


@contextmanager
def located(source: str, table: Any) -> Iterator[None]:
    """Every error raised inside becomes a `SceneError` that names the file and, as far as known, key and value."""
    try:
        yield
    except SceneError:
        raise
    except Exception as error:
        cause = error.__cause__ if isinstance(error, PartError) and error.__cause__ is not None else error
        raise _at_its_place(cause, source, table, error.path if isinstance(error, PartError) else ()) from cause


def _at_its_place(error: BaseException, source: str, table: Any, path: Path) -> SceneError:
    if isinstance(error, StructureError):
        try:
            return from_structure(error, source, table)
        except Exception:  # an element that is not in the file under its name
            return fault(source, table, place_of(error.element, table), error.problem, error.remedy)
    text = str(error)
    own = OWN.fullmatch(text) if type(error) in (ValueError, TypeError) else None
    problem, remedy = (own[1], own[2]) if own else (_foreign(error), REPORT)
    return fault(source, table, place_of(text, table, path), problem, remedy)


def _foreign(error: BaseException) -> str:
    """The problem of an unexpected error: its type and the beginning of its text."""
    first = " ".join(str(error).split())
    return f"cannot be read: {type(error).__name__}{f': {first}' if first else ''}"[:LONGEST]


def place_of(text: str, table: Any, path: Path = ()) -> Path:
    """The key, inside `path`, that holds a name quoted in a message, or `path` itself where there is none.

    In a message about a group, names outside the group come first; without a quoted name the first link is taken.
    """
    group = re.search(r"\bgroup of ([\w, -]+)", text)
    members = group[1].split(", ") if group else []
    quoted = re.findall(r"'([\w-]+)'", text)
    names = [*sorted(quoted, key=lambda name: name in members), *members[:1]]
    tables = [(name,) for name in TABLES if re.search(rf"\bthe {name.removesuffix('s')}\b", text)]
    places = [path] if path else [*tables, ()]
    found = (at for place in places for name in names for at in _holders(lookup(table, place), name, place))
    return next(found, path)


def _holders(value: Any, name: str, path: Path) -> Iterator[Path]:
    """Paths to a name inside a table: keys of this name, and keys whose value is the name."""
    if value == name or (isinstance(value, list) and name in value):
        yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        if key == name:
            yield (*path, key)
        yield from _holders(item, name, (*path, key))
