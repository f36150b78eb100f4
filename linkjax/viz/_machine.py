"""Drawing of the machine to scale."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch, Polygon, Wedge
from matplotlib.path import Path

from linkjax._display import Units, prefixed
from linkjax.machine import Scene
from linkjax.viz._labels import along, place_labels
from linkjax.viz._skeleton import (
    Arrow,
    Place,
    Places,
    Shape,
    Skeleton,
    Slot,
    arrows,
    clearest,
    outline,
    path,
    places,
    skeleton,
)
from linkjax.viz._style import (
    BLACK,
    COLOURS,
    GREY,
    INK,
    TEXT,
    VERMILION,
    WIDTH,
    Data,
    before_keys,
    canvas,
    key,
    legend_columns,
    styled,
)
from linkjax.viz._wheels import draw_wheels

JOINT, CENTRE = 3.4, 5.0  # points: radius of a joint and of the symbol of a mass centre
ARROW, ARC = 46.0, 15.0  # points: length of a force arrow, radius of a torque arc
BLOCK = (10.5, 7.0)  # points: half length and half height of a slider (block)
MARGIN = (36.0, 46.0, 36.0, 30.0)  # points: left, bottom, right, top


class Stage(NamedTuple):
    """A figure with a panel with equal scales; `unit` is the length (m) shown by one typographic point."""

    figure: Figure
    ax: Axes
    unit: float


@styled
def machine_figure(
    data: Data,
    scene: Scene,
    angle: float | None = None,
    *,
    others: Sequence[float] = (),
    before: Data | None = None,
    units: Units | None = None,
) -> Figure:
    """The machine to scale at a crank angle (rad; by default one at which loads act and the joints are well separated).

    Shows links with their joints, ground, guides and sliders, mass centres as quartered circles, paths of pins and
    coupler points, the loads active at this angle, and a scale bar. At the crank angles `others` (rad) its links are
    drawn as thin lines. The earlier design is drawn behind in grey. `data` is the document of an analysis, or that of
    `analysis.positions`; then loads of varying size are not drawn.
    """
    look = skeleton(data, scene)
    if before:
        old = skeleton(before, scene)
        look = look._replace(low=np.minimum(look.low, old.low), high=np.maximum(look.high, old.high))
    angle = clearest(data, scene, look) if angle is None else float(angle)
    keys = [key(s.link, color=colour(i), linewidth=4.5) for i, s in enumerate(look.shapes)] + before_keys(before)
    title = scene.title or str(data.get("scene", "")) or "Machine"
    stage = make_stage(look, WIDTH, 5.4, 0.42 + 0.19 * legend_columns(keys)[1])
    figure = stage.figure
    height = figure.get_size_inches()[1]
    figure.text(0.3 / WIDTH, 1 - 0.12 / height, title, size=TEXT + 2.5, weight="bold", va="top")
    where = f"φ = {math.degrees(angle):.4g}°"
    figure.text(1 - 0.3 / WIDTH, 1 - 0.14 / height, where, size=TEXT + 1, va="top", ha="right")
    figure.legend(
        handles=keys, loc="upper left", bbox_to_anchor=(0.28 / WIDTH, 1 - 0.36 / height), ncols=legend_columns(keys)[0],
        borderaxespad=0, borderpad=0, handlelength=1.8, columnspacing=1.4, labelspacing=0.3,
    )  # fmt: skip
    draw_frame(stage, data, look, units)
    if before:
        _draw_before(stage, look, places(before, scene, angle))
    for other in others:
        _draw_thin(stage, look, places(data, scene, float(other)))
    at = places(data, scene, angle)
    working = arrows(data, scene, angle, units)
    draw_links(stage, look, at, working)
    draw_names(stage, data, look, at, working)
    return figure


def make_stage(look: Skeleton, width: float, tallest: float, head: float) -> Stage:
    """A figure of `width` inches, at most `tallest` high; its panel, below `head` inches, holds the whole cycle."""
    left, bottom, right, top = MARGIN
    spread = np.maximum(look.high - look.low, 1e-3 * look.size)
    room = np.array([72 * width - left - right, 72 * (tallest - head) - bottom - top])
    scale = float(np.min(room / spread))  # points per metre
    drawn = max(scale * spread[1] + bottom + top, 72 * 1.5)
    height = head + drawn / 72
    figure = canvas(width, height)
    ax = figure.add_axes((0, 0, 1, 1 - head / height))
    unit = 1 / scale
    x = 0.5 * (look.low[0] + look.high[0]) + 0.5 * (right - left) * unit
    y = 0.5 * (look.low[1] + look.high[1]) + 0.5 * (top - bottom) * unit
    ax.set_xlim(x - 36 * width * unit, x + 36 * width * unit)
    ax.set_ylim(y - 0.5 * drawn * unit, y + 0.5 * drawn * unit)
    ax.set_axis_off()
    return Stage(figure, ax, unit)


def colour(index: int) -> str:
    """Colour of the link with this index."""
    return COLOURS[index % len(COLOURS)]


def tint(name: str, share: float = 0.3) -> tuple[float, float, float]:
    """A colour mixed with white."""
    r, g, b = (1 - share + share * part for part in to_rgb(name))
    return r, g, b


def _draw_before(stage: Stage, look: Skeleton, at: Places) -> None:
    """Draw the earlier design: outlines of its links in grey."""
    for shape in look.shapes:
        corners = np.stack([at[p] for p in outline(shape, at, 3 * stage.unit)])
        for edge, width in (("#a8a8a8", 10.5), ("#f1f1f1", 8.9)):
            stage.ax.plot(*np.concatenate([corners, corners[:1]]).T, color=edge, linewidth=width, zorder=1.5,
                          solid_joinstyle="round", solid_capstyle="round")  # fmt: skip


def _draw_thin(stage: Stage, look: Skeleton, at: Places) -> None:
    """Draw the links as thin lines with small joints, each in the light colour of the link."""
    for i, shape in enumerate(look.shapes):
        corners = np.stack([at[p] for p in outline(shape, at, 3 * stage.unit)])
        stage.ax.plot(*np.concatenate([corners, corners[:1]]).T, color=tint(colour(i), 0.4), linewidth=1.1, zorder=1.6)
    spots = np.stack([at[p] for p in look.joints])
    stage.ax.plot(
        *spots.T, "o", markersize=3, markerfacecolor="white", markeredgecolor=GREY, markeredgewidth=0.7, zorder=1.7
    )


def draw_frame(stage: Stage, data: Data, look: Skeleton, units: Units | None = None) -> None:
    """Draw the fixed parts: paths, guides, ground, scale bar."""
    ax, unit = stage.ax, stage.unit
    for point in look.traced:
        ax.plot(*path(data, point), color="#c3ccd4", linewidth=0.9, zorder=1)
    for guide in look.guides:
        t = np.array([math.cos(guide.angle), math.sin(guide.angle)])
        n = np.array([-t[1], t[0]])
        first, last = (end + sign * (BLOCK[0] + 8) * unit * t for end, sign in zip(guide.ends, (-1, 1), strict=True))
        for side in (1, -1):
            offset = side * (BLOCK[1] + 0.8) * unit * n
            _ground(stage, first + offset, last + offset, side * n)
    places_ = data["points"]
    for point in look.pivots:
        at = np.array([float(np.ravel(places_[point][k])[0]) for k in ("x", "y")])
        foot = at - np.array([0, 12.5]) * unit
        sole = np.array([8.5, 0]) * unit
        corners = np.stack([at, foot - 0.85 * sole, foot + 0.85 * sole])
        ax.add_patch(Polygon(corners, facecolor="white", edgecolor=INK, linewidth=1.0, zorder=2, joinstyle="round"))
        _ground(stage, foot - 1.5 * sole, foot + 1.5 * sole, np.array([0.0, -1.0]))
    _scale_bar(stage, units)


def _ground(stage: Stage, start: np.ndarray, end: np.ndarray, outward: np.ndarray) -> None:
    """Draw a line of the frame, hatched on its outer side."""
    ax, unit = stage.ax, stage.unit
    ax.plot(*np.stack([start, end], axis=1), color=INK, linewidth=1.0, zorder=2, solid_capstyle="butt")
    t = (end - start) / math.hypot(*(end - start))
    marks = along(start, end, 4.6 * unit)[:-1] + 2.3 * unit * t
    strokes = [(mark, mark + 4.5 * unit * (outward - t)) for mark in marks]
    ax.add_collection(LineCollection(strokes, colors=GREY, linewidths=0.7, zorder=1.9))


def _scale_bar(stage: Stage, units: Units | None) -> None:
    ax, unit = stage.ax, stage.unit
    (left, right), (bottom, _) = ax.get_xlim(), ax.get_ylim()
    length, text = scale_mark(0.22 * (right - left), units)
    x, y = left + 22 * unit, bottom + 12 * unit
    outline = np.array([[0, 3], [0, -3], [0, 0], [1, 0], [1, -3], [1, 3]]) * (length, unit) + (x, y)
    ax.plot(*outline.T, color=INK, linewidth=1.0, solid_joinstyle="miter", zorder=2)
    ax.text(x + 0.5 * length, y + 3 * unit, text, ha="center", va="bottom", fontsize=TEXT - 1)


def scale_mark(longest: float, units: Units | None) -> tuple[float, str]:
    """Length of a scale bar (m), 1, 2 or 5 times a power of ten in the displayed unit, and its label."""
    factor, shown = prefixed(longest, "m", units)
    power = 10.0 ** math.floor(math.log10(factor * longest))
    length = max(k * power for k in (1, 2, 5) if k * power <= factor * longest)
    return length / factor, f"{length:g} {shown}"


def draw_links(stage: Stage, look: Skeleton, at: Places, working: list[Arrow]) -> list[Artist]:
    """Draw the moving parts: links, sliders, joints, mass centres and loads. Returns the artists in drawing order."""
    artists: list[Artist] = []
    for i, shape in enumerate(look.shapes):
        artists += _counterweights(stage, shape, at, i)
        artists += _block(stage, shape, at, i) if shape.block else _bar(stage, shape, at, i)
    order = [shape.link for shape in look.shapes]
    artists += draw_wheels(look.wheels, look.belts, at, {link: colour(i) for i, link in enumerate(order)}, GREY)
    for slot in look.slots:
        artists += _rails(stage, slot, at, order.index(slot.on))
    for tie in look.ties:
        artists += [Line2D(*line.T, color=VERMILION, linewidth=1.3, zorder=5.5) for line in tie.drawn(at, stage.unit)]
    dots = {p for shape in look.shapes for p in shape.marked} - set(look.joints)
    marks = [(p, JOINT) for p in look.joints] + [(p, 2.0) for p in sorted(dots)]
    for point, radius in marks:
        face = "white" if point in look.joints else INK
        look_ = {"facecolor": face, "edgecolor": INK, "linewidth": 1.1, "zorder": 6}
        artists.append(Circle(_place(at[point]), radius * stage.unit, **look_))
    for shape in look.shapes:
        if shape.centre:
            artists += _quartered(stage, _place(at[shape.centre]))
    for arrow in working:
        artists += _load(stage, arrow)
    for artist in artists:
        stage.ax.add_artist(artist)
    return artists


def _place(at: np.ndarray) -> Place:
    return float(at[0]), float(at[1])


def _bar(stage: Stage, shape: Shape, at: Places, index: int) -> list[Artist]:
    """A bar, or a plate through all its points, with a rounded outline."""
    corners = np.stack([at[p] for p in outline(shape, at, 3 * stage.unit)])
    if len(corners) == 1:  # a slider that turns
        return [Circle(_place(corners[0]), BLOCK[1] * stage.unit, facecolor=tint(colour(index)), linewidth=1.3,
                       edgecolor=colour(index), zorder=2.5)]  # fmt: skip
    edge, fill, order = colour(index), tint(colour(index)), 3 + 0.1 * index
    if len(corners) == 2:
        return [
            Line2D(*corners.T, color=edge, linewidth=10.5, solid_capstyle="round", zorder=order),
            Line2D(*corners.T, color=fill, linewidth=8.3, solid_capstyle="round", zorder=order + 0.01),
        ]
    looks: list[dict[str, Any]] = [
        {"edgecolor": edge, "facecolor": edge, "linewidth": 10.5, "zorder": order},
        {"edgecolor": fill, "facecolor": fill, "linewidth": 8.3, "zorder": order + 0.01},
    ]
    return [Polygon(corners, closed=True, joinstyle="round", **each) for each in looks]


def _counterweights(stage: Stage, shape: Shape, at: Places, index: int) -> list[Artist]:
    """Counterweights as discs to scale (a symbol if the size is unknown), on arms from the first pin."""
    artists: list[Artist] = []
    for point, radius in shape.weights.items():
        line = np.stack([at[shape.pins[0]], at[point]])
        artists.append(Line2D(*line.T, color=tint(colour(index), 0.6), linewidth=4.5, zorder=2.2))
        size = 7 * stage.unit if radius is None else radius
        artists.append(Circle(_place(at[point]), size, facecolor=tint(colour(index), 0.45), edgecolor=colour(index),
                              linewidth=1.1, zorder=2.3))  # fmt: skip
    return artists


def _rails(stage: Stage, slot: Slot, at: Places, index: int) -> list[Artist]:
    """A guide on a moving link, in the colour of the link."""
    first, last, t = slot.drawn(at)
    t = stage.unit * t
    n = np.array([-t[1], t[0]])
    ends = np.stack([first - (BLOCK[0] + 8) * t, last + (BLOCK[0] + 8) * t])
    return [Line2D(*(ends + side * (BLOCK[1] + 0.8) * n).T, color=colour(index), linewidth=1.0, zorder=4.8)
            for side in (1, -1)]  # fmt: skip


def _block(stage: Stage, shape: Shape, at: Places, index: int) -> list[Artist]:
    """A slider along its guide, with arms to its additional points, in front of the link that carries the guide."""
    t = stage.unit * at[shape.link] / (math.hypot(*at[shape.link]) or 1.0)
    n = np.array([-t[1], t[0]])
    a, b = BLOCK[0] * t, BLOCK[1] * n
    corners = at[shape.pins[0]] + np.stack([a + b, b - a, -a - b, a - b])
    order = 5.0 if shape.upon else 2.5
    arms = [Line2D(*np.stack([at[shape.pins[0]], at[p]]).T, color=tint(colour(index), 0.6), linewidth=4.5,
                   zorder=order - 0.1) for p in shape.marked]  # fmt: skip
    return [*arms, Polygon(corners, closed=True, edgecolor=colour(index), facecolor=tint(colour(index)), linewidth=1.3,
                           zorder=order)]  # fmt: skip


def _quartered(stage: Stage, centre: Place) -> list[Artist]:
    """The symbol of a mass centre."""
    radius = CENTRE * stage.unit
    return [
        Circle(centre, radius, facecolor="white", edgecolor=BLACK, linewidth=0.9, zorder=6.2),
        *(Wedge(centre, radius, a, a + 90, facecolor=BLACK, linewidth=0, zorder=6.3) for a in (0, 180)),
    ]


def _tail(stage: Stage, arrow: Arrow) -> tuple[np.ndarray, np.ndarray]:
    """Ends of a force arrow: its head is at the point, or its tail if the arrow would leave the drawing."""
    reach = ARROW * stage.unit * arrow.along
    gap = 6.5 * stage.unit * arrow.along
    tail, head = arrow.at - gap - reach, arrow.at - gap
    (left, right), (low, high) = stage.ax.get_xlim(), stage.ax.get_ylim()
    if left < tail[0] < right and low < tail[1] < high:
        return tail, head
    return arrow.at + gap, arrow.at + gap + reach


def _load(stage: Stage, arrow: Arrow) -> list[Artist]:
    """A force as a straight arrow, a torque as an arc about the pin."""
    style: dict[str, Any] = {
        "arrowstyle": "-|>", "mutation_scale": 11, "color": VERMILION, "linewidth": 2.0, "zorder": 7, "shrinkA": 0,
        "shrinkB": 0,
    }  # fmt: skip
    if arrow.turn == 0:
        tail, head = _tail(stage, arrow)
        return [FancyArrowPatch(_place(tail), _place(head), **style)]
    sweep = np.radians(np.linspace(205, -25, 40) if arrow.turn < 0 else np.linspace(-25, 205, 40))
    curve = arrow.at + ARC * stage.unit * np.stack([np.cos(sweep), np.sin(sweep)], axis=1)
    return [FancyArrowPatch(path=Path(curve), **style)]


def draw_names(stage: Stage, data: Data, look: Skeleton, at: Places, working: list[Arrow]) -> None:
    """Write the names of points, mass centres and loads, with the least overlap."""
    unit = stage.unit
    centres = [shape.centre for shape in look.shapes if shape.centre]
    marked = [p for shape in look.shapes for p in shape.marked if p not in look.joints]
    spots: list[tuple[list[str], np.ndarray]] = []
    pieces = [p for shape in look.shapes for p in shape.weights]
    for point in [*look.joints, *marked, *centres, *pieces]:
        near = next((names for names, spot in spots if math.hypot(*(spot - at[point])) < 4 * unit), None)
        if near is None:
            spots.append(([point], at[point]))
        else:
            near.append(point)
    names = [(", ".join(group), spot, GREY if group[0] in (*centres, *pieces) else INK) for group, spot in spots]
    for arrow in working:
        start = arrow.at + np.array([0, ARC * unit]) if arrow.turn else _tail(stage, arrow)[0]
        names.append((arrow.text, start, VERMILION))
    names += [(tie.text, 0.5 * (at[tie.ends[0]] + at[tie.ends[1]]), VERMILION) for tie in look.ties]
    solid = [at[p][None] for p in (*look.joints, *centres, *pieces)] + [_covered(stage, arrow) for arrow in working]
    for shape in look.shapes:
        corners = [at[p] for p in (*shape.pins, *shape.marked)]
        solid += [along(a, b, 2.5 * unit) for i, a in enumerate(corners) for b in corners[:i]]
        solid += [at[shape.pins[0]] + unit * _raster(BLOCK[0], -BLOCK[1], BLOCK[1])] if shape.block else []
    solid += [along(at[tie.ends[0]], at[tie.ends[1]], 2.5 * unit) for tie in look.ties]
    solid += [at[p] + unit * _raster(9.0, -13.0, -3.0) for p in look.pivots]
    for guide in look.guides:
        normal = np.array([-math.sin(guide.angle), math.cos(guide.angle)]) * (BLOCK[1] + 1.5) * unit
        solid += [along(guide.ends[0] + side * normal, guide.ends[1] + side * normal, 2.5 * unit) for side in (1, -1)]
    faint = [path(data, p).T for p in look.traced] or [np.zeros((0, 2))]
    (left, right), (low, high) = stage.ax.get_xlim(), stage.ax.get_ylim()
    found = place_labels(
        [text for text, _, _ in names], np.stack([spot for _, spot, _ in names]) / unit, np.concatenate(solid) / unit,
        np.concatenate(faint) / unit, size=TEXT, limits=(left / unit, low / unit, right / unit, high / unit),
    )  # fmt: skip
    for (text, _, ink), (x, y) in zip(names, found, strict=True):
        stage.ax.text(x * unit, y * unit, text, ha="center", va="center", fontsize=TEXT, color=ink, zorder=8)


def _covered(stage: Stage, arrow: Arrow) -> np.ndarray:
    """Points along the arrow of a load."""
    if arrow.turn == 0:
        return along(*_tail(stage, arrow), 2.5 * stage.unit)
    sweep = np.radians(np.arange(-25, 206, 15))
    return arrow.at + ARC * stage.unit * np.stack([np.cos(sweep), np.sin(sweep)], axis=1)


def _raster(half: float, low: float, high: float) -> np.ndarray:
    """Points that fill a rectangle."""
    x, y = np.meshgrid(np.linspace(-half, half, 5), np.linspace(low, high, 4))
    return np.stack([x.ravel(), y.ravel()], axis=1)
