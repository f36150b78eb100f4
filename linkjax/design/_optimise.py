"""`optimise`: design variables, objective, constraints, several starts; the best design with its certificate.

Every solver uses the same rows and derivatives and ends with the same certificate. Measured on the demo, ten starts:
the cone solver 433 evaluations with 10 of 10 at the optimum, SLSQP 287 with 9 of 10; trust-constr stops 0.1 % above it;
multistart needs 6500 evaluations on two cores, and is meant for computers with many cores.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkjax._units import nearest
from linkjax.analysis import Maybe
from linkjax.design._cone import Path, descend
from linkjax.design._kinds import Kind
from linkjax.design._multistart import multistart
from linkjax.design._names import DesignError, amount, numbers
from linkjax.design._point import HELD, Point, obstacles, placed, rank
from linkjax.design._problem import Problem
from linkjax.design._scipy import slsqp, trust
from linkjax.design._starts import Progress, Run, Start, Traded, feasible, known, objective, trade, violated
from linkjax.design._terms import Asked, Limit, Term
from linkjax.design._text import notes, optimum_text
from linkjax.design._texts import (
    FUNCTION,
    Range,
    UnknownName,
    settled_case,
    settled_free,
    settled_limit,
    settled_term,
    with_own,
)
from linkjax.design._variables import Case, Variable, check
from linkjax.machine import Scene, check_scene
from linkjax.measures import NODES, measure_names

REACHED = 1e-6  # relative difference of objectives up to which two starts reached the same optimum
OTHERS = 5  # starts whose final designs are the initial designs of a trade-off
SOLVERS: dict[str, Callable[..., Path]] = {
    "cone": descend,
    "slsqp": slsqp,
    "trust-constr": trust,
    "multistart": multistart,
}


class ConstraintResult(NamedTuple):
    """A constraint at the optimum: its value (None where it does not exist), its bound, its multiplier (improvement of
    the objective per unit of relaxation of the bound, both SI), and the crank angles (rad) of its equal peaks."""

    value: Maybe[float]
    bound: float
    multiplier: float
    peak_angles: tuple[float, ...]


@dataclasses.dataclass(frozen=True)
class Optimum:
    """The best design found, and the original one.

    `limits` are the constraints by label and `violated` those not satisfied. `no_effect` names the design variables
    that affect neither the objective nor an active constraint. `bound_multiplier` is the improvement of the objective
    (SI) per unit of relaxation of an active variable bound. `history` has objective and violation, scaled, of every
    step of the best start. `trade_off` has the optima for other bounds of one constraint. `objective_before` and
    `objective` are None where the machine cannot be assembled or lacks the motion to which the objective belongs.
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
        """Every design variable before and after (SI), by name."""
        p = self.problem
        return {v.name: (float(a), float(b)) for v, a, b in zip(p.variables, p.start, self.x, strict=True)}

    @property
    def notes(self) -> tuple[str, ...]:
        """Lines about links whose mass stays as given while their length is a design variable, about uniform plates
        whose corners are no longer in order, and about variables that are not within their ranges."""
        return notes(self.problem, self.after)

    @property
    def starts_at_optimum(self) -> int:
        """Number of starts that reached the same objective."""
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
    """Change the design variables of a scene until the objective is as small (or large) as the constraints allow.

    `free` gives ranges by name: `("0.95 m", "1.1 m")`, `"0 to 40 kg m^2"`, `"± 8 %"`, or SI numbers. An objective or
    constraint is a measure, the name of a measure or of a scene parameter, or a JAX function of the scene that returns
    one number. `limits` are the constraints, made by `at_most` and `at_least` or written as strings: `"delta <= 0.15"`,
    `"min_transmission_angle >= initial"`. Every constraint holds in each of the `cases`; the objective is the worst of
    them. The first start is the scene itself; the others are drawn at random, from `seed`, within the bounds. `solver`
    is "cone", "slsqp", "trust-constr" or "multistart" (a new batch of random designs for every start). `nodes` is the
    number of nodes of the cycle grid per crank turn. `trade_off` names a constraint and further bounds for it; the cone
    solver optimises each, from the design before and from the final designs of the best starts.

    A design that cannot be assembled or has no steady-state motion does not raise; the search returns to designs that
    do. Without a feasible design the result is the least violated one; see `feasible` and `conflicts`. `callback` is
    called with the `Progress` after every step. An interrupt (Ctrl-C) returns the best design so far, or raises
    `KeyboardInterrupt` if there is none. Raises `DesignError` for a wrong problem, naming the argument. Source: see
    `linkjax.design.descend`.
    """
    check_scene(scene)
    try:
        asked = settled(scene, free, minimise, maximise, limits, cases, solver, trade_off)
    except UnknownName as error:
        raise DesignError(error.element, error.problem, f"{error.remedy} ({FUNCTION})") from error
    return solve(scene, **asked, starts=starts, seed=seed, nodes=nodes, callback=callback)


optimize = optimise


def solve(
    scene: Scene, free: Sequence[Variable], minimise: Term | None, maximise: Term | None, limits: Sequence[Limit],
    cases: Sequence[Case], solver: str, trade_off: tuple[str, Sequence[float]] | None, *, starts: int = 1,
    seed: int = 0, nodes: int = NODES, callback: Callable[[Progress], None] | None = None,
    meanwhile: Callable[[], None] | None = None,
) -> Optimum:  # fmt: skip
    """`optimise` for the arguments that `settled` returns. `meanwhile` is called while the problem compiles."""
    if starts < 1:
        raise DesignError("starts", f"is {starts}", "write an integer of at least 1")
    if seed < 0:
        raise DesignError("seed", f"is {seed}", "write an integer of at least 0")
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
    """The arguments of `optimise` with all names checked and all numbers in SI. Raises `DesignError`, with the argument
    that is wrong, before anything is compiled."""
    if (minimise is None) == (maximise is None):
        problem = "none is given" if minimise is None else "two are given"
        raise DesignError("objective", problem, "give either minimise or maximise")
    if solver not in SOLVERS:
        raise DesignError("solver", f"{solver!r} is not a solver", nearest(str(solver), SOLVERS))
    if isinstance(limits, str):
        raise DesignError("limits", "is a string", f"write a list, e.g. [{limits!r}]")
    with _in_argument("limits"):
        found = _told_apart(scene, [settled_limit(scene, one) for one in limits])
    names = [case.name for case in cases]
    if len(set(names)) < len(names):
        raise DesignError("cases", f"two cases have the name {max(names, key=names.count)!r}", "use different names")
    with _in_argument("free"):
        variables = settled_free(scene, free)
        check(variables)
    with _in_argument("cases"):
        settled_cases = [settled_case(scene, case) for case in cases or (Case(),)]
        _check_cases(variables, settled_cases)
    goals = {}
    for key, goal in (("minimise", minimise), ("maximise", maximise)):
        with _in_argument(key):
            goals[key] = None if goal is None else settled_term(scene, goal)
    with _in_argument("free"):
        variables = with_own(scene, variables, [*goals.values(), *(one.term for one in found)])
    return {
        "free": variables, **goals, "limits": found, "cases": settled_cases,
        "solver": solver, "trade_off": trade_off and _traded(found, *trade_off), **others,
    }  # fmt: skip


@contextlib.contextmanager
def _in_argument(name: str) -> Iterator[None]:
    """Errors raised inside begin with the argument that is wrong."""
    try:
        yield
    except DesignError as error:
        element = error.element if error.element == name else f"{name}: {error.element}"
        raise type(error)(element, error.problem, error.remedy) from error


def _check_cases(variables: Sequence[Variable], cases: Sequence[Case]) -> None:
    """Raise `DesignError` where a case changes a design variable."""
    free = {name for v in variables for name in (v.name, *v.linked)}
    for case in cases:
        for name in case.changes:
            if name in free:
                problem = f"is a design variable, but case {case.name!r} sets it"
                raise DesignError(name, problem, "remove it from the case or from `free`")


def _told_apart(scene: Scene, limits: list[Limit]) -> list[Limit]:
    """The constraints with different names: the sense or a number is added where two have the same."""
    found: list[Limit] = []
    known = {*measure_names(scene), *numbers(scene)}
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
            raise DesignError(each.name, f"has {len(same)} constraints", "keep one constraint of each sense")
    return found


def _traded(limits: Sequence[Limit], name: str, bounds: Sequence[float | str]) -> tuple[str, list[float]]:
    """The name of the traded constraint, the first of several on one quantity, and its further bounds in SI."""
    for limit in limits:
        if name in (limit.name, limit.name.removesuffix(f" {limit.sense}")):
            return limit.name, [amount(bound, limit.term.unit, "trade_off") for bound in bounds]
    known = [limit.name for limit in limits]
    raise DesignError("trade_off", f"{name!r} is not a constraint of this problem", nearest(name, known))


def _optimum(problem: Problem, path: Path, starts: tuple[Start, ...]) -> Optimum:
    point, certificate = path.point, path.certificate
    begin = placed(problem, _unit(problem, problem.start), problem.first)
    x = problem.lower + point.z * (problem.upper - problem.lower)
    roles = ("objective", "limit", "sound")
    order = [i for role in roles for i, kind in enumerate(problem.kinds) if kind.role == role]
    goal = problem.kinds[order[0]]
    per_size = goal.scale * goal.rate(point.value * goal.scale)
    angles: list[float] = []
    limits: dict[str, ConstraintResult] = {}
    for i, weights in zip(order, certificate.weights, strict=True):
        kind, block = problem.kinds[i], point.blocks[i]
        weights = np.where(weights > HELD, weights, 0.0)
        at = [float(a) for a in block.angle[weights > 0] if np.isfinite(a)]
        if kind.role == "objective":
            angles += at
        else:
            multiplier = float(np.sum(weights)) * per_size / (kind.scale * (kind.rate(kind.level) or 1.0))
            value = block.value if block.exists else None
            limits[kind.label] = ConstraintResult(value, kind.bound, multiplier, tuple(sorted(set(at))))
    missed = violated(problem, point)
    held = certificate.lower + certificate.upper
    pulls = np.where(held > HELD, held, 0.0) * per_size / (problem.upper - problem.lower)
    return Optimum(
        problem.scene, problem.design(x), problem, x, known(objective(problem, begin)),
        known(objective(problem, point)), limits,
        tuple(sorted(set(angles))), {v.name: float(p) for v, p in zip(problem.variables, pulls, strict=True) if p},
        certificate.residual, feasible(problem, point), _conflicts(problem, point, missed),
        tuple(kind.label for kind in missed), _no_effect(problem, path), starts, tuple(path.history),
        problem.evaluations,
    )  # fmt: skip


def _different(paths: list[Path]) -> list[Path]:
    """The best path of every different objective, best first."""
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
    """The design variables that affect neither the objective nor an active constraint."""
    every, goals = path.point.every, len(path.point.goals)
    held = [block for i, (block, weights) in enumerate(zip(every, path.certificate.weights, strict=True))
            if i < goals or np.sum(weights) > HELD]  # fmt: skip
    return tuple(v.name for j, v in enumerate(problem.variables) if not any(np.any(b.slope[..., j]) for b in held))


def _conflicts(problem: Problem, point: Point, missed: list[Kind]) -> tuple[str, ...]:
    """The conflicting constraints: those violated, and those that prevent a smaller violation, with the bounds of
    variables that do."""
    if not missed:
        return ()
    kinds = [kind for role in ("objective", "limit", "sound") for kind in problem.kinds if kind.role == role]
    exists = {id(kind): block.exists for kind, block in zip(problem.kinds, point.blocks, strict=True)}
    missed = [kind for kind in missed if exists[id(kind)]] or missed
    if not np.isfinite(point.value + point.violation):
        return tuple(kind.label for kind in missed)
    every, *ends = obstacles(point)
    held = [kind for kind, weights in zip(kinds, every, strict=True) if np.sum(weights) > 1e-6]
    bounds = [f"{v.name} at its {side} bound" for side, weights in zip(("lower", "upper"), ends, strict=True)
              for v, weight in zip(problem.variables, weights, strict=True) if weight > 1e-6]  # fmt: skip
    return tuple(dict.fromkeys([*(kind.label for kind in [*missed, *held]), *bounds]))
