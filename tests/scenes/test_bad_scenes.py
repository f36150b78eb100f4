"""Malformed and impossible scene files: each gives one clear line and the right exit code, never a traceback or NaN."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import jax
import numpy as np
import pytest

import linkjax as lj
from linkjax import cli
from linkjax._results import MachineError
from linkjax.analysis import document, measured, plain
from linkjax.scenes import (
    Document,
    SceneError,
    build_problem,
    build_rolling,
    load,
    loads_text,
    read_document,
    rolling_names,
    scene_names,
)
from linkjax.scenes._models import SceneFile
from linkjax.scenes._rolling import RollingFile
from tests.helpers import PACKAGE
from tests.scenes.mutations import broken, mutation

NAMES = (*scene_names(), *rolling_names())
KEYS = {*SceneFile.model_fields, *RollingFile.model_fields}
NOISE = re.compile(r"\bnan\b|\binf\b|None|Traceback|object at|\bdict\b|\bfloat\b|\bint\b|pydantic|Error|\n")


def text_of(name: str) -> str:
    """The file of a built-in scene."""
    folder = "rolling" if name in rolling_names() else "builtin"
    return (PACKAGE / f"scenes/{folder}/{name}.toml").read_text(encoding="utf-8")


def check_message(error: SceneError, what: str, given: object) -> None:
    """One line with file, key (or line), problem and remedy, in the terms of scene files, and of this one."""
    message = str(error)
    assert message.startswith("bad.toml: ") and message.endswith(f"{error.problem}; {error.remedy}"), what
    assert "\n" not in message and len(message) < 450 and error.problem and error.remedy, what
    assert not NOISE.search(f"{error.problem}; {error.remedy}".replace("not a finite number", "")), (what, message)
    assert f"{error.key}" in message, what
    top = re.split(r"[.\[ ]", error.key)[0]
    known = top in KEYS or top == "line" or "empty" in error.problem or "not readable" in error.problem
    assert known or error.problem.endswith("not a known key"), (what, message)
    assert "[" not in error.key or top in str(given), (what, message)


def refused(name: str, count: int, seed: int) -> int:
    """How many of so many bad versions of a scene are refused; all others give a machine with finite numbers."""
    text, found = text_of(name), 0
    table, rng = tomllib.loads(text), np.random.default_rng([seed, NAMES.index(name)])
    for _ in range(count):
        by_text = rng.random() < 0.15
        what, bad = broken(text, rng) if by_text else mutation(table, rng)
        try:
            document = read_document(bad, "bad.toml") if isinstance(bad, str) else Document("bad.toml", bad)
            made = build_rolling(document) if document.rolling else build_problem(document)[0]
        except SceneError as error:
            check_message(error, f"{name}: {what}", bad)
            found += 1
        else:
            assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(made)), f"{name}: {what}"
    return found


@pytest.mark.parametrize("name", NAMES)
def test_mutations(name):
    """25 bad versions of every scene; 16 refused of each are more than 300 in total."""
    assert len(NAMES) * 16 > 300
    assert refused(name, 25, seed=0) >= 16


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_many_mutations(name):
    assert refused(name, 300, seed=1) >= 200


def edit(name: str, *pairs: str) -> str:
    """A built-in scene with strings replaced in pairs, each at its first occurrence."""
    text = text_of(name)
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


LAW = 'link = "crank"\nlaw = { angles = ["0 deg", "90 deg", "180 deg"], values = ["0 deg", "40 deg", "10 deg"] }'
DRAWN = {  # errors in a drawn machine: file, key, part of the problem, part of the remedy
    "a slot on itself": (
        edit("elliptic-trammel", 'block = "stone"\nguide = {', 'block = "stone"\nguide = { on = "stone",'),
        "slots[0]",
        "slides along itself",
        "name the link that the guide is on",
    ),
    "a slot on itself, that drives": (
        edit("scissor-lift", 'block = "rod"\nguide = { on = "barrel"', 'block = "rod"\nguide = { on = "rod"'),
        "slots[0]",
        "slides along itself",
        "name the link that the guide is on",
    ),
    "lengths for a law": (
        edit("scissor-lift", "stroke = {", "law = {"),
        "drive.law.start",
        "a length where an angle is needed",
        "or, for a slider, stroke = {",
    ),
    "a slot of an unknown block": (
        edit("elliptic-trammel", 'block = "shoe"', 'block = "shoo"'),
        "slots[1].block",
        "link 'shoo' is not defined",
        "'shoe'",
    ),
    "a slot on an unknown link": (
        edit("scissor-lift", 'on = "barrel", through', 'on = "barel", through'),
        "drive.stroke",
        "'rod' does not slide on 'barrel'",
        'write on = "barel" as its slot does',
    ),
    "a guide on an unknown link": (
        edit("scissor-lift", 'block = "roller"\nguide = {', 'block = "roller"\nguide = { on = "bra",'),
        "slots[1].guide.on",
        "link 'bra' is not defined",
        "'brace'",
    ),
    "a guide through a point of another": (
        edit("scissor-lift", 'on = "barrel", through = "O"', 'on = "barrel", through = "U"'),
        "slots[0].guide.on",
        "point 'U' is not",
        "known here",
    ),
    "a guide of the frame through a moving point": (
        edit("scissor-lift", 'guide = { through = "O" }', 'guide = { through = "C" }'),
        "slots[1].guide.through",
        "not a point of the frame",
        "known here: O",
    ),
    "a missing slot": (
        edit("elliptic-trammel", '[[slots]]\nblock = "shoe"\nguide = { through = "O", along = "90 deg" }\n', ""),
        "links",
        "with the drive held, stone, bar, shoe can still move at X, Y, stone.guide: 3 degrees of freedom",
        "or a pin or slider joint (-2)",
    ),
    "two blocks for one": (
        edit(
            "scissor-lift",
            '[[slots]]\nblock = "roller"',
            '[[slots]]\nblock = "brace"\nguide = { through = "O" }\n\n[[slots]]\nblock = "roller"',
        ),
        "links",
        "form an overconstrained chain: one of the joints",
        "delete one of these joints",
    ),
    "a link too many": (
        edit("stephenson-3", "[flywheel]", '[links.tie]\npins = ["C", "G"]\nlength = "300 mm"\n\n[flywheel]'),
        "links",
        "the joints A, B, C, E, D, G, … make",
        "delete one of: tie, lever, rocker, or give it",
    ),
    "a link that hangs loose": (
        edit("stephenson-3", "[flywheel]", '[links.tie]\npins = ["C", "Z"]\nlength = "300 mm"\n\n[flywheel]'),
        "links",
        "tie can still move",
        "or delete the links that can move",
    ),
    "a link too many in a row": (
        edit(
            "stephenson-3",
            'pins = ["E", "G"]',
            'pins = ["E", "K"]',
            "[flywheel]",
            '[links.more]\npins = ["K", "G"]\nlength = "300 mm"\n\n[flywheel]',
            "[sketch]",
            '[sketch]\nK = ["250 mm", "300 mm"]',
        ),
        "links",
        "can still move at E, K, F, G: 2 degrees of freedom",
        "add a binary link (-1 degree of freedom)",
    ),
    "a motor beside the machine": (
        edit(
            "stephenson-3",
            "[fixed]",
            '[fixed]\nK = [0, "-100 mm"]',
            '[drive]\nlink = "crank"',
            '[drive]\nlink = "motor"\n\n[links.motor]\npins = ["K", "L"]\nlength = "50 mm"',
        ),
        "drive.link",
        "it moves 'motor' alone, which is joined only to 'frame'",
        "join another link to one of its pins (L)",
    ),
    "a crank beside what stands still": (
        edit("four-bar", 'from = "B"', 'from = "K"', "[fixed]", '[fixed]\nK = ["50 mm", "20 mm"]'),
        "groups[1]",
        "the driver moves 'crank' alone; coupler, rocker are attached to the frame and do not move",
        "attach it to a point of 'crank', such as B",
    ),
    "a link apart": (
        edit("stephenson-3", "[flywheel]", '[links.tie]\npins = ["Y", "Z"]\nlength = "300 mm"\n\n[flywheel]'),
        "links.tie",
        "not connected to the frame",
        "share a pin",
    ),
    "a pin twice": (
        edit("stephenson-3", 'pins = ["E", "G"]', 'pins = ["E", "E"]'),
        "links.arm",
        "names a pin twice",
        "once",
    ),
    "no pins": (edit("stephenson-3", 'pins = ["E", "G"]\n', ""), "links.arm.pins", "missing", 'pins = ["A", "B"]'),
    "a sketch of nothing": (
        edit("stephenson-3", 'G = ["400 mm", "150 mm"]', 'GG = ["400 mm", "150 mm"]'),
        "sketch.GG",
        "is not a point of any link",
        "'G'",
    ),
    "no sketch": (
        edit(
            "scissor-lift",
            'H = ["0.55 m", "0.22 m"]\n',
            "",
            'E = ["0.95 m", "0.38 m"]\n',
            "",
            'C = ["1.44 m", "0.29 m"]\n',
            "",
        ),
        "links.",
        "sketch",
        "sketch",
    ),
    "a drive of nothing": (
        edit("stephenson-3", 'link = "crank"', 'link = "krank"'),
        "drive.link",
        "'krank' is not defined",
        "'crank'",
    ),
    "a drive between strangers": (
        edit("stephenson-3", 'link = "crank"', 'link = "crank"\non = "lever"'),
        "drive",
        "share no joint",
        "two links that are joined",
    ),
    "a slide without a stroke": (
        edit("scissor-lift", 'stroke = { start = "1.0255814597533925 m", stop = "1.5527073130503377 m" }', ""),
        "drive.stroke",
        "a slider needs a limited stroke along its guide",
        "add stroke",
    ),
    "a stroke for a crank": (
        edit("stephenson-3", "[drive]\n", '[drive]\nstroke = { start = "1 mm", stop = "2 mm" }\n'),
        "drive.stroke",
        "does not slide",
        "delete stroke",
    ),
    "a stroke in degrees": (
        edit("scissor-lift", '"1.0255814597533925 m"', '"10 deg"'),
        "drive.stroke.start",
        "an angle where a length",
        "mm",
    ),
    "a law in metres": (
        edit(
            "stephenson-3", '[drive]\nlink = "crank"', '[drive]\nlink = "crank"\nlaw = { start = "1 m", stop = "2 m" }'
        ),
        "drive.law.start",
        "a length where an angle",
        "deg",
    ),
    "a law of two lengths": (
        edit("stephenson-3", '[drive]\nlink = "crank"', "[drive]\n" + LAW.replace(', "10 deg"]', "]")),
        "drive.law.values",
        "2 values at 3 angles",
        "one value for each angle",
    ),
    "a law against the clock": (
        edit(
            "stephenson-3",
            'speed = "150 rpm"',
            'speed = "150 rpm"\nrotation = "cw"',
            '[drive]\nlink = "crank"',
            "[drive]\n" + LAW,
        ),
        "rotation",
        "which gives its sense of motion",
        "delete rotation",
    ),
    "a law that stands still": (
        edit(
            "stephenson-3",
            "target_delta = 0.05\n",
            "",
            '[flywheel]\ninertia = "0.6 kg m^2"\n',
            "",
            '[drive]\nlink = "crank"',
            '[drive]\nlink = "crank"\nlaw = { start = "10 deg", stop = "10 deg" }',
        ),
        "drive.law.stop",
        "the same as start",
        "the other end",
    ),
    "groups and a drive": (
        text_of("four-bar") + '\n[drive]\nlink = "crank"\n',
        "drive",
        "not both",
        "delete drive, or the groups",
    ),
    "neither": (edit("stephenson-3", '[drive]\nlink = "crank"\n', ""), "groups", "missing", "a table [drive]"),
    "a sketch beside groups": (
        text_of("four-bar") + "\n[sketch]\nB = [0, 0]\n",
        "sketch",
        "no effect",
        "delete sketch",
    ),
    "a drive against what stands still": (
        edit("elliptic-trammel", 'pins = ["Y"]', 'pins = ["X"]'),
        "drive",
        "it moves 'bar' alone, which is joined only to 'stone'",
        "join another link to one of its pins (Y)",
    ),
    "coinciding pins": (
        edit(
            "stephenson-3",
            'pins = ["E", "G"]\nlength = "300 mm"',
            'pins = ["E", "G"]',
            'G = ["400 mm", "150 mm"]',
            'G = ["180 mm", "260 mm"]',
        ),
        "links.arm",
        "coincide",
        "give its length",
    ),
    "beyond size": (
        edit("stephenson-3", 'length = "350 mm"', 'length = "1e300 m"'),
        "links.coupler.length",
        "too large for any machine",
        "mm",
    ),
    "beyond smallness": (
        edit("stephenson-3", 'speed = "150 rpm"', 'speed = "1e-40 rpm"'),
        "speed",
        "too small for any machine",
        "rpm",
    ),
    "a slot for a slide that stands along its guide": (
        edit("scotch-yoke", 'slot = "90 deg"', 'slot = "180 deg"'),
        "groups[1].slot",
        "lies along the guide",
        "deg",
    ),
}
ROLLING = {
    "two bodies": (edit("rolling-eccentric", "bodies = 8", "bodies = 2"), "bodies", "3 to 1000", "e.g. 8"),
    "half a body": (edit("rolling-eccentric", "bodies = 8", "bodies = 7.5"), "bodies", "3 to 1000", "e.g. 8"),
    "links": (
        text_of("rolling-eccentric") + '\n[links.crank]\nlength = "1 m"\n',
        "links",
        "not a known key",
        "known here",
    ),
    "another kind": (
        edit("rolling-eccentric", 'kind = "rolling"', 'kind = "gear"'),
        "kind",
        "not a known kind of machine",
        "delete it",
    ),
}


@pytest.mark.parametrize("name", DRAWN)
def test_a_machine_that_is_drawn_wrong(name):
    text, key, problem, remedy = DRAWN[name]
    with pytest.raises(SceneError) as caught:
        loads_text(text, "bad.toml")
    check_message(caught.value, name, text)
    assert caught.value.key.startswith(key) and problem in caught.value.problem and remedy in caught.value.remedy


@pytest.mark.parametrize("name", ROLLING)
def test_rolling_bodies_that_cannot_be(name):
    text, key, problem, remedy = ROLLING[name]
    with pytest.raises(SceneError) as caught:
        build_rolling(read_document(text, "bad.toml"))
    check_message(caught.value, name, text)
    assert caught.value.key == key and problem in caught.value.problem and remedy in caught.value.remedy


IMPOSSIBLE = {  # well-formed, but impossible for a machine: scene, changes, part of the message
    "a rod too short": ("hay-press", {"links.rod.length": "1 mm"}, "cannot be assembled"),
    "a rod as short as the crank": ("hay-press", {"links.rod.length": "300 mm"}, "has a change point"),
    "a pivot out of reach": ("hay-press", {"fixed.F[0]": "20 m"}, "cannot be assembled"),
    "a load beyond all energy": ("hay-press", {"loads.hay.force": "1e9 kN"}, "no steady-state motion"),
    "a huge load": ("hay-press", {"loads.hay.force": 9e19}, "no steady-state motion"),
    "a crank that creeps": ("hay-press", {"speed": "1e-9 rpm"}, "no steady-state motion"),
    "a heavy rod": ("hay-press", {"links.rod.inertia": 9e19}, "no reduced inertia"),
    "a rocker in the clouds": ("hay-press", {"links.rocker.length": 9e19}, "cannot be assembled"),
    "a crank longer than all": ("hay-press", {"links.crank.length": 9e19}, "cannot be assembled"),
}
NO_MOTION = ("no steady-state motion", "no reduced inertia", "nothing has a mass")
SLOW = {
    "a four-bar that does not close": ("four-bar", {"links.rocker.length": "10 mm"}, "cannot be assembled"),
    "no inertia at all": (
        "two-cylinder",
        {
            "flywheel.inertia": 0,
            "gravity": 0,
            "links.rod2.mass": 0,
            "links.rod4.mass": 0,
            "links.piston3.mass": 0,
            "links.piston5.mass": 0,
        },
        "nothing has a mass",
    ),
    "a knee that cannot be reached": ("toggle-press", {"links.rod.length": "200 mm"}, "cannot be assembled"),
    "a trammel with a slot along the other": ("elliptic-trammel", {"slots[1].guide.along": "0 deg"}, ""),
    "a lift beyond its bars": ("scissor-lift", {"drive.stroke.stop": "4 m"}, "cannot be assembled"),
    "a lift through the ground": ("scissor-lift", {"drive.stroke.start": "0.9 m"}, "cannot be assembled"),
    "a stroke out of all reach": ("scissor-lift", {"drive.stroke": {"start": "6 m", "stop": "7 m"}}, "begins at 6 m"),
    "one ram of four out of reach": ("kozhevnikov-press", {"links.rod12.length": "1 mm"}, "cannot be assembled"),
}


@pytest.mark.parametrize("name", [*IMPOSSIBLE, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def test_impossible_machines(name):
    """One line with the scene, the problem and its position, and the remedy; no NaN in it."""
    scene, changes, part = {**IMPOSSIBLE, **SLOW}[name]
    if part in NO_MOTION:  # all other results exist
        cycle = lj.analyse(load(scene, changes), angles=4)
        assert cycle.steady is None and cycle.missing is not None
        assert part in cycle.missing.reason and not NOISE.search(cycle.missing.reason)
        json.dumps(plain(document(cycle)), allow_nan=False)
        return
    with pytest.raises((MachineError, SceneError)) as caught:
        lj.analyse(load(scene, changes))
    message = str(caught.value)
    assert part in message and not NOISE.search(message), message
    assert message.startswith(("Scene ", f"{scene}.toml"))


@pytest.mark.parametrize("name", [*DRAWN, *ROLLING])
def test_the_exit_code_of_what_is_refused(name, tmp_path: Path, monkeypatch, capsys):
    """Two, and one line."""
    (tmp_path / "bad.toml").write_text({**DRAWN, **ROLLING}[name][0], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["linkjax", "show", "bad.toml"])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    out, err = capsys.readouterr()
    assert stopped.value.code == 2 and not out and len(err.splitlines()) == 1 and err.startswith("bad.toml: ")


@pytest.mark.slow
@pytest.mark.parametrize("name", scene_names())
def test_what_is_not_refused_is_analysed(name):
    """Bad versions of a scene that give a machine: its results are finite, or one line gives the reason why there are
    none."""
    table, rng, analysed = tomllib.loads(text_of(name)), np.random.default_rng([2, NAMES.index(name)]), 0
    while analysed < 5:
        what, bad = mutation(table, rng)
        try:
            scene = build_problem(Document("bad.toml", bad))[0]
        except SceneError:
            continue  # the message: `test_many_mutations`
        analysed += 1
        try:
            found = measured(lj.analyse(scene, angles=4, nodes=48))
        except MachineError as error:
            assert not NOISE.search(str(error)), (what, str(error))
        else:
            assert np.all(np.isfinite(list(found.values()))), what


COMMANDS = {  # content of the file, exit code, part of the message
    "misspelt": (edit("four-bar", "[links.crank]", "[link.crank]"), 2, "link: not a known key; did you mean 'links'?"),
    "broken": (text_of("four-bar")[:300], 2, "line "),
    "empty": ("", 2, "the scene is empty"),
    "wrong unit": (edit("toggle-press", '"417 mm"', '"417 kg"'), 2, "links.rod.length"),
    "slot on itself": (DRAWN["a slot on itself"][0], 2, "slides along itself"),
    "loose": (DRAWN["a link that hangs loose"][0], 2, "tie can still move"),
    "two bodies": (ROLLING["two bodies"][0], 2, "bodies = 2"),
    "rings that do not close": (
        edit("rolling-prototype", 'inner_radius = "40 mm"', 'inner_radius = "40 mm"\nouter_radius = "80 mm"'),
        1,
        "clos",
    ),
    "too short": (edit("hay-press", "1020 mm", "200 mm"), 1, "cannot be assembled"),
    "no regime": (edit("hay-press", "30 kN", "300000 kN"), 1, "no steady-state motion"),
    "too large": (edit("hay-press", "1020 mm", "1e300 m"), 2, "too large for any machine"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_the_real_command(name, tmp_path: Path):
    text, code, part = COMMANDS[name]
    assert len(COMMANDS) >= 10
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "linkjax", "analyse", "bad.toml"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == code, done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == 1 and part in lines[0] and not re.search(r"Traceback|\bnan\b", done.stdout + done.stderr)
    assert lines[0].startswith("bad.toml: " if code == 2 else ("Scene '", "bad.toml", "Rolling"))
