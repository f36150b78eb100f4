"""Springs and dampers between two points, as they are drawn."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from linkjax.loads import Damper, Spring
from linkjax.machine import Scene

COILS, LEAD, WIDE = 7, 0.2, 5.0  # half-waves, share of a straight end, half the width (typographic points)
SPRING = (
    ((0.0, 0.0, 0.0), (LEAD, 0.0, 0.0),
     *((LEAD + (1 - 2 * LEAD) * (k + 0.5) / COILS, 0.0, (-1) ** k * WIDE) for k in range(COILS)),
     (1 - LEAD, 0.0, 0.0), (1.0, 0.0, 0.0)),
)  # fmt: skip
DAMPER = (
    ((0.0, 0.0, 0.0), (0.5, 2.0, 0.0)),
    ((0.5, 2.0, -3.5), (0.5, 2.0, 3.5)),
    ((0.5, -7.0, WIDE), (0.5, 7.0, WIDE), (0.5, 7.0, -WIDE), (0.5, -7.0, -WIDE)),
    ((0.5, 7.0, 0.0), (1.0, 0.0, 0.0)),
)


class Tie(NamedTuple):
    """A spring or damper: its name, the points of its ends, and its lines. Every place on a line has its share of the
    way from end to end, a distance along it, and one to its left (typographic points)."""

    text: str
    ends: tuple[str, str]
    lines: tuple[tuple[tuple[float, float, float], ...], ...]

    def drawn(self, at: dict[str, np.ndarray], unit: float) -> list[np.ndarray]:
        """Its lines, each of shape (places, 2), for positions of points and the length of a typographic point."""
        start, end = (at[point] for point in self.ends)
        way = end - start
        t = way / (math.hypot(*way) or 1.0)
        n = np.array([-t[1], t[0]])
        return [np.stack([start + f * way + unit * (d * t + v * n) for f, d, v in line]) for line in self.lines]


def ties_of(scene: Scene) -> tuple[Tie, ...]:
    """The springs and dampers between two points."""
    drawn = {Spring: SPRING, Damper: DAMPER}
    return tuple(Tie(load.name, (load.point, load.to_point), drawn[type(load)])
                 for load in scene.loads if isinstance(load, Spring | Damper))  # fmt: skip
