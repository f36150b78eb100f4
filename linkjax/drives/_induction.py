"""Induction motors: by the numbers of the type plate (Kloss), and by the equivalent circuit.

The slip is s = 1 - ω / ω_s, with the synchronous speed ω_s: zero at ω_s, one at rest.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import root, safe_sqrt
from linkjax._types import as_float, known
from linkjax.drives._motors import AbstractMotor, check_numbers, of_speed

STEPS = 12  # of Newton's method for the speed without load


class InductionMotor(AbstractMotor):
    """An induction motor by its type plate: `rated_power` (W), `rated_speed` and `synchronous_speed` (rad/s), breakdown
    torque over rated torque `breakdown_ratio`, and where known starting torque over rated torque `starting_ratio`.

    Up to the breakdown the torque is that of Kloss, T = T_b (2 + q) / (s/s_b + s_b/s + q), with the breakdown slip s_b
    at which the curve passes through the rated point exactly, s_b = s_r (c + √(c² - 4)) / 2 with
    c = m (2 + q) - q for the breakdown ratio m. `q` is 2 s_b R_1 / R_2', often near zero for large motors.

    Beyond the breakdown it is a monotone cubic from the breakdown point, with slope zero, to the starting torque at
    rest, if a `starting_ratio` is given, and Kloss otherwise; the starting ratio does not move the breakdown. When
    rotated backwards (s > 1) the torque decreases as that of Kloss, in proportion to the torque at rest. Above the
    synchronous speed (s < 0, generator) it is the torque of Kloss at -s, reversed.

    Raises `ValueError` for a number that is not above zero, a rated speed that is not below the synchronous speed, a
    breakdown ratio of one or less, and a starting ratio that is not below the breakdown ratio or has no effect because
    the breakdown slip is one or more. Source: M. Kloss, Archiv für Elektrotechnik 5 (1916) 59-87; G. Müller,
    B. Ponick, Theorie elektrischer Maschinen, ch. 2.
    """

    rated_power: Array = eqx.field(converter=as_float)
    rated_speed: Array = eqx.field(converter=as_float)
    synchronous_speed: Array = eqx.field(converter=as_float)
    breakdown_ratio: Array = eqx.field(converter=as_float)
    starting_ratio: Array | None = eqx.field(converter=as_float, default=None)
    q: Array = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        names = ("rated_power", "rated_speed", "synchronous_speed", "breakdown_ratio", "starting_ratio")
        check_numbers("an induction motor", {name: getattr(self, name) for name in names}, {"q": self.q})
        rated, synchronous, breakdown, start = (known(getattr(self, name)) for name in names[1:])
        if rated is not None and synchronous is not None and not np.all(rated < synchronous):
            problem = f"rated_speed of an induction motor is {of_speed(rated)}"
            problem += f", not below the synchronous {of_speed(synchronous)}"
            raise ValueError(f"{problem}; write both from the type plate, e.g. 1450 and 1500 rpm")
        if breakdown is not None and not np.all(breakdown > 1):
            remedy = "write the breakdown torque over the rated torque, e.g. 2.5"
            raise ValueError(f"breakdown_ratio of an induction motor is {breakdown}, not above one; {remedy}")
        if start is not None and breakdown is not None and not np.all(start < breakdown):
            problem = f"starting_ratio of an induction motor is {start}, not below its breakdown_ratio {breakdown}"
            raise ValueError(f"{problem}; write the torque at rest over the rated torque, or omit it")
        slip = known(self.breakdown_slip()) if start is not None else None
        if slip is not None and not np.all(slip < 1):
            problem = f"starting_ratio of an induction motor has no effect: its breakdown slip is {slip}, beyond rest"
            raise ValueError(f"{problem}; omit it, or check the rated speed and the breakdown_ratio")

    def rated_torque(self) -> Array:
        """Torque at the rated point (N m)."""
        return self.rated_power / self.rated_speed

    def breakdown_torque(self) -> Array:
        """The greatest torque as a motor (N m)."""
        return self.breakdown_ratio * self.rated_torque()

    def breakdown_slip(self) -> Array:
        """The slip s_b at which the torque is greatest."""
        c = self.breakdown_ratio * (2 + self.q) - self.q
        return (1 - self.rated_speed / self.synchronous_speed) * 0.5 * (c + safe_sqrt(c**2 - 4))

    def _kloss(self, slip: Array) -> Array:
        """Torque of Kloss (N m), odd in the slip."""
        s_b = self.breakdown_slip()
        below = slip**2 + s_b**2 + self.q * s_b * jnp.abs(slip)
        return self.breakdown_torque() * (2 + self.q) * slip * s_b / below

    def torque(self, speed):
        slip = 1 - speed / self.synchronous_speed
        if self.starting_ratio is None:
            return self._kloss(slip)
        start, most, s_b = self.starting_ratio * self.rated_torque(), self.breakdown_torque(), self.breakdown_slip()
        rest, slope = jax.jvp(self._kloss, (jnp.ones(()),), (jnp.ones(()),))
        width, drop = jnp.maximum(1 - s_b, 1e-6), start - most
        end = jnp.maximum(slope / rest * start * width, 3 * drop)  # both negative; beyond 3 it would not be monotone
        t = jnp.clip((slip - s_b) / width, 0.0, 1.0)
        cubic = most + t**2 * (3 * drop - end + t * (end - 2 * drop))
        behind = self._kloss(jnp.maximum(slip, 1.0)) * (start / rest)
        return jnp.where(slip <= s_b, self._kloss(slip), jnp.where(slip <= 1, cubic, behind))

    def knots(self):
        above = (self.synchronous_speed,)
        if self.starting_ratio is None:
            return above
        return (jnp.zeros_like(self.synchronous_speed), (1 - self.breakdown_slip()) * self.synchronous_speed, *above)

    def no_load_speed(self):
        return self.synchronous_speed

    def torque_limit(self):
        return self.breakdown_torque()


class InductionCircuit(AbstractMotor):
    """An induction motor by its equivalent circuit in T form, with three phases, in steady state.

    `phase_voltage` (V, effective value at one winding; see `phase_voltage_of` for delta and star), `frequency` (Hz),
    `pole_pairs`, and for each phase at that frequency, referred to the stator (ohm): `stator_resistance`,
    `rotor_resistance`, `magnetizing_reactance`, and the leakage reactances `stator_reactance` and `rotor_reactance`.
    Resistances are those of the warm windings; see `warm_resistance`. `friction_power` (W) at the shaft speed
    `friction_speed` (rad/s) is the power of friction and ventilation; its torque is in proportion to the speed.

    The torque is 3 I_2² (R_2 / s) / ω_s less friction, with the synchronous speed ω_s = 2π f / pole pairs. There is no
    loss in the iron, and currents and parameters are those of the steady state. Raises `ValueError` for a number that
    is not above zero (zero or more for the stator, the leakages and friction) and for friction without its speed.
    Source: A. E. Fitzgerald, C. Kingsley, S. D. Umans, Electric Machinery, ch. 6.
    """

    phase_voltage: Array = eqx.field(converter=as_float)
    frequency: Array = eqx.field(converter=as_float)
    pole_pairs: int = eqx.field(static=True)
    stator_resistance: Array = eqx.field(converter=as_float)
    rotor_resistance: Array = eqx.field(converter=as_float)
    magnetizing_reactance: Array = eqx.field(converter=as_float)
    stator_reactance: Array = eqx.field(converter=as_float)
    rotor_reactance: Array = eqx.field(converter=as_float)
    friction_power: Array = eqx.field(converter=as_float, default=0.0)
    friction_speed: Array | None = eqx.field(converter=as_float, default=None)

    def __check_init__(self):
        if isinstance(self.pole_pairs, bool) or not isinstance(self.pole_pairs, int) or self.pole_pairs < 1:
            problem = f"pole_pairs of an induction motor is {self.pole_pairs!r}"
            raise ValueError(f"{problem}; write an integer of 1 or more, e.g. 2 for 1500 rpm at 50 Hz")
        above = ("phase_voltage", "frequency", "rotor_resistance", "magnetizing_reactance", "friction_speed")
        least = ("stator_resistance", "stator_reactance", "rotor_reactance", "friction_power")
        given = ({name: getattr(self, name) for name in names} for names in (above, least))
        check_numbers("an induction motor", *given)
        power = known(self.friction_power)
        if self.friction_speed is None and power is not None and np.any(power > 0):
            remedy = "write friction_speed, the shaft speed to which it belongs"
            raise ValueError(f"friction_power of an induction motor has no speed; {remedy}")

    def synchronous_speed(self) -> Array:
        """The synchronous speed (rad/s)."""
        return 2 * jnp.pi * self.frequency / self.pole_pairs

    def _source(self) -> tuple[Array, Array, Array]:
        """Square of the voltage (V²), resistance and reactance (ohm) of stator and magnetizing branch, seen from the
        rotor (Thévenin)."""
        r, x, m = self.stator_resistance, self.stator_reactance, self.magnetizing_reactance
        below = r**2 + (x + m) ** 2
        return (self.phase_voltage * m) ** 2 / below, r * m**2 / below, m * (r**2 + x * (x + m)) / below

    def electrical_torque(self, speed: Array) -> Array:
        """Torque in the air gap (N m), before friction, at shaft speeds (rad/s)."""
        slip, (square, r, x) = 1 - speed / self.synchronous_speed(), self._source()
        below = (r * slip + self.rotor_resistance) ** 2 + ((x + self.rotor_reactance) * slip) ** 2
        return 3 * square * self.rotor_resistance * slip / (below * self.synchronous_speed())

    def friction(self, speed: Array) -> Array:
        """Torque of friction and ventilation (N m), positive at positive speeds."""
        if self.friction_speed is None:
            return jnp.zeros_like(speed)
        return self.friction_power / self.friction_speed**2 * speed

    def torque(self, speed):
        return self.electrical_torque(speed) - self.friction(speed)

    def breakdown_slip(self) -> Array:
        """The slip at which the torque in the air gap is greatest."""
        _, r, x = self._source()
        return self.rotor_resistance / safe_sqrt(r**2 + (x + self.rotor_reactance) ** 2, 1.0)

    def torque_limit(self):
        return self.torque((1 - self.breakdown_slip()) * self.synchronous_speed())

    def no_load_speed(self):
        if self.friction_speed is None:
            return self.synchronous_speed()

        def solve(function, start):
            def step(_, at):
                value, slope = jax.jvp(function, (at,), (jnp.ones_like(at),))
                return at - value / slope

            return jax.lax.fori_loop(0, STEPS, step, start)

        return root(lambda speed: self.torque(speed), self.synchronous_speed(), solve)


def phase_voltage_of(line_voltage: Any, connection: str) -> Array:
    """Voltage at one winding (V) from that between two lines (V), for the `connection` "delta" (the same) or "star"
    (divided by √3). Raises `ValueError` for any other connection."""
    if connection not in ("delta", "star"):
        raise ValueError(f'connection of an induction motor is {connection!r}; write "delta" or "star"')
    return as_float(line_voltage) / (1.0 if connection == "delta" else 3.0**0.5)


def warm_resistance(resistance: Any, coefficient: Any, rise: Any) -> Array:
    """Resistance (ohm) of a winding that is warmer by `rise` (K): R (1 + α ΔT). The `coefficient` α (1/K) belongs to
    the temperature at which the resistance was measured: about 3.92e-3 for copper and 4.03e-3 for aluminium at 20 °C.
    """
    return as_float(resistance) * (1 + as_float(coefficient) * as_float(rise))
