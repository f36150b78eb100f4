"""Angles of links that may turn round and round, unwound along the crank."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import nearest_turn, wrapped
from linkjax._vec import Vec
from linkjax.groups._base import Margin
from linkjax.groups._pairs import FRAME
from linkjax.groups._state import LinkState

BEYOND = 1e-6  # what the margin falls short by where a wheel is not after the cycle where it began


class Winding(NamedTuple):
    """Angles of two links at equal steps of the crank, roughly but unwound (rad), and how far the wheel that follows
    them is after the cycle from where it began."""

    at: Array  # (links, steps + 1)
    missed: Array

    def angle(self, number: int, u: Vec, phi: Array, turns: int) -> Array:
        """The angle of a link whose direction is `u`: to the last digit, and in the right turn."""
        count, span = self.at.shape[1] - 1, 2 * jnp.pi * turns
        place = wrapped(phi, span) * (count / span)
        whole = jnp.clip(jnp.floor(place), 0, count - 1).astype(int)
        row, rest = self.at[number], place - jnp.floor(place)
        rough = row[whole] + (row[whole + 1] - row[whole]) * rest
        return rough + nearest_turn(jnp.atan2(u.y, u.x) - rough, 2 * jnp.pi)

    def comes_back(self) -> Array:
        """Whether the wheel is after all turns where it began."""
        return self.missed < jnp.finfo(self.missed.dtype).eps ** 0.4

    def trouble(self) -> str:
        """What is wrong with it: "astray" where it does not come back."""
        return "" if bool(self.comes_back()) else "astray"


def comes_round(path: Winding | None, phi: Array) -> Margin:
    """Whether what follows these angles is after the cycle where it began, as a margin: one, or less than zero."""
    value = jnp.ones_like(phi)
    if path is not None:
        value = jnp.where(path.comes_back(), value, -BEYOND)
    return Margin(value, jnp.zeros_like(value), jnp.zeros_like(value))


def unwound(directions: tuple[Vec, ...]) -> Array:
    """Angles of links along the crank from their directions, shape (links, steps): the first within half a turn of
    zero, and steps of less than half a turn."""
    angles = jnp.stack([jnp.atan2(u.y, u.x) for u in directions])
    steps = nearest_turn(jnp.diff(angles, axis=1), 2 * jnp.pi)
    return jnp.concatenate([angles[:, :1], angles[:, :1] + jnp.cumsum(steps, axis=1)], axis=1)


def turned(
    name: str, number: int, states: Mapping[str, LinkState], path: Winding | None, phi: Array, turns: int
) -> tuple[Array, Array, Array]:
    """Angle of a link, or of the frame, unwound, and its rates."""
    none = jnp.zeros_like(phi)
    if name == FRAME:
        return none, none, none
    state = states[name]
    if state.angle is not None:
        return state.angle, state.w, state.e
    assert path is not None  # see `kinematics.prepared`
    return path.angle(number, state.u, phi, turns), state.w, state.e
