"""Physical quantities written as strings, "300 mm", read into SI numbers.

A small grammar parses the string: a number, then units joined by spaces, `*`, `·` or `/`, with integer powers. Only
names of units are passed to pint, so nothing in a scene file is evaluated. Arithmetic is decimal: "570 mm" is exactly
the float 0.57, and "180 deg" is `math.pi`. Angle is a separate dimension here, so that "5 Hz" is not a speed of
rotation and "30" is not an angle.
"""

from __future__ import annotations

import decimal
import difflib
import functools
import math
import re
from typing import Any, NamedTuple

from linkjax._renamed import renamed


class Dimension(NamedTuple):
    """A physical dimension: its SI unit, its name with article, an example and common units."""

    unit: str
    phrase: str
    example: str
    units: tuple[str, ...]


DIMENSIONS = {
    "length": Dimension("m", "a length", '"300 mm"', ("m", "mm", "cm", "km", "in", "ft")),
    "angle": Dimension("rad", "an angle", '"30 deg"', ("deg", "rad", "turn")),
    "mass": Dimension("kg", "a mass", '"5 kg"', ("kg", "g", "t", "lb")),
    "inertia": Dimension("kg m^2", "a moment of inertia", '"0.65 kg m^2"', ("kg m^2", "kg cm^2", "g mm^2")),
    "acceleration": Dimension("m/s^2", "an acceleration", '"9.81 m/s^2"', ("m/s^2", "mm/s^2", "ft/s^2")),
    "angular_acceleration": Dimension("rad/s^2", "an angular acceleration", '"10 rad/s^2"', ("rad/s^2", "deg/s^2")),
    "speed": Dimension("rad/s", "a speed of rotation", '"700 rpm"', ("rpm", "rad/s", "rev/s", "deg/s")),
    "force": Dimension("N", "a force", '"30 kN"', ("N", "kN", "MN", "kp", "lbf")),
    "torque": Dimension("N m", "a torque", '"60 N m"', ("N m", "kN m", "N mm", "lbf ft")),
    "area": Dimension("m^2", "an area", '"600 mm^2"', ("m^2", "mm^2", "cm^2", "in^2")),
    "density": Dimension("kg/m^3", "a density", '"7850 kg/m^3"', ("kg/m^3", "g/cm^3", "kg/dm^3")),
    "stiffness": Dimension("N/m", "a stiffness", '"2 kN/m"', ("N/m", "kN/m", "N/mm", "lbf/in")),
    "torsional_stiffness": Dimension(
        "N m/rad", "a torsional stiffness", '"5 N m/rad"', ("N m/rad", "N m/deg", "N mm/rad", "kN m/rad")
    ),
    "damping": Dimension("N s/m", "a damping coefficient", '"200 N s/m"', ("N s/m", "kN s/m", "N s/mm")),
    "torsional_damping": Dimension(
        "N m s/rad", "a torsional damping coefficient", '"0.5 N m s/rad"', ("N m s/rad", "N m s/deg", "N mm s/rad")
    ),
    "quadratic_drag": Dimension("N s^2/m^2", "a coefficient of quadratic drag", '"0.8 N s^2/m^2"', ("N s^2/m^2",)),
    "quadratic_drag_torque": Dimension(
        "N m s^2/rad^2", "a coefficient of quadratic drag torque", '"2e-4 N m s^2/rad^2"', ("N m s^2/rad^2",)
    ),
    "power": Dimension("W", "a power", '"5.5 kW"', ("W", "kW", "MW", "hp", "PS")),
    "voltage": Dimension("V", "a voltage", '"230 V"', ("V", "mV", "kV")),
    "current": Dimension("A", "a current", '"12 A"', ("A", "mA", "kA")),
    "resistance": Dimension("ohm", "a resistance", '"0.56 ohm"', ("ohm", "Ω", "mohm", "kohm")),
    "motor_constant": Dimension("V s", "a motor constant", '"0.64 V s"', ("V s", "N m/A", "N mm/A")),
    "frequency": Dimension("Hz", "a frequency", '"50 Hz"', ("Hz", "kHz")),
    "weight_moment": Dimension("N m^2", "a flywheel effect as a weight", '"24 N m^2"', ("N m^2", "kp m^2")),
    "pressure": Dimension("Pa", "a pressure", '"6 bar"', ("bar", "MPa", "kPa", "Pa")),
    "volume": Dimension("m^3", "a volume", '"20 cm^3"', ("cm^3", "m^3", "mm^3")),
    "number": Dimension("", "a plain number", "0.15", ()),
}
TWOFOLD = ("damping", "quadratic_drag")  # their units, kg/s and kg/m, are those of other quantities, too

ALSO = {
    "s": "a time",
    "m/s": "a velocity",
    "s^-1": "a frequency",
}

DEFINITIONS = """
mega- = 1e6 = M-
kilo- = 1e3 = k-
deci- = 1e-1 = d-
centi- = 1e-2 = c-
milli- = 1e-3 = m-
micro- = 1e-6 = µ- = μ- = u-
meter = [length] = m = metre
gram = [mass] = g
second = [time] = s = sec
radian = [angle] = rad
degree = 0.01745329251994329508887757482524547311994764539930556 * radian = ° = deg
turn = 6.28318530717958623199592693708837032318115234375 * radian = _ = rev = revolution
minute = 60 * second = min
hour = 3600 * second = h
rpm = turn / minute = _ = RPM
hertz = 1 / second = Hz
inch = 0.0254 * meter = in = inches
foot = 0.3048 * meter = ft = feet
tonne = 1000 * kilogram = t
pound = 0.45359237 * kilogram = lb = lbm
ounce = 28.349523125 * gram = oz
newton = kilogram * meter / second ** 2 = N
kilopond = 9.80665 * newton = kp = kgf
pound_force = 4.4482216152605 * newton = lbf
newton_meter = newton * meter = Nm
pascal = newton / meter ** 2 = Pa
bar = 100000 * pascal
psi = 6894.757293168361 * pascal
joule = newton * meter = J
watt = joule / second = W
horsepower = 745.69987158227022 * watt = hp
metric_horsepower = 735.49875 * watt = PS
ampere = [current] = A = amp
volt = watt / ampere = V
ohm = volt / ampere = Ω
"""

NUMBER = re.compile(r"([+-]?(?:[0-9][0-9_]*\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*(.*)", re.DOTALL)
FACTOR = re.compile(
    r"\s*(?P<join>[*·/]?)\s*(?P<name>[^\W\d_]+|°)(?:(?:\^|\*\*)?(?P<power>[1-9])|(?:\^|\*\*)(?P<low>-[1-9]))?"
)
TIDY = str.maketrans({"−": "-", "²": "^2", "³": "^3", "⋅": "·", "×": "*"})


class QuantityError(ValueError):
    """A value is not a quantity of the required dimension; `problem` says why, `remedy` what to write."""

    def __init__(self, problem: str, remedy: str):
        self.problem, self.remedy = problem, remedy
        super().__init__(f"{problem}; {remedy}")


def nearest(name: str, known) -> str:
    """A hint: the name that replaces an old one, the most similar known name, or all known names."""
    return similar(name, known) or f"known here: {', '.join(sorted(known)) or 'none'}"


def similar(name: str, known) -> str:
    """A hint: the name that replaces an old one, or the most similar known name; empty if there is none."""
    if new := renamed(name, known):
        return f"it is called {new!r} now"
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"did you mean {close[0]!r}?" if close else ""


def quantity(value: Any, dimension: str) -> float:
    """`value` in SI units: a string with a unit ("300 mm"), or a plain number, which is in SI units already.

    `dimension` is a key of `DIMENSIONS`. A plain angle other than zero is refused, since 30 might mean degrees or
    radians. Raises `QuantityError` for anything but a finite quantity of this dimension.
    """
    wanted = DIMENSIONS[dimension]
    if isinstance(value, str):
        result = _read(value, wanted)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        result = _float(value)
        if dimension == "angle" and result != 0 and math.isfinite(result):
            raise QuantityError("an angle without a unit", f'write "{result:.12g} deg" or "{result:.12g} rad"')
    else:
        raise QuantityError(f"{kind_of(value)} where {wanted.phrase} is needed", _example(wanted))
    if not math.isfinite(result):
        raise QuantityError("not a finite number", _example(wanted))
    return result


def kind_of(value: Any) -> str:
    """The type of a TOML value, in words with an article."""
    kinds = {
        bool: "a truth value",
        int: "an integer",
        float: "a number",
        str: "a string",
        list: "a list",
        dict: "a table",
    }
    return kinds.get(type(value), "a date or time")


def _float(value: int | float) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _example(wanted: Dimension) -> str:
    return f"write {wanted.phrase}{' with its unit' if wanted.unit else ''}, e.g. {wanted.example}"


def _read(text: str, wanted: Dimension) -> float:
    match = NUMBER.fullmatch(text.translate(TIDY).strip())
    if text.strip().lower().lstrip("+-").startswith(("nan", "inf")):
        return math.nan
    if match is None or "," in text:
        comma = " (decimal point, no comma)" if "," in text else ""
        raise QuantityError("cannot be read as a number and a unit", _example(wanted) + comma)
    number, unit = match[1], match[2].strip()
    if wanted.unit == "rad/s" and unit.translate(str.maketrans("", "", " ^U")) in ("1/min", "/min", "min-1"):
        raise QuantityError("turns per minute are called rpm", f'write "{number} rpm"')
    if not wanted.unit and (plain := _plain(number, unit)):
        raise QuantityError("not a plain number", f"write {plain}")
    try:
        with decimal.localcontext(decimal.Context(prec=34)):
            amount = decimal.Decimal(number)
            if not unit and wanted.unit and amount:
                plain = f" (a number without quotes is in {wanted.unit})" if wanted.unit != "rad" else ""
                raise QuantityError("a number without a unit", _example(wanted) + plain)
            return float(amount * _factor(unit, wanted)) if unit else float(amount)
    except (decimal.DecimalException, OverflowError):
        return math.inf


def _plain(number: str, rest: str) -> str:
    """The value of a percentage or of a fraction such as "1/50"; empty for anything else."""
    divisor = NUMBER.fullmatch(rest[1:].strip()) if rest.startswith("/") else None
    if rest == "%":
        below = 100.0
    elif divisor and not divisor[2]:
        below = float(divisor[1])
    else:
        return ""
    return f"{float(number) / below:.12g}" if below else ""


def _factor(unit: str, wanted: Dimension) -> decimal.Decimal:
    """SI value of one `unit`; raises `QuantityError` if it is unknown or of another dimension."""
    factor, dimension = _resolve(unit, wanted)
    if dimension != _dimensions()[wanted.phrase]:
        twofold = [DIMENSIONS[name].phrase for name in TWOFOLD]
        named = [p for p, known in _dimensions().items() if known == dimension and known and p not in twofold]
        given = named[0] if named else f"a quantity in {unit}"
        raise QuantityError(f"{given} where {wanted.phrase} is needed", _example(wanted))
    return factor


def _resolve(unit: str, wanted: Dimension) -> tuple[decimal.Decimal, dict[str, int]]:
    """Product of the units in the string `unit`: its size in SI base units and its dimension."""
    factor, dimension, at = decimal.Decimal(1), dict[str, int](), 0
    while at < len(unit):
        match = FACTOR.match(unit, at)
        if match is None or (at == 0 and match["join"] not in ("", "/")) or len(unit) > 60:
            remedy = f"{_example(wanted)}; join units by spaces or *, divide by /, raise by ^"
            raise QuantityError(f"cannot read the unit {unit[:60]!r}", remedy)
        power = int(match["power"] or match["low"] or 1) * (-1 if match["join"] == "/" else 1)
        unit_found = _unit(match["name"])
        if unit_found is None:
            known = wanted.units or tuple(u for d in DIMENSIONS.values() for u in d.units)
            hint = nearest(match["name"], known) if wanted.units else similar(match["name"], known)
            remedy = f"{hint} ({_example(wanted)})" if hint else _example(wanted)
            raise QuantityError(f"unknown unit {match['name']!r}", remedy)
        factor *= unit_found[0] ** power
        for base, exponent in unit_found[1].items():
            dimension[base] = dimension.get(base, 0) + exponent * power
        at = match.end()
    return factor, {base: exponent for base, exponent in dimension.items() if exponent}


@functools.cache
def _unit(name: str) -> tuple[decimal.Decimal, dict[str, int]] | None:
    """Size in SI base units, and dimension, of a unit with or without prefix; None where there is no such unit."""
    registry, undefined = _registry()
    try:
        unit = registry.Quantity(decimal.Decimal(1), registry.parse_units(name)).to_base_units()
    except undefined:
        return None
    dimension = {str(base): int(power) for base, power in unit.dimensionality.items()}
    grams = dimension.get("[mass]", 0)  # pint's base unit of mass is the gram
    return unit.magnitude * decimal.Decimal(1000) ** -grams, dimension


@functools.cache
def _registry() -> tuple[Any, type[Exception]]:
    """pint's registry of the units that a machine needs (4 ms; all of pint's: 130 ms), and its error for others."""
    import pint

    units: Any = pint.UnitRegistry
    registry = units(DEFINITIONS.strip().splitlines(), non_int_type=decimal.Decimal)
    return registry, pint.UndefinedUnitError


@functools.cache
def _dimensions() -> dict[str, dict[str, int]]:
    """Dimension in base units by phrase."""
    units = {d.phrase: d.unit for d in DIMENSIONS.values()} | {phrase: unit for unit, phrase in ALSO.items()}
    number = DIMENSIONS["number"]
    return {phrase: _resolve(unit, number)[1] for phrase, unit in units.items()}


def display_units(text: str) -> dict[str, tuple[float, str]]:
    """Units in which numbers are shown, "mm, rpm, kN": for each SI unit replaced, a factor and a label.

    A number in the SI unit (written as in `DIMENSIONS`: "N m", "rad/s") times the factor is the number in the unit of
    the label ("kN·m", "rpm"). A length also replaces the metre in kinematic coefficients, "m/rad" and "m/rad^2", in
    velocities and in accelerations. A force and a length give the unit of torque; with pounds that is "lbf in" unless
    the length is in feet. Units that are given explicitly take precedence. Energy is "J"; "kN m" is a torque.

    Raises `QuantityError` for a unit that belongs to no quantity known here.
    """
    known = {phrase: d.unit for d in DIMENSIONS.values() if (phrase := d.phrase) and d.unit}
    known |= {phrase: unit for unit, phrase in ALSO.items()}
    example = 'write units with commas between, e.g. "mm, rpm, kN"'
    found: dict[str, tuple[float, str]] = {}
    chosen: dict[str, str] = {}
    for name in filter(None, map(str.strip, text.split(","))):
        try:
            factor, dimension = _resolve(name.translate(TIDY), DIMENSIONS["number"])
        except QuantityError as error:
            names = [unit for d in DIMENSIONS.values() for unit in d.units] + ["J", "kW", "W", "s", "ms", "Pa", "MPa"]
            hint = similar(name, names)
            raise QuantityError(error.problem, f"{hint} ({example})" if hint else example) from None
        phrase = next((p for p, base in _dimensions().items() if p in known and base == dimension), None)
        if phrase is None:
            raise QuantityError(f"{name!r} belongs to no quantity that is shown", example)
        unit = "J" if name.endswith("J") else known[phrase]
        if unit in found:
            raise QuantityError(f"two units of {phrase.partition(' ')[2]}, {found[unit][1]!r} and {name!r}", "keep one")
        size = float(1 / factor)
        found[unit], chosen[unit] = (size, label_of(name)), name
        if unit == "m":
            found |= {f"m/rad{power}": (size, f"{label_of(name)}/rad{label_of(power)}") for power in ("", "^2")}
    return _compounds(chosen) | found


def _compounds(chosen: dict[str, str]) -> dict[str, tuple[float, str]]:
    """Units that follow from those chosen, by SI unit: velocity and acceleration from the length, torque from both."""
    length, force = chosen.get("m"), chosen.get("N")
    found = {} if length is None else {f"m/s{power}": f"{length}/s{power}" for power in ("", "^2")}
    if force == "lbf":
        length = length if length in ("ft", "feet", "foot") else "in"
    if force and length:
        found["N m"] = f"{force} {length}"
    number = DIMENSIONS["number"]
    return {si: (float(1 / _resolve(name.translate(TIDY), number)[0]), label_of(name)) for si, name in found.items()}


def unit_of(value: Any) -> str:
    """The unit in which a speed of rotation is written, e.g. "rpm"; "rad/s" for a number, otherwise an empty string."""
    if isinstance(value, str):
        match = NUMBER.fullmatch(value.translate(TIDY).strip())
        return match[2].strip() if match else ""
    return "rad/s" if isinstance(value, int | float) else ""


def label_of(unit: str) -> str:
    """A unit as it is printed: "kN·m" for "kN m", "m/s²" for "m/s^2", "°" for "deg", empty for "1"."""
    if unit in ("1", "deg"):
        return "" if unit == "1" else "°"
    joined = re.sub(r"\s*[*·\s]\s*", "·", unit.strip().translate(TIDY))
    return re.sub(r"\^?([23])$|\^([23])", lambda match: "²³"[int(match[1] or match[2]) - 2], joined)


def in_si(text: str) -> tuple[float, str]:
    """Value and SI unit of a quantity in a string, e.g. (0.15, "m") for "150 mm"; the unit is "1" for a plain number.
    Raises `QuantityError` for a string that is not a quantity known here."""
    match = NUMBER.fullmatch(text.translate(TIDY).strip())
    remedy = 'write a number and a unit, e.g. "150 mm"'
    if match is None:
        raise QuantityError("cannot be read as a number and a unit", remedy)
    name = match[2].strip()
    factor, dimension = _resolve(name, DIMENSIONS["number"])
    units = {d.phrase: d.unit or "1" for d in DIMENSIONS.values()} | {phrase: unit for unit, phrase in ALSO.items()}
    unit = next((units[phrase] for phrase, known in _dimensions().items() if known == dimension), None)
    if unit is None:
        raise QuantityError(f"the unit {name!r} belongs to no known quantity", remedy)
    return float(decimal.Decimal(match[1]) * factor), unit
