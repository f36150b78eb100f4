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
ROUNDS = 3  # of Newton's method where two solutions meet
NEAR = 1e-6, 0.1  # relative: how far they lead from where the steps end, for the factor and the frictions


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
    power = jnp.abs(values * paces)
    values, limit, w = jax.tree.map(fixed, _met(lambda c, factor: left(quiet, c, factor), values, limit))
    size = jnp.max(jnp.abs(values))
    by_factor = fixed(jax.jvp(lambda factor: left(quiet, values, factor), (limit,), (jnp.ones_like(limit),))[1])
    unit = jnp.where(size > 0, size, 1.0)
    moved = safe_divide(w @ (left(reactions, values, limit) / unit), w @ (by_factor / unit))
    factor = limit - (moved - fixed(moved))
    inverse = jnp.where(low >= jnp.log(MOST), 0.0, 1 / factor)
    return Locking(inverse, fixed(safe_divide(power, jnp.sum(power) * jnp.ones_like(power))))


def _met(left: Callable[[Array, Array], Array], values: Array, limit: Array) -> tuple[Array, Array, Array]:
    """The frictions and the factor at which two solutions meet, close to where the steps end: there an error of the
    factor is the square of one of the frictions; and the left null vector of the matrix. Where frictions grow without
    bound instead they stay: there the factor has its digits."""
    unit = jnp.where(values == 0, 1.0, jnp.abs(values))

    def scaled(x: Array) -> Array:
        return left(x[:-1] * unit, x[-1] * limit) / unit

    def nulls(x: Array) -> tuple[Array, Array]:
        u, _, v = svd(jax.jacfwd(scaled)(x)[:, :-1])
        return u[:, -1], v[-1]

    def nearer(_, x: Array) -> Array:
        w, v = nulls(x)

        def system(x: Array) -> Array:
            left, along = jax.jvp(scaled, (x,), (jnp.append(v, jnp.zeros(())),))
            return jnp.append(left, w @ along)

        return x - solve(jax.jacfwd(system)(x), system(x))

    begin = jnp.append(values / unit, jnp.ones(()))
    found = jax.lax.fori_loop(0, ROUNDS, nearer, begin)
    close = jnp.abs(found - begin) < jnp.where(jnp.arange(begin.size) < values.size, NEAR[1], NEAR[0])
    found = jnp.where(jnp.all(close), found, begin)
    return found[:-1] * unit, found[-1] * limit, nulls(found)[0] / unit
