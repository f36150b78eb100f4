"""Mechanisms from pylinkage's JSON.

The format is that of `pylinkage.mechanism.mechanism_to_dict` (pylinkage 1.3), or that of the linkages of pylinkage 0.6
to 0.9.
"""

from __future__ import annotations

import cmath
import itertools
from collections.abc import Mapping
from typing import Any, NamedTuple

from linkjax._units import nearest
from linkjax._vec import Vec
from linkjax.exchange._pylinkage_drive import DISAGREE, motion_of
from linkjax.exchange._pylinkage_file import Drawn, read
from linkjax.exchange._pylinkage_names import Names
from linkjax.groups import FRAME, Drive, Guide, Slot
from linkjax.mechanism import Link, Mechanism, StructureError, linkage

GROUND = "\ud800"  # the frame among the bodies; no link has such an id
SMALLEST = 1e-30  # m, as in scene files: smaller coordinates are zero
ONE_PLACE = 1e-12  # of the drawing's size: joints nearer to each other coincide


class Imported(NamedTuple):
    """A mechanism from a pylinkage file.

    `points` has the joint ids that were changed, with their new names; `links` has those of links and sliders.
    `notes` has a line for each difference between its motion and that in pylinkage.
    """

    mechanism: Mechanism
    points: dict[str, str]
    links: dict[str, str]
    notes: tuple[str, ...]


def from_pylinkage(document: str | Mapping[str, Any]) -> Mechanism:
    """The mechanism that pylinkage's JSON describes: a string, or the result of `json.load` or `mechanism_to_dict`.

    It is the mechanism of `read_pylinkage`, which documents what is read and also returns the names that were changed.
    Coordinates are in metres. Raises `StructureError`, naming the element, for anything that it cannot read.
    """
    return read_pylinkage(document).mechanism


def read_pylinkage(document: str | Mapping[str, Any]) -> Imported:
    """The mechanism that pylinkage's JSON describes, with the names that were changed: `document` is a string, or the
    result of `json.load` or `mechanism_to_dict`.

    Points and links have the ids of joints and links in the file. An id that is not allowed in a scene file is changed:
    `crank.motor_ground.A` becomes `crank_motor_ground_A`. Coordinates are in metres. At crank angle zero every joint is
    where it is drawn, and lengths are the distances in the drawing; a tracker is placed by its distance and angle. A
    driver becomes the crank, an arc driver a crank that oscillates over its arc. A prismatic joint becomes a slider
    with the joint's name (`<id>_block` where it has none). Two links that share two joints, and three links that form a
    triangle, become one link. Groups may be of any class. Links have no masses.

    Raises `StructureError`, naming the joint or link, for what linkjax cannot express: several drivers, trackers
    between two links, and joints without a link (pylinkage writes cams in this way). It is also raised where an initial
    angle, an arc or a slide line disagrees with the drawing by more than 1e-3 of its size, for mechanisms that cannot
    move or are unconstrained, and for a document that is not a mechanism of pylinkage.
    """
    return _Reader(read(document)).imported()


class _Reader:
    """The rigid bodies of a file: `on[body]` has the joints of each, also of the frame; `spots` has places."""

    def __init__(self, document: Drawn):
        self.joints: dict[str, Drawn] = {joint["id"]: joint for joint in document["joints"]}
        self.bars: dict[str, Drawn] = {bar["id"]: bar for bar in document["links"] if bar.get("type") != "ground"}
        for bar in document["links"]:
            for joint in [*bar["joints"], *([bar["motor_joint"]] if bar.get("motor_joint") else [])]:
                if joint not in self.joints:
                    raise StructureError(bar["id"], f"joint {joint!r} does not exist", nearest(joint, self.joints))
        places = {name: joint.get("position") for name, joint in self.joints.items()}
        self.spots = {name: complex(*map(_plain, at)) for name, at in places.items() if at is not None}
        apart = [abs(a - b) for a, b in itertools.combinations(self.spots.values(), 2)]
        self.size = max(apart, default=0.0)
        self.bar, self.pivot, self.end = self.driver()
        self.on: dict[str, list[str]] = {GROUND: self.still(document["links"])}
        self.on |= {name: list(dict.fromkeys(bar["joints"])) for name, bar in self.bars.items()}
        self.on[self.bar["id"]] = [self.pivot, self.end]
        self.slides = self.guides()

    # ---- the contents of the file

    def at(self, joint: str) -> complex:
        """The drawn place of a joint."""
        if joint not in self.spots:
            raise StructureError(joint, "has no position", "write x and y")
        return self.spots[joint]

    def kind(self, joint: str) -> str:
        return self.joints[joint].get("type") or "revolute"

    def refs(self, joint: str) -> tuple[str, str] | None:
        """The two joints that a tracker tracks; None for a tracker without them, and for other joints."""
        one, two = (self.joints[joint].get(key) for key in ("ref_joint1_id", "ref_joint2_id"))
        return (one, two) if self.kind(joint) == "tracker" and one and two else None

    def still(self, bars: list[Drawn]) -> list[str]:
        """Joints on the frame: ground joints, the motor's, and trackers that track nothing."""
        still = [joint for joint in self.joints if self.kind(joint) == "ground"]
        for bar in bars:
            still += bar["joints"] if bar.get("type") == "ground" else []
        still += [j for j in self.joints if self.kind(j) == "tracker" and self.refs(j) is None]
        return list(dict.fromkeys([*still, self.pivot]))

    def driver(self) -> tuple[Drawn, str, str]:
        """The driver, its pivot and its other joint."""
        drivers = [bar for bar in self.bars.values() if bar.get("type") in ("driver", "arc_driver")]
        if len(drivers) != 1:
            names = ", ".join(bar["id"] for bar in drivers) or "none"
            remedy = "keep one: a mechanism of linkjax has one driver"
            if not drivers:
                remedy = "write one; pylinkage's to_mechanism omits the links of arc cranks and linear actuators"
            raise StructureError("links", f"there must be one driver, but there are: {names}", remedy)
        (bar,) = drivers
        pins, pivot = bar["joints"], bar.get("motor_joint")
        grounded = [pin for pin in pins if self.kind(pin) == "ground"]
        pivot = grounded[0] if not pivot and len(grounded) == 1 else pivot
        if len(pins) != 2 or pins[0] == pins[1] or pivot not in pins:
            raise StructureError(
                bar["id"], "needs two joints, one of them its motor joint", "put further joints on a link of their own"
            )
        return bar, str(pivot), next(pin for pin in pins if pin != pivot)

    def guides(self) -> dict[str, tuple[str, str] | None]:
        """Joints that slide, each with two joints on its line, or with None where the joint itself has an axis.

        `pylinkage.dyads.to_mechanism` writes a slide on the line of two joints as a link `<joint>_guide` of all three.
        """
        found: dict[str, tuple[str, str] | None] = {
            joint: None for joint in self.joints if self.kind(joint) == "prismatic" and joint not in self.on[GROUND]
        }
        for name, bar in list(self.bars.items()):
            one, two, joint = bar["joints"] if len(bar["joints"]) == 3 else ("", "", "")
            if name != f"{joint}_guide" or len({one, two, joint}) < 3:
                continue
            line = self.at(two) - self.at(one)
            if line and abs(((self.at(joint) - self.at(one)) / line).imag * abs(line)) < 1e-6 * self.size:
                found[joint] = one, two
                del self.on[name]
        return found

    # ---- bodies

    def bodies(self, *joints: str) -> list[str]:
        """Bodies that all of these joints are on."""
        return [body for body, held in self.on.items() if all(joint in held for joint in joints)]

    def gather(self) -> None:
        """Merge bodies that form a rigid body, and put trackers on their bodies, until nothing changes."""
        waiting = [joint for joint in self.joints if self.refs(joint)]
        while True:
            while self.doubled() or self.triangle():
                pass
            ready = [joint for joint in waiting if self.bodies(*self.refs(joint) or ())]
            for joint in ready:
                self.track(joint)
                waiting.remove(joint)
            if not ready:
                break
        for joint in waiting:
            one, two = self.refs(joint) or ("", "")
            for ref in (one, two):
                if ref not in self.joints:
                    raise StructureError(joint, f"tracks {ref!r}, which does not exist", nearest(ref, self.joints))
            problem = f"tracks {one!r} and {two!r}, which are on no common link"
            raise StructureError(joint, problem, "delete it, or track two joints of one link")

    def track(self, joint: str) -> None:
        """Place a tracker by its distance and angle, on the body of the two joints that it tracks."""
        one, two = self.refs(joint) or ("", "")
        axis = self.at(two) - self.at(one)
        if not self.apart(one, two):
            raise StructureError(joint, f"tracks {one!r} and {two!r}, which coincide", "move one of them")
        drawn = self.joints[joint]
        away = cmath.rect(float(drawn.get("distance", 0.0)), float(drawn.get("angle", 0.0)))
        self.spots[joint] = self.at(one) + away * axis / abs(axis)
        self.absorb(self.bodies(one, two)[0], [joint])

    def apart(self, one: str, two: str) -> bool:
        return abs(self.at(one) - self.at(two)) > ONE_PLACE * self.size

    def absorb(self, body: str, joints: list[str]) -> None:
        self.on[body] = list(dict.fromkeys([*self.on[body], *joints]))

    def pairs(self) -> list[tuple[str, str, list[str]]]:
        """Pairs of bodies that share joints, with these joints, in the order of bodies; frame and driver come first."""
        order = sorted(self.on, key=lambda body: (body != GROUND, body != self.bar["id"]))
        shared = [(a, b, [j for j in self.on[a] if j in self.on[b]]) for a, b in itertools.combinations(order, 2)]
        return [each for each in shared if each[2]]

    def doubled(self) -> bool:
        """Merge two bodies that share two joints; False where there are none."""
        for one, two, shared in self.pairs():
            if len(shared) < 2:
                continue
            if not self.apart(*shared[:2]):
                problem = f"joints {shared[0]!r} and {shared[1]!r} coincide"
                raise StructureError(two, problem, "move one of them")
            if two == self.bar["id"]:
                problem = f"cannot move: its joints {shared[0]!r} and {shared[1]!r} are both on the frame"
                raise StructureError(two, problem, "remove one of them from the frame")
            self.absorb(one, self.on.pop(two))
            return True
        return False

    def triangle(self) -> bool:
        """Merge three bodies that form a triangle, pinned to each other; False where there are none."""
        shared = {(one, two): joints[0] for one, two, joints in self.pairs()}
        for (one, two), joint in shared.items():
            for three in self.on:
                pins = {joint, shared.get((one, three)), shared.get((two, three))}
                if len(pins) == 3 and None not in pins and self.bar["id"] not in (two, three):
                    self.absorb(one, [*self.on.pop(two), *self.on.pop(three)])
                    return True
        return False

    # ---- the mechanism

    def imported(self) -> Imported:
        """The mechanism of all bodies, with valid names."""
        for joint in self.joints:
            if not self.refs(joint):
                self.at(joint)
        self.gather()
        for joint in self.joints:
            if not self.bodies(joint):
                remedy = (
                    "put it on a link, or delete it; pylinkage's to_mechanism omits the links of cams, point trackers, "
                )
                remedy += "linear actuators, arc cranks and double sliders"
                raise StructureError(joint, "is on no link", remedy)
        for body, held in self.on.items():
            if body != GROUND and len(held) > 1 and not self.apart(*held[:2]):
                raise StructureError(body, f"joints {held[0]!r} and {held[1]!r} coincide", "move one of them")
        motion = motion_of(self.bar, self.end, self.at(self.end) - self.at(self.pivot), self.size)
        points, links, blocks, names = self.named()
        made = self.links(points, links, blocks)
        for number, (link, each) in enumerate(list(made.items()), 1):
            if f"S{number}" in names.taken:  # the default name of its mass centre
                made[link] = Link(
                    each.length, points=each.points, pins=each.pins, centre_name=names.new(f"S{number}", "S")
                )
        spots = {points[joint]: (at.real, at.imag) for joint, at in self.spots.items()}
        fixed = {points[joint]: spots[points[joint]] for joint in self.on[GROUND]}
        moving = {point: at for point, at in spots.items() if point not in fixed}
        drive = Drive(links[self.bar["id"]], FRAME, motion.rotation, motion.phase, motion.law)
        slots = [Slot(blocks[joint], self.guide(joint, points, links)) for joint in self.slides]
        mechanism = linkage(fixed, made, drive, slots, moving)
        own = {self.slider(joint): block for joint, block in blocks.items() if self.slider(joint)}
        notes = (motion.note,) if motion.note else ()
        return Imported(mechanism, _changed(points), _changed(own | links), notes)

    def named(self) -> tuple[dict[str, str], dict[str, str], dict[str, str], Names]:
        """Valid names of joints, of links and of blocks."""
        bars = [body for body in self.on if body != GROUND]
        own = [bar for bar in bars if bar not in self.joints]
        names = Names([*self.joints, *own])
        points = names.all(self.joints, "P", "", self.joints)
        links = names.all(bars, "L", "_link", own)
        blocks = {joint: names.new(self.slider(joint) or f"{joint}_block", "L", "_block") for joint in self.slides}
        return points, links, blocks, names

    def slider(self, joint: str) -> str:
        """The name of a slider in the file; empty where it is the name of the joint."""
        name = self.joints[joint].get("name") or ""
        return "" if name == joint else name

    def links(self, points: dict[str, str], links: dict[str, str], blocks: dict[str, str]) -> dict[str, Link]:
        """The links with their pins, and trackers as coupler points; sliders have one pin."""
        found = {}
        for body, held in self.on.items():
            if body == GROUND:
                continue
            pins = [j for j in held if not self.refs(j) or len(self.bodies(j)) > 1 or j in held[:2]]
            own = {}
            for joint in (j for j in held if self.refs(j) and j not in held[:2]):
                at = (self.at(joint) - self.at(held[0])) / self.axis(body)
                own[points[joint]] = Vec(at.real, at.imag)
            found[links[body]] = Link(points=own, pins=tuple(points[pin] for pin in pins))
        return found | {blocks[joint]: Link(pins=(points[joint],)) for joint in self.slides}

    def axis(self, body: str) -> complex:
        """The drawn direction of a body."""
        if body == GROUND:
            return 1 + 0j
        one, two = self.on[body][:2]
        return (self.at(two) - self.at(one)) / abs(self.at(two) - self.at(one))

    def guide(self, joint: str, points: dict[str, str], links: dict[str, str]) -> Guide:
        """The guide of a joint that slides, through the drawn place of the joint."""
        line, drawn = self.slides[joint], self.joints[joint]
        if line is not None:
            if not (on := self.bodies(*line)):
                problem = f"slides along the line of {line[0]!r} and {line[1]!r}, which are on no common link"
                raise StructureError(joint, problem, "put both on the frame or on one link")
            body, base, along = on[0], line[0], self.at(line[1]) - self.at(line[0])
        else:
            body, base, along = GROUND, self.pivot, complex(*drawn.get("axis", (1.0, 0.0)))
        along = along / abs(along) if abs(along) > 1e-10 else 1 + 0j  # as in pylinkage
        if line is None and "line_point" in drawn:
            off = abs(((self.at(joint) - complex(*drawn["line_point"])) / along).imag)
            if off > DISAGREE * self.size:
                x, y = self.at(joint).real, self.at(joint).imag
                problem = f"is drawn at ({x:.6g}, {y:.6g}), {off:.6g} from its line through {list(drawn['line_point'])}"
                raise StructureError(joint, problem, "correct line_point or axis, or move the joint onto the line")
        offset, angle = ((self.at(joint) - self.at(base)) / along).imag, cmath.phase(along / self.axis(body))
        offset = 0.0 if abs(offset) < ONE_PLACE * self.size else offset
        return Guide(points[base], 0.0 if abs(angle) < 1e-15 else angle, offset, on=links.get(body, FRAME))


def _plain(number: int | float) -> float:
    """A coordinate, zero if it is a rounding error too small for scene files."""
    return 0.0 if abs(number) < SMALLEST else float(number)


def _changed(names: Mapping[str, str]) -> dict[str, str]:
    """The names that were changed, with their new names."""
    return {old: new for old, new in names.items() if old != new}
