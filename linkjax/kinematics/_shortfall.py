"""The shortfall of a group that cannot be assembled, in its own lengths."""

from __future__ import annotations

import jax.numpy as jnp

from linkjax._types import Scalar
from linkjax.kinematics._pose import margins, named_groups, pose, prepared
from linkjax.mechanism import Mechanism

OPEN = 1e-6  # a margin below minus this cannot be assembled; closer to zero there may be a change point


def shortfall(mechanism: Mechanism, name: str, side: str, phi: Scalar | float) -> str:
    """A phrase for messages: the distance of the pins of this group at the crank angle `phi` (rad) and the reach of its
    links, or its margin. Not for use under JAX transformations."""
    mechanism = prepared(mechanism)
    group, here = named_groups(mechanism)[name], pose(mechanism, jnp.asarray(phi))
    told = group.shortfall(side, mechanism.held_by(group), here.links, here.points)
    return told or f"its margin is {float(margins(mechanism, jnp.asarray(phi))[name][side].value):.3g}"


def not_assembled_at_start(mechanism: Mechanism) -> tuple[str, str] | None:
    """The first group that cannot be assembled at crank angle zero, and the side of its least margin; None if none."""
    for name, sides in margins(prepared(mechanism), jnp.zeros(())).items():
        side = min(sides, key=lambda side, sides=sides: float(sides[side].value), default=None)
        if side is not None and float(sides[side].value) < -OPEN:
            return name, side
    return None


def open_at_start(mechanism: Mechanism) -> str:
    """Which group cannot be assembled at crank angle zero, and why; "" if all can. Not for use under JAX
    transformations."""
    lost = not_assembled_at_start(mechanism)
    if lost is None:
        return ""
    name, side = lost
    return f"{name!r} cannot be assembled at crank angle zero ({side}): {shortfall(mechanism, name, side, 0.0)}"
