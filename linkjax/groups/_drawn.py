"""What links and joints are drawn with: slots, and where the drive is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_sqrt
from linkjax._types import as_float, known
from linkjax._units import nearest
from linkjax._vec import Vec, unit
from linkjax.groups._guide import Guide, as_guide
from linkjax.groups._law import SENSES, AbstractLaw, Rotation, check_law, check_rotation
from linkjax.groups._mesh import PRESSURE, Mesh
from linkjax.groups._pairs import FRAME
from linkjax.groups._state import LinkState


class Slot(eqx.Module):
    """A sliding joint: the `block` moves along the `guide`, on the frame or on a link."""

    block: str = eqx.field(static=True)
    guide: Guide = eqx.field(converter=as_guide)


class GearPair(eqx.Module):
    """Two links in gear by a `mesh`: `link` is the wheel of which its first radius or number of teeth is, `to` the
    other. Both are pinned to the frame or to the same link, on which they turn. Seen from there `link` is at
    `phase` (rad) while `to` is at zero; None: as both are drawn."""

    link: str = eqx.field(static=True)
    to: str = eqx.field(static=True)
    mesh: Mesh
    phase: Array | None = eqx.field(converter=as_float, default=None)


class RackPair(eqx.Module):
    """The block `link` of a slot as a rack, and the wheel `to` of pitch `radius` (m), which is pinned to what the slot
    is on, to the left of its direction for `side` +1, to the right for -1. The block is `start` (m) along its guide
    while the wheel, seen from there, is at zero. Side and start are None: as both are drawn. `pressure_angle` (rad) is
    that of the teeth."""

    link: str = eqx.field(static=True)
    to: str = eqx.field(static=True)
    radius: jnp.ndarray = eqx.field(converter=as_float)
    side: int | None = eqx.field(static=True, default=None)
    start: Array | None = eqx.field(converter=as_float, default=None)
    pressure_angle: jnp.ndarray = eqx.field(converter=as_float, default=PRESSURE)


class Drive(eqx.Module):
    """Where the drive is: it moves `link` against what it is `on` ("frame" or another link).

    Two links pinned to each other turn: the angle of `link` relative to `on` is `phase + φ` (rad), `phase - φ` with the
    `rotation` "cw" (clockwise), or `phase + law(φ)`. The block of a slot slides: it is `law(φ)` (m) along its guide, and needs a law. Without a
    `phase` or a law the link is where the sketch of a `linkage` has it at crank angle zero, and so it is with a
    `Harmonic` law without a start; where nothing is sketched the phase is zero. Raises `ValueError` for
    another rotation, and for "cw" beside a law.
    """

    link: str = eqx.field(static=True)
    on: str = eqx.field(static=True, default="frame")
    rotation: Rotation = eqx.field(static=True, default="ccw")
    phase: Array | None = eqx.field(converter=as_float, default=None)
    law: AbstractLaw | None = None

    def __check_init__(self):
        check_law(self.law, drawn=True)
        check_rotation("drive", self.rotation, self.law)

    @property
    def sense(self) -> int:
        """+1 for a counter-clockwise and -1 for a clockwise drive."""
        return SENSES[self.rotation]

    def at(self, phi: Array, slides: bool) -> tuple[Array, Array, Array]:
        """Where it is at a crank angle, with its first and second derivative."""
        phase = jnp.zeros_like(phi) if self.phase is None else self.phase
        if self.law is not None:
            s, d, dd = self.law.at(phi)
            return (s if slides else s + phase), d, dd
        return phase + self.sense * phi, jnp.full_like(phi, self.sense), jnp.zeros_like(phi)

    def begins(self, slides: bool) -> float:
        """Where it is at crank angle zero (rad, or m)."""
        return float(self.at(jnp.zeros(()), slides)[0])

    def angle(self, states: Mapping[str, LinkState]) -> Array:
        """Where a drive that turns stands (rad), seen from the links."""
        u = states[self.link].u
        on = Vec(1.0, 0.0) if self.on == FRAME else states[self.on].u
        return jnp.atan2(on.cross(u), on.dot(u))


def driven_slot(drive: Drive, slots: Sequence[Slot]) -> int | None:
    """Number of the slot that a drive moves; None for one that turns."""
    ends = (drive.link, drive.on)
    return next((i for i, slot in enumerate(slots) if (slot.block, slot.guide.on) == ends), None)


def check_drive(drive: Drive, names: Sequence[str], slots: Sequence[Slot]) -> None:
    """Raise `ValueError` for what a drive cannot do in a group of these links."""
    if drive.link not in names or drive.on not in (*names, FRAME):
        problem = f"the drive moves {drive.link!r} against {drive.on!r}; name links of the group, or the frame"
        raise ValueError(f"the group of {', '.join(names)}: {problem}")
    check_law(drive.law)
    if driven_slot(drive, slots) is not None and drive.law is None:
        raise ValueError(f"the drive slides {drive.link!r} along a guide, which it cannot do for ever; give it a law")


def mesh_names(gears: Sequence[Any]) -> list[str]:
    """Names of the joints of wheels in gear: after their `link`, and after both where that is in several."""
    wheels = [gear.link for gear in gears]
    return [f"{g.link}.mesh" if wheels.count(g.link) == 1 else f"{g.link}.{g.to}.mesh" for g in gears]


def check_gears(gears: Sequence[Any], members: Mapping[str, Sequence[str]], slots: Sequence[Slot]) -> None:
    """Raise `ValueError` for wheels in gear that are none of a group of these links."""
    group = f"the group of {', '.join(members)}"
    for gear in gears:
        if gear.link not in members:
            raise ValueError(f"{group}: {gear.link!r} is in gear, but no member; let the `link` of a gear be a member")
        turns = [*gear.lies_on(), *([] if gear.kind == "rack" else [(gear.link, gear.pivot)])]
        for link, point in turns:
            if point not in members.get(link, (point,)):
                problem = f"a wheel turns about {point!r}, which is no pin of {link!r}"
                raise ValueError(f"{group}: {problem}; its pins are {', '.join(members[link])}")
        if gear.kind == "rack" and not any(_same(gear, slot) for slot in slots):
            raise ValueError(f"{group}: the rack {gear.link!r} is in none of its slots; add one along the same guide")
    twice = [name for name in mesh_names(gears) if mesh_names(gears).count(name) > 1]
    if twice:
        raise ValueError(f"{group}: two gears are the same, {twice[0]}; leave one out")


def _same(rack: Any, slot: Slot) -> bool:
    """Whether a rack slides in a slot."""
    mine, guide = rack.guide, slot.guide
    return (rack.link, mine.on, mine.through) == (slot.block, guide.on, guide.through)


def from_sketch(
    spots: Mapping[str, Vec],
    lean: Mapping[str, Guide],
    seen: Mapping[str, Sequence[str]],
    places: Mapping[str, Mapping[str, Vec]],
    known: Mapping[str, Vec],
) -> Array:
    """Origins and directions of links, shape (links, 4), from `spots` where points are roughly.

    `seen` names the links, each with its points that have a spot (of a wheel one is enough, if it is no matter how it
    stands); `lean` the guides that blocks are on; `places` says where points are on the links, `known` how links stand
    that were there before.
    """
    turned: dict[str, Vec] = {}
    for _ in seen:  # a block after the link that its guide is on
        for link, points in seen.items():
            if link not in lean and len(points) < 2:
                turned[link] = Vec(jnp.ones(()), jnp.zeros(()))
            elif link not in lean:
                off = places[link][points[1]] - places[link][points[0]]
                true = spots[points[1]] - spots[points[0]]
                turned[link] = Vec(off.dot(true), off.cross(true))
            elif (on := lean[link].on) in (*turned, "frame", *known):
                axis = unit(lean[link].along)
                turned[link] = axis if on == "frame" else axis.turned(turned[on] if on in turned else known[on])
    rows = []
    for link, points in seen.items():
        u = turned[link] / safe_sqrt(turned[link].squared(), 1.0)
        origin = spots[points[0]] - places[link][points[0]].turned(u)
        rows.append(jnp.stack([origin.x, origin.y, u.x, u.y]))
    return jnp.stack(rows)


def check_drawn(names: Sequence[str], slots: Sequence[Slot], sketch: Mapping[str, Vec]) -> None:
    """Raise `TypeError` or `ValueError` for slots and sketches that are none."""
    for slot in slots:
        if not isinstance(slot, Slot):
            raise TypeError(f"a slot of the group of {', '.join(names)} is {slot!r}; write Slot(block, guide)")
        if [other.block for other in slots].count(slot.block) > 1:
            problem = f"the block {slot.block!r} is in two slots"
            raise ValueError(f"the group of {', '.join(names)}: {problem}; name a second block, pinned to the first")
    for point, at in sketch.items():
        if isinstance(at, str | int | float | tuple | list):
            raise TypeError(f"the place of {point!r} in a sketch must be a Vec, but is {at!r}; write Vec(x, y)")


def undrawn(members, links: Mapping[str, Any], sketch, outer: Sequence[str], single) -> tuple[str, str] | None:
    """What links and sketch do not say, as problem and remedy; of the `single` links one point is enough."""
    every = [p for link, pins in members for p in (*pins, *links[link].points, links[link].centre_name)]
    strange = next((p for p in sketch if p not in every), None)
    if strange is not None:
        return f"the sketch has a point {strange!r}, which no link of the group has", nearest(strange, every)
    for link, pins in members:
        for point in pins[2:]:
            if point not in links[link].points:
                return f"link {link!r} has no marked point {point!r}", "add it to the points of the link"
        own = (*pins[:2], *links[link].points, links[link].centre_name)
        seen = [p for p in dict.fromkeys(own) if p in outer or p in sketch]
        if len(seen) < 2 - (link in single):
            count = "one" if link in single else "two"
            problem = f"the sketch does not say where link {link!r} is"
            return problem, f"sketch {count} of its points: {', '.join(own)}"
        spots = [sketch[p] for p in seen[:2] if p in sketch]
        if len(spots) == 2 and link not in single and _on_one_place(*spots):
            return f"the sketch puts {seen[0]!r} and {seen[1]!r} of link {link!r} on one place", "move one of them"
    return None


def _on_one_place(one: Vec, two: Vec) -> bool:
    """Whether two points are known to coincide, in any of the designs where there are many."""
    pairs = [(known(a), known(b)) for a, b in ((one.x, two.x), (one.y, two.y))]
    equal = [a == b for a, b in pairs if a is not None and b is not None]
    return len(equal) == 2 and bool((equal[0] & equal[1]).any())
