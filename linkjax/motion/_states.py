"""All steady-state motions of a machine with a motor: several where its torque and the loads cross repeatedly."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import StructureError
from linkjax.motion._driven import STARTS, begun_by_speed, periodic_starts
from linkjax.motion._grid import grid_of
from linkjax.motion._nodes import at_nodes
from linkjax.motion._steady import Steady, conclude
from linkjax.motion._switching import grid_with_kinks
from linkjax.sampling import Sampler

TRIED = 97  # speeds in the range from which a cycle is followed


def steady_states(
    scene: Scene | ReadyScene, slowest: float | None = None, fastest: float | None = None, nodes: int = 96
) -> tuple[Steady, ...]:
    """Every steady-state motion of a scene with a motor whose speed at the start of the cycle is between `slowest` and
    `fastest` (rad/s, 0.02 and 4 times the nominal speed if not given), by increasing mean speed.

    A motion is stable where its `driven.multiplier` is below one: a small difference in speed is multiplied by it in
    every cycle. Between two stable motions there is an unstable one, from whose speeds the machine goes to either.
    Empty if there is none. Two motions are separated if their speeds differ by more than the 97th part of the range,
    on a logarithmic scale. Not differentiable as a whole; each motion is found again by `steady_motion` with a nominal
    speed near its own. Raises `StructureError` without a motor, if the driver follows a motion law, and if the range is
    empty.
    """
    made = ready(scene)
    if made.scene.mechanism.prescribed or made.scene.motor is None:
        raise StructureError("motor", "there is none to give the machine its speed", "add a motor without a motion law")
    nominal = float(made.scene.speed)
    low, high = slowest or STARTS[0] * nominal, fastest or STARTS[-1] * nominal
    if not 0 < low < high:
        raise StructureError("slowest", f"{low:.6g} rad/s is not between zero and {high:.6g} rad/s", "exchange them")
    machine = Sampler(made)
    grid = grid_of(machine, nodes)
    starts = periodic_starts(machine, grid, at_nodes(machine, grid, edges=False), np.geomspace(low, high, TRIED))
    states = []
    for start in map(jnp.asarray, starts):
        grid = grid_with_kinks(machine, nodes, start=start, still=False)
        at = at_nodes(machine, grid)
        states.append(conclude(machine, *begun_by_speed(machine, grid, at, start=start)))
    return tuple(sorted(states, key=lambda each: float(each.mean_speed)))
