"""An optimum in plain text: what `print(best)` shows. Numbers have units; a dash means: does not exist."""

from __future__ import annotations

import math
from typing import Any

from linkjax._display import NONE, Numbers, aligned
from linkjax.design._names import number

SHOW = Numbers()
CERTIFIED = 1e-6
SAME = 1e-12  # of a range: a value so close to a bound is on it
WHILE = 'as given while the length changes (mass_properties = "fixed")'
Rows = list[tuple[str, ...]]


def outcome(found: Any) -> str:
    """The outcome: a key of `MESSAGES`."""
    if found.interrupted:
        return "interrupted"
    unsound = {kind.label for kind in found.problem.kinds if kind.role == "sound"} & set(found.violated)
    if not unsound and (found.objective is None or not math.isfinite(found.objective)):
        return "no value"
    if not found.feasible:
        return "infeasible"
    return "optimal" if found.kkt_residual <= CERTIFIED else "uncertified"


def notes(problem: Any, after: Any) -> tuple[str, ...]:
    """One line for the links whose mass stays as given while their length is a design variable: these links have a mass
    or inertia, `mass_properties = "fixed"`, and no free mass. Another line for those that are uniform, one for each
    uniform plate whose corners are no longer in order in the scene `after`, and one for each variable that is not
    within its range in the given scene."""
    free = {name for v in problem.variables for name in (v.name, *v.linked)}
    fixed = [
        (name, link) for name, link in problem.scene.mechanism.links.items()
        if f"links.{name}.length" in free and f"links.{name}.mass" not in free and link.mass_properties == "fixed"
        and float(link.mass) + float(link.inertia) > 0
    ]  # fmt: skip
    given = ", ".join(name for name, link in fixed if link.uniform is False)
    even = ", ".join(name for name, link in fixed if link.uniform is not False)
    found = [f"{given}: mass, centre and inertia stay {WHILE}"] if given else []
    found += [f"{even}: the mass stays {WHILE}; centre and inertia follow it (uniform)"] if even else []
    for name, link in after.mechanism.links.items():
        if (fault := link.uniform_fault()) is not None:
            found.append(f"{name}: {fault[0]} in the optimised design; narrow the ranges of its points")
    for i, (start, low, high) in enumerate(zip(problem.start, problem.lower, problem.upper, strict=True)):
        if max(low - start, start - high) > SAME * (high - low):
            name, side = problem.variables[i].name, "lower" if start < low else "upper"
            found.append(f"{name} of the given scene is not within its range; the first start is at its {side} bound")
    return tuple(found)


def optimum_text(found: Any) -> str:
    """Result, objective, variables and constraints of an optimum, each before and after."""
    goal = next(kind for kind in found.problem.kinds if kind.role == "objective")
    before, after = SHOW.told([found.objective_before, found.objective], goal.unit, 6)
    starts = f"{found.starts_at_optimum} of {len(found.starts)} starts at this optimum"
    head = [
        ("result", f"{outcome(found)}, KKT residual {found.kkt_residual:.1e}"),
        ("solver", f"{found.solver}, {found.evaluations} evaluations, {starts}"),
    ]
    if found.conflicts:
        head.append(("conflicts", ", ".join(found.conflicts)))
    head += [("note", note) for note in found.notes]
    sense = "minimise" if goal.sign > 0 else "maximise"
    objective = [("objective", "before", "after"), (f"{sense} {goal.name}", before, after)]
    tables = [aligned(rows) for rows in (head, objective, _variables(found), _limits(found)) if rows]
    title = found.before.title or "Scene"
    return "\n".join([f"{title}, optimised", *tables[0], *(line for table in tables[1:] for line in ("", *table))])


def _variables(found: Any) -> Rows:
    problem, values = found.problem, found.variables
    rows: Rows = [("variable", "before", "after", "lower", "upper", "")]
    for i, (name, (old, new)) in enumerate(values.items()):
        at = problem.numbers[i]
        bounds = SHOW.bound(problem.lower[i], at.unit), SHOW.bound(problem.upper[i], at.unit)
        note = "at its bound" if name in found.bound_multiplier else "no effect" if name in found.no_effect else ""
        rows.append((name, *SHOW.told([old, new], at.unit, 6), *bounds, note))
        for other in problem.variables[i].linked:
            linked = number(found.before, other)
            both = [float(linked.read(scene)) for scene in (found.before, found.after)]
            rows.append((f"  {other}", *SHOW.told(both, linked.unit, 6), NONE, NONE, "linked"))
    return rows


def _limits(found: Any) -> Rows:
    """Constraints with their bounds; those of the machine itself, that it can be assembled and runs, are among them."""
    problem = found.problem
    kinds = {kind.label: kind for kind in problem.kinds if kind.role != "objective"}
    first = {kind.label: block.value if block.exists else None
             for kind, block in zip(problem.kinds, problem.first, strict=True)}  # fmt: skip
    rows: Rows = [("constraint", "before", "after", "bound", "")]
    for label, limit in found.limits.items():
        kind = kinds[label]
        note = "violated" if label in found.violated else "active" if limit.multiplier > 0 else ""
        bound = f"{'≤' if kind.sign > 0 else '≥'} {SHOW.bound(limit.bound, kind.unit)}"
        rows.append((label, *SHOW.told([first[label], limit.value], kind.unit, 6), bound, note))
    return rows if len(rows) > 1 else []
