"""Whether wheels in gear are after the cycle where they began, as far as their turns are those of the crank."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from linkjax._types import known
from linkjax.groups import AbstractGroup, Coupling, Crank, Rack
from linkjax.mechanism import Mechanism, StructureError

WHOLE = 1e-9  # what a number of turns may be off a whole one
MOST = 1000  # cycles tried for the remedy


def check_turns(mechanism: Mechanism, cycle_turns: int) -> None:
    """Raise StructureError for wheels that are not where they began, and for racks that never come back."""
    crank, turns = mechanism.driver, {"frame": 0.0}
    if isinstance(crank, Crank):
        turns[crank.link] = float(cycle_turns * crank.turns) if crank.law is None else 0.0
    for group in mechanism.groups:
        couplings = [_plain(wheel.coupling()) for wheel in group.wheels()]
        if not couplings or None in couplings:
            continue
        rows = [row for row in couplings if row is not None]
        found = _solved(group, rows, turns)
        for link, count in found.items():
            if abs(count - round(count)) > WHOLE:
                whole = [k for k in range(1, MOST + 1) if all(_near(k * each / cycle_turns) for each in found.values())]
                problem = f"in {cycle_turns} turns of the crank {link!r} turns {count:.6g} times, so nothing repeats"
                remedy = f"write {whole[0]}" if whole else "choose a ratio of smaller whole numbers"
                raise StructureError("cycle_turns", problem, remedy)
        turns |= found
        if isinstance(group, Rack) and set(group.mates()) <= set(turns):
            count = turns[group.to] - turns[group.guide.on]
            if abs(count) > WHOLE:
                problem = f"{group.to!r} turns {count:.6g} times in a cycle, so the rack never comes back"
                raise StructureError(f"links.{group.link}", problem, "let a wheel move it that swings")


def _near(count: float) -> bool:
    return abs(count - round(count)) < WHOLE


def _plain(coupling: Coupling) -> dict[str, float] | None:
    """Factors of angles as plain numbers; None where they are traced, or those of many designs."""
    values = {name: known(factor) for name, factor in coupling.angles.items()}
    if any(value is None or value.ndim for value in values.values()):
        return None
    return {name: float(value) for name, value in values.items() if value is not None}


def _solved(group: AbstractGroup, rows: Sequence[Mapping[str, float]], turns: Mapping[str, float]) -> dict[str, float]:
    """Turns of links of the group, where those of the others settle them: racks come back, so their ways do not
    count."""
    unknown = list(dict.fromkeys(name for row in rows for name in row if name not in turns))
    if not unknown or not set(unknown) <= set(group.link_names()):
        return {}
    matrix = np.array([[row.get(name, 0.0) for name in unknown] for row in rows])
    right = -np.array([sum(factor * turns[name] for name, factor in row.items() if name in turns) for row in rows])
    counts, _, rank, _ = np.linalg.lstsq(matrix, right)
    return dict(zip(unknown, (float(count) for count in counts), strict=True)) if rank == len(unknown) else {}
