"""A mechanism in plain text: what `print(mechanism)` shows."""

from __future__ import annotations

from collections.abc import Iterable

from linkjax._display import NONE, aligned
from linkjax.topology import Pair, Structure


def structure_text(found: Structure) -> str:
    """Structural formula, mobility, and a table of the groups with the pairs by which they are attached."""
    rows = [("links", "class", "pairs", "outer pairs", "inner pairs")]
    for part in found.parts:
        rows.append((", ".join(part.links), part.kind, part.letters, _pairs(part.outer), _pairs(part.inner)))
    return "\n".join([f"structure  {found.formula()}", f"mobility   {found.mobility_formula()}", "", *aligned(rows)])


def _pairs(pairs: Iterable[Pair]) -> str:
    return ", ".join(f"{pair.name} ({pair.one} on {pair.other})" for pair in pairs) or NONE
