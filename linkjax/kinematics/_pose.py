"""Pose of the whole mechanism at one crank angle, with first and second kinematic coefficients in closed form."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import Scalar
from linkjax._vec import Vec
from linkjax.groups import (
    RRP,
    RRR,
    AbstractGroup,
    Gear,
    General,
    LinkState,
    Margin,
    Path,
    Pinion,
    PointState,
    Rack,
    Track,
    Winding,
    at_rest,
    carried,
    closed_to,
    course_of,
    followed,
    unwound,
    with_path,
)
from linkjax.kinematics._path import path_of
from linkjax.mechanism import Lump, Mechanism, lumps

STEPS = 360  # per turn of the path of a group of higher class: five Newton steps then suffice near singular positions
SCANNED = 120  # per turn, in the search for change points of a dyad
COUNTS = 480  # per turn, to count the revolutions of a link


class Pose(NamedTuple):
    """Points and links of a mechanism at one crank angle.

    `points` include the mass centres (`S1`, `S2`, …) and the counterweights. `bodies[link][point]` is the mass and
    moment of inertia that a link has at a point.
    """

    points: dict[str, PointState]
    links: dict[str, LinkState]
    bodies: dict[str, dict[str, Lump]]

    def heavy(self) -> list[tuple[str, str, Lump]]:
        """All masses, as (link, point, mass and moment of inertia)."""
        return [(link, point, lump) for link, held in self.bodies.items() for point, lump in held.items()]


def pose(mechanism: Mechanism, phi: Scalar) -> Pose:
    """Positions and kinematic coefficients of every point and link at the crank angle `phi` (rad).

    `phi` and all results are scalars; use `jax.vmap` for many angles or designs. Kinematic coefficients are the first
    and second derivatives with respect to `phi`. Positions are in m; coefficients are in m for points and dimensionless
    for links. If a group cannot be assembled at `phi`, the values are finite placeholders and one of its `margins` is
    negative. Pure and differentiable with respect to `phi` and the design.
    """
    return _pose(prepared(mechanism), jnp.asarray(phi))


@jax.jit  # traced once per topology, however often it is used inside larger functions
def _pose(mechanism: Mechanism, phi: Scalar) -> Pose:
    return _of_groups(mechanism, mechanism.groups, phi)


def _of_groups(mechanism: Mechanism, groups: Sequence[AbstractGroup], phi: Scalar) -> Pose:
    """Pose of the first groups of a mechanism, in order of assembly."""
    points = {name: at_rest(at) for name, at in mechanism.fixed.items()}
    links: dict[str, LinkState] = {}
    bodies = {}
    for group in groups:
        states, pins = group.solve(mechanism.held_by(group), links, points, phi)
        links |= states
        points |= pins
        still = group.translating()
        for name, (origin, far) in group.holds().items():
            link = mechanism.links[name]
            body, held = link.actual(), link.held(origin, far)
            if held is not None:
                links[name] = _in_own_axes(links[name], held.axis)
            bodies[name] = lumps(link, body, origin)
            weights = {piece: weight.at for piece, weight in link.counterweights.items()}
            for point, at in {link.centre_name: body.centre, **body.points, **weights}.items():
                if point in points and (point in group.shared() or point in link.pins):
                    continue  # a joint: the link is pinned there
                at = at if held is None else at - held.origin
                points[point] = carried(points[origin], links[name], at, name in still)
    return Pose(points, links, bodies)


def _in_own_axes(link: LinkState, axis: Vec) -> LinkState:
    """State of a link from the state of the line through two of its pins, whose direction on the link is `axis`."""
    angle = None if link.angle is None else link.angle - jnp.atan2(axis.y + 0.0, axis.x)
    return link._replace(u=link.u.turned(Vec(axis.x, -axis.y)), angle=angle)


def check_mechanism(given: Any) -> None:
    """Raise `TypeError` for anything but a mechanism, such as a scene, with the remedy."""
    if not isinstance(given, Mechanism):
        whole = isinstance(getattr(given, "mechanism", None), Mechanism)
        remedy = "scene.mechanism" if whole else "a Mechanism, e.g. from lj.library"
        raise TypeError(f"a Mechanism is needed, not {type(given).__name__}; write {remedy}")


def prepared(mechanism: Mechanism, cycle_turns: int | None = None) -> Mechanism:
    """The mechanism with reference paths over `cycle_turns` turns of the crank; unchanged if it needs none or has them.

    Groups of higher class need a path, and so do dyads that continue through change points and gears in mesh with links
    whose revolutions must be counted. It leads from the sketch to crank angle zero and on in small steps. By default it
    takes as many turns as the motion law of the driver, or one.

    Prepare a mechanism once if it is evaluated many times. A path has no derivatives: it only gives the start of
    Newton's method. It belongs to the dimensions from which it was computed. A mechanism built by its constructor or
    `dataclasses.replace` has no path; one whose leaves are replaced keeps the old path.
    """
    check_mechanism(mechanism)
    groups: list[Any] = [mechanism.groups[number] for number in followed(mechanism.groups)]
    law = mechanism.driver.follows()
    cycle_turns = max(cycle_turns or 1, 1 if law is None else round(law.period() / (2 * math.pi)))
    if all(group.path is not None and group.cycle_turns % cycle_turns == 0 for group in groups):
        return mechanism
    return _prepared(mechanism, cycle_turns)


@functools.partial(jax.jit, static_argnames="cycle_turns")
def _prepared(mechanism: Mechanism, cycle_turns: int) -> Mechanism:
    groups: list[AbstractGroup] = []
    paths: dict[int, Path] = {}
    needed = followed(mechanism.groups)
    fixed = jax.lax.stop_gradient(mechanism)
    angles, counting = (
        jnp.linspace(0.0, 2 * math.pi * cycle_turns, steps * cycle_turns + 1) for steps in (STEPS, COUNTS)
    )
    for group in fixed.groups:
        if len(groups) in needed:

            def before(phi, so_far=tuple(groups)):
                here = _of_groups(fixed, so_far, phi)
                return here.links, here.points, _closes(fixed, so_far, here, phi)

            if isinstance(group, General):
                wound = _winding(group, before, counting) if group.mates() else None
                none = jnp.zeros(0)
                begun = dataclasses.replace(group, path=Track(none, none, none, wound), cycle_turns=cycle_turns)
                path = path_of(begun, fixed.links, before, angles)._replace(wound=wound)
            elif isinstance(group, Gear | Rack | Pinion):
                path = _winding(group, before, counting)
            else:
                path = _course(group, fixed, before, cycle_turns)
            paths[len(groups)] = jax.lax.stop_gradient(path)
            group = with_path(group, paths[len(groups)], cycle_turns)
        groups.append(group)
    made = [
        with_path(group, paths[i], cycle_turns) if i in paths else group for i, group in enumerate(mechanism.groups)
    ]
    return eqx.tree_at(lambda m: m.groups, mechanism, tuple(made))  # the constructor would discard the paths


def _closes(mechanism: Mechanism, groups: Sequence[AbstractGroup], here: Pose, phi: Array) -> Array:
    """Whether these groups can be assembled, at least nearly, as at a change point."""
    found = [group.margins(mechanism.held_by(group), here.links, here.points, phi) for group in groups]
    every = [side.value > -closed_to(phi.dtype) for sides in found for side in sides.values()]
    return jnp.all(jnp.stack(every)) if every else jnp.asarray(True)


def before_group(mechanism: Mechanism, number: int, phi: Scalar) -> tuple[dict[str, LinkState], dict[str, PointState]]:
    """States of the links and points that precede the group with this number."""
    here = jax.jit(lambda m, phi: _of_groups(m, m.groups[:number], phi)[:2])(mechanism, phi)
    return here[1], here[0]


def _course(group: AbstractGroup, fixed: Mechanism, before: Callable, cycle_turns: int) -> Path:
    """The path of a dyad through its change points."""
    assert isinstance(group, RRR | RRP)
    held = fixed.held_by(group)

    def coordinates(phi, sense):
        states, points, _ = before(phi)
        return group.coordinates(held, states, points, sense)

    return course_of(lambda phi: group.gaps(held, *before(phi)[:2]), coordinates, SCANNED, cycle_turns)


def _winding(group: General | Gear | Rack | Pinion, before: Callable, angles: Array) -> Winding:
    """The counted rotation of the links that gears or racks follow."""

    def mates(phi):
        (states, _, closes), none = before(phi), jnp.zeros_like(phi)
        still = LinkState(Vec(jnp.ones_like(phi), none), none, none, none)
        return tuple(states.get(name, still) for name in group.mates()), closes

    return unwound(*jax.vmap(mates)(angles), angles[1] - angles[0])


def margins(mechanism: Mechanism, phi: Scalar) -> dict[str, dict[str, Margin]]:
    """Signed margins of every group to its singular positions at the crank angle `phi` (rad).

    Returns {group: {side: `Margin`}}, e.g. `margins(mechanism, 0.5)["coupler-rocker"]["stretched"]`. A margin is
    dimensionless: positive where the group can be assembled, zero in the singular position, and negative where the
    group cannot be assembled. It comes with its first and second derivatives, `d` and `dd`, with respect to `phi`.
    `phi` and all results are scalars; use `jax.vmap` for many angles or designs.
    """
    mechanism = prepared(mechanism)
    here = pose(mechanism, phi)
    groups = named_groups(mechanism).items()
    return {name: group.margins(mechanism.held_by(group), here.links, here.points, phi) for name, group in groups}


def named_groups(mechanism: Mechanism):
    """The groups by name; a name joins the names of the links, e.g. `link4-rocker`."""
    return {"-".join(g.link_names()): g for g in mechanism.groups}


def transmission_angles(mechanism: Mechanism, phi: Scalar) -> dict[str, Array]:
    """Transmission angle (rad, 0…π) of every dyad at the crank angle `phi` (rad); π/2 is best, 0 and π are singular.

    Returns {group: angle}. The angle is measured between the two links of an RRR, between the rod and the normal of the
    guide in an RRP, between the line from pivot to pin and the normal of the guide in an RPR, between the two slots of
    a PRP, and between the slot and the guide in an RPP. Groups of other kinds are not included. `phi` and all results
    are scalars; use `jax.vmap` for many angles or designs. If a group cannot be assembled, its angle is a finite
    placeholder.
    """
    here = pose(mechanism, phi)
    angles = {name: group.transmission(here.links, here.points) for name, group in named_groups(mechanism).items()}
    return {name: angle for name, angle in angles.items() if angle is not None}
