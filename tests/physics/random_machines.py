# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
"""Random machines in batches: one composition of groups, many designs of it, each at its own crank angle.

A plan defines the composition: a driver that rotates, oscillates or slides, and up to eight groups of class II attached
to any existing links. A design is drawn group by group until the group can be assembled at the tested angle, with any
margin; there is no other condition. All numbers of a batch are arrays over its designs.

Groups of higher class begin with a sketch at crank angle zero. So machines with such a group are tested up to a radian
from there, and a group is drawn until the oracle can follow it, in steps of two degrees, to the tested angle and two
steps of its path further at either end. Groups before it must be assembled on the whole way, too.
"""

from __future__ import annotations

import cmath
import dataclasses
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from linkjax import (
    PRP,
    RPP,
    RPR,
    RRP,
    RRR,
    Belt,
    Crank,
    Flywheel,
    Gear,
    General,
    Guide,
    Link,
    Mechanism,
    Pinion,
    Rack,
    Teeth,
    Vec,
)
from linkjax.groups import Drive, Slot
from linkjax.mechanism import linkage
from tests.physics import oracle, random_general

KINDS = ("RRR", "RRP", "RPR", "PRP", "RPP")
WHEELS = ("gear", "planet", "belt", "rack", "pinion")  # the last two after a gear and a rack
TRIES = 200
AS_SKETCHED = 0.05  # m, allowed movement of a group of higher class from its sketch to closure
FROM_SKETCH = 1.0  # rad, distance from the sketch within which groups of higher class are tested
FURTHER = math.radians(6.0)  # further range of closure at either end: two steps of the path they are followed along


class Batch(NamedTuple):
    """Designs of one composition (arrays over the designs in every leaf), with crank angle, speed and acceleration."""

    name: str
    scene: lj.Scene
    phi: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray

    def one(self, i: int) -> lj.Scene:
        """A single design."""
        return jax.tree.map(lambda leaf: np.asarray(leaf[i]), self.scene)


class Asked(NamedTuple):
    """The attachment of a group: points, guides as (link, point), its side; additional points that exist."""

    one: str
    to: str
    guides: list[tuple[str, str]]
    side: int
    more: list[str]


class Dice:
    """Random numbers, one for every design of a batch."""

    def __init__(self, rng: np.random.Generator, count: int):
        self.rng, self.count = rng, count

    def between(self, low: float, high: float) -> np.ndarray:
        return self.rng.uniform(low, high, self.count)

    def point(self, reach: Any) -> Vec:
        return Vec(reach * self.between(-1, 1), reach * self.between(-1, 1))

    def link(self, length: Any, point: str, scaled: bool = False) -> Link:
        """A link, or a block where the length is zero, with an additional point."""
        block = np.all(length == 0)
        reach = np.full(self.count, 0.1) if block else length
        extra = {"reference_length": reach * self.between(0.7, 1.3), "mass_properties": "scaled"} if scaled else {}
        return Link(length=length + np.zeros(self.count), mass=self.between(0.3, 3), inertia=self.between(0.001, 0.02),
                    centre=self.point(0.4 * reach), points={point: self.point(reach)}, **extra)  # fmt: skip

    def guide(self, on: tuple[str, str]) -> Guide:
        return Guide(on[1], self.between(-3, 3), self.between(-0.05, 0.05), on[0])


def composed(plan: int, groups: int, count: int, kinds: tuple[str, ...] = (), driver: str = "") -> Batch:
    """So many designs of the composition with this number."""
    choose, dice = np.random.default_rng((7, plan)), Dice(np.random.default_rng((8, plan)), count)
    kinds = kinds or tuple(str(kind) for kind in choose.choice(KINDS, groups))
    driver = driver or str(choose.choice(["turns", "turns", "turns", "swings", "slides"]))
    general = driver in random_general.DRIVERS or any(kind in random_general.LOOPS for kind in kinds)
    phi = dice.between(0, FROM_SKETCH if general else 2 * math.pi)
    fixed = {"A": dice.point(0.1), "P": dice.point(0.5), "Q": dice.point(0.5)}
    first, links, moving = _driver(driver, choose, dice, fixed, phi)
    made = [first]
    for number, kind in enumerate(kinds, 1):
        asked = _ask(choose, fixed, moving, kind in random_general.LOOPS)
        scaled = bool(choose.random() < 0.3)
        ahead = any(kind in random_general.LOOPS for kind in kinds[number - 1 :])  # it or a later one is followed
        angles = np.linspace(-FURTHER, phi + FURTHER, 37) if ahead else phi
        group, new = _assembled(kind, number, dice, asked, scaled, (fixed, links, made, angles))
        links |= new
        made.append(group)
        for link, (origin, far) in group.pins().items():
            moving |= {p: link for p in (origin, far) if p is not None and p in group.brings()}
            moving |= dict.fromkeys(new[link].points, link)
    marks = [p for p in moving if p.startswith("K")]
    worked, pushed = str(marks[-1]), str(choose.choice(marks))
    loads = (
        lj.Force("push", moving[pushed], pushed, force=dice.point(50.0)),
        lj.OpposingForce("work", moving[worked], worked, magnitude=dice.between(5, 50)),
        lj.Torque("twist", moving[pushed], torque=dice.between(-5, 5)),
    )
    wheel = Flywheel(dice.between(0, 0.5)) if driver in ("turns", "swings") else None
    turns = math.lcm(*(g.mesh.teeth[0] for g in made if isinstance(g, Gear) and isinstance(g.mesh, Teeth)))
    scene = lj.Scene(Mechanism(fixed, links, made, wheel), loads, dice.point(10.0), dice.between(5, 40),
                     cycle_turns=turns)  # fmt: skip
    scene = jax.tree.map(lambda leaf: np.array(np.broadcast_to(leaf, count)), scene)
    name = f"{plan}: {driver}, {' '.join(kinds)}"
    return Batch(name, scene, phi, scene.speed * dice.between(0.8, 1.2), scene.speed**2 * dice.between(-1, 1))


def _driver(driver: str, choose, dice: Dice, fixed, phi):
    """The driver, its links, and the points on them to which others can be attached."""
    if driver in random_general.DRIVERS:
        so_far = fixed, {}, [], np.stack([0 * phi - FURTHER, phi + FURTHER])
        first, links = _until_it_stands(dice, lambda: random_general.driver_of(driver, dice, fixed), so_far)
        return first, links, random_general.points_of(driver)
    first, link = _one_link(driver, choose, dice)
    return first, {"crank": link}, {"B": "crank", "K0": "crank"}


def _one_link(driver: str, choose, dice: Dice):
    """A driver of one link."""
    if driver == "slides":
        guide = Guide("A", dice.between(-3, 3), dice.between(-0.05, 0.05))
        law = lj.Harmonic(dice.between(-0.1, 0.1), dice.between(-0.1, 0.1))
        return lj.LinearDriver("crank", "B", guide, law), dice.link(0.0, "K0")
    link = dice.link(dice.between(0.05, 0.15), "K0")
    if driver == "swings":
        law = lj.Harmonic(dice.between(-1, 1), dice.between(-1, 1))
        return Crank("crank", "A", "B", phase=dice.between(0, 6), law=law), link
    return Crank("crank", "A", "B", "ccw" if choose.choice((1, -1)) == 1 else "cw", dice.between(0, 6)), link


def _ask(choose, fixed, moving, general: bool) -> Asked:
    """A moving point and another one, or one of the frame; guides on the frame and on a link."""
    points = list(moving)
    one, two = choose.choice(points, 2, replace=False)
    to = choose.choice([p for p in (*fixed, *points) if p not in (one, "A") and moving.get(p) != moving[one]])
    on = [("frame", str(choose.choice(["P", "Q"]))), (moving[two], str(two))]
    on, side = on if choose.random() < 0.5 else on[::-1], int(choose.choice((1, -1)))
    rest = [str(p) for p in choose.permutation([p for p in (*fixed, *points) if p not in (one, to)])] if general else []
    return Asked(str(one), str(to), on, side, rest)


def _assembled(kind: str, number: int, dice: Dice, asked: Asked, scaled: bool, so_far):
    """A group with its links, each design drawn anew until it can be assembled."""
    fixed, links, made, phi = so_far
    general = kind in random_general.LOOPS
    with np.errstate(invalid="ignore"):
        machine = SimpleNamespace(fixed=fixed, links=links, groups=made)
        pose = random_general.Pose(*oracle.assemble(machine, np.zeros(dice.count) if phi.ndim > 1 else phi))

    def draw():
        if not general:
            return _drawn(kind, number, dice, asked, pose.points, scaled)
        outer = [asked.one, asked.to, *asked.more][: random_general.outer_count(kind)]
        return random_general.group_of(kind, number, dice, outer, dice.guide(asked.guides[0]), pose, scaled)

    return _until_it_stands(dice, draw, (fixed, links, made, phi[[0, -1]] if general else phi))


def _until_it_stands(dice: Dice, draw: Callable[[], Any], so_far):
    """The random data, drawn anew for every design that is not assembled."""
    fixed, links, made, phi = so_far
    done, found = np.zeros(dice.count, bool), None
    for _ in range(TRIES):
        new = draw()
        if found is not None:
            new = jax.tree.map(lambda old, now, done=done: np.where(done, old, now), found, new)
        found, done = new, done | _stands(fixed, links, made, new[:2], phi)
        if done.all():
            return found
    raise AssertionError(f"no group was found that can be assembled behind {', '.join(links)}")


def _drawn(kind: str, number: int, dice: Dice, asked: Asked, points, scaled: bool):
    """A group of random dimensions, with its links."""
    one, to, (here, there), side, _ = asked
    a, b, marks = f"a{number}", f"b{number}", (f"K{2 * number}", f"K{2 * number + 1}")

    def links(*lengths: Any) -> dict[str, Link]:
        parts = zip((a, b), lengths, marks, strict=True)
        return {name: dice.link(length, mark, scaled and not np.all(length == 0)) for name, length, mark in parts}

    if kind == "RRR":
        r = np.abs(points[to] - points[one])
        return RRR((a, b), one, to, f"G{number}", side), links(r * dice.between(0.3, 1.6), r * dice.between(0.3, 1.6))
    if kind == "RRP":
        return RRP(a, b, one, f"G{number}", dice.guide(here), side), links(dice.between(0.1, 1.2), 0.0)
    if kind == "RPR":
        offset = dice.between(-0.03, 0.03)
        return RPR(a, b, one, to, f"G{number}", side, offset), links(dice.between(0.2, 0.5), 0.0)
    if kind == "PRP":
        return PRP((a, b), f"G{number}", (dice.guide(here), dice.guide(there)), side), links(0.0, 0.0)
    if kind in WHEELS:
        return _wheel(kind, number, dice, side, marks[0], points)
    slot = dice.between(0.05, math.pi - 0.05) * side
    return RPP(a, b, one, f"G{number}", dice.guide(here), slot, dice.between(-0.05, 0.05)), links(0.0, 0.0)


def _wheel(kind: str, number: int, dice: Dice, side: int, mark: str, points):
    """A gear in mesh with the crank or with the last gear, or a rack, with its link."""
    name, end, phase = f"a{number}", f"G{number}", dice.between(-3, 3)
    teeth = tuple(int(n) for n in dice.rng.choice(range(12, 80), 2, replace=False))
    link = {name: dice.link(0.0 if kind == "rack" else dice.between(0.05, 0.2), mark)}
    if kind == "rack":  # on a guide of the frame, moved by the previous gear
        guide, radius, start = dice.guide(("frame", "P")), dice.between(0.02, 0.2), dice.between(-0.2, 0.2)
        return Rack(name, end, guide, f"a{number - 1}", "Q", radius, side, start, dice.between(0, 0.5)), link
    if kind == "pinion":
        rest = dice.between(0.02, 0.2), side, end, phase, "frame", dice.between(0, 0.5)
        return Pinion(name, "Q", f"a{number - 1}", f"G{number - 1}", *rest), link
    if kind == "planet":
        mesh = Teeth(teeth, side > 0, dice.between(0, 0.5))
        return Gear(name, "B", mesh, "frame", "A", end, phase, "crank"), link
    apart = np.abs(points["Q"] - points["A"])
    belt = Belt(apart * dice.between(0.05, 0.45), apart * dice.between(0.05, 0.45), side > 0, dice.between(0, 50))
    mesh = belt if kind == "belt" else Teeth(teeth, side > 0, dice.between(0, 0.5))
    return Gear(name, "Q", mesh, "crank", "A", end, phase), link


def _stands(fixed, links, made, new, phi) -> np.ndarray:
    """The designs whose last group can be assembled."""
    group, own = new
    machine = SimpleNamespace(fixed=fixed, links=links | own, groups=[*made, group])
    with np.errstate(invalid="ignore"):
        points, directions = oracle.assemble(machine, phi)
    good = np.isfinite(phi)
    for link, pins in group.pins().items():
        good &= np.isfinite(directions[link])
        for p in pins:
            good &= np.isfinite(points[p]) if p else True
    if isinstance(group, General):
        with np.errstate(invalid="ignore"):
            begin, _ = oracle.assemble(machine, np.zeros(good.shape[-1]))
            off = [np.abs(begin[p] - (np.asarray(at.x) + 1j * np.asarray(at.y))) for p, at in group.sketch.items()]
        good &= np.max(off, 0) < AS_SKETCHED
    if isinstance(group, PRP):
        good &= group.side * (directions[group.blocks[1]] / directions[group.blocks[0]]).imag > 0
    return np.all(good.reshape((-1, good.shape[-1])), 0)


# ---- drawn by links and joints


def drawn(batch: Batch, plan: int) -> Batch:
    """The same machines given by links and joints, with link axes through other pins than those held by groups."""
    each = [(batch.one(i), float(phi)) for i, phi in enumerate(batch.phi)]
    scenes = [_drawn_one(scene, phi, np.random.default_rng((9, plan))) for scene, phi in each]
    scene = jax.tree.map(lambda *leaves: np.asarray(leaves, dtype=float), *scenes)
    return batch._replace(name=f"{batch.name}, drawn", scene=scene)


def _drawn_one(scene: lj.Scene, phi: float, choose: np.random.Generator) -> lj.Scene:
    m = jax.tree.map(jnp.asarray, scene.mechanism)
    at, _ = oracle.assemble(m, phi)
    used = {getattr(g, end) for g in m.groups for end in ("from_", "to", "about") if hasattr(g, end)}
    turned: dict[str, complex] = {}
    links = {}
    for group in m.groups:
        for name, (origin, far) in group.pins().items():
            link = m.links[name]
            pins = [p for p in (origin, far, *link.points) if p and (p in (origin, far) or p in used)]
            if isinstance(group, RRR | RRP | Crank) and far is not None:
                pins = [pins[i] for i in choose.permutation(len(pins))]
            if isinstance(group, Crank):  # turns about one of its first two pins
                pins.sort(key=lambda p, origin=origin: p != origin)
                pins[:2] = pins[:2][:: int(choose.choice((1, -1)))]
            links[name], turned[name] = _redrawn(link, origin, far, pins)

    def guide(g: Guide) -> Guide:
        return dataclasses.replace(g, along=g.along - cmath.phase(turned.get(g.on, 1.0)))

    slots: list[Slot] = []
    for g in m.groups:
        if isinstance(g, RRP):
            slots.append(Slot(g.block, guide(g.guide)))
        elif isinstance(g, PRP):
            slots += [Slot(block, guide(slot)) for block, slot in zip(g.blocks, g.slots, strict=True)]
        elif isinstance(g, RPR):
            slots.append(Slot(g.block, Guide(g.about, 0.0, g.offset, g.link)))
        elif isinstance(g, RPP):
            slots += [Slot(g.link, guide(g.guide)), Slot(g.block, Guide(g.end, g.slot, g.offset, g.link))]
    sketch = {p: (at[p].real, at[p].imag) for link in links.values() for p in link.pins if p not in m.fixed}
    crank = m.groups[0]
    assert isinstance(crank, Crank) and crank.law is None
    phase = crank.phase + cmath.phase(turned["crank"])
    found = linkage(m.fixed, links, Drive("crank", rotation=crank.rotation, phase=phase + crank.sense * phi), slots,
                    sketch, m.flywheel)  # fmt: skip
    first = dataclasses.replace(found.groups[0], phase=found.groups[0].phase - crank.sense * phi)
    ordered = {name: found.links[name] for name in found.link_names}
    found = Mechanism(found.fixed, ordered, [first, *found.groups[1:]], found.flywheel)
    assert sorted(g.kind for g in found.groups) == sorted(g.kind for g in m.groups)
    return scene.with_mechanism(found)


def _redrawn(link: Link, origin: str, far: str | None, pins: list[str]) -> tuple[Link, complex]:
    """A link in axes from the first of its pins to the second, and the direction of these axes."""
    body = link.actual()
    places = {p: complex(at.x, at.y) for p, at in body.points.items()} | {origin: 0j}
    if far is not None:
        places[far] = complex(link.length)
    start = places[pins[0]]
    span = places[pins[1]] - start if far is not None else 1.0 + 0j
    axis = span / abs(span)
    new = {p: (z - start) / axis for p, z in places.items() if p not in pins[: 1 if far is None else 2]}
    centre = (complex(body.centre.x, body.centre.y) - start) / axis
    return Link(abs(span) if far is not None else 0.0, body.mass, body.inertia, Vec(centre.real, centre.imag),
                {p: Vec(z.real, z.imag) for p, z in new.items()}, pins=pins), axis  # fmt: skip
