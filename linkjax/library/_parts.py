"""Shared parts of the constructors: checks of arguments, and links with the given lengths."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from jax.typing import ArrayLike

from linkjax._types import as_float, known
from linkjax._units import nearest
from linkjax._vec import Vec
from linkjax.mechanism import Link

Links = Mapping[str, Link] | None
Place = Vec | tuple[ArrayLike, ArrayLike]


def vec(at: Place) -> Vec:
    """A position in the plane."""
    return at if isinstance(at, Vec) else Vec(*at)


def origin() -> Vec:
    """The pivot of the crank."""
    return Vec(0.0, 0.0)


def numbers(*values: Any) -> list[float] | None:
    """Numbers of a design; None if any is traced or batched."""
    found = [known(as_float(value)) for value in values]
    return None if any(v is None or v.ndim for v in found) else [float(v) for v in found if v is not None]


def check_positive(machine: str, **lengths: ArrayLike) -> None:
    """Raise `ValueError` for a length that is not positive and finite."""
    for name, length in lengths.items():
        for value in numbers(length) or ():
            if not 0 < value < math.inf:
                raise ValueError(f"{name} of a {machine} must be above zero, but is {value:g}; give a length in metres")


def check_closes(machine: str, **lengths: ArrayLike) -> None:
    """Raise `ValueError` where one side of a polygon is at least as long as all others together."""
    values = dict(zip(lengths, numbers(*lengths.values()) or (), strict=False))
    longest = max(values, key=lambda name: values[name], default="")
    rest = math.fsum(value for name, value in values.items() if name != longest)
    if values and values[longest] >= rest:
        raise ValueError(
            f"{longest} of a {machine} is {values[longest]:g}, but all others together are {rest:g}, so it cannot be "
            f"assembled at any crank angle; shorten {longest} or lengthen another"
        )


def parts(machine: str, lengths: Mapping[str, ArrayLike], given: Links, marks: Mapping[str, Any] | None = None):
    """Links of these lengths (zero for a slider), by name, with the other properties of `given` and the points `marks`.

    Raises `ValueError` for a link that the machine does not have, and for a link of `given` with a length.
    """
    found = {}
    for name in given or {}:
        if name not in lengths:
            raise ValueError(f"links of a {machine}: it has no link {name!r}; {nearest(name, lengths)}")
    for name, length in lengths.items():
        link = (given or {}).get(name, Link())
        own = known(link.length)
        if own is not None and np.any(own != 0):
            raise ValueError(f"links[{name!r}] of a {machine} has the length {own}; omit it, the machine sets it")
        points = {**link.points, **(marks or {}).get(name, {})}
        found[name] = dataclasses.replace(link, length=length, points=points)
    return found
