"""Mobility of a chain of links and pairs, its redundant pairs, its unconstrained links, and its Assur groups.

Source: Grübler's and Chebyshev's formula for planar chains of links with lower pairs, and the canonical form of a
system of equations (Dulmage and Mendelsohn, Coverings of bipartite graphs, 1958), whose blocks are the Assur groups.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from linkjax.groups import FRAME
from linkjax.topology._pairs import Pair
from linkjax.topology._rates import GENERIC, Lies, null_space, rates, taken


def mobility(links: int, pairs: Sequence[Pair]) -> int:
    """Degrees of freedom W = 3 n - 2 p - h of a planar chain of n moving links with p lower pairs and h gear pairs
    (Chebyshev, Grübler)."""
    return 3 * links - sum(taken(pair) for pair in pairs)


def counted(links: int, pairs: Sequence[Pair]) -> str:
    """The formula of `mobility` with its numbers."""
    gears = sum(pair.letter == "G" for pair in pairs)
    lower, found = len(pairs) - gears, mobility(links, pairs)
    if gears:
        return f"W = 3 n - 2 p - h = 3·{links} - 2·{lower} - {gears} = {found}"
    return f"W = 3 n - 2 p = 3·{links} - 2·{lower} = {found}"


class Freedom(NamedTuple):
    """Freedom of a chain of general dimensions: degrees of freedom, pairs of which some are redundant, links that can
    still move with the drive held, and whether the drive moves the chain."""

    degrees: int
    redundant: tuple[Pair, ...]
    loose: tuple[str, ...]
    driven: bool


def shared_forces(links: Sequence[str], pairs: Sequence[Pair], lies: Lies) -> tuple[Pair, ...]:
    """Pairs whose forces are statically indeterminate in this position: a force in one of them can be taken by
    others."""
    spare = null_space(rates(links, pairs, lies=lies).T)
    return _touched(pairs, spare)


def _touched(pairs: Sequence[Pair], spare: np.ndarray) -> tuple[Pair, ...]:
    """Pairs that take part in redundancy vectors (rows over the equations of the pairs)."""
    owner = np.repeat(np.arange(len(pairs)), [taken(pair) for pair in pairs])
    part = np.max(np.abs(spare), axis=0, initial=0.0)
    return tuple(pair for k, pair in enumerate(pairs) if part[owner == k].max() > GENERIC)


def freedom(links: Sequence[str], pairs: Sequence[Pair], drive: Pair | None = None) -> Freedom:
    """Freedom of a chain of general dimensions."""
    matrix = rates(links, pairs)
    free, spare = null_space(matrix), null_space(matrix.T)
    held = matrix if drive is None else rates(links, pairs, drive)
    still = np.max(np.abs(null_space(held)), axis=0, initial=0.0).reshape((-1, 3)).max(axis=1, initial=0.0)
    return Freedom(
        len(free),
        _touched(pairs, spare),
        tuple(name for name, part in zip(links, still, strict=True) if part > GENERIC),
        drive is None or len(null_space(held)) < len(free),
    )


def blocks(links: Sequence[str], pairs: Sequence[Pair], drive: Pair | None = None) -> list[tuple[str, ...]]:
    """The links divided into the smallest parts that can be solved one after the other, in the order of attachment;
    the parts that the drive moves come as early as possible.

    The chain must have one degree of freedom, removed by the drive (zero without a drive), and no redundant pair.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

    pattern = np.abs(rates(links, pairs, drive)) > 0
    row_of = maximum_bipartite_matching(csr_array(pattern), perm_type="row")  # the equation of each unknown
    count, needs = len(links), np.zeros((len(links), len(links)), bool)
    for unknown, row in enumerate(row_of):
        needs[unknown // 3] |= pattern[row].reshape((count, 3)).any(axis=1)
    number, part = connected_components(csr_array(needs), connection="strong")
    ends = () if drive is None else drive.ends
    order, first = [], {part[links.index(end)] for end in ends if end != FRAME}
    while len(order) < number:
        ready = [k for i, k in enumerate(part) if k not in order and i == list(part).index(k)
                 and {part[j] for j in np.flatnonzero(needs[part == k].any(axis=0))} <= {*order, k}]  # fmt: skip
        order.append(min(ready, key=lambda k: k not in first))
    return [tuple(name for name, k in zip(links, part, strict=True) if k == this) for this in order]
