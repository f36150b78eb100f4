"""Random versions of the built-in scenes as text: values, keys, lines, tables and sections changed."""

from __future__ import annotations

import itertools
import re
import tomllib
from collections.abc import Callable

import numpy as np
import tomli_w

from linkjax._renamed import RENAMED
from linkjax.scenes import rolling_names, scene_names
from tests.helpers import PACKAGE
from tests.scenes.mutations import at, broken, mutation, names, places

NAMES = (*scene_names(), *rolling_names())
HEADER = re.compile(r"^\[{1,2}[^\[\]\n]+\]{1,2}.*$", re.MULTILINE)
AMOUNT = re.compile(r'"(?P<number>[-+±]?\s*[\d.]+(?:e[-+]?\d+)?)\s*(?P<unit>[^"\d\n]*)"')
UNITS = (
    "mm",
    "m",
    "in",
    "km",
    "deg",
    "rad",
    "turn",
    "kg",
    "g",
    "N",
    "kN",
    "N m",
    "rpm",
    "rad/s",
    "Hz",
    "kg m^2",
    "%",
    "",
)
SIZES = ("0", "-1", "1e-40", "1e300", "9e19", "-1e-29", "nan", "inf", "-inf", "1_000", "1e", "0x10", "١٢", "1,5", "")
WORDS = ('""', "true", "[]", "{}", "[[]]", "nan", "-inf", "0", "-1", "1e300", "12345678901234567890", '"frame"',
         "1979-05-27", "07:32:00", "[0, 0]", '["1 m", "2 m", "3 m"]', '{ through = "A" }', "'a'", "\"\"\"x\ny\"\"\"",
         '"\\n"', '"\\u2028"', '"' + "w" * 300 + '"', "{ start = \"0 deg\", stop = \"1 deg\" }")  # fmt: skip
KEYS = ("law", "length", "pins", "on", "side", "kind", "sides", "points", "belt", "phase", "branch", "cycle_turns",
        "stroke", "sketch", "groups", "drive", "window", "optimise", "counterweights", '"a b"', '""', "x-1",
        *sorted(RENAMED))  # fmt: skip

Mutator = Callable[[str, str, np.random.Generator], str]


def text_of(name: str) -> str:
    """The file of a built-in scene."""
    folder = "rolling" if name in rolling_names() else "builtin"
    return (PACKAGE / f"scenes/{folder}/{name}.toml").read_text(encoding="utf-8")


TEXTS = {name: text_of(name) for name in NAMES}


def sections(text: str) -> list[str]:
    """The top of a file and its tables, each with its header."""
    starts = [0, *(found.start() for found in HEADER.finditer(text)), len(text)]
    return [text[a:b] for a, b in itertools.pairwise(starts)]


def pick(options, rng: np.random.Generator):
    """One of several."""
    return options[rng.integers(len(options))]


def _replace(text: str, pattern: str | re.Pattern[str], new: Callable[[re.Match[str]], str], rng) -> str:
    """A text in which one of the matches is replaced."""
    found = list(re.finditer(pattern, text))
    if not found:
        return text
    match = pick(found, rng)
    return text[: match.start()] + new(match) + text[match.end() :]


def _unit(text: str, other: str, rng: np.random.Generator) -> str:
    return _replace(text, AMOUNT, lambda m: f'"{m["number"]} {pick(UNITS, rng)}"', rng)


def _size(text: str, other: str, rng: np.random.Generator) -> str:
    return _replace(text, AMOUNT, lambda m: f'"{pick(SIZES, rng)} {m["unit"]}"', rng)


def _sign(text: str, other: str, rng: np.random.Generator) -> str:
    return _replace(text, AMOUNT, lambda m: f'"-{m["number"]} {m["unit"]}"', rng)


def _scale(text: str, other: str, rng: np.random.Generator) -> str:
    factor = pick((0.01, 0.1, 0.5, 0.9, 1.1, 2, 10, 1000), rng)
    return _replace(text, AMOUNT, lambda m: f'"{m["number"]}e{np.log10(factor):.0f} {m["unit"]}"', rng)


def _value(text: str, other: str, rng: np.random.Generator) -> str:
    return _replace(text, r"(?<== )[^\n#]+", lambda m: pick(WORDS, rng), rng)


def _name(text: str, other: str, rng: np.random.Generator) -> str:
    known = re.findall(r'"([A-Za-z][\w-]*)"', text) + re.findall(r"^\[links\.([\w-]+)\]", text, re.MULTILINE)
    known += [*RENAMED, "frame", "left", "+"]
    return _replace(text, r'"[A-Za-z+-][\w-]*"', lambda m: f'"{pick(known, rng)}"', rng)


def _old(text: str, other: str, rng: np.random.Generator) -> str:
    return _replace(text, r"[A-Za-z_]+", lambda m: pick(sorted(RENAMED), rng), rng)


def _key(text: str, other: str, rng: np.random.Generator) -> str:
    def new(match: re.Match[str]) -> str:
        key, i = match[0], rng.integers(len(match[0]))
        return pick((key[:i] + key[i + 1 :], key[:i] + "e" + key[i:], key.upper(), pick(KEYS, rng)), rng)

    return _replace(text, r"[\w.]+(?= =)", new, rng)


def _header(text: str, other: str, rng: np.random.Generator) -> str:
    def new(match: re.Match[str]) -> str:
        name = match[0].strip("[]\n ").split("]")[0]
        return pick((f"[[{name}]]", f"[{name}]", f"[{name}.x]", f"[{name[:-1]}]", "[sketch]", "[drive]", ""), rng)

    return _replace(text, HEADER, new, rng)


def _add(text: str, other: str, rng: np.random.Generator) -> str:
    lines = text.split("\n")
    line = f"{pick(KEYS, rng)} = {pick(WORDS, rng)}"
    if rng.random() < 0.5:
        line = pick([line for line in other.split("\n") if " = " in line], rng)
    lines.insert(rng.integers(len(lines) + 1), line)
    return "\n".join(lines)


def _lines(text: str, other: str, rng: np.random.Generator) -> str:
    """Lines that are doubled, deleted, exchanged or cut."""
    lines = text.split("\n")
    i, j = rng.integers(len(lines), size=2)
    way = rng.integers(5)
    if way == 0:
        lines.insert(j, lines[i])
    elif way == 1:
        del lines[i : i + 1 + rng.integers(3)]
    elif way == 2:
        lines[i], lines[j] = lines[j], lines[i]
    elif way == 3:
        lines[i] = lines[i][: rng.integers(len(lines[i]) + 1)]
    else:
        lines[i:] = [lines[i][: rng.integers(len(lines[i]) + 1)]]
    return "\n".join(lines)


def _tables(text: str, other: str, rng: np.random.Generator) -> str:
    """Tables that are doubled, deleted or exchanged."""
    parts = sections(text)
    i, j = rng.integers(len(parts), size=2)
    way = rng.integers(3)
    if way == 0:
        parts.insert(j, parts[i])
    elif way == 1:
        del parts[i]
    else:
        parts[i], parts[j] = parts[j], parts[i]
    return "".join(parts)


def _moved(text: str, other: str, rng: np.random.Generator) -> str:
    """Tables of another scene, added or instead of those of the same name."""
    parts, more = sections(text), sections(other)
    if rng.random() < 0.3:  # all of one kind
        kind = pick(more, rng)[:6]
        rest = [part for part in parts if not part.startswith(kind)] if rng.random() < 0.5 else parts
        return "".join([*rest, *(part for part in more if part.startswith(kind))])
    part = pick(more, rng)
    i = rng.integers(len(parts) + 1)
    return "".join([*parts[:i], part, *parts[i + (rng.random() < 0.5) :]])


def _document(text: str, other: str, rng: np.random.Generator) -> str:
    """A change of the document, see `mutation`, or a value or table of another scene."""
    try:
        table = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError):
        return text
    if rng.random() < 0.6 and table:
        return tomli_w.dumps(mutation(table, rng)[1])
    theirs, mine = tomllib.loads(other), list(places(table))
    if mine:
        path, value = pick(mine, rng), at(theirs, pick(list(places(theirs)), rng))
        at(table, path[:-1])[path[-1]] = pick((value, pick(names(theirs), rng)), rng)
    return tomli_w.dumps(table)


def _broken(text: str, other: str, rng: np.random.Generator) -> str:
    return broken(text, rng)[1] if text else text


MUTATORS: tuple[Mutator, ...] = (
    _unit, _size, _sign, _scale, _value, _value, _name, _name, _name, _old, _key, _header, _add, _lines, _tables,
    _moved, _moved, _document, _document, _document, _broken,
)  # fmt: skip


def mutant(seed: int) -> str:
    """The text of a mutant: a built-in scene with one to three changes."""
    rng = np.random.default_rng(seed)
    name, other = pick(NAMES, rng), pick(NAMES, rng)
    text = TEXTS[name]
    for _ in range(pick((1, 1, 1, 2, 3), rng)):
        text = pick(MUTATORS, rng)(text, TEXTS[other], rng)
    return text
