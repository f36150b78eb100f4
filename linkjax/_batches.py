"""A machine as the numerics see it: a function of many places of the cycle at once.

Outside of jax transformations every batch is padded to one size, so a machine is compiled once, however many batches
are asked for. Inside of them (`jax.grad`, `jax.jit`, `jax.vmap`) the same code is traced at the size given.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from linkjax._types import Tracer

PLACES = 128  # places of a batch; more are taken in several batches


@jax.tree_util.register_pytree_node_class
class Whole:
    """A design whose leaves are at hand: a program that takes it gets the design."""

    def __init__(self, design: Any):
        self.leaves, self.structure = jax.tree.flatten(design)

    def tree_flatten(self) -> tuple[list[Any], Any]:
        """Leaves and structure of the design."""
        return self.leaves, self.structure

    @classmethod
    def tree_unflatten(cls, structure: Any, leaves: Any) -> Any:
        """The design."""
        return jax.tree.unflatten(structure, leaves)


class Batches:
    """A design evaluated at many places at once by `program(design, *places)`, a function made by `compiled_soon`.

    Results have a leading axis of places. Outside of jax transformations they are padded: only as many as were asked
    for are meaningful. `size` is the number of places of a batch.
    """

    def __init__(self, design: Any, size: int = PLACES):
        self.design, self.size = design, size
        self.traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(design))

    @functools.cached_property
    def still(self) -> Any:
        """The design without derivatives."""
        return jax.lax.stop_gradient(self.design) if self.traced else self.design

    @functools.cached_property
    def whole_design(self) -> Any:
        """The design as an argument of programs."""
        return self.design if self.traced else Whole(self.design)

    def ask(self, program: Any, *places: Any, fixed: bool = False, **static: Any) -> Any:
        """The results of a program at these places, each of shape (places,); without derivatives with respect to the
        design if `fixed`."""
        design = self.still if fixed and self.traced else self.whole_design
        return joined(self.parts(program, (design,), self.padded(places), **static))

    def parts(self, program: Any, given: tuple[Any, ...], places: tuple[Any, ...], **static: Any) -> list[Any]:
        """The results of a program that takes what is given, and arrays with a leading axis of places, batch by batch;
        all together inside of jax transformations."""
        leaves, tree = jax.tree.flatten(places)
        count = leaves[0].shape[0]
        if count == self.size or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((given, leaves))):
            return [self.run(program, *given, *places, **static)]
        leaves, found = self._at_hand(leaves), []
        for first in range(0, count, self.size):
            part = jax.tree.unflatten(tree, [self._slice(leaf, first) for leaf in leaves])
            found.append(self.run(program, *given, *part, **static))
        return found

    def _at_hand(self, leaves: list[Any]) -> list[Any]:
        return [np.asarray(leaf) for leaf in leaves]

    def _slice(self, leaf: Any, first: int) -> Any:
        return leaf[first : first + self.size]

    def run(self, stage: Any, *args: Any, **static: Any) -> Any:
        """The result of a stage of the numerics, a function made by `compiled_soon`."""
        return stage(*args, **static)

    def loop(self, times: int, step: Callable[[Any], Any], state: Any) -> Any:
        """`times` steps; inside of jax transformations in a loop that is traced once."""
        if times > 1 and (self.traced or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(state))):
            return jax.lax.fori_loop(0, times, lambda _, state: step(state), state)
        for _ in range(times):
            state = step(state)
        return state

    def until(self, going: Callable[[Any], Any], step: Callable[[Any], Any], state: Any, *given: Any) -> Any:
        """Steps while `going(state)`; inside of jax transformations, or where `given` is traced, in a loop that is
        traced once."""
        if self.traced or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(given)):
            return jax.lax.while_loop(going, step, state)
        while bool(going(state)):
            state = step(state)
        return state

    def padded(self, places: Any) -> Any:
        """Places, a tree of arrays of one axis, padded to the size of a batch by repeating the last one."""
        if self.traced or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(places)):
            return places
        return jax.tree.map(self._padded, places)

    def _padded(self, place: Any) -> Any:
        count, size = place.shape[0], self.whole(place.shape[0])
        if count == size:
            return place
        given, found = np.asarray(place), np.empty(size, place.dtype)
        found[:count], found[count:] = given, given[-1]
        return found

    def cut(self, results: Any, places: Any) -> Any:
        """Results of a batch without the padding: as many as `places`."""
        count, leaves = places.shape[0], jax.tree.leaves(results)
        if all(leaf.shape[0] == count and not isinstance(leaf, np.ndarray) for leaf in leaves):
            return results
        if any(isinstance(leaf, Tracer) for leaf in leaves):
            return jax.tree.map(lambda leaf: leaf[:count], results)
        return jax.device_put(jax.tree.map(lambda leaf: np.asarray(leaf)[:count], results))

    def whole(self, count: int) -> int:
        """The number of places in the batches for this many."""
        return -(-count // self.size) * self.size


def joined(parts: list[Any], axis: int = 0) -> Any:
    """Results of several batches as one; their places are along an axis."""
    if len(parts) == 1:
        return parts[0]
    trees = [jax.tree.flatten(part) for part in parts]
    if isinstance(trees[0][0][0], jax.ShapeDtypeStruct):
        leaves = [_lengthened(leaf, axis, len(parts)) for leaf in trees[0][0]]
    else:
        leaves = [np.concatenate([np.asarray(leaf) for leaf in leaves], axis)
                  for leaves in zip(*(leaves for leaves, _ in trees), strict=True)]  # fmt: skip
    return jax.tree.unflatten(trees[0][1], leaves)


def _lengthened(leaf: Any, axis: int, times: int) -> Any:
    shape = list(leaf.shape)
    shape[axis] *= times
    return jax.ShapeDtypeStruct(tuple(shape), leaf.dtype)


class Ahead(Batches):
    """The same for shapes instead of values: it starts compiling every program that the values will need."""

    def run(self, stage: Any, *args: Any, **static: Any) -> Any:
        return stage.ahead(*args, **static)

    def until(self, going: Callable[[Any], Any], step: Callable[[Any], Any], state: Any, *given: Any) -> Any:
        return step(state)

    def _at_hand(self, leaves: list[Any]) -> list[Any]:
        return leaves

    def _slice(self, leaf: Any, first: int) -> Any:
        return jax.ShapeDtypeStruct((self.size, *leaf.shape[1:]), leaf.dtype)

    def _padded(self, place: Any) -> Any:
        return jax.ShapeDtypeStruct((self.whole(place.shape[0]),), place.dtype)

    def cut(self, results: Any, places: Any) -> Any:
        count = places.shape[0]
        return jax.tree.map(lambda leaf: jax.ShapeDtypeStruct((count, *leaf.shape[1:]), leaf.dtype), results)
