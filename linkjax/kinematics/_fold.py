"""The fold of the closure of a group of higher class: two assembly modes coincide there, and the range ends.

Bisection on the margin stops where Newton's method has no root, before the fold; `STEPS` steps from there find the fold
to rounding error.
"""

from __future__ import annotations

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._lapack import solve, svd
from linkjax.groups import General, ReferencePath, closed_to
from linkjax.kinematics._pose import Prepared, before_group
from linkjax.mechanism import links_of

STEPS = 20  # Newton steps: five where two assembly modes coincide and end, more where they cross
BEYOND = 1e-5  # rad: largest distance of a fold beyond the angle to which the group was followed
NEAR = 1.0  # rad, or relative to the size: largest motion of links to the fold, else it belongs to other modes


def folded(ready: Prepared, number: int, inside: float, end: float, far: float) -> float:
    """The crank angle (rad) of the fold of the group of higher class with this number.

    `end` is an estimate; at the angle `inside`, close to it, the group closes. The estimate is returned if there is no
    fold between `far` (rad) inside it and slightly beyond it. Newton's method is applied to the closure, a null vector
    of its Jacobian and the length of that vector together. This system is regular at the fold.
    Source: Moore and Spence, The calculation of turning points of nonlinear equations, SIAM J. Numer. Anal. 17, 1980.
    """
    angle, left, moved = _fold(ready, number, jnp.asarray(inside), jnp.asarray(end))
    beyond = (angle - end) * math.copysign(1.0, end - inside)
    good = (left < closed_to(left.dtype)) & (beyond < BEYOND) & (beyond > -far) & (moved < NEAR)
    return float(angle) if bool(good) else end


@eqx.filter_jit
def _fold(ready: Prepared, number: int, inside: Array, end: Array) -> tuple[Array, Array, Array]:
    """The crank angle after `STEPS` steps, the closure error relative to the size of the group, and how far links have
    moved, without the rotation of free gears (relative to the size, or rad)."""
    group, path = ready.mechanism.groups[number], ready.paths[number]
    assert isinstance(group, General) and isinstance(path, ReferencePath)
    links = links_of(ready.mechanism, group)
    size, free = group.size(links, before_group(ready, number, inside)[1]), 3 * len(group.members)
    start, *_ = group.closed(links, *before_group(ready, number, inside), inside, path.at(inside), path.meshing, STEPS)

    def opened(move, phi):
        return group.opened(links, *before_group(ready, number, phi), phi, start, move * size, path.meshing)

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
