"""The optimiser on other machines: the same code, no special cases."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.measures import delta, min_transmission_angle, peak_shaking_force_constant_speed
from tests.physics.machines import composed_at_random

WEIGHT = lj.Counterweight(2.0, lj.Vec(-0.05, 0.0), 0.01)


def weighted(scene: lj.Scene) -> lj.Scene:
    """The scene with a counterweight on its crank."""
    m = scene.mechanism
    crank = dataclasses.replace(m.links["crank"], counterweights={"W": WEIGHT})
    return scene.with_mechanism(dataclasses.replace(m, links={**m.links, "crank": crank}))


SLOW = [
    pytest.param(machine, marks=pytest.mark.slow) for machine in ("slider-crank", "four-bar", "quick-return", 0, 1, 3)
]


@pytest.mark.parametrize("machine", SLOW)
def test_optimised(machine):
    """Lengths of all bars and the counterweight against the shaking force; δ and transmission at least as initially."""
    scene = composed_at_random(machine) if isinstance(machine, int) else weighted(lj.load(machine))
    bars = [name for name, link in scene.mechanism.links.items() if float(link.length) > 0 and name != "crank"]
    free = {f"links.{name}.length": "± 5 %" for name in bars}
    at = "links.crank.counterweights.W.at"
    free |= {f"{at}.along": (-0.2, 0.2), f"{at}.across": (-0.2, 0.2)}
    limits = ["delta <= initial", "min_transmission_angle >= initial"]
    found = lj.optimise(scene, free, "peak_shaking_force_constant_speed", limits=limits, starts=3)
    assert found.feasible
    assert np.isfinite([(start.objective, start.residual) for start in found.starts]).all()
    assert found.kkt_residual <= 1e-6
    assert found.objective < 0.999 * found.objective_before
    measured = compiled_soon(lambda scene: [m(scene, 160) for m in MEASURES])
    before, after = ([float(value) for value in measured(each)] for each in (found.before, found.after))
    assert after[0] == pytest.approx(found.objective, rel=1e-7)
    assert before[0] == pytest.approx(found.objective_before, rel=1e-7)
    assert after[1] <= before[1] * (1 + 1e-7)
    assert after[2] >= before[2] * (1 - 1e-7)


MEASURES = (peak_shaking_force_constant_speed, delta, min_transmission_angle)
