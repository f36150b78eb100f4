"""What loads between two ends share: their line, their wrenches, and checks of their input."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._types import known
from linkjax._vec import Vec, zero
from linkjax.groups import FRAME
from linkjax.kinematics import Pose
from linkjax.loads._loads import AbstractLoad, Applied, Instant

NOT_NEGATIVE = {  # fields, with the remedy for a negative value
    "stiffness": "write zero or more; a constant force or couple is a preload with stiffness zero",
    "free_length": "write zero or more",
    "coefficient": "write zero or more; use Force or Torque for a load that drives",
    "linear": "write zero or more; use Force or Torque for a load that drives",
    "quadratic": "write zero or more; use Force or Torque for a load that drives",
}


class AbstractTie(AbstractLoad):
    """A load between a `link` and the frame, or another link `to_link`; its reaction on the frame follows from that."""

    to_link: eqx.AbstractVar[str]
    to_point: eqx.AbstractVar[str]

    def __post_init__(self):
        self.reacts_on = FRAME if self.to_link == FRAME else None

    def __check_init__(self):
        """Raise `ValueError` if both ends are on one link, or the load's own end is on the frame."""
        if self.link == FRAME:
            problem = f"load {self.name!r} has {FRAME!r} as its link"
            raise ValueError(f"{problem}; write the moving link as link, and the frame as to_link")
        if self.link == self.to_link:
            problem = f"link {self.link!r} has both ends of load {self.name!r}"
            raise ValueError(f"{problem}; attach one of them to another link or to the frame")
        if self.point and self.point == self.to_point:
            problem = f"point {self.point!r} is both ends of load {self.name!r}"
            raise ValueError(f"{problem}; name two different points")

    def attachments(self):
        return (self.link, self.point), (self.to_link, self.to_point)


def span(pose: Pose, load: AbstractTie) -> Vec:
    """The vector from the point of a load to its other end (m)."""
    return pose.points[load.to_point].r - pose.points[load.point].r


def size_of(line: Vec) -> Array:
    """Its length, with a zero derivative at length zero."""
    return safe_sqrt(line.squared())


def along(line: Vec) -> Vec:
    """The unit vector along it; zero at length zero."""
    size = size_of(line)
    return line * safe_divide(jnp.ones_like(size), size)


def pulled(load: AbstractTie, force: Vec) -> list[Applied]:
    """A force on the point of a load, and its opposite on the other end; none on the frame."""
    none = jnp.zeros_like(force.x)
    own = Applied(load.link, load.point, force, none)
    return [own] if load.to_link == FRAME else [own, Applied(load.to_link, load.to_point, -force, none)]


def twisted(load: AbstractTie, couple: Array) -> list[Applied]:
    """A couple on the link of a load, and its opposite on the other link; none on the frame."""
    own = Applied(load.link, None, zero(), couple)
    return [own] if load.to_link == FRAME else [own, Applied(load.to_link, None, zero(), -couple)]


def turning(pose: Pose, load: AbstractTie) -> Array:
    """Rotation of the link of a load relative to its other end, as a derivative with respect to the crank angle."""
    own = pose.links[load.link].w
    return own if load.to_link == FRAME else own - pose.links[load.to_link].w


def speed_of(load: AbstractLoad, at: Instant) -> Any:
    """The crank speed (rad/s). Raises `ValueError` where it is not given."""
    if at.speed is None:
        raise ValueError(f"load {load.name!r} depends on the crank speed, which is not known here; evaluate it with "
                         "Instant(phi, side, speed)")  # fmt: skip
    return at.speed


def check_sizes(load: AbstractLoad, *keys: str) -> None:
    """Raise `ValueError` for a number of a load that is not finite, or negative where it must not be."""
    for key in keys:
        value = known(getattr(load, key))
        if value is None:
            continue
        if not np.all(np.isfinite(value)):
            raise ValueError(f"{key} of load {load.name!r} is {value}; write a finite number")
        if key in NOT_NEGATIVE and np.any(value < 0):
            raise ValueError(f"{key} of load {load.name!r} must not be negative, but is {value}; {NOT_NEGATIVE[key]}")
