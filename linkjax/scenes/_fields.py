"""The types of the values in a scene file, as pydantic annotations: tables, quantities with units, names, pairs."""

from __future__ import annotations

import dataclasses
import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError, core_schema

from linkjax._units import DIMENSIONS, QuantityError, kind_of, quantity
from linkjax.mechanism import StructureError

SMALLEST, LARGEST = 1e-30, 1e20  # of any quantity but zero, in SI units: squares and products stay far from overflow


class Table(BaseModel):
    """A table of a scene file: no other keys than its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)


@dataclasses.dataclass(frozen=True)
class Quantity:
    """Annotation of a float that is written as a quantity of a `dimension`, read into SI units.

    `sign` restricts it: "any", "zero" (zero or more) or "positive"; `hint` is the remedy for a negative value.
    """

    dimension: str
    sign: Literal["any", "zero", "positive"] = "any"
    hint: str = ""

    def read(self, value: Any) -> float:
        """The value in SI units; raises a pydantic error with `problem` and `remedy` in its context."""
        try:
            result = quantity(value, self.dimension)
        except QuantityError as error:
            raise wrong(error.problem, error.remedy) from error
        wanted = DIMENSIONS[self.dimension]
        if result < 0 and self.sign != "any":
            least = "above zero" if self.sign == "positive" else "of zero or more"
            raise wrong("must not be negative", self.hint or f"write {wanted.phrase} {least}, e.g. {wanted.example}")
        if result == 0 and self.sign == "positive":
            raise wrong("must be greater than zero", f"write {wanted.phrase} above zero, e.g. {wanted.example}")
        if result != 0 and not SMALLEST < abs(result) < LARGEST:
            size = "large" if abs(result) > 1 else "small"
            raise wrong(f"too {size} for any machine", f"write {wanted.phrase} of usual size, e.g. {wanted.example}")
        return result

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema, handler):
        wanted = DIMENSIONS[self.dimension]
        bound = {"zero": {"minimum": 0}, "positive": {"exclusiveMinimum": 0}}.get(self.sign, {})
        if self.dimension == "angle":
            bound = {"const": 0}
        text = (
            f"{wanted.phrase[0].upper()}{wanted.phrase[1:]}: a string with a unit, e.g. {wanted.example}, or a number"
        )
        described = f"{text}{' in ' + wanted.unit if wanted.unit else ''}."
        return {"anyOf": [{"type": "string"}, {"type": "number", **bound}], "description": described}


def wrong(problem: str, remedy: str) -> PydanticCustomError:
    """The error of a validator: pydantic collects it, `_explain` turns it into a `SceneError`."""
    return PydanticCustomError("scene", "{problem}; {remedy}", {"problem": problem, "remedy": remedy})


def _pair(value: Any) -> Any:
    if not isinstance(value, list | tuple):
        raise wrong(
            f"{kind_of(value)} where a list of two is needed", "write two values in square brackets, [first, second]"
        )
    if len(value) != 2:
        raise wrong(f"a list of {len(value)} where two values are needed", "write [first, second]")
    return value


def checked_name(value: str) -> str:
    """The name; raises a pydantic error if it cannot be one."""
    if not re.fullmatch(r"[^\W\d_][\w-]{0,39}", value):
        raise wrong("not a usable name", "begin with a letter; up to 39 letters, digits, _ and - may follow")
    return value


def _turns(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 1000:
        raise wrong("not an integer from 1 to 1000", "write the number of turns in one cycle, e.g. 1")
    return value


def _count(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 100000:
        raise wrong("not a number of teeth", "write an integer from 1 to 100000, e.g. 20")
    return value


Pair = BeforeValidator(_pair)
Name = Annotated[str, AfterValidator(checked_name)]
Length = Annotated[float, Quantity("length")]
Distance = Annotated[float, Quantity("length", "zero", "a distance is not negative; turn it by 180 deg instead")]
LinkLength = Annotated[float, Quantity("length", "zero")]
Radius = Annotated[float, Quantity("length", "positive")]
Side = Annotated[float, Quantity("length", "positive")]
Tension = Annotated[float, Quantity("force", "zero")]
Count = Annotated[int, PlainValidator(_count), WithJsonSchema({"type": "integer", "minimum": 1, "maximum": 100000})]
Thickness = Annotated[float, Quantity("length", "positive")]
Angle = Annotated[float, Quantity("angle")]
Mass = Annotated[float, Quantity("mass", "zero")]
Inertia = Annotated[float, Quantity("inertia", "zero")]
Area = Annotated[float, Quantity("area", "positive")]
Density = Annotated[float, Quantity("density", "positive")]
Weight = Annotated[
    float, Quantity("acceleration", "zero", 'a single value points downwards; write [gx, gy], e.g. [0, "9.81 m/s^2"]')
]
Acceleration = Annotated[float, Quantity("acceleration")]
Speed = Annotated[float, Quantity("speed", "positive", 'write it positive, and rotation = "cw" for a clockwise crank')]
Magnitude = Annotated[
    float, Quantity("force", "zero", "write the magnitude; the motion gives the direction of an opposing force")
]
Force = Annotated[float, Quantity("force")]
Torque = Annotated[float, Quantity("torque")]
Ratio = Annotated[float, Quantity("number", "positive")]
Bore = Annotated[float, Quantity("length", "positive")]
Volume = Annotated[float, Quantity("volume", "positive")]
Pressure = Annotated[float, Quantity("pressure", "zero", "write absolute pressures, of zero or more")]
Exponent = Annotated[float, Quantity("number", "positive")]
Turns = Annotated[int, PlainValidator(_turns), WithJsonSchema({"type": "integer", "minimum": 1, "maximum": 1000})]
Stiffness = Annotated[float, Quantity("stiffness", "zero")]
TorsionalStiffness = Annotated[float, Quantity("torsional_stiffness", "zero")]
Damping = Annotated[float, Quantity("damping", "zero")]
TorsionalDamping = Annotated[float, Quantity("torsional_damping", "zero")]
QuadraticDrag = Annotated[float, Quantity("quadratic_drag", "zero")]
QuadraticDragTorque = Annotated[float, Quantity("quadratic_drag_torque", "zero")]


def number_of(value: Any) -> float:
    """A single number. Raises `StructureError` for a traced or batched number."""
    try:
        return float(value)
    except Exception as error:
        raise StructureError("scene", "its numbers are traced or batched", "write one scene at a time") from error


def amount(value: Any, unit: str) -> str:
    """A number with its unit, to the last bit. Raises `StructureError` for a traced or batched number."""
    return f"{number_of(value)!r} {unit}"
