"""The study of the hay press: its first table, and that its README agrees with the repository."""

import pytest

import linkjax as lj
from studies.hay_press import study

ROWS = study.compared(lj.load("hay-press"))


@pytest.mark.parametrize(("name", "ours", "printed", "within"), ROWS, ids=[row[0] for row in ROWS])
def test_what_the_thesis_prints(name, ours, printed, within):
    assert abs(float(ours) - printed) <= within


def test_every_printed_number_is_compared():
    values = [study.PRINTED[order]["values"] for order in ("positions", "first", "second", "rates")]
    printed = [v for table in values for pair in table.values() for v in pair if v is not None]
    assert sorted(row[2] for row in ROWS[:-1]) == sorted(printed)


def test_what_is_asked():
    scene, asked = lj.load_problem("hay-press")
    assert asked["minimise"] == "peak_shaking_force_constant_speed" and len(asked["free"]) == 10
    assert set(scene.mechanism.links["crank"].counterweights) == {"W1"}
