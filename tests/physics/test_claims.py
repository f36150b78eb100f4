"""Statements of a result about itself are true: bounds of peaks, error with diffrax, motions, moments on the frame."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import subprocess
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import RRP, RRR, Crank, Flywheel, Guide, Link, Mechanism, OpposingForce, OpposingTorque, Vec
from linkjax._compile import compiled_soon
from linkjax.analysis import document, plain
from linkjax.motion import _diffrax, steady_by_diffrax, steady_motion
from tests.physics import newton_euler, oracle, shooting
from tests.physics.machines import machine


def hung_on_a_block() -> lj.Scene:
    """A dyad attached to an additional point of the slider, beside its pin."""
    links = {
        "crank": Link(length=0.08, mass=1.0, inertia=0.003, centre=Vec(0.02, 0.01)),
        "rod": Link(length=0.31, mass=1.1, inertia=0.01, centre=Vec(0.12, 0.02)),
        "block": Link(mass=2.2, centre=Vec(0.02, -0.03), points={"P": Vec(0.06, 0.04)}),
        "bar": Link(length=0.28, mass=0.8, inertia=0.008, centre=Vec(0.1, 0.0)),
        "rocker": Link(length=0.24, mass=0.7, inertia=0.006, centre=Vec(0.1, 0.02)),
    }
    groups = [
        Crank("crank", "O", "B"),
        RRP("rod", "block", "B", "D", Guide("O", offset=0.012)),
        RRR(("bar", "rocker"), "P", "F", "G", -1),
    ]
    fixed = {"O": Vec(0.0, 0.0), "F": Vec(0.45, -0.25)}
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.4)), (), Vec(0.0, -9.81), 30.0)


@pytest.mark.slow
def test_moment_on_the_frame():
    """Of guide and pins about the crank's bearing, by the Newton-Euler equations and by the balance of the machine."""
    scene = hung_on_a_block()
    cycle = lj.analyse(scene, angles=24)
    assert max(float(check) for check in jax.tree.leaves(cycle.checks)) < 1e-10
    phi, zero = np.asarray(cycle.angles), np.zeros(24)
    known = newton_euler.solve(scene, phi, zero + 30.0, zero)
    points = oracle.rates(scene.mechanism, phi).points
    at = {"O": "O", "F": "F", "block.guide": "D"}
    moment = sum(
        -np.asarray(couple) - ((points[at[joint]].r - points["O"].r).conjugate() * force).imag
        for (joint, link), (force, couple) in known.reactions.items()
        if joint in at and link in ("crank", "rocker", "block")
    )
    got = np.asarray(cycle.forces_constant_speed.frame.moment)
    np.testing.assert_allclose(got, moment, rtol=0, atol=1e-10 * np.max(np.abs(moment)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["slider-crank", *(pytest.param(n, marks=pytest.mark.slow) for n in ("hay-press", "hay-press-slider"))]
)
@pytest.mark.parametrize(
    "nodes", [pytest.param(32, marks=pytest.mark.slow), pytest.param(48, marks=pytest.mark.slow), 96]
)
def test_peaks_lie_within_their_bounds(name, nodes):
    scene = machine(name)
    got, fine = lj.analyse(scene, nodes=nodes, angles=4), lj.analyse(scene, nodes=400, angles=4)
    for few, many in ((got.peaks, fine.peaks), (got.peaks_constant_speed, fine.peaks_constant_speed)):
        wrong = np.abs(np.asarray(few.value - many.value))
        assert np.all(wrong <= np.asarray(few.error + many.error) + 1e-11 * np.abs(np.asarray(many.value)))
        if nodes == 96:  # and the bounds are not too large
            loose = np.asarray(few.error / np.abs(few.value))
            assert np.median(loose) < 1e-5 and np.max(loose) < 1e-2


@pytest.mark.slow
def test_the_general_road_states_its_own_error():
    scene = machine("hay-press-slider")
    run = jax.jit(steady_by_diffrax, static_argnames="nodes")
    for tolerance in (1e-4, 1e-6, 1e-8):
        got = run(scene, tolerance=jnp.asarray(tolerance))
        assert abs(float(got.delta) - 0.0903376816582) <= float(got.delta_error)
        assert got.evaluations is None


@pytest.mark.slow
def test_no_regime_on_the_general_road():
    """The same result as by quadrature, and the document can be written."""
    slow = dataclasses.replace(machine("hay-press"), speed=jnp.asarray(15.0))
    one, two = (lj.analyse(slow, method=road, throw=False, angles=8) for road in ("quadrature", "diffrax"))
    assert int(one.result) == int(two.result) == lj.Result.NO_PERIODIC_REGIME
    assert one.missing is not None and two.missing is not None and one.missing.reason == two.missing.reason
    for field in ("steady_state_margin", "min_mean_speed"):
        assert float(getattr(one.missing, field)) == float(getattr(two.missing, field))
    json.dumps(plain(document(two, "slow", "0")), allow_nan=False)


@pytest.mark.slow
def test_lowest_midrange_speed():
    """Just below there is no steady-state motion, just above there is one: the mean is that of the scene."""
    scene = dataclasses.replace(machine("hay-press"), mean="midrange", speed=jnp.asarray(15.0))
    run = compiled_soon(steady_motion)
    lowest = run(scene).min_mean_speed
    for _ in range(3):
        lowest = run(dataclasses.replace(scene, speed=lowest)).min_mean_speed
    margins = [float(run(dataclasses.replace(scene, speed=lowest * k)).steady_state_margin) for k in (0.98, 1.02)]
    assert margins[0] < 0 < margins[1]


def test_designs_are_changed_by_plain_numbers():
    scene = machine("hay-press-slider")
    one = scene.with_mechanism(eqx.tree_at(lambda m: m.links["rod"].length, scene.mechanism, 1.05))
    two = eqx.tree_at(lambda s: s.mechanism.links["rod"].length, scene, jnp.asarray(1.05))
    run = compiled_soon(steady_motion)
    assert float(run(one).delta) == float(run(two).delta)
    heavier = dataclasses.replace(scene.mechanism, flywheel=Flywheel(41.0))
    assert heavier.link_names == scene.mechanism.link_names
    assert float(run(scene.with_mechanism(heavier)).delta) < float(run(scene).delta)


def _named(one: str, two: str, three: str, four: str) -> Mechanism:
    names = ["crank", one, two, three, four]
    links = {name: Link(length=length) for name, length in zip(names, (0.1, 0.4, 0.3, 0.4, 0.3), strict=True)}
    groups = [Crank("crank", "A", "B"), RRR((one, two), "B", "D", "C"), RRR((three, four), "B", "F", "E")]
    return Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0), "F": Vec(-0.4, 0.0)}, links, groups)


def _press(**changes) -> lj.Scene:
    return dataclasses.replace(machine("hay-press-slider"), **changes)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: _named("a-b", "c", "a", "b-c"), "has the name 'a-b-c'.*rename one of its links"),
        (lambda: _named("a", "b", "c", "E"), "there is also a point 'E'.*another name"),
        (lambda: _press(cycle_turns=0), "cycle_turns: is 0"),
        (lambda: _press(loads=(OpposingForce("f", "crank", "A", magnitude=1.0),)), "point 'A' never moves"),
        (lambda: _press(loads=(OpposingTorque("t", "slider", magnitude=1.0),)), "link 'slider' never turns"),
    ],
)
def test_what_cannot_be_meant_is_refused(make, says):
    with pytest.raises((ValueError, TypeError), match=says):
        make()


def test_wrong_kinds_are_refused():
    """The messages to a user, without the type checks that run in tests."""
    script = """
import linkjax as lj
for make in (
    lambda: lj.Link(length=0.3, mass_properties="Scaled"),
    lambda: lj.Link(length=0.3, centre=0.1),
    lambda: lj.Scene(lj.load("four-bar").mechanism, mean="Time"),
):
    try:
        make()
    except (TypeError, ValueError) as error:
        print(error)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    said = done.stdout.splitlines()
    assert len(said) == 3
    assert "'Scaled'" in said[0]
    assert "Vec(x, y)" in said[1]
    assert "midrange" in said[2]


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param("hay-press", marks=pytest.mark.slow), "four-bar"])
def test_work_and_power(name):
    """Work of each load by SciPy; the drive compensates all of them, and its mean power is the work over the period."""
    scene = machine(name)
    cycle = lj.analyse(scene, angles=8)
    edges = oracle.jumps(scene)
    edges = np.append(edges, edges[:1] + scene.cycle) if edges.size else np.asarray([0.0, scene.cycle])
    total = sum(shooting.Fitted(scene, a + 1e-13, b - 1e-13).work() for a, b in itertools.pairwise(edges))
    work = {key: float(value) for key, value in cycle.work.items()}
    assert set(work) == {"drive", "gravity", *(load.name for load in scene.loads)}
    assert work["drive"] == pytest.approx(-total, rel=1e-9)
    assert abs(sum(work.values())) <= 1e-12 * work["drive"]
    assert abs(work["gravity"]) <= 1e-9 * work["drive"]
    assert float(cycle.mean_power) == pytest.approx(-total / float(cycle.steady.period), rel=1e-9)
    np.testing.assert_allclose(cycle.power, float(cycle.steady.mean_drive_torque) * np.asarray(cycle.speed), rtol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider-crank", "hay-press"])
def test_checks_of_a_clockwise_machine(name):
    """The drive torque is positive along the rotation; on the frame it acts in the opposite sense."""
    cycle = lj.analyse(lj.load(name, {"rotation": "cw"}), angles=12)
    assert max(float(check) for check in jax.tree.leaves(cycle.checks)) < 1e-10


def rotor() -> lj.Scene:
    """An eccentric crank alone, without gravity: it runs steadily without drive torque."""
    link = Link(length=0.1, mass=2.0, inertia=0.01, centre=Vec(0.03, 0.01))
    mechanism = Mechanism({"O": Vec(0.0, 0.0)}, {"crank": link}, [Crank("crank", "O", "A")], Flywheel(1.0))
    return lj.Scene(mechanism, speed=10.0, target_delta=0.05)


def balanced() -> lj.Scene:
    """A four-bar whose mass centre rests (Berkof and Lowen, 1969), without gravity."""
    a, b, c, m = 0.1, 0.3, 0.25, 1.5
    links = {
        "crank": Link(length=a, mass=2.0, inertia=0.01, centre=Vec(-m * 0.5 * a / 2.0, 0.0)),
        "coupler": Link(length=b, mass=m, inertia=0.02, centre=Vec(0.5 * b, 0.0)),
        "rocker": Link(length=c, mass=2.5, inertia=0.03, centre=Vec(-m * 0.5 * c / 2.5, 0.0)),
    }
    groups = [Crank("crank", "O", "A"), RRR(("coupler", "rocker"), "A", "C", "B", 1)]
    return lj.Scene(Mechanism({"O": Vec(0.0, 0.0), "C": Vec(0.3, 0.0)}, links, groups, Flywheel(1.0)), speed=10.0)


@pytest.mark.parametrize(
    "scene", [rotor(), pytest.param(balanced(), marks=pytest.mark.slow)], ids=["rotor", "balanced"]
)
def test_checks_where_everything_is_balanced(scene):
    """Residuals are relative to the summed terms: nothing may be divided by a sum that is zero except for rounding."""
    cycle = lj.analyse(scene, angles=12)
    assert max(float(check) for check in jax.tree.leaves(cycle.checks)) < 1e-12
    shaking = cycle.forces_constant_speed.shaking.magnitude
    if len(scene.mechanism.links) == 1:  # m ω² e
        np.testing.assert_allclose(shaking, 2.0 * 10.0**2 * math.hypot(0.03, 0.01), rtol=1e-14)
    else:  # the joint forces cancel
        largest = max(
            float(jnp.max(side.magnitude)) for sides in cycle.forces.reactions.values() for side in sides.values()
        )
        assert float(jnp.max(shaking)) <= 1e-14 * largest
        assert float(jnp.max(cycle.forces.frame.magnitude)) <= 1e-14 * largest
    json.dumps(plain(document(cycle)), allow_nan=False)


def test_a_flywheel_for_what_runs_steadily_by_itself():
    """None is needed: the largest possible reduction, half the present inertia, and a finite derivative."""
    value, slope = compiled_soon(jax.value_and_grad(lambda d: lj.flywheel_for(rotor(), d)))(jnp.asarray(0.05))
    assert float(value) == pytest.approx(-0.5 * (0.01 + 2.0 * (0.03**2 + 0.01**2)), rel=1e-9)
    assert np.isfinite(slope)


@pytest.mark.slow
def test_an_integration_that_fails_is_told(monkeypatch):
    monkeypatch.setattr(_diffrax, "MOST_STEPS", 16)
    cycle = lj.analyse(machine("four-bar"), method="diffrax", throw=False, angles=8)
    assert int(cycle.result) == lj.Result.INTEGRATION_FAILED
    assert float(cycle.delta_error) == np.inf
    with pytest.raises(lj.MachineError, match="looser tolerance"):
        lj.analyse(machine("four-bar"), method="diffrax", angles=8)


@pytest.mark.slow
def test_a_lost_machine_under_grad():
    """No exception there, for any machine: the result is data."""

    def delta(length):
        scene = machine("four-bar")
        links = {**scene.mechanism.links, "rocker": Link(length=length, mass=1.0)}
        return lj.analyse(scene.with_mechanism(dataclasses.replace(scene.mechanism, links=links)), angles=4).delta

    assert np.isfinite(compiled_soon(jax.grad(delta))(jnp.asarray(0.02)))


def test_a_jump_at_a_whole_degree():
    """41 degrees, as a uniform angle gives it, is an ulp below the end of the window: the load does not act there."""
    scene = lj.load("slider-crank", {"loads[0].window": ["10 deg", "41 deg"]})
    angles = jnp.asarray([2 * np.pi * i / 360 for i in range(360)])
    share = np.asarray(lj.analyse(scene, angles=angles).reduced.by_load[scene.loads[0].name])
    assert np.flatnonzero(share).tolist() == list(range(10, 41))


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda: RRR(("a", "b"), "A", "C", "B", 2), "side of an RRR must be 1 or -1"),
        (lambda: Link(length=-0.1), "length of a link must not be negative"),
        (lambda: dataclasses.replace(rotor(), speed=-3.0), "speed: is -3.0"),
        (lambda: dataclasses.replace(rotor(), target_delta=0.0), "target_delta: is 0.0"),
        (
            lambda: dataclasses.replace(
                rotor(), loads=(lj.Torque("t", "crank", torque=1.0, window=lj.Window(0.0, 2 * np.pi)),)
            ),
            "omit `window` for a permanent load",
        ),
        (
            lambda: Mechanism({"O": Vec(0.0, 0.0)}, {"frame": Link(length=0.1)}, [Crank("frame", "O", "A")]),
            "the name is reserved for the frame",
        ),
        (lambda: lj.analyse(rotor(), angles=[]), "angles must be an integer or a list"),
        (lambda: lj.analyse(rotor(), angles=36.0), "angles must be an integer or a list"),
    ],
)
def test_what_cannot_be_is_refused(wrong, says):
    with pytest.raises(ValueError, match=says):
        wrong()
