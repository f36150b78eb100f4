"""Following a group of higher class along the crank angle, from its sketch on.

The path goes up from crank angle zero in steps of one degree, and down only where this fails. A gap may lie between
neighbouring points: one of 0.3 degrees was once missed, and the machine was analysed as if its crank rotated fully. So
steps adapt, and three points show whether a fold may be between two of them. The closure error may grow within a step,
because near a fold Newton's method first increases it; when this was refused, paths stopped up to 4e-4 rad before the
fold. A path ends where the points of attachment cannot be assembled: a group once left such a region in a different
assembly mode.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._lapack import pinv
from linkjax._numerics import safe_divide
from linkjax.groups import CountedTurns, Found, Gear, General, Meshing, ReferencePath, closed_to

ALONG = 5  # damped Newton steps per step along the path
GROW = 10.0  # factor by which the closure error may grow in one Newton step
AGAIN = 5  # further rounds of Newton steps where the smallest step does not close at once
SWING = 0.2  # rad, or relative to the size: largest motion of a link in one step
SMALLEST = 4096  # the smallest step is this fraction of a path step
FIRST = 8  # parts of the first path step: it has no earlier position to compare with
DIP = 0.25  # of the larger end value: if the squared determinant may fall below this in between, it may reach zero
FEW = 4  # places needed to interpolate the path


def path_of(
    group: General, links: Mapping[str, Any], before: Callable, angles: Array, turns: CountedTurns, cycle_turns: int
) -> ReferencePath:
    """The configurations of a group at these crank angles, which cover `cycle_turns` turns from zero. `turns` are those
    of the links that its gears follow.

    `before` returns the states of the links and points that precede the group at a crank angle, and whether they can be
    assembled there; where they cannot, the group does not close either. Angles that are not reached upwards from zero,
    because the group does not close before them, are reached downwards where possible.
    """
    states, points, began = before(angles[0])

    *found, whole = group.assembled(links, states, points, angles[0], turns)
    first, size, meshing = Found(*found), group.size(links, points), Meshing(turns, whole)
    shut = closed_to(angles.dtype)
    measure = jnp.ones_like(first.z).at[:, :2].set(size)
    if group.gears:  # free gears may turn at any speed: their position is unique
        measure = measure.at[group.loose(), 2].set(jnp.inf)

    def close(phi: Array, start: Array) -> Found:
        states, points, closes = before(phi)
        there = group.closed(links, states, points, phi, start, meshing, ALONG, GROW)
        return there._replace(gap=jnp.where((closes | ~began) & jnp.isfinite(there.gap), there.gap, 1.0))

    def along(done: Array, way: Array) -> tuple[Array, tuple[Found, Tip]]:
        def step(last: tuple[Found, Seen], ends: tuple[Array, Array]):
            now, tip, seen = _follow(close, measure, *last, jnp.where(done, ends[1], ends[0]), ends[1], way)
            return (now, seen), (now, tip)

        _, (rest, tips) = jax.lax.scan(step, (first, Seen(angles[0], first.sense)), (angles[:-1], angles[1:]))
        whole = jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), first, rest)
        lost = jnp.minimum(jnp.sum(jnp.cumprod(whole.gap < shut)), angles.size - 1) - 1
        return jnp.all(whole.gap < shut), (whole, jax.tree.map(lambda part: part[lost], tips))

    ways = jax.lax.scan(along, jnp.asarray(False), jnp.asarray([1.0, -1.0], dtype=angles.dtype))[1]
    (up, tip), (down, end) = (jax.tree.map(lambda part, k=k: part[k], ways) for k in (0, 1))
    if group.gears:
        down, end = (part._replace(z=part.z.at[..., 2].add(_gained(group, turns))) for part in (down, end))
    return _joined(up, down, tip, end, angles, size, meshing, cycle_turns)


def _joined(
    up: Found, down: Found, tip: Tip, end: Tip, angles: Array, size: Array, meshing: Meshing, cycle_turns: int
) -> ReferencePath:
    """One path from the ways up and down, with their ends. Where the ways overlap, the range is longer than the path:
    one step between them is omitted, because their configurations there are unrelated."""
    count, step, span = angles.size, angles[1], angles[-1]
    reached = [jnp.cumprod(way.gap < closed_to(angles.dtype)) > 0 for way in (up, down)]
    ahead, back = (jnp.sum(way) for way in reached)
    until, since = jnp.where(ahead > 0, tip.beyond, -1.0), span - jnp.where(back > 0, end.beyond, -1.0)
    since, ends = jnp.where(until < since, since, until + step), ahead < count
    other = ends & (angles > 0.5 * (until + since))  # closer to the way down
    sound = reached[0] & ~other, reached[1][::-1] & other & (angles > since)
    begin, place = count - jnp.sum(sound[1]), jnp.arange(count)
    few = jnp.where(ahead + jnp.sum(sound[1]) <= FEW, FEW, 0)  # beyond the end, repeated as not closed
    above, below = (place >= ahead) & (place < ahead + few), (place < begin) & (place >= begin - few)
    source = jnp.where(above, ahead - 1, jnp.where(below, begin, place))
    path = jax.tree.map(lambda a, b: jnp.where(other.reshape((-1, *[1] * (a.ndim - 1))), b[::-1], a)[source], up, down)
    lost = jnp.where(ends, jnp.stack([until, since]), jnp.stack([span, -span]))
    firsts = _firsts(sound[0] | sound[1] | above | below, other)
    return ReferencePath(
        z=path.z,
        sense=path.sense,
        gap=jnp.where(above | below, 1.0, path.gap).at[0].set(up.gap[0]),
        size=size,
        meshing=meshing,
        first=firsts.astype(path.gap.dtype),
        lost=lost,
        tips=jnp.stack([tip.z, end.z]),
        tips_at=jnp.stack([tip.at, -end.at]),
        cycle_turns=cycle_turns,
    )


def _gained(group: General, turns: CountedTurns) -> Array:
    """The rotation that links of a group with gears gain (rad, (links,)) where the crank rotates fully but the group
    does not. Gears with a single pin follow the gears in mesh with them. Of each other pair of gears, one link gains
    whole turns, preferably the gear. All other links gain none."""
    names, free = group.link_names(), group.spinning()
    covered = dict(zip(group.mates(), turns.covered(), strict=True))
    gears = [gear for gear in group.gears if isinstance(gear, Gear)]
    turned = jnp.zeros(len(names))
    if not gears:
        return turned
    held = [gear.coupling().angles for gear in gears]
    matrix = jnp.stack([jnp.stack([each.get(name, turned[0]) for name in names]) for each in held])
    push = -jnp.stack(
        [sum((each[name] * covered[name] for name in each if name in covered), turned[0]) for each in held]
    )
    tied: list[str] = []
    for gear in gears:
        those = [name for name in (gear.link, gear.to, gear.carrier) if name in names and name not in (*free, *tied)]
        tied += those[:1] if not free.intersection((gear.link, gear.to)) else []
    loose = np.asarray([bool(free.intersection((gear.link, gear.to))) for gear in gears])
    for rows, columns, whole in ((~loose, tied, True), (loose, [name for name in names if name in free], False)):
        if rows.any() and columns:
            at = np.asarray([names.index(name) for name in columns])
            found = pinv(matrix[rows][:, at]) @ (push - matrix @ turned)[rows]
            found = 2 * jnp.pi * jnp.round(found / (2 * jnp.pi)) if whole else found
            turned = turned.at[at].set(found)
    return turned


def _firsts(sound: Array, other: Array) -> Array:
    """The first of the four places nearest to either half of every step, all reached and on the same way. If both ways
    were taken, they join at crank angle zero, where the places continue from the last to the first."""
    steps = sound.size - 1
    ends = (other[1:] != other[:-1]) | (sound[1:] != sound[:-1])
    ends, sound = (
        jnp.concatenate([before[-3:], part, after[:3]])
        for before, part, after in ((ends, ends, ends), (sound[:-1], sound, sound[1:]))
    )
    stretch = jnp.concatenate([jnp.zeros(1, dtype=int), jnp.cumsum(ends.astype(int))])
    i, found = jnp.arange(steps), []
    for order in ((-1, 0, -2, -3, 1), (-1, -2, 0, 1, -3)):
        best = jnp.clip(i - 1, 0, steps - 3)
        for ahead in order[::-1]:
            first = i + ahead
            there = (first >= 0) & (first <= steps - 3) | jnp.any(other)
            whole = there & sound[first + 3] & (stretch[first + 3] == stretch[first + 6])
            best = jnp.where(whole, first, best)
        found.append(best)
    return jnp.stack(found)


class Seen(NamedTuple):
    """An earlier place on a way: the crank angle (rad) and the determinant of the Jacobian."""

    at: Array
    sense: Array

    def clear(self, here: Seen, there: Seen, order: int) -> Array:
        """Whether there is no fold, or near fold, between `here` and `there`. Close to one the square of the
        determinant is a parabola, which is determined by this place and the other two."""
        h0, h1 = here.at - self.at, there.at - here.at
        r, q = (jnp.abs(safe_divide(side.sense, here.sense, 1.0)) ** (2 * order) for side in (self, there))
        bend = safe_divide(safe_divide(q - 1, h1) - safe_divide(1 - r, h0), h0 + h1)
        slope = safe_divide(q - 1, h1) - bend * h1
        lowest = safe_divide(-slope, 2 * bend)
        dips = (bend > 0) & (lowest > -0.1 * h1) & (lowest < 1.1 * h1)
        return ~dips | (1 + 0.5 * slope * lowest > DIP * jnp.maximum(1.0, q))


class Tip(NamedTuple):
    """The end of a way: the last configuration that was followed, its crank angle (rad, counted along the way), and an
    angle just beyond the end."""

    z: Array
    at: Array
    beyond: Array


class _Going(NamedTuple):
    """The state between two places of the path.

    `here` and `seen` are the present and the previous place. `tip` is the last configuration that was followed, to the
    crank angle `far` (rad). Newton's method begins at `start`; the step has the `width` and the lower bound `least`
    (rad), and was repeated `tries` times. `at` (rad) is the angle reached, followed or not, `beyond` (rad) an angle
    just beyond the end, and `most` the largest closure error.
    """

    here: Found
    seen: Seen
    tip: Array
    far: Array
    start: Array
    width: Array
    least: Array
    tries: Array
    at: Array
    beyond: Array
    most: Array


def _follow(
    close: Callable[[Array, Array], Found],
    measure: Array,
    last: Found,
    seen: Seen,
    phi: Array,
    to: Array,
    way: Array,
) -> tuple[Found, Tip, Seen]:
    """Go from a configuration to the next crank angle, in as many steps as necessary; also return where the group was
    followed to, and the previous place.

    `close` gives the configuration at a crank angle that is near another one; motions are relative to `measure`, which
    has the shape of a configuration.

    Angles are counted along the `way`, 1 up or -1 down. A step is made smaller if it does not close, moves links far,
    changes the sign of the Jacobian's determinant, or may have crossed a fold. If the smallest step does not close, or
    moves links far, the path ends: one more step leads to the next crank angle, where the group is marked as not
    closed, even if it closes in another assembly mode.
    """
    dtype, smallest, shut = last.z.dtype, (to - phi) / SMALLEST, closed_to(last.z.dtype)

    def step(going: _Going) -> _Going:
        new, gone = jnp.minimum(going.at + going.width, to), going.most >= shut
        there = close(way * new, going.start)
        calm, closes = jnp.max(jnp.abs(there.z - going.here.z) / measure) < SWING, there.gap < shut
        again = ~closes & (going.tries < AGAIN)
        clear = going.seen.clear(Seen(going.at, going.here.sense), Seen(new, there.sense), 3 * len(last.z))
        clear = jnp.where(going.at > going.seen.at, clear, going.width <= (to - phi) / FIRST)
        small, good = going.width <= going.least, closes & calm & clear & (there.sense * going.here.sense > 0)
        taken = gone | good | small & ~again
        most = jnp.where(taken & ~gone, jnp.maximum(going.most, jnp.where(closes & ~calm, 1.0, there.gap)), going.most)
        followed = taken & (most < shut)
        z = jnp.where(taken | small, there.z, going.here.z)
        width = jnp.where(most >= shut, to - phi, jnp.where(taken, 2.0, jnp.where(small, 1.0, 0.5)) * going.width)
        here = jax.tree.map(lambda a, b: jnp.where(taken, a, b), there, going.here)
        at, far = jnp.where(taken, new, going.at), jnp.where(followed, new, going.far)
        tries = jnp.where(taken, 0.0, going.tries + small.astype(dtype))
        least = jnp.where(taken & ~good, 2.0, 1.0) * going.least  # limits the number of smallest steps
        seen = jax.tree.map(lambda a, b: jnp.where(taken, a, b), Seen(going.at, going.here.sense), going.seen)
        tip = jnp.where(followed, there.z, going.tip)
        beyond = jnp.where((most >= shut) & ~gone, new + smallest, going.beyond)  # close to a fold it may not close
        return _Going(here, seen, tip, far, z, width, least, tries, at, beyond, most)

    none = jnp.zeros_like(last.gap)
    open_before = jnp.where(last.gap < shut, none, last.gap)
    begun = _Going(last, seen, last.z, phi, last.z, to - phi, smallest, none, phi, phi, open_before)
    found = jax.lax.while_loop(lambda going: going.at < to - 0.5 * smallest, step, begun)
    gap = jnp.maximum(found.here.gap, jnp.where(found.most < shut, 0.0, shut))
    return found.here._replace(gap=gap), Tip(found.tip, found.far, found.beyond), found.seen
