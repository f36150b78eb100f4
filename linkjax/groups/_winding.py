"""Angles of links that may turn round and round, unwound along the crank."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import nearest_turn, wrapped
from linkjax._vec import Vec
from linkjax.groups._base import Margin
from linkjax.groups._pairs import FRAME
from linkjax.groups._state import LinkState

FASTEST = 3.0  # rad a step of the path, up to which turns are counted


class Winding(NamedTuple):
    """Angles of links at equal steps of the crank, unwound (rad), and their rates, each of shape (links, steps + 1)."""

    at: Array
    w: Array

    def angle(self, number: int, u: Vec, phi: Array, cycle_turns: int) -> Array:
        """The angle of a link whose direction is `u`: to the last digit, and in the right turn."""
        count, span = self.at.shape[1] - 1, 2 * jnp.pi * cycle_turns
        here = wrapped(phi, span)
        place = here * (count / span)
        start = jnp.clip(jnp.floor(place), 0, count - 1)
        row, rate, t, h, whole = self.at[number], self.w[number], place - start, span / count, start.astype(int)
        rise = row[whole + 1] - row[whole]
        first, last = (
            jnp.clip(bend, -FASTEST, FASTEST) for bend in (h * rate[whole] - rise, rise - h * rate[whole + 1])
        )
        rough = row[whole] + t * (rise + (1 - t) * ((1 - t) * first + t * last))  # Hermite's cubic
        rough = rough + jnp.round((phi - here) / span) * (row[-1] - row[0])
        return rough + nearest_turn(jnp.atan2(u.y, u.x) - rough, 2 * jnp.pi)

    def missed(self, turns: Array, path_turns: int) -> Array:
        """How far from where it began is what should turn by a whole number of `turns` (rad) over the path, on the unit
        circle; infinite where the links are too fast for their turns to be counted."""
        return jnp.where(self.too_fast(path_turns), jnp.inf, 2 * jnp.abs(jnp.sin(0.5 * turns)))

    def too_fast(self, cycle_turns: int) -> Array:
        """Whether links turn so fast that their turns cannot be counted."""
        step = 2 * jnp.pi * cycle_turns / (self.at.shape[1] - 1)
        return jnp.max(jnp.abs(self.w)) * step > FASTEST

    def covered(self) -> Array:
        """By how much each link turns in all (rad)."""
        return self.at[:, -1] - self.at[:, 0]


def unwound(states: Sequence[LinkState], closes: Array, step: Array) -> Winding:
    """Angles of links along the crank, from their states at equal steps (leaves of that shape) and whether they can be
    assembled there: the first within half a turn of zero where they are not counted already; from step to step by
    their rates, and to the last digit. Over steps where these are none, or grow beyond all bounds, as near a dead
    position, they turn the shorter way. Where that is as near as nothing to half round, as when a dyad's far pins
    nearly meet, either could be it: the rate is told as too fast."""
    rows, rates = [], []
    last = jnp.maximum(jax.lax.cummax(jnp.where(closes, jnp.arange(closes.size), 0)), jnp.argmax(closes))
    for state in states:
        w, e = state.w, state.e
        if state.angle is not None:
            rows.append(state.angle)
            rates.append(jnp.zeros_like(w))  # of what is counted already none is needed
            continue
        angle = jnp.atan2(state.u.y, state.u.x)[last]
        known = closes & (jnp.abs(w) * step < FASTEST)
        moved = step * (w[1:] + w[:-1]) / 2 - jnp.clip(step**2 * (e[1:] - e[:-1]) / 12, -1.0, 1.0)
        moved = jnp.where(known[1:] & known[:-1], moved, 0.0)
        other = nearest_turn(jnp.diff(angle) - moved, 2 * jnp.pi)
        rows.append(jnp.concatenate([angle[:1], angle[0] + jnp.cumsum(moved + other)]))
        unseen = closes[1:] & closes[:-1] & (jnp.abs(other) > FASTEST)
        w = jnp.where(jnp.append(unseen, False), jnp.copysign(jnp.maximum(jnp.abs(w), 2 * FASTEST / step), w), w)
        rates.append(jnp.where(closes, w, 0.0))
    return Winding(jnp.stack(rows), jnp.stack(rates))


def always(phi: Array) -> Margin:
    """The margin of what can stand at every crank angle: only over the cycle it may not come round."""
    return Margin(jnp.ones_like(phi), jnp.zeros_like(phi), jnp.zeros_like(phi))


def nothing(missed: Array) -> Array:
    """Whether what is missed after the cycle is nothing but rounding."""
    return missed < jnp.finfo(missed.dtype).eps ** 0.4


def counted(
    name: str, number: int, states: Mapping[str, LinkState], path: Winding | None, phi: Array, cycle_turns: int
) -> tuple[Array, Array, Array]:
    """Angle of a link, or of the frame, unwound, and its rates."""
    none = jnp.zeros_like(phi)
    if name == FRAME:
        return none, none, none
    state = states[name]
    if state.angle is not None:
        return state.angle, state.w, state.e
    assert path is not None  # see `kinematics.prepared`
    return path.angle(number, state.u, phi, cycle_turns), state.w, state.e
