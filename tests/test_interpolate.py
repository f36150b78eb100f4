"""Interpolation in tables, compared with SciPy, NumPy and with its own definition."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from linkjax._interpolate import interpolate, periodic_interpolate

TABLES = {
    "rises": ([0.0, 0.3, 1.0, 1.2, 2.0], [0.0, 1.0, 1.5, 4.0, 4.5]),
    "two": ([-1.0, 2.0], [3.0, 5.0]),
    "three": ([0.0, 1.0, 3.0], [0.0, 1.0, -1.0]),
    "flat": ([0.0, 1.0, 2.0, 3.0, 4.0], [1.0, 1.0, 2.0, 2.0, 1.0]),
    "steep end": ([0.0, 1.0, 2.0, 4.0], [0.0, 0.1, 9.0, 8.9]),
    "end against the next": ([0.0, 1.0, 1.1, 2.0], [0.0, 1.0, -5.0, 3.0]),
}


@pytest.mark.parametrize("name", TABLES)
def test_the_cubic_is_that_of_scipy(name):
    knots, values = map(np.asarray, TABLES[name])
    x = np.linspace(knots[0], knots[-1], 97).reshape((1, 97))
    other, slope = PchipInterpolator(knots, values), jax.grad(lambda x: interpolate(x, *given, "cubic"))
    given = jnp.asarray(knots), jnp.asarray(values)
    np.testing.assert_allclose(interpolate(jnp.asarray(x), *given, "cubic"), other(x), rtol=0, atol=1e-12)
    inside = jnp.asarray(x[0, 1:-1])
    np.testing.assert_allclose(jax.vmap(slope)(inside), other(inside, 1), rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", TABLES)
def test_straight_lines_are_those_of_numpy_and_ends_are_held(name):
    knots, values = map(np.asarray, TABLES[name])
    x = np.linspace(knots[0] - 1, knots[-1] + 1, 201)
    given = jnp.asarray(knots), jnp.asarray(values)
    np.testing.assert_allclose(interpolate(jnp.asarray(x), *given, "linear"), np.interp(x, knots, values), atol=1e-14)
    ends = interpolate(jnp.asarray([knots[0] - 5, knots[-1] + 5]), *given, "cubic")
    np.testing.assert_allclose(ends, values[[0, -1]], atol=1e-15)


def test_a_periodic_cubic_is_that_of_three_periods():
    knots, values, period = np.asarray([0.2, 1.0, 2.5, 5.0]), np.asarray([1.0, -2.0, 4.0, 3.0]), 6.0
    long = np.concatenate([knots + k * period for k in range(-3, 4)])
    other = PchipInterpolator(long, np.tile(values, 7))
    x = np.linspace(-7.0, 9.0, 321)
    ours = periodic_interpolate(jnp.asarray(x), jnp.asarray(knots), jnp.asarray(values), period, "cubic")
    np.testing.assert_allclose(ours, other(x), atol=1e-12)
    lines = periodic_interpolate(jnp.asarray(x), jnp.asarray(knots), jnp.asarray(values), period, "linear")
    np.testing.assert_allclose(lines, np.interp(x, long, np.tile(values, 7)), atol=1e-13)


@pytest.mark.parametrize("method", ["linear", "cubic"])
def test_a_value_at_a_knot_is_that_of_the_table(method):
    knots, values = (jnp.asarray(each) for each in TABLES["steep end"])
    np.testing.assert_allclose(interpolate(knots, knots, values, method), values, atol=1e-14)
    np.testing.assert_allclose(periodic_interpolate(knots, knots, values, 5.0, method), values, atol=1e-14)


@pytest.mark.parametrize("method", ["linear", "cubic"])
@pytest.mark.parametrize("periodic", [False, True])
def test_derivatives_with_respect_to_knots_and_values(method, periodic):
    rng = np.random.default_rng(4)
    knots, values = jnp.asarray([0.0, 0.7, 1.1, 2.0, 3.1]), jnp.asarray([0.0, 1.0, 1.4, 3.0, 2.0])
    x = jnp.asarray([0.13, 0.9, 1.5, 2.8])

    def total(knots, values):
        found = (
            periodic_interpolate(x, knots, values, 4.0, method) if periodic else interpolate(x, knots, values, method)
        )
        return jnp.sum(found * jnp.arange(1.0, 5.0))

    reverse = jax.grad(total, argnums=(0, 1))(knots, values)
    ahead = jax.jacfwd(total, argnums=(0, 1))(knots, values)
    for one, two in zip(reverse, ahead, strict=True):
        np.testing.assert_allclose(one, two, atol=1e-12)
    for _ in range(3):
        a, b = (jnp.asarray(rng.normal(size=5)) for _ in range(2))
        step = 1e-6
        difference = (total(knots + step * a, values + step * b) - total(knots - step * a, values - step * b)) / step
        assert difference / 2 == pytest.approx(float(reverse[0] @ a + reverse[1] @ b), rel=1e-7, abs=1e-8)


def test_derivatives_are_finite_where_chords_are_flat():
    knots, values = (jnp.asarray(each) for each in TABLES["flat"])
    found = jax.grad(lambda v: jnp.sum(interpolate(jnp.linspace(-1.0, 5.0, 41), knots, v, "cubic")))(values)
    assert np.all(np.isfinite(found))
