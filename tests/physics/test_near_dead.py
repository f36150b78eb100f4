"""Errors of position, coefficients, reactions and gradients at 1e-2 … 1e-14 of a length from a singular position."""

import math

import numpy as np
import pytest

from tests.physics.near_dead import CASES, PASSING, judged

DISTANCES = (1e-2, 1e-8, 1e-14)
QUICK = ("stretched", "parallel")


@pytest.mark.parametrize("case", [c if c in QUICK else pytest.param(c, marks=pytest.mark.slow) for c in CASES])
def test_errors_grow_as_the_condition_of_the_problem_does(case):
    """At most ten times the effect of half a rounding unit in every number of the design and in the result."""
    for distance in DISTANCES:
        for part, found in judged(case, distance).items():
            assert found.excess() <= 10, (distance, part)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_at_every_power_of_ten(case):
    """The same, and the growth of the condition number: the height of a dyad's intersection is the root of the
    distance, rates are over that height and its powers; the intersection of two lines is over the distance itself."""
    conditions = []
    for exponent in range(2, 15):
        found = judged(case, 10.0**-exponent)
        assert max(each.excess() for each in found.values()) <= 10, exponent
        conditions.append([np.max(found[part].condition) for part in ("position", "coefficients", "reactions")])
    growth = [math.log10(b / a) / 4 for a, b in zip(conditions[5], conditions[9], strict=True)]
    powers = {"pivot": (1.0, 3.0, 4.0), "parallel": (2.0, 4.0, 5.0)}
    assert growth == pytest.approx(powers.get(case, (0.5, 2.5, 3.0)), abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("case", PASSING)
@pytest.mark.parametrize("exponent", [e if e == 10 else pytest.param(e, marks=pytest.mark.slow) for e in range(2, 15)])
def test_general_groups_pass_a_dead_position(case, exponent):
    """The same for a dyad closed by Newton's method, while the crank moves it past the position."""
    for part, found in judged(case, 10.0**-exponent).items():
        assert found.excess() <= 10, part
