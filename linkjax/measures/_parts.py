"""Results that the measures of one scene share: grid, node values, steady-state motion, each computed on first use."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from linkjax.kinematics import Least, Reversals, find_dead_centres, find_margins
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.motion import (
    At,
    AtNodes,
    Grid,
    Regime,
    Steady,
    at_nodes,
    grid_with_kinks,
    node_places,
    steady_on,
    with_kinks,
)
from linkjax.reduction import Reduced
from linkjax.sampling import Sampler

NODES = 96  # default number of nodes per crank turn on the cycle grid


class Parts:
    """A scene, or the machine that evaluates it, on a cycle grid of about `nodes` nodes per crank turn; attributes are
    computed on first use and kept. `grid`, node values `at` and the `steady` motion may be given; panels of a grid that
    is made also end at the crank angles `breaks` (rad). It serves the actual motion if that `moves`, and constant speed
    if that is asked for, as `still`. Outside of jax transformations it serves both, with the programs of an analysis.
    """

    def __init__(
        self,
        scene: Scene | ReadyScene | Sampler,
        nodes: int = NODES,
        grid: Grid | None = None,
        at: AtNodes | None = None,
        breaks: tuple[float, ...] = (),
        steady: Steady | None = None,
        moves: bool = True,
        still: bool = True,
    ):
        self.machine = scene if isinstance(scene, Sampler) else Sampler(ready(scene))
        self.nodes, self._grid, self._at, self._breaks = nodes, grid, at, breaks
        self.steady_known = steady
        self._moves, self._still = moves or not self.machine.traced, still
        self._made: dict[Any, Any] = {}

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.ready.scene

    @property
    def ready(self) -> ReadyScene:
        """The scene with its paths."""
        return self.machine.ready

    @functools.cached_property
    def grid(self) -> Grid:
        """The cycle grid."""
        return self._grid or self.grid_with(0.0)

    def grid_with(self, added: Any) -> Grid:
        """The cycle grid for the motion with a flywheel inertia (kg m²) that the machine does not have."""
        asked = {"breaks": self._breaks, "moves": self._moves, "still": self._still}
        return grid_with_kinks(self.machine, self.nodes, added=added, **asked)

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
        assert self._moves, "the grid does not serve the actual motion"
        return self.steady_known or steady_on(self.machine, self.grid, self.at)

    @functools.cached_property
    def constant_speed(self) -> Regime:
        """Constant nominal speed."""
        return Regime(self.machine, self.grid)

    def once(self, key: Any, made: Callable[[], Any]) -> Any:
        """What `made` returns, called once for a key."""
        if key not in self._made:
            self._made[key] = made()
        return self._made[key]

    def nodes_in(self, regime: Regime) -> At:
        """The machine at the nodes in a regime of this scene."""
        if regime.grid.divided:
            return self.once(regime, lambda: regime.at(self.machine.run(node_places, regime.grid, edges=False)))
        return self.once(regime, lambda: regime.at(self.at.place, self.at.sample))

    def with_kinks(self, regime: Regime) -> Regime:
        """The same motion, with panels that also end where reactions have a kink."""
        return self.once(("kinks", regime), lambda: with_kinks([regime], [self.nodes_in(regime)])[0])

    @functools.cached_property
    def dead_centres(self) -> dict[str, Reversals]:
        """Dead centres of sliders and limit positions of links."""
        return find_dead_centres(self.machine, self.scene.cycle_turns)

    @functools.cached_property
    def margins(self) -> dict[str, dict[str, Least]]:
        """Least assembly margins."""
        return find_margins(self.machine, self.scene.cycle_turns)

    @functools.cached_property
    def true_motion(self) -> Regime:
        """The actual steady-state motion."""
        return Regime(self.machine, self.grid, self.steady)
