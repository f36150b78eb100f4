"""The random machines of the physics in MuJoCo, each at its own crank angle: positions by MuJoCo's constraints, drive
torques by its inverse dynamics.

They are those of `tests/physics/random_machines.py`: drivers that rotate, oscillate and slide, groups of every class,
gears, loads, some drawn by links and joints, also near a singular position. Newton's method closes them on MuJoCo's
own constraints, not its soft forces, so none near a singular position has to be omitted. The exception is a belt on a
crank that rotates fully: with its random radii it never returns to its initial position, and a `Scene` that is not
periodic in any number of turns is refused before the export. An oscillating crank drives the same belts.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import pytest

from tests.exchange.mujoco_road import check
from tests.physics.test_random_machines import ALONE, DESIGNS, IN_GEAR, IN_LOOPS, TOGETHER, Case

FIRST = 4  # designs of each composition
CASES = [case for case in (*ALONE, *TOGETHER, *IN_GEAR, *IN_LOOPS) if (case.kinds, case.driver) != (("belt",), "turns")]
QUICK = (TOGETHER[28], TOGETHER[29], TOGETHER[37], IN_GEAR[6])  # a driver that slides, and three that oscillate


@pytest.mark.parametrize("case", [c if c in QUICK else pytest.param(c, marks=pytest.mark.slow) for c in CASES], ids=str)
def test_random_machines(case: Case, figures):
    batch = case.batch(DESIGNS)
    for i in range(FIRST):
        check(jax.tree.map(jnp.asarray, batch.one(i)), f"{batch.name}, design {i}", figures, only=float(batch.phi[i]))


def test_there_are_as_many_as_promised():
    assert len(CASES) * FIRST >= 300
