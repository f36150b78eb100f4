"""A motion on one grid as the guess of the motion on another one, from which Newton's method begins.

Where the motion has kinks of its own, it is found on several grids in turn, every time near the last one.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from linkjax._compile import compiled_soon
from linkjax._tree import node
from linkjax.forces import has_linear_reactions
from linkjax.friction import pairs
from linkjax.machine import Scene
from linkjax.motion._by_speed import between
from linkjax.motion._flow import Flow
from linkjax.motion._grid import Grid

LEAST = 1e-4  # of the square of the nominal speed: a guess is not less


@node
class Guess:
    """Squares of the crank speed at the nodes, relative to that of the nominal speed, shape (panels, n); frictions and
    accelerations there (see `FrictionTorque`; None without), the number of stable motions in the range of speeds, and
    whether all of this is `known`: otherwise it means nothing."""

    squares: Float[Array, "panels n"]
    near: Any
    number: Int[Array, ""]
    known: Bool[Array, ""]


def rubbing_joints(scene: Scene) -> int:
    """The number of joints whose frictions are found with the motion."""
    return len(pairs(scene.mechanism, scene.friction)) if has_linear_reactions(scene.mechanism) else 0


@compiled_soon(static=("joints",))
def unknown(grid: Grid, joints: int) -> Grid:
    """The grid with a guess that is not known."""
    none = jnp.zeros_like(grid.nodes)
    near = (none[:, None] * jnp.zeros(joints)[None, :, None], none) if joints else None
    return dataclasses.replace(grid, guess=Guess(none, near, jnp.zeros((), int), jnp.asarray(False)))


@compiled_soon
def guessed(flow: Flow, energy: Array, grid: Grid) -> Grid:
    """The grid with a motion on another grid as its guess."""
    flow, energy, at = jax.lax.stop_gradient((flow, energy, grid.nodes))
    assert flow.driven is not None
    place = flow.grid.place(at.ravel())
    squares = (flow.speed(energy + flow.at_nodes, flow.inertia) / flow.duty.speed) ** 2

    def moved(rows: Array) -> Array:
        found = between(flow.grid, rows, place.panel, place.x)
        return jnp.moveaxis(found.reshape((*found.shape[:-1], *at.shape)), -2, 0)

    near = jax.tree.map(moved, flow.driven.near)
    guess = Guess(jnp.maximum(moved(squares), LEAST), near, flow.driven.number, flow.driven.number > 0)
    return dataclasses.replace(grid, guess=guess)
