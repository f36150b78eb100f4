"""The structural groups of a drawing, attached one after the other.

The places of a group are computed from the exact places of the links to which it is attached, not from the sketch.
This comes before its side is read from the sketch: dyads are placed by complex numbers, groups of higher class by
closing them once.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp

from linkjax._compile import compiled_soon
from linkjax._types import known as number_of
from linkjax._vec import Vec, unit
from linkjax.groups import (
    FRAME,
    PRP,
    RPP,
    RPR,
    RRP,
    RRR,
    AbstractGroup,
    Crank,
    Drive,
    General,
    LinearDriver,
    LinkState,
    Slot,
    at_rest,
    closed_to,
)
from linkjax.mechanism._drawing import Drawing
from linkjax.mechanism._geared import Wheels
from linkjax.mechanism._mechanism import StructureError
from linkjax.mechanism._sketched import UNSURE
from linkjax.mechanism._start import number
from linkjax.topology import Pair

PARALLEL = 1e-9  # sine of the angle between two guides of an RPP that count as parallel, as in that group
Path = tuple[complex, complex]


class Attachment:
    """Builds the groups of a drawing, and finds the places of their points in it."""

    def __init__(self, drawing: Drawing, drive: Drive):
        self.drawing, self.drive = drawing, drive
        self.wheels = Wheels(drawing.gears, drawing.racks, drawing, drive)

    def groups(self, parts: Sequence[tuple[str, ...]]) -> list[AbstractGroup]:
        """The driver and the Assur groups, in the order of their parts."""
        made, placed = [], {FRAME}
        for part in parts:
            try:
                group = self._group(part, placed) if made else self._driver(part)
            except StructureError:
                raise
            except ValueError as error:  # of the group's class
                problem, _, remedy = str(error).partition("; ")
                problem = f"{', '.join(part)} form no group: {problem}"
                raise StructureError("links", problem, remedy or "change these links or their joints") from error
            made.append(group)
            placed |= set(part)
            if group.numerical() and part != parts[-1]:
                self._settle(group)
        return made

    def _group(self, part: tuple[str, ...], placed: set[str]) -> AbstractGroup:
        if len(part) == 1:
            return self.wheels.group(part[0], placed)
        return (self._dyad(part, placed) if len(part) == 2 else None) or self._general(part, placed)

    def _driver(self, part: tuple[str, ...]) -> AbstractGroup:
        drive = self.drive
        if len(part) > 1 or drive.on != FRAME:
            return self._general(part, {FRAME}, drive)
        pins, guide = self.drawing.links[drive.link].pins, self.drawing.guide(drive.link)
        if guide is not None and guide.on == FRAME and drive.law is not None:
            return LinearDriver(drive.link, pins[0], guide, drive.law)
        pivot = next(p for p in pins if p in self.drawing.fixed)
        end = next((p for p in pins if p != pivot), None)
        if end is None:
            raise StructureError(f"links.{drive.link}", "a crank needs a second pin", "name one, and give its length")
        places = self.drawing.places(drive.link)
        phase = number(drive.phase) + cmath.phase(places[end] - places[pivot])  # the crank is held at these two
        return Crank(drive.link, pivot, end, drive.rotation, phase, drive.law)

    def _general(self, part: tuple[str, ...], placed: set[str], drive: Drive | None = None) -> General:
        """A group of links whose loops are closed simultaneously by Newton's method."""
        drawing, ends = self.drawing, self.drawing.pins()
        outer = [p for name in part for p in drawing.links[name].pins if placed & set(ends[p])]
        slots = self._slots_within(part, placed)
        for slot in slots:
            if slot.block not in part:
                problem = f"its guide is on {slot.guide.on!r}, whose position is determined only after the block"
                remedy = f"make {slot.guide.on!r} the block and put the guide on {slot.block!r}"
                raise StructureError(f"slot of {slot.block}", problem, remedy)
        own = [p for name in part for p in drawing.places(name) if p in drawing.spots and p not in outer]
        sketch = {p: Vec(drawing.spots[p].real, drawing.spots[p].imag) for p in dict.fromkeys(own)}
        members = tuple((name, drawing.links[name].pins) for name in part)
        group = General(members, tuple(dict.fromkeys(outer)), sketch, slots, drive, self.wheels.inside(part, placed))
        for name in part:
            if not any(slot.block == name for slot in slots) and name not in group.spinning():
                drawing.axis(name)  # raises where the sketch does not show the direction
        self.wheels.check_phases(group)
        return group

    def _settle(self, group: Any) -> None:
        """Find the places of the links of a numerically solved group if its loops close."""
        drawing = self.drawing
        points = {p: at_rest(Vec(drawing.spots[p].real, drawing.spots[p].imag)) for p in group.needs()}
        on = [guide.on for guide in group.guides() if guide.on != FRAME]
        angles, none = {name: jnp.asarray(self.wheels.angle(name)) for name in (*on, *group.mates())}, jnp.zeros(())
        states = {name: LinkState(unit(angle), none, none, angle) for name, angle in angles.items()}
        links = {name: drawing.links[name] for name in group.link_names()}
        z, gap = _closed(group, links, states, points)
        if gap < closed_to(gap.dtype):
            for (name, pins), (x, y, *u) in zip(group.members, z.tolist(), strict=True):
                if group.gears:
                    self.wheels.counted[name] = u[0]
                turn = cmath.exp(1j * u[0]) if group.gears else complex(*u)
                drawing.place(name, pins[0], complex(x, y), turn)

    # ---- groups of class II in closed form

    def _dyad(self, part: tuple[str, ...], placed: set[str]) -> AbstractGroup | None:
        """A group of class II in closed form; None where its links need Newton's method."""
        touching = self._pairs_within(part, placed)
        inner = [pair for pair in touching if set(pair.ends) <= set(part)]
        one, two = part
        first = [pair for pair in touching if pair not in inner and one in pair.ends]
        second = [pair for pair in touching if pair not in inner and two in pair.ends]
        if (len(first), len(inner), len(second)) != (1, 1, 1):
            return None
        kind = first[0].letter + inner[0].letter + second[0].letter
        if kind in ("PRR", "PPR"):
            return self._dyad((two, one), placed)
        return getattr(self, f"_{kind.lower()}", lambda *_: None)(part, first[0], inner[0], second[0])

    def _pairs_within(self, part: tuple[str, ...], placed: set[str]) -> list[Pair]:
        """Pairs of a part; links at one pin are joined to a placed link, or else to the first link of the part."""
        found = []
        for point, ends in self.drawing.pins().items():
            outside = [end for end in ends if end in placed]
            inside = [end for end in ends if end in part]
            base = outside[0] if outside else (inside or [""])[0]
            found += [Pair("R", point, end, base) for end in inside if end != base]
        slots = self._slots_within(part, placed)
        return found + [Pair("P", f"{s.block}.guide", s.block, s.guide.on) for s in slots]

    def _slots_within(self, part: tuple[str, ...], placed: set[str]) -> tuple[Slot, ...]:
        """Slots of a part, without those of blocks that are attached after it."""
        here = {*part, *placed}
        ends = [(slot, {slot.block, slot.guide.on}) for slot in self.drawing.slots]
        return tuple(slot for slot, both in ends if both & set(part) and both <= here)

    def _span(self, link: str, one: str, two: str) -> complex:
        """The vector from one point of a link to another, in the axes of the link."""
        places = self.drawing.places(link)
        return places[two] - places[one]

    def _check_told(self, pin: str, drawn: float, true: float, path: Path) -> None:
        """Raise `StructureError` for a pin of a dyad that is sketched in the middle between its two possible places,
        which are `true` (m) from the middle on both sides."""
        if true > self.drawing.slack and abs(drawn) < UNSURE * true:
            one, two = (path[0] + sign * true * path[1] for sign in (1, -1))
            where = [f"({at.real + 0.0:.4g}, {at.imag + 0.0:.4g}) m" for at in (one, two)]
            problem = f"is midway between the two positions that the lengths allow for {pin!r}, {' and '.join(where)}"
            raise StructureError(f"sketch.{pin}", problem, "sketch it nearer to the intended position")

    def _rrr(self, part, first: Pair, inner: Pair, second: Pair) -> AbstractGroup:
        drawing = self.drawing
        a, b, meet = (
            drawing.spot(pair.name, name) for pair, name in ((first, part[0]), (second, part[1]), (inner, part[0]))
        )
        side = 1 if ((b - a).conjugate() * (meet - a)).imag >= 0 else -1
        arms = self._span(part[0], first.name, inner.name), self._span(part[1], second.name, inner.name)
        r = abs(b - a)
        foot = 0.5 * (r * r + abs(arms[0]) ** 2 - abs(arms[1]) ** 2) / r if r else 0.0
        if r and abs(foot) <= abs(arms[0]):
            along, aside = (b - a) / r, math.sqrt(abs(arms[0]) ** 2 - foot**2)
            self._check_told(inner.name, ((meet - a) / along).imag, aside, (a + along * foot, 1j * along))
            meet = a + along * complex(foot, side * aside)
            drawing.place(part[0], first.name, a, _turn(meet - a, arms[0]))
            drawing.place(part[1], second.name, b, _turn(meet - b, arms[1]))
        return RRR(part, first.name, second.name, inner.name, side)

    def _rrp(self, part, first: Pair, inner: Pair, second: Pair) -> AbstractGroup | None:
        drawing, (rod, block) = self.drawing, part
        guide = drawing.guide(block)
        if guide is None or guide.on == rod or drawing.links[block].pins[0] != inner.name:
            return None
        a, (base, along) = drawing.spot(first.name, rod), drawing.path(guide)
        side = 1 if ((drawing.spot(inner.name, rod) - a) / along).real >= 0 else -1
        arm, foot = self._span(rod, first.name, inner.name), (a - base) / along
        if abs(foot.imag) <= abs(arm):
            ahead = math.sqrt(abs(arm) ** 2 - foot.imag**2)
            drawn = ((drawing.spot(inner.name, rod) - base) / along).real - foot.real
            self._check_told(inner.name, drawn, ahead, (base + along * foot.real, along))
            end = base + along * (foot.real + side * ahead)
            drawing.place(rod, first.name, a, _turn(end - a, arm))
            drawing.place(block, inner.name, end, along)
        return RRP(rod, block, first.name, inner.name, guide, side)

    def _rpr(self, part, first: Pair, inner: Pair, second: Pair) -> AbstractGroup | None:
        drawing, (block, lever) = self.drawing, inner.ends
        joints = dict(zip(part, (first.name, second.name), strict=True))
        guide, pins = drawing.guide(block), drawing.links[lever].pins
        straight = guide is not None and number_of(guide.along) == 0 and guide.through == joints[lever] == pins[0]
        if guide is None or not straight or len(pins) < 2 or pins[1] in drawing.links[lever].points:
            return None
        if drawing.links[block].pins[0] != joints[block]:
            return None
        base, at, off = drawing.spot(pins[0], lever), drawing.spot(joints[block], block), float(guide.offset)
        side = 1 if ((at - base) * drawing.axis(lever).conjugate()).real >= 0 else -1
        if abs(at - base) > abs(off):
            turn = _turn(at - base, complex(side * math.sqrt(abs(at - base) ** 2 - off**2), off))
            drawing.place(lever, pins[0], base, turn)
            drawing.place(block, joints[block], at, turn)
        return RPR(lever, block, joints[block], joints[lever], pins[1], side, guide.offset)

    def _prp(self, part, first: Pair, inner: Pair, second: Pair) -> AbstractGroup | None:
        drawing = self.drawing
        one, two = (drawing.guide(name) for name in part)
        if one is None or two is None or any(drawing.links[name].pins[0] != inner.name for name in part):
            return None
        paths = drawing.path(one), drawing.path(two)
        left = (paths[0][1].conjugate() * paths[1][1]).imag >= 0
        self._cross(part, inner.name, *paths)
        return PRP(part, inner.name, (one, two), 1 if left else -1)

    def _rpp(self, part, first: Pair, inner: Pair, second: Pair) -> AbstractGroup | None:
        drawing, (block, slide) = self.drawing, part
        slot, guide, end = drawing.guide(block), drawing.guide(slide), drawing.links[slide].pins[0]
        if slot is None or guide is None or guide.on == block or (slot.on, slot.through) != (slide, end):
            return None
        if drawing.links[block].pins[0] != first.name:
            return None
        if abs(math.sin(float(slot.along))) < PARALLEL:
            problem = f"is parallel to the guide of {slide!r}, so the position of {slide!r} is undetermined"
            raise StructureError(f"slot of {block}", problem, "change `along` of one of the two guides")
        path, at = drawing.path(guide), drawing.spot(first.name, block)
        along = path[1] * cmath.exp(1j * float(slot.along))
        self._cross((slide,), end, path, (at - 1j * along * float(slot.offset), along))
        drawing.place(block, first.name, at, along)
        return RPP(slide, block, first.name, end, guide, slot.along, slot.offset)

    def _cross(self, blocks: Sequence[str], point: str, one: Path, two: Path) -> None:
        """Place blocks that share a point at the crossing of two paths, each block along its path."""
        (base, along), (other, across) = one, two
        sine = (along.conjugate() * across).imag
        if abs(sine) > 1e-9:
            at = base + along * ((other - base).conjugate() * across).imag / sine
            for block, turn in zip(blocks, (along, across), strict=False):
                self.drawing.place(block, point, at, turn)


def _turn(true: complex, own: complex) -> complex:
    """The direction of a link, from the direction of a line on it, actual and in the axes of the link."""
    turn = true / own if own else 1 + 0j
    return turn / abs(turn) if turn else 1 + 0j


@compiled_soon
def _closed(group: General, links, states, points):
    phi = jnp.zeros(())
    z, _, gap, _ = group.assembled(links, states, points, phi)
    return z, gap
