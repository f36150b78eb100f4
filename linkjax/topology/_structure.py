"""The structure of a mechanism: mobility, Assur groups, structural formula."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from linkjax.groups import FRAME, AbstractGroup
from linkjax.topology._class import class_of
from linkjax.topology._freedom import counted, mobility
from linkjax.topology._pairs import Pair, pairs_of, parted


class Part(NamedTuple):
    """The driver or an Assur group: its links, its class and kind (II1), its pairs as letters (RRR), its outer and
    inner pairs, and the number of the last part that moves it (None for a part that does not move)."""

    links: tuple[str, ...]
    kind: str
    letters: str
    outer: tuple[Pair, ...]
    inner: tuple[Pair, ...]
    moved_by: int | None


class Structure(NamedTuple):
    """Moving links and pairs, degrees of freedom W = 3 n - 2 p - h, and the parts in their order of attachment."""

    links: tuple[str, ...]
    pairs: tuple[Pair, ...]
    mobility: int
    parts: tuple[Part, ...]

    def mobility_formula(self) -> str:
        """The formula of Chebyshev and Grübler with its numbers, as a string."""
        return counted(len(self.links), self.pairs)

    def formula(self, letters: bool = False, numbers: bool = False) -> str:
        """Structural formula, e.g. `I1(crank) → II2(rod, slider)`; with letters `R(crank) → RRP(rod, slider)`; with
        numbers of links (0 is the frame) `I1(0,1) → II2(2,3)`.

        An arrow leads to a part from the last part that moves it. Several parts moved by one are in braces:
        `I1(0,1) → {II2(2,4); II2(3,5)}`. Parts that do not move follow after a semicolon.
        """
        shown = {name: str(i) if numbers else name for i, name in enumerate(self.links, 1)}

        def told(number: int) -> str:
            part = self.parts[number]
            names = [shown[name] for name in part.links]
            if numbers and number == 0:
                names = ["0"] * any(FRAME in pair.ends for pair in part.outer) + names
            here = f"{part.letters if letters else part.kind}({(',' if numbers else ', ').join(names)})"
            next_ones = [told(i) for i, other in enumerate(self.parts) if other.moved_by == number]
            behind = "; ".join(next_ones) if len(next_ones) < 2 else f"{{{'; '.join(next_ones)}}}"
            return f"{here} → {behind}" if behind else here

        return "; ".join(told(i) for i, part in enumerate(self.parts) if part.moved_by is None)


def structure_of(links: Sequence[str], groups: Sequence[AbstractGroup], owners: Mapping[str, str]) -> Structure:
    """Links, pairs, mobility and parts of groups in their order, with the link that each point belongs to."""
    parts: list[Part] = []
    moving: dict[str, int] = {}  # the number of the part of each moving link
    for number, group in enumerate(groups):
        (kind, letters), pairs = class_of(group), pairs_of(group, owners)
        outer, inner = parted(group.link_names(), pairs)
        by = [moving[end] for pair in outer for end in pair.ends if end in moving]
        if by or number == 0:
            moving |= dict.fromkeys(group.link_names(), number)
        last = max(by, default=None)
        parts.append(Part(group.link_names(), kind, letters, tuple(outer), tuple(inner), last))
    every = tuple(pair for part in parts for pair in (*part.outer, *part.inner))
    return Structure(tuple(links), every, mobility(len(links), every), tuple(parts))
