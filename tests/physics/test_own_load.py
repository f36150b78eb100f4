"""A load written outside linkjax, as a user would: a spring between two moving links."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax.forces import kinetostatics
from linkjax.loads import AbstractLoad, Applied


class Spring(AbstractLoad):
    """A spring between a `point` of a `link` and the point `other` of the link `to`."""

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    point: str = eqx.field(static=True)
    to: str = eqx.field(static=True, kw_only=True)
    other: str = eqx.field(static=True, kw_only=True)
    stiffness: jax.Array = eqx.field(converter=jnp.asarray, kw_only=True)
    free: jax.Array = eqx.field(converter=jnp.asarray, kw_only=True)
    window: lj.Window | None = None
    reacts_on: str | None = eqx.field(static=True, default=None)

    def wrenches(self, pose, at):
        span = pose.points[self.other].r - pose.points[self.point].r
        length = jnp.sqrt(span.squared())
        pull, none = span * (self.stiffness * (1 - self.free / length)), jnp.zeros_like(length)
        return [Applied(self.link, self.point, pull, none), Applied(self.to, self.other, -pull, none)]


@pytest.fixture(scope="module")
def scene():
    press = lj.load("hay-press")
    spring = Spring("spring", "crank", "B", to="rocker", other="G", stiffness=8e4, free=0.3)
    return eqx.tree_at(lambda s: s.loads, press, (*press.loads, spring))


@pytest.fixture(scope="module")
def cycle(scene):
    return lj.analyse(scene, angles=24, nodes=256)


def test_its_share_is_the_slope_of_its_energy(scene):
    """Q = -dV/dφ, with V = k (l - l₀)² / 2, by central differences."""

    def stretch(phi):
        points = lj.pose(scene.mechanism, phi).points
        span = points["G"].r - points["B"].r
        return jnp.sqrt(span.squared()) - 0.3

    phi = jnp.linspace(0.1, 6.0, 20)
    energy = jax.jit(jax.vmap(lambda phi: 0.5 * 8e4 * stretch(phi) ** 2))
    step = 1e-5
    slope = (energy(phi + step) - energy(phi - step)) / (2 * step)
    share = jax.jit(jax.vmap(lambda phi: lj.reduced_model(scene, phi).by_load["spring"]))(phi)
    np.testing.assert_allclose(share, -slope, atol=1e-8 * float(jnp.max(jnp.abs(slope))) + 1e-3)


def test_it_does_no_work_over_a_cycle(scene, cycle):
    assert abs(float(cycle.work["spring"])) < 1e-9 * float(jnp.max(jnp.abs(cycle.reduced.by_load["spring"])))
    for check in (cycle.checks.virtual_power, cycle.checks.energy_closure, cycle.checks.force_balance):
        assert float(check) < 1e-10


def test_it_acts_on_both_links(scene):
    """Equal and opposite forces leave the sum of the loads unchanged, but not the forces in the joints."""
    phi, speed, none = (jnp.asarray(x) for x in (0.7, 70.0, 0.0))
    with_it, without = (kinetostatics(s, phi, speed, none) for s in (scene, lj.load("hay-press")))
    assert float(with_it.loads.fx) == pytest.approx(float(without.loads.fx), abs=1e-9)
    assert float(with_it.loads.moment) == pytest.approx(float(without.loads.moment), abs=1e-8)
    assert abs(float(with_it.reactions["G"]["link4"].fx - without.reactions["G"]["link4"].fx)) > 100.0


def test_it_is_printed(scene):
    assert "spring" in str(scene)
