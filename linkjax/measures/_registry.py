"""Measures: functions of a scene, each with a unit. `MEASURES` holds those of the whole machine that every analysis
gives; `named` makes those of one element, at a crank angle, or in a window of it, from their names.

A new measure is a decorated function of `Parts`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from typing import Any, TypedDict

from jaxtyping import Array

from linkjax._numerics import largest, smallest
from linkjax._units import nearest
from linkjax.machine import Names, ReadyScene, Scene, nameless
from linkjax.measures._families import (
    breaks_of,
    checked,
    for_every_angle,
    has_rows,
    rows,
    taken_apart,
    values_of,
)
from linkjax.measures._family import CONSTANT, FAMILIES, SAID, STATISTICS, Asked
from linkjax.measures._gaps import no_transmission_angle
from linkjax.measures._parts import NODES, Parts
from linkjax.mechanism import StructureError
from linkjax.motion import Rows, Wanted, every_row, peaks


@dataclasses.dataclass(frozen=True)
class Measure:
    """A measure of a scene in SI `unit`: `measure(scene, nodes)` is pure and differentiable; nodes per crank turn.

    A peak also has `rows`, all values that may be the largest: where two peaks are equal, the peak has no gradient.
    `asked` is the name taken apart, of a measure that belongs to a family.
    """

    name: str
    unit: str
    meaning: str
    function: Callable[[Parts], Array]
    rows: Callable[[Parts], Rows | Wanted] | None = None  # all values that may be the largest, or the smallest
    smallest: bool = False
    motion: bool = False  # whether it needs the actual motion
    asked: Asked | None = None

    @property
    def built_in(self) -> bool:
        """Whether it belongs to the package, so that its name determines it and a machine without names has it."""
        functions = [self.function, *([] if self.rows is None else [self.rows])]
        return all(each.__module__.startswith("linkjax.") for each in functions)

    @property
    def breaks(self) -> tuple[float, ...]:
        """The crank angles (rad) at which panels of the grid must end."""
        return () if self.asked is None else breaks_of(self.asked)

    def check(self, scene: Scene | ReadyScene) -> None:
        """Raise `StructureError` where the scene has no such element."""
        if self.asked is not None:
            checked(self.asked, scene.scene if isinstance(scene, ReadyScene) else scene)

    def without_names(self, scene: Scene | ReadyScene, names: Names | None) -> Measure:
        """The same of a scene without names."""
        if names is None or self.asked is None or not self.asked.element:
            return self
        own = scene.scene if isinstance(scene, ReadyScene) else scene
        tokens = {names.in_text(token): token for token in FAMILIES[self.asked.family].names(own)}
        return _of_family(self.asked._replace(element=tokens[self.asked.element]))

    def __call__(self, scene: Scene | ReadyScene, nodes: int = NODES) -> Array:
        return evaluate(scene, [self], nodes)[self.name]


MEASURES: dict[str, Measure] = {}


def _of_family(asked: Asked) -> Measure:
    """The measure of a family."""
    family = FAMILIES[asked.family]
    return Measure(
        asked.text(), family.unit, family.meaning, lambda of: values_of(of, [asked])[0],
        (lambda of: rows(of, asked)) if has_rows(asked) else None, family.smallest, family.motion, asked,
    )  # fmt: skip


def named(name: str) -> Measure:
    """The measure of this name: one of `MEASURES`, or of a family, as in "stroke.D", "x.D@60deg" or "max_x.D where
    90deg to 180deg". Raises `StructureError` for any other name."""
    found = found_by(name)
    if found is None:
        base = name.partition(" where ")[0].partition("@")[0]
        if base in MEASURES:
            raise StructureError(base, "takes neither a window nor a crank angle", f"write {base}")
        raise StructureError(name, "is not a measure", _meant(name.partition(".")[0].lower()))
    return found


def _meant(name: str) -> str:
    """A hint for a name that is not a measure: another statistic of the same quantity, or the nearest name."""
    statistic, _, quantity = name.partition("_")
    others = [f"{each}_{quantity}" for each in STATISTICS.get(quantity.removesuffix(CONSTANT), ())]
    if statistic in SAID and others:
        return f"write {' or '.join(others)}"
    return nearest(name, [*MEASURES, *FAMILIES])


def found_by(name: str, sense: str = "") -> Measure | None:
    """The same; None for another name. With the `sense` of a constraint, "at most" or "at least", a quantity over the
    crank angle is its extreme: the constraint holds for every crank angle."""
    if name in MEASURES:
        return MEASURES[name]
    asked = taken_apart(name)
    if asked is None:
        return None
    return _of_family(for_every_angle(asked, sense) if sense else asked)


def measure_names(scene: Scene) -> tuple[str, ...]:
    """The names of all measures that a scene has, without those at a crank angle or in a window."""
    lacking = ("min_transmission_angle",) if no_transmission_angle(scene.mechanism) else ()
    found = [name for name in MEASURES if name not in lacking]
    for family in FAMILIES.values():
        if (family.quantity is not None and not family.statistic) or family.lacking(scene):
            continue
        elements = family.names(scene) if family.of else ("",)
        found += [Asked(family.name, element).text() for element in elements]
    return tuple(dict.fromkeys(found))


def _registered(
    function: Callable, unit: str, value, rows=None, smallest: bool = False, motion: bool = False
) -> Measure:
    """The measure made from a decorated function."""
    made = Measure(function.__name__, unit, (function.__doc__ or "").strip(), value, rows, smallest, motion)
    MEASURES[made.name] = made
    return made


def measure(
    unit: str, rows: Callable[[Parts], Rows | Wanted] | None = None, smallest: bool = False, *, motion: bool = True
) -> Callable[[Callable[[Parts], Array]], Measure]:
    """Make a measure of a function of `Parts` and register it under the function's name; `rows` are, for an extreme,
    all values that may be it. `motion` says whether it needs the actual motion."""
    return lambda function: _registered(function, unit, function, rows, smallest, motion)


def peak(unit: str, *, motion: bool = True) -> Callable[[Callable[[Parts], Wanted]], Measure]:
    """Make a measure of a peak; the function returns what is wanted."""
    return lambda function: _registered(
        function, unit, lambda of: largest(peaks(*function(of)[:3]).value), function, motion=motion
    )


def least(unit: str) -> Callable[[Callable[[Parts], Rows | Wanted]], Measure]:
    """Make a measure of the smallest of several numbers."""
    return lambda function: _registered(
        function, unit, lambda of: smallest(every_row([function(of)])[0].size()), function, True
    )


def of_family(name: str) -> Measure:
    """Register the measure of a family without an element."""
    MEASURES[name] = _of_family(Asked(name, ""))
    return MEASURES[name]


class Needs(TypedDict):
    """What is needed of the grid, arguments of `Parts`."""

    moves: bool
    still: bool


def needs_of(measures: Iterable[Measure]) -> Needs:
    """What measures need of the grid, see `Parts`; those of users may need everything."""
    asked = list(measures)
    own = not all(one.built_in for one in asked)
    return {"moves": own or any(one.motion for one in asked), "still": own or not all(one.motion for one in asked)}


def evaluate(scene: Scene | ReadyScene, measures: Iterable[Measure | str], nodes: int = NODES) -> dict[str, Array]:
    """Several measures of one scene, themselves or their names, by name. They share grid and node values, and all
    extremes are found together, so they cost little more than one. Where no steady-state motion exists
    (`steady_state_margin` is negative), or the machine cannot be assembled (`min_margin`), the others are finite but
    meaningless. Raises `StructureError` for a name that is not a measure of this scene."""
    every = [measures] if isinstance(measures, str | Measure) else list(measures)
    asked = [named(one) if isinstance(one, str) else one for one in every]
    for one in asked:
        if not isinstance(one, Measure):
            raise TypeError(f"evaluate: {one!r} is not a measure; write measures or their names, e.g. ['delta']")
        one.check(scene)
    plain, tokens = nameless(scene) if all(one.built_in for one in asked) else (scene, None)
    breaks = tuple(dict.fromkeys(angle for one in asked for angle in one.breaks))
    parts: Any = Parts(plain, nodes, breaks=breaks, **needs_of(asked))
    inside = [one.without_names(plain, tokens) for one in asked]
    of_families = [one.asked for one in inside if one.asked is not None]
    found = iter(values_of(parts, of_families) if of_families else ())
    return {
        one.name: next(found) if own.asked is not None else own.function(parts)
        for one, own in zip(asked, inside, strict=True)
    }
