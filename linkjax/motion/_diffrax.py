"""The general road: the equation of motion J φ'' + ½ J' φ'² = Q + T solved by diffrax, in angle or in time.

In angle the square of the speed obeys a linear equation, d(ω²)/dφ = (2 (Q + T) - J' ω²) / J, and loads switch at known
places; in time nothing is assumed. Both start from any state. Slower than quadrature (milliseconds a cycle), but it
needs no periodicity, and it is the independent check of the quadrature road.
diffrax is imported where it is used: it takes as long to load as jax itself.
Source: Kidger, On Neural Differential Equations, 2021 (diffrax); equation of motion as in `linkjax.reduction`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._numerics import safe_sqrt
from linkjax._types import Scalar
from linkjax.machine import Scene
from linkjax.motion._flow import LEAST, Flow, Primitive
from linkjax.motion._grid import Grid, make_grid
from linkjax.motion._steady import Steady, conclude, node_values
from linkjax.reduction import reduce

MOST_CYCLES = 8  # breakpoints are laid over this many cycles from the start; beyond, step control alone finds them
SHOTS = 6  # Newton steps for the starting energy


class Run(NamedTuple):
    """A motion from a given state: crank angle (rad), speed (rad/s) and time (s) at the points asked for.

    `stalled` tells whether the speed came to zero on the way; from there on the values are infinite.
    """

    angle: Array
    speed: Array
    time: Array
    stalled: Array


def run_in_angle(
    scene: Scene,
    angles: Float[Array, " points"],
    start_speed: Scalar,
    drive_torque: Scalar,
    *,
    tolerance: float = 1e-10,
    solver: Any = None,
    adjoint: Any = None,
) -> Run:
    """Motion over increasing crank `angles` (rad), starting at the first with `start_speed` (rad/s).

    `drive_torque` (N m) is constant. `solver` and `adjoint` are diffrax's: by default `Dopri8` and its checkpointed
    reverse mode; `diffrax.ForwardMode()` for `jvp`. Steps end at every breakpoint of the cycle grid.
    """
    import diffrax

    solution = _in_angle(scene, make_grid(scene, 8), angles, start_speed, drive_torque, tolerance, solver, adjoint)
    assert solution.ys is not None
    stalled = solution.result == diffrax.RESULTS.event_occurred
    return Run(angles, safe_sqrt(solution.ys[:, 0]), solution.ys[:, 1], stalled)


def _in_angle(scene: Scene, grid: Grid, angles, start_speed, drive_torque, tolerance, solver=None, adjoint=None):
    import diffrax

    first, last = angles[0], angles[-1]
    back = jnp.floor((first - grid.edges[0]) / scene.cycle) * scene.cycle
    jumps = (grid.edges[:-1] + back)[None, :] + scene.cycle * jnp.arange(MOST_CYCLES, dtype=float)[:, None]

    def rate(phi, state, _):
        squared, here = state[0], reduce(scene, phi)
        speed = safe_sqrt(squared, 1e-100)
        gain = (2 * (here.torque + drive_torque) - here.slope * squared) / here.inertia
        return jnp.stack([gain, 1 / speed, -1 / (here.inertia * speed**3), here.torque])

    start = jnp.stack([start_speed**2, *[jnp.zeros_like(start_speed)] * 3])
    least = jax.lax.stop_gradient(LEAST * start_speed**2)
    return diffrax.diffeqsolve(
        diffrax.ODETerm(rate), solver or diffrax.Dopri8(), first, last, None, start, saveat=diffrax.SaveAt(ts=angles),
        stepsize_controller=_controller(tolerance, jumps.ravel()),
        adjoint=adjoint or diffrax.RecursiveCheckpointAdjoint(),
        event=diffrax.Event(lambda t, y, args, **_: y[0] <= least), max_steps=16**4, throw=False,
    )  # fmt: skip


def run_in_time(
    scene: Scene,
    times: Float[Array, " points"],
    start_angle: Scalar,
    start_speed: Scalar,
    drive_torque: Scalar,
    *,
    tolerance: float = 1e-10,
    solver: Any = None,
    adjoint: Any = None,
) -> Run:
    """Motion over increasing `times` (s) from `start_angle` (rad) and `start_speed` (rad/s) at the first of them."""
    import diffrax

    least = jax.lax.stop_gradient(1e-3 * start_speed)

    def rate(_, state, __):
        phi, speed = state
        here = reduce(scene, phi)
        return jnp.stack([speed, (here.torque + drive_torque - 0.5 * here.slope * speed**2) / here.inertia])

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate), solver or diffrax.Dopri8(), times[0], times[-1], None,
        jnp.stack([start_angle, start_speed]), saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=_controller(tolerance, None), adjoint=adjoint or diffrax.RecursiveCheckpointAdjoint(),
        event=diffrax.Event(lambda t, y, args, **_: y[1] <= least), max_steps=16**4, throw=False,
    )  # fmt: skip
    assert solution.ys is not None
    stalled = solution.result == diffrax.RESULTS.event_occurred
    return Run(solution.ys[:, 0], solution.ys[:, 1], times, stalled)


def _controller(tolerance: Scalar | float, jumps: Array | None):
    import diffrax

    control = diffrax.PIDController(rtol=tolerance, atol=tolerance * 1e-3)
    if jumps is None:
        return control
    return diffrax.ClipStepSizeController(control, jump_ts=jax.lax.stop_gradient(jnp.sort(jumps)))


def steady_by_diffrax(
    scene: Scene, nodes: int = 96, *, tolerance: Scalar | float = 1e-11, solver: Any = None, adjoint: Any = None
) -> Steady:
    """The steady periodic regime by the general road: one cycle, integrated from the start that gives the wanted mean.

    The drive torque closes the energy of the cycle; Newton steps find the starting energy. Same result as `steady`
    within the tolerance. `solver` (default `Dopri8`) and `adjoint` are diffrax's; the latter decides the direction of
    differentiation: `ForwardMode()` (default) for `jvp`, `RecursiveCheckpointAdjoint()` for `grad`.
    """
    import diffrax

    grid = make_grid(scene, nodes)
    here = node_values(scene, grid)
    places = jnp.concatenate([grid.edges[:1], grid.nodes.ravel(), grid.edges[-1:]])
    adjoint = adjoint or diffrax.ForwardMode()
    inertia = reduce(scene, grid.edges[0], grid.middle[0]).inertia

    def cycle(energy, drive):
        speed = safe_sqrt(2 * energy / inertia, 1e-6)
        states = _in_angle(scene, grid, places, speed, drive, tolerance, solver, adjoint).ys
        assert states is not None
        return states

    guess = 0.5 * inertia * scene.speed**2
    drive = -cycle(1e3 * guess, 0.0)[-1, 3] / scene.cycle  # so fast that it cannot stall: only the work is wanted
    wanted = scene.cycle / scene.speed

    def newton(energy):
        end = cycle(energy, drive)[-1]
        return energy - jax.lax.stop_gradient(0.5 * end[1] / end[2]) * ((end[1] / wanted) ** 2 - 1)

    energy = jax.lax.stop_gradient(jax.lax.fori_loop(0, SHOTS, lambda _, e: newton(e), guess))
    energy = newton(energy)  # the last step carries the derivative
    states = cycle(energy, drive)
    squared, clock = (states[1:-1, i].reshape(grid.nodes.shape) for i in (0, 1))
    work = _fitted(grid, 0.5 * here.inertia * squared - energy)
    return conclude(Flow(scene, grid, here, work, drive), energy, _fitted(grid, clock))


def _fitted(grid: Grid, values: Float[Array, "panels n"]) -> Primitive:
    """A quantity known at the nodes as a piecewise series."""
    series = values @ jnp.asarray(grid.rule.spectrum.T)
    low, high = (values @ jnp.asarray(end) for end in grid.rule.ends)
    series = jnp.concatenate([series[:, :1] - low[:, None], series[:, 1:], jnp.zeros_like(low)[:, None]], axis=1)
    return Primitive(grid, jnp.concatenate([low, high[-1:]]), series)
