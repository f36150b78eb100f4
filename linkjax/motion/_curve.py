"""A coordinate between the scan angles of a cycle."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import nearest_turn, taken
from linkjax.groups import Seen

HALVINGS = 32  # bisections of a way on the scan
TURN = 2 * math.pi


class Curve(NamedTuple):
    """A coordinate over the cycle, on quintic pieces between the scan angles: values, unwrapped, and derivatives with
    respect to the number of scan steps, with the first place repeated at the end; the step and the cycle (rad)."""

    value: Array
    d: Array
    dd: Array
    step: float
    cycle: float

    def at(self, phi: Array) -> Array:
        """The coordinate at crank angles (rad) from zero to two cycles."""
        lap = jnp.floor(phi / self.cycle)
        place = (phi - lap * self.cycle) / self.step
        cell = jnp.clip(jnp.floor(place), 0, self.value.size - 2).astype(jnp.int32)
        x = place - cell.astype(place.dtype)
        p0, v0, a0 = (taken(part, cell) for part in (self.value, self.d, self.dd))
        p1, v1, a1 = (taken(part, cell + 1) for part in (self.value, self.d, self.dd))
        rise = p1 - p0
        c3 = 10 * rise - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
        c4 = -15 * rise + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
        c5 = 6 * rise - 3 * v0 - 3 * v1 - 0.5 * a0 + 0.5 * a1
        here = p0 + x * (v0 + x * (0.5 * a0 + x * (c3 + x * (c4 + x * c5))))
        return here + lap * (self.value[-1] - self.value[0])

    def passage(self, start: Array, width: Array, sense: Array, target: Array) -> Array:
        """Where the coordinate passes a value (rad) on ways of this width; the nearer end if it does not."""

        def halve(_: Any, bounds: tuple[Array, Array]) -> tuple[Array, Array]:
            low, high = bounds
            middle = 0.5 * (low + high)
            early = sense * (self.at(middle) - target) < 0
            return jnp.where(early, middle, low), jnp.where(early, high, middle)

        low, high = jax.lax.fori_loop(0, HALVINGS, halve, (start, start + width))
        return 0.5 * (low + high)


def curve_of(seen: Seen, scan: np.ndarray, cycle: float, turns: bool) -> Curve:
    """The coordinate between the scan angles; the angle of a link is unwrapped with the help of its slope."""
    step = float(scan[1] - scan[0])
    value, d, dd = (jnp.concatenate([part, part[:1]]) for part in (seen.value, step * seen.d, step**2 * seen.dd))
    if turns:
        rise, likely = value[1:] - value[:-1], 0.5 * (d[1:] + d[:-1])
        rise = likely + nearest_turn(rise - likely, TURN)
        value = jnp.concatenate([value[:1], value[0] + jnp.cumsum(rise)])
    return Curve(value, d, dd, step, cycle)
