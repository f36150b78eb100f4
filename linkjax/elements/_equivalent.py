"""Equivalent coefficients of friction: grooves, curved seats, journals; and coefficients of materials.

Source: the textbook's chapter on friction, formulas (7-2) to (7-5), and its table 7-1.
"""

from __future__ import annotations

import math
import re
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array

from linkjax.elements._way import checked, refuse

BEARINGS = {"given": 1.0, "unworn": math.pi / 2, "run-in": 4 / math.pi}

MATERIALS = {  # static dry, static lubricated, kinetic dry, kinetic lubricated; None where the table has no value
    "steel-steel": ((0.15, 0.15), (0.10, 0.12), (0.10, 0.10), (0.05, 0.10)),
    "steel-cast iron": ((0.2, 0.3), None, (0.16, 0.18), (0.05, 0.15)),
    "steel-bronze": (None, (0.10, 0.15), (0.15, 0.18), (0.07, 0.07)),
    "cast iron-cast iron": (None, (0.15, 0.16), (0.15, 0.15), (0.07, 0.12)),
    "cast iron-bronze": ((0.28, 0.28), (0.16, 0.16), (0.15, 0.21), (0.07, 0.15)),
    "bronze-bronze": (None, None, (0.15, 0.20), (0.04, 0.10)),
    "leather-cast iron": (None, None, (0.30, 0.50), (0.12, 0.15)),
    "leather-steel": (None, None, (0.30, 0.50), (0.12, 0.15)),
    "rubber-cast iron": (None, None, (0.8, 0.8), (0.5, 0.5)),
}


def groove_friction(friction: Any, half_angle: Any) -> Array:
    """The equivalent coefficient of a wedge-shaped groove, f / sin θ (7-2), θ the half angle of the groove (rad).

    Raises `ValueError` for a negative coefficient, or an angle that is not above 0 and below 90°.
    """
    f, theta = checked("the groove", friction=friction, half_angle=half_angle)
    return f / jnp.sin(theta)


def seat_friction(friction: Any, factor: Any) -> Array:
    """The equivalent coefficient of a curved seat, k f; the `factor` k is between 1 and π/2, depending on how the
    pressure is distributed. Raises `ValueError` for a factor outside of that range, or a negative coefficient."""
    f, k = checked("the curved seat", friction=friction, factor=factor)
    refuse("the curved seat", "factor", k, lambda x: (x >= 1) & (x <= math.pi / 2), "a number from 1 to π/2")
    return k * f


def journal_friction(friction: Any, bearing: str = "unworn") -> Array:
    """The equivalent coefficient f₀ of a journal in its bearing.

    `bearing` is "unworn" (π/2 f, uniform pressure on half the circumference), "run-in" (4/π f, pressure as a cosine) or
    "given" (the coefficient is that of the journal already). Raises `ValueError` for a negative coefficient or another
    bearing.
    """
    (f,) = checked("the journal", friction=friction)
    if bearing not in BEARINGS:
        raise ValueError(f"bearing of the journal is {bearing!r}; write one of {', '.join(map(repr, BEARINGS))}")
    return BEARINGS[bearing] * f


def material_friction(material: str, *, lubricated: bool = False, static: bool = False) -> float:
    """The coefficient of friction of two materials, e.g. "steel-bronze" or "bronze-steel", from table 7-1; of a range
    the middle.

    Raises `ValueError` for a pair that the table does not have, or has no value of. The values for leather and rubber
    are the least certain ones.
    """
    pair = "-".join(part.strip() for part in re.split("[-–−]", material)).lower()
    turned = "-".join(reversed(pair.split("-")))
    row = MATERIALS.get(pair) or MATERIALS.get(turned)
    if row is None:
        raise ValueError(f"material {material!r} is not in the table; write one of {', '.join(MATERIALS)}")
    at = 2 * (not static) + lubricated
    if row[at] is None:
        what = f"{'static' if static else 'kinetic'} friction of {material!r}, {'lubricated' if lubricated else 'dry'}"
        raise ValueError(f"the table has no coefficient for the {what}; give friction as a number")
    low, high = row[at]
    return (low + high) / 2
