"""Results that the measures of one scene share: grid, node values, steady-state motion, each computed on first use."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax.kinematics import Pose
from linkjax.machine import Scene, ready
from linkjax.motion import Grid, Regime, Steady, asked_for, make_grid, node_poses, node_values, steady_on
from linkjax.reduction import Reduced, mass_sums

NODES = 96  # default number of nodes per crank turn on the cycle grid


class Parts:
    """A scene on a cycle grid of about `nodes` nodes per crank turn; attributes are computed on first use and kept."""

    def __init__(self, scene: Scene, nodes: int = NODES):
        self.scene, self.nodes = ready(scene), nodes

    @functools.cached_property
    def grid(self) -> Grid:
        """The cycle grid."""
        return make_grid(self.scene, self.nodes)

    @functools.cached_property
    def poses(self) -> Pose:
        """The pose at every node, leaves of shape (nodes,)."""
        return node_poses(self.scene, self.grid)

    @functools.cached_property
    def reduced(self) -> Reduced:
        """Reduced inertia, slope and torque at every node, shape (panels, n)."""
        return node_values(self.scene, self.grid, self.poses)

    @functools.cached_property
    def steady(self) -> Steady:
        """The steady-state motion."""
        asked_for(self.scene)
        return steady_on(self.scene, self.grid, self.reduced)

    @functools.cached_property
    def constant_speed(self) -> Regime:
        """Constant nominal speed."""
        return Regime(self.scene, self.grid)

    @functools.cached_property
    def true_motion(self) -> Regime:
        """The actual steady-state motion."""
        return Regime(self.scene, self.grid, self.steady)

    def shaking(self, regime: Regime) -> Float[Array, "1 2 panels n"]:
        """Shaking force at every node (N), as one quantity of two parts."""
        places = jax.tree.map(jnp.ravel, self.grid.node_places())

        def at(here, place):
            first, second = mass_sums(here)
            speed, acceleration = regime.crank(place)
            force = -(second * speed**2 + first * acceleration)
            return force.x, force.y

        return jnp.stack(jax.vmap(at)(self.poses, places)).reshape((1, 2, *self.grid.nodes.shape))
