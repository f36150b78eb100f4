"""The flywheel that gives a target coefficient of speed fluctuation."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import root, safe_divide, smallest
from linkjax._types import Scalar, Tracer, known
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import Flywheel
from linkjax.motion._by_speed import speed_dependent
from linkjax.motion._flow import duty_of
from linkjax.motion._grid import Grid
from linkjax.motion._nodes import AtNodes, at_nodes
from linkjax.motion._speed_extremes import driven_on
from linkjax.motion._steady import Steady, begin, fluctuation
from linkjax.motion._switching import grid_with_kinks, kinked
from linkjax.reduction import Reduced
from linkjax.sampling import Sampler


def with_flywheel(scene: Scene, inertia: Scalar) -> Scene:
    """The scene with another flywheel inertia (kg m²)."""
    return scene.with_mechanism(eqx.tree_at(lambda m: m.flywheel, scene.mechanism, Flywheel(inertia)))


def flywheel_for(scene: Scene | ReadyScene, delta: Scalar | float, nodes: int = 96) -> Array:
    """Flywheel inertia (kg m²) that makes δ of the actual motion exactly `delta`, all else unchanged; `nodes` is the
    number of grid nodes per crank turn. Negative if δ is smaller even without a flywheel; zero if the driver has a
    motion law. Raises `ValueError` for a `delta` that is not above zero. Source: the energy
    equation, as in `steady_motion`."""
    wanted = known(jnp.asarray(delta))
    if wanted is not None and not np.all(wanted > 0):
        raise ValueError(f"delta is {wanted}; write a coefficient of speed fluctuation above zero, e.g. 0.05")
    machine = Sampler(ready(scene))
    regrid = functools.partial(grid_with_kinks, machine, nodes, still=False)
    grid = regrid()
    delta = jnp.asarray(delta, dtype=machine.scene.speed.dtype)
    at = at_nodes(machine, grid, edges=False)
    return flywheel_on(machine, delta, grid, at, lambda added: regrid(added=added)).inertia


class Sized(NamedTuple):
    """A flywheel inertia (kg m²), and the grid with its node values on which it was found."""

    inertia: Array
    grid: Grid
    at: AtNodes


def flywheel_on(
    machine: Sampler, delta: Any, grid: Grid, at: AtNodes, regrid: Callable[[Any], Grid], known: Any = None
) -> Sized:
    """The same from the node values; see `flywheel_for`. `known` is δ with the given flywheel.

    The motion with another flywheel has its kinks elsewhere. If it may have any, `regrid` gives the grid for a flywheel
    inertia added to the given one, and the search is repeated there, from the first result.
    """
    scene = machine.scene
    if grid.prescribed:  # δ is zero
        return Sized(jnp.zeros_like(scene.speed), grid, at)
    found, idle = _searched(machine, delta, grid, at, known)
    for _ in range(AGAIN if kinked(scene) and not idle else 0):
        start, added = machine.run(_more, found, scene.mechanism.flywheel.inertia)
        grid = regrid(added)
        at = at_nodes(machine, grid, edges=False)
        found, _ = _searched(machine, delta, grid, at, start=start)
    return Sized(found, grid, at)


def _searched(
    machine: Sampler, delta: Any, grid: Grid, at: AtNodes, known: Any = None, start: Any = None
) -> tuple[Any, bool]:
    """The flywheel inertia for the motion on one grid, searched from `start` or from the given one; and, outside of jax
    transformations, whether the search was given up because there is no motion.

    Solves 1/δ(J) = 1/δ_target; 1/δ is nearly linear in J. The root is differentiated implicitly. Positions and loads
    do not depend on the flywheel, so they are not computed again. Negative (down to minus half the least reduced
    inertia) if δ is smaller even without a flywheel.
    """
    scene = machine.scene
    given, duty = scene.mechanism.flywheel.inertia, duty_of(scene)
    state, more = machine.run(_search, given, start, at.here)

    def begun(added):
        if speed_dependent(scene):
            return driven_on(machine, grid, at, added)[0]
        return machine.run(begin, duty, grid, at.here, added)

    def step(state):
        now = begun(state.added)
        runs = None if now.flow.driven is None else now.flow.driven.found
        return machine.run(_step, state, fluctuation(machine, now), delta, given, more, runs)

    def excess(inertia):
        return step(state._replace(inertia=inertia, added=inertia - given)).excess

    def solve(_, start):
        first = state._replace(inertia=start, before=start, added=start - given)
        return machine.until(_going, step, first, delta).inertia

    if machine.traced or isinstance(delta, Tracer):
        return root(excess, state.inertia, solve), False
    if known is not None:
        runs = jnp.asarray(True) if speed_dependent(scene) else None
        state = machine.run(_step, state, known, delta, given, more, runs)
    last = machine.until(_going, step, state, delta)
    return last.inertia, isinstance(last.idle, jax.Array) and bool(last.idle >= IDLE)


AGAIN = 1  # searches on a grid whose panels end at the kinks of the motion with the flywheel found
STEPS = 30  # secant steps for a flywheel
IDLE = 8  # steps without a motion, one after the other: then the drive cannot carry the loads with any flywheel
SAME = 1e-9  # relative: a step as small as this is the last; its error is far smaller, as secant steps converge fast


class Search(NamedTuple):
    """A secant search: number of steps, and of the last ones without a motion, inertia and what it adds to the
    given one, the inertia before, the excess of 1/δ there, and whether to go on."""

    steps: Array
    idle: Array
    inertia: Array
    added: Array
    before: Array
    excess: Array
    moved: Array


def _going(state: Search) -> Array:
    return state.moved


@compiled_soon
def _more(found: Array, given: Array) -> tuple[Array, Array]:
    """A flywheel inertia, and what it adds to the given one (kg m²), both without derivatives."""
    return jax.lax.stop_gradient((found, found - given))


@compiled_soon
def _search(given: Array, start: Array | None, here: Reduced) -> tuple[Search, tuple[Array, Array]]:
    """The start of the search; the mean reduced inertia without a flywheel, and minus half the least one."""
    bare = here.inertia - given
    start = jax.lax.stop_gradient(jnp.maximum(given, 0.0) if start is None else start)
    none = jnp.asarray(0)
    state = Search(none, none, start, start - given, start, jnp.zeros_like(start), jnp.asarray(True))
    return state, (jnp.mean(bare), -0.5 * smallest(bare))


@compiled_soon
def _step(state: Search, got: Array, delta: Array, given: Array, more: tuple[Array, Array], runs: Any = None) -> Search:
    """The next inertia, from the fluctuation that the present one gives; `runs` says whether it has a motion."""
    value = delta / jnp.maximum(got, 1e-9 * delta) - 1  # a δ near zero counts as 1e-9 of the target
    x, (mean, least) = state.inertia, more
    slope = safe_divide(value - state.excess, x - state.before)
    rising = jnp.where(slope > 0, slope, safe_divide(1.0 + value, mean + x))
    new = jnp.maximum(x - value / rising, least)
    moved, idle = (jnp.abs(new - x) > SAME * (jnp.abs(new) + mean)) & (state.steps < STEPS), state.idle
    if runs is not None:
        idle = jnp.where(runs, 0, idle + 1)
        moved &= idle < IDLE
    return Search(state.steps + 1, idle, new, new - given, x, value, moved)


def textbook_flywheel(steady: Steady, delta: Scalar) -> Array:
    """Flywheel inertia (kg m²) by the textbook formula ΔA / (δ ω²), which ignores the reduced inertia; for comparison.

    ΔA is the largest excess work, max W - min W, at a constant torque of the drive.
    Source: e.g. Norton, Design of Machinery, eq. 11.20.
    """
    return steady.excess_work / (delta * steady.mean_speed**2)
