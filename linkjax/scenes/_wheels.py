"""Gear pairs in a scene file: by teeth, by a belt, or of a gear and a rack."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, StrictBool

from linkjax import groups
from linkjax.scenes._fields import Angle, Count, Length, Name, Pair, Radius, Table, Tension
from linkjax.scenes._guides import Fault, GroupTable, Guide, in_angle, in_length


def steep(angle: float) -> Iterator[Fault]:
    """A pressure angle out of range."""
    if not 0 <= angle < math.radians(60):
        yield ("pressure_angle",), "not from 0 to 60 degrees", 'the usual value is "20 deg"'


class BeltTable(Table):
    """A belt, chain or cable round two pulleys."""

    radii: Annotated[tuple[Radius, Radius], Pair] = Field(
        description="radii of this pulley and of the other one", examples=[["40 mm", "80 mm"]]
    )
    crossed: StrictBool = Field(False, description="whether the pulleys turn in opposite senses", examples=[True])
    tension: Tension = Field(0.0, description="tension of the slack strand", examples=["200 N"])


class Toothed(Table):
    """The mesh of two gears, or the belt of two pulleys."""

    teeth: Annotated[tuple[Count, Count], Pair] | None = Field(
        None, description="numbers of teeth of this gear and of the other one", examples=[[40, 20]]
    )
    internal: StrictBool = Field(False, description="whether the larger gear is internal", examples=[True])
    pressure_angle: Angle = Field(groups.PRESSURE, description="pressure angle of the teeth", examples=["25 deg"])
    belt: BeltTable | None = Field(
        None, description="instead of teeth: a belt round two pulleys", examples=[{"radii": ["40 mm", "80 mm"]}]
    )

    def mesh(self) -> groups.Mesh:
        """The teeth, or the belt."""
        if self.belt is not None:
            return groups.Belt(*self.belt.radii, self.belt.crossed, self.belt.tension)
        assert self.teeth is not None  # see `mesh_faults`
        return groups.Teeth(self.teeth, self.internal, self.pressure_angle)

    def mesh_faults(self) -> Iterator[Fault]:
        """The errors."""
        if self.teeth is not None and self.belt is not None:
            yield ("teeth",), "given, and a belt too", "delete teeth, or the belt"
        elif self.teeth is None and self.belt is None:
            remedy = 'add teeth = [40, 20], or belt = { radii = ["40 mm", "80 mm"] }'
            yield ("teeth",), "missing (a gear pair has teeth or a belt)", remedy
        for key in ("internal", "pressure_angle") if self.belt is not None else ():
            if key in self.model_fields_set:
                yield (key,), "has no effect: a belt has no teeth", f"delete {key}"
        if self.internal and self.teeth is not None and self.teeth[0] == self.teeth[1]:
            yield (
                ("internal",),
                "both gears have the same number of teeth, so neither can be internal",
                "change one of them",
            )
        yield from steep(self.pressure_angle)


def mesh_keys(mesh: groups.Mesh) -> dict[str, Any]:
    """The keys of a mesh or a belt."""
    if isinstance(mesh, groups.Teeth):
        return {"teeth": list(mesh.teeth), "internal": mesh.internal, "pressure_angle": in_angle(mesh.pressure_angle)}
    radii = [in_length(mesh.radius), in_length(mesh.other)]
    return {"belt": {"radii": radii, "crossed": mesh.crossed, "tension": f"{float(mesh.tension)!r} N"}}


class GearPair(Toothed):
    """A gear pair, in a machine drawn by links and joints."""

    link: Name = Field(description="the gear", examples=["wheel"])
    to: Name = Field(description="the link in mesh with it, or the frame", examples=["crank"])
    phase: Angle | None = Field(
        None, description="angle of the gear when the other one is at zero; as sketched if omitted",
        examples=["90 deg"],
    )  # fmt: skip

    def build(self) -> groups.GearPair:
        return groups.GearPair(self.link, self.to, self.mesh(), self.phase)


class RackPair(Table):
    """A slider (block) as a rack, and its gear, in a machine drawn by links and joints."""

    link: Name = Field(description="the rack: the slider of a slot", examples=["rack"])
    to: Name = Field(description="the gear", examples=["wheel"])
    radius: Radius = Field(description="pitch radius of the gear", examples=["60 mm"])
    side: Literal["left", "right"] | None = Field(
        None, description="side of the gear, seen along the guide; as sketched if omitted", examples=["right"]
    )
    start: Length | None = Field(
        None, description="distance of the rack along its guide when the gear is at zero; as sketched if omitted",
        examples=["250 mm"],
    )  # fmt: skip
    pressure_angle: Angle = Field(
        groups.PRESSURE, description="pressure angle of the teeth; zero for a belt or cable", examples=["25 deg"]
    )

    def build(self) -> groups.RackPair:
        side = None if self.side is None else 1 if self.side == "left" else -1
        return groups.RackPair(self.link, self.to, self.radius, side, self.start, self.pressure_angle)


class GearTable(Toothed, GroupTable):
    """A gear in mesh with a link, or a pulley with a belt."""

    kind: Literal["gear"] = Field(description="a gear in mesh with a link, or a pulley with a belt", examples=["gear"])
    link: Name = Field(description="the gear", examples=["wheel"])
    pivot: Name = Field(description="the point about which it turns", examples=["D"])
    to: Name = Field(description="the link in mesh with it, or the frame", examples=["crank"])
    centre: Name = Field(description="the point about which that link turns", examples=["A"])
    end: Name | None = Field(None, description="name for a pin of the gear at its length", examples=["C"])
    phase: Angle = Field(0.0, description="angle of the gear when the other one is at zero", examples=["90 deg"])
    carrier: Name = Field("frame", description="the link that carries both gears", examples=["arm"])

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        return groups.Gear(self.link, self.pivot, self.mesh(), self.to, self.centre, self.end, self.phase, self.carrier)

    @staticmethod
    def keys_of(group: groups.Gear) -> dict[str, Any]:
        table: dict[str, Any] = {"link": group.link, "pivot": group.pivot, "to": group.to, "centre": group.centre}
        table |= mesh_keys(group.mesh)
        end = {} if group.end is None else {"end": group.end}
        return {**table, **end, "phase": in_angle(group.phase), "carrier": group.carrier}

    def pins(self) -> tuple[str, ...]:
        return () if self.end is None else (self.end,)

    def bars(self) -> tuple[str, ...]:
        return () if self.end is None else (self.link,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        yield from self.mesh_faults()
        if self.carrier == self.to:
            problem = f"{self.to!r} carries the gear, so it cannot be in mesh with it"
            yield ("to",), problem, "name another link, or the carrier"
        if self.link in (self.to, self.carrier):
            yield ("link",), "in mesh with itself, or its own carrier", "name another link in `to` or `carrier`"
        if self.pivot == self.centre:
            yield ("centre",), "the same point as `pivot`", "name the point about which the other gear turns"


class RackTable(GroupTable):
    """A rack that is driven by a gear."""

    kind: Literal["rack"] = Field(description="a rack that is driven by a gear", examples=["rack"])
    link: Name = Field(description="the rack", examples=["rack"])
    end: Name = Field(description="name for its own point on the path", examples=["E"])
    guide: Guide = Field(description="the guide of the rack", examples=[{"through": "A"}])
    to: Name = Field(description="the gear", examples=["wheel"])
    centre: Name = Field(description="the point about which the gear turns", examples=["D"])
    radius: Radius = Field(description="pitch radius of the gear", examples=["60 mm"])
    side: Literal["left", "right"] = Field(
        "left", description="side of the gear, seen along the guide", examples=["right"]
    )
    start: Length = Field(
        0.0, description="distance of `end` along the guide when the gear is at zero", examples=["250 mm"]
    )
    pressure_angle: Angle = Field(
        groups.PRESSURE, description="pressure angle of the teeth; zero for a belt or cable", examples=["25 deg"]
    )

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        side = 1 if self.side == "left" else -1
        guide, rest = self.guide.build(), (self.radius, side, self.start, self.pressure_angle)
        return groups.Rack(self.link, self.end, guide, self.to, self.centre, *rest)

    @staticmethod
    def keys_of(group: groups.Rack) -> dict[str, Any]:
        side = "left" if group.side > 0 else "right"
        table = {"link": group.link, "end": group.end, "guide": Guide.keys_of(group.guide), "to": group.to}
        numbers = {"radius": in_length(group.radius), "side": side, "start": in_length(group.start)}
        return {**table, "centre": group.centre, **numbers, "pressure_angle": in_angle(group.pressure_angle)}

    def pins(self) -> tuple[str, ...]:
        return (self.end,)

    def bars(self) -> tuple[str, ...]:
        return ()

    def sliding(self) -> tuple[str, ...]:
        return (self.link,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        yield from self.guide.faults(("guide",), fixed)
        yield from steep(self.pressure_angle)
        if self.to == self.guide.on:
            yield ("to",), f"the rack slides on {self.to!r}, its own gear", "name the carrier of both in `guide`"


class PinionTable(GroupTable):
    """A gear that is driven by a rack."""

    kind: Literal["pinion"] = Field(description="a gear that is driven by a rack", examples=["pinion"])
    link: Name = Field(description="the gear", examples=["wheel"])
    pivot: Name = Field(description="the point about which it turns", examples=["D"])
    to: Name = Field(description="the rack: a slider on a guide", examples=["ram"])
    at: Name = Field(description="a point of the rack", examples=["C"])
    radius: Radius = Field(description="pitch radius of the gear", examples=["60 mm"])
    side: Literal["left", "right"] = Field(
        "left", description="side of the gear, seen along the rack's guide", examples=["right"]
    )
    end: Name | None = Field(None, description="name for a pin of the gear at its length", examples=["E"])
    phase: Angle = Field(0.0, description="angle of the gear when `at` is at distance `start`", examples=["90 deg"])
    carrier: Name = Field("frame", description="the link that carries the gear and the guide", examples=["arm"])
    through: Name | None = Field(
        None, description="the point of the carrier at which `start` is zero, instead of the pivot", examples=["A"]
    )
    start: Length = Field(0.0, description="distance of `at` along the guide at `phase`", examples=["250 mm"])
    pressure_angle: Angle = Field(groups.PRESSURE, description="pressure angle of the teeth", examples=["25 deg"])

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        side = 1 if self.side == "left" else -1
        rest = (self.radius, side, self.end, self.phase, self.carrier, self.pressure_angle)
        return groups.Pinion(self.link, self.pivot, self.to, self.at, *rest, self.through or "", self.start)

    @staticmethod
    def keys_of(group: groups.Pinion) -> dict[str, Any]:
        end = {} if group.end is None else {"end": group.end}
        end |= {"through": group.through} if group.through else {}
        return {"link": group.link, "pivot": group.pivot, "to": group.to, "at": group.at,
                "radius": in_length(group.radius), "side": "left" if group.side > 0 else "right", **end,
                "phase": in_angle(group.phase), "start": in_length(group.start), "carrier": group.carrier,
                "pressure_angle": in_angle(group.pressure_angle)}  # fmt: skip

    def pins(self) -> tuple[str, ...]:
        return () if self.end is None else (self.end,)

    def bars(self) -> tuple[str, ...]:
        return () if self.end is None else (self.link,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        yield from steep(self.pressure_angle)
