"""The machine at the nodes and edges of the cycle grid."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import once
from linkjax.kinematics import Pose, pose
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.motion._grid import Grid, Place
from linkjax.motion._rubbed import with_friction
from linkjax.reduction import Reduced, loaded, of_crank, reduce_pose
from linkjax.sampling import Sample, Sampler


class AtEdges(NamedTuple):
    """Reduced inertia at every panel's first edge, and the torque there from inside the panel and from before it."""

    inertia: Array
    after: Array
    before: Array


class AtNodes(NamedTuple):
    """The machine at the nodes: places and samples, first of the nodes, then of the edges if they were asked for; the
    reduced model, shape (panels, n); and what the error of δ needs of the edges."""

    place: Place
    sample: Sample
    here: Reduced
    edges: AtEdges | None


def at_nodes(machine: Sampler, grid: Grid, edges: bool = True, gaps: bool = False) -> AtNodes:
    """The machine at every node of the grid, and at the `edges` of the panels for the error of δ; with margins and
    transmission angles if `gaps`."""
    place = machine.run(node_places, grid, edges=edges)
    sample = machine.sample(place.phi, place.side, gaps=gaps)
    return AtNodes(place, sample, *machine.run(_node_values, grid, sample.dynamics, edges=edges))


@compiled_soon(static=("edges",))
def node_places(grid: Grid, edges: bool) -> Place:
    """The nodes, then the first edge of every panel."""
    nodes = jax.tree.map(jnp.ravel, grid.node_places())
    if not edges:
        return nodes
    number = jnp.arange(grid.panels, dtype=jnp.int32)
    first = Place(number, jnp.full(grid.panels, -1.0), grid.edges[:-1], grid.middle)
    return Place(*(jnp.concatenate(pair) for pair in zip(nodes, first, strict=True)))


@compiled_soon(static=("edges",))
def _node_values(grid: Grid, dynamics: tuple, edges: bool) -> tuple[Reduced, AtEdges | None]:
    shape = grid.nodes.shape
    inertia, slope, shares = jax.tree.map(lambda leaf: leaf[: grid.size].reshape(shape), dynamics)
    order = jnp.broadcast_to(grid.order[:, None], (*shape, len(grid.loads)))
    here = of_crank(loaded(inertia, slope, shares, grid.loads, order), grid.prescribed)
    here = here._replace(inertia=once(here.inertia), slope=once(here.slope), torque=once(here.torque))
    if not edges:
        return here, None
    number = jnp.arange(grid.panels, dtype=jnp.int32)
    rest = jax.tree.map(lambda leaf: leaf[grid.size :], dynamics)
    after, before = grid.reduced(rest, number), grid.reduced(rest, jnp.roll(number, 1))
    return here, AtEdges(after.inertia, after.torque, before.torque)


def reduced_in(
    made: ReadyScene, grid: Grid, phi: Array, panel: Array, here: Pose | None = None, speed: Array | None = None,
    advance: Callable[[Reduced], Array] | None = None, at_rest: bool = False,
) -> Reduced:  # fmt: skip
    """The reduced model that determines the motion of the crank, at a crank angle (rad) in a panel of the grid; `here`
    is the pose, if known. Loads that depend on the speed are those at the crank speed `speed` (rad/s), and omitted
    without one. With `advance`, which gives the acceleration for a model, it contains the friction of joints."""
    at, here = made.instant(phi, grid.middle[panel], speed), pose(made.mechanism, phi) if here is None else here
    bare = of_crank(reduce_pose(made.scene, at, here, grid.order[panel]), grid.prescribed)
    if advance is None:
        return bare
    return with_friction(made.scene, at, here, grid.order[panel], bare, advance, at_rest=at_rest)


def node_values(scene: Scene | ReadyScene, grid: Grid) -> Reduced:
    """Reduced inertia, slope and torque at every node, shape (panels, n)."""
    return at_nodes(Sampler(ready(scene)), grid, edges=False).here
