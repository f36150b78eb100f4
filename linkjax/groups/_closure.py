"""The closure of links and joints as arrays: configurations, and how they move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._vec import Vec


class Known(NamedTuple):
    """Places of points and directions of links that were there before the group."""

    points: dict[str, Vec]
    links: dict[str, Vec]


class Placed(NamedTuple):
    """Where links are: origins and unit vectors along them, shape (links, 2) each."""

    at: Array
    u: Array

    def moved(self, move: Array, size: Array) -> Placed:
        """Moved by x, y and angle times size of every link (the angle by twice the tangent of its half: no sine)."""
        move = move.reshape((-1, 3))
        half = 0.5 * move[:, 2:] / size
        perp = jnp.stack([-self.u[:, 1], self.u[:, 0]], axis=1)
        return Placed(self.at + move[:, :2], (self.u * (1 - half * half) + 2 * half * perp) / (1 + half * half))

    def later(self, v: Array, t: Array, size: Array, a: Array | None = None) -> Placed:
        """Moved on by a crank angle `t` with these rates, to second order."""
        v = v.reshape((-1, 3))
        a = jnp.zeros_like(v) if a is None else a.reshape((-1, 3))
        half, w, e = 0.5 * t * t, v[:, 2:] / size, a[:, 2:] / size
        perp = jnp.stack([-self.u[:, 1], self.u[:, 0]], axis=1)
        return Placed(self.at + v[:, :2] * t + a[:, :2] * half, self.u * (1 - w * w * half) + perp * (w * t + e * half))

    def flat(self) -> Array:
        """As one array, shape (links, 4)."""
        return jnp.concatenate([self.at, self.u], axis=1)


def placed(z: Array) -> Placed:
    """From one array, whose directions may be off the unit circle."""
    u = z[:, 2:]
    return Placed(z[:, :2], u / jnp.sqrt(jnp.sum(u * u, axis=1, keepdims=True)))


class Closure(NamedTuple):
    """The closure equations of a group as arrays: which body is at either side of every pin and where on it the pin is;
    of every slot its block, the body that its guide is on, and the guide in the axes of that body; places and
    directions of what the group hangs on, a length to measure by (m), and where the drive stands (m). Bodies are the
    links of the group, then what it hangs on."""

    one: Any
    two: Any
    near: Array
    far: Array
    block: Any
    on: Any
    through: Array
    axis: Array
    offset: Array
    outer_at: Array
    outer_u: Array
    size: Array
    drive: Array


def array(vectors: Sequence[Vec]) -> Array:
    """Vectors as rows."""
    if not vectors:
        return jnp.zeros((0, 2))
    return jnp.stack([jnp.stack([v.x for v in vectors]), jnp.stack([v.y for v in vectors])], axis=1)


def solved(linear: Callable[[Array], Array], y: Array) -> Array:
    """The root of a linear function less `y`."""
    return jnp.linalg.solve(jax.jacfwd(linear)(jnp.zeros_like(y)), y)


def turned(u: Array, at: Array) -> Array:
    """Rows given in axes whose directions are the rows of `u`, in those of the frame."""
    x, y, c, s = at[:, 0], at[:, 1], u[:, 0], u[:, 1]
    return jnp.stack([x * c - y * s, x * s + y * c], axis=1)


def crossed(a: Array, b: Array) -> Array:
    """Vector products of rows."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
