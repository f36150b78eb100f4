"""Every measure on every scene: finite, differentiable both ways, right by differences, blind to nodes and units."""

from __future__ import annotations

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import measures
from linkjax._compile import compiled_soon
from linkjax.analysis import measured
from linkjax.measures import MEASURES
from tests.physics.machines import BUILT_IN, machine, resized

FEW, MANY = 96, 160
NAMES = sorted(MEASURES)


def varied(scene: lj.Scene, by: jax.Array) -> lj.Scene:
    """The scene with every number changed by its share of itself, of 0.3 (of the size of a link) where it is zero."""
    leaves, tree = jax.tree.flatten(scene)
    return jax.tree.unflatten(tree, [leaf + jnp.where(leaf == 0, 0.3, leaf) * by[i] for i, leaf in enumerate(leaves)])


GROUPS = {  # measures that share most of their work, compiled together; the last takes what is left
    "motion": ("delta", "largest_speed", "smallest_speed", "regime_margin", "least_inertia", "mean_drive_torque"),
    "shaking": ("peak_shaking_force_constant_speed", "rms_shaking_force_constant_speed"),
    "constant": ("peak_drive_torque_constant_speed", "peak_reaction_constant_speed"),
    "true": ("peak_shaking_force", "peak_reaction"),
    "flywheel": ("flywheel_for_target_delta",),
}
GROUPS["rest"] = tuple(n for n in sorted(MEASURES) if n not in {m for group in GROUPS.values() for m in group})
FEWER = {"slider-crank": tuple(group for group in GROUPS if group != "constant")}  # the others: `make test-all`
CASES = [
    pytest.param(name, group, marks=[] if group in FEWER.get(name, ()) else [pytest.mark.slow])
    for name in BUILT_IN
    for group in GROUPS
]
SCENES = [pytest.param(name, marks=[] if name == "slider-crank" else [pytest.mark.slow]) for name in BUILT_IN]


def every(scene: lj.Scene, names: tuple[str, ...], nodes: int) -> jax.Array:
    """The measures named."""
    found = measures.evaluate(scene, [MEASURES[name] for name in names], nodes)
    return jnp.stack([found[name] for name in names])


@compiled_soon(static=("names", "nodes"))
def values(scene: lj.Scene, names: tuple[str, ...], nodes: int) -> jax.Array:
    return every(scene, names, nodes)


@compiled_soon(static=("names",))
def around(scene: lj.Scene, shifts: jax.Array, directions: jax.Array, names: tuple[str, ...]):
    """Measures of many designs around a scene, (designs, measures), and their derivatives along one direction each."""

    def one(pair):
        return jax.jvp(lambda x: every(varied(scene, x), names, MANY), pair[:1], pair[1:])

    return jax.lax.map(one, (shifts, directions))


@compiled_soon(static=("names",))
def backward(scene: lj.Scene, none: jax.Array, names: tuple[str, ...]) -> jax.Array:
    """Gradients of measures: (measures, numbers)."""
    _, pull = jax.vjp(lambda x: every(varied(scene, x), names, MANY), none)
    return jax.lax.map(lambda one: pull(one)[0], jnp.eye(len(names)))


@functools.cache
def gradients(name: str, group: str) -> np.ndarray:
    scene = machine(name)
    return np.asarray(backward(scene, jnp.zeros(len(jax.tree.leaves(scene))), names=GROUPS[group]))


@functools.cache
def all_values(name: str) -> np.ndarray:
    return np.asarray(values(machine(name), names=tuple(NAMES), nodes=FEW))


H = 3e-4  # step of the differences


@functools.cache
def neighbours(name: str, group: str) -> tuple[np.ndarray, np.ndarray]:
    """Measures with every number two steps down, one down, one up and two up, and (last row) as it is; and their
    derivatives by every number, forwards: (numbers, measures). One program for both."""
    count = len(jax.tree.leaves(machine(name)))
    steps = np.concatenate([*(k * H * np.eye(count) for k in (-2, -1, 1, 2)), np.zeros((1, count))])
    shifts = jnp.asarray(np.concatenate([steps, np.zeros((count, count))]))
    directions = jnp.asarray(np.concatenate([np.zeros_like(steps), np.eye(count)]))
    values, slopes = around(machine(name), shifts, directions, names=GROUPS[group])
    return np.asarray(values[: len(steps)]), np.asarray(slopes[len(steps) :])


@pytest.mark.parametrize(("name", "group"), CASES)
def test_gradients(name, group):
    """Finite, not zero, and the same forwards, backwards and by fourth-order differences, by every number."""
    names, reverse = GROUPS[group], gradients(name, group)
    assert np.all(np.isfinite(reverse))
    assert np.all(np.any(reverse != 0, axis=1))
    size = np.linalg.norm(reverse, axis=1, keepdims=True)
    count = reverse.shape[1]
    f, ahead = neighbours(name, group)
    wrong = np.max(np.abs(ahead.T - reverse) / size, axis=1)
    assert {n: w for n, w in zip(names, wrong, strict=True) if not w <= 1e-10} == {}
    f = f[:-1].reshape((4, count, len(names)))
    differences = ((f[0] - f[3]) + 8 * (f[2] - f[1])).T / (12 * H)
    wrong = np.max(np.abs(differences - reverse) / size, axis=1)
    assert {n: w for n, w in zip(names, wrong, strict=True) if not w <= 1e-6} == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_independent_of_the_number_of_nodes(name):
    many = {}
    for group, names in GROUPS.items():
        many |= dict(zip(names, neighbours(name, group)[0][-1], strict=True))
    np.testing.assert_allclose(all_values(name), [many[n] for n in NAMES], rtol=1e-8, atol=1e-8)


POWERS = {
    "1": (0, 0, 0),
    "rad": (0, 0, 0),
    "rad/s": (0, 0, -1),
    "N": (1, 1, -2),
    "N m": (2, 1, -2),
    "kg m^2": (2, 1, 0),
}


@pytest.mark.parametrize("units", [(1e3, 1e-3, 1.0), (1e-6, 1e-18, 1e-2), (1e6, 1e9, 1e3)])
@pytest.mark.parametrize("name", SCENES)
def test_unchanged_by_units(name, units):
    """Millimetres and tonnes, micro machines and giants: the same numbers in their own units."""
    before = all_values(name)
    after = np.asarray(values(resized(machine(name), *units), names=tuple(NAMES), nodes=FEW))
    back = [np.prod([u**-p for u, p in zip(units, POWERS[MEASURES[n].unit], strict=True)]) for n in NAMES]
    np.testing.assert_allclose(after * back, before, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", SCENES)
def test_an_analysis_holds_the_same_numbers(name):
    """What `measured` reads from a cycle, found by other programs; a target for the flywheel only some scenes have."""
    found = measured(lj.analyse(machine(name), angles=4, nodes=FEW))
    expected = dict(zip(NAMES, all_values(name), strict=True))
    assert set(expected) - set(found) <= {"flywheel_for_target_delta"}
    assert found == pytest.approx({name: expected[name] for name in found}, rel=1e-9, abs=1e-12)


def test_two_designs_share_one_compilation():
    traced = []

    @jax.jit
    def run(scene):
        traced.append(scene)
        return measures.delta(scene, 32)

    scene = machine("four-bar")
    longer = eqx.tree_at(lambda s: s.mechanism.links["coupler"].length, scene, jnp.asarray(0.42, dtype=float))
    one, two = float(run(scene)), float(run(longer))
    assert one != two
    assert len(traced) == 1


def test_the_gradient_by_a_mechanism_is_a_mechanism():
    scene = machine("four-bar")
    slope = compiled_soon(jax.grad(lambda m: measures.delta(scene.with_mechanism(m), 32)))(scene.mechanism)
    assert isinstance(slope, lj.Mechanism)
    assert jax.tree.structure(slope) == jax.tree.structure(scene.mechanism)


def test_a_measure_of_ones_own():
    """One function and a decorator; it is found by name and takes part in the sweep."""
    name = "speed_range"
    try:

        @measures.measure("rad/s")
        def speed_range(of: measures.Parts) -> jax.Array:
            """Difference between the largest and the smallest speed."""
            return of.steady.speed_max - of.steady.speed_min

        scene = machine("four-bar")
        got = compiled_soon(lambda scene: measures.evaluate(scene, [MEASURES[name], measures.delta], 32))(scene)
        assert float(got[name]) == pytest.approx(float(got["delta"] * scene.speed), rel=1e-12)
        assert speed_range.unit == "rad/s" and "smallest" in speed_range.meaning
    finally:
        MEASURES.pop(name, None)
