"""Figures of a run: speed and motor torque over time, operating points on the characteristic of the motor."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import jax.numpy as jnp
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from linkjax._display import Units, prefixed, turning
from linkjax._units import display_units
from linkjax.machine import Scene
from linkjax.viz._style import BLACK, BLUE, GREY, STYLE, VERMILION, Data, key, label, largest, sheet, styled
from linkjax.viz._write import svg

CURVE = 200  # points of a characteristic


@styled
def run_speed_figure(data: Data, scene: Scene, units: Units | None = None) -> Figure:
    """Crank speed over time, with the events of the run, and the crank angle in turns."""
    turn, per = turning(units)
    time, speed = (np.asarray(data[name], float) for name in ("time", "speed"))
    figure, ((top,), (bottom,)) = sheet(scene.title or "Run", 2, 1, panel=(2.2, 1.2))
    top.plot(time, turn * speed, color=BLUE, linewidth=1.5)
    top.set_title(label("crank speed", per))
    ends = "standstill" if data["stopped"] else "run-down"
    for name, text in {"run_up_time": "run-up", "run_down_time": ends}.items():
        if data[name] is not None and data[name] <= time[-1]:
            top.axvline(data[name], color=VERMILION, linewidth=1.0, linestyle=(0, (4, 2)))
            top.annotate(f" {text} {data[name]:.4g} s", (data[name], 0.5), xycoords=("data", "axes fraction"),
                         fontsize=7.5, color=VERMILION)  # fmt: skip
    bottom.plot(time, np.asarray(data["angle"], float) / (2 * np.pi), color=BLACK, linewidth=1.3)
    bottom.set_title(label("crank angle", "turns"))
    _over_time([top, bottom], time)
    return figure


@styled
def run_torque_figure(data: Data, scene: Scene, units: Units | None = None) -> Figure:
    """Torque and power of the motor over time."""
    time = np.asarray(data["time"], float)
    figure, rows = sheet(scene.title or "Run", 2, 1, panel=(1.7, 1.7))
    axes = [row[0] for row in rows]
    parts = (("motor_torque", "motor torque", "N·m", BLUE), ("motor_power", "motor power", "W", VERMILION))
    for ax, (name, text, unit, colour) in zip(axes, parts, strict=True):
        values = np.asarray(data[name], float)
        factor, shown = prefixed(largest([values]), unit, units)
        ax.plot(time, factor * values, color=colour, linewidth=1.5)
        ax.axhline(0, color=GREY, linewidth=0.6)
        ax.set_title(label(text, shown))
    _over_time(axes, time)
    return figure


@styled
def run_characteristic_figure(data: Data, scene: Scene, units: Units | None = None) -> Figure:
    """The operating points of a run on the characteristic of the motor. Raises `ValueError` without a motor."""
    if scene.motor is None:
        raise ValueError("the scene has no motor, so it has no characteristic; write a scene with one")
    turn, per = turning(units)
    speed, torque = (np.asarray(data[name], float) for name in ("motor_speed", "motor_torque"))
    low, high = min(0.0, float(speed.min())), max(float(speed.max()), 1e-9)
    shafts = np.linspace(low, high + 0.1 * (high - low), CURVE)
    curve = np.asarray(scene.motor.motor.torque(jnp.asarray(shafts)), float)
    factor, shown = prefixed(largest([curve, torque]), "N·m", units)
    keys = [
        key("characteristic", color=GREY, linewidth=1.2),
        key("operating points", color=BLUE, linewidth=0, marker="o", markersize=3),
    ]
    figure, ((ax,),) = sheet(scene.title or "Run", 1, 1, panel=2.8, keys=keys)
    ax.plot(turn * shafts, factor * curve, color=GREY, linewidth=1.2)
    ax.plot(turn * speed, factor * torque, "o", color=BLUE, markersize=2.2, alpha=0.5, markeredgewidth=0)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.set_title(label("motor torque", shown))
    ax.set_xlabel(f"motor speed  ({per})")
    return figure


def _over_time(axes: list[Axes], time: np.ndarray) -> None:
    for ax in axes:
        ax.set_xlim(time[0], time[-1])
        ax.tick_params(axis="x", labelbottom=ax is axes[-1])
    axes[-1].set_xlabel("time  (s)")


def write_run_figures(data: Data, scene: Scene, directory: str | Path, units: str = "") -> list[Path]:
    """Write the figures of a run as PNG (150 dpi) and SVG; create a missing directory. `data` is the document of a run
    (see `linkjax.runs.run_document`), `units` are the display units. Returns the files. Raises `QuantityError` for an
    unknown unit."""
    folder, shown = Path(directory), display_units(units)
    draw: dict[str, Callable[..., Figure]] = {"run-speed": run_speed_figure}
    if scene.motor is not None and any(data["motor_torque"]):
        draw |= {"run-torque": run_torque_figure, "run-characteristic": run_characteristic_figure}
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, make in draw.items():
        figure = make(data, scene, units=shown)
        raster, vector = folder / f"{name}.png", folder / f"{name}.svg"
        with matplotlib.rc_context({**STYLE, "svg.hashsalt": name}):
            figure.savefig(raster, dpi=150, metadata={"Software": None}, pil_kwargs={"compress_level": 4})
        vector.write_text(svg(name, figure), encoding="utf-8")
        written += [raster, vector]
    return written
