"""Motion laws: the prescribed motion of a driver that does not simply rotate.

The crank angle φ is then the phase of the law and increases uniformly in time: one turn is one cycle of the driver.
"""

from __future__ import annotations

import abc
import math
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import once, sincos, wrapped
from linkjax._types import as_float

Rotation = Literal["ccw", "cw"]
SENSES = {"ccw": 1, "cw": -1}


class Moved(NamedTuple):
    """The coordinate (rad or m) at a crank angle, and its first and second derivatives with respect to that angle."""

    value: Array
    d: Array
    dd: Array


class Stops(NamedTuple):
    """Where a law stands still between two moves: the crank angles (rad) at which it stops and at which it goes on, one
    for each stop, and a distance from both at which it moves (rad)."""

    begin: Array
    end: Array
    near: Array


class AbstractLaw(eqx.Module):
    """A coordinate of the driver, an angle (rad) or a distance (m), as a periodic function of the crank angle."""

    @abc.abstractmethod
    def at(self, phi: Array) -> Moved:
        """The coordinate at the crank angle `phi` (rad), with its derivatives."""

    def begins(self) -> float:
        """The coordinate at crank angle zero, the position of a sketch."""
        return float(self.at(jnp.zeros(()))[0])

    def period(self) -> float:
        """Crank angle (rad) after which the motion repeats."""
        return 2 * math.pi

    def breaks(self) -> tuple[Any, ...]:
        """Crank angles (rad) of one period where a derivative jumps: numbers, or arrays where they follow from the
        design."""
        return ()

    def every_break(self, cycle: float) -> tuple[Array, ...]:
        """The breaks of all periods in a cycle (rad)."""
        times = range(round(cycle / self.period()))
        return tuple(jnp.asarray(angle + k * self.period(), float) for k in times for angle in self.breaks())

    def stops(self) -> Stops | None:
        """Where it stands still between two moves, in one period; None if it has no moves."""
        return None

    def every_stop(self, cycle: float) -> Stops | None:
        """The stops of all periods in a cycle (rad)."""
        once = self.stops()
        if once is None:
            return None
        times = round(cycle / self.period())
        begin, end, near = (jnp.tile(part, times) for part in once)
        later = jnp.asarray(np.repeat(np.arange(times) * self.period(), once.begin.size), begin.dtype)
        return Stops(begin + later, end + later, near)

    def rests(self) -> bool:
        """Whether the coordinate rests over a range of crank angles."""
        return False

    def jumps(self) -> bool:
        """Whether the acceleration jumps at a break, so that values there are one-sided limits."""
        return False


def check_law(law: object, drawn: bool = False) -> None:
    """Raise `TypeError` for anything but a motion law, and `ValueError` for one without a start unless a sketch can
    give it (`drawn`)."""
    if law is not None and not isinstance(law, AbstractLaw):
        raise TypeError(f"a motion law must be a Harmonic, a Spline or Moves, but is {law!r}")
    if isinstance(law, Harmonic) and law.start is None and not drawn:
        raise ValueError("a harmonic law needs a start, except in the drive of a drawn linkage; set `start`")


def check_rotation(what: str, rotation: object, law: AbstractLaw | None) -> None:
    """Raise `ValueError` for a rotation that is neither "ccw" nor "cw", and for "cw" together with a motion law."""
    if rotation not in SENSES:
        raise ValueError(f'rotation of a {what} must be "ccw" (counter-clockwise) or "cw", but is {rotation!r}')
    if law is not None and rotation != "ccw":
        raise ValueError(f"a {what} that follows a motion law takes its sense from the law; omit rotation")


class Harmonic(AbstractLaw):
    """Cosine motion between `start`, at crank angle zero, and `stop`, half a turn later, and back. In the drive of a
    `linkage` the start may be None: the sketch then gives it."""

    start: Array | None = eqx.field(converter=as_float)
    stop: Array = eqx.field(converter=as_float)

    def at(self, phi):
        assert self.start is not None  # see `check_law`
        sine, cosine = sincos(phi)
        half = 0.5 * (self.stop - self.start)
        return Moved(self.start + half * (1 - cosine), half * sine, half * cosine)


class Spline(AbstractLaw):
    """Periodic cubic spline through `values` at the crank angles `angles` (rad, increasing, within one cycle); smooth
    up to the acceleration.

    `cycle` is the crank angle (rad) after which it repeats. Raises `ValueError` unless there are at least three angles,
    as many values as angles, and the angles increase within one cycle.
    Source: C. de Boor, A Practical Guide to Splines, 1978, ch. IV.
    """

    angles: tuple[float, ...] = eqx.field(static=True, converter=lambda angles: tuple(float(a) for a in angles))
    values: tuple[Array, ...] = eqx.field(converter=lambda values: tuple(as_float(value) for value in values))
    cycle: float = eqx.field(static=True, default=2 * math.pi)

    def __check_init__(self):
        steps = np.diff([*self.angles, self.angles[0] + self.cycle] if self.angles else [])
        if len(self.angles) < 3 or np.any(steps <= 0):
            raise ValueError(
                f"a spline needs three or more angles that increase within one cycle of {self.cycle:.6g} rad, but has "
                f"{self.angles}; omit the last if it repeats the first"
            )
        if len(self.values) != len(self.angles):
            raise ValueError(
                f"a spline needs a value at each of its {len(self.angles)} angles, but has {len(self.values)}"
            )

    def period(self):
        return self.cycle

    def breaks(self):
        return self.angles

    def at(self, phi):
        first, count = self.angles[0], len(self.angles)
        steps = np.diff([*self.angles, first + self.cycle])
        values = jnp.stack(self.values)
        bends = jnp.asarray(_bends(steps)) @ values  # second derivatives at the knots
        knots, x = jnp.asarray(self.angles), wrapped(phi - first, self.cycle) + first
        i = jnp.clip(jnp.searchsorted(knots, x, side="right") - 1, 0, count - 1)
        j, h = (i + 1) % count, jnp.asarray(steps)[i]
        t = once(x - knots[i])
        y, y1, m, m1 = values[i], values[j], bends[i], bends[j]
        slope, third = (y1 - y) / h - h * (2 * m + m1) / 6, (m1 - m) / h
        return Moved(y + t * (slope + t * (m / 2 + t * third / 6)), slope + t * (m + t * third / 2), m + t * third)


def _bends(steps: np.ndarray) -> np.ndarray:
    """The matrix from the values of a periodic cubic spline to its second derivatives at the knots."""
    n = len(steps)
    system, right = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        before, after = steps[i - 1], steps[i]
        for row, at, part in ((system, i - 1, before / 6), (system, i, (before + after) / 3)):
            row[i, at] += part
        system[i, (i + 1) % n] += after / 6
        right[i, i - 1] += 1 / before
        right[i, i] -= 1 / before + 1 / after
        right[i, (i + 1) % n] += 1 / after
    return np.linalg.solve(system, right)
