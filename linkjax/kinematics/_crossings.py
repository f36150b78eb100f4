"""Crank angles at which margins of a mechanism change sign."""

from __future__ import annotations

import functools

import equinox as eqx
import jax
import numpy as np

from linkjax._search import positive, sign_changes
from linkjax.kinematics._cycle import stacked
from linkjax.kinematics._pose import Prepared

BESIDE = 1e-11  # rad: from an end to the additional scan points on both sides of it
BATCH = 16  # ends that are refined together


def sound(ready: Prepared, phi: np.ndarray) -> np.ndarray:
    """Whether the mechanism can be assembled at each of these angles (rad)."""
    return np.all(positive(margins_at(ready, phi)[0]), axis=1)


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
    at = functools.partial(margins_at, ready)
    found, known = sign_changes(at, scan, value, slope), 0
    for _ in range(sum(bool(group.singular_positions()) for group in ready.mechanism.groups) - 1):
        if len(found) == known:
            break
        # a group attached to one that fails there may fail slightly before, and its margin is unknown beyond
        known = len(found)
        beside = np.asarray([angle + side for angle, _ in found for side in (-BESIDE, BESIDE)])
        beside = beside[(beside > scan[0]) & (beside < scan[-1])]
        more, order = at(beside), np.argsort(np.append(scan, beside))
        value, slope = (np.append(old, new, axis=0)[order] for old, new in zip((value, slope), more, strict=True))
        scan = np.append(scan, beside)[order]
        found = sign_changes(at, scan, value, slope)
    return found


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
