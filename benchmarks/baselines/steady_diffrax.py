"""The steady-state motion of a machine with a motor by diffrax: one cycle as an initial value problem, and Newton's
method on its start.

The state over the crank angle is the square of the speed, its derivative with respect to the start, and the time.
Integration ends and starts again at every `breaks`, where a load switches or the motion has a kink; they are given, so
that finding them costs the peer nothing. Newton's method ends one step after its correction is small, because its error
is then the square of it. The machine is evaluated by the same functions as elsewhere.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import linkjax as lj
from linkjax.machine import ready
from linkjax.motion import Grid, at_nodes, grid_with_kinks, reduced_in
from linkjax.motion._torque import acceleration_at
from linkjax.sampling import Sampler

SHOTS = 12  # the most steps of Newton's method
STEPS = 16**3


class Lap(NamedTuple):
    """Crank speeds (rad/s) and times (s, since the first edge of the grid) at the requested angles, mean speed (rad/s),
    and the number of cycles integrated."""

    speeds: Array
    times: Array
    mean: Array
    laps: Array


def breaks_of(scene: lj.Scene, nodes: int) -> tuple[Grid, np.ndarray]:
    """A grid that says which loads act, and the crank angles (rad) at which the torque jumps or may have a kink."""
    machine = Sampler(ready(scene))
    grid = grid_with_kinks(machine, nodes)
    edges = np.asarray(grid.edges)[1:-1]
    if scene.motor is not None and scene.motor.transmission.loses:
        return grid, edges
    ends = at_nodes(machine, grid).edges
    assert ends is not None
    jump = np.abs(np.asarray(ends.after - ends.before))[1:]
    return grid, edges[jump > 1e-6 * np.max(np.abs(np.asarray(ends.after)), initial=1e-12)]


def shooting(scene: lj.Scene, grid: Grid, breaks: Array, angles: Array, tolerance: Array, solver: Any = None) -> Lap:
    """The steady-state motion with the crank speeds at increasing `angles` (rad) within one cycle."""
    made, solver = ready(scene), solver or diffrax.Dopri8()
    unit, low = scene.speed, grid.edges[0]

    def gain(phi, square):
        speed = unit * jnp.sqrt(jnp.maximum(square, 1e-6))
        here = reduced_in(made, grid, phi, grid.place(phi).panel, speed=speed)
        return 2 * acceleration_at(scene.motor, here, None, phi, speed) / unit**2

    def with_slope(phi, state, _):
        rise, slope = jax.jvp(lambda square: gain(phi, square), (state[0],), (jnp.ones(()),))
        return jnp.stack([rise, slope * state[1]])

    def with_time(phi, state, _):
        return jnp.stack([gain(phi, state[0]), 1 / jnp.sqrt(jnp.maximum(state[0], 1e-6))])

    control = diffrax.PIDController(rtol=tolerance, atol=1e-3 * tolerance)
    if breaks.size:
        control = diffrax.ClipStepSizeController(control, jump_ts=breaks)

    def cycle(rate, start, save):
        return diffrax.diffeqsolve(
            diffrax.ODETerm(rate), solver, low, low + scene.cycle, None, start, saveat=save,
            stepsize_controller=control, max_steps=STEPS, throw=False, adjoint=diffrax.ForwardMode(),
        )  # fmt: skip

    def again(state):
        count, square, _ = state
        end = cycle(with_slope, jnp.stack([square, jnp.ones(())]), diffrax.SaveAt(t1=True)).ys
        assert end is not None
        move = (end[0, 0] - square) / (1 - end[0, 1])
        return count + 1, square + move, jnp.abs(move) > 0.1 * jnp.sqrt(tolerance) * square

    begin = (jnp.zeros((), jnp.int32), jnp.ones(()), jnp.asarray(True))
    count, square, _ = jax.lax.while_loop(lambda s: s[2] & (s[0] < SHOTS), again, begin)
    found = cycle(with_time, jnp.stack([square, jnp.zeros(())]), diffrax.SaveAt(ts=angles, t1=True)).ys
    assert found is not None
    speeds, times = unit * jnp.sqrt(found[:-1, 0]), found[:-1, 1] / unit
    return Lap(speeds, times, unit * scene.cycle / found[-1, 1], count + 1)
