"""States of points and links: position, and first and second kinematic coefficients."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Array

from linkjax._vec import Vec, zero


class PointState(NamedTuple):
    """Position of a point and its first and second kinematic coefficients (derivatives with respect to the crank
    angle φ)."""

    r: Vec
    dr: Vec
    ddr: Vec


class LinkState(NamedTuple):
    """Orientation of a link as the unit vector `u` along it, with ω' = dθ/dφ and ε' = d²θ/dφ². Its `angle` (rad)
    includes whole turns and is given where it is known in closed form, as for cranks and gears."""

    u: Vec
    w: Array
    e: Array
    angle: Array | None = None


def at_rest(r: Vec) -> PointState:
    """A point of the frame."""
    return PointState(r, zero(), zero())


def carried(origin: PointState, link: LinkState, at: Vec, translating: bool = False) -> PointState:
    """State of a point of a link, `at` in the link's axes."""
    arm = at.turned(link.u).once()
    if translating:
        return PointState(origin.r + arm, origin.dr, origin.ddr)
    return PointState(
        origin.r + arm,
        origin.dr + arm.perp() * link.w,
        origin.ddr + arm.perp() * link.e - arm * (link.w * link.w),
    )
