"""Joint forces, drive torque and shaking force, in the actual motion and at constant speed."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linkjax._display import Units, prefixed
from linkjax.machine import Scene
from linkjax.measures import motion_of
from linkjax.viz._curves import frame_equal, hodograph
from linkjax.viz._style import (
    BEFORE,
    BLUE,
    GREY,
    VERMILION,
    Data,
    behind,
    blank,
    closed,
    degrees,
    key,
    label,
    largest,
    mark_keys,
    over_crank,
    sheet,
    styled,
    window_keys,
)

TRUE = {"color": BLUE, "linewidth": 1.5, "linestyle": "-"}
CONSTANT = {"color": VERMILION, "linewidth": 1.2, "linestyle": (0, (4, 1.3))}


class Case(NamedTuple):
    """Forces of one motion, and their line style."""

    name: str
    forces: dict[str, Any]
    look: dict[str, Any]


def cases(data: Data) -> list[Case]:
    """Forces in the actual motion, then at constant speed; only one of them if the other was not computed."""
    constant = Case("constant speed", data.get("forces_constant_speed", data["forces"]), CONSTANT)
    if data.get("model", {}).get("constant_speed", False) or data["forces"] is None:
        return [constant]
    true = Case("actual motion", data["forces"], TRUE)
    return [true, constant] if "forces_constant_speed" in data else [true]


def cases_before(before: Data | None) -> list[Case]:
    """The same cases of the earlier design, as thin grey lines."""
    looks = {"actual motion": BEFORE, "constant speed": BEFORE | {"linestyle": (0, (1, 1.3)), "linewidth": 1.1}}
    found = cases(before) if before else []
    return [Case(f"before, {case.name}", case.forces, looks[case.name]) for case in found]


def motion_keys(found: list[Case], old: list[Case]) -> list[Line2D]:
    """Legend entries for the motions."""
    keys = [key(case.name, **case.look) for case in found]
    return keys + [key(case.name, gid=f"before-key-{i}", **case.look) for i, case in enumerate(old)]


def joints(data: Data) -> list[tuple[str, str, str]]:
    """(joint, link, by) for one side of every joint; the force on the other side is equal and opposite."""
    found, peaks = [], data.get("peaks", {})
    named = {motion_of(name)[0] for name in peaks}
    for joint, sides in cases(data)[0].forces["reactions"].items():
        seen: set[frozenset[str]] = set()
        for link in sorted(sides, key=lambda name, joint=joint: f"peak_reaction.{joint}.{name}" not in named):
            by = str(sides[link]["by"])
            if frozenset((link, by)) not in seen:
                seen.add(frozenset((link, by)))
                found.append((joint, link, by))
    return found


def joint_name(joint: str, link: str, by: str) -> str:
    """Heading of the panel of a joint: `B: rod on crank` is the force of the rod on the crank."""
    return f"{joint.removeprefix(link + '.')}: {by} on {link}"


@styled
def reactions_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """Magnitude of every joint force over the crank angle, and the couple in every guide that transmits one."""
    found, old = cases(data), cases_before(before)
    pairs = joints(data)
    panels = [(pair, False, [_magnitude(case, *pair) for case in found]) for pair in pairs]
    force = max((largest(values) for _, _, values in panels), default=0.0)
    for joint, link, by in pairs:
        couples = [np.asarray(case.forces["reactions"][joint][link].get("moment", 0.0)) for case in found]
        if largest(couples) > 1e-9 * force * largest(p["x"] for p in data["points"].values()):
            panels.append(((joint, link, by), True, couples))
    columns = 3 if len(panels) > 4 else 2
    rows = -(-len(panels) // columns)
    keys = [*motion_keys(found, old), *window_keys(data, scene)]
    figure, axes = sheet("Joint forces", rows, columns, panel=1.35, keys=keys, gap=(0.5, 0.42))
    cells = [ax for row in axes for ax in row]
    for ax, (pair, couple, values) in zip(cells, panels, strict=False):
        factor, shown = prefixed(largest(values), "N·m" if couple else "N", units)
        for case in old:
            _behind(ax, before, scene, case, pair, couple, factor)
        for case, curve in zip(found, values, strict=True):
            ax.plot(degrees(data, scene), factor * closed(data, curve), **case.look)
        ax.set_title(label(f"{joint_name(*pair)}{', couple' if couple else ''}", shown), fontsize=7.5)
    blank(cells[len(panels) :])
    for column in range(columns):
        over_crank(cells[column : len(panels) : columns], data, scene, columns=columns)
    for ax, (_, couple, _) in zip(cells, panels, strict=False):
        if not couple:
            ax.set_ylim(bottom=0)
    return figure


def _behind(ax: Axes, before: Data | None, scene: Scene, case: Case, pair: tuple[str, str, str], couple: bool,
            factor: float) -> None:  # fmt: skip
    """Draw the same joint of the earlier design, if it exists there."""
    side = case.forces["reactions"].get(pair[0], {}).get(pair[1])
    if before and side:
        values = np.asarray(side.get("moment", 0.0)) if couple else _magnitude(case, *pair)
        behind(ax, degrees(before, scene), factor * closed(before, values), **case.look)


def _magnitude(case: Case, joint: str, link: str, by: str) -> np.ndarray:
    del by
    side = case.forces["reactions"][joint][link]
    return np.hypot(np.asarray(side["fx"], float), np.asarray(side["fy"], float))


@styled
def reaction_hodographs_figure(
    data: Data, scene: Scene, before: Data | None = None, units: Units | None = None
) -> Figure:
    """Polar hodographs (fx, fy) of the joint forces."""
    found, old, pairs = cases(data), cases_before(before), joints(data)
    columns = 3
    rows = -(-len(pairs) // columns) or 1
    keys = [*motion_keys(found, old), *mark_keys(scene)]
    title = "Hodographs of the joint forces"
    figure, axes = sheet(title, rows, columns, panel=0.0, keys=keys, gap=(0.5, 0.5), square=True)
    cells = [ax for row in axes for ax in row]
    for ax, (joint, link, by) in zip(cells, pairs, strict=False):
        sides = [(case, data, case.forces["reactions"][joint][link]) for case in found]
        sides += [(case, before, side) for case in old if (side := case.forces["reactions"].get(joint, {}).get(link))]
        _polar(ax, scene, sides, units, joint_name(joint, link, by))
    blank(cells[len(pairs) :])
    return figure


def _polar(ax: Axes, scene: Scene, forces: list[tuple[Case, Any, dict[str, Any]]], units: Units | None, name: str,
           named: bool = False) -> None:  # fmt: skip
    """Draw hodographs of a force in several cases, each with its document; those of the earlier design are behind."""
    curves = [np.stack([closed(data, force["fx"]), closed(data, force["fy"])]) for _, data, force in forces]
    factor, shown = prefixed(largest(curves), "N", units)
    for i, ((case, data, _), curve) in enumerate(zip(forces, curves, strict=True)):
        if case.name.startswith("before"):
            behind(ax, *factor * curve, **case.look)
        else:
            hodograph(ax, degrees(data, scene), factor * curve, case.look, named and i == 0)
    frame_equal(ax, [factor * curve for curve in curves])
    ax.set_title(label(name, shown), fontsize=7.5)


@styled
def drive_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """Drive torque on the crank and its power."""
    found, old = cases(data), cases_before(before)
    keys = [*motion_keys(found, old), *window_keys(data, scene)]
    figure, ((top,), (bottom,)) = sheet("Drive", 2, 1, panel=1.8, keys=keys)
    torques = [closed(data, case.forces["drive_torque"]) for case in found]
    powers = [torque * _speed(data, scene, case) for torque, case in zip(torques, found, strict=True)]
    for ax, curves, name, unit in ((top, torques, "drive torque", "N·m"), (bottom, powers, "drive power", "W")):
        factor, shown = prefixed(largest(curves), unit, units)
        for case in old:
            curve = closed(before or data, case.forces["drive_torque"])
            power = curve * _speed(before or data, scene, case)
            behind(ax, degrees(before or data, scene), factor * (curve if ax is top else power), **case.look)
        for case, curve in zip(found, curves, strict=True):
            ax.plot(degrees(data, scene), factor * curve, **case.look)
        ax.axhline(0, color=GREY, linewidth=0.6)
        ax.set_title(label(name, shown))
    over_crank([top, bottom], data, scene)
    return figure


def _speed(data: Data, scene: Scene, case: Case) -> np.ndarray:
    """Crank speed in a case, over the closed cycle."""
    return closed(data, data["motion"]["speed"] if case.name.endswith("actual motion") else float(scene.speed))


@styled
def shaking_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """Hodograph and magnitude of the shaking force, and the shaking moment."""
    found = [(case, data, case.forces["shaking"]) for case in cases(data)]
    old = [(case, before or data, case.forces["shaking"]) for case in cases_before(before)]
    keys = [*motion_keys([case for case, *_ in found], [case for case, *_ in old]), *mark_keys(scene)]
    keys += window_keys(data, scene)
    figure, ((polar, top), (spare, bottom)) = sheet("Shaking force and moment", 2, 2, panel=1.55, keys=keys)
    low, high = spare.get_position(), polar.get_position()
    spare.remove()
    polar.set_position((high.x0, low.y0, high.width, high.y1 - low.y0))
    _polar(polar, scene, found + old, units, "shaking force, fx and fy", named=True)
    polar.title.set_fontsize(top.title.get_fontsize())
    about = str(found[0][2].get("about", ""))
    moment = f"shaking moment about {about}" if about else "shaking moment"
    for ax, read, name, unit in (
        (top, lambda force: np.hypot(force["fx"], force["fy"]), "shaking force", "N"),
        (bottom, lambda force: np.asarray(force["moment"]), moment, "N·m"),
    ):
        factor, shown = prefixed(largest(read(force) for _, _, force in found), unit, units)
        for case, of, force in old + found:
            draw = partial(behind, ax) if case.name.startswith("before") else ax.plot
            draw(degrees(of, scene), factor * closed(of, read(force)), **case.look)
        ax.set_title(label(name, shown))
    over_crank([top, bottom], data, scene, columns=2)
    top.set_ylim(bottom=0)
    bottom.axhline(0, color=GREY, linewidth=0.6)
    return figure
