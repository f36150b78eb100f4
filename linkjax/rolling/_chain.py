"""Bodies of a chain: positions, radii, contacts, and points of the working surfaces.

No step from body to body is needed: an inversion makes eccentric rings concentric, and the bodies then have equal
angular steps. The map of their angles uses half angles, tan(φ/2) = tan(θ/2) / q; it has no singular point and no
branch, and is smooth in the eccentricity, also at zero.
"""

from __future__ import annotations

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._types import Scalar, as_float
from linkjax._vec import Vec, unit
from linkjax.rolling._design import Rolling, half_angle_ratio, half_step, spread

Bodies = Float[Array, " bodies"]


class Chain(eqx.Module):
    """Positions of a chain (m); vectors have one entry per body, the centres of the rings are single points.

    `angles` (rad, increasing) are the polar angles of the body centres about the centre of the inner ring, from the
    line of centres, and `directions` the corresponding unit vectors. `neighbour_contacts` are the contacts of each body
    with the next, and of the last with the first.
    """

    angles: Bodies
    radii: Bodies
    directions: Vec
    centres: Vec
    inner_contacts: Vec
    outer_contacts: Vec
    neighbour_contacts: Vec
    inner_centre: Vec
    outer_centre: Vec


class Rings(eqx.Module):
    """Points of the working surfaces of both rings (m)."""

    inner: Vec
    outer: Vec


class Ellipse(eqx.Module):
    """Ellipse of the body centres: centre, semi-axes (m) along and across the line of centres; foci at ring centres."""

    centre: Vec
    major: Scalar
    minor: Scalar
    foci: tuple[Vec, Vec]

    def at(self, angle: Any) -> Vec:
        """The point of the ellipse at the eccentric anomaly `angle` (rad)."""
        direction = unit(as_float(angle))
        return self.centre + Vec(self.major * direction.x, self.minor * direction.y)


def chain(design: Rolling) -> Chain:
    """The chain in the axes of the design (origin at the centre of the inner ring, x along the line of centres).

    After the inversion that makes the rings concentric, the bodies are at equal angular steps. Each body therefore
    touches both rings and the previous body for all rings; the gap between the last and the first is `closure_gap`. A
    body at the angle φ has its centre at the radius ρ = ((R + r)² - e²) / (2 (R + r) - 2 e cos φ) and the radius ρ - r.
    If the rings touch or intersect, the values are finite placeholders; `margins` then shows the violation.
    """
    angles = _angles(design, design.bodies)
    inner, outer, e = design.inner_radius, design.outer_radius, design.eccentricity
    u = unit(angles)
    radii = safe_divide(spread(design) + 2 * inner * e * u.x, 2 * (inner + outer - e * u.x))
    middle, far = u * (inner + radii), Vec(e, jnp.zeros_like(e))
    beyond = middle - far
    reach = safe_sqrt(beyond.squared(), 1.0)
    following = jax.tree.map(lambda part: jnp.roll(part, -1), (middle, radii))
    between = middle + (following[0] - middle) * safe_divide(radii, radii + following[1])
    return Chain(angles, radii, u, middle, u * inner, far + beyond * (outer / reach), between,
                 Vec(jnp.zeros_like(e), jnp.zeros_like(e)), far)  # fmt: skip


def closure_gap(design: Rolling) -> Scalar:
    """Angular gap (rad) between the last body and the first, about the centre of the inner ring; negative if they
    overlap. It is 2π turns minus the sum of the `bodies` angular steps from body to body.
    """
    angles = _angles(design, design.bodies + 1)
    return 2 * math.pi * design.turns - (angles[-1] - angles[0])


def closing_clearance(design: Rolling) -> Scalar:
    """Distance (m) between the surfaces of the last body and the first; negative if they overlap."""
    made = chain(design)
    ends = Vec(made.centres.x[-1] - made.centres.x[0], made.centres.y[-1] - made.centres.y[0])
    return safe_sqrt(ends.squared()) - made.radii[-1] - made.radii[0]


def clearances(design: Rolling) -> Float[Array, "bodies others"]:
    """Distances (m) between the surfaces of non-adjacent bodies; negative if they overlap.

    Row i holds the distances from body i to bodies i + 2, i + 3, …, without itself and its two neighbours; a chain of
    three has none. In a chain of several turns some are always negative: its bodies must move in different planes.
    """
    made = chain(design)
    count = design.bodies
    other = (jnp.arange(count)[:, None] + jnp.arange(2, count - 1)[None, :]) % count
    apart = [part[:, None] - part[other] for part in (made.centres.x, made.centres.y)]
    return safe_sqrt(Vec(*apart).squared()) - made.radii[:, None] - made.radii[other]


def centre_curve(design: Rolling) -> Ellipse:
    """Ellipse of the body centres: its semi-major axis is (R + r) / 2, its foci are the centres of the rings."""
    e, zero = design.eccentricity, jnp.zeros_like(design.eccentricity)
    major = 0.5 * (design.inner_radius + design.outer_radius)
    minor = safe_sqrt((major - 0.5 * e) * (major + 0.5 * e))
    return Ellipse(Vec(0.5 * e, zero), major, minor, (Vec(zero, zero), Vec(e, zero)))


def surface_points(made: Chain, angle: Any) -> Vec:
    """A point on the working surface of every body, at `angle` (rad, one or one per body) from the outward direction.

    The outward direction is from the centre of the inner ring to the centre of the body. The contact with the inner
    ring is at π; that with the outer ring is at zero if there is no eccentricity.
    """
    return made.centres + unit(as_float(angle)).turned(made.directions) * made.radii


def ring_points(design: Rolling, angle: Any) -> Rings:
    """Points on the working surfaces of both rings, at `angle` (rad) about the centre of each ring."""
    direction = unit(as_float(angle))
    far = Vec(design.eccentricity, jnp.zeros_like(design.eccentricity))
    return Rings(direction * design.inner_radius, far + direction * design.outer_radius)


def moved(made: Chain, carrier: Any, rest: Vec | None = None) -> Chain:
    """The chain after the line of centres has turned by `carrier` (rad) about the point `rest`, in fixed axes.

    Bodies of fixed size keep their positions relative to the line of centres. `rest` is the centre of the ring whose
    axis is fixed in the frame; default: the inner ring.
    """
    rest, heading = made.inner_centre if rest is None else rest, unit(as_float(carrier))
    directions = made.directions.turned(heading)
    turned = jax.tree.map(
        lambda at: rest + (at - rest).turned(heading) if isinstance(at, Vec) else at,
        made, is_leaf=lambda at: isinstance(at, Vec),
    )  # fmt: skip
    return eqx.tree_at(lambda each: each.directions, turned, directions)


def _angles(design: Rolling, count: int) -> Float[Array, " count"]:
    """Polar angles of `count` bodies about the inner ring centre: equal steps for concentric rings, mapped back."""
    q, step = half_angle_ratio(design), 2 * half_step(design)
    half = unit(0.5 * design.start)
    begin = design.start - 2 * jnp.arctan2((1 - q) * half.x * half.y, half.x**2 + q * half.y**2)
    even = begin + step * jnp.arange(count, dtype=step.dtype)
    half = unit(0.5 * even)
    return even + 2 * jnp.arctan2((1 - q) * half.x * half.y, q * half.x**2 + half.y**2)
