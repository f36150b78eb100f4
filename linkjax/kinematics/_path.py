"""Following a general group along the crank, from its sketch on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._lapack import pinv
from linkjax.groups import Gear, General, Track, closed_to, slow

ALONG = 5  # damped Newton steps in a step along the path
SWING = 0.2  # rad, or of the size: what links may move in one step
LOST = 1e-4  # of the size: what is left open where the group is beyond its range
SMALLEST = 128  # parts of a step that a smaller one may be


def path_of(group: General, links: Mapping[str, Any], before: Callable, angles: Array) -> Track:
    """The configurations of a group at these crank angles, which go over whole turns from zero.

    `before` gives states of links and points that were there before the group at a crank angle. Angles that are not
    reached on the way up, because the group does not close before them, are reached on the way down where they can be.
    """
    states, points = before(angles[0])
    z, sense, gap, whole = group.assembled(links, states, points, angles[0])
    first, group = Track(z, sense, gap, size=group.size(links, points)), group if whole is None else group.off_by(whole)

    def along(done: Array, way: Array) -> tuple[Array, Track]:
        def step(last: Track, ends: tuple[Array, Array]):
            now = _follow(group, links, before, last, jnp.where(done, ends[1], ends[0]), ends[1], way)
            return now, now

        _, rest = jax.lax.scan(step, first, (angles[:-1], angles[1:]))
        whole = jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), first, rest)
        return jnp.all(whole.gap < closed_to(whole.gap.dtype)), whole

    both = jax.lax.scan(along, jnp.asarray(False), jnp.asarray([1.0, -1.0], dtype=angles.dtype))[1]
    up, down = (jax.tree.map(lambda part, k=k: part[k], both) for k in (0, 1))
    if group.gears:
        down = down._replace(z=down.z.at[:, :, 2].add(_gained(group)))
    reached = [jnp.cumprod(way.gap < closed_to(up.z.dtype)) > 0 for way in (up, down)]
    other = ~reached[0] & reached[1][::-1]
    path = jax.tree.map(lambda a, b: jnp.where(other.reshape((-1, *[1] * (a.ndim - 1))), b[::-1], a), up, down)
    firsts = _firsts(reached[0] | other, other).astype(path.gap.dtype)
    return path._replace(first=firsts, size=first.size, whole=whole)


def _gained(group: General) -> Array:
    """By how much the links of a group with wheels in gear turn (rad, (links,)) where the crank comes round and the
    group does not: wheels pinned once as those they are in gear with, others by whole turns or not at all."""
    names, free = group.link_names(), [name in group.spinning() for name in group.link_names()]
    wound = group.path.wound if group.path is not None else None
    covered = {} if wound is None else dict(zip(group.mates(), wound.covered(), strict=True))
    held = [gear.coupling().angles for gear in group.gears if isinstance(gear, Gear)]
    turned = jnp.zeros(len(names))
    if not held:
        return turned
    matrix = jnp.stack([jnp.stack([each.get(name, turned[0]) for name in names]) for each in held])
    push = -jnp.stack(
        [sum((each[name] * covered[name] for name in each if name in covered), turned[0]) for each in held]
    )
    loose = np.asarray([any(name in group.spinning() for name in each) for each in held])
    for rows, columns, whole in ((~loose, ~np.asarray(free), True), (loose, np.asarray(free), False)):
        if rows.any() and columns.any():
            left = (push - matrix @ turned)[rows]
            found = pinv(matrix[rows][:, columns]) @ left
            found = 2 * jnp.pi * jnp.round(found / (2 * jnp.pi)) if whole else found
            turned = turned.at[np.flatnonzero(columns)].set(found)
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


def _follow(
    group: General, links: Mapping[str, Any], before: Callable, last: Track, phi: Array, to: Array, way: Array
) -> Track:
    """From a configuration on to the next crank angle, in as many steps as it takes; both angles are those on the
    `way`, one up or minus one down. A step is made smaller while it does not close, moves links far, or turns the sense
    of the Jacobian; the smallest is taken as it is. Where it was lost before, one step will do. What is open on the way
    is told of the end, too: beyond a narrow gap it may close in another assembly."""
    shut = closed_to(last.z.dtype)
    least = jnp.where(last.gap > LOST, to - phi, (to - phi) / SMALLEST)
    assert last.size is not None
    measure = jnp.ones_like(last.z).at[:, :2].set(last.size)
    free = np.asarray([name in group.spinning() for name in group.link_names()])
    if last.z.shape[1] == 3:  # wheels may turn as fast as they like: there is only one way
        measure = measure.at[free, 2].set(jnp.inf)

    def goes_on(carry):
        return carry[1] < to - 0.5 * least

    def step(carry):
        here, at, width, most = carry
        new = jnp.minimum(at + width, to)
        states, points = before(way * new)
        there = Track(*group.closed(links, states, points, way * new, here.z, ALONG), size=here.size)
        calm = jnp.max(jnp.abs(there.z - here.z) / measure) < SWING
        good = (there.gap < shut) & calm & (there.sense == here.sense) | (width <= least)
        most = jnp.where(good, jnp.maximum(most, there.gap), most)
        kept = jax.tree.map(lambda a, b: jnp.where(good, a, b), (there, new), (here, at))
        return *kept, jnp.maximum(jnp.where(good, 2 * width, 0.5 * width), least), most

    found, _, _, most = jax.lax.while_loop(goes_on, step, (last, phi, to - phi, jnp.zeros_like(last.gap)))
    return found._replace(gap=jnp.where(most < slow(most.dtype), found.gap, most))
