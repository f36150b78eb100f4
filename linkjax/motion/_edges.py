"""Edges of the panels of a cycle: breakpoints, and spare edges where panels are most difficult."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from linkjax._numerics import highest, nearest_turn, once, taken, wrapped
from linkjax.loads import Window

ONE = 1e-13  # of the cycle: breakpoints so close are one
SAME = 1e-7  # rad: closer breakpoints are merged; a kink with this error of position costs (1e-7)^2
KINK = 1e-6  # rad: a reversal with a closer singularity is a kink, smooth on either side
REACH = 0.35  # rad: singularities farther than this from the real axis need no breakpoint
EXTRA = 8  # panels per crank turn near singularities beside the real axis
NEAREST = 0.03  # rad: closer ones count as so far away, otherwise one of them would take all of these
ROUNDED = 256  # roundings of a cycle: panels as narrow as this have no width
UNROLLED = 12  # the most panels that are halved without a loop


class Candidates(NamedTuple):
    """Places with the distance of their singularity from the real axis (0: a kink; inf: no breakpoint)."""

    angle: Array
    distance: Array


class Kinks(NamedTuple):
    """Crank angles at which panels end because of the motion itself (rad), infinite where there are fewer; and
    singularities beside the real axis, near which panels are halved once more."""

    ends: Array
    beside: Candidates


def has_width(half: Array, cycle: float) -> Array:
    """Whether panels of these half widths (rad) have a width. The nodes of one without are a single place, where
    several breakpoints meet, and signs of what reverses there are rounding errors."""
    return half > ROUNDED * jnp.finfo(half.dtype).eps * cycle


def together(one: Candidates, two: Candidates) -> Candidates:
    """All breakpoints."""
    return Candidates(*(jnp.concatenate(pair) for pair in zip(one, two, strict=True)))


def nearest(found: Candidates, most: int) -> tuple[Candidates, Array]:
    """The breakpoints nearest to the real axis, and whether others, on it, are not taken."""
    order = jnp.argsort(jax.lax.stop_gradient(found.distance))[:most]
    return Candidates(*(taken(part, order) for part in found)), jnp.sum(found.distance <= KINK) > most


def extra(beside: Candidates | None, cycle: float) -> int:
    """How many panels are for singularities beside the real axis."""
    return 0 if beside is None or not beside.angle.size else EXTRA * round(cycle / (2 * np.pi))


def pick(mask: Array, values: Array) -> Array:
    """The largest masked value along the last axis; a maximum is much cheaper than a gather on a CPU."""
    return jnp.max(jnp.where(mask, values, -jnp.inf), axis=-1)


def edges_of(
    fixed: list[Array], kinks: Candidates, beside: Candidates | None, panels: int, cycle: float, rolled: bool, sure: int
) -> Array:  # fmt: skip
    """Edges of so many panels (rad), sorted, from `fixed` breakpoints and kinks. Of breakpoints closer than `SAME` the
    first is kept; each spare edge halves the panel that is widest relative to its distance from a singularity, in a
    loop if `rolled`. The last `EXTRA` per turn also know the singularities `beside` the axis: before, these would take
    all of them. Fixed breakpoints may be infinite, that is unused, except `sure` of them."""
    angle = kinks.angle
    given = jnp.stack(fixed) if fixed else jnp.zeros(0)
    far = kinks.distance > REACH
    twin = jnp.abs(nearest_turn(angle[:, None] - angle[None], cycle)) < SAME
    twin &= jnp.asarray(np.tri(angle.size, k=-1, dtype=bool)) & ~far[None]
    gone = (
        far | jnp.any(twin, axis=1) | jnp.any(jnp.abs(nearest_turn(angle[:, None] - given[None], cycle)) < SAME, axis=1)
    )
    spare = jnp.full(panels - given.size - angle.size, jnp.inf)
    edges = _sorted(jnp.concatenate([given, jnp.where(gone, jnp.inf, angle), spare]))
    start = jnp.where(jnp.isfinite(edges[0]), edges[0], 0.0)
    edges = jnp.where(jnp.isfinite(edges), edges, start + cycle)
    edges = jnp.concatenate([edges.at[0].set(start), (start + cycle)[None]])
    kept = extra(beside, cycle)
    rounds = panels - max(1, sure) - kept
    split = _Split(jax.lax.stop_gradient(edges), jnp.arange(edges.size), _hardness(edges[:-1], edges[1:], kinks, cycle))
    if rounds <= UNROLLED and not rolled:
        for _ in range(rounds):
            split = _halved(split, kinks, cycle, kept)
    else:
        split = jax.lax.fori_loop(0, rounds, lambda _, split: _halved(split, kinks, cycle, kept), split)
    if kept and beside is not None:
        every = together(kinks, beside._replace(distance=jnp.maximum(beside.distance, NEAREST)))
        split = split._replace(hard=_hardness(split.edges[:-1], split.edges[1:], every, cycle))
        split = jax.lax.fori_loop(0, kept, lambda _, split: _halved(split, every, cycle), split)
    return once(jnp.where(split.origin < 0, split.edges, taken(edges, jnp.maximum(split.origin, 0))))


class _Split(NamedTuple):
    """Edges while panels are halved: the number that each had before, minus one for a new one; and the width of every
    panel relative to its distance from a singularity, squared."""

    edges: Array
    origin: Array
    hard: Array


def _hardness(low: Array, high: Array, kinks: Candidates, cycle: float) -> Array:
    """Squared width of panels relative to their distance from a singularity. On either side of a kink the function is
    smooth."""
    low, high, kinks = jax.lax.stop_gradient((low, high, kinks))
    width = high - low
    near = jnp.where(kinks.distance > KINK, kinks.distance, 1.0)
    off = nearest_turn(kinks.angle[None] - 0.5 * (low + high)[:, None], cycle)
    away = jnp.maximum(jnp.abs(off) - 0.5 * width[:, None], 0.0)
    squared = jnp.min(away * away + (near * near)[None], axis=1, initial=1.0)
    return width * width / squared


def _halved(split: _Split, kinks: Candidates, cycle: float, kept: int = 0) -> _Split:
    """Use one spare edge, an empty panel at the end, to halve the hardest panel, unless only those `kept` are left."""
    edges, origin, hard = split
    number = jnp.arange(edges.size)
    panel = jnp.max(jnp.where(highest(hard), number[:-1], 0))
    low, high = (pick(number[:-1] == panel, ends) for ends in (edges[:-1], edges[1:]))
    cut = 0.5 * (low + high)
    halves = _hardness(jnp.stack([low, cut]), jnp.stack([cut, high]), kinks, cycle)

    def inserted(values, here):
        later = jnp.concatenate([values[:1], values[:-1]])
        at = number[: values.size]
        return jnp.where(at <= panel, values, jnp.where(at == panel + 1, here, later))

    new = inserted(hard, halves[1])
    new = jnp.where(number[:-1] == panel, halves[0], new)
    free = edges[-2 - kept] >= edges[-1]
    made = _Split(inserted(edges, cut), inserted(origin, -1), new)
    return jax.tree.map(lambda one, two: jnp.where(free, one, two), made, split)


def _sorted(values: Array) -> Array:
    """Values in order; a few by counting, because a sort is slow on a CPU."""
    if values.size > 4 * UNROLLED:
        return jnp.sort(values)
    number = jnp.arange(values.size)
    before = (values[None] < values[:, None]) | ((values[None] == values[:, None]) & (number[None] < number[:, None]))
    place = jnp.sum(before, axis=1)
    return jnp.max(jnp.where(place[None] == number[:, None], values[None], -jnp.inf), axis=1)


def wrapped_kinks(kinks: Array, cycle: float) -> list[Array]:
    """Crank angles within the cycle; infinite ones stay."""
    finite = jnp.isfinite(kinks)
    return list(jnp.where(finite, wrapped(jnp.where(finite, kinks, 0.0), cycle), jnp.inf))


def not_there(angles: tuple[float, ...], fixed: list[Array], cycle: float) -> list[Array]:
    """Crank angles (rad) within the cycle, infinite where a breakpoint is already."""
    found = [wrapped(jnp.asarray(angle), cycle) for angle in angles]
    if not fixed:
        return found
    there = jnp.stack(fixed)
    gaps = [jnp.abs(nearest_turn(jnp.where(jnp.isfinite(there), there, angle + 1.0) - angle, cycle)) for angle in found]
    return [jnp.where(jnp.min(gap) < ONE * cycle, jnp.inf, angle) for angle, gap in zip(found, gaps, strict=True)]


def switched(edges: Array, ends: list[Array]) -> Int[Array, " ends"]:
    """The edge number of every window end; ends at one angle get consecutive edges."""
    if not ends:
        return jnp.zeros((0,), jnp.int32)
    found, number = jnp.stack(ends), jnp.arange(len(ends))
    before = jnp.sum(edges[None] < found[:, None], axis=1)
    twins = jnp.sum((found[None] == found[:, None]) & (number[None] < number[:, None]), axis=1)
    return (before + twins).astype(jnp.int32)


def window_ends(windows: tuple[Window | None, ...], cycle: float) -> tuple[list[Array], int]:
    """The ends of all ranges of crank angle (rad), infinite for a range that is not used, and how many are finite in
    any case."""
    found, sure = [], 0
    for window in windows:
        for one in () if window is None else window.ranges:
            ends = [wrapped(end, cycle) for end in (one.on, one.off)]
            if window is one:
                sure += 2
            else:
                ends = [jnp.where(one.on == one.off, jnp.inf, end) for end in ends]
            found += ends
    return found, sure
