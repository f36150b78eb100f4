"""The kinematic pairs of a group."""

from __future__ import annotations

from typing import NamedTuple

FRAME = "frame"


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
