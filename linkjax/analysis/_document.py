"""The JSON document of an analysis: the contract that reports, plots and other programs read."""

from __future__ import annotations

from typing import Any

from linkjax.analysis._cycle import Cycle
from linkjax.analysis._layout import laid_out


def document(cycle: Cycle, name: str = "", version: str = "") -> dict[str, Any]:
    """The analysis as nested dicts of NumPy arrays and floats (SI), laid out as `docs/conventions.md` says. What
    belongs to an actual motion that does not exist, or is not asked for, is None."""
    return laid_out(cycle, name, version)
