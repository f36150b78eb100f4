"""Sequential cone programming: linearise every row, solve with exact lengths, trust the step as far as it proves true.

An exact penalty is the merit; the curvature that is left, that of the vectors themselves, is gathered by damped BFGS
(Powell 1978); a step that fails through the curvature of limits gets a second-order correction. Source: Nocedal and
Wright, Numerical Optimization, 2006, ch. 18.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from linkjax.design._problem import Block, Problem
from linkjax.design._subproblem import Scaled, Step, scaled, solve

RADIUS, LEAST = 0.2, 1e-11  # first and least half width of the box, in units of the variables' ranges
PENALTY, MOST = 10.0, 1e7


@dataclasses.dataclass
class Point:
    """A design with everything known of it."""

    z: np.ndarray
    blocks: list[Block]
    goals: list[Scaled]
    limits: list[Scaled]
    sound: list[Scaled]

    @property
    def value(self) -> float:
        """The objective, scaled."""
        return max(goal.excess() for goal in self.goals)

    @property
    def violation(self) -> float:
        """Sum of the excess of all limits, scaled."""
        return sum(max(limit.excess(), 0.0) for limit in [*self.limits, *self.sound])

    @property
    def unsound(self) -> float:
        """What is missing to a machine that can be assembled and runs, scaled; zero when nothing is."""
        return sum(max(limit.excess(), 0.0) for limit in self.sound)


@dataclasses.dataclass
class Path:
    """Where a solver went: its last point, multipliers of every block there, the residual of the optimality conditions
    in the solver's scale, the number of steps, and the objective and violation along the way."""

    point: Point
    multipliers: list[np.ndarray]
    weights: list[np.ndarray]
    residual: float
    history: list[tuple[float, float]]
    converged: bool


def look(problem: Problem, z: np.ndarray) -> Point:
    """Evaluate a design given in units of the variables' ranges."""
    span = problem.upper - problem.lower
    blocks = problem.at(problem.lower + z * span)
    every = [(kind.role, scaled(kind, block, span)) for kind, block in zip(problem.kinds, blocks, strict=True)]
    goals, limits, sound = ([b for role, b in every if role == wanted] for wanted in ("objective", "limit", "sound"))
    return Point(z, blocks, goals, limits, sound)


def minimise(
    problem: Problem, z: np.ndarray, *, tolerance: float = 1e-8, steps: int = 200, told: Callable | None = None
) -> Path:
    """Go from a design to a local optimum."""
    point = look(problem, z)
    n, radius, penalty = z.size, RADIUS, PENALTY
    bend = np.zeros((n, n))
    history = [(point.value, point.violation)]
    path = Path(point, [], [], np.inf, history, converged=False)
    for _ in range(steps):
        if point.unsound > 0:
            better = _restore(problem, point, radius)
            if better is None:
                return path
            point, path.point = better, better
            history.append((point.value, point.violation))
            continue
        step = _step(point, radius, bend, penalty)
        if step is None:
            return path
        penalty = _raised(step, penalty, len(point.goals))
        path.multipliers, path.weights = step.multipliers, step.weights
        path.residual = residual(point, step)
        if told is not None:
            told(point, path.residual)
        if path.residual <= tolerance:
            path.converged = True
            return path
        merit = point.value + penalty * point.violation
        expected = merit - step.model
        trial, got = _try(problem, point, step, penalty)
        if merit - got < 0.1 * expected:
            again = _corrected(problem, point, trial, step, radius, bend, penalty)
            if again is not None and merit - again[1] >= 0.1 * expected:
                trial, got = again
        if merit - got < 1e-4 * expected:
            size = float(np.max(np.abs(step.d)))
            radius = (0.5 if np.isfinite(got) else 0.25) * min(radius, size)
            if radius < LEAST or expected <= 1e-15 * max(1.0, abs(merit)):
                return path
            continue
        share = (merit - got) / expected if expected > 0 else 1.0
        bend = _bfgs(bend, trial.z - point.z, _pull(trial, step) - _pull(point, step))
        size = float(np.max(np.abs(trial.z - point.z)))
        radius = min(2 * radius, 1.0) if share > 0.75 and size > 0.9 * radius else radius
        radius = 0.5 * radius if share < 0.25 else radius
        point = path.point = trial
        history.append((point.value, point.violation))
    return path


def _step(point: Point, radius: float, bend: np.ndarray, penalty: float) -> Step | None:
    return solve(point.goals, [*point.limits, *point.sound], point.z, radius, bend, penalty)


def _raised(step: Step, penalty: float, goals: int) -> float:
    """A penalty above every multiplier."""
    limits = [float(np.sum(weights)) for weights in step.weights[goals:]]
    return min(max(penalty, 2 * max(limits, default=0.0)), MOST)


def _try(problem: Problem, point: Point, step: Step, penalty: float) -> tuple[Point, float]:
    """The design after a step, and its merit: infinite where the machine is not sound."""
    trial = look(problem, np.clip(point.z + step.d, 0.0, 1.0))
    got = trial.value + penalty * trial.violation
    return trial, np.inf if trial.unsound > 0 or not np.isfinite(got) else got


def _corrected(problem: Problem, point, trial: Point, step: Step, radius, bend, penalty):
    """Second-order correction: the same slopes with the values found at the trial point."""

    def moved(here: Scaled, there: Scaled) -> Scaled:
        if here.rows.shape != there.rows.shape:
            return here
        return here._replace(rows=there.rows - here.slope @ step.d, shift=there.shift)

    if not all(np.isfinite(b.rows).all() for b in [*trial.goals, *trial.limits, *trial.sound]):
        return None
    goals = [moved(a, b) for a, b in zip(point.goals, trial.goals, strict=True)]
    limits = [moved(a, b) for a, b in zip([*point.limits, *point.sound], [*trial.limits, *trial.sound], strict=True)]
    second = solve(goals, limits, point.z, radius, bend, penalty)
    return None if second is None else _try(problem, point, second, penalty)


def _restore(problem: Problem, point: Point, radius: float) -> Point | None:
    """Towards a machine that can be assembled and runs; nothing else has a meaning before."""
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
    """Gradient of the Lagrangian for the multipliers of a step."""
    total = np.zeros(point.z.size)
    for block, y in zip([*point.goals, *point.limits, *point.sound], step.multipliers, strict=True):
        if block.rows.shape == y.shape:
            total = total + np.einsum("rp,rpn->n", y, block.slope)
    return total


def residual(point: Point, step: Step) -> float:
    """The largest violation of the optimality conditions (Karush-Kuhn-Tucker) in the solver's scale."""
    pull = _pull(point, step)
    still = float(np.max(np.abs(point.z - np.clip(point.z - pull, 0.0, 1.0))))
    loose, top = 0.0, point.value
    every = [*point.goals, *point.limits, *point.sound]
    for i, (block, y, weights) in enumerate(zip(every, step.multipliers, step.weights, strict=True)):
        level = top if i < len(point.goals) else block.level
        along = np.sum(y * block.rows, axis=1)
        loose += float(np.sum(np.abs(weights * (level - block.shift) - along)))
    return max(still, loose, point.violation)


def _bfgs(bend: np.ndarray, s: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Damped BFGS update of the curvature of the Lagrangian."""
    if not np.any(s):
        return bend
    if not np.any(bend):
        bend = max(float(y @ s) / float(s @ s), 1e-6) * np.eye(s.size)
    bs = bend @ s
    curve = float(s @ bs)
    if curve <= 1e-300:
        return bend
    theta = 1.0 if y @ s >= 0.2 * curve else 0.8 * curve / (curve - float(y @ s))
    r = theta * y + (1 - theta) * bs
    return bend - np.outer(bs, bs) / curve + np.outer(r, r) / float(s @ r)
