"""Outcomes of an analysis. A failure is data: a code per crank angle and one for the cycle, each with its remedy."""

from __future__ import annotations

import enum

import jax.numpy as jnp
from jaxtyping import Array


class Result(enum.IntEnum):
    """What became of an analysis; the larger code is the graver and wins when outcomes are merged."""

    SUCCESS = 0
    TOO_MANY_REVERSALS = 1
    INTEGRATION_FAILED = 2
    NO_PERIODIC_REGIME = 3
    NO_INERTIA = 4
    CANNOT_BE_ASSEMBLED = 5


LENGTHS = "Change the lengths named until every margin is positive."
MESSAGES = {
    Result.SUCCESS: "The machine runs.",
    Result.TOO_MANY_REVERSALS: "A load opposes a motion that reverses more often than the grid has room for; "
    "the error estimates still hold. Give the load a window that holds fewer reversals.",
    Result.INTEGRATION_FAILED: "The differential equation could not be integrated: the solver ran out of steps. Take "
    "the quadrature, or, in Python, a looser tolerance.",
    Result.NO_PERIODIC_REGIME: "There is no periodic regime at this mean speed: the kinetic energy would run out "
    "within the cycle. Raise the mean speed, add a flywheel (or other inertia) or lower the loads.",
    Result.NO_INERTIA: "The reduced inertia vanishes within the cycle, so that the crank speed is not bounded there. "
    "Give the crank or the flywheel (or what else the drive moves) an inertia.",
    Result.CANNOT_BE_ASSEMBLED: f"The linkage cannot be assembled over the whole cycle. {LENGTHS}",
}


def merge(*codes: Array) -> Array:
    """The gravest of several codes."""
    return jnp.max(jnp.stack([jnp.asarray(code, dtype=int) for code in codes]))


class MachineError(ValueError):
    """The machine cannot do what was asked: it cannot be assembled, or has no periodic regime.

    `speeds` are the speeds in the message, each as it is written there and in rad/s, to be written in other units.
    """

    def __init__(self, message: str, result: Result, speeds: tuple[tuple[str, float], ...] = ()):
        self.result, self.speeds = result, speeds
        super().__init__(message)
