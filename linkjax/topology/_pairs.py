"""The kinematic pairs of a group, from its joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from linkjax.groups import FRAME, AbstractGroup


class Pair(NamedTuple):
    """A pair between two links, or a link and the frame: "R" turns about the point, "P" slides along a guide, "G" is a
    mesh of gears carried by `on`, the first of them a rack if `rack`."""

    letter: str
    name: str
    one: str
    other: str
    on: str = FRAME
    rack: bool = False

    @property
    def ends(self) -> tuple[str, str]:
        """The two links that it joins."""
        return self.one, self.other


def pairs_of(group: AbstractGroup, owners: Mapping[str, str] | None = None) -> list[Pair]:
    """The outer and inner pairs of a group, with the link that each point belongs to; without `owners` the outer pairs
    are as if attached to the frame."""
    inside, found = group.link_names(), []
    for joint in group.joints():
        by = joint.by or (FRAME if owners is None else owners[joint.point])
        by = FRAME if owners is None and by not in inside else by
        found += [] if joint.drives else [Pair(joint.letter, joint.name, joint.link, by)]
    return found


def parted(links: Sequence[str], pairs: Sequence[Pair]) -> tuple[list[Pair], list[Pair]]:
    """The outer pairs, and the inner pairs, which join two of these links."""
    inner = [pair for pair in pairs if set(pair.ends) <= set(links)]
    return [pair for pair in pairs if pair not in inner], inner
