"""Primitives: safe where required, exact where possible, differentiable in every mode."""

import itertools

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from linkjax._numerics import envelope, largest, once, root, safe_divide, safe_sqrt, sincos
from tests.helpers import assert_gradients_agree, ulps

MODES = {"forward": jax.jacfwd, "reverse": jax.jacrev}
NESTED = list(itertools.product(MODES, MODES))
EPS = np.finfo(float).eps


class TestSafe:
    bad = jnp.asarray([0.0, -0.0, -1.0, -1e300, -jnp.inf])

    @pytest.mark.parametrize("mode", MODES)
    def test_largest(self, mode):
        """Of several equal values one counts; of a single value, that one."""
        for values, slope in (([1.0, 3.0, 2.0], [0.0, 1.0, 0.0]), ([5.0, 1.0, 5.0], [1.0, 0.0, 0.0])):
            x = jnp.asarray(values)
            assert largest(x) == max(values)
            np.testing.assert_array_equal(MODES[mode](largest)(x), slope)

    def test_sqrt_where_positive(self):
        x = jnp.asarray([1e-300, 0.25, 2.0, 1e300])
        np.testing.assert_array_equal(safe_sqrt(x), np.sqrt(x))
        np.testing.assert_allclose(jax.vmap(jax.grad(safe_sqrt))(x), 0.5 / np.sqrt(x), rtol=4 * EPS)

    @pytest.mark.parametrize("mode", MODES)
    def test_sqrt_elsewhere(self, mode):
        np.testing.assert_array_equal(safe_sqrt(self.bad, 7.0), 7.0)
        for derivative in (MODES[mode](safe_sqrt), MODES[mode](MODES[mode](safe_sqrt))):
            np.testing.assert_array_equal(jax.vmap(derivative)(self.bad), 0.0)

    def test_divide_where_defined(self):
        a, b = jnp.asarray([1.0, -3.0, 0.0]), jnp.asarray([3.0, -7.0, 1e-200])
        np.testing.assert_array_equal(safe_divide(a, b), np.asarray(a) / np.asarray(b))
        by_a, by_b = jax.vmap(jax.grad(safe_divide, argnums=(0, 1)))(a[:2], b[:2])
        np.testing.assert_allclose(by_a, 1 / b[:2], rtol=4 * EPS)
        np.testing.assert_allclose(by_b, -a[:2] / b[:2] ** 2, rtol=4 * EPS)

    @pytest.mark.parametrize("mode", MODES)
    @pytest.mark.parametrize("a", [0.0, 1.0, -1e300])
    def test_divide_elsewhere(self, mode, a):
        first = MODES[mode](safe_divide, argnums=(0, 1))
        second = MODES[mode](lambda x, y: first(x, y)[1], argnums=(0, 1))
        for b in (0.0, -0.0):
            at = jnp.asarray(a), jnp.asarray(b)
            assert safe_divide(*at, 7.0) == 7.0
            np.testing.assert_array_equal([*first(*at), *second(*at)], 0.0)

    def test_one_bad_element_spoils_no_other(self):
        x = jnp.asarray([4.0, -1.0, 0.0])
        np.testing.assert_array_equal(jax.grad(lambda x: jnp.sum(safe_sqrt(x)))(x), [0.25, 0.0, 0.0])
        np.testing.assert_array_equal(jax.grad(lambda x: jnp.sum(safe_divide(x, x)))(x), [0.0, 0.0, 0.0])


def newton(function, start):
    def step(_, x):
        value, slope = jax.jvp(function, (x,), (jnp.ones_like(x),))
        return x - safe_divide(value, slope)

    return jax.lax.fori_loop(0, 40, step, start)


class TestRoot:
    """x² + b x = c has the root (√(b² + 4c) - b) / 2."""

    at = jnp.asarray([0.7, 2.3])

    @staticmethod
    def found(p):
        return root(lambda x: x * x + p[0] * x - p[1], jnp.asarray(1.0), newton)

    @staticmethod
    def exact(p):
        return 0.5 * (jnp.sqrt(p[0] ** 2 + 4 * p[1]) - p[0])

    def test_value(self):
        np.testing.assert_allclose(jax.jit(self.found)(self.at), self.exact(self.at), rtol=4 * EPS)

    @pytest.mark.parametrize("mode", MODES)
    def test_gradient(self, mode):
        np.testing.assert_allclose(
            MODES[mode](self.found)(self.at), jax.jacfwd(self.exact)(self.at), rtol=1e-14, strict=True
        )

    @pytest.mark.parametrize(("outer", "inner"), NESTED)
    def test_second_derivative(self, outer, inner):
        found = jax.jit(MODES[outer](MODES[inner](self.found)))(self.at)
        np.testing.assert_allclose(found, jax.hessian(self.exact)(self.at), rtol=1e-13)

    def test_third_derivative(self):
        found = jax.jacfwd(jax.jacrev(jax.jacfwd(self.found)))(self.at)
        exact = jax.jacfwd(jax.jacfwd(jax.jacfwd(self.exact)))(self.at)
        np.testing.assert_allclose(found, exact, rtol=1e-12)

    def test_modes_and_differences(self, rng):
        assert_gradients_agree(self.found, self.at, rng)

    def test_batches(self):
        batch = jnp.asarray([[0.7, 2.3], [-1.0, 5.0], [3.0, 0.1]])
        found = jax.vmap(jax.grad(self.found))(batch)
        np.testing.assert_allclose(found, jax.vmap(jax.grad(self.exact))(batch), rtol=1e-13)

    def test_nothing_flows_through_the_search(self):
        assert jax.grad(lambda start: root(lambda x: x * x - 2.0, start, newton))(jnp.asarray(1.0)) == 0

    @pytest.mark.parametrize("mode", MODES)
    def test_where_the_slope_vanishes(self, mode):
        def touching(p):
            return root(lambda x: (x - p) ** 2, p, lambda _, start: start)

        assert MODES[mode](touching)(jnp.asarray(0.5)) == 0


class TestEnvelope:
    """p x - x⁴ / 4 is largest at x = ∛p, where it is ¾ p^(4/3)."""

    at = jnp.asarray(1.7)

    @staticmethod
    def height(x, p):
        return p * x - 0.25 * x**4

    def largest(self, p):
        x = root(lambda x: p - x**3, jnp.asarray(1.0), newton)
        return self.height(envelope(x, jnp.zeros_like(x)), p)

    def test_value(self):
        np.testing.assert_allclose(self.largest(self.at), 0.75 * self.at ** (4 / 3), rtol=4 * EPS)

    @pytest.mark.parametrize("mode", MODES)
    def test_first_derivative_drops(self, mode):
        assert MODES[mode](lambda x: envelope(x, jnp.asarray(0.0)))(self.at) == 0
        np.testing.assert_allclose(MODES[mode](self.largest)(self.at), self.at ** (1 / 3), rtol=1e-14)

    @pytest.mark.parametrize(("outer", "inner"), NESTED)
    def test_second_derivative(self, outer, inner):
        found = MODES[outer](MODES[inner](self.largest))(self.at)
        np.testing.assert_allclose(found, self.at ** (-2 / 3) / 3, rtol=1e-13)

    @pytest.mark.parametrize("mode", MODES)
    def test_moving_edge(self, mode):
        """On [0, p/2] with p < 2√2 the maximum is at the edge: p²/2 - p⁴/64."""

        def at_edge(p):
            edge = 0.5 * p
            fixed = jax.lax.stop_gradient(edge)
            return self.height(envelope(fixed, edge - fixed), p)

        np.testing.assert_allclose(at_edge(self.at), self.at**2 / 2 - self.at**4 / 64, rtol=4 * EPS)
        np.testing.assert_allclose(MODES[mode](at_edge)(self.at), self.at - self.at**3 / 16, rtol=1e-14)


class TestOnce:
    def test_is_the_identity(self, rng):
        x = jnp.asarray(
            np.concatenate([rng.normal(size=1000) * 10.0 ** rng.integers(-300, 300, size=1000), [0.0, -0.0]])
        )
        np.testing.assert_array_equal(once(x), x)
        np.testing.assert_array_equal(jax.jit(once)(x), x)

    @pytest.mark.parametrize("mode", MODES)
    def test_derivatives(self, mode):
        x = jnp.asarray(3.7)
        assert MODES[mode](once)(x) == 1
        assert MODES[mode](MODES[mode](once))(x) == 0


class TestSincos:
    @pytest.fixture
    def x(self, rng):
        turns = 0.5 * np.pi * np.concatenate([np.arange(-8, 9), rng.integers(-60000, 60000, size=200)])
        near = [turns, np.nextafter(turns, np.inf), np.nextafter(turns, -np.inf), turns / 2]
        return np.concatenate([rng.uniform(-10, 10, 1000), rng.uniform(-1e5, 1e5, 1000), *near, [0.0, 1e-300, -1e-9]])

    @pytest.mark.parametrize("compiled", [False, True])
    def test_two_units_in_the_last_place(self, x, compiled):
        sine, cosine = (jax.jit(sincos) if compiled else sincos)(jnp.asarray(x))
        with mpmath.workdps(60):
            points = [mpmath.mpf(float(v)) for v in x]
            assert np.max(ulps(sine, [mpmath.sin(v) for v in points])) <= 2
            assert np.max(ulps(cosine, [mpmath.cos(v) for v in points])) <= 2

    @pytest.mark.parametrize("mode", MODES)
    def test_derivatives(self, mode):
        x = jnp.linspace(-7.0, 7.0, 29)
        sine, cosine = sincos(x)
        first = jax.vmap(MODES[mode](lambda x: jnp.stack(sincos(x))))(x)
        second = jax.vmap(MODES[mode](MODES[mode](lambda x: jnp.stack(sincos(x)))))(x)
        np.testing.assert_array_equal(first, np.stack([cosine, -sine], axis=1))
        np.testing.assert_array_equal(second, np.stack([-sine, -cosine], axis=1))
