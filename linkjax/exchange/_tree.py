"""A mechanism as bodies on a spanning tree of joints, with the joints that close its loops.

Plane vectors are complex numbers here, and places are in the axes of a link. Every length comes from the design; the
pose at one crank angle only defines the zero of the joint coordinates.

Joints are used, not groups: the solution elsewhere is independent of `solve`, and a user-defined group is exported like
any other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from linkjax._compile import compiled_soon
from linkjax._results import MachineError, Result
from linkjax._types import as_float
from linkjax._vec import Vec
from linkjax.groups import AbstractGroup, Guide, Joint
from linkjax.kinematics import Pose, Prepared, margins, plain, pose
from linkjax.mechanism import Mechanism, StructureError

Places = Mapping[str, Mapping[str, complex]]


def number(value) -> float:
    """A number of a design. Raises `StructureError` if it is traced or batched."""
    try:
        return float(value)
    except Exception as error:
        raise StructureError("machine", "its numbers are traced or batched", "export one machine at a time") from error


def plane(at: Vec) -> complex:
    """A vector as a complex number."""
    return complex(number(at.x), number(at.y))


class Way(NamedTuple):
    """The straight path of a block's origin on the link `on`: through `base`, in the direction `along`."""

    on: str
    base: complex
    along: complex


class Placed(NamedTuple):
    """A body attached to `parent`: its origin `at` and direction `turned` there when its joint coordinate is zero. The
    joint is a hinge at `pin` of the body, or a slide along `axis` of the body."""

    body: str
    parent: str
    at: complex
    turned: complex
    pin: complex = 0j
    axis: complex | None = None


class Tree(NamedTuple):
    """Bodies, parents first; loop-closing pins, as (point, link, link), and slides; the paths of blocks; the places of
    points by link."""

    bodies: list[Placed]
    pins: list[tuple[str, str, str]]
    slides: list[Joint]
    ways: dict[str, Way]
    places: dict[str, dict[str, complex]]


def places_of(mechanism: Mechanism) -> dict[str, dict[str, complex]]:
    """Points of every link in the axes of the link, and the points of the frame under "frame"."""
    found = {"frame": {name: plane(at) for name, at in mechanism.fixed.items()}}
    for group in mechanism.groups:
        for name, (origin, far) in group.pins().items():
            link = mechanism.links[name]
            body = link.actual()
            held = {**body.points, link.centre_name: body.centre}
            held |= {piece: weight.at for piece, weight in link.counterweights.items()}
            ends = {origin: 0j} if far is None else {origin: 0j, far: complex(number(link.length))}
            found[name] = {point: plane(at) for point, at in held.items()} | ({} if link.pins else ends)
    return found


class Stand(NamedTuple):
    """Origins and directions of links at one crank angle, including "frame"."""

    at: dict[str, complex]
    u: dict[str, complex]


def stand(mechanism: Mechanism, here: Pose) -> Stand:
    """Origins and directions of the links of a mechanism in a pose."""
    places, u = places_of(mechanism), {"frame": 1 + 0j, **{link: plane(state.u) for link, state in here.links.items()}}
    at = {link: plane(here.points[pin].r) - places[link][pin] * u[link] for link, pin in mechanism.origins().items()}
    return Stand({"frame": 0j, **at}, u)


def ways_of(group: AbstractGroup, places: Places, owners: Mapping[str, str], here: Stand) -> dict[str, Way]:
    """The path of every block of a group."""

    def way(guide: Guide) -> Way:
        along = complex(np.exp(1j * float(guide.along)))
        return Way(guide.on, places[guide.on][guide.through] + 1j * float(guide.offset) * along, along)

    told = {slot.block: way(slot.guide) for slot in group.sliding()}
    slides = [(joint.link, joint.by or owners[joint.point]) for joint in group.joints() if joint.slides]
    return told | {block: _as_it_stands(block, on, here) for block, on in slides if block not in told}


def _as_it_stands(block: str, on: str, here: Stand) -> Way:
    """The path of a block whose guide the group does not give: a block has the axes of its guide."""
    return Way(on, (here.at[block] - here.at[on]) / here.u[on], here.u[block] / here.u[on])


@compiled_soon
def _at(mechanism: Mechanism | Prepared, phi):
    return pose(mechanism, phi), margins(mechanism, phi)


def assembled(mechanism: Mechanism | Prepared, phi: float) -> Pose:
    """The pose at a crank angle (rad). Raises `MachineError` where the mechanism cannot be assembled."""
    places_of(plain(mechanism))  # raises for traced or batched numbers
    here, sides = _at(mechanism, as_float(phi))
    for group, by_side in sides.items():
        for side, margin in by_side.items():
            if not float(margin.value) >= 0:
                where = f"{math.degrees(float(phi)):.6g} degrees"
                message = f"{group!r} cannot be assembled at {where}: its margin {side!r} is negative"
                remedy = "choose another crank angle, or change the lengths"
                raise MachineError(f"{message}; {remedy}", Result.CANNOT_BE_ASSEMBLED)
    return here


def tree_of(mechanism: Mechanism, here: Stand) -> Tree:
    """The spanning tree, group by group: blocks on the guides of placed links, then links on their pins; the remaining
    joints close the loops."""
    owners, places = mechanism.owners(), places_of(mechanism)
    tree = Tree([], [], [], {}, places)
    placed = {"frame"}
    for group in mechanism.groups:
        tree.ways.update(ways_of(group, places, owners, here))
        joints = [(j, j.by or owners[j.point]) for j in group.joints() if j.slides or j.pins]
        while not placed.issuperset(group.link_names()):
            reaching = [(j, by) for j, by in joints if (j.link in placed) != (by in placed)]
            joint, by = min(reaching, key=lambda pair: _order(*pair, placed, tree.ways))
            tree.bodies.append(_hung(joint, by, placed, tree, here))
            placed.add(tree.bodies[-1].body)
            joints.remove((joint, by))
        tree.slides.extend(joint for joint, _ in joints if joint.slides)
        tree.pins.extend((joint.point, joint.link, by) for joint, by in joints if not joint.slides)
    return tree


def _order(joint: Joint, by: str, placed: set[str], ways: Mapping[str, Way]) -> int:
    """The priority of a joint that reaches a new body, lowest first."""
    if joint.slides:
        return 0 if by in placed else 3
    return 1 if (by if joint.link in placed else joint.link) not in ways else 2


def _hung(joint: Joint, by: str, placed: set[str], tree: Tree, here: Stand) -> Placed:
    """A body on the joint that attaches it to another."""
    body, parent = (joint.link, by) if by in placed else (by, joint.link)
    if not joint.slides:
        turned, pin = here.u[body] / here.u[parent], tree.places[body][joint.point]
        return Placed(body, parent, tree.places[parent][joint.point] - pin * turned, turned, pin)
    way = tree.ways[joint.link]
    on = way.base + ahead(joint.link, way, here) * way.along
    if body == joint.link:
        return Placed(body, parent, on, way.along, axis=1 + 0j)
    back = way.along.conjugate()  # the link with the guide, in the axes of its block
    return Placed(body, parent, -on * back, back, axis=-way.along)


def ahead(block: str, way: Way, here: Stand) -> float:
    """The displacement of a block along its path (m)."""
    u = here.u[way.on]
    return ((here.at[block] - here.at[way.on] - way.base * u) / (way.along * u)).real
