"""States of points and links: where they are, and their first and second kinematic coefficients."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Array

from linkjax._vec import Vec, zero


class PointState(NamedTuple):
    """Position of a point and its first and second kinematic coefficients (derivatives by the crank angle φ)."""

    r: Vec
    dr: Vec
    ddr: Vec


class LinkState(NamedTuple):
    """Orientation of a link as the unit vector `u` along it, with ω' = dθ/dφ and ε' = d²θ/dφ²."""

    u: Vec
    w: Array
    e: Array


def at_rest(r: Vec) -> PointState:
    """A point of the frame."""
    return PointState(r, zero(), zero())
