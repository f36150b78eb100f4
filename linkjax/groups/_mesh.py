"""What couples two wheels in a constant ratio: teeth in mesh, or a belt (chain, cable) round both.

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
    """Raise ValueError for a pressure angle that is none."""
    value = known(angle)
    if value is not None and not ((value >= 0) & (value < math.radians(60))).all():
        raise ValueError(f"pressure angle of a {kind} must be from 0 to 60 degrees, but is {value} rad")


def push(size: Array, angle: Array) -> Array:
    """What presses two toothed wheels apart while they carry a tangential force, whichever flank is loaded."""
    return jnp.abs(size) * jnp.tan(angle)


def _whole(teeth: Any) -> Any:
    """Numbers of teeth as Python's, where they are whole numbers of NumPy."""
    if not isinstance(teeth, tuple | list):
        return teeth
    return tuple(int(n) if isinstance(n, np.integer) else n for n in teeth)


class Teeth(eqx.Module):
    """Two toothed wheels in mesh: `teeth` of the wheel itself and of the other one.

    Only their ratio counts: the pitch circles follow from the distance of the axes. `internal` says that the smaller one
    runs inside the larger. `pressure_angle` (rad) is that of the line of action. Raises `ValueError` for numbers of
    teeth that are no whole numbers above zero, and for two equal ones of which one is inside the other.
    """

    teeth: tuple[int, int] = eqx.field(static=True, converter=_whole)
    internal: bool = eqx.field(static=True, default=False)
    pressure_angle: Array = eqx.field(converter=as_float, default=PRESSURE)

    def __check_init__(self):
        pair = isinstance(self.teeth, tuple) and len(self.teeth) == 2
        if not pair or any(isinstance(n, bool) or not isinstance(n, int) or not 0 < n <= MOST for n in self.teeth):
            told = f"must be two whole numbers, but are {self.teeth!r}"
            raise ValueError(f"teeth of the wheel and of the other {told}")
        check_pressure("wheel", self.pressure_angle)
        if self.internal and self.teeth[0] == self.teeth[1]:
            raise ValueError(f"of two wheels with {self.teeth[0]} teeth each none can run inside the other")

    def ratio(self) -> Array:
        """Turns of the wheel for one of the other, as seen from the link that carries both."""
        return as_float((1 if self.internal else -1) * self.teeth[1] / self.teeth[0])

    def turned_round(self) -> Teeth:
        """The same, seen from the other wheel."""
        return Teeth((self.teeth[1], self.teeth[0]), self.internal, self.pressure_angle)

    def apart(self, span: Vec) -> Margin:
        """How far the axes are from coinciding: pitch circles are found for any distance."""
        gap = jnp.where(span.squared() > 0, 1.0, -1.0).astype(span.x.dtype)
        return Margin(gap, jnp.zeros_like(gap), jnp.zeros_like(gap))

    def exerted(self, span: Vec, moment: Array) -> Wrench:
        """Force on the wheel, and the moment about its axis that it must have; `span` goes from its axis to that of the
        other. Friction between the teeth is left out."""
        to_pitch = 1 / (1 - self.ratio())  # pitch point = where both have the same speed
        radius = safe_sqrt(span.squared()) * to_pitch
        along = span * safe_divide(jnp.ones_like(radius), safe_sqrt(span.squared()))
        pull = safe_divide(moment, radius)
        away = push(pull, self.pressure_angle) * (1.0 if self.internal else -1.0)
        return Wrench(along.perp() * pull + along * away, moment)


class Belt(eqx.Module):
    """A belt, chain or cable round two wheels: `radius` of the wheel itself, and of the `other` one (m).

    `crossed` turns them in opposite senses. `tension` (N) is that of the slack strand. It does not slip, has no mass
    and does not stretch. Raises `ValueError` for radii that are not above zero.
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
            raise ValueError(f"the slack strand of a belt can only pull, but its tension is {slack} N")

    def ratio(self) -> Array:
        """Turns of the wheel for one of the other, as seen from the link that carries both."""
        return (-1.0 if self.crossed else 1.0) * self.other / self.radius

    def turned_round(self) -> Belt:
        """The same, seen from the other wheel."""
        return Belt(self.other, self.radius, self.crossed, self.tension)

    def _slope(self, span: Vec) -> Array:
        """Sine of the angle between strands and line of centres."""
        against = self.radius + self.other if self.crossed else self.radius - self.other
        return safe_divide(against, safe_sqrt(span.squared()), 2.0)

    def apart(self, span: Vec) -> Margin:
        """How far the wheels are from being too near to each other for strands between them."""
        gap = 1 - jnp.abs(self._slope(span))
        return Margin(gap, jnp.zeros_like(gap), jnp.zeros_like(gap))

    def exerted(self, span: Vec, moment: Array) -> Wrench:
        """Force on the wheel, and the moment about its axis that it must have; `span` goes from its axis to that of the
        other."""
        c = span * safe_divide(jnp.ones_like(moment), safe_sqrt(span.squared()))
        sine = self._slope(span)
        cosine, difference = safe_sqrt(1 - sine * sine), moment / self.radius
        left = self.tension + jnp.maximum(-difference, 0.0)  # the strand on the left of the line of centres
        right = self.tension + jnp.maximum(difference, 0.0)
        return Wrench(c * ((left + right) * cosine) + c.perp() * ((right - left) * sine), moment)


Mesh = Teeth | Belt
