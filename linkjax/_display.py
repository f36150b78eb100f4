"""Numbers for people: SI input, shown in the chosen units, or with SI prefixes where no unit was chosen."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, SupportsFloat

from linkjax._units import label_of

NONE = "–"
NO_BOUND = "∞"
PLAIN = str.maketrans({"·": " ", "²": "^2", "³": "^3"})
ROUNDING = 1e-12  # relative to a sum's terms: a smaller sum counts as zero
NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
AMOUNT = re.compile(rf"(?<![\w.])({NUMBER})(?: to ({NUMBER}))? (m|rad/s|rad|degrees)(?![\w/^²])")
QUOTED = re.compile(r"""("[^"]*"|(?<!\w)'[^']*')""")
IN_WORDS = {
    "delta": "coefficient of speed fluctuation δ",
    "steady_state_margin": "steady-state margin",
    "flywheel_for_target_delta": "flywheel inertia for target δ",
}
Units = Mapping[str, tuple[float, str]]  # see `linkjax._units.display_units`


class Numbers(NamedTuple):
    """Format numbers: SI input, shown in the chosen units, or with SI prefixes where no unit was chosen.

    Units are given as printed ("kN·m") or as in measures ("kN m"). `beside` is a magnitude to compare with: a value
    that is only a rounding error of it is shown as zero.
    """

    units: Units = MappingProxyType({})

    def quantity(self, value: float, unit: str = "", digits: int = 5, beside: float = 0.0) -> str:
        """A number with `digits` significant digits and its unit."""
        return self.alike([value], unit, digits, beside)[0]

    def alike(
        self, values: Iterable[float], unit: str = "", digits: int = 5, beside: float = 0.0, largest: float = 0.0
    ) -> list[str]:  # fmt: skip
        """Numbers with `digits` significant digits, all in the unit that suits the largest, or the `largest` that is
        shown elsewhere; a rounding error of the largest is shown as zero, too."""
        values = [above(value, beside) for value in values]
        size = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
        factor, label = prefixed(max(size, largest), unit, self.units)
        return [_number(factor * above(value, size), label, digits) for value in values]

    def shown(self, value: SupportsFloat, unit: str = "") -> str:
        """An input number with its unit, without trailing zeros."""
        if not math.isfinite(float(value)):
            return NONE
        factor, label = prefixed(abs(float(value)), unit, self.units)
        return _joined(short(factor * float(value)), label)

    def place(self, at: tuple[SupportsFloat, SupportsFloat], unit: str = "m", beside: float = 0.0) -> str:
        """Two coordinates in one unit, "(0.3, −0.1) m"."""
        x, y = (above(float(value), beside) for value in at)
        factor, label = prefixed(max((abs(v) for v in (x, y) if math.isfinite(v)), default=0.0), unit, self.units)
        return _joined(f"({short(factor * x)}, {short(factor * y)})", label)

    def turned(self, value: float | None) -> str:
        """An angle (rad), in degrees unless another unit was chosen."""
        if value is None or not math.isfinite(value):
            return NONE
        factor, label = self._angles()
        places = 3 if label == "°" else 5
        return _joined(f"{round(factor * value, places) + 0.0:.{places}f}".replace("-", "−"), label)

    def _angles(self) -> tuple[float, str]:
        return self.units.get("rad", (180 / math.pi, "°"))

    def speed(self, value: float, digits: int = 6, error: float = 0.0) -> str:
        """A speed of rotation (rad/s), in revolutions per minute unless another unit was chosen, with no more digits
        than its `error` allows."""
        factor, label = turning(self.units)
        ratio = abs(float(value)) / error if error > 0 else math.inf
        digits = digits if ratio > 10.0**digits else 1 + math.floor(math.log10(max(ratio, 1.0)))
        return _number(factor * float(value), label, digits)

    def measured(self, value: float, error: float, unit: str = "", most: int = 10) -> tuple[str, str]:
        """A value and its error bound. The value has the digits that the error allows, but at least 3; it is shown as
        zero if it is below its error."""
        if not (math.isfinite(value) and math.isfinite(error)):
            return _missing(value), ""
        value = value if abs(value) > error else 0.0
        factor, label = prefixed(abs(value), unit, self.units)
        ratio = abs(value) / error if error > 0 else math.inf
        digits = most if ratio > 10.0**most else max(3, min(most, math.floor(math.log10(max(ratio, 1.0))) + 1))
        return _joined(number(factor * value, digits), label), f"± {self.quantity(error, unit, 2)}"

    def bound(self, value: SupportsFloat | None, unit: str) -> str:
        """An input bound, with its unit as in measures, without trailing zeros."""
        if value is None or not math.isfinite(float(value)):
            return NONE
        if unit not in ("rad", "rad/s"):
            return self.shown(value, label_of(unit))
        factor, label = turning(self.units) if unit == "rad/s" else self._angles()
        return _joined(short(factor * float(value)), label)

    def told(
        self, values: Sequence[SupportsFloat | None], unit: str, digits: int = 5, beside: float = 0.0
    ) -> list[str]:  # fmt: skip
        """Several values of one quantity, with its unit as in measures ("N m", "1", "rad"), all in the unit that suits
        the largest; a dash for None."""
        numbers = [math.nan if value is None else float(value) for value in values]
        if unit == "rad":
            factor, label = self._angles()
            return [_number(factor * value, label, digits) for value in numbers]
        if unit == "rad/s":
            return [self.speed(value) for value in numbers]
        return self.alike(numbers, label_of(unit), digits, beside)


def above(value: float, beside: float) -> float:
    """A number, or zero where it is only a rounding error of `beside`."""
    return 0.0 if abs(value) < ROUNDING * abs(beside) else value


def _number(value: float, label: str, digits: int) -> str:
    if not math.isfinite(value):
        return _missing(value)
    mantissa, _, power = number(value, digits).partition("e")
    scale = f"·10{superscript(int(power.replace('−', '-')))}" if power else ""
    return _joined(f"{mantissa}{scale}", label)


def _missing(value: float) -> str:
    return NONE if math.isnan(value) else NO_BOUND if value > 0 else f"−{NO_BOUND}"


def _joined(text: str, label: str) -> str:
    """A number and its unit, which may begin with a power of ten, except for zero."""
    if text == "0" and label.startswith("10"):
        label = label.partition(" ")[2]
    between = "" if label in ("°", "") else "·" if label.startswith("10") else " "
    return f"{text}{between}{label}"


def short(value: float) -> str:
    """A number without trailing zeros, at most six digits; a dash for NaN and infinity; zero has no sign."""
    if not math.isfinite(value):
        return NONE
    mantissa, _, power = f"{value + 0.0:.6g}".partition("e")
    return f"{mantissa}{f'·10{superscript(int(power))}' if power else ''}".replace("-", "−")


def prefixed(size: float, unit: str, units: Units | None = None) -> tuple[float, str]:
    """Factor and label that make numbers up to `size` (SI) easy to read: (1e-3, "kN") for 2000 N.

    A unit that was chosen in `units` is used for any size. Otherwise metres become millimetres below 10 m, and units
    without prefixes get a power of ten.
    """
    chosen = (units or {}).get(unit.translate(PLAIN))
    if chosen:
        return chosen
    if unit in ("m", "m/rad", "m/rad²"):
        for limit, factor, prefix in ((10.0, 1.0, ""), (1e-3, 1e3, "m"), (0.0, 1e6, "µ")):
            if size >= limit and (size > 0 or limit == 0.0):
                return (factor, prefix + unit) if size > 0 else (1e3, "m" + unit)
    if unit == "m²" and size >= 1e-9:  # the prefix belongs to the metre
        return (1.0, unit) if size >= 1 else (1e6, "mm²")
    if unit == "m³":
        return (1.0, unit) if size >= 1 else (1e6, "cm³")
    if size == 0 or unit == "" or (unit in ("m/s", "m/s²") and size >= 1):
        return 1.0, unit
    power = 3 * math.floor(math.log10(size) / 3)
    if unit.startswith("kg") or unit in ("m²", "rad²"):
        return (1.0, unit) if -3 <= power < 6 else (10.0**-power, f"10{superscript(power)} {unit}")
    power = min(max(power, -9), 9)
    prefix = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}[power]
    return 10.0**-power, prefix + unit


def superscript(power: int) -> str:
    """An integer as a superscript."""
    return str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def number(value: float, digits: int = 4) -> str:
    """A number with `digits` significant digits, without an exponent unless it would be long."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else str(value)
    places = digits - 1 - math.floor(math.log10(abs(value)))
    text = f"{value:.{max(places, 0)}f}" if -4 < places < digits + 5 else f"{value:.{digits - 1}e}"
    return text.replace("-", "−")


def aligned(rows: Iterable[Sequence[str]]) -> list[str]:
    """Rows of cells as lines of plain text, every column as wide as its widest cell."""
    rows = list(rows)
    widths = [max(map(len, column)) for column in itertools.zip_longest(*rows, fillvalue="")]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def turning(units: Units | None = None) -> tuple[float, str]:
    """Factor and label of speeds of rotation: revolutions per minute unless another unit was chosen."""
    return (units or {}).get("rad/s", (30 / math.pi, "rpm"))


def in_words(name: str) -> str:
    """Name of a measure or constraint in words: `peak_reaction_constant_speed` is "peak reaction, constant speed"."""
    base, space, case = name.partition(" ")
    words = IN_WORDS.get(base) or base.replace("_constant_speed", ", constant speed").replace("_", " ")
    return f"{words}{space}{case}"


def retold(message: str, show: Numbers) -> str:
    """A message with its lengths and angles in other units; quoted parts are unchanged."""
    parts = QUOTED.split(message)
    return "".join(part if i % 2 else AMOUNT.sub(lambda found: _amount(found, show), part)
                   for i, part in enumerate(parts))  # fmt: skip


def _amount(found: re.Match[str], show: Numbers) -> str:
    texts = [text for text in found.groups()[:2] if text is not None]
    values, unit = [float(text) for text in texts], found[3]
    if unit == "degrees":
        if "rad" not in show.units:
            return found[0]
        values = [math.radians(value) for value in values]
    size = max(abs(value) for value in values)
    if unit == "m":
        factor, label = prefixed(size, "m", show.units)
    else:
        factor, label = turning(show.units) if unit == "rad/s" else show.units.get("rad", (180 / math.pi, "°"))
    digits = max(4, *(len(text.partition("e")[0].lstrip("-0.").replace(".", "")) for text in texts))
    amount = " to ".join(short(float(f"{factor * value:.{digits}g}")) for value in values)
    return f"{amount}{'' if label == '°' else ' '}{label}"
