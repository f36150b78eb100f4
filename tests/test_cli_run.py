"""The command `run`: its table, files and exit codes."""

from __future__ import annotations

import json
import math

import pytest
from PIL import Image

from tests.test_cli import call as call
from tests.test_cli import run as run

SCENE = """
title = "Fan"
speed = "400 rpm"

[fixed]
O = [0, 0]

[links.shaft]
length = "100 mm"
inertia = "0.06 kg m^2"

[[groups]]
kind = "crank"
link = "shaft"
pivot = "O"
end = "E"

[[loads]]
name = "brake"
link = "shaft"
torque = "0.3 N m"
opposing = true
"""
MOTOR = """
[motor]
kind = "line"
no_load_speed = "400 rpm"
stall_torque = "3 N m"
"""


@pytest.fixture
def fan(tmp_path):
    path = tmp_path / "fan.toml"
    path.write_text(SCENE + MOTOR, encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_run_up(call, fan, tmp_path):
    """Shown, as JSON, and drawn; in closed form ω = ω_end (1 - exp(-k t / J)), k = T_stall / ω_0."""
    out = tmp_path / "out"
    code, text, err = call("run", fan, "--out", out, "--json", tmp_path / "run.json")
    assert (code, err) == (0, "")
    assert "run-up time" in text
    assert "starting-torque margin   +900.0 %" in text
    data = json.loads((tmp_path / "run.json").read_text())
    rate = 3.0 / (400 * math.pi / 30) / 0.06
    assert data["run_up_time"] == pytest.approx(math.log(100) / rate, rel=1e-8)
    assert data["speed"][-1] == pytest.approx(360 * math.pi / 30 * (1 - math.exp(-rate * data["time"][-1])), rel=1e-8)
    assert data["energies"]["error"] < 1e-8
    for name in ("run-speed", "run-torque", "run-characteristic"):
        assert (out / f"{name}.png").stat().st_size > 1000
        assert (out / f"{name}.svg").stat().st_size > 1000
    with Image.open(out / "machine.gif") as film:
        frames = getattr(film, "n_frames", 1)
        played = frames * film.info["duration"] / 1000
    assert played == pytest.approx(data["time"][-1], abs=0.005 * frames)  # a film counts in hundredths of a second


@pytest.mark.slow
def test_a_run_down(call, fan):
    """From the speed of the scene by default: J omega / M = 8.38 s."""
    code, text, _ = call("run", fan, "--motor-off")
    assert code == 0
    assert "standstill               at 10053.096° after 8.3776 s" in text
    code, text, _ = call("run", fan, "--motor-off", "--from-speed", "200 rpm", "--start-angle", "90")
    assert code == 0
    assert "standstill               at 2603.274° after 4.1888 s" in text


@pytest.mark.slow
def test_a_machine_that_does_not_start(call, fan):
    code, text, _ = call("run", fan, "--set", 'motor.stall_torque="0.2 N m"', "--time", "1")
    assert code == 1
    assert "WARNING: the machine does not start" in text
    code, text, _ = call("run", fan, "--set", 'motor.stall_torque="0.2 N m"', "--time", "13", "--from-speed", "300 rpm")
    assert code == 1
    assert "WARNING: the machine stalls" in text


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--from-speed", "300"], '--from-speed: "300": is a speed without a unit; write e.g. "300 rpm"'),
        (["--from-speed", "-1 rad/s"], "start_speed"),
        (["--start-angle", "up"], "--start-angle"),
        (["--time", "-1"], "time: is -1.0; write a number above zero"),
        (["--time", "1", "--cycles", "2"], "give one of them"),
    ],
)
def test_bad_input(call, fan, options, text):
    code, _, err = call("run", fan, *options)
    assert code == 2
    assert text in err


def test_rolling_bodies_are_refused(call):
    code, _, err = call("run", "rolling-eccentric")
    assert code == 2
    assert "rolling bodies" in err
