"""The structure of a mechanism: mobility, Assur groups, structural formula."""

from __future__ import annotations

from typing import NamedTuple

from linkjax.groups import FRAME, Pair
from linkjax.mechanism._freedom import counted, mobility
from linkjax.mechanism._mechanism import Mechanism


class Part(NamedTuple):
    """The driver or an Assur group: its links, its class and kind (II1), its pairs as letters (RRR), the pairs by which
    it is attached and those inside it."""

    links: tuple[str, ...]
    kind: str
    letters: str
    outer: tuple[Pair, ...]
    inner: tuple[Pair, ...]


class Structure(NamedTuple):
    """Moving links and pairs, degrees of freedom W = 3 n - 2 p - h, and the parts in their order of attachment."""

    links: tuple[str, ...]
    pairs: tuple[Pair, ...]
    mobility: int
    parts: tuple[Part, ...]

    def mobility_told(self) -> str:
        """The formula of Chebyshev and Grübler with its numbers."""
        return counted(len(self.links), self.pairs)

    def formula(self, letters: bool = False, numbers: bool = False) -> str:
        """Structural formula, e.g. `I1(crank) → II2(rod, slider)`; with letters `R(crank) → RRP(rod, slider)`; with
        numbers of links, the frame's zero among them, `I1(0,1) → II2(2,3)`."""
        shown = {name: str(i) if numbers else name for i, name in enumerate(self.links, 1)}
        parts = []
        for part in self.parts:
            names = [shown[name] for name in part.links]
            if numbers and part is self.parts[0]:
                names = ["0"] * any(FRAME in pair.ends for pair in part.outer) + names
            parts.append(f"{part.letters if letters else part.kind}({(',' if numbers else ', ').join(names)})")
        return " → ".join(parts)


def structure(mechanism: Mechanism) -> Structure:
    """Links, pairs, mobility and groups of a mechanism."""
    owners, parts = mechanism.owners(), []
    for group in mechanism.groups:
        kind, letters = group.classified()
        pairs = [Pair(j.letter, j.name, j.link, j.by or owners[j.point])
                 for j in group.joints() if not j.name.endswith(".drive")]  # fmt: skip
        inner = [pair for pair in pairs if set(pair.ends) <= set(group.link_names())]
        outer = [pair for pair in pairs if pair not in inner]
        parts.append(Part(group.link_names(), kind, letters, tuple(outer), tuple(inner)))
    every = tuple(pair for part in parts for pair in (*part.outer, *part.inner))
    return Structure(mechanism.link_names, every, mobility(len(mechanism.links), every), tuple(parts))
