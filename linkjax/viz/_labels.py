"""Placement of names beside points, with the least overlap."""

from __future__ import annotations

import math

import numpy as np

Box = tuple[float, float, float, float]


def place_labels(
    names: list[str], spots: np.ndarray, obstacles: np.ndarray, faint: np.ndarray, *, size: float, limits: Box
) -> list[tuple[float, float]]:
    """Centres of the names; all lengths in typographic points.

    `spots` are the named points (n by 2), `obstacles` samples of what must not be covered (m by 2), `faint` samples of
    what may be covered if necessary. Each name in turn gets the direction and distance with the least overlap (greedy).
    """
    chosen: list[tuple[float, float]] = []
    boxes: list[Box] = []
    for name, spot in zip(names, spots, strict=True):
        half = np.array([0.31 * size * len(name) + 1.0, 0.55 * size])
        best, place, taken = math.inf, (float(spot[0]), float(spot[1])), (0.0, 0.0, 0.0, 0.0)
        for step, turn in ((step, turn) for step in (7.5, 11.0, 15.0, 20.0) for turn in range(16)):
            direction = np.array([math.cos(turn * math.pi / 8), math.sin(turn * math.pi / 8)])
            centre = spot + direction * (step + np.abs(direction) @ half)
            box = (*(centre - half), *(centre + half))
            cost = inside(obstacles, grown(box, 4.5)) + 0.12 * inside(faint, box) + 0.25 * step + 0.02 * (turn % 4)
            cost += sum(60.0 for other in boxes if overlap(box, other))
            outside = box[0] < limits[0] or box[1] < limits[1] or box[2] > limits[2] or box[3] > limits[3]
            cost += 40.0 if outside else 0.0
            if cost < best:
                best, place, taken = cost, (float(centre[0]), float(centre[1])), box
        chosen.append(place)
        boxes.append(taken)
    return chosen


def inside(points: np.ndarray, box: Box) -> int:
    """Number of points inside a box (left, bottom, right, top)."""
    if not points.size:
        return 0
    x, y = points[:, 0], points[:, 1]
    return int(np.count_nonzero((x > box[0]) & (x < box[2]) & (y > box[1]) & (y < box[3])))


def grown(box: Box, by: float) -> Box:
    """A box with a margin added."""
    return box[0] - by, box[1] - by, box[2] + by, box[3] + by


def overlap(one: Box, two: Box) -> bool:
    """Whether two boxes overlap."""
    return bool(one[0] < two[2] and two[0] < one[2] and one[1] < two[3] and two[1] < one[3])


def along(start: np.ndarray, end: np.ndarray, step: float = 2.5) -> np.ndarray:
    """Points on a line, `step` apart."""
    count = max(2, int(math.hypot(*(end - start)) / step) + 1)
    return start + np.linspace(0, 1, count)[:, None] * (end - start)
