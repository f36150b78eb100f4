"""What an analysis and its scene say in words, on the screen and in the report alike."""

from __future__ import annotations

from linkjax._display import NONE, Numbers
from linkjax.loads import AbstractLoad, Force, OpposingForce, OpposingTorque, Torque


def peak_unit(name: str) -> str:
    """SI unit of a peak, by its name."""
    turning = not name.startswith("reaction.") and any(word in name for word in ("torque", "moment"))
    return "N·m" if turning else "N"


def load_size(show: Numbers, load: AbstractLoad) -> str:
    """How large a load is, and how it is directed."""
    if isinstance(load, Force):
        return show.place((load.force.x, load.force.y), "N")
    if isinstance(load, OpposingForce):
        return f"{show.shown(load.magnitude, 'N')} against the motion"
    if isinstance(load, Torque):
        return show.shown(load.torque, "N·m")
    if isinstance(load, OpposingTorque):
        return f"{show.shown(load.magnitude, 'N·m')} against the rotation"
    return NONE
