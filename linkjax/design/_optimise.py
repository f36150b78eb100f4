"""The way in: what is free, what is to be small, what must hold; many starts; the best design with its certificate."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from linkjax.design._cone import Path, descend
from linkjax.design._names import DesignError
from linkjax.design._point import Point, look
from linkjax.design._problem import Case, Kind, Problem, Variable
from linkjax.design._terms import Asked, Limit, as_term
from linkjax.machine import Scene
from linkjax.measures import NODES

FEASIBLE = 1e-8  # the excess, relative to its bound, up to which a limit counts as met
REACHED = 1e-6  # relative difference of objectives up to which two starts reached the same


class Start(NamedTuple):
    """What one start came to."""

    objective: float
    feasible: bool
    residual: float
    evaluations: int


class Met(NamedTuple):
    """A limit at the optimum: its value, its bound, its multiplier (what the objective loses per unit of the bound, in
    their SI units), and the crank angles (rad) at which it is tied."""

    value: float
    bound: float
    multiplier: float
    tied_angles: tuple[float, ...]


@dataclasses.dataclass(frozen=True)
class Optimum:
    """The best design found, beside the one it began with."""

    before: Scene
    after: Scene
    problem: Problem
    x: np.ndarray
    objective_before: float
    objective: float
    limits: dict[str, Met]
    tied_angles: tuple[float, ...]
    pull: dict[str, float]
    kkt_residual: float
    feasible: bool
    clash: tuple[str, ...]
    starts: tuple[Start, ...]
    history: tuple[tuple[float, float], ...]
    evaluations: int

    @property
    def variables(self) -> dict[str, tuple[float, float]]:
        """Every free number before and after (SI), by name."""
        p = self.problem
        return {v.name: (float(a), float(b)) for v, a, b in zip(p.variables, p.start, self.x, strict=True)}

    @property
    def reached(self) -> int:
        """How many starts came to the same objective."""
        close = REACHED * max(abs(self.objective), 1e-3 * abs(self.objective_before))
        return sum(s.feasible == self.feasible and abs(s.objective - self.objective) <= close for s in self.starts)


def optimise(
    scene: Scene,
    free: Mapping[str, tuple[float, float]] | Sequence[Variable],
    minimise: Asked | None = None,
    *,
    maximise: Asked | None = None,
    limits: Sequence[Limit] = (),
    cases: Sequence[Case] = (Case(),),
    starts: int = 1,
    seed: int = 0,
    nodes: int = NODES,
    told: Callable[[int, Point, float], None] | None = None,
) -> Optimum:
    """Change the free numbers of a scene until the objective is as small (or large) as the limits allow.

    `free` gives bounds (SI) by name, `limits` come from `at_most` and `at_least`. An objective or limit is a measure or
    any jax function of the scene. Every limit holds in every one of the `cases`, and the worst of them counts. The
    first start is the scene itself, the others are drawn at random within the bounds. Machines that cannot be
    assembled, or do not run, are led back; nothing throws. The optimum of a problem without a feasible design is the
    least violated one; `feasible` and `clash` tell. Raises `DesignError` for what cannot be asked.
    """
    if (minimise is None) == (maximise is None):
        raise DesignError("objective", "one is needed", "give either minimise or maximise")
    if starts < 1:
        raise DesignError("starts", f"is {starts}", "write a whole number of one or more")
    asked = minimise if maximise is None else maximise
    assert asked is not None
    chosen = list(free) if not isinstance(free, Mapping) else [Variable(name, *ends) for name, ends in free.items()]
    problem = Problem(scene, chosen, as_term(asked), limits, cases, maximise is not None, nodes)
    span, rng = problem.upper - problem.lower, np.random.default_rng(seed)
    first = np.clip((problem.start - problem.lower) / span, 0.0, 1.0)
    paths: list[Path] = []
    found: list[Start] = []
    for number in range(starts):
        before = problem.evaluations
        z = first if number == 0 else rng.random(first.size)
        tell = None if told is None else lambda point, c, n=number: told(n, point, c.residual)
        paths.append(descend(problem, z, told=tell))
        point = paths[-1].point
        found.append(Start(_objective(problem, point), point.violation <= FEASIBLE,
                           paths[-1].certificate.residual, problem.evaluations - before))  # fmt: skip
    best = min(paths, key=lambda path: (max(path.point.violation - FEASIBLE, 0.0), path.point.value))
    return _optimum(problem, best, look(problem, first), tuple(found))


def _objective(problem: Problem, point: Point) -> float:
    """The objective in SI: the worst of all cases."""
    kind = next(kind for kind in problem.kinds if kind.role == "objective")
    return point.value * kind.scale * (kind.sign if kind.signed else 1.0)


def _optimum(problem: Problem, path: Path, begin: Point, starts: tuple[Start, ...]) -> Optimum:
    point, certificate = path.point, path.certificate
    x = problem.lower + point.z * (problem.upper - problem.lower)
    roles = ("objective", "limit", "sound")
    order = [i for role in roles for i, kind in enumerate(problem.kinds) if kind.role == role]
    goal = problem.kinds[order[0]]
    angles: list[float] = []
    limits: dict[str, Met] = {}
    for i, weights in zip(order, certificate.weights, strict=True):
        kind, block = problem.kinds[i], point.blocks[i]
        at = [float(a) for a in block.angle[weights > 1e-9] if np.isfinite(a)]
        if kind.role == "objective":
            angles += at
        else:
            multiplier = float(np.sum(weights)) * goal.scale / kind.scale
            limits[kind.label] = Met(block.value, kind.bound, multiplier, tuple(sorted(set(at))))
    checked = zip(order[len(point.goals) :], [*point.limits, *point.sound], strict=True)
    violated = [problem.kinds[i] for i, limit in checked if limit.excess() > FEASIBLE]
    pulls = (certificate.lower - certificate.upper) * goal.scale / (problem.upper - problem.lower)
    return Optimum(
        problem.scene, problem.design(x), problem, x, _objective(problem, begin), _objective(problem, point), limits,
        tuple(sorted(set(angles))), {v.name: float(p) for v, p in zip(problem.variables, pulls, strict=True) if p},
        certificate.residual, not violated, _clash(violated, limits), starts, tuple(path.history), problem.evaluations,
    )  # fmt: skip


def _clash(violated: list[Kind], limits: dict[str, Met]) -> tuple[str, ...]:
    """The limits that stand against each other: those violated, and those that carry a multiplier beside them."""
    if not violated:
        return ()
    held = [name for name, met in limits.items() if met.multiplier > 1e-9]
    return tuple(dict.fromkeys([*(kind.label for kind in violated), *held]))
