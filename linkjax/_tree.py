"""Plain classes of arrays that JAX can take apart fast; for values that are made and passed on very often."""

from __future__ import annotations

import dataclasses
from operator import attrgetter
from typing import Any, TypeVar, dataclass_transform, no_type_check

import equinox as eqx
import jax

Class = TypeVar("Class")


@dataclass_transform(frozen_default=True)
def node(cls: type[Class]) -> type[Class]:
    """Make a frozen dataclass whose instances are trees of their fields; fields with `static` in their metadata, as
    those of `equinox.field(static=True)`, belong to the structure."""
    made: Any = dataclasses.dataclass(frozen=True, eq=False, repr=False)(cls)
    made.__repr__ = eqx.tree_pformat
    fields = dataclasses.fields(made)
    fixed = tuple(field.name for field in fields if field.metadata.get("static"))
    names = tuple(field.name for field in fields if field.name not in fixed)
    keys = tuple(jax.tree_util.GetAttrKey(name) for name in names)
    parts, structure = _getter(names), _getter(fixed)

    # JAX calls these very often: where tests check all annotations, these three would take most of the checks

    @no_type_check
    def flatten(tree: Any) -> tuple[Any, Any]:
        return parts(tree), structure(tree)

    @no_type_check
    def with_keys(tree: Any) -> tuple[Any, Any]:
        return tuple(zip(keys, parts(tree), strict=True)), structure(tree)

    @no_type_check
    def unflatten(structure: Any, parts: Any) -> Any:
        tree = object.__new__(made)
        tree.__dict__.update(zip(names, parts, strict=True))
        tree.__dict__.update(zip(fixed, structure, strict=True))
        return tree

    jax.tree_util.register_pytree_with_keys(made, with_keys, unflatten, flatten)
    return made


def _getter(names: tuple[str, ...]) -> Any:
    """A function that gives the attributes of these names as a tuple."""
    if not names:
        return lambda tree: ()
    if len(names) == 1:
        name = names[0]
        return lambda tree: (getattr(tree, name),)
    return attrgetter(*names)
