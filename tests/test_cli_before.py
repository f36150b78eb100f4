"""An optimisation of a machine that does not run or cannot be assembled: every place shows the same numbers."""

from __future__ import annotations

import contextlib
import io
import json
import re
from html import unescape

import pytest

from linkjax import cli
from linkjax._display import NONE, in_words
from linkjax.cli._console import console
from tests.helpers import PUMP

LIGHT = (
    """
title = "Pump without flywheel"
speed = "100 rpm"
fixed = { O = [0, 0] }
[links.crank]
length = "0.1 m"
inertia = "0.001 kg m^2"
[links.rod]
length = "0.4 m"
[links.piston]
mass = "0.1 kg"
"""
    + PUMP
    + """[optimise]
minimise = "delta"
free = { "flywheel.inertia" = "0 to 20 kg m^2" }
limits = ["max_crank_speed <= 1000 rpm", "min_transmission_angle >= 5 deg"]
"""
)
SHORT = LIGHT.replace('length = "0.4 m"', 'length = "0.09 m"').replace(
    'free = {', 'free = { "links.rod.length" = "80 to 500 mm", '
)  # fmt: skip
MOTION = {"delta", "max_crank_speed", "min_crank_speed", "min_inertia_ratio", "mean_drive_torque", "peak_shaking_force",
          "peak_reaction"}  # fmt: skip


@pytest.fixture(scope="module", params=["light", "short"])
def made(request, tmp_path_factory):
    """Which machine, output of the command, its JSON document, the table rows of its report, and the
    optimised scene file."""
    folder = tmp_path_factory.mktemp(request.param)
    (folder / "pump.toml").write_text({"light": LIGHT, "short": SHORT}[request.param])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("linkjax.viz.write_figures", lambda *_, **__: [])
        patch.setattr("linkjax.viz.animate", lambda *_, **__: None)
        command = ["linkjax", "optimise", str(folder / "pump.toml"), "--nodes", "24", "--out", str(folder)]
        patch.setattr("sys.argv", command)
        code, out = _run(patch)
    assert code == 0, out
    page = (folder / "report.html").read_text()
    rows = [[unescape(re.sub("<.*?>", "", cell)) for cell in re.findall("<t[hd].*?</t[hd]>", row)]
            for row in re.findall("<tr>.*?</tr>", page)]  # fmt: skip
    scene = (folder / "optimised.toml").read_text()
    return request.param, out, json.loads((folder / "optimum.json").read_text()), rows, scene


def _run(patch) -> tuple[int, str]:
    out = io.StringIO()
    patch.setattr(console, "_file", out)
    patch.setattr(console, "width", 160)
    with contextlib.redirect_stderr(out), pytest.raises(SystemExit) as stopped:
        cli.main()
    return int(stopped.value.code or 0), out.getvalue()


@pytest.mark.slow
def test_one_number_for_one_thing(made):
    """What does not exist is null in every part of the document and a dash in every table."""
    which, out, data, rows, scene = made
    exists = {"min_margin"} if which == "short" else set(data["before"]) - MOTION
    before = data["before"]
    assert {name for name, value in before.items() if value is not None} == exists
    assert (data["objective"]["name"], data["objective"]["before"]) == ("delta", None)
    assert data["history"][0]["objective"] is None
    assert None not in data["after"].values()
    for name, limit in data["limits"].items():
        assert (limit["before"] is None) == (name not in exists), name
        if name in exists:
            assert limit["before"] == pytest.approx(before[name], rel=1e-9)
    said = [line.split() for line in out.splitlines()]
    for name in before:
        printed = [line[line.index(name) + 1] for line in said if name in line[:2] and len(line) > 2]
        assert len(set(printed)) == 1 and printed.count(NONE) == (0 if name in exists else len(printed)), name
        told = [row[1] for row in rows if row[0] == in_words(name) and len(row) > 3]
        assert told and {cell == NONE for cell in told} == {name not in exists}, name
    results = {row[0]: row[1] for row in rows if len(row) == 4}
    assert results["coefficient of speed fluctuation δ"] == results["max crank speed"] == NONE
    assert "WARNING: before: " in out
    assert "\n# delta: – -> " in scene
