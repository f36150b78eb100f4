"""Ranges and constraints written as strings: `"0 to 40 kg m^2"`, `"± 8 %"`, `"delta <= 0.15"`."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import Any

from linkjax._renamed import renamed
from linkjax._units import QuantityError, in_si
from linkjax.design._names import DesignError, Number, amount, near, number, numbers
from linkjax.design._terms import INITIAL, UNSETTLED, Asked, Limit, Term, as_term, at_least, at_most
from linkjax.design._variables import OWN, Case, Variable, check, check_own
from linkjax.machine import Scene
from linkjax.measures import FAMILIES, MEASURES, measure_names
from linkjax.mechanism import StructureError

Range = Any  # two bounds, or a string

AROUND = re.compile(r"(?:±|\+/?-|within)\s*(.+)", re.IGNORECASE)
FROM_TO = re.compile(r"(.+?)\s*(?:\.\.\.?|…|\bto\b)\s*(.+)")
RELATION = re.compile(r"(.+?)\s*(<=|>=|≤|≥)\s*(.+?)(\s+where\s+.+)?")
FUNCTION = "in Python pass the function object, not its name: at_most(function, bound), minimise=function"
SENSES = {"<=": at_most, "≤": at_most, ">=": at_least, "≥": at_least}


class UnknownName(DesignError):
    """A name that is neither a measure nor a scene parameter; in Python it may be that of a function."""


def variable(scene: Scene, name: str, given: Range, linked: tuple[str, ...] = ()) -> Variable:
    """A design variable between two bounds, `("0.95 m", "1.1 m")` or `"0.95 to 1.1 m"`, or about its initial value,
    `"± 8 %"` or `"± 20 mm"`. Numbers without a unit are SI. Raises `DesignError`."""
    at = number(scene, name)
    return _variable(at, float(at.read(scene)), given, linked)


def _variable(at: Number, value: float, given: Range, linked: tuple[str, ...] = ()) -> Variable:
    """A design variable of a known parameter with this initial value."""
    name = at.name
    if not isinstance(given, str):
        if not isinstance(given, tuple | list) or len(given) != 2:
            remedy = 'write two, e.g. ("0.95 m", "1.1 m"), or "± 8 %"'
            raise DesignError(name, f"{given!r} is not a pair of bounds", remedy)
        return _possible(Variable(name, amount(given[0], at.unit, name), amount(given[1], at.unit, name), linked), at)
    text = given.replace("−", "-").strip()
    if about := AROUND.fullmatch(text):
        low, high = _around(about[1].strip(), value, at)
        return Variable(name, max(low, at.least), high, linked)
    if ends := FROM_TO.fullmatch(text):
        low, high = ends[1].strip(), ends[2].strip()
        if re.fullmatch(r"[\d._eE+-]+", low):  # the unit is written once, after the second
            low += re.sub(r"^[+-]?[\d_]*\.?[\d_]*(?:[eE][+-]?\d+)?", "", high)
        return _possible(Variable(name, amount(low, at.unit, name), amount(high, at.unit, name), linked), at)
    raise DesignError(name, f"{given!r} is not a range", 'write e.g. "0 to 40 kg m^2", "± 8 %" or "± 20 mm"')


def own_variable(name: str, given: Range, initial: Any = None, unit: str = "") -> Variable:
    """A number of one's own, `own.NAME`, with its range as in `variable` and its initial value: by default the middle
    of its range, of a range "± …" zero. Its unit is that of these values. Raises `DesignError`."""
    if not name.removeprefix(OWN).isidentifier():
        raise DesignError(name, "is not a name", 'write e.g. "own.start"')
    unit = unit or _own_unit(name, given, initial)
    value = None if initial is None else amount(initial, unit, name)
    found = _variable(Number(name, lambda scene: scene.speed, unit), value or 0.0, given)
    found = dataclasses.replace(found, initial=value, unit=unit)
    check([found])
    return found


def _own_unit(name: str, given: Range, initial: Any) -> str:
    """The SI unit of the strings among the ends of a range and the initial value; "1" if there are none."""
    texts = [*(given if isinstance(given, tuple | list) else (given,)), initial]
    units = set()
    for text in (each.replace("−", "-").strip() for each in texts if isinstance(each, str)):
        about, ends = AROUND.fullmatch(text), FROM_TO.fullmatch(text)
        last = about[1] if about else ends[2] if ends else text
        if last.endswith("%"):
            continue
        try:
            units.add(in_si(last)[1])
        except QuantityError as error:
            raise DesignError(name, f"{text!r}: {error.problem}", error.remedy) from error
    if len(units) > 1:
        raise DesignError(name, f"has values in different units: {' and '.join(sorted(units))}", "use one unit")
    return units.pop() if units else "1"


def _possible(free: Variable, at: Number) -> Variable:
    """A design variable with allowed bounds."""
    if float(free.lower) < at.least:
        raise DesignError(free.name, f"must not be less than {at.least:g}, but its lower bound is {free.lower:g}",
                          f"write {at.least:g} or more")  # fmt: skip
    return free


def _around(text: str, value: float, at: Number) -> tuple[float, float]:
    if text.endswith("%"):
        try:
            reach = abs(value) * float(text[:-1]) / 100
        except ValueError as error:
            raise DesignError(at.name, f"{text!r} is not a percentage", 'write e.g. "± 8 %"') from error
        if value == 0:
            raise DesignError(at.name, "is zero, so a percentage gives no range", 'write e.g. "0 to 40 kg m^2"')
    else:
        reach = amount(text, at.unit, at.name)
    if not reach > 0:
        raise DesignError(at.name, f"± {text} gives no range", 'write e.g. "± 8 %"')
    return value - reach, value + reach


def limit(text: str) -> Limit:
    """The constraint written as `"delta <= 0.15"`, `"flywheel.inertia <= 19.23 kg m^2"`, `"min_margin >= initial"`, or
    for every crank angle of a window, `"x.D >= 0 where 90 deg to 180 deg"`."""
    found = RELATION.fullmatch(text.strip())
    if found is None:
        remedy = 'write e.g. "delta <= 0.15" or "min_transmission_angle >= initial"'
        name, equals, value = (part.strip() for part in text.partition("="))
        if equals and not name.endswith(("<", ">", "=", "!")) and not value.startswith("="):
            remedy = f'write two constraints, "{name} >= {value}" and "{name} <= {value}"'
        raise DesignError(repr(text), "is not a constraint", remedy)
    name, relation, bound, window = found.groups()
    return SENSES[relation](name + (window or ""), bound)


def settled_term(scene: Scene, asked: Asked) -> Term:
    """A term with its unit known. Raises `DesignError` for a name that is neither a measure nor a scene parameter."""
    term = as_term(asked)
    if term.measure is not None:
        try:
            term.measure.check(scene)
        except StructureError as error:
            raise DesignError(error.element, error.problem, error.remedy) from error
    if term.unit != UNSETTLED:
        return term
    known = numbers(scene)
    if term.name not in known:
        problem = "is neither a measure nor a scene parameter"
        hint = near(term.name, [*(measure_names(scene) if "." in term.name else (*MEASURES, *FAMILIES)), *known])
        hint = hint or "linkjax.measures.measure_names(scene) and linkjax.design.numbers(scene) give the names"
        raise UnknownName(term.name, problem, hint)
    return dataclasses.replace(term, unit=known[term.name].unit)


def settled_limit(scene: Scene, given: Limit | str) -> Limit:
    """A constraint with its unit known and its bound in SI, or "initial"."""
    if not isinstance(given, Limit | str):
        remedy = 'write at_most(function, bound), or "delta <= 0.15"'
        raise DesignError("limits", f"{given!r} is not a constraint", remedy)
    asked = limit(given) if isinstance(given, str) else given
    if isinstance(asked.bound, str) and (new := renamed(asked.bound, [INITIAL])):
        raise DesignError(asked.name, f"has the bound {asked.bound!r}", f"it is called {new!r} now")
    term = settled_term(scene, asked.term)
    bound = INITIAL if asked.bound == INITIAL else amount(asked.bound, term.unit, asked.name)
    return dataclasses.replace(asked, term=term, bound=bound)


def settled_case(scene: Scene, case: Case) -> Case:
    """A case with its values in SI."""
    values = {}
    for name, value in case.changes.items():
        at = number(scene, name)
        values[name] = amount(value, at.unit, name)
        if values[name] < at.least:
            problem = f"must not be less than {at.least:g}, but is {values[name]:g}"
            raise DesignError(name, problem, f"write {at.least:g} or more")
    return Case(case.name, values)


def _check_range(name: str, given: Mapping[str, Any]) -> None:
    """Raise `DesignError` for a mapping that is not a range with linked parameters."""
    allowed = {"range", "initial" if name.startswith(OWN) else "linked"}
    unknown, linked = sorted(set(given) - allowed), given.get("linked", ())
    if unknown or "range" not in given:
        problem = f"unknown key {unknown[0]!r}" if unknown else "has no range"
        own = 'write {"range": "0 to 360 deg", "initial": "30 deg"}'
        remedy = own if name.startswith(OWN) else 'write {"range": "± 8 %", "linked": ["links.link4.length"]}'
        raise DesignError(name, problem, remedy)
    if isinstance(linked, str) or not all(isinstance(other, str) for other in linked):
        raise DesignError(
            name, f"linked is {linked!r}, not a list of names", 'write e.g. "linked": ["links.link4.length"]'
        )


def settled_free(scene: Scene, free: Mapping[str, Range] | Any) -> list[Variable]:
    """The design variables with bounds in SI: of a mapping from names to ranges (or to a range with linked parameters,
    `{"range": "± 8 %", "linked": [...]}`, or of an own number with its initial value), or of variables."""
    if isinstance(free, Mapping):
        full = {name: given if isinstance(given, Mapping) else {"range": given} for name, given in free.items()}
        for name, each in full.items():
            _check_range(name, each)
        return [own_variable(name, each["range"], each.get("initial")) if name.startswith(OWN)
                else variable(scene, name, each["range"], tuple(each.get("linked", ())))
                for name, each in full.items()]  # fmt: skip
    if isinstance(free, str) or any(isinstance(v, str) for v in free):
        name = free if isinstance(free, str) else next(v for v in free if isinstance(v, str))
        raise DesignError(name, "has no range", f'write a mapping from names to ranges, e.g. {{"{name}": "± 8 %"}}')
    for v in free:
        check_own(v)
    return [own_variable(v.name, (v.lower, v.upper), v.initial, v.unit) if v.own
            else variable(scene, v.name, (v.lower, v.upper), v.linked) for v in free]  # fmt: skip


def with_own(scene: Scene, variables: list[Variable], terms: Sequence[Term | None]) -> list[Variable]:
    """The design variables, with the own numbers that belong to ready-made terms and are not among them. Raises
    `DesignError` where the scene lacks what a term uses."""
    found = {v.name: v for v in variables}
    for term in terms:
        if term is not None and term.wants is not None:
            for v in term.wants(scene):
                found.setdefault(v.name, v)
    return list(found.values())
