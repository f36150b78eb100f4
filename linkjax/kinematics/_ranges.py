"""Crank ranges: where a linkage can be assembled if its crank cannot rotate fully."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from linkjax._search import RANGE_SCAN, scan_angles
from linkjax.groups import AbstractGroup, General, ReferencePath, closed_to
from linkjax.kinematics._crossings import crossings, margins_at, sound
from linkjax.kinematics._fold import folded
from linkjax.kinematics._pose import Prepared, check_cycle, named_groups, plain, prepared
from linkjax.mechanism import Mechanism

CLOSE = 1e-5  # rad: inside a range, where the search for the fold of a group of higher class begins
STEP = 0.02  # rad: largest distance of a fold inside the estimated end
LONGEST = 8  # largest number of turns of a range
SLOW = 32  # the same, in each direction, where gears make the motion non-periodic and all groups have a closed form
SEEN = 8  # angles per turn at which the motion is checked for periodicity
TOGETHER = 1e-12  # rad: ends that are closer coincide
LEFT_OUT = 0.06  # rad: more than a reference path omits of a range longer than the path
NARROW = 1e-6  # rad: narrower ranges and gaps do not count


class CrankRange(NamedTuple):
    """A range of crank angle (rad), `start` < `stop`, in all of which a mechanism can be assembled.

    `at_start` and `at_stop` name the group and the singular position that end it, e.g. "coupler-rocker, stretched".
    They are "" where nothing ends it: the crank rotates fully, or it drives gears that make the motion non-periodic and
    the range continues beyond all turns examined.
    """

    start: float
    stop: float
    at_start: str
    at_stop: str


def crank_ranges(mechanism: Mechanism | Prepared, cycle_turns: int = 1) -> tuple[CrankRange, ...]:
    """The ranges of crank angle (rad) in which a mechanism can be assembled.

    A crank that rotates fully has one range, from 0 to 2π `cycle_turns`; a linkage that closes nowhere has none.
    Otherwise the first range contains crank angle zero (or the angle at which a motion law begins), if the mechanism
    can be assembled there. The ranges above it follow, then those below it. `cycle_turns` is the number of crank turns
    in the machine's cycle, more than one if gears turn other links less often; the motion is assumed to repeat after
    them.

    Angles are those of a crank without a motion law, so that a law inside a range, e.g. `Harmonic(start, stop)`, is
    possible. For other drivers they are the phase of the law.

    A range ends where a margin is zero. For groups solved in closed form the error of an end is about 1e-15 rad divided
    by the slope of the margin, or 1e-8 rad for dyads that continue through change points. A group of higher class has
    one range: that in which it can be followed up and down from its sketch, through at most eight turns. It ends at
    folds of the closure, accurate to rounding where two assembly modes coincide, and otherwise to 1e-5 rad.

    If gears make the motion non-periodic after `cycle_turns`, as they may on a crank with a motion law, a range is
    followed in both directions, for up to 32 turns each (eight with groups of higher class). The ranges within
    `cycle_turns` in either direction are returned at their actual angles.

    Gaps narrower than 1e-6 rad do not count, nor do gaps of a group of higher class with a closure error below 4e-10 of
    its size, about 1e-4 rad wide. Ranges of other groups narrower than a thousandth of a turn may be missed. Whether
    the machine returns to its initial position is not checked. Not for use under JAX transformations: returns floats.
    Raises `ValueError` for a number of turns below one.
    Source: Grashof's rule says which cranks rotate fully, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988,
    ch. 2.
    """
    mechanism = plain(mechanism)
    check_cycle(cycle_turns)
    driver, law, begin = mechanism.driver, mechanism.driver.follows(), 0.0
    crank = None if (sense := driver.shaft()) is None else driver.turning(sense)
    if crank is not None and law is not None:
        begin = law.begins()  # the angle of the sketch
    elif law is not None:
        cycle_turns = max(cycle_turns, round(law.period() / (2 * math.pi)))
    mechanism = dataclasses.replace(mechanism, groups=(crank or driver, *mechanism.groups[1:]))
    whole = 2 * math.pi * cycle_turns
    if not any(group.singular_positions() for group in mechanism.groups):
        return (CrankRange(0.0, whole, "", ""),)
    ready = prepared(mechanism, cycle_turns)
    back = None if sense is None else driver.turning(-sense)
    if back is not None and any(group.wheels() for group in mechanism.groups) and not _repeats(ready, cycle_turns):
        found = _on_a_line(mechanism, back, cycle_turns)
    else:
        found = _turn_by_turn(ready, cycle_turns)
    if found and not (found[0].at_start or found[0].at_stop) and found[0].start == 0.0:
        return (CrankRange(0.0, whole, "", ""),)
    near = [each for each in found if each.start < whole and each.stop > -whole]
    return tuple(each._replace(start=each.start + begin, stop=each.stop + begin) for each in near or found[:1])


def _repeats(ready: Prepared, cycle_turns: int) -> bool:
    """Whether the margins repeat after so many turns, at the majority of some angles of a turn: at one of them a
    singular position may leave no digits. A group of higher class that is not assembled there does not count."""
    at = np.arange(SEEN) * (2 * math.pi / SEEN)
    first, after = np.split(margins_at(ready, np.append(at, at + 2 * math.pi * cycle_turns))[0], 2)
    general = [group.numerical() for group in ready.mechanism.groups for _ in group.singular_positions()]
    seen = np.all(first[:, general] > 0, axis=1) | np.all(after[:, general] > 0, axis=1)
    same = np.all(abs(after - first) < closed_to(first.dtype), axis=1)
    return bool(np.sum(seen & same) >= np.sum(seen & ~same))


def _turn_by_turn(ready: Prepared, cycle_turns: int) -> tuple[CrankRange, ...]:
    """Ranges of a mechanism that repeats after these turns, or whose groups of higher class take more turns.

    Where the ways up and down overlap with different positions, the range is longer than the path, and it is followed
    again over twice the turns. (Three of sixty random triads were reported as rotating fully.)
    """
    found = first = _on_a_circle(ready, cycle_turns)
    while found and 2 * cycle_turns <= LONGEST and _goes_on(ready, cycle_turns, found[0]):
        cycle_turns *= 2
        ready = prepared(ready, cycle_turns)
        found = _on_a_circle(ready, cycle_turns)
    return found or first


def _goes_on(ready: Prepared, cycle_turns: int, found: CrankRange) -> bool:
    """Whether the range may be longer than these turns, or the range of a group, which is then at another place."""
    ends = [end for end, why in ((found.start, found.at_start), (found.stop, found.at_stop)) if why]
    for group, path in ready.along().values():
        if not (isinstance(group, General) and isinstance(path, ReferencePath)):
            continue
        if path.trouble() == "astray" and (not ends or bool(path.astray(group.loose()))):
            return True
        if bool(path.ends()):  # only a narrow part of a longer range is omitted
            seam = float(path.middle())
            if any(abs(math.remainder(end - seam, 2 * math.pi * cycle_turns)) < LEFT_OUT for end in ends):
                return True
    return False


def _on_a_circle(ready: Prepared, cycle_turns: int) -> tuple[CrankRange, ...]:
    """Ranges of a prepared mechanism that repeats after these turns."""
    half, whole = math.pi * cycle_turns, 2 * math.pi * cycle_turns
    scan = np.append(_scan(ready, cycle_turns, half) - half, half)
    found, none = sorted(crossings(ready, scan, True)), (CrankRange(0.0, whole, "", ""),)
    if not found:
        return none if bool(np.all(sound(ready, np.zeros(1)))) else ()
    angles = np.asarray([angle for angle, _ in found])
    closes = _between(ready, np.append(angles, angles[0] + whole))
    if np.all(closes):
        return none
    on = int(np.argmin(closes)) + 1  # from where it cannot be assembled
    ends = [*found[on:], *((angle + whole, margin) for angle, margin in found[:on])]
    ranges = []
    for each in _runs(ready, ends, np.roll(closes, -on)[:-1]):
        shift = -whole if each.stop >= whole else whole if each.stop < 0 else 0.0
        ranges.append(each._replace(start=each.start + shift, stop=each.stop + shift))
    return _in_order(ranges)


def _on_a_line(mechanism: Mechanism, back: AbstractGroup, cycle_turns: int) -> tuple[CrankRange, ...]:
    """Ranges of a mechanism whose motion is not periodic, up and down from zero. Paths are followed upwards only, so
    the ranges below zero are found with the crank that turns `back`.

    A crank that oscillates in mesh with slow gears, or moves a rack, has no circle of turns: on a circle its range
    ended where its motion law began.
    """
    longest = LONGEST if any(group.numerical() for group in mechanism.groups) else SLOW
    both = [dataclasses.replace(mechanism, groups=(back, *mechanism.groups[1:])), mechanism]
    at_zero = _margin_names(mechanism)[int(np.argmin(margins_at(prepared(mechanism, cycle_turns), np.zeros(1))[0]))]
    nothing = CrankRange(0.0, 0.0, "", at_zero)
    while True:
        sides = [prepared(each, cycle_turns) for each in both]
        parts = [_one_way(side, cycle_turns) for side in sides]
        ranges = [_back(each) for each in parts[0] if each.start > 0.0] + [
            each for each in parts[1] if each.start > 0.0
        ]
        down, up = (next((each for each in part if each.start == 0.0), nothing) for part in parts)
        if down.stop + up.stop > 0.0:
            ranges.append(CrankRange(-down.stop, up.stop, down.at_stop, up.at_stop))
            if not (down.at_stop or up.at_stop) and all(_repeats(side, cycle_turns) for side in sides):
                return (CrankRange(0.0, 2 * math.pi * cycle_turns, "", ""),)
        found = _in_order(ranges)
        if (found and found[0].at_start and found[0].at_stop) or 2 * cycle_turns > longest:
            return found
        cycle_turns *= 2


def _back(found: CrankRange) -> CrankRange:
    """A range for the opposite rotation of the crank."""
    return CrankRange(-found.stop, -found.start, found.at_stop, found.at_start)


def _one_way(ready: Prepared, cycle_turns: int) -> list[CrankRange]:
    """Ranges of a prepared mechanism from zero up to these turns; one that is cut off there has "" as its reason."""
    whole = 2 * math.pi * cycle_turns
    found = crossings(ready, np.append(_scan(ready, cycle_turns), whole), False)
    ends = [(0.0, None), *sorted(found), (whole, None)]
    angles = np.asarray([angle for angle, _ in ends])
    closes = _between(ready, angles)
    for path in _paths(ready):
        if bool(path.ends()):  # beyond, the way down counts
            closes &= angles[:-1] + angles[1:] < 2 * float(path.middle())
    return _runs(ready, ends, closes)


def _scan(ready: Prepared, cycle_turns: int, ahead: float = 0.0) -> np.ndarray:
    """Scan angles from zero up, `ahead` of the crank by so much (rad): equal steps, and the middles of the gaps in the
    paths of groups of higher class."""
    gaps = np.asarray([float(path.middle()) for path in _paths(ready) if bool(path.ends())])
    return np.unique(
        np.concatenate(
            [np.asarray(scan_angles(cycle_turns, RANGE_SCAN)), np.mod(gaps + ahead, 2 * math.pi * cycle_turns)]
        )
    )


def _paths(ready: Prepared) -> list[ReferencePath]:
    """The paths of groups of higher class."""
    return [path for path in ready.paths if isinstance(path, ReferencePath)]


def _between(ready: Prepared, angles: np.ndarray) -> np.ndarray:
    """Whether the mechanism can be assembled between each of these angles and the next."""
    closes, wide = sound(ready, 0.5 * (angles[:-1] + angles[1:])), np.diff(angles) > NARROW
    known = np.flatnonzero(wide)
    next_one = np.searchsorted(known, np.arange(len(closes)))
    around = closes[known[next_one % len(known)]] & closes[known[next_one - 1]]  # for narrow intervals
    return np.where(wide, closes, around)


def _runs(ready: Prepared, ends: Sequence[tuple[float, int | None]], closes: np.ndarray) -> list[CrankRange]:
    """The ranges in which the mechanism can be assembled, between angles at which the margins of these numbers change
    sign."""
    names = _margin_names(ready.mechanism)
    owners = [number for number, group in enumerate(ready.mechanism.groups) for _ in group.singular_positions()]
    ranges, first = [], 0
    for last in range(len(closes)):
        first = first if closes[last] else last + 1
        if closes[last] and not closes[last + 1 : last + 2].any():
            (start, lower), (stop, upper) = ends[first], ends[last + 1]
            inwards, told = 0.5 * (stop - start), []
            for end, margin, way in ((start, lower, inwards), (stop, upper, -inwards)):
                told.append(end if margin is None else _sharpened(ready, owners[margin], end, way))
            for end, margin in ((start, lower), (stop, upper)):  # of a group and those attached to it, the first
                those = [k for angle, k in ends if k is not None and abs(angle - end) < TOGETHER]
                told.append("" if margin is None else names[min(those)])
            ranges.append(CrankRange(*told))
    return ranges


def _margin_names(mechanism: Mechanism) -> list[str]:
    """The names of the margins, in their order."""
    groups = named_groups(mechanism).items()
    return [f"{name}, {side}" for name, group in groups for side in group.singular_positions()]


def _in_order(ranges: Sequence[CrankRange]) -> tuple[CrankRange, ...]:
    """The range that contains zero first, then those above it, then those below it."""
    return tuple(sorted(ranges, key=lambda r: (not r.start <= 0.0 <= r.stop, r.stop < 0.0, r.start)))


def _sharpened(ready: Prepared, owner: int, end: float, inwards: float) -> float:
    """An end of a range, refined if a group of higher class causes it; `inwards` leads to the middle of the range."""
    if not ready.mechanism.groups[owner].numerical():
        return end
    inside = end + math.copysign(min(CLOSE, abs(inwards)), inwards)
    return folded(ready, owner, inside, end, min(STEP, abs(inwards)))
