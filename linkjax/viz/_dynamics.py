"""Torque and work of the cycle, and the speed of the crank."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from linkjax._display import Units, number, prefixed, turning
from linkjax.analysis import moves
from linkjax.machine import Scene
from linkjax.viz._style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    VERMILION,
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


@styled
def torque_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """Reduced torque of each load, drive torque (its mean unless a motor or a motion law gives it), their work over
    the cycle, and the kinetic energy; without an actual motion, only torque and work of the loads.

    Work is integrated by the trapezoidal rule over the angles shown; the kinetic energy is ½ J ω².
    """
    phi, reduced, runs = degrees(data, scene), data["reduced"], moves(data)
    before = before if before and moves(before) == runs else None
    drive = np.full(phi.shape, float(data["motion"]["mean_drive_torque"]) if runs else 0.0)
    if runs and (data.get("motor") is not None or scene.mechanism.prescribed):
        drive = closed(data, data["forces"]["drive_torque"])
    loads = {name: closed(data, reduced["torque_by_load"][name]) for name in loaded(data)}
    looks = {name: line(i) for i, name in enumerate(loads)}
    total, mean = {"color": BLACK, "linewidth": 1.6}, {"color": GREY, "linewidth": 1.4, "linestyle": (0, (5, 2))}
    energy_look = {"color": BLACK, "linewidth": 1.6, "linestyle": (0, (1.5, 1.5))}
    keys = [key(name, **look) for name, look in looks.items()]
    keys += [key("all loads", **total)] if len(loads) > 1 else []
    keys += [key("drive", **mean), key("change of kinetic energy", **energy_look)] if runs else []
    keys += [*before_keys(before), *window_keys(data, scene)]
    figure, ((top,), (bottom,)) = sheet("Torque and work, reduced to the crank", 2, 1, panel=2.1, keys=keys)

    torque = closed(data, reduced["torque"])
    factor, shown = prefixed(largest([torque, drive, *loads.values()]), "N·m", units)
    if before:
        behind(top, degrees(before, scene), factor * closed(before, before["reduced"]["torque"]))
    if len(loads) > 1:
        top.plot(phi, factor * torque, **total)
    for name, share in loads.items():
        top.plot(phi, factor * share, **looks[name])
    if runs:
        top.plot(phi, factor * drive, **mean)
    top.axhline(0, color=GREY, linewidth=0.6)
    top.set_title(label("torque", shown))

    angles = np.radians(phi)
    works = {name: integral(angles, share) for name, share in loads.items()}
    driven, gain = integral(angles, drive), _gain(data) if runs else 0.0 * angles
    factor, shown = prefixed(largest([driven, gain, *works.values()]), "J", units)
    if before and runs:
        behind(bottom, degrees(before, scene), factor * _gain(before))
    for name, work in works.items():
        bottom.plot(phi, factor * work, **looks[name])
    if runs:
        bottom.plot(phi, factor * driven, **mean)
        bottom.plot(phi, factor * gain, **energy_look)
    bottom.axhline(0, color=GREY, linewidth=0.6)
    bottom.set_title(label(f"work since φ = 0{', and change of kinetic energy' if runs else ''}", shown))
    over_crank([top, bottom], data, scene)
    return figure


def loaded(data: Data) -> list[str]:
    """The loads with a reduced torque."""
    return [name for name, share in data["reduced"]["torque_by_load"].items() if largest([share]) > 0]


def _gain(data: Data) -> np.ndarray:
    """Change of kinetic energy since the start of the cycle, over the closed cycle."""
    energy = 0.5 * closed(data, data["reduced"]["inertia"]) * closed(data, data["motion"]["speed"]) ** 2
    return energy - energy[0]


def integral(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Cumulative integral by the trapezoidal rule, zero at the start."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(x))])


@styled
def speed_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """Crank speed with its mean, maximum, minimum and δ; angular acceleration of the crank."""
    phi, motion = degrees(data, scene), data["motion"]
    turn, per = turning(units)
    name = "time mean" if scene.mean == "time" else "mean of max and min"
    mean = {"color": GREEN, "linewidth": 1.1, "linestyle": (0, (5, 2))}
    keys = [key("actual motion", color=BLUE, linewidth=1.7), key(name, **mean)]
    keys += [*before_keys(before), *window_keys(data, scene)]
    figure, ((top,), (bottom,)) = sheet("Crank speed", 2, 1, panel=(2.2, 1.4), keys=keys, right=1.05)
    acceleration = closed(data, motion["acceleration"])
    factor, shown = prefixed(largest([acceleration]), "rad/s²")
    if before:
        behind(top, degrees(before, scene), turn * closed(before, before["motion"]["speed"]))
        behind(bottom, degrees(before, scene), factor * closed(before, before["motion"]["acceleration"]))
    top.plot(phi, turn * closed(data, motion["speed"]), color=BLUE, linewidth=1.7)
    top.axhline(turn * float(motion["mean_speed"]), **mean)
    top.set_title(label("speed ω", per))
    over_crank([top, bottom], data, scene)
    _extremes(top, data, scene, units)
    if before:
        low, high = top.get_ylim()
        old = [turn * float(before["motion"][f"{which}_speed"]) for which in ("min", "max")]
        room = 0.05 * (max(high, old[1]) - min(low, old[0]))
        top.set_ylim(min(low, old[0] - room), max(high, old[1] + room))
    bottom.plot(phi, factor * acceleration, color=VERMILION, linewidth=1.4)
    bottom.axhline(0, color=GREY, linewidth=0.6)
    bottom.set_title(label("angular acceleration ε", shown))
    return figure


def _extremes(ax: Axes, data: Data, scene: Scene, units: Units | None) -> None:
    """Mark maximum and minimum speed at their angles, and dimension δ to the right of the panel."""
    motion, end = data["motion"], 360 * scene.cycle_turns
    ends, (turn, per) = {}, turning(units)
    for which, up in (("max", 1), ("min", -1)):
        value, angle = turn * float(motion[f"{which}_speed"]), math.degrees(float(motion[f"angle_of_{which}"]))
        ends[which] = value
        ax.plot([angle, end * 1.015], [value, value], color=GREY, linewidth=0.7, linestyle=(0, (1, 1.5)), clip_on=False)
        ax.plot([angle], [value], "o" if up > 0 else "s", color=BLUE, markerfacecolor="white", markersize=5, zorder=5,
                clip_on=False)  # fmt: skip
        side = "left" if angle < 0.7 * end else "right"
        ax.annotate(
            f"ω {which} {number(value)} {per} at {angle:.2f}°", (angle, value), xytext=(0, 8 * up),
            textcoords="offset points", ha=side, va="bottom" if up > 0 else "top", fontsize=7.5,
        )  # fmt: skip
    low, high = min(ends.values()), max(ends.values())
    room = 0.17 * max(high - low, 1e-9 * abs(high), 1e-12)
    ax.set_ylim(low - room, high + room)
    ax.annotate(
        "", (end * 1.02, high), xytext=(end * 1.02, low), annotation_clip=False,
        arrowprops={"arrowstyle": "<->", "color": BLACK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    text = f"δ = {number(float(motion['delta']))}"
    ax.annotate(text, (end * 1.032, 0.5 * (low + high)), annotation_clip=False, fontsize=9, va="center")
