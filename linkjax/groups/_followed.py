"""Groups that are followed along the crank, from an assembly that is given at crank angle zero."""

from __future__ import annotations

import dataclasses

from linkjax.groups._base import AbstractGroup
from linkjax.groups._course import Course
from linkjax.groups._general import General
from linkjax.groups._rrp import RRP
from linkjax.groups._rrr import RRR
from linkjax.groups._track import Track


def is_followed(group: AbstractGroup) -> bool:
    """Whether a group needs a reference path; see `kinematics.prepared`."""
    return isinstance(group, General) or (isinstance(group, RRR | RRP) and group.branch == "continue")


def with_path(group: AbstractGroup, path: Track | Course | None, turns: int = 1) -> AbstractGroup:
    """A group that is followed, with another reference path over so many turns, or none."""
    assert isinstance(group, General | RRR | RRP)
    return dataclasses.replace(group, **{"path": path, "turns": turns})


def without_path(group: AbstractGroup) -> AbstractGroup:
    """The group without the reference path that it may have."""
    return with_path(group, None) if getattr(group, "path", None) is not None else group
