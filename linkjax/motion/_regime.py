"""A regime: how the crank moves over the cycle, at constant speed or in the actual steady-state motion."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._numerics import nearest_turn, safe_divide, safe_sqrt, wrapped
from linkjax.machine import Scene
from linkjax.motion._extremum import Summit, climb, highest_in, phi_at, search, settle
from linkjax.motion._grid import Grid, Place
from linkjax.motion._panels import legendre_sum
from linkjax.motion._steady import Steady

FOLLOW = 3  # steps on the interpolants
RIVALS = 2  # panels whose summits are compared on the function itself
NEAR = 2e-4  # half width, in half panels, of the parabola that refines a peak on the function itself; in single
COARSE = 9.0  # precision this many times the square root of the rounding unit
ROUNDINGS = 4000.0  # rounding units of a peak: the least error stated
FAR = 3e-2  # the most that the parabola may move a peak


class Regime(eqx.Module):
    """A scene with its cycle grid and, for the actual motion, its steady state (`None`: constant nominal speed)."""

    scene: Scene
    grid: Grid
    steady: Steady | None = None

    def crank(self, place: Place) -> tuple[Array, Array]:
        """Crank speed (rad/s) and acceleration (rad/s²)."""
        if self.steady is None:
            return self.scene.speed * jnp.ones_like(place.phi), jnp.zeros_like(place.phi)
        return self.steady.at(self.scene, place)

    def side(self, place: Place) -> Array:
        """An angle inside the panel: limits at jumps are taken from this side."""
        return self.grid.middle[place.panel]


class Peak(NamedTuple):
    """Largest magnitude over the continuous cycle, its crank angle (rad), and an error bound (for the given motion)."""

    value: Array
    angle: Array
    error: Array


Components = Callable[[Regime, Place], Float[Array, "quantities parts"]]


def peaks(
    regime: Regime,
    components: Components,
    at_nodes: Float[Array, "quantities parts panels n"] | None = None,
) -> Peak:
    """Peaks of several quantities, each the length of a vector of smooth parts; leaves of shape (quantities,).

    `components(regime, place)` gives the vectors at one place. At a jump both one-sided limits count. The highest
    summits of the interpolants are compared on the functions themselves, and the best one is refined by a parabola.
    Values that are known at the nodes may be passed as `at_nodes`.
    """
    grid, fixed = regime.grid, jax.lax.stop_gradient(regime)
    at_nodes = _node_values(fixed, components) if at_nodes is None else jax.lax.stop_gradient(at_nodes)
    heights, series = _interpolated(grid, at_nodes)
    number = jnp.arange(at_nodes.shape[0])

    def squared(which, panel, x):
        vector = components(fixed, Place(panel, x, phi_at(grid, panel, x)))[which]
        return jnp.sum(vector * vector)

    def best(which, height, rows):
        summits, tops = [], jnp.max(height, axis=1)
        for _ in range(RIVALS):
            summits.append(search(jnp.asarray(grid.rule.fine), height, tops))
            tops = jnp.where(jnp.arange(tops.size) == summits[-1].panel, -jnp.inf, tops)
        summit = jax.tree.map(lambda *leaves: jnp.stack(leaves), *summits)
        x = jax.vmap(lambda one: _follow(rows[:, one.panel], one))(summit)
        first = jnp.argmax(jax.vmap(lambda panel, x: squared(which, panel, x))(summit.panel, x))
        return summit.panel[first], x[first]

    panel, followed = jax.vmap(best)(number, heights, series)
    x, gained = jax.vmap(lambda which, panel, x: _sharpened(lambda x: squared(which, panel, x), x))(
        number, panel, followed
    )

    def value(which, panel, x):
        place = settle(grid, panel, x)
        vector = components(regime, place)[which]
        return safe_sqrt(jnp.sum(vector * vector)), place.phi

    top, phi = jax.vmap(value)(number, panel, x)
    # the interpolants may hide another summit, higher by as much as their last terms
    hidden = jnp.sqrt(jnp.sum(jnp.sum(jnp.abs(series[..., -2:]), axis=-1) ** 2, axis=1))
    places = grid.middle[:, None] + grid.half[:, None] * jnp.asarray(grid.rule.fine)[None]
    away = jnp.abs(nearest_turn(places[None] - phi[:, None, None], regime.scene.cycle))
    near = away < (3 / grid.n) * (grid.half[None, :] + grid.half[panel][:, None])[..., None]
    near &= (jnp.abs(x) < 1)[:, None, None]  # a summit at the end of a panel may continue in the next one
    rival = jnp.max(jnp.where(near, 0.0, jnp.sqrt(heights) + hidden[..., None]), axis=(1, 2)) - top
    doubt = safe_divide(gained, 2 * top) + jnp.maximum(rival, 0.0) + ROUNDINGS * jnp.finfo(top.dtype).eps * top
    return Peak(top, wrapped(phi, regime.scene.cycle), jax.lax.stop_gradient(doubt))


def _interpolated(grid: Grid, at_nodes: Array) -> tuple[Array, Array]:
    """Squared lengths on the search grid of every panel, and the series of the parts."""
    fine = at_nodes @ jnp.asarray(grid.rule.to_fine.T)
    heights = functools.reduce(jnp.add, [fine[:, i] * fine[:, i] for i in range(fine.shape[1])])  # faster than jnp.sum
    return heights, at_nodes @ jnp.asarray(grid.rule.spectrum.T)


def _follow(rows: Array, summit: Summit) -> Array:
    """Refine a summit of the search grid on the interpolant, whose series are `rows`."""

    def slope(x):
        value, rate = jax.jvp(lambda x: legendre_sum(rows, x), (x,), (jnp.ones_like(x),))
        return 2 * jnp.sum(value * rate)

    return climb(slope, summit, FOLLOW)


def _sharpened(squared: Callable[[Array], Array], followed: Array) -> tuple[Array, Array]:
    """The coordinate of a summit by a parabola through the function itself, and the increase of the square by it."""
    near = max(NEAR, COARSE * math.sqrt(jnp.finfo(followed.dtype).eps))
    centre = jnp.clip(followed, -1.0 + near, 1.0 - near)
    y = jax.vmap(squared)(centre + near * jnp.asarray([-1.0, 0.0, 1.0]))
    bend, tilt = y[2] - 2 * y[1] + y[0], 0.5 * (y[2] - y[0])
    step = jnp.where(bend < 0, -near * safe_divide(tilt, bend), jnp.sign(tilt))
    x = jnp.clip(centre + jnp.clip(step, -FAR, FAR), -1.0, 1.0)
    gained = jnp.abs(tilt * (jnp.clip(centre + step, -1.0, 1.0) - followed)) / near
    return jax.lax.stop_gradient(x), gained


class Rows(eqx.Module):
    """Vectors, the longest of which is a peak, with the crank angle (rad) of each; for `signed` rows of one part the
    largest value is the peak. An optimiser that treats peaks exactly keeps all rows below a bound."""

    vectors: Float[Array, "rows parts"]
    angle: Float[Array, " rows"]
    signed: bool = eqx.field(static=True, default=False)

    def size(self) -> Float[Array, " rows"]:
        """The size of every row: its length, or its signed value."""
        return self.vectors[:, 0] if self.signed else safe_sqrt(jnp.sum(self.vectors**2, axis=1))


def rows(regime: Regime, components: Components, at_nodes: Array | None = None) -> Rows:
    """Vectors over the continuous cycle, differentiable: those at every node, and those of `summits`."""
    if at_nodes is None:
        at_nodes = _node_values(regime, components)
    tops, parts = summits(regime, components, at_nodes), at_nodes.shape[1]
    vectors = jnp.concatenate([jnp.moveaxis(at_nodes, 1, -1).reshape((-1, parts)), tops.vectors.reshape((-1, parts))])
    nodes = jnp.broadcast_to(regime.grid.nodes, (at_nodes.shape[0], *regime.grid.nodes.shape))
    nodes = wrapped(jax.lax.stop_gradient(nodes), regime.scene.cycle)
    return Rows(vectors, jnp.concatenate([nodes.ravel(), tops.angle.ravel()]))


class Summits(NamedTuple):
    """Vectors at the ends and summits of every panel, four per panel, and their crank angles (rad)."""

    vectors: Float[Array, "quantities places parts"]
    angle: Float[Array, "quantities places"]


def summits(regime: Regime, components: Components, at_nodes: Float[Array, "quantities parts panels n"]) -> Summits:
    """Vectors at both ends of every panel (both limits at every jump) and at the two highest summits of every panel.
    Each summit is found as in `peaks` and refined to rounding. Differentiable, but not with respect to `at_nodes`."""
    grid, fixed = regime.grid, jax.lax.stop_gradient(regime)
    quantities, parts, panels, n = at_nodes.shape
    heights, series = _interpolated(grid, jax.lax.stop_gradient(at_nodes))
    fine, number = jnp.asarray(grid.rule.fine), jnp.arange(panels, dtype=jnp.int32)

    def two(which, height, coefficients, panel):
        def squared(x):
            vector = components(fixed, Place(panel, x, phi_at(fixed.grid, panel, x)))[which]
            return jnp.sum(vector * vector)

        first = _follow(coefficients, highest_in(fine, height, panel))
        rises = jnp.concatenate([jnp.ones(1, bool), height[1:] >= height[:-1]])
        falls = jnp.concatenate([height[:-1] >= height[1:], jnp.ones(1, bool)])
        other = jnp.where(rises & falls & (jnp.abs(fine - first) > 2.5 / n), height, 0.0)
        both = jnp.stack([first, _follow(coefficients, highest_in(fine, other, panel))])
        # twice, to rounding: an optimiser is sensitive to the error
        return jax.vmap(lambda x: _sharpened(squared, _sharpened(squared, x)[0])[0])(both)

    def at(which, panel, x):
        place = settle(grid, panel, x)
        return components(regime, place)[which], place.phi

    def in_panels(which, heights, series):
        x = jax.vmap(lambda h, c, p: two(which, h, c, p), in_axes=(0, 1, 0))(heights, series, number)
        x = jnp.concatenate([jnp.broadcast_to(jnp.asarray([-1.0, 1.0]), (panels, 2)), x], axis=1)
        return jax.vmap(lambda panel, x: jax.vmap(lambda x: at(which, panel, x))(x))(number, x)

    tops, angles = jax.vmap(in_panels)(jnp.arange(quantities), heights, series)
    angles = wrapped(jax.lax.stop_gradient(angles), regime.scene.cycle)
    return Summits(tops.reshape((quantities, -1, parts)), angles.reshape((quantities, -1)))


def _node_values(regime: Regime, components: Components) -> Array:
    """The vectors at every node, shape (quantities, parts, panels, n)."""
    places = jax.tree.map(jnp.ravel, regime.grid.node_places())
    flat = jax.vmap(lambda place: components(regime, place), out_axes=-1)(places)
    return flat.reshape((*flat.shape[:2], *regime.grid.nodes.shape))
