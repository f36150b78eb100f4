"""Results of an analysis. A failure is data: a code per crank angle and one for the cycle, each with a remedy."""

from __future__ import annotations

import enum

import jax.numpy as jnp
from jaxtyping import Array


class Result(enum.IntEnum):
    """Result of an analysis; of several codes the largest, which is the most serious, is kept."""

    SUCCESS = 0
    TOO_MANY_REVERSALS = 1
    INTEGRATION_FAILED = 2
    NO_PERIODIC_REGIME = 3
    NO_INERTIA = 4
    CANNOT_BE_ASSEMBLED = 5
    LOCKED = 6


LENGTHS = "Change lengths of its links until every margin is positive."
MESSAGES = {
    Result.SUCCESS: "The machine runs.",
    Result.TOO_MANY_REVERSALS: "A load opposes a motion that reverses more often than the grid can represent, "
    "or its window follows such a motion, or one that rests; the error estimates still hold. Give the load a window of "
    "the crank angle with fewer reversals.",
    Result.INTEGRATION_FAILED: "The differential equation could not be integrated: the solver ran out of steps. Use "
    "the quadrature or, in Python, a larger tolerance.",
    Result.NO_PERIODIC_REGIME: "No steady-state motion exists at this mean speed: the kinetic energy falls to zero "
    "within the cycle. Raise the mean speed, add a flywheel (or other inertia) or reduce the loads.",
    Result.NO_INERTIA: "The reduced inertia is zero within the cycle, so that the crank speed is unbounded there. "
    "Give the crank, the flywheel or another driven link an inertia.",
    Result.CANNOT_BE_ASSEMBLED: f"The linkage cannot be assembled over the whole cycle. {LENGTHS}",
    Result.LOCKED: "Friction locks the machine: no finite drive torque keeps up the motion.",
}


def merge(*codes: Array) -> Array:
    """The most serious of several codes."""
    return jnp.max(jnp.stack([jnp.asarray(code, dtype=int) for code in codes]))


class MachineError(ValueError):
    """The analysis is impossible: the machine cannot be assembled, or has no actual motion."""

    def __init__(self, message: str, result: Result):
        self.result = result
        super().__init__(message)
