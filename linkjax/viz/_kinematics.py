"""Positions and kinematic coefficients of points and links; hodographs; reduced inertia."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from linkjax._display import Units, prefixed
from linkjax.machine import Scene
from linkjax.viz._curves import frame_equal, hodograph, moving
from linkjax.viz._style import (
    BLUE,
    GREY,
    INK,
    VERMILION,
    Data,
    before_keys,
    behind,
    blank,
    closed,
    degrees,
    key,
    label,
    largest,
    line,
    mark_keys,
    over_crank,
    sheet,
    styled,
    window_keys,
)

ORDERS = (("position", "m", "x", "y"), ("first coefficient", "m/rad", "dx", "dy"),
          ("second coefficient", "m/rad²", "ddx", "ddy"))  # fmt: skip
LIMIT: dict[str, Any] = {"color": VERMILION, "linewidth": 0.8, "linestyle": (0, (2, 2))}  # of the transmission angle


@styled
def points_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """Positions, first and second kinematic coefficients of pins and coupler points over the crank angle."""
    return _points(data, scene, before, units, moving(data, scene).pins, "Pins and coupler points")


@styled
def centres_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """The same for the mass centres that are not at a pin."""
    return _points(data, scene, before, units, moving(data, scene).centres, "Mass centres")


def _points(
    data: Data, scene: Scene, before: Data | None, units: Units | None, names: dict[str, str], title: str
) -> Figure:
    phi = degrees(data, scene)
    keys = [key(text, **line(i)) for i, text in enumerate(names.values())]
    figure, axes = sheet(title, 3, 2, panel=1.55, keys=[*keys, *before_keys(before), *window_keys(data, scene)])
    for row, (quantity, unit, *components) in enumerate(ORDERS):
        curves = {(n, c): closed(data, data["points"][n][c]) for n in names for c in components}
        factor, shown = prefixed(largest(curves.values()), unit, units)
        for column, component in enumerate(components):
            ax = axes[row][column]
            if before:
                for name in (n for n in names if n in before["points"]):
                    behind(ax, degrees(before, scene), factor * closed(before, before["points"][name][component]))
            for i, name in enumerate(names):
                ax.plot(phi, factor * curves[name, component], **line(i))
            ax.set_title(label(f"{'xy'[column]}{('', '′', '″')[row]}, {quantity}", shown))
    for column in (0, 1):
        over_crank([row[column] for row in axes], data, scene, columns=2)
    return figure


@styled
def links_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """Angles, first and second kinematic coefficients of the links, and transmission angles of the groups (degrees)."""
    del units
    phi = degrees(data, scene)
    turning = [n for n, link in data["links"].items() if largest([link["d"]]) > 0]
    groups = _transmission(data)
    looks = {name: line(i) | {"color": INK, "linewidth": 1.3} for i, name in enumerate(groups)}
    keys = [key(name, **line(i)) for i, name in enumerate(turning)]
    keys += [key(f"μ, {name}", **look) for name, look in looks.items()]
    keys += [key("recommended limits of μ", **LIMIT)] if groups else []
    figure, axes = sheet("Links", 2, 2, panel=1.9, keys=[*keys, *before_keys(before), *window_keys(data, scene)])
    (angles, first), (transmission, second) = axes
    if before:
        old = degrees(before, scene)
        for link in (before["links"][n] for n in turning if n in before["links"]):
            behind(angles, old, _turn(before, link))
            behind(first, old, closed(before, link["d"]))
            behind(second, old, closed(before, link["dd"]))
        for values in _transmission(before).values():
            behind(transmission, old, np.degrees(closed(before, values)))
    for i, name in enumerate(turning):
        link = data["links"][name]
        angles.plot(phi, _turn(data, link), **line(i))
        first.plot(phi, closed(data, link["d"]), **line(i))
        second.plot(phi, closed(data, link["dd"]), **line(i))
    for name, values in groups.items():
        transmission.plot(phi, np.degrees(closed(data, values)), **looks[name])
    angles.set_title("θ, angle to the x axis  (°)")
    first.set_title("ω′ = dθ/dφ")
    second.set_title("ε′ = d²θ/dφ²")
    transmission.set_title("μ, transmission angle  (°)")
    for column in (0, 1):
        over_crank([row[column] for row in axes], data, scene, columns=2)
    transmission.set_ylim(0, 180)
    transmission.set_yticks([0, 40, 90, 140, 180])
    for limit in (40, 140) if groups else ():
        transmission.axhline(limit, zorder=1, **LIMIT)
    return figure


def _transmission(data: Data) -> dict[str, np.ndarray]:
    """Transmission angles (rad) of the groups for which one is defined."""
    found = {n: np.asarray(g.get("transmission_angle", ())) for n, g in data.get("groups", {}).items()}
    return {name: values for name, values in found.items() if values.size == np.size(data["angles"])}


def _turn(data: Data, link: Data) -> np.ndarray:
    """Angle of a link over the closed cycle, in degrees."""
    angle = np.degrees(np.asarray(link["angle"], float))
    return closed(data, angle, 360 * np.round((angle[-1] - angle[0]) / 360))


@styled
def velocity_hodographs_figure(
    data: Data, scene: Scene, before: Data | None = None, units: Units | None = None
) -> Figure:
    """Hodographs of the first kinematic coefficients, the velocities at unit crank speed."""
    return _hodographs(data, scene, before, units, 1, "Hodographs of the first kinematic coefficients (velocity / ω)")


@styled
def acceleration_hodographs_figure(
    data: Data, scene: Scene, before: Data | None = None, units: Units | None = None
) -> Figure:
    """Hodographs of the second kinematic coefficients, the accelerations at constant unit crank speed."""
    title = "Hodographs of the second kinematic coefficients (acceleration / ω²)"
    return _hodographs(data, scene, before, units, 2, title)


def _hodographs(data: Data, scene: Scene, before: Data | None, units: Units | None, order: int, title: str) -> Figure:
    names = {name: text for group in moving(data, scene) for name, text in group.items()}
    columns = 3
    rows = -(-len(names) // columns) or 1
    keys = [*mark_keys(scene), *before_keys(before)]
    figure, axes = sheet(title, rows, columns, panel=0.0, keys=keys, gap=(0.5, 0.5), square=True)
    cells = [ax for row in axes for ax in row]
    _, unit, cx, cy = ORDERS[order]
    for ax, name in zip(cells, names, strict=False):
        curve = np.stack([closed(data, data["points"][name][c]) for c in (cx, cy)])
        factor, shown = prefixed(largest([curve]), unit, units)
        curves = [factor * curve]
        if before and name in before["points"]:
            curves.append(factor * np.stack([closed(before, before["points"][name][c]) for c in (cx, cy)]))
            behind(ax, *curves[1])
        hodograph(ax, degrees(data, scene), curves[0], {"color": BLUE, "linewidth": 1.4})
        frame_equal(ax, curves)
        ax.set_title(label(names[name], shown))
    blank(cells[len(names) :])
    return figure


@styled
def inertia_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """Reduced inertia J and its derivative J′ with respect to the crank angle."""
    phi, reduced = degrees(data, scene), data["reduced"]
    wheel = float(data.get("flywheel", {}).get("given", 0.0))
    keys = [key("flywheel", color=GREY, linewidth=1.0, linestyle=(0, (5, 2)))] if wheel > 0 else []
    figure, axes = sheet(
        "Reduced inertia", 2, 1, panel=1.9, keys=[*keys, *before_keys(before), *window_keys(data, scene)]
    )
    top, bottom = (row[0] for row in axes)
    for ax, kind, name, unit, colour in (
        (top, "inertia", "J", "kg·m²", BLUE),
        (bottom, "inertia_slope", "J′ = dJ/dφ", "kg·m²/rad", VERMILION),
    ):
        values = closed(data, reduced[kind])
        factor, shown = prefixed(largest([values]), unit, units)
        if before:
            behind(ax, degrees(before, scene), factor * closed(before, before["reduced"][kind]))
        ax.plot(phi, factor * values, color=colour, linewidth=1.6)
        ax.set_title(label(name, shown))
        if ax is top and wheel > 0:
            ax.axhline(factor * wheel, color=GREY, linewidth=1.0, linestyle=(0, (5, 2)))
    bottom.axhline(0, color=GREY, linewidth=0.6)
    over_crank([top, bottom], data, scene)
    return figure
