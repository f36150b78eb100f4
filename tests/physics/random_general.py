# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
"""Groups of higher class for the random machines: a pose at crank angle zero is drawn, all dimensions follow from it.

So each of them closes at zero; the oracle checks whether it can be followed from there to the tested angle.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from linkjax import Guide, Harmonic, Link, Vec
from linkjax.groups import Drive, General, Slot

if TYPE_CHECKING:
    from tests.physics.random_machines import Dice

LINKS = {  # with their pins: digits are existing points, letters new ones
    "triad": {"a": "EFH", "b": "1E", "c": "2F", "d": "3H"},
    "triad on a guide": {"a": "EFH", "b": "1E", "c": "2F", "d": "H"},
    "triad with a slot": {"a": "EF", "b": "1E", "c": "2F", "d": "3"},
    "tetrad": {"a": "1EF", "b": "2HI", "c": "EH", "d": "FI"},
    "two plates": {"a": "EFH", "b": "HIJ", "c": "1E", "d": "2F", "e": "3I", "f": "4J"},
    "dyad": {"a": "1E", "b": "2E"},
    "dyad with a slot": {"a": "1E", "b": "2"},
}
SLOTS = {"triad on a guide": ("d", ""), "triad with a slot": ("d", "a"), "dyad with a slot": ("b", "a")}  # block, on
LOOPS = tuple(LINKS)
DRIVERS = {"cylinder": {"lever": "1B", "barrel": "2V", "rod": "B"}, "inside": {"base": "1M", "disc": "MB", "arm": "2B"}}


class Pose(NamedTuple):
    """Positions at crank angle zero: points and directions of existing links, of every design."""

    points: dict[str, Any]
    directions: dict[str, Any]


def outer_count(kind: str) -> int:
    """The number of points to which a group is attached."""
    return sum(pin.isdigit() for pins in LINKS[kind].values() for pin in pins)


def group_of(kind: str, number: int, dice: Dice, outer: list[str], guide: Guide, pose: Pose, scaled: bool):
    """A group of random dimensions attached to these points, with its links; the offset of a guide is measured."""
    names = {p: f"{p}{number}" for pins in LINKS[kind].values() for p in pins}
    names |= {str(k): p for k, p in enumerate(outer, 1)}
    members = tuple((f"{link}{number}", tuple(names[p] for p in pins)) for link, pins in LINKS[kind].items())
    at, u, links = _measured(members, dice, pose, number, scaled)
    slots = ()
    if kind in SLOTS:
        block, on = (f"{name}{number}" if name else "" for name in SLOTS[kind])
        if on:
            guide = Guide(dict(members)[on][0], dice.between(-3, 3), 0.0, on)
        slots = (Slot(block, _through(guide, at[dict(members)[block][0]], at, {**pose.directions, **u})),)
    return General(members, tuple(outer), _sketch(at, pose, dice), slots), links


def driver_of(kind: str, dice: Dice, fixed: dict[str, Vec]) -> tuple[General, dict[str, Link]]:
    """A driving group between two points of the frame, with its links: a cylinder that moves a lever, or a dyad with a
    third link that is turned relative to the first."""
    members = tuple((link, tuple({"1": "A", "2": "P"}.get(p, p) for p in pins)) for link, pins in DRIVERS[kind].items())
    pose = Pose({p: np.asarray(at.x) + 1j * np.asarray(at.y) for p, at in fixed.items()}, {})
    at, u, links = _measured(members, dice, pose, 0, False)
    slots = ()
    if kind == "cylinder":
        guide = _through(Guide("P", dice.between(-3, 3), 0.0, "barrel"), at["B"], at, u)
        slots = (Slot("rod", guide),)
        start = ((at["B"] - at["P"]) / (u["barrel"] * np.exp(1j * np.asarray(guide.along)))).real
        drive = Drive("rod", "barrel", law=Harmonic(start, start + dice.between(-0.1, 0.1)))
    else:
        start, stop = dice.between(-1, 1), dice.between(-1, 1)
        drive = Drive("disc", "base", phase=np.angle(u["disc"] / u["base"]) - start, law=Harmonic(start, stop))
    return General(members, ("A", "P"), _sketch(at, pose, dice), slots, drive), links


def points_of(kind: str) -> dict[str, str]:
    """The moving points of a driving group to which others can be attached, with their links."""
    at = {"B": "lever" if kind == "cylinder" else "disc"}
    return at | {f"K0{link}": link for link in DRIVERS[kind]}


def _measured(members, dice: Dice, pose: Pose, number: int, scaled: bool):
    """Positions of all pins, directions of the links that have two, and the links."""
    new = [p for p in dict.fromkeys(p for _, pins in members for p in pins) if p not in pose.points]
    outer = [pose.points[p] + np.zeros(dice.count) for _, pins in members for p in pins if p in pose.points]
    middle, reach = np.mean(outer, 0), 0.1 + np.max(np.abs(np.asarray(outer) - outer[0]), 0)
    at = dict(pose.points)
    for p in new:
        at[p] = middle + reach * (dice.between(-1, 1) + 1j * dice.between(-1, 1))
    u: dict[str, Any] = {}
    links: dict[str, Link] = {}
    for link, pins in members:
        mark = f"K{number}{link}"
        if len(pins) == 1:
            links[link] = dice.link(0.0, mark)
            continue
        span = at[pins[1]] - at[pins[0]]
        u[link] = span / np.abs(span)
        made = dice.link(np.abs(span), mark, scaled and len(pins) == 2)
        more = {p: (at[p] - at[pins[0]]) / u[link] for p in pins[2:]}
        links[link] = dataclasses.replace(
            made, points={**made.points, **{p: Vec(z.real, z.imag) for p, z in more.items()}}
        )
    return at, u, links


def _through(guide: Guide, block, at, u) -> Guide:
    """The guide with the offset that leads a block through its position."""
    along = np.exp(1j * np.asarray(guide.along)) * u.get(guide.on, 1.0)
    return dataclasses.replace(guide, offset=((block - at[guide.through]) / along).imag)


def _sketch(at, pose: Pose, dice: Dice) -> dict[str, Vec]:
    """The positions of the new points, with small deviations."""
    new = {p: z for p, z in at.items() if p not in pose.points}
    return {p: Vec(z.real, z.imag) + dice.point(1e-3) for p, z in new.items()}
