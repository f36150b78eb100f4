"""Pose of the whole mechanism at one crank angle, with first and second kinematic coefficients in closed form."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import Scalar
from linkjax._vec import Vec
from linkjax.groups import LinkState, Margin, PointState, at_rest
from linkjax.mechanism import Lump, Mechanism, lumps


class Pose(NamedTuple):
    """Points and links of a mechanism at one crank angle; points include the mass centres (`S1`, `S2`, …) and the
    counterweights. `bodies[link][point]` is what is heavy on a link, and where."""

    points: dict[str, PointState]
    links: dict[str, LinkState]
    bodies: dict[str, dict[str, Lump]]

    def heavy(self) -> list[tuple[str, str, Lump]]:
        """All that is heavy, as (link, point, mass and inertia)."""
        return [(link, point, lump) for link, held in self.bodies.items() for point, lump in held.items()]


def pose(mechanism: Mechanism, phi: Scalar) -> Pose:
    """Positions and kinematic coefficients of every point and link at the crank angle `phi` (rad).

    Pure and of scalar shape: `vmap` it over angles and designs. Positions in m, coefficients in m (points) and
    dimensionless (links). Where a group cannot be assembled the values are finite placeholders and the group's margin
    is negative.
    """
    return _pose(mechanism, jnp.asarray(phi))


@jax.jit  # traced once per topology, however often it is used inside larger functions
def _pose(mechanism: Mechanism, phi: Scalar) -> Pose:
    points = {name: at_rest(at) for name, at in mechanism.fixed.items()}
    links: dict[str, LinkState] = {}
    bodies = {}
    for group in mechanism.groups:
        states, pins = group.solve(mechanism.links, links, points, phi)
        links |= states
        points |= pins
        for name, (origin, _) in group.pins().items():
            link = mechanism.links[name]
            body = link.actual()
            bodies[name] = lumps(link, body, origin)
            weights = {piece: weight.at for piece, weight in link.counterweights.items()}
            for point, at in {link.centre_name: body.centre, **body.points, **weights}.items():
                points[point] = carried(points[origin], states[name], at, name in group.translating())
    return Pose(points, links, bodies)


def carried(origin: PointState, link: LinkState, at: Vec, translating: bool = False) -> PointState:
    """State of a point of a link, `at` in the link's frame."""
    arm = at.turned(link.u).once()
    if translating:
        return PointState(origin.r + arm, origin.dr, origin.ddr)
    return PointState(
        origin.r + arm,
        origin.dr + arm.perp() * link.w,
        origin.ddr + arm.perp() * link.e - arm * (link.w * link.w),
    )


def margins(mechanism: Mechanism, phi: Scalar) -> dict[str, dict[str, Margin]]:
    """Signed margin of every group to its dead positions at `phi`, with derivatives; {group: {side: Margin}}."""
    here = pose(mechanism, phi)
    groups = named_groups(mechanism).items()
    return {name: group.margins(mechanism.links, here.links, here.points) for name, group in groups}


def named_groups(mechanism: Mechanism):
    """Groups by name: their links joined, e.g. `link4-rocker`."""
    return {"-".join(g.link_names()): g for g in mechanism.groups}


def transmission_angles(mechanism: Mechanism, phi: Scalar) -> dict[str, Array]:
    """Transmission angle (rad, 0…π) of every Assur group: between the two links of an RRR, between rod and the normal
    of the guide in an RRP, between the line from pivot to pin and the normal of the guide in an RPR, between the slots
    of a PRP, between slot and guide in an RPP."""
    here = pose(mechanism, phi)
    angles = {name: group.transmission(here.links, here.points) for name, group in named_groups(mechanism).items()}
    return {name: angle for name, angle in angles.items() if angle is not None}
