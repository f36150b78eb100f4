"""The table `[motor]` of a scene file: what drives the crank, and with which torque.

One class for each kind of motor; a new kind is a new class and a branch of `Motor`.
"""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, PlainValidator, Tag, WithJsonSchema
from pydantic_core import core_schema

from linkjax import drives
from linkjax._units import QuantityError, quantity
from linkjax.mechanism import StructureError
from linkjax.scenes._fields import Inertia, Pair, Quantity, Ratio, Speed, Table, Torque, wrong
from linkjax.scenes._guides import Fault

ShaftSpeed = Annotated[float, Quantity("speed")]
Point = Annotated[tuple[ShaftSpeed, Torque], Pair]
Limit = Annotated[float, Quantity("torque", "positive")]
Part = Annotated[float, Quantity("number", "zero")]
Power = Annotated[float, Quantity("power", "positive")]
Loss = Annotated[float, Quantity("power", "zero")]
Voltage = Annotated[float, Quantity("voltage", "positive")]
Current = Annotated[float, Quantity("current", "positive")]
Resistance = Annotated[float, Quantity("resistance", "positive")]
Reactance = Annotated[float, Quantity("resistance", "zero")]
Constant = Annotated[float, Quantity("motor_constant", "positive")]
Frequency = Annotated[float, Quantity("frequency", "positive")]


class FlywheelEffect:
    """Annotation of an inertia (kg m²) that is written as a flywheel effect GD², in kg m² or, as a weight, in N m²."""

    def read(self, value: Any) -> float:
        """The inertia; raises a pydantic error for anything but a positive quantity of one of the two dimensions."""
        example = 'write it with its unit, e.g. "2.4 kg m^2", or as a weight "24 N m^2"'
        if not isinstance(value, str):
            raise wrong("GD² without a unit", example)
        try:
            result = float(drives.inertia_of_gd2(quantity(value, "weight_moment"), weight=True))
        except QuantityError:
            try:
                result = float(drives.inertia_of_gd2(quantity(value, "inertia")))
            except QuantityError as error:
                raise wrong(error.problem, example) from error
        if result < 0:
            raise wrong("must not be negative", example)
        return result

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema, handler):
        return {
            "type": "string",
            "description": 'A flywheel effect GD² with its unit, e.g. "2.4 kg m^2" or "24 N m^2".',
        }


def _pole_pairs(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 100:
        raise wrong("not an integer from 1 to 100", "write half the number of poles, e.g. 2 for 1500 rpm at 50 Hz")
    return value


PolePairs = Annotated[int, PlainValidator(_pole_pairs), WithJsonSchema({"type": "integer", "minimum": 1})]


class MotorTable(Table, abc.ABC):
    """A motor of any kind with its transmission and rotor."""

    ratio: Ratio = Field(1.0, description="motor speed over crank speed", examples=[4.5])
    efficiency: Ratio | None = Field(
        None, description="efficiency of the gear or belt, from the motor to the crank; default: 1", examples=[0.95]
    )
    efficiency_back: Ratio | None = Field(
        None, description="its efficiency where power flows back; default: the same", examples=[0.9]
    )
    creep: Part | None = Field(None, description="part of the speed that a belt loses; default: 0", examples=[0.02])
    inertia: Inertia | None = Field(None, description="inertia on the motor's shaft", examples=["0.12 kg m^2"])
    gd2: Annotated[float, FlywheelEffect()] | None = Field(
        None, description="instead of the inertia: the flywheel effect GD²", examples=["0.48 kg m^2"]
    )

    @abc.abstractmethod
    def motor(self) -> drives.AbstractMotor:
        """The motor itself. Raises `ValueError` where its keys contradict each other."""

    def build(self) -> drives.MotorDrive | None:
        """The motor with transmission and rotor; None for the torque that balances the cycle."""
        inertia = self.inertia if self.gd2 is None else self.gd2
        transmission = drives.Transmission(self.ratio, self.efficiency, self.efficiency_back, self.creep)
        return drives.MotorDrive(self.motor(), transmission, 0.0 if inertia is None else inertia)

    def faults(self) -> Iterator[Fault]:
        """The contradictions between its keys."""
        if self.gd2 is not None and self.inertia is not None:
            yield ("motor", "gd2"), "given twice: the inertia follows from it", "delete gd2, or inertia"
        try:
            self.build()
        except ValueError as error:
            problem, _, remedy = str(error).partition("; ")
            key = problem.split(" ")[0]
            yield ("motor", key) if key in self.model_fields_set else ("motor",), problem, remedy

    def needs(self, *ways: tuple[str, ...]) -> Iterator[Fault]:
        """The keys that are missing, or too many, where one of several sets of keys is needed."""
        given = [key for way in ways for key in way if getattr(self, key) is not None]
        if set(given) not in [set(way) for way in ways]:
            listed = ", or ".join(" and ".join(way) for way in ways)
            kind = getattr(self, "kind", "")
            yield (
                ("motor",),
                f"has {' and '.join(dict.fromkeys(given)) or 'none of its keys'}",
                (f'a motor of kind = "{kind}" has {listed}'),
            )


class BalanceTable(Table):
    """No motor of its own: the constant torque on the crank that balances the cycle."""

    kind: Literal["balance"] = Field(
        "balance", description="the constant torque that balances the cycle", examples=["balance"]
    )

    def build(self) -> None:
        """No motor."""

    def faults(self) -> Iterator[Fault]:
        """None."""
        yield from ()


class NoMotorTable(MotorTable):
    """No motor: the machine runs freely."""

    kind: Literal["none"] = Field(description="no torque: free motion", examples=["none"])

    def motor(self) -> drives.AbstractMotor:
        return drives.NoMotor()


class TorqueTable(MotorTable):
    """A motor with a constant torque."""

    kind: Literal["torque"] = Field(description="a constant torque at any speed", examples=["torque"])
    torque: Torque = Field(description="torque at the motor's shaft", examples=["60 N m"])

    def motor(self) -> drives.AbstractMotor:
        return drives.ConstantTorque(self.torque)


class LineTable(MotorTable):
    """A motor whose torque is a straight line over its speed."""

    kind: Literal["line"] = Field(description="a straight line over the speed", examples=["line"])
    points: Annotated[tuple[Point, Point], Pair] | None = (
        Field(
            None, description="two points of the line, [speed, torque] each",
            examples=[[["1200 rpm", "0 N m"], ["1120 rpm", "176 N m"]]],
        )
    )  # fmt: skip
    no_load_speed: Speed | None = Field(None, description="or: speed without load", examples=["1500 rpm"])
    stall_torque: Limit | None = Field(None, description="with it: torque at rest", examples=["90 N m"])

    def motor(self) -> drives.AbstractMotor:
        return drives.LineMotor(self.points, self.no_load_speed, self.stall_torque)

    def faults(self) -> Iterator[Fault]:
        yield from list(self.needs(("points",), ("no_load_speed", "stall_torque"))) or super().faults()


class TableTable(MotorTable):
    """A motor given by a table of torques over speeds."""

    kind: Literal["table"] = Field(description="a table of torques over speeds", examples=["table"])
    speeds: list[ShaftSpeed] = Field(
        description="increasing speeds of the motor's shaft", examples=[["0 rpm", "1000 rpm", "1450 rpm", "1500 rpm"]]
    )
    torques: list[Torque] = Field(description="the torques there", examples=[["60 N m", "80 N m", "36 N m", "0 N m"]])

    def motor(self) -> drives.AbstractMotor:
        return drives.TableMotor(self.speeds, self.torques)


class DCTable(MotorTable):
    """A DC motor with separate or permanent excitation."""

    kind: Literal["dc"] = Field(description="a DC motor, separately excited", examples=["dc"])
    voltage: Voltage = Field(description="voltage of the armature", examples=["100 V"])
    resistance: Resistance = Field(description="resistance of the armature", examples=["0.05 ohm"])
    constant: Constant | None = Field(None, description="motor constant", examples=["0.6366 V s"])
    rated_current: Current | None = Field(None, description="or: rated current", examples=["100 A"])
    rated_speed: Speed | None = Field(None, description="with it: rated speed", examples=["1425 rpm"])

    def motor(self) -> drives.AbstractMotor:
        if self.constant is None:
            return drives.DCMotor.rated(self.voltage, self.resistance, self.rated_current, self.rated_speed)
        return drives.DCMotor(self.voltage, self.resistance, self.constant, self.rated_current)

    def faults(self) -> Iterator[Fault]:
        ways = (("constant",), ("constant", "rated_current"), ("rated_current", "rated_speed"))
        yield from list(self.needs(*ways)) or super().faults()


class InductionTable(MotorTable):
    """An induction motor by its type plate."""

    kind: Literal["induction"] = Field(description="an induction motor, by its type plate", examples=["induction"])
    rated_power: Power = Field(description="rated power", examples=["18.5 kW"])
    rated_speed: Speed = Field(description="rated speed", examples=["1462 rpm"])
    synchronous_speed: Speed = Field(description="synchronous speed", examples=["1500 rpm"])
    breakdown_ratio: Ratio = Field(description="breakdown torque over rated torque", examples=[2.5])
    starting_ratio: Ratio | None = Field(None, description="starting torque over rated torque", examples=[2.0])
    q: Part = Field(0.0, description="the term q of Kloss' formula, 2 s_b R1 / R2'", examples=[0.4])

    def motor(self) -> drives.AbstractMotor:
        return drives.InductionMotor(self.rated_power, self.rated_speed, self.synchronous_speed,
                                     self.breakdown_ratio, self.starting_ratio, self.q)  # fmt: skip


class CircuitTable(MotorTable):
    """An induction motor by its equivalent circuit."""

    kind: Literal["induction"] = Field(description="an induction motor, by its circuit", examples=["induction"])
    phase_voltage: Voltage | None = Field(None, description="voltage at one winding", examples=["230 V"])
    line_voltage: Voltage | None = Field(None, description="or: voltage between two lines", examples=["400 V"])
    connection: Literal["delta", "star"] | None = Field(
        None, description="with it: connection of the windings", examples=["delta"]
    )
    frequency: Frequency = Field(description="frequency of the supply", examples=["50 Hz"])
    pole_pairs: PolePairs = Field(description="number of pole pairs", examples=[2])
    stator_resistance: Reactance = Field(description="resistance of a stator phase, warm", examples=["0.71 ohm"])
    rotor_resistance: Resistance = Field(description="that of the rotor, referred to the stator", examples=["0.54 ohm"])
    magnetizing_reactance: Resistance = Field(description="magnetizing reactance", examples=["66.4 ohm"])
    stator_reactance: Reactance = Field(description="leakage reactance of the stator", examples=["1.52 ohm"])
    rotor_reactance: Reactance = Field(description="that of the rotor, referred to the stator", examples=["2.31 ohm"])
    friction_power: Loss = Field(0.0, description="power of friction and ventilation", examples=["180 W"])
    friction_speed: Speed | None = Field(None, description="the speed to which it belongs", examples=["1462 rpm"])

    def motor(self) -> drives.AbstractMotor:
        voltage = self.phase_voltage
        if self.line_voltage is not None and self.connection is not None:
            voltage = drives.phase_voltage_of(self.line_voltage, self.connection)
        return drives.InductionCircuit(
            voltage, self.frequency, self.pole_pairs, self.stator_resistance, self.rotor_resistance,
            self.magnetizing_reactance, self.stator_reactance, self.rotor_reactance, self.friction_power,
            self.friction_speed,
        )  # fmt: skip

    def faults(self) -> Iterator[Fault]:
        yield from list(self.needs(("phase_voltage",), ("line_voltage", "connection"))) or super().faults()


class ServoTable(MotorTable):
    """A servo motor, which follows the motion law of the driver within its limits."""

    kind: Literal["servo"] = Field(description="a servo motor, which follows the law", examples=["servo"])
    max_speed: Speed = Field(description="its greatest speed", examples=["3000 rpm"])
    max_torque: Limit = Field(description="its greatest torque", examples=["40 N m"])

    def motor(self) -> drives.AbstractMotor:
        return drives.Servo(self.max_speed, self.max_torque)


CIRCUIT = set(CircuitTable.model_fields) - set(MotorTable.model_fields) - {"kind"}


def _kind(value: Any) -> str | None:
    if not value and (value is None or isinstance(value, dict)):
        return "#balance"  # no table yet, or an empty one
    if not isinstance(value, dict):
        return None
    kind = value.get("kind")
    if kind == "induction" and CIRCUIT & set(value):
        return "#induction-circuit"
    return f"#{kind}" if isinstance(kind, str) else None


Motor = Annotated[
    Annotated[BalanceTable, Tag("#balance")]
    | Annotated[NoMotorTable, Tag("#none")]
    | Annotated[TorqueTable, Tag("#torque")]
    | Annotated[LineTable, Tag("#line")]
    | Annotated[TableTable, Tag("#table")]
    | Annotated[DCTable, Tag("#dc")]
    | Annotated[InductionTable, Tag("#induction")]
    | Annotated[CircuitTable, Tag("#induction-circuit")]
    | Annotated[ServoTable, Tag("#servo")],
    Discriminator(_kind),
]
KINDS: dict[type[drives.AbstractMotor], str] = {
    drives.NoMotor: "none",
    drives.ConstantTorque: "torque",
    drives.LineMotor: "line",
    drives.TableMotor: "table",
    drives.DCMotor: "dc",
    drives.InductionMotor: "induction",
    drives.InductionCircuit: "induction",
    drives.Servo: "servo",
}


def motor_keys(drive: drives.MotorDrive) -> dict[str, Any]:
    """The table of a motor with its transmission and rotor. Raises `StructureError` for kinds that scene files do not
    support, and for numbers that are traced or batched."""
    kind = KINDS.get(type(drive.motor))
    if kind is None:
        problem = f"scene files do not support motors of the kind {type(drive.motor).__name__}"
        raise StructureError("motor", problem, f"known here: {', '.join(motor.__name__ for motor in KINDS)}")
    table: dict[str, Any] = {"kind": kind}
    for part in (drive.motor, drive.transmission):
        for field in dataclasses.fields(part):
            value, unit = getattr(part, field.name), drives.UNITS.get(field.name, "")
            if value is not None:
                table[drives.KEYS.get(field.name, field.name)] = _written(value, unit)
    return {**table, "inertia": _written(drive.inertia, "kg m^2")}


def _written(value: Any, unit: Any) -> Any:
    """A number with its unit, to the last bit, or a list of them; the points of a line have two units."""
    if isinstance(value, int):
        return value
    if isinstance(value, tuple):
        units = unit if isinstance(unit, tuple) else (unit,) * len(value)
        pairs = units * len(value) if value and isinstance(value[0], tuple) else units
        return [
            _written(each, unit if isinstance(each, tuple) else own) for each, own in zip(value, pairs, strict=False)
        ]
    try:
        number = float(value)
    except Exception as error:
        raise StructureError("scene", "its numbers are traced or batched", "write one scene at a time") from error
    return f"{number!r} {unit}" if unit else number
