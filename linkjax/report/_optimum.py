"""Tables of an optimisation, from its document."""

from __future__ import annotations

import math
from typing import Any

from linkjax._display import NONE, above, in_words
from linkjax.analysis import measure_scales
from linkjax.report._cells import Cell, Cells, table, words

Data = dict[str, Any]


def asked(show: Cells, optimum: Data) -> str:
    """The problem: objective, design variables, constraints, cases; and the solver."""
    goal, solver = optimum["objective"], optimum["solver"]
    rows = [["objective", f"{goal['sense']} {in_words(goal['name'])}"]]
    free = [f"{name} ({show.bound(v['lower'], v['unit'])} … {show.bound(v['upper'], v['unit'])})"
            for name, v in optimum["variables"].items()]  # fmt: skip
    rows.append(["design variables", "; ".join(free) or NONE])
    limits = [
        f"{in_words(label).removesuffix(' ' + limit['sense'])} {limit['sense']} "
        f"{show.bound(limit['bound'], limit['unit'])}"
        for label, limit in optimum["limits"].items()
    ]
    rows.append(["constraints", "; ".join(limits) or "none"])
    if optimum.get("before_is"):
        rows.append(["before", optimum["before_is"]])
    if optimum["cases"]:
        rows.append(["cases (the objective is the worst)", ", ".join(optimum["cases"])])
    rows += [["note", note] for note in optimum["notes"]]
    rows.append(["solver", f"{solver['name']}: {solver['why']}"])
    return table(["problem", ""], [[words(name), words(text)] for name, text in rows])


def measures(show: Cells, optimum: Data) -> str:
    """Objective and all measures, before and after."""
    goal, units, scales = optimum["objective"], optimum["units"], measure_scales(optimum)
    name = f"{in_words(goal['name'])}, worst case" if optimum["cases"] else in_words(goal["name"])
    rows = [_change(show, name, goal["before"], goal["after"], goal["unit"], "objective", scales)]
    for name, after in optimum["after"].items():
        if name != goal["name"] or optimum["cases"]:  # measures are of the scene itself, without the cases
            rows.append(
                _change(show, in_words(name), optimum["before"].get(name), after, units.get(name, "1"), "", scales)
            )
    return table(["measure", "before", "after", "change", ""], rows, "Before and after")


def variables(show: Cells, optimum: Data) -> str:
    """Design variables: before, after, bounds, and the active bound."""
    held = any(v["active"] or v["no_effect"] for v in optimum["variables"].values())
    rows = []
    for name, v in optimum["variables"].items():
        row = [words(name), *show.several([v["before"], v["after"]], v["unit"], 6)]
        row += [Cell(show.bound(v[end], v["unit"]), True) for end in ("lower", "upper")]
        if held:
            idle = "no effect" if v["no_effect"] else ""
            row.append(Cell(f"at {v['active']} bound" if v["active"] else idle, look="s"))
            row.append(Cell(_plain_number(show, v["bound_multiplier"]) if v["active"] else "", True))
        rows.append(row)
        for tie, values in v["linked"].items():
            row = [words(f"linked: {tie}"), *show.several([values["before"], values["after"]], values["unit"], 6)]
            rows.append([*row, *[Cell("")] * (len(rows[-1]) - len(row))])
    head = ["design variable", "before", "after", "lower bound", "upper bound"]
    return table([*head, "", "multiplier (SI)"] if held else head, rows, "Design variables")


def limits(show: Cells, optimum: Data) -> str:
    """Constraints: value, bound, multiplier, whether active or violated, and the crank angles of equal peaks."""
    rows, feasible, scales = [], optimum["result"]["code"] == 0, measure_scales(optimum)
    for label, limit in optimum["limits"].items():
        beside = scales.get(limit["unit"], 0.0)
        cells = show.several([limit["before"], limit["value"]], limit["unit"], beside=beside)
        cells.append(Cell(f"{limit['sense']} {show.bound(limit['bound'], limit['unit'])}", True))
        price = Cell(_plain_number(show, limit["multiplier"]) if feasible else "", True)
        state = Cell("violated" if not limit["met"] else "active" if limit["active"] and feasible else "")
        rows.append([words(in_words(label)), *cells, price, state, words(angles(show, limit["peak_angles"]))])
    head = ["constraint", "before", "after", "bound", "multiplier (SI)", "", "peaks at"]
    return table(head, rows, "Constraints") if rows else ""


def outcome(show: Cells, optimum: Data) -> str:
    """Convergence: starts, residual of the optimality conditions, evaluations, crank angles of equal peaks."""
    starts, goal = optimum["starts"], optimum["objective"]
    rows = [["residual of the optimality conditions (KKT)", _plain_number(show, optimum["kkt_residual"], 2)],
            ["cycle evaluations", str(optimum["evaluations"])]]  # fmt: skip
    if starts:
        feasible = sum(bool(start["feasible"]) for start in starts)
        text = f"{optimum['starts_at_optimum']} of {len(starts)} reached the optimum; {feasible} feasible"
        rows.append(["starts", text])
    if goal["peak_angles"]:
        how = "equal peaks" if len(goal["peak_angles"]) > 1 else "peak"
        rows.append([f"{how} of the objective at", angles(show, goal["peak_angles"])])
    if optimum["scene_after"]:
        rows.append(["scene file of the optimum", str(optimum["scene_after"])])
    text = table(["convergence", ""], [[words(name), words(value)] for name, value in rows])
    if len(starts) > 1:
        reached = show.several([start["objective"] for start in starts], goal["unit"], 6)
        each = []
        for i, (start, cell) in enumerate(zip(starts, reached, strict=True)):
            residual = Cell(_plain_number(show, start["residual"], 2), True)
            count = Cell(str(start["evaluations"]), True)
            each.append([words(i + 1), cell, words("yes" if start["feasible"] else "no"), residual, count])
        text += table(["start", "objective", "feasible", "residual", "evaluations"], each, "Starts")
    return text


def conflicts(optimum: Data) -> str:
    """Table of the conflicting constraints; empty if there are none."""
    names = optimum["result"]["conflicts"]
    rows = [[words(in_words(name)), words(_missed(optimum["limits"].get(name)))] for name in names]
    return table(["conflicting constraints", ""], rows) if rows else ""


def _missed(limit: Data | None) -> str:
    if limit is None or limit["value"] is None:
        return ""
    return "satisfied" if limit["met"] else "violated"


def angles(show: Cells, found: list[float]) -> str:
    """Crank angles separated by commas; a dash for none."""
    return ", ".join(show.turned(angle) for angle in found) or NONE


def _change(
    show: Cells, name: str, before: Any, after: Any, unit: str, mark: str, scales: dict[str, float]
) -> list[Cell]:  # fmt: skip
    beside = scales.get(unit, 0.0)
    old, new = (math.nan if value is None else above(float(value), beside) for value in (before, after))
    share = 100 * (new - old) / abs(old) if old and math.isfinite(old) and math.isfinite(new) else math.nan
    text = f"{share:+.1f} %" if abs(share) >= 0.05 else "0.0 %"
    text = NONE if math.isnan(share) else text.replace("-", "−")
    return [words(name), *show.several([before, after], unit, beside=beside), Cell(text, True), words(mark)]


def _plain_number(show: Cells, value: Any, digits: int = 4) -> str:
    return NONE if value is None else show.quantity(float(value), "", digits)
