"""Redundant links in a scene file (passive constraints): they can only move because their dimensions fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from pydantic import Field

from linkjax import groups
from linkjax.scenes._fields import Name
from linkjax.scenes._guides import Fault, GroupTable, Guide


class RedundantLinkTable(GroupTable):
    """A redundant link between two points."""

    kind: Literal["redundant_link"] = Field(
        description="a redundant link: the distance of its two points is constant", examples=["redundant_link"]
    )
    link: Name = Field(description="the link", examples=["third"])
    from_: Name = Field(alias="from", description="the point at its first pin", examples=["E"])
    to: Name = Field(description="the point at its far pin", examples=["F"])

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
            yield ("to",), "the same point as `from`", "name the point at the far pin"


class RedundantSliderTable(GroupTable):
    """A redundant slider (block) on a guide."""

    kind: Literal["redundant_slider"] = Field(
        description="a redundant slider: its point always moves along a guide", examples=["redundant_slider"]
    )
    block: Name = Field(description="the slider (block)", examples=["shoe"])
    from_: Name = Field(alias="from", description="the point that is its pin", examples=["K"])
    guide: Guide = Field(description="the guide of the slider", examples=[{"through": "H"}])

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
