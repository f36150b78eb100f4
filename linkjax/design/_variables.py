"""Design variables and load cases. A name that begins with `own.` is a number of one's own, beside those of the scene.

Own numbers are arguments of the compiled program like all others. Functions with two parameters get them, as a mapping
from their names without `own.` to traced numbers.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax.design._names import DesignError, Number, near, number
from linkjax.machine import Scene
from linkjax.measures import Parts

OWN = "own."  # the names of own numbers begin so


@dataclasses.dataclass(frozen=True)
class Variable:
    """A design variable: its name, its bounds (SI, or in `optimise` strings with units), and the names of parameters
    that keep their ratio to it. A number of one's own (`own.NAME`) also has an initial value, by default the middle of
    its range, and an SI unit, by default that of its bounds. `optimise` raises `DesignError` for an unknown name, and
    for bounds that are no range of this parameter.
    """

    name: str
    lower: float | str
    upper: float | str
    linked: tuple[str, ...] = ()
    initial: float | str | None = None
    unit: str = ""

    @property
    def own(self) -> bool:
        """Whether it is a number of one's own."""
        return self.name.startswith(OWN)

    def number(self, scene: Scene) -> Number:
        """The scene parameter of this name, or the own number. Raises `DesignError` for an unknown name."""
        if not self.own:
            return number(scene, self.name)
        value = 0.5 * (float(self.lower) + float(self.upper)) if self.initial is None else float(self.initial)
        return Number(self.name, lambda scene: jnp.asarray(value, dtype=float), self.unit or "1")


@dataclasses.dataclass(frozen=True)
class Case:
    """A load case: scene parameters that differ, by name (SI, or in `optimise` strings with units)."""

    name: str = ""
    changes: Mapping[str, float | str] = dataclasses.field(default_factory=dict)


class Own(Mapping):
    """The own numbers (SI) by name, without `own.`; `read` has the names that were asked for. An unknown name raises
    `DesignError`."""

    def __init__(self, values: Mapping[str, Array]):
        self.values_, self.read = dict(values), set[str]()

    def __getitem__(self, name: str) -> Array:
        if name not in self.values_:
            remedy = near(name, self.values_) or f'free it, e.g. free={{"{OWN}{name}": "0 to 360 deg"}}'
            raise DesignError(f"{OWN}{name}", "is used by a function, but is not a design variable", remedy)
        self.read.add(name)
        return self.values_[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.values_)

    def __len__(self) -> int:
        return len(self.values_)


class OwnParts(Parts):
    """`Parts` of a scene with the own numbers."""

    def __init__(self, scene: Scene, nodes: int, own: Own, breaks: tuple[float, ...] = ()):
        super().__init__(scene, nodes, breaks=breaks)
        self.own = own


def own_of(of: Parts) -> Own:
    """The own numbers; none outside of an optimisation."""
    return of.own if isinstance(of, OwnParts) else Own({})


def called(function: Callable[..., Any], of: Parts) -> Any:
    """What a user-defined function of the scene, or of the scene and the own numbers, returns."""
    return function(of.scene, own_of(of)) if _takes_own(function) else function(of.scene)


def _takes_own(function: Callable[..., Any]) -> bool:
    """Whether a function has a second parameter without a default."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # some built-in functions have no signature
        return False
    places = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return sum(each.kind in places and each.default is each.empty for each in parameters) >= 2


def check(variables: Sequence[Variable]) -> None:
    """Raise `DesignError` without variables, for a parameter that is freed twice, and for wrong bounds."""
    if not variables:
        raise DesignError("free", "there is no design variable", 'name one, e.g. {"flywheel.inertia": (0, 40)}')
    seen: set[str] = set()
    for v in variables:
        for name in (v.name, *v.linked):
            if name in seen:
                raise DesignError(name, "is freed twice", "name every parameter once, or link it to one variable")
            seen.add(name)
        low, high = float(v.lower), float(v.upper)
        if not np.isfinite([low, high]).all() or not low < high:
            problem = f"its bounds are {low:g} and {high:g}"
            raise DesignError(v.name, problem, "give two finite bounds, the lower one first")
        check_own(v)
        if v.initial is not None and not low <= float(v.initial) <= high:
            problem = f"its initial value {float(v.initial):g} is not within its bounds {low:g} and {high:g}"
            raise DesignError(v.name, problem, "write an initial value within the bounds")


def check_own(v: Variable) -> None:
    """Raise `DesignError` for an own number with linked parameters, and for another variable with an initial value."""
    if v.linked and (v.own or any(name.startswith(OWN) for name in v.linked)):
        raise DesignError(v.name, "own numbers cannot be linked", "multiply by the ratio in your function")
    if v.initial is not None and not v.own:
        raise DesignError(v.name, "its initial value is that of the scene", f"delete `initial`, or change {v.name}")
