"""How the rates of links violate the pairs between them, where points lie at random or as told.

What holds at random places is what structure alone decides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from linkjax.groups._pairs import FRAME, Pair

GENERIC = 1e-9  # a singular value below this of the largest counts as none, where all places are drawn at random
Lies = Mapping[str, tuple[float, float, float]]


def taken(pair: Pair) -> int:
    """Degrees of freedom that a pair takes."""
    return 1 if pair.letter == "G" else 2


def place_name(pair: Pair) -> str:
    """What the place of a pair is filed under: pins at one point lie on one place."""
    return pair.name if pair.letter == "R" else f"{pair.name} of {pair.one}"


def rates(
    links: Sequence[str], pairs: Sequence[Pair], drive: Pair | None = None, lies: Lies | None = None
) -> np.ndarray:
    """How the rates of all links (x, y, angle each) violate the pairs, two rows each and one for wheels in gear; the
    last row is the rate of the drive. `lies` says where points and guides are (x, y, direction), by `place_name`; else
    they lie at random."""
    rng = np.random.default_rng(1)
    column = {name: 3 * i for i, name in enumerate(links)}
    spots: dict[str, tuple[float, float, float]] = dict(lies or {})
    along: dict[str, np.ndarray] = {}  # of every block on its guide

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
    """Rows that span what the matrix takes to zero."""
    _, sizes, right = np.linalg.svd(matrix)
    rank = int(np.sum(sizes > GENERIC * sizes[0])) if sizes.size else 0
    return right[rank:]


def bodies(links: Sequence[str], pairs: Sequence[Pair]) -> dict[str, str]:
    """For each link the first of those that cannot move against it, as the pairs between links hold them."""
    free = null_space(rates(links, pairs)) if pairs else np.eye(3 * len(links))
    each = free.T.reshape((len(links), 3, len(free)))
    found: dict[str, str] = {}
    for name, way in zip(links, each, strict=True):
        alike = (other for other, its in zip(links, each, strict=True) if np.abs(way - its).max() < GENERIC)
        found[name] = next(alike)
    return found
