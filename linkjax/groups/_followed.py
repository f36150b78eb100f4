"""Groups that are followed along the cycle, from their assembly mode at crank angle zero."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from linkjax.groups._base import AbstractGroup
from linkjax.groups._course import Course
from linkjax.groups._driver import Crank
from linkjax.groups._gear import Gear
from linkjax.groups._general import General
from linkjax.groups._mesh import Belt
from linkjax.groups._pairs import FRAME
from linkjax.groups._rack import Pinion, Rack
from linkjax.groups._rrp import RRP
from linkjax.groups._rrr import RRR
from linkjax.groups._track import Track
from linkjax.groups._winding import Winding

Path = Track | Course | Winding


def followed(groups: Sequence[AbstractGroup]) -> list[int]:
    """Numbers of the groups that need a reference path; see `kinematics.prepared`. Gears need none if they follow only
    cranks and other such gears, in a ratio of integer numbers of teeth."""
    found, counted = [], {FRAME}
    for number, group in enumerate(groups):
        if isinstance(group, Gear | Rack | Pinion):
            exact = set(group.mates()) <= counted and not (isinstance(group, Gear) and isinstance(group.mesh, Belt))
            found += [number] * (not exact)
            counted |= {group.link} if exact else set()
        elif isinstance(group, RRR | RRP):
            found += [number] * (group.branch == "continue")
        elif isinstance(group, General):
            found.append(number)
        elif isinstance(group, Crank):
            counted.add(group.link)
    return found


def with_path(group: AbstractGroup, path: Path | None, cycle_turns: int = 1) -> AbstractGroup:
    """A followed group with another reference path over `cycle_turns` turns, or with none."""
    assert isinstance(group, General | RRR | RRP | Gear | Rack | Pinion)
    return dataclasses.replace(group, **{"path": path, "cycle_turns": cycle_turns})


def without_path(group: AbstractGroup) -> AbstractGroup:
    """The group without its reference path, if it has one."""
    return with_path(group, None) if getattr(group, "path", None) is not None else group
