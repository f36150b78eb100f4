"""Checks of the section `[optimise]` against the machine, before anything is compiled."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

from linkjax.design import Case, DesignError, number, numbers, settled
from linkjax.machine import Scene
from linkjax.measures import MEASURES
from linkjax.scenes._errors import SceneError
from linkjax.scenes._explain import fault
from linkjax.scenes._keys import Path, lookup
from linkjax.scenes._optimise import Optimise

INFINITE = " is not a finite number"
GOAL = "speed"  # a scene parameter that every scene has
Check = tuple[Path, Callable[[], Any]]


def check_asked(source: str, table: Any, scene: Scene, asked: Optimise) -> None:
    """Raise `SceneError` for the first error in `[optimise]`, e.g. a name that the scene does not have.

    Missing keys are not reported: options of the command may give them.
    """
    _no_plain_angles(source, scene, asked)
    if asked.minimise is not None and asked.maximise is not None:
        remedy = "delete one of the two"
        raise fault(source, table, ("optimise", "maximise"), "given, and minimise too", remedy)
    for path, check in _checks(scene, asked):
        try:
            check()
        except DesignError as error:
            raise _fault(source, table, ("optimise", *path), error) from error


def _checks(scene: Scene, asked: Optimise) -> Iterator[Check]:
    """Paths in the section, each with a function that raises `DesignError` for an error there."""
    changed = {GOAL, *(name for case in asked.cases for name in case.changes)}
    spare = {next((name for name in numbers(scene) if name not in changed), GOAL): (1.0, 2.0)}
    cases = [Case(case.name, case.changes) for case in asked.cases]
    yield ("solver",), lambda: settled(scene, spare, GOAL, solver=asked.solver)
    for key, name in (("minimise", asked.minimise), ("maximise", asked.maximise)):
        if name is not None:
            yield (key,), lambda name=name: settled(scene, spare, name)
    for i, text in enumerate(asked.limits):
        yield ("limits", i), lambda text=text: settled(scene, spare, GOAL, limits=[text])
    yield ("limits",), lambda: settled(scene, spare, GOAL, limits=asked.limits)
    for name, given in asked.free.items():
        yield ("free", name), lambda name=name, given=given: settled(scene, {name: given}, GOAL)
        for other in given.get("linked", ()) if isinstance(given, dict) else ():
            yield ("free", name, "linked"), lambda other=other: number(scene, other)
    if asked.free:
        yield ("free",), lambda: settled(scene, asked.free, GOAL)
    for i, case in enumerate(cases):
        yield ("cases", i, "changes"), lambda case=case: settled(scene, spare, GOAL, cases=[case])
    if cases:
        yield ("cases",), lambda: settled(scene, asked.free or spare, GOAL, cases=cases)
    if asked.trade_off is not None:
        for key, bounds in (("limit", []), ("bounds", asked.trade_off.bounds)):
            trade = (asked.trade_off.limit, bounds)
            yield ("trade_off", key), lambda t=trade: settled(scene, spare, GOAL, limits=asked.limits, trade_off=t)


def _fault(source: str, table: Any, path: Path, error: DesignError) -> SceneError:
    """The `SceneError` of a `DesignError`."""
    problem, remedy, value = error.problem, error.remedy, lookup(table, path)
    element = error.element.rpartition(": ")[2]  # "minimise: delta" is the argument of `optimise` and its name
    if isinstance(value, dict) and element in value:
        path = (*path, element)
    if problem[:1].islower() and element not in (*path, value, repr(value)):
        problem = f"{element!r} {problem}"
    if isinstance(value, list) and problem.endswith(INFINITE):  # the list itself is in the message
        problem = "contains a number that is not finite"
    return fault(source, table, path, problem, remedy)


def _no_plain_angles(source: str, scene: Scene, asked: Optimise) -> None:
    """Raise `SceneError` for an angle that is a number without a unit, as everywhere in scene files."""
    angles = {name for name, at in numbers(scene).items() if at.unit == "rad"}
    ranges = {name: each["range"] if isinstance(each, dict) else each for name, each in asked.free.items()}
    found = [(f"optimise.free.{name}", value) for name, ends in ranges.items() if name in angles for value in ends]
    for i, case in enumerate(asked.cases):
        found += [(f"optimise.cases[{i}].changes.{name}", v) for name, v in case.changes.items() if name in angles]
    if asked.trade_off is not None:
        name = re.sub(" at (most|least)$", "", asked.trade_off.limit)
        if name in angles or (name in MEASURES and MEASURES[name].unit == "rad"):
            found += [("optimise.trade_off.bounds", value) for value in asked.trade_off.bounds]
    for key, value in found:
        if not isinstance(value, str) and value != 0:
            raise SceneError(source, key, value, "an angle without a unit", f'write "{value:.12g} deg"')
