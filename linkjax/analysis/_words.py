"""Units of peaks, for printed output and reports."""

from __future__ import annotations


def peak_unit(name: str) -> str:
    """SI unit of a peak, by its name."""
    turning = not name.startswith("reaction.") and any(word in name for word in ("torque", "moment"))
    return "N·m" if turning else "N"
