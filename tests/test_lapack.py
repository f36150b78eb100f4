"""Linear algebra of many small matrices, against NumPy; and no batch for which LAPACK's caller would wait."""

from __future__ import annotations

import dataclasses
import math
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax._lapack import WORK, inverted, pinv, sign_of_determinant, solve, svd
from tests.physics.machines import machine

HANDED_ON = 200_000  # operations from which jaxlib passes a batch to other threads: `GetLapackBatchChunkSize`
EACH = {"getrf": 1, "trsm": 1, "gesdd": 10}  # operations, by the cube of the size


@pytest.mark.parametrize("n", [1, 2, 9, 30])
@pytest.mark.parametrize("batch", [(1,), (150, 3)])
def test_as_numpy(n, batch):
    """Through two vmaps, in one share or in several with a remainder."""
    rng = np.random.default_rng(n)
    a, b = rng.normal(size=(*batch, n, n)), rng.normal(size=(*batch, n, 2))

    def every(a, b):
        u, s, v = svd(a)
        return solve(a, b), solve(a, b[:, 0]), inverted(a), sign_of_determinant(a), u @ jnp.diag(s) @ v, s, pinv(a)

    for _ in batch:
        every = jax.vmap(every)
    x, first, inverse, sign, again, sizes, pseudo = map(np.asarray, jax.jit(every)(a, b))
    condition = float(np.max(np.linalg.cond(a)))
    np.testing.assert_allclose(x, np.linalg.solve(a, b), rtol=0, atol=1e-14 * condition * np.abs(x).max())
    np.testing.assert_allclose(first, x[..., 0], rtol=0, atol=1e-14 * condition * np.abs(x).max())
    for found in (inverse, pseudo):
        np.testing.assert_allclose(found, np.linalg.inv(a), rtol=0, atol=1e-14 * condition * np.abs(inverse).max())
    np.testing.assert_array_equal(sign, np.linalg.slogdet(a)[0])
    np.testing.assert_allclose(again, a, rtol=0, atol=1e-14 * n)
    np.testing.assert_allclose(sizes, np.linalg.svd(a, compute_uv=False), rtol=0, atol=1e-14 * n)


def test_derivatives():
    """Forward over reverse of a vmapped solution, against those of `jnp.linalg.solve`."""
    rng = np.random.default_rng(0)
    a, b, d = (jnp.asarray(rng.normal(size=(400, 6, *rest))) for rest in ((6,), (), (6,)))

    def slopes(one):
        def total(a):
            return jnp.sum(jnp.sin(jax.vmap(one)(a, b)))

        return jax.jit(lambda a: jax.jvp(jax.grad(total), (a,), (d,)))(a)

    for found, true in zip(slopes(solve), slopes(jnp.linalg.solve), strict=True):
        np.testing.assert_allclose(found, true, rtol=0, atol=1e-11 * np.abs(true).max())
    (inverse,), (true,) = (jax.vjp(jax.vmap(f), a)[1](d) for f in (inverted, jnp.linalg.inv))
    np.testing.assert_allclose(inverse, true, rtol=0, atol=1e-12 * np.abs(true).max())


@pytest.mark.slow
def test_no_batch_is_handed_on():
    """Of a group of higher class, at many crank angles of many designs: a batch for other threads blocks its own
    thread, and all threads if as many arrive simultaneously."""
    scene = machine("scissor-lift")

    def cycle(scale):
        links = {k: dataclasses.replace(v, mass=v.mass * scale) for k, v in scene.mechanism.links.items()}
        changed = scene.with_mechanism(dataclasses.replace(scene.mechanism, links=links))
        return lj.measures.peak_reaction_constant_speed(changed, 256)

    text = jax.jit(jax.vmap(jax.grad(cycle))).lower(jnp.ones(8)).as_text()
    calls = re.findall(r"custom_call @lapack_[ds](\w+?)_ffi\(.*?: \((.*?)\) ->", text)
    assert {kind for kind, _ in calls} >= {"getrf", "trsm"}
    for kind, operands in calls:
        *batch, rows, columns = map(
            int, re.findall(r"tensor<([\dx]*)xf64>", operands)[-1].split("x")
        )  # right-hand sides
        work = EACH[kind] * rows * columns * (rows if kind == "trsm" else min(rows, columns))
        assert math.prod(batch) == 1 or math.prod(batch) * work <= WORK < HANDED_ON, (kind, operands)
