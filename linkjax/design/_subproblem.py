"""The convex subproblem of the sequential cone solver: linearised rows, exact lengths, a box around the design.

Vectors are linearised, their lengths are not: |F + J d| <= t is a second-order cone. The curvature of a peak due to the
rotation of its vector is therefore exact. Solved by clarabel. Source: Goulart and Chen, Clarabel: an
interior-point solver for conic programs with quadratic objectives, 2024.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from linkjax.design._point import Scaled, lengths

ROUGH, FINE = 1e-9, 1e-13  # tolerances; the finer one is below rounding, so the solver stops at rounding
FEW = 6  # rows of a block added at once
KEPT = 1e-6  # a row with such a multiplier in the step before is added
MISSED = 1e-10  # a row this far above the level (scaled) is added
LOOSE = 0.02  # plus this fraction of the improvement by the step
FAR = 1e-2  # if the improvement exceeds this
ROUNDS = 30


class Step(NamedTuple):
    """A step, the multipliers of every row of every block, and the value of the model."""

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
    """The best step within `radius` and the unit box. It minimises the largest row of the objective, plus
    half d' bend d, plus the penalised excess of every constraint. None if the solver fails.

    Only few rows matter. The largest ones are included first, with the active ones of the step before, `like`. Others
    are added when the computed step would make them the largest. Rows that cannot be reached are never included.
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
            if some.any():
                sizes = block.after(step.d)
                missed = (sizes > top + room) & some & ~rows
                if missed.any():
                    rows |= _leading(sizes, (sizes > top + room) & some) & missed
                    fresh = True
        if not fresh:
            return step
    return step


def _able(goals: list[Scaled], limits: list[Scaled], reach: np.ndarray) -> list[np.ndarray]:
    """The rows that can become active within a step: the largest of the objective, or at their level."""
    moves = [_reach(block, reach) for block in [*goals, *limits]]
    most = max((float(np.max(goal.sizes - move)) for goal, move in zip(goals, moves, strict=False)), default=0.0)
    levels = [most] * len(goals) + [block.level for block in limits]
    return [block.sizes + move >= level for block, move, level in zip([*goals, *limits], moves, levels, strict=True)]


def _reach(block: Scaled, reach: np.ndarray) -> Float[np.ndarray, " rows"]:
    """Upper bound of the change of the size of every row."""
    moved = np.abs(block.slope) @ reach
    return moved[:, 0] if block.signed else lengths(moved)


def _leading(sizes: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Of some rows, the few largest local maxima, and their neighbours, since a peak moves."""
    tops = some.copy()
    if not some.any():
        return tops
    heights = np.where(some, sizes, -np.inf)
    tops[1:] &= heights[1:] >= heights[:-1]
    tops[:-1] &= heights[:-1] >= heights[1:]
    if np.count_nonzero(tops) > FEW:
        tops &= heights >= np.sort(heights[tops])[-FEW]
    beside = tops.copy()
    beside[1:] |= tops[:-1]
    beside[:-1] |= tops[1:]
    return beside & some


def _solve(blocks, goals: int, chosen, low, high, bend, penalty, tolerance) -> tuple[Step, list[float]] | None:
    """The subproblem with the chosen rows: the step, and the highest level of the rows of each block."""
    import clarabel as _clarabel  # a compiled library, loaded only for an optimisation

    clarabel: Any = _clarabel  # it has no types

    n, held = low.size, [np.flatnonzero(rows) for rows in chosen]
    slacks = [i for i in range(goals, len(blocks)) if held[i].size]  # blocks with a slack
    matrix, right, homes = _lines(blocks, goals, held, slacks, low, high)
    cones = [clarabel.NonnegativeConeT(2 * n + len(slacks) + (not goals))]
    for block, some in zip(blocks, held, strict=True):
        if some.size:
            size = block.rows.shape[1] + 1
            many = [clarabel.SecondOrderConeT(size)] * some.size
            cones += [clarabel.NonnegativeConeT(some.size)] if block.signed else many
    linear = np.concatenate([np.zeros(n), [1.0 if goals else 0.0], np.full(len(slacks), penalty)])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.iterative_refinement_enable = False  # saves a third of the time; the digits are not needed
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    found = clarabel.DefaultSolver(_quadratic(bend, linear.size), linear, matrix, right, cones, settings).solve()
    x, dual = np.asarray(found.x), np.asarray(found.z)
    if not (np.isfinite(x).all() and np.isfinite(dual).all()) or "Infeasible" in str(found.status):
        return None
    d, over = np.clip(x[:n], low, high), np.maximum(x[n + 1 :], 0.0)
    top = float(x[n]) if goals else 0.0
    weights = [np.zeros(len(rows)) for rows in chosen]
    for one, some, home in zip(weights, held, homes, strict=True):
        one[some] = dual[home]  # for a cone, the first part of its dual
    model = top + 0.5 * float(d @ bend @ d) + penalty * float(np.sum(over))
    excess = dict(zip(slacks, over, strict=True))
    tops = [top if i < goals else block.level + excess.get(i, 0.0) for i, block in enumerate(blocks)]
    return Step(d, weights, model), tops


def _lines(blocks, goals: int, held, slacks, low, high) -> tuple[Any, np.ndarray, list[np.ndarray]]:
    """The constraints of a subproblem, matrix x + s = right with s in the cones, and the line of every included row.

    Unknowns: the step, the level of the objective, the slacks. Lines: the box, the non-negative slacks, the level if
    there is no objective, then every row, with the level of a cone before its vector. The matrix is built directly in
    compressed columns, several times faster than SciPy's conversion from a dense one.
    """
    from scipy.sparse import csc_matrix

    n, at = low.size, 2 * low.size + len(slacks) + (not goals)
    box = np.arange(at, dtype=np.int32)
    right, slopes, lines, homes = [high, -low, np.zeros(at - 2 * n)], [np.empty((0, n))], [box[:0]], []
    rising = [[] if goals else [box[-1:]], *([box[2 * n + i :][:1]] for i in range(len(slacks)))]  # level, slacks
    for i, (block, some) in enumerate(zip(blocks, held, strict=True)):
        level, vectors = block.level, block.rows[some]
        size = 1 if block.signed else vectors.shape[1] + 1
        every = np.arange(at, at + some.size * size, dtype=np.int32).reshape((-1, size))
        homes.append(every[:, 0])
        if not some.size:
            continue
        if block.signed:
            right.append(level - vectors[:, 0])
            slopes.append(block.slope[some, 0])
            lines.append(every[:, 0])
        else:
            right.append(np.concatenate([np.full((some.size, 1), level), vectors], axis=1).ravel())
            slopes.append(-block.slope[some].reshape((-1, n)))
            lines.append(every[:, 1:].ravel())
        rising[0 if i < goals else 1 + slacks.index(i)].append(every[:, 0])
        at += every.size
    body, ends = np.concatenate(slopes), [np.concatenate(one) for one in rising]
    values, places = np.empty((n, 2 + len(body))), np.empty((n, 2 + len(body)), np.int32)
    values[:, 0], values[:, 1], values[:, 2:] = 1.0, -1.0, body.T
    places[:, 0], places[:, 1], places[:, 2:] = box[:n], box[n : 2 * n], np.concatenate(lines)
    starts = np.cumsum([0, *[2 + len(body)] * n, *(len(one) for one in ends)], dtype=np.int32)
    values = np.concatenate([values.ravel(), np.full(sum(len(one) for one in ends), -1.0)])
    matrix = csc_matrix((values, np.concatenate([places.ravel(), *ends]), starts), shape=(at, n + len(ends)))
    return matrix, np.concatenate(right), homes


def _quadratic(bend: np.ndarray, wide: int) -> Any:
    """Upper triangle of a curvature, by columns, in `wide` unknowns."""
    from scipy.sparse import csc_matrix

    half = np.tri(len(bend), dtype=bool)  # the lower triangle by rows
    starts = np.cumsum([0, *range(1, len(bend) + 1), *[0] * (wide - len(bend))], dtype=np.int32)
    return csc_matrix((bend[half], np.nonzero(half)[1].astype(np.int32), starts), shape=(wide, wide))
