"""What people read is written in the field's words, and old names are gone."""

import importlib
import re

import pytest

import linkjax as lj
from linkjax._renamed import RENAMED
from tests.helpers import ROOT
from tests.words import PATTERN, SCANNED, WORDS, files, found_in

OLD = [
    "Met",
    "Slide",
    "RR",
    "RP",
    "over_designs",
    "load_task",
    "crank_limits",
    "tied_angles",
    "largest_speed",
    "smallest_speed",
    "smallest_margin",
    "least_margin",
    "smallest_transmission_angle",
    "least_inertia",
    "regime_margin",
    "lowest_mean_speed",
    "speed_max",
    "speed_min",
    "drive_torque_mean",
    "largest_radius",
    "smallest_radius",
    "least_clearance",
    "build_task",
    "dead_positions",
    "lost_at_start",
    "peak_told",
]
OLD_IN = {  # one old name of every subpackage that has them
    "analysis": "peak_told",
    "design": "many",
    "groups": "Slide",
    "kinematics": "crank_limits",
    "measures": "regime_margin",
    "motion": "steady",
    "reduction": "reduce",
    "scenes": "load_task",
}
MAY_NAME_THEM = {  # the table, and tests of it; two that sort the letters R and P of joints
    *("linkjax/_renamed.py", "tests/test_words.py", "tests/words.py", "tests/design/test_misuse.py"),
    *("tests/physics/test_structure.py", "tests/physics/test_scales.py"),
}


@pytest.mark.parametrize("folder", SCANNED)
def test_words_of_the_field(folder):
    """No word of the list in messages, docstrings, comments, and docs; `python -m tests.words` prints them."""
    places = [place for file in files([ROOT / folder]) for place in found_in(file)]
    assert not places, "\n" + "\n".join(places)


@pytest.mark.parametrize(
    "line",
    ["the crank comes round", "is told to", "two wheels in gear", "leave it out", "a group that brings the point in",
     "behind the one before", "its dead points", "an idler"],
)  # fmt: skip
def test_the_list_finds_words(line):
    assert PATTERN.search(line)
    assert not PATTERN.search(f"`{line.replace(' ', '_')}` is a name")


def test_every_word_can_be_read():
    for word, instead in WORDS.items():
        assert re.compile(word) and instead


def test_old_names_are_gone():
    """Only the changelog and the table of renamed names have them."""
    pattern = re.compile(r"(?<![\w-])(" + "|".join(OLD) + r")(?![\w-])")
    every = files([ROOT / folder for folder in (*SCANNED, "tests")])
    found = {file.relative_to(ROOT).as_posix() for file in every if pattern.search(file.read_text(encoding="utf-8"))}
    assert found <= MAY_NAME_THEM


@pytest.mark.parametrize("old", [name for name, new in RENAMED.items() if new in lj.__all__])
def test_old_names_say_the_new_one(old):
    with pytest.raises(AttributeError, match=f"it is called '{RENAMED[old]}' now"):
        getattr(lj, old)


@pytest.mark.parametrize(("subpackage", "old"), OLD_IN.items())
def test_old_names_of_subpackages_say_the_new_one(subpackage, old):
    with pytest.raises(AttributeError, match=f"'linkjax.{subpackage}' has no .* it is called '{RENAMED[old]}' now"):
        getattr(importlib.import_module(f"linkjax.{subpackage}"), old)
    with pytest.raises(AttributeError, match=f"^module 'linkjax.{subpackage}' has no attribute 'nonsense'$"):
        _ = getattr(lj, subpackage).nonsense


def test_every_subpackage_with_old_names_is_tested():
    """A name that replaces another, in a subpackage that defines it, can be asked for by the old name."""
    doors = {file.parent.name for file in (ROOT / "linkjax").glob("*/__init__.py") if "old_names" in file.read_text()}
    assert doors == set(OLD_IN)


def test_all_old_names_lead_somewhere():
    for subpackage, old in [("design", "Met"), ("groups", "RR"), ("kinematics", "assemblies"), ("scenes", "build_task"),
                            ("measures", "largest_speed"), ("kinematics", "smallest_margin")]:  # fmt: skip
        with pytest.raises(AttributeError, match=f"it is called '{RENAMED[old]}' now"):
            getattr(getattr(lj, subpackage), old)


def test_an_unknown_name_lists_no_names():
    with pytest.raises(AttributeError, match=r"^module 'linkjax' has no attribute 'xyzzy'; see dir\(linkjax\)$"):
        _ = lj.xyzzy
    with pytest.raises(AttributeError, match="did you mean 'slider_crank'"):
        _ = lj.slider_crnk
    for name in ("version__", "config"):  # similar to private names only
        with pytest.raises(AttributeError, match=r"see dir\(linkjax\)$"):
            getattr(lj, name)
