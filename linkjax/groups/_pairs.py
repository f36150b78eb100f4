"""The joints of a group."""

from __future__ import annotations

from typing import NamedTuple

FRAME = "frame"


class Joint(NamedTuple):
    """A joint of a group: its name, the reference point of its moments, and the two links that it joins.

    `by` is "frame", a link, or None for the link that the point belongs to. In a joint that `slides`, called
    `<link>.guide`, the link moves along a straight line of the other. In one that `meshes`, called `<link>.mesh`, both
    are in mesh. In any other joint the link turns about the point.
    """

    name: str
    point: str
    link: str
    by: str | None = None
    slides: bool = False
    meshes: bool = False

    @property
    def drives(self) -> bool:
        """Whether it is the drive and no joint: called `<link>.drive`, it only transmits the force of the drive."""
        return self.name.endswith(".drive")

    @property
    def pins(self) -> bool:
        """Whether the link turns about the point."""
        return not (self.slides or self.meshes or self.drives)

    @property
    def letter(self) -> str:
        """P for a sliding joint, G for gears in mesh, otherwise R."""
        return "P" if self.slides else "G" if self.meshes else "R"
