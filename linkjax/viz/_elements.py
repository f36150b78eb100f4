"""Drawings of elements with friction: a sketch with the forces in equilibrium, and the efficiency over the angle."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from linkjax._display import Numbers
from linkjax.elements import NAMED, thrust_ring
from linkjax.viz._style import BLUE, FAINT, GREEN, GREY, INK, TEXT, VERMILION, key, line, sheet, styled

FACE: dict[str, Any] = {"facecolor": "#eef3f8", "edgecolor": INK, "linewidth": 1.0, "zorder": 2}
Sketch = Callable[[Axes, dict[str, Any]], None]


@styled
def element_figure(data: dict[str, Any], show: Numbers | None = None) -> Figure:
    """A sketch of an element, and a curve of its efficiency, from `elements.element_document`."""
    name, show = data["element"], show or Numbers()
    title = ", ".join((data["title"], *_numbers(data["given"], show)))
    keys = [key(f"efficiency, {way}", **line(i)) for i, way in enumerate(NAMED[name].ways)]
    figure, ((sketch, curve),) = sheet(title, 1, 2, panel=3.1, keys=keys)
    sketch.set_aspect("equal")
    sketch.axis("off")
    SKETCHES[name](sketch, data)
    sketch.autoscale_view()
    sketch.margins(0.04)
    (_ways if NAMED[name].ways else _bearing)(curve, data)
    return figure


def _numbers(given: dict[str, Any], show: Numbers) -> list[str]:
    """The angle and the friction, for the title."""
    angle = [show.turned(given["angle"])] if "angle" in given else []
    return [*angle, f"f = {given['friction']:.4g}"]


def _ways(ax: Axes, data: dict[str, Any]) -> None:
    """Efficiency of both directions over the angle, and where it locks."""
    name, given = data["element"], data["given"]
    at = math.atan(given["lead"] / (math.pi * given["diameter"])) if name == "screw" else given["angle"]
    angles = np.linspace(0.25, 89.75, 359)
    found = NAMED[name].function(**_at_angle(name, given, np.radians(angles)))
    for i, way in enumerate(("forward", "backward")):
        values = np.asarray(getattr(found, way).efficiency)
        ax.plot(angles, np.where(values > -0.3, values, np.nan), **line(i))
        limit = math.degrees(data[way]["limit"])
        if 0 < limit < 90:
            ax.axvline(limit, color=line(i)["color"], linewidth=0.8, linestyle=":")
        if (here := data[way]["efficiency"]) is not None and here > -0.3:
            ax.plot(math.degrees(at), here, "o", color=line(i)["color"], markersize=4.5, zorder=5)
    ax.axhspan(-0.3, 0, facecolor=FAINT, alpha=0.6, zorder=0)
    ax.text(88, -0.15, "locks", ha="right", va="center", color=GREY)
    ax.set(xlim=(0, 90), ylim=(-0.3, 1.02), xticks=range(0, 91, 15), title="efficiency η")
    ax.set_xlabel("lead angle  (°)" if name == "screw" else "angle  (°)")


def _at_angle(name: str, given: dict[str, Any], angles: np.ndarray) -> dict[str, Any]:
    if name == "screw":
        return {**given, "lead": math.pi * given["diameter"] * np.tan(angles)}
    return {**given, "angle": angles}


def _bearing(ax: Axes, data: dict[str, Any]) -> None:
    """Efficiency over the distance of the force, or torque over the inner radius."""
    given = data["given"]
    if data["element"] == "journal":
        circle = data["circle"]
        distances = np.linspace(0.0, 10.0, 401)[1:]
        efficiency = 1 - 1 / distances
        ax.plot(distances, np.where(efficiency > -0.3, efficiency, np.nan), **line(0))
        ax.axhspan(-0.3, 0, facecolor=FAINT, alpha=0.6, zorder=0)
        ax.text(9.8, -0.15, "locks", ha="right", va="center", color=GREY)
        if "distance" in given and circle > 0 and given["distance"] <= 10 * circle:
            ax.plot(given["distance"] / circle, max(data["efficiency"], -0.3), "o", color=BLUE, markersize=4.5)
        ax.set(xlim=(0, 10), ylim=(-0.3, 1.02), title="efficiency η")
        ax.set_xlabel("distance of the force over radius of the friction circle")
        return
    shares = np.linspace(0.0, 0.99, 100)
    for i, bearing in enumerate(("unworn", "run-in")):
        ax.plot(shares, thrust_ring(1.0, 1.0, inner=shares, bearing=bearing).radius, **line(i), label=bearing)
    ax.plot(given.get("inner", 0.0) / given["outer"], data["radius"] / given["outer"], "o", color=INK, markersize=4.5)
    ax.set(xlim=(0, 1), ylim=(0.45, 1.02), title="radius of friction over outer radius")
    ax.set_xlabel("inner over outer radius")
    ax.legend(loc="upper left")


def _arrow(ax: Axes, at: Any, force: Any, text: str, colour: str = VERMILION) -> None:
    """A force that acts at a point, drawn towards it."""
    at, force = np.asarray(at, float), np.asarray(force, float)
    start = at - force
    look = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 9}
    ax.annotate("", at, start, arrowprops=look, zorder=6)
    shift = -0.09 * force / max(float(np.hypot(*force)), 1e-12)
    x, y = start + shift
    ax.text(x, y, text, color=colour, ha="center", va="center", zorder=7)
    ax.update_datalim([start + 2 * shift, at])


def _ground(ax: Axes, low: float, high: float, y: float = 0.0) -> None:
    ax.plot([low, high], [y, y], color=INK, linewidth=1.2)
    ax.add_patch(
        Rectangle((low, y - 0.07), high - low, 0.07, hatch="////", facecolor="none", edgecolor=GREY, linewidth=0)
    )


def _unit(angle: float) -> np.ndarray:
    return np.array([math.cos(angle), math.sin(angle)])


def _arc(ax: Axes, centre: Any, radius: float, start: float, end: float, text: str) -> None:
    """The arc of an angle (rad) with its letter."""
    angles = np.linspace(start, end, 40)
    ax.plot(
        centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles), color=GREY, linewidth=0.8, zorder=4
    )
    x, y = np.asarray(centre) + 1.22 * radius * _unit(0.5 * (start + end))
    ax.text(x, y, text, color=GREY, ha="center", va="center", zorder=7)


def _slider(ax: Axes, data: dict[str, Any]) -> None:
    gamma, phi = data["given"]["angle"], data["friction_angle"]
    _ground(ax, -1.0, 1.0)
    ax.add_patch(Rectangle((-0.45, 0), 0.9, 0.5, **FACE))
    top = np.array([0.0, 0.5])
    ax.plot([0, 0], [0.5, 1.25], color=GREY, linewidth=0.8, linestyle="-.")
    _arrow(ax, top, 0.7 * np.array([math.sin(gamma), -math.cos(gamma)]), "P")
    _arc(ax, top, 0.45, math.pi / 2, math.pi / 2 + gamma, "γ")
    _arrow(ax, (0.45, 0.25), (-0.45, 0.0), "Q", BLUE)
    _arrow(ax, (0.0, 0.0), 0.6 * np.array([-math.sin(phi), math.cos(phi)]), "R", GREEN)


def _incline(ax: Axes, data: dict[str, Any]) -> None:
    alpha, phi = data["given"]["angle"], data["friction_angle"]
    length = 1.7 * min(1.0, 1 / (2 * math.tan(alpha)))
    ax.add_patch(Polygon([(0, 0), (length, 0), (length, length * math.tan(alpha))], **{**FACE, "facecolor": "#f4f4f4"}))
    along, normal = _unit(alpha), _unit(alpha + math.pi / 2)
    foot = 0.55 * length / math.cos(alpha) * along
    left, right, up = foot - 0.22 * along, foot + 0.22 * along, 0.3 * normal
    ax.add_patch(Polygon([left, right, right + up, left + up], **FACE))
    centre = foot + 0.15 * normal
    _arrow(ax, centre, (0.6, 0.0), "P")
    _arrow(ax, centre, (0.0, -0.6), "Q", BLUE)
    _arrow(ax, foot, 0.6 * _unit(alpha + math.pi / 2 + phi), "R", GREEN)
    _arc(ax, (0, 0), 0.4, 0.0, alpha, "α")


def _screw(ax: Axes, data: dict[str, Any]) -> None:
    lead = math.atan(data["given"]["lead"] / (math.pi * data["given"]["diameter"]))
    pitch = min(max(math.pi * math.tan(lead), 0.12), 2.0)
    count = max(2, math.ceil(1.6 / pitch))
    for i in range(count + 1):
        y = i * pitch
        ax.plot([-0.5, 0.5], [y - pitch / 2, y], color=INK, linewidth=1.4)
        if i < count:
            ax.plot([0.5, -0.5], [y, y + pitch / 2], color=GREY, linewidth=0.7, linestyle="--")
    bottom, top = -pitch / 2, count * pitch
    ax.add_patch(Rectangle((-0.5, bottom), 1.0, top - bottom, **{**FACE, "zorder": 0}))
    _arrow(ax, (0, top), (0.0, -0.6), "Q", BLUE)
    _arc(ax, (0, bottom - 0.05), 0.62, -0.85 * math.pi, -0.15 * math.pi, "M")
    ax.text(0.0, bottom + 0.3 * pitch, "λ", color=GREY, ha="center")


def _wedge(ax: Axes, data: dict[str, Any]) -> None:
    alpha = data["given"]["angle"]
    height = min(1.3 * math.tan(alpha), 1.2)
    width = height / math.tan(alpha)
    _ground(ax, -0.5, width + 0.4)
    ax.add_patch(Polygon([(0, 0), (width, 0), (0, height)], **FACE))
    left, right = 0.3 * width, 0.3 * width + 0.65 * min(width, 1.0)
    roof = height + 0.35
    low = [(x, (width - x) * math.tan(alpha)) for x in (right, left)]
    ax.add_patch(Polygon([*low, (left, roof), (right, roof)], **{**FACE, "facecolor": "#f4f4f4"}))
    ax.plot([right, right], [low[0][1] + 0.05, roof + 0.3], color=INK, linewidth=1.2)
    _arrow(ax, (0, 0.35 * height), (0.6, 0.0), "P")
    _arrow(ax, ((left + right) / 2, roof), (0.0, -0.6), "Q", BLUE)
    _arc(ax, (width, 0), 0.4 * width, math.pi - alpha, math.pi, "α")


def _cam(ax: Axes, data: dict[str, Any]) -> None:
    given, phi = data["given"], data["friction_angle"]
    e, delta = given["eccentricity"] / given["radius"], given["angle"]
    centre = np.array([0.0, 1.0])
    pivot = centre - e * np.array([math.sin(delta), -math.cos(delta)])
    _ground(ax, -1.2, 1.2)
    ax.add_patch(Circle(tuple(centre), 1.0, **FACE))
    ax.plot([0, 0], [0, 1.0 + e + 0.3], color=GREY, linewidth=0.8, linestyle="-.")
    ax.plot(*zip(pivot, centre, strict=True), color=INK, linewidth=1.2, zorder=4)
    ax.plot(*centre, "+", color=INK, zorder=5)
    ax.add_patch(Circle(tuple(pivot), 0.06, facecolor="white", edgecolor=INK, zorder=5))
    if given.get("pivot"):
        circle = {"facecolor": "none", "edgecolor": BLUE, "linestyle": ":", "zorder": 6}
        ax.add_patch(Circle(tuple(pivot), given["pivot"] / given["radius"], **circle))
    _arc(ax, centre, 0.55 * max(e, 0.4), math.pi / 2, math.pi / 2 + delta, "δ")
    _arrow(ax, (0, 0), 0.7 * np.array([math.sin(phi), math.cos(phi)]), "R", GREEN)  # gripping, it turns clockwise


def _journal(ax: Axes, data: dict[str, Any]) -> None:
    given = data["given"]
    circle = data["circle"] / given["radius"]
    ax.add_patch(Circle((0, 0), 1.08, facecolor="#f4f4f4", edgecolor=INK, linewidth=1.0))
    ax.add_patch(Circle((0, 0), 1.0, **FACE))
    ax.add_patch(Circle((0, 0), circle, facecolor="none", edgecolor=BLUE, linestyle=":", linewidth=1.2, zorder=4))
    ax.plot(0, 0, "+", color=INK, zorder=5)
    ax.text(0, circle + 0.1, "ρ", color=BLUE, ha="center", zorder=7)
    far = given.get("distance", 2.2 * given["radius"] * max(circle, 0.3)) / given["radius"]
    reach = min(far, 2.5)
    _arrow(ax, (reach, 0.0), (0.0, -1.3), "Q")
    _arrow(ax, (circle, 0.0), (0.0, 0.7), "R", GREEN)
    ax.text(0, -1.45, "h > ρ turns, h ≤ ρ locks", color=GREY, ha="center")
    ax.update_datalim([(-1.3, -1.6), (max(1.3, reach), 1.5)])


def _thrust(ax: Axes, data: dict[str, Any]) -> None:
    share = data["given"].get("inner", 0.0) / data["given"]["outer"]
    radii = np.linspace(max(share, 0.12), 1.0, 60)
    _ground(ax, -1.2, 1.2)
    for side in (-1, 1):
        ax.add_patch(Rectangle((min(side * share, side), 0.0), 1 - share, 0.55, **FACE))
        if data["given"].get("bearing") == "run-in":
            height = 0.25 * np.minimum((1 + share) / (2 * radii), 3.0)
        else:
            height = np.full_like(radii, 0.25)
        outline = [*zip(side * radii, -0.1 - height, strict=True), (side, -0.1), (side * radii[0], -0.1)]
        ax.add_patch(Polygon(outline, facecolor="#fbe6d6", edgecolor=VERMILION, linewidth=0.8))
    ax.add_patch(Rectangle((-0.45, 0.55), 0.9, 0.5, **FACE))
    _arrow(ax, (0, 1.05), (0.0, -0.6), "Q", BLUE)
    radius = data["radius"] / data["given"]["outer"]
    for side in (-1, 1):
        ax.plot([side * radius] * 2, [-0.05, 0.7], color=GREY, linewidth=0.8, linestyle="-.", zorder=6)
    ax.text(radius + 0.05, 0.72, "radius of friction", color=GREY, fontsize=TEXT - 1)
    ax.text(-1.15, -0.85, "pressure", color=VERMILION, fontsize=TEXT - 1)
    ax.update_datalim([(-1.3, -0.95), (1.5, 1.8)])


SKETCHES: dict[str, Sketch] = {
    "slider": _slider, "incline": _incline, "screw": _screw, "wedge-press": _wedge, "gripping-cam": _cam,
    "journal": _journal, "thrust-ring": _thrust,
}  # fmt: skip
