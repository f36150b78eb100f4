"""The pairs of a group."""

from __future__ import annotations

from typing import NamedTuple

FRAME = "frame"


class Pair(NamedTuple):
    """A pair between two links, or a link and the frame: "R" turns about the point, "P" slides along a guide; "G" are
    wheels in gear on what `on` names, of which the first is a rack if `rack`."""

    letter: str
    name: str
    one: str
    other: str
    on: str = FRAME
    rack: bool = False

    @property
    def ends(self) -> tuple[str, str]:
        """The two that it joins."""
        return self.one, self.other
