"""Comparisons used by several tests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.kinematics import Prepared, pose, prepared
from linkjax.scenes import loads_text, text_of

ANGLES = np.linspace(0.0, 2 * np.pi, 25)
ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "linkjax"


def assert_gradients_agree(
    function: Callable[[Any], jax.Array],
    tree: Any,
    rng: np.random.Generator,
    *,
    forward: float = 1e-10,
    difference: float = 1e-6,
    step: float = 1e-4,
    directions: int = 3,
) -> None:
    """Gradients of a scalar `function` of a pytree: reverse against forward mode, and against differences.

    Every leaf is scaled by its own size (by one if it is zero), and errors are relative to the norm of the scaled
    gradient. Differences are central, of fourth order, along random directions; `step` is relative.
    """
    flat, rebuild = ravel_pytree(tree)
    scale = jnp.where(flat == 0, 1.0, jnp.abs(flat))

    def scaled(x):
        return function(rebuild(flat + scale * x))

    origin = jnp.zeros_like(flat)
    reverse = np.asarray(compiled_soon(jax.grad(scaled))(origin))
    ahead = np.asarray(compiled_soon(jax.jacfwd(scaled))(origin))
    size = np.linalg.norm(reverse)
    assert np.all(np.isfinite(reverse)), "the gradient is not finite"
    assert size > 0, "the gradient is zero"
    assert np.linalg.norm(reverse - ahead) <= forward * size, "reverse and forward mode differ"
    value = compiled_soon(scaled)
    for _ in range(directions):
        d = rng.normal(size=flat.shape)
        d /= np.linalg.norm(d)
        near, far = (float(value(h * d) - value(-h * d)) for h in (step, 2 * step))
        slope = (8 * near - far) / (12 * step)
        assert abs(slope - reverse @ d) <= difference * size, "gradient and differences differ"


def ulps(value: Any, exact: Any) -> np.ndarray:
    """Errors of float64 values, in units in the last place of the exact ones (numbers of any precision)."""
    pairs = zip(np.asarray(value, dtype=float), exact, strict=True)
    return np.asarray([abs(float((float(v) - e) / float(np.spacing(abs(float(e)))))) for v, e in pairs])


def at(mechanism: lj.Mechanism | Prepared, angles: Any = ANGLES) -> Any:
    """Poses over crank angles."""
    return compiled_soon(lambda m: jax.vmap(lambda phi: pose(m, phi))(jnp.asarray(angles)))(prepared(mechanism))


def xy(at: lj.Vec) -> np.ndarray:
    """Both coordinates."""
    return np.stack([at.x, at.y])


def same(scene: lj.Scene) -> None:
    """A scene is identical to the last bit after it is written to a file and read again."""
    again = loads_text(text_of(scene))
    for one, two in zip(jax.tree.leaves(scene), jax.tree.leaves(again), strict=True):
        assert np.array_equal(one, two)
    assert jax.tree.structure(scene) == jax.tree.structure(again)


PUMP = """\
[[groups]]
kind = "crank"
link = "crank"
pivot = "O"
end = "A"
[[groups]]
kind = "RRP"
link = "rod"
from = "A"
end = "B"
block = "piston"
guide = { through = "O" }
[[loads]]
name = "pressure"
link = "piston"
point = "B"
force = "2 kN"
opposing = true
window = ["0 deg", "180 deg"]
"""  # a slider-crank that presses against a load, without fixed points and links
