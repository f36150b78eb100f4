"""Every measure on every scene: finite, differentiable both ways, right by differences, blind to nodes and units."""

from __future__ import annotations

import dataclasses
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import measures
from linkjax._compile import compiled_soon
from linkjax.groups import RRP
from linkjax.measures import MEASURES
from tests.physics.machines import BUILT_IN, machine

FEW, MANY = 96, 160
NAMES = sorted(MEASURES)


def varied(scene: lj.Scene, by: jax.Array) -> lj.Scene:
    """The scene with every number multiplied by one plus its share."""
    leaves, tree = jax.tree.flatten(scene)
    return jax.tree.unflatten(tree, [leaf * (1 + by[i]) for i, leaf in enumerate(leaves)])


def every(scene: lj.Scene, nodes: int) -> jax.Array:
    """All measures, in the order of `NAMES`."""
    found = measures.evaluate(scene, [MEASURES[name] for name in NAMES], nodes)
    return jnp.stack([found[name] for name in NAMES])


@compiled_soon(static=("nodes",))
def values(scene: lj.Scene, nodes: int) -> jax.Array:
    return every(scene, nodes)


@compiled_soon
def forward(scene: lj.Scene, directions: jax.Array) -> jax.Array:
    """Derivatives of all measures along many directions: (directions, measures)."""
    none = jnp.zeros_like(directions[0])
    return jax.vmap(lambda u: jax.jvp(lambda x: every(varied(scene, x), MANY), (none,), (u,))[1])(directions)


@compiled_soon
def backward(scene: lj.Scene, none: jax.Array) -> jax.Array:
    """Gradient of every measure: (measures, numbers)."""
    _, pull = jax.vjp(lambda x: every(varied(scene, x), MANY), none)
    return jax.vmap(lambda one: pull(one)[0])(jnp.eye(len(NAMES)))


@compiled_soon
def around(scene: lj.Scene, shifts: jax.Array) -> jax.Array:
    """All measures of many designs around a scene: (designs, measures)."""
    return jax.lax.map(lambda x: every(varied(scene, x), MANY), shifts, batch_size=32)


@functools.cache
def gradients(name: str) -> np.ndarray:
    scene = machine(name)
    return np.asarray(backward(scene, jnp.zeros(len(jax.tree.leaves(scene)))))


@pytest.mark.parametrize("name", BUILT_IN)
def test_values_and_gradients_are_finite(name):
    got = np.asarray(values(machine(name), nodes=FEW))
    assert got.shape == (len(NAMES),)
    assert np.all(np.isfinite(got))
    assert np.all(np.isfinite(gradients(name)))
    assert np.all(np.any(gradients(name) != 0, axis=1))  # every measure depends on something


@pytest.mark.parametrize("name", BUILT_IN)
def test_forward_and_reverse_mode_agree(name):
    reverse = gradients(name)
    ahead = np.asarray(forward(machine(name), jnp.eye(reverse.shape[1]))).T
    size = np.linalg.norm(reverse, axis=1, keepdims=True)
    np.testing.assert_array_less(np.max(np.abs(ahead - reverse) / size, axis=1), 1e-10)


@pytest.mark.parametrize("name", BUILT_IN)
def test_gradients_are_differences(name):
    """Fourth-order central differences by every number of the scene."""
    reverse, h = gradients(name), 3e-4
    count = reverse.shape[1]
    steps = np.concatenate([k * h * np.eye(count) for k in (-2, -1, 1, 2)])
    f = np.asarray(around(machine(name), jnp.asarray(steps))).reshape((4, count, len(NAMES)))
    differences = ((f[0] - f[3]) + 8 * (f[2] - f[1])).T / (12 * h)
    size = np.linalg.norm(reverse, axis=1, keepdims=True)
    wrong = np.max(np.abs(differences - reverse) / size, axis=1)
    assert {n: w for n, w in zip(NAMES, wrong, strict=True) if not w <= 1e-6} == {}


@pytest.mark.parametrize("name", BUILT_IN)
def test_independent_of_the_number_of_nodes(name):
    few, many = (np.asarray(values(machine(name), nodes=nodes)) for nodes in (FEW, MANY))
    np.testing.assert_allclose(few, many, rtol=1e-8, atol=1e-8)


POWERS = {"1": (0, 0, 0), "rad/s": (0, 0, -1), "N": (1, 1, -2), "N m": (2, 1, -2), "kg m^2": (2, 1, 0)}


def rescaled(scene: lj.Scene, length: float, mass: float, time: float) -> lj.Scene:
    """The same machine in other units, or a similar one of another size."""
    force, inertia = mass * length / time**2, mass * length**2
    m = scene.mechanism
    links = {
        name: dataclasses.replace(
            link, length=link.length * length, mass=link.mass * mass, inertia=link.inertia * inertia,
            centre=link.centre * length, points={p: at * length for p, at in link.points.items()},
        )
        for name, link in m.links.items()
    }  # fmt: skip
    groups = tuple(dataclasses.replace(g, offset=g.offset * length) if isinstance(g, RRP) else g for g in m.groups)
    fixed = {p: at * length for p, at in m.fixed.items()}
    flywheel = lj.Flywheel(m.flywheel.inertia * inertia)
    loads = []
    for load in scene.loads:
        by = {"force": force, "magnitude": force, "torque": force * length}
        if isinstance(load, lj.OpposingTorque):
            by["magnitude"] = force * length
        loads.append(dataclasses.replace(load, **{k: getattr(load, k) * v for k, v in by.items() if hasattr(load, k)}))
    return dataclasses.replace(
        scene, mechanism=lj.Mechanism(fixed, links, groups, flywheel), loads=tuple(loads),
        gravity=scene.gravity * (length / time**2), speed=scene.speed / time,
    )  # fmt: skip


@pytest.mark.parametrize("units", [(1e3, 1e-3, 1.0), (1e-6, 1e-18, 1e-2), (1e6, 1e9, 1e3)])
@pytest.mark.parametrize("name", BUILT_IN)
def test_unchanged_by_units(name, units):
    """Millimetres and tonnes, micro machines and giants: the same numbers in their own units."""
    before = np.asarray(values(machine(name), nodes=FEW))
    after = np.asarray(values(rescaled(machine(name), *units), nodes=FEW))
    back = [np.prod([u**-p for u, p in zip(units, POWERS[MEASURES[n].unit], strict=True)]) for n in NAMES]
    np.testing.assert_allclose(after * back, before, rtol=1e-9, atol=1e-12)


def test_two_designs_share_one_compilation():
    run = jax.jit(lambda scene: measures.delta(scene, 32))
    scene = machine("four-bar")
    longer = eqx.tree_at(lambda s: s.mechanism.links["coupler"].length, scene, jnp.asarray(0.42))
    one, two = float(run(scene)), float(run(longer))
    assert one != two
    assert run._cache_size() == 1


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
        got = measures.evaluate(scene, [MEASURES[name], measures.delta], 32)
        assert float(got[name]) == pytest.approx(float(got["delta"] * scene.speed), rel=1e-12)
        assert speed_range.unit == "rad/s" and "smallest" in speed_range.meaning
    finally:
        MEASURES.pop(name, None)
