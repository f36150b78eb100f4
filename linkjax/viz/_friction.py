"""Where the power goes: what the friction of every joint takes."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from linkjax._display import Units, prefixed
from linkjax.analysis import moves
from linkjax.machine import Scene
from linkjax.viz._style import (
    BEFORE,
    GREY,
    TEXT,
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

BAR = 0.24  # inches: the height of a row
MARK: dict[str, Any] = {**BEFORE, "linewidth": 1.6}


@styled
def friction_figure(data: Data, scene: Scene, before: Data | None = None, units: Units | None = None) -> Figure:
    """The work that the friction of every joint takes in a cycle, as bars, and its power over the crank angle; in the
    actual motion, or at constant speed without one."""
    run, old = _run(data), _run(before) if before else {}
    names = list(run)
    looks = {name: line(i) for i, name in enumerate(names)}
    keys = [key(name, **looks[name]) for name in names]
    keys += [*before_keys(before), *window_keys(data, scene)]
    how = "actual motion" if moves(data) else "constant speed"
    figure, ((top,), (bottom,)) = sheet(
        f"Friction, {how}", 2, 1, panel=(BAR * (len(names) + 1), 1.9), keys=keys, gap=(0.62, 0.62)
    )
    losses = np.asarray([float(run[name]["loss"]) for name in names])
    earlier = [float(old[name]["loss"]) if name in old else 0.0 for name in names]
    factor, shown = prefixed(largest([losses, earlier]), "J", units)
    rows = np.arange(len(names))
    colours = [looks[name]["color"] for name in names]
    top.barh(rows, factor * losses, height=0.62, color=[(colour, 0.4) for colour in colours], edgecolor=colours)
    for row, name, loss in zip(rows, names, losses, strict=True):
        share = f"{100 * loss / losses.sum():.3g} %" if losses.sum() > 0 else ""
        top.annotate(f"{name}  {share}", (0, row), (3, 0), textcoords="offset points", va="center", fontsize=TEXT)
    if before:
        for number, (row, loss) in enumerate(zip(rows, earlier, strict=True)):
            (mark,) = top.plot([factor * loss] * 2, [row - 0.36, row + 0.36], **MARK)
            mark.set_gid(f"before-0-{number}")
    top.set(yticks=[], ylim=(len(names) - 0.4, -0.6), title=label("work per cycle", shown))
    top.set_xlim(left=0)
    curves = {name: closed(data, run[name]["power"]) for name in names}
    factor, shown = prefixed(largest(list(curves.values())), "W", units)
    for name in names if before else ():
        if name in old:
            behind(bottom, degrees(before or data, scene), factor * closed(before or data, old[name]["power"]))
    for name, curve in curves.items():
        bottom.plot(degrees(data, scene), factor * curve, **looks[name])
    bottom.axhline(0, color=GREY, linewidth=0.6)
    bottom.set_title(label("power", shown))
    over_crank([bottom], data, scene)
    return figure


def rubs(data: Data) -> bool:
    """Whether friction takes finite work in an analysis."""
    losses = [float(each["loss"]) for each in _run(data).values() if each["loss"] is not None]
    return bool(losses) and bool(np.all(np.isfinite(losses))) and len(losses) == len(_run(data)) and max(losses) > 0


def _run(data: Data) -> dict[str, Any]:
    """Friction by joint."""
    return (data.get("friction") or data.get("friction_constant_speed") or {}).get("joints") or {}
