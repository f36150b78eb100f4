"""What is asked of a design: a number to make small, and limits. A measure, or any function of the scene, will do."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import largest
from linkjax.design._names import number
from linkjax.machine import Scene
from linkjax.measures import MEASURES, Measure, Parts
from linkjax.motion import Rows

Sense = Literal["at most", "at least"]
INITIAL = "initial"
UNSETTLED = "?"  # the unit of a number of the scene until the scene is known


@dataclasses.dataclass(frozen=True)
class Term:
    """A number of a design in SI `unit`, and everything that may be the largest in it."""

    name: str
    unit: str
    value: Callable[[Parts], Array]
    rows: Callable[[Parts], Rows] | None = None
    smallest: bool = False  # the number is the smallest of its rows


Asked = Measure | Callable[[Scene], Array] | str | Term


@dataclasses.dataclass(frozen=True)
class Limit:
    """A bound on a term in every case: a number (SI), or "initial", what the unchanged scene has; a text with a unit
    until the scene is known."""

    term: Term
    sense: Sense
    bound: float | str
    name: str


def as_term(asked: Asked, unit: str = "1", name: str = "") -> Term:
    """The term of a measure (itself or by name), of a number of the scene by name, or of an own function of the scene.

    The function returns one number, or an array, which stands for its largest entry, or an array of shape
    (rows, parts), which stands for its longest row; either way every row is treated for itself, so that ties of peaks
    are no trouble.
    """
    if isinstance(asked, Term):
        return asked
    if isinstance(asked, str):
        if asked not in MEASURES:
            return Term(asked, UNSETTLED, lambda of: number(of.scene, asked).read(of.scene))
        asked = MEASURES[asked]
    if isinstance(asked, Measure):
        return Term(asked.name, asked.unit, asked.function, asked.rows, asked.smallest)
    name = name or getattr(asked, "__name__", "").strip("<>") or "own function"

    def found(of: Parts) -> Rows:
        at = jnp.asarray(asked(of.scene))
        if at.ndim > 2:
            raise TypeError(f"{name} must return a number, or an array of one or two axes, but its shape is {at.shape}")
        vectors = at if at.ndim == 2 else at.reshape((-1, 1))
        return Rows(vectors, jnp.full(vectors.shape[0], jnp.nan), signed=at.ndim < 2)

    return Term(name, unit, lambda of: largest(found(of).size()), found)


def at_most(asked: Asked, bound: float | str, *, unit: str = "1", name: str = "") -> Limit:
    """The limit `asked <= bound`: of a measure, a number of the scene by name, or an own function; the bound in SI, or
    a text ("19.23 kg m^2"), or "initial". `unit` and `name` are those of an own function."""
    term = as_term(asked, unit, name)
    return Limit(term, "at most", bound, name or term.name)


def at_least(asked: Asked, bound: float | str, *, unit: str = "1", name: str = "") -> Limit:
    """The limit `asked >= bound`; see `at_most`."""
    term = as_term(asked, unit, name)
    return Limit(term, "at least", bound, name or term.name)
