"""Crank ranges that end: where a linkage whose crank does not come round can be assembled."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from linkjax.groups import Crank, General, Track, closed_to
from linkjax.kinematics._crossings import crossings, margins_at, sound
from linkjax.kinematics._cycle import scan_angles
from linkjax.kinematics._fold import folded
from linkjax.kinematics._pose import named_groups, prepared
from linkjax.mechanism import Mechanism

SCAN = 360  # crank angles a turn at which the margins are first looked at
CLOSE = 1e-5  # rad: how far inside a range a general group is taken to find its fold from
STEP = 0.02  # rad: how far inside its range a fold may be found
LONGEST = 8  # turns that a range may take
SLOW = 32  # the same, either way, where wheels repeat nothing and all groups are closed in closed form
SEEN = 8  # angles of a turn at which it is asked whether all is as it was
TOGETHER = 1e-12  # rad: between ends that are one
LEFT_OUT = 0.06  # rad: more than a reference path leaves out of a range that is longer
NARROW = 1e-6  # rad: what is no range, and no gap


class CrankRange(NamedTuple):
    """Crank angles (rad) from `start` to `stop`, growing, between which a mechanism can be assembled all the way; what
    ends it there, e.g. "coupler-rocker, stretched", and "" where nothing does: the crank comes round, or swings, with
    wheels that repeat nothing, and can go on for as many turns as were looked at."""

    start: float
    stop: float
    at_start: str
    at_stop: str


def crank_ranges(mechanism: Mechanism, cycle_turns: int = 1) -> tuple[CrankRange, ...]:
    """The ranges of crank angle in which a mechanism can be assembled, from the one that holds crank angle zero, or
    where a law begins, or comes next, on; one from 0 to 2π `cycle_turns` for a crank that comes round, none for a linkage
    that closes nowhere. `cycle_turns` of the crank are looked at: as many as the machine's cycle has (more than one where
    gears turn other links less often), for what lies beyond is taken to repeat them where it can.

    Angles are those a crank without a law turns by, so that a law inside a range (`Harmonic(start, stop)`) can be
    driven; of other drivers they are the phase of their law. Ends are where a margin is zero, sharpened to rounding:
    for groups closed in closed form some 1e-15 rad over the margin's slope, 1e-8 for dyads that continue through change
    points. Of a general group there is one range, in which it can be followed up and down from there, through up to
    eight turns; its ends are folds of its closure, to rounding too where two assemblies meet there (else up to 1e-5 rad
    off). Where wheels turn so that nothing repeats after `cycle_turns`, as they may on a crank with a law, it is looked at
    for as many turns either way as its range takes, up to 32 (eight with general groups), and ranges within `cycle_turns`
    either way are told where they are. A gap narrower than 1e-6 rad is none, nor is one of a general group in which
    less than 4e-10 of its size stays open, some 1e-4 rad wide. Ranges of other groups narrower than a thousandth of a
    turn may be overlooked. Whether all is after a turn where it began is another question. Not for use under jax
    transformations: plain numbers come out.
    Source: Grashof's rule, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 2, says which cranks turn.
    """
    crank, law, begin = mechanism.groups[0], mechanism.driver.follows(), 0.0
    if isinstance(crank, Crank) and law is not None:
        begin = law.begins()  # sketches are drawn there
        crank = dataclasses.replace(crank, law=None, phase=crank.phase + begin)
    elif law is not None:
        cycle_turns = max(cycle_turns, round(law.period() / (2 * math.pi)))
    mechanism, whole = dataclasses.replace(mechanism, groups=(crank, *mechanism.groups[1:])), 2 * math.pi * cycle_turns
    if not any(group.dead_positions() for group in mechanism.groups):
        return (CrankRange(0.0, whole, "", ""),)
    ready = prepared(mechanism, cycle_turns)  # anew: a mechanism that is made has no paths
    if (
        isinstance(crank, Crank)
        and any(group.wheels() for group in mechanism.groups)
        and not _repeats(ready, cycle_turns)
    ):
        found = _on_a_line(mechanism, crank, cycle_turns)
    else:
        found = _turn_by_turn(mechanism, ready, cycle_turns)
    if found and not (found[0].at_start or found[0].at_stop) and found[0].start == 0.0:
        return (CrankRange(0.0, whole, "", ""),)
    near = [each for each in found if each.start < whole and each.stop > -whole]
    return tuple(each._replace(start=each.start + begin, stop=each.stop + begin) for each in near or found[:1])


def _repeats(mechanism: Mechanism, cycle_turns: int) -> bool:
    """Whether margins are after so many turns what they were, at most of some angles of a turn: at one of them a dead
    position may leave no digits. Where a general group is not assembled its margin says nothing."""
    at = np.arange(SEEN) * (2 * math.pi / SEEN)
    first, after = np.split(margins_at(mechanism, np.append(at, at + 2 * math.pi * cycle_turns))[0], 2)
    general = [isinstance(group, General) for group in mechanism.groups for _ in group.dead_positions()]
    seen = np.all(first[:, general] > 0, axis=1) | np.all(after[:, general] > 0, axis=1)
    same = np.all(abs(after - first) < closed_to(first.dtype), axis=1)
    return bool(np.sum(seen & same) >= np.sum(seen & ~same))


def _turn_by_turn(mechanism: Mechanism, ready: Mechanism, cycle_turns: int) -> tuple[CrankRange, ...]:
    """Ranges of a mechanism that repeats after these turns, or whose general groups go on for more of them."""
    found = first = _on_a_circle(ready, cycle_turns)
    while found and 2 * cycle_turns <= LONGEST and _goes_on(ready, cycle_turns, found[0]):
        cycle_turns *= 2
        ready = prepared(mechanism, cycle_turns)
        found = _on_a_circle(ready, cycle_turns)
    return found or first


def _goes_on(mechanism: Mechanism, cycle_turns: int, found: CrankRange) -> bool:
    """Whether a range may be longer than these turns, or that of one of its groups, which then is elsewhere in it."""
    groups = [group for group in mechanism.groups if isinstance(group, General)]
    ends = [end for end, why in ((found.start, found.at_start), (found.stop, found.at_stop)) if why]
    for group, path in ((group, group.path) for group in groups):
        assert path is not None
        if path.trouble() == "astray" and (not ends or bool(path.astray(group.loose()))):
            return True
        if bool(path.ends()):  # what is left out of a longer one is narrow
            seam = float(path.middle())
            if any(abs(math.remainder(end - seam, 2 * math.pi * cycle_turns)) < LEFT_OUT for end in ends):
                return True
    return False


def _on_a_circle(mechanism: Mechanism, cycle_turns: int) -> tuple[CrankRange, ...]:
    """Ranges of a prepared mechanism that repeats after these turns."""
    half, whole = math.pi * cycle_turns, 2 * math.pi * cycle_turns
    scan = np.append(_scan(mechanism, cycle_turns, half) - half, half)
    found, none = sorted(crossings(mechanism, scan, True)), (CrankRange(0.0, whole, "", ""),)
    if not found:
        return none if bool(np.all(sound(mechanism, np.zeros(1)))) else ()
    angles = np.asarray([angle for angle, _ in found])
    closes = _between(mechanism, np.append(angles, angles[0] + whole))
    if np.all(closes):
        return none
    on = int(np.argmin(closes)) + 1  # from where it cannot be assembled
    ends = [*found[on:], *((angle + whole, margin) for angle, margin in found[:on])]
    ranges = []
    for each in _runs(mechanism, ends, np.roll(closes, -on)[:-1]):
        shift = -whole if each.stop >= whole else whole if each.stop < 0 else 0.0
        ranges.append(each._replace(start=each.start + shift, stop=each.stop + shift))
    return _in_order(ranges)


def _on_a_line(mechanism: Mechanism, crank: Crank, cycle_turns: int) -> tuple[CrankRange, ...]:
    """Ranges of a mechanism that repeats nothing, where they are, up and down from zero: down it is what another is
    whose crank turns the other way, for paths are followed upwards."""
    longest = LONGEST if any(isinstance(group, General) for group in mechanism.groups) else SLOW
    ways = [dataclasses.replace(crank, rotation="cw" if crank.rotation == "ccw" else "ccw"), crank]
    both = [dataclasses.replace(mechanism, groups=(way, *mechanism.groups[1:])) for way in ways]
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
    """A range of a mechanism whose crank turns the other way."""
    return CrankRange(-found.stop, -found.start, found.at_stop, found.at_start)


def _one_way(mechanism: Mechanism, cycle_turns: int) -> list[CrankRange]:
    """Ranges of a prepared mechanism from zero up, as far as these turns; what is cut off there has no reason."""
    whole = 2 * math.pi * cycle_turns
    found = crossings(mechanism, np.append(_scan(mechanism, cycle_turns), whole), False)
    ends = [(0.0, None), *sorted(found), (whole, None)]
    angles = np.asarray([angle for angle, _ in ends])
    closes = _between(mechanism, angles)
    for path in _paths(mechanism):
        if bool(path.ends()):  # beyond it is taken from the way down
            closes &= angles[:-1] + angles[1:] < 2 * float(path.middle())
    return _runs(mechanism, ends, closes)


def _scan(mechanism: Mechanism, cycle_turns: int, ahead: float = 0.0) -> np.ndarray:
    """Angles from zero up at which the margins are looked at, so much `ahead` of the crank: equal steps, and between
    where general groups end."""
    gaps = np.asarray([float(path.middle()) for path in _paths(mechanism) if bool(path.ends())])
    return np.unique(
        np.concatenate([np.asarray(scan_angles(cycle_turns, SCAN)), np.mod(gaps + ahead, 2 * math.pi * cycle_turns)])
    )


def _paths(mechanism: Mechanism) -> list[Track]:
    """The paths of general groups."""
    return [g.path for g in mechanism.groups if isinstance(g, General) and g.path is not None]


def _between(mechanism: Mechanism, angles: np.ndarray) -> np.ndarray:
    """Whether it can be assembled from each of these angles to the next."""
    closes, wide = sound(mechanism, 0.5 * (angles[:-1] + angles[1:])), np.diff(angles) > NARROW
    known = np.flatnonzero(wide)
    next_one = np.searchsorted(known, np.arange(len(closes)))
    around = closes[known[next_one % len(known)]] & closes[known[next_one - 1]]  # of what is narrower than counts
    return np.where(wide, closes, around)


def _runs(mechanism: Mechanism, ends: Sequence[tuple[float, int | None]], closes: np.ndarray) -> list[CrankRange]:
    """The ranges between these angles, at which the margins of these numbers change their sign, where it can be
    assembled."""
    names = _margin_names(mechanism)
    owners = [number for number, group in enumerate(mechanism.groups) for _ in group.dead_positions()]
    ranges, first = [], 0
    for last in range(len(closes)):
        first = first if closes[last] else last + 1
        if closes[last] and not closes[last + 1 : last + 2].any():
            (start, lower), (stop, upper) = ends[first], ends[last + 1]
            inwards, told = 0.5 * (stop - start), []
            for end, margin, way in ((start, lower, inwards), (stop, upper, -inwards)):
                told.append(end if margin is None else _sharpened(mechanism, owners[margin], end, way))
            for end, margin in ((start, lower), (stop, upper)):  # what hangs on a group that is lost is so at once
                those = [k for angle, k in ends if k is not None and abs(angle - end) < TOGETHER]
                told.append("" if margin is None else names[min(those)])
            ranges.append(CrankRange(*told))
    return ranges


def _margin_names(mechanism: Mechanism) -> list[str]:
    """What the margins are of, in their order."""
    groups = named_groups(mechanism).items()
    return [f"{name}, {side}" for name, group in groups for side in group.dead_positions()]


def _in_order(ranges: Sequence[CrankRange]) -> tuple[CrankRange, ...]:
    """First that which holds zero, then those above it, then those below."""
    return tuple(sorted(ranges, key=lambda r: (not r.start <= 0.0 <= r.stop, r.stop < 0.0, r.start)))


def _sharpened(mechanism: Mechanism, owner: int, end: float, inwards: float) -> float:
    """An end of a range sharpened where a general group makes it; the middle of the range lies so far `inwards`."""
    if not isinstance(mechanism.groups[owner], General):
        return end
    inside = end + math.copysign(min(CLOSE, abs(inwards)), inwards)
    return folded(mechanism, owner, inside, end, min(STEP, abs(inwards)))
