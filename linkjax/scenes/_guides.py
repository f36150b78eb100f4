"""What the groups in a scene file share: their interface, straight guides, and motion laws of a driver."""

from __future__ import annotations

import abc
import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, ClassVar

from pydantic import Field

from linkjax import groups
from linkjax._units import nearest
from linkjax.mechanism import StructureError
from linkjax.scenes._fields import SMALLEST, Angle, Length, Name, Quantity, Ratio, Table

Turned = Annotated[float, Quantity("angle", "positive")]
Fault = tuple[tuple[str | int, ...], str, str]
"""An error: path of the key, problem, remedy."""


def in_angle(value: Any) -> str:
    """An angle as written in a scene file, to the last bit."""
    return f"{float(value)!r} rad"


def in_length(value: Any) -> str:
    """A length as written in a scene file, to the last bit; zero where it is smaller than a file may hold."""
    return f"{0.0 if abs(number := float(value)) <= SMALLEST else number!r} m"


class GroupTable(Table, abc.ABC):
    """A group of any kind."""

    drives: ClassVar[bool] = False  # whether it is a driver
    has_shaft: ClassVar[bool] = False  # whether it is a driver on a shaft that can carry a flywheel

    @abc.abstractmethod
    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        """The group itself; `rotation` is the sense of the crank."""

    @staticmethod
    @abc.abstractmethod
    def keys_of(group: Any) -> dict[str, Any]:
        """The keys, except `kind`, that build this group."""

    @abc.abstractmethod
    def pins(self) -> tuple[str, ...]:
        """Names of the pins that it introduces."""

    @abc.abstractmethod
    def bars(self) -> tuple[str, ...]:
        """Links that need a length."""

    def follows(self) -> bool:
        """Whether its drive follows a motion law."""
        return False

    def sliding(self) -> tuple[str, ...]:
        """Sliders: links without length."""
        return ()

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        """Other errors, given the points of the frame."""
        yield from ()


class Guide(Table):
    """A straight guide on the frame or on a link."""

    on: Name = Field("frame", description="the link that carries it", examples=["lever"])
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


class MoveTable(Table):
    """A move of a motion law to a value over a crank angle."""

    over: Turned | None = Field(
        None, description="crank angle over which it moves; the last move takes the rest", examples=["120 deg"]
    )
    shape: groups.Shape = Field("3-4-5", description="shape of the move", examples=["modified_sine"])
    ramp: Ratio | None = Field(
        None, description="with trapezoidal: part of the angle in which the speed increases", examples=[0.25]
    )

    def build(self) -> groups.Move:
        return groups.Move(getattr(self, "to", None), self.over, self.shape, self.ramp)


class AngleMove(MoveTable):
    """A move of a crank."""

    to: Angle | None = Field(None, description="angle at its end", examples=["60 deg"])


class LengthMove(MoveTable):
    """A move of a slider."""

    to: Length | None = Field(None, description="distance at its end", examples=["80 mm"])


class LawTable(Table):
    """A motion law: an oscillation between two values, a spline through given values, or a sequence of moves."""

    angles: list[Angle] | None = Field(
        None, description="crank angles of the values", examples=[["0 deg", "120 deg", "240 deg"]]
    )

    cycle: Angle | None = Field(None, description="period of spline or moves in crank angle", examples=["720 deg"])

    def build(self) -> groups.AbstractLaw:
        start, stop, values, moves = (getattr(self, key) for key in ("start", "stop", "values", "moves"))
        if moves is not None:
            return groups.Moves(start, [move.build() for move in moves], self.period())
        if self.angles is None:
            return groups.Harmonic(start, stop)
        return groups.Spline(tuple(self.angles), values, self.period())

    def period(self) -> float:
        """Its period in crank angle."""
        return 2 * math.pi if self.cycle is None else self.cycle

    def faults(self, path: tuple[str | int, ...], drawn: bool = False) -> Iterator[Fault]:
        """The errors. In a `drawn` machine the start may be omitted: it then follows from the sketch."""
        ends, spline = ("start", "stop"), ("angles", "values")
        moves = ("start", "moves")
        given = [key for key in (*ends, *spline, "moves") if getattr(self, key) is not None]
        if set(given) not in (set(ends), set(spline), set(moves), {"stop"} if drawn else set(ends)):
            problem = f"has {' and '.join(given) or 'no key'}, but a law has start and stop, or angles and values"
            yield (
                path,
                f"{problem}, or start and moves",
                "write the two ends of the motion, or crank angles and the values there",
            )
        elif "moves" in given:
            try:
                self.build()
            except ValueError as error:
                problem, _, remedy = str(error).partition("; ")
                yield (*path, "moves"), problem, remedy
        elif self.angles is None:
            if getattr(self, "start", None) == getattr(self, "stop", None):
                yield (*path, "stop"), "the same as start, so nothing moves", "write the other end of the motion"
            if self.cycle is not None:
                yield (
                    (*path, "cycle"),
                    "has no effect: the motion from start to stop and back takes one turn",
                    "delete cycle",
                )
        else:
            count, steps = len(self.angles), [b - a for a, b in itertools.pairwise(self.angles)]
            if count < 3 or min(steps) <= 0 or self.angles[-1] - self.angles[0] >= self.period() - 1e-9:
                problem = "must be three or more angles that increase within one cycle of the law"
                yield (*path, "angles"), problem, "omit the last angle if it repeats the first"
            values = len(getattr(self, "values", ()))
            if values != count:
                problem = f"{values} values at {count} angles"
                yield (*path, "values"), problem, "write one value for each angle"
            elif len(set(getattr(self, "values", ()))) == 1:
                yield (*path, "values"), "all the same, so nothing moves", "write values that differ"


class AngleLaw(LawTable):
    """A motion law of a crank."""

    start: Angle | None = Field(None, description="angle at crank angle zero", examples=["20 deg"])
    moves: list[AngleMove] | None = Field(
        None, description="moves, one after the other",
        examples=[[{"to": "60 deg", "over": "120 deg"}, {"over": "60 deg", "shape": "dwell"}, {"shape": "3-4-5"}]],
    )  # fmt: skip
    stop: Angle | None = Field(None, description="angle half a turn later", examples=["140 deg"])
    values: list[Angle] | None = Field(
        None, description="the angles of the crank", examples=[["20 deg", "140 deg", "80 deg"]]
    )


class LengthLaw(LawTable):
    """A motion law of a slider."""

    start: Length | None = Field(None, description="distance at crank angle zero", examples=["0 mm"])
    moves: list[LengthMove] | None = Field(
        None, description="moves, one after the other",
        examples=[[{"to": "80 mm", "over": "120 deg"}, {"over": "60 deg", "shape": "dwell"}, {"shape": "3-4-5"}]],
    )  # fmt: skip
    stop: Length | None = Field(None, description="distance half a turn later", examples=["120 mm"])
    values: list[Length] | None = Field(
        None, description="the distances along the guide", examples=[["0 mm", "120 mm", "60 mm"]]
    )


def law_keys(law: groups.AbstractLaw, write: Callable[[Any], str]) -> dict[str, Any]:
    """The keys of a law; raises `StructureError` for a kind that scene files do not support."""
    if isinstance(law, groups.Harmonic):
        return {"start": write(law.start), "stop": write(law.stop)}
    if isinstance(law, groups.Spline):
        angles = [in_angle(angle) for angle in law.angles]
        cycle = {} if law.cycle == 2 * math.pi else {"cycle": in_angle(law.cycle)}
        return {"angles": angles, "values": [write(value) for value in law.values], **cycle}
    if isinstance(law, groups.Moves):
        cycle = {} if law.cycle == 2 * math.pi else {"cycle": in_angle(law.cycle)}
        return {"start": write(law.start), "moves": [_move_keys(move, write) for move in law.moves], **cycle}
    kind = type(law).__name__
    raise StructureError("law", f"scene files do not support laws of the kind {kind}",
                         "write a Harmonic, a Spline or Moves")  # fmt: skip


def _move_keys(move: groups.Move, write: Callable[[Any], str]) -> dict[str, Any]:
    """The keys of a move."""
    given = {"to": None if move.to is None else write(move.to)}
    given["over"] = None if move.over is None else in_angle(move.over)
    ramp = {} if move.ramp is None else {"ramp": float(move.ramp)}
    return {key: value for key, value in given.items() if value is not None} | {"shape": move.shape} | ramp
