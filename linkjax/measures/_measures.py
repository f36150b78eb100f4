"""The measures of the motion and of the balance of work: δ, extreme speeds, steady state, mean torque, flywheel."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_divide
from linkjax.machine import Scene
from linkjax.measures._families import values_of
from linkjax.measures._family import Asked
from linkjax.measures._gaps import margins, transmission_angles
from linkjax.measures._parts import Parts
from linkjax.measures._quantities import QUANTITIES
from linkjax.measures._registry import least, measure, of_family
from linkjax.motion import (
    LEAST,
    At,
    Regime,
    Rows,
    Sized,
    Summits,
    Wanted,
    by_node,
    every_row,
    flywheel_on,
    with_flywheel,
)

MEAN_POWER = Asked("mean_motor_power", "")
SLOW = 0.1  # of the largest rate: the least rate of δ per inertia that is used


def _extreme_speeds(of: Parts, finish: Callable[[Rows, Rows], Rows]) -> Wanted:
    """Crank speeds of the actual motion that may be the largest, and those that may be the smallest; `finish` makes
    rows of both."""
    above = 2 * jax.lax.stop_gradient(of.steady.max_speed)

    def speeds(regime: Regime, at: At) -> Array:
        speed, _ = regime.crank(at)
        return jnp.stack([speed, above - speed])[:, None]

    def finished(found: Summits) -> Rows:
        fast, slow = found.vectors
        return finish(Rows(fast, found.angle[0], signed=True), Rows(above - slow, found.angle[1], signed=True))

    inertia = of.steady.inertia(of.reduced.inertia)
    work = of.steady.work.at(of.grid.node_places())
    at_nodes = jnp.sqrt(jnp.maximum(2 * (of.steady.energy + work) / inertia, 0.0))
    return Wanted(of.true_motion, speeds, jnp.stack([at_nodes, above - at_nodes])[:, None], finished)


def _swings(of: Parts) -> Wanted:
    """δ of every pair of a largest and a smallest speed, with the angle of the largest."""

    def pairs(fast: Rows, slow: Rows) -> Rows:
        every = (fast.vectors - slow.vectors.T) / of.steady.reference(of.scene.speed)
        angle = jnp.broadcast_to(fast.angle[:, None], every.shape)
        return Rows(every.reshape((-1, 1)), angle.ravel(), signed=True)

    return _extreme_speeds(of, pairs)


@measure("1", _swings, motion=True)
def delta(of: Parts) -> Array:
    """Coefficient of speed fluctuation of the actual motion, (ω_max - ω_min) / mean speed."""
    return of.steady.delta


@measure("rad/s", lambda of: _extreme_speeds(of, lambda fast, slow: fast), motion=True)
def max_crank_speed(of: Parts) -> Array:
    """Largest crank speed of the actual motion."""
    return of.steady.max_speed


@measure("rad/s", lambda of: _extreme_speeds(of, lambda fast, slow: slow), smallest=True, motion=True)
def min_crank_speed(of: Parts) -> Array:
    """Smallest crank speed of the actual motion."""
    return of.steady.min_speed


@measure("1", lambda of: _extreme_speeds(of, lambda fast, slow: _slowed(of, slow)), motion=True)
def slow_down(of: Parts) -> Array:
    """Largest drop of the crank speed below its time mean, 1 - ω_min / ω_mean."""
    return 1 - of.steady.min_speed * of.steady.period / of.scene.cycle


def _slowed(of: Parts, slow: Rows) -> Rows:
    return Rows(1 - slow.vectors * of.steady.period / of.scene.cycle, slow.angle, signed=True)


@measure("J", motion=True)
def energy_per_cycle(of: Parts) -> Array:
    """Net work per cycle: at the shaft of the motor, or of the drive on the crank without one."""
    if of.scene.motor is None:
        return of.steady.mean_drive_torque * of.scene.cycle
    return values_of(of, [MEAN_POWER])[0] * of.steady.period


def _least_energies(of: Parts) -> Wanted | Rows:
    """Steady-state margins, for every kinetic energy that may be the smallest; the margin itself where torques depend
    on the speed."""
    steady = of.steady
    if steady.driven is not None:
        return Rows(steady.steady_state_margin[None, None], jnp.full(1, jnp.nan), signed=True)
    inertia = steady.inertia(of.reduced.inertia)
    per_joule = 1 / (0.5 * _mean(of, inertia) * of.scene.speed**2)
    work = steady.work.at(of.grid.node_places())
    above = 2 * jax.lax.stop_gradient(jnp.max(jnp.abs(steady.energy + work)))

    def missing(regime: Regime, at: At) -> Array:
        assert regime.steady is not None
        return (above - regime.steady.energy - regime.steady.work.at(at.place))[None, None]

    def finished(found: Summits) -> Rows:
        return Rows((above - found.vectors[0]) * per_joule - LEAST, found.angle[0], signed=True)

    return Wanted(of.true_motion, missing, (above - steady.energy - work)[None, None], finished, "place")


@measure("1", _least_energies, smallest=True, motion=True)
def steady_state_margin(of: Parts) -> Array:
    """Least kinetic energy of the actual motion divided by ½ J̄ ω², minus 1e-6; negative: no steady-state motion."""
    return of.steady.steady_state_margin


def _mean(of: Parts, at_nodes: Array) -> Array:
    """Mean over the cycle of values at the nodes, shape (panels, n)."""
    return jnp.sum(of.grid.half[:, None] * of.grid.rule.w[None] * at_nodes) / of.scene.cycle


def _light_places(of: Parts) -> Wanted:
    """Reduced inertias, divided by their mean, that may be the smallest."""
    inertia, mean = of.reduced.inertia + of.steady.rotor, _mean(of, of.steady.inertia(of.reduced.inertia))
    above = 2 * jax.lax.stop_gradient(jnp.max(inertia))

    def missing(regime: Regime, at: At) -> Array:
        found = regime.grid.reduced(at.sample.dynamics, at.place.panel).inertia
        return (above - found - of.steady.rotor)[None, None]

    def finished(found: Summits) -> Rows:
        light = safe_divide(above - found.vectors[0], mean)
        return Rows(jnp.where(mean > 0, light, jnp.minimum(light, -1.0)), found.angle[0], signed=True)

    return Wanted(of.constant_speed, missing, (above - inertia)[None, None], finished)


@measure("1", _light_places, smallest=True, motion=True)
def min_inertia_ratio(of: Parts) -> Array:
    """Least reduced inertia divided by its mean; near zero the crank speed has a sharp peak there."""
    return of.steady.min_inertia_ratio


@measure("N m", motion=True)
def mean_drive_torque(of: Parts) -> Array:
    """Mean torque of the drive on the crank; without a motor the constant torque that balances the cycle."""
    return of.steady.mean_drive_torque


@measure("W", motion=True)
def mean_drive_power(of: Parts) -> Array:
    """Mean power of the drive on the crank: its work per cycle divided by the period."""
    return of.steady.mean_drive_torque * of.scene.cycle / of.steady.period


def _flywheels(of: Parts) -> Rows:
    """The flywheel inertia for every pair of a largest and a smallest speed, to first order about the inertia found, so
    that pairs with equal fluctuation there are exact."""
    needed, grid, at = of.once("flywheel", lambda: _sized(of))
    if of.scene.mechanism.prescribed:
        return Rows(needed[None, None], jnp.full(1, jnp.nan), signed=True)
    parts = Parts(of.ready, of.nodes, grid, at)
    swings, still = _swings_with(needed, parts), jax.lax.stop_gradient(needed)
    fixed = Parts(of.ready, of.nodes, *jax.lax.stop_gradient((grid, at)))
    _, rate = jax.jvp(lambda inertia: _swings_with(inertia, fixed).vectors, (still,), (jnp.ones_like(still),))
    steep = jnp.maximum(-rate, SLOW * jnp.max(-rate))
    return Rows(needed + (swings.vectors - _target(of.scene)) / steep, swings.angle, signed=True)


def _swings_with(inertia: Array, of: Parts) -> Rows:
    """`_swings` with another flywheel, on the same grid: positions and loads do not depend on the flywheel."""
    more = inertia - of.scene.mechanism.flywheel.inertia
    here = of.at.here._replace(inertia=of.at.here.inertia + more)
    bare, *rest = of.at.sample.dynamics
    sample = of.at.sample._replace(dynamics=(bare + more, *rest))
    scene = of.ready.of(with_flywheel(of.scene, inertia))  # a flywheel moves nothing
    parts = Parts(scene, of.nodes, of.grid, of.at._replace(here=here, sample=sample))
    return every_row([_swings(parts)])[0]


def _target(scene: Scene) -> Array:
    return jnp.asarray(0.05) if scene.target_delta is None else scene.target_delta


@measure("kg m^2", _flywheels, motion=True)
def flywheel_for_target_delta(of: Parts) -> Array:
    """Flywheel inertia that gives the scene's target δ (0.05 if it has none)."""
    return of.once("flywheel", lambda: _sized(of)).inertia


def _sized(of: Parts) -> Sized:
    """The flywheel for the target δ, with the grid and node values for it."""
    return flywheel_on(of.machine, _target(of.scene), of.grid, of.at, of.grid_with)


@least("1")
def min_margin(of: Parts) -> Rows:
    """Smallest signed assembly margin of all groups over the continuous cycle; negative: cannot be assembled."""
    return margins(of)


@least("rad")
def min_transmission_angle(of: Parts) -> Wanted:
    """Smallest of all transmission angles over the cycle, where an obtuse angle counts as its supplement: 90 degrees is
    best, and zero is a singular position. Groups of higher class have none; raises `StructureError` if there are no
    other groups."""
    return transmission_angles(of)


peak_shaking_force_constant_speed = of_family("peak_shaking_force_constant_speed")


def _all_shaking(of: Parts) -> Rows:
    """The shaking forces of the whole cycle as one vector, whose length is their root mean square. They are smooth on
    any grid, and the square root of a panel of zero width, between loads that switch together, has no derivative. So
    the crank angles are kept fixed."""
    still = Parts(of.ready, of.nodes, jax.lax.stop_gradient(of.grid))
    regime, grid = still.constant_speed, still.grid
    found = QUANTITIES["shaking_force"].at(still, ())(regime, regime.at(still.at.place, still.at.sample))
    share = grid.half[:, None] * grid.rule.w[None] / of.scene.cycle
    forces = of.machine.run(by_node, grid, found)[0]
    return Rows((jnp.sqrt(share)[None] * forces).reshape((1, -1)), jnp.full(1, jnp.nan))


@measure("N", _all_shaking, motion=False)
def rms_shaking_force_constant_speed(of: Parts) -> Array:
    """Root mean square over the cycle of the shaking force at constant nominal speed."""
    return _all_shaking(of).size()[0]


peak_shaking_force = of_family("peak_shaking_force")
peak_shaking_moment_constant_speed = of_family("peak_shaking_moment_constant_speed")
peak_drive_torque_constant_speed = of_family("peak_drive_torque_constant_speed")
max_drive_torque_constant_speed = of_family("max_drive_torque_constant_speed")
min_drive_torque_constant_speed = of_family("min_drive_torque_constant_speed")
peak_reaction_constant_speed = of_family("peak_reaction_constant_speed")
peak_reaction = of_family("peak_reaction")
