"""Passive links as a scene file writes them: those that only move because their dimensions fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from pydantic import Field

from linkjax import groups
from linkjax.scenes._fields import Name
from linkjax.scenes._guides import Fault, GroupTable, Guide


class RedundantLinkTable(GroupTable):
    """A passive link between two points."""

    kind: Literal["redundant_link"] = Field(
        description="a passive link: its two points keep their distance", examples=["redundant_link"]
    )
    link: Name = Field(description="the link", examples=["third"])
    from_: Name = Field(alias="from", description="the point it starts from", examples=["E"])
    to: Name = Field(description="the point at its far end", examples=["F"])

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        return groups.RedundantLink(self.link, self.from_, self.to)

    @staticmethod
    def keys_of(group: groups.RedundantLink) -> dict[str, Any]:
        return {"link": group.link, "from": group.from_, "to": group.to}

    def pins(self) -> tuple[str, ...]:
        return ()

    def bars(self) -> tuple[str, ...]:
        return (self.link,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        if self.from_ == self.to:
            yield ("to",), "the same point as `from`", "name the point at the far end"


class RedundantSliderTable(GroupTable):
    """A passive block on a guide."""

    kind: Literal["redundant_slider"] = Field(
        description="a passive block: its point keeps to a guide", examples=["redundant_slider"]
    )
    block: Name = Field(description="the block", examples=["shoe"])
    from_: Name = Field(alias="from", description="the point that is its pin", examples=["K"])
    guide: Guide = Field(description="the guide it keeps to", examples=[{"through": "H"}])

    def build(self, rotation: groups.Rotation) -> groups.AbstractGroup:
        return groups.RedundantSlider(self.block, self.from_, self.guide.build())

    @staticmethod
    def keys_of(group: groups.RedundantSlider) -> dict[str, Any]:
        return {"block": group.block, "from": group.from_, "guide": Guide.keys_of(group.guide)}

    def pins(self) -> tuple[str, ...]:
        return ()

    def bars(self) -> tuple[str, ...]:
        return ()

    def sliding(self) -> tuple[str, ...]:
        return (self.block,)

    def faults(self, fixed: Mapping[str, Any]) -> Iterator[Fault]:
        yield from self.guide.faults(("guide",), fixed)
