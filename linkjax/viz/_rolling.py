"""Rolling bodies between two rings: drawing to scale, radius and speed over the angle, animation of the chain."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Ellipse, Patch
from PIL import Image

from linkjax._display import Numbers, Units, prefixed, turning
from linkjax._units import display_units
from linkjax.viz._animation import save
from linkjax.viz._machine import scale_mark, tint
from linkjax.viz._style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    STYLE,
    TEXT,
    VERMILION,
    WIDTH,
    Data,
    canvas,
    key,
    label,
    legend_columns,
    sheet,
    styled,
)
from linkjax.viz._write import svg

FRAMES, SECONDS, DPI = 72, 6.0, 100  # of the animation
RIM = 0.075  # width of the drawn rings over the outer radius


class Plan(NamedTuple):
    """One frame of the motion: centres (m) and angles of rotation (rad) of the bodies; (x, y, angle) of each ring."""

    x: np.ndarray
    y: np.ndarray
    spins: np.ndarray
    inner: tuple[float, float, float]
    outer: tuple[float, float, float]


@styled
def rolling_figure(data: Data, units: Units | None = None) -> Figure:
    """The chain to scale, in the axes of the design: rings, numbered bodies, contacts, ellipse of the body centres."""
    keys = [
        Patch(facecolor=tint(BLUE), edgecolor=BLUE, label="inner ring"),
        Patch(facecolor=tint(GREEN), edgecolor=GREEN, label="outer ring"),
        Patch(facecolor=tint(ORANGE, 0.45), edgecolor=INK, label="rolling bodies"),
        key("ellipse of the body centres", color=PURPLE, linestyle=(0, (5, 2)), linewidth=1.2),
        key("contacts", color=VERMILION, marker="o", markersize=4, linewidth=0),
    ]
    figure, ax = _stage(data, str(data["title"] or data["scene"]), keys, units)
    e = data["rings"]["eccentricity"]
    at = Plan(data["bodies"]["x"], data["bodies"]["y"], data["bodies"]["angle"], (0.0, 0.0, 0.0), (e, 0.0, 0.0))
    for artist in _members(data, at):
        ax.add_artist(artist)
    curve = data["centres"]
    ax.add_patch(Ellipse((curve["x"], curve["y"]), 2 * curve["semi_major"], 2 * curve["semi_minor"], fill=False,
                         edgecolor=PURPLE, linestyle=(0, (5, 2)), linewidth=1.2, zorder=5))  # fmt: skip
    for kind in data["contacts"].values():
        ax.plot(kind["x"], kind["y"], "o", color=VERMILION, markersize=3.2, zorder=6)
    _centres_of_rings(ax, data)
    _numbers(ax, data, Numbers(units or {}))
    return figure


@styled
def bodies_figure(data: Data, units: Units | None = None) -> Figure:
    """Radius and speed of a body over its angular position; the bodies of the chain are dots."""
    rings, motion = data["rings"], data["motion"]
    angles = np.linspace(0, 2 * math.pi, 361)
    inner, outer, e = (rings[name] for name in ("inner_radius", "outer_radius", "eccentricity"))
    radii = ((inner + outer) ** 2 - e**2) / (2 * (inner + outer - e * np.cos(angles))) - inner
    speeds = motion["carrier"] - inner * (motion["inner"] - motion["carrier"]) / radii
    places = np.degrees(data["bodies"]["angle"]) % 360
    size, unit = prefixed(float(radii.max()), "m", units)
    turn, rpm = turning(units)
    keys = [key("body at any angle", color=BLUE), key("bodies of the chain", color=VERMILION, marker="o", linewidth=0)]
    figure, ((above,), (below,)) = sheet("Radius and speed of the rolling bodies", 2, 1, keys=keys, panel=1.7)
    for ax, curve, dots, name in (
        (above, size * radii, size * data["bodies"]["radius"], label("radius", unit)),
        (below, turn * speeds, turn * motion["bodies"], label("rotational speed", rpm)),
    ):
        ax.plot(np.degrees(angles), curve, color=BLUE, linewidth=1.5)
        ax.plot(places, dots, "o", color=VERMILION, markersize=5)
        ax.set_title(name)
        ax.set_xlim(0, 360)
        ax.set_xticks(range(0, 361, 30))
        ax.tick_params(axis="x", labelbottom=ax is below)
        spread = max(float(np.ptp(curve)), 0.02 * float(np.abs(curve).max()))
        ax.set_ylim(float(curve.min()) - 0.15 * spread, float(curve.max()) + 0.15 * spread)
    below.set_xlabel("angle from the line of centres  (°)")
    return figure


ROLLING_PICTURES: dict[str, tuple[str, Callable[..., Figure]]] = {
    "rolling": ("The rolling bodies to scale", rolling_figure),
    "bodies": ("Radius and speed of the rolling bodies over their angular position", bodies_figure),
}


def write_rolling_figures(data: Data, directory: str | Path, units: str = "") -> list[Path]:
    """Write the figures of a document of rolling bodies as PNG (150 dpi) and SVG; the directory is created if missing.

    `units` are the display units (e.g. "in, rad/s"). Returns the files. Raises `QuantityError` for an unknown unit.
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, (_, draw) in ROLLING_PICTURES.items():
        figure = draw(data, display_units(units))
        raster, vector = folder / f"{name}.png", folder / f"{name}.svg"
        with matplotlib.rc_context(STYLE):
            figure.savefig(raster, dpi=150, metadata={"Software": None}, pil_kwargs={"compress_level": 4})
        vector.write_text(svg(name, figure), encoding="utf-8")
        written += [raster, vector]
    return written


@styled
def animate_rolling(data: Data, path: str | Path, units: str = "") -> Path:
    """Write an animated GIF of the positions in the document, one turn of the line of centres; returns the path."""
    figure, ax = _stage(data, str(data["title"] or data["scene"]), [], display_units(units), width=5.0)
    figure.set_dpi(DPI)
    painter = FigureCanvasAgg(figure)
    painter.draw()
    background = painter.copy_from_bbox(figure.bbox)
    count = np.size(data["angles"])
    pictures = []
    for i in (frame * count // FRAMES for frame in range(FRAMES)):
        painter.restore_region(background)
        for artist in sorted(_members(data, plan_at(data, i)), key=lambda artist: artist.get_zorder()):
            ax.add_artist(artist)
            ax.draw_artist(artist)
            artist.remove()
        pictures.append(Image.fromarray(np.asarray(painter.buffer_rgba())[..., :3].copy()))
    return save(pictures, Path(path), round(1000 * SECONDS / FRAMES))


def plan_at(data: Data, i: int) -> Plan:
    """The frame at index `i` of the angles of the document."""
    path = data["path"]

    def ring(name: str) -> tuple[float, float, float]:
        x, y, angle = (float(path[name][part][i]) for part in ("x", "y", "angle"))
        return x, y, angle

    spins = data["bodies"]["angle"] + path["body_angles"][:, i]
    return Plan(path["x"][:, i], path["y"][:, i], spins, ring("inner"), ring("outer"))


def _stage(data: Data, title: str, keys: list[Any], units: Units | None, width: float = WIDTH) -> tuple[Figure, Axes]:
    """A figure with a panel to scale that holds the outer ring in all its positions, a title, legend and scale bar."""
    head = 0.36 + (0.19 * legend_columns(keys)[1] if keys else 0)
    height = min(width, 6.0) + head
    figure = canvas(width, height)
    figure.text(0.3 / width, 1 - 0.12 / height, title, size=TEXT + 2.5, weight="bold", va="top")
    if keys:
        figure.legend(
            handles=keys, loc="upper left", bbox_to_anchor=(0.28 / width, 1 - 0.36 / height), borderpad=0,
            ncols=legend_columns(keys)[0], borderaxespad=0, handlelength=1.8, columnspacing=1.4, labelspacing=0.3,
        )  # fmt: skip
    ax = figure.add_axes((0, 0, 1, 1 - head / height))
    half = 1.05 * (1 + RIM) * data["rings"]["outer_radius"]
    x, y = 0.5 * data["rings"]["eccentricity"], 0.0
    if not keys:  # animation, in the axes of the frame
        xs, ys = data["path"]["outer"]["x"], data["path"]["outer"]["y"]
        x, y = (0.5 * float(each.min() + each.max()) for each in (xs, ys))
        half += 0.5 * float(max(np.ptp(xs), np.ptp(ys)))
    wide = half * width / (height - head)
    ax.set_xlim(x - wide, x + wide)
    ax.set_ylim(y - half, y + half)
    ax.set_axis_off()
    length, text = scale_mark(0.3 * half, units)
    left, low = x - 0.96 * wide, y - 0.95 * half
    ax.plot([left, left + length], [low, low], color=INK, linewidth=1.2, marker="|", markersize=6)
    ax.text(left + 0.5 * length, low + 0.02 * half, text, ha="center", va="bottom", fontsize=TEXT - 1)
    return figure, ax


def _members(data: Data, at: Plan) -> list[Artist]:
    """Rings and bodies, with marks that show their rotation."""
    rings, radii = data["rings"], data["bodies"]["radius"]
    inner, outer = rings["inner_radius"], rings["outer_radius"]
    rim = RIM * outer
    looks = {"linewidth": 1.1, "zorder": 3}
    found: list[Artist] = [
        Circle(at.outer[:2], outer + rim, facecolor=tint(GREEN), edgecolor=GREEN, linewidth=1.1, zorder=2),
        Circle(at.outer[:2], outer, facecolor="white", edgecolor=GREEN, linewidth=1.1, zorder=2.1),
        Circle(at.inner[:2], inner, facecolor=tint(BLUE), edgecolor=BLUE, **looks),
        Circle(at.inner[:2], max(inner - rim, 0.3 * inner), facecolor="white", edgecolor=BLUE, **looks),
    ]
    for ring, colour, near, far in ((at.inner, BLUE, max(inner - rim, 0.3 * inner), inner),
                                    (at.outer, GREEN, outer, outer + rim)):  # fmt: skip
        for quarter in range(4):
            found.append(_spoke(ring[:2], ring[2] + quarter * math.pi / 2, near, far, colour))
    fill = (*tint(ORANGE, 0.45), 0.5 if data["chain"]["turns"] > 1 else 1.0)  # transparent, as bodies overlap
    for x, y, r, spin in zip(at.x, at.y, radii, at.spins, strict=True):
        found.append(Circle((x, y), r, facecolor=fill, edgecolor=INK, linewidth=1.0, zorder=3.2))
        found.append(_spoke((x, y), spin, 0.62 * r, r, INK))
    return found


def _spoke(centre: tuple[float, float], angle: float, near: float, far: float, colour: str) -> Line2D:
    """A mark on a member that shows its rotation."""
    c, s = math.cos(angle), math.sin(angle)
    x, y = centre
    return Line2D([x + near * c, x + far * c], [y + near * s, y + far * s], color=colour, linewidth=1.4, zorder=3.4)


def _centres_of_rings(ax: Axes, data: Data) -> None:
    """Draw the line of centres and the centres of both rings."""
    e, reach = data["rings"]["eccentricity"], 0.5 * data["rings"]["inner_radius"]
    ax.plot([-reach, reach + e], [0, 0], color=GREY, linewidth=0.7, linestyle=(0, (8, 2, 1.5, 2)), zorder=4)
    for x, colour in ((0.0, BLUE), (e, GREEN)):
        ax.plot([x], [0], "+", color=colour, markersize=8, markeredgewidth=1.4, zorder=6)


def _numbers(ax: Axes, data: Data, show: Numbers) -> None:
    """Write number and radius into every body that is large enough."""
    unit = (ax.get_xlim()[1] - ax.get_xlim()[0]) / (72 * WIDTH)  # m per point
    bodies = data["bodies"]
    for i, (x, y, r) in enumerate(zip(bodies["x"], bodies["y"], bodies["radius"], strict=True), 1):
        if r > 12 * unit:
            text = f"{i}\n{show.quantity(r, 'm', 5)}" if r > 26 * unit else str(i)
            ax.text(x, y, text, ha="center", va="center", fontsize=TEXT - 1, color=INK, zorder=7,
                    bbox={"facecolor": "white", "alpha": 0.6, "linewidth": 0, "pad": 0.8})  # fmt: skip
