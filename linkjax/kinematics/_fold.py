"""Where a general group ends: the fold of its closure, at which the last two of its assemblies meet."""

from __future__ import annotations

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._lapack import solve, svd
from linkjax.groups import General, closed_to
from linkjax.kinematics._pose import before_group
from linkjax.mechanism import Mechanism

STEPS = 20  # Newton steps: five where two assemblies meet, more where they only cross
BEYOND = 1e-5  # rad: a fold is no further than where the group could be followed to
NEAR = 1.0  # rad, or of the size: nor do links move further to it; else it is one of other assemblies


def folded(mechanism: Mechanism, number: int, inside: float, end: float, far: float) -> float:
    """The crank angle (rad) at which the general group of this number folds, from a rough `end` and an angle `inside`
    at which it closes near there; the rough one where there is no fold so `far` inside (rad), or a very little beyond.

    Newton's method on closure, a null vector of its Jacobian and that vector's length, together: regular where the
    closure is not.
    Source: Moore and Spence, The calculation of turning points of nonlinear equations, SIAM J. Numer. Anal. 17, 1980.
    """
    angle, left, moved = _fold(mechanism, number, jnp.asarray(inside), jnp.asarray(end))
    beyond = (angle - end) * math.copysign(1.0, end - inside)
    good = (left < closed_to(left.dtype)) & (beyond < BEYOND) & (beyond > -far) & (moved < NEAR)
    return float(angle) if bool(good) else end


@eqx.filter_jit
def _fold(mechanism: Mechanism, number: int, inside: Array, end: Array) -> tuple[Array, Array, Array]:
    """The crank angle after some steps, what is left open, of the size of the group, and how far links but loose
    wheels have moved, in that size or rad."""
    group = mechanism.groups[number]
    assert isinstance(group, General) and group.path is not None
    links = mechanism.held_by(group)
    size, free = group.size(links, before_group(mechanism, number, inside)[1]), 3 * len(group.members)
    start, *_ = group.closed(
        links, *before_group(mechanism, number, inside), inside, group.path.at(inside, group.cycle_turns), STEPS
    )

    def opened(move, phi):
        return group.opened(links, *before_group(mechanism, number, phi), phi, start, move * size)

    still = jnp.zeros(free)
    along = svd(opened(still, inside)[1])[2][-1]

    def system(x):
        gap, matrix = opened(x[:free], x[-1])
        v = x[free:-1]
        return jnp.concatenate([gap / size, matrix @ v, (along @ v - 1.0)[None]])

    def step(_, x):
        return x - solve(jax.jacfwd(system)(x), system(x))

    x = jax.lax.fori_loop(0, STEPS, step, jnp.concatenate([still, along, end[None]]))
    moved = jnp.abs(x[:free].reshape((-1, 3))).at[group.loose(), 2].set(0.0)
    return x[-1], jnp.max(jnp.abs(system(x))), jnp.max(moved)
