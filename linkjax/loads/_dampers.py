"""Loads that depend on speed: dampers between two ends, and the drag of a fluid."""

from __future__ import annotations

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import safe_sqrt
from linkjax._types import as_float
from linkjax._vec import zero
from linkjax.groups import FRAME
from linkjax.loads._ends import AbstractTie, along, check_sizes, pulled, span, speed_of, turning, twisted
from linkjax.loads._loads import AbstractLoad, Applied, Window
from linkjax.loads._passage import Passage

BOTH = frozenset({"position", "speed"})


class Damper(AbstractTie):
    """A viscous damper between a `point` of a `link` and the point `to_point` of the frame, or of another link
    `to_link`.

    Its tension is the `coefficient` (N s/m) times the rate of its length: it pulls while it becomes longer. At length
    zero it has no direction, and its force is zero. It acts within its `window`, or permanently if that is None. Raises
    `ValueError` if the coefficient is negative or not finite, or both ends are on one link.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    point: str = eqx.field(static=True)
    to_link: str = eqx.field(static=True, default=FRAME)
    to_point: str = eqx.field(static=True, kw_only=True)
    coefficient: Array = eqx.field(converter=as_float, kw_only=True)
    window: Window | Passage | None = eqx.field(default=None, kw_only=True)
    reacts_on: Literal["frame"] | None = eqx.field(static=True, init=False)

    def __check_init__(self):
        check_sizes(self, "coefficient")

    @property
    def depends_on(self):
        return BOTH

    def wrenches(self, pose, at):
        line = along(span(pose, self))
        slope = line.dot(pose.points[self.to_point].dr - pose.points[self.point].dr)
        return pulled(self, line * (self.coefficient * slope * speed_of(self, at)))


class TorsionDamper(AbstractTie):
    """A viscous torsion damper between a `link` and the frame, or another link `to_link`.

    Its couple on the link is the `coefficient` (N m s/rad) times the relative angular velocity, against it; the
    opposite couple acts on the other link. It acts within its `window`, or permanently if that is None. Raises
    `ValueError` if the coefficient is negative or not finite, or both ends are on one link.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    to_link: str = eqx.field(static=True, default=FRAME)
    coefficient: Array = eqx.field(converter=as_float, kw_only=True)
    window: Window | Passage | None = eqx.field(default=None, kw_only=True)
    reacts_on: Literal["frame"] | None = eqx.field(static=True, init=False)
    point: str = eqx.field(static=True, default="", kw_only=True)
    to_point: str = eqx.field(static=True, default="", kw_only=True)

    def __check_init__(self):
        check_sizes(self, "coefficient")

    @property
    def depends_on(self):
        return BOTH

    def wrenches(self, pose, at):
        return twisted(self, -self.coefficient * turning(pose, self) * speed_of(self, at))


class Drag(AbstractLoad):
    """The drag of a fluid at rest on a `point` of a `link`: `linear` v + `quadratic` v², against the velocity v of this
    point relative to the frame (N, with N s/m and N s²/m²).

    It acts within its `window`, or permanently if that is None. Raises `ValueError` if a coefficient is negative or not
    finite.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    point: str = eqx.field(static=True)
    linear: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    quadratic: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    window: Window | Passage | None = None
    reacts_on: Literal["frame"] | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        check_sizes(self, "linear", "quadratic")

    @property
    def depends_on(self):
        return BOTH

    def wrenches(self, pose, at):
        v = pose.points[self.point].dr * speed_of(self, at)
        force = v * -(self.linear + self.quadratic * safe_sqrt(v.squared()))
        return [Applied(self.link, self.point, force, jnp.zeros_like(force.x))]


class DragTorque(AbstractLoad):
    """The drag torque of a fluid at rest on a `link`: `linear` ω + `quadratic` ω², against the angular velocity ω of
    the link (N m, with N m s/rad and N m s²/rad²), as of a fan.

    It acts within its `window`, or permanently if that is None. Raises `ValueError` if a coefficient is negative or not
    finite.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    linear: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    quadratic: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    window: Window | Passage | None = None
    reacts_on: Literal["frame"] | None = eqx.field(static=True, default=None)
    point: str = eqx.field(static=True, default="")

    def __check_init__(self):
        check_sizes(self, "linear", "quadratic")

    @property
    def depends_on(self):
        return BOTH

    def wrenches(self, pose, at):
        w = pose.links[self.link].w * speed_of(self, at)
        return [Applied(self.link, None, zero(), -w * (self.linear + self.quadratic * jnp.abs(w)))]
