"""Sequential cone programming: linearise every row, solve with exact lengths, adapt the trust region to the result.

An exact penalty is the merit function. The remaining curvature, of the vectors and of the positions of their peaks, is
approximated by symmetric rank-one updates, also from rejected steps.

Measured on the hay press with ten design variables: 10 to 120 evaluations per start. Damped BFGS on the Lagrangian with
its own multipliers missed the moving positions and stopped at a residual of 1e-5 to 1e-3. Subproblems are solved to
nine digits only until the residual is 1e-3, since `_polish` finds the last digits; with full accuracy throughout, the
demo took a tenth more steps.

With sums of squares three things are added. The curvature is used only if it predicted the last step better than
Gauss and Newton's model without it (Dennis, Gay and Welsch, An adaptive nonlinear least-squares algorithm, 1981). A
step that gains less than expected is corrected to second order in the residuals and margins: it costs an evaluation
and follows curved valleys. A design that violates simple constraints is repaired even if it can be assembled.
Measured on a four-bar through five points, 40 random starts: 5 reach the optimum without these, 16 with the first, 27
with the repair of unsound designs, too, and more with all (`benchmarks/synthesis.py`).
Where two constraints hold a value from both sides, or a step is rejected because it leaves the curved surface of one,
steps are corrected to second order in the constraints, too: without
it, a crank-rocker of given angle of oscillation and time ratio crept along their surface (206 evaluations, now 19).
Source: Nocedal and Wright, Numerical Optimization, 2006, ch. 6, 10 and 18.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from linkjax.design._point import MET, Certificate, Point, Scaled, certify, lengths, look
from linkjax.design._polish import polished
from linkjax.design._problem import Problem
from linkjax.design._subproblem import FINE, ROUGH, Step, solve

RADIUS, LEAST = 0.2, 1e-11  # initial and smallest half width of the trust region, in units of the variables' ranges
PENALTY, MOST = 10.0, 1e7
SATURATED = 0.99  # of the penalty: multipliers of a constraint that stays violated
WORTH = 1e-4  # of the violation: a smaller gain is none
FIRST = 1e3  # in the repair of a design: weight of constraints against margins, whose scale is a thousandth
SHARP = 0.75  # with squares: a step with a smaller share of the expected improvement is corrected to second order
LAST = 0.05  # with squares: share of the tolerance to which the last digits are found; their evaluations are cheap
RESERVE = 1.5  # times the error of the linear model of a margin: its correction
NEAR = 1e-3  # a residual below which steps are solved to full precision
SAME = 1e-10  # relative difference of two merits that can be rounding


@dataclasses.dataclass
class Path:
    """The steps of a solver: its last point with the certificate, the history of objective and violation, both scaled,
    and whether the certificate meets the tolerance."""

    point: Point
    certificate: Certificate
    history: list[tuple[float, float]]
    converged: bool


def descend(
    problem: Problem, z: np.ndarray, *, tolerance: float = 1e-7, steps: int = 200, callback: Callable | None = None
) -> Path:
    """Go from a design, in units of the variables' ranges, to a local optimum.

    A design that cannot be assembled, or has no steady-state motion, is repaired first. `callback(point, certificate)`
    is called after every step. Stops at a certificate of residual `tolerance`, after `steps` steps, or when no step
    improves the merit.
    """
    path, bend = begin(problem, z, steps), np.zeros((z.size, z.size))
    if path.point.unsound <= 0:
        bend = _down(problem, path, bend, tolerance, steps, callback)
    last = tolerance * (LAST if _has_squares(problem) else 1.0)
    for point, certificate in polished(problem, path.point, path.certificate, bend, last):
        path.point, path.certificate = point, certificate
        path.history.append(point.course)
    path.converged = path.certificate.residual <= tolerance and path.point.violation <= MET
    return path


def _down(
    problem: Problem, path: Path, bend: np.ndarray, wanted: float, steps: int, callback: Callable | None
) -> np.ndarray:
    """Take steps while they improve the merit, until the residual is as wanted; returns the approximate curvature."""
    point, step, tolerance = path.point, None, ROUGH
    radius, penalty = RADIUS, PENALTY
    squares = _has_squares(problem)
    held, curved = _holds(problem), not squares  # whether the model has the approximate curvature
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
        convex = _convex(bend)
        model = convex if curved else np.zeros_like(bend)
        step, penalty = (_raised if held else _steered)(point, limits, radius, model, penalty, step, tolerance)
        if step is None:
            return bend
        merit = point.value + penalty * point.violation
        expected = merit - step.model
        trial, got = _tried(problem, point, step, penalty)
        curbed = trial.violation > max(point.violation, MET) and not merit - got > 0
        if curbed or ((squares or held) and not merit - got >= SHARP * expected):
            second = solve(*_bent(point, trial, held or curbed), point.z, radius, model, penalty, step, tolerance)
            other, found = (trial, got) if second is None else _tried(problem, point, second, penalty)
            if found < got:
                trial, got = other, found
        moved = trial.z - point.z
        size = float(np.max(np.abs(moved)))
        if squares and np.isfinite(got):
            more = 0.5 * float(moved @ convex @ moved)
            without = step.model - (more if curved else 0.0)
            curved = abs(got - without - more) < abs(got - without)
        if np.isfinite(got):  # a rejected step gives as much curvature as an accepted one
            bend = _sr1(bend, moved, _pull(trial, step) - _pull(point, step) - _turning(point, step, moved))
        better = merit - got >= 1e-4 * expected > 0
        if not better and got <= merit + SAME * abs(merit):  # where rounding hides the improvement
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
    """The path from a design, in units of the variables' ranges, to one that can be assembled and runs: before that, no
    other value is meaningful. If there is none, the last point stays unsound."""
    point = look(problem, z)
    path = Path(point, certify(point), [point.course], converged=False)
    first = _first if _has_squares(problem) else lambda point: []
    while _amiss(path.point, first) > 0 and len(path.history) <= steps:
        better = _restored(problem, path.point, RADIUS, first)
        if better is None:
            break
        arrived(path, better)
    if path.point.unsound > point.unsound:  # constraints were met, but by no machine that can be assembled
        arrived(path, point)
    return path


def arrived(path: Path, point: Point) -> Point:
    """Append a point to a path."""
    path.point, path.certificate = point, certify(point)
    path.history.append(point.course)
    return point


def _raised(
    point: Point, limits: list[Scaled], radius: float, bend: np.ndarray, penalty: float, like: Step | None,
    tolerance: float,
) -> tuple[Step | None, float]:  # fmt: skip
    """A step, and a penalty larger than every multiplier, where constraints hold a value from both sides: only the
    difference of their multipliers is known, so that a penalty that is steered by them grows without limit (measured:
    a stroke held exactly, 7 evaluations; steered, the residual stayed at 2e-5)."""
    step = solve(point.goals, limits, point.z, radius, bend, penalty, like, tolerance)
    if step is None:
        return None, penalty
    most = max((float(np.sum(weights)) for weights in step.weights[len(point.goals) :]), default=0.0)
    return step, min(max(penalty, 2 * most), MOST)


def _steered(
    point: Point, limits: list[Scaled], radius: float, bend: np.ndarray, penalty: float, like: Step | None,
    tolerance: float,
) -> tuple[Step | None, float]:  # fmt: skip
    """A step and the penalty of its merit. The penalty becomes larger than every multiplier; and where constraints stay
    violated in the model, so large that the step gains half of what the best step within the radius could gain. There
    every multiplier equals the penalty, however large that is.

    Source: Byrd, Nocedal and Waltz, Steering exact penalty methods for nonlinear programming, 2008.
    """
    while (step := solve(point.goals, limits, point.z, radius, bend, penalty, like, tolerance)) is not None:
        most = max((float(np.sum(weights)) for weights in step.weights[len(point.goals) :]), default=0.0)
        if most < SATURATED * penalty:
            if point.violation <= MET:  # there the merit is the objective, with any penalty
                penalty = min(penalty, max(PENALTY, 4 * most))
            return step, min(max(penalty, 2 * most), MOST)
        best = solve([], limits, point.z, radius, np.zeros_like(bend), 1.0)
        gain = 0.0 if best is None else point.violation - best.model
        left = sum(max(float(np.max(one.after(step.d))) - one.level, 0.0) for one in limits)
        if gain <= WORTH * point.violation or point.violation - left >= 0.5 * gain or penalty >= MOST:
            break
        penalty = min(4 * penalty, MOST)
    return step, penalty


def _tried(problem: Problem, point: Point, step: Step, penalty: float) -> tuple[Point, float]:
    """The design after a step, and its merit: infinite for a machine that is not sound."""
    trial = look(problem, np.clip(point.z + step.d, 0.0, 1.0))
    got = trial.value + penalty * trial.violation
    return trial, np.inf if trial.unsound > 0 or not np.isfinite(got) else got


def _restored(problem: Problem, point: Point, radius: float, first: Callable[[Point], list[Scaled]]) -> Point | None:
    """A step towards a machine that can be assembled and runs, and satisfies the constraints that come first."""
    for _ in range(12):
        step = solve([], [*first(point), *point.sound], point.z, radius, np.zeros((point.z.size,) * 2), PENALTY)
        if step is None:
            return None
        trial = look(problem, np.clip(point.z + step.d, 0.0, 1.0))
        if _amiss(trial, first) < _amiss(point, first):
            return trial
        radius *= 0.5
    return None


def _bent(point: Point, trial: Point, held: bool) -> tuple[list[Scaled], list[Scaled]]:
    """Objective and constraints with linear models that are exact after a trial step, and margins with a reserve."""
    d = trial.z - point.z
    pairs = zip(point.goals, trial.goals, strict=True)
    goals = [goal.bent_to(other, d) if other.exists else goal for goal, other in pairs]
    sound = [one.bent_to(other, d, RESERVE) for one, other in zip(point.sound, trial.sound, strict=True)]
    both = zip(point.limits, trial.limits, strict=True)
    limits = [a.bent_to(b, d) if b.exists else a for a, b in both] if held else point.limits
    return goals, [*limits, *sound]


def _holds(problem: Problem) -> bool:
    """Whether two constraints hold a value from both sides: steps leave their curved surface, and are corrected."""
    seen = {}
    for kind in problem.kinds:
        if kind.role == "limit":
            name = kind.name.removesuffix(" at most").removesuffix(" at least")
            seen.setdefault((name, kind.case, kind.bound), set()).add(kind.sign)
    return any(len(signs) == 2 for signs in seen.values())


def _has_squares(problem: Problem) -> bool:
    """Whether it is one of least squares."""
    return any(kind.square for kind in problem.kinds)


def _first(point: Point) -> list[Scaled]:
    """The constraints on one number that have a value, with a larger weight than margins: a crank that must be the
    shortest link rotates fully in another way than one that is longer than the frame, and there is no way between."""
    return [one.times(FIRST) for one in point.limits if one.exists and one.signed and len(one.rows) == 1]


def _amiss(point: Point, first: Callable[[Point], list[Scaled]]) -> float:
    """What a repair makes small: the shortfall of the margins, and the excess of constraints that come first."""
    return point.unsound + sum(max(one.excess() - FIRST * MET, 0.0) for one in first(point))


def _pull(point: Point, step: Step) -> np.ndarray:
    """Gradient of the Lagrangian: sizes of rows, weighted by the multipliers of a step."""
    total = np.zeros(point.z.size)
    for block, weights in zip(point.every, step.weights, strict=True):
        held = np.flatnonzero(weights)
        if held.size:
            total = total + weights[held] @ block.gradients(held)
    return total


def _turning(point: Point, step: Step, d: np.ndarray) -> np.ndarray:
    """The curvature that the subproblem already contains: lengths of linearised vectors, |F + J d|."""
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
    """Symmetric rank-one update of the remaining curvature."""
    miss = y - bend @ s
    if not np.isfinite(miss).all():
        return bend
    below = float(miss @ s)
    if abs(below) < 1e-8 * math.sqrt(float(s @ s) * float(miss @ miss)) or not miss.any():
        return bend
    return bend + np.outer(miss, miss) / below


def _convex(bend: np.ndarray) -> np.ndarray:
    """The nearest positive semidefinite curvature."""
    values, vectors = np.linalg.eigh(bend)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T
