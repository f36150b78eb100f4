"""Table of the harmonics of torque and speed."""

from __future__ import annotations

from itertools import zip_longest
from typing import Any

from linkjax._display import NONE
from linkjax.report._cells import Cell, Cells, table, words


def harmonics_table(show: Cells, data: dict[str, Any]) -> str:
    """Amplitudes and phases by order of the crank's revolution, one quantity beside the other; empty without any."""
    every = data.get("harmonics") or {}
    if not every:
        return ""
    longest = max((found["order"] for found in every.values()), key=len)
    columns = []
    for found in every.values():
        amplitudes = show.several([found["mean"], *found["amplitude"]], found["unit"], 4)
        phases = [Cell(NONE, True), *(show.angle(phase) for phase in found["phase"])]
        columns.append(list(zip(amplitudes, phases, strict=True)))
    rows = []
    for order, *cells in zip_longest(["mean", *longest], *columns, fillvalue=(Cell(NONE, True), Cell(NONE, True))):
        name = order if isinstance(order, str) else f"{order:g}"
        rows.append([words(name), *(cell for pair in cells for cell in pair)])
    head = ["order of the crank's revolution"]
    for name in every:
        head += [name.replace("_", " "), "phase"]
    return table(head, rows, "Harmonics over the crank angle: mean + Σ amplitude · cos(order · φ − phase)")
