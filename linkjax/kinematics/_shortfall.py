"""The shortfall of a dyad that cannot be assembled, in its own lengths."""

from __future__ import annotations

import jax.numpy as jnp

from linkjax._types import Scalar
from linkjax.groups import RPR, RRP, RRR, ReferencePath
from linkjax.kinematics._pose import Prepared, margins, pose, prepared
from linkjax.mechanism import Mechanism, links_of

OPEN = 1e-6  # a margin below minus this cannot be assembled; closer to zero there may be a change point


def shortfall(mechanism: Mechanism | Prepared, name: str, side: str, phi: Scalar | float) -> str:
    """A phrase for messages: the distance of the pins of this group at the crank angle `phi` (rad) and the reach of its
    links, or the margin of a group of another kind. Not for use under JAX transformations."""
    ready = prepared(mechanism)
    (group, path), here = ready.along()[name], pose(ready, jnp.asarray(phi))
    links, points = links_of(ready.mechanism, group), here.points
    if isinstance(group, RRR):
        away = float(jnp.sqrt((points[group.to].r - points[group.from_].r).squared()))
        one, two = (f"{link!r} ({float(links[link].length):.4g} m)" for link in group.links)
        pins = f"its pins {group.from_!r} and {group.to!r} are {away:.4g} m apart"
        far = side == "stretched"
        return f"{pins}, and {one} and {two} {'do not reach that far' if far else 'differ in length by more'}"
    if isinstance(group, RRP):
        off = abs(float(group.guide.line(here.links, points).height(points[group.from_]).value))
        rod = f"{group.link!r} ({float(links[group.link].length):.4g} m) does not reach that far"
        return f"its pin {group.from_!r} is {off:.4g} m off the path of {group.end!r}, and {rod}"
    if isinstance(group, RPR):
        away = float(jnp.sqrt((points[group.from_].r - points[group.about].r).squared()))
        offset = f"less than its offset of {abs(float(group.offset)):.4g} m"
        return f"its pins {group.about!r} and {group.from_!r} are {away:.4g} m apart, {offset}"
    if side == "loops" and isinstance(path, ReferencePath) and bool(path.ends()):
        return "its loops do not close there, or only in another assembly mode"
    return f"its margin is {float(margins(ready, jnp.asarray(phi))[name][side].value):.3g}"


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
