"""Panels that end where forces have a kink: where what is transmitted through a mesh changes its sign, or the force of
a guide with friction changes its side.

With a mesh the other flanks of the teeth are loaded then, or the other strand of a belt is tight. These places depend
on the motion, and the motion does not depend on them, as the forces that change do no work; with friction it does, and
the panels of its own grid end there already. At constant speed they are elsewhere. So they divide the panels of a grid
for forces alone. They move with the design: a force may be greatest there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax._numerics import once, safe_divide, taken
from linkjax._search import own
from linkjax.forces import Forces, Mesh, meshes, through_meshes
from linkjax.kinematics import Pose
from linkjax.motion._extremum import settle
from linkjax.motion._grid import Grid, Place
from linkjax.motion._regime import At, Regime
from linkjax.motion._switching import CHANGES, Changes, guide_kinks, sign_changes

Rows = Float[Array, "rows places"]

NEAR = 1e-3  # half panels: the distance of the places that give the slope at a change
CLOSE = 1e-5  # the same with friction: the panels of the motion end there, and the places are inside of them
IDLE = 1e-11  # of the drive torque, the largest torque through a mesh, or the largest reaction: less is rounding
EQUAL = 1e-9  # relative: panels that differ from the widest one by less are equal up to rounding
SAME = 1e-6  # rad: a change so close to an edge is that edge


def with_kinks(regimes: Sequence[Regime], at_nodes: Sequence[At]) -> list[Regime]:
    """The same motions on one grid, whose panels also end where forces have a kink in one of them. `at_nodes` is the
    machine at the nodes of the grid in each motion."""
    machine, grid, which = regimes[0].machine, regimes[0].grid, meshes(regimes[0].machine.mechanism)
    if not which and not guide_kinks(machine.scene):
        return list(regimes)
    most, ends = CHANGES * machine.scene.cycle_turns * max([1, *(mesh.faster for mesh in which)]), []
    near = CLOSE if machine.scene.friction else NEAR
    for regime, at in zip(regimes, at_nodes, strict=True):
        there = at
        if machine.traced:
            there = regime.still.at(*jax.lax.stop_gradient((at.place, at.sample)))
        found, places = machine.run(_changed, grid, *machine.run(_rows, there.pose, there.forces, which=which),
                                    most=most, near=near)  # fmt: skip
        there = regime.at(places)
        rows, _ = machine.run(_rows, there.pose, there.forces, which=which)
        ends.append(machine.run(_settled, grid, found, rows, near=near))
    divided = machine.run(_divided, grid, ends)
    return [Regime(machine, divided, regime.steady, fixed=regime.fixed) for regime in regimes]


@compiled_soon(static=("which",))
def _rows(pose: Pose, forces: Forces, which: tuple[Mesh, ...]) -> tuple[Rows, Rows]:
    """What is transmitted through the meshes, and the numbers at whose zeros the friction of guides has a kink; and for
    each of them one that is as large as what it is to be compared with."""
    guides = [row for sides in forces.friction.values() for one in sides.values() for row in one.switches]
    found, sizes = [], []
    if which:
        torques = through_meshes(which, pose, forces)
        largest = jnp.max(jnp.abs(jnp.concatenate([torques, forces.drive_torque[None]])), axis=0)
        found, sizes = [torques], [jnp.broadcast_to(largest, torques.shape)]
    if guides:
        sides = [one for joint in forces.reactions.values() for one in joint.values()]
        largest = jnp.max(jnp.stack([jnp.abs(part) for one in sides for part in (one.fx, one.fy)]), axis=0)
        found.append(jnp.stack(guides))
        sizes.append(jnp.broadcast_to(largest, found[-1].shape))
    return jnp.concatenate(found), jnp.concatenate(sizes)


@compiled_soon(static=("most", "near"))
def _changed(grid: Grid, rows: Rows, sizes: Rows, most: int, near: float) -> tuple[Changes, Place]:
    """Where functions known at the nodes change their signs, and three places around each, flat."""
    values, sizes = (jax.lax.stop_gradient(each[:, : grid.size]) for each in (rows, sizes))
    found = jax.vmap(lambda each: sign_changes(grid, each, most))(values.reshape((-1, *grid.nodes.shape)))
    used = found.used & (jnp.max(jnp.abs(values), axis=1) > IDLE * jnp.max(sizes, axis=1))[:, None]
    found = found._replace(x=jnp.clip(found.x, near - 1, 1 - near), used=used)
    three = (found.x[..., None] + jnp.asarray([[[-near, 0.0, near]]])).ravel()
    return found, settle(grid, jnp.repeat(found.panel.ravel(), 3), three)


@compiled_soon(static=("near",))
def _settled(grid: Grid, found: Changes, rows: Rows, near: float) -> Float[Array, "rows changes"]:
    """The crank angles of the changes (rad) by one more step, which has their derivatives; infinite ones are unused."""
    count = found.x.shape[1]
    three = own(rows[:, None], 3 * count)[:, 0].reshape((-1, count, 3))
    slope = jax.lax.stop_gradient(0.5 * (three[..., 2] - three[..., 0]) / near)
    step = -safe_divide(three[..., 1], slope)
    step = jnp.where(jnp.abs(step) < 2 * near, step, 0.0)
    middle, half = (jax.lax.stop_gradient(taken(part, found.panel)) for part in (grid.middle, grid.half))
    return jnp.where(found.used, middle + half * (found.x + step), jnp.inf)


@compiled_soon
def _divided(grid: Grid, ends: list[Array]) -> Grid:
    """The grid with more edges; those that are not used are in the middle of the widest panel, where nothing jumps. An
    end at an edge of the grid is no other one, but gives that edge its derivatives."""
    more = jnp.concatenate([each.ravel() for each in ends])
    apart = jnp.abs(jax.lax.stop_gradient(grid.edges[:, None] - more[None]))
    nearest = jnp.argmin(apart, axis=1)
    moves = jnp.where(jnp.isfinite(more), more - jax.lax.stop_gradient(more), 0.0)
    moved = jnp.where(jnp.min(apart, axis=1) < SAME, taken(moves, nearest), 0.0)
    grid = dataclasses.replace(grid, edges=grid.edges + moved)
    more = jnp.where(jnp.any(apart < SAME, axis=0), jnp.inf, more)
    half = jax.lax.stop_gradient(grid.half)
    spare = taken(grid.middle, jnp.argmax(half > (1 - EQUAL) * jnp.max(half)))
    more = jnp.where(jnp.isfinite(more), jnp.clip(more, grid.edges[0], grid.edges[-1]), spare)
    every = jnp.concatenate([grid.edges, more])
    edges = once(taken(every, jnp.argsort(jax.lax.stop_gradient(every))))
    half, middle = 0.5 * (edges[1:] - edges[:-1]), 0.5 * (edges[1:] + edges[:-1])
    number = jnp.searchsorted(jax.lax.stop_gradient(grid.edges), jax.lax.stop_gradient(middle), side="right") - 1
    number = jnp.clip(number, 0, grid.panels - 1)
    active, order = taken(grid.active, number), taken(grid.order, number)
    return dataclasses.replace(grid, edges=edges, half=half, middle=middle, active=active, order=order, divided=True)
