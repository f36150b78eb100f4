"""The position of a drawn machine at crank angle zero: as drawn; a number that is given must agree with it.

A phase that was not given was once zero, so a crank drawn upwards lay along x and the coupler's length was measured
from there: another machine, without notice. Now phases of drives and gears, and starts of laws and racks, are None
until `linkage` takes them from the sketch where each group is attached, so that the groups before it are in their true
position. A given number may differ by 1e-3 of its size from a sketch to scale, and by a tenth if given lengths show
that the sketch is rough. For coupled gears each phase follows from the drawn angles and its equation, including whole
revolutions. The property test draws random chains by coordinates only and compares with an independent program.
"""

from __future__ import annotations

import cmath
import dataclasses
import math
from collections.abc import Mapping

import jax
from jaxtyping import Array

from linkjax.groups import FRAME, Drive, Harmonic
from linkjax.mechanism._mechanism import StructureError
from linkjax.topology import Pair

SAME = 1e-9  # rad, or of the drawing's size: a law with a smaller stroke moves nothing
DIGITS = {True: 10, False: 6}  # of a number in a message, in double and in single precision


def degrees(angle: float) -> str:
    """An angle (rad) as a string for messages; not wrapped, since full revolutions matter where gears are coupled."""
    return f"{_digits(math.degrees(angle))} deg"


def metres(length: float) -> str:
    """A length (m) as a string for messages."""
    return f"{_digits(length)} m"


def _digits(value: float) -> str:
    return f"{value + 0.0:.{DIGITS[bool(jax.config.values['jax_enable_x64'])]}g}"


def number(value: Array | None) -> float:
    """An optional number, zero where it is None."""
    return 0.0 if value is None else float(value)


def settled(drawing, drive: Drive, driven: Pair) -> Drive:
    """The drive with a phase, and its law with a start; missing ones are taken from the drawing. Raises
    `StructureError` where a given number disagrees with the drawing."""
    slides, law = driven.letter == "P", drive.law
    drawn = _way(drawing, drive.link) if slides else _angle(drawing, drive)
    if isinstance(law, Harmonic) and law.start is None:
        return _from_drawing(drawing, drive, law, slides, drawn)
    if drive.phase is None and law is None:
        return dataclasses.replace(drive, phase=drawn or 0.0)
    found = drive if drive.phase is not None else dataclasses.replace(drive, phase=0.0)
    if drawn is not None:
        _check(drawing, found, driven, drawn, given=drive)
    return found


def spots_with_crank(drawing, drive: Drive) -> dict[str, complex]:
    """The drawn places of points (m), and the places of a crank's points if its length and phase are given."""
    if drive.phase is None or drive.law is not None or drive.link not in drawing.links:
        return drawing.spots
    copy = dataclasses.replace(drawing, links=dict(drawing.links), spots=dict(drawing.spots))
    try:
        copy.place_drive(drive)
    except StructureError:  # unknown so far; reported where it is needed
        return drawing.spots
    return copy.spots | drawing.spots


def check_guides(drawing) -> None:
    """Raise `StructureError` for a block that is not drawn on its guide."""
    for slot in drawing.slots:
        guide, on = slot.guide, drawing.drawn_axis(slot.guide.on)
        pin = drawing.links[slot.block].pins[0]
        if on is None or pin not in drawing.spots or guide.through not in drawing.spots:
            continue
        along = on * cmath.exp(1j * float(guide.along))
        _check_block(drawing, slot.block, along)
        aside = ((drawing.spots[pin] - drawing.spots[guide.through]) / along).imag
        if abs(aside - float(guide.offset)) > drawing.slack:
            where = f"drawn {metres(aside - float(guide.offset))} to the left of the path"
            problem = f"{pin!r} is {where} of its guide (offset {metres(float(guide.offset))})"
            remedy = f'write offset = "{metres(aside)}", correct `along` of the guide, or sketch {pin!r} on the path'
            raise StructureError(f"slot of {slot.block}", problem, remedy)


def _check_block(drawing, block: str, along: complex) -> None:
    """Raise `StructureError` where the points of a block disagree with the drawing: its axes are those of its guide,
    in the direction `along`."""
    link, unknown = drawing.links[block], drawing.unmeasured(block)
    origin = drawing.spots[link.pins[0]]
    for point, at in drawing.places(block).items():
        if point in unknown or point not in drawing.spots:
            continue
        drawn = (drawing.spots[point] - origin) / along
        if abs(drawn - at) > drawing.slack:
            key = f"points.{point}" if point in link.points else "length"
            problem = f"puts {point!r} {_along(at)} its guide from {link.pins[0]!r}, but it is drawn {_along(drawn)} it"
            remedy = "a block has the axes of its guide: correct the value, or omit it for the place drawn"
            raise StructureError(f"links.{block}.{key}", problem, remedy)


def _along(at: complex) -> str:
    return f"{metres(at.real)} along and {metres(at.imag)} across"


def check_fixed(drawing, sketch: Mapping[str, complex]) -> None:
    """Raise `StructureError` for a frame point whose place in the sketch differs."""
    for name, at in sketch.items():
        if name in drawing.fixed and abs(at - drawing.spots[name]) > drawing.slack:
            there = drawing.spots[name]
            problem = f"is {metres(abs(at - there))} from its place in [fixed], ({there.real:.6g}, {there.imag:.6g}) m"
            raise StructureError(f"sketch.{name}", problem, "delete it, or correct one of the two")


def _angle(drawing, drive: Drive) -> float | None:
    """The drawn angle of a link to the link or frame relative to which it is driven; None where it is not sketched."""
    link, on = drawing.drawn_axis(drive.link), drawing.drawn_axis(drive.on)
    return None if link is None or on is None else cmath.phase(link / on)


def _way(drawing, block: str) -> float | None:
    """The drawn displacement of a block along its guide (m); None where it is not sketched."""
    guide, pin = drawing.guide(block), drawing.links[block].pins[0]
    on = drawing.drawn_axis(guide.on)
    if on is None or pin not in drawing.spots or guide.through not in drawing.spots:
        return None
    return ((drawing.spots[pin] - drawing.spots[guide.through]) / (on * cmath.exp(1j * float(guide.along)))).real


def _from_drawing(drawing, drive: Drive, law: Harmonic, slides: bool, drawn: float | None) -> Drive:
    """The drive with a law that begins at the drawn position; of an angle, within half a turn of the end of the law."""
    if drawn is None:
        what = "displacement" if slides else "angle"
        problem = f"has no start, and the sketch does not show the {what} of {drive.link!r} relative to {drive.on!r}"
        raise StructureError("drive.law", problem, "write start, or sketch this link")
    phase, stop = number(drive.phase), float(law.stop)
    start = drawn if slides else stop + math.remainder(drawn - phase - stop, 2 * math.pi)
    if abs(stop - start) <= SAME * (drawing.size() if slides else 1.0):
        where = metres(stop) if slides else degrees(drawn)
        raise StructureError(
            "drive.law", f"stops where it starts: {drive.link!r} is drawn at {where}", "write another stop"
        )
    return dataclasses.replace(drive, phase=phase, law=dataclasses.replace(law, start=start))


def _check(drawing, drive: Drive, driven: Pair, drawn: float, given: Drive) -> None:
    """Raise `StructureError` where the numbers of the drive disagree with the drawing."""
    slides = driven.letter == "P"
    begins = drive.begins(slides)
    off = abs(begins - drawn) if slides else abs(math.remainder(begins - drawn, 2 * math.pi))
    if not slides:
        pin = drawing.spots.get(driven.name)
        reach = [abs(drawing.spots[p] - pin) for p in drawing.links[drive.link].point_names() if p in drawing.spots]
        off *= (max(reach, default=0.0) if pin is not None else 0.0) or drawing.size()
    if off <= drawing.slack:
        return
    write = metres if slides else degrees
    against = "" if slides or drive.on == FRAME else f" to {drive.on!r}"
    seen = f"{drive.link!r} is drawn at {write(drawn)}{against}"
    if drive.law is None:
        problem, remedy = f"is {write(begins)}, but {seen}", "delete it for the angle drawn, or correct the sketch"
        raise StructureError("drive.phase", problem, remedy)
    phase = 0.0 if slides else number(given.phase)
    since = "" if given.phase is None or slides else f" from the phase {degrees(phase)}"
    problem = f"starts at {write(begins - phase)}{since}, but {seen}"
    shift = drawn - begins
    if isinstance(drive.law, Harmonic):
        remedy = f'write start = "{write(number(drive.law.start) + shift)}"'
    else:
        remedy = "change its values"
    also = "" if slides else f', or phase = "{degrees(phase + shift)}"'
    raise StructureError("drive.law", problem, f"{remedy}{also}, or correct the sketch")
