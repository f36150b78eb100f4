"""Objective and constraints of an optimisation: a measure, a scene parameter, or a user-defined function."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any, Literal

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import largest
from linkjax._numerics import smallest as least
from linkjax._units import QuantityError, in_si
from linkjax.design._names import DesignError, number
from linkjax.design._variables import Variable, called
from linkjax.machine import Scene
from linkjax.measures import MEASURES, Measure, Parts, found_by
from linkjax.mechanism import StructureError
from linkjax.motion import Rows, Wanted

Sense = Literal["at most", "at least"]
INITIAL = "initial"
UNSETTLED = "?"  # the unit of a scene parameter until the scene is known
TRACEABLE = "use jax.numpy instead of numpy or math, and jnp.where instead of `if`"
SCENE = "a Scene with traced numbers"
LONGEST = 160  # characters of another message in ours


@dataclasses.dataclass(frozen=True)
class Term:
    """A quantity of a design in SI `unit`; `rows` are all values that can be its largest (or `smallest`). Of a sum of
    `squares` the only row is the vector of all residuals. `wants` returns the own numbers that belong to it, and raises
    `DesignError` where the scene lacks what it uses."""

    name: str
    unit: str
    value: Callable[[Parts], Array]
    rows: Callable[[Parts], Rows | Wanted] | None = None
    smallest: bool = False
    made: str = ""  # the name that determines it: of a scene parameter or a built-in measure
    measure: Measure | None = None
    squares: bool = False
    wants: Callable[[Scene], Sequence[Variable]] | None = None


Asked = Measure | Callable[..., Array] | str | Term


@dataclasses.dataclass(frozen=True)
class Limit:
    """A constraint on a term in every case. The bound is a number (SI), "initial" for the value of the original scene,
    or, until the scene is known, a string with a unit."""

    term: Term
    sense: Sense
    bound: float | str
    name: str


def as_term(asked: Asked, unit: str = "1", name: str = "", sense: str = "") -> Term:
    """The term of a measure (itself or its name), of a scene parameter by name, or of a user-defined function of the
    scene (or of the scene and the own numbers), which returns one number in SI. In a constraint of this `sense`, a
    quantity over the crank angle is the extreme that is limited.

    Raises `DesignError` for anything else. A function that fails or does not return one number raises `DesignError`
    when it is traced. For a function that returns an array see `as_rows`.
    """
    if isinstance(asked, Term):
        return asked
    if isinstance(asked, str):
        found = _found(asked, sense)
        if found is None:
            return Term(asked, UNSETTLED, lambda of: number(of.scene, asked).read(of.scene), made=asked)
        asked = found
    if isinstance(asked, Measure):
        made = asked.name if asked.built_in and (asked.asked or MEASURES.get(asked.name) is asked) else ""
        return Term(asked.name, asked.unit, asked.function, asked.rows, asked.smallest, made, asked)
    if not callable(asked):
        problem = f"{type(asked).__name__} is neither a measure, nor a name, nor a function"
        raise DesignError(repr(asked)[:LONGEST], problem, 'write e.g. "delta", or a function of the scene')
    name = name or name_of(asked)
    return Term(name, unit, lambda of: checked(name, SCENE, functools.partial(called, asked), of))


def _found(name: str, sense: str) -> Measure | None:
    try:
        return found_by(name, sense)
    except StructureError as error:
        raise DesignError(error.element, error.problem, error.remedy) from error


def as_rows(function: Callable[[Scene], Array], unit: str = "1", name: str = "", smallest: bool = False) -> Term:
    """The term of a user-defined function that returns an array: its largest entry, shape (rows,), or the length of its
    longest row, shape (rows, parts). The solvers treat every row separately, so equal peaks are exact.

    With `smallest` the smallest entry or length counts, for `maximise` and `at_least`. Errors as in `as_term`.
    """
    name = name or name_of(function)

    def rows(of: Parts) -> Rows:
        at = jnp.asarray(guarded(name, SCENE, functools.partial(called, function), of))
        if at.ndim not in (1, 2):
            problem = f"returns an array of shape {at.shape}, not of shape (rows,) or (rows, parts)"
            raise DesignError(name, problem, "return an array of one or two axes")
        vectors = at if at.ndim == 2 else at[:, None]
        return Rows(vectors, jnp.full(vectors.shape[0], jnp.nan), signed=at.ndim == 1)

    def value(of: Parts) -> Array:
        return least(rows(of).size()) if smallest else largest(rows(of).size())

    return Term(name, unit, value, rows, smallest)


def made_again(term: str | Term) -> Term:
    """The term of this name, or the term itself."""
    return term if isinstance(term, Term) else as_term(term)


def name_of(function: Any) -> str:
    """The name of a function in messages and results."""
    return getattr(function, "__name__", "").strip("<>") or "user-defined function"


def checked(name: str, given: str, function: Callable[[Any], Any], argument: Any) -> Array:
    """The number that a user-defined function returns. Raises `DesignError` where it fails or returns something else;
    `given` says what the argument is."""
    found = guarded(name, given, function, argument)
    try:
        at = jnp.asarray(found)
    except (TypeError, ValueError) as error:
        problem = f"returns {_kind(found)}, which is not a number"
        raise DesignError(name, problem, "return one number, e.g. scene.mechanism.flywheel.inertia") from error
    if at.ndim:
        remedy = "return one number, e.g. jnp.max(...), or jnp.min(...) for a lower bound"
        remedy += "; linkjax.design.as_rows(function) treats every entry separately"
        raise DesignError(name, f"returns an array of shape {at.shape}, not one number", remedy)
    if not jnp.issubdtype(at.dtype, jnp.floating) and not jnp.issubdtype(at.dtype, jnp.integer):
        problem = f"returns a value of type {at.dtype}, not a real number"
        raise DesignError(name, problem, "return one real number, and write comparisons as constraints")
    return at if jnp.issubdtype(at.dtype, jnp.floating) else at.astype(float)


def guarded(name: str, given: str, function: Callable[[Any], Any], argument: Any) -> Any:
    """What a user-defined function returns. Raises `DesignError` where it fails, in one line with the first line of the
    original error."""
    try:
        return function(argument)
    except DesignError:
        raise
    except Exception as error:
        first = (str(error).strip().splitlines() or [""])[0][:LONGEST]
        problem = f"this function failed when called with {given}: {type(error).__name__}: {first}".rstrip(": ")
        raise DesignError(name, problem, f"correct it; {TRACEABLE}") from error


def _kind(value: Any) -> str:
    return "None" if value is None else f"a {type(value).__name__}"


def at_most(asked: Asked, bound: float | str, *, unit: str | None = None, name: str = "") -> Limit:
    """The constraint `asked <= bound`, of a measure, a scene parameter by name, or a user-defined function.

    The bound is a number in SI, a string ("19.23 kg m^2"), or "initial". `unit` and `name` belong to a user-defined
    function; without `unit` its value is in the SI unit of the bound ("150 mm": metres). Raises `DesignError` where
    `unit` and bound contradict each other.
    """
    return _limit(asked, "at most", bound, unit, name)


def at_least(asked: Asked, bound: float | str, *, unit: str | None = None, name: str = "") -> Limit:
    """The constraint `asked >= bound`; see `at_most`."""
    return _limit(asked, "at least", bound, unit, name)


def _limit(asked: Asked, sense: Sense, bound: float | str, unit: str | None, name: str) -> Limit:
    if callable(asked) and not isinstance(asked, Measure):
        unit = _unit_of(name or name_of(asked), bound, unit)
    term = as_term(asked, unit or "1", name, sense)
    return Limit(term, sense, bound, name or term.name)


def _unit_of(name: str, bound: float | str, unit: str | None) -> str:
    """The unit of a user-defined function: as given, or the SI unit of its bound."""
    if not isinstance(bound, str) or bound == INITIAL:
        return unit or "1"
    try:
        _, own = in_si(bound)
    except QuantityError as error:
        if unit is not None:
            return unit  # unknown here: the bound must be a number in this unit
        raise DesignError(name, f"bound {bound!r}: {error.problem}", error.remedy) from error
    if unit is None:
        return own
    with contextlib.suppress(QuantityError):
        _, given = in_si(f"1 {unit}")
        if own not in ("1", given):
            problem = f"its bound {bound!r} is in {own}, but unit is {unit!r}"
            raise DesignError(name, problem, "write the bound in this unit, or omit `unit`")
    return unit
