"""The keys of loads by tables and of gas loads, for a scene file that gives the same loads when it is read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from linkjax.loads import AbstractLoad, Coordinate, Diagram, Gas, Polytropic, Table

Keys = dict[str, Any]
Amount = Callable[[Any, str], str]  # a number with its unit, to the last bit


def table_keys(load: AbstractLoad, amount: Amount) -> Keys | None:
    """The keys of a load by a table or of a gas load, without name, link and window; None for another load."""
    if isinstance(load, Table):
        return _table(load, amount)
    if isinstance(load, Gas) and isinstance(load.pressure, Diagram | Polytropic):
        return _gas(load, load.pressure, amount)
    return None


def _table(load: Table, amount: Amount) -> Keys:
    keys: Keys = {"kind": "table", **({"point": load.point} if load.point else {})}
    if load.direction is not None:
        keys["direction"] = amount(load.direction, "rad")
    if load.over is None:
        keys |= _over_crank(load, "values", load.unit, amount)
    else:
        at = "positions" if load.over.point else "angles"
        keys |= {"over": _over(load.over, amount), at: [amount(x, load.over.unit) for x in load.at]}
        keys |= _branches(load, "values", load.unit, amount)
    return keys if load.method == "linear" else {**keys, "method": load.method}


def _over(over: Coordinate, amount: Amount) -> Keys:
    keys: Keys = {"point": over.point} if over.point else {"link": over.link}
    return keys if over.direction is None else {**keys, "direction": amount(over.direction, "rad")}


def _gas(load: Gas, pressure: Diagram | Polytropic, amount: Amount) -> Keys:
    keys: Keys = {"kind": "gas", "point": load.point, "bore": amount(load.bore, "m"), "head": load.head}
    if load.clearance is not None:
        keys["clearance"] = amount(load.clearance, "m^3")
    keys["ambient"] = amount(load.ambient, "Pa")
    if load.reacts_on is None:
        keys["reacts_on"] = "outside"
    if isinstance(pressure, Polytropic):
        ends = {"suction": amount(pressure.suction, "Pa"), "discharge": amount(pressure.discharge, "Pa")}
        return {**keys, **ends, "exponent": float(pressure.exponent)}
    if pressure.by_volume:
        keys["volumes"] = [amount(x, "m^3") for x in pressure.at]
        keys |= _branches(pressure, "pressures", "Pa", amount)
    else:
        keys |= _over_crank(pressure, "pressures", "Pa", amount)
    return keys if pressure.method == "linear" else {**keys, "method": pressure.method}


def _branches(table: Table | Diagram, key: str, unit: str, amount: Amount) -> Keys:
    def listed(values: Sequence[Any]) -> list[str]:
        return [amount(value, unit) for value in values]

    if table.coming is None:
        return {key: listed(table.values)}
    return {"going": listed(table.values), "coming": listed(table.coming)}


def _over_crank(table: Table | Diagram, key: str, unit: str, amount: Amount) -> Keys:
    """Angles and values, where a jump is two equal angles."""
    angles, values = [], []
    for angle, value in zip(table.at, table.values, strict=True):
        for each in value if isinstance(value, tuple) else (value,):
            angles.append(amount(angle, "rad"))
            values.append(amount(each, unit))
    return {"angles": angles, key: values, "cycle_turns": table.cycle_turns}
