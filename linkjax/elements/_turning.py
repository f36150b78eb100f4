"""Elements that turn: journal, thrust ring, gripping cam.

Source: the textbook's chapter on friction, formulas (7-3) to (7-8).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import known
from linkjax.elements._equivalent import journal_friction
from linkjax.elements._way import RIGHT, Element, Way, checked, forward, friction_angle, refuse

FACES = ("unworn", "run-in")


class Journal(NamedTuple):
    """A journal: friction `torque` (N m), the radius of its friction `circle` (m) and the equivalent coefficient
    `friction`; for a driving force at a distance from the axis its `efficiency`, and the `margin` (m) outside of the
    circle: it locks where that is zero or negative. Both are NaN where no distance is given."""

    torque: Array
    circle: Array
    friction: Array
    efficiency: Array
    margin: Array


class ThrustRing(NamedTuple):
    """A thrust face: friction `torque` (N m), and the radius (m) at which the whole force of friction would have it."""

    torque: Array
    radius: Array


def journal(radius: Any, friction: Any, load: Any = 1.0, distance: Any = None, *, bearing: str = "given") -> Journal:
    """The friction of a journal of `radius` r (m) under a radial `load` Q (N): M = f₀ Q r, friction circle ρ = f₀ r
    (7-3, 7-5). f₀ follows from the coefficient and the `bearing`, see `journal_friction`.

    A force Q at the `distance` h (m) from the axis turns it with the efficiency 1 - ρ / h, and locks for h ≤ ρ.
    Arguments and results are scalars or arrays of one shape; raises `ValueError` for a radius or load that is not above
    zero, a negative coefficient or distance, or an unknown bearing.
    """
    r, f, q = checked("the journal", radius=radius, friction=friction, load=load)
    f0 = journal_friction(f, bearing)
    circle = f0 * r
    if distance is None:
        none = jnp.full_like(circle, jnp.nan)
        return Journal(circle * q, circle, f0, none, none)
    (h,) = checked("the journal", distance=distance)
    inside = h == 0
    efficiency = jnp.where(inside, -jnp.inf, 1 - circle / jnp.where(inside, 1.0, h))
    return Journal(circle * q, circle, f0, efficiency, h - circle)


def thrust_ring(outer: Any, friction: Any, load: Any = 1.0, inner: Any = 0.0, *, bearing: str = "unworn") -> ThrustRing:
    """The friction of a thrust face between the radii `outer` R and `inner` r (m) under an axial `load` Q (N).

    The `bearing` "unworn" has a uniform pressure: M = 2/3 f Q (R³ - r³) / (R² - r²) (7-7). "run-in" has a uniform wear,
    and a pressure as 1/radius: M = f Q (R + r) / 2 (7-8). Arguments and results are scalars or arrays of one shape;
    raises `ValueError` for an outer radius or load that is not above zero, a negative coefficient or inner radius, an
    inner radius that is not below the outer one, and another bearing.
    """
    big, f, q, small = checked("the thrust ring", outer=outer, friction=friction, load=load, inner=inner)
    if (limit := known(big)) is not None:
        refuse("the thrust ring", "inner", small, lambda x: x < limit, f"a radius below the outer one, {limit} m")
    mean = 0.5 * (big + small)
    new = (2 / 3) * (big * big + big * small + small * small) / (big + small)
    if bearing not in FACES:
        raise ValueError(f"bearing of the thrust ring is {bearing!r}; write one of {', '.join(map(repr, FACES))}")
    radius = mean if bearing == "run-in" else new
    return ThrustRing(f * q * radius, radius)


def gripping_cam(
    eccentricity: Any, radius: Any, angle: Any, friction: Any, load: Any = 1.0, pivot: Any = 0.0
) -> Element:
    """A gripping cam: a disc of `radius` r (m) that turns about a pivot at the `eccentricity` e (m) from its centre,
    and presses on the work with the normal force `load` N (N). `angle` δ (rad) is the one between the line from pivot
    to centre and the normal; `pivot` ρ (m) is the radius of the friction circle at the pivot.

    With R = N / cos φ the torque to grip is R (e sin(δ + φ) + r sin φ + ρ), and the one that keeps it from opening R (e
    sin(δ - φ) - r sin φ - ρ): it stays shut for δ ≤ φ + arcsin((r sin φ + ρ) / e) (7-6), at any angle where that
    quotient is one or more. Arguments and results are scalars or arrays of one shape; raises `ValueError` for an
    eccentricity, radius or load that is not above zero, an angle that is not between 0 and 90°, and a negative
    coefficient or friction circle.
    """
    given = {"eccentricity": eccentricity, "radius": radius, "angle": angle}
    e, r, delta, f, n, rho = checked("the gripping cam", **given, friction=friction, load=load, pivot=pivot)
    phi = friction_angle(f)
    lever = r * jnp.sin(phi) + rho
    share = lever / e
    limit = phi + jnp.where(share < 1, jnp.arcsin(jnp.where(share < 1, share, 0.0)), RIGHT)
    total, ideal = n / jnp.cos(phi), n * e * jnp.sin(delta)
    grip = total * (e * jnp.sin(delta + phi) + lever)
    hold = total * (e * jnp.sin(delta - phi) - lever)
    onward = forward(grip, ideal / grip, -limit, delta + limit)
    return Element(onward, Way(hold, hold / ideal, limit, delta - limit), phi)
