"""Strokes, swings, time ratios and lengths of paths: what lies between the extreme positions of a cycle."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import largest, safe_divide, safe_sqrt, wrapped
from linkjax._search import HALVINGS, MOTION_SCAN, scan_angles
from linkjax._vec import Vec
from linkjax.groups import AbstractLaw
from linkjax.kinematics import Pose, Reversals, stopping_ends
from linkjax.machine import Scene
from linkjax.measures._extremes import Extreme, Statistic, looked, lowered
from linkjax.measures._parts import Parts
from linkjax.measures._quantities import QUANTITIES, net_turn
from linkjax.measures._structure import Elements, by_structure
from linkjax.motion import Rows, Summits, Wanted

CUTS = 8  # per crank turn: the most places where a point is slowest
CLOSER = 3  # steps to each of them
ROUNDED = 1e-12  # of the largest value: less is rounding
INSIDE = 32  # steps in a move, to see where a law turns back
SPACING, REACH = 0.11, 29  # of the double-exponential rule, and its nodes to either side of the middle


def between(quantity: str, element: str) -> list[Extreme]:
    """The largest and the smallest value of a quantity of one element."""
    ways: tuple[Statistic, ...] = ("max", "min")
    return [Extreme(QUANTITIES[quantity], (element,), way, True) for way in ways]


def stroke_rows(of: Parts, element: str) -> Wanted:
    """Distances between all positions that may be outermost."""
    look = looked(of, between("travel", element))
    return look.wanted._replace(finish=lambda found: _pairs(found, look.above, look.signs))


def _pairs(found: Summits, above: Array, signs) -> Rows:
    high, low = lowered(found.vectors[..., 0], above, signs)
    every = high[:, None] - low[None]
    angle = jnp.broadcast_to(found.angle[0][:, None], every.shape)
    return Rows(every.reshape((-1, 1)), angle.ravel(), signed=True)


def swing_rows(of: Parts, element: str) -> Wanted:
    """Angles between all positions that may be outermost."""
    look, net = looked(of, between("angle", element)), jnp.abs(net_turn(of, element))

    def finished(found: Summits) -> Rows:
        rows = _pairs(found, look.above, look.signs)
        return Rows(jnp.where(net > 0, net, rows.vectors), rows.angle, signed=True)

    return look.wanted._replace(finish=finished)


@by_structure
def stopping(scene: Scene) -> tuple[str, ...]:
    """The points of sliders and the links that may have dead centres."""
    return () if resting(scene) else tuple(stopping_ends(scene.mechanism))


def resting(scene: Scene) -> tuple[str, str] | None:
    """Why a machine has no time ratio, and a remedy, where its motion law has dwells; otherwise None."""
    law = scene.mechanism.driver.follows()
    if law is None or not law.rests():
        return None
    return "does not exist: the motion law has dwells, and a way has no single end there", "delete it"


def time_ratio(of: Parts, element: str) -> Array:
    """Time of the slower way to that of the faster one, back, at constant crank speed; infinite without a return."""
    return largest(time_ratios(of, element).size())


def time_ratios(of: Parts, element: str) -> Rows:
    """The times of either way in relation to the other; both ratios are one where neither is slower."""
    turns = of.scene.cycle_turns
    return of.machine.run(_ratios, of.dead_centres[element], turns=turns)


@compiled_soon(static=("turns",))
def _ratios(found: Reversals, turns: int) -> Rows:
    """Ways and returns alternate, so every second interval between dead centres is of one kind."""
    cycle = 2 * np.pi * turns
    angle = jnp.sort(jnp.where(found.true, wrapped(found.angle, cycle), jnp.inf))
    number, count = jnp.arange(angle.size), jnp.sum(found.true)
    ahead = jnp.where(number + 1 < count, jnp.roll(angle, -1), angle[0] + cycle)
    spans = jnp.where(number < count, ahead - angle, 0.0)
    ways = jnp.stack([jnp.sum(jnp.where(number % 2 == own, spans, 0.0)) for own in (0, 1)])
    back = ways[::-1]
    ratios = jnp.where(back > 0, safe_divide(ways, back), jnp.inf)
    begins = jnp.where(count > 1, angle[:2], 0.0)
    return Rows(ratios[:, None], begins, signed=True)


def path_lengths(of: Parts, elements: Elements) -> list[Array]:
    """Lengths of the paths of points over the cycle.

    They are integrated between the places where a point is slowest: at a dead centre, or near a cusp of its path, the
    speed has a kink or a singularity close by; and between the ends of the moves of a motion law. Source: Takahasi and
    Mori, Double exponential formulas for numerical integration, 1974.
    """
    machine, turns = of.machine, of.scene.cycle_turns
    law = of.scene.mechanism.driver.follows()
    moves = None
    if law is not None and law.breaks():
        moves = machine.run(_ends_of_moves, jax.lax.stop_gradient(law), cycle=of.scene.cycle)
    scanned = machine.sample(scan_angles(turns, MOTION_SCAN), fixed=True, dynamics=False).pose
    cuts = machine.run(_slowest, scanned, turns=turns, elements=elements)

    def closer(cuts: Array) -> Array:
        return machine.run(_slower, cuts, machine.sample(cuts, fixed=True, dynamics=False).pose, elements=elements)

    slowest = machine.loop(CLOSER, closer, cuts)
    places, weights = machine.run(_between, slowest, moves, turns=turns, count=len(elements))
    return machine.run(_lengths, machine.sample(places, dynamics=False).pose, weights, elements=elements)


@compiled_soon(static=("cycle",))
def _ends_of_moves(law: AbstractLaw, cycle: float) -> Array:
    """Where moves end, and where the law turns back inside of a move (rad); the begin of the move where it does not.
    The way back may be short, so that the scan does not show it."""
    begin = jnp.sort(wrapped(jnp.stack(law.every_break(cycle)), cycle))
    width = jnp.roll(begin, -1) - begin + jnp.where(jnp.arange(begin.size) == begin.size - 1, cycle, 0.0)

    def forwards(phi):
        return jax.vmap(jax.vmap(law.at))(phi).d > 0

    x = np.linspace(0.0, 1.0, INSIDE + 1)[None, 1:-1]
    seen = forwards(begin[:, None] + width[:, None] * jnp.asarray(x))
    turns = seen[:, 1:] != seen[:, :-1]
    first = jnp.argmax(turns, axis=1)
    low = begin + width * jnp.asarray(x[0])[first]
    after = jnp.take_along_axis(seen, first[:, None] + 1, axis=1)[:, 0]

    def halve(_, ends):
        middle = 0.5 * (ends[0] + ends[1])
        late = forwards(middle[:, None])[:, 0] == after
        return jnp.where(late, ends[0], middle), jnp.where(late, middle, ends[1])

    low, high = jax.lax.fori_loop(0, HALVINGS, halve, (low, low + width / INSIDE))
    return jnp.concatenate([begin, jnp.where(jnp.any(turns, axis=1), 0.5 * (low + high), begin)])


@compiled_soon(static=("turns", "elements"))
def _slowest(pose: Pose, turns: int, elements: Elements) -> Array:
    """First guesses of the places where points are slowest (rad), a fixed number for each, flat; those that are not
    needed are spread evenly."""
    scan, slots, found = scan_angles(turns, MOTION_SCAN), np.arange(1, CUTS * turns + 1), []
    even = jnp.asarray(2 * np.pi / CUTS * slots)
    for name in elements:
        v, a = pose.points[name].dr, pose.points[name].ddr
        slope = v.dot(a)[: scan.size]
        rises = slope > ROUNDED * jnp.max(jnp.abs(slope))  # at constant speed there is rounding alone
        least = ~rises & jnp.roll(rises, -1)
        place = jnp.cumsum(least)
        chosen = least[None] & (place[None] == slots[:, None])
        guess = jnp.max(jnp.where(chosen, jnp.asarray(scan)[None], 0.0), axis=1)
        found.append(jnp.where(slots <= place[-1], guess, even))
    return jnp.concatenate(found)


@compiled_soon(static=("elements",))
def _slower(cuts: Array, pose: Pose, elements: Elements) -> Array:
    v, a = ([getattr(pose.points[name], part) for name in elements] for part in ("dr", "ddr"))
    v, a = (_own_places(part, cuts.size) for part in (v, a))
    step = 2 * np.pi / MOTION_SCAN
    move = safe_divide(jnp.sum(v * a, axis=0), jnp.sum(a * a, axis=0))
    return cuts - jnp.clip(move, -step, step)


def _own_places(vectors: list[Vec], places: int) -> Array:
    """Of vectors at the places of all points, one after another, those of each point at its own; shape (2, places)."""
    every = jnp.stack([jnp.stack([vector.x, vector.y]) for vector in vectors])[..., :places]
    size = places // len(vectors)
    return jnp.concatenate([every[i, :, i * size : (i + 1) * size] for i in range(len(vectors))], axis=1)


@functools.cache
def _rule() -> tuple[np.ndarray, np.ndarray]:
    """Nodes in [-1, 1] and weights of the double-exponential rule."""
    t = SPACING * np.arange(-REACH, REACH + 1)
    x, slope = np.tanh(0.5 * np.pi * np.sinh(t)), 0.5 * np.pi * np.cosh(t) / np.cosh(0.5 * np.pi * np.sinh(t)) ** 2
    return x, SPACING * slope


@compiled_soon(static=("turns", "count"))
def _between(cuts: Array, moves: Array | None, turns: int, count: int) -> tuple[Array, Array]:
    """Places between the cuts of each point, and the ends of `moves`, over one cycle (rad), flat, and their weights."""
    cycle = 2 * np.pi * turns
    cuts = wrapped(cuts.reshape((count, -1)), cycle)  # those outside of the cycle would lie between other moves
    if moves is not None:
        cuts = jnp.concatenate([cuts, jnp.broadcast_to(wrapped(moves, cycle)[None], (count, moves.size))], axis=1)
    edges = jnp.sort(cuts, axis=1)
    edges = jnp.concatenate([edges, edges[:, :1] + cycle], axis=1)
    x, weights = _rule()
    half, middle = 0.5 * jnp.diff(edges)[..., None], 0.5 * (edges[:, 1:] + edges[:, :-1])[..., None]
    return (middle + half * jnp.asarray(x)[None, None]).ravel(), (half * jnp.asarray(weights)[None, None]).ravel()


@compiled_soon(static=("elements",))
def _lengths(pose: Pose, weights: Array, elements: Elements) -> list[Array]:
    speed = _own_places([pose.points[name].dr for name in elements], weights.size)
    every = weights * safe_sqrt(jnp.sum(speed * speed, axis=0))
    return list(jnp.sum(every.reshape((len(elements), -1)), axis=1))
