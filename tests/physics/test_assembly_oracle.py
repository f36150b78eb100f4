# pyright: reportAttributeAccessIssue=false
"""Does it assemble? Random designs against a brute-force oracle; finite everywhere; gradients towards assembly."""

from __future__ import annotations

import functools
import math
import zlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from linkjax._compile import compiled_soon
from linkjax.groups import PRP, RPP, RPR, RRP, Crank
from linkjax.kinematics import assembly_margins
from linkjax.measures import delta, min_margin, peak_shaking_force_constant_speed
from linkjax.mechanism import Mechanism
from tests.physics import machines, oracle
from tests.physics.machines import machine

BUILT_IN = [name for name in machines.BUILT_IN if name != "scotch-yoke"]  # which is assembled for all lengths
ANGLES = 3600
BAND = 1e-9  # nearer to zero than this either result is accepted
BLOCK = 50
FEW = [pytest.param(n, marks=[] if n in ("hay-press", "four-bar") else pytest.mark.slow) for n in BUILT_IN]
MANY = [2000, pytest.param(100_000, marks=pytest.mark.slow)]


def sized(mechanism: Mechanism, lengths) -> Mechanism:
    """The same machine with other link lengths, in the order of `mechanism.links`."""
    old = [link.length for link in mechanism.links.values()]
    return eqx.tree_at(
        lambda m: [link.length for link in m.links.values()], mechanism, [lengths[..., i] for i in range(len(old))]
    )


def sample(name: str, count: int) -> np.ndarray:
    """Random link lengths, each within 30 % of its own; 80 % for a slider-crank, which always assembles within 30 %."""
    lengths = np.asarray([float(link.length) for link in machine(name).mechanism.links.values()])
    rng = np.random.default_rng(zlib.crc32(f"{name} {count}".encode()))
    spread = 0.8 if name == "slider-crank" else 0.3
    return lengths * rng.uniform(1 - spread, 1 + spread, (count, lengths.size))


def margins_at(mechanism: Mechanism, phi: np.ndarray) -> dict[tuple[str, str], np.ndarray]:
    """Distance of every group from its singular positions, from positions of pins; NaN after a group that fails."""
    with np.errstate(invalid="ignore"):
        points, directions = oracle.assemble(mechanism, phi)
    found = {}
    for g in mechanism.groups:
        if isinstance(g, Crank):
            continue
        group, one = "-".join(g.link_names()), np.asarray(mechanism.links[g.link_names()[0]].length)
        if isinstance(g, RRP):
            path = oracle.way(g.guide, points, directions)
            height = ((points[g.from_] - path.base) / path.along).imag - path.offset
            found[group, "left"], found[group, "right"] = 1 - height / one, 1 + height / one
        elif isinstance(g, RPR):
            found[group, "pivot"] = (np.abs(points[g.from_] - points[g.about]) - abs(float(g.offset))) / one
        elif isinstance(g, PRP):
            turn = directions[g.blocks[1]] / directions[g.blocks[0]]
            found[group, "parallel"] = g.side * turn.imag
        elif isinstance(g, RPP):
            found[group, "parallel"] = np.full(np.shape(phi), abs(math.sin(float(g.slot))))
        else:
            two = np.asarray(mechanism.links[g.link_names()[1]].length)
            r = np.abs(points[g.to] - points[g.from_])
            found[group, "stretched"] = (one + two - r) / (one + two)
            found[group, "folded"] = (r - np.abs(one - two)) / (one + two)
    return found


def least(mechanism: Mechanism, lengths: np.ndarray) -> dict[tuple[str, str], np.ndarray]:
    """The minimum of every margin over the cycle: a scan, and refined searches in its three lowest valleys."""
    designs = sized(mechanism, lengths[:, None, :])
    scan = np.linspace(0.0, 2 * np.pi, ANGLES, endpoint=False)[None]
    found = {}
    for key, values in margins_at(designs, scan).items():
        lost = np.isnan(values).any(axis=1)
        values = np.where(np.isnan(values), np.inf, values)
        valley = (values <= np.roll(values, 1, axis=1)) & (values <= np.roll(values, -1, axis=1))
        where = np.argpartition(np.where(valley, values, np.inf), 3, axis=1)[:, :3]
        best = np.min(values, axis=1)
        for k in range(3):
            middle, reach = scan[0, where[:, k]], scan[0, 1]
            for _ in range(8):
                phi = middle[:, None] + reach * np.linspace(-1, 1, 9)
                fine = margins_at(designs, phi)[key]
                fine = np.where(np.isnan(fine), np.inf, fine)
                middle = np.take_along_axis(phi, np.argmin(fine, axis=1)[:, None], axis=1)[:, 0]
                best, reach = np.minimum(best, np.min(fine, axis=1)), reach / 4
        found[key] = np.where(lost, np.nan, best)
    return found


def truth(name: str, lengths: np.ndarray) -> dict[tuple[str, str], np.ndarray]:
    mechanism = jax.device_get(machine(name).mechanism)
    blocks = [least(mechanism, part) for part in np.array_split(lengths, -(-len(lengths) // 200))]
    return {key: np.concatenate([block[key] for block in blocks]) for key in blocks[0]}


@functools.cache
def known(name: str, count: int) -> dict[tuple[str, str], np.ndarray]:
    return truth(name, sample(name, count))


def overall(margins: dict[tuple[str, str], np.ndarray]) -> np.ndarray:
    return functools.reduce(np.fmin, margins.values())


@compiled_soon
def all_margins(mechanism: Mechanism, lengths: jax.Array):
    return jax.lax.map(lambda one: assembly_margins(sized(mechanism, one)), lengths, batch_size=BLOCK)


@pytest.mark.parametrize("count", MANY)
@pytest.mark.parametrize("name", FEW)
def test_assembles_or_not(name, count):
    """The same result outside the band; the same margins wherever they are meaningful."""
    expected = known(name, count)
    got = jax.device_get(all_margins(machine(name).mechanism, jnp.asarray(sample(name, count))))
    margins = {(group, side): at.value for group, sides in got.items() for side, at in sides.items()}
    assert set(margins) == set(expected)
    flags, answer = overall(expected), functools.reduce(np.minimum, margins.values())
    clear = np.abs(flags) > BAND
    assert np.mean(clear) > 0.99
    np.testing.assert_array_equal((answer > 0)[clear], (flags > 0)[clear])
    whole = np.ones(count, dtype=bool)
    for (group, side), values in expected.items():
        assert np.all(np.isfinite(margins[group, side]))
        whole &= np.isfinite(values)
        np.testing.assert_allclose(margins[group, side][whole], values[whole], rtol=0, atol=BAND)
        angle = got[group][side].angle
        assert np.all((angle >= 0) & (angle < 2 * np.pi + 1e-12))

    assert 0.05 <= np.mean(flags > 0) <= 0.95  # both kinds occur, otherwise the test would show nothing


THREE = (delta, peak_shaking_force_constant_speed, min_margin)


def values_and_gradients(scene, lengths: jax.Array):
    def one(lengths):
        mechanism = sized(scene.mechanism, lengths)
        return [jax.value_and_grad(lambda m, f=f: f(scene.with_mechanism(m), 64))(mechanism) for f in THREE]

    return jax.lax.map(one, lengths, batch_size=BLOCK)


@pytest.mark.slow
@pytest.mark.parametrize("name", BUILT_IN)
def test_never_nan(name):
    """Values and gradients with respect to all numbers of the design, assembled or not."""
    lengths, runs = sample(name, 2000), overall(known(name, 2000)) > 0
    lost = np.flatnonzero(~runs)[:100]
    some = np.concatenate([lost, np.flatnonzero(runs)[: 200 - lost.size]])
    found = compiled_soon(values_and_gradients)(machine(name), jnp.asarray(lengths[some]))
    assert len(some) == 200
    for value, gradient in found:
        assert bool(jnp.all(jnp.isfinite(value)))
        for leaf in jax.tree.leaves(gradient):
            assert bool(jnp.all(jnp.isfinite(leaf)))
        by_length = jnp.stack([link.length for link in gradient.links.values()])
        assert bool(jnp.all(jnp.any(by_length != 0, axis=0)))


@pytest.mark.slow
@pytest.mark.parametrize("name", BUILT_IN)
def test_never_nan_in_a_hundred_thousand(name):
    run = jax.jit(values_and_gradients)
    lengths = sample(name, 100_000)
    for part in np.array_split(lengths, 10):
        for leaf in jax.tree.leaves(run(machine(name), jnp.asarray(part))):
            assert bool(jnp.all(jnp.isfinite(leaf)))


@compiled_soon
def led_back(scene, lengths: jax.Array):
    """Fifty steps of one per cent of the size of the machine along the margin's gradient, until it is positive."""

    def one(lengths):
        def step(_, at):
            value, slope = jax.value_and_grad(lambda x: min_margin(scene.with_mechanism(sized(scene.mechanism, x))))(at)
            size = jnp.sqrt(jnp.sum(slope**2))
            return jnp.where(value > 0, at, at + 0.01 * jnp.sqrt(jnp.sum(lengths**2)) * slope / size)

        return jax.lax.fori_loop(0, 50, step, lengths)

    return jax.lax.map(one, lengths, batch_size=BLOCK)


@pytest.mark.parametrize("name", FEW)
def test_the_gradient_leads_back(name):
    """According to the oracle, at least 95 % of the designs that cannot be assembled can be in the end."""
    lost = sample(name, 2000)[overall(known(name, 2000)) < -BAND][:300]
    after = np.asarray(led_back(machine(name), jnp.asarray(lost)))
    assert np.all(np.isfinite(after)) and np.all(after >= 0)
    assert np.mean(overall(truth(name, after)) > 0) >= 0.95
