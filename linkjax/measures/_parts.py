"""Results that the measures of one scene share: grid, node values, steady-state motion, each computed on first use."""

from __future__ import annotations

import functools

from jaxtyping import Array, Float

from linkjax.machine import ReadyScene, Scene, ready
from linkjax.measures._forces import shaking
from linkjax.motion import AtNodes, Grid, Regime, Steady, at_nodes, by_node, grid_of, steady_on
from linkjax.reduction import Reduced
from linkjax.sampling import Sampler

NODES = 96  # default number of nodes per crank turn on the cycle grid


class Parts:
    """A scene on a cycle grid of about `nodes` nodes per crank turn; attributes are computed on first use and kept.
    `grid` and node values `at` may be given."""

    def __init__(
        self, scene: Scene | ReadyScene, nodes: int = NODES, grid: Grid | None = None, at: AtNodes | None = None
    ):
        self.ready, self.nodes, self._grid, self._at = ready(scene), nodes, grid, at

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.ready.scene

    @functools.cached_property
    def machine(self) -> Sampler:
        """The scene, evaluated in batches."""
        return Sampler(self.ready)

    @functools.cached_property
    def grid(self) -> Grid:
        """The cycle grid."""
        return grid_of(self.machine, self.nodes) if self._grid is None else self._grid

    @functools.cached_property
    def at(self) -> AtNodes:
        """The machine at the nodes."""
        return at_nodes(self.machine, self.grid, edges=False, gaps=True) if self._at is None else self._at

    @property
    def reduced(self) -> Reduced:
        """Reduced inertia, slope and torque at every node, shape (panels, n)."""
        return self.at.here

    @functools.cached_property
    def steady(self) -> Steady:
        """The steady-state motion."""
        return steady_on(self.machine, self.grid, self.at)

    @functools.cached_property
    def constant_speed(self) -> Regime:
        """Constant nominal speed."""
        return Regime(self.machine, self.grid)

    @functools.cached_property
    def true_motion(self) -> Regime:
        """The actual steady-state motion."""
        return Regime(self.machine, self.grid, self.steady)

    def shaking(self, regime: Regime) -> Float[Array, "1 2 panels n"]:
        """Shaking force at every node (N), as one quantity of two parts."""
        return self.machine.run(by_node, self.grid, shaking(regime, regime.at(self.at.place, self.at.sample)))
