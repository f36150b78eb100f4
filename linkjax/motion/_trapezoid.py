"""The drive torque of a textbook: the work of a cycle by trapezoids over a few positions."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax.kinematics import pose
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.motion._windows import at_crank_angles
from linkjax.reduction import Moving, by_speed, reduce_pose, shares_at


def trapezoid_torque(scene: Scene | ReadyScene, positions: int = 12) -> Array:
    """The constant drive torque (N m) that balances the cycle, by the trapezoidal rule over so many positions.

    The reduced torque Q of weights and loads is taken at `positions` equally spaced crank angles of the cycle, the
    first at zero; loads that switch at a position act as just after it, and loads that depend on the speed are those at
    the nominal speed. Over a closed cycle the rule gives the negative mean of these values. Its error falls with the
    square of the step; the exact torque is `mean_drive_torque` of an analysis. Raises `ValueError` for fewer than two
    positions.
    Source: the graphical and tabular methods of machine dynamics, e.g. Artobolevsky, Theory of Mechanisms and
    Machines, 1988, ch. 16.
    """
    if not isinstance(positions, int) or positions < 2:
        raise ValueError(f"positions is {positions!r}; write the number of positions of a cycle, e.g. 12")
    made = ready(at_crank_angles(scene))
    angles = jnp.linspace(0.0, made.scene.cycle, positions, endpoint=False)
    return -jnp.mean(jax.vmap(lambda phi: _torque(made, phi))(angles))


@jax.jit  # traced once per scene topology
def _torque(made: ReadyScene, phi: Array) -> Array:
    """The reduced torque (N m) of weights and all loads at a crank angle (rad), at the nominal speed."""
    scene, here = made.scene, pose(made.mechanism, phi)
    moving = Moving(here, phi, phi, scene.active(phi))
    shares = shares_at({number: scene.loads[number] for number in by_speed(scene)}, moving, scene.speed)
    return sum(shares.values(), reduce_pose(scene, made.instant(phi, phi), here).torque)
