"""A mechanism from its links and joints as one draws them: found out, cut into groups, put together."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

from linkjax._units import nearest
from linkjax._vec import Vec
from linkjax.groups import FRAME, RRP, RRR, AbstractGroup, Drive, GearPair, Pair, RackPair, Slot
from linkjax.mechanism._attach import Attachment
from linkjax.mechanism._drawing import Drawing, Place, complex_of
from linkjax.mechanism._freedom import blocks, counted, freedom
from linkjax.mechanism._link import Flywheel, Link
from linkjax.mechanism._mechanism import Mechanism, StructureError
from linkjax.mechanism._passive import dispensable, misfit, passive_group
from linkjax.mechanism._sides import Sides, with_sides
from linkjax.mechanism._sketched import allowed, check_reach, check_sketch
from linkjax.mechanism._start import check_fixed, check_guides, settled, spots_with_crank

MOST_TOLD = 6  # joints in a message


def linkage(
    fixed: Mapping[str, Place],
    links: Mapping[str, Link],
    drive: Drive,
    slots: Iterable[Slot] = (),
    sketch: Mapping[str, Place] | None = None,
    flywheel: Flywheel | None = None,
    gears: Iterable[GearPair] = (),
    racks: Iterable[RackPair] = (),
    sides: Mapping[str, Sides] | None = None,
    branch: Literal["fixed", "continue"] = "fixed",
) -> Mechanism:
    """A mechanism from links and joints: mobility is checked, and the Assur groups are found.

    Every link names its `pins`. A point that two or more links name is a pin between them; one that stands in `fixed`
    is a pin on the frame. `slots` are the sliding joints: a block is a link whose first pin runs along the guide and
    whose axes are those of the guide. `gears` and `racks` are the wheels in gear: a wheel names the pin that it turns
    about first. `drive` says what drives. `sketch` says where the moving pins are at crank angle zero (m); it chooses
    the assembly. A link without a length has it from the sketch, and so have further pins that are no marked points; so
    have the drive its phase or the start of its law, gears their phases and racks their starts, where these are None. A
    machine drawn by coordinates alone has every joint where it is drawn. `sides` gives links of three or more pins by
    the distances between their pins (m), e.g. `{"plate": {("E", "F"): 0.25, ("F", "G"): 0.18, ("G", "E"): 0.3}}`; the
    sketch says on which side the third pin lies. With `branch` "continue" dyads go on smoothly through change points.

    Raises `StructureError`, naming links and joints, where the parts do not hang together, hold each other fast, are
    left loose or are not driven, where the sketch does not say enough, and where a number that is given disagrees with
    it: in a drawing that is true to scale by more than 1e-3 of its size, in a rough one by more than a tenth.
    """
    if branch not in ("fixed", "continue"):
        raise StructureError("branch", f"is {branch!r}", 'write "fixed" or "continue"')
    slots, spots = tuple(slots), {name: complex_of(f"sketch.{name}", at) for name, at in (sketch or {}).items()}
    frame = {name: complex_of(f"fixed.{name}", at) for name, at in fixed.items()}
    ground = {name: Vec(at.real, at.imag) for name, at in frame.items()}
    drawing = Drawing(ground, dict(links), slots, spots | frame, tuple(gears), tuple(racks))
    drawing.check(spots)
    for name, given in (sides or {}).items():
        if name not in drawing.links:
            raise StructureError(f"links.{name}.sides", "is no link", nearest(name, drawing.links))
        drawing.links[name] = with_sides(name, drawing.links[name], given, spots_with_crank(drawing, drive))
    check_sketch(drawing, spots)
    drawing.slack = allowed(drawing)
    check_fixed(drawing, spots)
    drive = _of_block(drive, slots)
    found = drawing.pairs()
    driven = drawing.driven(drive, found)
    drive = settled(drawing, drive, driven)
    passive, whole = drawing.passive(drive, found, driven), drawing
    if passive:
        drawing = whole.without(passive)
        found = drawing.pairs()
        driven = drawing.driven(drive, found)
    _check_freedom(drawing, drive, found, driven)
    parts = blocks(list(drawing.links), found, driven)
    if drive.link not in parts[0]:
        problem = (
            f"moves {drive.link!r} against {drive.on!r}, but {', '.join(parts[0])} cannot move, as good as the frame"
        )
        raise StructureError(
            "drive", problem, "leave them out, put their pins under `fixed`, and drive against the frame"
        )
    check_guides(drawing)
    drawing.measure_drawn()
    drawing.place_drive(drive)
    check_reach(drawing, drive, spots)
    for name in drawing.links:
        drawing.measure(name)
    groups = Attachment(drawing, drive).groups(parts)
    if passive or branch == "continue":
        groups = [_through(group) for group in groups]
    if passive:
        whole.spots = drawing.spots
        for link in passive:
            whole.measure(link)
        groups += [passive_group(link, whole) for link in passive]
        drawing.links = {name: drawing.links.get(name, whole.links[name]) for name in whole.links}
    return Mechanism(drawing.fixed, drawing.links, groups, flywheel)


def _of_block(drive: Drive, slots: Sequence[Slot]) -> Drive:
    """The drive that moves the block of a slot, where it was named the other way round."""
    other = (drive.on, drive.link)
    turned_round = any((slot.block, slot.guide.on) == other for slot in slots)
    return dataclasses.replace(drive, link=drive.on, on=drive.link) if turned_round else drive


def _through(group: AbstractGroup) -> AbstractGroup:
    """A dyad that goes on smoothly where its assemblies meet, as passive links make it do."""
    return dataclasses.replace(group, branch="continue") if isinstance(group, RRR | RRP) else group


def _check_freedom(drawing: Drawing, drive: Drive, found: Sequence[Pair], driven: Pair) -> None:
    """Raise `StructureError` unless the chain has the one degree of freedom that the drive takes."""
    links = list(drawing.links)
    degrees, redundant, loose, moved = freedom(links, found, driven)
    count = counted(len(links), found)
    if redundant:
        at = {name: {pair.name for pair in redundant if name in pair.ends} for name in links}
        held = ", ".join(name for name in links if len(at[name]) > 1)
        names = ", ".join(dict.fromkeys(pair.name for pair in redundant))
        problem = f"{held} hold each other fast: one of the joints {names} is too many ({count})"
        raise StructureError("links", problem, "leave out one of these joints, or add a link between them")
    if degrees == 0:
        drawn = drawing.measured(drive)
        near = misfit(drawn, found, driven) if drawn is not None else None
        if near is not None:
            name, length, *ends = near
            apart = " to ".join(dict.fromkeys(f"{end:.6g}" for end in ends))
            problem = (
                f"nothing can move ({count}): {name!r} is {length:.6g} m, but as the rest moves its ends are {apart}"
            )
            remedy = "give it dimensions with which it fits all the way, or leave it out"
            raise StructureError(f"links.{name}", f"{problem} m apart", remedy)
        _check_fast(drawing, drive, found, driven, count)
    alone = _alone(drawing, [name for name in links if name in (*loose, drive.link)])
    if not moved:
        problem = f"it moves nothing: {' and '.join(driven.ends)} cannot move against each other ({count}){alone}"
        free = ", ".join(freedom(links, found).loose)
        raise StructureError("drive", problem, f"name two links that can, of: {free}")
    others = [name for name in links if name != drive.link]
    if others and not any(drive.link in pair.ends for pair in found if pair != driven):
        problem = f"it moves {drive.link!r} alone, to which nothing is joined but {drive.on!r} ({count}){alone}"
        pins = ", ".join(
            point for point in drawing.links[drive.link].pins if point not in (*drawing.fixed, driven.name)
        )
        at = f" ({pins})" if pins else ""
        raise StructureError("drive", problem, f"let another link share a pin of it{at}, or drive another link")
    if degrees > 1:
        pins = dict.fromkeys(pair.name for pair in found if set(pair.ends) & set(loose))
        what = f"{', '.join(loose)} can still move at {_few(pins)}"
        remedy = "a link from pin to pin takes one away, a pin or a slot where none is takes two; or leave them out"
        cranks = [name for pair in found if FRAME in pair.ends for name in pair.ends if name in loose]
        if degrees == 2 and cranks:  # such as a five-bar of two cranks
            two = f"couple {drive.link!r} and {cranks[0]!r} by gears ([[gears]]) or add a link"
            remedy = f"linkjax drives one joint only and has no second drive: {two}; {remedy}"
        problem = f"{what} when the drive is held: {degrees} degrees of freedom ({count}){alone}"
        raise StructureError("links", problem, remedy)


def _check_fast(drawing: Drawing, drive: Drive, found: Sequence[Pair], driven: Pair, count: str) -> None:
    """Raise `StructureError` for a chain in which nothing can move: what holds the drive fast, what may be spared."""
    held = next(part for part in blocks(list(drawing.links), found) if drive.link in part)
    at = dict.fromkeys(pair.name for pair in found if set(pair.ends) & set(held))
    problem = f"nothing can move ({count}): {', '.join(held)} hold each other fast at {_few(at)}"
    spare = dispensable(drawing, found, driven)
    of = " one of:" if len(spare) > 1 else ""
    remedy = f"leave out{of} {', '.join(spare) or 'a link that joins two others'}"
    raise StructureError("links", problem, f"{remedy}, or give it dimensions with which it fits all the way")


def _alone(drawing: Drawing, links: Sequence[str]) -> str:
    """Pins of links that nothing else names, where one may be missing."""
    ends = drawing.pins()
    told = [f"{point!r} of {name!r}" for name in links for point in drawing.links[name].pins if ends[point] == [name]]
    return f"; nothing else names {_few(told)}" if told else ""


def _few(names: Iterable[str]) -> str:
    """The first of these, as a list in a message."""
    first = list(names)
    return ", ".join(first[:MOST_TOLD]) + ", …" * (len(first) > MOST_TOLD)
