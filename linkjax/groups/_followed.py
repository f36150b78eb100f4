"""Groups that are followed along the cycle, from their assembly mode at crank angle zero."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from jaxtyping import Array

from linkjax.groups._base import AbstractGroup, Margin
from linkjax.groups._branch_path import BranchPath
from linkjax.groups._counted_turns import CountedTurns
from linkjax.groups._pairs import FRAME
from linkjax.groups._reference_path import ReferencePath
from linkjax.groups._state import LinkState, PointState

Path = ReferencePath | BranchPath | CountedTurns


def followed(groups: Sequence[AbstractGroup]) -> list[int]:
    """Numbers of the groups that need a reference path; see `kinematics.prepared`. Gears need none if they follow only
    cranks and other such gears, in a ratio of integer numbers of teeth."""
    found, counted = [], {FRAME}
    for number, group in enumerate(groups):
        if group.followed(counted):
            found.append(number)
        else:
            counted |= {*group.counts()}
    return found


class Along(NamedTuple):
    """A group and its reference path, which is None for a group that needs none."""

    group: AbstractGroup
    path: Path | None

    def solve(
        self, links: Mapping[str, Any], states: dict[str, LinkState], points: dict[str, PointState], phi: Array
    ) -> tuple[dict[str, LinkState], dict[str, PointState]]:
        """See `AbstractGroup.solve`."""
        return self._asked(self.group.solve, links, states, points, phi)

    def margins(
        self, links: Mapping[str, Any], states: dict[str, LinkState], points: dict[str, PointState], phi: Array
    ) -> dict[str, Margin]:
        """See `AbstractGroup.margins`."""
        return self._asked(self.group.margins, links, states, points, phi)

    def _asked(self, kernel: Callable, *known: Any) -> Any:
        return kernel(*known) if self.path is None else kernel(*known, self.path)

    def returns(self) -> Array | None:
        """Whether the group returns to its initial position after the cycle; None without a reference path."""
        return None if self.path is None else self.group.returns(self.path)
