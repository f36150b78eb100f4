"""Loads by tables and gas loads in scene files: `[[loads]]` with `kind = "table"` or `kind = "gas"`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from linkjax.loads import ATMOSPHERE, AbstractPressure, Coordinate, Diagram, Gas, Polytropic, joined_jumps
from linkjax.loads import Table as TableLoad
from linkjax.scenes._fields import (
    Angle,
    Bore,
    Exponent,
    Force,
    Length,
    Name,
    Pressure,
    Table,
    Torque,
    Turns,
    Volume,
)
from linkjax.scenes._guides import Fault
from linkjax.scenes._load import REACTS, LoadTable
from linkjax.scenes._passages import Direction, OfLink, element
from linkjax.scenes._write_tables import gas_keys, table_keys

METHOD: Any = Field("linear", description="lines between the values, or a monotone cubic", examples=["cubic"])
CYCLE_TURNS: Any = Field(
    None, description="crank turns after which a table over the crank angle repeats; default: those of the scene",
    examples=[2],
)  # fmt: skip
GIVEN = 'write angles = ["0 deg", "90 deg", ...] in increasing order, with as many values'


class OverPoint(Table):
    """The position of a point, over which a table is given."""

    point: Name = Field(description="the point whose position is the abscissa", examples=["D"])
    direction: Direction | None = Field(
        None, description="direction of the position: x, y or an angle; default: the guide's", examples=["x"]
    )


class OverLink(OfLink):
    """The angle of a link, over which a table is given."""

    link: Name = Field(description="the link whose angle is the abscissa", examples=["rocker"])


Over = Annotated[
    Annotated[Literal["crank"], Tag("#crank")]
    | Annotated[OverPoint, Tag("#point")]
    | Annotated[OverLink, Tag("#link")],
    Discriminator(element),
]


class Tabulated(LoadTable):
    """What tables of forces and of torques have in common."""

    kind: Literal["table"] = Field(description="a table", examples=["table"])
    over: Over = Field(
        "crank", description="the abscissa: the crank angle, the position of a point, or the angle of a link",
        examples=[{"point": "D"}],
    )  # fmt: skip
    angles: list[Angle] | None = Field(
        None,
        description="crank angles (or angles of the link), increasing; default: equally spaced from zero; "
        "two equal crank angles are a jump",
        examples=[["0 deg", "90 deg", "180 deg"]],
    )
    positions: list[Length] | None = Field(
        None, description="positions of the point, increasing", examples=[["10 mm", "40 mm"]]
    )
    method: Literal["linear", "cubic"] = METHOD
    cycle_turns: Turns | None = CYCLE_TURNS
    reacts_on: Literal["frame"] | None = REACTS

    def faults(self) -> Iterator[Fault]:
        over, own = self.over, self.model_fields_set
        key, other = ("positions", "angles") if isinstance(over, OverPoint) else ("angles", "positions")
        if other in own:
            named = {"angles": "crank angle or the angle of a link", "positions": "position of a point"}[other]
            yield (other,), f"has no effect: the table is not over the {named}", f"delete {other}, or change over"
        yield from _branches(self, "values", "over" in own and over != "crank")
        yield from _in_order(key, getattr(self, key), over == "crank")
        if over == "crank":
            return
        if getattr(self, key) is None:
            example = '["10 mm", "40 mm"]' if key == "positions" else '["20 deg", "70 deg"]'
            yield (key,), "missing", f"add {key} = {example}, with as many values"
        if self.cycle_turns is not None:
            yield ("cycle_turns",), "has no effect: the table is not over the crank angle", "delete it"

    def build(self, cycle_turns: int) -> TableLoad:
        going, coming = _both(self, "values")
        given: dict[str, Any] = {**self.shared(), "method": self.method, "reacts_on": self.reacts_on}
        if isinstance(self, TabulatedForce):
            given |= {"point": self.point, "direction": self.direction}
        if not isinstance(self.over, str):
            at = self.positions if isinstance(self.over, OverPoint) else self.angles
            over = Coordinate(**{key: value for key, value in self.over.model_dump().items() if value is not None})
            return TableLoad(at=at, values=going, coming=coming, over=over, **given)
        turns = self.cycle_turns or cycle_turns
        given["cycle_turns"] = turns
        at, values = _over_crank(self.angles, going, turns)
        return TableLoad(at=at, values=values, **given)

    @staticmethod
    def keys_of(load: TableLoad) -> dict[str, Any]:
        return table_keys(load)


class TabulatedForce(Tabulated):
    """A force at a point, by a table over the crank angle, the position of a point, or the angle of a link."""

    point: Name = Field(description="the point of the link where the force acts", examples=["D"])
    direction: Direction | None = Field(
        None, description="direction of a positive force: x, y or an angle; default: the guide's of the point",
        examples=["x"],
    )  # fmt: skip
    values: list[Force] | None = Field(None, description="the forces", examples=[["0 N", "2 kN", "0 N"]])
    going: list[Force] | None = Field(
        None, description="the forces while the position (or angle) increases", examples=[["0 N", "2 kN"]]
    )
    coming: list[Force] | None = Field(
        None, description="the forces while the position (or angle) decreases", examples=[["0 N", "0 N"]]
    )


class TabulatedTorque(Tabulated):
    """A torque on a link, by a table over the crank angle, the position of a point, or the angle of a link."""

    values: list[Torque] | None = Field(
        None, description="the torques, counter-clockwise positive", examples=[["0 N m", "20 N m", "0 N m"]]
    )
    going: list[Torque] | None = Field(
        None, description="the torques while the position (or angle) increases", examples=[["0 N m", "20 N m"]]
    )
    coming: list[Torque] | None = Field(
        None, description="the torques while the position (or angle) decreases", examples=[["0 N m", "0 N m"]]
    )


class GasTable(LoadTable):
    """Gas in a cylinder, on a piston: an indicator diagram over the crank angle or the volume, or a compressor."""

    kind: Literal["gas"] = Field(description="gas in a cylinder", examples=["gas"])
    link: Name = Field(description="the piston, a slider", examples=["piston"])
    point: Name = Field(description="the point of the piston where the force acts", examples=["D"])
    bore: Bore = Field(description="diameter of the cylinder", examples=["80 mm"])
    head: Literal["+", "-"] = Field(
        description="on which side of the guide's direction the cylinder head is", examples=["+"]
    )
    clearance: Volume | None = Field(None, description="the least volume of the gas", examples=["20 cm^3"])
    ambient: Pressure = Field(
        ATMOSPHERE, description="absolute pressure on the other side of the piston", examples=["1 bar"]
    )
    angles: list[Angle] | None = Field(
        None, description="crank angles of an indicator diagram; two equal ones are a jump",
        examples=[["0 deg", "90 deg", "180 deg"]],
    )  # fmt: skip
    volumes: list[Volume] | None = Field(
        None, description="volumes of an indicator diagram, the clearance included", examples=[["20 cm^3", "600 cm^3"]]
    )
    pressures: list[Pressure] | None = Field(
        None, description="absolute pressures of an indicator diagram", examples=[["1 bar", "30 bar", "1 bar"]]
    )
    going: list[Pressure] | None = Field(
        None, description="absolute pressures while the volume grows", examples=[["30 bar", "4 bar"]]
    )
    coming: list[Pressure] | None = Field(
        None, description="absolute pressures while the volume shrinks", examples=[["10 bar", "1 bar"]]
    )
    suction: Pressure | None = Field(None, description="absolute suction pressure of a compressor", examples=["1 bar"])
    discharge: Pressure | None = Field(
        None, description="absolute discharge pressure of a compressor", examples=["6 bar"]
    )
    exponent: Exponent | None = Field(
        None, description="exponent of the compression and the expansion; 1 isothermal", examples=[1.3]
    )
    method: Literal["linear", "cubic"] = METHOD
    cycle_turns: Turns | None = CYCLE_TURNS
    reacts_on: Literal["frame", "outside"] = Field(
        "frame", description="what the reaction acts on: the frame (the cylinder head), or something outside",
        examples=["outside"],
    )  # fmt: skip

    def faults(self) -> Iterator[Fault]:
        own = self.model_fields_set
        compressor = [key for key in ("suction", "discharge", "exponent") if key in own]
        tabulated = [key for key in ("angles", "volumes", "pressures", "going", "coming") if key in own]
        if not compressor and not tabulated:
            remedy = (
                'write suction = "1 bar", discharge = "6 bar" and exponent = 1.3, or angles or volumes with pressures'
            )
            yield ("pressures",), "missing", remedy
        elif compressor:
            for key in tabulated:
                yield (key,), f"given, and {compressor[0]} too", "write an indicator diagram or a compressor, not both"
            for key, example in (("suction", '"1 bar"'), ("discharge", '"6 bar"'), ("exponent", "1.3")):
                if key not in own:
                    yield (key,), "missing", f"add {key} = {example}"
        else:
            if self.angles is not None and self.volumes is not None:
                yield ("volumes",), "given, and angles too", "write angles or volumes, not both"
            yield from _branches(self, "pressures", self.volumes is not None)
            yield from _in_order("angles", self.angles, True)
            yield from _in_order("volumes", self.volumes, False)
        if self.suction is not None and self.discharge is not None and self.suction >= self.discharge:
            yield ("suction",), "not below the discharge pressure", "write absolute pressures, the lower one as suction"
        if self.volumes is None and not compressor and self.clearance is not None and tabulated:
            problem = "has no effect: the pressure depends on the crank angle alone"
            yield ("clearance",), problem, "delete it, or write volumes instead of angles"
        if self.clearance is None and (compressor or self.volumes is not None):
            yield ("clearance",), "missing: the pressure depends on the volume", 'add clearance = "20 cm^3"'
        if self.cycle_turns is not None and (compressor or self.volumes is not None):
            yield ("cycle_turns",), "has no effect: the pressure depends on the volume", "delete it"

    def build(self, cycle_turns: int) -> Gas:
        return Gas(
            **self.shared(), point=self.point, bore=self.bore, head=self.head, pressure=self._pressure(cycle_turns),
            clearance=self.clearance, ambient=self.ambient, reacts_on="frame" if self.reacts_on == "frame" else None,
        )  # fmt: skip

    @staticmethod
    def keys_of(load: Gas) -> dict[str, Any]:
        return gas_keys(load)

    def _pressure(self, cycle_turns: int) -> AbstractPressure:
        if self.suction is not None:
            return Polytropic(self.suction, self.discharge, self.exponent)
        going, coming = _both(self, "pressures")
        if self.volumes is not None:
            return Diagram(self.volumes, going, coming, by="volume", method=self.method)
        turns = self.cycle_turns or cycle_turns
        return Diagram(*_over_crank(self.angles, going, turns), method=self.method, cycle_turns=turns)


def _in_order(key: str, values: Sequence[float] | None, jumps: bool) -> Iterator[Fault]:
    """The first value that does not exceed the one before it; with `jumps`, two may be equal."""
    given = list(values or ())
    for i in range(1, len(given)):
        twin = jumps and given[i] == given[i - 1] and (i == 1 or given[i - 1] != given[i - 2])
        if given[i] <= given[i - 1] and not twin:
            also = "; two equal angles are a jump" if jumps else ""
            yield (key, i), "does not exceed the one before it", f"write them in increasing order{also}"
            return


def _branches(table: Any, key: str, both: bool) -> Iterator[Fault]:
    """Whether values are given once, for both senses of a motion or for each; `both` says whether each may be given."""
    own = [each for each in ("going", "coming") if getattr(table, each) is not None]
    if own and not both:
        problem = "has no effect: a table over the crank angle has one value for each angle"
        yield (own[0],), problem, f"write {key}"
    elif own and getattr(table, key) is not None:
        yield (own[0],), f"given, and {key} too", f"write {key} for both senses, or going and coming"
    elif len(own) == 1:
        missing = "coming" if own == ["going"] else "going"
        yield (missing,), f"missing, while {own[0]} is given", f"add {missing}, or write {key} for both senses"
    elif not own and getattr(table, key) is None:
        yield (key,), "missing", f"add {key}, a list of quantities"


def _both(table: Any, key: str) -> tuple[Any, Any]:
    """The values while the abscissa increases, and while it decreases (None: the same)."""
    return (table.going, table.coming) if table.going is not None else (getattr(table, key), None)


def _over_crank(angles: Sequence[float] | None, values: list[float], turns: int) -> tuple[list[float], list[Any]]:
    """Crank angles and values, with jumps as pairs; equally spaced without angles."""
    period = 2 * math.pi * turns
    if angles is None:
        return [period * i / len(values) for i in range(len(values))], list(values)
    if len(angles) != len(values):
        raise ValueError(f"there are {len(angles)} angles and {len(values)} values; {GIVEN}")
    return joined_jumps(angles, values, period)
