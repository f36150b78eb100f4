"""What the groups in a scene file share: what each must answer, straight guides, and laws of motion of a driver."""

from __future__ import annotations

import abc
import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pydantic import Field

from linkjax import groups
from linkjax._units import nearest
from linkjax.mechanism import StructureError
from linkjax.scenes._fields import SMALLEST, Angle, Length, Name, Table

Fault = tuple[tuple[str | int, ...], str, str]
"""Something wrong: path of the key, problem, remedy."""


def in_angle(value: Any) -> str:
    """An angle as a scene file writes it, to the last bit."""
    return f"{float(value)!r} rad"


def in_length(value: Any) -> str:
    """A length as a scene file writes it, to the last bit; as zero where it is smaller than a file can hold."""
    return f"{0.0 if abs(number := float(value)) <= SMALLEST else number!r} m"


class GroupTable(Table, abc.ABC):
    """A group of any kind."""

    @abc.abstractmethod
    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        """The group itself; `rotation` is the sense of the crank."""

    @staticmethod
    @abc.abstractmethod
    def keys_of(group: Any) -> dict[str, Any]:
        """The keys, but for `kind`, that build such a group."""

    @abc.abstractmethod
    def pins(self) -> tuple[str, ...]:
        """Names of the pins it brings in."""

    @abc.abstractmethod
    def bars(self) -> tuple[str, ...]:
        """Links that need a length."""

    def sliding(self) -> tuple[str, ...]:
        """Links that slide and have no length."""
        return ()

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        """What else is wrong, given the points of the frame."""
        yield from ()


class Guide(Table):
    """A straight guide, of the frame or of a link."""

    on: Name = Field("frame", description="the link that it is on", examples=["lever"])
    through: Name = Field(description="a point of that link, or a fixed point", examples=["A"])
    along: Angle = Field(0.0, description="direction of the guide, from the axis of its link", examples=["90 deg"])
    offset: Length = Field(0.0, description="shift of the pin's path to the left of that direction", examples=["10 mm"])

    def build(self) -> groups.Guide:
        return groups.Guide(self.through, self.along, self.offset, self.on)

    @staticmethod
    def keys_of(guide: groups.Guide) -> dict[str, Any]:
        on = {} if guide.on == "frame" else {"on": guide.on}
        return {**on, "through": guide.through, "along": in_angle(guide.along), "offset": in_length(guide.offset)}

    def faults(self, path: tuple[str | int, ...], fixed: Mapping[str, Any]) -> Iterator[Fault]:
        if self.on == "frame" and self.through not in fixed:
            problem = f"{self.through!r} is not a point of the frame"
            yield (*path, "through"), problem, nearest(self.through, fixed)


class LawTable(Table):
    """A law of motion: to and fro between two values, or a spline through many."""

    angles: list[Angle] | None = Field(
        None, description="crank angles at which values are given", examples=[["0 deg", "120 deg", "240 deg"]]
    )

    cycle: Angle | None = Field(None, description="crank angle after which a spline repeats", examples=["720 deg"])

    def build(self) -> groups.AbstractLaw:
        start, stop, values = (getattr(self, key) for key in ("start", "stop", "values"))
        if self.angles is None:
            return groups.Harmonic(start, stop)
        return groups.Spline(tuple(self.angles), values, self.period())

    def period(self) -> float:
        """Crank angle after which it repeats."""
        return 2 * math.pi if self.cycle is None else self.cycle

    def faults(self, path: tuple[str | int, ...], drawn: bool = False) -> Iterator[Fault]:
        """What does not fit together. Where the machine is `drawn` the start may be left to the sketch."""
        ends, spline = ("start", "stop"), ("angles", "values")
        given = [key for key in (*ends, *spline) if getattr(self, key) is not None]
        if set(given) not in (set(ends), set(spline), {"stop"} if drawn else set(ends)):
            problem = f"has {' and '.join(given) or 'no key'}, but a law has start and stop, or angles and values"
            yield path, problem, "write the two ends of its motion, or crank angles and the values there"
        elif self.angles is None:
            if getattr(self, "start", None) == getattr(self, "stop", None):
                yield (*path, "stop"), "the same as start, so that nothing moves", "write the other end of its motion"
            if self.cycle is not None:
                yield (*path, "cycle"), "has no effect: from start to stop and back takes a turn", "delete cycle"
        else:
            count, steps = len(self.angles), [b - a for a, b in itertools.pairwise(self.angles)]
            if count < 3 or min(steps) <= 0 or self.angles[-1] - self.angles[0] >= self.period() - 1e-9:
                problem = "must be three or more, and rise within one cycle of the law"
                yield (*path, "angles"), problem, "leave out the last where it repeats the first"
            values = len(getattr(self, "values", ()))
            if values != count:
                problem = f"{values} values at {count} angles"
                yield (*path, "values"), problem, "write one value for each angle"
            elif len(set(getattr(self, "values", ()))) == 1:
                yield (*path, "values"), "all the same, so that nothing moves", "write values that differ"


class AngleLaw(LawTable):
    """A law of motion for a crank."""

    start: Angle | None = Field(None, description="angle at crank angle zero", examples=["20 deg"])
    stop: Angle | None = Field(None, description="angle half a turn later", examples=["140 deg"])
    values: list[Angle] | None = Field(None, description="angles there", examples=[["20 deg", "140 deg", "80 deg"]])


class LengthLaw(LawTable):
    """A law of motion for a slide."""

    start: Length | None = Field(None, description="distance at crank angle zero", examples=["0 mm"])
    stop: Length | None = Field(None, description="distance half a turn later", examples=["120 mm"])
    values: list[Length] | None = Field(None, description="distances there", examples=[["0 mm", "120 mm", "60 mm"]])


def law_keys(law: groups.AbstractLaw, write: Callable[[Any], str]) -> dict[str, Any]:
    """The keys of a law; raises `StructureError` for one that scene files do not know."""
    if isinstance(law, groups.Harmonic):
        return {"start": write(law.start), "stop": write(law.stop)}
    if isinstance(law, groups.Spline):
        angles = [in_angle(angle) for angle in law.angles]
        cycle = {} if law.cycle == 2 * math.pi else {"cycle": in_angle(law.cycle)}
        return {"angles": angles, "values": [write(value) for value in law.values], **cycle}
    kind = type(law).__name__
    raise StructureError("law", f"scene files know no law of the kind {kind}", "write a Harmonic or a Spline")
