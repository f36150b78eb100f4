"""The convex subproblem of the sequential cone solver: linearised rows, exact lengths, a box around the design.

Vectors are linearised, their lengths are not: |F + J d| <= t is a second-order cone, so that the curvature of a peak
that comes from the turning of its vector is exact. Solved by clarabel. Source: Goulart and Chen, Clarabel: an
interior-point solver for conic programs with quadratic objectives, 2024.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from linkjax.design._point import Scaled, lengths

ROUGH, FINE = 1e-9, 1e-13  # tolerances; the finer is more than the solver reaches: it stops where rounding stops it
FEW = 6  # rows of a block put in at once
KEPT = 1e-6  # a multiplier of a step before that puts its row in
MISSED = 1e-10  # a row so far above the others, in the solver's scale, is put in
LOOSE = 0.02  # and so many times what the step gains
FAR = 1e-2  # while that is more than so much
ROUNDS = 30


class Step(NamedTuple):
    """A step, the multipliers of every row of every block, and the model's value."""

    d: Float[np.ndarray, " n"]
    weights: list[Float[np.ndarray, " rows"]]
    model: float


def solve(
    goals: list[Scaled],
    limits: list[Scaled],
    z: np.ndarray,
    radius: float,
    bend: np.ndarray,
    penalty: float,
    like: Step | None = None,
    tolerance: float = ROUGH,
) -> Step | None:
    """The best step within `radius` and the unit box: the largest row of the goals, plus half d' bend d, plus the
    penalised excess of every limit. None where the solver finds no answer.

    Few rows ever matter: those that lead are put in first, with those that held a step before, `like`, and others when
    the step found would let them lead; those out of reach never.
    """
    blocks = [*goals, *limits]
    low, high = np.maximum(-z, -radius), np.minimum(1 - z, radius)
    able = _able(goals, limits, np.maximum(-low, high))
    chosen = [_leading(block.sizes, some) for block, some in zip(blocks, able, strict=True)]
    for rows, some, before in zip(chosen, able, like.weights if like else (), strict=False):
        if before.shape == rows.shape:
            rows |= (before > KEPT) & some
    step = None
    merit = max((goal.top for goal in goals), default=0.0) + penalty * sum(max(one.excess(), 0.0) for one in limits)
    for _ in range(ROUNDS):
        found = _solve(blocks, len(goals), chosen, low, high, bend, penalty, tolerance)
        if found is None:
            return None
        step, tops = found
        fresh, room = False, MISSED + (LOOSE * (merit - step.model) if merit - step.model > FAR else 0.0)
        for block, rows, some, top in zip(blocks, chosen, able, tops, strict=True):
            if np.any(some):
                sizes = block.after(step.d)
                missed = (sizes > top + room) & some & ~rows
                if np.any(missed):
                    rows |= _leading(sizes, (sizes > top + room) & some) & missed
                    fresh = True
        if not fresh:
            return step
    return step


def _able(goals: list[Scaled], limits: list[Scaled], reach: np.ndarray) -> list[np.ndarray]:
    """The rows that can matter within a step of so much in every variable: lead the goals, or come to their level."""
    moves = [_reach(block, reach) for block in [*goals, *limits]]
    most = max((float(np.max(goal.sizes - move)) for goal, move in zip(goals, moves, strict=False)), default=0.0)
    levels = [most] * len(goals) + [block.level for block in limits]
    return [block.sizes + move >= level for block, move, level in zip([*goals, *limits], moves, levels, strict=True)]


def _reach(block: Scaled, reach: np.ndarray) -> Float[np.ndarray, " rows"]:
    """How much, at most, the size of every row changes."""
    moved = np.abs(block.slope) @ reach
    return moved[:, 0] if block.signed else lengths(moved)


def _leading(sizes: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Of some rows, the highest few of those higher than their neighbours, and these neighbours: a peak moves."""
    heights = np.where(some, sizes, -np.inf)
    tops = some.copy()
    tops[1:] &= heights[1:] >= heights[:-1]
    tops[:-1] &= heights[:-1] >= heights[1:]
    if np.count_nonzero(tops) > FEW:
        tops &= heights >= np.sort(heights[tops])[-FEW]
    beside = tops.copy()
    beside[1:] |= tops[:-1]
    beside[:-1] |= tops[1:]
    return beside & some


def _solve(blocks, goals: int, chosen, low, high, bend, penalty, tolerance) -> tuple[Step, list[float]] | None:
    """The subproblem with the rows chosen: the step, and how high each block's rows may come in it."""
    import clarabel as _clarabel  # a compiled library, loaded when something is optimised

    clarabel: Any = _clarabel  # it has no types

    n = low.size
    slacks = [i for i in range(goals, len(blocks)) if np.any(chosen[i])]  # blocks that need one
    wide = n + 1 + len(slacks)
    lines = 2 * n + len(slacks) + 1
    box = np.zeros((lines, wide))
    box[:n, :n], box[n : 2 * n, :n], box[2 * n : -1, n + 1 :] = np.eye(n), -np.eye(n), -np.eye(len(slacks))
    box[-1, n] = 0.0 if goals else -1.0  # without goals nothing else bounds t
    matrix, right = [box], [high, -low, np.zeros(len(slacks) + 1)]
    cones, homes, at = [clarabel.NonnegativeConeT(lines)], [], lines
    for i, (block, rows) in enumerate(zip(blocks, chosen, strict=True)):
        homes.append(at)
        held = np.flatnonzero(rows)
        if not held.size:
            continue
        column = n if i < goals else n + 1 + slacks.index(i)
        vectors, slope, level = block.rows[held], block.slope[held], block.level - block.shift
        size = 1 if block.signed else vectors.shape[1] + 1
        a = np.zeros((held.size, size, wide))
        a[:, 0, column] = -1.0
        if block.signed:
            a[:, 0, :n] = slope[:, 0]
            right.append(level - vectors[:, 0])
            cones.append(clarabel.NonnegativeConeT(held.size))
        else:
            a[:, 1:, :n] = -slope
            right.append(np.concatenate([np.full((held.size, 1), level), vectors], axis=1).ravel())
            cones += [clarabel.SecondOrderConeT(size)] * held.size
        matrix.append(a.reshape((-1, wide)))
        at += held.size * size
    quadratic = np.zeros((wide, wide))
    quadratic[:n, :n] = np.triu(bend)
    linear = np.concatenate([np.zeros(n), [1.0 if goals else 0.0], np.full(len(slacks), penalty)])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.iterative_refinement_enable = False  # a third of the time, for digits that nothing needs
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    found = clarabel.DefaultSolver(
        _sparse(quadratic), linear, _sparse(np.concatenate(matrix)), np.concatenate(right), cones, settings
    ).solve()
    x, dual = np.asarray(found.x), np.asarray(found.z)
    if not (np.isfinite(x).all() and np.isfinite(dual).all()) or "Infeasible" in str(found.status):
        return None
    d, over = np.clip(x[:n], low, high), np.maximum(x[n + 1 :], 0.0)
    top = float(x[n]) if goals else 0.0
    weights = [_multipliers(*home, dual) for home in zip(blocks, chosen, homes, strict=True)]
    model = top + 0.5 * float(d @ bend @ d) + penalty * float(np.sum(over))
    excess = dict(zip(slacks, over, strict=True))
    tops = [top if i < goals else block.level + excess.get(i, 0.0) for i, block in enumerate(blocks)]
    return Step(d, weights, model), tops


def _sparse(matrix: np.ndarray) -> Any:
    """A matrix by its columns, zeros left out; several times faster than SciPy's own way."""
    from scipy import sparse

    turned = matrix.T
    held = turned != 0
    column, row = np.nonzero(held)
    starts = np.searchsorted(column, np.arange(matrix.shape[1] + 1))
    return sparse.csc_matrix((turned[held], row, starts), shape=matrix.shape)


def _multipliers(block: Scaled, rows: np.ndarray, at: int, dual: np.ndarray) -> np.ndarray:
    """Multipliers of every row; that of a cone is the first part of its dual."""
    count, size = int(np.sum(rows)), 1 if block.signed else block.rows.shape[1] + 1
    weights = np.zeros(len(rows))
    weights[rows] = dual[at : at + count * size : size]
    return weights
