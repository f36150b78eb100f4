"""Panels that end where forces have a kink: where what is transmitted through a mesh changes its sign.

Then the other flanks of the teeth are loaded, or the other strand of a belt is tight. These places depend on the
motion, and the motion does not depend on them, as the forces that change do no work. So they divide the panels of a
grid for forces alone. They move with the design: a force may be greatest there.
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
from linkjax.motion._switching import CHANGES, Changes, sign_changes

NEAR = 1e-3  # half panels: the distance of the places that give the slope at a change
IDLE = 1e-11  # of the drive torque and of the largest torque through a mesh: less is rounding


def with_kinks(regimes: Sequence[Regime], at_nodes: Sequence[At]) -> list[Regime]:
    """The same motions on one grid, whose panels also end where forces have a kink in one of them. `at_nodes` is the
    machine at the nodes of the grid in each motion."""
    machine, grid, which = regimes[0].machine, regimes[0].grid, meshes(regimes[0].machine.mechanism)
    if not which:
        return list(regimes)
    most, ends = CHANGES * machine.scene.cycle_turns * max(mesh.faster for mesh in which), []
    for regime, at in zip(regimes, at_nodes, strict=True):
        there = at
        if machine.traced:
            there = regime.still.at(*jax.lax.stop_gradient((at.place, at.sample)))
        torques = machine.run(_torques, there.pose, there.forces, which=which)
        found, places = machine.run(_changed, grid, torques, most=most)
        there = regime.at(places)
        torques = machine.run(_torques, there.pose, there.forces, which=which)
        ends.append(machine.run(_settled, grid, found, torques))
    divided = machine.run(_divided, grid, ends)
    return [Regime(machine, divided, regime.steady, fixed=regime.fixed) for regime in regimes]


@compiled_soon(static=("which",))
def _torques(pose: Pose, forces: Forces, which: tuple[Mesh, ...]) -> Float[Array, "rows places"]:
    """What is transmitted through the meshes, and the drive torque."""
    return jnp.concatenate([through_meshes(which, pose, forces), forces.drive_torque[None]])


@compiled_soon(static=("most",))
def _changed(grid: Grid, torques: Float[Array, "rows places"], most: int) -> tuple[Changes, Place]:
    """Where functions known at the nodes change their signs, all but the last, and three places around each, flat."""
    values = jax.lax.stop_gradient(torques[:, : grid.size])
    size = jnp.max(jnp.abs(values), axis=1)
    values = values[:-1].reshape((-1, *grid.nodes.shape))
    found = jax.vmap(lambda each: sign_changes(grid, each, most))(values)
    used = found.used & (size[:-1] > IDLE * jnp.max(size))[:, None]
    found = found._replace(x=jnp.clip(found.x, NEAR - 1, 1 - NEAR), used=used)
    three = (found.x[..., None] + jnp.asarray([[[-NEAR, 0.0, NEAR]]])).ravel()
    return found, settle(grid, jnp.repeat(found.panel.ravel(), 3), three)


@compiled_soon
def _settled(grid: Grid, found: Changes, torques: Float[Array, "rows places"]) -> Float[Array, "meshes changes"]:
    """The crank angles of the changes (rad) by one more step, which has their derivatives; infinite ones are unused."""
    count = found.x.shape[1]
    three = own(torques[:-1, None], 3 * count)[:, 0].reshape((-1, count, 3))
    slope = jax.lax.stop_gradient(0.5 * (three[..., 2] - three[..., 0]) / NEAR)
    step = -safe_divide(three[..., 1], slope)
    step = jnp.where(jnp.abs(step) < 2 * NEAR, step, 0.0)
    middle, half = (jax.lax.stop_gradient(taken(part, found.panel)) for part in (grid.middle, grid.half))
    return jnp.where(found.used, middle + half * (found.x + step), jnp.inf)


@compiled_soon
def _divided(grid: Grid, ends: list[Array]) -> Grid:
    """The grid with more edges; those that are not used are in the middle of the widest panel, where nothing jumps."""
    more = jnp.concatenate([each.ravel() for each in ends])
    spare = taken(grid.middle, jnp.argmax(jax.lax.stop_gradient(grid.half)))
    more = jnp.where(jnp.isfinite(more), jnp.clip(more, grid.edges[0], grid.edges[-1]), spare)
    every = jnp.concatenate([grid.edges, more])
    edges = once(taken(every, jnp.argsort(jax.lax.stop_gradient(every))))
    half, middle = 0.5 * (edges[1:] - edges[:-1]), 0.5 * (edges[1:] + edges[:-1])
    number = jnp.searchsorted(jax.lax.stop_gradient(grid.edges), jax.lax.stop_gradient(middle), side="right") - 1
    number = jnp.clip(number, 0, grid.panels - 1)
    active, order = taken(grid.active, number), taken(grid.order, number)
    return dataclasses.replace(grid, edges=edges, half=half, middle=middle, active=active, order=order, divided=True)
