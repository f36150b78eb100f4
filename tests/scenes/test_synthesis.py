"""Synthesis in scene files and on the command line: wanted points, angles and positions, own numbers."""

from __future__ import annotations

import functools
import json

import numpy as np
import pytest

import linkjax as lj
from linkjax.scenes import SceneError
from tests.design.test_squares import PHI, TRUE, closed
from tests.test_cli import run

POINTS, ROCKER, COUPLER = closed(TRUE, PHI)
MACHINE = """
title = "Four-bar"
speed = "60 rpm"
constant_speed = true
fixed = { A = [0, 0], D = ["0.35 m", 0] }
groups = [
    { kind = "crank", link = "crank", pivot = "A", end = "B" },
    { kind = "RRR", links = ["coupler", "rocker"], from = "B", to = "D", meet = "C", side = "left" },
]
[links]
crank = { length = "0.1 m" }
rocker = { length = "0.31 m" }
coupler = { length = "0.24 m", points = { E = { along = "0.12 m", across = "0.08 m" } } }
[optimise.free]
"links.coupler.length" = "0.2 to 0.3 m"
"links.rocker.length" = "0.25 to 0.35 m"
"""


def listed(values) -> str:
    return "[" + ", ".join(f'"{value:.17g} rad"' for value in values) + "]"


def table(text: str) -> str:
    return MACHINE + f"[optimise.minimise]\n{text}\n"


@pytest.fixture
def file(tmp_path):
    return tmp_path / "four-bar.toml"


@pytest.fixture
def call(monkeypatch, capsys):
    return functools.partial(run, monkeypatch, capsys, "optimise")


CASES = {
    "path": f'path_error = "E"\npoints = {POINTS.tolist()}\nangles = {listed(PHI - 0.1)}\nstart = "own.start"',
    "function": f'function_error = "rocker"\nangles = {listed(PHI)}\nvalues = {listed(ROCKER)}',
}


@pytest.mark.parametrize("case", CASES)
def test_a_scene_file(file, case):
    file.write_text(table(CASES[case]))
    scene, asked = lj.load_problem(file)
    found = lj.optimise(scene, **asked)
    assert found.objective is not None and found.objective < 1e-18
    assert [found.variables[f"links.{name}.length"][1] for name in ("coupler", "rocker")] == pytest.approx([0.25, 0.3])
    if case == "path":
        assert found.variables["own.start"][1] == pytest.approx(0.1, abs=1e-7)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('path_error = "Q"\npoints = [[0, 1]]\nangles = [0]', "is not a point of the machine"),
        ('path_error = "E"\nangles = [0]', "no points"),
        ('path_error = "E"\npoints = [[0, 1]]\nangels = [0]', "unknown key 'angels'; did you mean 'angles'?"),
        ('path_error = "E"\npoints = [[0, 1]]\nangles = [30]', "angles: 30 is an angle without a unit"),
        ('path_error = "E"\npoints = [["1 kg", 1]]\nangles = [0]', "a mass where a length is needed"),
        ('path_error = "E"\npoints = [[0, 1]]\nangles = [0, 0]', "has 2 crank angles for 1 wanted values"),
        ('function_error = "E"\nangles = [0]\nvalues = [0]', "is not a link of the machine"),
        ('points = [[0, 1]]', "not one of path_error, function_error, position_error"),
        ('position_error = "coupler"\npositions = [[0, 1, 2]]', "2 is an angle without a unit"),
    ],
)  # fmt: skip
def test_wrong_tables(file, text, says):
    file.write_text(table(text))
    with pytest.raises(SceneError) as error:
        lj.load_problem(file)
    assert says in str(error.value) and "optimise.minimise" in str(error.value)


def test_own_numbers_of_a_section(file):
    """With a range of their own, and an initial value."""
    own = '"own.start" = { range = "-20 to 20 deg", initial = "5 deg" }\n'
    text = table(CASES["path"]).replace("[optimise.minimise]", own + "[optimise.minimise]")
    file.write_text(text)
    scene, asked = lj.load_problem(file)
    found = lj.optimise(scene, **asked)
    assert found.variables["own.start"] == pytest.approx((np.radians(5), 0.1), abs=1e-7)


def test_the_command_line(call, file, tmp_path):
    """Points in mm and crank angles in degrees from a CSV file; own numbers in all results."""
    file.write_text(MACHINE)
    points = tmp_path / "points.csv"
    rows = [
        f"{1e3 * x:.15g},{1e3 * y:.15g},{np.degrees(at):.15g}" for (x, y), at in zip(POINTS, PHI - 0.1, strict=True)
    ]
    points.write_text("\n".join(["x (mm), y (mm), crank [deg]", *rows]) + "\n")
    out, data = tmp_path / "made", tmp_path / "all.json"
    code, told, _ = call(file, "--path-error", f"E={points}", "--free-start", "--json", data)
    assert code == 0
    found = json.loads(data.read_text())
    assert found["objective"]["name"] == "path_error" and found["objective"]["after"] < 1e-18
    assert found["variables"]["own.start"]["after"] == pytest.approx(0.1, abs=1e-7)
    assert found["variables"]["own.start"]["unit"] == "rad"
    assert "own.start" in told and "path_error" in told
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "content", "says"),
    [
        (["--path-error", "E"], "", "--path-error: 'E': is not NAME=FILE"),
        (["--path-error", "E=none.csv"], "", "none.csv: cannot be read"),
        (["--path-error", "E={}"], "x,z\n1,2\n", "'z': is not a column"),
        (["--path-error", "E={}"], "x,crank (rad)\n1,2\n", "has no column 'y'"),
        (["--path-error", "E={}"], "x (deg),y\n1,2\n", "'deg' is not a unit of this column"),
        (
            ["--path-error", "E={}"],
            "x,y,crank\n1,2,30\n",
            "crank: is an angle without a unit; write crank (deg) or crank",
        ),
        (["--path-error", "E={}"], "x (mm); y (mm)\n1; 2\n", "has semicolons between its columns; write commas"),
        (["--path-error", "E={}"], "x,y\n1,two\n", "row 2: y is 'two', which is not a number"),
        (["--path-error", "E={}"], "x,y\n1\n", "row 2: has 1 values"),
        (["--path-error", "E={}"], "x,y\n", "has no rows"),
        (["--path-error", "E={}"], "x,y\n1,nan\n", "nan is not a finite number"),
        (["--path-error", "E={}", "--function-error", "rocker={}"], "x,y\n1,2\n", "two objectives are given"),
        (["--free-start"], "", "--free-start: there are no crank angles"),
        (
            ["--function-error", "rocker={}", "--minimise", "speed"],
            "crank (rad),angle (rad)\n0,0\n",
            "objective: two are given",
        ),
        (["--path-error", "Q={}"], "x,y,crank (rad)\n1,2,0\n", "path_error: Q: is not a point of the machine"),
    ],
)
def test_wrong_options(call, file, tmp_path, options, content, says):
    file.write_text(MACHINE)
    points = tmp_path / "points.csv"
    points.write_text(content)
    code, _, err = call(file, *(option.replace("{}", str(points)) for option in options))
    assert code == 2 and says in err and len(err.splitlines()) == 1
