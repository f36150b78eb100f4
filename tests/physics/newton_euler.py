"""All forces of a machine simultaneously: the Newton-Euler equations of every link as one linear system.

Unknowns are the two components of the force at every pin, normal force and couple of every guide, and the drive torque.
In NumPy for arrays of states, or for one state in mpmath with as many digits as its rates have.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mpmath
import numpy as np

from linkjax.groups import PRP, RPP, RPR, RRP, RRR, Crank, Gear, General, LinearDriver, Pinion, Rack
from tests.physics import oracle, wheels


class Joint(NamedTuple):
    """What `by` exerts on `link`: a force at a point, or normal force and couple of a guide (referred to the point), or
    the drive load of a driver with a motion law, or the load between gears in mesh (referred to the point)."""

    name: str
    point: str
    link: str
    by: str
    guide: bool = False
    drive: bool = False
    mesh: bool = False


def joints(mechanism) -> list[Joint]:
    """Every joint of the machine, once."""
    owner = dict.fromkeys(mechanism.fixed, "frame")
    found: list[Joint] = []
    for g in mechanism.groups:
        if isinstance(g, Crank):
            found.append(Joint(g.pivot, g.pivot, g.link, owner[g.pivot]))
            found += [Joint(f"{g.link}.drive", g.pivot, g.link, "frame", drive=True)] if g.law is not None else []
            owner[g.end] = g.link
        elif isinstance(g, Gear | Pinion):
            found.append(Joint(g.pivot, g.pivot, g.link, owner[g.pivot]))
            owner |= {} if g.end is None else {g.end: g.link}
        elif isinstance(g, Rack):
            found.append(Joint(f"{g.link}.guide", g.end, g.link, g.guide.on, guide=True))
            owner[g.end] = g.link
        elif isinstance(g, LinearDriver):
            found.append(Joint(f"{g.link}.guide", g.end, g.link, "frame", guide=True))
            found.append(Joint(f"{g.link}.drive", g.end, g.link, "frame", drive=True))
            owner[g.end] = g.link
        elif isinstance(g, RRP):
            found += [
                Joint(g.from_, g.from_, g.link, owner[g.from_]),
                Joint(g.end, g.end, g.block, g.link),
                Joint(f"{g.block}.guide", g.end, g.block, g.guide.on, guide=True),
            ]
            owner[g.end] = g.link
        elif isinstance(g, RPR):
            found += [
                Joint(g.about, g.about, g.link, owner[g.about]),
                Joint(g.from_, g.from_, g.block, owner[g.from_]),
                Joint(f"{g.block}.guide", g.from_, g.block, g.link, guide=True),
            ]
            owner[g.end] = g.link
        elif isinstance(g, PRP):
            found += [Joint(f"{b}.guide", g.meet, b, s.on, guide=True) for b, s in zip(g.blocks, g.slots, strict=True)]
            found.append(Joint(g.meet, g.meet, *g.blocks))
            owner[g.meet] = g.blocks[0]
        elif isinstance(g, RPP):
            found += [
                Joint(g.from_, g.from_, g.block, owner[g.from_]),
                Joint(f"{g.block}.guide", g.from_, g.block, g.link, guide=True),
                Joint(f"{g.link}.guide", g.end, g.link, g.guide.on, guide=True),
            ]
            owner[g.end] = g.link
        elif isinstance(g, General):
            holders: dict[str, list[str]] = {}
            for link, pins in g.members:
                for p in pins:
                    holders.setdefault(p, []).append(link)
            for p, every in holders.items():
                by = owner[p] if p in g.outer else every[0]
                found += [Joint(p, p, link, by) for link in every[p not in g.outer :]]
                owner.setdefault(p, every[0])
            first = {link: pins[0] for link, pins in g.members}
            found += [Joint(f"{s.block}.guide", first[s.block], s.block, s.guide.on, guide=True) for s in g.slots]
        else:
            assert isinstance(g, RRR)
            one, two = g.links
            found += [
                Joint(g.from_, g.from_, one, owner[g.from_]),
                Joint(g.to, g.to, two, owner[g.to]),
                Joint(g.meet, g.meet, two, one),
            ]
            owner[g.meet] = one
        for wheel in g.wheels():
            point = wheel.end if isinstance(wheel, Rack) else wheel.pivot
            found.append(Joint(f"{wheel.link}.mesh", point, wheel.link, wheel.to, mesh=True))
        for name in g.link_names():
            link = mechanism.links[name]
            for point in (link.centre_name, *link.point_names()):
                owner.setdefault(point, name)
    return found


class Solution(NamedTuple):
    """Force (complex) and moment on each link at each joint, drive torque along the rotation, and m a of each link."""

    reactions: dict[tuple[str, str], tuple[Any, Any]]
    drive: Any
    momentum_rate: dict[str, Any]
    spin_rate: dict[str, Any]


def solve(scene, phi, speed, acceleration, m=np, here: oracle.Rates | None = None, more=()) -> Solution:
    """Forces at arrays of crank angle, crank speed and acceleration; in mpmath at one, with the rates there. `more` are
    further loads (link, point, force, couple)."""
    n = oracle.reader(m)
    phi, speed, acceleration = (n(x) for x in (phi, speed, acceleration))
    mechanism = scene.mechanism
    here = oracle.rates(mechanism, phi) if here is None else here
    every = [j for j in joints(mechanism) if not (j.drive or j.mesh)]
    bodies = oracle.numbers(mechanism, m).bodies
    row = {name: 3 * i for i, name in enumerate(bodies)}
    size = 3 * len(bodies)
    at, headings = ({name: jet.r for name, jet in jets.items()} for jets in here)
    contacts = [wheels.contact(wheel, at, headings, m, n) for g in mechanism.groups for wheel in g.wheels()]
    assert size == 2 * len(every) + len(contacts) + 1, "as many equations as unknowns"
    shape, dtype = np.shape(phi), object if m is mpmath else float
    matrix, right = np.zeros((*shape, size, size), dtype), np.zeros((*shape, size), dtype)
    centre = {name: here.points[next(iter(b.places))] for name, b in bodies.items()}
    normal = {j.link: 1j * here.links[j.link].r for j in every if j.guide}

    def act(link: str, point: str, column: int, force: Any, couple: Any = 0.0):
        """A unit unknown that gives `force` at the point and `couple`, on a link."""
        if link == "frame":
            return
        arm = here.points[point].r - centre[link].r
        matrix[..., row[link], column] += force.real
        matrix[..., row[link] + 1, column] += force.imag
        matrix[..., row[link] + 2, column] += (arm.conjugate() * force).imag + couple

    none = 0j * phi
    for k, j in enumerate(every):
        units = ((normal[j.link], 0.0), (none, 1.0)) if j.guide else ((none + 1, 0.0), (none + 1j, 0.0))
        for c, (force, couple) in enumerate(units):
            act(j.link, j.point, 2 * k + c, force, couple)
            act(j.by, j.point, 2 * k + c, -force, -couple)
    crank = mechanism.groups[0]
    pace = 1 + 0 * phi  # the first coefficient of the driver
    inside = crank.drive if isinstance(crank, General) else None
    if isinstance(crank, General) and inside is not None:  # between two links, or one link and the frame
        point = dict(crank.members)[inside.link][0]
        along, couple = (none, 1.0) if crank.driven_slot() is None else (here.links[inside.link].r, 0.0)
        act(inside.link, point, size - 1, along, couple)
        act(inside.on, point, size - 1, -along, -couple)
        pace = oracle.drive_rates(inside, phi, m)[0]
    elif isinstance(crank, LinearDriver):
        act(crank.link, crank.end, size - 1, here.links[crank.link].r)
        pace = (here.points[crank.end].v / here.links[crank.link].r).real
    else:
        assert isinstance(crank, Crank)
        act(crank.link, crank.pivot, size - 1, none, float(crank.sense))
        pace = here.links[crank.link].v if crank.law is not None else pace
    rate, spin = {}, {}
    for name, b in bodies.items():
        inertia = b.inertia + (n(mechanism.flywheel.inertia) if name == mechanism.driving_link else 0.0)
        rate[name] = b.mass * (centre[name].a * speed**2 + centre[name].v * acceleration)
        spin[name] = inertia * (here.links[name].a * speed**2 + here.links[name].v * acceleration)
        right[..., row[name] : row[name] + 3] = np.stack([rate[name].real, rate[name].imag, spin[name]], -1)
    for link, point, force, couple in [*oracle.applied(scene, phi, here, m).values(), *more]:
        arm = here.points[point].r - centre[link].r if point else none
        right[..., row[link]] -= force.real
        right[..., row[link] + 1] -= force.imag
        right[..., row[link] + 2] -= (arm.conjugate() * force).imag + couple
    x, meshes = _carried_by(contacts, matrix, right, 2 * len(every), row, centre)
    reactions: dict[tuple[str, str], tuple[Any, Any]] = {}
    for k, j in enumerate(every):
        one, two = x[2 * k : 2 * k + 2]
        force, couple = (one * normal[j.link], two) if j.guide else (one + 1j * two, 0 * one)
        for link, sign in ((j.link, 1), (j.by, -1)):
            if link != "frame":
                old = reactions.get((j.name, link), (none, 0 * phi))
                reactions[j.name, link] = (old[0] + sign * force, old[1] + sign * couple)
    for c, (force, moment) in zip(contacts, meshes, strict=True):
        shift = (here.points[c.about].r.conjugate() * force).imag
        for link, sign in ((c.link, 1), (c.by, -1)):
            if link != "frame":
                reactions[c.name, link] = sign * force, sign * (moment - shift)
    push = x[-1]
    if isinstance(crank, General) and inside is not None:
        turns, at = crank.driven_slot() is None, here.links[inside.link].r
        for link, sign in ((inside.link, 1), (inside.on, -1)):
            if link != "frame":
                force = sign * push * (none if turns else at), sign * push * float(turns)
                reactions[f"{inside.link}.drive", link] = force
    elif isinstance(crank, LinearDriver):
        reactions[f"{crank.link}.drive", crank.link] = push * here.links[crank.link].r, 0 * push
    elif isinstance(crank, Crank) and crank.law is not None:
        reactions[f"{crank.link}.drive", crank.link] = none, push
    return Solution(reactions, push * pace, rate, spin)


def _carried_by(contacts, matrix, right, first, row, centre):
    """The unknowns, and force and moment (about the origin) of every contact, in the one of its two modes whose force
    is not less than its minimum."""
    way = np.zeros((len(contacts), *right.shape[:-1]), dtype=int)

    def chosen(k, parts):
        return parts[0] * (1 - way[k]) + parts[1] * way[k]

    x, wrong = [], np.zeros(1, dtype=bool)
    for _ in range(2 ** len(contacts)):
        a, b = matrix.copy(), right.copy()
        for k, c in enumerate(contacts):
            at, along, beside, besides = (chosen(k, [side[i] for side in c.sides]) for i in range(4))
            for link, sign in ((c.link, 1), (c.by, -1)):
                if link == "frame":
                    continue
                i, g = row[link], centre[link].r
                a[..., i, first + k] += sign * along.real
                a[..., i + 1, first + k] += sign * along.imag
                a[..., i + 2, first + k] += sign * ((at - g).conjugate() * along).imag
                b[..., i] -= sign * besides.real
                b[..., i + 1] -= sign * besides.imag
                b[..., i + 2] -= sign * ((beside - g).conjugate() * besides).imag
        x = _solved(a, b)
        wrong = np.array([x[first + k] < c.sides[0].least - 1e-9 for k, c in enumerate(contacts)])
        if not wrong.any():
            break
        way = np.where(wrong, 1 - way, way)
    assert not wrong.any()
    found = []
    for k, c in enumerate(contacts):
        at, along, beside, besides = (chosen(k, [side[i] for side in c.sides]) for i in range(4))
        force = x[first + k] * along + besides
        moment = (at.conjugate() * along).imag * x[first + k] + (beside.conjugate() * besides).imag
        found.append((force, moment))
    return x, found


def _solved(matrix, right) -> list:
    """The unknowns of linear systems: arrays, or one by one in mpmath."""
    if matrix.dtype == object:
        return list(mpmath.lu_solve(mpmath.matrix(matrix.tolist()), mpmath.matrix(right.tolist())))
    return list(np.moveaxis(np.linalg.solve(matrix, right[..., None])[..., 0], -1, 0))
