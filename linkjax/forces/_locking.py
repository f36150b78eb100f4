"""Self-locking: by which common factor all friction may grow until no finite drive torque moves the machine.

Frictions c solve c = -λ σ s(R₀ + M c), see `linkjax.forces._friction`. The solution that continues the one without
friction exists for factors λ below a limit, where the matrix A = I + λ σ s' M is singular: either c grows without
bound, or two solutions meet. With the left null vector w of A there, a change of the equation F(c, λ) = 0 changes the
limit by -w·dF / (w·∂F/∂λ). Source: efficiency zero as the condition of self-locking, formula (7-13) of the textbook;
Seydel, Practical Bifurcation and Stability Analysis, 2010, ch. 5, for the derivative.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_divide
from linkjax.forces._friction import eliminated, rubbed
from linkjax.forces._kinetostatics import acting_on, applied_to, friction_numbers, reactions_of
from linkjax.friction import rubbing
from linkjax.kinematics import Pose
from linkjax.loads import Instant
from linkjax.machine import Scene

LEAST, MOST = 1e-6, 1e3  # the range of factors; close to a dead centre larger ones have few digits
HALVINGS = 56  # of its logarithm
INSIDE = 1e-11  # relative: so far below the limit the equations are not singular
ROUNDS = 3  # of inverse iteration


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

    def solved(factor: Array):
        return rubbed(frictions, senses, paces, reactions, lambda _: none, factor)

    def halve(_, state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        low, high, values = state
        middle = 0.5 * (low + high)
        found = solved(jnp.exp(middle))
        low, high = jnp.where(found.found, middle, low), jnp.where(found.found, high, middle)
        return low, high, jnp.where(found.found, found.values, values)

    fixed = jax.lax.stop_gradient
    begin = jnp.log(jnp.asarray(LEAST)), jnp.log(jnp.asarray(MOST)), jnp.zeros_like(senses)
    low, high, nearest = fixed(jax.lax.fori_loop(0, HALVINGS, halve, begin))
    limit = jnp.exp(low) * (1 - INSIDE)
    inside = fixed(solved(limit))  # where rounding prevents it, the last solution found
    values = jnp.where(inside.found, inside.values, nearest)
    power = jnp.abs(values * paces)

    def left(c: Array, factor: Array) -> Array:
        there = reactions(c, none)
        sizes = [each.size(*(part[i] for part in there)) for i, each in enumerate(frictions)]
        return c + factor * senses * jnp.stack(sizes)

    a, size = fixed(jax.jacfwd(left)(values, limit)), jnp.max(jnp.abs(values))
    w = _null(a.T)
    by_factor = fixed(jax.jvp(lambda factor: left(values, factor), (limit,), (jnp.ones_like(limit),))[1])
    unit = jnp.where(size > 0, size, 1.0)
    moved = safe_divide(w @ (left(values, limit) / unit), w @ (by_factor / unit))
    factor = limit - (moved - fixed(moved))
    inverse = jnp.where(high >= begin[1], 0.0, 1 / factor)
    return Locking(inverse, fixed(safe_divide(power, jnp.sum(power) * jnp.ones_like(power))))


def _null(a: Array) -> Array:
    """The null vector of a matrix that is nearly singular, by inverse iteration."""
    found = jnp.ones_like(a[0])
    for _ in range(ROUNDS):
        found, _ = eliminated(a, found)
        found = safe_divide(found, jnp.max(jnp.abs(found)) * jnp.ones_like(found))
    return jax.lax.stop_gradient(found)
