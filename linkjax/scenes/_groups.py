"""The groups as a scene file writes them, one class for each kind; a new kind is a new class and a branch of `Group`.

Each class knows its keys, what else must hold between them (`faults`), and how to `build` the group itself.
"""

from __future__ import annotations

import abc
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from linkjax import groups
from linkjax._units import nearest
from linkjax.scenes._fields import Angle, Length, Name, Pair, Table

Fault = tuple[tuple[str | int, ...], str, str]
"""Something wrong: path of the key, problem, remedy."""


class GroupTable(Table, abc.ABC):
    """A group of any kind."""

    @abc.abstractmethod
    def build(self, turns: int) -> groups.AbstractGroup:
        """The group itself; `turns` is the sense of the crank, +1 for counter-clockwise."""

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

    def blocks(self) -> tuple[str, ...]:
        """Links that slide and have no length."""
        return ()

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        """What else is wrong, given the points of the frame."""
        yield from ()


class CrankTable(GroupTable):
    """The driving crank, the first of the groups."""

    kind: Literal["crank"] = Field(description="the driver, about a fixed point", examples=["crank"])
    link: Name = Field(description="the link that turns", examples=["crank"])
    pivot: Name = Field(description="the fixed point it turns about", examples=["A"])
    end: Name = Field(description="name for its far pin", examples=["B"])
    phase: Angle = Field(0.0, description="angle of the link at crank angle zero", examples=["90 deg"])

    def build(self, turns: int) -> groups.AbstractGroup:
        return groups.Crank(self.link, self.pivot, self.end, turns, self.phase)

    @staticmethod
    def keys_of(group: groups.Crank) -> dict[str, Any]:
        return {"link": group.link, "pivot": group.pivot, "end": group.end, "phase": _angle(group.phase)}

    def pins(self) -> tuple[str, ...]:
        return (self.end,)

    def bars(self) -> tuple[str, ...]:
        return (self.link,)


class Guide(Table):
    """A straight guide of the frame."""

    through: Name = Field(description="a fixed point", examples=["A"])
    along: Angle = Field(0.0, description="direction of the guide", examples=["90 deg"])
    offset: Length = Field(0.0, description="shift of the pin's path to the left of that direction", examples=["10 mm"])


class RRPTable(GroupTable):
    """A rod and a block that slides on a straight guide."""

    kind: Literal["RRP"] = Field(description="a rod and a block on a straight guide", examples=["RRP"])
    link: Name = Field(description="the rod", examples=["rod"])
    from_: Name = Field(alias="from", description="the point the rod starts from", examples=["B"])
    end: Name = Field(description="name for the pin between rod and block", examples=["D"])
    block: Name = Field(description="the sliding block", examples=["slider"])
    guide: Guide = Field(description="the guide of the block", examples=[{"through": "A"}])
    side: Literal["+", "-"] = Field(
        "+", description="pin ahead of (+) or behind (-) the foot of the perpendicular", examples=["-"]
    )

    def build(self, turns: int) -> groups.AbstractGroup:
        through, along, offset = self.guide.through, self.guide.along, self.guide.offset
        side = 1 if self.side == "+" else -1
        return groups.RRP(self.link, self.block, self.from_, self.end, through, side, along, offset)

    @staticmethod
    def keys_of(group: groups.RRP) -> dict[str, Any]:
        guide = {"through": group.through, "along": _angle(group.along), "offset": f"{float(group.offset)!r} m"}
        return {"link": group.link, "from": group.from_, "end": group.end, "block": group.block, "guide": guide,
                "side": "+" if group.side > 0 else "-"}  # fmt: skip

    def pins(self) -> tuple[str, ...]:
        return (self.end,)

    def bars(self) -> tuple[str, ...]:
        return (self.link,)

    def blocks(self) -> tuple[str, ...]:
        return (self.block,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        if self.guide.through not in fixed:
            problem = f"{self.guide.through!r} is not a point of the frame"
            yield ("guide", "through"), problem, nearest(self.guide.through, fixed)


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

    def build(self, turns: int) -> groups.AbstractGroup:
        return groups.RRR(self.links, self.from_, self.to, self.meet, 1 if self.side == "left" else -1)

    @staticmethod
    def keys_of(group: groups.RRR) -> dict[str, Any]:
        return {"links": list(group.links), "from": group.from_, "to": group.to, "meet": group.meet,
                "side": "left" if group.side > 0 else "right"}  # fmt: skip

    def pins(self) -> tuple[str, ...]:
        return (self.meet,)

    def bars(self) -> tuple[str, ...]:
        return self.links

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        if self.from_ == self.to:
            yield ("to",), "the same point as `from`", "name the point that the second link starts from"


class RPRTable(GroupTable):
    """A lever and a block, one sliding along the other."""

    kind: Literal["RPR"] = Field(description="a lever and a block that slides along it", examples=["RPR"])
    link: Name = Field(description="the lever", examples=["lever"])
    about: Name = Field(description="the point the lever starts from", examples=["P"])
    end: Name = Field(description="name for the lever's far pin", examples=["E"])
    block: Name = Field(description="the sliding block", examples=["die"])
    from_: Name = Field(alias="from", description="the point that is the block's pin", examples=["B"])
    offset: Length = Field(
        0.0, description="shift of the pin's path on the lever to the left of its axis", examples=["10 mm"]
    )
    side: Literal["+", "-"] = Field(
        "+", description="pin ahead of (+) or behind (-) the lever's first pin", examples=["-"]
    )

    def build(self, turns: int) -> groups.AbstractGroup:
        side = 1 if self.side == "+" else -1
        return groups.RPR(self.link, self.block, self.from_, self.about, self.end, side, self.offset)

    @staticmethod
    def keys_of(group: groups.RPR) -> dict[str, Any]:
        return {"link": group.link, "about": group.about, "end": group.end, "block": group.block, "from": group.from_,
                "offset": f"{float(group.offset)!r} m", "side": "+" if group.side > 0 else "-"}  # fmt: skip

    def pins(self) -> tuple[str, ...]:
        return (self.end,)

    def bars(self) -> tuple[str, ...]:
        return (self.link,)

    def blocks(self) -> tuple[str, ...]:
        return (self.block,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        if self.about == self.from_:
            yield ("from",), "the same point as `about`", "name the point that the block is pinned to"


def _angle(value: Any) -> str:
    return f"{float(value)!r} rad"


TABLES: dict[str, type[GroupTable]] = {"crank": CrankTable, "RRP": RRPTable, "RRR": RRRTable, "RPR": RPRTable}


def _kind(value: Any) -> str | None:
    kind = value.get("kind") if isinstance(value, dict) else None
    return f"#{kind}" if isinstance(kind, str) else None


Group = Annotated[
    Annotated[CrankTable, Tag("#crank")]
    | Annotated[RRPTable, Tag("#RRP")]
    | Annotated[RRRTable, Tag("#RRR")]
    | Annotated[RPRTable, Tag("#RPR")],
    Discriminator(_kind),
]
