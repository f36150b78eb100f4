"""Array aliases: every physical quantity at one crank angle is a scalar array; axes come only from `vmap`."""

import re
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer as Tracer
from jaxtyping import Array, Float

Scalar = Float[Array, ""]
Angles = Float[Array, " angles"]
Nodes = Float[Array, " nodes"]
Panels = Float[Array, "panels nodes"]
ScalarFunction = Callable[[Scalar], Scalar]


def known(value: Any) -> np.ndarray | None:
    """The numbers of an array for checks on input; None while it is traced or a placeholder."""
    if isinstance(value, Tracer) or not isinstance(value, jax.Array | np.ndarray):
        return None
    return np.asarray(value)


def not_finite(tree: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Numbers of a tree that are not finite, with their places, as `links.rod.mass`; traced ones are not seen."""
    for path, leaf in jax.tree_util.tree_leaves_with_path(tree):
        value = known(leaf)
        if value is not None and not np.all(np.isfinite(value)):
            yield re.sub(r"\['([^']*)'\]", r".\1", jax.tree_util.keystr(path)).lstrip("."), value


def as_float(value: Any) -> Any:
    """Return `value` as a floating-point array of the precision in force (float64 after `linkjax.enable_x64()`).

    Tracers, arrays and the placeholders that JAX puts into trees pass through unchanged. Raises `TypeError` if `value`
    is not a number.
    """
    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jnp.integer):
        return value.astype(float)
    if isinstance(value, jax.Array) or hasattr(value, "aval") or type(value) is object or value is None:
        return value
    try:
        return jnp.asarray(None if isinstance(value, str) else value, dtype=float)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{value!r} where a number is needed; write it in SI units, e.g. 0.3 for 300 mm") from error
