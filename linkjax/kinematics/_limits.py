"""Crank ranges that end: where a linkage whose crank does not come round can be assembled."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
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
LEFT_OUT = 0.06  # rad: more than a reference path leaves out of a range that is longer
BATCH = 16  # ends that are sharpened together


class CrankRange(NamedTuple):
    """Crank angles (rad) from `start` to `stop`, growing, between which a mechanism can be assembled all the way; what
    ends it there, e.g. "coupler-rocker, stretched", and "" where the crank comes round and nothing does."""

    start: float
    stop: float
    at_start: str
    at_stop: str


def crank_limits(mechanism: Mechanism, turns: int = 1) -> tuple[CrankRange, ...]:
    """The ranges of crank angle in which a mechanism can be assembled, from the one that holds crank angle zero, or
    where a law begins, or comes next, on; one from 0 to 2π `turns` for a crank that comes round, none for a linkage
    that closes nowhere. `turns` of the crank are looked at: as many as the machine's cycle has (more than one where
    gears turn other links less often), for what lies beyond is taken to repeat them.

    Angles are those a crank without a law turns by, so that a law inside a range (`Harmonic(start, stop)`) can be
    driven; of other drivers they are the phase of their law. Ends are where a margin is zero, sharpened to rounding:
    for groups closed in closed form some 1e-15 rad over the margin's slope, 1e-8 for dyads that continue through change
    points. Of a general group there is one range, in which it can be followed up and down from there, through up to
    eight turns; its ends are folds of its closure, to rounding too where two assemblies meet there (else up to 1e-5 rad
    off). A gap in which less than 4e-10 of its size stays open, some 1e-4 rad wide, is none. Ranges of other groups
    narrower than a thousandth of a turn may be overlooked. Whether all is after a turn where it began is another
    question. Not for use under jax transformations: plain numbers come out.
    Source: Grashof's rule, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 2, says which cranks turn.
    """
    crank, begin = mechanism.groups[0], 0.0
    law = mechanism.driver.follows()
    if isinstance(crank, Crank) and law is not None:
        begin = float(law.at(jnp.zeros(()))[0])  # sketches are drawn there
        crank = dataclasses.replace(crank, law=None, phase=crank.phase + begin)
    elif law is not None:
        turns = max(turns, round(law.period() / (2 * math.pi)))
    mechanism = dataclasses.replace(mechanism, groups=(crank, *mechanism.groups[1:]))  # anew, without paths
    asked = 2 * math.pi * turns
    found = first = _ranges(mechanism, turns)
    while turns <= LONGEST // 2 and found and _goes_on(mechanism, turns, found[0]):
        turns *= 2
        found = _ranges(mechanism, turns)
    found = [each for each in found if each.start < asked] if found and found[0].at_start else first
    return tuple(r._replace(start=r.start + begin, stop=r.stop + begin) if r.at_start else r for r in found)


def _goes_on(mechanism: Mechanism, turns: int, found: CrankRange) -> bool:
    """Whether a range may be longer than these turns, or that of one of its groups, which then is elsewhere in it."""
    groups = [group for group in prepared(mechanism, turns).groups if isinstance(group, General)]
    ends = found[:2] if found.at_start else ()
    for group, path in ((group, group.path) for group in groups):
        assert path is not None
        if path.trouble() == "astray" and (not ends or bool(path.astray(group.loose()))):
            return True
        if bool(path.ends()):  # what is left out of a longer one is narrow
            seam = float(path.middle())
            if any(abs(math.remainder(end - seam, 2 * math.pi * turns)) < LEFT_OUT for end in ends):
                return True
    return False


def _ranges(mechanism: Mechanism, turns: int) -> tuple[CrankRange, ...]:
    """The same of a mechanism whose crank has no law, or whose turns its law takes."""
    whole = 2 * math.pi * turns
    owners = [number for number, g in enumerate(mechanism.groups) for _ in g.dead_positions()]
    names = [f"{group}, {side}" for group, g in named_groups(mechanism).items() for side in g.dead_positions()]
    if not names:
        return (CrankRange(0.0, whole, "", ""),)
    mechanism = prepared(mechanism, turns)
    gaps = [float(path.middle()) for path in _followed(mechanism) if bool(path.ends())]
    scan = np.unique(np.concatenate([np.asarray(scan_angles(turns, SCAN)), np.mod(gaps, whole)]))
    found = sorted(_crossings(mechanism, scan, whole))
    if not found:
        return (CrankRange(0.0, whole, "", ""),) if bool(_sound(mechanism, np.zeros(1))[0]) else ()
    ends = np.asarray([angle for angle, _ in found])
    after = np.append(ends[1:], ends[0] + whole)
    sound = _sound(mechanism, 0.5 * (ends + after)) & (after > ends)
    if np.all(sound):
        return (CrankRange(0.0, whole, "", ""),)
    ranges, count = [], len(ends)
    for first in range(count):
        if sound[first] and not sound[first - 1]:
            last = first
            while sound[(last + 1) % count]:
                last += 1
            start, stop = ends[first], after[last % count] + whole * (last // count)
            lower, upper = found[first][1], found[(last + 1) % count][1]
            half = 0.5 * (stop - start)
            start = _sharpened(mechanism, owners[lower], start, half)
            stop = _sharpened(mechanism, owners[upper], stop, -half)
            start, stop = (start, stop) if stop <= whole or stop - whole <= 0 else (start - whole, stop - whole)
            ranges.append(CrankRange(start, stop, names[lower], names[upper]))
    return tuple(sorted(ranges, key=lambda r: (not r.start <= 0.0 <= r.stop, r.start)))


def _followed(mechanism: Mechanism) -> list[Track]:
    """The paths of general groups."""
    return [g.path for g in mechanism.groups if isinstance(g, General) and g.path is not None]


def _sharpened(mechanism: Mechanism, owner: int, end: float, inwards: float) -> float:
    """An end of a range sharpened where a general group makes it; the middle of the range lies so far `inwards`."""
    if not isinstance(mechanism.groups[owner], General):
        return float(end)
    inside = float(end) + math.copysign(min(CLOSE, abs(inwards)), inwards)
    return folded(mechanism, owner, inside, float(end), min(STEP, abs(inwards)))


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
    return np.all(_at(mechanism, phi)[0] > 0, axis=1)


def _crossings(mechanism: Mechanism, scan: np.ndarray, whole: float) -> list[tuple[float, int]]:
    """Angles at which a margin changes its sign, with the number of the margin."""
    value, slope = (np.asarray(part) for part in _margins(mechanism, scan))
    upto, rows, cells = np.append(scan[1:], scan[0] + whole), [], []
    above, after = value > 0, np.roll(value, -1, axis=0) > 0
    turn = slope * np.roll(slope, -1, axis=0) < 0
    for i, k in np.argwhere(turn & (above == after) & (above == (slope < 0))):  # it may dip to the other side
        rows.append((scan[i], upto[i], k))
    if rows:
        at, to, columns = (np.asarray(part) for part in zip(*rows, strict=True))
        bottom = _halved(mechanism, at, to, columns, 1)
        beyond = (_at(mechanism, bottom)[0][np.arange(len(at)), columns] > 0) != (
            _at(mechanism, at)[0][np.arange(len(at)), columns] > 0
        )
        for a, b, c, k in zip(at[beyond], bottom[beyond], to[beyond], columns[beyond], strict=True):
            cells += [(a, b, k), (b, c, k)]
    cells += [(scan[i], upto[i], k) for i, k in np.argwhere(above != after)]
    if not cells:
        return []
    low, high, columns = (np.asarray(part) for part in zip(*cells, strict=True))
    return [(float(a % whole), int(k)) for a, k in zip(_halved(mechanism, low, high, columns, 0), columns, strict=True)]


def _halved(mechanism: Mechanism, low: np.ndarray, high: np.ndarray, columns: np.ndarray, which: int) -> np.ndarray:
    """Where margins (`which` 0) or their slopes (1) change their sign between two angles, by halving."""
    rows = np.arange(len(low))
    first = _at(mechanism, low)[which][rows, columns] > 0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = (_at(mechanism, middle)[which][rows, columns] > 0) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return 0.5 * (low + high)
