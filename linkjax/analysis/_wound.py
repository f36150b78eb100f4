"""Torsion springs that are wound by more than half a turn."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np

from linkjax.loads import TorsionSpring


def warn_of_wound(cycle: Any) -> None:
    """Warn of every torsion spring whose deflection passes half a turn, where its couple jumps."""
    angles, length = np.asarray(cycle.angles), cycle.scene.cycle
    closed = angles.size > 2 and math.isclose(2 * angles[-1] - angles[-2], angles[0] + length, rel_tol=1e-6)
    for load in cycle.scene.loads:
        if not isinstance(load, TorsionSpring):
            continue
        turned = np.broadcast_to(np.asarray(load.deflection(cycle.pose)), angles.shape)
        turned = np.append(turned, turned[:1]) if closed else turned
        if np.any(np.abs(np.diff(turned)) > np.pi):
            between = "the frame" if load.to_link == "frame" else repr(load.to_link)
            warnings.warn(
                f"torsion spring {load.name!r}: {load.link!r} turns by more than half a turn from the free angle, "
                f"relative to {between}, and the couple jumps there; change free_angle, or attach it to other links",
                stacklevel=3,
            )
