"""Periodic solutions of dE/dφ = f(φ, E) on the panels of a cycle, by collocation at the Gauss nodes.

The unknown is the kinetic energy E. In every panel E is the polynomial with the slope f at the Gauss nodes, which is
the implicit Runge-Kutta method of Gauss. Newton's method takes all panels together. Its linear equations are solved by
an integrating factor, without matrices, as the solution of E' = d E + g is known; where this does not converge, as with
a stiff motor, by elimination. Derivatives follow from the equations themselves. The slopes may have unknowns of their
own, as the frictions of joints: every step of Newton's method takes one step for them, too.
Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, 1993, ch. II.7; Ascher, Mattheij and
Russell, Numerical Solution of Boundary Value Problems, 1995, ch. 5.
"""

from __future__ import annotations

import dataclasses
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

OUTER = 40  # the most steps of Newton's method for all panels together
QUICK = 12  # the most steps of it with an integrating factor
MORE = 2  # steps of which the size is small, as the convergence may be linear
STEEP = 30.0  # the greatest exponent of an integrating factor
KEPT = 0.1  # the least part of an energy that a step of Newton's method leaves
CLOSED = 1e-8  # relative: a step as small as this is that of a solution
REST = 1e-10  # of the unit of energy: less than this is a standstill

# (what is given, data of the nodes of a panel, energies, additional constant slope, values near unknowns of its own, or
# None) -> other slopes there, and values nearer to those unknowns
Rate = Callable[[Any, Any, Array, Array, Any], tuple[Array, Any]]


@node
class Panels:
    """Panels with `n` nodes each: half widths (rad), what is `given` for all nodes, `data` of the nodes (leaves with
    the axes of panels and nodes), the unit of energy (J), and values near the unknowns that the slopes have of their
    own (leaves with the axis of panels; None without such unknowns, or where they are to be found afresh); and whether
    slopes depend on the additional constant one."""

    half: Float[Array, " panels"]
    given: Any
    data: Any
    unit: Array
    near: Any
    n: int = eqx.field(static=True)
    coupled: bool = eqx.field(static=True)

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

    def slopes(self, rate: Rate, nodes: Array, constant: Array | None = None) -> Array:
        """The slopes at all nodes, without the additional constant one."""
        return self.rates(rate, nodes, constant)[0]

    def rates(self, rate: Rate, nodes: Array, constant: Array | None = None) -> tuple[Array, Any]:
        """The same, and values nearer to the slopes' own unknowns."""
        more = jnp.zeros_like(self.unit) if constant is None else constant
        rates = jax.vmap(lambda data, energy, near: rate(self.given, data, energy, more, near))
        return rates(self.data, nodes, self.near)

    def closer(self, near: Any) -> Panels:
        """The panels with values nearer to these unknowns."""
        return dataclasses.replace(self, near=jax.lax.stop_gradient(near))

    def by_constant(self, rate: Rate, nodes: Array, constant: Array) -> Array | None:
        """Derivatives of all slopes with respect to the additional constant one; None if they are one."""
        if not self.coupled:
            return None
        return 1 + jax.jvp(lambda c: self.slopes(rate, nodes, c), (constant,), (jnp.ones_like(constant),))[1]


Lack = Callable[[Panels, Array], Array]  # (panels, energies at all nodes) -> what is missing of the wanted motion
State = tuple[Array, Array, Array]  # energies at the nodes and at the first edges (J), additional constant slope (N m)


class Orbit(NamedTuple):
    """Energies (J) at the nodes, shape (panels, n), and at the first edge of every panel; an additional constant slope
    (N m) where one was wanted, otherwise zero; the Floquet multiplier of the cycle, dE(end) / dE(start); whether
    these are a solution; and the values of the slopes' own unknowns."""

    nodes: Array
    edges: Array
    constant: Array
    multiplier: Array
    solved: Bool[Array, ""]
    near: Any

    @property
    def state(self) -> State:
        """The unknowns."""
        return self.nodes, self.edges, self.constant


class Progress(NamedTuple):
    """A state, the slopes' own unknowns, the multiplier, and how many small steps are still wanted."""

    state: State
    near: Any
    multiplier: Array
    spare: Array


def settled(rate: Rate, panels: Panels, start: State, lack: Lack | None, small: Any = CLOSED) -> Orbit:
    """The periodic solution from energies (J) near it, by Newton's method; without derivatives. With `lack` a constant
    slope (N m) is added to `rate`, such that `lack` of the panels and the energies is zero. A step as `small` as this,
    relative, is that of a solution; where that is more than `CLOSED`, one is enough."""
    one, enough = jnp.ones_like(panels.unit), 50 * float(jnp.finfo(panels.unit.dtype).eps)
    spare = jnp.where(small > CLOSED, 1, MORE).astype(jnp.int32)
    small = jnp.maximum(small, enough)

    def repeated(begin: Progress, most: int, quick: bool) -> Progress:
        def again(loop: tuple[Array, Progress]) -> tuple[Array, Progress]:
            count, (state, near, _, spare) = loop
            state, size, multiplier, near = _newton(rate, panels.closer(near), state, lack, quick)
            return count + 1, Progress(state, near, multiplier, spare - jnp.where(size <= small, 1, 0))

        loop = (jnp.zeros((), jnp.int32), begin)
        return jax.lax.while_loop(lambda loop: (loop[1].spare > 0) & (loop[0] < most), again, loop)[1]

    begin = Progress(start, panels.near, one, spare)
    found = repeated(begin, QUICK, True)
    there = found.spare <= 0
    begin = jax.tree.map(lambda a, b: jnp.where(there, a, b), found, begin)._replace(multiplier=found.multiplier)
    (nodes, edges, constant), near, multiplier, spare = repeated(begin, OUTER, False)
    return Orbit(nodes, edges, constant, multiplier, spare <= 0, near)


def lasting(panels: Panels, orbit: Orbit) -> Bool[Array, ""]:
    """Whether a periodic solution was found that is stable and never rests."""
    runs = jnp.minimum(jnp.min(orbit.nodes), jnp.min(orbit.edges)) > REST * panels.unit
    return orbit.solved & runs & (jnp.abs(orbit.multiplier) < 1)


def implicit(rate: Rate, panels: Panels, state: State, lack: Lack | None) -> State:
    """A periodic solution with its derivatives, of any order."""

    @jax.custom_jvp
    def root(panels: Panels, state: State) -> State:
        return state

    @root.defjvp
    def _rule(given, moving):
        panels, state = given[0], root(*given)
        push = jax.jvp(lambda panels: _left(rate, panels, state, lack), (panels,), (moving[0],))[1]
        return state, _solved(panels, state[0], *_slope(rate, panels, state), push, lack, False)[0]

    return root(panels, jax.lax.stop_gradient(state))


def gained(rate: Rate, panels: Panels, state: State) -> Array:
    """Gain of energy (J) over the cycle from a fixed starting energy, for energies that satisfy the equations within
    every panel; with its first derivative."""

    @jax.custom_jvp
    def gain(panels: Panels, state: State) -> Array:
        return jnp.sum(_left(rate, panels, state, None)[1])

    @gain.defjvp
    def _rule(given, moving):
        panels, state = given
        inner, outer, _ = jax.jvp(lambda panels: _left(rate, panels, state, None), (panels,), (moving[0],))[1]
        d, _ = _slope(rate, panels, state)
        unit, rest = _exactly(panels, d, [jnp.ones_like(inner), inner])
        return gain(*given), _chained(_over(panels, d, unit) + 1, [outer + _over(panels, d, rest)])[0][1]

    return gain(panels, jax.lax.stop_gradient(state))


def _left(rate: Rate, panels: Panels, state: State, lack: Lack | None, slopes: Array | None = None) -> State:
    """What is left of the equations, for the nodes and ends of all panels (J), and of the wanted motion."""
    nodes, edges, constant = state
    f = (panels.slopes(rate, nodes, constant) if slopes is None else slopes) + constant
    inner = edges[:, None] + panels.half[:, None] * f @ jnp.asarray(panels.inside).T - nodes
    outer = edges + panels.half * (f @ jnp.asarray(panels.rule.w)) - jnp.roll(edges, -1)
    return inner, outer, jnp.zeros_like(constant) if lack is None else lack(panels, nodes)


def _slope(rate: Rate, panels: Panels, state: State) -> tuple[Array, Array | None]:
    """Derivatives of the slopes with respect to the energies at the nodes, and to the additional constant slope."""
    nodes, _, constant = state
    d = jax.jvp(lambda e: panels.slopes(rate, e, constant), (nodes,), (jnp.ones_like(nodes),))[1]
    return d, panels.by_constant(rate, nodes, constant)


def _over(panels: Panels, d: Array, inside: Array) -> Array:
    """The change over every panel for changes inside, shape (panels, n)."""
    return panels.half * ((d * inside) @ jnp.asarray(panels.rule.w))


def _chained(a: Array, rest: list[Array]) -> tuple[list[Array], list[Array]]:
    """Panels one after the other: x becomes a x + b. For x = 1 and b = 0, and for x = 0 and every b of `rest`: x after
    the last panel and before every panel."""
    one = jnp.ones_like(a[0])

    def chain(carry, each):
        a, *rest = each
        return [a * carry[0], *(a * x + b for x, b in zip(carry[1:], rest, strict=True))], carry

    return jax.lax.scan(chain, [one, *(jnp.zeros_like(one) for _ in rest)], [a, *rest])


def _newton(
    rate: Rate, panels: Panels, state: State, lack: Lack | None, quick: bool
) -> tuple[State, Array, Array, Any]:  # fmt: skip
    """One step of Newton's method for all panels: the new state, the relative size of the step, the multiplier, and
    values nearer to the slopes' own unknowns."""
    nodes, edges, constant = state
    f, d, near = jax.jvp(lambda e: panels.rates(rate, e, constant), (nodes,), (jnp.ones_like(nodes),), has_aux=True)
    left, by_more = _left(rate, panels, state, lack, f), panels.by_constant(rate, nodes, constant)
    (inner, outer, more), p = _solved(panels, nodes, d, by_more, left, lack, quick)
    new_nodes = jnp.maximum(nodes + inner, KEPT * nodes)
    new_edges = jnp.maximum(edges + outer, KEPT * edges)
    size = jnp.max(jnp.abs(inner)) / (panels.unit + jnp.max(jnp.abs(nodes)))
    return (new_nodes, new_edges, constant + more), size, p, near


def _solved(
    panels: Panels, nodes: Array, d: Array, by_constant: Array | None, left: State, lack: Lack | None, quick: bool
) -> tuple[State, Array]:  # fmt: skip
    """The change of the state that makes up for what is `left` of the linear equations, and the multiplier. With
    `quick` up to the truncation error of the panels."""
    inner, outer, short = left
    right, ends = [jnp.ones_like(nodes), inner], [jnp.zeros_like(outer), outer]
    if lack is not None:
        inside = jnp.asarray(panels.inside)
        over = jnp.sum(inside, axis=1)[None] if by_constant is None else by_constant @ inside.T
        right += [panels.half[:, None] * over]
        ends += [2 * panels.half if by_constant is None else panels.half * (by_constant @ jnp.asarray(panels.rule.w))]
    inside = (_by_factor if quick else _exactly)(panels, d, right)
    a, *rest = (end + _over(panels, d, part) for end, part in zip(ends, inside, strict=True))
    (p, q, *r), along = _chained(1 + a, rest)
    if lack is None:
        first, more, parts = safe_divide(q, 1 - p), jnp.zeros_like(p), [1.0]
    else:
        wanted, (unit, rest, extra) = lack, inside
        first_way, more_way = unit * along[0][:, None], unit * along[2][:, None] + extra
        by_rest, by_first, by_more = (
            jax.jvp(lambda e: wanted(panels, e), (nodes,), (way,))[1]
            for way in (unit * along[1][:, None] + rest, first_way, more_way)
        )
        short = -short - by_rest
        size = (1 - p) * by_more + r[0] * by_first
        first = safe_divide(q * by_more + r[0] * short, size)
        more = safe_divide((1 - p) * short - by_first * q, size)
        parts = [1.0, more]
    edges = along[0] * first + sum(share * x for share, x in zip(parts, along[1:], strict=True))
    step = inside[0] * edges[:, None] + sum(share * x for share, x in zip(parts, inside[1:], strict=True))
    return (step, edges, more), p


def _exactly(panels: Panels, d: Array, right: list[Array]) -> list[Array]:
    """x of x - A (d x) = right in every panel, where A integrates from its low end, for several right-hand sides. Each
    is solved by itself, as not all depend on the tangents of a derivative."""
    matrix = jnp.eye(panels.n)[None] - panels.half[:, None, None] * jnp.asarray(panels.inside)[None] * d[:, None, :]

    def every(matrix: Array, right: list[Array]) -> list[Array]:
        found = _lapack.solver(matrix)
        return [found(each) for each in right]

    return jax.vmap(every)(matrix, [jnp.broadcast_to(each, d.shape) for each in right])


def _by_factor(panels: Panels, d: Array, right: list[Array]) -> list[Array]:
    """The same up to the truncation error: x = right + u A (d right / u) with u = exp(A d). Where u is too steep, it is
    not the solution."""
    half, inside = panels.half[:, None], jnp.asarray(panels.inside)
    u = jnp.exp(jnp.clip(half * (d @ inside.T), -STEEP, STEEP))
    return [each + u * half * ((d * each / u) @ inside.T) for each in right]
