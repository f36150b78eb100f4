"""User-defined functions and measures: whatever they use may be different the next time, and they may use names."""

from __future__ import annotations

import gc

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import _compile
from linkjax.measures import MEASURES, measure

FREE = {"links.rod.length": (0.15, 0.19)}


@pytest.fixture(scope="module")
def scene() -> lj.Scene:
    """A slider-crank whose rod is the design variable."""
    return lj.load("slider-crank")


def rod(scene: lj.Scene) -> jax.Array:
    return scene.mechanism.links["rod"].length


@pytest.fixture
def own_measures():
    """Measures that a test registers are removed."""
    before = dict(MEASURES)
    yield
    MEASURES.clear()
    MEASURES.update(before)


@pytest.mark.parametrize("least", [0.16, 0.18])
def test_a_function_whose_data_changed_is_called_again(scene, least):
    """The same function object: a global or a list that it reads may have changed."""
    BOUND[:] = [least]
    found = lj.optimise(scene, FREE, "links.rod.length", limits=[lj.at_least(above_bound, 0.0, unit="m")])
    assert found.feasible
    np.testing.assert_allclose(found.x, [least], rtol=1e-8)


BOUND = [0.0]


def above_bound(scene):
    return rod(scene) - BOUND[0]


@pytest.mark.parametrize("wanted", [0.16, 0.18])
def test_a_measure_of_the_users_is_not_known_by_its_name(scene, own_measures, tmp_path, monkeypatch, wanted):
    """Neither in process nor from a file: another function may have the name."""
    monkeypatch.setattr(_compile, "_KEPT", [tmp_path])

    @measure("m^2", motion=False)
    def rod_gap(of):
        """Square of the distance from the wanted length."""
        return (rod(of.scene) - wanted) ** 2

    for asked in (rod_gap, "rod_gap"):
        np.testing.assert_allclose(lj.optimise(scene, FREE, asked).x, [wanted], rtol=1e-6)
    assert list(tmp_path.glob("linkjax-*")) == []
    np.testing.assert_allclose(rod_gap(scene), (0.17 - wanted) ** 2, rtol=1e-12)
    np.testing.assert_allclose(lj.measures.evaluate(scene, [rod_gap])["rod_gap"], (0.17 - wanted) ** 2, rtol=1e-12)


def test_a_function_that_cannot_be_hashed(scene):
    class Gap(eqx.Module):
        wanted: jax.Array

        def __call__(self, scene):
            return (rod(scene) - self.wanted) ** 2

    np.testing.assert_allclose(lj.optimise(scene, FREE, Gap(jnp.asarray(0.16))).x, [0.16], rtol=1e-6)


@pytest.mark.slow
def test_a_program_with_a_users_function_goes_with_its_problem(scene):
    gc.collect()
    made = len(_compile._MADE)
    for wanted in (0.16, 0.17, 0.18):
        lj.optimise(scene, FREE, lambda scene, wanted=wanted: (rod(scene) - wanted) ** 2)
    gc.collect()
    assert len(_compile._MADE) == made


@pytest.mark.slow
def test_a_fixed_scene_inside_of_jit(scene):
    """Only the angles, or a factor, are traced."""
    expected = lj.analyse(scene, angles=4, throw=False)
    x = jax.jit(lambda angles: lj.analyse(scene, angles=angles, throw=False).pose.points["P"].r.x)(expected.angles)
    np.testing.assert_allclose(x, expected.pose.points["P"].r.x, rtol=1e-12)
    twice = jax.jit(lambda k: k * lj.measures.delta(scene) + 0 * lj.motion.steady_motion(scene).delta)(2.0)
    np.testing.assert_allclose(twice, 2 * expected.delta, rtol=1e-9)
