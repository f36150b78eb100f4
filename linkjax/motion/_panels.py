"""Gauss-Legendre panels: nodes, integration and interpolation as small constant matrices.

Source: Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, ch. 17-19.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import chebyshev, legendre


class Rule(NamedTuple):
    """Constant matrices of an n-node rule on [-1, 1]; most are applied to values at the nodes."""

    x: np.ndarray  # nodes
    w: np.ndarray  # weights
    spectrum: np.ndarray  # Legendre coefficients of the interpolant
    series: np.ndarray  # its Chebyshev coefficients
    primitive: np.ndarray  # Chebyshev coefficients (degree n) of the integral from -1
    fine: np.ndarray  # points of the search grid, both ends included
    to_fine: np.ndarray  # interpolant on the search grid
    at_nodes: np.ndarray  # a Chebyshev series of degree n at the nodes
    points: np.ndarray  # low end, nodes, high end
    at_points: np.ndarray  # a Chebyshev series of degree n there
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
    fine = np.cos(np.pi * np.arange(2 * n, -1, -1) / (2 * n))
    points = np.concatenate([[-1.0], x, [1.0]])
    slopes = np.stack([chebyshev.chebval(points, chebyshev.chebder(one)) for one in np.eye(n + 1)], axis=1)
    changed = _to_chebyshev(n + 1)
    return Rule(
        x, w, spectrum, changed[:n, :n] @ spectrum, changed @ raise_degree @ spectrum,
        fine, legendre.legvander(fine, n - 1) @ spectrum, chebyshev.chebvander(x, n),
        points, chebyshev.chebvander(points, n), slopes,
        legendre.legvander(points[[0, -1]], n - 1) @ spectrum, *_hermite(x),
    )  # fmt: skip


def _to_chebyshev(count: int) -> np.ndarray:
    """Chebyshev coefficients of the first `count` Legendre polynomials, one column each."""
    at = chebyshev.chebpts1(count)
    return np.linalg.solve(chebyshev.chebvander(at, count - 1), legendre.legvander(at, count - 1))


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


def polynomials(count: int, x: Float[Array, "*places"]) -> Float[Array, "*places count"]:
    """The first `count` Chebyshev polynomials at `x`, each round from the last ones: T(m+k) = 2 T(m) T(k) - T(m-k).

    Twenty equations for sixteen terms, and few for many. Unrolled Legendre recurrences took eighty, and a cycle of 640
    nodes once took 60 s to compile.
    """
    found = jnp.stack([jnp.ones_like(x), x], axis=-1)
    while (m := found.shape[-1] - 1) < count - 1:
        more = 2 * found[..., m:] * found[..., 1:] - found[..., m - 1 :: -1]
        found = jnp.concatenate([found, more], axis=-1)
    return found[..., :count]


def series_sum(coefficients: Float[Array, "*places k"], x: Float[Array, "*places"]) -> Float[Array, "*places"]:
    """Values of Chebyshev series at `x`."""
    return jnp.sum(coefficients * polynomials(coefficients.shape[-1], x), axis=-1)
