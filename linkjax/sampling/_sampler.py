"""A scene evaluated at many places of its cycle at once: samples, and the forces there."""

from __future__ import annotations

from typing import Any

import jax
from jaxtyping import Array

from linkjax import _batches
from linkjax._batches import Batches
from linkjax._compile import compiled_soon
from linkjax.forces import Forces, forces_of_pose
from linkjax.loads import Instant
from linkjax.machine import Scene
from linkjax.mechanism import Mechanism
from linkjax.sampling._sample import Sample, sample_at


@compiled_soon(static=("gaps",))
def _samples(scene: Scene, phi: Array, side: Array, gaps: bool) -> Sample:
    return jax.vmap(lambda phi, side: sample_at(scene, phi, side, gaps))(phi, side)


@compiled_soon
def _forces(scene: Scene, sample: Sample, active: Array, speed: Array, acceleration: Array) -> Forces:
    def at(phi, side, here, *given):
        return forces_of_pose(scene, here, Instant(phi, side), *given)

    return jax.vmap(at)(sample.phi, sample.side, sample.pose, active, speed, acceleration)


class Sampler(Batches):
    """A scene evaluated at many places at once; it must be `ready`."""

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.design

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism of the scene."""
        return self.design.mechanism

    def sample(self, phi: Any, side: Any = None, *, fixed: bool = False, gaps: bool = False) -> Sample:
        """Samples at the crank angles `phi` (rad) of one axis, from the sides `side`; without derivatives with respect
        to the scene if `fixed`. `gaps` asks for margins and transmission angles, which are otherwise optional."""
        traced = self.traced or isinstance(phi, jax.core.Tracer)
        return self.ask(_samples, phi, phi if side is None else side, fixed=fixed, gaps=gaps or not traced)

    def forces(self, sample: Sample, active: Any, speed: Any, acceleration: Any, *, fixed: bool = False) -> Forces:
        """Forces at the places of a sample, at these crank speeds (rad/s) and accelerations (rad/s²); `active` says
        which loads act, shape (places, loads). Without derivatives with respect to the scene if `fixed`."""
        return self.run(_forces, self.still if fixed else self.scene, sample, active, speed, acceleration)


class Ahead(_batches.Ahead, Sampler):
    """The same for shapes instead of values: it starts compiling every program that the values will need."""
