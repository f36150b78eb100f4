"""Files of an analysis: report, figures, animation and CSV tables."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import linkjax
from linkjax.analysis import columns
from linkjax.cli._console import console, elapsed
from linkjax.machine import Scene
from linkjax.mechanism import StructureError
from linkjax.scenes import SceneError


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
    console.print(f"\n{len(figures)} figures, machine.gif and report.html in {out}", highlight=False)


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
