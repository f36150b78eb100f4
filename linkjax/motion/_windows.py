"""Windows that are given by what happens, as ranges of crank angle.

A way of a coordinate leads from one reversal to the next, so the coordinate is monotone on it and passes every value at
most once. The reversals and the passages are first found on a scan of the cycle, on quintic pieces between its places,
and then refined in two rounds of evaluations; the last one carries the derivatives with respect to the design: those of
an implicit function, dφ/dp = -s_p / s_φ for a passage s(φ, p) = const.

An angle of a link that rotates fully is cut once in each revolution, opposite the middle of its window. A cut ends a
way like a reversal.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax._numerics import nearest_turn, once, safe_divide, safe_sqrt, taken, wrapped
from linkjax._search import BEND, GRID_SCAN, Found, refined, scan_angles, scan_reversals
from linkjax._types import Tracer
from linkjax.groups import Seen
from linkjax.kinematics import Pose
from linkjax.loads import STILL, Crossings, Passage, Watched, Window, watched
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import StructureError
from linkjax.motion._curve import Curve, curve_of
from linkjax.sampling import Sample, Sampler

REVERSALS = 4  # the most ways per window and crank turn; half as many if they go in one sense only
POLISH = 2  # evaluations that refine each of their ends
BESIDE = 1e-12  # of a way: a crossing closer to one of its ends is that end
TURN = 2 * math.pi


class Size(NamedTuple):
    """The fixed sizes of a search: crank turns of the cycle, and scan points per turn of what is given."""

    turns: int
    points: int

    @property
    def cycle(self) -> float:
        """The length of the cycle (rad)."""
        return TURN * self.turns

    @property
    def slots(self) -> int:
        """The most ways."""
        return REVERSALS * self.turns

    @property
    def scan(self) -> np.ndarray:
        """The scan angles (rad)."""
        return scan_angles(self.turns, GRID_SCAN)


class Passed(NamedTuple):
    """The windows of the loads as ranges of crank angle, in the order of the loads; whether there are more ways than
    slots, or ways that were not seen; and a bound of the error of the work (J) due to the position error of their
    ends. `kinks` are the crank angles at which loads have a kink, load by load, infinite in unused slots."""

    windows: tuple[Window, ...]
    overflow: Array
    doubt: Array
    kinks: tuple[Array, ...] = ()


class Ways(NamedTuple):
    """The ways of one coordinate. Their ends are the reversals `found` (rad), then the `cut` angles (rad), with the
    coordinate `value` there, unwrapped; `begin` and `end` are their numbers. `whole` says that one way is the whole
    cycle. Ways have a `sense` (1 or -1), and are `used` by the window or not. The values of the window are shifted by
    `level`, and the coordinate at the end by `lift`, both whole turns of a link. `cross` are the places (rad) where
    ways pass the values of the window, shape (values, ways)."""

    found: Found
    cut: Array
    value: Array
    begin: Array
    end: Array
    whole: Array
    sense: Array
    used: Array
    level: Array
    lift: Array
    cross: Array
    overflow: Array


def how_many(window: Any, turns: int) -> int:
    """The number of ranges of crank angle that a window may become; of ways on which a coordinate has crossings."""
    if isinstance(window, Crossings):
        return REVERSALS * turns
    if isinstance(window, Passage):
        return REVERSALS * turns // (2 if window.going else 1)
    return 0 if window is None else max(1, math.prod(jnp.shape(window.on)))


def crossings_of(made: ReadyScene) -> list[Crossings]:
    """The coordinates whose crossings and reversals are kinks of loads."""
    pairs = zip(made.scene.loads, made.ends or (None,) * len(made.scene.loads), strict=True)
    return [Crossings(over, load, ends) for load, ends in pairs if (over := load.crossed()) is not None]


def kinks_at_most(each: Crossings, turns: int) -> int:
    """The number of crank angles at which a load may have a kink: the begin of every way, and the crossings on it."""
    return (1 + each.load.level_count()) * how_many(each, turns)


def evaluated(windows: list[Any], turns: int) -> int:
    """The number of places that are evaluated to find the ranges of these windows, or these crossings."""
    places = [REVERSALS * turns + _values(window) * how_many(window, turns) for window in windows]
    return POLISH * sum(places)


def at_crank_angles(scene: Scene | ReadyScene) -> Scene:
    """The scene with ranges of crank angle in the place of windows that are given by what happens.

    Each of these becomes a `Window` with arrays of one axis, in which unused ranges have zero width. They hold for this
    design, and carry its derivatives. Raises `StructureError` if a motion has more ways than can be represented (four
    per crank turn, or two in one sense), or rests between two of them.
    """
    made = ready(scene)
    machine, scene = Sampler(made), made.scene
    scan = scan_angles(scene.cycle_turns, GRID_SCAN)
    if not any(isinstance(load.window, Passage) for load in scene.loads):
        return scene
    found = passed(machine, machine.sample(scan, fixed=True, dynamics=False), GRID_SCAN)
    assert found is not None  # there are such windows
    if not isinstance(found.overflow, Tracer) and bool(found.overflow):
        problem = "the motion has more ways per crank turn than can be represented, or rests between two of them"
        raise StructureError("window of a load", problem, "write windows of the crank angle")
    ranges = iter(found.windows)
    loads = tuple(
        dataclasses.replace(load, window=next(ranges)) if isinstance(load.window, Passage) else load
        for load in scene.loads
    )
    return dataclasses.replace(scene, loads=loads)


def passed(machine: Sampler, scanned: Sample, points: int) -> Passed | None:
    """The ranges of crank angle in which loads with a `Passage` act, from samples at `points` scan angles per turn;
    None if there are no such loads."""
    loads = {load.name: load.window for load in machine.scene.loads if isinstance(load.window, Passage)}
    every = [*loads.values(), *crossings_of(machine.ready)]
    if not every:
        return None
    size = Size(machine.scene.cycle_turns, points)

    def seen(pose: Pose) -> tuple[Watched, ...]:
        return tuple(watched(machine.mechanism, window, pose) for window in every)

    ways, flat = machine.run(_scanned, seen(scanned.pose), size=size)
    for _ in range(POLISH - 1):
        ways, flat = machine.run(_closer, seen(machine.sample(flat, fixed=True, dynamics=False).pose), ways, size=size)
    last = machine.sample(flat)
    shares = tuple(last.dynamics[2][name] for name in loads)
    return machine.run(_passed, seen(last.pose), ways, shares, size=size)


@compiled_soon(static=("size",))
def _scanned(seen: tuple[Watched, ...], size: Size) -> tuple[tuple[Ways, ...], Array]:
    """First guesses of the ways, and the places to evaluate next."""
    found = tuple(_ways(each, size) for each in jax.lax.stop_gradient(seen))
    return found, _places(found)


@compiled_soon(static=("size",))
def _closer(seen: tuple[Watched, ...], ways: tuple[Ways, ...], size: Size) -> tuple[tuple[Ways, ...], Array]:
    """The same after one round."""
    closer = []
    for each, old, first in _own(seen, ways):
        new = _refined(each, old, first, size)
        found = Found(new.ends[: size.slots][None], old.found.number)
        closer.append(old._replace(found=found, value=new.value, cross=new.cross))
    done = jax.lax.stop_gradient(tuple(closer))
    return done, _places(done)


@compiled_soon(static=("size",))
def _passed(seen: tuple[Watched, ...], ways: tuple[Ways, ...], shares: tuple[Array, ...], size: Size) -> Passed:
    """The ranges after the last round, which carries derivatives; `shares` are the torques of the loads (N m)."""
    windows, overflow, doubt, own = [], jnp.asarray(False), jnp.zeros(()), _own(seen, ways)
    for (each, old, first), share in zip(own, shares, strict=False):
        new = _refined(each, old, first, size)
        windows.append(_window(each.window, old, new, size))
        overflow |= old.overflow
        here = jnp.abs(share[first : first + new.left.size])
        doubt += jnp.sum(here * new.left)  # a load that begins too late, or ends too early, misses this work
    kinks = []
    for each, old, first in own[len(shares) :]:  # crossings; they cost the square of their error
        kinks.append(_crossed(each.window, old, _refined(each, old, first, size), size))
        overflow |= old.overflow
    return Passed(tuple(windows), overflow, jax.lax.stop_gradient(jnp.where(overflow, jnp.inf, doubt)), tuple(kinks))


def _places(ways: tuple[Ways, ...]) -> Array:
    """The places of all ways: reversals, then passages, way by way."""
    return jnp.concatenate([part for each in ways for part in (each.found.angle[0], each.cross.ravel())])


def _own(seen: tuple[Watched, ...], ways: tuple[Ways, ...]) -> list[tuple[Watched, Ways, int]]:
    """Windows with their ways, and the number of their first place among all."""
    found, first = [], 0
    for each, old in zip(seen, ways, strict=True):
        found.append((each, old, first))
        first += old.found.angle.size + old.cross.size
    return found


def _ways(seen: Watched, size: Size) -> Ways:
    """First guesses of the ways of a window, from its coordinate at the scan angles."""
    window, scan, slots, number = seen.window, size.scan, size.slots, np.arange(size.slots)
    every = slice(0, size.points * size.turns, size.points // GRID_SCAN)
    # once: a velocity that is zero at a scan angle must not have two signs by rounding
    value, d, dd, pace = (once(part[every]) for part in (*seen.seen(), seen.pace()))
    curve = curve_of(Seen(value, d, dd), scan, size.cycle, bool(window.link))
    moves = jnp.max(jnp.abs(d)) > STILL * jnp.max(pace)
    found = scan_reversals(
        d[None, None], dd[None, None], scan, slots, lambda start: jnp.broadcast_to(moves, start.shape)
    )
    cut, cuts, crowded = _cuts(curve, window, size) if window.cuts else (jnp.zeros(0), jnp.zeros(0, int), False)
    # a motion over a closed cycle reverses an even number of times; a rest between two senses is not seen
    stays = (found.number[0] == 0) & (jnp.abs(curve.value[-1] - curve.value[0]) < math.pi)
    unseen = moves & (stays | (found.number[0] % 2 == 1))
    turn = jnp.sort(jnp.where(number < found.number, wrapped(found.angle[0], size.cycle), jnp.inf))
    count = jnp.minimum(found.number[0] + cuts, slots) if window.cuts else jnp.minimum(found.number[0], slots)
    overflow = unseen | crowded | (found.number[0] + jnp.sum(cuts) > slots)
    ends = jnp.concatenate([turn, cut])
    order = jnp.argsort(ends)[:slots].astype(jnp.int32)
    after = taken(order, jnp.where(number + 1 < count, number + 1, 0))
    ends = jnp.where(jnp.isfinite(ends), ends, 0.0)
    start, whole = taken(ends, order), count == 1
    width = _width(start, taken(ends, after), whole, size.cycle)
    s0, s1 = curve.at(start), curve.at(start + width)
    sense = jnp.where(s1 >= s0, 1.0, -1.0)
    used = jnp.asarray(number) < count
    if window.going:
        used &= sense == (1.0 if window.going in ("+", "ccw") else -1.0)
    most = how_many(window, size.turns)
    overflow |= jnp.sum(used) > most
    chosen = jnp.argsort(jnp.where(used, number, slots + number))[:most]
    value = curve.at(ends)
    begin, end, sense, used, start, width, s0, s1 = (
        taken(part, chosen) for part in (order, after, sense, used, start, width, s0, s1)
    )
    level = lift = jnp.zeros(most)
    if window.link:
        lift = TURN * jnp.round((s1 - taken(value, end)) / TURN)
    if window.cuts:
        level = TURN * jnp.round((0.5 * (s0 + s1) - _middle(window)) / TURN)
    every = _targets(window, s0, s1, sense, level)
    begins, widths, senses = (jnp.broadcast_to(part[None], every.shape) for part in (start, width, sense))
    cross = curve.passage(begins, widths, senses, every)
    turn = jnp.where(jnp.isfinite(turn), turn, 0.0)
    cut = jnp.where(jnp.isfinite(cut), cut, 0.0)
    return Ways(
        Found(turn[None], found.number), cut, value, begin, end, whole, sense, used, level, lift,
        wrapped(cross, size.cycle), overflow,
    )  # fmt: skip


class _Refined(NamedTuple):
    """Ends of ways and passages after a Newton step: the angles (rad) of the ends, the coordinate there, that at
    `begin` and `end`; the passages (rad); and bounds of the error (rad) of all of them that are used."""

    ends: Array
    value: Array
    low: Array
    high: Array
    cross: Array
    left: Array


def _refined(seen: Watched, ways: Ways, first: int, size: Size) -> _Refined:
    """A Newton step, from the coordinate at places of which those of this window begin with number `first`. It carries
    the derivatives of ends that move with the design."""
    slots, step, window = size.slots, TURN / GRID_SCAN, seen.window
    here = Seen(*(part[first : first + slots + ways.cross.size] for part in seen.seen()))
    value, d, dd = (part[:slots] for part in here)
    turns = refined(ways.found.angle, d[None, None], dd[None, None], step, ways.found)
    move = jax.lax.stop_gradient(ways.found.angle - turns.angle)[0]
    value = _near(value - move * (d - 0.5 * move * dd), ways.value[:slots], window)
    ends, values = jnp.concatenate([turns.angle[0], ways.cut]), jnp.concatenate([value, ways.value[slots:]])
    low, high = taken(values, ways.begin), taken(values, ways.end) + ways.lift
    value, d, dd = (part[slots:].reshape(ways.cross.shape) for part in here)
    # the root of f + d x + dd x²/2 at which the slope has the sense of the way
    targets = _targets(window, low, high, ways.sense, ways.level)
    ahead = ways.sense[None] * (targets - low[None])
    there = ways.used[None] & (ways.whole | ((ahead > 0) & (ahead < (ways.sense * (high - low))[None])))
    f = value - targets
    f = nearest_turn(f, TURN) if window.link else f
    slope = jax.lax.stop_gradient(ways.sense[None] * safe_sqrt(d * d - 2 * f * dd))
    move = jnp.clip(safe_divide(-2 * f, d + slope), -step, step)
    moved = jnp.abs(jax.lax.stop_gradient(move))
    left = jnp.where(there, jnp.minimum(moved, BEND * moved**2), 0.0).ravel()
    left = jnp.concatenate([jnp.where(turns.present[0], turns.left[0], 0.0), left])
    cross = ways.cross + jax.lax.stop_gradient(move) - safe_divide(f - jax.lax.stop_gradient(f), slope)
    return _Refined(ends, values, low, high, cross, jax.lax.stop_gradient(left))


def _window(window: Passage, ways: Ways, new: _Refined, size: Size) -> Window:
    """The ranges of crank angle. A way on which a value is never reached, or passed before it begins, has its end in
    the place of the passage."""
    start, stop = taken(new.ends, ways.begin), taken(new.ends, ways.end)
    width = _width(start, stop, ways.whole, size.cycle)
    room, passages = ways.sense * (new.high - new.low), []
    for target, cross in zip(_targets(window, new.low, new.high, ways.sense, ways.level), new.cross, strict=True):
        ahead = ways.sense * (target - new.low)
        along = nearest_turn(cross - start - 0.5 * width, size.cycle) + 0.5 * width
        inside = start + jnp.clip(along, 0.0, width)
        inside = jnp.where(ways.whole, inside, jnp.where(ahead <= 0, start, jnp.where(ahead >= room, stop, inside)))
        passages.append(inside)
    on, off = passages if window.between is not None else (start, stop)
    if window.last is not None:
        on = passages[0]
    elif window.first is not None:
        off = passages[0]
    # not even by rounding does a range end before it begins: it would be the whole cycle
    rounding = 8 * jnp.finfo(on.dtype).eps * size.cycle
    ended = ways.used & (jnp.abs(nearest_turn(off - on, size.cycle)) > rounding)
    return Window(jnp.where(ended, on, 0.0), jnp.where(ended, off, 0.0))


def _crossed(each: Crossings, ways: Ways, new: _Refined, size: Size) -> Array:
    """The crank angles of the crossings, and of the begins of ways; infinite where there is none."""
    start, stop = taken(new.ends, ways.begin), taken(new.ends, ways.end)
    width, room = _width(start, stop, ways.whole, size.cycle), ways.sense * (new.high - new.low)
    targets = _targets(each, new.low, new.high, ways.sense, ways.level)
    ahead, near = ways.sense[None] * (targets - new.low[None]), BESIDE * room[None]
    there = (ways.used & ~ways.whole)[None] & (ahead > near) & (ahead < room[None] - near)
    there |= (ways.used & ways.whole)[None]
    along = nearest_turn(new.cross - start[None] - 0.5 * width[None], size.cycle) + 0.5 * width[None]
    inside = start[None] + jnp.clip(along, 0.0, width[None])
    return jnp.concatenate([jnp.where(ways.used, start, jnp.inf), jnp.where(there, inside, jnp.inf).ravel()])


def _targets(window: Any, low: Array, high: Array, sense: Array, level: Array) -> Float[Array, "values ways"]:
    """The values that the coordinate passes on ways from `low` to `high`, in the order in which it passes them; those
    at which a load has a kink are in their own order."""
    if isinstance(window, Crossings):
        return jnp.stack([value + level for value in window.values()])
    if window.first is not None:
        return (low + sense * window.first)[None]
    if window.last is not None:
        return (high - sense * window.last)[None]
    if window.between is None:
        return jnp.zeros((0, *low.shape))
    a, b = window.between
    return jnp.stack([jnp.where(sense > 0, a, b), jnp.where(sense > 0, b, a)]) + level[None]


def _values(window: Any) -> int:
    if isinstance(window, Crossings):
        return window.load.level_count()
    return sum(part is not None for part in (window.first, window.last, *(window.between or ())))


def _middle(window: Any) -> Array:
    if isinstance(window, Crossings):
        values = window.values()
        return 0.5 * (values[0] + values[-1])
    assert window.between is not None
    return 0.5 * (window.between[0] + window.between[1])


def _near(value: Array, guess: Array, window: Any) -> Array:
    """The coordinate itself; the angle of a link with as many whole turns as a guess."""
    return guess + nearest_turn(value - guess, TURN) if window.link else value


def _width(start: Array, stop: Array, whole: Array, cycle: float) -> Array:
    """The crank angle (rad) from the begin of ways to their end; reversals that have changed places by rounding are
    one."""
    width = wrapped(stop - start, cycle)
    return jnp.where(whole, cycle, jnp.where(width > cycle - 1e-6, 0.0, width))


def _cuts(curve: Curve, window: Any, size: Size) -> tuple[Array, Array, Array]:
    """Where a link is opposite the middle of its window (rad, infinite in unused slots), how often, and whether more
    often than can be seen."""
    lap = jnp.floor((curve.value - _middle(window) + math.pi) / TURN)
    low, high = jnp.minimum(lap[:-1], lap[1:]), jnp.maximum(lap[:-1], lap[1:])
    cell, count = high > low, jnp.sum(high > low)
    number = jnp.cumsum(cell)
    at = cell[None] & (number[None] == jnp.arange(1, size.slots + 1)[:, None])
    begin, target, sense = (
        jnp.sum(jnp.where(at, part[None], 0.0), axis=1)
        for part in (jnp.asarray(size.scan), _middle(window) - math.pi + TURN * high, jnp.sign(lap[1:] - lap[:-1]))
    )
    angle = curve.passage(begin, jnp.full_like(begin, curve.step), sense, target)
    there = jnp.arange(size.slots) < count
    return jnp.where(there, angle, jnp.inf), count, jnp.max(high - low) > 1
