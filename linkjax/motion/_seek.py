"""Cycles of dE/dφ = f(φ, E) from a starting energy, and the search for periodic ones.

Following the cycle panel by panel from many starting energies shows every periodic solution in a range, whether it is
stable, and where a motion comes to rest.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from linkjax import _lapack
from linkjax._numerics import safe_divide
from linkjax.motion._collocation import KEPT, REST, Orbit, Panels, Rate, State, settled

INNER = 30  # the most steps of Newton's method in one panel
SEARCHES = 4  # of an interval with a periodic solution, every time in as many parts as there are starting energies


class Passed(NamedTuple):
    """A cycle from a starting energy: energies (J) at its end, at the nodes and at the first edges; the multiplier
    dE(end) / dE(start); whether the motion came to rest; and the values of the slopes' own unknowns."""

    end: Array
    slope: Array
    stopped: Bool[Array, ""]
    nodes: Array
    edges: Array
    near: Any


def follow(rate: Rate, panels: Panels, start: Array) -> Passed:
    """The cycle from a starting energy (J), panel by panel; without derivatives."""
    inside, w, eye = jnp.asarray(panels.inside), jnp.asarray(panels.rule.w), jnp.eye(panels.n)
    least = REST * panels.unit

    def one(carry, each):
        energy, slope, stopped = carry
        half, data = each

        def left(nodes):
            none = jnp.zeros_like(panels.unit)
            once, slopes = jnp.ones_like(nodes), lambda e: rate(panels.given, data, e, none, None)
            f, d, near = jax.jvp(slopes, (nodes,), (once,), has_aux=True)
            return energy + half * inside @ f - nodes, f, d, near

        def step(state):
            count, nodes, _ = state
            missing, _, d, _ = left(nodes)
            move = _lapack.solve(eye - half * inside * d[None], missing)
            new = jnp.maximum(nodes + move, KEPT * nodes)
            return count + 1, new, jnp.max(jnp.abs(new - nodes)) > 1e-10 * (panels.unit + jnp.max(jnp.abs(new)))

        first = (jnp.zeros((), jnp.int32), jnp.full(panels.n, energy), jnp.asarray(True))
        _, nodes, _ = jax.lax.while_loop(lambda s: s[2] & (s[0] < INNER), step, first)
        missing, f, d, near = left(nodes)
        gain = 1 + half * w @ (d * _lapack.solve(eye - half * inside * d[None], jnp.ones(panels.n)))
        end = energy + half * w @ f
        failed = jnp.max(jnp.abs(missing)) > 1e-6 * (panels.unit + energy)
        stopped = stopped | failed | ~(end > least) | ~(jnp.min(nodes) > least)
        safe = jnp.where(stopped, least, end)
        return (safe, jnp.where(stopped, 0.0, slope * gain), stopped), (nodes, energy, near)

    begin = (start, jnp.ones_like(start), start <= least)
    (end, slope, stopped), (nodes, edges, near) = jax.lax.scan(one, begin, (panels.half, panels.data))
    return Passed(jnp.where(stopped, 0.0, end), slope, stopped, nodes, edges, near)


class Sought(NamedTuple):
    """A periodic solution, or where none was found the motion nearest to one; the number of stable ones in the range
    that was searched, and whether this motion came to rest."""

    orbit: Orbit
    number: Array
    stopped: Array


def seek(rate: Rate, panels: Panels, starts: Array, wanted: Array) -> Sought:
    """The stable periodic solution with the starting energy nearest to `wanted` (J), on a relative scale, among those
    between increasing `starts` (J); without derivatives. Where there is none, the cycle with the greatest gain.

    Newton's method begins between the two cycles of which one gains and the other loses; where it fails, or leaves the
    interval, cycles are followed from more energies inside of it.
    """
    least = REST * panels.unit

    def again(loop: tuple) -> tuple:
        count, points, old, _ = loop
        passed = jax.vmap(lambda start: follow(rate, panels, start))(points)
        gain = passed.end - points
        falls = (gain[:-1] > 0) & (gain[1:] <= 0)
        far = jnp.abs(jnp.log(jnp.sqrt(points[:-1] * points[1:]) / wanted))
        first, found = jnp.argmin(jnp.where(falls, far, jnp.inf)), jnp.any(falls)
        best = jnp.argmax(jnp.where(points == points[-1], -jnp.abs(gain), gain))
        low, high = jnp.where(found, first, best), jnp.where(found, first + 1, best)
        below, above = (jax.tree.map(lambda leaf, at=at: leaf[at], passed) for at in (low, high))
        share = jnp.where(found, safe_divide(gain[low], gain[low] - gain[high]), 0.0)
        nodes, edges = (
            jnp.maximum(a + share * (b - a), least) for a, b in ((below.nodes, above.nodes), (below.edges, above.edges))
        )
        orbit = _closed(rate, panels, (nodes, edges, jnp.zeros_like(panels.unit)), below)
        inside = (orbit.edges[0] >= points[low]) & (orbit.edges[0] <= points[high])
        orbit = orbit._replace(solved=found & orbit.solved & inside)
        number = jnp.where(count == 0, jnp.sum(falls), old.number)
        more = jnp.exp(jnp.linspace(jnp.log(points[low]), jnp.log(points[high]), points.size))
        return count + 1, more, Sought(orbit, number, below.stopped), found & ~orbit.solved

    none = jnp.zeros_like(panels.unit)
    nodes = panels.half[:, None] * jnp.zeros(panels.n)[None]
    orbit = Orbit(nodes, nodes[:, 0], none, none, jnp.asarray(False), jax.tree.map(jnp.zeros_like, panels.near))
    begin = jnp.zeros((), jnp.int32), starts, Sought(orbit, jnp.zeros((), int), jnp.asarray(True)), jnp.asarray(True)
    return jax.lax.while_loop(lambda loop: loop[3] & (loop[0] < SEARCHES), again, begin)[2]


def near(rate: Rate, panels: Panels, start: Array) -> Sought:
    """The periodic solution near the cycle from one starting energy (J), stable or not; without derivatives."""
    passed = follow(rate, panels, start)
    state = (passed.nodes, passed.edges, jnp.zeros_like(panels.unit))
    orbit = _closed(rate, panels, state, passed)
    return Sought(orbit._replace(solved=orbit.solved & ~passed.stopped), jnp.ones((), int), passed.stopped)


def _closed(rate: Rate, panels: Panels, state: State, passed: Passed) -> Orbit:
    """The periodic solution from energies (J) near it; where it is not found, these, which are near a cycle that was
    followed."""
    least = REST * panels.unit
    state = (jnp.maximum(state[0], least), jnp.maximum(state[1], least), state[2])
    orbit = settled(rate, panels.closer(passed.near), state, None)
    nearest = Orbit(*state, passed.slope, jnp.asarray(False), passed.near)
    return jax.tree.map(lambda a, b: jnp.where(orbit.solved, a, b), orbit, nearest)
