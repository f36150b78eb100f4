"""Convergence of an optimisation, and the objective over the bound of a constraint."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from linkjax._display import Units, in_words, prefixed, superscript
from linkjax._units import label_of
from linkjax.viz._style import (
    BLUE,
    GREY,
    VERMILION,
    key,
    label,
    largest,
    sheet,
    styled,
)


def scaled(values: list[Any], unit: str, units: Units | None) -> tuple[np.ndarray, str]:
    """Numbers (None for a missing one) in the unit to be displayed, and its label; angles in degrees by default."""
    found = np.array([np.nan if value is None else float(value) for value in values])
    if unit == "rad":
        factor, shown = (units or {}).get("rad", (180 / np.pi, "°"))
    else:
        factor, shown = prefixed(largest([found]), label_of(unit), units)
    return factor * found, shown


def _ends_at(course: list[Any], objective: dict[str, Any]) -> bool:
    """Whether the history is in the unit of the objective, not in an internal scale: it ends at the final objective."""
    last, after = course[-1], objective.get("after")
    return last is not None and after is not None and abs(last - after) <= 1e-3 * abs(after)


@styled
def history_figure(optimum: dict[str, Any], units: Units | None = None) -> Figure:
    """Objective and largest constraint violation over the iterations."""
    steps, objective = optimum["history"], optimum["objective"]
    course = [step["objective"] for step in steps]
    values, shown = scaled(course, objective["unit"] if _ends_at(course, objective) else "1", units)
    violation, _ = scaled([step["violation"] for step in steps], "1", None)
    figure, ((left, right),) = sheet("Convergence", 1, 2, panel=1.7, gap=(0.75, 0.42))
    dots: dict[str, Any] = {"marker": ".", "markersize": 4, "linewidth": 1.2}
    left.plot(values, color=BLUE, **dots)
    left.set_title(label(in_words(objective["name"]), shown), fontsize=7.5)
    above = np.where(violation > 0, violation, np.nan)
    right.plot(above, color=VERMILION, **dots)
    right.set_title("max constraint violation, relative" + (" (logarithmic)" if np.any(above > 0) else ""),
                    fontsize=7.5)  # fmt: skip
    if np.any(above > 0):
        right.set_yscale("log")
        right.yaxis.set_major_locator(LogLocator(numticks=6))
        right.yaxis.set_minor_locator(NullLocator())
        right.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"10{superscript(round(np.log10(y)))}"))
    else:
        right.set_ylim(-0.05, 1)
        right.text(0.5, 0.5, "none", transform=right.transAxes, ha="center", color=GREY)
    for ax in (left, right):
        ax.set_xlim(-0.02 * max(len(steps) - 1, 1), 1.02 * max(len(steps) - 1, 1))
        ax.xaxis.set_major_locator(MaxNLocator(8, integer=True))
        ax.set_xlabel("iteration")
    return figure


@styled
def trade_off_figure(optimum: dict[str, Any], units: Units | None = None) -> Figure:
    """Best objective over the bound of one constraint; crosses mark bounds without a feasible design."""
    trade, objective = optimum["trade_off"], optimum["objective"]
    points = trade["points"]
    bounds, bound_unit = scaled([point["bound"] for point in points], trade["unit"], units)
    values, shown = scaled([point["objective"] for point in points], trade["objective_unit"], units)
    met = np.array([bool(point["feasible"]) for point in points])
    keys = [key("feasible", color=BLUE, marker="o", linewidth=1.4, markersize=4.5)]
    keys += [key("infeasible", color=VERMILION, marker="x", linewidth=0, markersize=6)] if not np.all(met) else []
    figure, ((ax,),) = sheet("Trade-off", 1, 1, panel=2.2, keys=keys)
    order = np.argsort(bounds)
    sound = order[met[order]]
    ax.plot(bounds[sound], values[sound], color=BLUE, marker="o", linewidth=1.4, markersize=4.5)
    ax.plot(bounds[~met], values[~met], "x", color=VERMILION, markersize=6)
    ax.set_title(label(in_words(objective["name"]), shown))
    ax.set_xlabel(label(f"bound of {in_words(trade['limit'])}", bound_unit))
    ax.margins(0.06)
    return figure
