"""Motors: the torque at the shaft as a function of the speed of the shaft, the static characteristic.

Speeds are those of the motor's own shaft (rad/s), positive in the direction in which the motor drives.
"""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._interpolate import interpolate
from linkjax._numerics import safe_divide
from linkjax._types import as_float, known


def check_numbers(kind: str, above: dict[str, Any], least: dict[str, Any] | None = None) -> None:
    """Raise `ValueError` unless the numbers `above` are finite and above zero, and those of `least` zero or more. None
    and traced numbers pass."""
    for name, value in {**above, **(least or {})}.items():
        number, positive = known(value), name in above
        if number is not None and not np.all(np.isfinite(number) & ((number > 0) if positive else (number >= 0))):
            size = "above zero" if positive else "of zero or more"
            raise ValueError(f"{name} of {kind} is {number}; write a finite number {size}")


def of_speed(value: Any) -> str:
    """A speed (rad/s) in both of its usual units; the first one where there are several."""
    first = float(np.ravel(value)[0])
    return f"{first:.6g} rad/s ({first * 30 / np.pi:.6g} rpm)"


def numbers(values: Any) -> tuple[Array, ...]:
    """Several numbers, each an array of its own."""
    return tuple(as_float(value) for value in values)


class AbstractMotor(eqx.Module):
    """A motor: torque (N m) at its shaft as a function of the speed of its shaft (rad/s).

    A new kind of motor is a subclass with `torque`; `knots` and `no_load_speed` where the characteristic has them, and
    `rated_torque`, `torque_limit` and `speed_limit` where its type plate gives them.
    """

    @abc.abstractmethod
    def torque(self, speed: Array) -> Array:
        """Torque at the shaft (N m) at shaft speeds (rad/s) of any shape; negative where the motor brakes."""

    def knots(self) -> tuple[Array, ...]:
        """Shaft speeds (rad/s) at which a derivative of the characteristic jumps."""
        return ()

    def no_load_speed(self) -> Array | None:
        """The shaft speed (rad/s) at which the torque is zero; None without one, infinite for a level line."""
        return None

    def stall_torque(self) -> Array:
        """The torque at rest (N m), that of the start."""
        return self.torque(jnp.zeros(()))

    def rated_torque(self) -> Array | None:
        """The torque (N m) that the motor may give continuously; None where it is not known."""
        return None

    def torque_limit(self) -> Array | None:
        """The greatest torque that the motor can give (N m): the breakdown torque, or the limit of a servo motor; None
        where there is none."""
        return None

    def speed_limit(self) -> Array | None:
        """The greatest speed of the shaft (rad/s); None where there is none."""
        return None


class NoMotor(AbstractMotor):
    """No motor: the machine runs freely. Its torque is zero at every speed."""

    def torque(self, speed):
        return jnp.zeros_like(speed)


class ConstantTorque(AbstractMotor):
    """A motor that gives the torque `value` (N m) at every speed. Raises `ValueError` unless it is finite."""

    value: Array = eqx.field(converter=as_float)

    def __check_init__(self):
        value = known(self.value)
        if value is not None and not np.all(np.isfinite(value)):
            raise ValueError(f"the torque of a constant-torque motor is {value}; write a finite number, in N m")

    def torque(self, speed):
        return jnp.broadcast_to(self.value, jnp.shape(speed))


class LineMotor(AbstractMotor):
    """A motor whose torque is a straight line over its speed: through two `points`, each (speed in rad/s, torque in
    N m), or from the stall torque `stall` (N m) to the speed `no_load` (rad/s) without load.

    A line describes an induction motor near its rated speed (Shigley, Mechanical Engineering Design, ch. 16), or a
    motor with permanent magnets. Raises `ValueError` unless it is given in one of the two ways, with two different
    speeds.
    """

    points: tuple[tuple[Array, ...], ...] | None = eqx.field(
        converter=lambda points: None if points is None else tuple(numbers(point) for point in points), default=None
    )
    no_load: Array | None = eqx.field(converter=as_float, default=None)
    stall: Array | None = eqx.field(converter=as_float, default=None)

    def __check_init__(self):
        ends, remedy = (self.no_load, self.stall), "give two points (speed, torque), or no_load and stall"
        given = [end for end in ends if end is not None]
        if (self.points is None) != (len(given) == 2) or len(given) == 1:
            raise ValueError(f"a line motor has points, or no_load and stall; {remedy}")
        if self.points is None:
            check_numbers("a line motor", {"no_load": self.no_load, "stall": self.stall})
            return
        if len(self.points) != 2 or any(len(point) != 2 for point in self.points):
            raise ValueError(f"the points of a line motor are not two pairs; {remedy}")
        values = [known(number) for point in self.points for number in point]
        if any(value is not None and not np.all(np.isfinite(value)) for value in values):
            raise ValueError("a point of a line motor is not finite; write finite speeds and torques")
        if values[0] is not None and values[2] is not None and np.any(values[0] == values[2]):
            raise ValueError(f"both points of a line motor have the speed {of_speed(values[0])}; write two speeds")

    def torque(self, speed):
        if self.points is None:
            assert self.stall is not None and self.no_load is not None
            return self.stall * (1 - speed / self.no_load)
        (w0, t0), (w1, t1) = self.points
        return t0 + (t1 - t0) * ((speed - w0) / (w1 - w0))

    def no_load_speed(self):
        if self.points is None:
            return self.no_load
        (w0, t0), (w1, t1) = self.points
        return w0 + safe_divide(t0 * (w1 - w0), t0 - t1, jnp.inf)


class TableMotor(AbstractMotor):
    """A motor given by a table: `torques` (N m) at increasing shaft `speeds` (rad/s), two or more.

    Between them the torque is the monotone cubic interpolant, which has no extremes of its own. Below the first and
    above the last speed it continues as a straight line with the slope at that end, so that a motor whose table ends
    near its speed without load brakes above it. Raises `ValueError` unless there are as many torques as speeds, and the
    speeds increase. Source: F. N. Fritsch, R. E. Carlson, SIAM J. Numer. Anal. 17 (1980) 238-246.
    """

    speeds: tuple[Array, ...] = eqx.field(converter=numbers)
    torques: tuple[Array, ...] = eqx.field(converter=numbers)

    def __check_init__(self):
        count = len(self.speeds)
        if count < 2 or len(self.torques) != count:
            problem = f"a table motor has {count} speeds and {len(self.torques)} torques"
            raise ValueError(f"{problem}; write two or more speeds and a torque for each")
        values = [known(number) for number in (*self.speeds, *self.torques)]
        if any(value is None for value in values):
            return
        if not np.all(np.isfinite(np.asarray(values))):
            raise ValueError("a number of a table motor is not finite; write finite speeds and torques")
        if np.any(np.diff(np.asarray(values[:count]), axis=0) <= 0):
            raise ValueError(f"the speeds of a table motor do not increase: {self.speeds}; write them in order")

    def torque(self, speed):
        knots, values = jnp.stack(self.speeds), jnp.stack(self.torques)
        low, high = self._end_slopes(knots, values)
        inside = jnp.minimum(jnp.maximum(speed, knots[0]), knots[-1])
        beyond = low * jnp.minimum(speed - knots[0], 0.0) + high * jnp.maximum(speed - knots[-1], 0.0)
        return interpolate(inside, knots, values, "cubic") + beyond

    @staticmethod
    def _end_slopes(knots: Array, values: Array) -> list[Array]:
        """The slopes at the two ends of the interpolant: the difference formula of four points is exact for its cubic
        end pieces."""
        weights = jnp.asarray([-11.0, 18.0, -9.0, 2.0]) / 6
        found = []
        for end, other in ((0, 1), (-1, -2)):
            step = (knots[other] - knots[end]) / 3
            at = knots[end] + step * jnp.arange(4.0)
            found.append(jnp.sum(weights * interpolate(at, knots, values, "cubic")) / step)
        return found

    def knots(self):
        return self.speeds


class DCMotor(AbstractMotor):
    """A DC motor with separate or permanent excitation: T = k (U - k ω) / R.

    `voltage` U of the armature (V), its `resistance` R (ohm) and the `constant` k (V s, or N m/A). The current is
    T / k; that of the rating plate, `rated_current` (A), gives the rated torque. Raises `ValueError` unless all are
    above zero.
    Source: A. E. Fitzgerald, C. Kingsley, S. D. Umans, Electric Machinery, ch. 7.
    """

    voltage: Array = eqx.field(converter=as_float)
    resistance: Array = eqx.field(converter=as_float)
    constant: Array = eqx.field(converter=as_float)
    rated_current: Array | None = eqx.field(converter=as_float, default=None)

    def __check_init__(self):
        names = ("voltage", "resistance", "constant", "rated_current")
        check_numbers("a DC motor", {name: getattr(self, name) for name in names})

    @classmethod
    def rated(cls, voltage: Any, resistance: Any, current: Any, speed: Any) -> DCMotor:
        """The motor of a rating plate: rated voltage (V), resistance of the armature (ohm), rated current (A) and rated
        speed (rad/s); k = (U - R I) / ω. Raises `ValueError` if the resistance alone takes up the voltage."""
        voltage, resistance, current, speed = (as_float(value) for value in (voltage, resistance, current, speed))
        check_numbers("a DC motor", {"rated speed": speed, "rated current": current, "resistance": resistance})
        left = known(voltage - resistance * current)
        if left is not None and not np.all(left > 0):
            problem = f"resistance times rated current leaves {left} V of the voltage of a DC motor"
            raise ValueError(f"{problem}; write a smaller resistance or current")
        return cls(voltage, resistance, (voltage - resistance * current) / speed, current)

    def current(self, speed: Array) -> Array:
        """Current of the armature (A) at shaft speeds (rad/s)."""
        return (self.voltage - self.constant * speed) / self.resistance

    def torque(self, speed):
        return self.constant * self.current(speed)

    def no_load_speed(self):
        return self.voltage / self.constant

    def rated_torque(self):
        return None if self.rated_current is None else self.constant * self.rated_current
