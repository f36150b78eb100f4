"""The time of a run-up from rest, with its derivatives."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide
from linkjax._types import Scalar, Tracer, as_float
from linkjax.drives import NoMotor, Servo
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import StructureError
from linkjax.motion import Steady, at_crank_angles, run_in_time, solver_for, steady_motion
from linkjax.runs._course import Passed, course, passage, setup_of
from linkjax.runs._run import CHUNK, LOOKS, MOST, missing_speed, setup_for

TOLERANCE = 1e-12  # of the integration


def run_up_time(
    scene: Scene | ReadyScene, start_angle: Scalar | float = 0.0, motion: Steady | None = None
) -> Array:  # fmt: skip
    """Time (s) of a run-up from rest at the crank angle `start_angle` (rad), until the crank has for the first time
    99 % of the speed of the steady-state `motion` at the same crank angle (computed unless it is given).

    It is infinite where the machine does not start from there, comes to rest again, has no steady-state motion, or does
    not reach that speed in the time of 500 cycles at the scene's speed; its derivatives are then zero. Otherwise its
    first derivatives with respect to the design and the start angle are exact, forward and reverse, also where loads
    switch on the way. `starting_torque` gives the margin of the start at every angle. Raises `StructureError` for a
    scene without a motor, and if the driver follows a motion law.
    """
    given = ready(scene)
    if (lack := no_start(given.scene)) is not None:
        raise StructureError("run_up_time", *lack)
    motion = steady_motion(given) if motion is None else motion
    made, angle = given.of(at_crank_angles(given)), as_float(start_angle)
    setup = setup_for(made, angle, True, None, False, TOLERANCE, None)
    fixed = jax.lax.stop_gradient((setup.numbers(), motion, angle))
    when, rate = jax.lax.stop_gradient(_passed(*fixed, stiff=setup.stiff))
    if not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((made, motion, angle))):
        return when
    reached = jnp.isfinite(when) & (when > 0)
    times = jnp.stack([jnp.zeros_like(when), jnp.where(reached, when, 1 / setup.unit)])
    options = {"tolerance": TOLERANCE, "solver": solver_for(made, None, setup.stiff), "adjoint": _both_ways()}
    moved = run_in_time(made, times, angle, jnp.zeros(()), **options)
    ends = jnp.isfinite(jax.lax.stop_gradient(moved.speed[1])) & reached
    phi, speed = (jnp.where(ends, x[1], jax.lax.stop_gradient(y)) for x, y in
                  ((moved.angle, angle), (moved.speed, setup.unit)))  # fmt: skip
    missing = missing_speed(made, motion, phi[None], speed[None])[0][0]
    missing = jnp.where(ends, missing, 0.0)
    shift = safe_divide(missing - jax.lax.stop_gradient(missing), rate)
    return jnp.where(ends, when - jnp.where(ends, shift, 0.0), jnp.inf)


def no_start(scene: Scene) -> tuple[str, str] | None:
    """What a scene lacks for a start from rest, and the remedy; None if it has a motor with a torque at rest."""
    if scene.mechanism.prescribed:
        return "the driver has a motion law, so it cannot be started", "delete the law, or the measure"
    if scene.motor is None or isinstance(scene.motor.motor, NoMotor):
        return "the scene has no motor to start it", "add [motor], or delete the measure"
    if isinstance(scene.motor.motor, Servo):
        return "a servo motor has no characteristic", "write another kind of motor, or delete the measure"
    return None


class _Looked(NamedTuple):
    """How far the run is: number of parts, time (s) and state at the begin of the last part and at its end, whether it
    contains the passage, and whether the crank has come to rest or the solver ran out of steps."""

    number: Array
    before: tuple[Array, Array]
    now: tuple[Array, Array]
    hit: Array
    over: Array


@compiled_soon(static=("stiff",))
def _passed(numbers: tuple, motion: Steady, angle: Array, stiff: bool) -> Passed:
    """The passage through 99 % of the speed of the steady-state motion, looked for part by part."""
    setup = setup_of(numbers, stiff=stiff)
    wide = CHUNK * setup.made.scene.cycle / setup.unit
    found = jnp.asarray(True) if motion.driven is None else motion.driven.found

    def gap(phi: Array, speed: Array) -> tuple[Array, Array]:
        return missing_speed(setup.made, motion, phi, speed)

    def times(begin: Array) -> Array:
        return begin + wide * jnp.linspace(0.0, 1.0, (LOOKS - 1) * CHUNK + 1)

    def more(at: _Looked) -> Array:
        return found & ~at.hit & ~at.over & (at.number < MOST // CHUNK)

    def further(at: _Looked) -> _Looked:
        begin, state = at.now
        ran = course(setup, times(begin), state, works=False)
        reached = jnp.any(gap(ran.states[:, 0], ran.states[:, 1] * setup.unit)[0] >= 0)
        return _Looked(at.number + 1, at.now, (begin + wide, ran.last), reached, ran.stopped | ~ran.whole)

    zero = jnp.zeros_like(angle)
    start = zero, jnp.stack([angle, zero])
    last = jax.lax.while_loop(more, further, _Looked(jnp.asarray(0), start, start, zero > 0, zero > 0))
    begin, state = last.before
    ran = course(setup, times(begin), state, works=False)
    when, rate = passage(setup, times(begin), ran.states[:, :2], gap)
    return Passed(jnp.where(last.hit, when, jnp.inf), jnp.where(last.hit, rate, 1.0))


def _both_ways() -> Any:
    """The way in which diffrax differentiates forward and in reverse."""
    import diffrax

    return diffrax.DirectAdjoint()
