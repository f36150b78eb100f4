"""Links of three or more pins whose shape is given by the distances between the pins."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from linkjax._types import known as number_of
from linkjax._vec import Vec
from linkjax.mechanism._link import Link
from linkjax.mechanism._mechanism import StructureError
from linkjax.mechanism._sketched import ROUGH, UNSURE

Sides = Mapping[tuple[str, str], float]
FLAT = 1e-9  # of a side: excess over the sum of the other two that counts as rounding


def with_sides(name: str, link: Link, sides: Sides, spots: Mapping[str, complex]) -> Link:
    """The link with its length and further pins from the distances `sides` between its pins (m). The places in `spots`
    show on which side of the line between two pins a third one lies. Raises `StructureError` where the distances form
    no triangle, are too few or too many, or the side of a pin is unknown."""
    where, given = f"links.{name}.sides", _given(name, link, sides)
    if (number_of(link.length) or 0) > 0 or link.points.keys() & set(link.pins):
        raise StructureError(where, "the length or the position of a pin is also given", "give the sides only")
    if len(link.pins) < 3:
        raise StructureError(where, f"the link has {len(link.pins)} pins", "give its length instead")
    first, second, *rest = link.pins
    length = _taken(given, first, second)
    if length is None:
        remedy = "give the distance of the first two pins, and two distances for each further pin"
        raise StructureError(where, f"the distance {first}-{second} is missing", remedy)
    places = {first: 0j, second: complex(length)}
    while rest:
        for pin in rest:
            held = [(other, side) for other in places if (side := given.get(frozenset((pin, other)))) is not None]
            if len(held) >= 2:
                break
        else:
            problem = f"does not determine {rest[0]!r}: two distances to other pins are needed"
            raise StructureError(where, problem, f"add e.g. {rest[0]}-{first} and {rest[0]}-{second}")
        (one, a), (two, b) = held[:2]
        places[pin] = _third(where, places, spots, (one, two, pin), (a, b))
        for other in (one, two):
            del given[frozenset((pin, other))]
        rest.remove(pin)
    if given:
        left = "-".join(sorted(next(iter(given))))
        raise StructureError(where, f"the distance {left} is redundant: the others determine the shape", "delete it")
    points = {p: Vec(at.real, at.imag) for p, at in places.items() if p not in (first, second)}
    scaled = {"reference_length": length} if number_of(link.reference_length) == 0 else {}
    return dataclasses.replace(link, length=length, points={**link.points, **points}, **scaled)


def _given(name: str, link: Link, sides: Sides) -> dict[frozenset[str], float]:
    """The distances by their pairs of pins."""
    found: dict[frozenset[str], float] = {}
    for pins, length in sides.items():
        ends, where = frozenset(pins if isinstance(pins, Iterable) else ()), f"links.{name}.sides"
        if len(ends) != 2 or not ends <= set(link.pins):
            problem = f"{'-'.join(pins) if ends else repr(pins)} are not two pins of the link"
            raise StructureError(where, problem, f"its pins are {', '.join(link.pins)}")
        if ends in found:
            raise StructureError(where, f"{'-'.join(pins)} is given twice", "delete one of them")
        if not 0 < (distance := _number(length)) < math.inf:
            raise StructureError(where, f"{'-'.join(pins)} is {length!r}", "write a distance above zero, in metres")
        found[ends] = distance
    return found


def _number(value: Any) -> float:
    """A single number; NaN for anything else."""
    try:
        return float(value) if np.ndim(value) == 0 else math.nan
    except (TypeError, ValueError):
        return math.nan


def _taken(given: dict[frozenset[str], float], one: str, two: str) -> float | None:
    return given.pop(frozenset((one, two)), None)


def _third(
    where: str,
    places: Mapping[str, complex],
    spots: Mapping[str, complex],
    pins: tuple[str, str, str],
    sides: tuple[float, float],
) -> complex:
    """The third corner of a triangle with two known corners."""
    one, two, pin = pins
    base, (a, b) = places[two] - places[one], sides
    length = abs(base)
    foot = 0.5 * (length + (a - b) * (a + b) / length) if length else math.nan
    square = (a - foot) * (a + foot)
    if not square >= -FLAT * a * a:
        problem = (
            f"{one}-{pin} {a:.6g} m, {two}-{pin} {b:.6g} m and {one}-{two} {length:.6g} m form no triangle: "
            "the longest is longer than the other two together"
        )
        raise StructureError(where, problem, "correct one of them")
    missing = [point for point in pins if point not in spots]
    if missing:
        problem = f"it is unknown on which side of the line from {one!r} to {two!r} the pin {pin!r} lies"
        raise StructureError(where, problem, f"sketch {', '.join(missing)}")
    aside, line = math.sqrt(max(square, 0.0)), spots[two] - spots[one]
    drawn = (line.conjugate() * (spots[pin] - spots[one])).imag / abs(line) if line else 0.0
    size = max(abs(here - there) for here in spots.values() for there in spots.values())
    if aside > ROUGH * size and abs(drawn) < UNSURE * aside:
        problem = f"puts {pin!r} {aside:.4g} m beside the line from {one!r} to {two!r}, but it is sketched on this line"
        raise StructureError(where, problem, f"sketch {pin!r} on the intended side")
    return places[one] + base / length * complex(foot, aside if drawn >= 0 else -aside)
