"""Links and joints of a group of higher class: its members, and the points and links to which it is attached."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._vec import Vec
from linkjax.groups._base import AbstractGroup, Wrench
from linkjax.groups._drawn import check_drawn, check_gears, mesh_names, undrawn
from linkjax.groups._drive import Drive, check_drive, driven_slot
from linkjax.groups._gear import Gear
from linkjax.groups._guide import Slot
from linkjax.groups._pairs import FRAME, Joint
from linkjax.groups._rack import Rack


class AbstractChain(AbstractGroup):
    """Links joined by pins, slots and gears in mesh; see `General`."""

    members: tuple[tuple[str, tuple[str, ...]], ...] = eqx.field(static=True)
    outer: tuple[str, ...] = eqx.field(static=True)
    sketch: dict[str, Vec]
    slots: tuple[Slot, ...] = ()
    drive: Drive | None = None
    gears: tuple[Gear | Rack, ...] = ()

    def __check_init__(self):
        names = [link for link, _ in self.members]
        check_drawn(names, self.slots, self.sketch)
        if self.drive is not None:
            check_drive(self.drive, names, self.slots)
        check_gears(self.gears, dict(self.members), self.slots)
        rows = sum(2 * (len(links) - (point not in self.outer)) for point, links in self._pins().items())
        rows += 2 * len(self.slots) + len(self.gears) + (self.drive is not None)
        if rows != 3 * len(names):
            problem = f"{len(names)} links have {3 * len(names)} degrees of freedom, but their joints remove {rows}"
            raise ValueError(f"the group of {', '.join(names)}: {problem}; a point may be missing in `outer`")

    def driven_slot(self) -> int | None:
        """Number of the slot that the drive moves; None for a rotary drive and without a drive."""
        return None if self.drive is None else driven_slot(self.drive, self.slots)

    def _pins(self) -> dict[str, list[str]]:
        """Every pinned point with the members that share it."""
        found: dict[str, list[str]] = {}
        for link, points in self.members:
            for point in points:
                found.setdefault(point, []).append(link)
        return {p: links for p, links in found.items() if len(links) > 1 or p in self.outer}

    def link_names(self):
        return tuple(link for link, _ in self.members)

    def needs(self):
        return tuple(dict.fromkeys((*self.outer, *super().needs())))  # the first is a reference point

    def pins(self):
        return {link: (points[0], points[1] if len(points) > 1 else None) for link, points in self.members}

    def holds(self):
        return {link: (points[0], None) for link, points in self.members}

    def shared(self):
        return {p: "" if p in self.outer else links[0] for p, links in self._pins().items()}

    def wheels(self):
        return self.gears

    def _geared_pairs(self) -> list[Gear]:
        return [gear for gear in self.gears if isinstance(gear, Gear)]

    def mates(self) -> tuple[str, ...]:
        """The existing links whose angles its gears follow."""
        names = [name for gear in self.gears for name in gear.mates()]
        return tuple(dict.fromkeys(name for name in names if name not in (FRAME, *self.link_names())))

    def spinning(self) -> set[str]:
        """The free gears: members that are gears, carry none, are pinned once and are not driven. Only the gears in
        mesh with them determine their angles."""
        every = {name for gear in self.gears for name in (gear.link, gear.to) if name in self.link_names()}
        held = [link for links in self._pins().values() for link in links]
        tied = (name for name in every if held.count(name) > 1 or name == self.driving())
        return every.difference(tied, (slot.block for slot in self.slots), (gear.mates()[1] for gear in self.gears))

    def in_whole_turns(self, gear: Gear | Rack) -> bool:
        """Whether a gear is at the angle of the sketch except for whole turns, which do not affect the other links
        joined to it."""
        others = {*self.spinning(), *(g.mates()[1] for g in self.gears), *(slot.block for slot in self.slots)}
        return isinstance(gear, Gear) and gear.link not in others and gear.to not in self.spinning()

    def lies_on(self):
        ends = [end for gear in self.gears for end in gear.lies_on()]
        return tuple((link, point) for link, point in ends if link not in self.link_names())

    def driving(self):
        return None if self.drive is None else self.drive.link

    def as_drive(self):
        return self.drive

    def drive_slides(self):
        return self.driven_slot() is not None

    def numerical(self):
        return True

    def spots(self):
        return self.sketch

    def sliding(self):
        return self.slots

    def lost(self, at):
        if at.side == "apart":
            return at.apart()
        if (told := super().lost(at)) is None and at.trouble == "change point":
            what = "it has a change point or a singular position there"
            return f"passes to another assembly mode near {at.place}: {what}", ""
        return told

    def follows(self):
        return None if self.drive is None else self.drive.law

    def places(self, links) -> dict[str, dict[str, Vec]]:
        """Positions of the points of every member in its own axes."""
        found = {}
        for link, points in self.members:
            zero = jnp.zeros_like(links[link].length)
            body = links[link].actual()
            found[link] = {**body.points, links[link].centre_name: body.centre, points[0]: Vec(zero, zero)}
            if len(points) > 1:
                found[link].setdefault(points[1], Vec(links[link].length, zero))
        return found

    def _pairs(self) -> list[tuple[str, str, str]]:
        """Every pin as (point, link, what it is pinned to): another link, or "" for a point that existed before."""
        return [(p, link, "" if p in self.outer else links[0]) for p, links in self._pins().items()
                for link in links[p not in self.outer :]]  # fmt: skip

    def _outer_points(self) -> list[str]:
        return list(dict.fromkeys(p for p, _, to in self._pairs() if not to))

    def _seen(self, link: str, pins: tuple[str, ...], places) -> list[str]:
        """Points of a link whose positions are known or sketched."""
        return [p for p in dict.fromkeys((*pins, *places[link])) if p in self.outer or p in self.sketch]

    def _pace(self, slot: Slot, states, points) -> Array:
        """Rate of a slider along its slot, with respect to the crank angle."""
        block, base = points[dict(self.members)[slot.block][0]], points[slot.guide.through]
        under = base.dr
        if slot.guide.on != "frame":
            under = under + (block.r - base.r).perp() * states[slot.guide.on].w
        return (block.dr - under).dot(states[slot.block].u)

    def lacking(self, links):
        blocks = {slot.block: slot.guide for slot in self.slots}
        for block, guide in blocks.items():
            if block not in self.link_names():
                return f"the block {block!r} is not in the group", f"known here: {', '.join(self.link_names())}"
            pins = dict(self.members).get(guide.on)
            if pins is not None and guide.through not in (*pins, *links[guide.on].points):
                problem = f"the guide of {block!r} is on link {guide.on!r}, but point {guide.through!r} is not"
                return problem, f"known here: {', '.join((*pins, *links[guide.on].points))}"
        return undrawn(self.members, links, self.sketch, self.outer, {*blocks, *self.spinning()})

    def joints(self):
        found = []
        for point, links in self._pins().items():
            by = None if point in self.outer else links[0]
            found += [Joint(point, point, link, by) for link in links[point not in self.outer :]]
        origins = {link: points[0] for link, points in self.members}
        for slot in self.slots:
            found.append(Joint(f"{slot.block}.guide", origins[slot.block], slot.block, slot.guide.on, slides=True))
        for gear, name in zip(self.gears, mesh_names(self.gears), strict=True):
            about = gear.end if isinstance(gear, Rack) else gear.pivot
            found.append(Joint(name, about, gear.link, gear.to, meshes=True))
        if self.drive is not None:
            found.append(Joint(f"{self.drive.link}.drive", origins[self.drive.link], self.drive.link, self.drive.on))
        return tuple(found)

    def _teeth(self, x: Array, size: Array, pins: list[Wrench], slots: list[Wrench], states, points) -> list[Wrench]:
        """Forces of the meshes from their multipliers (couples on gears, forces along racks); the difference to the
        actual tooth forces is added to the `pins` of gears and the `slots` of racks."""
        found = []
        for gear, much in zip(self.gears, x, strict=False):
            if isinstance(gear, Gear):
                mesh = gear.mesh.exerted(points[gear.centre].r - points[gear.pivot].r, much * size)
                self._carry(pins, gear.pivot, gear.link, gear.carrier, -mesh.force)
            else:
                k = next(i for i, slot in enumerate(self.slots) if slot.block == gear.link)
                mesh = gear.exerted(much, states, points)
                along = states[gear.link].u * much
                slots[k] = Wrench(slots[k].force + along - mesh.force, slots[k].moment - mesh.moment)
            self._carry(pins, gear.centre, gear.to, gear.mates()[1], mesh.force)
            found.append(mesh)
        return found

    def _carry(self, pins: list[Wrench], point: str, wheel: str, carrier: str, force: Vec) -> None:
        """Add the tooth force on a gear to the pin between the gear and its carrier, as a force on the gear."""
        for k, (at, link, _) in enumerate(self._pairs()):
            if at == point and link in (wheel, carrier):
                more = force if link == wheel else -force
                pins[k] = Wrench(pins[k].force + more, pins[k].moment)
