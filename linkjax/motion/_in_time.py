"""Runs over time from any state, with the derivatives of a run over the crank angle.

Where a load switches at a crank angle, the time of the switch depends on the design, and steps in time cannot represent
this. So first derivatives are those of a run in angle through the same states. The end in a standstill is reached from
a place shortly before it, in the same panel of the cycle grid: without a switch between them, time is the right
variable, and the time of the standstill is that of an implicit function, dt* = -dω / ε.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._numerics import safe_divide
from linkjax._types import Scalar, known
from linkjax.loads import Passage
from linkjax.machine import ReadyScene, Scene
from linkjax.mechanism import StructureError
from linkjax.motion._diffrax import MOST_CYCLES, Run, free, run_in_angle
from linkjax.motion._grid import make_grid
from linkjax.motion._march import MOST_STEPS, Way, march
from linkjax.motion._nodes import reduced_in
from linkjax.motion._stiff import control_for, solver_for
from linkjax.motion._torque import Torque, acceleration_at, fixed_torque
from linkjax.motion._windows import at_crank_angles

REST = 1e-6  # times the scene's speed: a motion that starts slower has the derivatives of this start


def run_in_time(
    scene: Scene | ReadyScene,
    times: Float[Array, " points"],
    start_angle: Scalar,
    start_speed: Scalar,
    drive_torque: Scalar | Torque | None = None,
    *,
    through_rest: bool = False,
    tolerance: Scalar | float = 1e-10,
    solver: Any = None,
    adjoint: Any = None,
) -> Run:
    """Motion over increasing `times` (s) from `start_angle` (rad) and `start_speed` (rad/s, may be zero) at the first.

    `drive_torque`, `solver` and `adjoint` are as in `run_in_angle`. The motion ends at a standstill, with its exact
    angle and time; a machine that does not start is stalled at the start. First derivatives, also those of angle and
    time of the standstill, are those of a run in angle through the same states.

    With `through_rest` it goes on: smoothly where nothing depends on the sense of rotation; otherwise the crank starts
    forward, starts backward, or stays at rest (then it is `stalled`, and its values are those of the standstill), as
    opposing loads, motor and transmission allow. The speed may then be negative, also at the start. Derivatives are
    those of the integrator: they lack the movement of angles at which loads switch, and there is no reverse mode where
    something depends on the sense.

    Raises `StructureError` if the driver has a motion law, for a negative speed at the start without `through_rest`,
    and with `through_rest` for windows that depend on the sense of a motion.
    """
    made = free(scene)
    times, start_angle, start_speed = (jnp.asarray(value, float) for value in (times, start_angle, start_speed))
    solver = solver or solver_for(made, drive_torque)
    speed = known(start_speed)
    if through_rest:
        _check_windows(made.scene)
    elif speed is not None and speed < 0:
        raise StructureError("start_speed", f"is {float(speed):.6g} rad/s", "write zero or more, or through_rest=True")
    made = made.of(at_crank_angles(made))
    if through_rest:
        way = way_of(made, drive_torque)
        start = jnp.stack([start_angle, start_speed / way.unit])
        course = march(way, times, start, solver, tolerance, through_rest=True, adjoint=adjoint)
        return _run(course, times, way.unit)
    given = jax.lax.stop_gradient((made, times, start_angle, start_speed))
    way = way_of(given[0], fixed_torque(drive_torque))
    start = jnp.stack([given[2], given[3] / way.unit])
    course = march(way, given[1], start, solver, tolerance)
    found = jax.lax.stop_gradient(_cut(_run(course, given[1], way.unit)))
    least = jax.lax.stop_gradient(REST * made.scene.speed)
    start_speed = start_speed + jnp.where(start_speed < least, least, 0.0)
    return _through_angle(made, found, times, start_angle, start_speed, drive_torque, tolerance, solver, adjoint)


def _check_windows(scene: Scene) -> None:
    """Raise `StructureError` for a window that depends on the sense in which something moves."""
    for load in scene.loads:
        if isinstance(window := load.window, Passage) and (window.going or window.between is None):
            problem = "its window depends on the sense of a motion, which a run through a standstill reverses"
            raise StructureError(f"load {load.name!r}", problem, "write a window of the crank angle")


def way_of(made: ReadyScene, drive: Any, acting: Any = None) -> Way:
    """How a scene is driven, with its speed and 1 J as units of states."""
    unit = jax.lax.stop_gradient(made.scene.speed)
    return Way(made, drive, acting, unit, jnp.ones_like(unit))


def _run(course: Any, times: Array, unit: Array) -> Run:
    angle, speed = course.states[:, 0], course.states[:, 1] * unit
    where, when = (jnp.where(course.stopped, x, jnp.inf) for x in (course.last[0], course.stop_time))
    lost = ~course.whole & (jnp.arange(times.size) > 0)
    return Run(jnp.where(lost, jnp.inf, angle), jnp.where(lost, jnp.inf, speed), times, course.stopped, where, when)


def _cut(run: Run) -> Run:
    """The same with infinite values after a standstill."""
    late = (jnp.arange(run.time.size) > 0) & run.stalled & (run.time >= run.stall_time)
    return run._replace(angle=jnp.where(late, jnp.inf, run.angle), speed=jnp.where(late, jnp.inf, run.speed))


def _through_angle(made: ReadyScene, found: Run, times, angle, speed, drive_torque, tolerance, solver, adjoint) -> Run:
    """The same motion with the derivatives of a run in angle: a delay dt of φ(t) changes it by -ω dt."""
    there = jnp.isfinite(found.angle)
    further = MOST_CYCLES * made.scene.cycle / times.size * jnp.arange(times.size, dtype=float)
    beyond = jnp.max(jnp.where(there, found.angle, -jnp.inf)) + further
    angles = jnp.concatenate([jnp.atleast_1d(angle), jnp.where(there, found.angle, beyond)[1:]])
    run = run_in_angle(made, angles, speed, drive_torque, tolerance=tolerance, solver=solver, adjoint=adjoint)
    there &= jnp.isfinite(jax.lax.stop_gradient(run.speed))
    late = jnp.where(there, times - times[0] - run.time, 0.0)
    pace = jnp.where(there, found.speed, 1.0)
    way = way_of(made, drive_torque)
    one = jnp.ones_like(pace[0])
    gain = jax.vmap(lambda phi, speed: way.acceleration(times[0], phi, speed, one))(angles, pace)

    def carry(value, by_angle, rate):
        same = by_angle + jax.lax.stop_gradient(rate) * late
        return jnp.where(there, value + (same - jax.lax.stop_gradient(same)), value)

    stop = _stop(made, found, angle, speed, drive_torque, tolerance, solver, adjoint)
    where, when = (
        jnp.where(found.stalled, value + (x - jax.lax.stop_gradient(x)), jnp.inf)
        for value, x in zip((found.stall_angle, found.stall_time), (stop[0], times[0] + stop[1]), strict=True)
    )
    return Run(carry(found.angle, angles, pace), carry(found.speed, run.speed, gain), times, found.stalled, where, when)


def _stop(made: ReadyScene, found: Run, angle, speed, drive_torque, tolerance, solver, adjoint) -> tuple[Array, Array]:
    """Angle (rad) and time since the start (s) of the standstill `found`, with their derivatives: by angle to a place
    shortly before it, then in time, with the loads of this panel of the grid."""
    import diffrax

    grid, fixed = make_grid(made, 8), jax.lax.stop_gradient(angle)
    target = jnp.where(found.stalled & (found.stall_angle > fixed), found.stall_angle, fixed + 1e-3)
    place = jax.lax.stop_gradient(grid.place(target - 1e-9))
    low = target - (place.phi - grid.edges[place.panel])
    middle = jax.lax.stop_gradient(0.5 * (jnp.maximum(low, fixed) + target))
    ends = jnp.stack([angle, middle])
    run = run_in_angle(made, ends, speed, drive_torque, tolerance=tolerance, solver=solver, adjoint=adjoint)
    pace, gone = run.speed[-1], run.time[-1]
    known = jnp.isfinite(jax.lax.stop_gradient(pace)) & found.stalled
    pace, gone = jnp.where(known, pace, 1.0), jnp.where(known, gone, 0.0)
    unit = jax.lax.stop_gradient(made.scene.speed)
    turns = jax.lax.stop_gradient(middle - grid.place(middle).phi)

    def gain(phi, speed):
        def advance(model):
            return acceleration_at(made.scene.motor, model, drive_torque, phi, speed, jnp.ones_like(speed))

        return advance(reduced_in(made, grid, phi - turns, place.panel, speed=speed, advance=advance))

    def rate(t, state, _):
        return jnp.stack([state[1], gain(state[0], state[1] * unit) / unit**2])

    began = found.time[0] + jax.lax.stop_gradient(gone)
    left = jnp.where(known, jax.lax.stop_gradient(found.stall_time - began), 0.0)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate), solver, jnp.zeros_like(left), left * unit, None, jnp.stack([middle, pace / unit]),
        stepsize_controller=control_for(solver, tolerance), max_steps=MOST_STEPS,
        throw=False, adjoint=adjoint or diffrax.RecursiveCheckpointAdjoint(),
    )  # fmt: skip
    assert solution.ys is not None
    state = jnp.where(known, solution.ys[-1], 1.0)
    slowing = jax.lax.stop_gradient(gain(state[0], jnp.zeros_like(state[1])))
    return state[0], gone - safe_divide(state[1] * unit, jnp.where(known, slowing, -1.0))
