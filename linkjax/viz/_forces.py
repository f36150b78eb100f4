"""Joint forces, drive torque and shaking force, in the true motion and at constant speed."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linkjax.machine import Scene
from linkjax.viz._curves import frame_equal, hodograph
from linkjax.viz._style import (
    BLUE,
    GREY,
    VERMILION,
    Data,
    blank,
    closed,
    degrees,
    key,
    label,
    largest,
    mark_keys,
    over_crank,
    prefixed,
    sheet,
    styled,
    window_keys,
)

TRUE = {"color": BLUE, "linewidth": 1.5, "linestyle": "-"}
CONSTANT = {"color": VERMILION, "linewidth": 1.2, "linestyle": (0, (4, 1.3))}


class Case(NamedTuple):
    """Forces of one motion, and how they look."""

    name: str
    forces: dict[str, Any]
    look: dict[str, Any]


def cases(data: Data) -> list[Case]:
    """Forces in the true motion first, then at constant speed; one of them when only that was computed."""
    constant = Case("constant speed", data.get("forces_constant_speed", data["forces"]), CONSTANT)
    if data.get("model", {}).get("constant_speed", False):
        return [constant]
    true = Case("true motion", data["forces"], TRUE)
    return [true, constant] if "forces_constant_speed" in data else [true]


def motion_keys(found: list[Case]) -> list[Line2D]:
    """Legend entries of the motions."""
    return [key(case.name, **case.look) for case in found]


def joints(data: Data) -> list[tuple[str, str, str]]:
    """(joint, link, by): one side of every joint, the other being equal and opposite."""
    found, peaks = [], data.get("peaks", {})
    for joint, sides in data["forces"]["reactions"].items():
        seen: set[frozenset[str]] = set()
        for link in sorted(sides, key=lambda name, joint=joint: f"reaction.{joint}.{name}" not in peaks):
            by = str(sides[link]["by"])
            if frozenset((link, by)) not in seen:
                seen.add(frozenset((link, by)))
                found.append((joint, link, by))
    return found


def joint_name(joint: str, link: str, by: str) -> str:
    """Heading of a joint's panel: `B: rod on crank` says who pushes whom."""
    return f"{joint.removeprefix(link + '.')}: {by} on {link}"


@styled
def reactions_figure(data: Data, scene: Scene) -> Figure:
    """Magnitude of every joint force over the crank angle, and the couple of every guide that carries one."""
    phi, found = degrees(data, scene), cases(data)
    pairs = joints(data)
    panels = [(joint_name(*pair), "N", [_magnitude(case, *pair) for case in found]) for pair in pairs]
    force = max((largest(values) for _, _, values in panels), default=0.0)
    for joint, link, by in pairs:
        couples = [np.asarray(case.forces["reactions"][joint][link].get("moment", 0.0)) for case in found]
        if largest(couples) > 1e-9 * force * largest(p["x"] for p in data["points"].values()):
            panels.append((f"{joint_name(joint, link, by)}, couple", "N·m", couples))
    columns = 3 if len(panels) > 4 else 2
    rows = -(-len(panels) // columns)
    keys = [*motion_keys(found), *window_keys(scene)]
    figure, axes = sheet("Joint forces", rows, columns, panel=1.35, keys=keys, gap=(0.5, 0.42))
    cells = [ax for row in axes for ax in row]
    for ax, (name, unit, values) in zip(cells, panels, strict=False):
        factor, shown = prefixed(largest(values), unit)
        for case, curve in zip(found, values, strict=True):
            ax.plot(phi, factor * closed(data, curve), **case.look)
        ax.set_title(label(name, shown), fontsize=7.5)
    blank(cells[len(panels) :])
    for column in range(columns):
        over_crank(cells[column : len(panels) : columns], scene, columns=columns)
    for ax, (_, unit, _) in zip(cells, panels, strict=False):
        if unit == "N":
            ax.set_ylim(bottom=0)
    return figure


def _magnitude(case: Case, joint: str, link: str, by: str) -> np.ndarray:
    del by
    side = case.forces["reactions"][joint][link]
    return np.hypot(np.asarray(side["fx"], float), np.asarray(side["fy"], float))


@styled
def reaction_hodographs_figure(data: Data, scene: Scene) -> Figure:
    """Polar hodographs (fx, fy) of the joint forces."""
    found, pairs = cases(data), joints(data)
    columns = 3
    rows = -(-len(pairs) // columns) or 1
    keys = [*motion_keys(found), *mark_keys(scene)]
    title = "Hodographs of the joint forces"
    figure, axes = sheet(title, rows, columns, panel=0.0, keys=keys, gap=(0.5, 0.5), square=True)
    cells = [ax for row in axes for ax in row]
    for ax, (joint, link, by) in zip(cells, pairs, strict=False):
        sides = [case.forces["reactions"][joint][link] for case in found]
        _polar(ax, data, scene, found, sides, joint_name(joint, link, by))
    blank(cells[len(pairs) :])
    return figure


def _polar(ax: Axes, data: Data, scene: Scene, found: list[Case], forces: list[dict[str, Any]], name: str,
           named: bool = False) -> None:  # fmt: skip
    curves = [np.stack([closed(data, force["fx"]), closed(data, force["fy"])]) for force in forces]
    factor, shown = prefixed(largest(curves), "N")
    for case, curve in zip(found, curves, strict=True):
        hodograph(ax, degrees(data, scene), factor * curve, case.look, named and case is found[0])
    frame_equal(ax, [factor * curve for curve in curves])
    ax.set_title(label(name, shown), fontsize=7.5)


@styled
def drive_figure(data: Data, scene: Scene) -> Figure:
    """Drive torque on the crank and its power."""
    phi, found = degrees(data, scene), cases(data)
    keys = [*motion_keys(found), *window_keys(scene)]
    figure, ((top,), (bottom,)) = sheet("Drive", 2, 1, panel=1.8, keys=keys)
    torques = [closed(data, case.forces["drive_torque"]) for case in found]
    nominal = float(scene.speed)
    speeds = [closed(data, data["motion"]["speed"] if case.look is TRUE else nominal) for case in found]
    powers = [torque * speed for torque, speed in zip(torques, speeds, strict=True)]
    for ax, curves, name, unit in ((top, torques, "drive torque", "N·m"), (bottom, powers, "drive power", "W")):
        factor, shown = prefixed(largest(curves), unit)
        for case, curve in zip(found, curves, strict=True):
            ax.plot(phi, factor * curve, **case.look)
        ax.axhline(0, color=GREY, linewidth=0.6)
        ax.set_title(label(name, shown))
    over_crank([top, bottom], scene)
    return figure


@styled
def shaking_figure(data: Data, scene: Scene) -> Figure:
    """Polar plot of the shaking force, its magnitude, and the shaking moment."""
    phi, found = degrees(data, scene), cases(data)
    keys = [*motion_keys(found), *mark_keys(scene), *window_keys(scene)]
    figure, ((polar, top), (spare, bottom)) = sheet("Shaking force and moment", 2, 2, panel=1.55, keys=keys)
    low, high = spare.get_position(), polar.get_position()
    spare.remove()
    polar.set_position((high.x0, low.y0, high.width, high.y1 - low.y0))
    forces = [case.forces["shaking"] for case in found]
    _polar(polar, data, scene, found, forces, "shaking force, fx and fy", named=True)
    polar.title.set_fontsize(top.title.get_fontsize())
    magnitudes = [np.hypot(np.asarray(f["fx"], float), np.asarray(f["fy"], float)) for f in forces]
    about = str(forces[0].get("about", ""))
    moment = f"shaking moment about {about}" if about else "shaking moment"
    for ax, curves, name, unit in (
        (top, magnitudes, "shaking force", "N"),
        (bottom, [np.asarray(f["moment"], float) for f in forces], moment, "N·m"),
    ):
        factor, shown = prefixed(largest(curves), unit)
        for case, curve in zip(found, curves, strict=True):
            ax.plot(phi, factor * closed(data, curve), **case.look)
        ax.set_title(label(name, shown))
    over_crank([top, bottom], scene, columns=2)
    top.set_ylim(bottom=0)
    bottom.axhline(0, color=GREY, linewidth=0.6)
    return figure
