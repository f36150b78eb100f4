"""Machines by name in MuJoCo: positions by its constraints, drive torques by its inverse dynamics."""

from __future__ import annotations

import pytest

from tests.exchange.mujoco_road import check
from tests.library.examples import MADE, scene


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name == "scissor_lift")) for name in MADE]
)
def test_machines_of_the_library(name, figures):
    check(scene(name), name, figures)
