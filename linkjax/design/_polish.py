"""The last digits of an optimum: Newton's method on its conditions, with the active set fixed.

A solver that compares objectives cannot see an improvement below rounding; the residual of the conditions still can.

A step with an error of 1e-6 of a range changes the objective by 1e-12, which no subproblem resolves. One or two Newton
steps reduce the residual from 1e-6 to 1e-12.
Source: Nocedal and Wright, Numerical Optimization, 2006, ch. 18.1.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from linkjax.design._point import HELD, MET, Certificate, Point, Scaled, certify, lengths, look
from linkjax.design._problem import Problem

STEPS = 4
FAR = 1e-3  # relative to the ranges: a longer step changes more than the last digits


def polished(
    problem: Problem, point: Point, certificate: Certificate, bend: np.ndarray, tolerance: float
) -> Iterator[tuple[Point, Certificate]]:
    """Points that satisfy the optimality conditions better and better, down to a residual of `tolerance`. `bend` is the
    known curvature apart from that of the lengths; it is also tried without."""
    for known in (bend, np.zeros_like(bend)):
        for _ in range(STEPS):
            if certificate.residual <= tolerance or point.violation > MET:
                return
            d = _newton(point, certificate, known)
            if not (np.isfinite(d).all() and np.max(np.abs(d)) <= FAR):
                break
            trial = look(problem, np.clip(point.z + d, 0.0, 1.0))
            found = certify(trial)
            if not (found.residual < certificate.residual and trial.violation <= MET):
                break
            point, certificate = trial, found
            yield point, certificate


def _newton(point: Point, certificate: Certificate, bend: np.ndarray) -> Float[np.ndarray, " n"]:
    """The Newton step to the optimality conditions: active rows at their level, Lagrangian stationary."""
    n, bent, rows, gaps, goal = point.z.size, bend.copy(), [], [], []
    for i, (block, weights) in enumerate(zip(point.every, certificate.weights, strict=True)):
        held = np.flatnonzero(weights > HELD)
        rows.append(block.gradients(held))
        gaps.append(block.sizes[held] - (point.value if i < len(point.goals) else block.level))
        goal.append(np.full(held.size, float(i < len(point.goals))))
        bent += _curvature(block, held, weights[held])
    active, gap, goals = np.concatenate(rows), np.concatenate(gaps), np.concatenate(goal)
    free = np.flatnonzero((certificate.lower <= HELD) & (certificate.upper <= HELD))
    count, m = free.size, gap.size
    # unknowns: the step, the level of the objective, the multipliers
    matrix = np.zeros((count + 1 + m,) * 2)
    matrix[:count, :count], matrix[:count, count + 1 :] = bent[np.ix_(free, free)], active[:, free].T
    matrix[count, count + 1 :] = goals
    matrix[count + 1 :, :count], matrix[count + 1 :, count] = active[:, free], -goals
    right = np.concatenate([np.zeros(count), [1.0], -gap])
    d = np.zeros(n)
    d[free] = np.linalg.lstsq(matrix, right, rcond=1e-12)[0][:count]
    return d


def _curvature(block: Scaled, held: np.ndarray, weights: np.ndarray) -> Float[np.ndarray, "n n"]:
    """Curvature of the lengths of some rows, weighted by their multipliers."""
    size = lengths(block.rows[held])
    if block.signed or not np.all(size > 0):
        return np.zeros((block.slope.shape[-1],) * 2)
    slope = block.slope[held]
    along = np.einsum("rp,rpn->rn", block.rows[held] / size[:, None], slope)
    share = weights / size
    return np.einsum("r,rpn,rpm->nm", share, slope, slope) - np.einsum("r,rn,rm->nm", share, along, along)
