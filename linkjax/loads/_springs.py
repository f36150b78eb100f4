"""Springs between a link and the frame, or between two links.

Source: linear springs with initial tension, e.g. Budynas and Nisbett, Shigley's Mechanical Engineering Design, ch. 10.
"""

from __future__ import annotations

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import as_float
from linkjax._vec import unit
from linkjax.groups import FRAME
from linkjax.kinematics import Pose
from linkjax.loads._ends import AbstractTie, along, check_sizes, pulled, size_of, span, twisted
from linkjax.loads._loads import Window
from linkjax.loads._passage import Passage


class Spring(AbstractTie):
    """A spring between a `point` of a `link` and the point `to_point` of the frame, or of another link `to_link`.

    Its tension is `preload` + `stiffness` (length - `free_length`), in N, with N/m and m. A negative tension pushes, as
    in a compression spring. `preload` is the tension at the free length (initial tension of an extension spring). With
    stiffness zero the tension is constant. With free length and preload zero the force is the stiffness times the
    vector between the points; otherwise it has no direction at length zero, and is zero there.

    It acts within its `window`, or permanently if that is None. Raises `ValueError` if stiffness or free length are
    negative, a number is not finite, or both ends are on one link.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    point: str = eqx.field(static=True)
    to_link: str = eqx.field(static=True, default=FRAME)
    to_point: str = eqx.field(static=True, kw_only=True)
    stiffness: Array = eqx.field(converter=as_float, kw_only=True)
    free_length: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    preload: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    window: Window | Passage | None = eqx.field(default=None, kw_only=True)
    reacts_on: Literal["frame"] | None = eqx.field(static=True, init=False)

    def __check_init__(self):
        check_sizes(self, "stiffness", "free_length", "preload")

    def length(self, pose: Pose) -> Array:
        """Its length (m) in a pose."""
        return size_of(span(pose, self))

    def tension(self, pose: Pose) -> Array:
        """Its tension (N) in a pose while it acts; negative if it pushes."""
        return self.preload + self.stiffness * (self.length(pose) - self.free_length)

    def wrenches(self, pose, at):
        line = span(pose, self)
        steady = self.preload - self.stiffness * self.free_length  # the tension that remains at length zero
        return pulled(self, line * self.stiffness + along(line) * steady)

    def energy(self, pose):
        stretch = self.length(pose) - self.free_length
        return stretch * (self.preload + 0.5 * self.stiffness * stretch)


class TorsionSpring(AbstractTie):
    """A torsion spring between a `link` and the frame, or another link `to_link`.

    Its couple on the link is -(`preload` + `stiffness` (angle - `free_angle`)), in N m, with N m/rad and rad; the
    opposite couple acts on the other link. The angle is that of the axis of the link from the axis of the other link
    (from the x axis for the frame), counter-clockwise, and whole turns make no difference: it is within half a turn of
    the free angle. A spring that is wound further has a preload.

    It acts within its `window`, or permanently if that is None. Raises `ValueError` if the stiffness is negative, a
    number is not finite, or both ends are on one link.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    to_link: str = eqx.field(static=True, default=FRAME)
    stiffness: Array = eqx.field(converter=as_float, kw_only=True)
    free_angle: Array = eqx.field(converter=as_float, kw_only=True)
    preload: Array = eqx.field(converter=as_float, default=0.0, kw_only=True)
    window: Window | Passage | None = eqx.field(default=None, kw_only=True)
    reacts_on: Literal["frame"] | None = eqx.field(static=True, init=False)
    point: str = eqx.field(static=True, default="", kw_only=True)
    to_point: str = eqx.field(static=True, default="", kw_only=True)

    def __check_init__(self):
        check_sizes(self, "stiffness", "free_angle", "preload")

    def deflection(self, pose: Pose) -> Array:
        """Its angle from the free angle (rad) in a pose, from -π to π."""
        free, own = unit(self.free_angle), pose.links[self.link].u
        if self.to_link != FRAME:
            free = free.turned(pose.links[self.to_link].u)
        return jnp.arctan2(free.cross(own), free.dot(own))

    def wrenches(self, pose, at):
        return twisted(self, -(self.preload + self.stiffness * self.deflection(pose)))

    def energy(self, pose):
        turned = self.deflection(pose)
        return turned * (self.preload + 0.5 * self.stiffness * turned)
