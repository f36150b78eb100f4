"""The coordinate of a point or link: of a point along its guide or in a direction, of a link its angle."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import nearest_turn
from linkjax._types import as_float
from linkjax.groups import Seen
from linkjax.kinematics import Pose
from linkjax.loads._passage import watched

TURN = 2 * math.pi
NEAR = 1e-5  # rad: closer to a reversal than this, the sense of motion is that on the requested side


class Coordinate(eqx.Module):
    """The coordinate of a `point` or of a `link`, over which a table of a load is given.

    That of a point of a slider is measured along its guide, from the guide's point (m); that of any point with a
    `direction` (rad, from the x axis) is its component in this direction, from the origin of the frame (m); that of a
    link is its angle (rad), where whole turns make no difference. Raises `ValueError` unless one element is named, and
    for a link with a direction.
    """

    point: str = eqx.field(static=True, default="", kw_only=True)
    link: str = eqx.field(static=True, default="", kw_only=True)
    direction: Array | None = eqx.field(converter=as_float, default=None, kw_only=True)

    def __check_init__(self):
        if bool(self.point) == bool(self.link):
            problem = f"names {'both a point and a link' if self.point else 'neither a point nor a link'}"
            raise ValueError(f"a coordinate {problem}; name one point or one link")
        if self.link and self.direction is not None:
            raise ValueError(f"direction is given for the link {self.link!r}; delete it, or name a point")

    @property
    def of(self) -> str:
        """The point or link."""
        return self.point or self.link

    @property
    def unit(self) -> str:
        """Its unit."""
        return "m" if self.point else "rad"


class Crossings(NamedTuple):
    """Values of a coordinate at which a load has a kink; its reversals count too. `load` knows the values, from the
    extremes `ends` of the coordinate if it needs them."""

    over: Coordinate
    load: Any
    ends: tuple[Array, Array] | None

    point = property(lambda self: self.over.point)
    link = property(lambda self: self.over.link)
    direction = property(lambda self: self.over.direction)
    going = ""

    @property
    def cuts(self) -> bool:
        """Whether a link may pass the values once in every revolution."""
        return bool(self.link)

    def values(self) -> Array:
        """The values."""
        return self.load.levels(self.ends)


def seen_at(over: Coordinate, pose: Pose, at: Any) -> Seen:
    """The coordinate at an instant, with its first and second derivatives with respect to the crank angle. Raises
    `ValueError` if the instant does not know the mechanism, whose guides it needs."""
    if at.mechanism is None:
        raise ValueError(f"the coordinate of {over.of!r} needs the guides of a mechanism; use ReadyScene.instant(phi)")
    return watched(at.mechanism, over, pose).seen()


def sense_of(seen: Seen, at: Any) -> Array:
    """One where the coordinate increases, minus one where it decreases; at a reversal, the limit on the requested
    side."""
    ahead = jnp.where(at.side >= at.phi, NEAR, -NEAR)
    rate = jnp.where(jnp.abs(seen.d) > NEAR * jnp.abs(seen.dd), seen.d, seen.d + ahead * seen.dd)
    return jnp.where(rate >= 0, 1.0, -1.0)


def unwrapped(seen: Seen, middle: Array, at: Any) -> Array:
    """The angle of a link within half a turn of `middle`; opposite of it, the limit on the requested side."""
    ahead = jnp.where(at.side >= at.phi, 1e-9, -1e-9)
    probe = seen.value + ahead * seen.d
    return middle + nearest_turn(probe - middle, TURN) + (seen.value - probe)
