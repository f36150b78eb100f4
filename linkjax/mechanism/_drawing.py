"""Links and joints as one draws them: where points are, and the groups that they make."""

from __future__ import annotations

import cmath
import dataclasses
import math
from collections.abc import Sequence

from linkjax._types import known as number_of
from linkjax._units import nearest
from linkjax._vec import Vec
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
    GearPair,
    General,
    Guide,
    Pair,
    RackPair,
    Slide,
    Slot,
)
from linkjax.mechanism._freedom import freedom
from linkjax.mechanism._geared import Wheels, pairs_of
from linkjax.mechanism._link import Link
from linkjax.mechanism._mechanism import StructureError
from linkjax.mechanism._passive import passive_links

Place = Vec | Sequence[float | int]


@dataclasses.dataclass
class Drawing:
    """Links and joints, and where points are at crank angle zero as far as is known (complex numbers, m)."""

    fixed: dict[str, Vec]
    links: dict[str, Link]
    slots: tuple[Slot, ...]
    spots: dict[str, complex]
    gears: tuple[GearPair, ...] = ()
    racks: tuple[RackPair, ...] = ()

    def check(self) -> None:
        """Raise `StructureError` where names do not fit together."""
        for name, link in self.links.items():
            if not link.pins:
                raise StructureError(f"links.{name}", "has no pins", 'name them, e.g. pins = ["A", "B"]')
            if len(set(link.pins)) < len(link.pins):
                raise StructureError(f"links.{name}", "names a pin twice", "name every pin once")
            if link.pins[0] in link.points:
                problem = f"its first pin {link.pins[0]!r} is the origin of its axes, and a marked point too"
                raise StructureError(f"links.{name}", problem, "delete the point")
            for point in (p for p in link.points if p not in link.pins):
                others = [n for n, other in self.links.items() if n != name and point in (*other.pins, *other.points)]
                if others or point in self.fixed:
                    problem = f"the point name {point!r} is used already, by {(others or [FRAME])[0]!r}"
                    remedy = "name it among the pins of this link, too, or give it another name"
                    raise StructureError(f"links.{name}.points.{point}", problem, remedy)
        joints = {point for point, ends in self.pins().items() if len(ends) > 1}
        for name in self.spots:
            if name not in joints and not any(name in link.point_names() for link in self.links.values()):
                every = {p: 0 for link in self.links.values() for p in link.point_names()}
                raise StructureError(f"sketch.{name}", "is no point of a link", nearest(name, every))
        for slot in self.slots:
            where = f"slot of {slot.block}"
            if slot.block not in self.links:
                raise StructureError(where, f"link {slot.block!r} is not defined", nearest(slot.block, self.links))
            if slot.guide.on not in (FRAME, *self.links):
                raise StructureError(
                    where, f"link {slot.guide.on!r} is not defined", nearest(slot.guide.on, self.links)
                )
            if [other.block for other in self.slots].count(slot.block) > 1:
                problem, remedy = "is in two slots", "name a second block, pinned to the first"
                raise StructureError(where, problem, remedy)
            if slot.guide.on == slot.block:
                raise StructureError(where, "slides along itself", "name the link that the guide is on")
            own = tuple(self.fixed) if slot.guide.on == FRAME else self.links[slot.guide.on].point_names()
            if slot.guide.through not in own:
                problem = f"the guide is on {slot.guide.on!r}, but point {slot.guide.through!r} is not"
                raise StructureError(where, problem, nearest(slot.guide.through, own))
        self._check_joined()

    def _check_joined(self) -> None:
        reached, grown = {FRAME}, True
        while grown:
            new = {end for pair in self.pairs() if reached & set(pair.ends) for end in pair.ends}
            grown, reached = not new <= reached, reached | new
        apart = [name for name in self.links if name not in reached]
        if apart:
            problem = f"not joined to the frame: {', '.join(apart)}"
            raise StructureError(f"links.{apart[0]}", problem, "let it share a pin, or put a pin of it under `fixed`")

    def passive(self, drive: Drive, found: Sequence[Pair], driven: Pair) -> list[str]:
        """Links that hold what is held already, where the chain moves though its joints are too many by count."""
        degrees, redundant, *_ = freedom(list(self.links), found, driven)
        if degrees == 1 and not redundant:
            return []
        drawn = dataclasses.replace(self, links=dict(self.links), spots=dict(self.spots))
        try:
            drawn.place_drive(drive)
            drawn.measure()
            return passive_links(drawn, found, driven)
        except StructureError:
            return []  # the sketch does not say enough

    def without(self, gone: Sequence[str]) -> Drawing:
        """The same without these links."""
        links = {name: link for name, link in self.links.items() if name not in gone}
        slots = tuple(slot for slot in self.slots if slot.block not in gone)
        return dataclasses.replace(self, links=links, slots=slots, spots=dict(self.spots))

    def pins(self) -> dict[str, list[str]]:
        """Every pin with what it joins: the frame first, then links in their order."""
        found: dict[str, list[str]] = {}
        for name, link in self.links.items():
            for point in link.pins:
                found.setdefault(point, [FRAME] if point in self.fixed else []).append(name)
        return found

    def pairs(self) -> list[Pair]:
        """All pairs; several links at one pin are joined to the first of them."""
        found = [Pair("R", p, end, ends[0]) for p, ends in self.pins().items() for end in ends[1:]]
        found += [Pair("P", f"{s.block}.guide", s.block, s.guide.on) for s in self.slots]
        return found + pairs_of(self.gears, self.racks, self.slots, self.pins(), self.links)

    def driven(self, drive: Drive, found: Sequence[Pair]) -> Pair:
        """The pair that the drive moves."""
        ends = {drive.link, drive.on}
        for name in (drive.link, drive.on):
            if name not in (FRAME, *self.links):
                raise StructureError("drive", f"link {name!r} is not defined", nearest(name, self.links))
        at = [pair for pair in found if set(pair.ends) == ends and pair.letter != "G"]
        at += [Pair("R", point, drive.link, drive.on) for point, joined in self.pins().items() if ends <= set(joined)]
        if not at:
            problem = f"{drive.link!r} and {drive.on!r} share no joint"
            raise StructureError("drive", problem, "name two links that are joined, or one that is joined to the frame")
        if at[0].letter == "P" and drive.law is None:
            problem = f"slides {drive.link!r} along a guide, which it cannot do for ever"
            raise StructureError("drive", problem, "give it a law")
        if at[0] not in found:  # three links at one pin, of which the drive moves the second against the third
            raise StructureError("drive", f"several links share the pin {at[0].name!r}",
                                 f"write {drive.on!r} before the others, so that they are joined to it")  # fmt: skip
        return at[0]

    # ---- where things are

    def places(self, link: str) -> dict[str, complex]:
        """Points of a link in its own axes."""
        return {p: complex_of(f"links.{link}", at) for p, at in self.links[link].actual().points.items()}

    def place_drive(self, drive: Drive) -> None:
        """Find the places of the points of a link that the drive turns on the frame."""
        self.spots |= {name: complex_of(f"fixed.{name}", at) for name, at in self.fixed.items()}
        link = self.links[drive.link]
        guide = next((s.guide for s in self.slots if s.block == drive.link), None)
        if drive.law is not None and guide is not None and guide.on == drive.on == FRAME:
            ahead = complex(float(drive.law.at(drive.phase * 0.0)[0]), float(guide.offset))
            self.spots[link.pins[0]] = self.spots[guide.through] + self.along(guide) * ahead
        pivot = next((p for p in link.pins if p in self.fixed), None)
        if drive.on != FRAME or pivot is None or any(s.block == drive.link for s in self.slots):
            return
        if number_of(link.length) == 0 and len(link.pins) > 1 and link.pins[1] not in link.points:
            self.measure(drive.link)
        angle = drive.at(drive.phase * 0.0, slides=False)[0]
        turn, places = cmath.exp(1j * float(angle)), self.places(drive.link)
        self.spots |= {p: self.spots[pivot] + (at - places[pivot]) * turn for p, at in places.items()}

    def measure(self, only: str | None = None) -> None:
        """Take lengths, and the places of further pins, from the sketch where the links do not give them."""
        for name, link in self.links.items():
            if len(link.pins) < 2 or only not in (None, name):
                continue
            origin, far, *rest = link.pins
            if number_of(link.length) == 0 and far not in link.points:
                span = self.spot(far, name) - self.spot(origin, name)
                if abs(span) == 0:
                    raise StructureError(
                        f"links.{name}", f"its pins {origin!r} and {far!r} coincide", "give its length"
                    )
                scaled = {} if link.reference_length is None else {"reference_length": abs(span)}
                link = dataclasses.replace(link, length=abs(span), **scaled)
            missing = [p for p in rest if p not in link.points]
            if missing:
                span = self.spot(far, name) - self.spot(origin, name)
                off = {p: (self.spot(p, name) - self.spot(origin, name)) * abs(span) / span for p in missing}
                new = {p: Vec(at.real, at.imag) for p, at in off.items()}
                link = dataclasses.replace(link, points={**link.points, **new})
            self.links[name] = link

    def spot(self, point: str, link: str) -> complex:
        """Where a point is. Raises `StructureError` where the sketch does not say so."""
        if point not in self.spots:
            raise StructureError(f"links.{link}", f"nothing says where its pin {point!r} is", "add it to the sketch")
        return self.spots[point]

    def axis(self, link: str) -> complex:
        """Direction of a link."""
        guide = next((slot.guide for slot in self.slots if slot.block == link), None)
        if guide is not None:
            return self.along(guide)
        places = self.places(link)
        seen = [p for p in places if p in self.spots]
        if len(seen) < 2:
            names = ", ".join(self.links[link].point_names())
            raise StructureError(f"links.{link}", "the sketch does not say how it stands", f"sketch two of: {names}")
        pairs = [(self.spots[b] - self.spots[a], places[b] - places[a]) for a in seen for b in seen]
        drawn, own = max(pairs, key=lambda pair: min(abs(pair[0]), abs(pair[1])))
        if drawn == 0 or own == 0:
            problem = f"the sketch puts {', '.join(seen)} on one place"
            raise StructureError(f"links.{link}", problem, "move one of them, or give the places of its points")
        turn = drawn / own
        return turn / abs(turn)

    def along(self, guide: Guide) -> complex:
        """Direction of a guide."""
        own = cmath.exp(1j * float(guide.along))
        return own if guide.on == FRAME else own * self.axis(guide.on)

    # ---- groups

    def groups(self, parts: Sequence[tuple[str, ...]], drive: Drive) -> list[AbstractGroup]:
        """The driver and the Assur groups, in the order of their parts."""
        self._check_wheels(parts[0], {FRAME})
        made: list[AbstractGroup] = [self._driver(parts[0], drive)]
        placed = {FRAME, *parts[0]}
        wheels = Wheels(self.gears, self.racks, self, drive)
        for part in parts[1:]:
            self._check_wheels(part, placed)
            if len(part) == 1:
                group = wheels.group(part[0], placed)
            else:
                group = self._dyad(part, placed) if len(part) == 2 else None
            made.append(self._general(part, placed) if group is None else group)
            placed |= set(part)
        return made

    def _check_wheels(self, part: tuple[str, ...], placed: set[str]) -> None:
        """Raise `StructureError` for wheels whose turns only come out together with other links."""
        for gear in (*self.gears, *self.racks):
            ends = {gear.link, gear.to}
            if len(part) > 1 and ends & set(part) and ends <= {*part, *placed}:
                problem = f"{', '.join(part)} can only be solved together, with {gear.link!r} and {gear.to!r} in gear"
                remedy = "drive the mechanism so that one wheel after the other follows, e.g. by the carrier"
                raise StructureError(f"gear of {gear.link}", problem, remedy)

    def _driver(self, part: tuple[str, ...], drive: Drive) -> AbstractGroup:
        if len(part) > 1 or drive.on != FRAME:
            return self._general(part, {FRAME}, drive)
        pins, slot = self.links[drive.link].pins, next((s for s in self.slots if s.block == drive.link), None)
        if slot is not None and drive.law is not None:
            return Slide(drive.link, pins[0], slot.guide, drive.law)
        pivot = next(p for p in pins if p in self.fixed)
        if len(pins) > 1 and pivot in pins[:2] and pins[1] not in self.links[drive.link].points:
            back = pivot == pins[1]
            phase = drive.phase + math.pi if back else drive.phase
            return Crank(drive.link, pivot, pins[0] if back else pins[1], drive.turns, phase, drive.law)
        if len(pins) == 1:
            raise StructureError(f"links.{drive.link}", "a crank needs a second pin", "name one, and give its length")
        return self._general(part, {FRAME}, drive)

    def _general(self, part: tuple[str, ...], placed: set[str], drive: Drive | None = None) -> General:
        """Links that are closed together by Newton's method."""
        ends = self.pins()
        outer = [p for name in part for p in self.links[name].pins if placed & set(ends[p])]
        slots = self._slots_within(part, placed)
        for slot in slots:
            if slot.block not in part:
                problem = f"its guide is on {slot.guide.on!r}, which is found after the block"
                raise StructureError(f"slot of {slot.block}", problem, "let the other of the two be the block")
        own = [p for name in part for p in self.places(name) if p in self.spots and p not in outer]
        sketch = {p: Vec(self.spots[p].real, self.spots[p].imag) for p in dict.fromkeys(own)}
        members = tuple((name, self.links[name].pins) for name in part)
        for name in part:
            if not any(slot.block == name for slot in slots):
                self.axis(name)  # the sketch must say so
        if drive is not None and drive.on != FRAME and not any(s.block == drive.link for s in slots):
            seen = cmath.phase(self.axis(drive.link) / self.axis(drive.on))
            wanted = float(drive.at(drive.phase * 0.0, slides=False)[0])
            if math.cos(seen - wanted) < 0:
                told = f"{math.degrees(wanted):.4g} degrees to {drive.on!r} at crank angle zero"
                problem = f"{drive.link!r} stands at {told}, but at {math.degrees(seen):.4g} in the sketch"
                raise StructureError("drive", problem, f'write phase = "{math.degrees(seen):.4g} deg", or sketch it so')
        return General(members, tuple(dict.fromkeys(outer)), sketch, slots, drive)

    def _dyad(self, part: tuple[str, ...], placed: set[str]) -> AbstractGroup | None:
        """A group of class II in closed form; None where its links are drawn so that only Newton's method closes it."""
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
        """Pairs of a part; those at one pin are joined to what is placed already, or else to the first of the part."""
        found = []
        for point, ends in self.pins().items():
            outside = [end for end in ends if end in placed]
            inside = [end for end in ends if end in part]
            base = outside[0] if outside else (inside or [""])[0]
            found += [Pair("R", point, end, base) for end in inside if end != base]
        slots = self._slots_within(part, placed)
        return found + [Pair("P", f"{s.block}.guide", s.block, s.guide.on) for s in slots]

    def _slots_within(self, part: tuple[str, ...], placed: set[str]) -> tuple[Slot, ...]:
        """Slots of a part; not those in which links that come later slide along it."""
        here = {*part, *placed}
        ends = [(slot, {slot.block, slot.guide.on}) for slot in self.slots]
        return tuple(slot for slot, both in ends if both & set(part) and both <= here)

    def _guide(self, block: str) -> Guide | None:
        """The guide of a block; None for a link that is none."""
        return next((slot.guide for slot in self.slots if slot.block == block), None)

    def _rrr(self, part, first: Pair, inner: Pair, second: Pair) -> AbstractGroup:
        a, b, meet = (
            self.spot(pair.name, name) for pair, name in ((first, part[0]), (second, part[1]), (inner, part[0]))
        )
        left = ((b - a).conjugate() * (meet - a)).imag >= 0
        return RRR(part, first.name, second.name, inner.name, 1 if left else -1)

    def _rrp(self, part, first: Pair, inner: Pair, second: Pair) -> AbstractGroup | None:
        rod, block = part
        guide = self._guide(block)
        if guide is None or guide.on == rod or self.links[block].pins[0] != inner.name:
            return None
        ahead = self.spot(inner.name, rod) - self.spot(first.name, rod)
        side = 1 if (ahead * self.along(guide).conjugate()).real >= 0 else -1
        return RRP(rod, block, first.name, inner.name, guide, side)

    def _rpr(self, part, first: Pair, inner: Pair, second: Pair) -> AbstractGroup | None:
        (block, lever), joints = inner.ends, dict(zip(part, (first.name, second.name), strict=True))
        guide, pins = self._guide(block), self.links[lever].pins
        straight = guide is not None and number_of(guide.along) == 0 and guide.through == joints[lever] == pins[0]
        if guide is None or not straight or len(pins) < 2 or pins[1] in self.links[lever].points:
            return None
        if self.links[block].pins[0] != joints[block]:
            return None
        ahead = self.spot(joints[block], block) - self.spot(pins[0], lever)
        side = 1 if (ahead * self.axis(lever).conjugate()).real >= 0 else -1
        return RPR(lever, block, joints[block], joints[lever], pins[1], side, guide.offset)

    def _prp(self, part, first: Pair, inner: Pair, second: Pair) -> AbstractGroup | None:
        one, two = (self._guide(name) for name in part)
        if one is None or two is None or any(self.links[name].pins[0] != inner.name for name in part):
            return None
        left = (self.along(one).conjugate() * self.along(two)).imag >= 0
        return PRP(part, inner.name, (one, two), 1 if left else -1)

    def _rpp(self, part, first: Pair, inner: Pair, second: Pair) -> AbstractGroup | None:
        block, slide = part
        slot, guide, end = self._guide(block), self._guide(slide), self.links[slide].pins[0]
        if slot is None or guide is None or guide.on == block or (slot.on, slot.through) != (slide, end):
            return None
        if self.links[block].pins[0] != first.name:
            return None
        return RPP(slide, block, first.name, end, guide, slot.along, slot.offset)


def complex_of(where: str, at: Place) -> complex:
    """A place as a complex number. Raises `StructureError` while it is traced, or one of many."""
    x, y = (number_of(part) for part in (at.x, at.y)) if isinstance(at, Vec) else at
    if x is None or y is None:
        raise StructureError(where, "is traced or batched", "build the mechanism once, and change its numbers then")
    return complex(float(x), float(y))
