"""An optimisation as tables on the screen."""

from __future__ import annotations

from typing import Any

from rich.table import Table
from rich.text import Text

from linkjax._display import NONE, Numbers
from linkjax.analysis import measure_scales
from linkjax.cli._console import console

Data = dict[str, Any]


def amount(value: float | None, unit: str, show: Numbers) -> str:
    """A quantity in the units asked for."""
    return show.told([value], unit, 6)[0]


def comment(data: Data) -> str:
    """What stands on top of the optimised scene."""
    goal = data["objective"]
    old, new = (NONE if goal[key] is None else f"{goal[key]:.6g}" for key in ("before", "after"))
    change = f"{old} -> {new} {goal['unit']}"
    return f"{data['scene']}, optimised by linkjax {data['linkjax_version']}\n{goal['name']}: {change}"


def print_optimum(data: Data, show: Numbers, seconds: float) -> None:
    """Objective, limits, variables, measures, starts and certificate."""
    goal, result = data["objective"], data["result"]
    style = "bold" if result["code"] == 0 else "bold red"
    console.print(Text(f"\n{result['message']}", style=style))
    if result["conflicts"]:
        console.print(f"these clash: {', '.join(result['conflicts'])}", highlight=False, markup=False)
    _print_limits(data, show)
    _print_variables(data, show)
    _print_measures(data, show)
    _print_trade_off(data, show)
    starts = len(data["starts"])
    reached = f"{data['starts_at_optimum']} of {starts} starts reached it, " if starts > 1 else ""
    tied = _angles(goal["peak_angles"], show)
    console.print(f"\n{reached}{data['evaluations']} evaluations, KKT residual {data['kkt_residual']:.1e}, "
                  f"{seconds:.1f} s", highlight=False)  # fmt: skip
    if tied:
        how = "peaks tie at" if len(goal["peak_angles"]) > 1 else "its peak is at"
        console.print(f"{goal['name']}: {how} {tied}", highlight=False)
    console.print(f"solver     {data['solver']['name']}: {data['solver']['why']}", highlight=False)


def _print_limits(data: Data, show: Numbers) -> None:
    """Objective and limits, with what the objective would gain per unit of room."""
    table = _table("", "before", "after", "bound", "objective per unit (SI)" if data["result"]["code"] == 0 else "")
    goal, scales = data["objective"], measure_scales(data)
    both = show.told([goal["before"], goal["after"]], goal["unit"], 6, scales.get(goal["unit"], 0.0))
    table.add_row(f"{goal['sense']} {goal['name']}", *both, "", "")
    for name, limit in data["limits"].items():
        sign = "≤" if limit["sense"] == "at most" else "≥"
        table.add_row(
            name, *show.told([limit["before"], limit["value"]], limit["unit"], 6, scales.get(limit["unit"], 0.0)),
            f"{sign} {show.bound(limit['bound'], limit['unit'])}",
            _price(limit, goal["unit"], show) if data["result"]["code"] == 0 else "met" if limit["met"] else "NOT MET",
        )  # fmt: skip
    console.print()
    console.print(table, highlight=False)


def _price(limit: Data, unit: str, show: Numbers) -> str:
    if not limit["active"]:
        return ""
    own = "" if limit["unit"] == "1" else f" per {limit['unit']}"
    tied = _angles(limit["peak_angles"], show)
    return f"{limit['multiplier']:.5g} {unit}{own}" + (f" (tied at {tied})" if tied else "")


def _print_variables(data: Data, show: Numbers) -> None:
    table = _table("free", "before", "after", "from", "to", "at its bound: objective per unit (SI)")
    unit = data["objective"]["unit"]
    for name, v in data["variables"].items():
        parts = show.told([v["before"], v["after"]], v["unit"], 6)
        parts += [show.bound(v[key], v["unit"]) for key in ("lower", "upper")]
        price = f"{v['active']}: {v['bound_multiplier']:.5g} {unit} per {v['unit']}" if v["active"] else ""
        table.add_row(name, *parts, price or ("no effect on the optimum" if v["no_effect"] else ""))
        for tie, values in v["linked"].items():
            table.add_row(f"  tied: {tie}", *show.told([values["before"], values["after"]], values["unit"], 6))
    console.print()
    console.print(table, highlight=False)


def _print_measures(data: Data, show: Numbers) -> None:
    table, scales = _table("measure", "before", "after"), measure_scales(data)
    for name, unit in data["units"].items():
        if name in data["after"]:
            both = [data["before"][name], data["after"][name]]
            table.add_row(name, *show.told(both, unit, 6, scales.get(unit, 0.0)))
    console.print()
    console.print(table, highlight=False)


def _print_trade_off(data: Data, show: Numbers) -> None:
    trade = data["trade_off"]
    if trade is None:
        return
    table = _table(f"with {trade['limit']}", data["objective"]["name"])
    for point in trade["points"]:
        value = amount(point["objective"], trade["objective_unit"], show)
        table.add_row(show.bound(point["bound"], trade["unit"]), value if point["feasible"] else "no design")
    console.print()
    console.print(table, highlight=False)


def _table(first: str, *others: str) -> Table:
    """A plain table whose first column is never cut."""
    table = Table(box=None, pad_edge=False)
    table.add_column(first, no_wrap=True)
    for heading in others:
        table.add_column(heading)
    return table


def _angles(angles: list[float], show: Numbers) -> str:
    return ", ".join(show.turned(angle) for angle in angles)
