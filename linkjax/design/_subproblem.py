"""The convex subproblem of the sequential cone solver: linearised rows, exact lengths, a box around the design.

Vectors are linearised, their lengths are not: |F + J d| <= t is a second-order cone, so that the curvature of a peak
that comes from the turning of its vector is exact. Solved by clarabel. Source: Goulart and Chen, Clarabel: an
interior-point solver for conic programs with quadratic objectives, 2024.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from linkjax.design._point import Scaled

TOLERANCE = 1e-13  # more than it reaches: it stops where rounding stops it
FEW = 12  # rows of a block put in at once
MISSED = 1e-10  # a row so far above the others, in the solver's scale, is put in
ROUNDS = 30


class Step(NamedTuple):
    """A step, the multipliers of every row of every block, the model's value, and the rows that were put in."""

    d: Float[np.ndarray, " n"]
    weights: list[Float[np.ndarray, " rows"]]
    model: float
    chosen: list[np.ndarray]


def solve(
    goals: list[Scaled],
    limits: list[Scaled],
    z: np.ndarray,
    radius: float,
    bend: np.ndarray,
    penalty: float,
    like: Step | None = None,
) -> Step | None:
    """The best step within `radius` and the unit box: the largest row of the goals, plus half d' bend d, plus the
    penalised excess of every limit. None where the solver finds no answer.

    Few rows ever matter: those that lead are put in first, with those of a step before, `like`, and others when the
    step found would let them lead.
    """
    blocks = [*goals, *limits]
    low, high = np.maximum(-z, -radius), np.minimum(1 - z, radius)
    chosen = [_leading(block.sizes(), np.full(len(block.rows), -np.inf)) for block in blocks]
    for block, rows, before in zip(blocks, chosen, like.chosen if like else (), strict=False):
        if before.shape == rows.shape:
            rows |= before & (block.sizes() > np.max(block.sizes()) - 0.1 * abs(np.max(block.sizes())))
    step = None
    for _ in range(ROUNDS):
        found = _solve(blocks, len(goals), chosen, low, high, bend, penalty)
        if found is None:
            return None
        step, tops = found
        moved = [_after(block, step.d) for block in blocks]
        missed = [sizes > top + MISSED for sizes, top in zip(moved, tops, strict=True)]
        if not any(np.any(m & ~c) for m, c in zip(missed, chosen, strict=True)):
            return step
        chosen = [c | (_leading(sizes, top) & m) for c, sizes, top, m in zip(chosen, moved, tops, missed, strict=True)]
    return step


def _leading(sizes: np.ndarray, above: np.ndarray | float) -> np.ndarray:
    """The highest of every run of neighbouring rows above a level; at first, the highest few of all."""
    before, after = np.roll(sizes, 1), np.roll(sizes, -1)
    tops = (sizes >= before) & (sizes >= after) & (sizes > above)
    if np.sum(tops) > FEW:
        tops &= sizes >= np.sort(sizes[tops])[-FEW]
    tops[int(np.argmax(sizes))] = True
    return tops


def _after(block: Scaled, d: np.ndarray) -> np.ndarray:
    """Sizes of all rows after a step, by the linear model of the vectors."""
    return block._replace(rows=block.rows + block.slope @ d).sizes()


def _solve(blocks, goals: int, chosen, low, high, bend, penalty) -> tuple[Step, list[float]] | None:
    """The subproblem with the rows chosen: the step, and how high each block's rows may come in it."""
    import clarabel as _clarabel  # a compiled library, loaded when something is optimised
    from scipy import sparse

    clarabel: Any = _clarabel  # it has no types

    n, count = low.size, len(blocks) - goals
    wide = n + 1 + count
    box = np.zeros((2 * n + count + 1, wide))
    box[:n, :n], box[n : 2 * n, :n], box[2 * n : -1, n + 1 :] = np.eye(n), -np.eye(n), -np.eye(count)
    box[-1, n] = 0.0 if goals else -1.0  # without goals nothing else bounds t
    matrix, right, cones = [box], [np.concatenate([high, -low, np.zeros(count + 1)])], []
    cones.append(clarabel.NonnegativeConeT(2 * n + count + 1))
    homes, at = [], 2 * n + count + 1
    for i, (block, rows) in enumerate(zip(blocks, chosen, strict=True)):
        homes.append(at)
        column = n if i < goals else n + 1 + i - goals
        vectors, slope, level = block.rows[rows], block.slope[rows], block.level - block.shift
        size = 1 if block.signed else vectors.shape[1] + 1
        a = np.zeros((len(vectors), size, wide))
        a[:, 0, column] = -1.0
        if block.signed:
            a[:, 0, :n] = slope[:, 0]
            right.append(level - vectors[:, 0])
            cones.append(clarabel.NonnegativeConeT(len(vectors)))
        else:
            a[:, 1:, :n] = -slope
            right.append(np.concatenate([np.full((len(vectors), 1), level), vectors], axis=1).ravel())
            cones += [clarabel.SecondOrderConeT(size)] * len(vectors)
        matrix.append(a.reshape((-1, wide)))
        at += len(vectors) * size
    quadratic = np.zeros((wide, wide))
    quadratic[:n, :n] = np.triu(bend)
    linear = np.concatenate([np.zeros(n), [1.0 if goals else 0.0], np.full(count, penalty)])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    found = clarabel.DefaultSolver(
        sparse.csc_matrix(quadratic), linear, sparse.csc_matrix(np.concatenate(matrix)), np.concatenate(right), cones,
        settings,
    ).solve()  # fmt: skip
    x, dual = np.asarray(found.x), np.asarray(found.z)
    if not (np.isfinite(x).all() and np.isfinite(dual).all()) or "Infeasible" in str(found.status):
        return None
    d, slacks = np.clip(x[:n], low, high), np.maximum(x[n + 1 :], 0.0)
    top = float(x[n]) if goals else 0.0
    weights = [_multipliers(*home, dual) for home in zip(blocks, chosen, homes, strict=True)]
    model = top + 0.5 * float(d @ bend @ d) + penalty * float(np.sum(slacks))
    tops = [top] * goals + [block.level + slack for block, slack in zip(blocks[goals:], slacks, strict=True)]
    return Step(d, weights, model, chosen), tops


def _multipliers(block: Scaled, rows: np.ndarray, at: int, dual: np.ndarray) -> np.ndarray:
    """Multipliers of every row; that of a cone is the first part of its dual."""
    count, size = int(np.sum(rows)), 1 if block.signed else block.rows.shape[1] + 1
    weights = np.zeros(len(rows))
    weights[rows] = dual[at : at + count * size : size]
    return weights
