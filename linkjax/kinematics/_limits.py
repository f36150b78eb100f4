"""Crank ranges that end: where a linkage whose crank does not come round can be assembled."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np

from linkjax.groups import Crank, General, Track
from linkjax.kinematics._cycle import scan_angles, stacked
from linkjax.kinematics._fold import folded
from linkjax.kinematics._pose import named_groups, prepared
from linkjax.mechanism import Mechanism

SCAN = 360  # crank angles a turn at which the margins are first looked at
HALVINGS = 50  # of a scan step: down to rounding
CLOSE = 1e-5  # rad: how far inside a range a general group is taken to find its fold from
STEP = 0.02  # rad: how far inside its range a fold may be found
LONGEST = 8  # turns that a range may take
SLOW = 64  # the same of machines with wheels that do not repeat
AGAIN = 1e-4  # rad: ends of ranges that repeat after these turns
SAME = 1e-9  # margins, and their slopes, after turns that all repeats after
LEFT_OUT = 0.06  # rad: more than a reference path leaves out of a range that is longer
BESIDE = 1e-11  # rad: beside an end
NARROW = 1e-9  # rad: what is no range, and no gap
TOUCH = -4e-16  # a margin that comes down to this touches zero in a change point, and ends nothing
BATCH = 16  # ends that are sharpened together


class CrankRange(NamedTuple):
    """Crank angles (rad) from `start` to `stop`, growing, between which a mechanism can be assembled all the way; what
    ends it there, e.g. "coupler-rocker, stretched", and "" where nothing does: the crank comes round, or swings, with
    wheels that repeat nothing, and can go on for as many turns as were looked at."""

    start: float
    stop: float
    at_start: str
    at_stop: str


def crank_limits(mechanism: Mechanism, turns: int = 1) -> tuple[CrankRange, ...]:
    """The ranges of crank angle in which a mechanism can be assembled, from the one that holds crank angle zero, or
    where a law begins, or comes next, on; one from 0 to 2π `turns` for a crank that comes round, none for a linkage
    that closes nowhere. `turns` of the crank are looked at: as many as the machine's cycle has (more than one where
    gears turn other links less often), for what lies beyond is taken to repeat them where it can.

    Angles are those a crank without a law turns by, so that a law inside a range (`Harmonic(start, stop)`) can be
    driven; of other drivers they are the phase of their law. Ends are where a margin is zero, sharpened to rounding:
    for groups closed in closed form some 1e-15 rad over the margin's slope, 1e-8 for dyads that continue through change
    points. Of a general group there is one range, in which it can be followed up and down from there, through up to
    eight turns; its ends are folds of its closure, to rounding too where two assemblies meet there (else up to 1e-5 rad
    off). Where wheels turn so that nothing repeats after `turns`, as they may on a crank with a law, it is looked at
    for as many turns either way as its range takes, up to 32, and ranges within `turns` either way are told where they
    are. A gap in which less than 4e-10 of its size stays open, some 1e-4 rad wide, is none. Ranges of other groups
    narrower than a thousandth of a turn may be overlooked. Whether all is after a turn where it began is another
    question. Not for use under jax transformations: plain numbers come out.
    Source: Grashof's rule, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 2, says which cranks turn.
    """
    crank, law, begin = mechanism.groups[0], mechanism.driver.follows(), 0.0
    if isinstance(crank, Crank) and law is not None:
        begin = law.begins()  # sketches are drawn there
        crank = dataclasses.replace(crank, law=None, phase=crank.phase + begin)
    elif law is not None:
        turns = max(turns, round(law.period() / (2 * math.pi)))
    mechanism = dataclasses.replace(mechanism, groups=(crank, *mechanism.groups[1:]))  # anew, without paths
    whole, ready = 2 * math.pi * turns, prepared(mechanism, turns)
    slow = any(group.wheels() for group in mechanism.groups) and not _repeats(ready, turns)
    if slow:
        turns *= 2
        ready = prepared(mechanism, turns)
    found = first = _ranges(ready, turns, slow)
    while found and (_goes_on(ready, turns, found[0]) or (slow and 2 * turns <= SLOW and _far(ready, turns, found[0]))):
        turns *= 2
        ready = prepared(mechanism, turns)
        found = _ranges(ready, turns, slow)
    found = found or first
    if found and not (found[0].at_start or found[0].at_stop) and not (slow and _far(ready, turns, found[0])):
        return (CrankRange(0.0, whole, "", ""),)
    near = [each for each in found if each.start < whole and each.stop > -whole] or list(found[:1] if slow else ())
    once = [each for i, each in enumerate(near) if not any(_again(each, other, whole) for other in near[:i])]
    return tuple(each._replace(start=each.start + begin, stop=each.stop + begin) for each in once)


def _again(one: CrankRange, other: CrankRange, whole: float) -> bool:
    """Whether one range is another, these turns on or back."""
    return all(abs(abs(a - b) - whole) < AGAIN for a, b in zip(one[:2], other[:2], strict=True))


def _repeats(mechanism: Mechanism, turns: int) -> bool:
    """Whether all is seen to be after so many turns what it was; of a general group that is lost nothing is."""
    value, slope = _at(mechanism, np.asarray([-math.pi * turns, math.pi * turns]))
    general = [isinstance(group, General) for group in mechanism.groups for _ in group.dead_positions()]
    seen = np.all(value[:, general] > 0)
    return bool(seen and np.allclose(*value, rtol=0.0, atol=SAME) and np.allclose(*slope, rtol=0.0, atol=SAME))


def _far(mechanism: Mechanism, turns: int, found: CrankRange) -> bool:
    """Whether a range goes on beyond the turns that were looked at, half of them either way, and nothing repeats."""
    if found.at_start or found.at_stop:
        return not (found.at_start and found.at_stop)
    return not _repeats(mechanism, turns)


def _goes_on(mechanism: Mechanism, turns: int, found: CrankRange) -> bool:
    """Whether a range may be longer than these turns, or that of one of its groups, which then is elsewhere in it."""
    groups = [group for group in mechanism.groups if isinstance(group, General) and 2 * turns <= LONGEST]
    ends = [end for end, why in ((found.start, found.at_start), (found.stop, found.at_stop)) if why]
    for group, path in ((group, group.path) for group in groups):
        assert path is not None
        if path.trouble() == "astray" and (not ends or bool(path.astray(group.loose()))):
            return True
        if bool(path.ends()):  # what is left out of a longer one is narrow
            seam = float(path.middle())
            if any(abs(math.remainder(end - seam, 2 * math.pi * turns)) < LEFT_OUT for end in ends):
                return True
    return False


def _ranges(mechanism: Mechanism, turns: int, slow: bool) -> tuple[CrankRange, ...]:
    """The same of a prepared mechanism whose crank has no law, or whose turns its law takes. It is looked at as far up
    as down from zero: what repeats after these turns is the same there, and of a `slow` machine, where nothing does,
    ranges are left where they are, and end where they are looked at no further."""
    half, whole = math.pi * turns, 2 * math.pi * turns
    names = {
        (number, side): f"{group}, {side}"
        for number, (group, g) in enumerate(named_groups(mechanism).items())
        for side in g.dead_positions()
    }
    round_it = (CrankRange(-half, half, "", ""),)
    if not names:
        return round_it
    gaps = np.asarray([float(path.middle()) for path in _followed(mechanism) if bool(path.ends())])
    scan = np.unique(np.concatenate([np.asarray(scan_angles(turns, SCAN)), np.mod(gaps + half, whole)]) - half)
    found = [(angle, list(names)[k]) for angle, k in sorted(_crossings(mechanism, scan, whole))]
    if not found:
        return round_it if bool(_sound(mechanism, np.zeros(1))[0]) else ()
    ends = [(-half, None), *found, (half, None)] if slow else [*found, (found[0][0] + whole, found[0][1])]
    sound = _between(mechanism, ends)
    if np.all(sound):
        return round_it
    if not slow:  # on from where it cannot be assembled
        on = int(np.argmin(sound)) + 1
        ends = [*found[on:], *((angle + whole, why) for angle, why in found[:on])]
        sound = np.roll(sound, -on)[:-1]
    ranges, first = [], 0
    for last in range(len(sound)):
        first = first if sound[last] else last + 1
        if sound[last] and not sound[last + 1 : last + 2].any():
            (start, lower), (stop, upper) = ends[first], ends[last + 1]
            start, stop = (
                _sharpened(mechanism, why, end, 0.5 * (other - end))
                for end, why, other in ((start, lower, stop), (stop, upper, start))
            )
            shift = 0.0 if slow else -whole if stop >= whole else whole if stop < 0 else 0.0
            why = (names[which] if which is not None else "" for which in (lower, upper))
            ranges.append(CrankRange(start + shift, stop + shift, *why))
    return tuple(sorted(ranges, key=lambda r: (not r.start <= 0.0 <= r.stop, r.stop < 0.0, r.start)))


def _between(mechanism: Mechanism, ends: Sequence[tuple[float, object]]) -> np.ndarray:
    """Whether it can be assembled from each of these angles to the next."""
    angles = np.asarray([angle for angle, _ in ends])
    sound, wide = _sound(mechanism, 0.5 * (angles[:-1] + angles[1:])), np.diff(angles) > NARROW
    beside = np.pad(sound & wide, 1, mode="wrap")
    return np.where(wide, sound, beside[:-2] & beside[2:])


def _followed(mechanism: Mechanism) -> list[Track]:
    """The paths of general groups."""
    return [g.path for g in mechanism.groups if isinstance(g, General) and g.path is not None]


def _sharpened(mechanism: Mechanism, why: tuple[int, str] | None, end: float, inwards: float) -> float:
    """An end of a range sharpened where a general group makes it; the middle of the range lies so far `inwards`."""
    if why is None or not isinstance(mechanism.groups[why[0]], General):
        return end
    inside = end + math.copysign(min(CLOSE, abs(inwards)), inwards)
    return folded(mechanism, why[0], inside, end, min(STEP, abs(inwards)))


@eqx.filter_jit
def _margins(mechanism: Mechanism, phi):
    """All margins and their slopes, each of shape (angles, margins)."""
    here = jax.vmap(lambda one: stacked(mechanism, one))(phi)
    return here.value, here.d


def _at(mechanism: Mechanism, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same at any number of angles, in batches of one size."""
    rows = []
    for i in range(0, len(phi), BATCH):
        part = phi[i : i + BATCH]
        value, slope = _margins(mechanism, np.pad(part, (0, BATCH - len(part)), mode="edge"))
        rows.append((np.asarray(value)[: len(part)], np.asarray(slope)[: len(part)]))
    return np.concatenate([v for v, _ in rows]), np.concatenate([d for _, d in rows])


def _sound(mechanism: Mechanism, phi: np.ndarray) -> np.ndarray:
    """Whether it can be assembled at these angles."""
    return np.all(_at(mechanism, phi)[0] > TOUCH, axis=1)


def _crossings(mechanism: Mechanism, scan: np.ndarray, whole: float) -> list[tuple[float, int]]:
    """Angles at which a margin changes its sign, with the number of the margin."""
    scan = np.append(scan, scan[0] + whole)
    value, slope = (np.asarray(part) for part in _margins(mechanism, scan))
    found, known = _changes(mechanism, scan, value, slope), 0
    for _ in range(sum(bool(group.dead_positions()) for group in mechanism.groups) - 1):
        if len(found) == known:
            break
        # what hangs on a group that is lost there may be lost a little before, and is not known beyond
        known = len(found)
        beside = np.asarray([angle + side for angle, _ in found for side in (-BESIDE, BESIDE)])
        beside = beside[(beside > scan[0]) & (beside < scan[-1])]
        more, order = _at(mechanism, beside), np.argsort(np.append(scan, beside))
        value, slope = (np.append(old, new, axis=0)[order] for old, new in zip((value, slope), more, strict=True))
        scan = np.append(scan, beside)[order]
        found = _changes(mechanism, scan, value, slope)
    return found


def _changes(mechanism: Mechanism, scan: np.ndarray, value: np.ndarray, slope: np.ndarray) -> list[tuple[float, int]]:
    """The same between angles at which margins and their slopes are known."""
    rows, cells = [], []
    above, after = value[:-1] > TOUCH, value[1:] > TOUCH
    down, dips = slope[:-1] < 0, slope[:-1] * slope[1:] < 0
    for i, k in np.argwhere(dips & (above == after) & (above == down)):  # it may dip to the other side
        rows.append((scan[i], scan[i + 1], k, above[i, k]))
    if rows:
        at, to, columns, kept = (np.asarray(part) for part in zip(*rows, strict=True))
        bottom = _halved(mechanism, at, to, columns, 1, ~kept)
        beyond = (_at(mechanism, bottom)[0][np.arange(len(at)), columns] > TOUCH) != kept
        for a, b, c, k, one in zip(*(part[beyond] for part in (at, bottom, to, columns, kept)), strict=True):
            cells += [(a, b, k, one), (b, c, k, ~one)]
    cells += [(scan[i], scan[i + 1], k, above[i, k]) for i, k in np.argwhere(above != after)]
    if not cells:
        return []
    low, high, columns, begun = (np.asarray(part) for part in zip(*cells, strict=True))
    ends = _halved(mechanism, low, high, columns, 0, begun)
    return [(float(a), int(k)) for a, k in zip(ends, columns, strict=True)]


def _halved(
    mechanism: Mechanism, low: np.ndarray, high: np.ndarray, columns: np.ndarray, which: int, first: np.ndarray
) -> np.ndarray:
    """Where margins (`which` 0) or their slopes (1) change their sign between two angles, by halving; whether they are
    positive at the `first` of them."""
    rows = np.arange(len(low))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = (_at(mechanism, middle)[which][rows, columns] > 0) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return 0.5 * (low + high)
