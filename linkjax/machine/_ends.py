"""Extremes of coordinates over the cycle, for loads that depend on the ends of a stroke."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide
from linkjax._search import GRID_SCAN, scan_angles
from linkjax.groups import Seen
from linkjax.kinematics import Prepared, pose
from linkjax.loads import AbstractLoad, Coordinate, watched

ROUNDS = 4  # Newton steps from the outermost scan angle to the extreme


def ends_of(made: Prepared, loads: tuple[AbstractLoad, ...], cycle_turns: int) -> tuple[Any, ...]:
    """Least and greatest value over the cycle of the coordinate that each load asks for (`span`), None for a load that
    asks for none. They carry the derivatives with respect to the design; second derivatives are those of the extreme,
    too."""
    spans = [load.span() for load in loads]
    wanted = tuple(span for span in spans if span is not None)
    if not wanted:
        return (None,) * len(loads)
    found = iter(_ends(made, wanted, turns=cycle_turns))
    return tuple(None if span is None else next(found) for span in spans)


@compiled_soon(static=("turns",))
def _ends(made: Prepared, wanted: tuple[Coordinate, ...], turns: int) -> list[tuple[Array, Array]]:
    def at(made: Prepared, wanted: tuple[Coordinate, ...], phi: Array) -> list[Seen]:
        here = jax.vmap(lambda phi: pose(made, phi))(phi)
        return [watched(made.mechanism, each, here).seen() for each in wanted]

    fixed, still = jax.lax.stop_gradient((made, wanted))
    scan, step = jnp.asarray(scan_angles(turns, GRID_SCAN)), 2 * math.pi / GRID_SCAN
    scanned = at(fixed, still, scan)
    start = jnp.stack([scan[best(each.value)] for each in scanned for best in (jnp.argmin, jnp.argmax)])

    def closer(_: Any, phi: Array) -> Array:
        rows = _own(at(fixed, still, phi))
        move = jnp.stack([safe_divide(each.d, each.dd) for each in rows])
        return jnp.clip(phi - move, start - step, start + step)

    phi = jax.lax.stop_gradient(jax.lax.fori_loop(0, ROUNDS, closer, start))
    # the value at the extreme, which moves with the design: exact up to the second derivative
    values = [each.value - 0.5 * each.d * safe_divide(each.d, each.dd) for each in _own(at(made, wanted, phi))]
    return list(zip(values[::2], values[1::2], strict=True))


def _own(seen: list[Seen]) -> list[Seen]:
    """Of coordinates at the two places of each of them, in order, those at their own places."""
    return [Seen(*(part[2 * i + k] for part in each)) for i, each in enumerate(seen) for k in (0, 1)]
