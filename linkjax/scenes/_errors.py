"""The error of a scene file: the problem, its place, and the remedy."""

from __future__ import annotations

import json
from typing import Any

LONGEST = 70  # characters of a value in a message
LINE, SHORTEST = 490, 200  # characters of a message; of problem and remedy together where the rest is long


class SceneError(ValueError):
    """An error in a scene file.

    `source` is the file (or "<text>"), `key` the path of the key, e.g. `links.rod.length` or `loads[0].window` ("line
    7" when the file is not TOML, empty for the whole file), `value` the value of this key in the file (None when it is
    missing), `problem` the problem and `remedy` what to write instead. The message is one line with all five.
    """

    def __init__(self, source: str, key: str, value: Any, problem: str, remedy: str):
        self.source, self.key, self.value, self.problem, self.remedy = source, key, value, problem, remedy
        line = key.startswith("line ")  # the file is not TOML: the line itself is the value
        whole = isinstance(value, dict | list) and len(_toml(value)) > LONGEST  # a long table: its key is enough
        stands = "" if value is None or whole else str(value)[:LONGEST] if line else shown(value)
        place = (": " if line else " = ").join(part for part in (key[:200], stands) if part)
        place, problem, remedy = map(_one_line, (place, problem, remedy))
        head = f"{_one_line(source) if len(source.splitlines()) > 1 else source}: {place + ': ' if place else ''}"
        spare = max(LINE - len(head), SHORTEST)
        problem = _cut(problem, max(spare - len(remedy), spare // 2))
        super().__init__(f"{head}{problem}; {_cut(remedy, spare - len(problem))}")

    def __reduce__(self):
        return SceneError, (self.source, self.key, self.value, self.problem, self.remedy)


def shown(value: Any, limit: int = LONGEST) -> str:
    """`value` as TOML, on one line, cut at `limit` characters."""
    text = _toml(value)
    return text if len(text) <= limit else text[: limit - 1] + "…"


def _toml(value: Any, depth: int = 0) -> str:
    if depth > 4:
        return "…"
    if isinstance(value, str):
        return json.dumps(value[:200], ensure_ascii=False)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item, depth + 1) for item in value[:20]) + "]"
    if isinstance(value, dict):
        items = list(value.items())[:20]
        return "{" + ", ".join(f"{key} = {_toml(item, depth + 1)}" for key, item in items) + "}"
    if isinstance(value, int) and abs(value) >= 10**30:
        return "an integer of more than 30 digits"
    return str(value)


def _cut(text: str, limit: int) -> str:
    """A string of at most `limit` characters: the whole, or its first words."""
    return text if len(text) <= limit else text[: limit - 2].rpartition(" ")[0].rstrip(",") + " …"


def _one_line(text: str) -> str:
    """A string with line breaks and other characters that are not printable as escapes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
