"""Common style of all figures: colours, fonts, layout of panels, crank-angle axis, units of the axes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from linkjax.loads import AbstractLoad, Passage
from linkjax.machine import Scene

Data = dict[str, Any]
Plot = Callable[..., Figure]

# Okabe and Ito, Color universal design (2008): distinguishable with every type of colour vision.
BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY, BLACK = "#E69F00", "#56B4E9", "#000000"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
DASHES = (
    "-", (0, (6, 1.5)), (0, (1.2, 1.2)), (0, (7, 1.5, 1.5, 1.5)), (0, (3, 1.2)), (0, (9, 2)), (0, (4, 1, 1, 1, 1, 1)),
)  # fmt: skip
INK, GREY, FAINT = "#222222", "#6b6b6b", "#dcdcdc"
WINDOWS = (ORANGE, SKY, GREEN, PURPLE)
WIDTH, TEXT = 7.2, 8.5  # inches, points
BEFORE: dict[str, Any] = {"color": "#8a8a8a", "linewidth": 0.9, "linestyle": (0, (3.5, 1.6)), "zorder": 1.8}

STYLE: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": GREY,
    "axes.grid": True,
    "axes.linewidth": 0.6,
    "axes.titlelocation": "left",
    "axes.titlepad": 4,
    "axes.titlesize": TEXT,
    "axes.titley": 1.0,  # fixed position: automatic placement takes a sixth of the drawing time
    "axes.formatter.useoffset": False,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.unicode_minus": True,
    "figure.facecolor": "white",
    "font.family": ["sans-serif"],
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica", "sans-serif"],
    "font.size": TEXT,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "hatch.linewidth": 0.5,
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "path.simplify": True,
    "path.simplify_threshold": 0.15,
    "svg.fonttype": "none",
    "text.color": INK,
    "text.parse_math": False,
    "text.usetex": False,
    "xtick.color": GREY,
    "xtick.labelcolor": INK,
    "xtick.labelsize": TEXT - 0.5,
    "xtick.major.size": 2.5,
    "xtick.major.width": 0.6,
    "ytick.color": GREY,
    "ytick.labelcolor": INK,
    "ytick.labelsize": TEXT - 0.5,
    "ytick.major.size": 2.5,
    "ytick.major.width": 0.6,
}


styled = matplotlib.rc_context(STYLE)
"""Decorator: run a function with this style and restore the settings of matplotlib afterwards."""


def line(index: int) -> dict[str, Any]:
    """Colour and dashes of the series with this index; distinguishable in colour and in grey."""
    return {"color": COLOURS[index % len(COLOURS)], "linestyle": DASHES[index % len(DASHES)], "linewidth": 1.5}


def canvas(width: float, height: float) -> Figure:
    """An empty figure (inches) with its own raster canvas."""
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def sheet(
    title: str, rows: int, cols: int, *, panel: float | Sequence[float], keys: Sequence[Line2D | Patch] = (),
    right: float = 0.18, gap: tuple[float, float] = (0.62, 0.42), square: bool = False,
) -> tuple[Figure, list[list[Axes]]]:  # fmt: skip
    """A figure with a title, a legend of `keys` below it and `rows` by `cols` panels of height `panel` (inches).

    Margins are fixed in inches, so that no layout solver is needed. `panel` may be one height per row; the height of
    square panels equals their width.
    """
    left, bottom, above = 0.62, 0.48, 0.24
    across, legend_rows = legend_columns(keys)
    width = (WIDTH - left - right - gap[0] * (cols - 1)) / cols
    heights = [width if square else float(panel)] * rows if isinstance(panel, float | int) else list(panel)
    head = 0.36 + 0.19 * legend_rows
    height = head + above + sum(heights) + (rows - 1) * gap[1] + bottom
    figure = canvas(WIDTH, height)
    figure.text(left / WIDTH, 1 - 0.12 / height, title, size=TEXT + 2.5, weight="bold", va="top")
    if keys:
        anchor = ((left - 0.02) / WIDTH, 1 - 0.34 / height)
        legend = figure.legend(
            handles=list(keys), loc="upper left", bbox_to_anchor=anchor, ncols=across, borderaxespad=0, borderpad=0,
            handlelength=2.6, columnspacing=1.4, labelspacing=0.3, fontsize=TEXT,
        )  # fmt: skip
        for entry, *drawn in zip(keys, legend.legend_handles, legend.get_texts(), strict=True):
            for part, artist in enumerate(drawn if entry.get_gid() else []):
                if artist is not None:
                    artist.set_gid(f"{entry.get_gid()}-{part}")
    axes = []
    for row in range(rows):
        low = bottom + sum(heights[row + 1 :]) + (rows - 1 - row) * gap[1]
        rect = [(left + c * (width + gap[0])) / WIDTH for c in range(cols)]
        axes.append([figure.add_axes((x, low / height, width / WIDTH, heights[row] / height)) for x in rect])
        for ax in axes[-1]:  # fixed positions of the axis labels, too
            ax.xaxis.set_label_coords(0.5, -0.235 / heights[row])
            ax.yaxis.set_label_coords(-0.1, 0.5)
    return figure, axes


def legend_columns(keys: Sequence[Line2D | Patch]) -> tuple[int, int]:
    """Numbers of columns and rows of the legend, with as few rows as fit; entries are ordered down the columns."""
    widths = [(0.6 * len(str(entry.get_label())) + 5.2) * TEXT / 72 for entry in keys]
    for rows in range(1, len(widths)):
        columns = math.ceil(len(widths) / rows)
        if sum(max(part) for part in np.array_split(widths, columns)) <= WIDTH - 0.8:
            return columns, rows
    return 1, len(widths)


def key(label: str, **look: Any) -> Line2D:
    """A legend entry for a line (matplotlib omits labels that begin with an underscore)."""
    return Line2D([], [], label=f" {label}" if label.startswith("_") else label, **look)


def behind(ax: Axes, x: Any, y: Any, **look: Any) -> None:
    """Draw a curve of the earlier design, thin, behind the others; a group named `before-…` in the SVG."""
    (curve,) = ax.plot(x, y, **BEFORE | look)
    curve.set_gid(f"before-{ax.figure.axes.index(ax)}-{len(ax.lines)}")


def before_keys(before: Data | None) -> list[Line2D]:
    """Legend entry for the earlier design, if there is one."""
    return [key("before", gid="before-key", **BEFORE)] if before else []


def mark_keys(scene: Scene) -> list[Line2D]:
    """Legend entries for the marks on hodographs."""
    dot = {"color": BLUE, "linewidth": 0, "markersize": 4.2}
    return [
        key("φ = 0", marker="o", markerfacecolor="white", **dot),
        key(f"every {30 * scene.cycle_turns}°", marker=".", **dot),
    ]


def degrees(data: Data, scene: Scene) -> np.ndarray:
    """Crank angles in degrees, with the end of the cycle appended to close the curves."""
    return np.degrees(np.append(np.asarray(data["angles"], float), scene.cycle))


def closed(data: Data, values: Any, climb: float = 0.0) -> np.ndarray:
    """A quantity over the angles, with its first value (plus `climb`) appended at the end of the cycle.

    NaN where the linkage cannot be assembled.
    """
    count = np.size(data["angles"])
    values = np.array(np.broadcast_to(np.asarray(values, float), (count,)))
    values[lost(data)] = np.nan
    return np.append(values, values[0] + climb)


def lost(data: Data) -> np.ndarray:
    """Crank angles at which the linkage cannot be assembled."""
    count = np.size(data["angles"])
    codes = data.get("result", {}).get("per_angle")
    return np.zeros(count, bool) if codes is None else np.asarray(codes).reshape(count) != 0


def largest(values: Iterable[Any]) -> float:
    """Largest magnitude in several arrays; zero if there is no finite value."""
    finite = [np.abs(v)[np.isfinite(v)] for v in map(np.asarray, values)]
    return max((float(v.max()) for v in finite if v.size), default=0.0)


def label(quantity: str, unit: str) -> str:
    """Heading of a panel: quantity and unit."""
    return f"{quantity}  ({unit})" if unit else quantity


def crank_axis(ax: Axes, scene: Scene, *, columns: int = 1, last: bool = True) -> None:
    """Set up the crank-angle axis of a panel; the lowest panel of a column (`last`) has the tick labels."""
    turns = scene.cycle_turns
    ax.set_gid(f"crank-{360 * turns}-{ax.figure.axes.index(ax)}")  # the report identifies the panels by it
    step = next(s for s in (30, 45, 60, 90, 180, 360) if 360 * turns / s <= 13 / columns)
    ax.set_xlim(0, 360 * turns)
    ax.set_xticks(range(0, 360 * turns + 1, step))
    ax.tick_params(axis="x", labelbottom=last)
    ax.yaxis.set_major_locator(MaxNLocator(5, min_n_ticks=3, steps=[1, 2, 2.5, 5, 10]))
    ax.margins(y=0.08)
    if last:
        ax.set_xlabel("crank angle φ  (°)")


def ranges(data: Data, scene: Scene, load: AbstractLoad) -> list[tuple[float, float]] | None:
    """The ranges of crank angle (rad) in which a load acts, None for a permanent one. Those of a window that is given
    by what happens come from the analysis."""
    if load.window is None:
        return None
    if isinstance(load.window, Passage):
        return [(float(on), float(off)) for on, off in (data.get("windows") or {}).get(load.name, ())]
    return load.window.used(scene.cycle)


def spans(data: Data, scene: Scene) -> list[tuple[str, list[tuple[float, float]]]]:
    """Name and ranges of crank angle (degrees) of every load with a window."""
    found, cycle = [], scene.cycle
    for load in scene.loads:
        acts = ranges(data, scene, load)
        if acts is None:
            continue
        parts = [part for on, off in acts for part in ([(on, off)] if on <= off else [(0.0, off), (on, cycle)])]
        found.append((load.name, [(math.degrees(a), math.degrees(b)) for a, b in parts if b > a]))
    return found


def shade(ax: Axes, data: Data, scene: Scene) -> None:
    """Shade the windows of the loads."""
    for number, (_, parts) in enumerate(spans(data, scene)):
        for a, b in parts:
            ax.axvspan(a, b, facecolor=WINDOWS[number % len(WINDOWS)], alpha=0.11, linewidth=0, zorder=0)


def window_keys(data: Data, scene: Scene) -> list[Patch]:
    """Legend entries for the shaded windows."""
    return [
        Patch(facecolor=WINDOWS[i % len(WINDOWS)], alpha=0.25, linewidth=0, label=f"{name} acts")
        for i, (name, _) in enumerate(spans(data, scene))
    ]


def over_crank(axes: Sequence[Axes], data: Data, scene: Scene, columns: int = 1) -> None:
    """Set up one column of panels over the crank angle."""
    for ax in axes:
        shade(ax, data, scene)
        crank_axis(ax, scene, columns=columns, last=ax is axes[-1])


def blank(axes: Iterable[Axes]) -> None:
    """Remove unused panels."""
    for ax in axes:
        ax.remove()
