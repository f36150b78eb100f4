"""Periodic solutions of dE/dφ = f(φ, E) on the panels of a cycle, by collocation at the Gauss nodes.

The unknown is the kinetic energy E. In every panel E is the polynomial with the slope f at the Gauss nodes, which is
the implicit Runge-Kutta method of Gauss. Newton's method takes all panels together; its last two steps carry the
derivatives. Before, the cycle is followed panel by panel from many starting energies: this shows every periodic
solution in a range, whether it is stable, and where a motion comes to rest.
Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, 1993, ch. II.7; Ascher, Mattheij and
Russell, Numerical Solution of Boundary Value Problems, 1995, ch. 5.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from linkjax import _lapack
from linkjax._numerics import safe_divide
from linkjax._tree import node
from linkjax.motion._panels import Rule, rule

INNER = 30  # the most steps of Newton's method in one panel
OUTER = 40  # the most steps of Newton's method for all panels together
HALVES = 60  # the most steps of the search for a starting energy
SAME = 1e-13  # relative: a step as small as this is the last
KEPT = 0.1  # the least part of an energy that a step of Newton's method leaves
CLOSED = 1e-9  # relative: a step as small as this is that of a solution
REST = 1e-10  # of the unit of energy: less than this is a standstill

Rate = Callable[[Any, Any, Array], Array]  # (what is given, data of the nodes of a panel, energies) -> slopes there


@node
class Panels:
    """Panels with `n` nodes each: half widths (rad), what is `given` for all nodes, `data` of the nodes (leaves with
    the axes of panels and nodes), and the unit of energy (J)."""

    half: Float[Array, " panels"]
    given: Any
    data: Any
    unit: Array
    n: int = eqx.field(static=True)

    @property
    def rule(self) -> Rule:
        """The Gauss-Legendre rule of every panel."""
        return rule(self.n)

    @property
    def inside(self) -> np.ndarray:
        """Integrals from the low end of a panel to its nodes, from values at the nodes."""
        return self.rule.at_nodes @ self.rule.primitive

    @property
    def weights(self) -> Array:
        """Weights of the nodes in an integral over the cycle (rad), shape (panels, n)."""
        return self.half[:, None] * jnp.asarray(self.rule.w)[None]

    def slopes(self, rate: Rate, nodes: Array) -> Array:
        """The slopes at all nodes."""
        return jax.vmap(lambda data, energy: rate(self.given, data, energy))(self.data, nodes)


Lack = Callable[[Panels, Array], Array]  # (panels, energies at all nodes) -> what is missing of the wanted motion


class Orbit(NamedTuple):
    """Energies (J) at the nodes, shape (panels, n), and at the first edge of every panel; an additional constant slope
    (N m) where one was wanted, otherwise zero; the Floquet multiplier of the cycle, dE(end) / dE(start); and what is
    left of the equations, relative to the unit of energy."""

    nodes: Array
    edges: Array
    constant: Array
    multiplier: Array
    left: Array


class Passed(NamedTuple):
    """A cycle from a starting energy: energies (J) at its end, at the nodes and at the first edges; the multiplier
    dE(end) / dE(start); and whether the motion came to rest."""

    end: Array
    slope: Array
    stopped: Bool[Array, ""]
    nodes: Array
    edges: Array


def follow(rate: Rate, panels: Panels, start: Array) -> Passed:
    """The cycle from a starting energy (J), panel by panel; without derivatives."""
    inside, w, eye = jnp.asarray(panels.inside), jnp.asarray(panels.rule.w), jnp.eye(panels.n)
    least = REST * panels.unit

    def one(carry, each):
        energy, slope, stopped = carry
        half, data = each

        def left(nodes):
            f, d = jax.jvp(lambda e: rate(panels.given, data, e), (nodes,), (jnp.ones_like(nodes),))
            return energy + half * inside @ f - nodes, f, d

        def step(state):
            count, nodes, _ = state
            missing, _, d = left(nodes)
            move = _lapack.solve(eye - half * inside * d[None], missing)
            new = jnp.maximum(nodes + move, KEPT * nodes)
            return count + 1, new, jnp.max(jnp.abs(new - nodes)) > 1e-10 * (panels.unit + jnp.max(jnp.abs(new)))

        first = (jnp.zeros((), jnp.int32), jnp.full(panels.n, energy), jnp.asarray(True))
        _, nodes, _ = jax.lax.while_loop(lambda s: s[2] & (s[0] < INNER), step, first)
        missing, f, d = left(nodes)
        gain = 1 + half * w @ (d * _lapack.solve(eye - half * inside * d[None], jnp.ones(panels.n)))
        end = energy + half * w @ f
        failed = jnp.max(jnp.abs(missing)) > 1e-6 * (panels.unit + energy)
        stopped = stopped | failed | ~(end > least) | ~(jnp.min(nodes) > least)
        safe = jnp.where(stopped, least, end)
        return (safe, jnp.where(stopped, 0.0, slope * gain), stopped), (nodes, energy)

    begin = (start, jnp.ones_like(start), start <= least)
    (end, slope, stopped), (nodes, edges) = jax.lax.scan(one, begin, (panels.half, panels.data))
    return Passed(jnp.where(stopped, 0.0, end), slope, stopped, nodes, edges)


class Sought(NamedTuple):
    """What was found in a range of starting energies: the cycle from the energy nearest to a periodic solution, whether
    there is one, the gain of energy (J) over this cycle, and the number of stable periodic solutions in the range."""

    passed: Passed
    found: Bool[Array, ""]
    gain: Array
    number: Array


def seek(rate: Rate, panels: Panels, starts: Array, wanted: Array) -> Sought:
    """The stable periodic solution with the starting energy nearest to `wanted` (J), on a relative scale, among those
    between increasing `starts` (J); without derivatives. Where there is none, the cycle with the greatest gain."""
    gain = jax.vmap(lambda start: follow(rate, panels, start).end - start)(starts)
    falls = (gain[:-1] > 0) & (gain[1:] <= 0)
    between = jnp.sqrt(starts[:-1] * starts[1:])
    first = jnp.argmin(jnp.where(falls, jnp.abs(jnp.log(between / wanted)), jnp.inf))
    found, low, high = jnp.any(falls), starts[first], starts[first + 1]
    best = starts[jnp.argmax(jnp.where(starts == starts[-1], -jnp.abs(gain), gain))]
    low, high = jnp.where(found, low, best), jnp.where(found, high, best)

    def step(state):
        count, low, high, at, _, _ = state
        passed = follow(rate, panels, at)
        rise = passed.end - at
        low, high = jnp.where(rise > 0, at, low), jnp.where(rise > 0, high, at)
        new = at + safe_divide(rise, 1 - passed.slope, jnp.inf)
        inside = (new > low) & (new < high) & ~passed.stopped
        new = jnp.where(inside, new, 0.5 * (low + high))
        return count + 1, low, high, new, passed, found & (jnp.abs(new - at) > 1e-9 * at)

    none, edges = jnp.zeros_like(low), jnp.zeros_like(panels.half)
    begin = Passed(none, none, jnp.asarray(True), edges[:, None] + jnp.zeros(panels.n, none.dtype)[None], edges)
    state = (jnp.zeros((), jnp.int32), low, high, jnp.sqrt(low * high), begin, jnp.asarray(True))
    passed = jax.lax.while_loop(lambda s: s[5] & (s[0] < HALVES), step, state)[4]
    return Sought(passed, found, passed.end - passed.edges[0], jnp.sum(falls))


def near(rate: Rate, panels: Panels, start: Array) -> Sought:
    """The cycle from one starting energy (J), of which a periodic solution is near; without derivatives."""
    passed = follow(rate, panels, start)
    return Sought(passed, ~passed.stopped, passed.end - start, jnp.ones((), int))


def settled(rate: Rate, panels: Panels, nodes: Array, edges: Array) -> tuple[Orbit, Bool[Array, ""]]:
    """The periodic solution from energies (J) near it, and whether it was found, is stable, and never rests."""
    none = jnp.zeros_like(panels.unit)
    (nodes, edges, _), left, multiplier = _repeated(rate, panels, (nodes, edges, none), None)
    runs = jnp.minimum(jnp.min(nodes), jnp.min(edges)) > REST * panels.unit
    return Orbit(nodes, edges, none, multiplier, left), (left < CLOSED) & runs & (jnp.abs(multiplier) < 1)


def _repeated(
    rate: Rate, panels: Panels, start: tuple[Array, Array, Array], lack: Lack | None
) -> tuple[tuple[Array, Array, Array], Array, Array]:
    """Newton's method until its steps are rounding: the state, the size of the last step, and the multiplier."""
    one, same = jnp.ones_like(panels.unit), max(SAME, 50 * float(jnp.finfo(panels.unit.dtype).eps))

    def again(state):
        return state[0] + 1, *_newton(rate, panels, state[1], lack)

    state = (jnp.zeros((), jnp.int32), start, jnp.inf * one, one)
    return jax.lax.while_loop(lambda s: (s[2] > same) & (s[0] < OUTER), again, state)[1:]


def periodic(rate: Rate, panels: Panels, nodes: Array, edges: Array, constant: Array, lack: Lack | None) -> Orbit:
    """The periodic solution near the energies (J) at the nodes and first edges. With `lack` a constant slope (N m) is
    added to `rate`, such that `lack` of the panels and the energies is zero. Differentiable: the last two steps of
    Newton's method are right up to the third derivative."""
    fixed = jax.lax.stop_gradient(panels)
    found = _repeated(rate, fixed, jax.lax.stop_gradient((nodes, edges, constant)), lack)[0]
    found, multiplier = jax.lax.stop_gradient(found), jnp.ones_like(constant)
    left = jnp.zeros_like(constant)
    for _ in range(2):
        found, left, multiplier = _newton(rate, panels, found, lack)
    return Orbit(found[0], found[1], found[2], multiplier, jax.lax.stop_gradient(left))


def gained(rate: Rate, panels: Panels, nodes: Array, edges: Array) -> Array:
    """Gain of energy (J) over the cycle from a fixed starting energy, for energies that satisfy the equations within
    every panel; with its first derivative."""
    fixed = jax.lax.stop_gradient((nodes, edges, jnp.zeros_like(panels.unit)))
    return _newton(rate, panels, fixed, None, closed=False)[1]


def _newton(
    rate: Rate, panels: Panels, at: tuple[Array, Array, Array], lack: Lack | None, closed: bool = True
) -> tuple[Any, Array, Array]:
    """One step of Newton's method for all panels: the new state, the relative size of the step, and the multiplier.
    Unless `closed`, the state is unchanged, and the second result is the gain of energy from the same start."""
    (nodes, edges, constant), half = at, panels.half[:, None]
    inside, w, eye = jnp.asarray(panels.inside), jnp.asarray(panels.rule.w), jnp.eye(panels.n)
    f, d = jax.jvp(lambda e: panels.slopes(rate, e), (nodes,), (jnp.ones_like(nodes),))
    f = f + constant
    right = [jnp.ones_like(nodes), edges[:, None] + half * f @ inside.T - nodes, half * jnp.sum(inside, axis=1)[None]]
    matrix = eye[None] - half[:, :, None] * inside[None] * d[:, None, :]
    unit, rest, extra = jnp.moveaxis(jax.vmap(_lapack.solve)(matrix, jnp.stack(right, axis=-1)), -1, 0)

    def ends(inside_panel):
        return panels.half * ((d * inside_panel) @ w)

    a = 1 + ends(unit)
    b = edges + panels.half * (f @ w) - jnp.roll(edges, -1) + ends(rest)
    c = 2 * panels.half + ends(extra)

    def chain(carry, each):
        (p, q, r), (a, b, c) = carry, each
        return (a * p, a * q + b, a * r + c), carry

    begin = (jnp.ones_like(constant), jnp.zeros_like(constant), jnp.zeros_like(constant))
    (p, q, r), along = jax.lax.scan(chain, begin, (a, b, c))
    if not closed:
        return (nodes, edges, constant), q, p
    if lack is None:
        first, more = safe_divide(q, 1 - p), jnp.zeros_like(constant)
    else:
        wanted = lack

        def along_by(first, more):
            moved = along[0] * first + along[2] * more
            return unit * moved[:, None] + extra * more

        moved = unit * along[1][:, None] + rest
        short, by_rest = jax.jvp(lambda e: wanted(panels, e), (nodes,), (moved,))
        by_first, by_more = (
            jax.jvp(lambda e: wanted(panels, e), (nodes,), (along_by(*which),))[1] for which in ((1.0, 0.0), (0.0, 1.0))
        )
        short = -short - by_rest
        size = (1 - p) * by_more + r * by_first
        first = safe_divide(q * by_more + r * short, size)
        more = safe_divide((1 - p) * short - by_first * q, size)
    step_edges = along[0] * first + along[1] + along[2] * more
    step_nodes = unit * step_edges[:, None] + rest + extra * more
    new_nodes = jnp.maximum(nodes + step_nodes, KEPT * nodes)
    new_edges = jnp.maximum(edges + step_edges, KEPT * edges)
    size = jnp.max(jnp.abs(step_nodes)) / (panels.unit + jnp.max(jnp.abs(nodes)))
    return (new_nodes, new_edges, constant + more), size, p
