"""The result of a run: the motion over time, its energies, and what happened."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Array, Bool, Float

from linkjax.runs._starting import Starting


class Energies(NamedTuple):
    """Energies (J) at the times of a run: kinetic energy with that of the rotor, energy stored in springs that always
    act, and since the start the work of the motor, the losses of its transmission, and the work on the machine of
    weight and of every load, by name. `error` is the most that is left of motor + loads - losses - gain of kinetic
    energy, relative to the greatest of them."""

    kinetic: Float[Array, " points"]
    springs: Float[Array, " points"]
    motor: Float[Array, " points"]
    losses: Float[Array, " points"]
    loads: dict[str, Float[Array, " points"]]
    error: Float[Array, ""]


class Transient(NamedTuple):
    """A motion over time: at uniform `time` (s) the crank `angle` (rad), `speed` (rad/s) and `acceleration` (rad/s²);
    speed (rad/s), torque (N m) and power (W) of the motor by its characteristic, zero where there is none or it is off.

    `starts` is false where the crank stays at rest at the start. `stopped` says that the motion came to rest, at
    `stop_angle` (rad) and `stop_time` (s), and `goes_back` that it would then turn backward; the values after that are
    those of the standstill. `run_up_time` is the first time (s) at which the speed is 99 % of that of the steady-state
    motion at the same crank angle, and `run_down_time` that of the standstill, or else, with the motor off, the first
    time at which the speed is 1 % of that at the start. All these are infinite where there is none. `starting` is the
    start from rest at any angle (None without a motor that is on), `complete` false where the solver ran out of steps.
    `energies` is None inside of jax transformations.
    """

    time: Float[Array, " points"]
    angle: Float[Array, " points"]
    speed: Float[Array, " points"]
    acceleration: Float[Array, " points"]
    motor_speed: Float[Array, " points"]
    motor_torque: Float[Array, " points"]
    motor_power: Float[Array, " points"]
    starts: Bool[Array, ""]
    stopped: Bool[Array, ""]
    stop_angle: Float[Array, ""]
    stop_time: Float[Array, ""]
    goes_back: Bool[Array, ""]
    run_up_time: Float[Array, ""]
    run_down_time: Float[Array, ""]
    starting: Starting | None
    complete: Bool[Array, ""]
    energies: Energies | None
