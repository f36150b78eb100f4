"""Groups that are followed along the crank, from an assembly that is given at crank angle zero."""

from __future__ import annotations

import dataclasses

from linkjax.groups._base import AbstractGroup
from linkjax.groups._general import General
from linkjax.groups._rrp import RRP
from linkjax.groups._rrr import RRR


def is_followed(group: AbstractGroup) -> bool:
    """Whether a group needs a reference path; see `kinematics.prepared`."""
    return isinstance(group, General) or (isinstance(group, RRR | RRP) and group.branch == "continue")


def without_path(group: AbstractGroup) -> AbstractGroup:
    """The group without the reference path that it may have."""
    if isinstance(group, General | RRR | RRP) and group.path is not None:
        return dataclasses.replace(group, path=None, turns=1)
    return group
