"""The JSON document of an optimisation, the interface for reports and other programs."""

from __future__ import annotations

from typing import Any

import numpy as np

from linkjax.analysis import Cycle, measured
from linkjax.design._names import number
from linkjax.design._optimise import Optimum
from linkjax.design._text import outcome
from linkjax.design._variables import Case
from linkjax.measures import MEASURES

WHY = {
    "cone": "sequential second-order cone programming; exact peaks",
    "slsqp": "requested: SciPy's SLSQP on every row of every peak, with exact derivatives",
    "trust-constr": "requested: SciPy's trust-constr on every row of every peak, with exact derivatives",
    "multistart": "requested: a batch of starts by optax, the best ones finished by the cone solver",
}
MESSAGES = {
    "optimal": "Optimum found: every constraint is satisfied, and the multipliers certify the first-order conditions.",
    "uncertified": "Feasible design found, but it is not certified as an optimum: run more starts, or check that the "
    "constraints are smooth there.",
    "no value": "The objective has no finite value at any design that was tried: analyse the original machine with "
    "`linkjax analyse`, or check the user-defined function.",
    "interrupted": "Interrupted; this is the best design so far.",
    "infeasible": "No start reached a design that satisfies every constraint; this one violates them least. Relax one "
    "of the conflicting constraints, widen a range, add design variables, or try more starts.",
}


def document(
    found: Optimum, before: Cycle, after: Cycle, name: str = "", version: str = "", scene_after: str | None = None
) -> dict[str, Any]:
    """An optimisation as nested dicts of plain numbers (SI; angles in rad), as `docs/json.md` describes.

    `before` and `after` are the analyses of the scenes `found.before` and `found.after`; the measures are taken from
    them. `scene_after` is the path of the file with the optimised scene. A value that does not exist is None.
    """
    problem, word = found.problem, outcome(found)
    goal = next(kind for kind in problem.kinds if kind.role == "objective")
    first = {kind.label: block.value if block.exists else None
             for kind, block in zip(problem.kinds, problem.first, strict=True)}  # fmt: skip
    asked = {kind.label: kind for kind in problem.kinds if kind.role != "objective"}
    missed = set(found.violated)
    return {
        "scene": name or found.before.title,
        "linkjax_version": version,
        "precision": str(np.asarray(found.before.speed).dtype),
        "objective": {
            "name": goal.name, "unit": goal.unit, "sense": "minimise" if goal.sign > 0 else "maximise",
            "before": found.objective_before, "after": found.objective, "peak_angles": list(found.peak_angles),
        },
        "variables": {v.name: _variable(found, i) for i, v in enumerate(problem.variables)},
        "limits": {
            label: {
                "value": met.value, "before": first[label], "bound": met.bound,
                "sense": "at most" if asked[label].sign > 0 else "at least", "unit": asked[label].unit,
                "met": label not in missed, "multiplier": met.multiplier, "active": met.multiplier > 0,
                "peak_angles": list(met.peak_angles),
            }
            for label, met in found.limits.items()
        },
        **_measures(before, after, {kind.name for kind in problem.kinds}),
        "units": {each.name: each.unit for each in MEASURES.values()},
        "history": [{"objective": goal.value(a), "violation": b}
                    for a, b in found.history],
        "notes": list(found.notes),
        "evaluations": found.evaluations,
        "starts": [start._asdict() for start in found.starts],
        "starts_at_optimum": found.starts_at_optimum,
        "kkt_residual": found.kkt_residual,
        "trade_off": _trade_off(found, goal.unit),
        "cases": [_case_name(case, i) for i, case in enumerate(problem.cases, 1)
                  if case != Case() or len(problem.cases) > 1],
        "solver": {"name": found.solver, "why": WHY[found.solver]},
        "scene_after": scene_after,
        "result": {
            "code": 0 if found.feasible else 1, "name": word, "message": MESSAGES[word],
            "conflicts": list(found.conflicts),
        },
    }  # fmt: skip


def _measures(before: Cycle, after: Cycle, asked: set[str]) -> dict[str, dict[str, float | None]]:
    """The measures of both machines, the same in both; None where one does not exist."""
    old, new = measured(before), measured(after)
    names = [name for name in MEASURES if name in {*old, *new, *asked}]
    return {"before": {name: old.get(name) for name in names}, "after": {name: new.get(name) for name in names}}


def _case_name(case: Case, place: int) -> str:
    return case.name or (f"case {place}" if case.changes else "unchanged")


def _variable(found: Optimum, i: int) -> dict[str, Any]:
    problem = found.problem
    name, multiplier = problem.variables[i].name, found.bound_multiplier.get(problem.variables[i].name, 0.0)
    low, high = float(problem.lower[i]), float(problem.upper[i])
    return {
        "before": float(problem.start[i]), "after": float(found.x[i]), "lower": low, "upper": high,
        "active": _active(found, name, float(found.x[i]), low, high), "unit": problem.numbers[i].unit,
        "bound_multiplier": multiplier,
        "no_effect": name in found.no_effect,
        "linked": {other: _linked(found, other) for other in problem.variables[i].linked},
    }  # fmt: skip


def _linked(found: Optimum, name: str) -> dict[str, Any]:
    at = number(found.before, name)
    return {"before": float(at.read(found.before)), "after": float(at.read(found.after)), "unit": at.unit}


def _active(found: Optimum, name: str, value: float, low: float, high: float) -> str:
    """The bound with a multiplier."""
    if name not in found.bound_multiplier:
        return ""
    return "lower" if value - low < high - value else "upper"


def _trade_off(found: Optimum, unit: str) -> dict[str, Any] | None:
    if not found.trade_off:
        return None
    names = [v.name for v in found.problem.variables]
    limit = next(kind for kind in found.problem.kinds if kind.name == found.traded and kind.role == "limit")
    every = [
        {"bound": limit.bound, "objective": found.objective, "feasible": found.feasible,
         "variables": dict(zip(names, map(float, found.x), strict=True))},
        *({"bound": point.bound, "objective": point.objective, "feasible": point.feasible,
           "variables": dict(zip(names, point.x, strict=True))} for point in found.trade_off),
    ]  # fmt: skip
    return {"limit": found.traded, "unit": limit.unit, "objective_unit": unit, "points": every}
