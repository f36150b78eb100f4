"""Self-locking: by which common factor all friction may grow until no finite drive torque moves the machine.

Frictions c solve c = -λ σ s(R₀ + M c), see `linkjax.forces._friction`. The solution that continues the one without
friction exists for factors λ below a limit, where the matrix A = I + λ σ s' M is singular: either c grows without
bound, or two solutions meet. With the left null vector w of A there, a change of the equation F(c, λ) = 0 changes the
limit by -w·dF / (w·∂F/∂λ). Source: efficiency zero as the condition of self-locking, formula (7-13) of the textbook;
Seydel, Practical Bifurcation and Stability Analysis, 2010, ch. 5, for the derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._lapack import solve, svd
from linkjax._numerics import safe_divide
from linkjax.forces._friction import Linear, eliminated, is_last
from linkjax.forces._kinetostatics import acting_on, applied_to, friction_numbers, reactions_of
from linkjax.friction import rubbing
from linkjax.kinematics import Pose
from linkjax.loads import Instant
from linkjax.machine import Scene

LEAST, MOST = 1e-6, 1e3  # the range of factors; close to a dead centre larger ones have few digits
FIRST, LONGER, SHORTER = 2.0, 1.5, 0.3  # the first step of its logarithm; the next after a solution, and without one
STEPS, NEWTON = 120, 8  # of the factor; of Newton's method, from the solution before
LEFT = 4e5  # roundings of the largest friction: what is left of the equations of a solution
ROUNDS = 3  # of Newton's method for the end of the solution
NEAR = 1e-6, 0.1  # relative: how far they lead from where the steps end, for the factor and the frictions
GROWS, BEYOND = 1e-6, 1e8  # frictions above this share of the largest grow without bound; they are set to so much


class Locking(NamedTuple):
    """The inverse of the factor at which the machine locks, zero where it does not up to 1000; and the share of the
    power of friction of each joint there, shape (joints,), in the order of the joints with friction."""

    inverse: Array
    shares: Array


def locking_of_pose(scene: Scene, here: Pose, at: Instant, active: Array) -> Locking:
    """Self-locking of a scene with friction in a pose, quasi-static: with weights and loads but no inertia, as the
    crank turns on (`at.speed` zero or more) or back."""
    origins, none = scene.mechanism.origins(), jnp.zeros(())
    joints = rubbing(scene.mechanism, scene.friction, here, jnp.where(at.side >= at.phi, 1.0, -1.0))
    acting = acting_on(scene, here, origins, *applied_to(scene, here, at, active, none, none)[:3])
    frictions, senses, paces = friction_numbers(joints)
    senses = jnp.where(at.speed < 0, -senses, senses)
    reactions = reactions_of(scene, here, origins, joints, lambda _: acting)

    fixed = jax.lax.stop_gradient
    quiet = fixed(reactions) if isinstance(reactions, Linear) else reactions

    def left(reactions, c: Array, factor: Array) -> Array:
        there = reactions(c, none)
        sizes = [each.size(*(part[i] for part in there)) for i, each in enumerate(frictions)]
        return c + factor * senses * jnp.stack(sizes)

    def solved(c: Array, factor: Array) -> tuple[Array, Array]:
        """The frictions at a factor, from those at a smaller one, and whether they continue them."""

        def again(_, state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
            c = state[0]
            move, sign = eliminated(jax.jacfwd(lambda c: left(quiet, c, factor))(c), -left(quiet, c, factor))
            return c + move, safe_divide(jnp.max(jnp.abs(move)), jnp.max(jnp.abs(c + move))), sign

        c, last, sign = jax.lax.fori_loop(0, NEWTON, again, (c, jnp.ones(()), jnp.ones(())))
        close = jnp.max(jnp.abs(left(quiet, c, factor))) <= LEFT * jnp.finfo(c.dtype).eps * jnp.max(jnp.abs(c))
        return c, is_last(last) & (sign > 0) & close

    def step(_, state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        low, by, values = state
        new = jnp.minimum(low + by, jnp.log(MOST))
        c, found = solved(values, jnp.exp(new))
        by = by * jnp.where(found, LONGER, SHORTER)
        return jnp.where(found, new, low), by, jnp.where(found, c, values)

    least = jnp.asarray(LEAST)
    first, found = solved(jnp.zeros_like(senses), least)
    begin = jnp.log(least), jnp.asarray(FIRST), jnp.where(found, first, 0.0)
    low, _, values = fixed(jax.lax.fori_loop(0, STEPS, step, begin))
    limit = jnp.exp(low)
    values, limit, w = jax.tree.map(fixed, _end(lambda c, factor: left(quiet, c, factor), values, limit))
    power, size = jnp.abs(values * paces), jnp.max(jnp.abs(values))
    by_factor = fixed(jax.jvp(lambda factor: left(quiet, values, factor), (limit,), (jnp.ones_like(limit),))[1])
    unit = jnp.where(size > 0, size, 1.0)
    moved = safe_divide(w @ (left(reactions, values, limit) / unit), w @ (by_factor / unit))
    factor = limit - (moved - fixed(moved))
    inverse = jnp.where(low >= jnp.log(MOST), 0.0, 1 / factor)
    return Locking(inverse, fixed(safe_divide(power, jnp.sum(power) * jnp.ones_like(power))))


def _end(left: Callable[[Array, Array], Array], values: Array, limit: Array) -> tuple[Array, Array, Array]:
    """The frictions and the factor where the solution ends, close to where the steps do; and the left null vector of
    the matrix there.

    Either two solutions meet: where the steps end, an error of the factor is the square of one of the frictions. Or
    frictions grow without bound: where the steps end, the loads still count for 1e-10 of them and of the factor, which
    moved the least factor of a cycle by 2e-7. So these frictions are set to many times their values. Where neither end
    is found, frictions and factor stay."""
    sizes, unit = jnp.abs(values), jnp.where(values == 0, 1.0, jnp.abs(values))
    most, largest = jnp.max(sizes), jnp.arange(values.size) == jnp.argmax(sizes)

    def scaled(x: Array, unit: Array) -> Array:
        return left(x[:-1] * unit, x[-1] * limit) / unit

    def nulls(x: Array, unit: Array) -> tuple[Array, Array]:
        u, _, v = svd(jax.jacfwd(scaled)(x, unit)[:, :-1])
        return u[:, -1], v[-1]

    def nearer(begin: Array, unit: Array, grows: Array) -> tuple[Array, Array]:
        def step(_, x: Array) -> Array:
            w, v = nulls(x, unit)

            def system(y: Array) -> Array:
                left, along = jax.jvp(lambda y: scaled(y, unit), (y,), (jnp.append(v, jnp.zeros(())),))
                kept = jnp.sum(jnp.where(largest, (y - x)[:-1], 0.0))
                return jnp.append(left, jnp.where(grows, kept, w @ along))

            return x - solve(jax.jacfwd(system)(x), system(x))

        found = jax.lax.fori_loop(0, ROUNDS, step, begin)
        close = jnp.abs(found - begin) < jnp.where(jnp.arange(begin.size) < values.size, NEAR[1], NEAR[0])
        return found, jnp.all(close)

    grown = jnp.where(sizes > GROWS * most, BEYOND * values, values)
    units = jnp.stack([unit, jnp.maximum(jnp.abs(grown), jnp.where(most == 0, 1.0, GROWS * BEYOND * most))])
    begin = jnp.append(jnp.stack([values, grown]) / units, jnp.ones((2, 1)), axis=1)
    found, close = jax.vmap(nearer)(begin, units, np.asarray([False, True]))
    unit = jnp.where(close[1] & ~close[0], units[1], units[0])
    x = jnp.where(close[0], found[0], jnp.where(close[1], found[1], begin[0]))
    return x[:-1] * unit, x[-1] * limit, nulls(x, unit)[0] / unit
