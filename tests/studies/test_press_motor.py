"""The study of motors for the hay press: its README, and torques by a line instead of the motor's curve."""

from __future__ import annotations

import re

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from studies.press_motor import study

TEXT = (study.HERE / "README.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in row.strip("|").split("|")] for row in re.findall(r"^\| \d+ kW.*\|$", TEXT, re.M)]


def number(cell: str) -> float:
    return float(cell.rstrip(" %"))


def test_the_motors_of_the_readme():
    """Slip, and the power that the press needs, from the type plates."""
    speed = jnp.asarray(study.SPEED)
    assert [row[0] for row in ROWS] == [plate.name for plate in study.PLATES]
    for plate, row in zip(study.PLATES, ROWS, strict=True):
        assert number(row[1]) == pytest.approx(100 * (1500 - plate.speed) / 1500, abs=0.05)
        motor = study.press(plate).motor
        assert motor is not None
        assert float(motor.motor_torque(speed)) == pytest.approx(plate.torque, rel=1e-12)  # at 700 rpm of the crank
        assert float(motor.motor_speed(speed)) == pytest.approx(plate.speed * study.RPM, rel=1e-12)
        mean = number(row[-1]) * 1e3 / (2 * np.pi) / (plate.speed * study.RPM / study.SPEED)
        assert (mean > plate.torque) == (row[2] == "none")  # no flywheel lowers the mean torque


@pytest.mark.slow
@pytest.mark.parametrize(("plate", "row"), [(study.PLATES[i], ROWS[i]) for i in (1, 2, 3)], ids=lambda x: x[0])
def test_the_least_flywheel(plate, row):
    """The constraint holds with equality, and less inertia violates it."""
    found = study.chosen(plate)
    assert found.enough and list(study.cells(found)) == row
    assert found.measures["rms_motor_torque"] == pytest.approx(plate.torque, rel=1e-7)
    less = study.measured(study.press(plate), 0.98 * found.flywheel)
    assert less["rms_motor_torque"] > plate.torque > 0 and less["delta"] > found.measures["delta"]


@pytest.mark.slow
def test_the_common_motor():
    """At the edge of the list; the small motor has no flywheel that is enough."""
    common, small = study.PLATES[0], study.PLATES[4]
    told = number(ROWS[0][2])
    assert study.measured(study.press(common), told + 0.1)["rms_motor_torque"] < common.torque
    assert study.measured(study.press(common), told - 0.1)["rms_motor_torque"] > common.torque
    assert not study.least_flywheel(small).feasible
    scene = lj.load("press-with-motor")
    assert float(scene.mechanism.flywheel.inertia) > number(ROWS[2][2])
