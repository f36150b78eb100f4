"""An evaluated design in the scale of the solvers, and the certificate of its optimality."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from linkjax.design._kinds import Block, Kind
from linkjax.design._problem import Problem

TIED = 1e-5  # rows this close to the largest may have a multiplier
MET = 1e-8  # scaled excess up to which a constraint counts as satisfied
HELD = 1e-9  # scaled multiplier below which it counts as rounding
NOTHING = 1e-10  # scaled length that counts as zero: every direction can be its gradient
AT_BOUND = 1e-6  # relative to its range: a variable this close to a bound may have its multiplier


class Scaled(NamedTuple):
    """A block in the scale of the solvers: its rows, of value or length `sizes`, must stay below `level`; `top` is the
    largest size."""

    rows: Float[np.ndarray, "rows parts"]
    slope: Float[np.ndarray, "rows parts n"]
    signed: bool
    level: float
    sizes: Float[np.ndarray, " rows"]
    top: float
    exists: bool = True

    def gradients(self, which: np.ndarray | slice = slice(None)) -> Float[np.ndarray, "rows n"]:
        """Gradient of the value or length of some rows, by default of all."""
        rows, slope = self.rows[which], self.slope[which]
        if self.signed:
            return slope[:, 0]
        sizes = lengths(rows)[:, None]
        return ((rows / np.where(sizes > 0, sizes, 1.0))[:, None] @ slope)[:, 0]

    def after(self, d: np.ndarray) -> Float[np.ndarray, " rows"]:
        """Sizes of all rows after a step, by the linear model of the vectors."""
        rows = self.rows + self.slope @ d
        return rows[:, 0] if self.signed else lengths(rows)

    def times(self, factor: float) -> Scaled:
        """The same with another scale."""
        rows, slope, sizes = self.rows * factor, self.slope * factor, self.sizes * factor
        return Scaled(rows, slope, self.signed, self.level * factor, sizes, self.top * factor, self.exists)

    def bent_to(self, there: Scaled, d: np.ndarray, times: float = 1.0) -> Scaled:
        """The same with a linear model that is exact after a step, where it is `there`, instead of at the design; with
        `times` its error there is corrected more than once."""
        rows = self.rows + times * (there.rows - self.rows - self.slope @ d)
        sizes = rows[:, 0] if self.signed else lengths(rows)
        return self._replace(rows=rows, sizes=sizes, top=float(np.max(sizes)))

    def excess(self) -> float:
        """The amount by which the largest row exceeds the level."""
        return self.top - self.level


def lengths(vectors: Float[np.ndarray, "rows parts"]) -> Float[np.ndarray, " rows"]:
    """Length of every row."""
    return np.sqrt(np.einsum("rp,rp->r", vectors, vectors))


def scaled(kind: Kind, block: Block, span: np.ndarray) -> Scaled:
    """A block in the scale of its kind, with derivatives with respect to variables from 0 to 1."""
    factor = (kind.sign if kind.signed else 1.0) / kind.scale
    rows, slope = block.vectors * factor, block.slope * (factor * span)
    sizes = rows[:, 0] if kind.signed else lengths(rows)
    level = 0.0 if kind.role == "objective" else kind.level * factor
    return Scaled(rows, slope, kind.signed, level, sizes, float(np.max(sizes)), block.exists)


@dataclasses.dataclass
class Point:
    """An evaluated design, its variables from 0 to 1."""

    z: np.ndarray
    blocks: list[Block]
    goals: list[Scaled]
    limits: list[Scaled]
    sound: list[Scaled]

    @property
    def every(self) -> list[Scaled]:
        """Objective, constraints and margins."""
        return [*self.goals, *self.limits, *self.sound]

    @property
    def value(self) -> float:
        """The objective, scaled; NaN if it is NaN in one case."""
        return float(np.max([goal.top for goal in self.goals]))

    @property
    def exists(self) -> bool:
        """Whether the objective has a value in every case."""
        return all(goal.exists for goal in self.goals)

    @property
    def course(self) -> tuple[float, float]:
        """Objective and violation, scaled; the objective is NaN where it does not exist."""
        return self.value if self.exists else np.nan, self.violation

    @property
    def violation(self) -> float:
        """Sum of the excess of all constraints, scaled."""
        return sum(max(limit.excess(), 0.0) for limit in [*self.limits, *self.sound])

    @property
    def unsound(self) -> float:
        """Scaled shortfall of the margins of a machine that can be assembled and runs; zero up to rounding."""
        return sum(max(limit.excess() - MET, 0.0) for limit in self.sound)


def rank(point: Point) -> tuple[float, float]:
    """Sort key of designs: first the violation, then the objective. A design with NaN comes last."""
    found = max(point.violation - MET, 0.0), point.value
    return found if np.isfinite(found).all() else (np.inf, np.inf)


def look(problem: Problem, z: np.ndarray) -> Point:
    """Evaluate a design in units of the variables' ranges."""
    return placed(problem, z, problem.at(problem.lower + z * (problem.upper - problem.lower)))


def placed(problem: Problem, z: np.ndarray, blocks: list[Block]) -> Point:
    """An evaluated design in the current scale of the problem."""
    span = problem.upper - problem.lower
    every = [(kind.role, scaled(kind, block, span)) for kind, block in zip(problem.kinds, blocks, strict=True)]
    goals, limits, sound = ([b for role, b in every if role == wanted] for wanted in ("objective", "limit", "sound"))
    return Point(z, blocks, goals, limits, sound)


class Certificate(NamedTuple):
    """Multipliers of every row of every block and of the bounds, and the residual of the optimality conditions (Karush,
    Kuhn, Tucker): gradient of the Lagrangian, slack times multiplier, violation; all scaled."""

    residual: float
    weights: list[np.ndarray]
    lower: np.ndarray
    upper: np.ndarray


def certify(point: Point) -> Certificate:
    """The multipliers that satisfy the conditions best, by non-negative least squares over the active rows.

    Independent of the solver that found the design. A vector whose length vanishes has subgradients in all directions.
    """
    n, top = point.z.size, point.value
    if not np.isfinite([top, point.violation]).all():
        return Certificate(np.inf, [np.zeros(len(block.rows)) for block in point.every], np.zeros(n), np.zeros(n))
    columns, slacks, goal, homes = [], [], [], []
    for i, block in enumerate(point.every):
        level = top if i < len(point.goals) else block.level
        tied = np.flatnonzero(block.sizes >= level - TIED)
        if not tied.size:
            homes.append(tied)
            continue
        columns.append(block.gradients(tied))
        if not block.signed:
            for row in tied[lengths(block.rows[tied]) <= NOTHING]:
                directions = _directions(block.rows.shape[1])
                columns.append(directions @ block.slope[row])
                tied = np.append(tied, [row] * len(directions))
        slacks.append(np.maximum(level - block.sizes[tied], 0.0))
        goal.append(np.full(tied.size, float(i < len(point.goals))))
        homes.append(tied)
    low, high = np.flatnonzero(point.z <= AT_BOUND), np.flatnonzero(point.z >= 1 - AT_BOUND)
    rows = np.concatenate([*columns, -np.eye(n)[low], np.eye(n)[high]]).T
    slack = np.concatenate([*slacks, point.z[low], 1 - point.z[high]])
    goals = np.concatenate([*goal, np.zeros(low.size + high.size)])
    scale = 1e3 * max(1.0, float(np.max(np.abs(rows), initial=0.0)))  # the multipliers of the objective sum to one
    matrix = np.concatenate([rows, scale * goals[None], slack[None]])
    found = _non_negative(matrix, np.concatenate([np.zeros(n), [scale, 0.0]]))
    left = max(
        float(np.max(np.abs(rows @ found))), abs(float(goals @ found) - 1), float(slack @ found), point.violation
    )
    weights, at = [], 0
    for block, tied in zip(point.every, homes, strict=True):
        weights.append(np.zeros(len(block.rows)))
        np.add.at(weights[-1], tied, found[at : at + len(tied)])
        at += len(tied)
    lower, upper = np.zeros(n), np.zeros(n)
    lower[low], upper[high] = found[at : at + len(low)], found[at + len(low) :]
    return Certificate(left, weights, lower, upper)


def _non_negative(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The non-negative least-squares solution; zeros, which certify nothing, if the solver fails."""
    from scipy.optimize import nnls

    try:
        return nnls(matrix, right, maxiter=30 * matrix.shape[1])[0]
    except RuntimeError:
        return np.zeros(matrix.shape[1])


def _directions(parts: int) -> Float[np.ndarray, "directions parts"]:
    """Directions in which a zero vector may grow."""
    if parts == 2:
        angle = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.concatenate([np.eye(parts), -np.eye(parts)])


def obstacles(point: Point) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
    """For violated constraints: multipliers of every row of every block, and of the lower and upper bounds of all
    variables, for which the violation is stationary. Those of every violated block sum to one, those of bounds are
    relative to the largest slope; the objective is ignored."""
    n, columns, homes, sums = point.z.size, [], [], []
    for i, block in enumerate(point.every):
        missed = block.excess() > MET
        level = block.top if missed else block.level
        tied = np.flatnonzero(block.sizes >= level - TIED) if i >= len(point.goals) else np.zeros(0, int)
        columns.append(block.gradients(tied))
        homes.append(tied)
        if missed and tied.size:
            sums.append((sum(len(home) for home in homes[:-1]), tied.size))
    low, high = np.flatnonzero(point.z <= AT_BOUND), np.flatnonzero(point.z >= 1 - AT_BOUND)
    rows = np.concatenate([*columns, -np.eye(n)[low], np.eye(n)[high]]).T
    scale = 1e3 * max(1.0, float(np.max(np.abs(rows), initial=0.0)))
    add = np.zeros((len(sums), rows.shape[1]))
    for line, (at, count) in zip(add, sums, strict=True):
        line[at : at + count] = scale
    found = _non_negative(np.concatenate([rows, add]), np.concatenate([np.zeros(n), np.full(len(sums), scale)]))
    weights, at = [], 0
    for block, tied in zip(point.every, homes, strict=True):
        weights.append(np.zeros(len(block.rows)))
        weights[-1][tied] = found[at : at + len(tied)]
        at += len(tied)
    lower, upper = np.zeros(n), np.zeros(n)
    size = max((float(np.max(np.abs(part), initial=0.0)) for part in columns), default=0.0) or 1.0
    lower[low], upper[high] = found[at : at + low.size] / size, found[at + low.size :] / size
    return weights, lower, upper
