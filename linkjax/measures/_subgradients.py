"""The gradients of an extreme where several values are equal: one for each of them."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._batches import Whole
from linkjax._compile import compiled_soon
from linkjax.machine import Scene, nameless
from linkjax.measures._parts import NODES, Parts
from linkjax.measures._registry import Measure, named, needs_of
from linkjax.motion import Rows, every_row

TIED = 1e-9  # relative: values this close are equal
SAME = 1e-6  # relative: gradients this close are one
MOST = 64  # equal values that are looked at


class Subgradient(NamedTuple):
    """One of the equal values of an extreme: its crank angle (rad, NaN if it has none), and its gradient, a scene."""

    angle: float
    gradient: Scene


def subgradients(scene: Scene, measure: Measure | str, nodes: int = NODES) -> list[Subgradient]:
    """The gradients of every value that is the largest (or smallest) one, with respect to the scene.

    Where several values of an extreme are equal, its change with the design is that of the value that becomes the
    largest; `jax.grad` gives the gradient of one of them. A measure without equal values, or that is no extreme, has
    one gradient. Values within 1e-9 of the extreme count as equal, and gradients within 1e-6 of each other as one. For
    a measure of the package or its name; a measure of one's own is traced anew at every call. Raises `StructureError`
    for a name that is not a measure of this scene. Source: Clarke, Optimization and Nonsmooth Analysis, 1983, ch. 2.
    """
    asked = named(measure) if isinstance(measure, str) else measure
    asked.check(scene)
    plain, names = nameless(scene) if asked.built_in else (scene, None)
    inside = asked.without_names(plain, names)
    known: Any = inside.name if inside.built_in else inside
    program = _weighted if inside.built_in else compiled_soon(_weighted.function, static=("measure", "nodes"))
    found, _ = program(Whole(plain), jnp.zeros(0), measure=known, nodes=nodes)
    values = np.asarray(found.size())
    best = np.nanmin(values) if asked.smallest else np.nanmax(values)
    kept: list[Subgradient] = []
    flat: list[np.ndarray] = []
    for row in np.flatnonzero(np.abs(values - best) <= TIED * abs(best))[:MOST]:
        weights = jnp.asarray(np.eye(1, values.size, row)[0])
        _, slope = program(Whole(plain), weights, measure=known, nodes=nodes)
        numbers = np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(slope)])
        if all(np.linalg.norm(numbers - other) > SAME * np.linalg.norm(other) for other in flat):
            flat.append(numbers)
            kept.append(Subgradient(float(found.angle[row]), slope if names is None else names.back(slope)))
    return kept


@compiled_soon(static=("measure", "nodes"))
def _weighted(scene: Scene, weights: Array, measure: Any, nodes: int) -> tuple[Rows, Any]:
    """The rows of an extreme, and the gradient of the sum of their sizes times the weights (none: of nothing)."""
    asked = named(measure) if isinstance(measure, str) else measure

    def rows(scene: Scene) -> Rows:
        parts = Parts(scene, nodes, breaks=asked.breaks, **needs_of([asked]))
        if asked.rows is None:
            return Rows(asked.function(parts).reshape((1, 1)), jnp.full(1, jnp.nan), signed=True)
        return every_row([asked.rows(parts)])[0]

    if not weights.size:
        return rows(scene), None
    found, pull = jax.vjp(lambda scene: rows(scene).size(), scene)
    return Rows(found[:, None], jnp.full(found.size, jnp.nan), signed=True), pull(weights)[0]
