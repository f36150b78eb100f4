"""Part of a cycle's angles."""

from __future__ import annotations

import dataclasses

import jax

from linkjax.analysis._cycle import Cycle

OVER_ANGLES = (
    "angles", "pose", "transmission", "reduced", "speed", "acceleration", "time", "forces", "forces_constant_speed",
    "assembled",
)  # fmt: skip


def pick(cycle: Cycle, which: slice) -> Cycle:
    """The same cycle reported over some of its angles only."""
    parts = {name: jax.tree.map(lambda leaf: leaf[which], getattr(cycle, name)) for name in OVER_ANGLES}
    return dataclasses.replace(cycle, **parts)
