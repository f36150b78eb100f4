"""Force and power of every load, and of the drive."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from linkjax._display import Units, prefixed
from linkjax.analysis import moves
from linkjax.machine import Scene
from linkjax.viz._style import (
    BLACK,
    GREY,
    Data,
    before_keys,
    behind,
    closed,
    degrees,
    key,
    label,
    largest,
    line,
    over_crank,
    sheet,
    styled,
    window_keys,
)

DRIVE: dict[str, Any] = {"color": BLACK, "linewidth": 1.4, "linestyle": (0, (5, 2))}


@styled
def loads_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """Magnitude of the force of each load, torque of the loads that are torques, and power of each load, of gravity and
    of the drive, at the motor's shaft if there is a motor; in the actual motion, or at constant speed without one."""
    names = _acting(data)
    looks = {name: line(i) for i, name in enumerate(names)}
    forces = [name for name in names if "fx" in data["loads"][name]]
    torques = [name for name in names if "moment" in data["loads"][name]]
    kinds = [("force", "N", forces)] * bool(forces) + [("torque", "N·m", torques)] * bool(torques)
    kinds.append(("power", "W", [name for name in names if largest([data["loads"][name]["power"]]) > 0]))
    drive = "drive" if data.get("motor") is None else "motor"
    keys = [*(key(name, **looks[name]) for name in names), key(drive, **DRIVE)]
    keys += [*before_keys(before), *window_keys(data, scene)]
    how = "actual motion" if moves(data) else "constant speed"
    figure, axes = sheet(f"Loads, {how}", len(kinds), 1, panel=1.7, keys=keys)
    for (ax,), (what, unit, own) in zip(axes, kinds, strict=True):
        curves = {name: _values(data, name, what) for name in own}
        driven = [_drive(data, scene)] if what == "power" else []
        factor, shown = prefixed(largest([*curves.values(), *driven]), unit, units)
        for name in own if before else ():
            if name in _acting(before or {}):
                behind(ax, degrees(before or data, scene), factor * _values(before or data, name, what))
        for name, curve in curves.items():
            ax.plot(degrees(data, scene), factor * curve, **looks[name])
        for curve in driven:
            ax.plot(degrees(data, scene), factor * curve, **DRIVE)
        ax.axhline(0, color=GREY, linewidth=0.6)
        ax.set_title(label(what, shown))
    over_crank([ax for (ax,) in axes], data, scene)
    return figure


def acts(data: Data) -> bool:
    """Whether an analysis has a load, or a weight, that does anything."""
    return bool(_acting(data))


def _acting(data: Data) -> list[str]:
    """The loads with a force or power."""
    every = data.get("loads") or {}
    series = {name: [run[key] for key in ("fx", "fy", "moment", "power") if key in run] for name, run in every.items()}
    return [name for name, each in series.items() if largest(each) > 0]


def _values(data: Data, name: str, what: str) -> np.ndarray:
    """A quantity of a load over the closed cycle."""
    run = data["loads"][name]
    if what == "force":
        return closed(data, np.hypot(run["fx"], run["fy"]))
    return closed(data, run["moment" if what == "torque" else "power"])


def _drive(data: Data, scene: Scene) -> np.ndarray:
    """Power of the motor at its shaft, or of the drive on the crank."""
    if data.get("motor") is not None:
        return closed(data, data["motor"]["power"])
    if moves(data) and data["motion"].get("power") is not None:
        return closed(data, data["motion"]["power"])
    return closed(data, data["forces_constant_speed"]["drive_torque"]) * float(scene.speed)
