"""The table of energies in the report."""

from __future__ import annotations

from typing import Any

from linkjax._display import NONE
from linkjax.analysis import energy_rows
from linkjax.report._cells import Cell, Cells, table, words

Data = dict[str, Any]


def energies(show: Cells, data: Data, before: Data | None = None) -> str:
    """Energies per cycle by source and sink; those of the earlier design in separate columns."""
    new, old = energy_rows(data, show), energy_rows(before, show) if before else []
    if not new:
        return ""
    earlier = {name: cells for name, *cells in old[1:]}
    rows = []
    for name, *cells in new[1:]:
        both = [*(earlier.get(name, [NONE] * 2) if before else []), *cells]
        rows.append([words(name), *(Cell(cell, True) for cell in both)])
    ways = new[0][1:]
    head = [f"{way} {when}" for when in ("before", "after") for way in ways] if before else ways
    return table([new[0][0], *head], rows)
