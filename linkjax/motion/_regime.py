"""A regime: how the crank moves over the cycle, at constant speed or in the actual steady-state motion."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide, taken
from linkjax.forces import Forces
from linkjax.kinematics import Pose
from linkjax.machine import Scene
from linkjax.motion._by_speed import moving_at, on_pose
from linkjax.motion._grid import Grid, Place
from linkjax.motion._steady import Steady
from linkjax.sampling import Sample, Sampler


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
        return at.driven[1]

    def forces(self, at: At) -> Forces:
        """Joint reactions, drive torque, and the other forces."""
        return at.forces

    def find_forces(self, at: At) -> Forces:
        """The same, found anew."""
        (active, crank), place = at.driven, at.place
        return self.machine.forces(place.phi, place.side, at.pose, active, *crank, fixed=self.fixed)

    def find_driven(self, at: At) -> Any:
        """The loads that act, crank speed and acceleration, found anew."""
        scene = self.machine.still.scene if self.fixed else self.scene
        dynamics = None if self.steady is None or self.grid.prescribed else at.sample.dynamics
        here = None if dynamics is None or not on_pose(scene) else at.sample.pose
        return self.machine.run(_driven, self.grid, self.steady, scene.speed, at.place, dynamics, here)


class At:
    """The machine at several places of the grid, in a regime; what is asked for is computed on first use and kept."""

    def __init__(self, regime: Regime, place: Place, sample: Sample | None):
        self.regime, self.place, self._given = regime, place, sample

    @functools.cached_property
    def sample(self) -> Sample:
        """Samples with the reduced model."""
        return self._asked() if self._given is None else self._given

    @functools.cached_property
    def gaps(self) -> Sample:
        """Samples with margins and transmission angles."""
        return self.sample if self._given is not None else self._asked(dynamics=False, gaps=True)

    @functools.cached_property
    def pose(self) -> Pose:
        """Points and links."""
        known = self._given is not None or "sample" in self.__dict__
        if not known and "gaps" in self.__dict__:
            return self.gaps.pose
        return self.sample.pose if known else self._asked(dynamics=False).pose

    @property
    def transmission(self) -> dict[str, Any]:
        """Transmission angles of the groups (rad)."""
        return self.gaps.transmission

    @functools.cached_property
    def driven(self) -> Any:
        """The loads that act, and crank speed (rad/s) and acceleration (rad/s²)."""
        return self.regime.find_driven(self)

    @functools.cached_property
    def forces(self) -> Forces:
        """All forces."""
        return self.regime.find_forces(self)

    def _asked(self, **what: bool) -> Sample:
        return self.regime.machine.sample(self.place.phi, self.place.side, fixed=self.regime.fixed, **what)


Components = Callable[[Regime, At], Float[Array, "quantities parts places"]]


@compiled_soon
def _driven(
    grid: Grid, steady: Steady | None, nominal: Array, place: Place, dynamics: Any, here: Pose | None
) -> tuple[Array, tuple[Array, Array]]:
    return taken(grid.active, place.panel), crank_at(grid, steady, nominal, place, dynamics, here)


def crank_at(
    grid: Grid, steady: Steady | None, nominal: Array, place: Place, dynamics: Any, pose: Pose | None
) -> tuple[Array, Array]:
    """Crank speed (rad/s) and acceleration (rad/s²) at places, in the actual motion or, without one, at constant
    nominal speed; with the pose there, if loads depend on the speed."""
    if steady is None or grid.prescribed:
        return nominal * jnp.ones_like(place.phi), jnp.zeros_like(place.phi)
    moving = None
    if pose is not None and steady.driven is not None:
        moving = moving_at(steady.driven.torques, grid, pose, place.phi, place.panel)
    here = grid.reduced(dynamics, place.panel)
    return steady.crank(nominal, here, _around(steady.grid, place) if grid.divided else place, moving)


def is_locked(grid: Grid, moves: Array | None) -> Array:
    """Whether friction locks the machine at one of the nodes, which come first in `moves`."""
    return jnp.asarray(False) if moves is None else ~jnp.all(moves[: grid.size])


def _around(grid: Grid, place: Place) -> Place:
    """The place on a grid of a place on another one, which divides its panels."""
    panel = jnp.searchsorted(grid.edges, jax.lax.stop_gradient(place.side), side="right").astype(jnp.int32) - 1
    panel = jnp.clip(panel, 0, grid.panels - 1)
    middle, half = taken(grid.middle, panel), taken(grid.half, panel)
    return Place(panel, jnp.clip(safe_divide(place.phi - middle, half), -1.0, 1.0), place.phi, middle)
