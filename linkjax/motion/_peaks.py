"""Peaks over the continuous cycle, of quantities that are evaluated at many places at once."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax._numerics import nearest_turn, once, safe_divide, safe_sqrt, taken, wrapped
from linkjax.motion._edges import has_width
from linkjax.motion._extremum import Held, Summit, climb, search, settle, summit_heights
from linkjax.motion._grid import Grid, Place
from linkjax.motion._nodes import node_places
from linkjax.motion._panels import polynomials
from linkjax.motion._regime import Components, Regime

FOLLOW = 3  # steps on the interpolants
RIVALS = 2  # panels whose summits are compared on the function itself
NEAR = 2e-4  # half width, in half panels, of the parabola that refines a peak on the function itself
CLOSER = 16.0  # the half width of a second parabola is smaller by this
DEEPER = 64.0  # and by this for a sharp minimum, whose parabola ends where its arms begin
COARSE = 9.0  # in single precision: this many times the square root of the rounding unit
ROUNDINGS = 4000.0  # rounding units of a peak: the least error stated
FAR = 3e-2  # the most that the parabola may move a peak
TIED, APART = 1e-9, 1e-3  # summits are equal within this, relative, and two if they are so far apart (rad)


class Peak(NamedTuple):
    """Largest magnitude over the continuous cycle, its crank angle (rad), and an error bound (for the given motion);
    and the crank angle of another summit of equal height (NaN if there is none): there the peak has no gradient, only
    that of either summit."""

    value: Array
    angle: Array
    error: Array
    tied: Array


def peaks(
    regime: Regime,
    components: Components,
    at_nodes: Any = None,
    held: Held = (),
) -> Peak:
    """Peaks of several quantities, each the length of a vector of smooth parts; leaves of shape (quantities,).

    `components(regime, at)` gives the vectors at several places (see `Regime.at`). At a jump both one-sided limits
    count. The highest summits of the interpolants are compared on the functions themselves, and the best one is refined
    by a parabola. Values that are known at the nodes may be passed as `at_nodes`, shape (quantities, parts, panels, n).
    For `held` see `settle`.

    Two summits are compared, because interpolants err where large forces cancel. A third one changed no value beyond
    the error bound, and cost 6 µs of 28 in the gradient.
    """
    machine, grid, still = regime.machine, regime.grid, regime.still
    at_nodes = node_vectors(still, components) if at_nodes is None else at_nodes
    spots, heights, hidden = machine.run(_two_summits, still.grid, at_nodes, rolled=not machine.traced)
    spot, three, tied = machine.run(_higher, still.grid, spots, components(still, still.at(spots.place)))
    x, gained, place = machine.run(_parabola, grid, spot, components(still, still.at(three)), held=held)
    return machine.run(_peaked, grid, x, gained, place, components(regime, regime.at(place)), heights, hidden, tied)


class Spots(NamedTuple):
    """Places to look at, flat, and the panel and coordinate of each, shape (quantities, places)."""

    place: Place
    panel: Array
    x: Array


def spots_at(grid: Grid, panel: Array, x: Array) -> Spots:
    """Places to look at, from their panels and coordinates."""
    return Spots(grid.at(panel.ravel(), once(x.ravel())), panel, x)


def own_rows(found: Array, like: Array) -> Array:
    """Of the vectors of all quantities at all places, those of each quantity at its own places; shape (*like.shape,
    parts)."""
    quantities, size = like.shape[0], like.size
    parts = found.shape[1]
    if quantities == 1:
        return found[0, :, :size].T.reshape((*like.shape, parts))
    every = found[..., :size].reshape((quantities, parts, quantities, size // quantities))
    return jnp.moveaxis(jnp.diagonal(every, axis1=0, axis2=2), (-1, 0), (0, -1)).reshape((*like.shape, parts))


def squares(vectors: Array) -> Array:
    """Squared lengths of vectors, whose parts are along the last axis."""
    return jnp.sum(vectors * vectors, axis=-1)


@compiled_soon(static=("rolled",))
def _two_summits(grid: Grid, at_nodes: Array, rolled: bool) -> tuple[Spots, Array, Array]:
    """The highest summits of every quantity, the squared lengths on the search grid, and by how much the interpolants
    may hide another summit: by as much as their last terms."""
    heights, series = interpolated(grid, jax.lax.stop_gradient(at_nodes))
    wide = has_width(grid.half, grid.length)
    heights = jnp.where(wide[None, :, None], heights, 0.0)

    def best(height, rows):
        fine, number = jnp.asarray(grid.rule.fine), jnp.arange(grid.panels, dtype=jnp.int32)
        tops, begins, ends = summit_heights(fine, height)

        def following(tops, _):
            found = search(fine, height, tops)
            next_one, last_one = (found.panel + 1) % grid.panels, (found.panel - 1) % grid.panels
            gone = (number == found.panel) | ((number == next_one) & begins) | ((number == last_one) & ends)
            return jnp.where(gone, -jnp.inf, tops), found

        summit = jax.lax.scan(following, tops, length=RIVALS, unroll=1 if rolled else RIVALS)[1]
        return summit.panel, jax.vmap(lambda one: follow(rows[:, one.panel], one, rolled))(summit)

    last = at_nodes @ jnp.asarray(grid.rule.spectrum[-2:].T)
    hidden = jnp.sqrt(jnp.sum(jnp.sum(jnp.abs(jax.lax.stop_gradient(last)), axis=-1) ** 2, axis=1))
    hidden = jnp.where(wide[None], hidden, 0.0)
    return spots_at(grid, *jax.vmap(best)(heights, series)), heights, hidden


@compiled_soon
def _higher(grid: Grid, spots: Spots, found: Array) -> tuple[Spots, Place, Array]:
    """The higher summit of each quantity, three places around it, and the crank angle of the other if it is equal."""
    height = squares(own_rows(found, spots.x))
    first = jnp.argmax(height, axis=1)[:, None]
    panel, x = (jnp.take_along_axis(part, first, axis=1) for part in (spots.panel, spots.x))
    phi = spots.place.phi.reshape(spots.x.shape)
    apart = jnp.abs(nearest_turn(phi[:, 1] - phi[:, 0], grid.length)) > APART
    equal = jnp.min(height, axis=1) >= (1 - 2 * TIED) * jnp.max(height, axis=1)
    other = jnp.where(first[:, 0] == 0, phi[:, 1], phi[:, 0])
    tied = jnp.where(apart & equal, wrapped(other, grid.length), jnp.nan)
    return spots_at(grid, panel[:, 0], x[:, 0]), spots_at(grid, *three_around(panel[:, 0], x[:, 0])).place, tied


def _near(x: Array, closer: float) -> float:
    return max(NEAR / closer, COARSE * math.sqrt(jnp.finfo(x.dtype).eps))


def three_around(panel: Array, x: Array, closer: float = 1.0) -> tuple[Array, Array]:
    """Three places around each one, in the same panel; as many times nearer to it as `closer`."""
    near = _near(x, closer)
    centre = jnp.clip(x, -1.0 + near, 1.0 - near)
    three = jnp.stack([centre - near, centre, centre + near], axis=-1)
    return jnp.broadcast_to(panel[..., None], three.shape), three


def sharpened(followed: Array, y: Array, closer: float = 1.0) -> tuple[Array, Array]:
    """The coordinate of a summit by a parabola through three squared values, and the increase of the square by it.
    `closer` is as in `three_around`.

    The position of a maximum is as accurate as its parabola is narrow. With points 3e-3 of a half panel apart, the
    third derivative shifted it by 1e-6 and the derivative of the peak equally. At `NEAR` this is a hundred times less,
    and rounding, which grows as the points approach each other, is still smaller.
    """
    near = _near(followed, closer)
    centre = jnp.clip(followed, -1.0 + near, 1.0 - near)
    bend, tilt = y[..., 2] - 2 * y[..., 1] + y[..., 0], 0.5 * (y[..., 2] - y[..., 0])
    step = jnp.where(bend < 0, -near * safe_divide(tilt, bend), jnp.sign(tilt))
    x = jnp.clip(centre + jnp.clip(step, -FAR, FAR), -1.0, 1.0)
    gained = jnp.abs(tilt * (jnp.clip(centre + step, -1.0, 1.0) - followed)) / near
    return jax.lax.stop_gradient(x), gained


@compiled_soon(static=("held",))
def _parabola(grid: Grid, spot: Spots, found: Array, held: Held) -> tuple[Array, Array, Place]:
    three = jnp.broadcast_to(spot.x[:, None], (*spot.x.shape, 3))
    x, gained = sharpened(spot.x, squares(own_rows(found, three)))
    return x, gained, settle(grid, spot.panel, x, held)


@compiled_soon
def _peaked(
    grid: Grid, x: Array, gained: Array, place: Place, found: Array, heights: Array, hidden: Array, tied: Array
) -> Peak:
    top, phi = safe_sqrt(squares(own_rows(found, x))), place.phi
    places = grid.middle[:, None] + grid.half[:, None] * jnp.asarray(grid.rule.fine)[None]
    away = jnp.abs(nearest_turn(places[None] - phi[:, None, None], grid.length))
    near = away < (3 / grid.n) * (grid.half[None, :] + taken(grid.half, place.panel)[:, None])[..., None]
    near &= (jnp.abs(x) < 1)[:, None, None]  # a summit at the end of a panel may continue in the next one
    rival = jnp.max(jnp.where(near, 0.0, jnp.sqrt(heights) + hidden[:, :, None]), axis=(1, 2)) - top
    doubt = safe_divide(gained, 2 * top) + jnp.maximum(rival, 0.0) + ROUNDINGS * jnp.finfo(top.dtype).eps * top
    return Peak(top, wrapped(phi, grid.length), jax.lax.stop_gradient(doubt), tied)


def interpolated(grid: Grid, at_nodes: Array) -> tuple[Array, Array]:
    """Squared lengths on the search grid of every panel, and the series of the parts."""
    fine = at_nodes @ jnp.asarray(grid.rule.to_fine.T)
    heights = functools.reduce(jnp.add, [fine[:, i] * fine[:, i] for i in range(fine.shape[1])])  # faster than jnp.sum
    return heights, at_nodes @ jnp.asarray(grid.rule.series.T)


def follow(rows: Array, summit: Summit, rolled: bool) -> Array:
    """Refine a summit of the search grid on the interpolant, whose series are `rows`."""

    def slope(x):
        value, rate = jax.jvp(lambda x: rows @ polynomials(rows.shape[-1], x), (x,), (jnp.ones_like(x),))
        return 2 * jnp.sum(value * rate)

    return climb(slope, summit, FOLLOW, rolled)


def node_vectors(regime: Regime, components: Components) -> Array:
    """The vectors at every node, shape (quantities, parts, panels, n)."""
    place = regime.machine.run(node_places, regime.grid, edges=False)
    return regime.machine.run(by_node, regime.grid, components(regime, regime.at(place)))


@compiled_soon
def by_node(grid: Grid, found: Float[Array, "quantities parts places"]) -> Float[Array, "quantities parts panels n"]:
    """Vectors at the nodes, first of all places, in the order of the grid."""
    return found[..., : grid.size].reshape((*found.shape[:2], *grid.nodes.shape))
