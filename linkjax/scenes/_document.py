"""The raw scene document: reading TOML from a file, a built-in scene or a string, and overriding single keys."""

from __future__ import annotations

import copy
import dataclasses
import difflib
import os
import re
import tomllib
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from linkjax._renamed import renamed
from linkjax._units import nearest
from linkjax.mechanism import OF_LENGTH
from linkjax.scenes._absent import absent, meant
from linkjax.scenes._errors import SceneError
from linkjax.scenes._keys import Path as KeyPath
from linkjax.scenes._keys import annotation_at, fields, is_rolling, is_table, join, leaves, lookup, split
from linkjax.scenes._located import located

BUILTIN = Path(__file__).with_name("builtin")
ROLLING = Path(__file__).with_name("rolling")
STARTER = Path(__file__).with_name("starter.toml")


@dataclasses.dataclass(frozen=True)
class Document:
    """A scene file before validation: `table` holds the TOML data, `source` names the file in messages."""

    source: str
    table: dict[str, Any]

    @property
    def rolling(self) -> bool:
        """Whether it describes rolling bodies; raises `SceneError` for an unknown kind of machine."""
        kind = self.table.get("kind", "rolling")
        if kind != "rolling":
            remedy = 'write kind = "rolling" for rolling bodies, or delete it for a linkage'
            raise SceneError(self.source, "kind", kind, "not a known kind of machine", remedy)
        return is_rolling(self.table)


def scene_names() -> tuple[str, ...]:
    """Names of the built-in linkages, which `load` reads; those of rolling bodies are in `rolling_names`."""
    return tuple(sorted(path.stem for path in BUILTIN.glob("*.toml")))


def rolling_names() -> tuple[str, ...]:
    """Names of the built-in machines of rolling bodies; `load_rolling` reads them."""
    return tuple(sorted(path.stem for path in ROLLING.glob("*.toml")))


def scene_text(name_or_path: str | os.PathLike[str]) -> tuple[str, str]:
    """Source and content of a built-in scene (by name) or of a file. Raises `SceneError` when it cannot be read."""
    name = os.fspath(name_or_path)
    folder = BUILTIN if name in scene_names() else ROLLING if name in rolling_names() else None
    path, source = (Path(name), name) if folder is None else (folder / f"{name}.toml", f"{name}.toml")
    try:
        return source, path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise SceneError(
            source, "", None, f"not encoded in UTF-8 (byte {error.start})", "save the file as UTF-8"
        ) from error
    except (OSError, ValueError) as error:  # a ValueError: a null character in the name
        raise _unreadable(name, path) from error


def titled(name: str) -> str:
    """A name as the title of a scene, inside double quotes."""
    text = "".join(c for c in name if c.isprintable())
    return text.replace("\\", "\\\\").replace('"', '\\"') or "New machine"


def _unreadable(name: str, path: Path) -> SceneError:
    problem, known = "no such scene file, nor a built-in scene", (*scene_names(), *rolling_names())
    if "\n" in name:
        return SceneError("<text>", "", None, "is not a name or path", "read a scene in a string with loads_text")
    if name and os.path.exists(path):  # os.path.exists does not raise, unlike pathlib
        problem = "cannot be read: a folder" if os.path.isdir(path) else "cannot be read"
    beside = f"{name}.toml"
    close = [beside] if name and os.path.isfile(beside) else difflib.get_close_matches(name, known + _near(path), n=1)
    ways = f"give the path of a .toml file, or a built-in scene: {', '.join(known)}"
    remedy = f"did you mean {close[0]!r}? ({ways})" if close else ways
    return SceneError(name or '""', "", None, problem, remedy)


def _near(path: Path) -> tuple[str, ...]:
    """Scene files in the folder of a path."""
    try:
        return tuple(str(each) for each in path.parent.glob("*.toml"))
    except (OSError, ValueError):
        return ()


def load_document(name_or_path: str | os.PathLike[str]) -> Document:
    """The raw document of a built-in scene or a file, not validated. Raises `SceneError` if missing or not TOML."""
    source, text = scene_text(name_or_path)
    return read_document(text, source)


def read_document(text: str, source: str = "<text>") -> Document:
    """The raw document of a TOML string. Raises `SceneError`, with the line, when it is not TOML, or is empty."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _syntax(str(error), text, source) from error
    except (RecursionError, ValueError) as error:  # a ValueError: a number of thousands of digits
        raise SceneError(
            source, "", None, "not readable as TOML", "write plain numbers and at most two nested lists"
        ) from error
    if not table:
        raise SceneError(
            source, "", None, "the scene is empty", "begin with `linkjax new NAME`, or copy a built-in scene"
        )
    return Document(source, table)


def _syntax(message: str, text: str, source: str) -> SceneError:
    found = re.search(r"\(at line (\d+), column (\d+)\)", message)
    lines = text.split("\n")
    number = min(int(found[1]), len(lines)) if found else len(lines)
    line = lines[number - 1].strip()
    remedy = "see docs/scenes.md for the format"
    if re.search(r"=\s*[-+.\d]+\s*[A-Za-z°µ]", line):
        remedy = 'put a quantity in double quotes, e.g. length = "300 mm"'
    elif "overwrite" in message or "twice" in message or "mutate" in message:
        remedy = "write every key and table once"
        if listed := re.match(r"\[{1,2}([\w-]+)\]{1,2}", line):
            remedy += f"; the tables of a list have double brackets, e.g. [[{listed[1]}]]"
    elif "nterminated" in message or "llegal character" in message or "Expected" in message:
        remedy = "close every quote and bracket on its own line"
    problem = re.sub(r"\('([^']*)',\)", r"\1", message.split(" (at ")[0])
    return SceneError(
        source, f"line {number}", line or None, f"not valid TOML: {problem[:1].lower()}{problem[1:]}", remedy
    )


def setting(value: Any) -> Any:
    """A value of the command line: a TOML number, boolean, list, table or quoted string, else the string itself."""
    if not isinstance(value, str):
        return copy.deepcopy(value)
    try:
        read = tomllib.loads(f"value = {value}")
    except (tomllib.TOMLDecodeError, RecursionError, ValueError):
        return value
    plain = set(read) == {"value"} and isinstance(read["value"], bool | int | float | str | list | dict)
    return read["value"] if plain else value


def override(document: Document, key: str, value: Any) -> Document:
    """A copy of `document` with one key replaced, as `--set links.rod.length="1.1 m"` does; validated when built.

    `key` is a path such as `links.rod.length`, `fixed.F[0]`, `loads.hay.window[1]` (a load by name or number) or
    `groups[1].guide.along` (a group by number or by its joined link names, `groups.rod-slider.guide.along`). A string
    that is a TOML value ("0.02", "true", "[0, -1]") is read as one. Keys of the format may be added; any other key
    raises `SceneError` with the nearest known key. If a link has `mass_properties = "scaled"` or `"stretched"`, its
    previous length becomes its `reference_length`.
    """
    with located(document.source, document.table):
        return Document(document.source, _with(document, key, setting(value)))


def _with(document: Document, key: str, given: Any) -> dict[str, Any]:
    """The table of a document with one key replaced."""
    table, path = copy.deepcopy(document.table), _resolved(document, key, given)
    place: Any = table
    for part in path[:-1]:
        if isinstance(place, dict):
            place.setdefault(part, {})
        place = place[part]
    place[path[-1]] = given
    if len(path) == 3 and (path[0], path[2]) == ("links", "length"):
        link, before = place, lookup(document.table, path)
        if link.get("mass_properties") in OF_LENGTH and before is not None:
            link.setdefault("reference_length", before)
    return table


def overridden(document: Document, changes: Mapping[str, Any] | None) -> Document:
    """A copy of `document` with several keys replaced; see `override`."""
    for key, value in (changes or {}).items():
        document = override(document, key, value)
    return document


def _resolved(document: Document, key: str, value: Any) -> KeyPath:
    """`key` as a path that exists in the document or in the format."""
    path: KeyPath = ()
    steps = split(key)
    for number, step in enumerate(steps, 1):
        held = lookup(document.table, path)
        annotation = annotation_at(document.table, path)
        if isinstance(held, list):
            part, known = _entry(held, step)
            step = int(step) if step.isdecimal() else step
        elif is_table(annotation) and (held is None or isinstance(held, dict)):
            known = list(fields(annotation))
            part = step if step in known else None
        elif typing.get_origin(annotation) is dict and (held is None or isinstance(held, dict)):
            known = list(held or {})
            table = isinstance(value, dict) or number < len(steps)
            new = table and getattr(typing.get_args(annotation)[1], "may_be_added", False)
            part = step if step in known or new else None
        else:
            raise SceneError(
                document.source, key, value, f"{join(path)} has no keys of its own", f"set {join(path)} itself"
            )
        if part is None:
            raise _unknown(document, key, value, join((*path, step)), known)
        path = (*path, part)
    if not path:
        raise SceneError(document.source, key, value, "no key given", 'write e.g. links.rod.length="1.1 m"')
    return path


def _entry(items: list[Any], step: str) -> tuple[int | None, list[str]]:
    """Number of the entry that `step` means (its number, name or links), and the names of all entries."""
    known = [entry_name(item) or str(number) for number, item in enumerate(items)]
    if step.isdecimal() and len(step) < 6 and int(step) < len(items):
        return int(step), known
    return (known.index(step) if step in known else None), known


def entry_name(item: Any) -> str:
    """Name of an entry of a list of tables: of a load its name, of a group its links joined by "-"; else ""."""
    if not isinstance(item, dict):
        return ""
    name, links = item.get("name"), item.get("links")
    if isinstance(name, str):
        return name
    names = links if isinstance(links, list) else [item.get("link"), item.get("block")]
    return "-".join(n for n in names if isinstance(n, str))


def _unknown(document: Document, key: str, value: Any, reached: str, known: list[str]) -> SceneError:
    step = split(reached)[-1]
    close = difflib.get_close_matches(step, known, n=1)
    whole = difflib.get_close_matches(key, [join(leaf) for leaf in leaves(document.table)], n=1)
    same = meant(step, known)
    lacking = "" if is_rolling(document.table) or same else absent(split(reached))
    if lacking or renamed(step, known):
        remedy = lacking or nearest(step, known)
    elif same or close:
        close, parent = [same] if same else close, reached[: len(reached) - len(step)]
        remedy = f"did you mean {parent + close[0] + key[len(reached) :]!r}?"
    else:
        remedy = f"did you mean {whole[0]!r}?" if whole else nearest(step, known)
    return SceneError(document.source, key, value, f"{reached} is not a known key", remedy)
