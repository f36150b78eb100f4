"""Extremes of quantities over the continuous cycle, or over a window of crank angle: values, and rows for an optimiser.

The largest of numbers with a sign is found as the greatest length of these numbers, raised above zero; the smallest as
the greatest distance from above.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax._numerics import largest, safe_sqrt, smallest
from linkjax.machine import Scene
from linkjax.measures._parts import Parts
from linkjax.measures._quantities import QUANTITIES, Quantity, Vectors
from linkjax.measures._structure import Elements
from linkjax.motion import CLOSER, DEEPER, At, Grid, Regime, Rows, Summits, Wanted, by_node, every_row, peaks

Statistic = Literal["peak", "max", "min"]
RAISED = 2.0  # times the largest magnitude: numbers are raised by so much
Signs = tuple[tuple[float, bool], ...]


class Extreme(NamedTuple):
    """The largest magnitude ("peak"), or the largest or smallest value, of a quantity over its elements; at constant
    speed or in the actual motion; over the cycle, or between two crank angles (rad)."""

    quantity: Quantity
    elements: Elements
    statistic: Statistic
    constant: bool
    window: tuple[float, float] | None = None

    @property
    def still(self) -> bool:
        """Whether it does not depend on the actual motion."""
        return self.constant or not self.quantity.moves

    @property
    def asks(self) -> str:
        """What the machine must be asked for."""
        return self.quantity.asks if self.still else "dynamics"

    @property
    def held(self) -> tuple[float, ...]:
        """Crank angles (rad) at which the range ends, or the quantity jumps: these places do not move."""
        return (*((0.0,) if self.quantity.name == "angle" else ()), *(self.window or ()))

    def signs(self, scene: Scene) -> Signs:
        """For every element: one where the largest number is looked for, minus one for the smallest, zero for the
        greatest length; and whether the number is the length of a vector."""
        found = []
        for name in self.elements or ("",):
            vector = not self.quantity.signed(scene, name)
            way = {"peak": 0.0, "max": 0.0 if vector else 1.0, "min": -1.0}[self.statistic]
            found.append((way, vector))
        return tuple(found)

    def numbers(self, scene: Scene) -> bool:
        """Whether they are numbers with a sign."""
        return all(self.quantity.signed(scene, name) for name in self.elements or ("",))

    def deep(self, scene: Scene) -> bool:
        """Whether it is the smallest length of a vector, which may have a sharp minimum between two nodes."""
        return self.statistic == "min" and not self.numbers(scene)


class Looked(NamedTuple):
    """Extremes of one motion as greatest lengths: of which vectors, by how much numbers are raised, their signs."""

    wanted: Wanted
    above: Float[Array, " quantities"]
    signs: Signs


def looked(of: Parts, extremes: Sequence[Extreme]) -> Looked:
    """What is looked for by extremes of one motion, all with kinks or all without, over the whole cycle: windows are
    left to the rows."""
    regime, machine = extremes[0].quantity.regime(of, not extremes[0].still), of.machine
    signs = tuple(sign for each in extremes for sign in each.signs(of.scene))
    elements: dict[str, dict[str, int]] = {}  # of every quantity, once
    for each in extremes:
        known = elements.setdefault(each.quantity.name, {})
        for name in each.elements:
            known.setdefault(name, len(known))
    order = sorted(elements, key=lambda name: QUANTITIES[name].asks != "gaps")  # a sample with gaps has a pose, too
    asked = [QUANTITIES[quantity].at(of, tuple(elements[quantity])) for quantity in order]
    which = tuple(
        (order.index(each.quantity.name), elements[each.quantity.name][name] if name else 0)
        for each in extremes
        for name in each.elements or ("",)
    )

    def raw(regime: Regime, at: At) -> Vectors:
        return machine.run(_numbers, [one(regime, at) for one in asked], which=which, signs=signs)

    nodes = machine.run(by_node, regime.grid, raw(regime, of.nodes_in(regime)))
    nodes, above = machine.run(_above, nodes, signs=signs)

    def components(regime: Regime, at: At) -> Vectors:
        return machine.run(_raised, raw(regime, at), above, signs=signs)

    asks = "dynamics" if any(each.asks == "dynamics" for each in extremes) else extremes[0].asks
    held = tuple(dict.fromkeys(angle for each in extremes for angle in each.held))
    return Looked(Wanted(regime, components, nodes, None, asks, held), above, signs)


@compiled_soon(static=("which", "signs"))
def _numbers(found: list[Array], which: tuple[tuple[int, int], ...], signs: Signs) -> Vectors:
    """The vectors that belong to all extremes, from those of every quantity; lengths where the smallest is looked for.
    `which` are the numbers of a quantity and of its element."""
    firsts = np.cumsum([0, *(len(each) for each in found)])
    every = jnp.concatenate(found)[np.asarray([firsts[quantity] + element for quantity, element in which])]
    lengths = [i for i, (way, vector) in enumerate(signs) if way and vector]
    if not lengths:
        return every
    size = jnp.sum(every[np.asarray(lengths)] ** 2, axis=1)  # smooth where the length has a sharp minimum
    return every.at[np.asarray(lengths)].set(jnp.stack([size, jnp.zeros_like(size)], axis=1))


@compiled_soon(static=("signs",))
def _above(nodes: Array, signs: Signs) -> tuple[Array, Array]:
    """By how much numbers are raised; and the values at the nodes, raised."""
    above = jax.lax.stop_gradient(RAISED * jnp.max(jnp.abs(nodes[:, 0]), axis=(1, 2)))
    above = jnp.where(above > 0, above, 1.0)
    return _raised.function(nodes, above, signs), above


@compiled_soon(static=("signs",))
def _raised(numbers: Array, above: Array, signs: Signs) -> Float[Array, "elements 2 *places"]:
    if not any(way for way, _ in signs):
        return numbers
    ways, above = _ways(signs, numbers.ndim - 1), above.reshape((-1, *[1] * (numbers.ndim - 2)))
    first = jnp.where(ways == 0, numbers[:, 0], above + ways * numbers[:, 0])
    return numbers.at[:, 0].set(first)


def _ways(signs: Signs, axes: int) -> Array:
    """The senses, as an array of so many axes."""
    return jnp.asarray([way for way, _ in signs], float).reshape((-1, *[1] * (axes - 1)))


def lowered(found: Array, above: Array, signs: Signs) -> Array:
    """The numbers themselves, from greatest lengths, shape (quantities, ...)."""
    ways = _ways(signs, found.ndim)
    above = above.reshape(ways.shape)
    own = jnp.where(ways == 0, found, jnp.where(ways > 0, found - above, above - found))
    lengths = np.asarray([bool(way) and vector for way, vector in signs])
    return own if not lengths.any() else jnp.where(lengths.reshape(ways.shape), safe_sqrt(own), own)


def extremes_of(of: Parts, extremes: Sequence[Extreme]) -> list[Array]:
    """The values of extremes; those of one motion and one grid are found together."""
    found: dict[int, Array] = {}
    by_rows = [i for i, each in enumerate(extremes) if each.window is not None or each.deep(of.scene)]
    for still, kinks in itertools.product((True, False), (False, True)):
        which = [
            i for i, each in enumerate(extremes)
            if i not in by_rows and each.still is still and each.quantity.kinked(of.scene) is kinks
        ]  # fmt: skip
        if not which:
            continue
        look = looked(of, [extremes[i] for i in which])
        regime, components, nodes = look.wanted[:3]
        held = tuple(extremes[i].held for i in which for _ in extremes[i].elements or ("",))
        tops = lowered(peaks(regime, components, nodes, held if any(held) else ()).value, look.above, look.signs)
        first = 0
        for i in which:
            size = len(extremes[i].elements or ("",))
            own = tops[first : first + size]
            most = smallest if extremes[i].statistic == "min" else largest
            found[i] = own[0] if size == 1 else most(own)
            first += size
    for i, own in zip(by_rows, every_row([rows_of(of, extremes[i]) for i in by_rows]), strict=True):
        found[i] = smallest(own.size()) if extremes[i].statistic == "min" else largest(own.size())
    return [found[i] for i in range(len(extremes))]


def rows_of(of: Parts, extreme: Extreme) -> Wanted:
    """All values that may be the extreme; those of an extreme with a sign have one element."""
    look = looked(of, [extreme])
    ways = {way for way, _ in look.signs}
    if extreme.window is None and ways == {0.0}:
        return look.wanted
    grid = look.wanted.regime.grid
    inside = jnp.repeat(in_window(grid, extreme.window), 4)  # two ends and two summits of every panel

    def finished(found: Summits) -> Rows:
        return of.machine.run(_rows, found, look.above, inside, signs=look.signs)

    closer = DEEPER if extreme.deep(of.scene) else CLOSER
    return look.wanted._replace(finish=finished, closer=closer)


@compiled_soon(static=("signs",))
def _rows(found: Summits, above: Array, inside: Array, signs: Signs) -> Rows:
    vectors = jnp.where(inside[None, :, None], found.vectors, 0.0)  # zero is never the greatest length
    angle = jnp.where(inside[None], found.angle, jnp.nan).ravel()
    if all(way == 0 for way, _ in signs):
        return Rows(vectors.reshape((-1, 2)), angle)
    return Rows(lowered(vectors[..., 0], above, signs).reshape((-1, 1)), angle, signed=True)


def in_window(grid: Grid, window: tuple[float, float] | None) -> Array:
    """Which panels lie between two crank angles, at which panels end; all of them without a window."""
    if window is None:
        return jnp.ones_like(grid.middle, dtype=bool)
    on, off = window
    wide = (off - on) % grid.length or grid.length
    return jnp.mod(jax.lax.stop_gradient(grid.middle) - on, grid.length) < wide
