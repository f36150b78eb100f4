"""Names out of programs: the same machine under other names is the same program.

A scene without names has a token in the place of every name of a link, point or load, in an order that depends on
the structure only. `Names` puts the names back into whatever was computed from it.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator
from typing import Any

import jax

from linkjax._types import Tracer
from linkjax.groups import FRAME
from linkjax.machine._scene import ReadyScene, Scene, untitled

TOKEN = re.compile("<[0-9]+>")
# strings in a structure that are no names
CHOICES = {"bearing", "branch", "by", "going", "head", "mass_properties", "mean", "method", "reacts_on", "rotation",
           "shape", "title"}  # fmt: skip
MOST = 64  # structures whose names are remembered


class Names:
    """The names of a machine, by token."""

    def __init__(self, tokens: dict[str, str]):
        self.of = {token: name for name, token in tokens.items()}
        self.known: dict[Any, tuple[list[int], Any]] = {}

    def in_text(self, text: str) -> str:
        """A string with the names in the place of the tokens."""
        return TOKEN.sub(lambda found: self.of.get(found[0], found[0]), text) if "<" in text else text

    def back(self, tree: Any) -> Any:
        """A tree with the names in the place of the tokens, in keys and in structures."""
        return _moved(tree, self.known, lambda tree: _changed(tree, self.in_text))


_KNOWN: dict[Any, tuple[Names | None, dict[Any, tuple[list[int], Any]]]] = {}


def nameless(scene: Any) -> tuple[Any, Names | None]:
    """The scene, ready or not, without title and names, and the names.

    It is unchanged, with None, inside of jax transformations, which compile for every structure, and with loads or
    groups of the user's, which may use a name in their own way."""
    if isinstance(scene, ReadyScene):
        plain, names = nameless(scene.scene)
        return scene.of(plain), names
    leaves, tree = jax.tree.flatten(scene)
    if any(isinstance(leaf, Tracer) for leaf in leaves):
        return scene, None
    found = _KNOWN.get(tree)
    if found is None:
        if len(_KNOWN) >= MOST:
            _KNOWN.clear()
        own = all(part.__module__.startswith("linkjax.") for part in _classes(scene))
        found = _KNOWN[tree] = Names(_tokens(scene)) if own else None, {}
    names, known = found
    if names is None:
        return scene, None
    return _moved(scene, known, lambda tree: _without(tree, names)), names


def _without(scene: Scene, names: Names) -> Scene:
    tokens = {name: token for token, name in names.of.items()}
    return untitled(_changed(scene, lambda name: tokens.get(name, name)))


def _moved(tree: Any, known: dict[Any, tuple[list[int], Any]], change: Callable[[Any], Any]) -> Any:
    """A tree whose structure is changed; how the leaves move is found once for a structure."""
    leaves, structure = jax.tree.flatten(tree)
    if structure not in known:
        order, new = jax.tree.flatten(change(jax.tree.unflatten(structure, range(len(leaves)))))
        known[structure] = order, new
    order, new = known[structure]
    return jax.tree.unflatten(new, [leaves[i] for i in order])


def _tokens(scene: Scene) -> dict[str, str]:
    """A token for every name, in the order in which the groups, then the links, the frame and the loads use them."""
    mechanism, found = scene.mechanism, {}
    for name in _strings([mechanism.groups, scene.loads]):
        found.setdefault(name, len(found))
    for name in sorted(mechanism.links, key=lambda link: found.get(link, len(found))):
        for each in _strings({name: mechanism.links[name]}):
            found.setdefault(each, len(found))
    for name in mechanism.fixed:
        found.setdefault(name, len(found))
    return {name: f"<{number:03}>" for name, number in found.items() if name not in ("", FRAME)}


def _strings(tree: Any) -> Iterator[str]:
    """All strings in a tree that may be names, in order."""
    if isinstance(tree, str):
        yield tree
    elif isinstance(tree, dict):
        for key, value in tree.items():
            yield from _strings(key)
            yield from _strings(value)
    elif isinstance(tree, tuple | list):
        for value in tree:
            yield from _strings(value)
    elif dataclasses.is_dataclass(tree):
        for name, value in _fields(tree):
            if name not in CHOICES:
                yield from _strings(value)


def _changed(tree: Any, change: Callable[[str], str]) -> Any:
    """A tree with every name changed, made without its constructors."""
    if isinstance(tree, str):
        return change(tree)
    if isinstance(tree, dict):
        found = {_changed(key, change): _changed(value, change) for key, value in tree.items()}
        return dict(sorted(found.items()))  # as jax sorts the keys of dicts
    if isinstance(tree, tuple | list):
        parts = [_changed(value, change) for value in tree]
        return type(tree)(*parts) if hasattr(tree, "_fields") else type(tree)(parts)
    if not dataclasses.is_dataclass(tree) or isinstance(tree, type):
        return tree
    made = object.__new__(type(tree))
    for name, value in _fields(tree):
        object.__setattr__(made, name, value if name in CHOICES else _changed(value, change))
    return made


def _fields(tree: Any) -> list[tuple[str, Any]]:
    return [(field.name, getattr(tree, field.name)) for field in dataclasses.fields(tree) if hasattr(tree, field.name)]


def _classes(tree: Any) -> Iterator[type]:
    """The classes of all dataclasses in a tree."""
    if isinstance(tree, dict):
        tree = tuple(tree.values())
    if isinstance(tree, tuple | list):
        for value in tree:
            yield from _classes(value)
    elif dataclasses.is_dataclass(tree) and not isinstance(tree, type):
        yield type(tree)
        yield from _classes([value for _, value in _fields(tree)])
