"""Harmonics as plain numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from linkjax.measures import FAMILIES, Harmonics


def harmonics_document(found: dict[str, Harmonics]) -> dict[str, Any]:
    """Harmonics by the name of their quantity as plain numbers (SI), with the `unit`."""
    return {
        name: {
            "unit": FAMILIES[name.partition(".")[0]].unit,
            **{part: float(getattr(each, part)) for part in ("mean", "rms")},
            **{part: np.asarray(getattr(each, part)).tolist() for part in ("order", "amplitude", "phase")},
        }
        for name, each in found.items()
    }
