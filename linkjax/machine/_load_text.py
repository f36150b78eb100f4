"""Loads by tables and gas loads in words."""

from __future__ import annotations

from typing import Any

from linkjax._display import Numbers
from linkjax.loads import AbstractLoad, Diagram, Gas, Polytropic, Table


def table_text(show: Numbers, load: AbstractLoad) -> str | None:
    """How large a load by a table or a gas load is: "table over the crank angle, 0 to 20 N·m"; None for another
    load."""
    if isinstance(load, Table):
        over = "the crank angle" if load.over is None else f"the {_measured(load.over)} of {load.over.of}"
        return f"table over {over}, {_range(show, load, load.unit)}"
    if isinstance(load, Gas):
        bore = f"bore {show.shown(load.bore, 'm')}"
        if isinstance(load.pressure, Polytropic):
            ends = " to ".join(show.shown(each, "Pa") for each in (load.pressure.suction, load.pressure.discharge))
            return f"compressor, {bore}, {ends}, n = {show.shown(load.pressure.exponent)}"
        if isinstance(load.pressure, Diagram):
            over = "volume" if load.pressure.by_volume else "crank angle"
            return f"gas by an indicator diagram over the {over}, {bore}, {_range(show, load.pressure, 'Pa')}"
        return f"gas, {bore}"
    return None


def _measured(over: Any) -> str:
    return "position" if over.point else "angle"


def _range(show: Numbers, table: Any, unit: str) -> str:
    every = [float(part) for values in (table.values, table.coming or ()) for value in values
             for part in (value if isinstance(value, tuple) else (value,))]  # fmt: skip
    return " to ".join(show.bound(each, unit) for each in (min(every), max(every)))
