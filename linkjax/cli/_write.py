"""Drawings, and files of an analysis: report, figures, animation and CSV tables."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import linkjax
from linkjax._display import Numbers
from linkjax._results import MachineError, Result
from linkjax.analysis import columns, positions
from linkjax.cli._console import console, elapsed
from linkjax.cli._options import check_places
from linkjax.machine import Scene
from linkjax.mechanism import StructureError
from linkjax.rolling import RollingMachine, document
from linkjax.scenes import SceneError

PICTURES = (".svg", ".png", ".pdf")
OTHERS = 6  # crank angles of a drawing, if none is given


def write_out(
    data: dict[str, Any], machine: Scene, out: Path, *, before: tuple[dict[str, Any], Scene] | None = None,
    optimum: dict[str, Any] | None = None, units: str = "",
) -> None:  # fmt: skip
    """Write figures, animation and report of an analysis, or of an optimisation with the machine before."""
    with elapsed("drawing"):  # viz and report load matplotlib, so only here
        earlier = None if before is None else before[0]
        figures = linkjax.viz.write_figures(data, machine, out, before=earlier, units=units)
        linkjax.viz.animate(data, machine, out / "machine.gif", units=units)
        linkjax.report.write_report(
            data, machine, out / "report.html", figures=figures, before=before, optimum=optimum, units=units
        )
    console.print(f"\n{len(figures) // 2} figures (PNG and SVG), machine.gif and report.html in {out}", highlight=False)


def write_csv(data: dict[str, Any], folder: Path) -> None:
    """One table per kind, with the columns of `Cycle.table`. Raises `SceneError` where two columns have the same
    name."""
    try:
        kinds = columns(data)
    except StructureError as error:
        raise SceneError(data["scene"], error.element, None, error.problem, error.remedy) from error
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in kinds.items():
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(table)
            writer.writerows(zip(*(map(repr, map(float, column)) for column in table.values()), strict=True))


def check_picture(out: Path | None, at: bool) -> None:
    """Raise, before anything is computed, for a picture that cannot be written, and for angles without a picture."""
    if out is None and at:
        raise SceneError("--at", "", None, "is the crank angle of a drawing", "add --out picture.svg")
    if out is not None and out.suffix.lower() not in PICTURES:
        raise SceneError("--out", "", str(out), "is no picture", f"write a name that ends in {', '.join(PICTURES)}")
    check_places(None, None, out)


def draw(machine: Scene | RollingMachine, name: str, out: Path, angles: list[float], show: Numbers) -> None:
    """Draw a machine at the first of these crank angles (rad), at the others in thin lines; without angles, at six."""
    if isinstance(machine, RollingMachine):
        figure = linkjax.viz.rolling_figure(document(machine, 4, name, linkjax.__version__), show.units)
    else:
        data = positions(machine) | {"scene": name}
        good = [angle for angle in angles or uniform(machine, OTHERS) if assembled(data, machine, angle)]
        if angles and len(good) < len(angles):
            where = show.turned(next(angle for angle in angles if angle not in good))
            problem = f"Scene {machine.title or name!r}: cannot be assembled at {where} of crank angle."
            raise MachineError(f"{problem} Choose another angle with --at, or omit it.", Result.CANNOT_BE_ASSEMBLED)
        first, others = (good[0], good[1:]) if angles else (None, good)
        figure = linkjax.viz.machine_figure(data, machine, first, others=others, units=show.units)
    out.parent.mkdir(parents=True, exist_ok=True)
    if out.suffix.lower() == ".svg":
        out.write_text(linkjax.viz.svg(out.stem, figure), encoding="utf-8")
    else:
        figure.savefig(out, dpi=150)


def uniform(machine: Scene, count: int) -> list[float]:
    """Uniform crank angles (rad) over the cycle."""
    return [i * machine.cycle / count for i in range(count)]


def assembled(data: dict[str, Any], machine: Scene, angle: float) -> bool:
    """Whether the machine can be assembled at the nearest crank angle of `positions`."""
    codes = data["result"]["per_angle"]
    return bool(codes[round(angle / machine.cycle * len(codes)) % len(codes)] == Result.SUCCESS)
