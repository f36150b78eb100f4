"""Loads: forces and torques, constant or opposing the motion, permanent or in a window."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import safe_divide, safe_sqrt, wrapped
from linkjax._types import as_float, known
from linkjax._vec import Vec, zero
from linkjax.groups import PointState
from linkjax.kinematics import Motion, Pose
from linkjax.loads._coordinate import Coordinate
from linkjax.loads._passage import Passage


class Window(eqx.Module):
    """Half-open range [on, off) of the crank angle (rad), modulo the cycle.

    `on` and `off` are numbers, or arrays of equal shape (ranges,) for several ranges, of which those of zero width do
    not count. A `Scene` raises `StructureError` for angles beyond two cycles, which are probably degrees.
    """

    on: Array = eqx.field(converter=as_float)
    off: Array = eqx.field(converter=as_float)

    @property
    def ranges(self) -> tuple[Window, ...]:
        """Its ranges, one by one."""
        if jnp.ndim(self.on) == 0:
            return (self,)
        return tuple(Window(on, off) for on, off in zip(self.on, self.off, strict=True))

    def used(self, cycle: float) -> list[tuple[float, float]]:
        """Its ranges (rad) as numbers, from the first on; those that touch are one, and those of zero width are
        omitted. The end is below the beginning where a range contains the crank angle zero."""
        if np.ndim(self.on) == 0:
            return [(float(self.on) % cycle, float(self.off) % cycle)]
        pairs = zip(np.asarray(self.on).tolist(), np.asarray(self.off).tolist(), strict=True)
        widths = [(on % cycle, (off - on) % cycle) for on, off in pairs if on != off]
        return joined_ranges(widths, cycle)

    def active(self, angle: Array, cycle: float) -> Array:
        """One inside the window, zero outside."""
        if jnp.ndim(self.on) == 0:
            return jnp.where(wrapped(angle - self.on, cycle) < wrapped(self.off - self.on, cycle), 1.0, 0.0)
        each = [one.active(angle, cycle) for one in self.ranges]
        return jnp.max(jnp.stack(each), axis=0)


def joined_ranges(widths: list[tuple[float, float]], cycle: float) -> list[tuple[float, float]]:
    """Ranges of crank angle from begin and width (rad), in order, where those that touch are one."""
    near, found = 1e-12 * cycle, []
    for on, width in sorted(widths):
        if found and on - sum(found[-1]) < near:
            found[-1] = (found[-1][0], on + width - found[-1][0])
        else:
            found.append((on, width))
    if len(found) > 1 and found[0][0] + cycle - sum(found[-1]) < near:
        (first, width), (last, late) = found.pop(0), found.pop()
        found.append((last, late + first + cycle - (last + late) + width))
    if len(found) == 1 and found[0][1] > cycle - near:
        return [(0.0, cycle)]
    return [(on, (on + width) % cycle) for on, width in found]


class Instant(NamedTuple):
    """The crank angle `phi` (rad) at which a load is evaluated, an angle `side` (rad) on the side of one-sided limits
    at jumps, and the crank speed `speed` (rad/s, None where only loads that depend on position alone are evaluated).

    Loads that measure the position of a point along a guide need the `mechanism`, and those that ask for the `span` of
    a coordinate find its least and greatest value in `ends`, by the name of the load; `ReadyScene.instant` gives both.
    """

    phi: Array
    side: Array
    speed: Any = None
    mechanism: Any = None
    ends: Any = None


class Applied(NamedTuple):
    """A force (N) at a point of a link, None for a pure couple, and a free couple (N m) on this link."""

    link: str
    point: str | None
    force: Vec
    couple: Array


class AbstractLoad(eqx.Module):
    """A load on one link, or between two. It acts within its `window`, or permanently if that is None. `reacts_on` is
    "frame" if its reaction acts on the frame of the machine.

    A new kind of load is a subclass with the fields below and `wrenches`. `link` and `point` are where it acts; a load
    between two links names one of them, returns the wrenches on both, and names both in `attachments`.
    """

    name: eqx.AbstractVar[str]
    link: eqx.AbstractVar[str]
    point: eqx.AbstractVar[str]
    window: eqx.AbstractVar[Window | Passage | None]
    reacts_on: eqx.AbstractVar[str | None]

    @property
    def depends_on(self) -> frozenset[str]:
        """What the load depends on, of "position" and "speed"."""
        return frozenset({"position"})

    @property
    def opposing(self) -> bool:
        """Whether the load depends on the direction of motion."""
        return False

    def attachments(self) -> tuple[tuple[str, str], ...]:
        """Where the load acts, as (link, point): the link may be "frame", and the point is empty for a couple."""
        return ((self.link, self.point),)

    @abc.abstractmethod
    def wrenches(self, pose: Pose, at: Instant) -> list[Applied]:
        """Forces and couples on the links while the load acts."""

    def share(self, pose: Pose, at: Instant) -> Array:
        """Share of the reduced torque (N m) while the load acts: its power at unit crank speed."""
        return power(pose, self.wrenches(pose, at))

    def energy(self, pose: Pose) -> Array | None:
        """Potential energy (J) that the load stores in a pose while it acts; None if it stores none."""
        return None

    def opposed(self, pose: Pose) -> Motion | None:
        """The motion that the load opposes; None if it does not depend on the direction of motion."""
        return None

    def strength(self) -> Array:
        """Magnitude of a load that opposes the motion (N or N m); zero for others."""
        return jnp.zeros(())

    def breakpoints(self) -> tuple[Array, ...]:
        """Crank angles (rad) at which the load begins or ends to act, or jumps, as far as the load itself gives
        them."""
        return (self.window.on, self.window.off) if isinstance(self.window, Window) else ()

    def kinks(self, cycle: float) -> tuple[Array, ...]:
        """Crank angles (rad) of a cycle of this length (rad) at which the load has a kink or a jump while it acts."""
        return ()

    def crossed(self) -> Coordinate | None:
        """The coordinate at whose reversals, and at some values of which, the load has a kink or a jump; None if the
        load depends on none."""
        return None

    def levels(self, ends: tuple[Array, Array] | None) -> Array:
        """The values of this coordinate, from its extremes `ends` if the load asks for its `span`; shape (values,)."""
        return jnp.zeros(0)

    def level_count(self) -> int:
        """The number of these values."""
        return 0

    def span(self) -> Coordinate | None:
        """The coordinate whose extremes over the cycle the load needs; None if it needs none."""
        return None

    def __check_init__(self):
        """Raise `TypeError` if a force is not a `Vec`, and `ValueError` if a component or magnitude is invalid."""
        if isinstance(force := getattr(self, "force", None), int | float | tuple | list):
            raise TypeError(f"force of load {self.name!r} must be a Vec, but is {force!r}; write Vec(x, y), in N")
        sizes = {key: getattr(self, key, None) for key in ("torque", "magnitude")}
        parts = {f"force.{axis}": getattr(force, axis, None) for axis in ("x", "y")}
        for key, size in (sizes | parts).items():
            value = known(size)
            if value is not None and not np.all(np.isfinite(value)):
                raise ValueError(f"{key} of load {self.name!r} is {value}; write a finite number")
            if value is not None and key == "magnitude" and np.any(value < 0):
                remedy = "write zero or more; use Force or Torque for a load that drives"
                raise ValueError(f"{key} of load {self.name!r} must not be negative, but is {value}; {remedy}")


class Force(AbstractLoad):
    """A `force` (`Vec`, N), constant in the axes of the frame, at a `point` of a `link`.

    It acts within its `window`, or permanently if that is None. Raises `TypeError` or `ValueError` for a bad force.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    point: str = eqx.field(static=True)
    force: Vec = eqx.field(kw_only=True)
    window: Window | Passage | None = None
    reacts_on: Literal["frame"] | None = eqx.field(static=True, default=None)

    def wrenches(self, pose, at):
        return [Applied(self.link, self.point, self.force, jnp.zeros_like(at.phi))]


class OpposingForce(AbstractLoad):
    """A force of constant `magnitude` (N) at a `point` of a `link`, against the velocity of that point.

    It acts within its `window`, or permanently if that is None. Raises `ValueError` if the magnitude is negative or not
    finite.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    point: str = eqx.field(static=True)
    magnitude: Array = eqx.field(converter=as_float, kw_only=True)
    window: Window | Passage | None = None
    reacts_on: Literal["frame"] | None = eqx.field(static=True, default=None)

    @property
    def opposing(self):
        return True

    def strength(self):
        return self.magnitude

    def wrenches(self, pose, at):
        against = direction(pose.points[self.point], at)
        return [Applied(self.link, self.point, against * -self.magnitude, jnp.zeros_like(at.phi))]

    def share(self, pose, at):
        return -self.magnitude * safe_sqrt(pose.points[self.point].dr.squared())  # exact at a reversal

    def opposed(self, pose):
        p = pose.points[self.point]
        return Motion((p.dr.x, p.dr.y), (p.ddr.x, p.ddr.y))


class Torque(AbstractLoad):
    """A constant `torque` (N m, positive counter-clockwise) on a `link`.

    It acts within its `window`, or permanently if that is None. Raises `ValueError` if the torque is not finite.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    torque: Array = eqx.field(converter=as_float, kw_only=True)
    window: Window | Passage | None = None
    reacts_on: Literal["frame"] | None = eqx.field(static=True, default=None)
    point: str = eqx.field(static=True, default="")

    def wrenches(self, pose, at):
        return [Applied(self.link, None, zero(), jnp.broadcast_to(self.torque, jnp.shape(at.phi)))]


class OpposingTorque(AbstractLoad):
    """A torque of constant `magnitude` (N m) on a `link`, against its rotation.

    It acts within its `window`, or permanently if that is None. Raises `ValueError` if the magnitude is negative or not
    finite.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    magnitude: Array = eqx.field(converter=as_float, kw_only=True)
    window: Window | Passage | None = None
    reacts_on: Literal["frame"] | None = eqx.field(static=True, default=None)
    point: str = eqx.field(static=True, default="")

    @property
    def opposing(self):
        return True

    def strength(self):
        return self.magnitude

    def wrenches(self, pose, at):
        link = pose.links[self.link]
        ahead = jnp.where(at.side >= at.phi, 1.0, -1.0)
        sense = jnp.sign(jnp.where(jnp.abs(link.w) > NEAR * jnp.abs(link.e), link.w, link.w + ahead * NEAR * link.e))
        return [Applied(self.link, None, zero(), -self.magnitude * sense)]

    def share(self, pose, at):
        return -self.magnitude * jnp.abs(pose.links[self.link].w)  # exact at a reversal

    def opposed(self, pose):
        link = pose.links[self.link]
        return Motion((link.w,), (link.e,))


def power(pose: Pose, applied: Sequence[Applied]) -> Array:
    """Power of forces and couples at unit crank speed (N m)."""
    total = jnp.asarray(0.0)
    for link, point, force, couple in applied:
        total = total + couple * pose.links[link].w + (force.dot(pose.points[point].dr) if point else 0.0)
    return total


NEAR = 1e-5  # rad: closer to a reversal than this, the direction of motion is that on the requested side


def direction(point: PointState, at: Instant) -> Vec:
    """Unit vector along the velocity; at a reversal, its limit on the requested side; zero for a point that never
    moves."""
    v, a = point.dr, point.ddr
    ahead = jnp.where(at.side >= at.phi, 1.0, -1.0)
    near = v.squared() <= NEAR * NEAR * a.squared()
    nudge = jnp.where(near, ahead * NEAR, 0.0)
    v = Vec(v.x + nudge * a.x, v.y + nudge * a.y)
    return v * safe_divide(jnp.ones_like(v.x), safe_sqrt(v.squared()))
