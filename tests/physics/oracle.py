# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportIndexIssue=false
# pyright: reportReturnType=false, reportOptionalMemberAccess=false
"""Planar machines by independent methods: NumPy and mpmath, directly from the laws of mechanics.

Nothing of linkjax is used except the numbers and names of a design. Points and link directions are complex numbers,
linkages are closed with angles and the law of cosines, rates come from the loop equations solved as linear systems (or
from differences of 50-digit positions), forces from the Newton-Euler equations of all links simultaneously.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import mpmath
import numpy as np
from scipy.optimize import brentq

from linkjax.groups import PRP, RPP, RPR, RRP, RRR, Crank, Gear, General, Harmonic, LinearDriver, Pinion, Rack
from linkjax.loads import Force, OpposingForce, OpposingTorque, Torque
from linkjax.mechanism import Mechanism
from tests.physics import wheels


class Body(NamedTuple):
    """Mass, central inertia, and the points of a link (mass centre included) in its own frame, as complex numbers."""

    mass: Any
    inertia: Any
    places: dict[str, Any]


def reader(m) -> Callable[[Any], Any]:
    """How a number of a design is read: as an exact mpmath number, or as a NumPy array."""
    if m is mpmath:
        return lambda x: x if isinstance(x, mpmath.mpf) else mpmath.mpf(float(x))
    return lambda x: np.asarray(x, dtype=float)


def body(link, m=np) -> Body:
    """The data of a link at its present length."""
    n = reader(m)
    place = {name: n(at.x) + 1j * n(at.y) for name, at in link.points.items()}
    centre = n(link.centre.x) + 1j * n(link.centre.y)
    mass, inertia, length = n(link.mass), n(link.inertia), n(link.length)
    if link.mass_properties == "section":
        mass, centre = n(link.area) * n(link.density) * length, length / 2 + 0j
        inertia = mass * length**2 / 12
    if link.mass_properties == "scaled":
        k = length / n(link.reference_length)
        place = {name: at * k for name, at in place.items()}
        mass, centre, inertia = mass * k, centre * k, inertia * k**3
    return Body(mass, inertia, {link.centre_name: centre, **place})


class Numbers(NamedTuple):
    """The data read from a mechanism: its links (points from where the group holds them), the distance of the pins at
    which the group holds each and the direction of this line in the link's axes, its fixed points, the pins of groups.
    """

    bodies: dict[str, Body]
    length: dict[str, Any]
    axis: dict[str, Any]
    fixed: dict[str, Any]
    pins: list[dict[str, tuple[str, str | None]]]


_READ: dict[int, tuple[Mechanism, Numbers]] = {}  # the mechanism too: while it exists its id is unique


def numbers(mechanism: Mechanism, m=np) -> Numbers:
    """The data of a mechanism; those in NumPy, needed by thousands of evaluations, are kept for the last few."""
    if m is np and id(mechanism) in _READ:
        return _READ[id(mechanism)][1]
    n = reader(m)
    bodies = {name: body(link, m) for name, link in mechanism.links.items()}
    length = {name: n(link.length) for name, link in mechanism.links.items()}
    axis = dict.fromkeys(bodies, 1)
    for group in mechanism.groups:
        for name, (origin, far) in group.pins().items():
            own = mechanism.links[name].pins
            if own:  # drawn by its joints: the group may hold it at other pins than those of its axis
                places = {**dict(zip(own, (n(0.0) + 0j, length[name] + 0j), strict=False)), **bodies[name].places}
                places = {centre: places[centre] for centre in bodies[name].places} | places  # the mass centre first
                places = {point: at - places[origin] for point, at in places.items()}
                bodies[name] = bodies[name]._replace(places=places)
                if far is not None and not isinstance(group, General):
                    length[name] = abs(places[far])
                    axis[name] = places[far] / length[name]
    fixed = {name: n(at.x) + 1j * n(at.y) for name, at in mechanism.fixed.items()}
    found = Numbers(bodies, length, axis, fixed, [group.pins() for group in mechanism.groups])
    if m is np:
        if len(_READ) >= 4:
            _READ.clear()
        _READ[id(mechanism)] = mechanism, found
    return found


def prescribed(law, phi, m=np):
    """The position of the driver that a motion law prescribes."""
    assert isinstance(law, Harmonic)
    start, stop = (reader(m)(end) for end in (law.start, law.stop))
    return (start + stop) / 2 + (start - stop) / 2 * m.cos(phi)


def swinging(law, phi, m=np):
    """First and second derivatives of that position."""
    half = (reader(m)(law.stop) - reader(m)(law.start)) / 2
    return half * m.sin(phi), half * m.cos(phi)


class Path(NamedTuple):
    """A guide in its present position: a point on it, its direction, its offset, and its link."""

    base: Any
    along: Any
    offset: Any
    on: str


def way(guide, points, directions, m=np) -> Path:
    """A guide, for given positions of points and links."""
    n = reader(m)
    turned = 1 if guide.on == "frame" else directions[guide.on]
    return Path(points[guide.through], m.exp(1j * n(guide.along)) * turned, n(guide.offset), guide.on)


def meeting(one: Path, two: Path) -> Any:
    """Intersection of two straight paths."""
    far = two.base + 1j * two.offset * two.along
    near = one.base + 1j * one.offset * one.along
    return near + one.along * ((far - near) / two.along).imag / (one.along / two.along).imag


def open_joints(g: General, places, points, directions, x, m=np, phi=0.0) -> list:
    """Closure errors of pins, slots and drive of a group of higher class; `x` has x, y and angle of every link."""
    n = reader(m)
    at = {link: x[3 * i] + 1j * x[3 * i + 1] for i, (link, _) in enumerate(g.members)}
    u = {link: m.exp(1j * x[3 * i + 2]) for i, (link, _) in enumerate(g.members)}
    angles = {name: m.atan2(there.imag, there.real) for name, there in directions.items()} if g.gears else {}
    angles |= {"frame": n(0), **{link: x[3 * i + 2] for i, (link, _) in enumerate(g.members)}}
    found, holders, ways = [], {}, {}
    for link, pins in g.members:
        for p in pins:
            holders.setdefault(p, []).append(at[link] + places[link][p] * u[link])
    for p, every in holders.items():
        first = points[p] if p in g.outer else every[0]
        found += [part for there in every[p not in g.outer :] for part in ((there - first).real, (there - first).imag)]
    for k, slot in enumerate(g.slots):
        guide, on = slot.guide, slot.guide.on
        base = at[on] + places[on][guide.through] * u[on] if on in at else points[guide.through]
        turned = u[on] if on in at else 1 if on == "frame" else directions[on]
        seen = (at[slot.block] - base) / (m.exp(1j * n(guide.along)) * turned)
        found += [seen.imag - n(guide.offset), (u[slot.block] / (m.exp(1j * n(guide.along)) * turned)).imag]
        found += [seen.real - stands(g.drive, phi, m)] if k == g.driven_slot() else []
        ways[slot.block] = seen.real
    found += [wheels.left_open(gear, angles.__getitem__, ways, n) for gear in g.gears]
    if g.drive is not None and g.driven_slot() is None:
        turned = u[g.drive.link] / (1 if g.drive.on == "frame" else u[g.drive.on])
        found.append((turned / m.exp(1j * (n(g.drive.phase) + stands(g.drive, phi, m)))).imag)
    return found


def stands(drive, phi, m=np):
    """The displacement of a drive inside a group, without its phase."""
    return drive.sense * phi if drive.law is None else prescribed(drive.law, phi, m)


def drive_rates(drive, phi, m=np):
    """First and second derivatives of that."""
    return (drive.sense + 0 * phi, 0 * phi) if drive.law is None else swinging(drive.law, phi, m)


def in_axes(g: General, mechanism: Mechanism, m=np) -> dict[str, dict[str, Any]]:
    """The points of the links of a group of higher class in their own axes."""
    here = numbers(mechanism, m)
    found = {}
    for link, pins in g.members:
        found[link] = {**here.bodies[link].places, pins[0]: reader(m)(0.0)}
        if len(pins) > 1:
            found[link].setdefault(pins[1], here.length[link])
    return found


STEP = math.radians(2.0)


def closed_at(g: General, places, points, directions, x, phi) -> tuple[np.ndarray, np.ndarray]:
    """The configuration near `x` that closes the joints at `phi`, NaN if there is none, and the sign of the
    determinant of its Jacobian: Newton's method with differences, for many designs simultaneously."""
    count = len(x)
    size = np.max([np.abs(at) + 0 * phi for link, pins in g.members for p, at in places[link].items() if p in pins], 0)
    size = np.where(size > 0, size, 1.0)
    unit = np.stack([size, size, np.ones_like(size)] * len(g.members))
    steps = np.concatenate([np.zeros((count, 1)), 1e-7 * np.eye(count)], 1)
    last, gap, sense, found = False, size, size, size
    for _ in range(40):
        every = np.expand_dims(x, 1) + np.multiply.outer(steps, np.ones_like(size)) * np.expand_dims(unit, 1)
        values = np.stack(open_joints(g, places, points, directions, every, phi=phi))
        gap, matrix = values[:, 0], np.moveaxis((values[:, 1:] - values[:, :1]) * 1e7, (0, 1), (-2, -1))
        found = np.isfinite(matrix).all((-1, -2))
        matrix = np.where(found[..., None, None], matrix, np.eye(count))
        move = np.moveaxis(np.linalg.solve(matrix, -np.moveaxis(gap, 0, -1)[..., None])[..., 0], -1, 0)
        most = np.max(np.abs(move), 0)
        x, sense = x + unit * move * np.minimum(1.0, 0.3 / np.maximum(most, 0.3)), np.sign(np.linalg.det(matrix))
        if last:
            break
        last = not np.any(most > 1e-7)  # the next step is accurate to rounding
    return np.where(found & (np.max(np.abs(gap), 0) < 1e-9 * size), x, np.nan), sense


def sketched(g: General, places, points, directions) -> np.ndarray:
    """The configuration in the sketch of a group of higher class."""
    n = reader(np)
    spots = {**points, **{p: n(at.x) + 1j * n(at.y) for p, at in g.sketch.items()}}
    guides, u = {slot.block: slot.guide for slot in g.slots}, {"frame": 1.0, **directions}
    for link, pins in sorted(g.members, key=lambda member: member[0] in guides):
        seen = [p for p in (*pins, *places[link]) if p in spots]
        if link in guides:
            u[link] = np.exp(1j * n(guides[link].along)) * u[guides[link].on]
        else:
            u[link] = (spots[seen[1]] - spots[seen[0]]) / (places[link][seen[1]] - places[link][seen[0]])
        u[link] = u[link] / np.abs(u[link])
    x = []
    for link, pins in g.members:
        seen = next(p for p in (*pins, *places[link]) if p in spots)
        origin = spots[seen] - places[link][seen] * u[link]
        x += [origin.real, origin.imag, np.angle(u[link])]
    return np.stack(np.broadcast_arrays(*x))


_PATHS: dict[int, tuple[Any, list[tuple[np.ndarray, np.ndarray]]]] = {}


def followed(g: General, mechanism: Mechanism, phi, before) -> np.ndarray:
    """The configuration at `phi`, followed from the sketch in steps of at most two degrees; NaN if it cannot be
    followed without a sign change of its Jacobian. Many designs are followed simultaneously, each to its own angle;
    for a single one the path is stored, for any number of angles."""
    places = in_axes(g, mechanism)

    def next_one(path, at):
        points, directions = before(at)
        start = path[-1][0] if path else [part + 0 * at for part in sketched(g, places, points, directions)]
        x, sense = closed_at(g, places, points, directions, np.stack(start), at)
        return np.where(sense == path[0][1], x, np.nan) if path else x, sense

    path: list[tuple[np.ndarray, np.ndarray]]
    if any(np.ndim(at) for each in places.values() for at in each.values()):
        path, count = [], max(1, math.ceil(np.max(np.abs(phi)) / STEP))
        for k in range(count + 1):
            path.append(next_one(path[:1] + path[-1:], phi * (k / count)))
        return path[-1][0]
    path = _PATHS.setdefault(id(g), (g, []))[1]
    number = np.rint(phi % (2 * math.pi) / STEP).astype(int)
    while len(path) <= np.max(number):
        path.append(next_one(path, np.asarray(len(path) * STEP)))
    start = np.moveaxis(np.stack([x for x, _ in path])[number], -1, 0)
    points, directions = before(phi)
    return closed_at(g, places, points, directions, start, phi)[0]


def general(g: General, mechanism: Mechanism, phi, before, m=np) -> dict[str, tuple[Any, Any]]:
    """Origins and directions of the links of a group of higher class."""
    x = followed(g, mechanism, np.asarray(phi, dtype=float), lambda phi: before(phi, np))
    if m is mpmath:
        places, (points, directions) = in_axes(g, mechanism, m), before(phi, m)
        x = mpmath.findroot(lambda *x: open_joints(g, places, points, directions, x, mpmath, phi), x.tolist())
    return {link: (x[3 * i] + 1j * x[3 * i + 1], m.exp(1j * x[3 * i + 2])) for i, (link, _) in enumerate(g.members)}


def assemble(mechanism: Mechanism, phi, m=np, groups=None) -> tuple[dict[str, Any], dict[str, Any]]:
    """Points and link directions at the crank angle `phi`: complex numbers of NumPy or mpmath."""
    n = reader(m)
    groups = mechanism.groups if groups is None else groups
    links, length, axis, fixed, _ = numbers(mechanism, m)
    points = dict(fixed)
    directions: dict[str, Any] = {}
    counted: dict[str, Any] = {"frame": n(0)}  # angles of links with all turns

    def angle(name):
        return counted[name] if name in counted else m.atan2(directions[name].imag, directions[name].real)

    for number, g in enumerate(groups):
        if isinstance(g, Crank):
            turned = g.sense * phi if g.law is None else prescribed(g.law, phi, m)
            counted[g.link] = n(g.phase) + turned
            new = {g.link: (g.pivot, m.exp(1j * counted[g.link]))}
            points[g.end] = points[g.pivot] + length[g.link] * new[g.link][1]
        elif isinstance(g, Gear | Pinion):
            if isinstance(g, Gear):
                counted[g.link] = wheels.mesh_angle(g, angle, n)
            else:
                way_on = ((points[g.at] - points[g.through or g.pivot]) / directions[g.to]).real - n(g.start)
                counted[g.link] = n(g.phase) + angle(g.carrier) + g.side * way_on / n(g.radius)
            new = {g.link: (g.pivot, m.exp(1j * counted[g.link]))}
            if g.end is not None:
                points[g.end] = points[g.pivot] + length[g.link] * new[g.link][1]
        elif isinstance(g, Rack):
            base, along, offset, _ = way(g.guide, points, directions, m)
            rolled = g.side * n(g.radius) * (angle(g.to) - angle(g.guide.on))
            points[g.end] = base + along * (n(g.start) + rolled + 1j * offset)
            new = {g.link: (g.end, along + 0 * points[g.end])}
        elif isinstance(g, LinearDriver):
            base, along, offset, _ = way(g.guide, points, directions, m)
            points[g.end] = base + along * (prescribed(g.law, phi, m) + 1j * offset)
            new = {g.link: (g.end, along + 0 * points[g.end])}
        elif isinstance(g, RRP):
            base, along, offset, _ = way(g.guide, points, directions, m)
            height = ((points[g.from_] - base) / along).imag - offset
            lean = m.asin(-height / length[g.link])
            rod = along * m.exp(1j * (lean if g.side > 0 else m.pi - lean))
            points[g.end] = points[g.from_] + length[g.link] * rod
            new = {g.link: (g.from_, rod), g.block: (g.end, along + 0 * rod)}
        elif isinstance(g, RPR):
            d = points[g.from_] - points[g.about]
            lean = m.asin(n(g.offset) / abs(d))  # of the pin over the lever's axis
            lever = d / abs(d) * m.exp(-1j * (lean if g.side > 0 else m.pi - lean))
            points[g.end] = points[g.about] + length[g.link] * lever
            new = {g.link: (g.about, lever), g.block: (g.from_, lever)}
        elif isinstance(g, PRP):
            one, two = (way(slot, points, directions, m) for slot in g.slots)
            points[g.meet] = meeting(one, two)
            new = {
                block: (g.meet, path.along + 0 * points[g.meet])
                for block, path in zip(g.blocks, (one, two), strict=True)
            }
        elif isinstance(g, RPP):
            path = way(g.guide, points, directions, m)
            slot = Path(points[g.from_], path.along * m.exp(1j * n(g.slot)), -n(g.offset), "")
            points[g.end] = meeting(path, slot)
            still = 0 * points[g.end]
            new = {g.link: (g.end, path.along + still), g.block: (g.from_, slot.along + still)}
        elif isinstance(g, General):
            so_far = groups[:number]
            new = general(g, mechanism, phi, lambda phi, m, so_far=so_far: assemble(mechanism, phi, m, so_far), m)
            places = in_axes(g, mechanism, m)
            for link, pins in g.members:
                origin, direction = new[link]
                points.update({p: origin + places[link][p] * direction for p in pins if p not in g.outer})
                new[link] = pins[0], direction
        else:
            assert isinstance(g, RRR)
            one, two = (length[name] for name in g.links)
            span = points[g.to] - points[g.from_]
            r = abs(span)
            corner = m.acos((one**2 + r**2 - two**2) / (2 * one * r))
            first = span / r * m.exp(1j * g.side * corner)
            points[g.meet] = points[g.from_] + one * first
            new = {g.links[0]: (g.from_, first), g.links[1]: (g.to, (points[g.meet] - points[g.to]) / two)}
        for name, (origin, direction) in new.items():
            directions[name] = direction = direction / axis[name]
            for point, at in links[name].places.items():
                points[point] = points[origin] + at * direction
    return points, directions


class Jet(NamedTuple):
    """A quantity with its first and second derivatives with respect to the crank angle (NumPy arrays)."""

    r: Any
    v: Any
    a: Any


class Rates(NamedTuple):
    """Points, and links as direction `r`, ω' `v` and ε' `a`."""

    points: dict[str, Jet]
    links: dict[str, Jet]


def exact(mechanism: Mechanism, phi: Any, digits: int = 50, step: str = "1e-13") -> Rates:
    """Positions with 50 digits, and their differences: rates correct to about 1e-22."""
    with mpmath.workdps(digits):
        h, at = mpmath.mpf(step), reader(mpmath)(phi)
        before, here, after = (assemble(mechanism, at + k * h, mpmath) for k in (-1, 0, 1))
        points, links = {}, {}
        for name, p in here[0].items():
            ahead, behind = after[0][name] - p, p - before[0][name]
            points[name] = Jet(p, (ahead + behind) / (2 * h), (ahead - behind) / h**2)
        for name, u in here[1].items():
            ahead, behind = mpmath.arg(after[1][name] / u), mpmath.arg(u / before[1][name])
            links[name] = Jet(u, (ahead + behind) / (2 * h), (ahead - behind) / h**2)
    return Rates(points, links)


def with_numbers(scene, mechanism: Mechanism):
    """The scene with another mechanism, whose numbers are mpmath's."""
    leaves, tree = jax.tree.flatten(scene)
    inside = len(jax.tree.leaves(scene.mechanism))
    return jax.tree.unflatten(tree, [*jax.tree.leaves(mechanism), *leaves[inside:]])


def parts(values) -> list:
    """Both parts of complex numbers, one after the other."""
    return [part for z in values for part in (z.real, z.imag)]


def rates(mechanism: Mechanism, phi: np.ndarray) -> Rates:
    """Rates at an array of crank angles, from the loop equations of each group solved as linear systems."""
    phi = np.asarray(phi, dtype=float)
    at, directions = assemble(mechanism, phi)
    bodies, length, _, _, pins = numbers(mechanism)
    none = np.zeros_like(phi)
    still = Jet(none + 1.0 + 0j, none, none)
    points = {name: Jet(at[name] + none, none + 0j, none + 0j) for name in mechanism.fixed}
    links: dict[str, Jet] = {}

    def carried(origin: Jet, link: Jet, place) -> Jet:
        arm = place * link.r
        return Jet(origin.r + arm, origin.v + 1j * link.v * arm, origin.a + (1j * link.a - link.v**2) * arm)

    for g, held in zip(mechanism.groups, pins, strict=True):
        if isinstance(g, Crank):
            w, e = (none + g.sense, none) if g.law is None else swinging(g.law, phi)
            links[g.link] = Jet(directions[g.link], w, e)
        elif isinstance(g, LinearDriver):
            (s, s2), along = swinging(g.law, phi), directions[g.link]
            points[g.end], links[g.link] = Jet(at[g.end], s * along, s2 * along), Jet(along, none, none)
        elif isinstance(g, Gear):
            w, e = (wheels.mesh_rates(g, lambda name, k=k: links.get(name, still)[k])
                    for k in (1, 2))  # fmt: skip
            links[g.link] = Jet(directions[g.link], w, e)
        elif isinstance(g, Rack | Pinion):
            on = links.get(g.guide.on if isinstance(g, Rack) else g.carrier, still)
            if isinstance(g, Rack):
                s, s2 = (g.side * np.asarray(g.radius) * (links.get(g.to, still)[k] - on[k]) for k in (1, 2))
                along, base = directions[g.link], points[g.guide.through]
                under = carried(base, on, (at[g.end] - base.r) / on.r)
                points[g.end] = Jet(at[g.end], under.v + s * along, under.a + (s2 + 2j * on.v * s) * along)
                links[g.link] = Jet(along, on.v, on.a)
            else:
                along, pin = directions[g.to], points[g.at]
                base = points[g.through or g.pivot]
                under = carried(base, on, (pin.r - base.r) / on.r)
                s = ((pin.v - under.v) / along).real
                s2 = ((pin.a - under.a - 2j * on.v * s * along) / along).real
                rolled = g.side / np.asarray(g.radius)
                links[g.link] = Jet(directions[g.link], on.v + rolled * s, on.a + rolled * s2)
        elif isinstance(g, RRP):
            b, rod, along = points[g.from_], at[g.end] - at[g.from_], directions[g.block]
            on, base = links.get(g.guide.on, still), points[g.guide.through]
            there = carried(base, on, (at[g.end] - base.r) / on.r)  # the point of the guide's link under the pin
            w, s = _solve(1j * rod, -along, there.v - b.v)
            e, s2 = _solve(1j * rod, -along, there.a + 2j * on.v * s * along - b.a + w**2 * rod)
            points[g.end] = Jet(at[g.end], there.v + s * along, there.a + (s2 + 2j * on.v * s) * along)
            links[g.link], links[g.block] = Jet(directions[g.link], w, e), Jet(along, on.v, on.a)
        elif isinstance(g, PRP | RPP):
            name = g.meet if isinstance(g, PRP) else g.end
            pairs = [(slot.through, slot.on) for slot in (g.slots if isinstance(g, PRP) else (g.guide,))]
            pairs += [] if isinstance(g, PRP) else [(g.from_, g.guide.on)]
            under, turn, along = [], [], []
            for block, (through, on) in zip(g.link_names(), pairs, strict=True):
                base, turning = points[through], links.get(on, still)
                under.append(carried(base, turning, (at[name] - base.r) / turning.r))
                turn.append(turning)
                along.append(directions[block])
                links[block] = Jet(directions[block], turning.v, turning.a)
            s, t = _solve(along[0], -along[1], under[1].v - under[0].v)
            extra = [2j * turning.v * rate * t_ for turning, rate, t_ in zip(turn, (s, t), along, strict=True)]
            s2, _ = _solve(along[0], -along[1], under[1].a + extra[1] - under[0].a - extra[0])
            points[name] = Jet(at[name], under[0].v + s * along[0], under[0].a + extra[0] + s2 * along[0])
        elif isinstance(g, RPR):
            a, b, u = points[g.about], points[g.from_], directions[g.link]
            d = b.r - a.r
            w, s = _solve(1j * d, u, b.v - a.v)
            e, _ = _solve(1j * d, u, b.a - a.a + w**2 * d - 2j * w * s * u)
            links[g.link] = links[g.block] = Jet(u, w, e)
        elif isinstance(g, General):
            _general_rates(g, in_axes(g, mechanism), at, directions, points, links, still, phi)
        else:
            a, b = points[g.from_], points[g.to]
            p, q = at[g.meet] - a.r, at[g.meet] - b.r
            w1, w2 = _solve(1j * p, -1j * q, b.v - a.v)
            e1, e2 = _solve(1j * p, -1j * q, b.a - a.a + w1**2 * p - w2**2 * q)
            for name, w, e in zip(g.links, (w1, w2), (e1, e2), strict=True):
                links[name] = Jet(directions[name], w, e)
        for name, (origin, far) in held.items():
            places = bodies[name].places
            if far is not None and far not in points:
                places = {far: length[name] + 0j, **places}
            for point, place in places.items():
                points[point] = carried(points[origin], links[name], place)
    return Rates(points, links)


def _general_rates(g: General, places, at, directions, points, links, still, phi) -> None:
    """Velocities, then accelerations, of all links of a group of higher class and along its slots: linear systems."""
    names, count = [link for link, _ in g.members], 3 * len(g.members) + len(g.slots)
    origin = {link: at[pins[0]] for link, pins in g.members}
    holders: dict[str, list[str]] = {}
    for link, pins in g.members:
        for p in pins:
            holders.setdefault(p, []).append(link)
    solved: list[dict[str, tuple[Any, Any]]] = []
    slides: list[list[Any]] = []

    def moved(link: str, arm: Any, order: int) -> Any:
        """The known part of the second derivative of a point of a link: the part from its velocity."""
        return -(solved[0][link][1] ** 2) * arm if order else 0 * arm

    for order in (0, 1):
        matrix, right, row = np.zeros((*np.shape(still.v), count, count)), np.zeros((*np.shape(still.v), count)), 0

        def put(link, arm, sign, row, matrix=matrix):
            i = 3 * names.index(link)
            matrix[..., row, i] += sign
            matrix[..., row + 1, i + 1] += sign
            matrix[..., row, i + 2] += sign * (1j * arm).real
            matrix[..., row + 1, i + 2] += sign * (1j * arm).imag

        def give(value, row, right=right):
            right[..., row] += value.real
            right[..., row + 1] += value.imag

        for p, every in holders.items():
            for link in every[p not in g.outer :]:
                arm = places[link][p] * directions[link]
                put(link, arm, 1.0, row)
                give(-moved(link, arm, order), row)
                if p in g.outer:
                    give((points[p].v, points[p].a)[order], row)
                else:
                    other = places[every[0]][p] * directions[every[0]]
                    put(every[0], other, -1.0, row)
                    give(moved(every[0], other, order), row)
                row += 2
        for k, slot in enumerate(g.slots):
            on, block, along = slot.guide.on, slot.block, directions[slot.block]
            put(block, 0j * along, 1.0, row)
            matrix[..., row, count - len(g.slots) + k] -= along.real
            matrix[..., row + 1, count - len(g.slots) + k] -= along.imag
            if on in names:
                arm, w = origin[block] - origin[on], solved[0][on][1] if order else 0.0
                put(on, arm, -1.0, row)
                give(moved(on, arm, order), row)
                matrix[..., row + 2, 3 * names.index(on) + 2] = -1.0
            else:
                base, turning = points[slot.guide.through], links.get(on, still)
                arm, w = origin[block] - base.r, turning.v
                give((base.v + 1j * w * arm, base.a + (1j * turning.a - w**2) * arm)[order], row)
                right[..., row + 2] += (turning.v, turning.a)[order]
            if order:
                give(2j * w * slides[0][k] * along, row)
            matrix[..., row + 2, 3 * names.index(block) + 2] = 1.0
            row += 3
        for gear in g.gears:
            for name, factor in wheels.factors(gear).items():
                if name in names:
                    matrix[..., row, 3 * names.index(name) + 2] += factor
            if isinstance(gear, Rack):
                k = [slot.block for slot in g.slots].index(gear.link)
                matrix[..., row, count - len(g.slots) + k] = 1.0
            row += 1
        if g.drive is not None:
            k = g.driven_slot()
            if k is not None:
                matrix[..., row, count - len(g.slots) + k] = 1.0
            for name, sign in ((g.drive.link, 1.0), (g.drive.on, -1.0)) if k is None else ():
                if name != "frame":
                    matrix[..., row, 3 * names.index(name) + 2] = sign
            right[..., row] = drive_rates(g.drive, phi)[order]
            row += 1
        assert row == count
        x = np.linalg.solve(matrix, right[..., None])[..., 0]
        solved.append(
            {link: (x[..., 3 * i] + 1j * x[..., 3 * i + 1], x[..., 3 * i + 2]) for i, link in enumerate(names)}
        )
        slides.append([x[..., count - len(g.slots) + k] for k in range(len(g.slots))])
    for link, pins in g.members:
        (v, w), (a, e) = solved[0][link], solved[1][link]
        links[link] = Jet(directions[link], w, e)
        for p in pins:
            if p not in g.outer:
                arm = places[link][p] * directions[link]
                points[p] = Jet(origin[link] + arm, v + 1j * w * arm, a + (1j * e - w**2) * arm)


def _solve(a, b, right):
    """Real x, y with a x + b y = right, all complex."""
    matrix = np.stack([np.stack([a.real, b.real], -1), np.stack([a.imag, b.imag], -1)], -2)
    found = np.linalg.solve(matrix, np.stack([right.real, right.imag], -1)[..., None])[..., 0]
    return found[..., 0], found[..., 1]


def active(load, phi, cycle) -> Any:
    """One where a load acts: half-open window, modulo the cycle."""
    if load.window is None:
        return 1.0 + 0.0 * phi
    on, off = float(load.window.on), float(load.window.off)
    return 1.0 * ((phi - on) % cycle < (off - on) % cycle)


def applied(scene, phi, here: Rates, m=np) -> dict[str, tuple[str, str, Any, Any]]:
    """Weights and loads by name: link, point, force (complex) and couple."""
    n = reader(m)
    gravity = n(scene.gravity.x) + 1j * n(scene.gravity.y)
    found = {}
    for name, b in numbers(scene.mechanism, m).bodies.items():
        found[f"weight of {name}"] = (name, next(iter(b.places)), b.mass * gravity + 0 * phi, 0 * phi)
    for load in scene.loads:
        on = active(load, phi, scene.cycle)
        force, couple = 0j * phi, 0.0 * phi
        if isinstance(load, Force):
            force = (n(load.force.x) + 1j * n(load.force.y)) * on
        elif isinstance(load, OpposingForce):
            v = here.points[load.point].v
            force = -n(load.magnitude) * on * v / (abs(v) + (v == 0))
        elif isinstance(load, Torque):
            couple = n(load.torque) * on
        else:
            assert isinstance(load, OpposingTorque)
            w = here.links[load.link].v
            couple = -n(load.magnitude) * on * w / (abs(w) + (w == 0))
        found[load.name] = (load.link, load.point, force, couple)
    return found


class Reduction(NamedTuple):
    """Reduced inertia with its slope, and reduced torque with the share of each load."""

    inertia: Any
    slope: Any
    torque: Any
    shares: dict[str, Any]


def reduction(scene, phi, m=np, here: Rates | None = None) -> Reduction:
    """Kinetic energy and power at unit crank speed; with the rates there, if they are not in NumPy."""
    phi = reader(m)(phi)
    here = rates(scene.mechanism, phi) if here is None else here
    shaft = here.links[scene.mechanism.driving_link]
    wheel = reader(m)(scene.mechanism.flywheel.inertia)
    inertia = wheel * shaft.v**2
    slope = 2 * wheel * shaft.v * shaft.a
    for name, b in numbers(scene.mechanism, m).bodies.items():
        s, turn = here.points[next(iter(b.places))], here.links[name]
        inertia = inertia + b.mass * abs(s.v) ** 2 + b.inertia * turn.v**2
        slope = slope + 2 * b.mass * (s.v.conjugate() * s.a).real + 2 * b.inertia * turn.v * turn.a
    shares = {}
    for name, (link, point, force, couple) in applied(scene, phi, here, m).items():
        velocity = here.points[point].v if point else 0j
        share = (force.conjugate() * velocity).real + couple * here.links[link].v
        name = "gravity" if name.startswith("weight of ") else name
        shares[name] = shares.get(name, 0.0) + share
    return Reduction(inertia, slope, sum(shares.values(), 0 * phi), shares)


def jumps(scene) -> np.ndarray:
    """Crank angles where a load switches or reverses, sorted, in [0, cycle)."""
    found = [float(end) for load in scene.loads if load.window for end in (load.window.on, load.window.off)]
    scan = np.linspace(0.0, scene.cycle, 4001) + 1e-4
    for load in (load for load in scene.loads if load.opposing):

        def along(phi, load=load):
            here = rates(scene.mechanism, np.atleast_1d(phi))
            return here.points[load.point].v if load.point else here.links[load.link].v + 0j

        v = along(scan)
        for i in np.flatnonzero((v[1:] * v[:-1].conjugate()).real < 0):
            before = v[i].conjugate()
            found.append(brentq(lambda p, a=along, b=before: (a(p) * b)[0].real, scan[i], scan[i + 1], xtol=1e-14))
    return np.unique(np.mod(found, scene.cycle))
