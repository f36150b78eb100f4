"""What is wrong with a group whose margin is not positive, for messages."""

from __future__ import annotations

from typing import NamedTuple

Told = tuple[str, str]  # the problem, and the remedy; "" for the general one


class Lost(NamedTuple):
    """The least margin of a group over the cycle, where it is not positive: the `side` (singular position), its
    `value`, the crank angle in `degrees`, and the `trouble` with the reference path of the group ("" for none)."""

    side: str
    value: float
    degrees: float
    trouble: str = ""

    @property
    def place(self) -> str:
        """The crank angle and the singular position."""
        return f"{self.degrees:.2f} degrees of crank angle ({self.side})"

    def returning(self) -> Told | None:
        """The problem of a group that does not return to its initial position; None if it does."""
        if self.trouble == "too fast":
            what = "has gears driven by a link that turns too fast to count its revolutions"
            return what, "Make that link turn more evenly, or less often per turn of the crank."
        if self.side == "turns" or self.trouble == "astray":
            what = "does not return to its initial position within cycle_turns"
            return what, "Increase cycle_turns, or choose another ratio." if self.side == "turns" else ""
        return None

    def parallel(self) -> Told:
        """The problem of two slots that determine no point."""
        return (
            f"cannot be assembled over the cycle: at {self.place} the directions of its slots are parallel, or on "
            "the other side than given; change the side, or the slots so that they are never parallel"
        ), ""

    def apart(self) -> Told:
        """The problem of a mesh or belt whose centre distance is too short."""
        return (
            "has pulleys that are too close to each other for their belt, or gears with the same axis in mesh; change "
            "radii, or the distance"
        ), ""
