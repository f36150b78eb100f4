"""Crank angles at which margins of a mechanism change sign."""

from __future__ import annotations

import equinox as eqx
import jax
import numpy as np

from linkjax.kinematics._cycle import stacked
from linkjax.kinematics._pose import Prepared

HALVINGS = 50  # bisections of a scan step, down to rounding
BESIDE = 1e-11  # rad: from an end to the additional scan points on both sides of it
TOUCH = 2.0  # units of rounding: a margin this little below zero only touches zero, at a change point
BATCH = 16  # ends that are refined together


def sound(ready: Prepared, phi: np.ndarray) -> np.ndarray:
    """Whether the mechanism can be assembled at each of these angles (rad)."""
    return np.all(_closes(margins_at(ready, phi)[0]), axis=1)


def _closes(value: np.ndarray) -> np.ndarray:
    """Whether margins of these values are positive, or only touch zero."""
    return value > -TOUCH * np.finfo(value.dtype).eps


def crossings(ready: Prepared, scan: np.ndarray, circle: bool) -> list[tuple[float, int]]:
    """Angles (rad) at which a margin changes sign between the scan angles, with the number of the margin. On a circle
    the last scan angle is the first one again.

    Near every end the margins are examined again: where a dyad folds, a group attached to it moves as the square root
    of the distance and may fail slightly earlier. (28 of 1500 random six-bars had ranges reported up to 0.7 degrees too
    long.)
    """
    value, slope = (np.array(part) for part in _margins(ready, scan))
    if circle:  # exactly equal: an end may be right there
        value[-1], slope[-1] = value[0], slope[0]
    found, known = _changes(ready, scan, value, slope), 0
    for _ in range(sum(bool(group.singular_positions()) for group in ready.mechanism.groups) - 1):
        if len(found) == known:
            break
        # a group attached to one that fails there may fail slightly before, and its margin is unknown beyond
        known = len(found)
        beside = np.asarray([angle + side for angle, _ in found for side in (-BESIDE, BESIDE)])
        beside = beside[(beside > scan[0]) & (beside < scan[-1])]
        more, order = margins_at(ready, beside), np.argsort(np.append(scan, beside))
        value, slope = (np.append(old, new, axis=0)[order] for old, new in zip((value, slope), more, strict=True))
        scan = np.append(scan, beside)[order]
        found = _changes(ready, scan, value, slope)
    return found


def _changes(ready: Prepared, scan: np.ndarray, value: np.ndarray, slope: np.ndarray) -> list[tuple[float, int]]:
    """The same between angles at which the margins and their slopes are given."""
    rows, cells = [], []
    above, after = _closes(value[:-1]), _closes(value[1:])
    down, dips = slope[:-1] < 0, slope[:-1] * slope[1:] < 0
    for i, k in np.argwhere(dips & (above == after) & (above == down)):  # it may change sign twice
        rows.append((scan[i], scan[i + 1], k, above[i, k]))
    if rows:
        at, to, columns, kept = (np.asarray(part) for part in zip(*rows, strict=True))
        bottom = _halved(ready, at, to, columns, 1, ~kept)
        beyond = _closes(margins_at(ready, bottom)[0][np.arange(len(at)), columns]) != kept
        for a, b, c, k, one in zip(*(part[beyond] for part in (at, bottom, to, columns, kept)), strict=True):
            cells += [(a, b, k, one), (b, c, k, ~one)]
    cells += [(scan[i], scan[i + 1], k, above[i, k]) for i, k in np.argwhere(above != after)]
    if not cells:
        return []
    low, high, columns, begun = (np.asarray(part) for part in zip(*cells, strict=True))
    ends = _halved(ready, low, high, columns, 0, begun)
    return [(float(a), int(k)) for a, k in zip(ends, columns, strict=True)]


@eqx.filter_jit
def _margins(ready: Prepared, phi):
    """All margins and their slopes, each of shape (angles, margins)."""
    here = jax.vmap(lambda one: stacked(ready, one))(phi)
    return here.value, here.d


def margins_at(ready: Prepared, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same at any number of angles, in batches of equal size."""
    rows = []
    for i in range(0, len(phi), BATCH):
        part = phi[i : i + BATCH]
        value, slope = _margins(ready, np.pad(part, (0, BATCH - len(part)), mode="edge"))
        rows.append((np.asarray(value)[: len(part)], np.asarray(slope)[: len(part)]))
    return np.concatenate([v for v, _ in rows]), np.concatenate([d for _, d in rows])


def _halved(
    ready: Prepared, low: np.ndarray, high: np.ndarray, columns: np.ndarray, which: int, first: np.ndarray
) -> np.ndarray:
    """Angles at which margins (`which` 0) or their slopes (1) change sign between two angles, by bisection. `first`
    says whether they are positive at the first angle."""
    rows = np.arange(len(low))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = (margins_at(ready, middle)[which][rows, columns] > 0) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return 0.5 * (low + high)
