"""Rows of a term, and what a machine must have so that the term has a value."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import largest, smallest
from linkjax.design._names import DesignError
from linkjax.design._terms import Limit, Term, checked, guarded
from linkjax.design._variables import Own, OwnParts
from linkjax.machine import Scene
from linkjax.measures import Parts, min_margin, steady_state_margin
from linkjax.mechanism import StructureError
from linkjax.motion import Rows, Wanted, begin, every_row

PARTS = "Parts with traced numbers"
POSE = "_pose"  # the compiled function that all positions come from
MOTION = begin.function.__name__  # the compiled function that all actual motions begin with


class Needs(enum.IntEnum):
    """What a term needs: no more than the scene, a machine that can be assembled, or its actual motion."""

    SCENE = 0
    ASSEMBLY = 1
    MOTION = 2


def rows_for(limits: Sequence[Limit], parts: Parts) -> list[tuple[Rows, Array]]:
    """The rows of every term, where its sense is one for every row, and its value. Raises `DesignError` where a term
    has no value for this kind of machine, or is user-defined and fails."""
    wanted = [_wanted(limit, parts) for limit in limits]
    found = every_row([rows for rows, _ in wanted])
    return [(rows, _extreme(limit.term, rows) if value is None else value)
            for limit, rows, (_, value) in zip(limits, found, wanted, strict=True)]  # fmt: skip


def _extreme(term: Term, rows: Rows) -> Array:
    if term.squares:
        return jnp.sum(rows.vectors**2)
    return smallest(rows.size()) if term.smallest else largest(rows.size())


def _wanted(limit: Limit, parts: Parts) -> tuple[Rows | Wanted, Array | None]:
    """The rows of a term, or what they are made of, and its value if it is not the extreme of its rows."""
    term = limit.term
    call = _measured if term.measure is not None else lambda function, of: guarded(term.name, PARTS, function, of)
    if term.rows is not None and term.smallest == (limit.sense == "at least"):
        return call(term.rows, parts), None
    value = call(term.value, parts) if term.measure is not None else checked(term.name, PARTS, term.value, parts)
    return Rows(value.reshape((1, 1)), jnp.full(1, jnp.nan), signed=True), value


def breaks_of(term: Term) -> tuple[float, ...]:
    """The crank angles (rad) at which panels of the grid must end."""
    return () if term.measure is None else term.measure.breaks


def needs(limit: Limit, scene: Scene, nodes: int, own: Own) -> Needs:
    """What the term of a constraint or objective needs. A measure says so; a user-defined function is traced, with the
    own numbers at their start."""
    term = limit.term
    if term.measure is not None:
        name = term.name.partition(".")[0]
        if name in (min_margin.name, steady_state_margin.name):
            return Needs.SCENE if name == min_margin.name else Needs.ASSEMBLY  # they say how far a machine is off
        return Needs.MOTION if term.measure.motion else Needs.ASSEMBLY
    traced = jax.make_jaxpr(lambda scene: rows_for([limit], OwnParts(scene, nodes, own))[0][1])(scene)
    names = set(_programs(traced.jaxpr))
    return Needs.MOTION if MOTION in names else Needs.ASSEMBLY if POSE in names else Needs.SCENE


def _measured(function: Callable[[Parts], Any], of: Parts) -> Any:
    try:
        return function(of)
    except StructureError as error:
        raise DesignError(error.element, error.problem, error.remedy) from error


def _programs(jaxpr: Any) -> Iterator[str]:
    """Names of the compiled functions that a traced function calls."""
    for equation in jaxpr.eqns:
        if "name" in equation.params:
            yield equation.params["name"]
        for value in equation.params.values():
            inner = [getattr(each, "jaxpr", each) for each in (value if isinstance(value, tuple | list) else (value,))]
            for each in inner:
                if hasattr(each, "eqns"):
                    yield from _programs(each)
