"""Following a general group along the crank, from its sketch on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._lapack import pinv
from linkjax._numerics import safe_divide
from linkjax.groups import Gear, General, Track, closed_to

ALONG = 5  # damped Newton steps in a step along the path
GROW = 10.0  # times that what is open may grow in one of them
AGAIN = 5  # times as many more where the smallest step does not close at once
SWING = 0.2  # rad, or of the size: what links may move in one step
SMALLEST = 4096  # parts of a step that a smaller one may be
FIRST = 8  # parts of the first step that it is made in: nothing was seen before
DIP = 0.25  # of the larger at either end, below which the determinant's square may come down to nothing in between
FEW = 4  # places, at which the path may be interpolated


def path_of(group: General, links: Mapping[str, Any], before: Callable, angles: Array) -> Track:
    """The configurations of a group at these crank angles, which go over whole turns from zero.

    `before` gives states of links and points that were there before the group at a crank angle, and whether those can
    be assembled there: where they cannot the group is open, too. Angles that are not reached on the way up, because the
    group does not close before them, are reached on the way down where they can be.
    """
    states, points, began = before(angles[0])

    def known(phi: Array):
        states, points, closes = before(phi)
        return states, points, closes | ~began

    z, sense, gap, whole = group.assembled(links, states, points, angles[0])
    shut = closed_to(angles.dtype)
    first, group = Track(z, sense, gap, size=group.size(links, points)), group if whole is None else group.off_by(whole)

    def along(done: Array, way: Array) -> tuple[Array, tuple[Track, Tip]]:
        def step(last: tuple[Track, Seen], ends: tuple[Array, Array]):
            now, tip, seen = _follow(group, links, known, *last, jnp.where(done, ends[1], ends[0]), ends[1], way)
            return (now, seen), (now, tip)

        _, (rest, tips) = jax.lax.scan(step, (first, Seen(angles[0], sense)), (angles[:-1], angles[1:]))
        whole = jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), first, rest)
        lost = jnp.minimum(jnp.sum(jnp.cumprod(whole.gap < shut)), angles.size - 1) - 1
        return jnp.all(whole.gap < shut), (whole, jax.tree.map(lambda part: part[lost], tips))

    ways = jax.lax.scan(along, jnp.asarray(False), jnp.asarray([1.0, -1.0], dtype=angles.dtype))[1]
    (up, tip), (down, end) = (jax.tree.map(lambda part, k=k: part[k], ways) for k in (0, 1))
    if group.gears:
        down, end = (part._replace(z=part.z.at[..., 2].add(_gained(group))) for part in (down, end))
    return _joined(up, down, tip, end, angles)._replace(size=first.size, whole=whole)


def _joined(up: Track, down: Track, tip: Tip, end: Tip, angles: Array) -> Track:
    """One path of the ways up and down, and of where they end. Where they overlap, a range is longer than the path: a
    step is left out there, for they may be anywhere to each other."""
    count, step, span = angles.size, angles[1], angles[-1]
    reached = [jnp.cumprod(way.gap < closed_to(angles.dtype)) > 0 for way in (up, down)]
    ahead, back = (jnp.sum(way) for way in reached)
    until, since = jnp.where(ahead > 0, tip.beyond, -1.0), span - jnp.where(back > 0, end.beyond, -1.0)
    since, ends = jnp.where(until < since, since, until + step), ahead < count
    other = ends & (angles > 0.5 * (until + since))  # nearer to the way down
    sound = reached[0] & ~other, reached[1][::-1] & other & (angles > since)
    begin, place = count - jnp.sum(sound[1]), jnp.arange(count)
    few = jnp.where(ahead + jnp.sum(sound[1]) <= FEW, FEW, 0)  # they are held on to beyond, but count for nothing
    above, below = (place >= ahead) & (place < ahead + few), (place < begin) & (place >= begin - few)
    source = jnp.where(above, ahead - 1, jnp.where(below, begin, place))
    path = jax.tree.map(lambda a, b: jnp.where(other.reshape((-1, *[1] * (a.ndim - 1))), b[::-1], a)[source], up, down)
    lost = jnp.where(ends, jnp.stack([until, since]), jnp.stack([span, -span]))
    firsts = _firsts(sound[0] | sound[1] | above | below, other)
    return path._replace(
        gap=jnp.where(above | below, 1.0, path.gap).at[0].set(up.gap[0]),
        first=firsts.astype(path.gap.dtype),
        lost=lost,
        tips=jnp.stack([tip.z, end.z]),
        tips_at=jnp.stack([tip.at, -end.at]),
    )


def _gained(group: General) -> Array:
    """By how much the links of a group with wheels in gear turn (rad, (links,)) where the crank comes round and the
    group does not: wheels pinned once as those they are in gear with, and others by whole turns, one for each pair in
    gear, wheels first; the rest not at all."""
    names, free = group.link_names(), group.spinning()
    wound = group.path.wound if group.path is not None else None
    covered = {} if wound is None else dict(zip(group.mates(), wound.covered(), strict=True))
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
    """The first of the four places nearest to either half of every step, all reached, and on the same way; where both
    ways were taken they meet at crank angle zero, and the places go on there from the last to the first."""
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
    """Where it was before on a way: the crank angle (rad), and the Jacobian's determinant there."""

    at: Array
    sense: Array

    def clear(self, here: Seen, there: Seen, order: int) -> Array:
        """Whether there is no fold, or nearly one, between `here` and `there`: beside it the square of the determinant
        is a parabola, which this place and those two tell."""
        h0, h1 = here.at - self.at, there.at - here.at
        r, q = (jnp.abs(safe_divide(side.sense, here.sense, 1.0)) ** (2 * order) for side in (self, there))
        bend = safe_divide(safe_divide(q - 1, h1) - safe_divide(1 - r, h0), h0 + h1)
        slope = safe_divide(q - 1, h1) - bend * h1
        lowest = safe_divide(-slope, 2 * bend)
        dips = (bend > 0) & (lowest > -0.1 * h1) & (lowest < 1.1 * h1)
        return ~dips | (1 + 0.5 * slope * lowest > DIP * jnp.maximum(1.0, q))


class Tip(NamedTuple):
    """Where a way ends: the last configuration that was followed, at which crank angle (rad), counted along the way,
    and an angle right beyond the end."""

    z: Array
    at: Array
    beyond: Array


class _Going(NamedTuple):
    """On the way from place to place: where it is, and where it was before; the last that was followed, and to which
    crank angle (rad); where Newton's method begins, how wide the step is and may least be (rad), and how often it went
    on there; where it got to (rad), be it lost or not, an angle right beyond where it was lost, and the most that was
    open."""

    here: Track
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
    group: General,
    links: Mapping[str, Any],
    before: Callable,
    last: Track,
    seen: Seen,
    phi: Array,
    to: Array,
    way: Array,
) -> tuple[Track, Tip, Seen]:
    """From a configuration on to the next crank angle, in as many steps as it takes; where it was followed to, and
    where it was before. The angles are those on the `way`, one up or minus one down. A step is made smaller while it
    does not close, moves links far, turns the sense of the Jacobian, or may have gone over a fold. Where the smallest
    does not close, or moves links far, the group is lost: one more step leads to the end, where it may close in another
    assembly, and is told as open."""
    dtype, smallest, shut = last.z.dtype, (to - phi) / SMALLEST, closed_to(last.z.dtype)
    assert last.size is not None
    measure = jnp.ones_like(last.z).at[:, :2].set(last.size)
    if last.z.shape[1] == 3:  # wheels may turn as fast as they like: there is only one way
        measure = measure.at[group.loose(), 2].set(jnp.inf)

    def step(going: _Going) -> _Going:
        new, gone = jnp.minimum(going.at + going.width, to), going.most >= shut
        states, points, whole = before(way * new)
        there = Track(*group.closed(links, states, points, way * new, going.start, ALONG, GROW), size=last.size)
        there = there._replace(gap=jnp.where(whole & jnp.isfinite(there.gap), there.gap, 1.0))
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
        least = jnp.where(taken & ~good, 2.0, 1.0) * going.least  # so that they do not become many
        seen = jax.tree.map(lambda a, b: jnp.where(taken, a, b), Seen(going.at, going.here.sense), going.seen)
        tip = jnp.where(followed, there.z, going.tip)
        beyond = jnp.where((most >= shut) & ~gone, new + smallest, going.beyond)  # it may not close right beside a fold
        return _Going(here, seen, tip, far, z, width, least, tries, at, beyond, most)

    none = jnp.zeros_like(last.gap)
    open_before = jnp.where(last.gap < shut, none, last.gap)
    begun = _Going(last, seen, last.z, phi, last.z, to - phi, smallest, none, phi, phi, open_before)
    found = jax.lax.while_loop(lambda going: going.at < to - 0.5 * smallest, step, begun)
    gap = jnp.maximum(found.here.gap, jnp.where(found.most < shut, 0.0, shut))
    return found.here._replace(gap=gap), Tip(found.tip, found.far, found.beyond), found.seen
