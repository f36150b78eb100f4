"""Everything that depends on the crank angle alone, at one place of the cycle."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Array

from linkjax._types import Scalar
from linkjax.groups import Margin
from linkjax.kinematics import Pose, named_groups, pose
from linkjax.loads import Instant
from linkjax.machine import Scene
from linkjax.reduction import unloaded


class Sample(NamedTuple):
    """Crank angle `phi` and `side` (rad), pose, reduced inertia and its slope, shares of the reduced torque (every load
    as if it acted), margins and transmission angles of the groups (empty where not asked for)."""

    phi: Array
    side: Array
    pose: Pose
    inertia: Array
    slope: Array
    shares: dict[str, Array]
    margins: dict[str, dict[str, Margin]]
    transmission: dict[str, Array]

    @property
    def dynamics(self) -> tuple:
        """Reduced inertia, its slope, and the shares of the loads."""
        return self.inertia, self.slope, self.shares


def sample_at(scene: Scene, phi: Scalar, side: Scalar, gaps: bool = True) -> Sample:
    """The sample of one place. A jump of a load counts from the side of the angle `side`. Margins and transmission
    angles are computed with `gaps`. The scene is `ready`."""
    mechanism = scene.mechanism
    here = pose(mechanism, phi)
    margins, transmission = {}, {}
    for name, group in named_groups(mechanism).items() if gaps else ():
        margins[name] = group.margins(mechanism.held_by(group), here.links, here.points, phi)
        angle = group.transmission(here.links, here.points)
        transmission |= {} if angle is None else {name: angle}
    return Sample(phi, side, here, *unloaded(scene, Instant(phi, side), here), margins, transmission)
