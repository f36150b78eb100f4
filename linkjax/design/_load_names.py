"""The parameters of loads by tables and of gas loads, by the keys of a scene file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import equinox as eqx

from linkjax.loads import AbstractLoad, Gas, Polytropic, Table

Path = tuple[str, Callable[[Any], Any], str, float]  # name, the parameter in a load, its unit, its least value
GAS = {"bore": ("m", 1e-6), "clearance": ("m^3", 1e-12), "ambient": ("Pa", 0.0)}
POLYTROPIC = {"suction": ("Pa", 1e-3), "discharge": ("Pa", 1e-3), "exponent": ("1", 1e-3)}
NONE = float("-inf")


def table_parameters(load: AbstractLoad) -> Iterator[Path] | None:
    """The parameters of a load by a table or of a gas load, without those of its window; None for another load.

    A jump is one angle with two values: `values[2][0]` and `values[2][1]`, before and after it."""
    if isinstance(load, Table):
        return _table(load)
    return _gas(load) if isinstance(load, Gas) else None


def _table(load: Table) -> Iterator[Path]:
    if load.direction is not None:
        yield "direction", lambda s: s.direction, "rad", NONE
    if load.over is not None and load.over.direction is not None:
        yield "over.direction", lambda s: s.over.direction, "rad", NONE
    key, unit = ("positions", "m") if load.over is not None and load.over.point else ("angles", "rad")
    yield from _listed(key, load.at, lambda s: s.at, unit, NONE)
    first = "values" if load.coming is None else "going"
    yield from _listed(first, load.values, lambda s: s.values, load.unit, NONE)
    yield from _listed("coming", load.coming or (), lambda s: s.coming, load.unit, NONE)


def _gas(load: Gas) -> Iterator[Path]:
    for key, (unit, least) in GAS.items():
        if eqx.is_array(getattr(load, key)):
            yield key, lambda s, k=key: getattr(s, k), unit, least
    pressure: Any = load.pressure
    if isinstance(pressure, Polytropic):
        for key, (unit, least) in POLYTROPIC.items():
            yield key, lambda s, k=key: getattr(s.pressure, k), unit, least
        return
    key, unit = ("volumes", "m^3") if pressure.by_volume else ("angles", "rad")
    yield from _listed(key, pressure.at, lambda s: s.pressure.at, unit, 0.0 if pressure.by_volume else NONE)
    first = "pressures" if pressure.coming is None else "going"
    yield from _listed(first, pressure.values, lambda s: s.pressure.values, "Pa", 0.0)
    yield from _listed("coming", pressure.coming or (), lambda s: s.pressure.coming, "Pa", 0.0)


def _listed(key: str, values: Any, where: Callable[[Any], Any], unit: str, least: float) -> Iterator[Path]:
    for i, value in enumerate(values):
        if not isinstance(value, tuple):
            yield f"{key}[{i}]", lambda s, i=i: where(s)[i], unit, least
            continue
        for k in (0, 1):
            yield f"{key}[{i}][{k}]", lambda s, i=i, k=k: where(s)[i][k], unit, least
