"""Gas in a cylinder: an indicator diagram over the crank angle or the volume, or the cycle of a compressor.

Sources: indicator diagrams and the polytropic cycle of a reciprocating compressor with clearance, e.g. Cengel and
Boles, Thermodynamics, ch. 7 and 9; Bloch and Hoefner, Reciprocating Compressors, 1996, ch. 1.
"""

from __future__ import annotations

import abc
import math
from typing import Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._interpolate import interpolate
from linkjax._types import as_float, known
from linkjax.kinematics import Pose
from linkjax.loads._coordinate import Coordinate, seen_at, sense_of
from linkjax.loads._curve import TURN, Heights, check_knots, check_method, heights, listed, over_crank, repeated
from linkjax.loads._loads import AbstractLoad, Applied, Instant, Window
from linkjax.loads._passage import Passage
from linkjax.loads._table import along_guide

ATMOSPHERE = 101325.0  # Pa
TIGHT = 1e-3  # of the clearance: the least volume where a machine cannot be assembled


class Volumes(NamedTuple):
    """The `volume` of the gas (m³), its `least` and its `most` in the cycle, and whether it `grows`: one or minus
    one."""

    volume: Array
    least: Array
    most: Array
    grows: Array


class AbstractPressure(eqx.Module):
    """The absolute pressure of the gas (Pa), as a function of its volume or of the crank angle."""

    @property
    @abc.abstractmethod
    def by_volume(self) -> bool:
        """Whether it depends on the volume, otherwise on the crank angle."""

    @abc.abstractmethod
    def pressure(self, gas: Volumes | None, when: Instant) -> Array:
        """The pressure (Pa), from the volumes if it depends on them."""

    @abc.abstractmethod
    def check(self, what: str) -> None:
        """Raise `ValueError` for invalid numbers of the load `what`."""

    def kinks(self, cycle: float) -> tuple[Array, ...]:
        """Crank angles (rad) of a cycle of this length (rad) at which it has a kink or a jump."""
        return ()

    def volumes(self, least: Array, most: Array) -> Array:
        """Volumes (m³) at which it has a kink, from the least and the greatest of the cycle."""
        return jnp.zeros(0)

    def volume_count(self) -> int:
        """The number of these volumes."""
        return 0


class Diagram(AbstractPressure):
    """An indicator diagram: absolute pressures `values` (Pa) at crank angles `at` (rad), or with `by` = "volume" at
    volumes of the gas (m³), which include the clearance.

    Over the crank angle it repeats after `cycle_turns` turns, two for a four-stroke engine, and a value may be a pair,
    the pressures before and after a jump. Over the volume `values` hold while it grows and `coming` while it shrinks,
    by default the same; beyond the table the end values hold. `method` is "linear" or "cubic" (monotone). `Gas` raises
    `ValueError` unless there are two or more values at as many increasing numbers, none of them negative.
    """

    at: tuple[Array, ...] = eqx.field(converter=listed)
    values: Heights = eqx.field(converter=heights)
    coming: tuple[Array, ...] | None = eqx.field(converter=listed, default=None)
    by: Literal["crank", "volume"] = eqx.field(static=True, default="crank", kw_only=True)
    method: Literal["linear", "cubic"] = eqx.field(static=True, default="linear", kw_only=True)
    cycle_turns: int = eqx.field(static=True, default=1, kw_only=True)

    @property
    def by_volume(self):
        return self.by == "volume"

    @property
    def period(self) -> float:
        """Crank angle (rad) after which a diagram over the crank angle repeats."""
        return TURN * self.cycle_turns

    def check(self, what):
        check_method(what, self.method)
        if self.by not in ("crank", "volume"):
            raise ValueError(f'by of the diagram of {what} is {self.by!r}; write "crank" or "volume"')
        if not isinstance(self.cycle_turns, int) or self.cycle_turns < 1:
            raise ValueError(f"cycle_turns of {what} is {self.cycle_turns!r}; write an integer of 1 or more")
        if self.by == "crank" and self.coming is not None:
            raise ValueError(f"{what} has pressures for the way back, but its diagram is over the crank angle; delete "
                             'them, or write by = "volume"')  # fmt: skip
        if self.by_volume and any(isinstance(value, tuple) for value in self.values):
            raise ValueError(f"{what} has a jump in a diagram over the volume; write a steep part of small width")
        key, unit, width = ("volumes", "m^3", None) if self.by_volume else ("angles", "rad", self.period)
        for values in (self.values, self.coming):
            if values is not None:
                check_knots(f"{key} of {what}", self.at, values, unit, width)
        every = [part for each in (self.values, self.coming) if each for value in each
                 for part in (value if isinstance(value, tuple) else (value,))]  # fmt: skip
        for part in every:
            value = known(part)
            if value is not None and np.any(value < 0):
                raise ValueError(f"{what} has a pressure of {value} Pa; write absolute pressures, zero or more")

    def kinks(self, cycle):
        return () if self.by_volume else repeated(self.at, self.period, cycle)

    def volumes(self, least, most):
        return jnp.stack(list(self.at))

    def volume_count(self):
        return len(self.at) if self.by_volume else 0

    def pressure(self, gas, when):
        if gas is None:
            return over_crank(self.at, self.values, self.method, self.period, when)
        knots, going = jnp.stack(list(self.at)), [value for value in self.values if not isinstance(value, tuple)]
        there = interpolate(gas.volume, knots, jnp.stack(going), self.method)
        if self.coming is None:
            return there
        back = interpolate(gas.volume, knots, jnp.stack(list(self.coming)), self.method)
        return jnp.where(gas.grows > 0, there, back)


class Polytropic(AbstractPressure):
    """The cycle of a compressor with ideal valves, between the `suction` and the `discharge` pressure (Pa, absolute).

    The gas in the clearance expands from the discharge to the suction pressure, the cylinder fills at the suction
    pressure, and the gas is compressed and delivered at the discharge pressure. Expansion and compression follow
    p V^n = const., with the `exponent` n: 1 isothermal, 1.4 adiabatic for air.

    Suction begins at V₄ = V₃ (p₂/p₁)^(1/n), V₃ the clearance, and delivery at V₂ = V₁ (p₁/p₂)^(1/n), V₁ the greatest
    volume. Where V₄ exceeds V₁ nothing is delivered, and the gas expands and is compressed along one curve. `Gas`
    raises `ValueError` unless 0 < suction < discharge and the exponent is positive.
    """

    suction: Array = eqx.field(converter=as_float)
    discharge: Array = eqx.field(converter=as_float)
    exponent: Array = eqx.field(converter=as_float)

    @property
    def by_volume(self):
        return True

    def check(self, what):
        low, high, exponent = (known(each) for each in (self.suction, self.discharge, self.exponent))
        for key, value in (("suction", low), ("discharge", high), ("exponent", exponent)):
            if value is not None and not (np.all(np.isfinite(value)) and np.all(value > 0)):
                raise ValueError(f"{key} of {what} is {value}; write a number above zero")
        if low is not None and high is not None and np.any(low >= high):
            problem = f"the suction pressure of {what}, {low} Pa, is not below the discharge pressure, {high} Pa"
            raise ValueError(f"{problem}; write absolute pressures, the lower one as suction")

    def volumes(self, least, most):
        ratio = (self.discharge / self.suction) ** (1 / self.exponent)
        begun = self._begun(least, most)
        return jnp.stack([least * ratio, most * (begun / self.discharge) ** (1 / self.exponent)])

    def volume_count(self):
        return 2

    def pressure(self, gas, when):
        assert gas is not None  # it depends on the volume
        least, most, here = gas.least, gas.most, jnp.maximum(gas.volume, TIGHT * gas.least)
        expanded = jnp.maximum(self.discharge * (least / here) ** self.exponent, self.suction)
        compressed = jnp.minimum(self._begun(least, most) * (most / here) ** self.exponent, self.discharge)
        return jnp.where(gas.grows > 0, expanded, compressed)

    def _begun(self, least: Array, most: Array) -> Array:
        """The pressure at which the compression begins (Pa)."""
        return jnp.maximum(self.suction, self.discharge * (least / most) ** self.exponent)


class Gas(AbstractLoad):
    """The force of gas on a piston: a `point` of the slider `link`, on a guide of the frame.

    The piston has the area π/4 bore², with the `bore` in m, and the cylinder head is on its side `head` of the guide's
    direction, "+" or "-". The force (p - ambient) π/4 bore² acts along the guide, away from the head. `pressure` is a
    `Diagram` or a `Polytropic` cycle, in absolute pressures (Pa), as is `ambient`, the pressure on the other side of
    the piston. The volume of the gas is V = clearance + π/4 bore² x, where x is the distance of the piston from its end
    position towards the head, an extreme of its stroke for this design; so the `clearance` (m³) is the least volume.
    It is needed if the pressure depends on the volume.

    The gas also pushes the cylinder head, so the reaction acts on the frame (`reacts_on`). Raises `ValueError` unless
    bore and clearance are positive, and for invalid pressures.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    point: str = eqx.field(static=True)
    bore: Array = eqx.field(converter=as_float, kw_only=True)
    head: Literal["+", "-"] = eqx.field(static=True, kw_only=True)
    pressure: AbstractPressure = eqx.field(kw_only=True)
    clearance: Array | None = eqx.field(converter=as_float, default=None, kw_only=True)
    ambient: Array = eqx.field(converter=as_float, default=ATMOSPHERE, kw_only=True)
    window: Window | Passage | None = eqx.field(default=None, kw_only=True)
    reacts_on: Literal["frame"] | None = eqx.field(static=True, default="frame", kw_only=True)

    def __check_init__(self):
        what = f"load {self.name!r}"
        if self.head not in ("+", "-"):
            problem = f"head of {what} is {self.head!r}"
            raise ValueError(f'{problem}; write "+" if the cylinder head is ahead along the guide, "-" if it is behind')
        if not isinstance(self.pressure, AbstractPressure):
            problem = f"pressure of {what} is {self.pressure!r}"
            raise ValueError(f"{problem}; write a Diagram of pressures, or Polytropic(suction, discharge, exponent)")
        if self.pressure.by_volume and self.clearance is None:
            remedy = "write the least volume of the gas, in m³"
            raise ValueError(f"{what} has no clearance, but its pressure depends on the volume; {remedy}")
        if self.clearance is not None and not self.pressure.by_volume:
            problem = f"clearance of {what} has no effect: its pressure depends on the crank angle alone"
            raise ValueError(f"{problem}; delete it")
        for key, value in (("bore", known(self.bore)), ("clearance", known(self.clearance))):
            if value is not None and not (np.all(np.isfinite(value)) and np.all(value > 0)):
                raise ValueError(f"{key} of {what} is {value}; write a number above zero")
        ambient = known(self.ambient)
        if ambient is not None and not (np.all(np.isfinite(ambient)) and np.all(ambient >= 0)):
            raise ValueError(f"ambient of {what} is {ambient}; write an absolute pressure, zero or more")
        self.pressure.check(what)

    @property
    def area(self) -> Array:
        """Area of the piston (m²)."""
        return 0.25 * math.pi * self.bore**2

    @property
    def along(self) -> Coordinate:
        """The coordinate of the piston."""
        return Coordinate(point=self.point)

    def kinks(self, cycle):
        return self.pressure.kinks(cycle)

    def crossed(self):
        return self.along if self.pressure.by_volume else None

    def span(self):
        return self.along if self.pressure.by_volume else None

    def level_count(self):
        return self.pressure.volume_count()

    def levels(self, ends):
        assert ends is not None and self.clearance is not None  # its pressure depends on the volume
        low, high = ends
        away = (self.pressure.volumes(self.clearance, self._most(ends)) - self.clearance) / self.area
        return high - away if self.head == "+" else low + away

    def gas(self, pose: Pose, at: Instant) -> Volumes | None:
        """The volumes of the gas at an instant; None if the pressure does not depend on them. Raises `ValueError` if
        the instant does not know the extremes of the stroke."""
        if not self.pressure.by_volume:
            return None
        if at.ends is None or self.name not in at.ends:
            raise ValueError(f"the volume of the gas {self.name!r} needs the ends of the stroke of {self.point!r}; use "
                             "ReadyScene.instant(phi) of a ready scene")  # fmt: skip
        assert self.clearance is not None
        ends, seen = at.ends[self.name], seen_at(self.along, pose, at)
        away = ends[1] - seen.value if self.head == "+" else seen.value - ends[0]
        grows = sense_of(seen, at) * (-1.0 if self.head == "+" else 1.0)
        return Volumes(self.clearance + self.area * away, self.clearance, self._most(ends), grows)

    def _most(self, ends: tuple[Array, Array]) -> Array:
        """The greatest volume of the gas (m³), at the end of the stroke that is far from the head."""
        assert self.clearance is not None
        return self.clearance + self.area * (ends[1] - ends[0])

    def wrenches(self, pose, at):
        push = (self.pressure.pressure(self.gas(pose, at), at) - self.ambient) * self.area
        force = along_guide(self.point, pose, at) * (-push if self.head == "+" else push)
        return [Applied(self.link, self.point, force, jnp.zeros_like(at.phi))]
