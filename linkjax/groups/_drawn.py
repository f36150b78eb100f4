"""Elements of links and joints as drawn: slots, gear and rack pairs, and the drive."""

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
from linkjax.groups._guide import Guide, Slot
from linkjax.groups._law import SENSES, AbstractLaw, Rotation, check_law, check_rotation
from linkjax.groups._mesh import PRESSURE, Mesh
from linkjax.groups._pairs import FRAME
from linkjax.groups._state import LinkState


class GearPair(eqx.Module):
    """Two links in mesh: the first radius or number of teeth of the `mesh` belongs to `link`, the second to `to`. Both
    are pinned to the frame or to the same link, on which they turn. Relative to it, `link` is at `phase` (rad) when
    `to` is at zero; None: as sketched."""

    link: str = eqx.field(static=True)
    to: str = eqx.field(static=True)
    mesh: Mesh
    phase: Array | None = eqx.field(converter=as_float, default=None)


class RackPair(eqx.Module):
    """The block `link` of a slot as a rack, and the gear `to` of pitch `radius` (m). The gear is pinned to the body of
    the slot, to the left of the slot's direction for `side` +1, to the right for -1. The block is `start` (m) along its
    guide when the gear, relative to that body, is at zero. Side and start None: as sketched. `pressure_angle` (rad) is
    that of the teeth."""

    link: str = eqx.field(static=True)
    to: str = eqx.field(static=True)
    radius: jnp.ndarray = eqx.field(converter=as_float)
    side: int | None = eqx.field(static=True, default=None)
    start: Array | None = eqx.field(converter=as_float, default=None)
    pressure_angle: jnp.ndarray = eqx.field(converter=as_float, default=PRESSURE)


class Drive(eqx.Module):
    """The drive moves `link` relative to `on` ("frame" or another link).

    For two links pinned to each other, the drive is rotary: the angle of `link` relative to `on` is `phase + φ` (rad),
    `phase - φ` with the `rotation` "cw" (clockwise), or `phase + law(φ)`. For the block of a slot, the drive is linear:
    the block is `law(φ)` (m) along its guide; a motion law is required. Without a `phase` or a law, the sketch of a
    `linkage` gives the position of the link at crank angle zero. This also holds for a `Harmonic` law without a start.
    Without a sketch the phase is zero. Raises `ValueError` for another rotation, and for "cw" together with a law.
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
        """Coordinate of the drive at a crank angle, with its first and second derivatives."""
        phase = jnp.zeros_like(phi) if self.phase is None else self.phase
        if self.law is not None:
            s, d, dd = self.law.at(phi)
            return (s if slides else s + phase), d, dd
        return phase + self.sense * phi, jnp.full_like(phi, self.sense), jnp.zeros_like(phi)

    def begins(self, slides: bool) -> float:
        """Coordinate of the drive at crank angle zero (rad or m)."""
        return float(self.at(jnp.zeros(()), slides)[0])

    def angle(self, states: Mapping[str, LinkState]) -> Array:
        """Angle of a rotary drive (rad), from the states of its links."""
        u = states[self.link].u
        on = Vec(1.0, 0.0) if self.on == FRAME else states[self.on].u
        return jnp.atan2(on.cross(u), on.dot(u))


def driven_slot(drive: Drive, slots: Sequence[Slot]) -> int | None:
    """Number of the slot that a drive moves; None for a rotary drive."""
    ends = (drive.link, drive.on)
    return next((i for i, slot in enumerate(slots) if (slot.block, slot.guide.on) == ends), None)


def check_drive(drive: Drive, names: Sequence[str], slots: Sequence[Slot]) -> None:
    """Raise `ValueError` for a drive that is impossible in a group of these links."""
    if drive.link not in names or drive.on not in (*names, FRAME):
        problem = f"the drive moves {drive.link!r} relative to {drive.on!r}; name links of the group, or the frame"
        raise ValueError(f"the group of {', '.join(names)}: {problem}")
    check_law(drive.law)
    if driven_slot(drive, slots) is not None and drive.law is None:
        raise ValueError(f"the drive moves {drive.link!r} along a guide, which requires a motion law; set `law`")


def mesh_names(gears: Sequence[Any]) -> list[str]:
    """Names of the joints of gears in mesh: after their `link`, or after both where `link` is in several meshes."""
    wheels = [gear.link for gear in gears]
    return [f"{g.link}.mesh" if wheels.count(g.link) == 1 else f"{g.link}.{g.to}.mesh" for g in gears]


def check_gears(gears: Sequence[Any], members: Mapping[str, Sequence[str]], slots: Sequence[Slot]) -> None:
    """Raise `ValueError` for gears and racks that are impossible in a group of these links."""
    group = f"the group of {', '.join(members)}"
    for gear in gears:
        if gear.link not in members:
            raise ValueError(f"{group}: the gear {gear.link!r} is not a member; the `link` of a gear must be a member")
        turns = [*gear.lies_on(), *([] if gear.kind == "rack" else [(gear.link, gear.pivot)])]
        for link, point in turns:
            if point not in members.get(link, (point,)):
                problem = f"a gear turns about {point!r}, which is not a pin of {link!r}"
                raise ValueError(f"{group}: {problem}; its pins are {', '.join(members[link])}")
        if gear.kind == "rack" and not any(_same(gear, slot) for slot in slots):
            raise ValueError(f"{group}: the rack {gear.link!r} has no slot; add a slot along the same guide")
    twice = [name for name in mesh_names(gears) if mesh_names(gears).count(name) > 1]
    if twice:
        raise ValueError(f"{group}: the gear mesh {twice[0]} is given twice; omit one")


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
    """Origins and directions of links, shape (links, 4), from `spots`, the approximate positions of points.

    `seen` gives for each link its points that have a spot (one is enough for a gear whose angle does not matter);
    `lean` gives the guides of blocks, `places` the positions of points on the links, and `known` the directions of
    existing links.
    """
    turned: dict[str, Vec] = {}
    for _ in seen:  # a block after the link of its guide
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
    """Raise `TypeError` or `ValueError` for invalid slots and sketches."""
    for slot in slots:
        if not isinstance(slot, Slot):
            raise TypeError(f"a slot of the group of {', '.join(names)} is {slot!r}; write Slot(block, guide)")
        if [other.block for other in slots].count(slot.block) > 1:
            problem = f"the block {slot.block!r} is in two slots"
            raise ValueError(f"the group of {', '.join(names)}: {problem}; add a second block, pinned to the first")
    for point, at in sketch.items():
        if isinstance(at, str | int | float | tuple | list):
            raise TypeError(f"the position of {point!r} in a sketch must be a Vec, but is {at!r}; write Vec(x, y)")


def undrawn(members, links: Mapping[str, Any], sketch, outer: Sequence[str], single) -> tuple[str, str] | None:
    """What links and sketch lack, as problem and remedy; one point is enough for the `single` links."""
    every = [p for link, pins in members for p in (*pins, *links[link].points, links[link].centre_name)]
    strange = next((p for p in sketch if p not in every), None)
    if strange is not None:
        return f"the sketch has a point {strange!r}, which no link of the group has", nearest(strange, every)
    for link, pins in members:
        for point in pins[2:]:
            if point not in links[link].points:
                return f"link {link!r} has no coupler point {point!r}", "add it to the points of the link"
        own = (*pins[:2], *links[link].points, links[link].centre_name)
        seen = [p for p in dict.fromkeys(own) if p in outer or p in sketch]
        if len(seen) < 2 - (link in single):
            count = "one" if link in single else "two"
            problem = f"the sketch does not locate link {link!r}"
            return problem, f"sketch {count} of its points: {', '.join(own)}"
        spots = [sketch[p] for p in seen[:2] if p in sketch]
        if len(spots) == 2 and link not in single and _on_one_place(*spots):
            return f"{seen[0]!r} and {seen[1]!r} of link {link!r} coincide in the sketch", "move one of them"
    return None


def _on_one_place(one: Vec, two: Vec) -> bool:
    """Whether two points are known to coincide, in any design of a batch."""
    pairs = [(known(a), known(b)) for a, b in ((one.x, two.x), (one.y, two.y))]
    equal = [a == b for a, b in pairs if a is not None and b is not None]
    return len(equal) == 2 and bool((equal[0] & equal[1]).any())
