"""Whether gears return to their initial positions after the cycle, as far as the crank alone determines them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from linkjax._types import known
from linkjax.groups import AbstractGroup
from linkjax.mechanism import Mechanism, StructureError

WHOLE = 1e-9  # largest difference of a number of turns from an integer
MOST = 1000  # cycles tried for the remedy


def check_turns(mechanism: Mechanism, cycle_turns: int) -> None:
    """Raise `StructureError` if a gear does not return to its initial position after the cycle, or a rack does not."""
    crank, turns = mechanism.driver, {"frame": 0.0}
    if (sense := crank.shaft()) is not None:
        turns[mechanism.driving_link] = 0.0 if mechanism.prescribed else float(cycle_turns * sense)
    for group in mechanism.groups:
        rows = [_angles(wheel) for wheel in group.wheels()]
        if all(row is not None for row in rows):
            turns |= _solved(group, [row for row in rows if row is not None], turns)
    for link, count in turns.items():
        if abs(count - round(count)) > WHOLE:
            whole = [k for k in range(1, MOST + 1) if all(_near(k * each / cycle_turns) for each in turns.values())]
            within = f"within cycle_turns = {cycle_turns} (it turns {count:.6g} times)"
            problem = f"{link!r} does not return to its initial position {within}"
            remedy = f"write cycle_turns = {whole[0]}" if whole else "choose a ratio of smaller integers"
            raise StructureError("cycle_turns", problem, remedy)


def _near(count: float) -> bool:
    return abs(count - round(count)) < WHOLE


def _angles(wheel: Any) -> dict[str, float] | None:
    """Factors of the angles in the constraint of a gear, rack or pinion, scaled to a maximum of one, as plain numbers;
    None if they are traced or batched."""
    values = {name: known(factor) for name, factor in wheel.coupling().angles.items()}
    if any(value is None or value.ndim for value in values.values()):
        return None
    factors = {name: float(value) for name, value in values.items() if value is not None}
    most = max(abs(factor) for factor in factors.values())
    return {name: factor / most for name, factor in factors.items()}


def _solved(group: AbstractGroup, rows: Sequence[Mapping[str, float]], turns: Mapping[str, float]) -> dict[str, float]:
    """Numbers of turns of the group's links, if those of other links determine them. Racks return, so their travel is
    taken as zero."""
    unknown = list(dict.fromkeys(name for row in rows for name in row if name not in turns))
    if not rows or not set(unknown) <= set(group.link_names()):
        return {}
    matrix = np.array([[row.get(name, 0.0) for name in unknown] for row in rows]).reshape(len(rows), len(unknown))
    right = -np.array([sum(factor * turns[name] for name, factor in row.items() if name in turns) for row in rows])
    racks = [i for i, wheel in enumerate(group.wheels()) if wheel.sliding()]
    gears = [i for i in range(len(rows)) if i not in racks]
    counts, _, rank, _ = np.linalg.lstsq(matrix[gears], right[gears])
    if rank < len(unknown):
        counts, _, rank, _ = np.linalg.lstsq(matrix, right)
    for i in racks:
        rack, left = group.wheels()[i], float(matrix[i] @ counts - right[i])
        if abs(left) > WHOLE:
            problem = f"{rack.to!r} turns {-rack.side * left:.6g} times in a cycle, so the rack does not return"
            raise StructureError(f"links.{rack.link}", problem, "drive it by an oscillating gear")
    return dict(zip(unknown, (float(count) for count in counts), strict=True)) if rank == len(unknown) else {}
