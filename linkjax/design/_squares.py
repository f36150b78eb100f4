"""Sums of squares: the residuals stay visible to the solvers, as the parts of one row.

The length of this row is the root of the sum. The subproblem has the cone |F + J d| <= t, so that its step is that of
Gauss and Newton within the trust region and all constraints, without squaring the condition of J; SR1 adds the
curvature of the residuals, which matters where they do not vanish. The length was chosen instead of half its square:
both have the same steps near the optimum, but the length keeps the scale of the penalty and of all tolerances.
Source: Nocedal and Wright, Numerical Optimization, 2006, ch. 10.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax.design._names import DesignError
from linkjax.design._terms import LONGEST, SCENE, Term, guarded, name_of
from linkjax.design._variables import Variable, called
from linkjax.machine import Scene
from linkjax.measures import Parts
from linkjax.motion import Rows


def sum_of_squares(residuals: Any, weights: Any = None, *, unit: str = "1", name: str = "") -> Term:
    """The sum of the squares of what a function of the scene, or of the scene and the own numbers, returns: residuals
    in SI, shape (n,) or (n, parts), for `minimise` or `at_most`.

    Every square is multiplied by its weight, shape (n,) or that of the residuals. `unit` is the SI unit of the sum. The
    solvers take Gauss-Newton steps; a minimum of zero is found to rounding. Raises `DesignError` for weights that are
    negative or not finite, and, when the function is traced, where it fails or returns anything else.
    """
    if not callable(residuals):
        problem = f"{type(residuals).__name__} is not a function"
        raise DesignError(repr(residuals)[:LONGEST], problem, "write a function of the scene that returns an array")
    name = name or name_of(residuals)
    factors = None if weights is None else np.sqrt(weights_of(weights, name))

    def vector(of: Parts) -> Array:
        found = guarded(name, SCENE, functools.partial(called, residuals), of)
        return _weighted(_array(name, found), factors, name)

    return squares(name, unit, vector)


def squares(
    name: str, unit: str, vector: Callable[[Parts], Array], wants: Callable[[Scene], Sequence[Variable]] | None = None
) -> Term:
    """The sum of the squares of the entries of a vector, shape (n,) or (n, parts), as a term."""

    def rows(of: Parts) -> Rows:
        return Rows(vector(of).reshape((1, -1)), jnp.full(1, jnp.nan))

    return Term(name, unit, lambda of: jnp.sum(vector(of) ** 2), rows, squares=True, wants=wants)


def weights_of(weights: Any, name: str) -> np.ndarray:
    """Weights as an array. Raises `DesignError` where one is negative or not finite, or all are zero."""
    remedy = "write one non-negative number for every residual, not all zero"
    try:
        found = np.asarray(weights, float)
    except (TypeError, ValueError) as error:
        raise DesignError(name, "its weights are not numbers", remedy) from error
    wrong = found[~(np.isfinite(found) & (found >= 0))]
    if wrong.size or not found.any():
        problem = f"has a weight of {wrong[0]:g}" if wrong.size else "has no weight above zero"
        raise DesignError(name, problem, remedy)
    return found


def _array(name: str, found: Any) -> Array:
    """The residuals that a user-defined function returned."""
    remedy = "return an array of residuals, shape (n,) or (n, parts)"
    try:
        at = jnp.asarray(found)
    except (TypeError, ValueError) as error:
        problem = f"returns {'None' if found is None else f'a {type(found).__name__}'}, which is not an array"
        raise DesignError(name, problem, remedy) from error
    if at.ndim == 0:
        remedy += "; a function that returns one number is an objective itself, minimise=function"
        raise DesignError(name, "returns one number, not the residuals", remedy)
    if at.ndim > 2 or not at.size:
        raise DesignError(name, f"returns an array of shape {at.shape}", remedy)
    if not jnp.issubdtype(at.dtype, jnp.floating):
        if not jnp.issubdtype(at.dtype, jnp.integer):
            raise DesignError(name, f"returns values of type {at.dtype}, not real numbers", remedy)
        at = at.astype(float)
    return at


def _weighted(at: Array, factors: np.ndarray | None, name: str) -> Array:
    """The residuals times the roots of their weights."""
    if factors is None:
        return at
    if factors.shape not in ((), at.shape, at.shape[:1]):
        problem = f"returns residuals of shape {at.shape}, but its weights have shape {factors.shape}"
        raise DesignError(name, problem, f"write {at.shape[0]} weights")
    return at * jnp.asarray(factors.reshape(factors.shape + (1,) * (at.ndim - factors.ndim)), dtype=at.dtype)
