"""A drawing: links, joints and the places of points, and the pairs between them."""

from __future__ import annotations

import cmath
import dataclasses
from collections.abc import Collection, Sequence

import jax
import numpy as np

from linkjax._types import known as number_of
from linkjax._units import nearest
from linkjax._vec import Vec
from linkjax.groups import FRAME, Drive, GearPair, Guide, RackPair, Slot
from linkjax.mechanism._geared import pairs_of
from linkjax.mechanism._link import Link
from linkjax.mechanism._mechanism import StructureError
from linkjax.mechanism._passive import passive_links
from linkjax.topology import Pair, freedom

Place = Vec | Sequence[float | int]


@dataclasses.dataclass
class Drawing:
    """Links and joints, and the known places of points at crank angle zero (complex numbers, m)."""

    fixed: dict[str, Vec]
    links: dict[str, Link]
    slots: tuple[Slot, ...]
    spots: dict[str, complex]
    gears: tuple[GearPair, ...] = ()
    racks: tuple[RackPair, ...] = ()
    slack: float = 0.0  # m: allowed distance of a joint from its drawn place; see `_sketched.allowed`

    def check(self, sketch: Collection[str]) -> None:
        """Raise `StructureError` for names that are wrong, in the sketch too, and for numbers that are traced or
        batched."""
        for name, link in self.links.items():
            if name == FRAME:
                raise StructureError(f"links.{name}", "the name is reserved for the frame", "give it another name")
            check_numbers(f"links.{name}", link)
            if not link.pins:
                raise StructureError(f"links.{name}", "has no pins", 'name them, e.g. pins = ["A", "B"]')
            if len(set(link.pins)) < len(link.pins):
                raise StructureError(f"links.{name}", "names a pin twice", "name every pin once")
            if link.pins[0] in link.points:
                problem = f"its first pin {link.pins[0]!r} is the origin of its axes, but is in `points` too"
                raise StructureError(f"links.{name}", problem, "delete it from `points`")
            for point in (p for p in link.points if p not in link.pins):
                others = [n for n, other in self.links.items() if n != name and point in (*other.pins, *other.points)]
                if others or point in self.fixed:
                    problem = f"the point name {point!r} is already used by {(others or [FRAME])[0]!r}"
                    remedy = "add it to the pins of this link, or give it another name"
                    raise StructureError(f"links.{name}.points.{point}", problem, remedy)
        joints = {point for point, ends in self.pins().items() if len(ends) > 1}
        for name in sketch:
            if name not in joints and not any(name in link.point_names() for link in self.links.values()):
                every = {p: 0 for link in self.links.values() for p in link.point_names()}
                raise StructureError(f"sketch.{name}", "is not a point of any link", nearest(name, every))
        for slot in self.slots:
            where = f"slot of {slot.block}"
            check_numbers(where, slot)
            if slot.block not in self.links:
                raise StructureError(where, f"link {slot.block!r} is not defined", nearest(slot.block, self.links))
            if slot.guide.on not in (FRAME, *self.links):
                raise StructureError(
                    where, f"link {slot.guide.on!r} is not defined", nearest(slot.guide.on, self.links)
                )
            if [other.block for other in self.slots].count(slot.block) > 1:
                problem = "is in two slots, which constrain its direction twice and form no Assur group"
                remedy = "use a second block, pinned to the first"
                raise StructureError(where, problem, remedy)
            if slot.guide.on == slot.block:
                raise StructureError(where, "slides along itself", "name the link that the guide is on")
            own = tuple(self.fixed) if slot.guide.on == FRAME else self.links[slot.guide.on].point_names()
            if slot.guide.through not in own:
                problem = f"the guide is on {slot.guide.on!r}, but point {slot.guide.through!r} is not"
                raise StructureError(where, problem, nearest(slot.guide.through, own))
            self._check_block(where, slot)
        for gear in self.gears:
            check_numbers(f"gear of {gear.link}", (gear.phase, gear.mesh.ratio()))
        for rack in self.racks:
            check_numbers(f"rack {rack.link}", (rack.radius, rack.start))
        self._check_joined()

    def _check_block(self, where: str, slot: Slot) -> None:
        """Raise `StructureError` for blocks that slide along each other, and for a mass that needs a length."""
        on = slot.guide.on
        for _ in self.slots:
            on = FRAME if (guide := self.guide(on)) is None else guide.on
            if on == slot.block:
                problem = f"slides along {slot.guide.on!r}, which itself slides along {slot.block!r}"
                raise StructureError(where, problem, "put one of the guides on another link")
        link = self.links[slot.block]
        if link.mass_properties != "fixed" and number_of(link.length) == 0:
            problem = f"mass_properties {link.mass_properties!r} needs a length, but this block has none"
            raise StructureError(f"links.{slot.block}", problem, "omit mass_properties, or give its length")

    def _check_joined(self) -> None:
        reached, grown = {FRAME}, True
        while grown:
            new = {end for pair in self.pairs() if reached & set(pair.ends) for end in pair.ends}
            grown, reached = not new <= reached, reached | new
        apart = [name for name in self.links if name not in reached]
        if apart:
            pins = dict.fromkeys(point for name in apart for point in self.links[name].pins)
            problem = f"not connected to the frame: {', '.join(apart)} (pins {', '.join(pins)})"
            remedy = "let it share a pin with another link, or put one of its pins under `fixed`"
            raise StructureError(f"links.{apart[0]}", problem, remedy)

    def passive(self, drive: Drive, found: Sequence[Pair], driven: Pair) -> list[str]:
        """Redundant links, where the chain moves although its mobility by the count of its joints is too low."""
        degrees, redundant, *_ = freedom(list(self.links), found, driven)
        if degrees > 1 or (degrees == 1 and not redundant):
            return []
        drawn = self.measured(drive)
        return [] if drawn is None else passive_links(drawn, found, driven)

    def measured(self, drive: Drive) -> Drawing | None:
        """The same with all dimensions from the drive and the sketch; None where the sketch is incomplete."""
        drawn = dataclasses.replace(self, links=dict(self.links), spots=dict(self.spots))
        try:
            drawn.measure_drawn()
            drawn.place_drive(drive)
            for name in drawn.links:
                drawn.measure(name)
                drawn.axis(name)
                drawn.spot(drawn.links[name].pins[0], name)
        except StructureError:
            return None
        return drawn

    def without(self, gone: Sequence[str]) -> Drawing:
        """The same without these links."""
        links = {name: link for name, link in self.links.items() if name not in gone}
        slots = tuple(slot for slot in self.slots if slot.block not in gone)
        return dataclasses.replace(self, links=links, slots=slots, spots=dict(self.spots))

    def pins(self) -> dict[str, list[str]]:
        """Every pin with the bodies that it joins: the frame first, then links in their order."""
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
        check_numbers("drive", drive)
        for name in (drive.link, drive.on):
            if name not in (FRAME, *self.links):
                raise StructureError("drive", f"link {name!r} is not defined", nearest(name, self.links))
        if drive.link == drive.on or drive.link == FRAME:
            problem = f"moves {drive.link!r} relative to {drive.on!r}"
            raise StructureError("drive", problem, "name a link, and what it moves relative to")
        at = [pair for pair in found if set(pair.ends) == ends and pair.letter != "G"]
        at += [Pair("R", point, drive.link, drive.on) for point, joined in self.pins().items() if ends <= set(joined)]
        if not at:
            problem = f"{drive.link!r} and {drive.on!r} share no joint"
            raise StructureError("drive", problem, "name two links that are joined, or one that is joined to the frame")
        if at[0].letter == "P" and drive.law is None:
            problem = f"moves {drive.link!r} along a guide, but has no motion law"
            raise StructureError("drive", problem, "give the drive a law")
        return at[0]

    # ---- where things are

    def places(self, link: str) -> dict[str, complex]:
        """Points of a link in the axes of the link."""
        return {p: complex_of(f"links.{link}", at) for p, at in self.links[link].places().items()}

    def size(self) -> float:
        """The largest distance between points with known places (m)."""
        spots = np.array(list(self.spots.values()))
        return float(np.abs(spots[:, None] - spots).max()) if len(spots) else 0.0

    def place_drive(self, drive: Drive) -> None:
        """Find the places of the points of a link that is driven relative to the frame."""
        link, guide = self.links[drive.link], self.guide(drive.link)
        if drive.on != FRAME:
            return
        if guide is not None and guide.on == FRAME and drive.law is not None:
            base, turn = self.path(guide)
            pin, at = link.pins[0], base + turn * drive.begins(slides=True)
        elif guide is None and (pivots := [p for p in link.pins if p in self.fixed]):
            pin, at = pivots[0], self.spots[pivots[0]]
            turn = cmath.exp(1j * drive.begins(slides=False))
        else:
            return
        places, unknown = self.places(drive.link), self.unmeasured(drive.link)
        if pin in places:  # points that are not sketched are placed by the drive
            self.spots = {p: at + (z - places[pin]) * turn for p, z in places.items() if p not in unknown} | self.spots
        self.measure(drive.link)
        self.place(drive.link, pin, at, turn)

    def place(self, link: str, point: str, at: complex, turn: complex) -> None:
        """Find the places of all points of a link from the place of one of them and the link's direction."""
        places = self.places(link)
        self.spots |= {p: at + (z - places[point]) * turn for p, z in places.items()}

    def unmeasured(self, name: str) -> list[str]:
        """Pins of a link whose places on the link must be taken from the sketch."""
        link = self.links[name]
        given = [*link.points, *(link.pins[1:2] if number_of(link.length) else ())]
        return [point for point in link.pins[1:] if point not in given]

    def measure(self, name: str) -> None:
        """Take the length of a link and the places of further pins from the sketch, where they are not given.
        A block has the axes of its guide, so all its pins but the first are points of it."""
        link, guide, missing = self.links[name], self.guide(name), self.unmeasured(name)
        if not missing:
            return
        origin = self.spot(link.pins[0], name)
        if guide is None and missing[0] == link.pins[1]:
            length = abs(self.spot(missing[0], name) - origin)
            if length == 0:
                problem = f"its pins {link.pins[0]!r} and {missing[0]!r} coincide"
                raise StructureError(f"links.{name}", problem, "give its length")
            scaled = {"reference_length": length} if number_of(link.reference_length) == 0 else {}
            link = self.links[name] = dataclasses.replace(link, length=length, **scaled)
            missing = missing[1:]
        elif guide is not None and guide.on != FRAME:
            self.measure(guide.on)
        if missing:
            axis = self.axis(name)
            new = {p: (self.spot(p, name) - origin) / axis for p in missing}
            points = {**link.points, **{p: Vec(at.real, at.imag) for p, at in new.items()}}
            self.links[name] = dataclasses.replace(link, points=points)

    def measure_drawn(self) -> None:
        """Take missing dimensions from the sketch for links of which all pins are sketched, before given numbers move a
        pin: a length from the sketch is the distance in the sketch."""
        for name in self.links:
            on = name
            while (guide := self.guide(on)) is not None and guide.on != FRAME:
                on = guide.on
            if {*self.links[name].pins, *self.links[on].pins} <= set(self.spots):
                self.measure(name)

    def spot(self, point: str, link: str) -> complex:
        """The place of a point. Raises `StructureError` where it is unknown."""
        if point not in self.spots:
            problem = f"the position of its pin {point!r} is unknown"
            raise StructureError(f"links.{link}", problem, "add it to the sketch")
        return self.spots[point]

    def drawn_axis(self, link: str) -> complex | None:
        """Direction of a link, or of the frame, in the sketch, before its dimensions are taken from there; None where
        the sketch does not show it."""
        if link == FRAME:
            return 1 + 0j
        guide = self.guide(link)
        if guide is not None:
            on = self.drawn_axis(guide.on)
            return None if on is None else on * cmath.exp(1j * float(guide.along))
        pins, unknown = self.links[link].pins, self.unmeasured(link)
        if unknown[:1] == list(pins[1:2]) and pins[1:] and set(pins[:2]) <= set(self.spots):
            turn = self.spots[pins[1]] - self.spots[pins[0]]
            return turn / abs(turn) if turn else None
        places = {p: at for p, at in self.places(link).items() if p in self.spots and p not in unknown}
        pairs = [(self.spots[b] - self.spots[a], places[b] - places[a]) for a in places for b in places]
        drawn, own = max(pairs, key=lambda pair: min(abs(pair[0]), abs(pair[1])), default=(0j, 0j))
        turn = drawn * own.conjugate()
        return turn / abs(turn) if turn else None

    def axis(self, link: str) -> complex:
        """Direction of a link."""
        guide = self.guide(link)
        if guide is not None:
            return self.along(guide)
        places = self.places(link)
        seen = [p for p in places if p in self.spots]
        if len(seen) < 2:
            names = [p for p in self.links[link].point_names() if p not in seen]
            some = f"one of: {', '.join(names)}" if seen else f"two of: {', '.join(names)}"
            enough = len(names) + len(seen) > 1
            remedy = (
                f"sketch {some if len(names) > 1 else names[0]}" if enough else "give it another pin, and sketch it"
            )
            raise StructureError(f"links.{link}", "the sketch does not show its direction", remedy)
        pairs = [(self.spots[b] - self.spots[a], places[b] - places[a]) for a in seen for b in seen]
        drawn, own = max(pairs, key=lambda pair: min(abs(pair[0]), abs(pair[1])))
        if drawn == 0 or own == 0:
            problem = f"{', '.join(seen)} coincide in the sketch"
            raise StructureError(f"links.{link}", problem, "move one of them, or give the positions of its points")
        turn = drawn / own
        return turn / abs(turn)

    def guide(self, block: str) -> Guide | None:
        """The guide of a block; None for a link that is not a block."""
        return next((slot.guide for slot in self.slots if slot.block == block), None)

    def along(self, guide: Guide) -> complex:
        """Direction of a guide."""
        own = cmath.exp(1j * float(guide.along))
        return own if guide.on == FRAME else own * self.axis(guide.on)

    def path(self, guide: Guide) -> tuple[complex, complex]:
        """The path that a guide prescribes: the place on it next to the point `through`, and its direction."""
        along = self.along(guide)
        return self.spot(guide.through, guide.on) + 1j * along * float(guide.offset), along


def complex_of(where: str, at: Place) -> complex:
    """A place as a complex number. Raises `StructureError` for anything else, and for traced or batched numbers."""
    check_numbers(where, at)
    try:
        x, y = (at.x, at.y) if isinstance(at, Vec) else at
        return complex(float(x), float(y))
    except (TypeError, ValueError) as error:
        raise StructureError(where, f"must be x and y, but is {at!r}", "write (x, y) in metres") from error


def check_numbers(where: str, of: object) -> None:
    """Raise `StructureError` for numbers that are traced or batched."""
    numbers = [number_of(leaf) for leaf in jax.tree.leaves(of) if isinstance(leaf, jax.Array | np.ndarray)]
    if any(number is None or number.ndim for number in numbers):
        problem = "has numbers that are traced or batched"
        raise StructureError(where, problem, "build the mechanism with plain numbers, then replace its numbers")
