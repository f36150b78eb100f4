"""The plane vector: two separate scalar arrays; code reads as in a textbook and compiles to plain arithmetic.

Equations contain no angles: the direction of a link is a unit vector, and axes for crank angles and designs come only
from `vmap`. Closure then needs only square roots and divisions, without a branch cut; this is an order of magnitude
faster than `atan2` on vectors with an axis of length two.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import once, sincos
from linkjax._tree import node
from linkjax._types import Tracer, as_float


@node
class Vec:
    """A vector in the plane, components `x` and `y` (same shape, SI units)."""

    x: Array
    y: Array

    def __init__(self, x: Any, y: Any):
        self.__dict__["x"] = x if isinstance(x, Tracer) else as_float(x)
        self.__dict__["y"] = y if isinstance(y, Tracer) else as_float(y)

    def __add__(self, other: Vec) -> Vec:
        return Vec(self.x + other.x, self.y + other.y)

    def __sub__(self, other: Vec) -> Vec:
        return Vec(self.x - other.x, self.y - other.y)

    def __neg__(self) -> Vec:
        return Vec(-self.x, -self.y)

    def __mul__(self, factor) -> Vec:
        return Vec(self.x * factor, self.y * factor)

    __rmul__ = __mul__

    def __truediv__(self, divisor) -> Vec:
        return Vec(self.x / divisor, self.y / divisor)

    def dot(self, other: Vec) -> Array:
        """Scalar product."""
        return self.x * other.x + self.y * other.y

    def cross(self, other: Vec) -> Array:
        """The z component of the vector product: positive when `other` lies to the left of `self`."""
        return self.x * other.y - self.y * other.x

    def perp(self) -> Vec:
        """The vector rotated by +90 degrees."""
        return Vec(-self.y, self.x)

    def turned(self, unit: Vec) -> Vec:
        """The vector, given in a frame whose x axis is `unit`, expressed in the axes of `unit`."""
        return Vec(self.x * unit.x - self.y * unit.y, self.x * unit.y + self.y * unit.x)

    def once(self) -> Vec:
        """The same vector, computed once (see `linkjax._numerics.once`)."""
        return Vec(once(self.x), once(self.y))

    def squared(self) -> Array:
        """Squared length."""
        return self.x * self.x + self.y * self.y


def zero() -> Vec:
    """The zero vector."""
    return Vec(jnp.asarray(0.0), jnp.asarray(0.0))


def unit(angle) -> Vec:
    """The unit vector at `angle` (rad, counter-clockwise from +x)."""
    sine, cosine = sincos(jnp.asarray(angle))
    return Vec(cosine, sine).once()
