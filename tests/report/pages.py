"""Reading a report: its tables by row, and numbers as they are printed."""

from __future__ import annotations

import re
from html.parser import HTMLParser

VOID = {"meta", "img", "br", "hr", "link", "input", "wbr"}
POWERS = {"": 0, "k": 3, "M": 6, "m": -3, "µ": -6, "n": -9, "G": 9}
FIGURES = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")


class Page(HTMLParser):
    """Tables by row, and what a well-formed page has; what is for browsers without programs is left out."""

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.links, self.rows, self.sources = [], [], [], [], []
        self.counts, self.text, self.scripts, self.aside = {}, "", [], 0

    def handle_starttag(self, tag, attrs):
        self.aside += tag == "noscript"
        if self.aside:
            return
        self.counts[tag] = self.counts.get(tag, 0) + 1
        found = dict(attrs)
        self.ids += [found["id"]] if "id" in found else []
        self.links += [found["href"]] if "href" in found else []
        self.links += re.findall(r"url\((#[^)]+)\)", " ".join(value or "" for value in found.values()))
        self.sources += [found["src"]] if "src" in found else []
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if self.aside:
            self.aside -= tag == "noscript"
            return
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("script", "style"):
            self.scripts += [data] if self.open[-1] == "script" else []
            return
        self.text += data
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data

    def row(self, name: str, cells: int | None = None) -> list[str]:
        """The one row of that name (and so many cells), its name left out."""
        (found,) = [row[1:] for row in self.rows if row[0] == name and cells in (None, len(row))]
        return found


def read(path) -> Page:
    page = Page()
    page.feed(path.read_text(encoding="utf-8"))
    page.close()
    assert not page.open
    return page


def assert_printed(text: str, value: float, unit: str, scale: float = 1.0) -> None:
    """The text is the value to the digits printed, in the unit with or without a prefix."""
    found = re.fullmatch(r"(−?[\d.]+)(?:·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))? ?(.*)", text)
    assert found, text
    mantissa, power, printed = found.groups()
    exponent = int((power or "0").translate(FIGURES))
    if printed != unit:
        assert printed.endswith(unit), text
        prefix = printed.removesuffix(unit)
        exponent += POWERS[prefix] if prefix in POWERS else int(prefix[2:].strip().translate(FIGURES))
    step = 10.0 ** (exponent - len(mantissa.partition(".")[2]))
    number = float(mantissa.translate(FIGURES)) * 10.0**exponent
    assert abs(number - scale * value) <= 0.5000001 * step, (text, value)
