"""The groups in a scene file, one class for each kind; a new kind is a new class and a branch of `Group`.

Each class defines its keys, the conditions between them (`faults`), and how to `build` the group.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag

from linkjax import groups
from linkjax.scenes._fields import Angle, Length, Name, Pair
from linkjax.scenes._guides import AngleLaw, Fault, GroupTable, Guide, LengthLaw, in_angle, in_length, law_keys
from linkjax.scenes._passive import RedundantLinkTable, RedundantSliderTable
from linkjax.scenes._wheels import GearTable, PinionTable, RackTable

Branch = Literal["fixed", "continue"]
BRANCH: Any = Field(
    "fixed",
    description="at a change point: stay on the same side, or continue smoothly to the other",
    examples=["continue"],
)


def branch_keys(group: groups.RRR | groups.RRP) -> dict[str, Any]:
    """The key, where it is not the default."""
    return {"branch": group.branch} if group.branch != "fixed" else {}


class CrankTable(GroupTable):
    """The driving crank, the first group."""

    drives: ClassVar[bool] = True
    has_shaft: ClassVar[bool] = True

    kind: Literal["crank"] = Field(description="the driver, about a fixed point", examples=["crank"])
    link: Name = Field(description="the crank", examples=["crank"])
    pivot: Name = Field(description="the fixed point it turns about", examples=["A"])
    end: Name = Field(description="name for its far pin", examples=["B"])
    phase: Angle = Field(0.0, description="angle of the link at crank angle zero", examples=["90 deg"])
    law: AngleLaw | None = Field(
        None, description="motion law of an oscillating crank", examples=[{"start": "20 deg", "stop": "140 deg"}]
    )

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        law = None if self.law is None else self.law.build()
        return groups.Crank(self.link, self.pivot, self.end, rotation, self.phase, law)

    @staticmethod
    def keys_of(group: groups.Crank) -> dict[str, Any]:
        table = {"link": group.link, "pivot": group.pivot, "end": group.end, "phase": in_angle(group.phase)}
        return table if group.law is None else {**table, "law": law_keys(group.law, in_angle)}

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        yield from () if self.law is None else self.law.faults(("law",))

    def follows(self) -> bool:
        return self.law is not None

    def pins(self) -> tuple[str, ...]:
        return (self.end,)

    def bars(self) -> tuple[str, ...]:
        return (self.link,)


class LinearDriverTable(GroupTable):
    """A driving slider, the first group."""

    drives: ClassVar[bool] = True

    kind: Literal["linear_driver"] = Field(
        description="the driver, along a guide of the frame", examples=["linear_driver"]
    )
    link: Name = Field(description="the driving slider", examples=["piston"])
    end: Name = Field(description="name for its own point on the path", examples=["B"])
    guide: Guide = Field(description="the guide of the frame", examples=[{"through": "A"}])
    law: LengthLaw = Field(description="how far along the guide it is", examples=[{"start": "0 mm", "stop": "120 mm"}])

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        return groups.LinearDriver(self.link, self.end, self.guide.build(), self.law.build())

    @staticmethod
    def keys_of(group: groups.LinearDriver) -> dict[str, Any]:
        return {"link": group.link, "end": group.end, "guide": Guide.keys_of(group.guide),
                "law": law_keys(group.law, in_length)}  # fmt: skip

    def pins(self) -> tuple[str, ...]:
        return (self.end,)

    def bars(self) -> tuple[str, ...]:
        return ()

    def sliding(self) -> tuple[str, ...]:
        return (self.link,)

    def follows(self) -> bool:
        return True

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        if self.guide.on != "frame":
            yield ("guide", "on"), "the guide of a linear driver is on the frame", "delete `on`"
        yield from self.guide.faults(("guide",), fixed)
        yield from self.law.faults(("law",))


class RRPTable(GroupTable):
    """A rod and a slider (block) on a straight guide."""

    kind: Literal["RRP"] = Field(description="a rod and a slider (block) on a straight guide", examples=["RRP"])
    link: Name = Field(description="the rod", examples=["rod"])
    from_: Name = Field(alias="from", description="the point the rod starts from", examples=["B"])
    end: Name = Field(description="name for the pin between rod and slider", examples=["D"])
    block: Name = Field(description="the slider (block)", examples=["slider"])
    guide: Guide = Field(description="the guide of the slider", examples=[{"through": "A"}])
    side: Literal["+", "-"] = Field(
        "+", description="pin ahead of (+) or behind (-) the foot of the perpendicular", examples=["-"]
    )
    branch: Branch = BRANCH

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        side = 1 if self.side == "+" else -1
        return groups.RRP(self.link, self.block, self.from_, self.end, self.guide.build(), side, self.branch)

    @staticmethod
    def keys_of(group: groups.RRP) -> dict[str, Any]:
        return {"link": group.link, "from": group.from_, "end": group.end, "block": group.block,
                "guide": Guide.keys_of(group.guide), "side": "+" if group.side > 0 else "-",
                **branch_keys(group)}  # fmt: skip

    def pins(self) -> tuple[str, ...]:
        return (self.end,)

    def bars(self) -> tuple[str, ...]:
        return (self.link,)

    def sliding(self) -> tuple[str, ...]:
        return (self.block,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        yield from self.guide.faults(("guide",), fixed)


class RRRTable(GroupTable):
    """Two links and three pins."""

    kind: Literal["RRR"] = Field(description="two links and three pins", examples=["RRR"])
    links: Annotated[tuple[Name, Name], Pair] = Field(description="the two links", examples=[["coupler", "rocker"]])
    from_: Name = Field(alias="from", description="the point the first link starts from", examples=["B"])
    to: Name = Field(description="the point the second link starts from", examples=["F"])
    meet: Name = Field(description="name for the pin where they meet", examples=["G"])
    side: Literal["left", "right"] = Field(
        "left", description="where they meet, seen along the line from-to", examples=["right"]
    )
    branch: Branch = BRANCH

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        side = 1 if self.side == "left" else -1
        return groups.RRR(self.links, self.from_, self.to, self.meet, side, self.branch)

    @staticmethod
    def keys_of(group: groups.RRR) -> dict[str, Any]:
        return {"links": list(group.links), "from": group.from_, "to": group.to, "meet": group.meet,
                "side": "left" if group.side > 0 else "right", **branch_keys(group)}  # fmt: skip

    def pins(self) -> tuple[str, ...]:
        return (self.meet,)

    def bars(self) -> tuple[str, ...]:
        return self.links

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        if self.from_ == self.to:
            yield ("to",), "the same point as `from`", "name the point that the second link starts from"


class RPRTable(GroupTable):
    """A lever and a slider (block), one sliding along the other."""

    kind: Literal["RPR"] = Field(description="a lever and a slider (block) that slides along it", examples=["RPR"])
    link: Name = Field(description="the lever", examples=["lever"])
    about: Name = Field(description="the point the lever starts from", examples=["P"])
    end: Name = Field(description="name for the lever's far pin", examples=["E"])
    block: Name = Field(description="the slider (block)", examples=["die"])
    from_: Name = Field(alias="from", description="the point that is the block's pin", examples=["B"])
    offset: Length = Field(
        0.0, description="shift of the pin's path on the lever to the left of its axis", examples=["10 mm"]
    )
    side: Literal["+", "-"] = Field(
        "+", description="pin ahead of (+) or behind (-) the lever's first pin", examples=["-"]
    )

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        side = 1 if self.side == "+" else -1
        return groups.RPR(self.link, self.block, self.from_, self.about, self.end, side, self.offset)

    @staticmethod
    def keys_of(group: groups.RPR) -> dict[str, Any]:
        return {"link": group.link, "about": group.about, "end": group.end, "block": group.block, "from": group.from_,
                "offset": in_length(group.offset), "side": "+" if group.side > 0 else "-"}  # fmt: skip

    def pins(self) -> tuple[str, ...]:
        return (self.end,)

    def bars(self) -> tuple[str, ...]:
        return (self.link,)

    def sliding(self) -> tuple[str, ...]:
        return (self.block,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        if self.about == self.from_:
            yield ("from",), "the same point as `about`", "name the point that the slider is pinned to"


class PRPTable(GroupTable):
    """Two sliders (blocks) pinned to each other, each in its own slot."""

    kind: Literal["PRP"] = Field(
        description="two sliders (blocks) pinned to each other, in two slots", examples=["PRP"]
    )
    blocks: Annotated[tuple[Name, Name], Pair] = Field(description="the two sliders", examples=[["die", "stone"]])
    meet: Name = Field(description="name for the pin between them", examples=["M"])
    slots: Annotated[tuple[Guide, Guide], Pair] = Field(
        description="the guide of each, on two links", examples=[[{"on": "lever", "through": "P"}, {"through": "A"}]]
    )
    side: Literal["left", "right"] = Field(
        "left", description="where the second slot points, seen along the first", examples=["right"]
    )

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        one, two = self.slots
        return groups.PRP(self.blocks, self.meet, (one.build(), two.build()), 1 if self.side == "left" else -1)

    @staticmethod
    def keys_of(group: groups.PRP) -> dict[str, Any]:
        return {"blocks": list(group.blocks), "meet": group.meet, "slots": [Guide.keys_of(s) for s in group.slots],
                "side": "left" if group.side > 0 else "right"}  # fmt: skip

    def pins(self) -> tuple[str, ...]:
        return (self.meet,)

    def bars(self) -> tuple[str, ...]:
        return ()

    def sliding(self) -> tuple[str, ...]:
        return self.blocks

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        if self.slots[0].on == self.slots[1].on:
            problem = f"both slots are on {self.slots[0].on!r}, so nothing can move"
            yield ("slots", 1), problem, "name the other link with `on`"
        for i, slot in enumerate(self.slots):
            yield from slot.faults(("slots", i), fixed)


class RPPTable(GroupTable):
    """A slider (block) in the slot of a slotted slider (yoke), which moves on a guide."""

    kind: Literal["RPP"] = Field(
        description="a slider (block) in the slot of a yoke on a straight guide", examples=["RPP"]
    )
    link: Name = Field(description="the slotted slider (yoke)", examples=["yoke"])
    end: Name = Field(description="name for the yoke's own point on its path", examples=["E"])
    guide: Guide = Field(description="the guide of the yoke", examples=[{"through": "A"}])
    block: Name = Field(description="the slider (block) in its slot", examples=["die"])
    from_: Name = Field(alias="from", description="the point that is the block's pin", examples=["B"])
    slot: Angle = Field(math.pi / 2, description="direction of the slot, from that of the guide", examples=["60 deg"])
    offset: Length = Field(
        0.0, description="shift of the slot to the left of its direction, away from `end`", examples=["10 mm"]
    )

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        guide = self.guide.build()
        return groups.RPP(self.link, self.block, self.from_, self.end, guide, self.slot, self.offset)

    @staticmethod
    def keys_of(group: groups.RPP) -> dict[str, Any]:
        return {"link": group.link, "end": group.end, "guide": Guide.keys_of(group.guide), "block": group.block,
                "from": group.from_, "slot": in_angle(group.slot), "offset": in_length(group.offset)}  # fmt: skip

    def pins(self) -> tuple[str, ...]:
        return (self.end,)

    def bars(self) -> tuple[str, ...]:
        return ()

    def sliding(self) -> tuple[str, ...]:
        return (self.link, self.block)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        yield from self.guide.faults(("guide",), fixed)
        if abs(math.sin(self.slot)) < 1e-9:
            yield ("slot",), "the slot lies along the guide", 'write another angle, e.g. "90 deg"'


TABLES: dict[str, type[GroupTable]] = {
    "crank": CrankTable,
    "linear_driver": LinearDriverTable,
    "RRP": RRPTable,
    "RRR": RRRTable,
    "RPR": RPRTable,
    "PRP": PRPTable,
    "RPP": RPPTable,
    "gear": GearTable,
    "rack": RackTable,
    "pinion": PinionTable,
    "redundant_link": RedundantLinkTable,
    "redundant_slider": RedundantSliderTable,
}


def _kind(value: Any) -> str | None:
    kind = value.get("kind") if isinstance(value, dict) else None
    return f"#{kind}" if isinstance(kind, str) else None


Group = Annotated[
    Annotated[CrankTable, Tag("#crank")]
    | Annotated[LinearDriverTable, Tag("#linear_driver")]
    | Annotated[RRPTable, Tag("#RRP")]
    | Annotated[RRRTable, Tag("#RRR")]
    | Annotated[RPRTable, Tag("#RPR")]
    | Annotated[PRPTable, Tag("#PRP")]
    | Annotated[RPPTable, Tag("#RPP")]
    | Annotated[GearTable, Tag("#gear")]
    | Annotated[RackTable, Tag("#rack")]
    | Annotated[PinionTable, Tag("#pinion")]
    | Annotated[RedundantLinkTable, Tag("#redundant_link")]
    | Annotated[RedundantSliderTable, Tag("#redundant_slider")],
    Discriminator(_kind),
]
