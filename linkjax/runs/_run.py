"""Runs of a machine: run-up from rest, load on and off, run-down, standstill."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide
from linkjax._types import Scalar, Tracer, as_float
from linkjax._units import nearest
from linkjax.drives import Servo
from linkjax.loads import Passage
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import StructureError
from linkjax.motion import Steady, at_crank_angles, is_stiff, run_in_time, solver_for, steady_motion
from linkjax.reduction import reduced_model
from linkjax.runs._course import Gap, Setup, Times, course, details, passage, threshold, turned, without_motor
from linkjax.runs._starting import starting_torque
from linkjax.runs._transient import Energies, Transient

REACHED = 0.99  # of the speed of the steady-state motion: the end of a run-up
SLOW = 0.01  # of the speed at the start: the end of a run-down that never stops
CHUNK, LOOKS, MOST = 4, 65, 500  # cycles at once in the search for an end, places in each cycle, the most cycles
CLOSER = 2001  # places at which a passage is looked for inside of jax transformations
AFTER = 1.3  # the default end, times the time of what is waited for
Span = tuple[float, float]


def run(
    scene: Scene | ReadyScene,
    *,
    start_angle: Scalar | float = 0.0,
    start_speed: Scalar | float = 0.0,
    time: float | None = None,
    cycles: float | None = None,
    motor: bool | Span = True,
    acting: Mapping[str, Span] | None = None,
    through_rest: bool = False,
    points: int = 501,
    tolerance: float = 1e-12,
    solver: Any = None,
    adjoint: Any = None,
) -> Transient:
    """The motion of a machine with its motor, weight and loads, from a crank angle `start_angle` (rad) and a speed
    `start_speed` (rad/s, default rest), at `points` uniform times.

    It ends after a `time` (s), or a number of `cycles`; by default some time after the run-up, or with the motor off
    after the run-down. `motor=False` is the motor switched off, with rotor and transmission still attached; a pair
    (on, off) of times (s) is when it is on. `acting` has such pairs for loads by name, which act only between them, and
    only within their window. The motion ends in a standstill, unless it is to go on `through_rest`: see
    `linkjax.motion.run_in_time`, also for `solver`, `adjoint` and `tolerance`.

    Inside of jax transformations `time` must be given, `acting`, pairs of times and `through_rest` are not possible,
    and there are no energies; angles, speeds and the times of run-up and standstill have exact first derivatives.

    Raises `StructureError` if the driver follows a motion law, for a load that does not exist, and for an end, a number
    of points, or times that are not valid. Source: equation of motion as in `linkjax.reduction`.
    """
    given = ready(scene)
    _check(given.scene, start_speed, time, cycles, motor, acting, through_rest, points)
    traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((given, start_angle, start_speed)))
    if traced and (time is None or acting or not isinstance(motor, bool) or through_rest):
        problem = "runs from a given design only, without jax transformations, unless `time` is its only option"
        raise StructureError("run", problem, "give time, and neither acting, times of the motor nor through_rest")
    off = motor is False or given.scene.motor is None
    if motor is False and given.scene.motor is not None:
        given = given.of(eqx.tree_at(lambda s: s.motor, given.scene, without_motor(given.scene.motor)))
    angle, speed = as_float(start_angle), as_float(start_speed)
    made = given.of(at_crank_angles(given))
    setup = setup_for(made, angle, motor, acting, through_rest, tolerance, solver)
    gap = _gap(given, made, speed, off)
    if traced:
        assert time is not None
        return _traced(setup, gap, angle, speed, as_float(time), points, off, adjoint)
    start = jnp.stack([angle, speed / setup.unit])
    end = _end(setup, start, gap, cycles, off) if time is None else float(time)
    return _whole(setup, gap, start, end, points, off)


def _check(scene: Scene, speed, time, cycles, motor, acting, through_rest, points) -> None:
    if scene.mechanism.prescribed:
        problem = "has a motion law: its motion is known, so there is no equation of motion to solve"
        raise StructureError(scene.mechanism.driving_link, problem, "delete the law")
    if motor is not False and scene.motor is not None and isinstance(scene.motor.motor, Servo):
        problem = "a servo motor follows a motion law, and has no characteristic"
        raise StructureError("motor", problem, "write another kind of motor, or motor=False (--motor-off)")
    if time is not None and cycles is not None:
        raise StructureError("time", "is given, and cycles too", "give one of them")
    for name, value in {"time": time, "cycles": cycles}.items():
        if value is not None and not (math.isfinite(value) and value > 0):
            raise StructureError(name, f"is {value}", "write a number above zero")
    if points < 2:
        raise StructureError("points", f"is {points}", "write 2 or more")
    if not isinstance(speed, Tracer):
        if not math.isfinite(float(speed)):
            raise StructureError("start_speed", f"is {float(speed)}", "write a finite number, in rad/s")
        if float(speed) < 0 and not through_rest:
            remedy = "write zero or more, or through_rest=True"
            raise StructureError("start_speed", f"is {float(speed):.6g} rad/s", remedy)
    names = [load.name for load in scene.loads]
    for name, span in {**(acting or {}), **({} if isinstance(motor, bool) else {"motor": motor})}.items():
        if name not in names and (acting is not None and name in acting):
            raise StructureError(f"acting[{name!r}]", "there is no such load", nearest(name, names))
        if len(span) != 2 or not span[0] < span[1]:
            raise StructureError(name, f"acts in the times {span}", "write (on, off) in s, with on before off")
    for load in scene.loads:
        window = load.window
        if through_rest and isinstance(window, Passage) and (window.going or window.between is None):
            problem = "its window depends on the sense of a motion, which a run through a standstill reverses"
            raise StructureError(f"load {load.name!r}", problem, "write a window of the crank angle")


def setup_for(
    made: ReadyScene, angle: Array, motor, acting, through_rest: bool, tolerance: float, solver: Any
) -> Setup:
    """What a run from the crank angle `angle` (rad) at any speed is made of."""
    scene, times = made.scene, None
    if acting or not isinstance(motor, bool):
        always = (-math.inf, math.inf)
        spans = [(acting or {}).get(load.name, always) for load in scene.loads]
        spans.append(always if isinstance(motor, bool) else motor)
        times = Times(*(jnp.asarray([span[i] for span in spans], float) for i in (0, 1)))
    unit = jax.lax.stop_gradient(scene.speed)
    inertia = reduced_model(made, angle, speed=jnp.zeros_like(angle)).inertia
    inertia = inertia if scene.motor is None else inertia + scene.motor.rotor_inertia()
    energy = jax.lax.stop_gradient(jnp.where(inertia > 0, inertia, 1.0) * unit**2)
    stiff = solver is None and is_stiff(made)
    return Setup(made, times, unit, energy, as_float(tolerance), through_rest, stiff, solver)


def _gap(given: ReadyScene, made: ReadyScene, speed: Array, off: bool) -> Gap | None:
    """What is waited for: the speed of the steady-state motion, or with the motor off a hundredth of that at the start;
    None if it cannot be reached."""
    if off:
        return threshold(SLOW * jnp.abs(speed))
    motion = steady_motion(given)
    assert motion.driven is not None
    if not isinstance(motion.driven.found, Tracer) and not bool(motion.driven.found):
        return None
    return lambda phi, speed: missing_speed(made, motion, phi, speed)


@compiled_soon
def missing_speed(made: ReadyScene, motion: Steady, phi: Array, speed: Array) -> tuple[Array, Array]:
    """What is missing of 99 % of the steady-state motion's speed (rad/s), negative, and the slope of that."""
    steady, gain = jax.vmap(lambda phi: motion.at(made, motion.grid.place(phi)))(phi)
    found = jnp.asarray(True) if motion.driven is None else motion.driven.found
    return jnp.where(found, speed - REACHED * steady, -jnp.inf), -REACHED * gain / steady


def _end(setup: Setup, start: Array, gap: Gap | None, cycles: float | None, off: bool) -> float:
    """The time (s) at which the run ends, if it is not given."""
    scene = setup.made.scene
    lap = scene.cycle / float(setup.unit)
    goal = gap if cycles is None else turned(start[0] + cycles * scene.cycle)
    slope = -1.0 if cycles is None and off else 1.0 if cycles is None else 0.0
    if goal is None or (cycles is None and off and float(start[1]) == 0):
        goal, slope = turned(start[0] + 10 * scene.cycle), 0.0
    now, state = 0.0, start
    while now < MOST * lap:
        times = jnp.linspace(now, now + CHUNK * lap, (LOOKS - 1) * CHUNK + 1)
        found = course(setup, times, state, works=False)
        when = float(passage(setup, times, found.states, goal, slope).time)
        if math.isfinite(when) and cycles is None and off and not bool(found.stopped):
            later = jnp.stack([times[-1], times[-1] + max(CHUNK * lap, 0.5 * when)])
            found = course(setup, later, found.last, works=False)  # does it stop soon, or only approach the standstill?
        if math.isfinite(when) and not (off and cycles is None and bool(found.stopped)):
            return max(when, 1e-3 * lap) * (1.0 if cycles is not None else 1 + 1e-6 if off else AFTER)
        if bool(found.stopped):
            return max(AFTER * float(found.stop_time), lap)
        if not bool(found.whole):
            break
        now, state = float(times[-1]), found.last
    if cycles is not None:
        raise StructureError("cycles", f"{cycles:g} are not reached in {MOST * lap:.6g} s", "give time instead")
    return max(now, lap)


def _whole(setup: Setup, gap: Gap | None, start: Array, end: float, points: int, off: bool) -> Transient:
    times = jnp.linspace(0.0, end, points)
    size = 2 + 3 + len(setup.made.scene.loads) + bool(setup.made.scene.friction)
    found = course(setup, times, jnp.concatenate([start, jnp.zeros(size - 2)]), works=True)
    # a passage is looked for at least so often in a cycle
    laps = float(jnp.max(jnp.abs(jnp.diff(found.states[:, 0])))) / setup.made.scene.cycle * (LOOKS - 1)
    closer, states = times, found.states
    if laps > 1:
        closer = jnp.linspace(0.0, end, (points - 1) * math.ceil(laps) + 1)
        states = course(setup, closer, start, works=False).states
    when = jnp.asarray(jnp.inf)
    if gap is not None and not (off and float(start[1]) == 0):
        when = passage(setup, closer, states[:, :2], gap, -1.0 if off else 1.0).time
    states, ending = found.states, Ending(found.last[0], found.stopped, found.stop_time, found.goes_on, found.whole)
    return _result(setup, times, states[:, 0], states[:, 1] * setup.unit, ending, when, off, states[:, 2:])


class Ending(NamedTuple):
    """How a motion ends: the crank angle (rad) then, whether in a standstill, its time (s), the sense in which the
    crank would go on from there, and whether the solver reached the end."""

    angle: Array
    stopped: Array
    time: Array
    goes_on: Array
    whole: Array


def _traced(
    setup: Setup, gap: Gap | None, angle: Array, speed: Array, end: Array, points: int, off: bool, adjoint: Any
) -> Transient:
    """The same with derivatives: events are found on the motion without them, and then moved as implicit functions."""
    assert gap is not None
    made, _, unit, energy, tolerance = jax.lax.stop_gradient(setup.numbers())
    fixed = setup._replace(made=made, unit=unit, energy=energy, tolerance=tolerance)
    start, sign = jax.lax.stop_gradient(jnp.stack([angle, speed / setup.unit])), -1.0 if off else 1.0
    closer = jax.lax.stop_gradient(jnp.linspace(0.0, end, max(points, CLOSER)))
    found = course(fixed, closer, start, works=False)
    when, rate = jax.lax.stop_gradient(passage(fixed, closer, found.states, gap, sign))
    reached = jnp.isfinite(when) & (when > 0)
    there = jnp.where(reached, when, jax.lax.stop_gradient(0.5 * end))
    times = jnp.linspace(0.0, 1.0, points) * end
    merged = jnp.sort(jnp.concatenate([times, there[None]]))
    number = jnp.searchsorted(merged, there).astype(int)
    solver = solver_for(setup.made, None, setup.stiff) if setup.solver is None else setup.solver
    options = {"tolerance": setup.tolerance, "solver": solver, "adjoint": adjoint}
    moved = run_in_time(setup.made, merged, angle, speed, None, **options)
    missing = gap(moved.angle[number][None], moved.speed[number][None])[0][0]
    shift = safe_divide(missing - jax.lax.stop_gradient(missing), rate)
    when = jnp.where(reached, when - jnp.where(reached, shift, 0.0), when)
    kept = jnp.arange(points) + jnp.where(jnp.arange(points) >= number, 1, 0)
    still = moved.stalled & ~jnp.isfinite(moved.angle[kept])
    angles = jnp.where(still, moved.stall_angle, moved.angle[kept])
    ending = Ending(moved.stall_angle, moved.stalled, moved.stall_time, found.goes_on, found.whole)
    speeds = jnp.where(still, 0.0, moved.speed[kept])
    return _result(setup, times, angles, speeds, ending, when, off, None)


def _result(
    setup: Setup, times: Array, angle: Array, speed: Array, found: Ending, when: Array, off: bool, works: Array | None
) -> Transient:
    """The result from angles (rad) and speeds (rad/s); `when` is the time of the passage that was waited for."""
    motor, states = setup.made.scene.motor, jnp.stack([angle, speed / setup.unit], axis=1)
    more = details(setup.numbers(), times, states)
    none = jnp.zeros_like(times)
    on = none + 1.0 if setup.times is None else jax.vmap(setup.times.acting)(times)[:, -1]
    shaft = none if motor is None else motor.motor_speed(speed)
    torque = none if motor is None else on * motor.motor_torque(speed)
    still = found.stopped & (times >= found.time)
    moved = jnp.any(speed != 0) | (found.time > times[0])
    infinite = jnp.asarray(jnp.inf)
    where, stop = (jnp.where(found.stopped, x, jnp.inf) for x in (found.angle, found.time))
    begins = None if off else starting_torque(setup.made)
    slow = jnp.where(found.stopped, stop, when) if off else stop
    energies = None if works is None else _energies(setup, works, more)
    return Transient(
        times, angle, speed, jnp.where(still, 0.0, more.acceleration), shaft, torque, torque * shaft,
        moved, found.stopped, where, stop, found.stopped & (found.goes_on < 0), infinite if off else when, slow,
        begins, found.whole, energies,
    )  # fmt: skip


def _energies(setup: Setup, works: Array, more: Any) -> Energies:
    motor, losses, *loads = (setup.energy * works[:, i] for i in range(works.shape[1]))
    scene = setup.made.scene
    names = ["gravity", *(load.name for load in scene.loads), *(["friction"] if scene.friction else [])]
    gained = more.kinetic - more.kinetic[0]
    sizes = jnp.stack([jnp.max(jnp.abs(part)) for part in (more.kinetic, motor, losses, *loads)])
    left = jnp.max(jnp.abs(motor - losses + sum(loads) - gained))
    error = safe_divide(left, jnp.max(sizes))
    return Energies(more.kinetic, more.springs, motor, losses, dict(zip(names, loads, strict=True)), error)
