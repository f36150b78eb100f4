"""Errors of the optimiser found by an independent review, each as a test."""

from __future__ import annotations

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import Case, Counterweight, DesignError, Vec, at_least, at_most
from linkjax.design import as_rows, changed, outcome, settled
from linkjax.design._problem import Kind
from linkjax.scenes import SceneError
from tests.design.test_optimise import AT, rotor

WHEEL = "flywheel.inertia"


def with_wheel(inertia: float) -> lj.Scene:
    return lj.load("slider-crank", {WHEEL: inertia})


@pytest.mark.slow
@pytest.mark.parametrize("start", [1e-7, 1e-3, 0.35])
def test_a_start_that_happens_to_be_small_is_no_measure(start):
    """A tiny flywheel at the start must not make the constraint on δ seem infeasible."""
    found = lj.optimise(with_wheel(start), {WHEEL: "0 to 4 kg m^2"}, WHEEL, limits=["delta <= 0.02"])
    assert found.feasible
    assert found.objective == pytest.approx(float(lj.flywheel_for(with_wheel(start), 0.02)), rel=1e-7)
    assert found.kkt_residual <= 1e-6


def test_a_start_that_happens_to_be_large_is_none_either():
    """A value of 1e10 at the start hides the possible gain; the certificate is relative to the final objective."""

    def walled(scene):
        x = scene.mechanism.flywheel.inertia
        return 1 + (x - 3) ** 2 + 1e10 * jnp.maximum(x - 9, 0.0) ** 2

    scene = rotor()
    scene = scene.with_mechanism(dataclasses.replace(scene.mechanism, flywheel=lj.Flywheel(9.9)))
    found = lj.optimise(scene, {WHEEL: (0.0, 10.0)}, walled)
    assert found.objective == pytest.approx(1.0, abs=1e-6)
    assert found.kkt_residual <= 1e-6


@pytest.mark.parametrize(
    ("mass", "at"), [(0.0, (0.03, 0.0)), (0.5, (0.1, 0.1)), (0.5, (0.09, 0.05)), (0.0, (0.0, 0.0))]
)
def test_a_weight_without_mass_on_the_wrong_side(mass, at):
    """Its position has no effect and a small mass is harmful, so the optimality conditions hold without an optimum. A
    mass that exists at the start vanishes on the way, except for rounding."""
    scene = rotor()
    crank = scene.mechanism.links["crank"]
    weight = Counterweight(mass, Vec(*at), thickness=0.02, density=7850.0)
    crank = dataclasses.replace(crank, counterweights={"W": weight})
    scene = scene.with_mechanism(dataclasses.replace(scene.mechanism, links={"crank": crank}))
    free = {f"{AT}.along": "-100 to 100 mm", f"{AT}.across": "-100 to 100 mm"}
    free[f"{AT.removesuffix('.at')}.mass"] = "0 to 3 kg"
    found = lj.optimise(scene, free, "peak_shaking_force_constant_speed")
    assert found.objective < 1e-6 * found.objective_before


def test_what_is_no_number_is_no_optimum():
    """A constraint with value NaN is violated; an objective that is NaN, or an infinite slope, ends only this start."""
    free = {WHEEL: (0.0, 2.0)}
    found = lj.optimise(rotor(), free, WHEEL, limits=[at_most(lambda s: s.speed * jnp.nan, 1.0, name="nothing")])
    assert not found.feasible
    assert found.conflicts == ("nothing",)
    lost = lj.optimise(rotor(), free, lambda s: jnp.log(s.mechanism.flywheel.inertia - 3), starts=2)
    assert not np.isfinite(lost.kkt_residual)
    assert not lost.feasible
    assert outcome(lost) == "no value"
    cases = [Case("slow", {"speed": 1.0}), Case("fast", {"speed": 3.0})]
    for both in (cases, cases[::-1]):  # one of them is NaN, in any order
        lost = lj.optimise(rotor(), free, lambda s: jnp.log(2 - s.speed) + s.mechanism.flywheel.inertia, cases=both)
        assert outcome(lost) == "no value"
    steep = lj.optimise(rotor(), free, maximise=lambda s: jnp.sqrt(s.mechanism.flywheel.inertia))
    assert steep.objective == pytest.approx(np.sqrt(2.0), rel=1e-9)


@pytest.mark.parametrize(("low", "high", "side"), [(2.0, 4.0, "lower"), (0.0, 2.0, "upper")])
def test_prices_of_bounds(low, high, side):
    """The gain of the objective when the bound is relaxed, at either end: (x - 1)² or (x - 3)², for the active side."""
    best = 1.0 if side == "lower" else 3.0
    found = lj.optimise(rotor(), {WHEEL: (low, high)}, lambda s: (s.mechanism.flywheel.inertia - best) ** 2)
    assert found.x == pytest.approx([2.0])
    assert found.bound_multiplier[WHEEL] == pytest.approx(2.0, rel=1e-6)


def test_too_degenerate_to_certify(monkeypatch):
    """A point without multipliers does not stop the search; it is only not certified."""

    def lost(*_, **__):
        raise RuntimeError("Maximum number of iterations reached.")

    monkeypatch.setattr("scipy.optimize.nnls", lost)
    found = lj.optimise(rotor(), {WHEEL: (0.5, 2.0)}, WHEEL)
    assert found.objective == pytest.approx(0.5)
    assert outcome(found) == "uncertified"


def test_the_clash_is_named_where_the_objective_does_not_care():
    """Two conflicting constraints, and an objective that depends on neither."""
    limits = [at_least(lambda s: s.mechanism.flywheel.inertia, 1.5, name="heavy"), at_most(WHEEL, 1.0)]
    found = lj.optimise(rotor(), {WHEEL: (0.0, 2.0), f"{AT}.along": (-0.1, 0.1)},
                        "peak_shaking_force_constant_speed", limits=limits)  # fmt: skip
    assert not found.feasible
    assert set(found.conflicts) == {"heavy", WHEEL}
    for bounds, side, limit in (
        ((0.0, 1.0), "upper", limits[0]),
        ((1.2, 2.0), "lower", limits[1]),
    ):
        found = lj.optimise(rotor(), {WHEEL: bounds}, "peak_shaking_force_constant_speed", limits=[limit])
        assert found.conflicts == (limit.name or WHEEL, f"{WHEEL} at its {side} bound")


def test_limits_of_one_name_are_told_apart():
    two = [at_least(lambda s: s.mechanism.flywheel.inertia, 0.5), at_least(lambda s: s.speed, 1.0)]
    found = lj.optimise(rotor(), {WHEEL: (0.0, 2.0)}, WHEEL, limits=two)
    assert found.limits["lambda 1"].multiplier == pytest.approx(1.0)
    assert "lambda 2" in found.limits


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"limits": ["delta <= 0.1", "delta <= 0.2"]}, "limits: delta: has 2 constraints"),
        ({"cases": [Case("a"), Case("a")]}, "cases: two cases have the name 'a'"),
        ({"cases": [Case("a", {"speed": "-3 rpm"})]}, "speed: must not be less than 0"),
        ({"free": {WHEEL: {"rnge": "0 to 2 kg m^2"}}}, f"{WHEEL}: unknown key 'rnge'"),
        ({"free": {WHEEL: {"linked": ["speed"]}}}, f"{WHEEL}: has no range"),
        ({"free": {WHEEL: {"range": "0 to 2 kg m^2", "linked": "speed"}}}, "linked is 'speed', not a list of names"),
        ({"seed": -1}, "seed: is -1; write an integer of at least 0"),
        ({"free": {WHEEL: "-2 to 4 kg m^2"}}, "must not be less than 0, but its lower bound is -2"),
        ({"free": {"links.piston.length": (0.0, 1.0)}}, "free: links.piston.length: is not a scene parameter"),
    ],
)
def test_refused(change, says):
    asked = {"free": {WHEEL: (0.0, 2.0)}, "minimise": "delta", **change}
    with pytest.raises(DesignError, match=says):
        lj.optimise(lj.load("slider-crank"), **asked)


def test_changes_by_hand_come_last():
    """`[optimise.changes]` defines the scene, `--set` and `load_problem(changes)` modify that scene."""
    rod = "links.rod.length"
    scene, _ = lj.load_problem(
        "hay-press", {rod: "1.1 m", "links.link4.mass_properties": "fixed", "optimise.starts": 3}
    )
    assert float(scene.mechanism.links["rod"].actual().mass) == pytest.approx(15 * 1.1 / 1.02)
    assert scene.mechanism.links["link4"].mass_properties == "fixed"
    weight = "links.crank.counterweights.W1.mass"
    scene, asked = lj.load_problem("hay-press", {weight: "5 kg", "optimise.starts": 3})
    assert float(scene.mechanism.links["crank"].counterweights["W1"].mass) == 5.0
    assert asked["starts"] == 3
    with pytest.raises(SceneError, match="an angle without a unit"):
        lj.load_problem("hay-press", {"optimise.free": {"loads.hay.window.on": [80, 100]}})


PEAK = "peak_shaking_force_constant_speed"
MASS = f"{AT.removesuffix('.at')}.mass"
BALANCING = {f"{AT}.along": (-0.1, 0.1), f"{AT}.across": (-0.1, 0.1), MASS: (0.0, 3.0)}


@pytest.mark.parametrize("mass", [0.2, 0.3, 0.5])
def test_the_last_digits(mass):
    """2 (0.03, 0.01) kg m of the rotor against a mass within ± 0.1 m: (0.06 - 0.1 m) 20², by hand, from every start."""
    found = lj.optimise(rotor(), BALANCING, PEAK, limits=[f"{MASS} <= {mass} kg"], starts=3)
    by_hand = 400 * math.hypot(max(0.06 - 0.1 * mass, 0.0), max(0.02 - 0.1 * mass, 0.0))
    assert found.objective == pytest.approx(by_hand, rel=1e-8)
    assert all(start.residual <= 1e-7 for start in found.starts)
    assert found.x == pytest.approx([-0.1, -0.02 / mass, mass], rel=1e-6)


def test_nothing_left_is_certified():
    """A rotor balanced exactly: the length of a zero vector has subgradients in all directions. An inactive constraint,
    and other starts, change nothing."""
    found = lj.optimise(rotor(), BALANCING, PEAK, limits=[f"{MASS} <= 2 kg"], starts=3)
    assert found.objective < 1e-9 * found.objective_before
    assert found.kkt_residual <= 1e-7
    assert all(start.residual <= 1e-7 for start in found.starts)
    assert found.limits[MASS].multiplier == 0.0


def test_rounding_is_no_scale():
    """A bound of zero on a value that is 5.5e-17 at the start: the multiplier is that of a start at exactly zero."""
    scene = rotor()
    crank = scene.mechanism.links["crank"]
    crank = dataclasses.replace(crank, counterweights={"W": Counterweight(1.0, Vec(0.0, 5.5e-17), inertia=0.0)})
    scene = scene.with_mechanism(dataclasses.replace(scene.mechanism, links={"crank": crank}))
    free = {f"{AT}.along": (-0.1, 0.1), f"{AT}.across": (-0.1, 0.1)}
    found = lj.optimise(scene, free, PEAK, limits=[f"{AT}.across >= 0 m"])
    assert found.limits[f"{AT}.across"].multiplier == pytest.approx(400.0, rel=1e-6)
    assert found.kkt_residual <= 1e-7


@pytest.mark.slow
def test_an_own_function_of_the_true_motion_needs_one():
    """At 20 rpm the pump has no steady-state motion, in every call."""
    scene = lj.load("slider-crank", {"speed": "300 rpm"})
    found = lj.optimise(scene, {"speed": "20 to 400 rpm"}, lambda s: lj.measures.peak_reaction(s))
    assert found.limits["steady_state_margin"].value >= 1e-3 * (1 - 1e-8)
    still = lj.optimise(rotor(), {WHEEL: (0.0, 2.0)}, WHEEL)
    assert "steady_state_margin" not in still.limits


def test_rows_that_are_no_number():
    """A vector of NaN does not have length zero."""

    def lost(scene):
        return jnp.stack([scene.mechanism.flywheel.inertia, jnp.nan * scene.speed])[:, None]

    assert not np.isfinite(lj.optimise(rotor(), {WHEEL: (0.0, 2.0)}, as_rows(lost)).kkt_residual)


def test_a_start_without_bound():
    """x + 1/x from x = 0, where it is infinite: 2."""
    scene = rotor()
    scene = scene.with_mechanism(dataclasses.replace(scene.mechanism, flywheel=lj.Flywheel(0.0)))

    def wall(scene):
        x = scene.mechanism.flywheel.inertia
        return 1 / x + x

    found = lj.optimise(scene, {WHEEL: (0.0, 2.0)}, wall, starts=3)
    assert found.objective == pytest.approx(2.0, rel=1e-9)
    assert found.starts_at_optimum == 3
    assert found.kkt_residual <= 1e-6


def test_what_depends_on_nothing_is_named():
    """The flywheel does not affect the shaking force at constant speed."""
    found = lj.optimise(rotor(), {WHEEL: (0.0, 2.0), f"{AT}.along": (-0.1, 0.1)}, PEAK)
    assert found.no_effect == (WHEEL,)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"limits": [at_most("speed", np.inf)]}, "speed: inf is not a finite number"),
        ({"limits": ["speed <= 30 rad/s", "speed <= 40 rad/s"]}, "limits: speed: has 2 constraints"),
        pytest.param(
            {"limits": [at_most(PEAK, "initial")], "scene": {"links.rod.length": 0.02}},
            "has no initial value",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            {"limits": ["delta <= initial"], "scene": {"speed": 1.0}},
            "has no initial value: .* has no steady-state motion",
            marks=pytest.mark.slow,
        ),
        ({"cases": [Case("a", {WHEEL: 1.0})]}, f"cases: {WHEEL}: is a design variable, but case 'a' sets it"),
        ({"cases": [Case("a", {"speed": math.nan})]}, "speed: nan is not a finite number"),
        ({"minimise": ""}, "neither a measure nor a scene parameter"),
        ({"free": {WHEEL: "± -5 %"}}, f"{WHEEL}: ± -5 % gives no range"),
        ({"trade_off": ("delat", [0.1]), "limits": ["delta <= 0.2"]}, "did you mean 'delta'"),
    ],
)
def test_refused_at_once(change, says):
    asked = {"free": {WHEEL: (0.0, 2.0)}, "minimise": "delta", **change}
    scene = lj.load("slider-crank")
    for name, value in asked.pop("scene", {}).items():
        scene = changed(scene, {name: value})
    with pytest.raises(DesignError, match=says):
        lj.optimise(scene, **asked)


def test_a_name_with_underscores_in_its_numbers():
    assert settled(lj.load("slider-crank"), {"links.rod.length": "1 to 2_000 mm"}, "delta")["free"][0].upper == 2.0
    with pytest.raises(SceneError, match="an angle without a unit"):
        changes = {"optimise.trade_off": {"limit": "min_transmission_angle", "bounds": [60, 50]}}
        lj.load_problem("hay-press", changes)


def test_a_bound_close_to_zero_is_no_measure():
    kind = Kind("length", "", "m", "limit", True, 1.0, bound=0.0, scale=0.5, own=0.5, effect=0.1)
    assert [kind.bounded(bound).scale for bound in (-3.0, 0.0, 1e-9, 1e-5)] == [3.0, 0.5, 0.5, 1e-5]
    assert [kind.bounded(bound).bound for bound in (-3.0, 0.0, 1e-9)] == [-3.0, 0.0, 1e-9]


def test_both_senses_traded_off():
    """A constraint of the other sense on the same quantity, as added by `--limit`, does not change the trade-off."""
    limits = [f"{MASS} <= 0.5 kg", f"{MASS} >= 0.01 kg"]
    heard = []
    found = lj.optimise(rotor(), BALANCING, PEAK, limits=limits, trade_off=(MASS, ["0.3 kg"]), callback=heard.append)
    assert found.trade_off[0].objective == pytest.approx(12.0, rel=1e-7)
    assert found.traded == f"{MASS} at most"
    last = heard[-1]  # the callback reports the trade-off like the starts
    assert (last.traded, last.start, last.starts) == (found.traded, 0, 1)
    assert last.best == pytest.approx(found.trade_off[0].objective, rel=1e-8)
    assert last.objective == found.trade_off[0].objective
