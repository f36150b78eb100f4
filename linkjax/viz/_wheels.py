"""Drawing of gears and pulleys: pitch circles with a spoke that shows the rotation, and the strands of belts."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from linkjax.groups import FRAME
from linkjax.machine import Scene


class Wheel(NamedTuple):
    """Pitch circle of a link, or of the frame, about a point; radius in m."""

    link: str
    point: str
    radius: float


class Strands(NamedTuple):
    """A belt around two pulleys."""

    one: Wheel
    other: Wheel
    crossed: bool

    def ends(self, a: np.ndarray, b: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Ends of the two straight strands, at the points of tangency; `a` and `b` are the centres of the pulleys."""
        span = complex(*(b - a))
        far = -self.other.radius if self.crossed else self.other.radius
        lean = math.acos(max(-1.0, min(1.0, (self.one.radius - far) / (abs(span) or 1.0))))
        found = []
        for sign in (1, -1):
            out = span / (abs(span) or 1.0) * complex(math.cos(lean), sign * math.sin(lean))
            touch = np.array([out.real, out.imag])
            found.append((a + self.one.radius * touch, b + far * touch))
        return found


def wheels_of(scene: Scene, paths) -> tuple[tuple[Wheel, ...], tuple[Strands, ...]]:
    """Gears, pulleys and belts of a machine, from the paths of its points (each of shape (2, angles))."""
    wheels, belts = [], []

    def apart(one: str, other: str) -> float:
        gap = np.hypot(*(paths(other) - paths(one)))
        return float(gap[np.isfinite(gap)].mean()) if np.isfinite(gap).any() else 0.0

    for wheel in (wheel for group in scene.mechanism.groups for wheel in group.wheels()):
        circles = [Wheel(link, point, radius) for link, point, radius in wheel.pitch_circles(apart)]
        wheels += circles
        if wheel.crossed() is not None:
            belts.append(Strands(circles[0], circles[1], wheel.crossed()))
    return tuple(dict.fromkeys(wheels)), tuple(belts)


def draw_wheels(wheels, belts, at, colours, ink: str) -> list[Artist]:
    """Chain-dotted circles with a spoke, in the colours of their links, and the strands of belts."""
    artists: list[Artist] = []
    for wheel in wheels:
        colour, centre = colours.get(wheel.link, ink), at[wheel.point]
        place = float(centre[0]), float(centre[1])
        artists.append(Circle(place, wheel.radius, fill=False, edgecolor=colour, linewidth=1.0, zorder=2.6,
                              linestyle=(0, (9, 2, 2, 2))))  # fmt: skip
        if wheel.link != FRAME:
            way = at[wheel.link] / (math.hypot(*at[wheel.link]) or 1.0)
            artists.append(Line2D(*np.stack([centre, centre + wheel.radius * way], axis=1), color=colour,
                                  linewidth=1.0, zorder=2.6))  # fmt: skip
    for belt in belts:
        for ends in belt.ends(at[belt.one.point], at[belt.other.point]):
            artists.append(Line2D(*np.stack(ends, axis=1), color=ink, linewidth=1.0, zorder=2.5))
    return artists
