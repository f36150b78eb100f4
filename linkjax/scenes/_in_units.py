"""Quantities of a scene file in the units of another, to the last bit."""

from __future__ import annotations

import collections
import decimal
from collections.abc import Iterator, Mapping
from typing import Any

from linkjax._units import QuantityError, in_si, unit_of

WORDS = ("title", "name")  # keys whose strings are no quantities
MOST = 17  # digits of a double
SMALL, LARGE = 6, 9  # powers of ten between which numbers are written without one


def units_in(table: Mapping[str, Any]) -> dict[str, str]:
    """The unit in which most quantities of a kind are written in a table, by SI unit: {"m": "mm", "rad/s": "rpm"}."""
    counts: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    for text in _strings(table):
        if (unit := _si_unit(text)) != "":
            counts[unit][unit_of(text)] += 1
    return {unit: found.most_common(1)[0][0] for unit, found in counts.items()}


def in_units(value: Any, units: Mapping[str, str]) -> Any:
    """A table, list or string with its quantities in these units, in the fewest digits that give the same number; those
    without such digits stay as they are."""
    if isinstance(value, dict):
        return {key: each if key in WORDS else in_units(each, units) for key, each in value.items()}
    if isinstance(value, list):
        return [in_units(each, units) for each in value]
    unit = units.get(_si_unit(value)) if isinstance(value, str) else None
    if unit is None:
        return value
    number = in_si(value)[0]
    if number == 0:
        return f"0 {unit}"
    exact = decimal.Decimal(repr(number)) / decimal.Decimal(repr(in_si(f"1 {unit}")[0]))
    texts = (f"{_plain(exact, digits)} {unit}" for digits in range(1, MOST + 1))
    return next((text for text in texts if in_si(text)[0] == number), value)


def _plain(number: decimal.Decimal, digits: int) -> str:
    """A number with so many significant digits, without a power of ten unless it is very large or small."""
    rounded = decimal.Context(prec=digits).create_decimal(number).normalize()
    return f"{rounded:f}" if -SMALL < rounded.adjusted() < LARGE else str(rounded)


def _strings(value: Any) -> Iterator[str]:
    """All strings of a table that may be quantities."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        yield from (text for key, each in pairs if key not in WORDS for text in _strings(each))


def _si_unit(text: str) -> str:
    """The SI unit of a quantity; "" for another string, and for a plain number."""
    try:
        unit = in_si(text)[1]
    except QuantityError:
        return ""
    return "" if unit == "1" else unit
