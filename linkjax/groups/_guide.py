"""Straight guides on the frame or on a moving link, and the intersection of two guides.

Source: relative motion in a rotating frame, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import once
from linkjax._types import as_float
from linkjax._vec import Vec, unit
from linkjax.groups._state import LinkState, PointState


class Guide(eqx.Module):
    """A straight guide on the link `on` ("frame" for a fixed guide).

    Its path is the line through the point `through` of that link, at the angle `along` (rad) to the link's axis (on the
    frame: to the x axis), shifted to its left by `offset` (m).
    """

    through: str = eqx.field(static=True)
    along: jnp.ndarray = eqx.field(converter=as_float, default=0.0)
    offset: jnp.ndarray = eqx.field(converter=as_float, default=0.0)
    on: str = eqx.field(static=True, default="frame")

    def line(self, states: Mapping[str, LinkState], points: Mapping[str, PointState]) -> Line:
        """The path for these states of the links."""
        t = unit(self.along)
        if self.on == "frame":
            return Line(points[self.through], t, self.offset, None)
        return Line(points[self.through], t.turned(states[self.on].u).once(), self.offset, states[self.on])


def as_guide(guide: Guide | str) -> Guide:
    """The guide itself; for the name of a frame point, the guide through it parallel to x."""
    return Guide(guide) if isinstance(guide, str) else guide


class Slot(eqx.Module):
    """A sliding joint: the `block` moves along the `guide`, on the frame or on a link."""

    block: str = eqx.field(static=True)
    guide: Guide = eqx.field(converter=as_guide)


class Seen(NamedTuple):
    """A coordinate of a point relative to a line, with its derivatives with respect to the crank angle."""

    value: Array
    d: Array
    dd: Array


class Line(NamedTuple):
    """A line through the moving point `base`, of direction `t`, shifted to its left by `offset`; `turning` holds the
    rates of its direction, None for a fixed direction."""

    base: PointState
    t: Vec
    offset: Array
    turning: LinkState | None

    @property
    def state(self) -> LinkState:
        """State of a block that slides along the line."""
        if self.turning is None:
            still = jnp.zeros_like(self.t.x)
            return LinkState(self.t, still, still)
        return LinkState(self.t, self.turning.w, self.turning.e)

    def along(self, point: PointState) -> Seen:
        """Coordinate of a point along the line."""
        return self._seen(point, self.t)

    def height(self, point: PointState) -> Seen:
        """Distance of a point from the line, positive to its left."""
        value, d, dd = self._seen(point, self.t.perp())
        return Seen(value - self.offset, d, dd)

    def _seen(self, point: PointState, axis: Vec) -> Seen:
        """Coordinate along an axis that turns with the line."""
        d = point.r - self.base.r
        if self.turning is None:
            return Seen(d.dot(axis), point.dr.dot(axis), point.ddr.dot(axis))
        v, a, n, w, e = point.dr - self.base.dr, point.ddr - self.base.ddr, axis.perp(), self.turning.w, self.turning.e
        first = v.dot(axis) + w * d.dot(n)
        return Seen(d.dot(axis), first, a.dot(axis) + 2 * w * v.dot(n) + e * d.dot(n) - w * w * d.dot(axis))

    def point(self, s: Array, d: Array, dd: Array) -> PointState:
        """A point on the path, `s` ahead of the foot of its base; `d` and `dd` are the derivatives of `s`."""
        t, n, base = self.t, self.t.perp(), self.base
        arm = t * s + n * self.offset
        if self.turning is None:
            return PointState(base.r + arm, base.dr + t * d, base.ddr + t * dd)
        w, e = self.turning.w, self.turning.e
        first = base.dr + t * d + arm.perp() * w
        return PointState(base.r + arm, first, base.ddr + t * dd + n * (2 * w * d) + arm.perp() * e - arm * (w * w))

    def wanted(self, at: Vec, v: Vec | None = None) -> Array:
        """For a point `at` that stays on the line: the component of its velocity along the left normal, or, given the
        velocity `v`, of its acceleration."""
        n = self.t.perp()
        if self.turning is None:
            return jnp.zeros_like(n.x)
        d, w, e = at - self.base.r, self.turning.w, self.turning.e
        if v is None:
            return self.base.dr.dot(n) + w * d.dot(self.t)
        return self.base.ddr.dot(n) + 2 * w * (v - self.base.dr).dot(self.t) + e * d.dot(self.t) + w * w * d.dot(n)


def crossing(one: Line, two: Line) -> PointState:
    """The intersection of two lines; a finite placeholder where they are parallel."""
    sine = one.t.cross(two.t)
    sine = once(jnp.where(sine != 0, sine, 0.1))

    def solved(a, b):
        """The vector with these components along the left normals of the two lines."""
        return (two.t * a - one.t * b) / sine

    apart = (two.base.r - one.base.r).dot(two.t.perp())
    r = one.base.r + solved(one.offset, two.offset + apart)
    v = solved(one.wanted(r), two.wanted(r))
    return PointState(r, v, solved(one.wanted(r, v), two.wanted(r, v)))
