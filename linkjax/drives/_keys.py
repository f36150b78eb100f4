"""The numbers of a motor drive by the keys of a scene file, with their units."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from linkjax.drives._drive import MotorDrive

KEYS = {"value": "torque", "no_load": "no_load_speed", "stall": "stall_torque"}  # fields with another name in a file
UNITS: dict[str, Any] = {  # of the fields of motors and transmissions; the points of a line have two
    "value": "N m", "no_load": "rad/s", "stall": "N m", "points": ("rad/s", "N m"), "speeds": "rad/s",
    "torques": "N m", "voltage": "V", "resistance": "ohm", "constant": "V s", "rated_current": "A", "rated_power": "W",
    "rated_speed": "rad/s", "synchronous_speed": "rad/s", "phase_voltage": "V", "frequency": "Hz",
    "stator_resistance": "ohm", "rotor_resistance": "ohm", "magnetizing_reactance": "ohm",
    "stator_reactance": "ohm", "rotor_reactance": "ohm", "friction_power": "W", "friction_speed": "rad/s",
    "max_speed": "rad/s", "max_torque": "N m",
}  # fmt: skip
SIGNED = ("value", "points", "speeds", "torques")  # all other numbers are zero or more


class DriveNumber(NamedTuple):
    """One number of a motor drive: its key, its unit ("1" for a plain number), whether it may be negative, and where it
    is in the drive."""

    key: str
    unit: str
    signed: bool
    where: Callable[[Any], Any]


def drive_numbers(drive: MotorDrive) -> Iterator[DriveNumber]:
    """Every number of a motor drive, with the key that it has under `[motor]`: `ratio`, `points[0][1]`."""
    parts: list[tuple[Any, Callable[[MotorDrive], Any]]] = [
        (drive.motor, lambda drive: drive.motor),
        (drive.transmission, lambda drive: drive.transmission),
    ]
    for part, inside in parts:
        for field in dataclasses.fields(part):
            name, value = field.name, getattr(part, field.name)
            if value is None or field.metadata.get("static"):
                continue
            units = UNITS.get(name, "1")
            for steps in _places(value):
                unit = units[steps[-1]] if isinstance(units, tuple) else units
                key = KEYS.get(name, name) + "".join(f"[{step}]" for step in steps)
                where = _where(inside, name, steps)
                yield DriveNumber(key, unit, name in SIGNED, where)
    yield DriveNumber("inertia", "kg m^2", False, lambda drive: drive.inertia)


def _places(value: Any) -> Iterator[tuple[int, ...]]:
    """The indices of the numbers in nested tuples; an empty one for a number."""
    if not isinstance(value, tuple):
        yield ()
        return
    for number, each in enumerate(value):
        yield from ((number, *inner) for inner in _places(each))


def _where(inside: Callable[[MotorDrive], Any], name: str, steps: tuple[int, ...]) -> Callable[[MotorDrive], Any]:
    def find(drive: MotorDrive) -> Any:
        value = getattr(inside(drive), name)
        for step in steps:
            value = value[step]
        return value

    return find
