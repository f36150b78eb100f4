"""Couplings of constant ratio: two gears in mesh, or a belt (chain, cable) around two pulleys.

Source: any text on machine elements, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 7 (gears), and
Shigley, Mechanical Engineering Design, ch. 13 (tooth forces) and 17 (belts).
"""

from __future__ import annotations

import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._types import as_float, known
from linkjax._vec import Vec
from linkjax.groups._base import Margin, Wrench

PRESSURE = math.radians(20.0)
MOST = 100000  # teeth


def check_pressure(kind: str, angle: Array) -> None:
    """Raise ValueError for an invalid pressure angle."""
    value = known(angle)
    if value is not None and not ((value >= 0) & (value < math.radians(60))).all():
        raise ValueError(f"pressure angle of a {kind} must be from 0 to 60 degrees, but is {value} rad")


def push(size: Array, angle: Array) -> Array:
    """The separating force of two gears for the tangential force `size`, for either loaded flank."""
    return jnp.abs(size) * jnp.tan(angle)


def _whole(teeth: Any) -> Any:
    """Numbers of teeth as Python integers, where they are NumPy integers."""
    if not isinstance(teeth, tuple | list):
        return teeth
    return tuple(int(n) if isinstance(n, np.integer) else n for n in teeth)


class Teeth(eqx.Module):
    """Two gears in mesh: `teeth` of the gear itself and of the other one.

    Only their ratio matters: the pitch circles follow from the centre distance. With `internal` the smaller gear runs
    inside the larger one. `pressure_angle` (rad) is that of the line of action. Raises `ValueError` unless the numbers
    of teeth are positive integers, and for an internal pair with equal numbers of teeth.
    """

    teeth: tuple[int, int] = eqx.field(static=True, converter=_whole)
    internal: bool = eqx.field(static=True, default=False)
    pressure_angle: Array = eqx.field(converter=as_float, default=PRESSURE)

    def __check_init__(self):
        pair = isinstance(self.teeth, tuple) and len(self.teeth) == 2
        if not pair or any(isinstance(n, bool) or not isinstance(n, int) or not 0 < n <= MOST for n in self.teeth):
            problem = f"must be two integers from 1 to {MOST}, but are {self.teeth!r}"
            raise ValueError(f"teeth of the gear and of the other {problem}")
        check_pressure("gear", self.pressure_angle)
        if self.internal and self.teeth[0] == self.teeth[1]:
            raise ValueError(f"two gears of an internal pair must differ in size, but have {self.teeth[0]} teeth each")

    def ratio(self) -> Array:
        """Turns of the gear per turn of the other, relative to the link that carries both."""
        return as_float((1 if self.internal else -1) * self.teeth[1] / self.teeth[0])

    def faster(self) -> int:
        """How many times as fast as the slower gear the faster one turns, rounded up."""
        return -(-max(self.teeth) // min(self.teeth))

    def turned_round(self) -> Teeth:
        """The same mesh, as that of the other gear."""
        return Teeth((self.teeth[1], self.teeth[0]), self.internal, self.pressure_angle)

    def radii(self, apart: float) -> tuple[float, float]:
        """Pitch radii of the gear and of the other one (m), from the distance of their axes."""
        mine, other = self.teeth
        whole = abs(mine - other) if self.internal else mine + other
        return apart * mine / whole, apart * other / whole

    def apart(self, span: Vec) -> Margin:
        """Positive unless the axes coincide: pitch circles exist for any other centre distance."""
        gap = jnp.where(span.squared() > 0, 1.0, -1.0).astype(span.x.dtype)
        return Margin(gap, jnp.zeros_like(gap), jnp.zeros_like(gap))

    def exerted(self, span: Vec, moment: Array) -> Wrench:
        """Force on the gear, and the required moment about its axis; `span` goes from its axis to that of the other.
        Friction between the teeth is neglected."""
        to_pitch = 1 / (1 - self.ratio())  # pitch point = where both have the same velocity
        radius = safe_sqrt(span.squared()) * to_pitch
        along = span * safe_divide(jnp.ones_like(radius), safe_sqrt(span.squared()))
        pull = safe_divide(moment, radius)
        away = push(pull, self.pressure_angle) * (1.0 if self.internal else -1.0)
        return Wrench(along.perp() * pull + along * away, moment)


class Belt(eqx.Module):
    """A belt, chain or cable around two pulleys: `radius` of the pulley itself, and of the `other` one (m).

    A `crossed` belt turns them in opposite senses. `tension` (N) is that of the slack strand. The belt does not slip
    or stretch and has no mass. Raises `ValueError` for radii that are not positive, and for a negative tension.
    """

    radius: Array = eqx.field(converter=as_float)
    other: Array = eqx.field(converter=as_float)
    crossed: bool = eqx.field(static=True, default=False)
    tension: Array = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        for name in ("radius", "other"):
            value = known(getattr(self, name))
            if value is not None and not (value > 0).all():
                raise ValueError(f"{name} of a belt must be above zero, but is {value} m")
        slack = known(self.tension)
        if slack is not None and not (slack >= 0).all():
            raise ValueError(f"tension of the slack strand of a belt must not be negative, but is {slack} N")

    def ratio(self) -> Array:
        """Turns of the pulley per turn of the other, relative to the link that carries both."""
        return (-1.0 if self.crossed else 1.0) * self.other / self.radius

    def faster(self) -> int:
        """One: the radii are design variables."""
        return 1

    def turned_round(self) -> Belt:
        """The same belt, as that of the other pulley."""
        return Belt(self.other, self.radius, self.crossed, self.tension)

    def radii(self, apart: float) -> tuple[float, float]:
        """Radii of the pulley and of the other one (m), for any distance of their axes."""
        return float(self.radius), float(self.other)

    def _slope(self, span: Vec) -> Array:
        """Sine of the angle between the strands and the line of centres."""
        against = self.radius + self.other if self.crossed else self.radius - self.other
        return safe_divide(against, safe_sqrt(span.squared()), 2.0)

    def apart(self, span: Vec) -> Margin:
        """Negative where the pulleys are too close to each other for strands between them."""
        gap = 1 - jnp.abs(self._slope(span))
        return Margin(gap, jnp.zeros_like(gap), jnp.zeros_like(gap))

    def exerted(self, span: Vec, moment: Array) -> Wrench:
        """Force on the pulley, and the required moment about its axis; `span` goes from its axis to that of the
        other."""
        c = span * safe_divide(jnp.ones_like(moment), safe_sqrt(span.squared()))
        sine = self._slope(span)
        cosine, difference = safe_sqrt(1 - sine * sine), moment / self.radius
        left = self.tension + jnp.maximum(-difference, 0.0)  # the strand on the left of the line of centres
        right = self.tension + jnp.maximum(difference, 0.0)
        return Wrench(c * ((left + right) * cosine) + c.perp() * ((right - left) * sine), moment)


Mesh = Teeth | Belt
