"""Passive links as a scene file writes them: those that only move because their dimensions fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from pydantic import Field

from linkjax import groups
from linkjax.scenes._fields import Name
from linkjax.scenes._guides import Fault, GroupTable, Guide


class RRTable(GroupTable):
    """A passive link between two points."""

    kind: Literal["RR"] = Field(description="a passive link: its two points keep their distance", examples=["RR"])
    link: Name = Field(description="the link", examples=["third"])
    from_: Name = Field(alias="from", description="the point it starts from", examples=["E"])
    to: Name = Field(description="the point at its far end", examples=["F"])

    def build(self, turns: int) -> groups.AbstractGroup:
        return groups.RR(self.link, self.from_, self.to)

    @staticmethod
    def keys_of(group: groups.RR) -> dict[str, Any]:
        return {"link": group.link, "from": group.from_, "to": group.to}

    def pins(self) -> tuple[str, ...]:
        return ()

    def bars(self) -> tuple[str, ...]:
        return (self.link,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        if self.from_ == self.to:
            yield ("to",), "the same point as `from`", "name the point at the far end"


class RPTable(GroupTable):
    """A passive block on a guide."""

    kind: Literal["RP"] = Field(description="a passive block: its point keeps to a guide", examples=["RP"])
    block: Name = Field(description="the block", examples=["shoe"])
    from_: Name = Field(alias="from", description="the point that is its pin", examples=["K"])
    guide: Guide = Field(description="the guide it keeps to", examples=[{"through": "H"}])

    def build(self, turns: int) -> groups.AbstractGroup:
        return groups.RP(self.block, self.from_, self.guide.build())

    @staticmethod
    def keys_of(group: groups.RP) -> dict[str, Any]:
        return {"block": group.block, "from": group.from_, "guide": Guide.keys_of(group.guide)}

    def pins(self) -> tuple[str, ...]:
        return ()

    def bars(self) -> tuple[str, ...]:
        return ()

    def sliding(self) -> tuple[str, ...]:
        return (self.block,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        yield from self.guide.faults(("guide",), fixed)
