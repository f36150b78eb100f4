"""Writing of all figures of an analysis to files."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import matplotlib
from matplotlib.figure import Figure

from linkjax._display import Units
from linkjax._units import display_units
from linkjax.analysis import moves
from linkjax.machine import Scene
from linkjax.viz._curves import moving
from linkjax.viz._dynamics import loaded, speed_figure, torque_figure
from linkjax.viz._forces import drive_figure, reaction_hodographs_figure, reactions_figure, shaking_figure
from linkjax.viz._friction import friction_figure, rubs
from linkjax.viz._kinematics import (
    acceleration_hodographs_figure,
    centres_figure,
    inertia_figure,
    links_figure,
    points_figure,
    velocity_hodographs_figure,
)
from linkjax.viz._loads import acts, loads_figure
from linkjax.viz._machine import machine_figure
from linkjax.viz._motor import energy_mass_figure, harmonics_figure, has_loop, operating_loop_figure
from linkjax.viz._optimum import history_figure, trade_off_figure
from linkjax.viz._style import STYLE, Data


class Picture(NamedTuple):
    """A figure: file name, caption, function that draws it, and the part of the analysis that it needs."""

    name: str
    caption: str
    draw: Callable[..., Figure]
    needs: str


PICTURES = (
    Picture("machine", "The machine to scale", machine_figure, "points"),
    Picture("points", "Positions and kinematic coefficients of pins and coupler points", points_figure, "points"),
    Picture("mass-centres", "Positions and kinematic coefficients of the mass centres", centres_figure, "centres"),
    Picture("links", "Angles and kinematic coefficients of the links, transmission angles", links_figure, "links"),
    Picture("velocity-hodographs", "Hodographs of the first kinematic coefficients",
            velocity_hodographs_figure, "points"),
    Picture("acceleration-hodographs", "Hodographs of the second kinematic coefficients",
            acceleration_hodographs_figure, "points"),
    Picture("inertia", "Reduced inertia and its derivative", inertia_figure, "reduced"),
    Picture("torque", "Reduced torque of each load, drive torque, and work", torque_figure, "torques"),
    Picture("loads", "Force of each load, power of loads and drive", loads_figure, "loads"),
    Picture("friction", "Work and power that the friction of every joint takes", friction_figure, "friction"),
    Picture("speed", "Speed and angular acceleration of the crank", speed_figure, "motion"),
    Picture("reactions", "Magnitudes of the joint forces", reactions_figure, "forces"),
    Picture("reaction-hodographs", "Hodographs of the joint forces", reaction_hodographs_figure, "forces"),
    Picture("drive", "Drive torque and power", drive_figure, "forces"),
    Picture("shaking", "Shaking force and shaking moment", shaking_figure, "forces"),
    Picture("energy-mass", "Energy-mass diagram (Wittenbauer)", energy_mass_figure, "free motion"),
    Picture("operating-loop", "Operating loop on the characteristic of the motor", operating_loop_figure, "loop"),
    Picture("harmonics", "Harmonics of torque and speed", harmonics_figure, "harmonics"),
)  # fmt: skip

COURSES = (
    Picture("history", "Objective and constraint violation over the iterations", history_figure, "history"),
    Picture("trade-off", "Best objective over the bound of one constraint", trade_off_figure, "trade_off"),
)


def write_figures(
    data: Data, scene: Scene, directory: str | Path, before: Data | None = None, units: str = ""
) -> list[Path]:
    """Write every figure for which the analysis has data, as PNG (150 dpi) and SVG; create a missing directory.

    `data` is the document of an analysis (see `linkjax.analysis.document`), `before` that of an earlier design, drawn
    behind in grey, and `units` are the display units (e.g. "mm, rpm, kN"; default SI with prefixes). Returns the files,
    a PNG and an SVG for each figure, in the order of the report. The files contain no dates, so the same data gives
    the same bytes. Raises `QuantityError` for an unknown unit.
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, figure in drawn(data, scene, before, display_units(units)):
        raster, vector = folder / f"{name}.png", folder / f"{name}.svg"
        with matplotlib.rc_context({**STYLE, "svg.hashsalt": name}):
            figure.savefig(raster, dpi=150, metadata={"Software": None}, pil_kwargs={"compress_level": 4})
        vector.write_text(svg(name, figure), encoding="utf-8")
        written += [raster, vector]
    return written


def drawn(data: Data, scene: Scene, before: Data | None, units: Units) -> Iterator[tuple[str, Figure]]:
    """Every figure for which the analysis has data, with its name."""
    for picture in PICTURES:
        if _has(data, picture.needs, scene):
            old = before if before and _has(before, picture.needs, scene) else None
            yield picture.name, picture.draw(data, scene, before=old, units=units)


def _has(data: Data, part: str, scene: Scene) -> bool:
    """Whether an analysis contains the part that a figure needs."""
    if part == "motion":
        return moves(data)
    if part == "loads":
        return acts(data)
    if part == "friction":
        return rubs(data)
    if part == "free motion":
        return moves(data) and not scene.mechanism.prescribed
    if part == "torques":
        return moves(data) or bool(loaded(data))
    if part == "centres":
        return bool(data.get("points")) and bool(moving(data, scene).centres)
    if part == "loop":
        return has_loop(data, scene)
    return bool(data.get(part) or (part == "forces" and data.get("forces_constant_speed")))


def courses(optimum: Data, units: Units) -> Iterator[tuple[Picture, Figure]]:
    """Every figure for which the document of an optimisation has data."""
    for course in COURSES:
        if optimum.get(course.needs):
            yield course, course.draw(optimum, units)


def svg(name: str, figure: Figure) -> str:
    """A figure as SVG text that depends only on the figure and its name."""
    text = io.StringIO()
    with matplotlib.rc_context({**STYLE, "svg.hashsalt": name}):
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return text.getvalue()
