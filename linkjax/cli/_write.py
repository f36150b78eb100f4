"""Files of an analysis: report, figures, animation and CSV tables."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import linkjax
from linkjax.analysis import moves
from linkjax.cli._console import console, elapsed
from linkjax.machine import Scene


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
    """One table per kind, crank angle (rad) in the first column, keys of the JSON document as headings."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("points", "links", "groups", "reduced", "motion", "forces", "forces_constant_speed"):
        if data[name] is None or (name == "motion" and not moves(data)):
            continue
        columns = {"angle": data["angles"]} | dict(_columns(data[name], len(data["angles"])))
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*(map(repr, map(float, column)) for column in columns.values()), strict=True))


def _columns(tree: dict[str, Any], length: int, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _columns(value, length, f"{prefix}{key}.")
        elif getattr(value, "shape", ()) == (length,):
            yield prefix + key, value
