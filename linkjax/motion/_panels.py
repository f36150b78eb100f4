"""Gauss-Legendre panels: nodes, integration and interpolation as small constant matrices.

Source: Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, ch. 17-19.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import legendre

UNROLLED = 40  # the most Legendre polynomials computed without a loop


class Rule(NamedTuple):
    """Constant matrices of an n-node rule on [-1, 1]; most are applied to values at the nodes."""

    x: np.ndarray  # nodes
    w: np.ndarray  # weights
    spectrum: np.ndarray  # Legendre coefficients of the interpolant
    primitive: np.ndarray  # Legendre coefficients (degree n) of the integral from -1
    fine: np.ndarray  # points of the search grid, both ends included
    to_fine: np.ndarray  # interpolant on the search grid
    at_nodes: np.ndarray  # a series of degree n at the nodes
    points: np.ndarray  # low end, nodes, high end
    at_points: np.ndarray  # a series of degree n there
    slope_at_points: np.ndarray  # its derivative there
    ends: np.ndarray  # interpolant at the two ends
    hermite_ends: tuple[np.ndarray, np.ndarray]  # Hermite interpolant at the two ends, from values and slopes
    hermite_slopes: tuple[np.ndarray, np.ndarray]  # its slope there


@functools.lru_cache(maxsize=32)
def rule(n: int) -> Rule:
    """The n-node Gauss-Legendre rule with its matrices (NumPy, computed once)."""
    x, w = legendre.leggauss(n)
    k = np.arange(n)
    spectrum = (k[:, None] + 0.5) * legendre.legvander(x, n - 1).T * w
    raise_degree = np.zeros((n + 1, n))  # Legendre coefficients of the integral of P_j
    for j in range(n):
        raise_degree[j + 1, j] += 1 / (2 * j + 1)
        raise_degree[max(j - 1, 0), j] -= 1 / (2 * j + 1) if j else -1.0
    primitive = raise_degree @ spectrum
    fine = np.cos(np.pi * np.arange(2 * n, -1, -1) / (2 * n))
    points = np.concatenate([[-1.0], x, [1.0]])
    slopes = np.stack([legendre.legval(points, legendre.legder(one)) for one in np.eye(n + 1)], axis=1)
    return Rule(
        x, w, spectrum, primitive, fine, legendre.legvander(fine, n - 1) @ spectrum, legendre.legvander(x, n),
        points, legendre.legvander(points, n), slopes,
        legendre.legvander(points[[0, -1]], n - 1) @ spectrum, *_hermite(x),
    )  # fmt: skip


def _hermite(x: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Values and slopes at the two ends of the Hermite interpolant, each as matrices for node values and slopes."""
    n, ends = x.size, np.asarray([-1.0, 1.0])
    apart = x[:, None] - x[None] + np.eye(n)
    own = np.sum((1 - np.eye(n)) / apart, axis=1)  # slope of each Lagrange polynomial at its own node
    away = ends[:, None] - x[None]
    lagrange = np.prod(away, axis=1, keepdims=True) / away / np.prod(apart, axis=1)
    tilt = lagrange * (np.sum(1 / away, axis=1, keepdims=True) - 1 / away)
    straight, square, double = 1 - 2 * away * own, lagrange**2, 2 * lagrange * tilt
    return (straight * square, away * square), (straight * double - 2 * own * square, away * double + square)


def legendre_sum(coefficients: Float[Array, "*rows k"], x: Float[Array, ""]) -> Float[Array, "*rows"]:
    """Value of Legendre series at `x`, by the three-term recurrence."""
    return coefficients @ legendre_basis(coefficients.shape[-1], x)


def legendre_basis(count: int, x: Float[Array, ""]) -> Float[Array, " k"]:
    """The first `count` Legendre polynomials at `x`; many are computed in a loop, which compiles sooner."""
    if count > UNROLLED:
        k = jnp.arange(1, count - 1, dtype=x.dtype)

        def following(pair, weights):
            before, last = pair
            new = weights[0] * x * last - weights[1] * before
            return (last, new), new

        rest = jax.lax.scan(following, (jnp.ones_like(x), x), ((2 * k + 1) / (k + 1), k / (k + 1)))[1]
        return jnp.concatenate([jnp.stack([jnp.ones_like(x), x]), rest])
    basis = [jnp.ones_like(x), x]
    for k in range(1, count - 1):
        basis.append(((2 * k + 1) / (k + 1)) * x * basis[k] - (k / (k + 1)) * basis[k - 1])
    return jnp.stack(basis[:count])
