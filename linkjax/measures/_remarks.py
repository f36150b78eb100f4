"""What the value of a measure means, in words."""

from __future__ import annotations

from linkjax.measures._forces import in_motion
from linkjax.measures._inertia import RATIO, STATIC
from linkjax.measures._registry import found_by, named


def measure_remark(name: str, value: float | None) -> str:
    """What the value of a measure means for an analysis, or why there is none; "" without a remark."""
    if value is None:
        return _missing(name)
    if name != RATIO or not value > STATIC:
        return ""
    return f"above {STATIC:g}: statics alone is not sufficient"


def _missing(name: str) -> str:
    head, at, angle = name.partition("@")
    if not named(name).motion:
        return ""
    other = f"{in_motion(head, True)}{at}{angle}"
    return "no actual motion" if found_by(other) is None else f"no actual motion; at constant speed: {other}"
