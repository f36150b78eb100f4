"""The measures of a start from rest: time of the run-up, margin of the starting torque."""

from __future__ import annotations

from jaxtyping import Array

from linkjax.measures._parts import Parts
from linkjax.runs import run_up_time, starting_torque


def run_up(of: Parts, angle: float = 0.0) -> Array:
    """Time (s) from rest at a crank angle (rad) to 99 % of the speed of the steady-state motion."""
    return run_up_time(of.ready, angle, of.steady)


def torque_margin(of: Parts, element: str = "") -> Array:
    """Starting torque of the motor over the greatest static load torque, less one; no `element`."""
    return starting_torque(of.ready).margin
