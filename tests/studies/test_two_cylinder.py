"""The study of the two-cylinder machine: the twelve positions by plain formulas, and the statements of its README."""

import itertools
import re

import numpy as np
import pytest

import linkjax as lj
from studies.two_cylinder import study

R, L, C, G = 0.06, 0.24, 0.09, 9.81
TEXT = (study.HERE / "README.md").read_text(encoding="utf-8").replace("−", "-")
ROWS = [row.strip("|").split("|") for row in re.findall(r"^\| \d+ \|.*\|$", TEXT, re.M)]


@pytest.fixture(scope="module")
def scene() -> lj.Scene:
    return lj.load("two-cylinder")


def reduced_torque(phi):
    """Of weights and forces, by the velocities of two slider-cranks at 180 degrees, upright."""
    torque = 0.0
    for angle in (phi, phi + np.pi):
        rod = np.sqrt(L**2 - (R * np.cos(angle)) ** 2)
        piston = R * np.cos(angle) + R**2 * np.cos(angle) * np.sin(angle) / rod
        centre = R * np.cos(angle) + (piston - R * np.cos(angle)) * C / L
        force = np.where(piston > 0, -2000.0, 300.0)
        torque = torque + force * piston - G * (4.0 * piston + 3.0 * centre)
    return torque


def test_twelve_positions(scene):
    """Reference: M_P = 85.837169, A = -539.330836, energies closing to zero."""
    ours = study.sums(scene)
    np.testing.assert_allclose(ours.resistance, reduced_torque(ours.angles), atol=1e-10)
    assert ours.drive == pytest.approx(85.8371685741072, abs=1e-8)
    assert ours.resistance_work[-1] == pytest.approx(-539.3308363947276, abs=1e-8)
    assert ours.energy[2] == pytest.approx(-36.238229611221996, abs=1e-8)
    assert abs(ours.energy[-1]) < 1e-10 and ours.resistance_work[0] == 0


def test_more_positions_come_to_the_exact_work(scene):
    """The error of the trapezoidal rule falls with the square of the step; the work is (2000 + 300)·0.12·2."""
    losses = [study.sums(scene, n).resistance_work[-1] + 552 for n in (12, 24, 48)]
    assert losses[0] / 552 == pytest.approx(0.02295, abs=1e-5)
    assert [a / b for a, b in itertools.pairwise(losses)] == pytest.approx([4, 4], rel=0.02)


@pytest.mark.slow
def test_the_readme(scene):
    coarse, fine = study.sums(scene), study.exact(scene)
    assert fine.resistance_work[-1] == pytest.approx(-552, rel=1e-10) and fine.drive == pytest.approx(276 / np.pi)
    for n, *told in [list(map(float, row)) for row in ROWS[:7]]:
        i = int(n)
        ours = (coarse.resistance[i], coarse.resistance_work[i], coarse.drive_work[i], coarse.energy[i])
        assert told == pytest.approx([*ours, fine.energy[60 * i]], abs=6e-5)
    for count, drive, work, error, span, off in ROWS[7:12]:
        each = study.sums(scene, int(count))
        assert [float(drive), float(work)] == pytest.approx([each.drive, each.resistance_work[-1]], abs=6e-7)
        assert float(error.strip(" %")) == pytest.approx(100 * (each.drive / fine.drive - 1), abs=6e-4)
        assert float(span) == pytest.approx(np.ptp(each.energy), abs=6e-5)
        assert float(off.strip(" %")) == pytest.approx(100 * (np.ptp(each.energy) / np.ptp(fine.energy) - 1), abs=2e-3)
