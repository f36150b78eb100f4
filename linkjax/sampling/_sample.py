"""Everything that depends on the crank angle alone, at one place of the cycle."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxtyping import Array

from linkjax._types import Scalar
from linkjax.groups import Margin
from linkjax.kinematics import Pose, named_groups, pose
from linkjax.loads import Instant
from linkjax.machine import Scene
from linkjax.reduction import unloaded


class Sample(NamedTuple):
    """Pose; reduced inertia with its slope and the shares of the reduced torque, every load as if it acted (None where
    not asked for); margins and transmission angles of the groups (empty where not asked for)."""

    pose: Pose
    dynamics: Any
    margins: dict[str, dict[str, Margin]]
    transmission: dict[str, Array]


def sample_at(scene: Scene, phi: Scalar, side: Scalar, dynamics: bool = True, gaps: bool = True) -> Sample:
    """The sample of one place. A jump of a load counts from the side of the angle `side`. The scene is
    `ready`."""
    mechanism = scene.mechanism
    here = pose(mechanism, phi)
    margins, transmission = {}, {}
    for name, group in named_groups(mechanism).items() if gaps else ():
        margins[name] = group.margins(mechanism.held_by(group), here.links, here.points, phi)
        angle = group.transmission(here.links, here.points)
        transmission |= {} if angle is None else {name: angle}
    reduced = unloaded(scene, Instant(phi, side), here) if dynamics else None
    return Sample(here, reduced, margins, transmission)
