"""Mechanisms out of pylinkage's JSON.

The format is that of `pylinkage.mechanism.mechanism_to_dict` (pylinkage 1.3).
"""

from __future__ import annotations

import cmath
import json
import math
from collections.abc import Mapping
from typing import Any

from linkjax._units import nearest
from linkjax._vec import Vec
from linkjax.groups import RRP, RRR, AbstractGroup, Crank, Guide
from linkjax.mechanism import Link, Mechanism, StructureError

Drawn = Mapping[str, Any]
TEXTS = ("type", "name", "motor_joint", "ref_joint1_id", "ref_joint2_id")
NUMBERS = ("distance", "angle", "angular_velocity", "initial_angle")
PLACES = ("position", "axis", "line_point")
LEGACY = {"Static", "Crank", "Revolute", "Fixed", "Prismatic"}


def from_pylinkage(document: str | Mapping[str, Any]) -> Mechanism:
    """The mechanism that pylinkage's JSON describes: a text, or what `json.load` or `mechanism_to_dict` gave.

    Points and links have the ids of joints and links there, lengths are taken as metres. A driver becomes the crank,
    whose angle zero is its initial angle; revolute joints with two links RRR groups, prismatic joints RRP groups with a
    block that has the joint's name (`<id>_block` where it has none), trackers and further joints of a link marked
    points. Links have no masses: pylinkage knows none. Raises `StructureError` for what linkjax cannot express, by the
    name of the joint or link: several drivers, drivers that go to and fro, trackers between two links, groups of higher
    class, and for a document that is none of pylinkage's mechanisms.
    """
    return _Reader(_read(document)).mechanism()


def _read(document: str | Mapping[str, Any]) -> Mapping[str, Any]:
    if isinstance(document, str):
        try:
            document = json.loads(document)
        except json.JSONDecodeError as error:
            problem = f"not JSON: {error.msg} in line {error.lineno}"
            raise StructureError("pylinkage", problem, "write it with pylinkage's mechanism_to_json") from error
    if not isinstance(document, Mapping) or not all(isinstance(document.get(k), list) for k in ("joints", "links")):
        raise StructureError("pylinkage", "has no lists of joints and links", "write it with mechanism_to_json")
    for key in ("joints", "links"):
        for number, each in enumerate(document[key]):
            if not isinstance(each, Mapping) or not isinstance(each.get("id"), str):
                raise StructureError(f"{key}[{number}]", "has no id", "write the file with mechanism_to_json")
            _check(each)
            if key == "links" and not _are(each.get("joints"), str):
                problem = f"joints is {each.get('joints')!r}, which is no list of ids"
                raise StructureError(each["id"], problem, 'write the ids of its joints, e.g. ["A", "B"]')
    for joint in document["joints"]:
        if joint.get("type") in LEGACY:
            remedy = "read it with pylinkage and write it with mechanism_to_json"
            raise StructureError(joint["id"], f"has the type {joint['type']!r} of an older format", remedy)
    return document


def _check(element: Drawn) -> None:
    """Raise `StructureError` where a key of a joint or link is not what it should be."""
    for key, value in element.items():
        what, remedy = "", ""
        if key in TEXTS and not isinstance(value, str | None):
            what, remedy = "text", "write it in double quotes"
        elif key in NUMBERS and not _are([value], int, float):
            what, remedy = "finite number", "write a number"
        elif key in PLACES and not (isinstance(value, list | tuple) and len(value) == 2 and _are(value, int, float)):
            what, remedy = "place", "write two numbers, [x, y]"
        if what:
            raise StructureError(element["id"], f"{key} is {value!r}, which is no {what}", remedy)


def _are(values: object, *kinds: type) -> bool:
    """Whether these are a list of texts, or of finite numbers."""
    return isinstance(values, list | tuple) and all(
        isinstance(each, kinds) and not isinstance(each, bool) and (isinstance(each, str) or math.isfinite(each))
        for each in values
    )


class _Reader:
    """What has its place so far: `on[body][joint]` are places in the axes of a body, the frame among them."""

    def __init__(self, document: Mapping[str, Any]):
        self.joints: dict[str, Drawn] = {joint["id"]: joint for joint in document["joints"]}
        self.bars: list[Drawn] = list(document["links"])
        self.on: dict[str, dict[str, complex]] = {"frame": {}}
        self.lengths: dict[str, float] = {}
        self.groups: list[AbstractGroup] = []
        for bar in self.bars:
            for joint in bar["joints"]:
                if joint not in self.joints:
                    raise StructureError(bar["id"], f"joint {joint!r} is not there", nearest(joint, self.joints))

    def mechanism(self) -> Mechanism:
        """Frame and driver, then everything that hangs on what is there, until nothing is left."""
        self.frame()
        self.driver()
        while self.bars:
            if not (self.marked() or self.tracked() or self.slid() or self.met()):
                names = ", ".join(bar["id"] for bar in self.bars)
                problem = f"hang on nothing as a group of two: {names}"
                raise StructureError("links", problem, "build groups of higher class with linkjax.groups.General")
        while self.tracked():
            pass
        for joint in self.joints:
            if not self.bodies(joint):
                raise StructureError(joint, "is on no link that has a place", "put it on a link, or delete it")
        links = {}
        for group in self.groups:
            for link, ends in group.pins().items():
                points = {p: Vec(at.real, at.imag) for p, at in self.on[link].items() if p not in ends}
                links[link] = Link(length=self.lengths.get(link, 0.0), points=points)
        fixed = {p: Vec(at.real, at.imag) for p, at in self.on["frame"].items()}
        return Mechanism(fixed, links, self.groups)

    def at(self, joint: str) -> complex:
        """Where a joint is drawn."""
        if "position" not in self.joints[joint]:
            raise StructureError(joint, "has no position", "write x and y")
        return complex(*self.joints[joint]["position"])

    def bodies(self, joint: str) -> list[str]:
        """Bodies that a joint is on."""
        return [body for body, held in self.on.items() if joint in held]

    def kind(self, joint: str) -> str:
        return self.joints[joint].get("type", "revolute")

    def frame(self) -> None:
        """Ground joints, motors, and trackers that track nothing."""
        still = [joint for joint in self.joints if self.kind(joint) == "ground"]
        for bar in self.bars:
            still += bar["joints"] if bar.get("type") == "ground" else []
            still += [bar["motor_joint"]] if bar.get("motor_joint") in self.joints else []
        still += [j for j, d in self.joints.items() if self.kind(j) == "tracker" and not d.get("ref_joint1_id")]
        self.on["frame"] = {joint: self.at(joint) for joint in still}
        self.bars = [bar for bar in self.bars if bar.get("type") != "ground"]

    def driver(self) -> None:
        """The crank."""
        drivers = [bar for bar in self.bars if bar.get("type") in ("driver", "arc_driver")]
        if len(drivers) != 1:
            names = ", ".join(bar["id"] for bar in drivers) or "none"
            raise StructureError("links", f"there must be one driver, but there are: {names}", "mobility is one")
        (bar,) = drivers
        pins, speed = bar["joints"], float(bar.get("angular_velocity", 1.0))
        if bar["type"] == "arc_driver":
            problem, remedy = (
                "goes to and fro with jumps of its speed",
                "write a driver; in Python give it a Harmonic law",
            )
        elif len(pins) != 2 or bar.get("motor_joint") not in pins:
            problem, remedy = "has no motor joint and one other", "put further joints on a link of their own"
        elif speed == 0:
            problem, remedy = "does not turn", "write an angular velocity"
        else:
            pivot = bar["motor_joint"]
            (end,) = (pin for pin in pins if pin != pivot)
            turns, phase = (1 if speed > 0 else -1), float(bar.get("initial_angle", 0.0))
            self.groups.append(Crank(bar["id"], pivot, end, turns, phase))
            self.hang(bar, pivot, end)
            return
        raise StructureError(bar["id"], problem, remedy)

    def hang(self, bar: Drawn, origin: str, far: str) -> None:
        """Give a link its place: its axis from one joint to another, its further joints where they are drawn."""
        axis = self.at(far) - self.at(origin)
        if not axis:
            raise StructureError(bar["id"], f"joints {origin!r} and {far!r} are drawn at one place", "move one")
        places = {
            j: (self.at(j) - self.at(origin)) / (axis / abs(axis)) for j in bar["joints"] if j not in (origin, far)
        }
        self.mark(bar["id"], places)
        self.on[bar["id"]] = {origin: 0j, far: complex(abs(axis)), **places}
        self.lengths[bar["id"]] = abs(axis)
        self.bars.remove(bar)

    def mark(self, link: str, places: Mapping[str, complex]) -> None:
        """Refuse further joints of a link that cannot be points of it."""
        for joint in places:
            if self.bodies(joint) or self.kind(joint) == "prismatic":
                problem = f"could not move: joint {joint!r} is held twice"
                raise StructureError(link, problem, "take the joint off one of its links")

    def marked(self) -> bool:
        """A bar with two joints of one body is part of that body."""
        for bar in self.bars:
            placed = [j for j in bar["joints"] if self.bodies(j)]
            for held in self.on.values():
                one, two = ([j for j in placed if j in held] + [None, None])[:2]
                if one is None or two is None:
                    continue
                if held[two] == held[one]:
                    raise StructureError(bar["id"], f"joints {one!r} and {two!r} are drawn at one place", "move one")
                scale = (held[two] - held[one]) / (self.at(two) - self.at(one))
                rest = [j for j in bar["joints"] if j not in held]
                places = {j: held[one] + (self.at(j) - self.at(one)) * scale for j in rest}
                self.mark(bar["id"], places)
                held.update(places)
                self.bars.remove(bar)
                return True
            if len(placed) > 1:
                problem = f"joins {placed[0]!r} and {placed[1]!r}, which have their places already"
                raise StructureError(bar["id"], problem, "delete it: the mechanism could not move")
        return False

    def tracked(self) -> bool:
        """A tracker is a point of the link that its two joints are on."""
        for joint, drawn in self.joints.items():
            if self.kind(joint) != "tracker" or self.bodies(joint):
                continue
            one, two = drawn.get("ref_joint1_id", ""), drawn.get("ref_joint2_id", "")
            for held in self.on.values():
                if one in held and two in held:
                    axis = held[two] - held[one]
                    away = cmath.rect(float(drawn.get("distance", 0.0)), float(drawn.get("angle", 0.0)))
                    held[joint] = held[one] + away * axis / abs(axis)
                    return True
            if self.bodies(one) and self.bodies(two):
                problem = f"tracks {one!r} and {two!r}, which are on no common link"
                raise StructureError(joint, problem, "linkjax's points are fixed to a link; delete it")
        return False

    def hanging(self, joint: str) -> list[tuple[Drawn, str]]:
        """Bars with this joint and one that has its place, with that one."""
        bars = [bar for bar in self.bars if joint in bar["joints"]]
        return [(bar, j) for bar in bars for j in bar["joints"] if j != joint and self.bodies(j)]

    def slid(self) -> bool:
        """A prismatic joint on a bar that hangs on something: an RRP, its guide given from the crank's pivot."""
        for joint, drawn in self.joints.items():
            if self.kind(joint) != "prismatic" or self.bodies(joint) or not (found := self.hanging(joint)):
                continue
            (bar, origin), base = found[0], self.groups[0].needs()[0]
            axis, line = (complex(*drawn.get(key, (0.0, 0.0))) for key in ("axis", "line_point"))
            axis = axis / abs(axis) if axis else 1 + 0j
            offset = ((line - self.at(base)) / axis).imag
            side = 1 if ((self.at(joint) - self.at(origin)) / axis).real >= 0 else -1
            block = str(drawn.get("name") or f"{joint}_block")
            block = f"{joint}_block" if block == joint else block
            guide = Guide(base, cmath.phase(axis), offset)
            self.groups.append(RRP(bar["id"], block, origin, joint, guide, side))
            self.hang(bar, origin, joint)
            self.on[block] = {joint: 0j}
            return True
        return False

    def met(self) -> bool:
        """A revolute joint on two bars that hang on something: an RRR."""
        for joint in self.joints:
            if self.kind(joint) != "revolute" or self.bodies(joint) or len(found := self.hanging(joint)) < 2:
                continue
            (one, a), (two, b) = found[:2]
            if a == b:
                problem = f"joins {a!r} and {joint!r}, as {one['id']!r} does"
                raise StructureError(two["id"], problem, "delete one of them")
            left = ((self.at(joint) - self.at(a)) * (self.at(b) - self.at(a)).conjugate()).imag
            self.groups.append(RRR((one["id"], two["id"]), a, b, joint, 1 if left >= 0 else -1))
            self.hang(one, a, joint)
            self.hang(two, b, joint)
            return True
        return False
