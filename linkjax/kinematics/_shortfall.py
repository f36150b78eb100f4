"""The shortfall of a group that cannot be assembled, in its own lengths."""

from __future__ import annotations

import jax.numpy as jnp

from linkjax._types import Scalar
from linkjax.groups import ReferencePath
from linkjax.kinematics._pose import Prepared, margins, pose, prepared
from linkjax.mechanism import Mechanism, links_of

OPEN = 1e-6  # a margin below minus this cannot be assembled; closer to zero there may be a change point


def shortfall(mechanism: Mechanism | Prepared, name: str, side: str, phi: Scalar | float) -> str:
    """A phrase for messages: the distance of the pins of this group at the crank angle `phi` (rad) and the reach of its
    links, or its margin. Not for use under JAX transformations."""
    ready = prepared(mechanism)
    (group, path), here = ready.along()[name], pose(ready, jnp.asarray(phi))
    told = group.shortfall(side, links_of(ready.mechanism, group), here.links, here.points)
    if isinstance(path, ReferencePath) and not bool(path.ends()):
        told = ""
    return told or f"its margin is {float(margins(ready, jnp.asarray(phi))[name][side].value):.3g}"


def not_assembled_at_start(mechanism: Mechanism | Prepared) -> tuple[str, str] | None:
    """The first group that cannot be assembled at crank angle zero, and the side of its least margin; None if none."""
    for name, sides in margins(mechanism, jnp.zeros(())).items():
        side = min(sides, key=lambda side, sides=sides: float(sides[side].value), default=None)
        if side is not None and float(sides[side].value) < -OPEN:
            return name, side
    return None


def open_at_start(mechanism: Mechanism | Prepared) -> str:
    """Which group cannot be assembled at crank angle zero, and why; "" if all can. Not for use under JAX
    transformations."""
    mechanism = prepared(mechanism)
    lost = not_assembled_at_start(mechanism)
    if lost is None:
        return ""
    name, side = lost
    return f"{name!r} cannot be assembled at crank angle zero ({side}): {shortfall(mechanism, name, side, 0.0)}"
