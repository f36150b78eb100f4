"""The demo: the hay press optimised, its starts, its certificate, and the optimum recomputed by other methods."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.measures import (
    delta,
    evaluate,
    min_margin,
    min_transmission_angle,
    peak_shaking_force_constant_speed,
    steady_state_margin,
)
from linkjax.motion import steady_by_diffrax
from linkjax.scenes import loads_text, text_of

FEASIBLE = 1e-8


@pytest.fixture(scope="module")
def best():
    scene, asked = lj.load_problem("hay-press")
    return lj.optimise(scene, **asked)


def test_starts_agree_and_are_certified(best):
    """At least eight of ten reach the best within 1e-6, none ends in an exception or NaN; optimality is certified."""
    assert best.feasible
    assert len(best.starts) == 10
    assert best.starts_at_optimum >= 8
    assert best.kkt_residual <= 1e-6
    assert np.isfinite([(start.objective, start.residual) for start in best.starts]).all()
    assert best.objective < 0.35 * best.objective_before


@pytest.mark.slow
def test_the_optimum_by_other_roads(best):
    """Read back from a file, with 640 nodes and by the equation of motion: every constraint holds to 1e-8."""
    after = loads_text(text_of(best.after))
    fine = (delta, peak_shaking_force_constant_speed, min_transmission_angle, min_margin, steady_state_margin)
    found = {name: float(v) for name, v in compiled_soon(lambda s: evaluate(s, fine, 640))(after).items()}
    assert found["peak_shaking_force_constant_speed"] == pytest.approx(best.objective, rel=FEASIBLE)
    assert found["delta"] <= 0.15 * (1 + FEASIBLE)
    assert found["delta"] == pytest.approx(best.limits["delta"].value, rel=FEASIBLE)
    initial = float(compiled_soon(min_transmission_angle)(best.before))
    assert found["min_transmission_angle"] >= initial * (1 - FEASIBLE)
    assert found["min_margin"] > 0
    assert found["steady_state_margin"] > 0
    assert float(after.mechanism.flywheel.inertia) <= 19.23 * (1 + FEASIBLE)
    integrated = compiled_soon(steady_by_diffrax)(after)
    assert float(integrated.delta) <= 0.15 * (1 + FEASIBLE)
    assert float(integrated.delta) == pytest.approx(found["delta"], rel=1e-7)


def test_smaller_flywheels_cost_force(best):
    """Three points, each feasible, the force grows as the flywheel decreases; the first below the constraint itself."""
    bounds = [point.bound for point in best.trade_off]
    forces = [best.objective, *(point.objective for point in best.trade_off)]
    assert bounds == [12.0, 10.0, 8.0]
    assert all(point.feasible for point in best.trade_off)
    assert all(a <= b * (1 + 1e-9) for a, b in itertools.pairwise(forces))
    for point in best.trade_off:
        names = [v.name for v in best.problem.variables]
        assert dict(zip(names, point.x, strict=True))["flywheel.inertia"] <= point.bound * (1 + FEASIBLE)


@pytest.mark.slow
def test_no_feasible_design():
    """δ ≤ 1e-4 with a flywheel of at most 1 kg m²: this and the conflicting constraints are reported."""
    scene, asked = lj.load_problem("hay-press")
    asked |= {"limits": ["delta <= 1e-4", "flywheel.inertia <= 1 kg m^2"], "starts": 1, "trade_off": None}
    found = lj.optimise(scene, **asked)
    assert not found.feasible
    assert set(found.conflicts) == {"delta", "flywheel.inertia"}
    assert math.isfinite(found.objective)
