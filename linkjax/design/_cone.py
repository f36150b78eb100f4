"""Sequential cone programming: linearise every row, solve with exact lengths, trust the step as far as it proves true.

An exact penalty is the merit; the curvature that is left, that of the vectors and of where their peaks are, is gathered
by symmetric rank-one updates, from steps that fail too.
Source: Nocedal and Wright, Numerical Optimization, 2006, ch. 6 and 18.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from linkjax.design._point import MET, Certificate, Point, certify, lengths, look
from linkjax.design._polish import polished
from linkjax.design._problem import Problem
from linkjax.design._subproblem import FINE, ROUGH, Step, solve

RADIUS, LEAST = 0.2, 1e-11  # first and least half width of the box, in units of the variables' ranges
PENALTY, MOST = 10.0, 1e7
NEAR = 1e-3  # a residual below which every digit of a step counts
SAME = 1e-10  # relative difference of two merits that may be rounding


@dataclasses.dataclass
class Path:
    """Where a solver went: its last point, what certifies it, the objective and violation along the way, both scaled,
    and whether the certificate is as good as was asked for."""

    point: Point
    certificate: Certificate
    history: list[tuple[float, float]]
    converged: bool


def descend(
    problem: Problem, z: np.ndarray, *, tolerance: float = 1e-7, steps: int = 200, callback: Callable | None = None
) -> Path:
    """Go from a design, in units of the variables' ranges, to a local optimum.

    A design that cannot be assembled, or does not run, is first made sound. `callback(point, certificate)` hears of every
    step. Ends with a certificate of residual `tolerance`, after so many steps, or where no step improves any more.
    """
    path, bend = begin(problem, z, steps), np.zeros((z.size, z.size))
    if path.point.unsound <= 0:
        bend = _down(problem, path, bend, tolerance, steps, callback)
    for point, certificate in polished(problem, path.point, path.certificate, bend, tolerance):
        path.point, path.certificate = point, certificate
        path.history.append(point.course)
    path.converged = path.certificate.residual <= tolerance and path.point.violation <= MET
    return path


def _down(
    problem: Problem, path: Path, bend: np.ndarray, wanted: float, steps: int, callback: Callable | None
) -> np.ndarray:
    """Follow a path down as long as it gains, or until its residual is as wanted; the curvature gathered."""
    point, step, tolerance = path.point, None, ROUGH
    radius, penalty = RADIUS, PENALTY
    for _ in range(steps):
        if not np.isfinite(point.value + point.violation):
            return bend
        if callback is not None:
            callback(point, path.certificate)
        if path.certificate.residual <= wanted and point.violation <= MET:
            return bend
        if path.certificate.residual <= NEAR:
            tolerance = FINE
        limits = [*point.limits, *point.sound]
        step = solve(point.goals, limits, point.z, radius, _convex(bend), penalty, step, tolerance)
        if step is None:
            return bend
        penalty = _raised(step, penalty, len(point.goals))
        merit = point.value + penalty * point.violation
        expected = merit - step.model
        trial, got = _tried(problem, point, step, penalty)
        moved = trial.z - point.z
        size = float(np.max(np.abs(moved)))
        if np.isfinite(got):  # a step that fails tells as much of the curvature as one that does not
            bend = _sr1(bend, moved, _pull(trial, step) - _pull(point, step) - _turning(point, step, moved))
        better = merit - got >= 1e-4 * expected > 0
        if not better and got <= merit + SAME * abs(merit):  # where rounding hides what is gained
            better = certify(trial).residual < 0.5 * path.certificate.residual
        if not better:
            radius = (0.5 if np.isfinite(got) else 0.25) * min(radius, size)
            if radius < LEAST or expected <= 1e-15 * max(1.0, abs(merit)):
                if tolerance == FINE:
                    return bend
                radius, tolerance = size or RADIUS, FINE
            continue
        share = (merit - got) / expected if expected > SAME * abs(merit) else 0.5
        if share > 0.75 and size > 0.9 * radius:
            radius = min(2 * radius, 1.0)
        elif share < 0.25:
            radius *= 0.5
        point = arrived(path, trial)
    return bend


def begin(problem: Problem, z: np.ndarray, steps: int = 200) -> Path:
    """The path from a design, in units of the variables' ranges, to one that can be assembled and runs: nothing else
    has a meaning before. Its point stays unsound where none is found."""
    point = look(problem, z)
    path = Path(point, certify(point), [point.course], converged=False)
    while path.point.unsound > 0 and len(path.history) <= steps:
        better = _restored(problem, path.point, RADIUS)
        if better is None:
            break
        arrived(path, better)
    return path


def arrived(path: Path, point: Point) -> Point:
    """The next point of a path."""
    path.point, path.certificate = point, certify(point)
    path.history.append(point.course)
    return point


def _raised(step: Step, penalty: float, goals: int) -> float:
    """A penalty above every multiplier."""
    limits = [float(np.sum(weights)) for weights in step.weights[goals:]]
    return min(max(penalty, 2 * max(limits, default=0.0)), MOST)


def _tried(problem: Problem, point: Point, step: Step, penalty: float) -> tuple[Point, float]:
    """The design after a step, and its merit: infinite where the machine is not sound."""
    trial = look(problem, np.clip(point.z + step.d, 0.0, 1.0))
    got = trial.value + penalty * trial.violation
    return trial, np.inf if trial.unsound > 0 or not np.isfinite(got) else got


def _restored(problem: Problem, point: Point, radius: float) -> Point | None:
    """A step towards a machine that can be assembled and runs."""
    for _ in range(12):
        step = solve([], point.sound, point.z, radius, np.zeros((point.z.size,) * 2), PENALTY)
        if step is None:
            return None
        trial = look(problem, np.clip(point.z + step.d, 0.0, 1.0))
        if trial.unsound < point.unsound:
            return trial
        radius *= 0.5
    return None


def _pull(point: Point, step: Step) -> np.ndarray:
    """Gradient of the Lagrangian, sizes of rows weighted by the multipliers of a step."""
    total = np.zeros(point.z.size)
    for block, weights in zip(point.every, step.weights, strict=True):
        held = np.flatnonzero(weights)
        if held.size:
            total = total + weights[held] @ block.gradients(held)
    return total


def _turning(point: Point, step: Step, d: np.ndarray) -> np.ndarray:
    """What the subproblem knows of the curvature already: lengths of linearised vectors, |F + J d|."""
    total = np.zeros(d.size)
    for block, weights in zip(point.every, step.weights, strict=True):
        held = np.flatnonzero(weights) if not block.signed else np.empty(0, int)
        if held.size:
            before, slope = block.rows[held], block.slope[held]
            after = before + slope @ d
            size, grown = lengths(before), lengths(after)
            held = held[fine := (size > 0) & (grown > 0)]
            turned = after[fine] / grown[fine, None] - before[fine] / size[fine, None]
            total = total + np.einsum("r,rp,rpn->n", weights[held], turned, slope[fine])
    return total


def _sr1(bend: np.ndarray, s: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Symmetric rank-one update of the curvature that is left."""
    miss = y - bend @ s
    if not np.isfinite(miss).all():
        return bend
    below = float(miss @ s)
    if abs(below) < 1e-8 * math.sqrt(float(s @ s) * float(miss @ miss)) or not miss.any():
        return bend
    return bend + np.outer(miss, miss) / below


def _convex(bend: np.ndarray) -> np.ndarray:
    """The nearest curvature that bends upwards."""
    values, vectors = np.linalg.eigh(bend)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T
