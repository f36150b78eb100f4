# pyright: reportAttributeAccessIssue=false
"""Gears in mesh by an independent method: their invariants in complex numbers, and forces as contacts that only press
(teeth) or strands that only pull (belts).

linkjax uses the size of a tangential force; here contacts have a force of one sign along the normal of one of two
flanks, and the solution determines which flank.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from linkjax.groups import Gear, Pinion, Rack, Teeth

WHEELS = (Gear, Rack, Pinion)


def mesh_angle(g: Gear, angle, n) -> Any:
    """Angle of a gear from those of the others; `n` reads a number."""
    if isinstance(g.mesh, Teeth):
        ratio = n(g.mesh.teeth[1]) / n(g.mesh.teeth[0]) * (1 if g.mesh.internal else -1)
    else:
        ratio = n(g.mesh.other) / n(g.mesh.radius) * (-1 if g.mesh.crossed else 1)
    seen = angle(g.to) - angle(g.carrier)
    return n(g.phase) + angle(g.carrier) + ratio * seen


def left_open(g: Gear | Rack, angle, ways, n) -> Any:
    """Closure errors of gears in mesh, from angles and from the displacements of blocks."""
    if isinstance(g, Gear):
        return angle(g.link) - mesh_angle(g, angle, n)
    return ways[g.link] - n(g.start) - g.side * n(g.radius) * (angle(g.to) - angle(g.guide.on))


def factors(g: Gear | Rack) -> dict[str, Any]:
    """The same as factors of the rates of links; the factor of the displacement is one."""
    if isinstance(g, Rack):
        arc = g.side * np.asarray(g.radius)
        return {g.to: -arc, g.guide.on: arc}
    found = {name: mesh_rates(g, lambda one, name=name: float(one == name)) for name in (g.to, g.carrier)}
    return {g.link: 1.0, **{name: -factor for name, factor in found.items()}}


def mesh_rates(g, rate) -> Any:
    """The same relation between rates of any order, without the phase."""
    if isinstance(g.mesh, Teeth):
        first, second = g.mesh.teeth
        return rate(g.carrier) + (1 if g.mesh.internal else -1) * second / first * (rate(g.to) - rate(g.carrier))
    arc = np.asarray(g.mesh.other) * (rate(g.to) - rate(g.carrier))  # of the belt
    return rate(g.carrier) + (-1 if g.mesh.crossed else 1) * arc / np.asarray(g.mesh.radius)


class Side(NamedTuple):
    """One way to carry load: point and direction of the force on the gear, the other loads, and the least size."""

    at: Any
    along: Any
    besides_at: Any
    besides: Any
    least: Any


class Contact(NamedTuple):
    """The load that the link `by` exerts on `link`, in one of two ways, about the point `about`."""

    name: str
    link: str
    by: str
    about: str
    sides: tuple[Side, Side]


def contact(g, points, directions, m, n) -> Contact:
    """The contact of a group; points and directions are complex arrays, or mpmath numbers (`m`), read by `n`."""
    name = f"{g.link}.mesh"
    if isinstance(g, Gear) and not isinstance(g.mesh, Teeth):
        return Contact(name, g.link, g.to, g.pivot, _strands(g, points, m, n))
    if isinstance(g, Gear):
        mine, other = g.mesh.teeth
        span = points[g.centre] - points[g.pivot]
        towards = span / abs(span)
        if not g.mesh.internal:
            place = points[g.pivot] + span * mine / (mine + other)
            normal = -towards  # the other gear is on that side
        elif mine < other:
            place = points[g.pivot] - span * mine / (other - mine)
            normal = towards
        else:
            place = points[g.pivot] + span * mine / (mine - other)
            normal = towards
        lean, about = n(g.mesh.pressure_angle), g.pivot
    elif isinstance(g, Rack):
        normal = -1j * g.side * directions[g.link]
        place = points[g.centre] + normal * n(g.radius)
        lean, about = n(g.pressure_angle), g.end
    else:
        normal = 1j * g.side * directions[g.to]
        place = points[g.pivot] - normal * n(g.radius)
        lean, about = n(g.pressure_angle), g.pivot
    flanks = [normal * 1j * sign * m.exp(-1j * sign * lean) for sign in (1, -1)]  # towards the inside of the link
    none = 0 * place
    one, two = (Side(place, flank, place, none, 0.0) for flank in flanks)
    return Contact(name, g.link, g.to, about, (one, two))


def _strands(g: Gear, points, m, n) -> tuple[Side, Side]:
    """The two straight strands of a belt, either of which may be the tight one."""
    mine, other, slack = n(g.mesh.radius), n(g.mesh.other), n(g.mesh.tension)
    span = points[g.centre] - points[g.pivot]
    strands = []
    for sign in (1, -1):  # the tangent that touches the gear on its left, seen along the line of centres; and right
        end = -other if g.mesh.crossed else other
        out = span / abs(span) * m.exp(1j * sign * m.acos((mine - end) / abs(span)))  # from centre to tangent point
        here, there = points[g.pivot] + mine * out, points[g.centre] + end * out
        strands.append((here, (there - here) / abs(there - here)))
    (a, u), (b, v) = strands
    return Side(a, u, b, slack * v, slack), Side(b, v, a, slack * u, slack)
