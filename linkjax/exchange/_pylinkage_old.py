"""Linkages as pylinkage 0.6 to 0.9 wrote them: joints that name the joints they are attached to, and no links.

The format is that of `pylinkage.linkage.serialization` up to version 0.9. The places of its joints are approximate.
pylinkage computes each joint from its lengths and takes the solution nearest to the drawing; so does this reader.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from typing import Any

from linkjax._units import nearest
from linkjax.mechanism import StructureError

Drawn = Mapping[str, Any]
KINDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {  # keys of its anchors, and of its numbers
    "Static": ((), ()),
    "Crank": (("joint0",), ("distance", "angle")),
    "Fixed": (("joint0", "joint1"), ("distance", "angle")),
    "Revolute": (("joint0", "joint1"), ("distance0", "distance1")),
    "Prismatic": (("joint0", "joint1", "joint2"), ("revolute_radius",)),
}
ALIASES = {"Pivot": "Revolute", "Linear": "Prismatic"}
OLD = {*KINDS, *ALIASES}


def of_old(elements: list[Any]) -> dict[str, Any]:
    """The joints and links of an old linkage, at the places computed from its lengths.

    Links are named after their joint, as in pylinkage's later `to_mechanism`. Raises `StructureError` for joints that
    lack a key, are attached to each other, or are out of reach of their lengths.
    """
    joints: dict[str, Drawn] = {}
    for number, joint in enumerate(elements):
        if not isinstance(joint, Mapping) or not isinstance(joint.get("name"), str):
            raise StructureError(f"joints[{number}]", "has no name", "give it a name")
        if joint["name"] in joints:
            raise StructureError(joint["name"], "is the name of two joints", "give one of them another name")
        if (kind := joint.get("type")) not in (*KINDS, *ALIASES):
            raise StructureError(joint["name"], f"has the type {kind!r}", f"known here: {', '.join(KINDS)}")
        joints[joint["name"]] = joint
    made = _Made()
    waiting = dict(joints)
    while waiting:
        ready = [name for name, joint in waiting.items() if made.has(name, joint, joints)]
        for name in ready:
            made.add(name, waiting.pop(name))
        if not ready:
            problem = "are attached to each other, so none of them can be placed"
            raise StructureError(", ".join(waiting), problem, "attach one of them to joints that are placed")
    return {"joints": list(made.joints.values()), "links": made.links}


def _kind(joint: Drawn) -> str:
    kind = str(joint["type"])
    return ALIASES.get(kind, kind)


def _number(name: str, joint: Drawn, key: str) -> float:
    value = joint.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e20:
        raise StructureError(name, f"{key} is {value!r}, which is not a finite number", "write a number")
    return float(value)


class _Made:
    """Joints and links in the present format, those converted so far."""

    def __init__(self):
        self.joints: dict[str, dict[str, Any]] = {}
        self.links: list[dict[str, Any]] = []
        self.inline: dict[tuple[str, str], str] = {}

    def has(self, name: str, joint: Drawn, joints: Mapping[str, Drawn]) -> bool:
        """Whether all anchors of a joint are placed; inline anchors are placed here."""
        for key in KINDS[_kind(joint)][0]:
            anchor = joint.get(key)
            if not isinstance(anchor, Mapping):
                raise StructureError(name, f"{key} is {anchor!r}, which is not a joint", 'write e.g. {"ref": "A"}')
            to = anchor.get("ref")
            if not anchor.get("inline") and (not isinstance(to, str) or to not in joints):
                raise StructureError(name, f"{key} is {to!r}, which does not exist", nearest(str(to), joints))
            if anchor.get("inline") and (name, key) not in self.inline:
                at = complex(_number(name, anchor, "x"), _number(name, anchor, "y"))
                own = anchor.get("name")
                if not isinstance(own, str) or own in joints or (own in self.joints and self.at(own) != at):
                    own = f"{name}_{key}"
                self.inline[name, key] = own
                self.ground(own, at)
            if self.anchor(name, key, anchor) not in self.joints:
                return False
        return True

    def anchor(self, name: str, key: str, anchor: Drawn) -> str:
        """The anchor of a joint under one of its keys."""
        return self.inline[name, key] if anchor.get("inline") else anchor["ref"]

    def ground(self, name: str, at: complex) -> None:
        self.joints[name] = {"id": name, "type": "ground", "position": [at.real, at.imag]}

    def at(self, name: str) -> complex:
        return complex(*self.joints[name]["position"])

    def add(self, name: str, joint: Drawn) -> None:
        """Place a joint by its lengths, at the solution nearest to its drawn place, and add its links."""
        kind = _kind(joint)
        drawn = 0j if kind == "Fixed" else complex(_number(name, joint, "x"), _number(name, joint, "y"))
        if kind == "Static":
            self.ground(name, drawn)
            return
        keys, lengths = KINDS[kind]
        anchors = [self.anchor(name, key, joint[key]) for key in keys]
        numbers = [_number(name, joint, key) for key in lengths]
        on = [self.at(anchor) for anchor in anchors]
        found: dict[str, Any] = {"id": name, "type": "revolute"}
        if kind == "Crank":
            away = drawn - on[0]
            at = on[0] + numbers[0] * (away / abs(away) if away else 1.0)
            self.links.append({"id": f"{name}_driver", "type": "driver", "joints": [anchors[0], name],
                               "motor_joint": anchors[0], "angular_velocity": numbers[1]})  # fmt: skip
        elif kind == "Fixed":
            at = on[0] + cmath.rect(numbers[0], numbers[1] + cmath.phase(on[1] - on[0]))
            refs = {"ref_joint1_id": anchors[0], "ref_joint2_id": anchors[1]}
            found = {**found, "type": "tracker", **refs, "distance": numbers[0], "angle": numbers[1]}
        elif kind == "Revolute":
            at = self.nearest(name, drawn, _circles(on[0], numbers[0], on[1], numbers[1]))
            for i, anchor in enumerate(anchors, 1):
                self.links.append({"id": f"{name}_link{i}", "type": "link", "joints": [anchor, name]})
        else:
            at = self.nearest(name, drawn, _circle_and_line(on[0], numbers[0], on[1], on[2]))
            self.links.append({"id": f"{name}_link1", "type": "link", "joints": [anchors[0], name]})
            self.links.append({"id": f"{name}_guide", "type": "link", "joints": [*anchors[1:], name]})
        self.joints[name] = {**found, "position": [at.real, at.imag]}

    @staticmethod
    def nearest(name: str, drawn: complex, places: tuple[complex, ...]) -> complex:
        if not places:
            raise StructureError(name, "is out of reach of its anchors", "correct its lengths or its anchors")
        return min(places, key=lambda place: abs(place - drawn))


def _circles(a: complex, r: float, b: complex, s: float) -> tuple[complex, ...]:
    """The intersections of two circles."""
    d = abs(b - a)
    if d == 0:
        return ()
    foot = (d * d + r * r - s * s) / (2 * d)
    height = math.sqrt(max(r * r - foot * foot, 0.0))
    if r * r < foot * foot * (1 - 1e-12):
        return ()
    along = (b - a) / d
    return a + along * complex(foot, height), a + along * complex(foot, -height)


def _circle_and_line(a: complex, r: float, b: complex, c: complex) -> tuple[complex, ...]:
    """The intersections of a circle and the line through two points."""
    if b == c:
        return ()
    along = (c - b) / abs(c - b)
    foot = (a - b) / along
    if abs(foot.imag) > abs(r) * (1 + 1e-12):
        return ()
    half = math.sqrt(max(r * r - foot.imag**2, 0.0))
    return b + along * (foot.real + half), b + along * (foot.real - half)
