"""Wheels in gear among links and joints as one draws them: what carries them, and the group that each makes."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence

from linkjax._units import nearest
from linkjax.groups import FRAME, AbstractGroup, Drive, Gear, GearPair, Pair, Pinion, Rack, RackPair, Slot
from linkjax.mechanism._link import Link
from linkjax.mechanism._mechanism import StructureError

Pins = Mapping[str, Sequence[str]]


def carried_on(gear: GearPair, pins: Pins) -> tuple[str, str, str]:
    """What carries two wheels, and the pins that they turn about there. `pins` says what every pin joins."""

    def shared(one: str, other: str) -> list[str]:
        return [point for point, ends in pins.items() if {one, other} <= set(ends)]

    bodies = dict.fromkeys([FRAME, *(end for ends in pins.values() for end in ends)])
    both = [
        (body, at[0], about[0])
        for body in bodies
        if body not in (gear.link, gear.to) and (at := shared(gear.link, body)) and (about := shared(gear.to, body))
    ]
    if not both:
        problem = f"{gear.link!r} and {gear.to!r} are in gear, but nothing carries both"
        raise StructureError(f"gear of {gear.link}", problem, "pin both to the frame, or to one link")
    return both[0]


def pairs_of(
    gears: Sequence[GearPair], racks: Sequence[RackPair], slots: Sequence[Slot], pins: Pins, links: Mapping[str, Link]
) -> list[Pair]:
    """The pairs that wheels in gear make. Raises `StructureError` for what is none."""
    found = []
    for gear in (*gears, *racks):
        for name in (gear.link, gear.to):
            if name not in (FRAME, *links):
                raise StructureError(f"gear of {gear.link}", f"link {name!r} is not defined", nearest(name, links))
        if isinstance(gear, GearPair):
            found.append(Pair("G", f"{gear.link}.mesh", gear.link, gear.to, carried_on(gear, pins)[0]))
            continue
        guide = next((slot.guide for slot in slots if slot.block == gear.link), None)
        if guide is None:
            problem = f"link {gear.link!r} is a rack, but no slot's block"
            raise StructureError(f"rack {gear.link}", problem, "add a slot that it slides in")
        if not any({gear.to, guide.on} <= set(ends) for ends in pins.values()):
            problem = f"its wheel {gear.to!r} is not pinned to {guide.on!r}, along which it slides"
            raise StructureError(f"rack {gear.link}", problem, "pin the wheel there")
        found.append(Pair("G", f"{gear.link}.mesh", gear.link, gear.to, guide.on, rack=True))
    return found


class Wheels:
    """Builds the group of a single link that is in gear with one that is there already."""

    def __init__(self, gears: Sequence[GearPair], racks: Sequence[RackPair], drawing, drive: Drive):
        self.gears, self.racks, self.drawing, self.drive = gears, racks, drawing, drive

    def group(self, link: str, placed: set[str]) -> AbstractGroup:
        """The group; the places of the link's points are found on the way."""
        for gear in self.gears:
            if link in (gear.link, gear.to) and {gear.link, gear.to} - {link} <= placed:
                return self._gear(gear if gear.link == link else turned_round(gear))
        rack = next(rack for rack in self.racks if link in (rack.link, rack.to))
        return self._rack(rack) if link == rack.link else self._pinion(rack)

    def _gear(self, gear: GearPair) -> Gear:
        carrier, pivot, centre = carried_on(gear, self.drawing.pins())
        end = self._end(gear.link, pivot)
        there, on = self._angle(gear.to), self._angle(carrier)
        self._turn(gear.link, pivot, float(gear.phase) + on + float(gear.mesh.ratio()) * (there - on))
        return Gear(gear.link, pivot, gear.mesh, gear.to, centre, end, gear.phase, carrier)

    def _rack(self, rack: RackPair) -> Rack:
        guide, centre = self._guide(rack.link), self._centre(rack)
        end = self.drawing.links[rack.link].pins[0]
        return Rack(rack.link, end, guide, rack.to, centre, rack.radius, rack.side, rack.start, rack.pressure_angle)

    def _pinion(self, rack: RackPair) -> Pinion:
        guide, pivot, at = self._guide(rack.link), self._centre(rack), self.drawing.links[rack.link].pins[0]
        places = self.drawing.spots if guide.on == FRAME else self.drawing.places(guide.on)
        ahead = ((places[pivot] - places[guide.through]) * cmath.exp(-1j * float(guide.along))).real
        phase = rack.side * (ahead - rack.start) / rack.radius
        end = self._end(rack.to, pivot)
        along = self.drawing.along(guide)
        moved = ((self.drawing.spot(at, rack.link) - self.drawing.spots[pivot]) / along).real
        self._turn(rack.to, pivot, float(phase) + self._angle(guide.on) + rack.side * moved / float(rack.radius))
        return Pinion(rack.to, pivot, rack.link, at, rack.radius, rack.side, end, phase, guide.on, rack.pressure_angle)

    def _guide(self, block: str):
        return next(slot.guide for slot in self.drawing.slots if slot.block == block)

    def _centre(self, rack: RackPair) -> str:
        on = self._guide(rack.link).on
        return next(point for point, ends in self.drawing.pins().items() if {rack.to, on} <= set(ends))

    def _end(self, wheel: str, pivot: str) -> str | None:
        """The pin at the far end of a wheel's axis, if it has one."""
        link = self.drawing.links[wheel]
        if link.pins[0] != pivot:
            problem = f"is in gear, and turns about {pivot!r}, which is not its first pin"
            raise StructureError(f"links.{wheel}", problem, "name that pin first")
        return link.pins[1] if len(link.pins) > 1 and link.pins[1] not in link.points else None

    def _angle(self, link: str) -> float:
        """Angle of a link at crank angle zero."""
        if link == FRAME:
            return 0.0
        if link == self.drive.link and self.drive.on == FRAME:
            return float(self.drive.at(self.drive.phase * 0.0, slides=False)[0])
        return cmath.phase(self.drawing.axis(link))

    def _turn(self, wheel: str, pivot: str, angle: float) -> None:
        """Find the places of the points of a wheel that stands at this angle."""
        turn = cmath.exp(1j * math.remainder(angle, 2 * math.pi))
        places, at = self.drawing.places(wheel), self.drawing.spots[pivot]
        self.drawing.spots |= {p: at + (place - places[pivot]) * turn for p, place in places.items()}


def turned_round(gear: GearPair) -> GearPair:
    """The same two wheels, the other one first."""
    mesh = gear.mesh.turned_round()
    return GearPair(gear.to, gear.link, mesh, -gear.phase * mesh.ratio())
