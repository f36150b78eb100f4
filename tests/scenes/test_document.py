"""Raw documents: overriding single keys, and that every damaged document gives only a SceneError."""

import copy
import datetime

import numpy as np
import pytest

from linkjax.loads import OpposingForce
from linkjax.machine import Scene
from linkjax.scenes import Document, SceneError, build, load, load_document, loads_text, override, scene_names, setting
from tests.helpers import PACKAGE

CHANGES = [  # key, value, its path in the raw document, the value there afterwards
    ("links.rod.length", "1.1 m", ("links", "rod", "length"), "1.1 m"),
    (" links.rod.length ", '"1.1 m"', ("links", "rod", "length"), "1.1 m"),
    ("links.rod.length", 1.1, ("links", "rod", "length"), 1.1),
    ("target_delta", "0.02", ("target_delta",), 0.02),
    ("mean", "midrange", ("mean",), "midrange"),
    ("gravity", "[0, -1]", ("gravity",), [0, -1]),
    ("flywheel.inertia", "4 kg m^2", ("flywheel", "inertia"), "4 kg m^2"),
    ("fixed.F[0]", "560 mm", ("fixed", "F", 0), "560 mm"),
    ("fixed.F.1", "590 mm", ("fixed", "F", 1), "590 mm"),
    ("loads.hay.window[1]", "300 deg", ("loads", 0, "window", 1), "300 deg"),
    ("loads[0].force", "20 kN", ("loads", 0, "force"), "20 kN"),
    ("loads.0.name", "straw", ("loads", 0, "name"), "straw"),
    ("groups[1].guide.offset", "10 mm", ("groups", 1, "guide", "offset"), "10 mm"),
    ("groups.rod-slider.guide.along", "1 deg", ("groups", 1, "guide", "along"), "1 deg"),
    ("groups.link4-rocker.side", "right", ("groups", 2, "side"), "right"),
    ("groups.crank.phase", "3 deg", ("groups", 0, "phase"), "3 deg"),
    (
        "links.rod.points.E",
        '{ along = "400 mm", across = "0.2 m" }',
        ("links", "rod", "points", "E", "across"),
        "0.2 m",
    ),
    ('links."rod".points.E.turned', "20 deg", ("links", "rod", "points", "E", "turned"), "20 deg"),
]


@pytest.mark.parametrize(("key", "value", "path", "there"), CHANGES, ids=lambda x: x if isinstance(x, str) else "")
def test_override(key, value, path, there):
    before = load_document("hay-press")
    kept = copy.deepcopy(before.table)
    after = override(before, key, value)
    assert before.table == kept and after.source == before.source
    place = after.table
    for part in path:
        place = place[part]
    assert place == there
    assert isinstance(build(after), Scene)


def test_override_is_seen_in_the_scene():
    scene = load("hay-press", {"links.rod.length": "1.1 m", "loads.hay.force": "20 kN", "fixed.F[1]": 0.6})
    assert float(scene.mechanism.links["rod"].length) == 1.1
    assert isinstance(scene.loads[0], OpposingForce) and float(scene.loads[0].magnitude) == 20e3
    assert float(scene.mechanism.fixed["F"].y) == 0.6


WRONG = [  # key, value, part of the problem, part of the remedy
    ("links.rod.lenght", "1 m", "links.rod.lenght is not a known key", "did you mean 'links.rod.length'?"),
    ("rod.length", "1 m", "rod is not a known key", "did you mean 'links.rod.length'?"),
    ("links.rodd.length", "1 m", "links.rodd is not a known key", "did you mean 'links.rod.length'?"),
    ("links.rod.points.Q.at", "1 m", "links.rod.points.Q is not a known key", "did you mean 'links.rod.points.E.at'?"),
    ("loads.hey.force", "1 N", "loads.hey is not a known key", "did you mean 'loads.hay.force'?"),
    ("loads[3].force", "1 N", "loads[3] is not a known key", "did you mean 'loads[0].force'?"),
    ("groups[1].meet", "X", "groups[1].meet is not a known key", "did you mean"),
    ("flywheel.mass", "1 kg", "flywheel.mass is not a known key", "known here: inertia"),
    ("fixed.Q", "[0, 0]", "fixed.Q is not a known key", "did you mean 'fixed.F'?"),
    ("fixed.F[2]", "1 m", "fixed.F[2] is not a known key", "did you mean 'fixed.F'?"),
    ("xyz", "1", "xyz is not a known key", "known here: branch, constant_speed, cycle_turns, drive, fixed"),
    ("links.rod.length.x", "1", "links.rod.length has no keys of its own", "set links.rod.length itself"),
    ("", "1", "no key given", "links.rod.length"),
    ("...", "1", "not a known key", "known here: branch, constant_speed, cycle_turns"),
    ("links.rod[", "1", "not a known key", "did you mean"),
]


@pytest.mark.parametrize(("key", "value", "problem", "remedy"), WRONG, ids=lambda x: x)
def test_override_of_what_is_not_there(key, value, problem, remedy):
    with pytest.raises(SceneError) as caught:
        override(load_document("hay-press"), key, value)
    assert problem in caught.value.problem and remedy in caught.value.remedy
    assert caught.value.source == "hay-press.toml" and caught.value.key == key


def test_wrong_values_are_found_when_the_scene_is_built():
    with pytest.raises(
        SceneError, match=r'hay-press.toml: links.rod.length = "3 kg": a mass where a length is needed; '
    ):
        load("hay-press", {"links.rod.length": "3 kg"})


def test_scaled_masses_follow_an_overridden_length():
    changes = {"links.rod.mass_properties": "scaled", "links.rod.length": "1.53 m"}  # 1.5 times as long
    one, two = (
        load("hay-press").mechanism.links["rod"].actual(),
        load("hay-press", changes).mechanism.links["rod"].actual(),
    )
    ratios = [two.mass / one.mass, two.centre.x / one.centre.x, two.points["E"].y / one.points["E"].y]
    np.testing.assert_allclose([*ratios, two.inertia / one.inertia], [1.5, 1.5, 1.5, 1.5**3], rtol=1e-15)
    again = load("hay-press", changes | {"links.rod.length": "0.51 m"}).mechanism.links["rod"]
    assert again.reference_length == 1.02


@pytest.mark.parametrize(
    ("text", "value"),
    [("1.1 m", "1.1 m"), ("true", True), ("3", 3), ('"3"', "3"), ("[1, 2]", [1, 2]), ("+", "+"), ("", ""),
     ("1\nb = 2", "1\nb = 2"), ("1979-05-27", "1979-05-27"), ("{a = 1}", {"a": 1}), ("[" * 5000, "[" * 5000), (2, 2)],
    ids=str,
)  # fmt: skip
def test_settings_of_the_command_line(text, value):
    assert setting(text) == value and type(setting(text)) is type(value)


JUNK = [
    *(None, "3 s", "-7 m", "-7 kg", float("nan"), float("inf"), -1, 0, 10**400, 1e300, "1e999 kg", True),
    *(
        "",
        "x",
        "A",
        "S1",
        "\0\n",
        "é" * 3000,
        [],
        [1],
        [1, 2],
        [[1], {}],
        {},
        {"at": -1},
        {"along": "1 m", "turned": 3},
    ),
    datetime.date(2000, 1, 1),
]


def paths(value, path=()):
    """Every path in a document."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield (*path, key)
        yield from paths(item, (*path, key))


def mutants(table):
    """Every key of a document deleted, misspelt, and replaced by each kind of invalid value."""
    for path in list(paths(table)):
        for junk in (*JUNK, "delete", "misspell", "double"):
            mutant = copy.deepcopy(table)
            place = mutant
            for part in path[:-1]:
                place = place[part]
            last = path[-1]
            if junk == "delete":
                del place[last]
            elif junk == "misspell" and isinstance(place, dict):
                place[f"{last}x"] = place.pop(last)
            elif junk == "double" and isinstance(place, list):
                place.append(copy.deepcopy(place[last]))
            else:
                place[last] = junk
            yield path, junk, mutant


QUICK = ("four-bar",)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in scene_names()])
def test_no_mutant_gives_anything_but_a_scene_or_a_scene_error(name):
    document = load_document(name)
    outcomes = {"scene": 0, "error": 0}
    for path, junk, table in mutants(document.table):
        try:
            build(Document(name, table))
            outcomes["scene"] += 1
        except SceneError as error:
            outcomes["error"] += 1
            assert str(error).startswith(f"{name}: ") and "\n" not in str(error), (path, junk)
            assert len(str(error)) < 600 and error.problem and error.remedy, (path, junk)
    assert outcomes["error"] > 20 * len(list(paths(document.table))) and outcomes["scene"] > 0


@pytest.mark.slow
def test_no_damaged_text_gives_anything_but_a_scene_or_a_scene_error(rng):
    text = (PACKAGE / "scenes/builtin/four-bar.toml").read_text(encoding="utf-8")
    damage = [*'"[]{}=.,#\n\\ -09eé\0\t', "", "", "", "1e9", "nan", "'''", "[[", "kg"]
    outcomes = {"scene": 0, "error": 0}
    for _ in range(1000):
        mangled = text
        for at in rng.integers(0, len(text), size=rng.integers(1, 4)):
            mangled = mangled[:at] + damage[rng.integers(len(damage))] + mangled[at + 1 :]
        try:
            loads_text(mangled)
            outcomes["scene"] += 1
        except SceneError as error:
            outcomes["error"] += 1
            assert "\n" not in str(error)
    assert min(outcomes.values()) > 30


@pytest.mark.parametrize("key", ["links.rod.length", "links", "groups[1].guide", "loads.hay", "fixed.F[0]", "title"])
@pytest.mark.parametrize("junk", JUNK, ids=lambda junk: str(junk)[:10])
def test_overrides_of_junk(key, junk):
    document = Document("junk", {"links": junk, "groups": junk, "loads": junk, "fixed": junk, "title": junk})
    for given in (document, load_document("hay-press")):
        try:
            build(override(given, key, junk))
        except SceneError as error:
            assert error.remedy
