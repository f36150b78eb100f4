"""Integration of the equation of motion over time, in parts between standstills.

A machine without dry friction passes a standstill smoothly. Friction of joints, opposing loads, and losses of a
transmission change their sense there: the crank then starts forward, starts backward, or stays at rest, as the
accelerations from rest say.
Source: breakaway as in `linkjax.drives.MotorDrive.breakaway`, with all loads.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from linkjax._types import Scalar
from linkjax.drives import AbstractMotor, MotorDrive
from linkjax.kinematics import pose
from linkjax.machine import ReadyScene, Scene
from linkjax.motion._rubbed import JAM, with_friction
from linkjax.motion._stiff import control_for
from linkjax.motion._torque import Torque, acceleration_at
from linkjax.reduction import Reduced, reduce_pose

MOST_STEPS = 16**4
MOST_PARTS = 10_000  # parts between standstills

Acting = Callable[[Array], Array]  # (time) -> one or zero for every load, and for the motor


class Switched(AbstractMotor):
    """A motor times a `factor`: one while it is on, zero while it is off."""

    motor: AbstractMotor
    factor: Array

    def torque(self, speed):
        return self.factor * self.motor.torque(speed)


class Way(NamedTuple):
    """How a scene is driven: its `drive` torque on the crank (None: its motor), which loads act at a time, with the
    motor last (None: all), and the angular speed (rad/s) and energy (J) that are the units of states."""

    made: ReadyScene
    drive: Any
    acting: Acting | None
    unit: Array
    energy: Array

    def motor(self, time: Scalar) -> MotorDrive | None:
        """The motor at a time (s)."""
        motor = self.made.scene.motor
        if motor is None or self.acting is None:
            return motor
        return MotorDrive(Switched(motor.motor, self.acting(time)[-1]), motor.transmission, motor.inertia)

    def gain(self, time: Scalar, here: Reduced, phi: Scalar, speed: Scalar, sense: Scalar) -> Array:
        """Acceleration of the crank (rad/s²) with the reduced model of all loads and of friction."""
        return acceleration_at(self.motor(time), here, self.drive, phi, speed, sense)

    def reduced(self, time: Scalar, phi: Scalar, speed: Scalar, sense: Scalar, at_rest: bool = False) -> Reduced:
        """The reduced model of friction, and of all loads that act at a time (s), at a crank angle (rad) and speed
        (rad/s)."""
        active = self.made.scene.active(phi)
        active = active if self.acting is None else active * self.acting(time)[:-1]
        at, here = self.made.instant(phi, phi, speed), pose(self.made.mechanism, phi)
        bare = reduce_pose(self.made.scene, at, here, active, sense)

        def advance(model: Reduced) -> Array:
            return self.gain(time, model, phi, speed, sense)

        return with_friction(self.made.scene, at, here, active, bare, advance, sense, at_rest)

    def acceleration(
        self, time: Scalar, phi: Scalar, speed: Scalar, sense: Scalar, at_rest: bool = False
    ) -> Array:  # fmt: skip
        """Acceleration of the crank (rad/s²)."""
        return self.gain(time, self.reduced(time, phi, speed, sense, at_rest), phi, speed, sense)

    def rate(self, time: Scalar, state: Array, sense: Scalar, works: bool) -> Array:
        """Rates of crank angle and speed, and of the works of motor, losses, weight, loads and friction, in time times
        unit."""
        phi, speed = state[0], state[1] * self.unit
        here = self.reduced(time / self.unit, phi, speed, sense)
        gain = self.gain(time / self.unit, here, phi, speed, sense)
        powers = self.powers(time / self.unit, here, speed, gain, sense) if works else []
        return jnp.stack([state[1], gain / self.unit**2, *(p / (self.energy * self.unit) for p in powers)])

    def powers(self, time: Scalar, here: Reduced, speed: Scalar, gain: Scalar, sense: Scalar) -> list[Array]:
        """Powers (W) of the motor, of the losses of its transmission, of weight, of every load, and of friction."""
        motor = self.motor(time)
        if self.drive is not None or motor is None:
            torque = 0.0 if self.drive is None else here.inertia * gain - here.torque + 0.5 * here.slope * speed**2
            first = [torque * speed, jnp.zeros_like(speed)]
        else:
            first = [motor.motor_power(speed), motor.power_loss(speed, gain, sense)]
        return [*first, *(share * speed for share in here.by_load.values())]

    def breakaway(self, time: Scalar, phi: Scalar) -> Array:
        """The sense in which a crank at rest starts: 1, -1, or 0 if it stays at rest."""
        rest, one = jnp.zeros_like(phi), jnp.ones_like(phi)
        ahead, back = (self.acceleration(time, phi, rest, sense, at_rest=True) for sense in (one, -one))
        return jnp.where(ahead > 0, 1.0, jnp.where(back < 0, -1.0, 0.0))


class Course(NamedTuple):
    """States at the times asked for: crank angle (rad), speed in its unit, and works in their unit where asked for.
    After a standstill the state is kept; after the solver ran out of steps it is infinite. Whether the motion ended in
    a standstill, its state and time (s); the sense in which the crank would start from there; and whether the
    integration reached its end."""

    states: Float[Array, "points n"]
    stopped: Bool[Array, ""]
    last: Float[Array, " n"]
    stop_time: Array
    goes_on: Array
    whole: Bool[Array, ""]


def is_dry(scene: Scene, drive: Scalar | Torque | None) -> bool:
    """Whether torques jump where the sense of rotation changes: friction, opposing loads, a lossy transmission."""
    if scene.friction or any(load.opposing for load in scene.loads):
        return True
    return drive is None and scene.motor is not None and scene.motor.transmission.loses


def march(
    way: Way, times: Float[Array, " points"], start: Float[Array, " n"], solver: Any, tolerance: Any, *,
    through_rest: bool = False, works: bool = False, jumps: Array | None = None, adjoint: Any = None,
) -> Course:  # fmt: skip
    """The motion over increasing `times` (s) from a state `start` at the first. It ends at a standstill unless it is to
    go on `through_rest`. `jumps` are times (s) at which loads begin or end to act."""
    scene = way.made.scene
    dry = is_dry(scene, way.drive)
    clock = times * way.unit
    begin, end = clock[0], clock[-1]
    sense = jnp.where(start[1] < 0, -1.0, jnp.where(start[1] > 0, 1.0, way.breakaway(times[0], start[0])))
    options = (way, clock, solver, tolerance, works, jumps, adjoint)
    if through_rest and not dry:
        states, last, _, _, whole = _part(*options, begin, start, jnp.ones_like(sense), stops=False)
        never = jnp.asarray(False)
        return Course(states, never, last, jnp.asarray(jnp.inf), sense, whole)
    if not through_rest:
        ahead = (sense > 0) & (start[1] >= 0)
        states, last, when, stopped, whole = _part(*options, begin, start, jnp.ones_like(sense), stops=True)
        rest = start.at[1].set(0.0)
        states, last = (jnp.where(ahead, a, b) for a, b in ((states, rest[None]), (last, rest)))
        stopped, when = stopped | ~ahead, jnp.where(ahead, when, begin)
        return Course(states, stopped, last, when / way.unit, way.breakaway(when / way.unit, last[0]), whole | ~ahead)
    return _parts(options, begin, end, start, sense)


class _Carry(NamedTuple):
    """What is known before a part: its number, time, state and sense; the states so far; whether all steps were
    taken; and the time at which the crank last came to rest."""

    number: Array
    time: Array
    state: Array
    sense: Array
    states: Array
    whole: Array
    rest: Array


def _parts(options: tuple, begin: Array, end: Array, start: Array, sense: Array) -> Course:
    way, clock, jumps = options[0], options[1], options[5]
    switches = jnp.full(1, jnp.inf) if jumps is None else jumps * way.unit

    def more(carry: _Carry) -> Array:
        return (carry.time < end) & carry.whole & (carry.number < MOST_PARTS)

    def moving(carry: _Carry) -> _Carry:
        states, last, when, stopped, whole = _part(
            *options, begin=carry.time, start=carry.state, sense=carry.sense, stops=True
        )
        states = jnp.where((clock > carry.time)[:, None], states, carry.states)
        last = jnp.where(stopped, last.at[1].set(0.0), last)
        sense = jnp.where(stopped, way.breakaway(when / way.unit, last[0]), carry.sense)
        return _Carry(carry.number + 1, when, last, sense, states, carry.whole & whole,
                      jnp.where(stopped, when, carry.rest))  # fmt: skip

    def resting(carry: _Carry) -> _Carry:
        when = jnp.minimum(jnp.min(jnp.where(switches > carry.time, switches, jnp.inf)), end)
        states = jnp.where((clock > carry.time)[:, None], carry.state[None], carry.states)
        just = when * (1 + 4 * jnp.finfo(when.dtype).eps)
        return _Carry(carry.number + 1, when, carry.state, way.breakaway(just / way.unit, carry.state[0]), states,
                      carry.whole, carry.rest)  # fmt: skip

    first = _Carry(jnp.zeros((), jnp.int32), begin, start, sense, jnp.broadcast_to(start, (clock.size, start.size)),
                   jnp.asarray(True), begin)  # fmt: skip

    def step(carry: _Carry) -> _Carry:
        return jax.lax.cond(carry.sense == 0, resting, moving, carry)

    done = jax.lax.while_loop(more, step, first)
    stopped = (done.state[1] == 0) & (done.sense == 0)
    when = jnp.where(stopped, done.rest / way.unit, jnp.inf)
    return Course(done.states, stopped, done.state, when, done.sense, done.time >= end)


def _part(
    way: Way, clock: Array, solver: Any, tolerance: Any, works: bool, jumps: Array | None, adjoint: Any,
    begin: Array, start: Array, sense: Array, stops: bool,
) -> tuple[Array, Array, Array, Array, Array]:  # fmt: skip
    """The states at all times of the `clock`; those before `begin` have no meaning, and those after a standstill are
    the last one. The last state and its time, whether the crank came to rest, and whether the integration reached its
    end."""
    import diffrax
    import optimistix

    control = control_for(solver, tolerance)
    if jumps is not None:
        control = diffrax.ClipStepSizeController(control, jump_ts=jumps * way.unit)
    finder = optimistix.Bisection(rtol=1e-14, atol=1e-14)
    scale = 1 / JAM if way.made.scene.friction else 1.0  # the speed may fall so steeply that its zero has few digits
    falls = diffrax.Event(lambda t, y, args, **_: scale * sense * y[1], finder, direction=False)
    term = diffrax.ODETerm(lambda t, state, _: way.rate(jnp.asarray(t), state, sense, works))
    solution = diffrax.diffeqsolve(
        term, solver, begin, clock[-1], None, start,
        saveat=diffrax.SaveAt(ts=jnp.clip(clock, begin), t1=True), stepsize_controller=control,
        event=falls if stops else None, max_steps=MOST_STEPS, throw=False,
        adjoint=adjoint or diffrax.RecursiveCheckpointAdjoint(),
    )  # fmt: skip
    assert solution.ys is not None
    assert solution.ts is not None
    end = jnp.sum(jnp.isfinite(solution.ts)) - 1  # the index of the final state, after the requested ones
    last, when = solution.ys[end], solution.ts[end]
    stopped = solution.result == diffrax.RESULTS.event_occurred
    whole = stopped | (solution.result == diffrax.RESULTS.successful)
    last = jnp.where(stopped, last.at[1].set(0.0), last)
    kept = (jnp.arange(clock.size) < end) & ~(stopped & (clock > when))
    after = jnp.where(whole, last, jnp.inf)
    return jnp.where(kept[:, None], solution.ys[:-1], after[None]), last, when, stopped, whole
