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


class PointState(NamedTuple):
    """Position of a point and its first and second kinematic coefficients (derivatives by the crank angle φ)."""

    r: Vec
    dr: Vec
    ddr: Vec


class LinkState(NamedTuple):
    """Orientation of a link as the unit vector `u` along it, with ω' = dθ/dφ and ε' = d²θ/dφ²."""

    u: Vec
    w: Array
    e: Array


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
    `by` is "frame", a link, or None for the link that the point belongs to."""

    name: str
    point: str
    link: str
    by: str | None = None


def check_side(kind: str, side: int) -> None:
    """Raise ValueError for a side that is none."""
    if side not in (1, -1):
        raise ValueError(f"side of an {kind} must be 1 or -1, but is {side!r}")


class AbstractGroup(eqx.Module):
    """A structural group: closes one or more links onto points that are already known."""

    kind: eqx.AbstractClassVar[str]
    formula: eqx.AbstractClassVar[str]
    dead_positions: eqx.AbstractClassVar[tuple[str, ...]]

    @abc.abstractmethod
    def link_names(self) -> tuple[str, ...]:
        """Links the group brings in, in order."""

    @abc.abstractmethod
    def needs(self) -> tuple[str, ...]:
        """Points that must exist before the group is attached."""

    @abc.abstractmethod
    def pins(self) -> Mapping[str, tuple[str, str | None]]:
        """For each link brought in: the point at its origin, and the point at its far end (None where it has none)."""

    def on_frame(self) -> tuple[str, ...]:
        """Points that must belong to the frame."""
        return ()

    def translating(self) -> tuple[str, ...]:
        """Links brought in that never turn."""
        return ()

    @abc.abstractmethod
    def joints(self) -> tuple[Joint, ...]:
        """The joints that attach the group and those inside it, in the order of `react`."""

    @abc.abstractmethod
    def solve(
        self, links: Mapping[str, Any], points: dict[str, PointState], phi: Array
    ) -> tuple[dict[str, LinkState], dict[str, PointState]]:
        """States of the links brought in and of the pins that the group creates; of `links` only `length` is used."""

    @abc.abstractmethod
    def margins(self, links: Mapping[str, Any], points: dict[str, PointState]) -> dict[str, Margin]:
        """Signed margins by the name of the dead position."""

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
