"""Random machines in MuJoCo: positions by its constraints, drive torques by its inverse dynamics."""

from __future__ import annotations

import pytest

from tests.exchange.compositions import composed
from tests.exchange.mujoco_road import check

QUICK = {7: 3, 20: 4, 30: 2, 35: 4, 38: 4}  # compositions, with their number of groups
MORE = {36: 2, 3: 2, 6: 2, 9: 2, 13: 3, 18: 2, 24: 2, 39: 2}
DESIGNS = range(5)


@pytest.mark.parametrize("composition", [*QUICK, *(pytest.param(c, marks=pytest.mark.slow) for c in MORE)])
def test_random_machines(composition, figures):
    for design in DESIGNS:
        scene = composed(composition, design, (QUICK | MORE)[composition])
        check(scene, scene.title, figures)
