"""Curves through the values of a table: periodic ones with jumps, and pairs of branches over a coordinate."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._interpolate import (
    METHODS,
    Method,
    Pieces,
    closed_knots,
    monotone_slopes,
    periodic_slopes,
    piece_number,
    pieces_of,
)
from linkjax._numerics import wrapped
from linkjax._types import as_float, known

TURN = 2 * math.pi
BESIDE = 1e-9  # rad: a side at most so far away decides on which side of a jump a value is taken
Heights = tuple[Array | tuple[Array, Array], ...]


def listed(values: Any) -> Any:
    """Numbers as scalar float arrays; None for None. Raises `TypeError` for anything but a list of numbers."""
    if values is None or type(values) is object:
        return values
    return tuple(as_float(value) for value in _items(values))


def heights(values: Any) -> Any:
    """The same, where a value may be a pair: the values before and after a jump."""
    if values is None or type(values) is object:
        return values
    found = []
    for value in _items(values):
        pair = isinstance(value, tuple | list)
        if pair and len(value) != 2:
            raise TypeError(f"{value!r} in a table; write one value, or a pair at a jump, (before, after)")
        found.append(tuple(as_float(each) for each in value) if pair else as_float(value))
    return tuple(found)


def _items(values: Any) -> list[Any]:
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise TypeError(f"{values!r} where a list of numbers is needed; write e.g. [0.0, 1.5, 3.0]")
    return list(values)


def joined_jumps(at: Sequence[float], values: Sequence[float], period: float | None) -> tuple[list[float], list[Any]]:
    """Knots and values as lists of different knots, where two equal knots, or one at the end of the period, are a jump:
    a pair of values, before and after it. Equal values there are one value."""
    knots, found = [], []
    for x, y in zip(at, values, strict=True):
        if knots and x == knots[-1] and not isinstance(found[-1], tuple):
            found[-1] = y if y == found[-1] else (found[-1], y)
        else:
            knots.append(x)
            found.append(y)
    if period is not None and len(knots) > 1 and abs(knots[-1] - knots[0] - period) < 1e-12 * period:
        knots.pop()
        last = found.pop()
        same = last == found[0]
        found[0] = found[0] if same or isinstance(last, tuple) or isinstance(found[0], tuple) else (last, found[0])
    return knots, found


def check_knots(what: str, at: Sequence[Any], values: Sequence[Any], unit: str, width: float | None) -> None:
    """Raise `ValueError` unless there are two knots or more, a finite value at each, and the knots increase, within a
    `width` if one is given. `what` names them, e.g. "angles of load 'gas'"."""
    if len(at) < 2 or len(values) != len(at):
        number = f"{len(at)} {'entries' if len(at) != 1 else 'entry'} and {len(values)} values"
        raise ValueError(f"{what}: there are {number}; write two or more, and a value for each")
    numbers = [known(x) for x in at]
    parts = [known(y) for value in values for y in (value if isinstance(value, tuple) else (value,))]
    for each in (*numbers, *parts):
        if each is not None and not np.all(np.isfinite(each)):
            raise ValueError(f"{what}: one of the numbers is {each}; write finite numbers")
    if any(x is None for x in numbers):
        return
    places: list[Any] = numbers
    for before, after in itertools.pairwise(places):
        if np.any(after <= before):
            pair = "; write the values before and after a jump as a pair, (before, after)"
            problem = f"{after} {unit} does not exceed {before} {unit} before it"
            raise ValueError(f"{what}: {problem}{pair if np.any(after == before) else '; write them in order'}")
    if width is not None and np.any(places[-1] - places[0] >= width * (1 - 1e-12)):
        problem = f"they cover {np.max(places[-1] - places[0]):.9g} {unit}, a period of {width:.9g} {unit} or more"
        raise ValueError(f"{what}: {problem}; omit the last if it repeats the first, or increase cycle_turns")


def check_method(what: str, method: str) -> None:
    """Raise `ValueError` for an unknown method of interpolation."""
    if method not in METHODS:
        raise ValueError(f'method of {what} is {method!r}; write "linear" or "cubic"')


def over_crank(at: Sequence[Array], values: Heights, method: Method, period: float, when: Any) -> Array:
    """The value of a periodic table at an instant; at a jump the limit on the requested side."""
    knots, pieces = _periodic(at, values, method, period)
    first, rounding = knots[0], 8 * jnp.finfo(knots.dtype).eps * period
    ahead = 0.5 * jnp.clip(when.side - when.phi, -BESIDE, BESIDE)
    probe = when.phi + ahead + jnp.where(when.side >= when.phi, rounding, -rounding)
    inside = first + wrapped(probe - first, period)
    return pieces.at(piece_number(inside, knots, len(at)), inside + (when.phi - probe))


def _periodic(at: Sequence[Array], values: Heights, method: Method, period: float) -> tuple[Array, Pieces]:
    """Knots, the first one repeated at the end of the period, and the pieces between them."""
    jumps = [i for i, value in enumerate(values) if isinstance(value, tuple)]
    if not jumps:
        knots, plain = jnp.stack(list(at)), jnp.stack([value for value in values if not isinstance(value, tuple)])
        slopes = None if method == "linear" else periodic_slopes(knots, plain, period)
        ends, closed = closed_knots(knots, plain, period)
        return ends, pieces_of(ends, closed, slopes)
    count, places, parts = len(at), [], []
    for jump, following in zip(jumps, [*jumps[1:], jumps[0] + len(at)], strict=True):
        numbers = range(jump, following + 1)
        knots = jnp.stack([at[i % count] + period * (i // count) for i in numbers])
        shown = [values[i % count] for i in numbers]
        first, last = shown[0], shown[-1]
        assert isinstance(first, tuple) and isinstance(last, tuple)  # a part leads from jump to jump
        inner = [value for value in shown[1:-1] if not isinstance(value, tuple)]
        plain = jnp.stack([first[1], *inner, last[0]])
        parts.append(pieces_of(knots, plain, None if method == "linear" else monotone_slopes(knots, plain)))
        places.append(knots[:-1])
    start, width, low, high = (jnp.concatenate(part) for part in zip(*(part[:4] for part in parts), strict=True))
    slopes = None
    if method == "cubic":
        ends = zip(*(part.slopes for part in parts if part.slopes is not None), strict=True)
        left, right = (jnp.concatenate(part) for part in ends)
        slopes = left, right
    ends = jnp.concatenate([*places, (places[0][0] + period)[None]])
    return ends, Pieces(start, width, low, high, slopes)


def repeated(at: Sequence[Array], period: float, cycle: float) -> tuple[Array, ...]:
    """Knots of a periodic table over a whole cycle (rad)."""
    times = max(1, round(cycle / period))
    return tuple(knot if k == 0 else knot + k * period for k in range(times) for knot in at)
