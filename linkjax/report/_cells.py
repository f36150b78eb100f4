"""Numbers, cells and tables as HTML text; everything that comes from outside is escaped here."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple, SupportsFloat

from linkjax.viz import number, prefixed, superscript

NONE = "–"


class Cell(NamedTuple):
    """A table cell: text (escaped when written), a number to the right or words to the left, a class for its looks."""

    text: str
    numeric: bool = False
    look: str = ""


def words(text: object) -> Cell:
    """A cell of words."""
    return Cell(str(text))


def amount(value: SupportsFloat | None, unit: str = "", digits: int = 5) -> Cell:
    """A cell of one number with its unit (SI in, prefixed for reading), a dash where there is none."""
    return Cell(NONE if value is None else quantity(float(value), unit, digits), numeric=True)


def quantity(value: float, unit: str = "", digits: int = 5) -> str:
    """A number to so many significant digits, with its unit."""
    if not math.isfinite(value):
        return NONE
    factor, shown = prefixed(abs(value), unit)
    mantissa, _, power = number(factor * value, digits).partition("e")
    scale = f"·10{superscript(int(power.replace('−', '-')))}" if power else ""
    return f"{mantissa}{scale} {shown}".rstrip()


def given(value: SupportsFloat, unit: str = "") -> Cell:
    """A cell of a number that was put in: as short as it is, with its unit."""
    return Cell(shown(value, unit), numeric=True)


def shown(value: SupportsFloat, unit: str = "") -> str:
    """A number that was put in, with its unit and without idle zeros."""
    factor, label = prefixed(abs(float(value)), unit)
    mantissa, _, power = f"{factor * float(value):.6g}".partition("e")
    return f"{mantissa}{f'·10{superscript(int(power))}' if power else ''} {label}".rstrip().replace("-", "−")


def angle(value: float | None) -> Cell:
    """A cell of an angle (rad in, degrees out)."""
    if value is None or not math.isfinite(value):
        return Cell(NONE, True)
    return Cell(f"{math.degrees(value):.3f}°".replace("-", "−"), True)


def measured(value: float, error: float, unit: str = "", most: int = 10) -> tuple[str, str]:
    """A value and the bound of its error in one unit, the value to the digits that the error leaves it (3 at least)."""
    if not (math.isfinite(value) and math.isfinite(error)):
        return NONE, ""
    factor, shown = prefixed(abs(value), unit)
    ratio = abs(value) / error if error > 0 else math.inf
    digits = most if ratio > 10.0**most else max(3, min(most, math.floor(math.log10(max(ratio, 1.0))) + 1))
    return f"{number(factor * value, digits)} {shown}".rstrip(), f"± {quantity(error, unit, 2)}"


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
    return f'<div class="wide"><table>{title}<thead><tr>{top}</tr></thead>\n<tbody>{lines}</tbody></table></div>'


def _data(cell: Cell) -> str:
    looks = " ".join(part for part in ("n" if cell.numeric else "", cell.look) if part)
    mark = f' class="{looks}"' if looks else ""
    return f"<td{mark}>{escape(cell.text)}</td>"
