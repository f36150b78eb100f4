"""An optimisation as tables on the screen."""

from __future__ import annotations

import math
from typing import Any

from rich.table import Table
from rich.text import Text

from linkjax.cli._console import console

Data = dict[str, Any]
Display = dict[str, tuple[float, str]]


def amount(value: float | None, unit: str, shown: Display, digits: int = 6) -> str:
    """A quantity in the units asked for."""
    if value is None or not math.isfinite(value):
        return "–"
    factor, label = shown.get(unit, (1.0, "" if unit == "1" else unit))
    return f"{factor * value:.{digits}g} {label}".rstrip().replace(" °", "°").replace("^2", "²").replace("^3", "³")


def comment(data: Data) -> str:
    """What stands on top of the optimised scene."""
    goal = data["objective"]
    change = f"{goal['before']:.6g} -> {goal['after']:.6g} {goal['unit']}"
    return f"{data['scene']}, optimised by linkjax {data['linkjax_version']}\n{goal['name']}: {change}"


def print_optimum(data: Data, shown: Display, seconds: float) -> None:
    """Objective, limits, variables, measures, starts and certificate."""
    goal, result = data["objective"], data["result"]
    style = "bold" if result["code"] == 0 else "bold red"
    console.print(Text(f"\n{result['message']}", style=style))
    if result["clash"]:
        console.print(f"these clash: {', '.join(result['clash'])}", highlight=False, markup=False)
    _print_limits(data, shown)
    _print_variables(data, shown)
    _print_measures(data, shown)
    _print_trade_off(data, shown)
    starts = len(data["starts"])
    reached = f"{data['reached']} of {starts} starts reached it, " if starts > 1 else ""
    tied = _angles(goal["tied_angles"])
    console.print(f"\n{reached}{data['evaluations']} evaluations, KKT residual {data['kkt_residual']:.1e}, "
                  f"{seconds:.1f} s", highlight=False)  # fmt: skip
    if tied:
        how = "peaks tie at" if len(goal["tied_angles"]) > 1 else "its peak is at"
        console.print(f"{goal['name']}: {how} {tied}", highlight=False)
    console.print(f"solver     {data['solver']['name']}: {data['solver']['why']}", highlight=False)


def _print_limits(data: Data, shown: Display) -> None:
    """Objective and limits, with what the objective would gain per unit of room."""
    table = _table("", "before", "after", "bound", "objective per unit" if data["result"]["code"] == 0 else "")
    goal = data["objective"]
    table.add_row(
        f"{goal['sense']} {goal['name']}", amount(goal["before"], goal["unit"], shown),
        amount(goal["after"], goal["unit"], shown), "", "",
    )  # fmt: skip
    for name, limit in data["limits"].items():
        sign = "≤" if limit["sense"] == "at most" else "≥"
        table.add_row(
            name, amount(limit["before"], limit["unit"], shown), amount(limit["value"], limit["unit"], shown),
            f"{sign} {amount(limit['limit'], limit['unit'], shown)}",
            _price(limit, goal["unit"]) if data["result"]["code"] == 0 else "met" if limit["met"] else "NOT MET",
        )  # fmt: skip
    console.print()
    console.print(table, highlight=False)


def _price(limit: Data, unit: str) -> str:
    if not limit["active"]:
        return ""
    own = "" if limit["unit"] == "1" else f" per {limit['unit']}"
    tied = _angles(limit["tied_angles"])
    return f"{limit['multiplier']:.5g} {unit}{own}" + (f" (tied at {tied})" if tied else "")


def _print_variables(data: Data, shown: Display) -> None:
    table = _table("free", "before", "after", "from", "to", "at its bound: objective per unit")
    unit = data["objective"]["unit"]
    for name, v in data["variables"].items():
        parts = [amount(v[key], v["unit"], shown) for key in ("before", "after", "lower", "upper")]
        price = f"{v['active']}: {v['pull']:.5g} {unit} per {v['unit']}" if v["active"] else ""
        table.add_row(name, *parts, price or ("no effect on the optimum" if v["idle"] else ""))
        for tie, values in v["tied"].items():
            table.add_row(
                f"  tied: {tie}", *(amount(values[key], values["unit"], shown) for key in ("before", "after"))
            )
    console.print()
    console.print(table, highlight=False)


def _print_measures(data: Data, shown: Display) -> None:
    table = _table("measure", "before", "after")
    for name, unit in data["units"].items():
        if name in data["before"]:
            table.add_row(name, amount(data["before"][name], unit, shown), amount(data["after"][name], unit, shown))
    console.print()
    console.print(table, highlight=False)


def _print_trade_off(data: Data, shown: Display) -> None:
    trade = data["trade_off"]
    if trade is None:
        return
    table = _table(f"with {trade['limit']}", data["objective"]["name"])
    for point in trade["points"]:
        value = amount(point["objective"], trade["objective_unit"], shown)
        table.add_row(amount(point["limit"], trade["unit"], shown), value if point["feasible"] else "no design")
    console.print()
    console.print(table, highlight=False)


def _table(first: str, *others: str) -> Table:
    """A plain table whose first column is never cut."""
    table = Table(box=None, pad_edge=False)
    table.add_column(first, no_wrap=True)
    for heading in others:
        table.add_column(heading)
    return table


def _angles(angles: list[float]) -> str:
    return ", ".join(f"{math.degrees(angle):.2f}°" for angle in angles)
