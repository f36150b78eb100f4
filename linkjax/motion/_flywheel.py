"""The flywheel that gives a target coefficient of speed fluctuation."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import root, safe_divide, smallest
from linkjax._types import Scalar
from linkjax.machine import Scene, ready
from linkjax.mechanism import Flywheel
from linkjax.motion._grid import Grid, make_grid
from linkjax.motion._steady import Steady, node_values, steady_on
from linkjax.reduction import Reduced


def with_flywheel(scene: Scene, inertia: Scalar) -> Scene:
    """The scene with another flywheel inertia (kg m²)."""
    return scene.with_mechanism(eqx.tree_at(lambda m: m.flywheel, scene.mechanism, Flywheel(inertia)))


def flywheel_for(scene: Scene, delta: Scalar | float, nodes: int = 96) -> Array:
    """Flywheel inertia (kg m²) that makes δ of the actual motion exactly `delta`, all else unchanged; `nodes` is the
    number of grid nodes per crank turn. Negative if δ is smaller even without a flywheel; zero if the driver has a
    motion law."""
    scene = ready(scene)
    grid = make_grid(scene, nodes)
    return flywheel_on(scene, jnp.asarray(delta, dtype=scene.speed.dtype), grid, node_values(scene, grid))


def flywheel_on(scene: Scene, delta: Scalar, grid: Grid, here: Reduced) -> Array:
    """The same from the node values; see `flywheel_for`.

    Solves 1/δ(J) = 1/δ_target; 1/δ is nearly linear in J. The root is differentiated implicitly. The work over the
    cycle does not depend on the flywheel, so the mechanism is not evaluated again. Negative (down to minus half the
    least reduced inertia) if δ is smaller even without a flywheel.
    """
    if scene.mechanism.prescribed:  # δ is zero
        return jnp.zeros_like(scene.speed)
    bare = here.inertia - scene.mechanism.flywheel.inertia
    least = -0.5 * smallest(bare)

    def excess(inertia):
        at = with_flywheel(scene, inertia)
        got = steady_on(at, grid, here._replace(inertia=bare + inertia)).delta
        return delta / jnp.maximum(got, 1e-9 * delta) - 1  # a δ near zero counts as 1e-9 of the target

    def solve(function, start):
        def step(state):
            count, x, before, value_before, _ = state
            value = function(x)
            slope = safe_divide(value - value_before, x - before)
            rising = jnp.where(slope > 0, slope, safe_divide(1.0 + value, jnp.mean(bare) + x))
            new = jnp.maximum(x - value / rising, least)
            moved = jnp.abs(new - x) > 4e-16 * (jnp.abs(new) + jnp.mean(bare))
            return count + 1, new, x, value, moved

        state = (0, start, start, jnp.zeros_like(start), jnp.asarray(True))
        return jax.lax.while_loop(lambda s: s[4] & (s[0] < 30), step, state)[1]

    return root(excess, jax.lax.stop_gradient(jnp.maximum(scene.mechanism.flywheel.inertia, 0.0)), solve)


def textbook_flywheel(steady: Steady, delta: Scalar) -> Array:
    """Flywheel inertia (kg m²) by the textbook formula ΔA / (δ ω²), which ignores the reduced inertia; for comparison.

    ΔA is the largest excess work, max W - min W. Source: e.g. Norton, Design of Machinery, eq. 11.20.
    """
    swing = steady.work.extreme(1)[0] - steady.work.extreme(-1)[0]
    return swing / (delta * steady.mean_speed**2)
