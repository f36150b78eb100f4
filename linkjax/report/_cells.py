"""Numbers, cells and tables as HTML text; all input is escaped here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple, SupportsFloat

from linkjax._display import NONE, Numbers


class Cell(NamedTuple):
    """A table cell: text (escaped when written), alignment (numbers right, words left), and a CSS class."""

    text: str
    numeric: bool = False
    look: str = ""


def words(text: object) -> Cell:
    """A cell with words."""
    return Cell(str(text))


class Cells(Numbers):
    """Formatted numbers as cells."""

    def amount(self, value: SupportsFloat | None, unit: str = "", digits: int = 5) -> Cell:
        """A cell with a number and its unit; a dash for None."""
        return Cell(NONE if value is None else self.quantity(float(value), unit, digits), numeric=True)

    def given(self, value: SupportsFloat, unit: str = "") -> Cell:
        """A cell with an input value and its unit, without trailing zeros."""
        return Cell(self.shown(value, unit), numeric=True)

    def angle(self, value: float | None) -> Cell:
        """A cell with an angle, in degrees unless another unit was chosen."""
        return Cell(self.turned(value), True)

    def several(
        self, values: Sequence[SupportsFloat | None], unit: str, digits: int = 5, beside: float = 0.0
    ) -> list[Cell]:  # fmt: skip
        """Cells of one quantity, all in the prefixed unit that suits the largest value; `unit` is written as in
        measures. A value that is only rounding error relative to `beside` is shown as zero."""
        return [Cell(text, True) for text in self.told(values, unit, digits, beside)]


def table(head: Sequence[str], rows: Iterable[Sequence[Cell]], caption: str = "") -> str:
    """A table; the first cell of a row is its heading."""
    rows = list(rows)
    right = [cell.numeric for cell in rows[0]] if rows else [False] * len(head)
    looks = [' class="n"' if numeric else "" for numeric in right]
    top = "".join(f'<th scope="col"{look}>{escape(name)}</th>' for name, look in zip(head, looks, strict=True))
    body = []
    for row in rows:
        cells = [f'<th scope="row">{_breakable(row[0].text)}</th>', *(_data(cell) for cell in row[1:])]
        body.append(f"<tr>{''.join(cells)}</tr>")
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    lines = "\n".join(body)
    many = ' class="many"' if len(head) > 4 else ""
    return f'<div class="wide"><table{many}>{title}<thead><tr>{top}</tr></thead>\n<tbody>{lines}</tbody></table></div>'


def _breakable(name: str) -> str:
    """A row heading in which a long dotted name may be broken after its dots."""
    return escape(name).replace(".", ".<wbr>") if len(name) > 24 else escape(name)


def _data(cell: Cell) -> str:
    looks = " ".join(part for part in ("n" if cell.numeric else "", cell.look) if part)
    mark = f' class="{looks}"' if looks else ""
    return f"<td{mark}>{escape(cell.text)}</td>"
