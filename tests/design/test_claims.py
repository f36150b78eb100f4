"""What an independent review found wrong in the optimiser, each as a test."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import Case, Counterweight, DesignError, Vec, at_least, at_most
from linkjax.scenes import SceneError
from tests.design.test_optimise import AT, rotor

WHEEL = "flywheel.inertia"


def with_wheel(inertia: float) -> lj.Scene:
    return lj.load("slider-crank", {WHEEL: inertia})


@pytest.mark.parametrize("start", [1e-7, 1e-3, 0.35])
def test_a_start_that_happens_to_be_small_is_no_measure(start):
    """A tiny flywheel at the start must not make the limit on δ seem out of reach."""
    found = lj.optimise(with_wheel(start), {WHEEL: "0 to 4 kg m^2"}, WHEEL, limits=["delta <= 0.02"])
    assert found.feasible
    assert found.objective == pytest.approx(float(lj.flywheel_for(with_wheel(start), 0.02)), rel=1e-7)
    assert found.kkt_residual <= 1e-6


def test_a_start_that_happens_to_be_large_is_none_either():
    """A wall of 1e10 at the start hides what is left to gain; the certificate is relative to the objective found."""

    def walled(scene):
        x = scene.mechanism.flywheel.inertia
        return 1 + (x - 3) ** 2 + 1e10 * jnp.maximum(x - 9, 0.0) ** 2

    scene = rotor()
    scene = scene.with_mechanism(dataclasses.replace(scene.mechanism, flywheel=lj.Flywheel(9.9)))
    found = lj.optimise(scene, {WHEEL: (0.0, 10.0)}, walled)
    assert found.objective == pytest.approx(1.0, abs=1e-6)
    assert found.kkt_residual <= 1e-6


def test_a_weight_without_mass_on_the_wrong_side():
    """Its place has no effect and a little mass does harm, so that the conditions of an optimum hold; it is none."""
    scene = rotor()
    crank = scene.mechanism.links["crank"]
    weight = Counterweight(0.0, Vec(0.03, 0.0), thickness=0.02, density=7850.0)
    crank = dataclasses.replace(crank, counterweights={"W": weight})
    scene = scene.with_mechanism(dataclasses.replace(scene.mechanism, links={"crank": crank}))
    free = {f"{AT}.along": "-100 to 100 mm", f"{AT}.across": "-100 to 100 mm"}
    free[f"{AT.removesuffix('.at')}.mass"] = "0 to 3 kg"
    found = lj.optimise(scene, free, "peak_shaking_force_constant_speed")
    assert found.objective < 1e-6 * found.objective_before


def test_what_is_no_number_is_no_optimum():
    """A limit that is NaN is not met; an objective that is NaN, or a slope without bound, ends a start and no more."""
    free = {WHEEL: (0.0, 2.0)}
    found = lj.optimise(rotor(), free, WHEEL, limits=[at_most(lambda s: s.speed * jnp.nan, 1.0, name="nothing")])
    assert not found.feasible
    assert found.clash == ("nothing",)
    lost = lj.optimise(rotor(), free, lambda s: jnp.log(s.mechanism.flywheel.inertia - 3), starts=2)
    assert not np.isfinite(lost.kkt_residual)
    steep = lj.optimise(rotor(), free, maximise=lambda s: jnp.sqrt(s.mechanism.flywheel.inertia))
    assert steep.objective == pytest.approx(np.sqrt(2.0), rel=1e-9)


@pytest.mark.parametrize(("low", "high", "side"), [(2.0, 4.0, "lower"), (0.0, 2.0, "upper")])
def test_prices_of_bounds(low, high, side):
    """What the objective gains as the bound gives way, at either end: (x - 1)² or (x - 3)², whichever side holds."""
    best = 1.0 if side == "lower" else 3.0
    found = lj.optimise(rotor(), {WHEEL: (low, high)}, lambda s: (s.mechanism.flywheel.inertia - best) ** 2)
    assert found.x == pytest.approx([2.0])
    assert found.pull[WHEEL] == pytest.approx(2.0, rel=1e-6)


def test_the_clash_is_named_where_the_objective_does_not_care():
    """Two limits against each other, an objective with nothing to do with either."""
    limits = [at_least(lambda s: s.mechanism.flywheel.inertia, 1.5, name="heavy"), at_most(WHEEL, 1.0)]
    found = lj.optimise(rotor(), {WHEEL: (0.0, 2.0), f"{AT}.along": (-0.1, 0.1)},
                        "peak_shaking_force_constant_speed", limits=limits)  # fmt: skip
    assert not found.feasible
    assert set(found.clash) == {"heavy", WHEEL}


def test_limits_of_one_name_are_told_apart():
    two = [at_least(lambda s: s.mechanism.flywheel.inertia, 0.5), at_least(lambda s: s.speed, 1.0)]
    found = lj.optimise(rotor(), {WHEEL: (0.0, 2.0)}, WHEEL, limits=two)
    assert found.limits["lambda 1"].multiplier == pytest.approx(1.0)
    assert "lambda 2" in found.limits


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"limits": ["delta <= 0.1", "delta <= 0.2"]}, "delta: is limited 2 times"),
        ({"cases": [Case("a"), Case("a")]}, "cases: two have the name 'a'"),
        ({"cases": [Case("a", {"speed": "-3 rpm"})]}, "speed: must not be less than 0"),
        ({"seed": -1}, "seed: is -1; write a whole number of zero or more"),
        ({"free": {WHEEL: "-2 to 4 kg m^2"}}, "must not be less than 0, but its bounds begin at -2"),
        ({"free": {"links.piston.length": (0.0, 1.0)}}, "links.piston.length: is no number of this scene"),
    ],
)
def test_refused(change, says):
    asked = {"free": {WHEEL: (0.0, 2.0)}, "minimise": "delta", **change}
    with pytest.raises(DesignError, match=says):
        lj.optimise(lj.load("slider-crank"), **asked)


def test_changes_by_hand_come_last():
    """`[optimise.changes]` makes the scene, `--set` and `load_task(changes)` change that."""
    rod = "links.rod.length"
    scene, _ = lj.load_task("hay-press", {rod: "1.1 m", "links.link4.mass_properties": "fixed", "optimise.starts": 3})
    assert float(scene.mechanism.links["rod"].actual().mass) == pytest.approx(15 * 1.1 / 1.02)
    assert scene.mechanism.links["link4"].mass_properties == "fixed"
    weight = "links.crank.counterweights.W1.mass"
    scene, asked = lj.load_task("hay-press", {weight: "5 kg", "optimise.starts": 3})
    assert float(scene.mechanism.links["crank"].counterweights["W1"].mass) == 5.0
    assert asked["starts"] == 3
    with pytest.raises(SceneError, match="an angle without a unit"):
        lj.load_task("hay-press", {"optimise.free": {"loads.hay.window.on": [80, 100]}})
