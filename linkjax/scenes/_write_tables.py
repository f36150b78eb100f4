"""The keys of loads by tables and of gas loads, for a scene file that gives the same loads when it is read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from linkjax.loads import Coordinate, Diagram, Gas, Polytropic, Table
from linkjax.mechanism import StructureError
from linkjax.scenes._fields import amount

Keys = dict[str, Any]


def table_keys(load: Table) -> Keys:
    """The keys of a load by a table, without name, link and window."""
    keys: Keys = {"point": load.point} if load.point else {}
    if load.direction is not None:
        keys["direction"] = amount(load.direction, "rad")
    if load.over is None:
        keys |= _over_crank(load, "values", load.unit)
    else:
        at = "positions" if load.over.point else "angles"
        keys |= {"over": _over(load.over), at: [amount(x, load.over.unit) for x in load.at]}
        keys |= _branches(load, "values", load.unit)
    keys |= {} if load.method == "linear" else {"method": load.method}
    return {**keys, "reacts_on": load.reacts_on} if load.reacts_on else keys


def _over(over: Coordinate) -> Keys:
    keys: Keys = {"point": over.point} if over.point else {"link": over.link}
    return keys if over.direction is None else {**keys, "direction": amount(over.direction, "rad")}


def gas_keys(load: Gas) -> Keys:
    """The keys of a gas load, without name, link and window. Raises `StructureError` for another kind of pressure."""
    pressure = load.pressure
    if not isinstance(pressure, Diagram | Polytropic):
        raise StructureError(load.name, "scene files do not support a pressure of this kind",
                             "write a Diagram or a Polytropic")  # fmt: skip
    keys: Keys = {"point": load.point, "bore": amount(load.bore, "m"), "head": load.head}
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
        keys |= _branches(pressure, "pressures", "Pa")
    else:
        keys |= _over_crank(pressure, "pressures", "Pa")
    return keys if pressure.method == "linear" else {**keys, "method": pressure.method}


def _branches(table: Table | Diagram, key: str, unit: str) -> Keys:
    def listed(values: Sequence[Any]) -> list[str]:
        return [amount(value, unit) for value in values]

    if table.coming is None:
        return {key: listed(table.values)}
    return {"going": listed(table.values), "coming": listed(table.coming)}


def _over_crank(table: Table | Diagram, key: str, unit: str) -> Keys:
    """Angles and values, where a jump is two equal angles."""
    angles, values = [], []
    for angle, value in zip(table.at, table.values, strict=True):
        for each in value if isinstance(value, tuple) else (value,):
            angles.append(amount(angle, "rad"))
            values.append(amount(each, unit))
    return {"angles": angles, key: values, "cycle_turns": table.cycle_turns}
