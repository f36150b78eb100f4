"""Uniform bars and plates: mass centre and inertia from the positions of the pins or corner points."""

from __future__ import annotations

import functools
import itertools
import operator
from collections.abc import Mapping, Sequence

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import known
from linkjax._units import nearest
from linkjax._vec import Vec

FLAT = 1e-9  # of the square of a plate's size: an area that counts as none
PLATE = 'write three or more corner points of the plate in order, e.g. ["B", "C", "E"]'


def bar(far: Vec) -> tuple[Vec, Array]:
    """A slender uniform bar from the origin to `far` (m): its centre, its central inertia per mass, l² / 12 (m²)."""
    return far * 0.5, far.squared() / 12


def plate(corners: Sequence[Vec]) -> tuple[Vec, Array]:
    """A uniform polygon with these corners in order, either way round (m): its centroid, and its polar second moment
    of area about the centroid per area (m²), which is its central inertia per mass.

    With c the cross product of the positions p, q of two successive corners and A = Σ c / 2: the centroid is
    Σ (p + q) c / 6A, the polar second moment about the origin Σ (p² + p·q + q²) c / 12 (C. Steger, On the Calculation
    of Moments of Polygons, TU München, FGBV-96-04, 1996). Corners that enclose no area give their mean, and zero.
    """
    base = functools.reduce(operator.add, corners) / len(corners)  # for small differences of large numbers
    about = [corner - base for corner in corners]
    edges = list(zip(about, [*about[1:], about[0]], strict=True))
    cross = [p.cross(q) for p, q in edges]
    double = _sum(cross)
    double = jnp.where(double == 0, 1.0, double)
    shift = Vec(
        _sum([(p.x + q.x) * c for (p, q), c in zip(edges, cross, strict=True)]) / (3 * double),
        _sum([(p.y + q.y) * c for (p, q), c in zip(edges, cross, strict=True)]) / (3 * double),
    )
    polar = [(p.squared() + p.dot(q) + q.squared()) * c for (p, q), c in zip(edges, cross, strict=True)]
    return base + shift, _sum(polar) / (6 * double) - shift.squared()


def plate_fault(corners: Sequence[str], places: Mapping[str, Vec]) -> tuple[str, str] | None:
    """Problem and remedy where the points named as corners are no polygon; None where they are, or are traced."""
    for name in corners:
        if name not in places:
            return f"{name!r} is not a pin or point of this link", nearest(name, places)
        if list(corners).count(name) > 1:
            return f"{name!r} is named twice", "name every corner once; the last is joined to the first"
    found = [(known(places[name].x), known(places[name].y)) for name in corners]
    at = [complex(float(x), float(y)) for x, y in found if x is not None and y is not None and x.ndim == y.ndim == 0]
    if len(at) < len(corners):
        return None
    edges = list(zip(at, [*at[1:], at[0]], strict=True))
    names = list(zip(corners, [*corners[1:], corners[0]], strict=True))
    for (i, (a, b)), (j, (c, d)) in itertools.combinations(enumerate(edges), 2):
        if _beside(a, b, c) * _beside(a, b, d) < 0 and _beside(c, d, a) * _beside(c, d, b) < 0:
            crossed = f"the edges {'-'.join(names[i])} and {'-'.join(names[j])} of the plate cross"
            return crossed, "name its corners in the order of its outline"
    size = max(abs(p - q) for p in at for q in at)
    if abs(sum(_beside(at[0], p, q) for p, q in edges)) <= 2 * FLAT * size**2:
        lie = f"the corners {', '.join(corners)} enclose no area"
        return lie, "move one of them off the line of the others, or name other corners"
    return None


def _beside(a: complex, b: complex, p: complex) -> float:
    """Twice the area of a triangle, positive where p lies to the left of the line from a to b."""
    return ((b - a).conjugate() * (p - a)).imag


def _sum(parts: Sequence[Array]) -> Array:
    return functools.reduce(operator.add, parts)
