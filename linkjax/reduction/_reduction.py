"""Reduction to the crank: J φ'' + ½ J' φ'² = Q + drive torque.

Source: reduced (equivalent) inertia and torque of a one-degree-of-freedom machine, e.g. Artobolevsky, Theory of
Mechanisms and Machines, 1988, ch. 15; Eksergian, Dynamical analysis of machines, J. Franklin Inst. 209 (1930).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import Scalar
from linkjax._vec import Vec
from linkjax.kinematics import Pose, pose
from linkjax.loads import AbstractLoad, Instant
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import StructureError


class Reduced(NamedTuple):
    """Reduced inertia J (kg m²) with the flywheel, its slope J' = dJ/dφ (kg m²), reduced torque Q (N m), and the shares
    of gravity and of each load in Q, by name."""

    inertia: Array
    slope: Array
    torque: Array
    by_load: dict[str, Array]


def reduce_pose(
    scene: Scene, at: Instant, here: Pose, active: Array | None = None, sense: Scalar | None = None
) -> Reduced:
    """The reduced model for a given pose; see `reduced_model`. `active` says which loads act, by default those of
    `at.side`. Loads that depend on the speed are omitted where `at` has none. Opposing loads are those of a crank that
    turns in the `sense` (1 or -1), by default that of `at.speed`, forward where there is none."""
    inertia, slope, shares = unloaded(scene, at, here)
    if at.speed is not None:
        shares |= {scene.loads[number].name: scene.loads[number].share(here, at) for number in by_speed(scene)}
        sense = jnp.where(at.speed < 0, -1.0, 1.0) if sense is None else sense
    if sense is not None:
        shares |= {load.name: sense * shares[load.name] for load in scene.loads if load.opposing}
    return loaded(inertia, slope, shares, [load.name for load in scene.loads], _active(scene, at, active))


def unloaded(scene: Scene, at: Instant, here: Pose) -> tuple[Array, Array, dict[str, Array]]:
    """Reduced inertia, its slope, and the shares of gravity and of every load that does not depend on the speed, each
    as if it acted."""
    inertia, half_slope, weight = scene.mechanism.flywheel.inertia, jnp.zeros_like(at.phi), jnp.zeros_like(at.phi)
    if scene.mechanism.prescribed:
        turn = here.links[scene.mechanism.driving_link]
        inertia, half_slope = inertia * turn.w * turn.w, inertia * turn.w * turn.e
    for name, place, body in here.heavy():
        point, turn = here.points[place], here.links[name]
        inertia = inertia + body.mass * point.dr.squared() + body.inertia * (turn.w * turn.w)
        half_slope = half_slope + body.mass * point.dr.dot(point.ddr) + body.inertia * (turn.w * turn.e)
        weight = weight + body.mass * scene.gravity.dot(point.dr)
    shares = {load.name: load.share(here, at) for load in scene.loads if "speed" not in load.depends_on}
    return inertia, 2 * half_slope, {"gravity": weight, **shares}


def loaded(inertia: Array, slope: Array, shares: dict[str, Array], loads: Sequence[str], active: Array) -> Reduced:
    """The reduced model with the shares of the loads that act; `active` has their axis last, in the order of the names
    `loads`; those without a share are omitted."""
    by_load = {"gravity": shares["gravity"]}
    by_load |= {name: shares[name] * active[..., i] for i, name in enumerate(loads) if name in shares}
    return Reduced(inertia, slope, sum(by_load.values(), jnp.zeros_like(inertia)), by_load)


def _active(scene: Scene, at: Instant, active: Array | None) -> Array:
    return scene.active(at.side) if active is None else active


def reduced_model(
    scene: Scene | ReadyScene, phi: Scalar, side: Scalar | None = None, speed: Scalar | None = None
) -> Reduced:
    """Reduced inertia, its slope, and reduced torque at the crank angle `phi` (rad), referred to the crank.

    `phi` and all results are scalars; use `jax.vmap` for many angles or designs. At a jump of a load the value is the
    one-sided limit on the side of the angle `side` (rad; default: just after `phi`). Loads that depend on the speed are
    those at the crank speed `speed` (rad/s); where it is negative, opposing loads act against the motion backward. The
    motor and its rotor are not included. Raises `StructureError` if a load depends on the speed and none is given.
    """
    made, phi = ready(scene), jnp.asarray(phi)
    if speed is None and (numbers := by_speed(made.scene)):
        element = f"load {made.scene.loads[numbers[0]].name!r}"
        raise StructureError(element, "depends on the crank speed, which is not given", "write speed=..., in rad/s")
    speed = None if speed is None else jnp.asarray(speed)
    return _reduce(made, phi, phi if side is None else side, speed)


@jax.jit  # traced once per scene topology, however often it is used inside larger functions
def _reduce(made: ReadyScene, phi: Scalar, side: Scalar, speed: Scalar | None) -> Reduced:
    return reduce_pose(made.scene, made.instant(phi, jnp.asarray(side), speed), pose(made.mechanism, phi))


def of_crank(here: Reduced, prescribed: bool) -> Reduced:
    """The reduced values that determine the motion of the crank: those given, unless the driver follows a motion law.
    Then inertia is one and torque zero, which gives constant speed; the shares of the loads are kept."""
    if not prescribed:
        return here
    none = jnp.zeros_like(here.torque)
    return here._replace(inertia=none + 1.0, slope=none, torque=none)


class Moving(NamedTuple):
    """What loads that depend on the speed, and friction, need at places: pose, crank angle and side (rad), which loads
    act there, with the axis of all loads last, the reactions of joints with friction (`forces.Basis`), and values near
    the frictions and the acceleration, if known."""

    pose: Pose
    phi: Array
    side: Array
    active: Array
    basis: Any = None
    near: Any = None


def by_speed(scene: Scene) -> tuple[int, ...]:
    """Numbers of the loads that depend on the speed."""
    return tuple(number for number, load in enumerate(scene.loads) if "speed" in load.depends_on)


def shares_at(loads: Mapping[int, AbstractLoad], moving: Moving, speed: Array) -> dict[str, Array]:
    """Shares of the reduced torque (N m) of loads that depend on the speed, by name, at the crank speed (rad/s) of each
    place; `loads` are by their number in the scene."""

    def one(moving: Moving, speed: Array) -> dict[str, Array]:
        at = Instant(moving.phi, moving.side, speed)
        return {load.name: load.share(moving.pose, at) * moving.active[number] for number, load in loads.items()}

    for _ in range(jnp.ndim(speed)):
        one = jax.vmap(one)
    return one(moving, speed)


def mass_sums(here: Pose) -> tuple[Vec, Vec]:
    """First and second kinematic coefficients of Σ m r (kg m): the shaking force at constant speed is -ω² Σ m r''."""
    first, second = Vec(0.0, 0.0), Vec(0.0, 0.0)
    for _, place, body in here.heavy():
        point = here.points[place]
        first, second = first + point.dr * body.mass, second + point.ddr * body.mass
    return first, second
