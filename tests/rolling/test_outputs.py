"""The document, figures, report and commands of rolling bodies."""

from __future__ import annotations

import csv
import json
import sys
from typing import Any

import numpy as np
import pytest
from matplotlib.patches import Circle
from PIL import Image

import linkjax as lj
from linkjax.analysis import plain
from linkjax.cli import main
from linkjax.report import write_rolling_report
from linkjax.rolling import closing_outer_radius, document
from linkjax.viz import bodies_figure, rolling_figure, write_rolling_figures
from tests.helpers import ROOT

GOLDEN = json.loads((ROOT / "tests/data/golden.json").read_text(encoding="utf-8"))["rolling.emk_e5"]


@pytest.fixture(scope="module")
def data():
    return document(lj.load_rolling("rolling-eccentric"), 36, "rolling-eccentric")


@pytest.fixture
def call(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["linkjax", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            main()
        out, err = capsys.readouterr()
        return stopped.value.code or 0, out, err

    return run


def test_the_document(data):
    assert list(data)[:3] == ["scene", "title", "kind"] and data["result"]["code"] == 0
    np.testing.assert_allclose(data["bodies"]["radius"], np.array(GOLDEN["ball_r"]) / 1e3, rtol=0, atol=1e-12)
    assert data["rings"]["outer_radius"] == pytest.approx(GOLDEN["Rn"] / 1e3, abs=1e-12)
    assert data["limits"]["closing_eccentricity"] == pytest.approx(5e-3, rel=1e-9)
    assert data["limits"]["max_radius"] == pytest.approx(GOLDEN["ball_r"][0] / 1e3, rel=1e-12)
    assert data["checks"]["contacts"] < 1e-14
    assert json.loads(json.dumps(plain(data), allow_nan=False))["bodies"]["x"] == data["bodies"]["x"].tolist()


def test_the_path_of_the_document_is_a_chain_at_every_angle(data):
    path, rings, radii = data["path"], data["rings"], data["bodies"]["radius"][:, None]
    near = np.hypot(path["x"] - path["inner"]["x"], path["y"] - path["inner"]["y"])
    far = np.hypot(path["x"] - path["outer"]["x"], path["y"] - path["outer"]["y"])
    assert path["x"].shape == (8, 36) == path["body_angles"].shape
    assert np.abs(near - rings["inner_radius"] - radii).max() < 1e-15 * 4
    assert np.abs(far - rings["outer_radius"] + radii).max() < 1e-15 * 4
    assert np.ptp(path["outer"]["x"]) < 1e-16 < np.ptp(path["inner"]["x"])  # the outer ring is fixed
    assert path["carrier"][-1] == pytest.approx(2 * np.pi * 35 / 36)
    backwards = document(lj.load_rolling("rolling-eccentric", {"rotation": "cw"}), 36)
    np.testing.assert_allclose(backwards["path"]["carrier"], -path["carrier"], rtol=1e-14)
    np.testing.assert_array_equal(backwards["angles"], data["angles"])


def test_a_chain_that_does_not_close_says_so_in_its_document():
    design = lj.Rolling(0.04, 0.08, 3)
    found = document(lj.RollingMachine(design), 4)
    assert found["result"]["name"] == "cannot_be_assembled" and "leaves a gap" in found["result"]["message"]
    assert found["limits"]["min_clearance"] is None and found["limits"]["closing_eccentricity"] is None
    assert found["limits"]["closing_outer_radius"] == float(closing_outer_radius(0.04, 3))


def test_figures(data, tmp_path):
    files = write_rolling_figures(data, tmp_path, "in")
    assert [file.name for file in files] == ["rolling.png", "rolling.svg", "bodies.png", "bodies.svg"]
    again = write_rolling_figures(data, tmp_path / "again", "in")
    assert [file.read_bytes() for file in files] == [file.read_bytes() for file in again]
    text = files[1].read_text(encoding="utf-8")
    assert "1.0815 in" in text and "Eccentric rolling mechanism" in text  # 27.470 mm
    (ax,) = rolling_figure(data).axes
    circles = sorted(round(patch.radius, 12) for patch in ax.patches if isinstance(patch, Circle))
    for radius in (*data["bodies"]["radius"], data["rings"]["inner_radius"], data["rings"]["outer_radius"]):
        assert round(float(radius), 12) in circles
    curve: Any = bodies_figure(data).axes[0].lines[0]
    np.testing.assert_allclose(np.interp(np.degrees(data["bodies"]["angle"]), *curve.get_data()),
                               1e3 * data["bodies"]["radius"], rtol=1e-4)  # fmt: skip


def test_animation(data, tmp_path):
    with Image.open(lj.viz.animate_rolling(data, tmp_path / "machine.gif")) as picture:
        assert getattr(picture, "n_frames", 1) > 30
        first = np.asarray(picture.convert("L"), int)
        picture.seek(20)
        assert (np.abs(np.asarray(picture.convert("L"), int) - first) > 40).mean() > 0.02


def test_the_report_holds_everything_and_escapes(data, tmp_path):
    text = write_rolling_report(data | {"title": "<b>x</b>"}, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "&lt;b&gt;x&lt;/b&gt;" in text and "<b>x" not in text
    for told in ("27.4699911 mm", "89.9399821 mm", "The chain closes.", "300.000 rpm", "47.565°"):
        assert told in text
    assert "http://" not in text and "https://" not in text.replace("http://www.w3.org", "")


def test_analyse(call, tmp_path):
    code, out, _ = call(
        "analyse", "rolling-eccentric", "--out", tmp_path, "--json", tmp_path / "a.json", "--csv", tmp_path
    )
    assert code == 0 and "89.9399821 mm" in out and "8 rolling bodies between two rings" in out
    names = {"rolling.png", "rolling.svg", "bodies.png", "bodies.svg", "machine.gif", "report.html"}
    assert {path.name for path in tmp_path.iterdir()} == {*names, "a.json", "bodies.csv", "path.csv"}
    found = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    with (tmp_path / "bodies.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["radius"]) for row in rows] == found["bodies"]["radius"]
    with (tmp_path / "path.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for name in ("bodies.csv", "path.csv"):
        heading = (tmp_path / name).read_text(encoding="utf-8").splitlines()[0]
        assert np.genfromtxt(tmp_path / name, delimiter=",", names=True).dtype.names == tuple(heading.split(","))
    assert len(rows) == 360 and float(rows[90]["x_3"]) == found["path"]["x"][2][90]


def test_units_and_changes(call):
    code, out, _ = call("analyse", "rolling-eccentric", "--set", 'inner_radius="2 in"', "--units", "in,rad/s")
    assert code == 0 and "2.00000000 in" in out and "31.4159 rad/s" in out
    code, out, _ = call("analyse", "rolling-eccentric", "--set", "bodies=7", "--set", "turns=2")
    assert code == 0 and "overlap in the plane" in out


def test_chains_that_do_not_close_end_with_one(call, tmp_path):
    code, out, err = call(
        "analyse", "rolling-eccentric", "--set", 'outer_radius="95 mm"', "--json", tmp_path / "a.json"
    )
    assert code == 1 and out == "" and "does not close" in err
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["result"]["code"] == 5


@pytest.mark.parametrize("option", [("--at", "30"), ("--constant-speed",), ("--nodes", "48"), ("--method", "diffrax")])
def test_options_without_a_meaning_are_refused(call, option):
    code, _, err = call("analyse", "rolling-eccentric", *option)
    assert code == 2 and f"{option[0]}: is not available for rolling bodies; omit it" in err


def test_other_commands(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "rolling-prototype" in call("scenes")[1]
    code, out, _ = call("show", "rolling-eccentric")
    assert code == 0 and "5.00000000 mm between the centres" in out and "inner ring at 300 rpm, outer ring held" in out
    assert call("new", "mine", "--kind", "rolling")[0] == 0
    assert lj.load_rolling("mine.toml").title == "mine"
    assert json.loads(call("schema", "--kind", "rolling")[1])["title"] == "linkjax scene of rolling bodies"
    code, _, err = call("optimise", "rolling-eccentric")
    assert code == 2 and "where a linkage is needed" in err
