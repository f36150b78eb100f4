"""Harmonics of a quantity over the crank angle: its Fourier series, by order of the crank's revolution.

In every panel of the cycle grid the interpolant of the quantity is integrated by a Gauss rule with enough nodes for the
highest order, so that jumps of loads between panels do not disturb the result.
Source: Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, ch. 19.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import legendre

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_sqrt
from linkjax._units import nearest
from linkjax.machine import Scene
from linkjax.measures._families import taken_apart
from linkjax.measures._family import FAMILIES, Asked, Family
from linkjax.measures._parts import Parts
from linkjax.mechanism import StructureError
from linkjax.motion import Grid, by_node, is_locked

MORE = 16  # nodes in a panel beyond those of the interpolant and two for each order


class Harmonics(NamedTuple):
    """The Fourier series mean + Σ amplitude cos(order φ - phase) of a quantity over the crank angle φ: its `mean` over
    the crank angle, its root mean square `rms` over the crank angle, and by `order` of the crank's revolution the
    `amplitude`, in the unit of the quantity, and the `phase` (rad, in [-π, π]; zero without amplitude)."""

    mean: Float[Array, ""]
    rms: Float[Array, ""]
    order: Float[Array, " orders"]
    amplitude: Float[Array, " orders"]
    phase: Float[Array, " orders"]


def harmonic_family(what: str, scene: Scene) -> tuple[Family, Asked]:
    """The family and the name taken apart of a quantity whose harmonics are asked for. Raises `StructureError` unless
    it is a quantity over the crank angle that this scene has, and a number with its sign."""
    asked = taken_apart(what)
    family = None if asked is None else FAMILIES[asked.family]
    if asked is None or family is None:
        known = [name for name, each in FAMILIES.items() if each.quantity is not None and not each.statistic]
        raise StructureError(what, "is not a quantity over the crank angle", nearest(what.partition(".")[0], known))
    bare = asked.angle is None and asked.window is None
    if family.quantity is None or family.statistic or not bare:
        raise StructureError(what, "is one number, and no quantity over the crank angle", "write e.g. drive_torque")
    if lacking := family.lacking(scene):
        raise StructureError(what, *lacking)
    names = family.names(scene)
    if asked.element not in (names if family.of else ("",)):
        raise StructureError(what, f"there is no {family.of} {asked.element!r}", nearest(asked.element, names))
    if not family.quantity.signed(scene, asked.element):
        raise StructureError(what, "is a vector", "write a quantity with a sign, e.g. drive_torque or x.D")
    return family, asked


def harmonics_of(of: Parts, what: Sequence[tuple[Family, Asked]], orders: int) -> list[Harmonics]:
    """The harmonics of several quantities up to the order `orders` of the crank's revolution; in a cycle of several
    turns also those between, by the reciprocal of the turns. Those of forces are NaN where friction locks the
    machine."""
    found = []
    for family, asked in what:
        assert family.quantity is not None
        regime = family.quantity.regime(of, family.motion)
        vectors = family.quantity.at(of, (asked.element,) if asked.element else ())(regime, of.nodes_in(regime))
        nodes = of.machine.run(by_node, regime.grid, vectors)
        series = of.machine.run(_series, regime.grid, nodes, orders=orders, turns=of.scene.cycle_turns)
        if family.quantity.forced and of.scene.friction:
            series = of.machine.run(_known, regime.grid, regime.forces(of.nodes_in(regime)).moves, series)
        found.append(series)
    return found


@compiled_soon
def _known(grid: Grid, moves: Array, series: Harmonics) -> Harmonics:
    return jax.tree.map(lambda part: jnp.where(is_locked(grid, moves), jnp.nan, part), series)


@compiled_soon(static=("orders", "turns"))
def _series(grid: Grid, nodes: Array, orders: int, turns: int) -> Harmonics:
    """The series from vectors at the nodes, shape (1, 2, panels, n), whose first part counts."""
    values, rule = nodes[0, 0], grid.rule
    x, w = legendre.leggauss(grid.n + 2 * orders + MORE)
    between = jnp.asarray(legendre.legvander(x, grid.n - 1) @ rule.spectrum, values.dtype)
    x, w = (jnp.asarray(part, values.dtype) for part in (x, w))
    fine = values @ between.T
    phi = grid.middle[:, None] + grid.half[:, None] * x[None]
    share = grid.half[:, None] * w[None] / grid.length
    order = jnp.asarray(np.arange(1, orders * turns + 1) / turns, values.dtype)
    angles = order[:, None, None] * phi[None]
    weighted = 2 * (share * fine)[None]
    a, b = (jnp.sum(weighted * part, axis=(1, 2)) for part in (jnp.cos(angles), jnp.sin(angles)))
    amplitude = safe_sqrt(a**2 + b**2)
    some = amplitude > 0
    phase = jnp.where(some, jnp.arctan2(b, jnp.where(some, a, 1.0)), 0.0)
    return Harmonics(jnp.sum(share * fine), safe_sqrt(jnp.sum(share * fine**2)), order, amplitude, phase)
