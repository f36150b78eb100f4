"""The page of the JSON files names every key of a document, and no other."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tests.helpers import ROOT
from tests.viz.cycles import analysed

NAMED = {  # how many levels of keys below them are names, of the machine or of measures
    **dict.fromkeys(("points", "links", "groups", "strokes", "swings", "torque_by_load", "windows", "loads"), 1),
    **dict.fromkeys(("energies", "work", "joints", "peaks", "margins", "harmonics"), 1), "reactions": 2,
}  # fmt: skip
SCENES = ("hay-press", "pump-with-motor", "friction-slider-crank")


def page() -> list[tuple[list[str], set[str]]]:
    """The rows of the first table: the path of a key, and its members."""
    text = (ROOT / "docs/json.md").read_text(encoding="utf-8").split("## Columns")[0]
    rows = re.findall(r"^\| (`.*?) \|(.*)\|$", text, re.M)
    return [(quoted(path), set(quoted(members))) for path, members in rows]


def quoted(cell: str) -> list[str]:
    """The keys in code quotes, part by part."""
    return [part for key in re.findall("`([^`]*)`", cell) for part in key.split(".")]


def keys(data: Any, names: int = 0) -> set[str]:
    """All keys of a document, but not the names in its next levels."""
    if isinstance(data, list):
        return set().union(*(keys(each) for each in data))
    if not isinstance(data, dict):
        return set()
    if names:
        return set().union(*(keys(value, names - 1) for value in data.values()))
    return set(data).union(*(keys(value, NAMED.get(key, 0)) for key, value in data.items()))


@pytest.mark.parametrize("name", [SCENES[0], *(pytest.param(each, marks=pytest.mark.slow) for each in SCENES[1:])])
def test_every_key_is_described(name):
    described = set().union(*({*path, *members} for path, members in page()))
    missing = keys(analysed(name)[1]) - described
    assert not missing, missing


@pytest.mark.slow
def test_every_described_key_exists():
    found = set().union(*(keys(analysed(name)[1]) for name in SCENES))
    unknown = {part for path, _ in page() for part in path if not part.startswith("<")} - found
    assert unknown == {"measures"}  # which exist only where they are asked for
