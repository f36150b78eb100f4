"""Reactions of joints with friction at many places, for any crank speed and acceleration.

Reactions are linear in all forces and couples. So those of weight and loads, of the square of the crank speed, of the
acceleration, and of unit frictions give them at every speed that a motion may have at a place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._vec import Vec, zero
from linkjax.forces._friction import Contacts, Linear, Transmitted
from linkjax.forces._kinetostatics import acting_on, applied_to, friction_numbers, has_linear_reactions, rubbed_by
from linkjax.friction import pairs, rubbing
from linkjax.groups import Wrench
from linkjax.kinematics import Pose
from linkjax.loads import Applied, Instant
from linkjax.machine import Scene

At = Callable[[Array, Array, Array], Instant]  # of crank angle, side (rad) and speed (rad/s)


class Basis(NamedTuple):
    """Reactions of joints with friction at a place, for any crank speed and acceleration: senses and speeds of their
    relative motions, shape (joints,); the directions in which they slide, None for pins; what they transmit (fx, fy,
    moment; each of shape (joints,)) from weight and loads that depend on position alone, at unit square of the crank
    speed, and at unit acceleration; from unit frictions (joints, joints with the friction), and from unit forces and
    couples (3, joints) of every load that depends on the speed. Of many places the axis is the last one."""

    senses: Array
    paces: Array
    axes: tuple[Vec | None, ...]
    fixed: Transmitted
    square: Transmitted
    rate: Transmitted
    own: Transmitted
    by_load: dict[int, tuple[Transmitted, ...]]


def basis_of_pose(scene: Scene, here: Pose, at: Instant, active: Array, by_speed: Sequence[int]) -> Basis | None:
    """The basis of the reactions of joints with friction; `by_speed` are the numbers of the loads that depend on the
    speed. None with meshes, whose reactions are not linear."""
    if not has_linear_reactions(scene.mechanism):
        return None
    origins, one, none = scene.mechanism.origins(), jnp.ones(()), jnp.zeros(())
    joints = rubbing(scene.mechanism, scene.friction, here, jnp.where(at.side >= at.phi, 1.0, -1.0))
    _, weight, working, _ = applied_to(scene, here, at, active, none, none, by_speed)
    still = acting_on(scene, here, origins)

    def transmitted(acting: dict[str, Wrench], c: Array) -> Transmitted:
        return rubbed_by(scene, here, acting, origins, joints, c)

    push = jax.linearize(transmitted, still, jnp.zeros(len(joints)))[1]
    inertia = [applied_to(scene, here, at, active, *state, by_speed)[0] for state in ((one, none), (none, one))]
    units: dict[int, list[Applied]] = {}
    for number in by_speed:
        for link, point, *_ in scene.loads[number].wrenches(here, at._replace(speed=one)):
            sides = ((Vec(one, none), none), (Vec(none, one), none), (zero(), one))
            units.setdefault(number, []).extend(Applied(link, point, force, couple) for force, couple in sides)
    every = [weight + working, *inertia, *([unit] for parts in units.values() for unit in parts)]
    loaded = [acting_on(scene, here, origins, each) for each in every]
    free = jnp.zeros(len(joints))
    rows = jax.vmap(lambda acting: push(acting, free))(jax.tree.map(lambda *leaves: jnp.stack(leaves), *loaded))
    fixed, square, rate = (tuple(part[i] for part in rows) for i in range(3))
    own = jax.vmap(lambda c: push(still, c), out_axes=1)(jnp.eye(len(joints)))
    first, by_load = 3, {}
    for number, parts in units.items():
        cuts = range(first, first + len(parts), 3)
        by_load[number] = tuple(tuple(part[i : i + 3] for part in rows) for i in cuts)
        first += len(parts)
    _, senses, paces = friction_numbers(joints)
    return Basis(senses, paces, tuple(joint.axis for joint in joints), fixed, square, rate, own, by_load)


def contacts_of(
    scene: Scene, instant: At, basis: Basis, here: Pose, phi: Array, side: Array, active: Array, speed: Array
) -> Contacts:
    """The joints with friction at one place or several, at the crank speeds (rad/s) there; `instant` as by
    `ReadyScene.instant`."""

    def loaded(basis: Basis, here: Pose, phi: Array, side: Array, active: Array, speed: Array) -> Transmitted:
        at = instant(phi, side, speed)
        first = [a + speed**2 * b for a, b in zip(basis.fixed, basis.square, strict=True)]
        for number, parts in basis.by_load.items():
            for (_, _, force, couple), part in zip(scene.loads[number].wrenches(here, at), parts, strict=True):
                size = jnp.stack([force.x, force.y, jnp.asarray(couple)]) * active[number]
                first = [a + size @ b for a, b in zip(first, part, strict=True)]
        fx, fy, moment = first
        return fx, fy, moment

    if jnp.ndim(speed):
        loaded = jax.vmap(loaded, (-1, 0, 0, 0, 0, 0), -1)
    first = loaded(basis, here, phi, side, active, speed)
    frictions = tuple(pair.friction for pair in pairs(scene.mechanism, scene.friction))
    return Contacts(frictions, basis.senses, basis.senses * basis.paces, Linear(first, basis.own, basis.rate))
