"""Random designs, most of them bad machines: how many values and gradients are not finite, and the time for each.

Run: python -m benchmarks.finite [COUNT]      (default 1e6 designs of each machine: two minutes on two cores)

Every scene parameter is multiplied by a random factor, a third of them by up to ten or a tenth. Values: δ, peak shaking
force at constant speed, least assembly margin; gradient: of their scaled sum by all scene parameters, 64 nodes.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from benchmarks._timing import line

SCENES = ("hay-press", "quick-return")
TOGETHER = 20_000
NODES = 64


def functions(scene: lj.Scene) -> tuple[Any, Any, np.ndarray]:
    """Values and gradient as functions of all scene parameters in a row, and these."""
    leaves, tree = jax.tree.flatten(scene)
    asked = [lj.measures.delta, lj.measures.peak_shaking_force_constant_speed, lj.measures.min_margin]

    def values(row):
        return jnp.stack(list(lj.measures.evaluate(jax.tree.unflatten(tree, list(row)), asked, NODES).values()))

    scales = 1 / np.maximum(np.abs(np.asarray(values(jnp.asarray(leaves)))), 1e-9)
    return values, jax.grad(lambda row: jnp.sum(values(row) * scales)), np.asarray(leaves, float)


def factors(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """Random factors: most near one, a third between a tenth and ten, some negative."""
    near, far = 1 + 0.1 * rng.normal(size=shape), 10 ** rng.uniform(-1, 1, size=shape)
    return np.where(rng.random(shape) < 1 / 3, far, near) * np.where(rng.random(shape) < 0.01, -1, 1)


def main(count: int) -> None:
    """One line for each machine and function."""
    lj.use_cpu_devices()
    lj.enable_x64()
    line("devices", len(jax.devices()), jax.devices()[0].device_kind.replace(" ", "_"))
    gpu, rng = jax.devices()[0].platform != "cpu", np.random.default_rng(0)
    for name in SCENES:
        values, gradient, start = functions(lj.load(name))
        for what, function, block in (("values", values, 50), ("gradients", gradient, 25)):
            mapped = lj.map_designs(function, block=TOGETHER if gpu else block)
            begin = time.perf_counter()
            jax.block_until_ready(mapped(jnp.asarray(start * factors(rng, (TOGETHER, start.size)))))
            compiling, wrong, spent = time.perf_counter() - begin, 0, 0.0
            for _ in range(count // TOGETHER):
                designs = jnp.asarray(start * factors(rng, (TOGETHER, start.size)))
                begin = time.perf_counter()
                found = np.asarray(mapped(designs))
                spent += time.perf_counter() - begin
                wrong += int(np.sum(~np.isfinite(found).all(axis=1)))
            done = count // TOGETHER * TOGETHER
            line(f"finite.{name}.{what}.compile", compiling, "s")
            line(f"finite.{name}.{what}", 1e6 * spent / done, "us/design")
            line(f"finite.{name}.{what}.not_finite", wrong, f"of_{done}")


if __name__ == "__main__":
    main(int(float(sys.argv[1])) if len(sys.argv) > 1 else 1_000_000)
