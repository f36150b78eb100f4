"""Gears and racks of a drawing: their carriers, their pairs and their groups."""

from __future__ import annotations

import cmath
import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from linkjax._units import nearest
from linkjax.groups import FRAME, AbstractGroup, Drive, Gear, GearPair, General, Pinion, Rack, RackPair, Slot
from linkjax.mechanism._link import Link
from linkjax.mechanism._mechanism import StructureError
from linkjax.mechanism._start import degrees, metres, number
from linkjax.topology import Pair

ASTRAY = 0.5  # rad: largest misfit of the sketched carrier of a gear that is not sketched
Pins = Mapping[str, Sequence[str]]


def carried_on(gear: GearPair, pins: Pins) -> tuple[str, str, str]:
    """The carrier of two gears, and the pins that they turn about on it. `pins` has the bodies that every pin joins."""

    def shared(one: str, other: str) -> list[str]:
        return [point for point, ends in pins.items() if {one, other} <= set(ends)]

    bodies = dict.fromkeys([FRAME, *(end for ends in pins.values() for end in ends)])
    both = [
        (body, at[0], about[0])
        for body in bodies
        if body not in (gear.link, gear.to) and (at := shared(gear.link, body)) and (about := shared(gear.to, body))
    ]
    if not both:
        problem = f"{gear.link!r} and {gear.to!r} are in mesh, but have no common carrier"
        raise StructureError(f"gear of {gear.link}", problem, "pin both to the frame, or to the same link")
    if both[0][1] == both[0][2]:
        problem = f"{gear.link!r} and {gear.to!r} are in mesh, but turn about the same pin {both[0][1]!r}"
        raise StructureError(f"gear of {gear.link}", problem, "pin one of them at another point")
    return both[0]


def pairs_of(
    gears: Sequence[GearPair], racks: Sequence[RackPair], slots: Sequence[Slot], pins: Pins, links: Mapping[str, Link]
) -> list[Pair]:
    """The gear pairs. Raises `StructureError` for gears and racks that form no pair."""
    found = []
    for gear in gears:
        _check_ends(gear, links)
        found.append(Pair("G", f"{gear.link}.mesh", gear.link, gear.to, carried_on(gear, pins)[0]))
    for rack in racks:
        _check_ends(rack, links)
        guide = next((slot.guide for slot in slots if slot.block == rack.link), None)
        if guide is None:
            problem = f"link {rack.link!r} is a rack, but is not the block of any slot"
            raise StructureError(f"rack {rack.link}", problem, "add a slot with this link as its block")
        if rack.to == guide.on:
            problem = f"it slides on {rack.to!r}, the gear that it meshes with"
            raise StructureError(f"rack {rack.link}", problem, "let it slide on the carrier of the gear")
        if not any({rack.to, guide.on} <= set(ends) for ends in pins.values()):
            problem = f"its gear {rack.to!r} is not pinned to {guide.on!r}, along which the rack slides"
            raise StructureError(f"rack {rack.link}", problem, f"pin {rack.to!r} to {guide.on!r}")
        found.append(Pair("G", f"{rack.link}.mesh", rack.link, rack.to, guide.on, rack=True))
    return found


def _check_ends(gear: GearPair | RackPair, links: Mapping[str, Link]) -> None:
    """Raise `StructureError` unless a pair in mesh names two links."""
    if gear.link == gear.to:
        raise StructureError(f"gear of {gear.link}", "it is in mesh with itself", "name another link")
    for name in (gear.link, gear.to):
        if name not in (FRAME, *links):
            raise StructureError(f"gear of {gear.link}", f"link {name!r} is not defined", nearest(name, links))


class Wheels:
    """Builds the group of a single link that meshes with a link attached before."""

    def __init__(self, gears: Sequence[GearPair], racks: Sequence[RackPair], drawing, drive: Drive):
        self.gears, self.drawing = gears, drawing
        self.racks, self.sides = racks, {rack.link: self._side(rack) for rack in racks}
        self.counted = {FRAME: 0.0}  # angles with full revolutions, at crank angle zero
        if drive.on == FRAME and all(slot.block != drive.link for slot in drawing.slots):
            self.counted[drive.link] = drive.begins(slides=False)

    def _side(self, rack: RackPair) -> int:
        """The side of the rack on which its gear is. Raises `StructureError` where it is drawn on the other side."""
        guide, centre = self.drawing.guide(rack.link), self._centre(rack)
        on, known = self.drawing.drawn_axis(guide.on), {guide.through, centre} <= set(self.drawing.spots)
        if on is None or not known:
            return 1 if rack.side is None else rack.side
        away = (self.drawing.spots[centre] - self.drawing.spots[guide.through]) / (
            on * cmath.exp(1j * float(guide.along))
        )
        off = away.imag - float(guide.offset)
        drawn = 1 if off >= 0 else -1
        if rack.side is not None and rack.side != drawn and abs(off) > self.drawing.slack:
            one, other = ("left", "right") if rack.side > 0 else ("right", "left")
            problem = f"with this side {rack.to!r} is on the {one} of the guide, but it is drawn on the {other}"
            raise StructureError(f"rack {rack.link}", problem, "delete it for the side drawn, or correct the sketch")
        return drawn if rack.side is None else rack.side

    def group(self, link: str, placed: set[str]) -> AbstractGroup:
        """The group of a link; it also finds the places of the link's points."""
        for gear in self.gears:
            if link in (gear.link, gear.to) and {gear.link, gear.to} - {link} <= placed:
                return self._gear(gear if gear.link == link else turned_round(gear))
        ends = ((rack, {rack.link, rack.to}) for rack in self.racks)
        rack = next(rack for rack, both in ends if link in both and both - {link} <= placed)
        return self._rack(rack) if link == rack.link else self._pinion(rack)

    def inside(self, part: Sequence[str], placed: set[str]) -> tuple[Gear | Rack, ...]:
        """The gears and racks whose angles are coupled with links of a part and solved simultaneously."""
        pins, found = self.drawing.pins(), []
        for gear in self.gears:
            carrier, pivot, centre = carried_on(gear, pins)
            if {gear.link, gear.to, carrier} <= {*part, *placed, FRAME} and {gear.link, gear.to, carrier} & set(part):
                ends = (gear.link, pivot, gear.mesh, gear.to, centre)
                if gear.link not in part:
                    back = turned_round(gear)
                    ends, gear = (back.link, centre, back.mesh, back.to, pivot), back
                found.append(Gear(*ends, None, gear.phase, carrier))
        for rack in self.racks:
            guide = self.drawing.guide(rack.link)
            if {rack.link, rack.to, guide.on} <= {*part, *placed, FRAME} and {rack.link, rack.to, guide.on} & set(part):
                end, rest = (
                    self.drawing.links[rack.link].pins[0],
                    (self.sides[rack.link], rack.start, rack.pressure_angle),
                )
                found.append(Rack(rack.link, end, guide, rack.to, self._centre(rack), rack.radius, *rest))
        for each in found:
            if each.link not in part:
                problem = f"the position of its carrier is determined only after {each.link!r} and {each.to!r}"
                raise StructureError(f"gear of {each.link}", problem, "drive another link")
        return self._as_drawn(found)

    def _as_drawn(self, found: Sequence[Gear | Rack]) -> tuple[Gear | Rack, ...]:
        """These, with missing phases and starts from the drawing. Of gears that are not drawn the first phase is zero,
        and the others follow from it."""
        done, angles, left = list(found), dict(self.counted), list(range(len(found)))
        for name in (name for gear in found for name in gear.coupling().angles):
            axis = None if name in angles else self.drawing.drawn_axis(name)
            angles |= {} if axis is None else {name: cmath.phase(axis)}
        while left:
            i = min(left, key=lambda i: (len(unknown := _unknown(done[i], angles)), _given(done[i]) is None, unknown))
            gear, more = done[i], _unknown(done[i], angles)
            angles |= dict.fromkeys(more[1:], 0.0)
            held, given = gear.coupling(), _given(gear)
            sums = [float(held.angles[name]) * angles[name] for name in held.angles if name in angles]
            total = sum(sums) + sum(float(held.ways[name]) * self._way(name) for name in held.ways)
            if more:
                given = 0.0 if given is None else given
                angles[more[0]] = (given - total) / float(held.angles[more[0]])
            if _given(gear) is None:
                done[i] = gear.with_constant(total if given is None else given)
            left.remove(i)
        return tuple(done)

    def check_phases(self, group: General) -> None:
        """Raise `StructureError` where the phases of gears put carriers, racks or drawn gears elsewhere than
        sketched."""
        gears, free = group.gears, list(group.spinning())
        if not gears:
            return
        rows, left, seen = self._contradictions(group)
        told = [name for name in seen if name in group.link_names()]
        at = np.array([[row.get(name, 0.0) for name in (*free, *told)] for row in rows])
        inverse = np.linalg.pinv(at[:, : len(free)])
        spun, still = inverse @ left, np.eye(len(rows)) - at[:, : len(free)] @ inverse
        left = still @ left  # the part that gears cannot compensate
        off = np.linalg.pinv(still @ at[:, len(free) :]) @ left
        racks = {gear.link for gear in gears if gear.sliding()}
        drawn = {name: cmath.phase(axis) for name in free if (axis := self.drawing.drawn_axis(name)) is not None}
        off = dict(zip(told, off, strict=True)) | {name: spun[free.index(name)] - drawn[name] for name in drawn}
        for name, more in off.items():
            if (abs(more) if name in racks else self._swept(name, more)) <= self.drawing.slack:
                continue
            there, write = (seen | drawn)[name], metres if name in racks else degrees
            where = f"{name!r} is at {write(there + more)}" + " along its guide" * (name in racks)
            every = (self._remedy(gears[i], left, still[:, i]) for i in reversed(range(len(gears))))
            remedy = next(filter(None, every), "")
            problem = f"with these phases {where} at crank angle zero, but is drawn at {write(there)}"
            raise StructureError(f"gear of {', '.join(gear.link for gear in gears)}", problem,
                                 f"{remedy}delete the phases for those drawn, or correct the sketch")  # fmt: skip

    def _contradictions(self, group: General) -> tuple[list[dict[str, float]], np.ndarray, dict[str, float]]:
        """The constraints of gears, racks and a drive inside a group, the misfit of the sketch in each (rad; of a rack
        divided by its gear's radius), and the sketched angles and displacements."""
        rows, left, seen, wheels = [], [], {FRAME: 0.0}, group.spinning()
        for gear in group.gears:
            held, radius = gear.coupling(), _per_radian(gear)
            rows.append({name: float(factor) / radius for name, factor in (*held.angles.items(), *held.ways.items())})
            left.append(number(held.constant) / radius)
            seen |= {name: self.angle(name) for name in held.angles if name not in wheels}
            seen |= {name: self._way(name) for name in held.ways}
        drive, whole = group.drive, [group.in_whole_turns(gear) for gear in group.gears]
        if drive is not None and group.driven_slot() is None:
            rows.append({drive.link: 1.0, drive.on: -1.0})
            left.append(drive.begins(slides=False))
            seen |= {name: self.angle(name) for name in (drive.link, drive.on)}
            whole.append(True)
        for i, row in enumerate(rows):
            left[i] -= sum(row.get(name, 0.0) * at for name, at in seen.items())
            left[i] = math.remainder(left[i], 2 * math.pi) if whole[i] else left[i]
        return rows, np.array(left), seen

    def _remedy(self, gear: Gear | Rack, left: np.ndarray, share: np.ndarray) -> str:
        """The phase or start of one gear that removes the misfit `left`; empty where more than one must change. `share`
        is the part of a change of its phase that other gears cannot compensate."""
        much = float(share @ share)
        more = -float(left @ share) / much if much > 1e-12 else math.inf
        if not np.abs(left + more * share).max() <= ASTRAY:
            return ""
        constant = number(gear.coupling().constant) + more * _per_radian(gear)
        if gear.sliding():
            return f'write start = "{metres(constant)}" for the rack {gear.link!r}, or '
        pair = next(given for given in self.gears if {given.link, given.to} == {gear.link, gear.to})
        phase = constant if pair.link == gear.link else -constant * float(pair.mesh.ratio())
        return f'write phase = "{degrees(phase)}" for the pair {pair.link!r} and {pair.to!r}, or '

    def _way(self, rack: str) -> float:
        """The displacement of a rack along its guide in the sketch (m)."""
        base, along = self.drawing.path(self.drawing.guide(rack))
        return ((self.drawing.spot(self.drawing.links[rack].pins[0], rack) - base) / along).real

    def _gear(self, gear: GearPair) -> Gear:
        carrier, pivot, centre = carried_on(gear, self.drawing.pins())
        end, drawn = self._end(gear.link, pivot), self.drawing.drawn_axis(gear.link)
        there, on = self.angle(gear.to), self.angle(carrier)
        moved = on + float(gear.mesh.ratio()) * (there - on)
        seen = 0.0 if drawn is None else math.remainder(cmath.phase(drawn) - moved, 2 * math.pi)
        phase = seen if gear.phase is None else float(gear.phase)
        if drawn is not None and self._swept(gear.link, phase - seen) > self.drawing.slack:
            pair = dataclasses.replace(gear, phase=seen)
            pair = pair if any(pair.link == g.link and pair.to == g.to for g in self.gears) else turned_round(pair)
            problem = f"with this phase {gear.link!r} is at {degrees(phase + moved)} at crank angle zero"
            remedy = (
                f'write phase = "{degrees(number(pair.phase))}", delete it for the one drawn, or correct the sketch'
            )
            raise StructureError(
                f"gear of {pair.link}", f"{problem}, but is drawn at {degrees(cmath.phase(drawn))}", remedy
            )
        self._turn(gear.link, pivot, phase + moved)
        return Gear(gear.link, pivot, gear.mesh, gear.to, centre, end, phase, carrier)

    def _swept(self, link: str, angle: float) -> float:
        """The largest displacement (m) of the drawn points of a link that turns by `angle` about its first pin."""
        spots = [self.drawing.spots[p] for p in self.drawing.links[link].point_names() if p in self.drawing.spots]
        reach = max((abs(spot - spots[0]) for spot in spots), default=0.0)
        return reach * abs(math.remainder(angle, 2 * math.pi))

    def _rack(self, rack: RackPair) -> Rack:
        guide, centre = self.drawing.guide(rack.link), self._centre(rack)
        end, (base, along) = self.drawing.links[rack.link].pins[0], self.drawing.path(guide)
        side = self.sides[rack.link]
        moved = side * float(rack.radius) * (self.angle(rack.to) - self.angle(guide.on))
        drawn = self._way(rack.link) if end in self.drawing.spots else None
        start = float(rack.start) if rack.start is not None else 0.0 if drawn is None else drawn - moved
        if drawn is not None and abs(drawn - start - moved) > self.drawing.slack:
            where = f"is {metres(start + moved)} along its guide at crank angle zero, but is drawn at {metres(drawn)}"
            remedy = f'write start = "{metres(drawn - moved)}", delete it for the start drawn, or correct the sketch'
            raise StructureError(f"rack {rack.link}", f"with this start it {where}", remedy)
        self.drawing.place(rack.link, end, base + along * (start + moved), along)
        return Rack(rack.link, end, guide, rack.to, centre, rack.radius, side, start, rack.pressure_angle)

    def _pinion(self, rack: RackPair) -> Pinion:
        guide, pivot, at = self.drawing.guide(rack.link), self._centre(rack), self.drawing.links[rack.link].pins[0]
        end, drawn = self._end(rack.to, pivot), self.drawing.drawn_axis(rack.to)
        side = self.sides[rack.link]
        way, on, per = self._way(rack.link), self.angle(guide.on), side / float(rack.radius)
        stands = None if drawn is None else cmath.phase(drawn)
        seen = 0.0 if stands is None else way - math.remainder(stands - on, 2 * math.pi) / per
        start = seen if rack.start is None else float(rack.start)
        turned = on + per * (way - start)
        if stands is not None and self._swept(rack.to, per * (start - seen)) > self.drawing.slack:
            problem = f"with this start {rack.to!r} is at {degrees(turned)} at crank angle zero"
            remedy = f'write start = "{metres(seen)}", delete it for the start drawn, or correct the sketch'
            raise StructureError(f"rack {rack.link}", f"{problem}, but is drawn at {degrees(stands)}", remedy)
        self._turn(rack.to, pivot, turned)
        return Pinion(rack.to, pivot, rack.link, at, rack.radius, side, end, 0.0, guide.on, rack.pressure_angle,
                      guide.through, start)  # fmt: skip

    def _centre(self, rack: RackPair) -> str:
        on = self.drawing.guide(rack.link).on
        return next(point for point, ends in self.drawing.pins().items() if {rack.to, on} <= set(ends))

    def _end(self, link: str, pivot: str) -> str | None:
        """The second pin of a gear, if its length places one."""
        own = self.drawing.links[link]
        if own.pins[0] != pivot:
            problem = f"is a gear that turns about {pivot!r}, which is not its first pin"
            raise StructureError(f"links.{link}", problem, f"name {pivot!r} first in its pins")
        return own.pins[1] if len(own.pins) > 1 and own.pins[1] not in own.points else None

    def angle(self, link: str) -> float:
        """Angle of a link at crank angle zero."""
        return self.counted[link] if link in self.counted else cmath.phase(self.drawing.axis(link))

    def _turn(self, wheel: str, pivot: str, angle: float) -> None:
        """Find the places of the points of a gear at this angle."""
        self.counted[wheel] = angle
        turn = cmath.exp(1j * math.remainder(angle, 2 * math.pi))
        self.drawing.place(wheel, pivot, self.drawing.spots[pivot], turn)


def turned_round(gear: GearPair) -> GearPair:
    """The same two gears in the other order."""
    mesh = gear.mesh.turned_round()
    return GearPair(gear.to, gear.link, mesh, None if gear.phase is None else -gear.phase * mesh.ratio())


def _given(gear: Gear | Rack) -> float | None:
    """The given phase of a gear, or the given start of a rack."""
    value = gear.coupling().constant
    return None if value is None else float(value)


def _per_radian(gear: Gear | Rack) -> float:
    """The displacement of a rack per radian of its gear (m); one for a gear."""
    return abs(float(gear.coupling().angles[gear.to])) if gear.sliding() else 1.0


def _unknown(gear: Gear | Rack, angles: Mapping[str, float]) -> list[str]:
    """The links of a gear pair with unknown angles."""
    return [name for name, factor in gear.coupling().angles.items() if name not in angles and float(factor) != 0.0]
