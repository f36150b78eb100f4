"""A course of the motion over time, as programs that are compiled once for a machine, and passages of a value on it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide
from linkjax._types import Tracer
from linkjax.drives import MotorDrive, NoMotor
from linkjax.kinematics import pose
from linkjax.machine import ReadyScene
from linkjax.motion import Course, Way, march, solver_for
from linkjax.reduction import unloaded

NEWTON = 6  # steps for the time of a passage, so that its rate has all digits as well


class Times(NamedTuple):
    """Times (s) at which every load, and last the motor, begins and ends to act."""

    on: Array
    off: Array

    def acting(self, time: Array) -> Array:
        """One or zero for every load, and for the motor."""
        return jnp.where((time >= self.on) & (time < self.off), 1.0, 0.0)


class Setup(NamedTuple):
    """What a run is made of: the scene, times of loads and motor (None: they always act), the units of speed (rad/s)
    and energy (J), the tolerance; and whether it goes through standstills, is stiff, or has another solver."""

    made: ReadyScene
    times: Times | None
    unit: Array
    energy: Array
    tolerance: Array
    through_rest: bool
    stiff: bool
    solver: Any

    @property
    def way(self) -> Way:
        """How the scene is driven."""
        return Way(self.made, None, None if self.times is None else self.times.acting, self.unit, self.energy)

    def numbers(self) -> tuple:
        """The part that consists of numbers."""
        return self.made, self.times, self.unit, self.energy, self.tolerance


def setup_of(numbers: tuple, through_rest: bool = False, stiff: bool = False) -> Setup:
    """A run of these numbers, without a solver of its own."""
    made, times, unit, energy, tolerance = numbers
    return Setup(made, times, unit, energy, tolerance, through_rest, stiff, None)


def without_motor(motor: MotorDrive | None) -> MotorDrive | None:
    """The motor switched off: its rotor and transmission stay."""
    return None if motor is None else MotorDrive(NoMotor(), motor.transmission, motor.inertia)


def course(setup: Setup, times: Array, start: Array, works: bool) -> Course:
    """The motion over times (s) from a state at the first; with works of motor, losses, weight and loads if `works`."""
    if setup.solver is not None:
        return _integrated(setup, times, start, works, setup.solver)
    flags = {"through_rest": setup.through_rest, "stiff": setup.stiff, "works": works}
    return _course(setup.numbers(), times, start, **flags)


@compiled_soon(static=("through_rest", "stiff", "works"))
def _course(numbers: tuple, times: Array, start: Array, through_rest: bool, stiff: bool, works: bool) -> Course:
    setup = setup_of(numbers, through_rest, stiff)
    return _integrated(setup, times, start, works, solver_for(setup.made, None, stiff))


def _integrated(setup: Setup, times: Array, start: Array, works: bool, solver: Any) -> Course:
    given, jumps = setup.times, None
    if given is not None:
        jumps = jnp.sort(jnp.clip(jnp.concatenate([given.on, given.off]), times[0] - 1, times[-1] + 1))
    options = {"through_rest": setup.through_rest, "works": works, "jumps": jumps}
    return march(setup.way, times, start, solver, setup.tolerance, **options)


class Details(NamedTuple):
    """At the states of a run: acceleration (rad/s²), kinetic energy with that of the rotor, and energy stored in the
    springs that always act (J)."""

    acceleration: Array
    kinetic: Array
    springs: Array


@compiled_soon
def details(numbers: tuple, times: Array, states: Array) -> Details:
    """Acceleration and energies at states of a run."""
    setup = setup_of(numbers)
    scene = setup.made.scene
    rotor = 0.0 if scene.motor is None else scene.motor.rotor_inertia()

    def one(time: Array, state: Array) -> Details:
        speed, here = state[1] * setup.unit, pose(setup.made.mechanism, state[0])
        gain = setup.way.acceleration(time, state[0], speed, jnp.where(speed < 0, -1.0, 1.0))
        inertia = unloaded(scene, setup.made.instant(state[0], state[0], speed), here)[0]
        stored = [load.energy(here) for load in scene.loads if load.window is None]
        springs = sum((energy for energy in stored if energy is not None), jnp.zeros_like(speed))
        return Details(gain, 0.5 * (inertia + rotor) * speed**2, springs)

    return jax.vmap(one)(times, states)


Gap = Callable[
    [Array, Array], tuple[Array, Array]
]  # (angle, speed) -> what is missing in speed, and its slope in angle


class Passed(NamedTuple):
    """A passage: its time (s), infinite if there is none, and the rate of the gap there."""

    time: Array
    rate: Array


def passage(setup: Setup, times: Array, states: Array, gap: Gap, by_speed: float = 1.0) -> Passed:
    """The first time at which a gap, below zero before, reaches zero. `states` are known at the `times`, closely enough
    to see it; Newton's method with integration from the last of them before it finds the time. `by_speed` is the slope
    of the gap in the speed."""
    gaps = gap(states[:, 0], states[:, 1] * setup.unit)[0]
    over = gaps >= 0
    found, k = jnp.any(over), jnp.maximum(jnp.argmax(over), 1)
    if not isinstance(found, Tracer) and not bool(found):
        return Passed(jnp.asarray(jnp.inf), jnp.ones(()))
    low, high, start = times[k - 1], times[k], states[k - 1, :2]
    part = safe_divide(gaps[k - 1], gaps[k - 1] - gaps[k])
    at, rate = low + (high - low) * jnp.clip(part, 1e-6, 1.0), jnp.ones(())
    for _ in range(NEWTON):
        state = course(setup, jnp.stack([low, at]), start, works=False).last
        speed = state[1] * setup.unit
        missing, slope = gap(state[0][None], speed[None])
        gain = details(setup.numbers(), at[None], state[None]).acceleration[0]
        rate = slope[0] * speed + by_speed * gain
        at = jnp.clip(at - safe_divide(missing[0], rate), low + 1e-9 * (high - low), high)
    return Passed(jnp.where(over[0], times[0], jnp.where(found, at, jnp.inf)), rate)


def threshold(least: Array) -> Gap:
    """The gap of a speed that falls to `least` (rad/s)."""
    return functools.partial(_below, least)


def _below(least: Array, angle: Array, speed: Array) -> tuple[Array, Array]:
    return least - jnp.abs(speed), jnp.zeros_like(angle)


def turned(angle: Array) -> Gap:
    """The gap of a crank that turns to an angle (rad)."""
    return lambda phi, speed: (phi - angle, jnp.ones_like(phi))
