"""Everything that depends on the crank angle alone, at one place of the cycle."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxtyping import Array

from linkjax._types import Scalar
from linkjax.groups import Margin
from linkjax.kinematics import Pose, margins_of_pose, pose, transmission_of_pose
from linkjax.machine import ReadyScene
from linkjax.reduction import unloaded


class Sample(NamedTuple):
    """Pose; reduced inertia with its slope and the shares of the reduced torque, every load as if it acted (None where
    not asked for); margins and transmission angles of the groups (empty where not asked for)."""

    pose: Pose
    dynamics: Any
    margins: dict[str, dict[str, Margin]]
    transmission: dict[str, Array]


def sample_at(ready: ReadyScene, phi: Scalar, side: Scalar, dynamics: bool = True, gaps: bool = True) -> Sample:
    """The sample of one place. A jump of a load counts from the side of the angle `side`."""
    here = pose(ready.mechanism, phi)
    margins = margins_of_pose(ready.mechanism, here, phi) if gaps else {}
    transmission = transmission_of_pose(ready.scene.mechanism, here) if gaps else {}
    reduced = unloaded(ready.scene, ready.instant(phi, side), here) if dynamics else None
    return Sample(here, reduced, margins, transmission)
