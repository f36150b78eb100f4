"""`linkjax optimise`: its files, output and exit codes."""

from __future__ import annotations

import functools
import json
import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import linkjax as lj
from linkjax._display import Numbers
from linkjax.cli._print import print_warnings
from linkjax.design import _optimise
from linkjax.design._point import certify, look
from linkjax.measures import delta
from tests.helpers import PUMP, ROOT
from tests.report.optimum import OPTIMUM
from tests.test_cli import run

SCENE = (
    """
title = "Pump"
gravity = "9.81 m/s^2"
speed = "300 rpm"
fixed = { O = [0, 0] }
[links.crank]
length = "0.1 m"
mass = "2 kg"
inertia = "0.02 kg m^2"
centre = "50 mm"
[links.rod]
length = "0.4 m"
mass = "1 kg"
inertia = "0.02 kg m^2"
centre = "0.2 m"
[links.piston]
mass = "3 kg"
[flywheel]
inertia = "2 kg m^2"
"""
    + PUMP
    + """
[optimise]
minimise = "flywheel.inertia"
free = { "flywheel.inertia" = "0 to 50 kg m^2", "links.rod.length" = "± 20 %" }
limits = ["delta <= 0.02"]
"""
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    file = tmp_path_factory.mktemp("optimise") / "pump.toml"
    file.write_text(SCENE)
    return file


@pytest.fixture
def call(monkeypatch, capsys):
    """Exit code, standard output and standard error of one call."""

    return functools.partial(run, monkeypatch, capsys, "optimise")


@pytest.mark.slow
def test_the_whole_story(call, scene, tmp_path):
    """Tables, JSON, a scene that loads again, report and figures."""
    out = tmp_path / "made"
    code, told, _ = call(scene, "--out", out, "--json", tmp_path / "all.json", "--starts", "3", "--units", "mm")
    assert code == 0
    data = json.loads((tmp_path / "all.json").read_text())
    beside = json.loads((out / "optimum.json").read_text())
    assert (data.pop("scene_after"), beside.pop("scene_after")) == ("made/optimised.toml", "optimised.toml")
    assert data == beside
    assert set(data) == set(OPTIMUM) - {"scene_after"}  # covered by the tests of the report
    for of in ("objective", "result", "solver"):
        assert set(data[of]) == set(OPTIMUM[of])
    for of in ("variables", "limits"):
        assert {frozenset(each) for each in (*data[of].values(), *OPTIMUM[of].values())} == {
            frozenset(next(iter(OPTIMUM[of].values())))
        }
    after = lj.load(out / "optimised.toml")
    assert float(delta(after)) == pytest.approx(0.02, rel=1e-8)
    rod = data["variables"]["links.rod.length"]
    assert float(after.mechanism.links["rod"].length) == rod["after"]
    assert float(after.mechanism.flywheel.inertia) == data["objective"]["after"]
    assert (rod["before"], rod["lower"], rod["upper"]) == pytest.approx((0.4, 0.32, 0.48))
    limit = data["limits"]["delta"]
    assert limit["active"]
    assert limit["value"] == pytest.approx(data["after"]["delta"], rel=1e-9)
    assert data["before"]["delta"] == pytest.approx(float(delta(lj.load(scene))), rel=1e-9)
    assert data["kkt_residual"] <= 1e-6
    assert data["before_is"] == "the machine"
    assert (len(data["starts"]), data["starts_at_optimum"]) == (3, 3)
    assert data["evaluations"] > sum(start["evaluations"] for start in data["starts"])
    assert data["result"]["name"] == "optimal"
    assert f"{1e3 * rod['after']:#.6g} mm" in told
    assert f"{data['objective']['after']:#.6g} kg·m²" in told
    assert "3 of 3 starts reached the optimum" in told
    assert {"report.html", "machine.png", "machine.svg", "machine.gif", "optimised.toml"} <= {
        p.name for p in out.iterdir()
    }


@pytest.mark.slow
def test_limits_that_clash(call, scene, tmp_path):
    code, told, _ = call(scene, "--limit", "delta <= 1e-4", "--limit", "flywheel.inertia <= 0.1 kg m^2",
                         "--json", tmp_path / "all.json")  # fmt: skip
    assert code == 1
    assert "conflicting constraints: delta, flywheel.inertia" in told
    assert "NOT MET" in told
    data = json.loads((tmp_path / "all.json").read_text())
    assert (data["result"]["code"], data["result"]["name"]) == (1, "infeasible")
    assert set(data["result"]["conflicts"]) == {"delta", "flywheel.inertia"}


@pytest.mark.slow
def test_options_take_the_place_of_the_section(call, scene, tmp_path):
    """Another objective, another range, a design variable fixed again."""
    options = ["--minimise", "delta", "--limit", "delta <= 1"]
    options += ["--free", "flywheel.inertia=1 to 3 kg m^2", "--free", "links.rod.length=no"]
    code, _, _ = call(scene, *options, "--quiet", "--json", tmp_path / "all.json")
    data = json.loads((tmp_path / "all.json").read_text())
    assert (code, list(data["variables"])) == (0, ["flywheel.inertia"])
    assert data["objective"]["name"] == "delta"
    assert data["variables"]["flywheel.inertia"]["after"] == pytest.approx(3.0, rel=1e-9)
    assert data["variables"]["flywheel.inertia"]["active"] == "upper"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ("four-bar",),
            "four-bar: objective: none is given; write --minimise NAME or --maximise NAME, or `minimise` or ",
        ),
        (("hay-press", "--maximise", "delta", "--minimise", "speed"), "two are given"),
        (("hay-press", "--minimise", ""), "neither a measure nor a scene parameter"),
        (("hay-press", "--minimise", "detla"), "did you mean 'delta'?\n"),
        (("four-bar", "--minimise", "delta"), "no design variable; name one, e.g. --free flywheel.inertia="),
        (("hay-press", "--limit", "delta"), "is not a constraint"),
        (("hay-press", "--free", "speed"), "--free: 'speed': is not NAME=RANGE"),
        (("hay-press", "--free", "speed=300 to 200 rpm"), "speed: its bounds are"),
        (("hay-press", "--units", "furlong"), "furlong"),
        (("hay-press", "--solver", "simplex"), "'simplex' is not a solver"),
        (("no-such-scene",), "no such scene file"),
    ],
)
def test_what_cannot_be_asked(call, arguments, says):
    code, _, err = call(*arguments)
    assert code == 2
    assert says in err


def test_spelling_with_z_is_the_same_command(call, monkeypatch, capsys):
    """`analyze` and `optimize` exist, and are not listed."""
    for alias, command in (("analyze", "analyse"), ("optimize", "optimise")):
        code, said, _ = run(monkeypatch, capsys, alias, "--help")
        assert code == 0
        assert said.replace(alias, command) == run(monkeypatch, capsys, command, "--help")[1]
    listed = run(monkeypatch, capsys, "--help")[1]
    assert "analyse" in listed and "optimise" in listed and "analyze" not in listed and "optimize" not in listed
    code, _, err = run(monkeypatch, capsys, "optimize", "four-bar", "--minimise", "delta")
    assert code == 2 and "four-bar: free: there is no design variable" in err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("optimise", "hay-press", "--limit", "delta"), "hay-press: --limit: 'delta': is not a constraint; write e.g."),
        (("optimise", "hay-press", "--free", "speed=no"), "hay-press: --free: speed: is not a design variable; "),
        (("optimise", "hay-press", "--free", "speed=3 kg to 4 kg"), "hay-press: free: speed: '3 kg': a mass where a"),
        (("optimise", "hay-press", "--limit", "detla <= 1"), "hay-press: limits: detla: is neither a measure nor"),
        (("optimise", "hay-press", "--minimise", "detla"), "hay-press: minimise: detla: is neither a measure nor"),
        (("optimise", "elliptic-trammel", "--minimise", "min_transmission_angle", "--free", "speed=1 to 2 rad/s"),
         "elliptic-trammel: min_transmission_angle: does not exist for this machine"),
        (("show", "hay-press", "--units", "furlong"), "--units: \"furlong\": unknown unit 'furlong'; write units with"),
        (("analyse", "hay-press", "--set", "speed"), "hay-press: --set = \"speed\": is not KEY=VALUE; write e.g."),
    ],
)  # fmt: skip
def test_an_error_names_its_place(monkeypatch, capsys, arguments, says):
    """File or option, key, value, problem, remedy: one line."""
    code, _, err = run(monkeypatch, capsys, *arguments)
    assert code == 2 and err.startswith(says) and len(err.splitlines()) == 1


def interrupted(call, *arguments) -> dict:
    """The JSON of a call that is interrupted during its run."""
    code, told, _ = call(*arguments, "--json", "all.json")
    assert code == 130
    assert "Interrupted; this is the best design so far." in told
    data = json.loads(Path("all.json").read_text())
    assert data["result"]["name"] == "interrupted"
    return data


@pytest.mark.slow
def test_interrupted(call, scene, tmp_path, monkeypatch):
    """Ctrl-C in the second start: the best design so far is written, the exit code reports the interruption."""
    descend = _optimise.SOLVERS["cone"]
    seen = []

    def impatient(problem, z, **options):
        if seen:
            raise KeyboardInterrupt
        seen.append(descend(problem, z, **options))
        return seen[0]

    monkeypatch.setitem(_optimise.SOLVERS, "cone", impatient)
    monkeypatch.chdir(tmp_path)
    data = interrupted(call, scene, "--starts", "5")
    assert data["limits"]["delta"]["value"] == pytest.approx(0.02, rel=1e-8)
    assert data["objective"]["after"] == seen[0].point.blocks[0].value


@pytest.mark.slow
def test_interrupted_before_anything_is_found(call, scene, tmp_path, monkeypatch):
    """A design that meets the constraints was not yet reached; this does not show that the problem is infeasible."""

    def impatient(problem, z, *, callback, **options):
        point = look(problem, z)
        callback(point, certify(point))
        raise KeyboardInterrupt

    monkeypatch.setitem(_optimise.SOLVERS, "cone", impatient)
    monkeypatch.chdir(tmp_path)
    assert not interrupted(call, scene, "--limit", "delta <= 0.001")["limits"]["delta"]["met"]


@pytest.mark.slow
def test_ties_stay_with_another_range(call, scene, tmp_path):
    """The same with the changes of the section, which define the reported initial state."""
    changes = "optimise.changes={'links.rod.mass_properties' = 'scaled'}"
    tied = "optimise.free={'flywheel.inertia' = '0 to 50 kg m^2', 'links.rod.length' = "
    tied += "{ range = '± 20 %', linked = ['links.crank.length'] }}"
    options = ("--set", tied, "--set", changes, "--free", "links.rod.length=± 10 %", "--json", tmp_path / "all.json")
    code, told, _ = call(scene, *options)
    assert code == 0
    data = json.loads((tmp_path / "all.json").read_text())
    assert data["before_is"] == "the machine with the changes of its section [optimise]"
    assert f"before: {data['before_is']}" in told
    rod = data["variables"]["links.rod.length"]
    assert rod["upper"] == pytest.approx(0.44)
    crank = rod["linked"]["links.crank.length"]
    assert crank["after"] / crank["before"] == pytest.approx(rod["after"] / rod["before"])
    assert "linked: links.crank.length" in told


def test_a_folder_that_cannot_be_written_is_told_at_once(call, scene, tmp_path, monkeypatch):
    def refuse(dir):
        raise PermissionError(13, "Permission denied", str(dir))

    monkeypatch.setattr("linkjax.cli._options.tempfile.TemporaryFile", refuse)
    monkeypatch.setattr("linkjax.cli._optimise.solve", None)
    code, _, err = call(scene, "--out", tmp_path)
    assert code == 2
    assert "Permission denied" in err


@pytest.mark.slow
def test_a_real_signal(scene, tmp_path):
    """SIGINT to the running program, after its first start: the results so far are written."""
    command = [sys.executable, "-m", "linkjax", "optimise", str(scene), "--starts", "5000", "--json", "all.json"]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True, env=environment) as program:
        assert program.stdout is not None
        assert program.stdout.readline().startswith("start   1")
        program.send_signal(signal.SIGINT)
        told = program.stdout.read()
        assert program.wait(60) == 130
    assert "Interrupted; this is the best design so far." in told
    assert json.loads((tmp_path / "all.json").read_text())["limits"]["delta"]["value"] <= 0.02 * (1 + 1e-8)


def test_warnings_name_the_machine(capsys):
    """A machine that does not run before, and one whose checks fail afterwards."""
    stuck = {"checks": {"energy_closure": 0.0}, "precision": "float64", "result": {"code": 3, "message": "Stuck."}}
    wrong = {"checks": {"energy_closure": math.nan}, "precision": "float64", "result": {"code": 0, "message": ""}}
    print_warnings(stuck, Numbers(), "before")
    print_warnings(wrong, Numbers(), "after")
    before, after = capsys.readouterr().out.splitlines()
    assert before == "WARNING: before: Stuck."
    assert after.startswith("WARNING: after: a check is above")
