"""Self-locking: by which common factor all friction may grow until no finite drive torque moves the machine.

Frictions c solve c = -λ σ s(R₀ + M c), see `linkjax.forces._friction`. The solution that continues the one without
friction exists for factors λ below a limit, where it has an end: c grows without bound or two solutions meet, with a
singular matrix A = I + λ σ s' M, or the determinant of A changes its sign at a kink of s. The end is the solution of
the equations and one more for c and λ, which also give its derivative. Source: efficiency zero as the condition of
self-locking, formula (7-13) of the textbook; Seydel, Practical Bifurcation and Stability Analysis, 2010, ch. 5; di
Bernardo et al., Piecewise-smooth Dynamical Systems, 2008, ch. 2, for the fold at a kink.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._lapack import solve, svd
from linkjax._numerics import safe_divide, safe_sqrt
from linkjax.forces._friction import Linear, eliminated, is_last
from linkjax.forces._kinetostatics import acting_on, applied_to, friction_numbers, reactions_of
from linkjax.friction import rubbing
from linkjax.kinematics import Pose
from linkjax.loads import Instant
from linkjax.machine import Scene

LEAST, MOST = 1e-6, 1e3  # the range of factors; close to a dead centre larger ones have few digits
FIRST, LONGER, SHORTER = 2.0, 1.5, 0.3  # the first step of its logarithm; the next after a solution, and without one
STEPS, NEWTON = 120, 8  # of the factor; of Newton's method, from the solution before
LEFT = 4e3  # roundings of the largest friction: what is left of the equations of a solution
CLOSER, JUMP = 0.1, 0.01  # of a step of Newton's method: a longer next one leads to no solution that is so far away
ROUNDS = 4  # of Newton's method for the end of the solution
MET, GROWN, BENT = range(3)  # how a solution ends: it meets another one, grows without bound, or at a kink
NEAR = 1e-6, 0.1  # relative: how far they lead from where the steps end, for the factor and the frictions
BEFORE = 1e-7  # relative: how far before a kink slopes are taken
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

    def kinks(reactions, c: Array) -> Array:
        """Numbers at whose zeros sizes have kinks: those of guides, and of pins the force along its direction before
        the end of the solution, as the forces of rods without mass vanish together."""
        there, found = reactions(c, none), []
        for i, joint in enumerate(joints):
            fx, fy, moment = (part[i] for part in there)
            pin = joint.axis is None and not joint.joint.meshes
            found += [fx * way[0][i] + fy * way[1][i]] if pin else joint.switches(fx, fy, moment)
        return jnp.stack(found)

    def solved(c: Array, factor: Array) -> tuple[Array, Array]:
        """The frictions at a factor, from those expected there, and whether they continue the solution. Those far away
        do only if every step of Newton's method was much shorter than the one before: there are other solutions
        beyond the end of this one."""

        def again(_, state: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
            c, before, slow, _ = state
            move, sign = eliminated(jax.jacfwd(lambda c: left(quiet, c, factor))(c), -left(quiet, c, factor))
            last = safe_divide(jnp.max(jnp.abs(move)), jnp.max(jnp.abs(c + move)))
            return c + move, last, slow | ((last > CLOSER * before) & ~is_last(last)), sign

        begin = (c, jnp.asarray(jnp.inf), jnp.asarray(False), jnp.ones(()))
        new, last, slow, sign = jax.lax.fori_loop(0, NEWTON, again, begin)
        close = jnp.max(jnp.abs(left(quiet, new, factor))) <= LEFT * jnp.finfo(c.dtype).eps * jnp.max(jnp.abs(new))
        far = jnp.max(jnp.abs(new - c)) > JUMP * jnp.max(jnp.abs(new))
        return new, is_last(last) & (sign > 0) & close & ~(slow & far)

    def step(_, state: tuple[Array, Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array, Array]:
        low, by, values, slope, earlier = state
        new = jnp.minimum(low + by, jnp.log(MOST))
        c, found = solved(values + (new - low) * slope, jnp.exp(new))
        slope = jnp.where(found, safe_divide(c - values, (new - low) * jnp.ones_like(c)), slope)
        earlier = jnp.where(found & (by > BEFORE), values, earlier)
        by = by * jnp.where(found, LONGER, SHORTER)
        return jnp.where(found, new, low), by, jnp.where(found, c, values), slope, earlier

    free = jnp.zeros_like(senses)
    begin = jnp.log(jnp.asarray(LEAST)), jnp.asarray(FIRST), free, free, free
    low, _, values, _, earlier = fixed(jax.lax.fori_loop(0, STEPS, step, begin))
    before, found = fixed(solved(earlier, (1 - BEFORE) * jnp.exp(low)))
    before = jnp.where(found, before, values)
    way = fixed(_direction(*quiet(before, none)[:2]))
    given = lambda c, factor: left(quiet, c, factor), lambda c: kinks(quiet, c), values, before, jnp.exp(low)
    end = fixed(_end(*given))
    moved = end.weights @ left(reactions, end.values, end.factor) + end.kinks @ kinks(reactions, end.values)
    inverse = jnp.where(low >= jnp.log(MOST), 0.0, 1 / (end.factor - (moved - fixed(moved))))
    power = jnp.abs(end.values * paces)
    return Locking(inverse, fixed(safe_divide(power, jnp.sum(power) * jnp.ones_like(power))))


def _direction(fx: Array, fy: Array) -> tuple[Array, Array]:
    size = safe_sqrt(fx * fx + fy * fy)
    return safe_divide(fx, size, 0.0), safe_divide(fy, size, 0.0)


class _End(NamedTuple):
    """Where the solution ends: frictions there or just before, the factor, and by how much less the factor becomes for
    what is added to the equations of friction, and to the numbers at whose zeros these have kinks."""

    values: Array
    factor: Array
    weights: Array
    kinks: Array


def _end(
    left: Callable[[Array, Array], Array], kinks: Callable[[Array], Array], values: Array, before: Array, limit: Array
) -> _End:  # fmt: skip
    """The end of the solution, close to where the steps end; `before` are the frictions at a factor that is smaller by
    `BEFORE`.

    There two solutions meet: where the steps end, an error of the factor is the square of one of the frictions. Or
    frictions grow without bound: where the steps end, the loads still count for 1e-10 of them and of the factor, which
    moved the least factor of a cycle by 2e-7. So these frictions are set to many times their values. Or the force of a
    guide changes its side, or all forces of a pin vanish, and beyond there is no solution; there slopes are those
    before the end. Where no such end is found, frictions and factor stay."""
    sizes, unit = jnp.abs(values), jnp.where(values == 0, 1.0, jnp.abs(values))
    most, largest = jnp.max(sizes), jnp.arange(values.size) == jnp.argmax(sizes)

    def scaled(x: Array, unit: Array) -> Array:
        return left(x[:-1] * unit, x[-1] * limit) / unit

    def bent(x: Array, unit: Array) -> Array:
        return kinks(x[:-1] * unit)

    def nearer(begin: Array, unit: Array, kind: Array) -> tuple[Array, Array, Array]:
        """The end, whether it is close, and the matrix there, or at a kink before it. The last equation is that the
        matrix of the others is singular, the largest friction is kept, or the nearest kink is reached."""

        def step(i: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
            x, first = state
            u, _, v = svd(jax.jacfwd(scaled)(x, unit)[:, :-1])

            def system(y: Array) -> Array:
                left, along = jax.jvp(lambda y: scaled(y, unit), (y,), (jnp.append(v[-1], jnp.zeros(())),))
                kept = jnp.sum(jnp.where(largest, (y - x)[:-1], 0.0))
                last = [u[:, -1] @ along, kept, share @ bent(y, unit)]
                return jnp.append(left, jnp.select([kind == MET, kind == GROWN], last[:2], last[2]))

            matrix = jax.jacfwd(system)(x)
            return x - solve(matrix, system(x)), jnp.where((kind == BENT) & (i > 0), first, matrix)

        found, matrix = jax.lax.fori_loop(0, ROUNDS, step, (begin, jnp.zeros((begin.size, begin.size))))
        close = jnp.abs(found - begin) < jnp.where(jnp.arange(begin.size) < values.size, NEAR[1], NEAR[0])
        return found, jnp.all(close), matrix

    grown = jnp.where(sizes > GROWS * most, BEYOND * values, values)
    wide = jnp.maximum(jnp.abs(grown), jnp.where(most == 0, 1.0, GROWS * BEYOND * most))
    units = jnp.stack([unit, wide, jnp.where(most == 0, 1.0, most) * jnp.ones_like(unit)])  # at a kink some are zero
    factors = np.asarray([[1.0], [1.0], [1.0 - BEFORE]])
    begin = jnp.append(jnp.stack([values, grown, before]) / units, factors, axis=1)
    slopes = jax.jacfwd(bent)(begin[BENT], units[BENT])
    size = jnp.sqrt(jnp.sum(slopes * slopes, axis=1))
    away = jnp.where(size > 0, safe_divide(jnp.abs(bent(begin[BENT], units[BENT])), size), jnp.inf)
    share = jnp.where(jnp.arange(size.size) == jnp.argmin(away), safe_divide(jnp.ones_like(size), size), 0.0)

    found, close, matrix = jax.vmap(nearer)(begin, units, jnp.arange(3))
    kind = jnp.argmax(close)  # the first that is found
    unit, x = units[kind], jnp.where(jnp.any(close), found[kind], begin[MET])
    near = jnp.where(kind == BENT, begin[BENT], x)
    weights = limit * solve(matrix[kind].T, jnp.zeros(values.size + 1).at[-1].set(1.0))
    at_kink = jnp.where(kind == BENT, weights[-1] * share, 0.0)
    return _End(near[:-1] * unit, x[-1] * limit, weights[:-1] / unit, at_kink)
