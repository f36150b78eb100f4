"""A scene evaluated at many places of its cycle at once: samples, and the forces there."""

from __future__ import annotations

from typing import Any

import jax
from jaxtyping import Array

from linkjax import _batches
from linkjax._batches import PLACES, Batches, joined
from linkjax._compile import compiled_soon
from linkjax._types import Tracer
from linkjax.forces import Forces, forces_of_pose
from linkjax.kinematics import Pose, Prepared
from linkjax.machine import ReadyScene, Scene, untitled
from linkjax.mechanism import Mechanism
from linkjax.sampling._sample import Sample, sample_at


@compiled_soon(static=("dynamics", "gaps"))
def _samples(ready: ReadyScene, phi: Array, side: Array, dynamics: bool, gaps: bool) -> Sample:
    return jax.vmap(lambda phi, side: sample_at(ready, phi, side, dynamics, gaps))(phi, side)


@compiled_soon
def _forces(
    ready: ReadyScene, phi: Array, side: Array, pose: Pose, active: Array, speed: Array, acceleration: Array
) -> Forces:
    def at(phi, side, here, active, speed, acceleration):
        return forces_of_pose(ready.scene, here, ready.instant(phi, side, speed), active, speed, acceleration)

    return jax.vmap(at)(phi, side, pose, active, speed, acceleration)


class Sampler(Batches):
    """A scene evaluated at many places at once, made `ready`. Its title is no part of any program."""

    def __init__(self, made: ReadyScene, size: int = PLACES):
        super().__init__(made.of(untitled(made.scene)), size)

    @property
    def ready(self) -> ReadyScene:
        """The scene with its paths."""
        return self.design

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.design.scene

    @property
    def prepared(self) -> Prepared:
        """The mechanism of the scene with its paths."""
        return self.design.mechanism

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism of the scene."""
        return self.design.scene.mechanism

    def sample(
        self, phi: Any, side: Any = None, *, fixed: bool = False, dynamics: bool = True, gaps: bool = False
    ) -> Sample:
        """Samples at the crank angles `phi` (rad) of one axis, from the sides `side`; without derivatives with respect
        to the scene if `fixed`. What is not asked for is omitted inside of jax transformations, where it would only
        make programs longer: `dynamics` is the reduced model, `gaps` are margins and transmission angles."""
        traced, side = self.traced or isinstance(phi, Tracer), phi if side is None else side
        return self.ask(_samples, phi, side, fixed=fixed, dynamics=dynamics or not traced, gaps=gaps or not traced)

    def forces(
        self, phi: Any, side: Any, pose: Pose, active: Any, speed: Any, acceleration: Any, *, fixed: bool = False
    ) -> Forces:
        """Forces at places with this pose, at these crank speeds (rad/s) and accelerations (rad/s²); `active` says
        which loads act, shape (places, loads). Without derivatives with respect to the scene if `fixed`."""
        design = self.still if fixed else self.whole_design
        return joined(self.parts(_forces, (design,), (phi, side, pose, active, speed, acceleration)))


class Ahead(_batches.Ahead, Sampler):
    """The same for shapes instead of values: it starts compiling every program that the values will need."""
