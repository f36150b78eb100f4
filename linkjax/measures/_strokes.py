"""Strokes, swings, time ratios and lengths of paths: what lies between the extreme positions of a cycle."""

from __future__ import annotations

import functools

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide, safe_sqrt, wrapped
from linkjax._search import MOTION_SCAN, scan_angles
from linkjax.kinematics import Pose, Reversals, stopping_ends
from linkjax.machine import Scene
from linkjax.measures._extremes import Extreme, Statistic, looked, lowered
from linkjax.measures._parts import Parts
from linkjax.measures._quantities import QUANTITIES, by_structure, net_turn
from linkjax.motion import Rows, Summits, Wanted

CUTS = 8  # per crank turn: the most places where a point is slowest
CLOSER = 3  # steps to each of them
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
    return tuple(stopping_ends(scene.mechanism))


def time_ratio(of: Parts, element: str) -> Array:
    """Time of the slower way to that of the faster one, back, at constant crank speed; infinite without a return."""
    turns = of.scene.cycle_turns
    return of.machine.run(_ratio, of.dead_centres[element], turns=turns)


@compiled_soon(static=("turns",))
def _ratio(found: Reversals, turns: int) -> Array:
    """Ways and returns alternate, so every second interval between dead centres is of one kind."""
    cycle = 2 * np.pi * turns
    angle = jnp.sort(jnp.where(found.true, wrapped(found.angle, cycle), jnp.inf))
    number, count = jnp.arange(angle.size), jnp.sum(found.true)
    ahead = jnp.where(number + 1 < count, jnp.roll(angle, -1), angle[0] + cycle)
    spans = jnp.where(number < count, ahead - angle, 0.0)
    ways = jnp.sum(jnp.where(number % 2 == 0, spans, 0.0)), jnp.sum(jnp.where(number % 2 == 1, spans, 0.0))
    long, short = jnp.maximum(*ways), jnp.minimum(*ways)
    return jnp.where(short > 0, safe_divide(long, short), jnp.inf)


def path_length(of: Parts, element: str) -> Array:
    """Length of the path of a point over the cycle.

    It is integrated between the places where the point is slowest: at a dead centre, or near a cusp of its path, the
    speed has a kink or a singularity close by. Source: Takahasi and Mori, Double exponential formulas for numerical
    integration, 1974.
    """
    machine, turns = of.machine, of.scene.cycle_turns
    scanned = machine.sample(scan_angles(turns, MOTION_SCAN), fixed=True, dynamics=False).pose
    cuts = machine.run(_slowest, scanned, turns=turns, element=element)
    for _ in range(CLOSER):
        cuts = machine.run(_slower, cuts, machine.sample(cuts, fixed=True, dynamics=False).pose, element=element)
    places, weights = machine.run(_between, cuts, turns=turns)
    return machine.run(_length, machine.sample(places, dynamics=False).pose, weights, element=element)


@compiled_soon(static=("turns", "element"))
def _slowest(pose: Pose, turns: int, element: str) -> Array:
    """First guesses of the places where a point is slowest (rad), a fixed number; the others are spread evenly."""
    scan = scan_angles(turns, MOTION_SCAN)
    v, a = pose.points[element].dr, pose.points[element].ddr
    slope = (v.x * a.x + v.y * a.y)[: scan.size]
    least = (slope <= 0) & (jnp.roll(slope, -1) > 0)
    place, slots = jnp.cumsum(least), jnp.arange(1, CUTS * turns + 1)
    chosen = least[None] & (place[None] == slots[:, None])
    found = jnp.sum(jnp.where(chosen, jnp.asarray(scan)[None], 0.0), axis=1)
    return jnp.where(slots <= place[-1], found, 2 * np.pi / CUTS * slots)


@compiled_soon(static=("element",))
def _slower(cuts: Array, pose: Pose, element: str) -> Array:
    v, a = pose.points[element].dr, pose.points[element].ddr
    v, a = (type(part)(part.x[: cuts.size], part.y[: cuts.size]) for part in (v, a))
    step = 2 * np.pi / MOTION_SCAN
    return cuts - jnp.clip(safe_divide(v.dot(a), a.squared()), -step, step)


@functools.cache
def _rule() -> tuple[np.ndarray, np.ndarray]:
    """Nodes in [-1, 1] and weights of the double-exponential rule."""
    t = SPACING * np.arange(-REACH, REACH + 1)
    x, slope = np.tanh(0.5 * np.pi * np.sinh(t)), 0.5 * np.pi * np.cosh(t) / np.cosh(0.5 * np.pi * np.sinh(t)) ** 2
    return x, SPACING * slope


@compiled_soon(static=("turns",))
def _between(cuts: Array, turns: int) -> tuple[Array, Array]:
    """Places between the cuts (rad) and their weights, over one cycle."""
    cycle = 2 * np.pi * turns
    edges = jnp.sort(cuts)
    edges = jnp.concatenate([edges, edges[:1] + cycle])
    x, weights = _rule()
    half, middle = 0.5 * (edges[1:] - edges[:-1])[:, None], 0.5 * (edges[1:] + edges[:-1])[:, None]
    return (middle + half * jnp.asarray(x)).ravel(), (half * jnp.asarray(weights)).ravel()


@compiled_soon(static=("element",))
def _length(pose: Pose, weights: Array, element: str) -> Array:
    speed = safe_sqrt(pose.points[element].dr.squared())[: weights.size]
    return jnp.sum(weights * speed)
