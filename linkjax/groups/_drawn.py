"""Elements of links and joints as drawn: gear and rack pairs, and the checks of a drawn group."""

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
from linkjax.groups._mesh import PRESSURE, Mesh


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
