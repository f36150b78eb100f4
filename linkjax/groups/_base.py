"""The interface of every structural group (Assur group or driving crank).

Each kind of group is one file with assembly and rates (`solve`), the distance to singular positions (`margins`), and
joint reactions (`react`). A new kind is a new file; nothing else changes.

Each group states its closure once: positions have a closed form; velocities, accelerations and reactions follow from
one small Jacobian. Reactions use its transpose, with loads taken in reverse order of assembly. The tests compare with
nested differentiation of the position.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping, Set
from typing import Any, NamedTuple

import equinox as eqx
from jaxtyping import Array

from linkjax._vec import Vec
from linkjax.groups._drive import Drive
from linkjax.groups._guide import Guide, Slot
from linkjax.groups._law import AbstractLaw
from linkjax.groups._lost import Lost, Told
from linkjax.groups._pairs import FRAME, Joint
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


class Coupling(NamedTuple):
    """What gears in mesh keep constant: the sum of link angles (rad) and of slider displacements along their guides
    (m), each times its factor. The `constant` is None where a sketch gives it."""

    angles: dict[str, Array]
    ways: dict[str, Array]
    constant: Any


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

    def needs(self) -> tuple[str, ...]:
        """Points that must exist before the group is attached: those of its outer pins, of its guides and of gears."""
        return tuple(dict.fromkeys([*self._pinned(), *self._aligned()]))

    def _pinned(self) -> list[str]:
        """Points of its outer pins."""
        inside = self.link_names()
        return [joint.point for joint in self.joints() if joint.pins and joint.by not in inside]

    def _aligned(self) -> list[str]:
        """Points of existing links that locate guides and gears."""
        return [*(guide.through for guide in self.guides()), *(point for _, point in self.lies_on())]

    @abc.abstractmethod
    def pins(self) -> Mapping[str, tuple[str, str | None]]:
        """For each link of the group: the point at its origin, and the point at its far end (None if there is none)."""

    def holds(self) -> Mapping[str, tuple[str, str | None]]:
        """For each link of the group: the point at its origin, and the point on the x axis that the group uses (None
        for the link's own axis)."""
        return self.pins()

    def brings(self) -> tuple[str, ...]:
        """Pins that the group creates."""
        ends, shared = self.pins().values(), self.shared()
        there = {*self.needs()} - ({*self._aligned()} - {*self._pinned()})  # no link begins at a point of a guide alone
        far = [far for _, far in ends if far is not None and shared.get(far) != ""]
        return tuple(dict.fromkeys([*far, *(first for first, _ in ends if first not in there)]))

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

    def as_drive(self) -> Drive | None:
        """Its drive, as in a drawing; None for a group without one."""
        link = self.driving()
        return None if link is None else Drive(link, law=self.follows())

    def drive_slides(self) -> bool:
        """Whether its drive moves a link along a guide (m), and does not turn it (rad)."""
        link = self.driving()
        return link is not None and any(joint.slides and joint.link == link for joint in self.joints())

    def shaft(self) -> int | None:
        """Sense of rotation of a driving crank on the frame, whose shaft can carry a flywheel: +1 for
        counter-clockwise, -1 for clockwise. None for any other group."""
        return None

    def turning(self, sense: int) -> AbstractGroup | None:
        """A driving crank on the frame without its motion law: it turns in this sense from where the law begins. None
        for any other group."""
        return None

    def on_frame(self) -> tuple[str, ...]:
        """Points that must belong to the frame."""
        return ()

    def passive(self) -> bool:
        """Whether its constraints are redundant."""
        return False

    def numerical(self) -> bool:
        """Whether it is a group of higher class, solved numerically from a sketch as `General` is."""
        return False

    def spots(self) -> Mapping[str, Vec]:
        """Approximate positions of its points at crank angle zero (m), which select its assembly mode."""
        return {}

    def continues(self) -> bool:
        """Whether its motion continues smoothly through change points, where its assembly modes coincide."""
        return False

    def continued(self) -> AbstractGroup | None:
        """The same group with a motion that continues through change points; None for a kind without this choice."""
        return None

    def wheels(self) -> tuple[Any, ...]:
        """The gears and racks of the group, each as a separate `Gear`, `Rack` or `Pinion`."""
        return ()

    def lies_on(self) -> tuple[tuple[str, str], ...]:
        """Which points must belong to which existing links, as (link or "frame", point)."""
        return ()

    def slides_on(self) -> tuple[tuple[str, str], ...]:
        """Which links must slide along which others, as (link, link or "frame")."""
        return ()

    def sliding(self) -> tuple[Slot, ...]:
        """Its sliding joints: each block with its guide, which may be on a link of the group itself."""
        return ()

    def guides(self) -> tuple[Guide, ...]:
        """Guides on the frame or on existing links; each must pass through a point of its link."""
        inside = self.link_names()
        return tuple(slot.guide for slot in self.sliding() if slot.guide.on not in inside)

    def translating(self) -> tuple[str, ...]:
        """Links of the group that never turn: blocks on the frame, and blocks on these."""
        slots, still = self.sliding(), {FRAME}
        for _ in slots:
            still |= {slot.block for slot in slots if slot.guide.on in still}
        return tuple(name for name in self.link_names() if name in still)

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

    def lost(self, at: Lost) -> Told | None:
        """The problem and the remedy, for messages, where its least margin is not positive; None where the general
        message says enough: it cannot be assembled there, because of its `shortfall`, or has a change point."""
        return at.returning()

    def shortfall(
        self, side: str, links: Mapping[str, Any], states: Mapping[str, LinkState], points: Mapping[str, PointState]
    ) -> str:
        """A phrase for messages: why it cannot be assembled at a crank angle, in its own lengths; "" where its margin
        has to say enough."""
        return ""

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
