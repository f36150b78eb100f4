"""Joint forces by inertia alone, and by statics alone: whether a static analysis is enough."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._batches import joined
from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide
from linkjax.forces import Forces, forces_of_pose
from linkjax.kinematics import Pose
from linkjax.machine import ReadyScene
from linkjax.measures._extremes import Extreme
from linkjax.measures._forces import reaction_names
from linkjax.measures._parts import Parts
from linkjax.measures._quantities import QUANTITIES, by_forces, quantity
from linkjax.measures._structure import Elements
from linkjax.motion import At, Place, Regime

RATIO = "inertia_force_ratio_constant_speed"
STATIC = 0.1  # ratio of inertia forces to others above which statics alone is not sufficient


@quantity("N", "joint", vector=True)
def static_reaction(of: Parts, elements: Elements):
    """Force in a joint on a link by weight and loads alone, without inertia."""

    def at(regime: Regime, at: At) -> Any:
        return by_forces(of, elements, at.pose, _static(regime, at))

    return at


@quantity("N", "joint", vector=True)
def inertia_reaction(of: Parts, elements: Elements):
    """Force in a joint on a link by inertia alone."""

    def at(regime: Regime, at: At) -> Any:
        forces = of.machine.run(_without, regime.forces(at), _static(regime, at))
        return by_forces(of, elements, at.pose, forces)

    return at


def _static(regime: Regime, at: At) -> Forces:
    """The forces without inertia; loads that depend on the speed are those at the speed of the motion."""
    machine, (active, (speed, _)) = regime.machine, at.driven
    design = machine.still if regime.fixed else machine.whole_design
    return joined(machine.parts(_at_rest, (design,), (at.place, at.pose, active, speed)))


@compiled_soon
def _at_rest(made: ReadyScene, place: Place, pose: Pose, active: Array, speed: Array) -> Forces:
    def at(place, here, active, speed):
        none = jnp.zeros_like(speed)
        return forces_of_pose(made.scene, here, made.instant(place.phi, place.side, speed), active, none, none)

    return jax.vmap(at)(place, pose, active, speed)


@compiled_soon
def _without(forces: Forces, still: Forces) -> Forces:
    found = jax.tree.map(lambda every, part: every - part, forces.reactions, still.reactions)
    return forces._replace(reactions=found)


def force_extremes(of: Parts) -> list[Extreme]:
    """The largest joint force by inertia alone, and by statics alone, at constant nominal speed."""
    every = tuple(f"{joint}.{link}" for joint, link in reaction_names(of.scene))
    return [Extreme(QUANTITIES[f"{cause}_reaction"], every, "peak", True) for cause in ("inertia", "static")]


@compiled_soon
def force_ratio(inertia: Array, static: Array) -> Array:
    """Their ratio; infinite where statics gives no force, and zero where inertia gives none either."""
    none = jnp.where(inertia > 0, jnp.inf, 0.0)
    return jnp.where(static > 0, safe_divide(inertia, static), none)
