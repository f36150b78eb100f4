"""Counted turns of rotating links along the cycle: angles that include whole turns.

Only gears count revolutions, so linkages without gears have no extra cost: the state of a link contains an angle only
where a closed form exists (cranks, gears), and a gear in mesh with another link follows a path of counted turns, as a
group of higher class follows its own path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import nearest_turn, wrapped
from linkjax._tree import node
from linkjax._vec import Vec
from linkjax.groups._base import Margin
from linkjax.groups._pairs import FRAME
from linkjax.groups._state import LinkState

FASTEST = 3.0  # rad per step of the path, up to which turns are counted


@node
class CountedTurns:
    """Unwound angles of links (rad) at equal steps of the crank over `cycle_turns` turns, and their rates, each of
    shape (links, steps + 1)."""

    at: Array
    w: Array
    cycle_turns: int = eqx.field(static=True)

    def angle(self, number: int, u: Vec, phi: Array) -> Array:
        """The angle of a link whose direction is `u`: accurate to rounding, and in the right turn."""
        count, span = self.at.shape[1] - 1, 2 * jnp.pi * self.cycle_turns
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

    def missed(self, turns: Array) -> Array:
        """Distance on the unit circle between the initial and the final position, for `turns` (rad) over the path;
        infinite where the links turn too fast for their turns to be counted."""
        return jnp.where(self.too_fast(), jnp.inf, 2 * jnp.abs(jnp.sin(0.5 * turns)))

    def too_fast(self) -> Array:
        """Whether links turn too fast for their turns to be counted."""
        step = 2 * jnp.pi * self.cycle_turns / (self.at.shape[1] - 1)
        return jnp.max(jnp.abs(self.w), initial=0.0) * step > FASTEST

    def covered(self) -> Array:
        """Total rotation of each link (rad)."""
        return self.at[:, -1] - self.at[:, 0]


def counted_turns(states: Sequence[LinkState], closes: Array, step: Array, cycle_turns: int) -> CountedTurns:
    """Angles of links over `cycle_turns` turns, from their states at equal steps (leaves of that shape) and whether
    they can be assembled there (`closes`).

    The first angle is within half a turn of zero, unless whole turns are known already. From step to step the rates
    determine the turn. Where rates do not exist or are unbounded, as near a singular position, links turn the shorter
    way. Where this is almost half a turn, as when a dyad's outer pins nearly coincide, the sense is ambiguous: the rate
    is then set to a value that counts as too fast.

    Within about 1e-5 of the change point of a kite the choice of the shorter way would be arbitrary. (Before the sense
    was checked, one in five such gears was wrong by one revolution, without notice.)
    """
    if not states:
        return uncounted()
    rows, rates = [], []
    last = jnp.maximum(jax.lax.cummax(jnp.where(closes, jnp.arange(closes.size), 0)), jnp.argmax(closes))
    for state in states:
        w, e = state.w, state.e
        if state.angle is not None:
            rows.append(state.angle)
            rates.append(jnp.zeros_like(w))  # not needed where turns are known already
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
    return CountedTurns(jnp.stack(rows), jnp.stack(rates), cycle_turns)


def uncounted() -> CountedTurns:
    """Turns of no links."""
    return CountedTurns(none := jnp.zeros((0, 2)), none, 1)


def always(phi: Array) -> Margin:
    """The margin of a group that can be assembled at every crank angle, but may not return after the cycle."""
    return Margin(jnp.ones_like(phi), jnp.zeros_like(phi), jnp.zeros_like(phi))


def nothing(missed: Array) -> Array:
    """Whether the distance missed after the cycle is only rounding."""
    return missed < jnp.finfo(missed.dtype).eps ** 0.4


def counted(
    name: str, number: int, states: Mapping[str, LinkState], path: CountedTurns | None, phi: Array
) -> tuple[Array, Array, Array]:
    """Unwound angle of a link, or of the frame, and its rates."""
    none = jnp.zeros_like(phi)
    if name == FRAME:
        return none, none, none
    state = states[name]
    if state.angle is not None:
        return state.angle, state.w, state.e
    assert path is not None  # see `kinematics.prepared`
    return path.angle(number, state.u, phi), state.w, state.e
