"""The stated error of δ: never below the true error, rarely far above it, on random designs of every scene."""

from __future__ import annotations

import functools
import zlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.kinematics import min_margin
from linkjax.motion import Steady, steady_motion
from tests.physics import shooting
from tests.physics.machines import BUILT_IN, machine

DESIGNS, SPREAD = 200, 0.3
TRUTH = 400  # nodes
LEAST = 1e-11  # smaller errors count as this value
COARSE = ("hay-press-slider", "slider-crank")
ALL = (32, 40, 48, 56, 64, 80, 96, 112, 128, 144, 160)


def chosen(scene: lj.Scene):
    """Lengths and masses of every link."""
    return [number for link in scene.mechanism.links.values() for number in (link.length, link.mass)]


def sample(name: str) -> list[jax.Array]:
    """Random designs around a scene, each number within its range."""
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    return [jnp.asarray(float(x) * (1 + SPREAD * rng.uniform(-1, 1, DESIGNS))) for x in chosen(machine(name))]


def design(scene: lj.Scene, numbers: list[jax.Array]) -> lj.Scene:
    return eqx.tree_at(chosen, scene, numbers)


@compiled_soon(static=("nodes",))
def found(scene: lj.Scene, numbers: list[jax.Array], nodes: int):
    """δ, its stated error, and whether they exist."""

    def one(numbers):
        here = design(scene, numbers)
        motion = steady_motion(here, nodes)
        runs = (motion.steady_state_margin > 0) & (min_margin(here.mechanism) > 0) & ~motion.grid.overflow
        return motion.delta, motion.delta_error, runs

    return jax.lax.map(one, numbers, batch_size=50)


@functools.cache
def at(name: str, nodes: int) -> tuple[np.ndarray, ...]:
    return tuple(np.asarray(part) for part in found(machine(name), sample(name), nodes=nodes))


def honesty(counts: tuple[int, ...], names: tuple[str, ...]) -> dict[tuple[str, int], np.ndarray]:
    """Stated error over true error, of every design that runs."""
    ratios = {}
    for name in names:
        truth, surely, runs = at(name, TRUTH)
        assert np.sum(runs) > DESIGNS // 4
        for nodes in counts:
            value, stated, _ = at(name, nodes)
            error = np.maximum(np.abs(value - truth), LEAST)
            known = runs & (surely < np.maximum(3 * LEAST, 0.1 * np.maximum(error, stated)))  # better than both
            assert np.mean(known[runs]) > 0.97
            ratios[name, nodes] = (stated / error)[known]
    return ratios


def check(ratios: dict[tuple[str, int], np.ndarray]) -> None:
    below = {key: float(np.min(r)) for key, r in ratios.items() if np.min(r) < 1}
    assert below == {}
    above = {key: float(np.max(r)) for key, r in ratios.items() if np.max(r) > 1e5}
    assert above == {}
    every = np.concatenate(list(ratios.values()))
    assert np.mean(every <= 1000) >= 0.95


def test_the_stated_error_is_honest():
    check(honesty((96,), ("four-bar",)))  # the others: `make test-all`


@pytest.mark.slow
def test_the_stated_error_of_a_coarse_grid_is_honest():
    check(honesty((32,), COARSE))


@pytest.mark.slow
def test_the_stated_error_is_honest_for_every_number_of_nodes():
    check(honesty(ALL, BUILT_IN))


@pytest.mark.slow
@pytest.mark.parametrize("name", BUILT_IN)
def test_the_truth_is_confirmed_by_another_road(name):
    """DOP853 with shooting, on a sample of the same designs."""
    truth, surely, runs = at(name, TRUTH)
    numbers = sample(name)
    for i in np.flatnonzero(runs & (surely < 1e-9))[:3]:
        known = shooting.shoot(jax.device_get(design(machine(name), [n[i] for n in numbers])), 1e-13)
        assert float(truth[i]) == pytest.approx(known.delta, rel=3e-9)


@compiled_soon(static=("nodes",))
def one_cycle(scene: lj.Scene, nodes: int) -> Steady:
    return steady_motion(scene, nodes)


@pytest.mark.slow
@pytest.mark.parametrize("name", BUILT_IN)
def test_it_covers_the_scenes_themselves(name):
    fine = one_cycle(machine(name), nodes=TRUTH)
    for nodes in (32, 64):
        got = one_cycle(machine(name), nodes=nodes)
        wrong = abs(float(got.delta) - float(fine.delta))
        assert wrong <= float(got.delta_error)
        assert float(got.delta_error) <= 1e5 * max(wrong, LEAST)
