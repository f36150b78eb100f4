"""Checks of the types of the arguments of `linkage`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar, cast

from linkjax.groups import Belt, Drive, GearPair, RackPair, Slot, Teeth
from linkjax.mechanism._link import Flywheel, Link
from linkjax.mechanism._mechanism import StructureError

Of = TypeVar("Of")
LONGEST = 60  # characters of a value in a message
TABLES = {
    "fixed": '{"A": (0.0, 0.0)}',
    "links": '{"crank": Link(pins=("A", "B"))}',
    "sketch": '{"B": (0.1, 0.2)}',
    "sides": '{"plate": {("E", "F"): 0.25}}',
}
LISTS: dict[str, tuple[type, str]] = {
    "slots": (Slot, '[Slot("ram", Guide("A"))]'),
    "gears": (GearPair, '[GearPair("wheel", "crank", Teeth((20, 40)))]'),
    "racks": (RackPair, '[RackPair("rack", "wheel", 0.05)]'),
}


def check_arguments(tables: Mapping[str, Any], lists: Mapping[str, Any], drive: Any, flywheel: Any) -> None:
    """Raise `StructureError` for an argument, a name or an element of the wrong type."""
    for key, table in tables.items():
        if not isinstance(table, Mapping):
            raise StructureError(key, f"must be a dictionary, but is {shown(table)}", f"write e.g. {TABLES[key]}")
        for name in table:
            _check_name(key, name)
    for name, link in tables["links"].items():
        if not isinstance(link, Link):
            raise StructureError(f"links.{name}", f"must be a Link, but is {shown(link)}", "write Link(pins=(...))")
        for pin in link.pins:
            _check_name(f"links.{name}.pins", pin)
    for name, given in tables["sides"].items():
        if not isinstance(given, Mapping):
            problem = f"must be a dictionary, but is {shown(given)}"
            raise StructureError(f"links.{name}.sides", problem, 'write e.g. {("E", "F"): 0.25}')
    for key, elements in lists.items():
        kind, example = LISTS[key]
        if not isinstance(elements, tuple):
            raise StructureError(key, f"must be a list, but is {shown(elements)}", f"write e.g. {key}={example}")
        for number, each in enumerate(elements):
            if not isinstance(each, kind):
                problem = f"must be a {kind.__name__}, but is {shown(each)}"
                raise StructureError(f"{key}[{number}]", problem, f"write e.g. {key}={example}")
    for gear in lists["gears"]:
        if not isinstance(gear.mesh, Teeth | Belt):
            problem = f"its mesh must be Teeth or a Belt, but is {shown(gear.mesh)}"
            raise StructureError(f"gear of {gear.link}", problem, "write e.g. Teeth((20, 40))")
    if not isinstance(drive, Drive):
        raise StructureError("drive", f"must be a Drive, but is {shown(drive)}", 'write e.g. Drive("crank")')
    for name in (drive.link, drive.on):
        _check_name("drive", name)
    if flywheel is not None and not isinstance(flywheel, Flywheel):
        raise StructureError("flywheel", f"must be a Flywheel, but is {shown(flywheel)}", "write e.g. Flywheel(0.6)")


def listed(elements: Iterable[Of]) -> tuple[Of, ...]:
    """The elements as a tuple; anything that cannot be iterated over is returned unchanged."""
    return tuple(elements) if isinstance(elements, Iterable) else cast(Any, elements)


def shown(value: object) -> str:
    """A value in a message: its first line, shortened."""
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


def _check_name(where: str, name: object) -> None:
    if not isinstance(name, str):
        raise StructureError(where, f"the name {shown(name)} is not a string", "write names in quotes")
