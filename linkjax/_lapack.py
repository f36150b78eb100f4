"""Linear algebra of many small matrices at once, without deadlock.

The LAPACK routines of jaxlib pass a batch of 200 000 operations or more to XLA's threads and wait for it in one of
these threads. If as many batches wait as there are threads, all wait for ever (seen on two cores, jaxlib 0.10.2). Here
a batch is processed in smaller shares, under any vmap.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap
from jaxtyping import Array

WORK = 180_000  # operations in a share; jaxlib uses its threads from 200 000 on


def _in_shares(function: Callable[..., Any], cost: Callable[..., int]) -> Callable[..., Any]:
    """A function of a matrix and further arrays, vmapped in shares; without derivatives."""

    @custom_vmap
    def many(*arrays: Array):
        batch = arrays[0].shape[:-2]
        if not batch:
            return function(*arrays)
        count, cores = math.prod(batch), [x.shape[len(batch) :] for x in arrays]
        share = max(1, WORK // cost(*cores))
        rows = tuple(x.reshape((count, *core)) for x, core in zip(arrays, cores, strict=True))
        whole = jax.vmap(function)
        if count <= share:
            found = whole(*rows)
        else:
            found = jax.lax.platform_dependent(
                *rows, cpu=lambda *rows: jax.lax.map(lambda row: function(*row), rows, batch_size=share), default=whole
            )
        return jax.tree.map(lambda x: x.reshape((*batch, *x.shape[1:])), found)

    @many.def_vmap
    def _rule(size: int, batched: list[bool], *arrays: Array):
        every = (x if b else jnp.broadcast_to(x, (size, *x.shape)) for x, b in zip(arrays, batched, strict=True))
        found = many(*every)
        return found, jax.tree.map(lambda _: True, found)

    return many


def _triangular(factors: Array, b: Array, lower: bool, transposed: bool) -> Array:
    return jax.lax.linalg.triangular_solve(
        factors, b, left_side=True, lower=lower, transpose_a=transposed, unit_diagonal=lower
    )


def _forward(factors: Array, order: Array, b: Array) -> Array:
    return _triangular(factors, _triangular(factors, b[order], True, False), False, False)


def _transposed(factors: Array, order: Array, b: Array) -> Array:
    x = _triangular(factors, _triangular(factors, b, False, True), True, True)
    return jnp.zeros_like(x).at[order].set(x)


_factored = _in_shares(lambda a: tuple(jax.lax.linalg.lu(a)[:2]), lambda a: math.prod(a) * min(a))
_ahead, _back = (_in_shares(f, lambda a, _, b: a[0] * math.prod(b)) for f in (_forward, _transposed))
_decomposed, _pseudo = (
    _in_shares(f, lambda a: 10 * math.prod(a) * min(a)) for f in (lambda a: tuple(jnp.linalg.svd(a)), jnp.linalg.pinv)
)


def solver(a: Array) -> Callable[[Array], Array]:
    """The function b -> x of a x = b, for a of shape (n, n) and b of shape (n,) or (n, m), with a factored once;
    differentiable as `jnp.linalg.solve`."""
    factors, pivots = _factored(jax.lax.stop_gradient(a))
    order = jax.lax.linalg.lu_pivots_to_permutation(pivots, a.shape[0])  # a loop, done once for all shares

    def solved(b: Array) -> Array:
        x = jax.lax.custom_linear_solve(
            lambda x: a @ x,
            b if b.ndim == 2 else b[:, None],
            solve=lambda _, x: _ahead(factors, order, x),
            transpose_solve=lambda _, x: _back(factors, order, x),
        )
        return x if b.ndim == 2 else x[:, 0]

    return solved


def solve(a: Array, b: Array) -> Array:
    """x of a x = b, for a of shape (n, n) and b of shape (n,) or (n, m); differentiable as `jnp.linalg.solve`."""
    return solver(a)(b)


def inverted(a: Array) -> Array:
    """The inverse, shape (n, n)."""
    return solve(a, jnp.eye(a.shape[0], dtype=a.dtype))


def sign_of_determinant(a: Array) -> Array:
    """Sign of the determinant, shape (); without derivatives."""
    return _pivots(a)[0]


def mean_of_determinant(a: Array) -> Array:
    """The determinant's sign times the geometric mean of the pivots, shape (): the n-th root cannot overflow. Without
    derivatives."""
    sign, pivots = _pivots(a)
    return sign * jnp.exp(jnp.mean(jnp.log(jnp.abs(pivots))))


def _pivots(a: Array) -> tuple[Array, Array]:
    """Sign of the determinant, and the pivots, whose product is the determinant up to its sign."""
    factors, order = _factored(jax.lax.stop_gradient(a))
    swaps, pivots = jnp.sum(order != jnp.arange(order.size, dtype=order.dtype)), jnp.diagonal(factors)
    sign = jnp.prod(jnp.sign(pivots))
    return jnp.where(swaps % 2 == 1, -sign, sign), pivots


def svd(a: Array) -> tuple[Array, Array, Array]:
    """Left singular vectors, singular values and right ones as from `jnp.linalg.svd`; without derivatives."""
    return _decomposed(jax.lax.stop_gradient(a))


def pinv(a: Array) -> Array:
    """The pseudo-inverse of a matrix of shape (n, m), shape (m, n); without derivatives."""
    return _pseudo(jax.lax.stop_gradient(a))
