"""The study of rolling bodies: the rings and bodies in its README, checked by distances between centres."""

import re

import numpy as np
import pytest

from linkjax.rolling import chain
from studies.rolling import study
from tests.rolling.walk import walk

TEXT = (study.HERE / "README.md").read_text(encoding="utf-8")
NUMBERS = [tuple(map(float, row.strip("|").split("|"))) for row in re.findall(r"^\|[ \d.|]+\|$", TEXT, re.M)]
COURSE, RINGS = NUMBERS[:6], NUMBERS[6:]


@pytest.mark.parametrize("row", COURSE, ids=str)
def test_rows_of_the_course_close(row):
    """Rounded to 1e-5 mm: the walk around ends equally near its beginning, with the printed sizes."""
    e, outer, largest, smallest = row
    steps = walk(40.0, outer, e, 0.0, 9)
    assert abs(float(steps[-1][0]) - 2 * np.pi) < 1e-5
    sizes = [float(size) for _, size in steps]
    assert (max(sizes), min(sizes)) == pytest.approx((largest, smallest), abs=1.1e-5)


@pytest.mark.parametrize("row", RINGS, ids=str)
def test_rows_of_rings_hold_the_wanted_bodies(row):
    bodies, inner, outer, e = row
    steps = walk(inner, outer, e, 0.0, int(bodies) + 1)
    assert abs(float(steps[-1][0]) - 2 * np.pi) < 1e-5
    sizes = [float(size) for _, size in steps]
    assert (max(sizes), min(sizes)) == pytest.approx((27.0, 22.0), abs=2e-5)


def test_the_program_finds_them():
    design = study.asked(7)
    told = next(row for row in RINGS if row[0] == 7)
    found = [1e3 * float(x) for x in (design.inner_radius, design.outer_radius, design.eccentricity)]
    assert found == pytest.approx(told[1:], abs=6e-6)
    radii = np.asarray(chain(design).radii)
    assert (radii.max(), radii.min()) == pytest.approx((study.LARGEST, study.SMALLEST), abs=1e-12)
