"""Objectives of synthesis on the command line: wanted points, angles or positions from a CSV file."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from linkjax._units import QuantityError, in_si, nearest
from linkjax.design import DesignError, Term, function_error, path_error, position_error

START = "own.start"
UNITS = {"x": "m", "y": "m", "angle": "rad", "crank": "rad"}
HEADING = re.compile(r"\s*(\w+)\s*(?:[(\[]\s*(.+?)\s*[)\]])?\s*")

PathError = Annotated[
    str | None,
    typer.Option(metavar="POINT=FILE", help="Objective: the point passes through the points x, y (at crank) of a CSV."),
]
FunctionError = Annotated[
    str | None, typer.Option(metavar="LINK=FILE", help="Objective: the link has the angles (angle at crank) of a CSV.")
]
PositionError = Annotated[
    str | None,
    typer.Option(metavar="LINK=FILE", help="Objective: the link takes the positions x, y, angle (at crank) of a CSV."),
]
FreeStart = Annotated[bool, typer.Option(help=f"Crank angles of these objectives count from a free one, {START}.")]


def target(path: str | None, function: str | None, position: str | None, free_start: bool) -> Term | None:
    """The objective that the options ask for, None without them. Raises `DesignError` for wrong options and files."""
    asked = {"--path-error": path, "--function-error": function, "--position-error": position}
    given = {option: text for option, text in asked.items() if text is not None}
    if len(given) > 1:
        raise DesignError(" and ".join(given), "two objectives are given", "keep one")
    if not given:
        if free_start:
            raise DesignError("--free-start", "there are no crank angles", "write --path-error POINT=FILE, too")
        return None
    option, text = next(iter(given.items()))
    name, equals, file = text.partition("=")
    if not equals:
        raise DesignError(f"{option}: {text!r}", "is not NAME=FILE", f"write e.g. {option} P=points.csv")
    make, columns = MAKERS[option]
    data = _read(Path(file.strip()), (*columns, "crank"))
    for column in columns:
        if column not in data:
            raise DesignError(f"{option}: {file}", f"has no column {column!r}", f"it has: {', '.join(data)}")
    rows = [list(row) for row in zip(*(data[column] for column in columns), strict=True)]
    return make(name.strip(), rows, data.get("crank"), START if free_start else None)


def _path(point: str, rows: list[list[float]], crank: Any, start: str | None) -> Term:
    return path_error(point, rows, crank, start=start)


def _function(link: str, rows: list[list[float]], crank: Any, start: str | None) -> Term:
    return function_error(link, crank, [row[0] for row in rows], start=start)


def _position(link: str, rows: list[list[float]], crank: Any, start: str | None) -> Term:
    return position_error(link, rows, crank, start=start)


MAKERS: dict[str, tuple[Callable[..., Term], tuple[str, ...]]] = {
    "--path-error": (_path, ("x", "y")),
    "--function-error": (_function, ("angle",)),
    "--position-error": (_position, ("x", "y", "angle")),
}


def _read(file: Path, known: tuple[str, ...]) -> dict[str, list[float]]:
    """The columns of a CSV file in SI. Headings are names, with units in parentheses: `x (mm)`; lengths without one are
    in SI, angles need theirs."""
    try:
        lines = [row for row in csv.reader(file.read_text(encoding="utf-8-sig").splitlines()) if any(row)]
    except (OSError, UnicodeDecodeError) as error:
        raise DesignError(str(file), f"cannot be read: {error}", "name a CSV file") from error
    if len(lines) < 2:
        raise DesignError(str(file), "has no rows", f"write a heading with {', '.join(known)}, then one row each")
    if len(lines[0]) == 1 and ";" in lines[0][0]:
        raise DesignError(str(file), "has semicolons between its columns", "write commas, and points in decimals")
    names, factors = [], []
    for heading in lines[0]:
        found = HEADING.fullmatch(heading)
        if found is None or found[1] not in known:
            raise DesignError(f"{file}: {heading!r}", "is not a column", nearest(heading.strip(), known))
        names.append(found[1])
        factors.append(_factor(f"{file}: {heading}", found[2], UNITS[found[1]]))
    columns: dict[str, list[float]] = {name: [] for name in names}
    for number, row in enumerate(lines[1:], 2):
        if len(row) != len(names):
            raise DesignError(f"{file}: row {number}", f"has {len(row)} values", f"write {len(names)}")
        for name, factor, value in zip(names, factors, row, strict=True):
            try:
                columns[name].append(factor * float(value))
            except ValueError as error:
                problem = f"{name} is {value!r}, which is not a number"
                raise DesignError(f"{file}: row {number}", problem, "write numbers; units belong in heading") from error
    return columns


def _factor(element: str, unit: str | None, wanted: str) -> float:
    """The factor from the unit of a heading to SI."""
    if unit is None and wanted == "rad":
        name = element.rpartition(": ")[2].strip()
        raise DesignError(element, "is an angle without a unit", f"write {name} (deg) or {name} (rad)")
    if unit is None:
        return 1.0
    try:
        factor, own = in_si(f"1 {unit}")
    except QuantityError as error:
        raise DesignError(element, error.problem, error.remedy) from error
    if own != wanted:
        raise DesignError(element, f"{unit!r} is not a unit of this column", f"write one of {wanted}")
    return factor
