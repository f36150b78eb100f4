"""The section `[optimise]` of a scene file: the optimisation problem."""

from __future__ import annotations

import inspect
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainValidator, WithJsonSchema

from linkjax._renamed import renamed
from linkjax._units import kind_of, nearest
from linkjax.design import DesignError, function_error, path_error, position_error
from linkjax.scenes._fields import Name, Table, wrong

RANGES = 'write e.g. "0 to 40 kg m^2", "± 8 %", or ["0.95 m", "1.1 m"]'


def _range(value: Any) -> Any:
    pair = isinstance(value, list) and len(value) == 2 and all(_amount_like(end) for end in value)
    if isinstance(value, str) or pair:
        return value
    if isinstance(value, dict):
        unknown = set(value) - {"range", "linked", "initial"}
        if unknown or "range" not in value:
            key = sorted(unknown)[0] if unknown else ""
            now = f"it is called {new!r} now: " if (new := renamed(key, ["range", "linked"])) else ""
            problem = f"unknown key {key!r}" if unknown else "no range"
            raise wrong(problem, now + 'write { range = "± 8 %", linked = ["links.link4.length"] }')
        linked = value.get("linked", [])
        if not isinstance(linked, list) or not all(isinstance(name, str) for name in linked):
            raise wrong("`linked` is not a list of names", 'write e.g. linked = ["links.link4.length"]')
        _range(value["range"])
        if "initial" in value:
            _amount(value["initial"])
        return value
    raise wrong(f"{kind_of(value)} where a range is needed", RANGES)


def _amount(value: Any) -> Any:
    if not _amount_like(value):
        raise wrong(f"{kind_of(value)} where a quantity is needed", 'write e.g. "15 kg m^2"')
    return value if isinstance(value, str) else float(value)


def _amount_like(value: Any) -> bool:
    return isinstance(value, str | int | float) and not isinstance(value, bool)


def _seed(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise wrong("not an integer of zero or more", "write e.g. 1")
    return value


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 10_000:
        raise wrong("not an integer from 1 to 10000", "write the number of starts, e.g. 10")
    return value


def _goal(value: Any) -> Any:
    """The name of a measure or scene parameter, or the ready-made term of a table."""
    if isinstance(value, str):
        return value
    if not isinstance(value, dict):
        raise wrong(f"{kind_of(value)} where a string or a table is needed", f'write e.g. "delta", or {GOAL}')
    kinds = [name for name in READY if name in value]
    if len(kinds) != 1:
        raise wrong("not one of " + ", ".join(READY) if not kinds else f"both {' and '.join(kinds)}", f"write {GOAL}")
    made = READY[kinds[0]]
    _, *others = inspect.signature(made).parameters.values()
    known = {each.name: each.default is each.empty for each in others}
    rest = {key: each for key, each in value.items() if key != kinds[0]}
    for key in rest:
        if key not in known:
            raise wrong(f"unknown key {key!r}", nearest(key, known))
    for key, needed in known.items():
        if needed and key not in rest:
            raise wrong(f"no {key}", f"write {GOAL}")
    _with_units(rest)
    try:
        return made(value[kinds[0]], **rest)
    except DesignError as error:
        raise wrong(f"{error.element}: {error.problem}", error.remedy) from error


def _with_units(given: dict[str, Any]) -> None:
    """Raise an error for an angle without a unit."""
    lists = {key: given[key] for key in ("angles", "values") if isinstance(given.get(key), list)}
    if isinstance(given.get("positions"), list):
        lists["positions"] = [row[2] for row in given["positions"] if isinstance(row, list) and len(row) == 3]
    for key, values in lists.items():
        for each in values:
            if not isinstance(each, str) and each != 0:
                raise wrong(f"{key}: {each!r} is an angle without a unit", f'write "{each} deg"')


READY = {"path_error": path_error, "function_error": function_error, "position_error": position_error}
GOAL = 'e.g. { path_error = "P", points = [["20 mm", "10 mm"]], angles = ["30 deg"] }'
AMOUNT = {"anyOf": [{"type": "string"}, {"type": "number"}]}
PAIR = {"type": "array", "items": AMOUNT, "minItems": 2, "maxItems": 2}
LINKED = {
    "type": "object", "required": ["range"], "additionalProperties": False,
    "properties": {
        "range": {"anyOf": [{"type": "string"}, PAIR], "description": "lower and upper bound"},
        "linked": {"type": "array", "items": {"type": "string"}, "description": "parameters in constant ratio to it"},
        "initial": {**AMOUNT, "description": "initial value of an own number"},
    },
}  # fmt: skip
AMOUNTS = {"type": "array", "items": AMOUNT}
TEXT = {"type": "string"}
SYNTHESIS = {
    "type": "object", "additionalProperties": False,
    "properties": {
        "path_error": {**TEXT, "description": "the point that passes through `points`"},
        "function_error": {**TEXT, "description": "the link whose angle takes `values`"},
        "position_error": {**TEXT, "description": "the link that takes `positions`"},
        "points": {"type": "array", "items": PAIR, "description": "wanted points, x and y"},
        "values": {**AMOUNTS, "description": "wanted angles of the link"},
        "positions": {"type": "array", "items": AMOUNTS, "description": "wanted positions, x, y and angle"},
        "angles": {"anyOf": [AMOUNTS, TEXT], "description": "crank angles; free without them"},
        "point": {**TEXT, "description": "the point of the link, instead of its origin"},
        "length": {**AMOUNT, "description": "length by which the angle of a position counts"},
        "start": {**TEXT, "description": "own number that is added to all crank angles"},
        "offset": {**TEXT, "description": "own number that is added to all values"},
        "weights": {"type": "array", "items": {"type": "number"}, "description": "weight of every square"},
    },
}  # fmt: skip
Goal = Annotated[Any, PlainValidator(_goal), WithJsonSchema({"anyOf": [TEXT, SYNTHESIS]})]
Range = Annotated[Any, PlainValidator(_range), WithJsonSchema({"anyOf": [{"type": "string"}, PAIR, LINKED]})]
Amount = Annotated[Any, BeforeValidator(_amount), WithJsonSchema(AMOUNT)]
Starts = Annotated[int, PlainValidator(_whole), WithJsonSchema({"type": "integer", "minimum": 1, "maximum": 10_000})]


Seed = Annotated[int, PlainValidator(_seed), WithJsonSchema({"type": "integer", "minimum": 0})]


class Case(Table):
    """An operating case: every constraint holds in each case, and the objective is the worst of all cases."""

    name: Name = Field(description="name of the case", examples=["idle"])
    changes: dict[str, Amount] = Field(
        default={}, description="scene parameters that differ, by name", examples=[{"loads.hay.force": "0 N"}]
    )


class TradeOff(Table):
    """More bounds of one constraint, with an optimum for each."""

    limit: str = Field(description="name of the constraint", examples=["flywheel.inertia"])
    bounds: list[Amount] = Field(description="its other bounds", examples=[["15 kg m^2", "10 kg m^2"]])


class Optimise(Table):
    """The optimisation problem."""

    minimise: Goal | None = Field(
        default=None,
        description="objective to minimise: a measure, a scene parameter, or a table with wanted points or positions",
        examples=["delta"],
    )
    maximise: str | None = Field(default=None, description="objective to maximise, instead", examples=["min_margin"])
    free: dict[str, Range] = Field(
        default={},
        description="the design variables by name, each with its range",
        examples=[{"flywheel.inertia": "0 to 40 kg m^2"}],
    )
    limits: list[str] = Field(default=[], description="the constraints", examples=[["delta <= 0.15"]])
    cases: list[Case] = Field(default=[], description="operating cases of load and speed")
    trade_off: TradeOff | None = Field(default=None, description="more bounds of one constraint")
    starts: Starts = Field(
        default=1, description="number of starts: first the scene, then random designs", examples=[10]
    )
    seed: Seed = Field(default=0, description="seed of the random starts", examples=[1])
    solver: str = Field(
        default="cone", description='"cone", or another of `linkjax optimise --help`', examples=["slsqp"]
    )
    changes: dict[str, Any] = Field(
        default={}, description="keys of this file that are changed before the optimisation, by path",
        examples=[{"links.rod.mass_properties": "scaled"}],
    )  # fmt: skip
