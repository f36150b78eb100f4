"""All figures of an analysis, written to files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import matplotlib
from matplotlib.figure import Figure

from linkjax.machine import Scene
from linkjax.viz._dynamics import speed_figure, torque_figure
from linkjax.viz._forces import drive_figure, reaction_hodographs_figure, reactions_figure, shaking_figure
from linkjax.viz._kinematics import (
    acceleration_hodographs_figure,
    centres_figure,
    inertia_figure,
    links_figure,
    points_figure,
    velocity_hodographs_figure,
)
from linkjax.viz._machine import machine_figure
from linkjax.viz._style import STYLE, Data


class Picture(NamedTuple):
    """A figure of the set: file name, what it shows, how it is drawn, and the part of the analysis it needs."""

    name: str
    caption: str
    draw: Callable[[Data, Scene], Figure]
    needs: str


PICTURES = (
    Picture("machine", "The machine to scale", machine_figure, "points"),
    Picture("points", "Positions and kinematic coefficients of pins and marked points", points_figure, "points"),
    Picture("mass-centres", "Positions and kinematic coefficients of the mass centres", centres_figure, "points"),
    Picture("links", "Angles and kinematic coefficients of the links, transmission angles", links_figure, "links"),
    Picture("velocity-hodographs", "Hodographs of the first kinematic coefficients",
            velocity_hodographs_figure, "points"),
    Picture("acceleration-hodographs", "Hodographs of the second kinematic coefficients",
            acceleration_hodographs_figure, "points"),
    Picture("inertia", "Reduced inertia and its slope", inertia_figure, "reduced"),
    Picture("torque", "Reduced torque by load, drive torque, and work", torque_figure, "motion"),
    Picture("speed", "Speed and angular acceleration of the crank", speed_figure, "motion"),
    Picture("reactions", "Joint forces by magnitude", reactions_figure, "forces"),
    Picture("reaction-hodographs", "Joint forces as polar hodographs", reaction_hodographs_figure, "forces"),
    Picture("drive", "Drive torque and power", drive_figure, "forces"),
    Picture("shaking", "Shaking force and shaking moment", shaking_figure, "forces"),
)  # fmt: skip


def write_figures(data: Data, scene: Scene, directory: str | Path) -> list[Path]:
    """Write every figure that the analysis has data for, as PNG (150 dpi) and SVG, into a directory made if need be.

    `data` is the document of an analysis (see `linkjax.analysis.document`). Returns the files, a PNG and an SVG for
    each figure, in the order in which a reader wants them. The files hold no dates: the same data gives the same bytes.
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for picture in PICTURES:
        if not data.get(picture.needs):
            continue
        figure = picture.draw(data, scene)
        raster, vector = folder / f"{picture.name}.png", folder / f"{picture.name}.svg"
        with matplotlib.rc_context({**STYLE, "svg.hashsalt": picture.name}):
            figure.savefig(raster, dpi=150, metadata={"Software": None}, pil_kwargs={"compress_level": 4})
            figure.savefig(vector, metadata={"Date": None, "Creator": None})
        written += [raster, vector]
    return written
