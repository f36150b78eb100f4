"""Numbers, cells and tables as HTML text; everything that comes from outside is escaped here."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from types import MappingProxyType
from typing import NamedTuple, SupportsFloat

from linkjax._units import label_of
from linkjax.viz import number, prefixed, superscript, turning

NONE = "–"


class Cell(NamedTuple):
    """A table cell: text (escaped when written), a number to the right or words to the left, a class for its looks."""

    text: str
    numeric: bool = False
    look: str = ""


def words(text: object) -> Cell:
    """A cell of words."""
    return Cell(str(text))


class Numbers(NamedTuple):
    """How numbers are written: SI in, out in the units chosen, with prefixes where none was."""

    units: Mapping[str, tuple[float, str]] = MappingProxyType({})

    def amount(self, value: SupportsFloat | None, unit: str = "", digits: int = 5) -> Cell:
        """A cell of one number with its unit, a dash where there is none."""
        return Cell(NONE if value is None else self.quantity(float(value), unit, digits), numeric=True)

    def quantity(self, value: float, unit: str = "", digits: int = 5) -> str:
        """A number to so many significant digits, with its unit."""
        return self.alike([value], unit, digits)[0]

    def alike(self, values: Iterable[float], unit: str = "", digits: int = 5) -> list[str]:
        """Numbers to so many significant digits, all in the unit that suits the largest."""
        values = list(values)
        size = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
        factor, label = prefixed(size, unit, self.units)
        return [_number(factor * value, label, digits) for value in values]

    def given(self, value: SupportsFloat, unit: str = "") -> Cell:
        """A cell of a number that was put in: as short as it is, with its unit."""
        return Cell(self.shown(value, unit), numeric=True)

    def shown(self, value: SupportsFloat, unit: str = "") -> str:
        """A number that was put in, with its unit and without idle zeros."""
        factor, label = prefixed(abs(float(value)), unit, self.units)
        mantissa, _, power = f"{factor * float(value):.6g}".partition("e")
        scale = f"·10{superscript(int(power))}" if power else ""
        return f"{mantissa}{scale} {label}".rstrip().replace("-", "−")

    def angle(self, value: float | None) -> Cell:
        """A cell of an angle, in degrees unless another unit was chosen."""
        return Cell(self.turned(value), True)

    def turned(self, value: float | None) -> str:
        """An angle, in degrees unless another unit was chosen."""
        if value is None or not math.isfinite(value):
            return NONE
        factor, label = self.units.get("rad", (180 / math.pi, "°"))
        return (f"{factor * value:.3f}°" if label == "°" else f"{factor * value:.5f} {label}").replace("-", "−")

    def speed(self, value: float, digits: int = 6) -> str:
        """A speed of rotation (rad/s in), in revolutions per minute unless another unit was chosen."""
        factor, label = turning(self.units)
        return _number(factor * float(value), label, digits)

    def measured(self, value: float, error: float, unit: str = "", most: int = 10) -> tuple[str, str]:
        """A value and the bound of its error, the value in one unit to the digits the error leaves it (3 at least)."""
        if not (math.isfinite(value) and math.isfinite(error)):
            return NONE, ""
        factor, label = prefixed(abs(value), unit, self.units)
        ratio = abs(value) / error if error > 0 else math.inf
        digits = most if ratio > 10.0**most else max(3, min(most, math.floor(math.log10(max(ratio, 1.0))) + 1))
        return f"{number(factor * value, digits)} {label}".rstrip(), f"± {self.quantity(error, unit, 2)}"

    def bound(self, value: SupportsFloat | None, unit: str) -> str:
        """A bound that was put in, unit as measures write it: as short as it is."""
        if value is None or not math.isfinite(float(value)):
            return NONE
        if unit not in ("rad", "rad/s"):
            return self.shown(value, label_of(unit))
        factor, label = turning(self.units) if unit == "rad/s" else self.units.get("rad", (180 / math.pi, "°"))
        return f"{factor * float(value):.6g}{'' if label == '°' else ' '}{label}".replace("-", "−")

    def several(self, values: Sequence[SupportsFloat | None], unit: str, digits: int = 5) -> list[Cell]:
        """Cells of one quantity, unit as measures write it ("N m", "1", "rad"), all in the unit that suits the largest.

        A dash for None.
        """
        numbers = [math.nan if value is None else float(value) for value in values]
        if unit == "rad":
            return [self.angle(value) for value in numbers]
        if unit == "rad/s":
            return [Cell(self.speed(value), True) for value in numbers]
        return [Cell(text, True) for text in self.alike(numbers, label_of(unit), digits)]


def _number(value: float, label: str, digits: int) -> str:
    if not math.isfinite(value):
        return NONE
    mantissa, _, power = number(value, digits).partition("e")
    scale = f"·10{superscript(int(power.replace('−', '-')))}" if power else ""
    return f"{mantissa}{scale} {label}".rstrip()


def table(head: Sequence[str], rows: Iterable[Sequence[Cell]], caption: str = "") -> str:
    """A table; the first cell of a row names it."""
    rows = list(rows)
    right = [cell.numeric for cell in rows[0]] if rows else [False] * len(head)
    looks = [' class="n"' if numeric else "" for numeric in right]
    top = "".join(f'<th scope="col"{look}>{escape(name)}</th>' for name, look in zip(head, looks, strict=True))
    body = []
    for row in rows:
        cells = [f'<th scope="row">{escape(row[0].text)}</th>', *(_data(cell) for cell in row[1:])]
        body.append(f"<tr>{''.join(cells)}</tr>")
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    lines = "\n".join(body)
    many = ' class="many"' if len(head) > 4 else ""
    return f'<div class="wide"><table{many}>{title}<thead><tr>{top}</tr></thead>\n<tbody>{lines}</tbody></table></div>'


def _data(cell: Cell) -> str:
    looks = " ".join(part for part in ("n" if cell.numeric else "", cell.look) if part)
    mark = f' class="{looks}"' if looks else ""
    return f"<td{mark}>{escape(cell.text)}</td>"
