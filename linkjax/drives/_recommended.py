"""The coefficient of speed fluctuation δ that is recommended for a kind of machine."""

from __future__ import annotations

from typing import NamedTuple

from linkjax._units import nearest

RECOMMENDED_DELTA_SOURCE = (
    "table 26-1, required coefficient of steadiness, p. 509 of the chapter Flywheels of a textbook of machine design "
    "(Scribd document 421582869)"
)


class RecommendedDelta(NamedTuple):
    """Recommended largest coefficient of speed fluctuation δ of a kind of machine, between `low` and `high`, by the way
    in which it is driven: "belt", "gears", "coupling" (flexible), or "direct"."""

    low: float
    high: float
    drive: str


# the source has Cf = 1/m with the coefficient of steadiness m: 5, 7 to 10, 20 to 25, 30, 40 to 50, 50 to 65, 35, ...
RECOMMENDED_DELTA: dict[str, RecommendedDelta] = {
    "hammer": RecommendedDelta(0.2, 0.2, "belt"),
    "crusher": RecommendedDelta(0.2, 0.2, "belt"),
    "punch press": RecommendedDelta(0.2, 0.2, "belt"),
    "concrete mixer": RecommendedDelta(0.1, 0.143, "belt"),
    "excavator": RecommendedDelta(0.1, 0.143, "belt"),
    "compressor": RecommendedDelta(0.1, 0.143, "belt"),
    "pump": RecommendedDelta(0.04, 0.05, "coupling"),
    "shears": RecommendedDelta(0.04, 0.05, "coupling"),
    "metalworking machine": RecommendedDelta(0.0333, 0.0333, "belt"),
    "woodworking machine": RecommendedDelta(0.0333, 0.0333, "belt"),
    "flour mill": RecommendedDelta(0.02, 0.025, "belt"),
    "paper mill": RecommendedDelta(0.02, 0.025, "belt"),
    "textile machine": RecommendedDelta(0.02, 0.025, "belt"),
    "compressor with gears": RecommendedDelta(0.02, 0.02, "gears"),
    "pump with gears": RecommendedDelta(0.02, 0.02, "gears"),
    "spinning machine": RecommendedDelta(0.015, 0.02, "belt"),
    "DC generator with belt": RecommendedDelta(0.029, 0.029, "belt"),
    "DC generator": RecommendedDelta(0.0143, 0.0143, "direct"),
    "AC generator with belt": RecommendedDelta(0.0167, 0.0167, "belt"),
    "AC generator": RecommendedDelta(0.01, 0.01, "direct"),
}


def recommended_delta(kind: str) -> RecommendedDelta:
    """The recommended largest δ of a kind of machine, one of `RECOMMENDED_DELTA`, e.g. "pump". A `target_delta` below
    `high` is usual, below `low` on the safe side. Raises `ValueError` for a kind that is not in the table.

    >>> recommended_delta("pump").high
    0.05

    Source: see `RECOMMENDED_DELTA_SOURCE`.
    """
    if kind not in RECOMMENDED_DELTA:
        remedy = nearest(kind, list(RECOMMENDED_DELTA))
        raise ValueError(f"there is no recommended δ for {kind!r}; {remedy}")
    return RECOMMENDED_DELTA[kind]
