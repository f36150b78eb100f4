"""All values over the cycle that may be a peak, for an optimiser that treats peaks exactly.

At an optimum peaks are often equal, and then the peak has no gradient; its rows have one: the vectors at every node, at
both ends of every panel, and at the two highest maxima of every panel, each evaluated on the quantity itself.
Interpolated rows were tried first: at a balanced optimum, where large forces cancel, the interpolants have errors of
2e-5 of the remainder, and the search stalled.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_sqrt, wrapped
from linkjax._tree import node
from linkjax.motion._extremum import highest_in, settle
from linkjax.motion._grid import Grid, Place
from linkjax.motion._peaks import (
    CLOSER,
    Spots,
    follow,
    interpolated,
    node_vectors,
    own_rows,
    sharpened,
    spots_at,
    squares,
    three_around,
)
from linkjax.motion._regime import At, Components, Regime
from linkjax.sampling import Sample


@node
class Rows:
    """Vectors, the longest of which is a peak, with the crank angle (rad) of each; for `signed` rows of one part the
    largest value is the peak. An optimiser that treats peaks exactly keeps all rows below a bound."""

    vectors: Float[Array, "rows parts"]
    angle: Float[Array, " rows"]
    signed: bool = eqx.field(static=True, default=False)

    def size(self) -> Float[Array, " rows"]:
        """The size of every row: its length, or its signed value."""
        return self.vectors[:, 0] if self.signed else safe_sqrt(jnp.sum(self.vectors**2, axis=1))


class Summits(NamedTuple):
    """Vectors at the ends and summits of every panel, four per panel, and their crank angles (rad)."""

    vectors: Float[Array, "quantities places parts"]
    angle: Float[Array, "quantities places"]


class Wanted(NamedTuple):
    """Rows that are wanted: the vectors of `components` in a regime over the continuous cycle. `at_nodes` are their
    values at the nodes, if known; `finish` makes the rows of the summits, by default of these and the nodes. `asks`
    says what the components use: "place" only, "pose", "dynamics" (the reduced model), or "gaps" (transmission
    angles). At the crank angles `held` (rad) the range of what is wanted ends, or it jumps: see `settle`. `closer` is
    that of the second parabola: see `three_around`."""

    regime: Regime
    components: Components
    at_nodes: Any = None
    finish: Callable[[Summits], Rows] | None = None
    asks: str = "dynamics"
    held: tuple[float, ...] = ()
    closer: float = CLOSER


def every_row(wanted: Sequence[Wanted | Rows]) -> list[Rows]:
    """The rows that are wanted, those of one machine, differentiable; rows that are known are unchanged.
    All are found together, so that the machine is evaluated in few batches."""
    asked = [each for each in wanted if isinstance(each, Wanted)]
    nodes = [node_vectors(each.regime, each.components) if each.at_nodes is None else each.at_nodes for each in asked]
    found = iter(zip(asked, nodes, summits(asked, nodes) if asked else [], strict=True))
    return [each if isinstance(each, Rows) else _finished(*next(found)) for each in wanted]


def _finished(wanted: Wanted, at_nodes: Array, tops: Summits) -> Rows:
    if wanted.finish is not None:
        return wanted.finish(tops)
    return wanted.regime.machine.run(_joined, wanted.regime.grid, at_nodes, tops)


@compiled_soon
def _joined(grid: Grid, at_nodes: Array, tops: Summits) -> Rows:
    parts = at_nodes.shape[1]
    vectors = jnp.concatenate([jnp.moveaxis(at_nodes, 1, -1).reshape((-1, parts)), tops.vectors.reshape((-1, parts))])
    nodes = jnp.broadcast_to(grid.nodes, (at_nodes.shape[0], *grid.nodes.shape))
    nodes = wrapped(jax.lax.stop_gradient(nodes), grid.length)
    return Rows(vectors, jnp.concatenate([nodes.ravel(), tops.angle.ravel()]))


def summits(wanted: Sequence[Wanted], at_nodes: Sequence[Any]) -> list[Summits]:
    """Vectors at both ends of every panel (both limits at every jump) and at the two highest summits of every panel.
    Each summit is found as in `peaks` and refined to rounding. Differentiable, but not with respect to `at_nodes`."""
    machine, grids = wanted[0].regime.machine, [each.regime.grid for each in wanted]
    still = [each.regime.still.grid for each in wanted]
    rolled = not machine.traced
    begun = [machine.run(_all_summits, *each, rolled=rolled) for each in zip(still, at_nodes, strict=True)]
    spots, three = zip(*begun, strict=True)
    again = _together(wanted, three, still=True)
    begun = [
        machine.run(_again, *each, closer=one.closer) for *each, one in zip(still, spots, again, wanted, strict=True)
    ]
    spots, three = zip(*begun, strict=True)
    # twice, to rounding: an optimiser is sensitive to the error
    again = _together(wanted, three, still=True)
    settled = zip(grids, spots, again, wanted, strict=True)
    places = [machine.run(_settled, *each, held=one.held, closer=one.closer) for *each, one in settled]
    counts = [nodes.shape[0] for nodes in at_nodes]
    last = zip(grids, places, _together(wanted, places, still=False), counts, strict=True)
    return [machine.run(_on_summits, *each, quantities=count) for *each, count in last]


def _together(wanted: Sequence[Wanted], places: Sequence[Place], still: bool) -> list[Any]:
    """The components of all that is wanted, each at its own places; the machine is evaluated at all of them at once."""
    regimes = [each.regime.still if still else each.regime for each in wanted]
    asking = [i for i, each in enumerate(wanted) if each.asks != "place"]
    if len(asking) < 2 or not regimes[0].machine.traced:
        ats = [regime.at(place) for regime, place in zip(regimes, places, strict=True)]
    else:
        asks = {wanted[i].asks for i in asking}
        phi, side = (jnp.concatenate([getattr(places[i], name) for i in asking]) for name in ("phi", "side"))
        every = regimes[0].machine.sample(
            phi, side, fixed=regimes[0].fixed, dynamics="dynamics" in asks, gaps="gaps" in asks
        )
        ends = dict(zip(asking, itertools.accumulate(places[i].phi.size for i in asking), strict=True))
        ats = [
            At(regime, place, _part(every, slice(ends[i] - place.phi.size, ends[i])) if i in ends else None)
            for i, (regime, place) in enumerate(zip(regimes, places, strict=True))
        ]
    return [each.components(at.regime, at) for each, at in zip(wanted, ats, strict=True)]


def _part(sample: Sample, which: slice) -> Sample:
    return jax.tree.map(lambda leaf: leaf[which], sample)


@compiled_soon(static=("rolled",))
def _all_summits(grid: Grid, at_nodes: Array, rolled: bool) -> tuple[Spots, Place]:
    """The two highest summits of every panel, and three places around each; shape (quantities, panels, 2)."""
    heights, series = interpolated(grid, jax.lax.stop_gradient(at_nodes))
    fine, number = jnp.asarray(grid.rule.fine), jnp.arange(grid.panels, dtype=jnp.int32)

    def two(height, coefficients, panel):
        first = follow(coefficients, highest_in(fine, height, panel), rolled)
        rises = jnp.concatenate([jnp.ones(1, bool), height[1:] >= height[:-1]])
        falls = jnp.concatenate([height[:-1] >= height[1:], jnp.ones(1, bool)])
        other = jnp.where(rises & falls & (jnp.abs(fine - first) > 2.5 / grid.n), height, 0.0)
        return jnp.stack([first, follow(coefficients, highest_in(fine, other, panel), rolled)])

    x = jax.vmap(jax.vmap(two, in_axes=(0, 1, 0)), in_axes=(0, 0, None))(heights, series, number)
    panel = jnp.broadcast_to(number[None, :, None], x.shape)
    return spots_at(grid, panel, x), spots_at(grid, *three_around(panel, x)).place


@compiled_soon(static=("closer",))
def _again(grid: Grid, spots: Spots, found: Array, closer: float) -> tuple[Spots, Place]:
    x = _sharp(spots, found, 1.0)
    return spots._replace(x=x), spots_at(grid, *three_around(spots.panel, x, closer)).place


def _sharp(spots: Spots, found: Array, closer: float) -> Array:
    three = jnp.broadcast_to(spots.x[..., None], (*spots.x.shape, 3))
    return sharpened(spots.x, squares(own_rows(found, three)), closer)[0]


@compiled_soon(static=("held", "closer"))
def _settled(grid: Grid, spots: Spots, found: Array, held: tuple[float, ...], closer: float) -> Place:
    """The two ends and the two summits of every panel, flat."""
    x = _sharp(spots, found, closer)
    ends = jnp.broadcast_to(jnp.asarray([-1.0, 1.0], x.dtype), (*x.shape[:2], 2))
    panel = jnp.concatenate([spots.panel, spots.panel], axis=-1).ravel()
    return settle(grid, panel, jnp.concatenate([ends, x], axis=-1).ravel(), (held,) if held else ())


@compiled_soon(static=("quantities",))
def _on_summits(grid: Grid, place: Place, found: Array, quantities: int) -> Summits:
    angle = place.phi.reshape((quantities, -1))
    return Summits(own_rows(found, angle), wrapped(jax.lax.stop_gradient(angle), grid.length))
