"""How the rates of links violate the pairs between them, for random or given positions of the points.

What holds at random positions depends on the structure alone: special dimensions neither hide nor simulate a mobility.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from linkjax.groups import FRAME
from linkjax.topology._pairs import Pair

GENERIC = 1e-9  # smaller singular values, relative to the largest, count as zero at random positions
Lies = Mapping[str, tuple[float, float, float]]


def taken(pair: Pair) -> int:
    """Degrees of freedom that a pair removes."""
    return 1 if pair.letter == "G" else 2


def place_name(pair: Pair) -> str:
    """The key of a pair's position: pins at one point share it."""
    return pair.name if pair.letter == "R" else f"{pair.name} of {pair.one}"


def rates(
    links: Sequence[str], pairs: Sequence[Pair], drive: Pair | None = None, lies: Lies | None = None
) -> np.ndarray:
    """The matrix from the rates of all links (x, y, angle each) to the violations of the pairs.

    Each pair has two rows, gears in mesh have one; the last row is the rate of the drive. `lies` gives the positions of
    points and guides (x, y, direction) by `place_name`; other positions are random.
    """
    rng = np.random.default_rng(1)
    column = {name: 3 * i for i, name in enumerate(links)}
    spots: dict[str, tuple[float, float, float]] = dict(lies or {})
    along: dict[str, np.ndarray] = {}  # rate of every block on its guide

    def row(pair: Pair, at_one: Sequence[float]) -> np.ndarray:
        found = np.zeros(3 * len(links))
        for sign, end in zip((1, -1), pair.ends, strict=True):
            if end != FRAME:
                found[column[end] : column[end] + 3] += sign * np.asarray(at_one)
        return found

    def spin(link: str, factor: float) -> np.ndarray:
        return factor * row(Pair("R", "", link, FRAME), (0.0, 0.0, 1.0))

    rows = []
    for pair in pairs:
        if pair.letter == "G":
            ratio = rng.uniform(0.3, 0.9)
            both = spin(pair.other, -ratio) + spin(pair.on, ratio)
            rows.append(both + (along[pair.one] if pair.rack else spin(pair.one, 1.0) - spin(pair.on, 1.0)))
            continue
        x, y, lean = spots.setdefault(place_name(pair), tuple(rng.uniform(-3, 3, 3)))
        c, s = np.cos(lean), np.sin(lean)
        if pair.letter == "R":
            rows += [row(pair, (1.0, 0.0, -y)), row(pair, (0.0, 1.0, x))]
        else:
            rows += [row(pair, (0.0, 0.0, 1.0)), row(pair, (-s, c, s * y + c * x))]
            along[pair.one] = row(pair, (c, s, s * x - c * y))
    if drive is not None:
        rows.append(row(drive, (0.0, 0.0, 1.0)) if drive.letter == "R" else along[drive.one])
    return np.array(rows).reshape((-1, 3 * len(links)))


def null_space(matrix: np.ndarray) -> np.ndarray:
    """Rows that span the null space of the matrix."""
    _, sizes, right = np.linalg.svd(matrix)
    rank = int(np.sum(sizes > GENERIC * sizes[0])) if sizes.size else 0
    return right[rank:]


def bodies(links: Sequence[str], pairs: Sequence[Pair]) -> dict[str, str]:
    """For each link the first link relative to which it cannot move, by the pairs between the links."""
    free = null_space(rates(links, pairs)) if pairs else np.eye(3 * len(links))
    each = free.T.reshape((len(links), 3, len(free)))
    found: dict[str, str] = {}
    for name, way in zip(links, each, strict=True):
        alike = (other for other, its in zip(links, each, strict=True) if np.abs(way - its).max() < GENERIC)
        found[name] = next(alike)
    return found
