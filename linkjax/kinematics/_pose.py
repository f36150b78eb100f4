"""Pose of the whole mechanism at one crank angle, with first and second kinematic coefficients in closed form."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._search import TURN_SCAN
from linkjax._tree import node
from linkjax._types import Scalar
from linkjax._vec import Vec
from linkjax.groups import (
    RRP,
    RRR,
    AbstractGroup,
    Along,
    CountedTurns,
    Gear,
    General,
    LinkState,
    Margin,
    Path,
    Pinion,
    PointState,
    Rack,
    at_rest,
    branch_path,
    carried,
    closed_to,
    counted_turns,
    followed,
)
from linkjax.kinematics._path import path_of
from linkjax.mechanism import Lump, Mechanism, links_of, lumps

STEPS = 360  # per turn of the path of a group of higher class: five Newton steps then suffice near singular positions


@node
class Prepared:
    """A mechanism with the reference paths of its groups, one a group, None for those that need none; made by
    `prepared`. Paths belong to the numbers of this mechanism, and have no derivatives.

    A `Mechanism` holds numbers and topology alone. When groups held their paths, a mechanism whose length was replaced
    in the tree kept the path of the old length without notice.
    """

    mechanism: Mechanism
    paths: tuple[Path | None, ...]

    def along(self) -> dict[str, Along]:
        """The groups by name, each with its path."""
        groups = named_groups(self.mechanism).items()
        return {name: Along(group, path) for (name, group), path in zip(groups, self.paths, strict=True)}


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


def pose(mechanism: Mechanism | Prepared, phi: Scalar) -> Pose:
    """Positions and kinematic coefficients of every point and link at the crank angle `phi` (rad).

    `phi` and all results are scalars; use `jax.vmap` for many angles or designs. Kinematic coefficients are the first
    and second derivatives with respect to `phi`. Positions are in m; coefficients are in m for points and dimensionless
    for links. If a group cannot be assembled at `phi`, the values are finite placeholders and one of its `margins` is
    negative. Pure and differentiable with respect to `phi` and the design.
    """
    return _pose(prepared(mechanism), jnp.asarray(phi))


@jax.jit  # traced once per topology, however often it is used inside larger functions
def _pose(ready: Prepared, phi: Scalar) -> Pose:
    return _of_groups(ready.mechanism, list(ready.along().values()), phi)


def _of_groups(mechanism: Mechanism, groups: Sequence[Along], phi: Scalar) -> Pose:
    """Pose of the first groups of a mechanism, in order of assembly."""
    points = {name: at_rest(at) for name, at in mechanism.fixed.items()}
    links: dict[str, LinkState] = {}
    bodies = {}
    for along in groups:
        group = along.group
        states, pins = along.solve(links_of(mechanism, group), links, points, phi)
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


def plain(given: Mechanism | Prepared) -> Mechanism:
    """The mechanism, without paths. Raises `TypeError` for anything else, such as a scene, with the remedy."""
    mechanism = given.mechanism if isinstance(given, Prepared) else given
    if not isinstance(mechanism, Mechanism):
        whole = isinstance(getattr(given, "mechanism", None), Mechanism | Prepared)
        remedy = "scene.mechanism" if whole else "a Mechanism, e.g. from lj.library"
        raise TypeError(f"a Mechanism is needed, not {type(given).__name__}; write {remedy}")
    return mechanism


def check_cycle(cycle_turns: int) -> None:
    """Raise `ValueError` unless the number of crank turns in a cycle is an integer of one or more."""
    if not isinstance(cycle_turns, int) or cycle_turns < 1:
        raise ValueError(f"cycle_turns is {cycle_turns!r}; write an integer of 1 or more")


def prepared(mechanism: Mechanism | Prepared, cycle_turns: int | None = None) -> Prepared:
    """The mechanism with reference paths over `cycle_turns` turns of the crank; unchanged if it has them.

    Groups of higher class need a path, and so do dyads that continue through change points and gears in mesh with links
    whose revolutions must be counted. It leads from the sketch to crank angle zero and on in small steps. By default it
    takes as many turns as the motion law of the driver, or one.

    Prepare a mechanism once if it is evaluated many times: all functions of a mechanism also take it prepared. A path
    has no derivatives: it only gives the start of Newton's method. It belongs to the dimensions from which it was
    computed, so a mechanism with other numbers must be prepared again.
    """
    made = plain(mechanism)
    law = made.driver.follows()
    cycle_turns = max(cycle_turns or 1, 1 if law is None else round(law.period() / (2 * math.pi)))
    if isinstance(mechanism, Prepared) and all(
        path is None or path.cycle_turns % cycle_turns == 0 for path in mechanism.paths
    ):
        return mechanism
    needed = followed(made.groups)
    return Prepared(made, _paths(made, cycle_turns) if needed else (None,) * len(made.groups))


@functools.partial(jax.jit, static_argnames="cycle_turns")
def _paths(mechanism: Mechanism, cycle_turns: int) -> tuple[Path | None, ...]:
    """The path of every group, None for those that need none."""
    found: list[Along] = []
    needed, fixed = followed(mechanism.groups), jax.lax.stop_gradient(mechanism)
    for number, group in enumerate(fixed.groups):

        def before(phi, so_far=tuple(found)):
            here = _of_groups(fixed, so_far, phi)
            return here.links, here.points, _closes(fixed, so_far, here, phi)

        path = _path(group, fixed, before, cycle_turns) if number in needed else None
        found.append(Along(group, jax.lax.stop_gradient(path)))
    return tuple(along.path for along in found)


def _path(group: AbstractGroup, fixed: Mechanism, before: Callable, cycle_turns: int) -> Path:
    """The path of a followed group; `before` gives the states that precede it, and whether these can be assembled."""
    angles, counting = (
        jnp.linspace(0.0, 2 * math.pi * cycle_turns, steps * cycle_turns + 1) for steps in (STEPS, TURN_SCAN)
    )
    if isinstance(group, General):
        turns = _turns(group, before, counting, cycle_turns)
        return path_of(group, fixed.links, before, angles, turns, cycle_turns)
    if isinstance(group, Gear | Rack | Pinion):
        return _turns(group, before, counting, cycle_turns)
    assert isinstance(group, RRR | RRP)
    links = links_of(fixed, group)

    def coordinates(phi, sense):
        states, points, _ = before(phi)
        return group.coordinates(links, states, points, sense)

    return branch_path(lambda phi: group.gaps(links, *before(phi)[:2]), coordinates, cycle_turns)


def _turns(group: General | Gear | Rack | Pinion, before: Callable, angles: Array, cycle_turns: int) -> CountedTurns:
    """The counted rotation of the links that gears or racks follow."""

    def mates(phi):
        (states, _, closes), none = before(phi), jnp.zeros_like(phi)
        still = LinkState(Vec(jnp.ones_like(phi), none), none, none, none)
        return tuple(states.get(name, still) for name in group.mates()), closes

    return counted_turns(*jax.vmap(mates)(angles), angles[1] - angles[0], cycle_turns)


def _closes(mechanism: Mechanism, groups: Sequence[Along], here: Pose, phi: Array) -> Array:
    """Whether these groups can be assembled, at least nearly, as at a change point."""
    found = [_margins(mechanism, along, here, phi) for along in groups]
    every = [side.value > -closed_to(phi.dtype) for sides in found for side in sides.values()]
    return jnp.all(jnp.stack(every)) if every else jnp.asarray(True)


def before_group(
    mechanism: Mechanism | Prepared, number: int, phi: Scalar
) -> tuple[dict[str, LinkState], dict[str, PointState]]:
    """States of the links and points that precede the group with this number."""
    here = jax.jit(lambda ready, phi: _of_groups(ready.mechanism, list(ready.along().values())[:number], phi)[:2])(
        prepared(mechanism), phi
    )
    return here[1], here[0]


def margins(mechanism: Mechanism | Prepared, phi: Scalar) -> dict[str, dict[str, Margin]]:
    """Signed margins of every group to its singular positions at the crank angle `phi` (rad).

    Returns {group: {side: `Margin`}}, e.g. `margins(mechanism, 0.5)["coupler-rocker"]["stretched"]`. A margin is
    dimensionless: positive where the group can be assembled, zero in the singular position, and negative where the
    group cannot be assembled. It comes with its first and second derivatives, `d` and `dd`, with respect to `phi`.
    `phi` and all results are scalars; use `jax.vmap` for many angles or designs.
    """
    ready = prepared(mechanism)
    return margins_of_pose(ready, pose(ready, phi), phi)


def margins_of_pose(ready: Prepared, here: Pose, phi: Scalar) -> dict[str, dict[str, Margin]]:
    """The margins for a given pose; see `margins`."""
    return {name: _margins(ready.mechanism, along, here, phi) for name, along in ready.along().items()}


def _margins(mechanism: Mechanism, along: Along, here: Pose, phi: Scalar) -> dict[str, Margin]:
    return along.margins(links_of(mechanism, along.group), here.links, here.points, phi)


def named_groups(mechanism: Mechanism) -> dict[str, AbstractGroup]:
    """The groups by name; a name joins the names of the links, e.g. `link4-rocker`."""
    return {"-".join(g.link_names()): g for g in mechanism.groups}


def transmission_angles(mechanism: Mechanism | Prepared, phi: Scalar) -> dict[str, Array]:
    """Transmission angle (rad, 0…π) of every dyad at the crank angle `phi` (rad); π/2 is best, 0 and π are singular.

    Returns {group: angle}. The angle is measured between the two links of an RRR, between the rod and the normal of the
    guide in an RRP, between the line from pivot to pin and the normal of the guide in an RPR, between the two slots of
    a PRP, and between the slot and the guide in an RPP. Groups of other kinds are not included. `phi` and all results
    are scalars; use `jax.vmap` for many angles or designs. If a group cannot be assembled, its angle is a finite
    placeholder.
    """
    return transmission_of_pose(plain(mechanism), pose(mechanism, phi))


def transmission_of_pose(mechanism: Mechanism, here: Pose) -> dict[str, Array]:
    """The transmission angles for a given pose; see `transmission_angles`."""
    angles = {name: group.transmission(here.links, here.points) for name, group in named_groups(mechanism).items()}
    return {name: angle for name, angle in angles.items() if angle is not None}
