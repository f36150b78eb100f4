"""A regime: how the crank moves over the cycle, at constant speed or in the actual steady-state motion."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax._numerics import nearest_turn, safe_divide, safe_sqrt, taken, wrapped
from linkjax._tree import node
from linkjax.forces import Forces
from linkjax.kinematics import Pose
from linkjax.machine import Scene
from linkjax.motion._extremum import Summit, climb, highest_in, search, settle
from linkjax.motion._grid import Grid, Place
from linkjax.motion._panels import polynomials
from linkjax.motion._steady import Steady, node_places
from linkjax.sampling import Sample, Sampler

FOLLOW = 3  # steps on the interpolants
RIVALS = 2  # panels whose summits are compared on the function itself
NEAR = 2e-4  # half width, in half panels, of the parabola that refines a peak on the function itself; in single
COARSE = 9.0  # precision this many times the square root of the rounding unit
ROUNDINGS = 4000.0  # rounding units of a peak: the least error stated
FAR = 3e-2  # the most that the parabola may move a peak


class Regime:
    """A machine with its cycle grid and, for the actual motion, its steady state (`None`: constant nominal speed).

    With `fixed` nothing is differentiated.
    """

    def __init__(self, machine: Sampler, grid: Grid, steady: Steady | None = None, *, fixed: bool = False):
        self.machine, self.grid, self.steady, self.fixed = machine, grid, steady, fixed

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.machine.scene

    @functools.cached_property
    def still(self) -> Regime:
        """The same without derivatives."""
        if not self.machine.traced or self.fixed:
            return self
        return Regime(self.machine, *jax.lax.stop_gradient((self.grid, self.steady)), fixed=True)

    def at(self, place: Place, sample: Sample | None = None) -> At:
        """The machine at several places of the grid, the leaves of `place` having one axis; `sample` if known."""
        return At(self, self.machine.padded(place), sample)

    def crank(self, at: At) -> Any:
        """Crank speed (rad/s) and acceleration (rad/s²)."""
        return self._driven(at)[1]

    def forces(self, at: At) -> Forces:
        """Joint reactions, drive torque, and the other forces."""
        (active, crank), place = self._driven(at), at.place
        return self.machine.forces(place.phi, place.side, at.pose, active, *crank, fixed=self.fixed)

    def _driven(self, at: At) -> Any:
        scene = self.machine.still if self.fixed else self.scene
        dynamics = None if self.steady is None or self.grid.prescribed else at.sample.dynamics
        return self.machine.run(_driven, self.grid, self.steady, scene.speed, at.place, dynamics)


class At:
    """The machine at several places of the grid, in a regime; what is asked for is computed on first use and kept."""

    def __init__(self, regime: Regime, place: Place, sample: Sample | None):
        self.regime, self.place, self._given = regime, place, sample

    @functools.cached_property
    def sample(self) -> Sample:
        """Samples with the reduced model."""
        return self._asked() if self._given is None else self._given

    @functools.cached_property
    def pose(self) -> Pose:
        """Points and links."""
        known = self._given is not None or "sample" in self.__dict__
        return self.sample.pose if known else self._asked(dynamics=False).pose

    @functools.cached_property
    def transmission(self) -> dict[str, Array]:
        """Transmission angles of the groups (rad)."""
        known = self._given is not None
        return self.sample.transmission if known else self._asked(dynamics=False, gaps=True).transmission

    def _asked(self, **what: bool) -> Sample:
        return self.regime.machine.sample(self.place.phi, self.place.side, fixed=self.regime.fixed, **what)


@compiled_soon
def _driven(
    grid: Grid, steady: Steady | None, nominal: Array, place: Place, dynamics: Any
) -> tuple[Array, tuple[Array, Array]]:
    return taken(grid.active, place.panel), crank_at(grid, steady, nominal, place, dynamics)


def crank_at(grid: Grid, steady: Steady | None, nominal: Array, place: Place, dynamics: tuple) -> tuple[Array, Array]:
    """Crank speed (rad/s) and acceleration (rad/s²) at places, in the actual motion or, without one, at constant
    nominal speed."""
    if steady is None:
        return nominal * jnp.ones_like(place.phi), jnp.zeros_like(place.phi)
    return steady.crank(nominal, grid.reduced(dynamics, place.panel), place)


class Peak(NamedTuple):
    """Largest magnitude over the continuous cycle, its crank angle (rad), and an error bound (for the given motion)."""

    value: Array
    angle: Array
    error: Array


Components = Callable[[Regime, At], Float[Array, "places quantities parts"]]


def peaks(
    regime: Regime,
    components: Components,
    at_nodes: Any = None,
) -> Peak:
    """Peaks of several quantities, each the length of a vector of smooth parts; leaves of shape (quantities,).

    `components(regime, at)` gives the vectors at several places (see `Regime.at`). At a jump both one-sided limits
    count. The highest summits of the interpolants are compared on the functions themselves, and the best one is refined
    by a parabola. Values that are known at the nodes may be passed as `at_nodes`, shape (quantities, parts, panels, n).
    """
    machine, grid, still = regime.machine, regime.grid, regime.still
    at_nodes = _node_values(still, components) if at_nodes is None else at_nodes
    spots, heights, hidden = machine.run(_two_summits, still.grid, at_nodes)
    spot, three = machine.run(_higher, still.grid, spots, components(still, still.at(spots.place)))
    x, gained, place = machine.run(_parabola, grid, spot, components(still, still.at(three)))
    return machine.run(_peaked, grid, x, gained, place, components(regime, regime.at(place)), heights, hidden)


class Spots(NamedTuple):
    """Places to look at, flat, and the panel and coordinate of each, shape (quantities, places)."""

    place: Place
    panel: Array
    x: Array


def _spots(grid: Grid, panel: Array, x: Array) -> Spots:
    return Spots(grid.at(panel.ravel(), x.ravel()), panel, x)


def _rows(found: Array, like: Array) -> Array:
    """Of the vectors of all quantities at all places, those of each quantity at its own places; shape (*like.shape,
    parts)."""
    quantities, size = like.shape[0], like.size
    every = found[:size].reshape((quantities, size // quantities, *found.shape[1:]))
    own = every[:, :, 0] if quantities == 1 else jnp.moveaxis(jnp.diagonal(every, axis1=0, axis2=2), -1, 0)
    return own.reshape((*like.shape, found.shape[-1]))


def _squares(vectors: Array) -> Array:
    return jnp.sum(vectors * vectors, axis=-1)


@compiled_soon
def _two_summits(grid: Grid, at_nodes: Array) -> tuple[Spots, Array, Array]:
    """The highest summits of every quantity, the squared lengths on the search grid, and by how much the interpolants
    may hide another summit: by as much as their last terms."""
    heights, series = _interpolated(grid, jax.lax.stop_gradient(at_nodes))

    def best(height, rows):
        def following(tops, _):
            found = search(jnp.asarray(grid.rule.fine), height, tops)
            return jnp.where(jnp.arange(tops.size, dtype=jnp.int32) == found.panel, -jnp.inf, tops), found

        summit = jax.lax.scan(following, jnp.max(height, axis=1), length=RIVALS)[1]
        return summit.panel, jax.vmap(lambda one: _follow(rows[:, one.panel], one))(summit)

    last = at_nodes @ jnp.asarray(grid.rule.spectrum[-2:].T)
    hidden = jnp.sqrt(jnp.sum(jnp.sum(jnp.abs(jax.lax.stop_gradient(last)), axis=-1) ** 2, axis=1))
    return _spots(grid, *jax.vmap(best)(heights, series)), heights, hidden


@compiled_soon
def _higher(grid: Grid, spots: Spots, found: Array) -> tuple[Spots, Place]:
    """The higher summit of each quantity, and three places around it."""
    first = jnp.argmax(_squares(_rows(found, spots.x)), axis=1)[:, None]
    panel, x = (jnp.take_along_axis(part, first, axis=1) for part in (spots.panel, spots.x))
    return _spots(grid, panel[:, 0], x[:, 0]), _spots(grid, *_three(panel[:, 0], x[:, 0])).place


def _near(x: Array) -> float:
    return max(NEAR, COARSE * math.sqrt(jnp.finfo(x.dtype).eps))


def _three(panel: Array, x: Array) -> tuple[Array, Array]:
    """Three places around each one, in the same panel."""
    near = _near(x)
    centre = jnp.clip(x, -1.0 + near, 1.0 - near)
    three = jnp.stack([centre - near, centre, centre + near], axis=-1)
    return jnp.broadcast_to(panel[..., None], three.shape), three


def _sharpened(followed: Array, y: Array) -> tuple[Array, Array]:
    """The coordinate of a summit by a parabola through three squared values, and the increase of the square by it."""
    near = _near(followed)
    centre = jnp.clip(followed, -1.0 + near, 1.0 - near)
    bend, tilt = y[..., 2] - 2 * y[..., 1] + y[..., 0], 0.5 * (y[..., 2] - y[..., 0])
    step = jnp.where(bend < 0, -near * safe_divide(tilt, bend), jnp.sign(tilt))
    x = jnp.clip(centre + jnp.clip(step, -FAR, FAR), -1.0, 1.0)
    gained = jnp.abs(tilt * (jnp.clip(centre + step, -1.0, 1.0) - followed)) / near
    return jax.lax.stop_gradient(x), gained


@compiled_soon
def _parabola(grid: Grid, spot: Spots, found: Array) -> tuple[Array, Array, Place]:
    three = jnp.broadcast_to(spot.x[:, None], (*spot.x.shape, 3))
    x, gained = _sharpened(spot.x, _squares(_rows(found, three)))
    return x, gained, settle(grid, spot.panel, x)


@compiled_soon
def _peaked(grid: Grid, x: Array, gained: Array, place: Place, found: Array, heights: Array, hidden: Array) -> Peak:
    top, phi = safe_sqrt(_squares(_rows(found, x))), place.phi
    places = grid.middle[:, None] + grid.half[:, None] * jnp.asarray(grid.rule.fine)[None]
    away = jnp.abs(nearest_turn(places[None] - phi[:, None, None], grid.length))
    near = away < (3 / grid.n) * (grid.half[None, :] + taken(grid.half, place.panel)[:, None])[..., None]
    near &= (jnp.abs(x) < 1)[:, None, None]  # a summit at the end of a panel may continue in the next one
    rival = jnp.max(jnp.where(near, 0.0, jnp.sqrt(heights) + hidden[:, :, None]), axis=(1, 2)) - top
    doubt = safe_divide(gained, 2 * top) + jnp.maximum(rival, 0.0) + ROUNDINGS * jnp.finfo(top.dtype).eps * top
    return Peak(top, wrapped(phi, grid.length), jax.lax.stop_gradient(doubt))


def _interpolated(grid: Grid, at_nodes: Array) -> tuple[Array, Array]:
    """Squared lengths on the search grid of every panel, and the series of the parts."""
    fine = at_nodes @ jnp.asarray(grid.rule.to_fine.T)
    heights = functools.reduce(jnp.add, [fine[:, i] * fine[:, i] for i in range(fine.shape[1])])  # faster than jnp.sum
    return heights, at_nodes @ jnp.asarray(grid.rule.series.T)


def _follow(rows: Array, summit: Summit) -> Array:
    """Refine a summit of the search grid on the interpolant, whose series are `rows`."""

    def slope(x):
        value, rate = jax.jvp(lambda x: rows @ polynomials(rows.shape[-1], x), (x,), (jnp.ones_like(x),))
        return 2 * jnp.sum(value * rate)

    return climb(slope, summit, FOLLOW)


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
    angles)."""

    regime: Regime
    components: Components
    at_nodes: Any = None
    finish: Callable[[Summits], Rows] | None = None
    asks: str = "dynamics"


def every_row(wanted: Sequence[Wanted | Rows]) -> list[Rows]:
    """The rows that are wanted, those of one machine on one grid, differentiable; rows that are known are unchanged.
    All are found together, so that the machine is evaluated in few batches."""
    asked = [each for each in wanted if isinstance(each, Wanted)]
    nodes = [_node_values(each.regime, each.components) if each.at_nodes is None else each.at_nodes for each in asked]
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
    machine, grid = wanted[0].regime.machine, wanted[0].regime.grid
    begun = [
        machine.run(_all_summits, each.regime.still.grid, nodes) for each, nodes in zip(wanted, at_nodes, strict=True)
    ]
    spots, three = zip(*begun, strict=True)
    again = _together(wanted, three, still=True)
    begun = [machine.run(_again, grid, *each) for each in zip(spots, again, strict=True)]
    spots, three = zip(*begun, strict=True)
    # twice, to rounding: an optimiser is sensitive to the error
    again = _together(wanted, three, still=True)
    places = [machine.run(_settled, grid, *each) for each in zip(spots, again, strict=True)]
    counts = [nodes.shape[0] for nodes in at_nodes]
    last = zip(places, _together(wanted, places, still=False), counts, strict=True)
    return [machine.run(_on_summits, grid, place, found, quantities=count) for place, found, count in last]


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


@compiled_soon
def _all_summits(grid: Grid, at_nodes: Array) -> tuple[Spots, Place]:
    """The two highest summits of every panel, and three places around each; shape (quantities, panels, 2)."""
    heights, series = _interpolated(grid, jax.lax.stop_gradient(at_nodes))
    fine, number = jnp.asarray(grid.rule.fine), jnp.arange(grid.panels, dtype=jnp.int32)

    def two(height, coefficients, panel):
        first = _follow(coefficients, highest_in(fine, height, panel))
        rises = jnp.concatenate([jnp.ones(1, bool), height[1:] >= height[:-1]])
        falls = jnp.concatenate([height[:-1] >= height[1:], jnp.ones(1, bool)])
        other = jnp.where(rises & falls & (jnp.abs(fine - first) > 2.5 / grid.n), height, 0.0)
        return jnp.stack([first, _follow(coefficients, highest_in(fine, other, panel))])

    x = jax.vmap(jax.vmap(two, in_axes=(0, 1, 0)), in_axes=(0, 0, None))(heights, series, number)
    panel = jnp.broadcast_to(number[None, :, None], x.shape)
    return _spots(grid, panel, x), _spots(grid, *_three(panel, x)).place


@compiled_soon
def _again(grid: Grid, spots: Spots, found: Array) -> tuple[Spots, Place]:
    x = _sharp(spots, found)
    return spots._replace(x=x), _spots(grid, *_three(spots.panel, x)).place


def _sharp(spots: Spots, found: Array) -> Array:
    three = jnp.broadcast_to(spots.x[..., None], (*spots.x.shape, 3))
    return _sharpened(spots.x, _squares(_rows(found, three)))[0]


@compiled_soon
def _settled(grid: Grid, spots: Spots, found: Array) -> Place:
    """The two ends and the two summits of every panel, flat."""
    x = _sharp(spots, found)
    ends = jnp.broadcast_to(jnp.asarray([-1.0, 1.0], x.dtype), (*x.shape[:2], 2))
    panel = jnp.concatenate([spots.panel, spots.panel], axis=-1).ravel()
    return settle(grid, panel, jnp.concatenate([ends, x], axis=-1).ravel())


@compiled_soon(static=("quantities",))
def _on_summits(grid: Grid, place: Place, found: Array, quantities: int) -> Summits:
    angle = place.phi.reshape((quantities, -1))
    return Summits(_rows(found, angle), wrapped(jax.lax.stop_gradient(angle), grid.length))


def _node_values(regime: Regime, components: Components) -> Array:
    """The vectors at every node, shape (quantities, parts, panels, n)."""
    place = regime.machine.run(node_places, regime.grid, edges=False)
    return regime.machine.run(by_node, regime.grid, components(regime, regime.at(place)))


@compiled_soon
def by_node(grid: Grid, found: Float[Array, "places quantities parts"]) -> Float[Array, "quantities parts panels n"]:
    """Vectors at the nodes, first of all places, in the order of the grid."""
    flat = jnp.moveaxis(found[: grid.size], 0, -1)
    return flat.reshape((*flat.shape[:2], *grid.nodes.shape))
