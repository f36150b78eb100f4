"""What every structural group (Assur group, or the driving crank) must answer.

A group is one file with all its sides together: assembly and rates (`solve`), closeness to its dead positions
(`margins`), and joint reactions (`react`). A new kind is a new file; nothing else changes.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
from jaxtyping import Array

from linkjax._vec import Vec
from linkjax.groups._class import classified
from linkjax.groups._guide import Guide
from linkjax.groups._law import AbstractLaw
from linkjax.groups._pairs import FRAME, Pair
from linkjax.groups._state import LinkState, PointState

BEYOND = 1e-6  # what a margin falls short by where a group closes, but in another place than where it began


class Wrench(NamedTuple):
    """A force and its moment about a stated point."""

    force: Vec
    moment: Array


class Margin(NamedTuple):
    """Signed, dimensionless distance to one dead position of a group, and its derivatives by the crank angle."""

    value: Array
    d: Array
    dd: Array


class Joint(NamedTuple):
    """A joint that a group brings in: its name, the point its moments are referred to, and the two links it joins;
    `by` is "frame", a link, or None for the link that the point belongs to. In one that `slides`, called
    `<link>.guide`, the link moves along a straight line of the other; in one that `meshes`, called `<link>.mesh`, both
    are in gear; else it turns about the point."""

    name: str
    point: str
    link: str
    by: str | None = None
    slides: bool = False
    meshes: bool = False

    @property
    def letter(self) -> str:
        """P for a sliding joint, G for wheels in gear, else R."""
        return "P" if self.slides else "G" if self.meshes else "R"


class Coupling(NamedTuple):
    """What wheels in gear keep constant: the sum of the angles of links (rad) and of the way of blocks along what they
    slide on (m), each times its factor."""

    angles: dict[str, Array]
    ways: dict[str, Array]


def named(kind: str) -> str:
    """A kind of group with its article."""
    return f"{'an' if kind[0] == 'R' else 'a'} {kind}"


def check_side(kind: str, side: int) -> None:
    """Raise ValueError for a side that is none."""
    if side not in (1, -1):
        raise ValueError(f"side of {named(kind)} must be 1 or -1, but is {side!r}")


def check_apart(kind: str, one: str, other: str) -> None:
    """Raise ValueError where both ends of a group hang on the same point."""
    if one == other:
        raise ValueError(f"both ends of {named(kind)} hang on the point {one!r}; name two points")


class AbstractGroup(eqx.Module):
    """A structural group: closes one or more links onto points that are already known."""

    kind: eqx.AbstractClassVar[str]

    @abc.abstractmethod
    def link_names(self) -> tuple[str, ...]:
        """Links the group brings in, in order."""

    def pairs(self) -> list[Pair]:
        """The pairs by which it is attached, as if to the frame, and those inside it."""
        inside = self.link_names()
        return [Pair(j.letter, j.name, j.link, j.by if j.by in inside else FRAME)
                for j in self.joints() if not j.name.endswith(".drive")]  # fmt: skip

    def classified(self) -> tuple[str, str]:
        """Class and kind, e.g. II1, and its pairs as letters, e.g. RRR; see `classified`."""
        return classified(self.link_names(), self.pairs())

    @abc.abstractmethod
    def needs(self) -> tuple[str, ...]:
        """Points that must exist before the group is attached."""

    @abc.abstractmethod
    def pins(self) -> Mapping[str, tuple[str, str | None]]:
        """For each link brought in: the point at its origin, and the point at its far end (None where it has none)."""

    def holds(self) -> Mapping[str, tuple[str, str | None]]:
        """For each link brought in: the point at its origin, and the point to which its x axis runs as the group sees
        it (None where that is the link's own)."""
        return self.pins()

    def brings(self) -> tuple[str, ...]:
        """Pins that the group creates."""
        ends, needed = self.pins().values(), self.needs()
        new = [*(far for _, far in ends if far is not None), *(first for first, _ in ends if first not in needed)]
        return tuple(dict.fromkeys(new))

    def shared(self) -> Mapping[str, str]:
        """Pins that may be marked points of its links, each with the link that it belongs to ("" for one that was there
        before)."""
        return {}

    def lacking(self, links: Mapping[str, Any]) -> tuple[str, str] | None:
        """What its links would have to have besides, as problem and remedy; None where nothing is missing."""
        return None

    def driving(self) -> str | None:
        """The link that the drive moves; None for a group without a drive in it. One that has it stands first."""
        return None

    def follows(self) -> AbstractLaw | None:
        """The law of motion that the drive in it follows whatever the loads; None for one that turns as they let it."""
        return None

    def on_frame(self) -> tuple[str, ...]:
        """Points that must belong to the frame."""
        return ()

    def passive(self) -> bool:
        """Whether it holds what is held already."""
        return False

    def wheels(self) -> tuple[Any, ...]:
        """The wheels and racks in gear inside it, each as the `Gear`, `Rack` or `Pinion` that it would be by itself."""
        return ()

    def lies_on(self) -> tuple[tuple[str, str], ...]:
        """Which points must belong to which links that are there already, as (link or "frame", point)."""
        return ()

    def slides_on(self) -> tuple[tuple[str, str], ...]:
        """Which links must slide along which others, as (link, link or "frame")."""
        return ()

    def guides(self) -> tuple[Guide, ...]:
        """Guides on the frame or on links attached before; each must run through a point of what it is on."""
        return ()

    def translating(self) -> tuple[str, ...]:
        """Links brought in that never turn."""
        return ()

    @abc.abstractmethod
    def joints(self) -> tuple[Joint, ...]:
        """The joints that attach the group and those inside it, in the order of `react`."""

    @abc.abstractmethod
    def solve(
        self, links: Mapping[str, Any], states: dict[str, LinkState], points: dict[str, PointState], phi: Array
    ) -> tuple[dict[str, LinkState], dict[str, PointState]]:
        """States of the links brought in and of the pins that the group creates, from what is known already; of
        `links` only `length` is used."""

    @abc.abstractmethod
    def dead_positions(self) -> tuple[str, ...]:
        """Names of its margins."""

    @abc.abstractmethod
    def margins(
        self, links: Mapping[str, Any], states: dict[str, LinkState], points: dict[str, PointState], phi: Array
    ) -> dict[str, Margin]:
        """Signed margins by the name of the dead position."""

    def returns(self) -> Array | None:
        """Whether what is followed along the crank is after all its turns where it began; None where nothing is."""
        return None

    @abc.abstractmethod
    def transmission(self, states: dict[str, LinkState], points: dict[str, PointState]) -> Array | None:
        """Transmission angle (rad, 0 to π), None for a driver."""

    @abc.abstractmethod
    def react(
        self,
        loads: dict[str, Wrench],
        states: dict[str, LinkState],
        points: dict[str, PointState],
    ) -> tuple[tuple[Wrench, ...], Array | None]:
        """What is exerted on `link` of each of the `joints`, from the loads on the group's links (moments about the
        link's origin).

        Loads hold everything but the group's own reactions: weight, working loads, inertia, and what groups solved
        earlier exert. Returns forces with moments about the joint's point, and the drive torque for a driver.
        """
