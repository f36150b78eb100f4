"""The mechanism: frame points, links and an ordered composition of structural groups."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import equinox as eqx
import numpy as np

from linkjax._types import known as number_of
from linkjax._types import not_finite
from linkjax._units import nearest
from linkjax._vec import Vec
from linkjax.groups import FRAME, AbstractGroup, Guide
from linkjax.mechanism._link import Flywheel, Link
from linkjax.mechanism._text import structure_text
from linkjax.topology import Structure, origins, owners, structure_of


class StructureError(ValueError):
    """An error in the structure of a mechanism; the message names the element, the problem and the remedy."""

    def __init__(self, element: str, problem: str, remedy: str):
        self.element, self.problem, self.remedy = element, problem, remedy
        super().__init__(f"{element}: {problem}; {remedy}")


class Mechanism(eqx.Module):
    """A planar linkage of one degree of freedom. All numbers are array leaves, all topology is static.

    `fixed` holds the points of the frame, `links` the links by name, `groups` the driver and the Assur groups in their
    order of attachment. A gradient with respect to a mechanism is a mechanism.
    Raises `StructureError` when a group refers to a link or point that does not exist yet, a name is used twice, or a
    number is not finite.
    """

    fixed: dict[str, Vec]
    links: dict[str, Link]
    groups: tuple[AbstractGroup, ...]
    flywheel: Flywheel = eqx.field(default_factory=Flywheel)
    link_names: tuple[str, ...] = eqx.field(static=True, default=())

    def __init__(self, fixed, links, groups, flywheel=None, link_names=()):
        if link_names:  # given by `dataclasses.replace`: the original order of the links
            links = {name: links[name] for name in [*(n for n in link_names if n in links), *links]}
        self.fixed = dict(sorted(fixed.items()))  # sorted, as jax sorts the keys of dicts
        self.groups = tuple(groups)
        self.flywheel = Flywheel() if flywheel is None else flywheel
        named = {name: _named(link, f"S{i}") for i, (name, link) in enumerate(links.items(), 1)}
        ends = {name: pins for group in self.groups for name, pins in group.pins().items()}
        named = {name: _with_ends(link, ends.get(name, ())) for name, link in named.items()}
        self.links, self.link_names = dict(sorted(named.items())), tuple(named)
        check_structure(self)
        for place, value in not_finite(self):
            raise StructureError(place, f"is {value}", "write a finite number")

    def __str__(self) -> str:
        return structure_text(structure(self))

    @property
    def driver(self) -> AbstractGroup:
        """The driving group."""
        return self.groups[0]

    @property
    def driving_link(self) -> str:
        """Name of the driving link."""
        return self.driver.driving() or self.driver.link_names()[0]

    @property
    def prescribed(self) -> bool:
        """Whether the driver follows a motion law, so that its motion does not depend on forces."""
        return self.driver.follows() is not None

    def owners(self) -> dict[str, str]:
        """The link that each point belongs to: "frame", or the link that introduced the point."""
        return owners(self.fixed, self.groups, self.links)

    def origins(self) -> dict[str, str]:
        """The point at the origin of each link's axes."""
        return origins(self.groups)

    def points_on(self, link: str) -> set[str]:
        """Points fixed to a link, including the pins that it shares; the points of the frame for "frame"."""
        if link == "frame":
            return set(self.fixed)
        ends = {pin for group in self.groups for pin in group.pins().get(link, ()) if pin is not None}
        own = self.links[link]
        return {*ends, own.centre_name, *own.point_names(), *own.counterweights}

    def guides_of(self, point: str) -> list[Guide]:
        """The guides of all sliders that a point belongs to; those on the frame first."""
        slots = [slot for group in self.groups for slot in group.sliding()]
        found = [slot.guide for slot in slots if point in self.points_on(slot.block)]
        return sorted(found, key=lambda guide: guide.on != FRAME)

    def formula(self) -> str:
        """Structural formula, e.g. `I1(crank) → II2(rod, slider) → II1(link4, rocker)`; see `Structure.formula`."""
        return structure(self).formula()


def links_of(mechanism: Mechanism, group: AbstractGroup) -> dict[str, Link]:
    """The links as a group sees them: as length each has the distance between the two pins that the group uses."""
    links = mechanism.links
    for name, ends in group.holds().items():
        held = links[name].held(*ends)
        if held is not None:
            links = {**links, name: dataclasses.replace(links[name], length=held.length)}
    return links


def structure(mechanism: Mechanism) -> Structure:
    """Links, pairs, mobility and groups of a mechanism. Raises `TypeError` for anything else, such as a scene. Source:
    Chebyshev's mobility W = 3n - 2p and Assur's groups, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988,
    ch. 2 and 3."""
    if not isinstance(mechanism, Mechanism):
        raise TypeError(f"a Mechanism is needed, not {type(mechanism).__name__}; of a scene write scene.mechanism")
    return structure_of(mechanism.link_names, mechanism.groups, mechanism.owners())


def _named(link: Link, name: str) -> Link:
    return link if link.centre_name else dataclasses.replace(link, centre_name=name)


def _with_ends(link: Link, pins: Iterable[str | None]) -> Link:
    """A uniform link with the names of its pins, which are the ends of the bar and may be corners of the plate."""
    if link.uniform is False or link.pins:
        return link
    return dataclasses.replace(link, ends=tuple(pin for pin in pins if pin is not None))


def check_structure(mechanism: Mechanism) -> None:
    """Raise `StructureError` for the first error in the structure."""
    if not mechanism.groups or mechanism.groups[0].driving() is None:
        raise StructureError(
            "groups", "the first group must be the driver", 'begin with kind = "crank" or "linear_driver"'
        )
    flywheel = number_of(mechanism.flywheel.inertia)
    if mechanism.driver.shaft() is None and flywheel is not None and np.any(flywheel != 0):
        raise StructureError("flywheel", "needs a crank as the driver: it is on the crankshaft", "delete it")
    known, placed = set(mechanism.fixed), set()
    everywhere = _all_points(mechanism)
    for number, group in enumerate(mechanism.groups):
        element = f"groups[{number}] ({group.kind})"
        if number and group.driving() is not None:
            raise StructureError(element, "is a second driver", "keep one driver: a mechanism has one")
        for link in group.link_names():
            if link not in mechanism.links:
                raise StructureError(element, f"link {link!r} is not defined", nearest(link, mechanism.links))
            if link in placed:
                raise StructureError(element, f"link {link!r} already belongs to a group", "use each link once")
            placed.add(link)
        for point in group.needs():
            if point not in known:
                later = point in everywhere
                problem = f"point {point!r} does not exist yet" if later else f"point {point!r} is not defined"
                remedy = "move this group after the one that introduces the point" if later else nearest(point, known)
                raise StructureError(element, problem, remedy)
        for point in group.on_frame():
            if point not in mechanism.fixed:
                problem = f"point {point!r} must be on the frame, but it moves"
                raise StructureError(element, problem, nearest(point, mechanism.fixed))
        _check_guides(mechanism, group, element, placed)
        _check_couplings(mechanism, group, element, placed, number)
        if (lacking := group.lacking(mechanism.links)) is not None:
            raise StructureError(element, *lacking)
        for link, (origin, far) in group.pins().items():
            apart = None if far is None else _apart(mechanism.links[link], origin, far)
            if apart is not None and number and np.any(apart == 0):
                problem = "joins two pins, but its length is zero"
                raise StructureError(f"links.{link}", problem, "give the distance between its pins")
            if (uneven := mechanism.links[link].uniform_fault()) is not None:
                raise StructureError(f"links.{link}.uniform", *uneven)
            for name, piece in mechanism.links[link].counterweights.items():
                if piece.ideal and (origin not in mechanism.fixed or link in group.translating()):
                    problem = f"link {link!r} has no fixed pivot, so its counterweight cannot be ideal"
                    where = f"links.{link}.counterweights.{name}"
                    raise StructureError(where, problem, "omit `ideal`, or choose a link with a fixed pivot")
        _add_points(mechanism, group, element, known)
    _check_names(mechanism, everywhere)
    idle = [name for name in mechanism.links if name not in placed]
    if idle:
        raise StructureError(f"links.{idle[0]}", "belongs to no group", "add a group that contains it, or delete it")
    _check_driven(mechanism)


def _check_driven(mechanism: Mechanism) -> None:
    """Raise `StructureError` where the driver moves one link alone and the other groups do not move."""
    (driver, *rest), crank = structure(mechanism).parts, mechanism.driving_link
    if rest and driver.links == (crank,) and not any(crank in pair.ends for part in rest for pair in part.outer):
        problem = (
            f"the driver moves {crank!r} alone; {', '.join(rest[0].links)} are attached to the frame and do not move"
        )
        pins = ", ".join(pin for pin in mechanism.driver.pins()[crank] if pin and pin not in mechanism.fixed)
        remedy = f"attach it to a point of {crank!r}" + (f", such as {pins}" if pins else "")
        raise StructureError(f"groups[1] ({mechanism.groups[1].kind})", problem, remedy)


def _apart(link: Link, origin: str, far: str) -> np.ndarray | None:
    """Zero where the two pins of a link in a group coincide; None while its numbers are traced."""
    if link.held(origin, far) is None:
        return number_of(link.length)
    points = link.places()
    return number_of((points[far] - points[origin]).squared())


def _check_guides(mechanism, group, element, placed):
    """Raise `StructureError` unless guides are on the frame or on links attached before, through points of these."""
    given = [value for field in dataclasses.fields(group) for value in _flat(getattr(group, field.name))]
    for guide in given:
        if isinstance(guide, Guide) and guide.on in group.link_names():
            problem = f"the guide is on {guide.on!r}, a link of the group itself"
            raise StructureError(element, problem, "name the frame, or a link of a group before this one")
    for guide in group.guides():
        if guide.on != "frame" and (guide.on not in placed):
            problem = f"the guide is on link {guide.on!r}, which is not attached yet"
            known = [name for name in placed if name not in group.link_names()]
            remedy = "move this group after the one that introduces the link"
            raise StructureError(element, problem, remedy if guide.on in mechanism.links else nearest(guide.on, known))
        if guide.through not in (own := mechanism.points_on(guide.on)):
            where = "of the frame" if guide.on == "frame" else f"on link {guide.on!r}"
            problem = f"the guide is {where}, but point {guide.through!r} is not"
            raise StructureError(element, problem, nearest(guide.through, own))


def _flat(value):
    return value if isinstance(value, tuple) else (value,)


def _check_couplings(mechanism, group, element, placed, number):
    """Raise `StructureError` unless gears turn about points of their carriers, and racks slide on the same carrier."""
    there = [name for name in placed if name not in group.link_names()]
    for link in (link for link, _ in (*group.lies_on(), *group.slides_on())):
        if link != "frame" and link not in there:
            problem, remedy = f"link {link!r} is not attached yet", "move this group after the one that introduces it"
            raise StructureError(element, problem, remedy if link in mechanism.links else nearest(link, there))
    for link, point in group.lies_on():
        if point not in (own := mechanism.points_on(link)):
            where = "of the frame" if link == "frame" else f"on link {link!r}"
            raise StructureError(element, f"point {point!r} is not {where}", nearest(point, own))
    for link, on in group.slides_on():
        joints = [joint for before in mechanism.groups[:number] for joint in before.joints()]
        by = [joint.by for joint in joints if joint.slides and joint.link == link]
        if on not in by:
            problem = f"{link!r} does not slide along {on!r}"
            raise StructureError(element, problem, f"it slides along: {', '.join(map(str, by)) or 'nothing'}")


def _check_names(mechanism, points):
    """Raise `StructureError` unless the keys of results differ: names of groups, and names of links and points."""
    seen = {}
    for number, group in enumerate(mechanism.groups):
        name = "-".join(group.link_names())
        if name in seen:
            problem = f"has the name {name!r}, which groups[{seen[name]}] has too"
            raise StructureError(f"groups[{number}] ({group.kind})", problem, "rename one of its links")
        seen[name] = number
    for name in mechanism.links:
        if name == "frame":
            raise StructureError("links.frame", "the name is reserved for the frame", "give the link another name")
        if name in points:
            raise StructureError(f"links.{name}", f"there is also a point {name!r}", "give the link another name")
    for name, at in mechanism.fixed.items():
        if isinstance(at, str | int | float | tuple | list):
            raise StructureError(f"fixed.{name}", f"must be a Vec, but is {at!r}", "write Vec(x, y)")


def _all_points(mechanism):
    pins = {pin for g in mechanism.groups for pin in g.brings()}
    on_links = {p for link in mechanism.links.values() for p in (*link.point_names(), *link.counterweights)}
    return pins | set(mechanism.fixed) | on_links


def _add_points(mechanism, group, element, known):
    before = frozenset(known)
    new = [(pin, element) for pin in group.brings()]
    shared = {*group.shared(), *(pin for link in group.pins() for pin in mechanism.links[link].pins)}
    for link in group.pins():
        new += [(p, f"links.{link}.points.{p}") for p in mechanism.links[link].point_names()]
        new += [(p, f"links.{link}.counterweights.{p}") for p in mechanism.links[link].counterweights]
        new.append((mechanism.links[link].centre_name, f"links.{link}"))
    own = {mechanism.links[link].centre_name for link in group.pins()}
    own |= {name for link in group.pins() for name in mechanism.links[link].counterweights}
    for point, where in new:
        pin = point in shared - own and (point not in before or point in group.needs())  # of several links of the group
        if point in known and not pin:
            raise StructureError(where, f"the point name {point!r} is already used", "give every point its own name")
        known.add(point)
