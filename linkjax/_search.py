"""Roots and extremes over the cycle, of functions that are evaluated at many places at once.

A search begins on a scan of the cycle; its places are then refined in rounds. Each round takes the values at all places
of all searches and returns the next places, so that the function is evaluated in one batch a round.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from linkjax._numerics import safe_divide, safe_sqrt

# crank angles per turn at which each search looks first
GRID_SCAN = 32  # reversals that loads oppose, and singular positions, for the cycle grid
MARGIN_SCAN = 64  # least margins
MOTION_SCAN = 128  # dead centres; a multiple of the two above, so that one scan serves all three
BRANCH_SCAN = 120  # change points of a dyad
RANGE_SCAN = 360  # ends of crank ranges
TURN_SCAN = 480  # revolutions of a link

HALVINGS = 50  # bisections of a scan step, down to rounding
TOUCH = 2.0  # units of rounding: a function this little below zero only touches zero
REAL = 1e-6  # rad: largest distance of a true reversal from the real axis
BEND = 30.0  # 1/rad: the last Newton step squared, times this, bounds the error of a reversal
KINK = 10.0  # d² / (value dd): two at most near the minimum of a parabola; above this the value reaches zero


def scan_angles(cycle_turns: int, points: int) -> Float[np.ndarray, " scan"]:
    """Uniform crank angles (rad) over `cycle_turns` turns, `points` per turn, without the end."""
    return np.arange(points * cycle_turns, dtype=jnp.result_type(float)) * (2 * math.pi / points)


class Motion(NamedTuple):
    """Velocity and acceleration coefficients of a point or link, component by component."""

    v: tuple[Array, ...]
    a: tuple[Array, ...]


def stacked_motions(motions: list[Motion] | tuple[Motion, ...]) -> tuple[Array, Array]:
    """Velocities and accelerations of several motions at many places, each of shape (motions, 2, places)."""
    none = jnp.zeros_like(motions[0].v[0])
    both = ([jnp.stack([*part, none][:2]) for part in parts] for parts in zip(*motions, strict=True))
    v, a = (jnp.stack(part) for part in both)
    return v, a


class Reversals(NamedTuple):
    """Crank angles `angle` (rad) at which a motion reverses, in a fixed number of slots; unused ones are not `present`.

    `distance` (rad) is the distance from the real axis to the zero of the speed: zero for a true reversal, larger for a
    point that only slows down. `left` (rad) bounds the error of the angle, `rate` is the magnitude of the acceleration
    coefficient there, and `overflow` says that there are more reversals than slots.
    """

    angle: Float[Array, " slots"]
    distance: Float[Array, " slots"]
    present: Bool[Array, " slots"]
    left: Float[Array, " slots"]
    rate: Float[Array, " slots"]
    overflow: Bool[Array, ""]

    @property
    def true(self) -> Any:
        """Which slots hold a true reversal, not only a minimum of the speed."""
        return self.present & (self.distance < REAL)


class Found(NamedTuple):
    """First guesses of the reversals of several motions (rad), and how many each has."""

    angle: Float[Array, "motions slots"]
    number: Array


def scan_reversals(v: Array, a: Array, scan: Float[np.ndarray, " scan"], slots: int, wanted: Any = None) -> Found:
    """First guesses of reversals, from the scan cells in which the velocity changes direction; velocities and
    accelerations of shape (motions, 2, scan). `wanted(start)` filters by angle, shape (motions, starts)."""
    step = scan[1] - scan[0]
    a = a * step
    v1, a1 = jnp.roll(v, -1, axis=2), jnp.roll(a, -1, axis=2)
    single, x = _single_root(v, a, v1, a1)
    double, near, far = _double_root(v, a, v1, a1)
    start = jnp.concatenate([scan[None] + step * jnp.where(double, near, x), scan[None] + step * far], axis=1)
    mask = jnp.concatenate([single | double, double], axis=1)
    mask = mask if wanted is None else mask & wanted(start)
    place = jnp.cumsum(mask, axis=1)
    at = mask[:, None] & (place[:, None] == jnp.arange(1, slots + 1)[None, :, None])
    angle = jnp.sum(jnp.where(at, start[:, None], 0.0), axis=2)
    return Found(jax.lax.stop_gradient(angle), place[:, -1])


def refined(angle: Array, v: Array, a: Array, step: float, found: Found) -> Any:
    """Reversals after a Newton step from `angle`, where velocities and accelerations are `v` and `a`, shape
    (motions, 2, slots). The step carries the derivative of a reversal that moves with the design."""
    slope = jax.lax.stop_gradient(jnp.sum(a * a, axis=1))
    move = jnp.clip(safe_divide(jnp.sum(v * a, axis=1), slope), -step, step)
    rest = jax.lax.stop_gradient(v - a * move[:, None])
    distance = safe_sqrt(safe_divide(jnp.sum(rest * rest, axis=1), slope))
    moved, slots = jnp.abs(move), angle.shape[1]
    left = jax.lax.stop_gradient(jnp.minimum(moved, BEND * moved**2))
    present = found.number[:, None] >= jnp.arange(1, slots + 1)[None]
    return Reversals(angle - move, distance, present, left, safe_sqrt(slope), found.number > slots)


def own(values: Array, count: int) -> Array:
    """Of values of several functions, shape (functions, parts, places), those at the places of each function itself:
    its `count` places among them all, in the order of the functions."""
    functions, parts = values.shape[:2]
    blocks = values[..., : functions * count].reshape((functions, parts, functions, count))
    return blocks[:, :, 0] if functions == 1 else jnp.moveaxis(jnp.diagonal(blocks, axis1=0, axis2=2), -1, 0)


def _single_root(v0: Array, a0: Array, v1: Array, a1: Array) -> tuple[Array, Array]:
    """Cells in which the motion reverses once, and the place in them (0…1): a root of the cubic Hermite interpolant."""
    turn = v1 - v0
    along = turn * safe_divide(jnp.ones_like(turn[:, :1]), safe_sqrt(jnp.sum(turn * turn, axis=1, keepdims=True)))
    f0, f1, g0, g1 = (jnp.sum(part * along, axis=1) for part in (v0, v1, a0, a1))
    x = safe_divide(-f0, f1 - f0)
    c2, c3 = 3 * (f1 - f0) - 2 * g0 - g1, g0 + g1 - 2 * (f1 - f0)
    for _ in range(3):
        value, slope = f0 + x * (g0 + x * (c2 + x * c3)), g0 + x * (2 * c2 + 3 * x * c3)
        x = jnp.clip(x - safe_divide(value, slope), 0.0, 1.0)
    stopped = (jnp.sum(v0 * v0, axis=1) == 0) & (jnp.sum(a0 * a0, axis=1) > 0)  # a scan point at a reversal
    return (jnp.sum(v0 * v1, axis=1) < 0) | stopped, x


def _double_root(v0: Array, a0: Array, v1: Array, a1: Array) -> tuple[Array, Array, Array]:
    """Cells in which the motion reverses twice, and the two places: the Hermite interpolant falls below zero."""
    mean = v0 + v1
    along = mean * safe_divide(jnp.ones_like(mean[:, :1]), safe_sqrt(jnp.sum(mean * mean, axis=1, keepdims=True)))
    f0, f1, g0, g1 = (jnp.sum(part * along, axis=1) for part in (v0, v1, a0, a1))
    c2, c3 = 3 * (f1 - f0) - 2 * g0 - g1, g0 + g1 - 2 * (f1 - f0)
    x = safe_divide(-g0, g1 - g0)
    for _ in range(2):
        x = jnp.clip(x - safe_divide(g0 + x * (2 * c2 + 3 * x * c3), 2 * c2 + 6 * x * c3), 0.0, 1.0)
    least, bend = f0 + x * (g0 + x * (c2 + x * c3)), 2 * c2 + 6 * x * c3
    dips = (f0 > 0) & (f1 > 0) & (g0 < 0) & (g1 > 0) & (least < 0) & (bend > 0)
    reach = safe_sqrt(safe_divide(-2 * least, bend))
    return dips, jnp.clip(x - reach, 0.0, 1.0), jnp.clip(x + reach, 0.0, 1.0)


class Values(NamedTuple):
    """Values of functions with first and second derivatives, shape (functions, places)."""

    value: Array
    d: Array
    dd: Array


def scan_least(at: Values, scan: Float[np.ndarray, " scan"]) -> Array:
    """Where each function is least: the lowest point of the local parabolas at the scan points (rad)."""
    step = scan[1] - scan[0]
    move = jnp.clip(-at.d / jnp.maximum(at.dd, 1e-9), -step, step)
    predicted = at.value + move * (at.d + 0.5 * move * at.dd)
    best = jnp.argmin(jnp.minimum(predicted, at.value), axis=1, keepdims=True)
    return (jnp.asarray(scan)[best] + jnp.take_along_axis(move, best, axis=1))[:, 0]


def towards_least(phi: Array, at: Values, reaches_zero: Bool[np.ndarray, " functions"]) -> Array:
    """The next places of minima, by a Newton step each; values at one place of each function. Functions of which
    `reaches_zero` is true may have a kink at zero, where the step goes to the root."""
    bend = jnp.where(at.dd > 0, at.dd, jnp.abs(at.d) + 1.0)
    kink = reaches_zero & (at.d * at.d > KINK * at.value * jnp.maximum(at.dd, 0.0))
    return phi - jnp.where(kink & (at.value > 0), safe_divide(at.value, at.d), at.d / bend)


def scan_minima(slope: Array, scan: Array) -> tuple[Array, Array]:
    """Where periodic functions with these slopes at the scan angles, shape (scan, functions), have a minimum: which
    scan cells contain one, and a first guess in every cell (rad)."""
    ahead, step = jnp.roll(slope, -1, axis=0), scan[1] - scan[0]
    least = (slope <= 0) & (ahead > 0)
    return least, scan[:, None] + jnp.where(least, -slope / jnp.where(least, ahead - slope, 1.0), 0.0) * step


def to_minimum(phi: Array, d: Array, dd: Array, most: Any) -> Array:
    """Newton's next place of a minimum, at most so far away; unchanged where the function is not convex."""
    return phi - jnp.clip(jnp.where(dd > 0, d / jnp.where(dd > 0, dd, 1.0), 0.0), -most, most)


Batched = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # values and slopes, shape (places, functions)


def positive(value: np.ndarray) -> np.ndarray:
    """Whether values are positive, or only touch zero."""
    return value > -TOUCH * np.finfo(value.dtype).eps


def sign_changes(at: Batched, scan: np.ndarray, value: np.ndarray, slope: np.ndarray) -> list[tuple[float, int]]:
    """Where functions change sign between scan angles, at which their values and slopes are given: angles (rad), each
    with the number of the function. A function that dips between two scan angles is looked at in between."""
    rows, cells = [], []
    above, after = positive(value[:-1]), positive(value[1:])
    down, dips = slope[:-1] < 0, slope[:-1] * slope[1:] < 0
    for i, k in np.argwhere(dips & (above == after) & (above == down)):  # it may change sign twice
        rows.append((scan[i], scan[i + 1], k, above[i, k]))
    if rows:
        low, high, columns, kept = (np.asarray(part) for part in zip(*rows, strict=True))
        bottom = halved(at, low, high, columns, 1, ~kept)
        beyond = positive(at(bottom)[0][np.arange(len(low)), columns]) != kept
        for a, b, c, k, one in zip(*(part[beyond] for part in (low, bottom, high, columns, kept)), strict=True):
            cells += [(a, b, k, one), (b, c, k, ~one)]
    cells += [(scan[i], scan[i + 1], k, above[i, k]) for i, k in np.argwhere(above != after)]
    if not cells:
        return []
    low, high, columns, begun = (np.asarray(part) for part in zip(*cells, strict=True))
    ends = halved(at, low, high, columns, 0, begun)
    return [(float(a), int(k)) for a, k in zip(ends, columns, strict=True)]


def halved(
    at: Batched, low: np.ndarray, high: np.ndarray, columns: np.ndarray, which: int, first: np.ndarray
) -> np.ndarray:
    """Angles at which functions (`which` 0) or their slopes (1) change sign between two angles, by bisection. `first`
    says whether they are positive at the first angle."""
    rows = np.arange(len(low))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = (at(middle)[which][rows, columns] > 0) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return 0.5 * (low + high)
