"""A batch of starts: many designs minimise the exact penalty at once, and the best are finished by the cone solver.

The merit is the largest row of the objective plus a multiple of the excess of every constraint. Its derivative is that
of the largest rows, a subgradient, so the steps (Adam) must shrink.
Source: Kingma and Ba, Adam, 2015; Nocedal and Wright, Numerical Optimization, 2006, ch. 17.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from linkjax._compile import compiled_sooner
from linkjax._numerics import largest, safe_sqrt
from linkjax._population import map_designs
from linkjax.design._cone import PENALTY, Path, descend
from linkjax.design._point import rank
from linkjax.design._problem import Problem

CROWD, TURNS = 64, 100
BLOCK = 16  # designs evaluated together
PACE = 0.05  # the first step of every variable, relative to its range
FINISHED = 3  # designs finished by the cone solver
APART = 0.05  # relative to the ranges: designs closer than this in every variable count as the same


def multistart(
    problem: Problem, z: np.ndarray, *, tolerance: float = 1e-7, steps: int = 200, callback: Callable | None = None
) -> Path:
    """The best local optimum found from a batch of starts: the given design, in units of the variables' ranges, and
    others drawn at random within the ranges. `descend` finishes the best distinct ones with `callback`, `tolerance` and
    `steps`. Every evaluated design counts as an evaluation."""
    drawn = np.random.default_rng(np.abs(z).view(np.uint64)).random((CROWD - 1, z.size))
    crowd = np.concatenate([z[None], drawn])
    ended, merits = map(np.asarray, _descent(problem)(jnp.asarray(crowd)))
    problem.evaluations += CROWD * (TURNS + 1)
    chosen: list[np.ndarray] = []
    for one in ended[np.argsort(merits)]:
        if len(chosen) < FINISHED and all(np.max(np.abs(one - other)) > APART for other in chosen):
            chosen.append(one)
    paths = [descend(problem, one, tolerance=tolerance, steps=steps, callback=callback) for one in chosen]
    return min(paths, key=lambda path: rank(path.point))


@functools.lru_cache(maxsize=1)
def _descent(problem: Problem) -> Callable:
    """The descent of a batch, compiled once for a problem: from initial designs to the best design that each has
    reached, with the merits."""
    import optax

    square = jnp.asarray([k.square for k in problem.kinds])
    factors = jnp.asarray([(k.sign if k.signed else 1.0) / k.scale for k in problem.kinds])
    goals = jnp.asarray([k.role == "objective" for k in problem.kinds])
    levels = factors * jnp.asarray([0.0 if k.role == "objective" else k.level for k in problem.kinds])
    lower, span = jnp.asarray(problem.lower), jnp.asarray(problem.upper - problem.lower)
    rule = optax.adam(optax.cosine_decay_schedule(PACE, TURNS))

    def merit(z):
        values = problem.values(lower + z * span)
        values = jnp.where(square, safe_sqrt(values), values) * factors
        excess = jnp.where(goals, 0.0, jnp.maximum(values - levels, 0.0))
        return largest(jnp.where(goals, values, -jnp.inf)) + PENALTY * jnp.sum(excess)

    def turn(state, _):
        z, held, best, least = state
        slope, value = jax.jacfwd(lambda z: (merit(z),) * 2, has_aux=True)(z)  # compiles faster than reverse mode
        better = value < least  # false for NaN
        best, least = jnp.where(better, z, best), jnp.where(better, value, least)
        change, held = rule.update(jnp.nan_to_num(slope), held)
        return (jnp.clip(z + change, 0.0, 1.0), held, best, least), None

    def one(z):
        begin = z, rule.init(z), z, jnp.full((), jnp.inf)
        _, _, best, least = jax.lax.scan(turn, begin, None, length=TURNS + 1)[0]
        return best, least

    begin = jnp.zeros((CROWD, lower.size))
    with jax.numpy_dtype_promotion("standard"):  # optax relies on it
        return compiled_sooner(jax.jit(map_designs(one, block=BLOCK)).lower(begin))
