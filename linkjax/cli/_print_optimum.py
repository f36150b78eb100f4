"""Tables of an optimisation on the screen."""

from __future__ import annotations

from typing import Any

from rich.table import Table
from rich.text import Text

from linkjax._display import NONE, Numbers
from linkjax.analysis import measure_scales
from linkjax.cli._console import console

Data = dict[str, Any]
OWN = "own."  # numbers that are not in the scene, so that its file has them as a comment


def amount(value: float | None, unit: str, show: Numbers) -> str:
    """A quantity in the display units; a dash for None."""
    return show.told([value], unit, 6)[0]


def comment(data: Data) -> str:
    """The comment at the top of the optimised scene."""
    goal = data["objective"]
    old, new = (NONE if goal[key] is None else f"{goal[key]:.6g}" for key in ("before", "after"))
    change = f"{old} -> {new}{_unit(goal['unit'])}"
    own = [f"\n{name} = {v['after']:.12g}{_unit(v['unit'])}" for name, v in data["variables"].items()
           if name.startswith(OWN)]  # fmt: skip
    return f"{data['scene']}, optimised by linkjax {data['linkjax_version']}\n{goal['name']}: {change}" + "".join(own)


def print_optimum(data: Data, show: Numbers, seconds: float) -> None:
    """Print objective, constraints, variables, measures, starts and certificate."""
    goal, result = data["objective"], data["result"]
    style = "bold" if result["code"] == 0 else "bold red"
    console.print(Text(f"\n{result['message']}", style=style))
    if result["conflicts"]:
        console.print(f"conflicting constraints: {', '.join(result['conflicts'])}", highlight=False, markup=False)
    _print_limits(data, show)
    _print_variables(data, show)
    for note in data["notes"]:
        console.print(f"note: {note}", highlight=False, markup=False)
    _print_measures(data, show)
    _print_trade_off(data, show)
    starts = len(data["starts"])
    reached = f"{data['starts_at_optimum']} of {starts} starts reached the optimum, " if starts > 1 else ""
    angles = _angles(goal["peak_angles"], show)
    console.print(f"\n{reached}{data['evaluations']} evaluations, KKT residual {data['kkt_residual']:.1e}, "
                  f"{seconds:.1f} s", highlight=False)  # fmt: skip
    if angles:
        how = "equal peaks at" if len(goal["peak_angles"]) > 1 else "peak at"
        console.print(f"{goal['name']}: {how} {angles}", highlight=False)
    console.print(f"solver     {data['solver']['name']}: {data['solver']['why']}", highlight=False)


def _print_limits(data: Data, show: Numbers) -> None:
    """Print objective and constraints, with the improvement of the objective per unit of relaxation."""
    table = _table("", "before", "after", "bound", "improvement per unit (SI)" if data["result"]["code"] == 0 else "")
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
    angles, peaks = _angles(limit["peak_angles"], show), "equal peaks" if len(limit["peak_angles"]) > 1 else "peak"
    return _per(limit["multiplier"], unit, limit["unit"]) + (f" ({peaks} at {angles})" if angles else "")


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _per(multiplier: float, unit: str, own: str) -> str:
    """A multiplier in the unit of the objective per unit of a bound."""
    return f"{multiplier:.5g}{_unit(unit)}" + ("" if own == "1" else f" per {own}")


def _print_variables(data: Data, show: Numbers) -> None:
    table = _table("design variable", "before", "after", "from", "to", "at a bound: improvement per unit (SI)")
    unit = data["objective"]["unit"]
    for name, v in data["variables"].items():
        parts = show.told([v["before"], v["after"]], v["unit"], 6)
        parts += [show.bound(v[key], v["unit"]) for key in ("lower", "upper")]
        price = f"{v['active']}: {_per(v['bound_multiplier'], unit, v['unit'])}" if v["active"] else ""
        table.add_row(name, *parts, price or ("no effect on the optimum" if v["no_effect"] else ""))
        for tie, values in v["linked"].items():
            table.add_row(f"  linked: {tie}", *show.told([values["before"], values["after"]], values["unit"], 6))
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
        table.add_row(show.bound(point["bound"], trade["unit"]), value if point["feasible"] else "no feasible design")
    console.print()
    console.print(table, highlight=False)


def _table(first: str, *others: str) -> Table:
    """A plain table with a first column that is never cut."""
    table = Table(box=None, pad_edge=False)
    table.add_column(first, no_wrap=True)
    for heading in others:
        table.add_column(heading)
    return table


def _angles(angles: list[float], show: Numbers) -> str:
    return ", ".join(show.turned(angle) for angle in angles)
