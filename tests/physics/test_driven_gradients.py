"""Gradients of measures of a driven machine by every number of links, springs, windows and motor."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import measures
from linkjax._compile import compiled_soon
from tests.physics.driven import line, slider_crank

NAMES = ("delta", "slow_down", "rms_motor_torque", "mean_motor_torque", "max_motor_power", "energy_per_cycle")
PLATE = lj.InductionMotor(rated_power=60.0, rated_speed=36.0, synchronous_speed=40.0, breakdown_ratio=2.5)


def sprung(motor: lj.MotorDrive) -> lj.Scene:
    """The slider-crank with pump, a spring from the piston to the frame, a braking torque in a window, and gravity."""
    scene = slider_crank(motor, flywheel=0.02, gravity=lj.Vec(0.3, -9.81))
    spring = lj.Spring("spring", "slider", "D", to_point="A", stiffness=20.0, free_length=0.2)
    window = lj.Window(jnp.asarray(1.1), jnp.asarray(2.9))
    return dataclasses.replace(
        scene, loads=(*scene.loads, spring, lj.Torque("brake", "crank", torque=-0.2, window=window))
    )


@pytest.mark.slow
@pytest.mark.parametrize("motor", [line(transmission=lj.Transmission(1.2), inertia=0.001), lj.MotorDrive(PLATE)])
def test_gradients_by_every_number(motor):
    """Forward and reverse to 1e-9, fourth-order differences to 1e-6, relative to the norm of the gradient."""
    scene = sprung(motor)
    leaves = jax.tree.leaves(scene)
    size = np.asarray([abs(float(leaf)) or 0.03 for leaf in leaves])

    @compiled_soon
    def moved(scene, by):
        leaves, tree = jax.tree.flatten(scene)
        found = measures.evaluate(
            jax.tree.unflatten(tree, [x + d for x, d in zip(leaves, by, strict=True)]), NAMES, 160
        )
        return jnp.stack([found[name] for name in NAMES])

    none = jnp.zeros(len(leaves))
    ahead, back = (
        np.asarray(compiled_soon(way(moved, argnums=1))(scene, none)) * size for way in (jax.jacfwd, jax.jacrev)
    )
    norm = np.linalg.norm(back, axis=1, keepdims=True)
    assert np.all(norm > 0)
    assert np.max(np.abs(ahead - back) / norm) < 1e-9
    h, unit = 1e-3, np.eye(len(leaves)) * size
    f = [[np.asarray(moved(scene, jnp.asarray(h * k * step))) for k in (-2, -1, 1, 2)] for step in unit]
    differences = np.stack([(a - d + 8 * (c - b)) / (12 * h) for a, b, c, d in f], axis=1)
    assert np.max(np.abs(differences - back) / norm) < 1e-6
