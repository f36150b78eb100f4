"""The checks of an analysis and its result code."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide
from linkjax._results import Result, merge
from linkjax._vec import Vec
from linkjax.analysis._cycle import Checks, Margins
from linkjax.analysis._friction import RubbingAt
from linkjax.forces import Forces, driven_by_joint
from linkjax.groups import PointState, closed_to
from linkjax.kinematics import Pose
from linkjax.machine import Scene
from linkjax.measures import known_torque
from linkjax.motion import Grid, Steady, primitive
from linkjax.reduction import Reduced

LIGHTEST = 1e-6  # least reduced inertia divided by its mean; below it the crank would turn a thousand times faster


class Shown(NamedTuple):
    """Results at the crank angles asked for; `forces`, `speed`, `acceleration` and `friction` in the actual motion (if
    it exists) and at constant speed, and so the reduced model if loads depend on the speed."""

    pose: Pose
    transmission: dict[str, Array]
    reduced: tuple[Reduced, ...]
    forces: tuple[Forces, ...]
    speed: tuple[Array, ...]
    acceleration: tuple[Array, ...]
    time: Array | None
    assembled: Array
    friction: tuple[RubbingAt, ...] = ()


@compiled_soon
def checks_of(
    scene: Scene,
    grid: Grid,
    motion: Steady | None,
    here: Reduced | None,
    closing: tuple[Grid, Array] | None,
    angles: Array,
    at: Shown,
    limits: Margins,
) -> tuple[Checks, Array]:
    """The checks of the analysis, and its result code."""
    bodies = _masses(at)
    parts = [at.forces, at.speed, at.acceleration, *([at.reduced] if len(at.reduced) > 1 else [])]
    motions = jax.tree.map(lambda *leaves: jnp.stack(leaves), *zip(*parts, strict=True))
    found = jax.vmap(lambda given: _residuals(scene, at, bodies, *given))(motions)
    power, balance = (jnp.max(part) for part in found)
    if motion is not None and motion.driven is not None:  # a motion that does not exist has no balance
        exists = motion.steady_state_margin > 0
        power, balance = (jnp.where(exists, one, part[-1]) for one, part in zip((power, balance), found, strict=True))
    none = {"loops": closed_to(power.dtype)}  # a singular value is zero only to rounding
    every = [m.value - none.get(side, 0.0) for sides in limits.values() for side, m in sides.items()]
    least = jnp.min(jnp.stack([jnp.ones(()), *every]))
    codes = [
        jnp.where(grid.overflow, Result.TOO_MANY_REVERSALS, 0),
        jnp.where(least > 0, 0, Result.CANNOT_BE_ASSEMBLED),
    ]
    if motion is None or here is None:
        return Checks(power, None, balance), merge(*codes)
    codes += [
        jnp.where(jnp.isinf(motion.delta_error), Result.INTEGRATION_FAILED, 0),
        jnp.where(motion.steady_state_margin > 0, 0, Result.NO_PERIODIC_REGIME),
        jnp.where(motion.min_inertia_ratio > LIGHTEST, 0, Result.NO_INERTIA),
    ]
    return Checks(power, _energy_closure(scene, motion, here, closing, angles, at, bodies), balance), merge(*codes)


class Masses(NamedTuple):
    """All masses of the links at the angles shown: mass (kg), inertia (kg m²), states of their centres, and rotation of
    their links; leaves of shape (masses, angles)."""

    mass: Array
    inertia: Array
    at: PointState
    w: Array
    e: Array


def _masses(at: Shown) -> Masses:
    pose = at.pose
    places = [(pose.points[place], pose.links[link]) for link, place, _ in pose.heavy()]
    mass, inertia = (jnp.stack(part) for part in zip(*(body for *_, body in pose.heavy()), strict=True))
    point = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(point for point, _ in places))
    return Masses(mass, inertia, point, *(jnp.stack([getattr(link, name) for _, link in places]) for name in "we"))


def _residuals(
    scene: Scene, at: Shown, bodies: Masses, forces: Forces, speed: Array, acceleration: Array,
    reduced: Reduced | None = None,
) -> tuple[Array, Array]:  # fmt: skip
    """Virtual power and force balance in one of the two motions, relative to the largest term of the sums, because in a
    balanced machine the sums themselves are zero. At a change point drive torque and frame forces come from these sums,
    so only the power is compared there, with the reduced model."""
    crank = at.pose.links[scene.mechanism.driving_link].w
    reduced = at.reduced[0] if reduced is None else reduced
    inertia, slope, torque = reduced[:3]
    parts = inertia * acceleration, 0.5 * slope * speed**2, -torque
    power, point = jnp.abs(known_torque(forces) - sum(parts)), bodies.at
    power = power if forces.moves is None else jnp.where(forces.moves, power, 0.0)  # locked: there are no forces
    about = at.pose.points[scene.mechanism.groups[0].needs()[0]].r
    reach = jnp.max(_length(point.r - Vec(about.x[None], about.y[None])), axis=0, initial=0.0)
    square, slow = speed[None] ** 2, acceleration[None]
    pull = jnp.abs(bodies.mass * _length(point.ddr * square + point.dr * slow))
    spin = jnp.abs(bodies.inertia * (bodies.e * square + bodies.w * slow) * bodies.w)
    size = sum(jnp.abs(share) for share in reduced.by_load.values())
    size = size + scene.mechanism.flywheel.inertia * jnp.abs(acceleration * crank)
    size = size + jnp.sum(pull * _length(point.dr) + spin, axis=0)
    joints = [side for sides in forces.reactions.values() for side in sides.values()]
    sides = jnp.stack([jnp.stack([side.fx for side in joints]), jnp.stack([side.fy for side in joints])])
    sides = jnp.where(jnp.isnan(sides), 0.0, sides)  # joints at a change point, or of a locked machine
    heavy = jnp.max(jnp.maximum(jnp.sum(pull, axis=0), jnp.max(_length(Vec(*sides)), axis=0)))
    sources = [jnp.stack(part) for part in zip(forces.shaking, forces.weight, forces.loads, strict=True)]
    drive = jnp.zeros_like(power) if driven_by_joint(scene.mechanism) else crank * known_torque(forces)
    moments = jnp.concatenate([drive[None], sources[2]])
    turning = jnp.max(jnp.sum(jnp.abs(moments), axis=0) + reach * heavy)
    rest = [forces.frame[k] - jnp.sum(sources[k], axis=0) for k in (0, 1)]
    rest += [forces.frame.moment - jnp.sum(moments, axis=0)]
    rest = [one if forces.moves is None else jnp.where(forces.moves, one, 0.0) for one in rest]
    twist = jnp.max(jnp.abs(rest.pop()))
    balance = jnp.maximum(safe_divide(jnp.max(jnp.hypot(*rest)), heavy), safe_divide(twist, turning))
    return safe_divide(jnp.max(power), jnp.max(size)), balance


def _length(v: Vec) -> Array:
    return jnp.sqrt(v.squared())


def _energy_closure(
    scene: Scene, motion: Steady, here: Reduced, closing: tuple[Grid, Array] | None, angles: Array, at: Shown,
    bodies: Masses,
) -> Array:  # fmt: skip
    """Kinetic energy of the links, from their velocities, and of the rotor, compared with the work of the loads, each
    integrated separately, and of the drive: of its constant torque, of that of the motor, or of the torque that the
    motion law requires."""
    speed, grid = at.speed[0], motion.grid
    spin = at.pose.links[scene.mechanism.driving_link].w * speed
    kinetic = 0.5 * scene.mechanism.flywheel.inertia * spin**2
    if motion.driven is not None:
        kinetic = kinetic + 0.5 * motion.rotor * speed**2
    energy = bodies.mass * bodies.at.dr.squared() + bodies.inertia * bodies.w**2
    kinetic = kinetic + 0.5 * jnp.sum(energy, axis=0) * speed**2
    torques = list(here.by_load.values())
    if motion.driven is not None:
        torques.append(motion.drive_torque(here))
    elif closing is None:
        torques.append(jnp.broadcast_to(motion.mean_drive_torque, grid.nodes.shape))
    else:
        torques += [-torque for torque in torques]  # the drive balances the loads
    work = jnp.sum(_integrals(grid, jnp.stack(torques), angles), axis=0)
    if closing is not None:
        fine, torque = closing
        work = work + _integrals(fine, torque[None], angles)[0]
    closure = jnp.max(jnp.abs((kinetic - kinetic[0]) - (work - work[0])))
    return safe_divide(closure, jnp.max(kinetic))


def _integrals(grid: Grid, torques: Array, angles: Array) -> Array:
    """Integrals of torques given at the nodes, shape (torques, panels, n), from the first edge to the angles."""
    place = jax.vmap(grid.place)(angles)
    return jax.vmap(lambda torque: primitive(grid, torque).at(place))(torques)
