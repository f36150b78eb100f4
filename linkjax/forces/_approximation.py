"""Friction by successive approximation, as the textbook finds it by hand: reactions without friction, friction from
these, reactions with it, and so on. Source: the textbook's chapter on friction, (7-14) and following."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from linkjax._numerics import safe_divide
from linkjax._types import Scalar
from linkjax.forces._friction import Rubbed
from linkjax.forces._kinetostatics import Forces, forces_of_pose
from linkjax.kinematics import pose
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import StructureError


class Approximation(NamedTuple):
    """The forces of the last approximation, the number of `iterations` that it took, and whether it `converged`."""

    forces: Forces
    iterations: Int[Array, ""]
    converged: Bool[Array, ""]


def successive_approximation(
    scene: Scene | ReadyScene, phi: Scalar, speed: Scalar, acceleration: Scalar, tolerance: float = 1e-12,
    most: int = 200,
) -> Approximation:  # fmt: skip
    """All forces at the crank angle `phi` (rad), crank speed (rad/s) and crank acceleration (rad/s²), with frictions
    that follow from the reactions of the step before, until none of them changes by more than `tolerance` of the
    largest, in at most so many iterations.

    `kinetostatics` finds the same by Newton's method. Successive approximation converges linearly: the change of every
    step is a fixed share of the one before, which is larger the closer the machine is to locking. Where it locks, it
    does not converge; it may fail to converge elsewhere, too. Arguments are scalars; use `jax.vmap` for many. Its
    derivatives are not meaningful. Raises `StructureError` for a scene without friction.
    """
    made = ready(scene)
    if not made.scene.friction:
        raise StructureError("friction", "the scene has none to be approximated", "use kinetostatics")
    phi, speed, acceleration = (jnp.asarray(value, float) for value in (phi, speed, acceleration))
    count: list[tuple[Array, Array]] = []

    def solve(frictions, senses, paces, reactions, advance) -> Rubbed:
        def again(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
            number, c, _ = state
            there = reactions(c, acceleration)
            sizes = [each.size(*(part[i] for part in there)) for i, each in enumerate(frictions)]
            new = -senses * jnp.stack(sizes)
            largest = jnp.max(jnp.abs(new)) * jnp.ones_like(new)
            return number + 1, new, jnp.max(safe_divide(jnp.abs(new - c), largest))

        start = jnp.zeros((), jnp.int32), jnp.zeros_like(senses), jnp.asarray(jnp.inf)
        number, c, change = jax.lax.while_loop(lambda s: (s[2] > tolerance) & (s[0] < most), again, start)
        count.append((number, change <= tolerance))
        return Rubbed(c, acceleration, change <= tolerance, reactions(c, acceleration))

    at, here = made.instant(phi, phi, speed), pose(made.mechanism, phi)
    found = forces_of_pose(made.scene, here, at, made.scene.active(phi), speed, acceleration, solve)
    return Approximation(found, *count[0])
