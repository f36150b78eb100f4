"""A mechanism from its links and joints: checked, divided into structural groups, and put together.

There is no second solver: the drawing is divided into the blocks of its closure (`topology`). Blocks of two links
become groups in closed form where their links permit it, the others `General`. A group may hold a link at pins other
than those of its own axis (`Link.held`), so another driver changes the groups, but neither the dimensions nor the names
of the links.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

from linkjax._units import nearest
from linkjax._vec import Vec
from linkjax.groups import FRAME, Drive, GearPair, RackPair, Slot
from linkjax.mechanism._arguments import check_arguments, listed
from linkjax.mechanism._attach import Attachment
from linkjax.mechanism._drawing import Drawing, Place, complex_of
from linkjax.mechanism._link import Flywheel, Link
from linkjax.mechanism._mechanism import Mechanism, StructureError
from linkjax.mechanism._passive import dispensable, misfit, passive_group
from linkjax.mechanism._sides import Sides, with_sides
from linkjax.mechanism._sketched import allowed, check_reach, check_sketch
from linkjax.mechanism._start import check_fixed, check_guides, settled, spots_with_crank
from linkjax.topology import Pair, blocks, counted, freedom

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
    """A mechanism from links and joints: the mobility is checked, and the Assur groups are found.

    Every link names its `pins`. A point that two or more links name is a pin between them. A point in `fixed` is a pin
    on the frame. `slots` are the sliding joints: a slider (block) is a link whose first pin runs along the guide and
    whose axes are those of the guide. `gears` and `racks` are the pairs in mesh: the first pin of a gear is the one
    that it turns about. `drive` names the driven joint and its motion. `sketch` gives the positions of the moving pins
    at crank angle zero (m); it selects the assembly mode. Values that are not given are taken from the sketch: lengths,
    positions of further pins on their links, the phase of the drive or the start of its law, phases of gears and
    starts of racks. With coordinates alone every joint is where it is drawn. `sides` gives links of three or more pins
    by the distances between their pins (m), e.g. `{"plate": {("E", "F"): 0.25, ("F", "G"): 0.18, ("G", "E"): 0.3}}`;
    the sketch shows on which side the third pin lies. With `branch` "continue" dyads pass change points smoothly.

    Raises `StructureError`, naming links and joints, where the parts are not connected, form an overconstrained chain,
    are unconstrained or are not driven; where the sketch is incomplete; and where a given number disagrees with it, by
    more than 1e-3 of its size if it is true to scale, or else by more than a tenth.
    """
    if branch not in ("fixed", "continue"):
        raise StructureError("branch", f"is {branch!r}", 'write "fixed" or "continue"')
    slots, gears, racks, sketch, sides = listed(slots), listed(gears), listed(racks), sketch or {}, sides or {}
    tables = {"fixed": fixed, "links": links, "sketch": sketch, "sides": sides}
    check_arguments(tables, {"slots": slots, "gears": gears, "racks": racks}, drive, flywheel)
    spots = {name: complex_of(f"sketch.{name}", at) for name, at in sketch.items()}
    frame = {name: complex_of(f"fixed.{name}", at) for name, at in fixed.items()}
    ground = {name: Vec(at.real, at.imag) for name, at in frame.items()}
    drawing = Drawing(ground, dict(links), slots, spots | frame, gears, racks)
    drawing.check(spots)
    for name, given in sides.items():
        if name not in drawing.links:
            raise StructureError(f"links.{name}.sides", f"link {name!r} is not defined", nearest(name, drawing.links))
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
    if drive.link not in parts[0] or drive.on not in (FRAME, *parts[0]):  # the first part does not need the drive
        stuck = ", ".join(parts[0])
        problem = f"moves {drive.link!r} relative to {drive.on!r}, but {stuck} cannot move relative to the frame"
        raise StructureError(
            "drive", problem, "delete these links, put their pins under `fixed`, and drive relative to the frame"
        )
    check_guides(drawing)
    drawing.measure_drawn()
    drawing.place_drive(drive)
    check_reach(drawing, drive, spots)
    for name in drawing.links:
        drawing.measure(name)
    groups = Attachment(drawing, drive).groups(parts)
    if passive or branch == "continue":
        groups = [group.continued() or group for group in groups]  # as redundant links enforce it
    if passive:
        whole.spots = drawing.spots
        for link in passive:
            whole.measure(link)
        groups += [passive_group(link, whole) for link in passive]
        drawing.links = {name: drawing.links.get(name, whole.links[name]) for name in whole.links}
    return Mechanism(drawing.fixed, drawing.links, groups, flywheel)


def _of_block(drive: Drive, slots: Sequence[Slot]) -> Drive:
    """The drive with the block of a slot as the driven link, where the two links were given in the other order."""
    other = (drive.on, drive.link)
    turned_round = any((slot.block, slot.guide.on) == other for slot in slots)
    return dataclasses.replace(drive, link=drive.on, on=drive.link) if turned_round else drive


def _check_freedom(drawing: Drawing, drive: Drive, found: Sequence[Pair], driven: Pair) -> None:
    """Raise `StructureError` unless the chain has the one degree of freedom that the drive takes."""
    links = list(drawing.links)
    degrees, redundant, movable, moved = freedom(links, found, driven)
    count = counted(len(links), found)
    if redundant:
        at = {name: {pair.name for pair in redundant if name in pair.ends} for name in links}
        held = ", ".join(name for name in links if len(at[name]) > 1)
        names = ", ".join(dict.fromkeys(pair.name for pair in redundant))
        problem = f"{held} form an overconstrained chain: one of the joints {names} is redundant ({count})"
        raise StructureError("links", problem, "delete one of these joints, or add a link between them")
    if degrees == 0:
        drawn = drawing.measured(drive)
        near = misfit(drawn, found, driven) if drawn is not None else None
        if near is not None:
            name, length, *ends = near
            apart = " to ".join(dict.fromkeys(f"{end:.6g}" for end in ends))
            problem = (
                f"nothing can move ({count}): {name!r} is {length:.6g} m long, but the motion of the other links "
                f"puts its ends {apart}"
            )
            remedy = "give it dimensions that fit in every position, or delete it"
            raise StructureError(f"links.{name}", f"{problem} m apart", remedy)
        _check_fast(drawing, drive, found, driven, count)
    alone = _alone(drawing, [name for name in links if name in (*movable, drive.link)])
    if not moved:
        problem = f"it moves nothing: {' and '.join(driven.ends)} cannot move relative to each other ({count}){alone}"
        free = ", ".join(freedom(links, found).loose)
        raise StructureError("drive", problem, f"name two of these links: {free}")
    others = [name for name in links if name != drive.link]
    if others and not any(drive.link in pair.ends for pair in found if pair != driven):
        problem = f"it moves {drive.link!r} alone, which is joined only to {drive.on!r} ({count}){alone}"
        pins = ", ".join(
            point for point in drawing.links[drive.link].pins if point not in (*drawing.fixed, driven.name)
        )
        at = f" ({pins})" if pins else ""
        raise StructureError("drive", problem, f"join another link to one of its pins{at}, or drive another link")
    if degrees > 1:
        pins = dict.fromkeys(pair.name for pair in found if set(pair.ends) & set(movable))
        what = f"with the drive held, {', '.join(movable)} can still move at {_few(pins)}"
        remedy = (
            "add a binary link (-1 degree of freedom) or a pin or slider joint (-2), or delete the links that can move"
        )
        cranks = [name for pair in found if FRAME in pair.ends for name in pair.ends if name in movable]
        if degrees == 2 and cranks:  # such as a five-bar of two cranks
            two = f"couple {drive.link!r} and {cranks[0]!r} by gears ([[gears]])"
            remedy = f"linkjax drives one joint only and has no second drive: {two}, or {remedy}"
        problem = f"{what}: {degrees} degrees of freedom ({count}){alone}"
        raise StructureError("links", problem, remedy)


def _check_fast(drawing: Drawing, drive: Drive, found: Sequence[Pair], driven: Pair, count: str) -> None:
    """Raise `StructureError` for a chain in which nothing can move: the rigid part with the drive, links to delete."""
    held = next(part for part in blocks(list(drawing.links), found) if drive.link in part)
    at = dict.fromkeys(pair.name for pair in found if set(pair.ends) & set(held))
    problem = f"nothing can move ({count}): the joints {_few(at)} make {', '.join(held)} a rigid chain"
    spare = dispensable(drawing, found, driven)
    of = " one of:" if len(spare) > 1 else ""
    remedy = f"delete{of} {', '.join(spare) or 'a link that joins two others'}"
    raise StructureError("links", problem, f"{remedy}, or give it dimensions that fit in every position")


def _alone(drawing: Drawing, links: Sequence[str]) -> str:
    """Pins that only one link names, as part of a message: a link may be missing there."""
    ends = drawing.pins()
    single = [f"{point!r} of {name!r}" for name in links for point in drawing.links[name].pins if ends[point] == [name]]
    return f"; pins of one link only: {_few(single)}" if single else ""


def _few(names: Iterable[str]) -> str:
    """The first of these names, as a list in a message."""
    first = list(names)
    return ", ".join(first[:MOST_TOLD]) + ", …" * (len(first) > MOST_TOLD)
