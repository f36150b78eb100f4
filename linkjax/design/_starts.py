"""Several starts, one after another: their results, the best design on the way, and the trade-off of one constraint."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from linkjax.analysis import Maybe
from linkjax.design._cone import Path, descend
from linkjax.design._kinds import Kind
from linkjax.design._point import MET, NOTHING, Certificate, Point, certify, look, placed, rank
from linkjax.design._problem import Problem

SCALINGS = 3  # maximum number of rescalings of the objective
NEAR = 10.0  # an objective within this factor of its scale needs no rescaling
SHRINK = 1e-3  # smallest ratio of the new scale to the old one
GAINED = 1e-7  # relative to the objective (1e-9 of its first scale): improvement for which a new scale is kept
IDLE = 1e-6  # relative to the scales: a variable with less change over its range has no effect
INSIDE = 0.1  # relative to the ranges: distance from the bounds for a second descent if some variables have no effect
SIDES = 4  # up to so many variables without effect, all combinations of sides are tried
CERTIFIED = 1e-7  # residual for which a new scale is kept without improvement
ROUNDING = 1e-9  # relative difference of objectives that counts as rounding


class Start(NamedTuple):
    """Result of one start. The objective (SI) is None where it does not exist."""

    objective: Maybe[float]
    feasible: bool
    residual: float
    evaluations: int


class Traded(NamedTuple):
    """The optimum for another bound of one constraint; `objective` (SI) as in `Start`."""

    bound: float
    objective: Maybe[float]
    feasible: bool
    x: tuple[float, ...]


class Progress(NamedTuple):
    """State of an optimisation: index of the start and number of starts, steps of this start, its objective (SI, None
    where it does not exist) with the unit, the constraints it violates, its scaled residual, and the best feasible
    objective so far. In a trade-off `traded` is the constraint, and the starts are its bounds."""

    start: int
    starts: int
    step: int
    objective: Maybe[float]
    unit: str
    violated: tuple[str, ...]
    residual: float
    best: float | None
    traded: str = ""


Descent = Callable[..., Path]


class Run:
    """Several starts, one after another, and the best design on the way."""

    def __init__(self, problem: Problem, starts: int, callback: Callable[[Progress], None] | None):
        self.problem, self.starts, self.callback = problem, starts, callback
        self.paths: list[Path] = []
        self.ended: list[Start] = []
        self.seen: Point | None = None
        self.stopped, self.number, self.step = False, 0, 0

    def follow(self, descend: Descent, z: np.ndarray, number: int) -> None:
        """Run one start."""
        before, self.number, self.step = self.problem.evaluations, number, 0
        self.paths.append(descend(self.problem, z, callback=self._callback))
        self._moved_inside(descend)
        self._tried_elsewhere(descend)
        self._measured_anew()
        path = self.paths[-1]
        self._callback(path.point, path.certificate)
        self.ended.append(
            Start(known(objective(self.problem, path.point)), feasible(self.problem, path.point),
                  path.certificate.residual, self.problem.evaluations - before)
        )  # fmt: skip

    def interrupted(self) -> None:
        """Use the best design so far as the result. Raises `KeyboardInterrupt` if there is none."""
        if self.seen is None:
            raise KeyboardInterrupt
        self.stopped = True
        self.paths = self.paths[: len(self.ended)]
        self.paths.append(Path(self.seen, certify(self.seen), [self.seen.course], False))

    def best(self) -> Path:
        """The best of all paths; of those with the same objective, the best certified."""
        ranks = [rank(path.point) for path in self.paths]
        first = min(ranks)
        same = [path for path, each in zip(self.paths, ranks, strict=True) if not _worse(each, first)]
        return min(same, key=lambda path: path.certificate.residual)

    def _moved_inside(self, descend: Descent) -> None:
        """Descend a second time, from inside the bounds and from the best side, and keep the better result. The
        optimality conditions hold trivially if a variable has no effect (as the position of a counterweight without
        mass) and others are near a bound.

        Without this, two of ten random starts ended, certified, without the weight that balances a rotor.
        """
        point = self.paths[-1].point
        moves = np.max([np.max(np.abs(block.slope), axis=(0, 1), initial=0.0) for block in point.every], axis=0)
        idle, inside = np.flatnonzero(moves <= IDLE), np.clip(point.z, INSIDE, 1 - INSIDE)
        # moving a single variable without effect changes nothing; several may have an effect together, and where the
        # objective is infinite no effect is known
        matters = (moves > IDLE) | (idle.size > 1) | ~np.isfinite(point.value)
        if idle.size and np.any((inside != point.z) & matters):
            sides = (look(self.problem, z) for z in _mirrored(inside, idle))
            self._taken(descend(self.problem, min(sides, key=rank).z, callback=self._callback))

    def _tried_elsewhere(self, descend: Descent) -> None:
        """Descend a second time, from half way to the middle of the ranges, where a path ends without a design that
        satisfies every constraint, and keep the better result.

        There may be one on the other side of a symmetry: at an in-line slider-crank the derivative of the time ratio by
        the offset is that of one side or the other, and that of the stroke is zero.
        """
        point = self.paths[-1].point
        if violated(self.problem, point):
            self._taken(descend(self.problem, 0.5 * (point.z + 0.5), callback=self._callback))

    def _measured_anew(self) -> None:
        """Rescale an objective that has become small or large relative to its scale, and continue with the cone solver:
        optimality is judged relative to the objective."""
        first = _goal(self.problem).scale
        for _ in range(SCALINGS):
            point, old = self.paths[-1].point, _goal(self.problem).scale
            if rank(point)[0] > 0 or not point.exists or any(rank(path.point) < rank(point) for path in self.paths):
                return
            size = _size(self.problem, point)
            new = max(size, SHRINK * old)
            if old / NEAR <= new <= NEAR * old or size <= NOTHING * first:
                return
            self._rescale(new)
            self._taken(descend(self.problem, point.z, callback=self._callback))
            path = self.paths[-1]
            gained = size - _size(self.problem, path.point)
            if path.certificate.residual > CERTIFIED and abs(gained) <= max(GAINED * size, 1e-9 * first):
                self._rescale(old)
                return

    def _taken(self, further: Path) -> None:
        """Accept a continuation of the last path if its result is better by more than rounding, or as good and better
        certified."""
        path = self.paths[-1]
        old, new = rank(path.point), rank(further.point)
        if _worse(old, new) or (new <= old and further.certificate.residual < path.certificate.residual):
            further.history[:0] = path.history
            self.paths[-1] = further

    def _rescale(self, scale: float) -> None:
        """Change the scale (SI) of the objective, also in all earlier results."""
        ratio = _goal(self.problem).scale / scale
        self.problem.rescale(scale)
        for path in self.paths:
            path.point = placed(self.problem, path.point.z, path.point.blocks)
            path.certificate = certify(path.point)
            path.history[:] = [(value * ratio, violation) for value, violation in path.history]
        if self.seen is not None:
            self.seen = placed(self.problem, self.seen.z, self.seen.blocks)

    def _see(self, point: Point) -> None:
        if self.seen is None or rank(point) < rank(self.seen):
            self.seen = point

    def _callback(self, point: Point, certificate: Certificate) -> None:
        self._see(point)
        self.step += 1
        if self.callback is not None and self.seen is not None:
            self.callback(_progress(self.problem, point, self.seen, certificate)._replace(
                start=self.number, starts=self.starts, step=self.step))  # fmt: skip


def _progress(problem: Problem, point: Point, best: Point, certificate: Certificate) -> Progress:
    """The state of a search at a point, with the best point so far."""
    names = tuple(kind.label for kind in violated(problem, point))
    found = objective(problem, best) if feasible(problem, best) else None
    return Progress(0, 1, 0, known(objective(problem, point)), _goal(problem).unit, names, certificate.residual, found)


def _worse(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether one sort key is worse than another by more than rounding."""
    return one[0] > other[0] or (one[0] == other[0] and one[1] > other[1] + ROUNDING * max(1.0, abs(other[1])))


def _mirrored(z: np.ndarray, which: np.ndarray) -> Iterator[np.ndarray]:
    """A design with some variables on either side of the middle of their ranges, in every combination; if there are
    many, only all of them mirrored or none."""
    sides = itertools.product((False, True), repeat=which.size) if which.size <= SIDES else ((False,), (True,))
    for turned in sides:
        found = z.copy()
        found[which] = np.where(turned, 1 - z[which], z[which])
        yield found


def _goal(problem: Problem) -> Kind:
    return next(kind for kind in problem.kinds if kind.role == "objective")


def objective(problem: Problem, point: Point) -> float:
    """The objective in SI, the worst of all cases; NaN where it does not exist in one of them."""
    return float(_goal(problem).value(point.course[0]))


def _size(problem: Problem, point: Point) -> float:
    """The size of the objective in the unit of its scale."""
    return abs(float(point.course[0])) * _goal(problem).scale


def known(value: float) -> float | None:
    """A value, or None for NaN."""
    return None if np.isnan(value) else value


def violated(problem: Problem, point: Point) -> list[Kind]:
    """The constraints that a design does not satisfy; one without a value is not satisfied."""
    kinds = [kind for role in ("limit", "sound") for kind in problem.kinds if kind.role == role]
    every = [*point.limits, *point.sound]
    return [kind for kind, limit in zip(kinds, every, strict=True) if not (limit.exists and limit.excess() <= MET)]


def feasible(problem: Problem, point: Point) -> bool:
    """Whether a design satisfies every constraint and its objective is finite."""
    return point.exists and bool(np.isfinite(point.value)) and not violated(problem, point)


def trade(
    problem: Problem,
    paths: list[Path],
    name: str,
    bounds: list[float],
    callback: Callable[[Progress], None] | None = None,
) -> tuple[tuple[Traded, ...], bool]:
    """The optimum for every bound of one constraint, each from the design before and from the final designs of several
    starts, and whether it was interrupted."""
    kinds, ends, found = problem.kinds, [path.point.z for path in paths], []
    before, span, stopped = [], problem.upper - problem.lower, False
    try:
        for number, bound in enumerate(bounds):
            problem.kinds = [
                kind.bounded(bound) if kind.name == name and kind.role == "limit" else kind for kind in kinds
            ]
            heard = _heard(problem, callback, number, len(bounds), name)
            ways = (descend(problem, each, callback=heard) for each in (*before, *ends))
            point, certificate = min(((path.point, path.certificate) for path in ways), key=lambda of: rank(of[0]))
            x, before = problem.lower + point.z * span, [point.z]
            value = known(objective(problem, point))
            found.append(Traded(bound, value, feasible(problem, point), tuple(map(float, x))))
            heard(point, certificate)
    except KeyboardInterrupt:
        stopped = True
    finally:
        problem.kinds = kinds
    return tuple(found), stopped


def _heard(
    problem: Problem, callback: Callable[[Progress], None] | None, number: int, bounds: int, name: str
) -> Callable:
    """The function that reports every step of one point of a trade-off."""
    best, step = [], 0

    def heard(point: Point, certificate: Certificate) -> None:
        nonlocal step
        step += 1
        best[:] = [min((*best, point), key=rank)]
        if callback is not None:
            callback(_progress(problem, point, best[0], certificate)._replace(
                start=number, starts=bounds, step=step, traded=name))  # fmt: skip

    return heard
