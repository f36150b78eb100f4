"""Hodographs and point names used by several figures."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from linkjax.machine import Scene
from linkjax.viz._style import GREY, INK, Data, closed, largest


class Names(NamedTuple):
    """Points of which curves are drawn, with what they are called: moving pins and coupler points, and mass centres. A
    mass centre at the place of a pin is named with it, e.g. "D, S3"."""

    pins: dict[str, str]
    centres: dict[str, str]


def moving(data: Data, scene: Scene) -> Names:
    """Points that move."""
    points = data["points"]
    where = {name: np.stack([closed(data, p["x"]), closed(data, p["y"])]) for name, p in points.items()}
    size = largest(where.values())
    own = [link.centre_name for link in scene.mechanism.links.values()]
    moves = [p for p, at in where.items() if largest([at - at[:, :1]]) > 1e-9 * size]
    pins = {p: p for p in moves if p not in own}
    centres = {}
    for centre in (p for p in moves if p in own):
        pin = next((p for p in pins if largest([where[centre] - where[p]]) <= 1e-9 * size), None)
        if pin is None:
            centres[centre] = centre
        else:
            pins[pin] += f", {centre}"
    return Names(pins, centres)


def frame_equal(ax: Axes, curves: list[np.ndarray]) -> None:
    """Fit a panel with equal scales to the curves (each 2 by angles) and the pole, and draw axes through the pole."""
    sides = np.array(ax.get_window_extent().size) / ax.figure.dpi
    parts = [np.append(part[np.isfinite(part)], 0.0) for part in np.concatenate(curves, axis=1)]
    halves = 0.7 * (max(np.ptp(part) / side for part, side in zip(parts, sides, strict=True)) or 1.0) * sides
    for part, half, limits in zip(parts, halves, (ax.set_xlim, ax.set_ylim), strict=True):
        centre = 0.5 * (part.min() + part.max())
        limits(centre - half, centre + half)
    ax.set_aspect("equal")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(max(3, int(2 * sides[0])), steps=[1, 2, 5, 10]))
    ax.axhline(0, color=GREY, linewidth=0.6, zorder=1)
    ax.axvline(0, color=GREY, linewidth=0.6, zorder=1)


def hodograph(ax: Axes, phi: np.ndarray, curve: np.ndarray, look: dict[str, Any], named: bool = True) -> None:
    """Draw a closed curve of vector ends, shape (2, angles), with a dot every 30 degrees and a label every 90 degrees.

    `phi` are the crank angles in degrees, including the end of the cycle. In the SVG the curve is a group named
    `hodograph-…` that keeps every vertex, so that the report can place its cursor by crank angle.
    """
    (drawn,) = ax.plot(*curve, **look)
    if np.all(np.isfinite(curve)):
        drawn.set_gid(f"hodograph-{ax.figure.axes.index(ax)}-{len(ax.lines)}")
        drawn.get_path().should_simplify = False
    turns = round(phi[-1] / 360)
    marks = np.arange(0, 360 * turns, 30 * turns)
    at = np.stack([np.interp(marks, phi, part) for part in curve])
    ax.plot(*at[:, 1:], ".", color=look["color"], markersize=3.2)
    ax.plot(*at[:, :1], "o", color=look["color"], markerfacecolor="white", markersize=4.2, zorder=4)
    sound = curve[:, np.all(np.isfinite(curve), axis=0)]
    if not named or not sound.size:
        return
    span, middle = float(np.max(np.ptp(sound, axis=1))), np.mean(sound, axis=1)
    axes, sizes, _ = np.linalg.svd(sound - middle[:, None], full_matrices=False)
    straight = sizes[-1] < 0.02 * sizes[0]
    across = axes[:, 1] * math.copysign(1.0, axes[1, 1]) if straight else None
    done: list[np.ndarray] = []
    for mark, place in zip(marks[::3], at.T[::3], strict=True):
        near = any(math.hypot(*(place - other)) < 0.25 * span for other in done)
        if near or span == 0 or not np.all(np.isfinite(place)):
            continue
        done.append(place)
        out = (place - middle) / (math.hypot(*(place - middle)) or 1.0) if across is None else across
        ax.annotate(
            f"{mark}°", tuple(place), xytext=tuple(8.5 * out), textcoords="offset points", size=6,
            ha="center", va="center", color=INK, zorder=1.5, bbox={"facecolor": "white", "linewidth": 0, "pad": 0.6},
        )  # fmt: skip
