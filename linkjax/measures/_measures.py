"""Every number a designer asks for, as a function of the scene with a unit. The name states the regime.

`MEASURES` is what the tests sweep and the optimiser uses; a new measure is a function with the decorator.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax.kinematics import assembly_margins, transmission_angles
from linkjax.machine import Scene
from linkjax.measures import _forces
from linkjax.motion import Place, Regime, flywheel_for, make_grid, node_values, peaks, steady

NODES = 96  # nodes on the cycle grid unless asked otherwise


@dataclasses.dataclass(frozen=True)
class Measure:
    """A number of a scene: `function(scene, nodes)` in SI `unit`."""

    name: str
    unit: str
    function: Callable[..., Array]

    def __call__(self, scene: Scene, nodes: int = NODES) -> Array:
        return self.function(scene, nodes)


MEASURES: dict[str, Measure] = {}


def measure(unit: str):
    """Register a function of (scene, nodes) as a measure with a unit."""

    def register(function: Callable[..., Array]) -> Callable[..., Array]:
        name = function.__name__
        MEASURES[name] = Measure(name, unit, function)
        return function

    return register


@measure("1")
def delta(scene: Scene, nodes: int = NODES) -> Array:
    """Coefficient of speed fluctuation of the true motion, (ω_max - ω_min) / mean speed."""
    return steady(scene, nodes).delta


@measure("rad/s")
def largest_speed(scene: Scene, nodes: int = NODES) -> Array:
    """Largest crank speed of the true motion."""
    return steady(scene, nodes).speed_max


@measure("rad/s")
def smallest_speed(scene: Scene, nodes: int = NODES) -> Array:
    """Smallest crank speed of the true motion."""
    return steady(scene, nodes).speed_min


@measure("1")
def regime_margin(scene: Scene, nodes: int = NODES) -> Array:
    """Least kinetic energy of the true motion over ½ J̄ ω², less the least that counts as running."""
    return steady(scene, nodes).regime_margin


@measure("N m")
def mean_drive_torque(scene: Scene, nodes: int = NODES) -> Array:
    """Constant drive torque that balances the cycle."""
    return steady(scene, nodes).drive_torque


@measure("kg m^2")
def flywheel_for_target_delta(scene: Scene, nodes: int = NODES) -> Array:
    """Flywheel inertia that gives the scene's target δ (0.05 where it names none)."""
    grid = make_grid(scene, nodes)
    target = jnp.asarray(0.05) if scene.target_delta is None else scene.target_delta
    return flywheel_for(scene, target, grid, node_values(scene, grid))


@measure("1")
def smallest_margin(scene: Scene, nodes: int = NODES) -> Array:
    """Smallest signed assembly margin of all groups over the continuous cycle; negative: it cannot be assembled."""
    del nodes
    every = [
        least.value
        for sides in assembly_margins(scene.mechanism, scene.cycle_turns).values()
        for least in sides.values()
    ]
    return jnp.min(jnp.stack(every)) if every else jnp.ones(())


@measure("1")
def largest_transmission_cosine(scene: Scene, nodes: int = NODES) -> Array:
    """Largest |cos μ| of all transmission angles over the cycle: 0 at 90 degrees, 1 at a dead position."""

    def cosines(regime: Regime, place: Place) -> Array:
        angles = transmission_angles(regime.scene.mechanism, place.phi)
        return jnp.cos(jnp.stack(list(angles.values())))[:, None]

    return _largest(Regime(scene, make_grid(scene, nodes)), cosines)


@measure("N")
def peak_shaking_force_constant_speed(scene: Scene, nodes: int = NODES) -> Array:
    """Largest shaking force at constant nominal speed."""
    return _largest(_constant(scene, nodes), _forces.shaking)


@measure("N")
def rms_shaking_force_constant_speed(scene: Scene, nodes: int = NODES) -> Array:
    """Root mean square over the cycle of the shaking force at constant nominal speed."""
    regime = _constant(scene, nodes)
    force = jax.vmap(jax.vmap(lambda place: _forces.shaking(regime, place)[0]))(regime.grid.node_places())
    weights = regime.grid.half[:, None] * regime.grid.rule.w[None]
    return jnp.sqrt(jnp.sum(weights * jnp.sum(force * force, axis=-1)) / scene.cycle)


@measure("N")
def peak_shaking_force(scene: Scene, nodes: int = NODES) -> Array:
    """Largest shaking force in the true motion."""
    return _largest(_true(scene, nodes), _forces.shaking)


@measure("N m")
def peak_drive_torque_constant_speed(scene: Scene, nodes: int = NODES) -> Array:
    """Largest magnitude of the drive torque at constant nominal speed."""
    return _largest(_constant(scene, nodes), _forces.drive)


@measure("N")
def peak_reaction_constant_speed(scene: Scene, nodes: int = NODES) -> Array:
    """Largest joint or guide force at constant nominal speed."""
    return _largest(_constant(scene, nodes), _forces.reactions)


@measure("N")
def peak_reaction(scene: Scene, nodes: int = NODES) -> Array:
    """Largest joint or guide force in the true motion."""
    return _largest(_true(scene, nodes), _forces.reactions)


def _constant(scene: Scene, nodes: int) -> Regime:
    return Regime(scene, make_grid(scene, nodes))


def _true(scene: Scene, nodes: int) -> Regime:
    motion = steady(scene, nodes)
    return Regime(scene, motion.grid, motion)


def _largest(regime: Regime, components) -> Array:
    return jnp.max(peaks(regime, components).value)
