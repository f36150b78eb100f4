"""Units of peaks, for printed output and reports."""

from __future__ import annotations


def peak_unit(name: str) -> str:
    """SI unit of a peak, by its name."""
    head = name.partition(".")[0]
    return "N·m" if any(word in head for word in ("torque", "moment")) else "N"


def peak_label(name: str) -> str:
    """Name of a peak in words: "drive torque", "max drive torque", but "reaction.B.rod" as in other outputs."""
    label = name.removeprefix("peak_")
    return label if label.startswith("reaction.") else label.replace("_", " ")
