"""Links and joints drawn in a scene file, instead of groups: slots and the drive."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

import jax.numpy as jnp
from pydantic import Field

from linkjax import groups
from linkjax._vec import Vec
from linkjax.groups import FRAME
from linkjax.kinematics import pose, prepared
from linkjax.mechanism import Mechanism
from linkjax.scenes._fields import Angle, Name, Table
from linkjax.scenes._guides import AngleLaw, Fault, Guide, LengthLaw, in_angle, in_length, law_keys
from linkjax.scenes._wheels import mesh_keys


class Slot(Table):
    """A sliding joint: a slider (block) on a straight guide."""

    block: Name = Field(description="the slider: its first pin moves along the guide", examples=["ram"])
    guide: Guide = Field(description="the guide of the slider", examples=[{"through": "A"}])

    def build(self) -> groups.Slot:
        return groups.Slot(self.block, self.guide.build())


class Drive(Table):
    """The drive of a machine drawn by links and joints."""

    link: Name = Field(description="the driving link", examples=["crank"])
    on: Name = Field(FRAME, description="the link relative to which it is driven, or the frame", examples=["lever"])
    phase: Angle | None = Field(
        None, description="angle between the two at crank angle zero; as sketched if omitted", examples=["90 deg"]
    )
    law: AngleLaw | None = Field(
        None,
        description="motion law of an oscillating link, from its phase",
        examples=[{"start": "20 deg", "stop": "140 deg"}],
    )
    stroke: LengthLaw | None = Field(
        None,
        description="motion law of a slider: its distance along the guide",
        examples=[{"start": "0 mm", "stop": "120 mm"}],
    )

    def build(self, rotation: groups.Rotation) -> groups.Drive:
        """The drive itself; `rotation` is its sense."""
        law = self.law or self.stroke
        return groups.Drive(
            self.link, self.on, "ccw" if law else rotation, self.phase, None if law is None else law.build()
        )

    def faults(self, slots: list[Slot], clockwise: bool) -> Iterator[Fault]:
        """The errors, given the slots of the machine; none where a slot itself is wrong."""
        if any(slot.block == slot.guide.on for slot in slots):
            return
        slides = any({slot.block, slot.guide.on} == {self.link, self.on} for slot in slots)
        if slides and self.stroke is None:
            problem, remedy = (
                "missing: a slider needs a limited stroke along its guide",
                'add stroke = { start = "0 mm", ',
            )
            yield ("drive", "stroke"), problem, remedy + 'stop = "120 mm" }'
        for key in ("law", "phase") if slides else ("stroke",):
            if key in self.model_fields_set:
                what = "slides along a guide" if slides else f"does not slide on {self.on!r}"
                others = [slot.guide.on for slot in slots if slot.block == self.link and not slides]
                same = f"write on = {json.dumps(others[0])} as its slot does, or " if others else ""
                yield ("drive", key), f"has no effect: {self.link!r} {what}", f"{same}delete {key}"
        law = self.law or self.stroke
        if law is not None:
            yield from law.faults(("drive", "law" if self.law else "stroke"), drawn=True)
            if clockwise:
                yield ("rotation",), "the drive follows a law, which gives its sense of motion", "delete rotation"


def is_drawn(mechanism: Mechanism) -> bool:
    """Whether a mechanism was drawn by links and joints, or has groups that can only be drawn."""
    return any(group.numerical() for group in mechanism.groups) or any(link.pins for link in mechanism.links.values())


def sketched_keys(table: Mapping[str, Any]) -> set[tuple[str, ...]]:
    """The values that follow from the sketch, in the raw document of a valid scene: `("drive",)`, `(link, "length")`,
    and `(link, pin)` for additional pins."""
    if "drive" not in table:
        return set()
    drive, found = table["drive"], set()
    law, moved = drive.get("law") or drive.get("stroke"), table["links"][drive["link"]]
    spots = {*table["fixed"], *table.get("sketch", {})} & {*moved["pins"], *moved.get("points", {})}
    if ("stop" in law and "start" not in law) if law else ("phase" not in drive and len(spots) > 1):
        found.add(("drive",))
    for name, link in table["links"].items():
        given = {*link.get("points", {}), *(link["pins"][1:2] if link.get("length", 0) else ())}
        blank = [] if "sides" in link else [pin for pin in link["pins"][1:] if pin not in given]
        block = any(slot["block"] == name for slot in table.get("slots", ()))
        found |= {(name, "length" if pin == link["pins"][1] and not block else pin) for pin in blank}
    return found


def pins_of(mechanism: Mechanism) -> dict[str, list[str]]:
    """The pins of every link: its own, or those of its group and those to which other groups are attached."""
    found: dict[str, list[str]] = {}
    used = {point for group in mechanism.groups for point in (*group.needs(), *group.shared())}
    for group in mechanism.groups:
        for name, ends in group.pins().items():
            link = mechanism.links[name]
            own = [*(p for p in ends if p is not None), *(p for p in link.points if p in used)]
            found[name] = list(link.pins or dict.fromkeys(own))
    return found


def drawn_keys(mechanism: Mechanism, as_sketched: bool = True) -> dict[str, Any]:
    """The tables `drive`, `slots` and `sketch` of a mechanism, in its present position, or `as_sketched` for groups of
    higher class."""
    first = mechanism.driver
    slots = [slot for group in mechanism.groups for slot in group.sliding()]
    table: dict[str, Any] = {"drive": {"link": mechanism.driving_link}}
    drive, slides = first.as_drive(), first.drive_slides()
    assert drive is not None  # a mechanism has a driver
    if first.numerical():
        table["drive"]["on"] = drive.on
    if not slides:
        table["drive"]["phase"] = in_angle(_phase(mechanism, drive))
    if drive.law is not None:
        table["drive"]["stroke" if slides else "law"] = law_keys(drive.law, in_length if slides else in_angle)
    passive = any(group.passive() for group in mechanism.groups)  # with redundant links, dyads always continue
    if not passive and any(group.continues() for group in mechanism.groups):
        table["branch"] = "continue"
    if slots:
        table["slots"] = [{"block": slot.block, "guide": Guide.keys_of(slot.guide)} for slot in slots]
    wheels = [wheel for group in mechanism.groups for wheel in group.wheels()]
    for key in ("gears", "racks"):
        rows = [PAIRS[w.kind][1](w, slots, mechanism) for w in wheels if PAIRS[w.kind][0] == key]
        if rows:
            table[key] = rows
    sketch = _sketch(mechanism, as_sketched)
    table["sketch"] = {name: [in_length(at.x), in_length(at.y)] for name, at in sketch.items()}
    return table


def _gear(gear: Any, slots: list[groups.Slot], mechanism: Mechanism) -> dict[str, Any]:
    """The keys of two gears."""
    return {"link": gear.link, "to": gear.to, **mesh_keys(gear.mesh), "phase": in_angle(gear.phase)}


def _rack(rack: Any, slots: list[groups.Slot], mechanism: Mechanism) -> dict[str, Any]:
    """The keys of a rack that is moved by its gear."""
    return _rack_keys(rack.link, rack.to, rack.start, rack)


def _pinion(pinion: Any, slots: list[groups.Slot], mechanism: Mechanism) -> dict[str, Any]:
    """The keys of a rack that moves its gear."""
    rack, start = pinion.to, pinion.start
    through = next(slot.guide.through for slot in slots if slot.block == rack)
    first = pins_of(mechanism)[rack][0]
    if (pinion.through, pinion.at) != (through, first) or float(pinion.phase) != 0:
        here = pose(mechanism, jnp.zeros(()))
        base = here.points[pinion.through or pinion.pivot].r - here.points[through].r
        shift = base - (here.points[pinion.at].r - here.points[first].r)
        start = start + shift.dot(here.links[rack].u) - pinion.side * pinion.phase * pinion.radius
    return _rack_keys(rack, pinion.link, start, pinion)


def _rack_keys(rack: str, wheel: str, start: Any, group: Any) -> dict[str, Any]:
    return {"link": rack, "to": wheel, "radius": in_length(group.radius), "side": "left" if group.side > 0 else "right",
            "start": in_length(start), "pressure_angle": in_angle(group.pressure_angle)}  # fmt: skip


PAIRS = {"gear": ("gears", _gear), "rack": ("racks", _rack), "pinion": ("racks", _pinion)}  # table and keys of a kind


def _phase(mechanism: Mechanism, drive: groups.Drive) -> float:
    """Angle of the driving link's own axis at crank angle zero, without its law."""
    pins, phase = mechanism.driver.holds()[drive.link], 0.0 if drive.phase is None else float(drive.phase)
    held = mechanism.links[drive.link].held(*pins)
    return phase - (0.0 if held is None else math.atan2(held.axis.y, held.axis.x))


def _sketch(mechanism: Mechanism, as_sketched: bool) -> Mapping[str, Vec]:
    """The positions of the moving pins at crank angle zero."""
    sketches = [group.spots() for group in mechanism.groups] if as_sketched else []
    given = {p: at for sketch in sketches for p, at in sketch.items()}
    here = pose(prepared(mechanism), jnp.zeros(())).points
    chains: list[Any] = [group for group in mechanism.groups if group.numerical()] if as_sketched else []
    blank = {
        p for group in chains for _, pins in group.members for p in pins if p not in given
    }  # these stay unsketched
    every = dict.fromkeys(pin for pins in pins_of(mechanism).values() for pin in pins)
    names = [pin for pin in every if pin not in mechanism.fixed and pin not in blank]
    return {name: given.get(name, here[name].r) for name in names} | {n: a for n, a in given.items() if n not in names}
