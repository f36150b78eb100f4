"""The way in: what is free, what is to be small, what must hold; many starts; the best design with its certificate."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkjax._units import nearest
from linkjax.analysis import Maybe
from linkjax.design._cone import Path, descend
from linkjax.design._multistart import multistart
from linkjax.design._names import DesignError, amount, numbers
from linkjax.design._point import HELD, Point, obstacles, placed, rank
from linkjax.design._problem import Case, Kind, Problem, Variable, check
from linkjax.design._scipy import slsqp, trust
from linkjax.design._starts import Progress, Run, Start, Traded, feasible, known, objective, trade, violated
from linkjax.design._terms import Asked, Limit, Term
from linkjax.design._text import optimum_text
from linkjax.design._texts import Range, settled_case, settled_free, settled_limit, settled_term
from linkjax.machine import Scene, check_scene
from linkjax.measures import MEASURES, NODES

REACHED = 1e-6  # relative difference of objectives up to which two starts reached the same
OTHERS = 5  # starts whose ends the points of a trade-off begin from
SOLVERS: dict[str, Callable[..., Path]] = {
    "cone": descend,
    "slsqp": slsqp,
    "trust-constr": trust,
    "multistart": multistart,
}


class ConstraintResult(NamedTuple):
    """A limit at the optimum: its value, its bound, its multiplier (what the objective gains per unit that the bound
    gives way, in their SI units), and the crank angles (rad) at which it is tied."""

    value: Maybe[float]
    bound: float
    multiplier: float
    peak_angles: tuple[float, ...]


@dataclasses.dataclass(frozen=True)
class Optimum:
    """The best design found, beside the one it began with.

    `limits` by label, `violated` those not met, `no_effect` the free numbers on which neither the objective nor an active
    limit depends, `bound_multiplier` what the objective would gain (SI) per unit of room at an active bound, `history` the
    objective and violation, scaled, of every step of the best start, `trade_off` the optima for other bounds of one
    limit.
    """

    before: Scene
    after: Scene
    problem: Problem
    x: np.ndarray
    objective_before: Maybe[float]
    objective: Maybe[float]
    limits: dict[str, ConstraintResult]
    peak_angles: tuple[float, ...]
    bound_multiplier: dict[str, float]
    kkt_residual: float
    feasible: bool
    conflicts: tuple[str, ...]
    violated: tuple[str, ...]
    no_effect: tuple[str, ...]
    starts: tuple[Start, ...]
    history: tuple[tuple[float, float], ...]
    evaluations: int
    solver: str = "cone"
    interrupted: bool = False
    trade_off: tuple[Traded, ...] = ()
    traded: str = ""

    def __str__(self) -> str:
        return optimum_text(self)

    @property
    def variables(self) -> dict[str, tuple[float, float]]:
        """Every free number before and after (SI), by name."""
        p = self.problem
        return {v.name: (float(a), float(b)) for v, a, b in zip(p.variables, p.start, self.x, strict=True)}

    @property
    def starts_at_optimum(self) -> int:
        """How many starts came to the same objective."""
        before, best = self.objective_before, self.objective
        if best is None:
            return 0
        first = abs(before) if before is not None and np.isfinite(before) else 0.0
        close = REACHED * max(abs(best), 1e-3 * first)
        same = [s.objective for s in self.starts if s.feasible == self.feasible and s.objective is not None]
        return sum(bool(abs(each - best) <= close) for each in same)


def optimise(
    scene: Scene,
    free: Mapping[str, Range] | Sequence[Variable],
    minimise: Asked | None = None,
    *,
    maximise: Asked | None = None,
    limits: Sequence[Limit | str] = (),
    cases: Sequence[Case] = (Case(),),
    starts: int = 1,
    seed: int = 0,
    solver: str = "cone",
    trade_off: tuple[str, Sequence[float | str]] | None = None,
    nodes: int = NODES,
    callback: Callable[[Progress], None] | None = None,
) -> Optimum:
    """Change the free numbers of a scene until the objective is as small (or large) as the limits allow.

    `free` gives ranges by name: `("0.95 m", "1.1 m")`, `"0 to 40 kg m^2"`, `"± 8 %"`, or SI numbers. An objective or
    limit is a measure, the name of one or of a number of the scene, or any jax function of the scene; limits come from
    `at_most` and `at_least`, or are texts: `"delta <= 0.15"`, `"min_transmission_angle >= initial"`. Every limit
    holds in every one of the `cases`, and the worst of them counts. The first start is the scene itself, the others are
    drawn at random, from `seed`, within the bounds. `solver` is "cone", "slsqp", "trust-constr" or "multistart" (a crowd,
    drawn anew from every start); `nodes` are those of the cycle grid, per crank turn. `trade_off` names a limit and
    further bounds for it, each optimised by the cone solver from the design before and the ends of the best starts.
    Machines that cannot be assembled, or do not run, are led back; nothing throws. The optimum of a problem without a
    feasible design is the least violated one; `feasible` and `conflicts` tell. `callback` is
    called with the `Progress` after every step; interrupted (Ctrl-C), the best design so far is returned, or
    `KeyboardInterrupt` raised where there is none. Raises `DesignError` for what cannot be asked. Source: see
    `linkjax.design.descend`.
    """
    check_scene(scene)
    asked = settled(scene, free, minimise, maximise, limits, cases, solver, trade_off)
    return solve(scene, **asked, starts=starts, seed=seed, nodes=nodes, callback=callback)


optimize = optimise


def solve(
    scene: Scene, free: Sequence[Variable], minimise: Term | None, maximise: Term | None, limits: Sequence[Limit],
    cases: Sequence[Case], solver: str, trade_off: tuple[str, Sequence[float]] | None, *, starts: int = 1,
    seed: int = 0, nodes: int = NODES, callback: Callable[[Progress], None] | None = None,
    meanwhile: Callable[[], None] | None = None,
) -> Optimum:  # fmt: skip
    """`optimise` for arguments that are `settled` already; `meanwhile` is called while the problem compiles."""
    if starts < 1:
        raise DesignError("starts", f"is {starts}", "write a whole number of one or more")
    if seed < 0:
        raise DesignError("seed", f"is {seed}", "write a whole number of zero or more")
    goal = minimise if maximise is None else maximise
    assert goal is not None
    problem = Problem(scene, free, goal, limits, cases, maximise is not None, nodes, meanwhile)
    run = Run(problem, starts, callback)
    rng = np.random.default_rng(seed)
    first = np.clip(_unit(problem, problem.start), 0.0, 1.0)
    try:
        for number in range(starts):
            run.follow(SOLVERS[solver], first if number == 0 else rng.random(first.size), number)
    except KeyboardInterrupt:
        run.interrupted()
    best = run.best()
    found = _optimum(problem, best, tuple(run.ended))
    points, stopped = (), run.stopped
    if trade_off is not None and not stopped:
        ends = _different(run.paths)[:OTHERS]
        points, stopped = trade(problem, ends, trade_off[0], list(trade_off[1]), callback)
    return dataclasses.replace(
        found, solver=solver, interrupted=stopped, trade_off=points, traded=trade_off[0] if trade_off else "",
        evaluations=problem.evaluations,
    )  # fmt: skip


def settled(
    scene: Scene, free: Any, minimise: Asked | None = None, maximise: Asked | None = None,
    limits: Sequence[Limit | str] = (), cases: Sequence[Case] = (Case(),), solver: str = "cone",
    trade_off: tuple[str, Sequence[float | str]] | None = None, **others: Any,
) -> dict[str, Any]:  # fmt: skip
    """The arguments of `optimise` with every name known and every number in SI. Raises `DesignError` for what cannot be
    asked, before anything is compiled."""
    if (minimise is None) == (maximise is None):
        problem = "none is given" if minimise is None else "two are given"
        raise DesignError("objective", problem, "give either minimise or maximise")
    if solver not in SOLVERS:
        raise DesignError("solver", f"{solver!r} is not known", nearest(solver, SOLVERS))
    found = _told_apart(scene, [settled_limit(scene, one) for one in limits])
    names = [case.name for case in cases]
    if len(set(names)) < len(names):
        raise DesignError("cases", f"two have the name {max(names, key=names.count)!r}", "give each its own")
    variables = settled_free(scene, free)
    check(variables)
    settled_cases = [settled_case(scene, case) for case in cases or (Case(),)]
    _check_cases(variables, settled_cases)
    return {
        "free": variables, "minimise": None if minimise is None else settled_term(scene, minimise),
        "maximise": None if maximise is None else settled_term(scene, maximise), "limits": found,
        "cases": settled_cases, "solver": solver, "trade_off": trade_off and _traded(found, *trade_off), **others,
    }  # fmt: skip


def _check_cases(variables: Sequence[Variable], cases: Sequence[Case]) -> None:
    """Raise `DesignError` where a case changes what is free."""
    free = {name for v in variables for name in (v.name, *v.linked)}
    for case in cases:
        for name in case.changes:
            if name in free:
                raise DesignError(name, f"is free, but the case {case.name!r} sets it", "either free it or set it")


def _told_apart(scene: Scene, limits: list[Limit]) -> list[Limit]:
    """Limits of one name by their senses, several own functions of one name by numbers."""
    found: list[Limit] = []
    known = {*MEASURES, *numbers(scene)}
    for each in limits:
        same = [other for other in limits if other.name == each.name]
        if len(same) == 1:
            found.append(each)
        elif {(other.sense) for other in same} == {"at most", "at least"} and len(same) == 2:
            found.append(dataclasses.replace(each, name=f"{each.name} {each.sense}"))
        elif any(other.term.value is not each.term.value for other in same) and each.name not in known:
            number = next(i for i, other in enumerate(same, 1) if other is each)
            found.append(dataclasses.replace(each, name=f"{each.name} {number}"))
        else:
            raise DesignError(each.name, f"is limited {len(same)} times", "keep one limit of each sense")
    return found


def _traded(limits: Sequence[Limit], name: str, bounds: Sequence[float | str]) -> tuple[str, list[float]]:
    """The limit that is traded off, the first of several on one number, and its further bounds in SI."""
    for limit in limits:
        if name in (limit.name, limit.name.removesuffix(f" {limit.sense}")):
            return limit.name, [amount(bound, limit.term.unit, "trade_off") for bound in bounds]
    known = [limit.name for limit in limits]
    raise DesignError("trade_off", f"{name!r} is no limit of this problem", nearest(name, known))


def _optimum(problem: Problem, path: Path, starts: tuple[Start, ...]) -> Optimum:
    point, certificate = path.point, path.certificate
    begin = placed(problem, _unit(problem, problem.start), problem.first)
    x = problem.lower + point.z * (problem.upper - problem.lower)
    roles = ("objective", "limit", "sound")
    order = [i for role in roles for i, kind in enumerate(problem.kinds) if kind.role == role]
    goal = problem.kinds[order[0]]
    angles: list[float] = []
    limits: dict[str, ConstraintResult] = {}
    for i, weights in zip(order, certificate.weights, strict=True):
        kind, block = problem.kinds[i], point.blocks[i]
        weights = np.where(weights > HELD, weights, 0.0)
        at = [float(a) for a in block.angle[weights > 0] if np.isfinite(a)]
        if kind.role == "objective":
            angles += at
        else:
            multiplier = float(np.sum(weights)) * goal.scale / kind.scale
            value = block.value if block.exists else None
            limits[kind.label] = ConstraintResult(value, kind.bound, multiplier, tuple(sorted(set(at))))
    missed = violated(problem, point)
    held = certificate.lower + certificate.upper
    pulls = np.where(held > HELD, held, 0.0) * goal.scale / (problem.upper - problem.lower)
    return Optimum(
        problem.scene, problem.design(x), problem, x, known(objective(problem, begin)), known(objective(problem, point)),
        limits,
        tuple(sorted(set(angles))), {v.name: float(p) for v, p in zip(problem.variables, pulls, strict=True) if p},
        certificate.residual, feasible(problem, point), _conflicts(problem, point, missed),
        tuple(kind.label for kind in missed), _no_effect(problem, path), starts, tuple(path.history),
        problem.evaluations,
    )  # fmt: skip


def _different(paths: list[Path]) -> list[Path]:
    """The best of the paths that came to the same objective, best first."""
    found: list[Path] = []
    for path in sorted(paths, key=lambda path: rank(path.point)):
        value = path.point.value
        if not found or not abs(value - found[-1].point.value) <= REACHED * max(1.0, abs(value)):
            found.append(path)
    return found


def _unit(problem: Problem, x: np.ndarray) -> np.ndarray:
    """A design (SI) in units of the variables' ranges."""
    return (x - problem.lower) / (problem.upper - problem.lower)


def _no_effect(problem: Problem, path: Path) -> tuple[str, ...]:
    """The free numbers on which neither the objective nor a limit that holds it depends."""
    every, goals = path.point.every, len(path.point.goals)
    held = [block for i, (block, weights) in enumerate(zip(every, path.certificate.weights, strict=True))
            if i < goals or np.sum(weights) > HELD]  # fmt: skip
    return tuple(v.name for j, v in enumerate(problem.variables) if not any(np.any(b.slope[..., j]) for b in held))


def _conflicts(problem: Problem, point: Point, missed: list[Kind]) -> tuple[str, ...]:
    """The limits that stand against each other: those violated, and those that keep the violation from shrinking."""
    if not missed:
        return ()
    kinds = [kind for role in ("objective", "limit", "sound") for kind in problem.kinds if kind.role == role]
    if not np.isfinite(point.value + point.violation):
        return tuple(kind.label for kind in missed)
    held = [kind for kind, weights in zip(kinds, obstacles(point), strict=True) if np.sum(weights) > 1e-6]
    return tuple(dict.fromkeys(kind.label for kind in [*missed, *held]))
