"""The interface of every structural group (Assur group or driving crank).

Each kind of group is one file with assembly and rates (`solve`), the distance to singular positions (`margins`), and
joint reactions (`react`). A new kind is a new file; nothing else changes.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping, Set
from typing import Any, NamedTuple

import equinox as eqx
from jaxtyping import Array

from linkjax._vec import Vec
from linkjax.groups._class import classified
from linkjax.groups._guide import Guide
from linkjax.groups._law import AbstractLaw
from linkjax.groups._pairs import FRAME, Pair
from linkjax.groups._state import LinkState, PointState

BEYOND = 1e-6  # minus this is the margin where a group closes, but not in the assembly mode it was followed in


class Wrench(NamedTuple):
    """A force and its moment about a stated point."""

    force: Vec
    moment: Array


class Margin(NamedTuple):
    """Signed, dimensionless distance to a singular position, with derivatives with respect to the crank angle."""

    value: Array
    d: Array
    dd: Array


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
    def letter(self) -> str:
        """P for a sliding joint, G for gears in mesh, otherwise R."""
        return "P" if self.slides else "G" if self.meshes else "R"


class Coupling(NamedTuple):
    """What gears in mesh keep constant: the sum of link angles (rad) and of slider displacements along their guides
    (m), each times its factor."""

    angles: dict[str, Array]
    ways: dict[str, Array]


def named(kind: str) -> str:
    """A kind of group with its article."""
    return f"{'an' if kind[0] == 'R' else 'a'} {kind.replace('_', ' ')}"


def check_side(kind: str, side: int) -> None:
    """Raise ValueError for an invalid side."""
    if side not in (1, -1):
        raise ValueError(f"side of {named(kind)} must be 1 or -1, but is {side!r}")


def check_apart(kind: str, one: str, other: str) -> None:
    """Raise ValueError where both ends of a group are attached to the same point."""
    if one == other:
        raise ValueError(f"both ends of {named(kind)} are attached to the point {one!r}; name two points")


class AbstractGroup(eqx.Module):
    """A structural group: one or more links attached to points that are already known."""

    kind: eqx.AbstractClassVar[str]

    @abc.abstractmethod
    def link_names(self) -> tuple[str, ...]:
        """Links of the group, in order."""

    def pairs(self) -> list[Pair]:
        """The outer pairs, as if attached to the frame, and the inner pairs."""
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
        """For each link of the group: the point at its origin, and the point at its far end (None if there is none)."""

    def holds(self) -> Mapping[str, tuple[str, str | None]]:
        """For each link of the group: the point at its origin, and the point on the x axis that the group uses (None
        for the link's own axis)."""
        return self.pins()

    def brings(self) -> tuple[str, ...]:
        """Pins that the group creates."""
        ends, needed = self.pins().values(), self.needs()
        new = [*(far for _, far in ends if far is not None), *(first for first, _ in ends if first not in needed)]
        return tuple(dict.fromkeys(new))

    def shared(self) -> Mapping[str, str]:
        """Pins that may be coupler points of its links, each with the link that it belongs to ("" for a point that
        existed before)."""
        return {}

    def lacking(self, links: Mapping[str, Any]) -> tuple[str, str] | None:
        """What the definition of its links lacks, as problem and remedy; None if nothing is missing."""
        return None

    def driving(self) -> str | None:
        """The link that the drive moves; None for a group without a drive. A group with a drive comes first."""
        return None

    def follows(self) -> AbstractLaw | None:
        """The motion law of its drive, independent of the loads; None for a drive whose speed depends on the loads."""
        return None

    def on_frame(self) -> tuple[str, ...]:
        """Points that must belong to the frame."""
        return ()

    def passive(self) -> bool:
        """Whether its constraints are redundant."""
        return False

    def wheels(self) -> tuple[Any, ...]:
        """The gears and racks of the group, each as a separate `Gear`, `Rack` or `Pinion`."""
        return ()

    def lies_on(self) -> tuple[tuple[str, str], ...]:
        """Which points must belong to which existing links, as (link or "frame", point)."""
        return ()

    def slides_on(self) -> tuple[tuple[str, str], ...]:
        """Which links must slide along which others, as (link, link or "frame")."""
        return ()

    def guides(self) -> tuple[Guide, ...]:
        """Guides on the frame or on existing links; each must pass through a point of its link."""
        return ()

    def translating(self) -> tuple[str, ...]:
        """Links of the group that never turn."""
        return ()

    @abc.abstractmethod
    def joints(self) -> tuple[Joint, ...]:
        """The outer and inner joints of the group, in the order of `react`."""

    @abc.abstractmethod
    def solve(
        self, links: Mapping[str, Any], states: dict[str, LinkState], points: dict[str, PointState], phi: Array
    ) -> tuple[dict[str, LinkState], dict[str, PointState]]:
        """States of the group's links and of the pins that it creates, from the known states; of `links` only `length`
        is used."""

    @abc.abstractmethod
    def singular_positions(self) -> tuple[str, ...]:
        """Names of its margins."""

    @abc.abstractmethod
    def margins(
        self, links: Mapping[str, Any], states: dict[str, LinkState], points: dict[str, PointState], phi: Array
    ) -> dict[str, Margin]:
        """Signed margins by the name of the singular position."""

    def followed(self, counted: Set[str]) -> bool:
        """Whether it must be followed along the cycle, given the links whose turns are `counted` in closed form. The
        `solve` and `margins` of such a group take its reference path (`kinematics.prepared`) as a last argument."""
        return False

    def counts(self) -> tuple[str, ...]:
        """Its links whose turns are counted in closed form unless the group is followed."""
        return ()

    def returns(self, path: Any) -> Array | None:
        """Whether the group returns to its initial position after the cycle that its path covers; None where nothing
        shows it."""
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
        """Force and moment on `link` of each of the `joints`, from the loads on the group's links (moments about the
        link's origin).

        Loads include everything except the group's own reactions: weight, working loads, inertia, and reactions of
        groups solved earlier. Returns forces with moments about the joint's point, and the drive torque for a driver.
        """
