"""What a chain of links and pairs can do: mobility, redundant pairs, loose links, and the parts it falls into.

Source: Grübler's and Chebyshev's formula for plane chains of links with lower pairs, and the canonical form of a system
of equations (Dulmage and Mendelsohn, Coverings of bipartite graphs, 1958), whose blocks are the Assur groups.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from linkjax.groups import FRAME, Pair

GENERIC = 1e-9  # a singular value below this of the largest counts as none, where all places are drawn at random


def mobility(links: int, pairs: Sequence[Pair]) -> int:
    """Degrees of freedom W = 3 n - 2 p - h of a plane chain of n moving links with p lower pairs and h pairs of wheels
    in gear (Chebyshev, Grübler)."""
    return 3 * links - sum(taken(pair) for pair in pairs)


def counted(links: int, pairs: Sequence[Pair]) -> str:
    """That formula with its numbers."""
    gears = sum(pair.letter == "G" for pair in pairs)
    lower, found = len(pairs) - gears, mobility(links, pairs)
    if gears:
        return f"W = 3 n - 2 p - h = 3·{links} - 2·{lower} - {gears} = {found}"
    return f"W = 3 n - 2 p = 3·{links} - 2·{lower} = {found}"


def taken(pair: Pair) -> int:
    """Degrees of freedom that a pair takes."""
    return 1 if pair.letter == "G" else 2


class Freedom(NamedTuple):
    """What a chain of general dimensions can do: degrees of freedom, pairs of which some are redundant, and links that
    still move when the drive is held."""

    degrees: int
    redundant: tuple[Pair, ...]
    loose: tuple[str, ...]
    driven: bool


Lies = Mapping[str, tuple[float, float, float]]


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


def _null_space(matrix: np.ndarray) -> np.ndarray:
    """Rows that span what the matrix takes to zero."""
    _, sizes, right = np.linalg.svd(matrix)
    rank = int(np.sum(sizes > GENERIC * sizes[0])) if sizes.size else 0
    return right[rank:]


def shared_forces(links: Sequence[str], pairs: Sequence[Pair], lies: Lies) -> tuple[Pair, ...]:
    """Pairs whose forces the balance of the links does not tell, as the points and guides lie: a force in one of them
    can be taken by others."""
    spare = _null_space(rates(links, pairs, lies=lies).T)
    return _touched(pairs, spare)


def _touched(pairs: Sequence[Pair], spare: np.ndarray) -> tuple[Pair, ...]:
    """Pairs that take part in what is spare (rows over their equations)."""
    owner = np.repeat(np.arange(len(pairs)), [taken(pair) for pair in pairs])
    part = np.max(np.abs(spare), axis=0, initial=0.0)
    return tuple(pair for k, pair in enumerate(pairs) if part[owner == k].max() > GENERIC)


def freedom(links: Sequence[str], pairs: Sequence[Pair], drive: Pair | None = None) -> Freedom:
    """What a chain of general dimensions can do."""
    matrix = rates(links, pairs)
    free, spare = _null_space(matrix), _null_space(matrix.T)
    held = matrix if drive is None else rates(links, pairs, drive)
    still = np.max(np.abs(_null_space(held)), axis=0, initial=0.0).reshape((-1, 3)).max(axis=1, initial=0.0)
    return Freedom(
        len(free),
        _touched(pairs, spare),
        tuple(name for name, part in zip(links, still, strict=True) if part > GENERIC),
        drive is None or len(_null_space(held)) < len(free),
    )


def blocks(links: Sequence[str], pairs: Sequence[Pair], drive: Pair) -> list[tuple[str, ...]]:
    """The links cut into the smallest parts that can be solved one after the other, in the order of attachment, those
    that the drive moves first where nothing else must be there before.

    The chain must have one degree of freedom, which the drive takes, and no redundant pair.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

    pattern = np.abs(rates(links, pairs, drive)) > 0
    row_of = maximum_bipartite_matching(csr_array(pattern), perm_type="row")  # the equation that each unknown is for
    count, needs = len(links), np.zeros((len(links), len(links)), bool)
    for unknown, row in enumerate(row_of):
        needs[unknown // 3] |= pattern[row].reshape((count, 3)).any(axis=1)
    number, part = connected_components(csr_array(needs), connection="strong")
    order, first = [], {part[links.index(end)] for end in drive.ends if end != FRAME}
    while len(order) < number:
        ready = [k for i, k in enumerate(part) if k not in order and i == list(part).index(k)
                 and {part[j] for j in np.flatnonzero(needs[part == k].any(axis=0))} <= {*order, k}]  # fmt: skip
        order.append(min(ready, key=lambda k: k not in first))
    return [tuple(name for name, k in zip(links, part, strict=True) if k == this) for this in order]
