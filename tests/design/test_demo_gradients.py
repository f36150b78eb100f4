"""Gradients over the whole range of the demo: every measure at a hundred random designs, breakpoints in any order."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax.design import Problem, as_term, settled
from linkjax.measures import MEASURES, evaluate, min_margin, steady_state_margin

COUNT, NODES = 100, 160
GROUPS = (
    (
        "delta",
        "max_crank_speed",
        "min_crank_speed",
        "steady_state_margin",
        "min_inertia_ratio",
        "slow_down",
        "mean_drive_torque",
        "mean_drive_power",
        "energy_per_cycle",
    ),
    ("peak_shaking_force_constant_speed", "rms_shaking_force_constant_speed", "min_margin"),
    (
        "peak_drive_torque_constant_speed",
        "peak_reaction_constant_speed",
        "min_transmission_angle",
        "peak_shaking_moment_constant_speed",
        "max_drive_torque_constant_speed",
        "min_drive_torque_constant_speed",
    ),
    ("peak_shaking_force", "peak_reaction"),
    ("flywheel_for_target_delta",),
)


@functools.cache
def posed() -> tuple[Problem, jax.Array]:
    """The design variables of the demo, and random designs between their bounds, scaled from 0 to 1."""
    scene, asked = lj.load_problem("hay-press")
    free = settled(scene, asked["free"], "flywheel.inertia")["free"]
    problem = Problem(scene, free, as_term(lambda scene: scene.mechanism.flywheel.inertia))
    return problem, jnp.asarray(np.random.default_rng(0).random((COUNT, len(free))))


def numbers(names: tuple[str, ...], z: jax.Array) -> jax.Array:
    problem, _ = posed()
    low, span = jnp.asarray(problem.lower), jnp.asarray(problem.upper - problem.lower)
    found = evaluate(problem.design(low + z * span), [MEASURES[name] for name in names], NODES)
    return jnp.stack([found[name] for name in names])


def over(function, points: jax.Array) -> np.ndarray:
    """A function at many points, compiled once, in small blocks."""
    return np.asarray(jax.jit(lambda points: jax.lax.map(function, points, batch_size=10))(points))


@functools.cache
def sound() -> np.ndarray:
    """Designs that can be assembled and run, with a margin for the steps of the differences."""
    _, z = posed()
    margins = over(lambda z: numbers((min_margin.name, steady_state_margin.name), z), z)
    return np.asarray(np.min(margins, axis=1) > 0.02)


def test_the_names_are_all():
    assert sorted(name for group in GROUPS for name in group) == sorted(MEASURES)


@pytest.mark.slow
@pytest.mark.parametrize("names", GROUPS, ids=lambda names: names[0])
def test_gradients(names):
    """Finite everywhere, the same both ways, and equal to differences of two steps where these agree."""
    _, z = posed()
    value = functools.partial(numbers, names)
    reverse, forward = over(jax.jacrev(value), z), over(jax.jacfwd(value), z)
    assert np.isfinite(reverse).all()
    size = np.linalg.norm(reverse, axis=2, keepdims=True)
    assert np.max(np.abs(forward - reverse) / size) <= 1e-10
    assert 0.3 * COUNT <= np.sum(sound()) < COUNT  # some of these designs cannot be assembled
    some, eye = np.asarray(z)[sound()], np.eye(z.shape[1])
    slopes = []
    for h in (2e-4, 1e-4):
        shifts = np.stack([k * h * eye for k in (-2, -1, 1, 2)])
        points = (some[:, None, None] + shifts[None]).reshape((-1, z.shape[1]))
        f = over(value, jnp.asarray(points)).reshape((len(some), 4, len(eye), len(names)))
        slopes.append(np.moveaxis(f[:, 0] - f[:, 3] + 8 * (f[:, 2] - f[:, 1]), 1, 2) / (12 * h))
    scale = size[sound()]
    settled_ = np.max(np.abs(slopes[0] - slopes[1]) / scale, axis=2) <= 1e-6  # otherwise two peaks coincide
    wrong = np.max(np.abs(slopes[1] - reverse[sound()]) / scale, axis=2)
    assert np.mean(~settled_) <= 0.02
    assert np.max(wrong[settled_]) <= 1e-6
