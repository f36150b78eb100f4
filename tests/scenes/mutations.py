"""Invalid scene files: every way in which one entry of a good file can be wrong."""

from __future__ import annotations

import copy
import datetime
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

Path = tuple[str | int, ...]
VALUES: tuple[Any, ...] = (
    3, -1, 0, 1e300, -1e300, 1e-300, float("nan"), float("inf"), 10**400, True, "", "x", "a b", "3", "3 mmm", "1e999 m",
    "1e300 m", "nan m", "-5 m", "0 m", "5 kg", "-5 kg", "5 s", "0 rpm", "-3 rpm", "400 deg", "1e300 deg", "5 N",
    "frame", [], [1], [1, 2], [1, 2, 3], ["m"], [[], []], {}, {"x": 1}, [{}], datetime.date(1979, 5, 27), "\n", "\0",
)  # fmt: skip


def places(value: Any, path: Path = ()) -> Iterator[Path]:
    """Paths to everything in a document, including tables and lists."""
    if path:
        yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, (*path, key))


def at(table: Any, path: Path) -> Any:
    """The value at a path."""
    for part in path:
        table = table[part]
    return table


def names(table: dict[str, Any]) -> list[str]:
    """All strings of a document that can be names, and the keys of its tables of points and links."""
    texts = [at(table, path) for path in places(table)]
    keys = [key for part in ("fixed", "links", "sketch") for key in table.get(part, {})]
    found = [text for text in texts if isinstance(text, str) and re.fullmatch(r"[A-Za-z][\w-]*", text)]
    return list(dict.fromkeys([*keys, *found]))


def possible(parent: Any, value: Any) -> list[str]:
    """Possible changes of a value in its table or list."""
    ways = ["delete", "value", "value", "double" if isinstance(parent, list) else "misspell"]
    ways += ["name", "name", "misspell value"] if isinstance(value, str) else []
    ways += ["reverse"] if isinstance(value, list) and len(value) > 1 else []
    ways += ["exchange"] if isinstance(parent, dict) and len(parent) > 1 else []
    ways += ["add"] if isinstance(value, dict) else []
    return ways


def mutation(table: dict[str, Any], rng: np.random.Generator) -> tuple[str, dict[str, Any]]:
    """A description of a change, and a copy of a document with this change."""
    table = copy.deepcopy(table)
    every = list(places(table))
    path = every[rng.integers(len(every))]
    parent: Any = at(table, path[:-1])
    value: Any = at(table, path)
    key: Any = path[-1]
    ways = possible(parent, value)
    way, told = ways[rng.integers(len(ways))], ""
    if way == "delete":
        del parent[key]
    elif way == "value":
        told = VALUES[rng.integers(len(VALUES))]
        parent[key] = copy.deepcopy(told)
    elif way == "double":
        parent.insert(key, copy.deepcopy(value))
    elif way == "misspell":
        told = str(key) + "x" if rng.random() < 0.5 else str(key)[1:]
        items = [(told if k == key else k, v) for k, v in parent.items()]
        parent.clear()
        parent.update(items)
    elif way == "name":
        known = names(table)
        parent[key] = told = known[rng.integers(len(known))]
    elif way == "misspell value":
        parent[key] = told = value[:-1] if rng.random() < 0.5 else value + "q"
    elif way == "reverse":
        value.reverse()
    elif way == "exchange":
        others = [k for k in parent if k != key]
        told = others[rng.integers(len(others))]
        parent[key], parent[told] = parent[told], value
    elif way == "add":
        value[told := ("extra", "length", "guide", "pins", "law", "x-y")[rng.integers(6)]] = copy.deepcopy(
            VALUES[rng.integers(len(VALUES))]
        )
    return f"{way} {path} {told!r:.60}", table


def broken(text: str, rng: np.random.Generator) -> tuple[str, str]:
    """A description of a change, and a string in which a character, a line or the end is missing, or one is added."""
    lines = text.split("\n")
    i, k = int(rng.integers(len(text))), int(rng.integers(len(lines)))
    way = ("cut", "character", "line", "insert", "exchange")[rng.integers(5)]
    if way == "cut":
        return f"{way} at {i}", text[:i]
    if way == "character":
        return f"{way} {i}", text[:i] + text[i + 1 :]
    if way == "line":
        return f"{way} {k}", "\n".join(lines[:k] + lines[k + 1 :])
    if way == "insert":
        more = '"[]{}=.,#\n\0é\\'[rng.integers(13)]
        return f"{way} {more!r} at {i}", text[:i] + more + text[i:]
    j = int(rng.integers(len(lines)))
    lines[k], lines[j] = lines[j], lines[k]
    return f"{way} lines {k} and {j}", "\n".join(lines)
