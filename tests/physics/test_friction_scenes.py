"""Every built-in machine with friction in its joints, from none to beyond locking.

Slow: forces and locking of every machine are compiled."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics, locking_of_pose
from linkjax.friction import everywhere, indeterminate
from linkjax.kinematics import pose
from linkjax.machine import ready
from tests.scenes.test_builtin import NAMES

COUNT = 24  # crank angles per turn
NEAR = 1e-6  # relative distance from locking
MOST = 100.0  # the largest factor that is tried: with coefficients above 10 Newton's method may fail before it locks
machines = pytest.mark.parametrize("name", NAMES)
pytestmark = pytest.mark.slow


@functools.cache
def machine(name: str) -> lj.Scene:
    """A built-in machine with friction in all pins and guides whose reactions are unique; journals with a radius of a
    tenth of the shortest link."""
    scene = dataclasses.replace(lj.motion.at_crank_angles(lj.scenes.load(name)), friction=())
    lengths = [float(each.length) for each in scene.mechanism.links.values() if float(each.length) > 0]
    shared = indeterminate(scene.mechanism)
    found = everywhere(scene.mechanism, 0.1, 0.1 * min(lengths), 0.1)
    return dataclasses.replace(scene, friction=tuple(each for each in found if each.joint not in shared))


@functools.cache
def angles(name: str) -> np.ndarray:
    """Crank angles between the ticks of a dial, over the whole cycle."""
    turns = machine(name).cycle_turns
    return (np.arange(COUNT * turns) + 0.37) * 2 * math.pi / COUNT


def times(scene: lj.Scene, factor: jax.Array) -> lj.Scene:
    """The scene with all coefficients times a factor."""
    every: Any = scene.friction
    grown = (dataclasses.replace(each, coefficient=each.coefficient * factor) for each in every)
    return dataclasses.replace(scene, friction=tuple(grown))


class Found(NamedTuple):
    """Drive torque (N m), losses of the joints (N m), whether the machine moves, and the derivative of the torque by
    the common factor of all coefficients."""

    torque: jax.Array
    lost: jax.Array
    moves: jax.Array
    slope: jax.Array


@compiled_soon
def forces(scene: lj.Scene, phi: jax.Array, factor: jax.Array, speed: jax.Array) -> Found:
    """Forces at constant speed."""

    def one(phi, factor):
        def torque(factor):
            found = kinetostatics(times(scene, factor), phi, speed, jnp.zeros(()))
            spent = [one.value * one.speed for sides in found.friction.values() for one in sides.values()]
            return found.drive_torque, (-jnp.stack(spent), found.moves)

        value, slope, (lost, moves) = jax.jvp(torque, (factor,), (jnp.ones_like(factor),), has_aux=True)
        return Found(value, lost, moves, slope)

    return jax.vmap(one)(phi, factor)


@compiled_soon
def locking(scene: lj.Scene, phi: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The inverse of the factor at which the machine locks, and its derivatives by all coefficients together."""

    def one(phi):
        def inverse(factor):
            made = ready(times(scene, factor))
            here, at = pose(made.mechanism, phi), made.instant(phi, phi, jnp.zeros(()))
            return locking_of_pose(made.scene, here, at, made.scene.active(phi)).inverse

        return jax.jvp(inverse, (jnp.ones(()),), (jnp.ones(()),))

    return jax.vmap(one)(phi)


@machines
def test_from_none_to_beyond_locking(name):
    """Quasi-static: it moves just below the factor of locking and locks just above it, everything is finite up to
    there, and the factor is in inverse proportion to the coefficients."""
    scene, phi = machine(name), jnp.asarray(angles(name))
    inverse, slope = (np.asarray(part) for part in locking(scene, phi))
    assert np.all(np.isfinite(inverse)) and np.all(np.isfinite(slope))
    np.testing.assert_allclose(slope, inverse, rtol=0, atol=1e-6 * max(inverse.max(), 1e-3))
    locks = inverse > 1 / MOST
    for side, moving in ((0.0, True), (1e-3, True), (0.5, True), (1 - NEAR, True), (1 + NEAR, False), (2.0, False)):
        got = jax.device_get(forces(scene, phi, jnp.asarray(side / np.maximum(inverse, 1 / MOST)), jnp.zeros(())))
        known = locks | moving
        differs = got.moves[known] != moving
        assert not np.any(differs), (side, np.degrees(angles(name)[known][differs]))
        assert np.all(np.isinf(got.torque[~got.moves]))
        for part in (got.torque, got.slope, *got.lost.T):
            assert np.all(np.isfinite(part[got.moves])), side


@machines
def test_the_frictionless_limit_and_the_power_balance(name):
    """At the machine's speed the torque grows in proportion to small coefficients; with any coefficients the drive
    gives what it gives without friction, and the losses of the joints."""
    scene, phi = machine(name), jnp.asarray(angles(name))
    speed = jnp.asarray(float(scene.speed))
    none, small, more, whole = (
        jax.device_get(forces(scene, phi, jnp.full(phi.shape, factor), speed)) for factor in (0.0, 1e-6, 2e-6, 1.0)
    )
    assert np.all(none.moves & small.moves & more.moves) and np.all(none.lost == 0)
    assert np.mean(whole.moves) > 0.5
    for found in (small, whole):
        gained, size = (found.torque - none.torque)[found.moves], float(np.max(np.abs(found.torque[found.moves])))
        np.testing.assert_allclose(gained, found.lost.sum(1)[found.moves], rtol=0, atol=1e-10 * size)
    np.testing.assert_allclose(2 * small.lost, more.lost, rtol=0, atol=1e-5 * float(np.max(more.lost)))
    np.testing.assert_allclose(none.slope, 1e6 * small.lost.sum(1), rtol=0, atol=1e-5 * float(np.max(none.slope)))
