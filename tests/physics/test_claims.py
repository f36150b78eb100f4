"""What a result says of itself is true: bounds of peaks, error on the general road, regimes, moments on the frame."""

from __future__ import annotations

import dataclasses
import itertools
import json
import subprocess
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import RRP, RRR, Crank, Flywheel, Link, Mechanism, OpposingForce, OpposingTorque, Vec
from linkjax._compile import compiled_soon
from linkjax.analysis import document, plain
from linkjax.motion import steady, steady_by_diffrax
from tests.physics import newton_euler, oracle, shooting
from tests.physics.machines import machine


def hung_on_a_block() -> lj.Scene:
    """A dyad that hangs on a marked point of the sliding block, beside its pin."""
    links = {
        "crank": Link(length=0.08, mass=1.0, inertia=0.003, centre=Vec(0.02, 0.01)),
        "rod": Link(length=0.31, mass=1.1, inertia=0.01, centre=Vec(0.12, 0.02)),
        "block": Link(mass=2.2, centre=Vec(0.02, -0.03), points={"P": Vec(0.06, 0.04)}),
        "bar": Link(length=0.28, mass=0.8, inertia=0.008, centre=Vec(0.1, 0.0)),
        "rocker": Link(length=0.24, mass=0.7, inertia=0.006, centre=Vec(0.1, 0.02)),
    }
    groups = [
        Crank("crank", "O", "B"),
        RRP("rod", "block", "B", "D", "O", 1, offset=0.012),
        RRR(("bar", "rocker"), "P", "F", "G", -1),
    ]
    fixed = {"O": Vec(0.0, 0.0), "F": Vec(0.45, -0.25)}
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.4)), (), Vec(0.0, -9.81), 30.0)


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


@pytest.mark.parametrize("name", ["hay-press", pytest.param("hay-press-slider", marks=pytest.mark.slow)])
@pytest.mark.parametrize("nodes", [32, pytest.param(48, marks=pytest.mark.slow), 96])
def test_peaks_lie_within_their_bounds(name, nodes):
    scene = machine(name)
    got, fine = lj.analyse(scene, nodes=nodes, angles=4), lj.analyse(scene, nodes=400, angles=4)
    for few, many in ((got.peaks, fine.peaks), (got.peaks_constant_speed, fine.peaks_constant_speed)):
        wrong = np.abs(np.asarray(few.value - many.value))
        assert np.all(wrong <= np.asarray(few.error + many.error) + 1e-11 * np.asarray(many.value))
        if nodes == 96:  # and the bounds are worth something
            loose = np.asarray(few.error / few.value)
            assert np.median(loose) < 1e-5 and np.max(loose) < 1e-2


def test_the_general_road_states_its_own_error():
    scene = machine("hay-press-slider")
    run = jax.jit(steady_by_diffrax, static_argnames="nodes")
    for tolerance in (1e-4, 1e-6, 1e-8):
        got = run(scene, tolerance=jnp.asarray(tolerance))
        assert abs(float(got.delta) - 0.0903376816582) <= float(got.delta_error)
        assert got.evaluations is None


def test_no_regime_on_the_general_road():
    """The same answer as by quadrature, and the document can be written."""
    slow = dataclasses.replace(machine("hay-press"), speed=jnp.asarray(15.0))
    one, two = (lj.analyse(slow, motion=road, throw=False, angles=8) for road in ("quadrature", "diffrax"))
    assert int(one.result) == int(two.result) == lj.Result.NO_PERIODIC_REGIME
    for field in ("regime_margin", "lowest_mean_speed", "angle_of_least_work"):
        assert float(getattr(one.steady, field)) == float(getattr(two.steady, field))
    json.dumps(plain(document(two, "slow", "0")), allow_nan=False)


def test_lowest_midrange_speed():
    """Just below there is no regime, just above there is one: the mean meant is the scene's own."""
    scene = dataclasses.replace(machine("hay-press"), mean="midrange", speed=jnp.asarray(15.0))
    run = compiled_soon(steady)
    lowest = run(scene).lowest_mean_speed
    for _ in range(3):
        lowest = run(dataclasses.replace(scene, speed=lowest)).lowest_mean_speed
    margins = [float(run(dataclasses.replace(scene, speed=lowest * k)).regime_margin) for k in (0.98, 1.02)]
    assert margins[0] < 0 < margins[1]


def test_designs_are_changed_by_plain_numbers():
    scene = machine("hay-press-slider")
    one = scene.with_mechanism(eqx.tree_at(lambda m: m.links["rod"].length, scene.mechanism, 1.05))
    two = eqx.tree_at(lambda s: s.mechanism.links["rod"].length, scene, jnp.asarray(1.05))
    run = compiled_soon(steady)
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
        (lambda: _named("a-b", "c", "a", "b-c"), "the group is called 'a-b-c'.*rename one of its links"),
        (lambda: _named("a", "b", "c", "E"), "there is a point 'E' too.*another name"),
        (lambda: _press(cycle_turns=0), "cycle_turns: is 0"),
        (lambda: _press(loads=(OpposingForce("f", "crank", "A", magnitude=1.0),)), "point 'A' never moves"),
        (lambda: _press(loads=(OpposingTorque("t", "slider", magnitude=1.0),)), "link 'slider' never turns"),
    ],
)
def test_what_cannot_be_meant_is_refused(make, says):
    with pytest.raises((ValueError, TypeError), match=says):
        make()


def test_wrong_kinds_are_refused():
    """Without the type checks that run in tests: what a user is told."""
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


@pytest.mark.parametrize("name", ["hay-press", "four-bar"])
def test_work_and_power(name):
    """Each load's work by SciPy; the drive makes up for all of them, and its mean power is the work over the period."""
    scene = machine(name)
    cycle = lj.analyse(scene, angles=8)
    edges = oracle.jumps(scene)
    edges = np.append(edges, edges[:1] + scene.cycle) if edges.size else np.asarray([0.0, scene.cycle])
    total = sum(shooting.work(scene, a + 1e-13, b - 1e-13) for a, b in itertools.pairwise(edges))
    work = {key: float(value) for key, value in cycle.work.items()}
    assert set(work) == {"drive", "gravity", *(load.name for load in scene.loads)}
    assert work["drive"] == pytest.approx(-total, rel=1e-9)
    assert abs(sum(work.values())) <= 1e-12 * work["drive"]
    assert abs(work["gravity"]) <= 1e-9 * work["drive"]
    assert float(cycle.mean_power) == pytest.approx(-total / float(cycle.steady.period), rel=1e-9)
    np.testing.assert_allclose(cycle.power, float(cycle.steady.drive_torque) * np.asarray(cycle.speed), rtol=1e-14)
