"""Reference paths are no part of a mechanism: another one is followed anew, and preparing twice is free."""

from __future__ import annotations

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import Mechanism
from linkjax._compile import compiled_soon
from linkjax.kinematics import Prepared, margins, pose, prepared
from linkjax.machine import ready
from tests.physics.machines import machine

ANGLES = np.linspace(0.0, 2 * math.pi, 13)


@compiled_soon
def places(mechanism: Mechanism | Prepared, phi: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Positions of all points, shape (angles, points, 2), and the least margins, shape (angles,)."""
    made = prepared(mechanism)

    def at(phi):
        here, sides = pose(made, phi), margins(made, phi).values()
        least = jnp.min(jnp.stack([margin.value for each in sides for margin in each.values()]))
        return jnp.stack([jnp.stack([p.r.x, p.r.y]) for p in here.points.values()]), least

    return jax.vmap(at)(phi)


def over(mechanism: Mechanism | Prepared) -> tuple[np.ndarray, np.ndarray]:
    """The same over the cycle."""
    at, least = places(mechanism, jnp.asarray(ANGLES))
    return np.asarray(at), np.asarray(least)


def longer(mechanism: Mechanism, link: str, factor: float) -> Mechanism:
    """The mechanism with the length of a link replaced in the tree."""
    return eqx.tree_at(lambda m: m.links[link].length, mechanism, factor * mechanism.links[link].length)


@pytest.mark.slow
@pytest.mark.parametrize("link", [pytest.param("bar1", marks=pytest.mark.slow), "bar3"])
def test_a_replaced_length_is_followed_anew(link):
    """A bar of a triad that is too short for a whole turn is replaced by a longer one: the former path ends."""
    made = prepared(longer(machine("triad").mechanism, link, 0.93))
    changed = longer(made.mechanism, link, 1.08)
    anew = Mechanism(changed.fixed, changed.links, changed.groups, changed.flywheel)
    (at, least), (same, margin) = over(changed), over(anew)
    np.testing.assert_array_equal(at, same)
    np.testing.assert_array_equal(least, margin)
    np.testing.assert_allclose(over(prepared(changed))[0], at, rtol=0, atol=1e-13)
    assert np.all(least > 0) and np.min(over(Prepared(changed, made.paths))[1]) < 0


@pytest.mark.slow
def test_a_replaced_link_of_a_scissor_lift():
    """Also where the drive is solved together with the links."""
    made = prepared(lj.scissor_lift(2.1, 0.35, 0.2, 0.9))
    changed = longer(made.mechanism, "bar", 0.97)
    anew = Mechanism(changed.fixed, changed.links, changed.groups, changed.flywheel)
    for one, other in zip(over(changed), over(anew), strict=True):
        np.testing.assert_array_equal(one, other)


def test_preparing_twice_is_free():
    made = prepared(machine("triad").mechanism)
    assert prepared(made) is made
    assert prepared(made, 2) is not made
    scene = ready(machine("triad"))
    assert ready(scene) is scene
    plain = prepared(machine("hay-press").mechanism)
    assert prepared(plain, 3) is plain and not any(plain.paths)
