"""Hard cases of friction: tiny and huge coefficients, journals larger than the crank, dead centres, change points."""

from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax.forces import Contacts, Linear, frictions_of, specks
from linkjax.friction import GuideFriction, PinFriction, everywhere
from tests.physics import rubbed
from tests.physics.test_friction import crank_slider, forces, forces_at, friction_circles

ANGLES = np.radians(np.arange(3.0, 360.0, 15.0))


def found_at(scene: lj.Scene, angles=ANGLES, gain: float = 0.0):
    return forces_at(scene, *map(jnp.asarray, (angles, np.full_like(angles, 10.0), np.full_like(angles, gain))))


def test_a_coefficient_of_a_billionth():
    """The loss is in proportion, to the digits that are left beside the torque."""
    scene = crank_slider(force=-200.0)

    def loss(f: float) -> np.ndarray:
        rough = dataclasses.replace(scene, friction=everywhere(scene.mechanism, f, 0.01))
        sides = found_at(rough).friction.values()
        return -np.sum([one.value * one.speed for joint in sides for one in joint.values()], axis=0)

    np.testing.assert_allclose(loss(1e-9) / 1e-9, loss(1e-6) / 1e-6, rtol=1e-5)


def test_a_coefficient_of_three():
    """Pins of light rubber: as found by repeating the equations of all links, where these agree in the end."""
    scene = crank_slider(force=-200.0)
    scene = dataclasses.replace(scene, friction=everywhere(scene.mechanism, 3.0, 0.002, 0.1))
    known, got = rubbed.solve(scene, ANGLES, 10 + 0 * ANGLES, 0 * ANGLES), found_at(scene)
    assert known.rounds < rubbed.ROUNDS and np.all(got.moves)
    largest = np.abs(known.solution.drive).max()
    np.testing.assert_allclose(got.drive_torque, known.solution.drive, rtol=0, atol=1e-10 * largest)


@pytest.mark.parametrize("radius", [0.15, 1.0])
def test_a_journal_larger_than_the_crank(radius):
    """Its friction circle f₀ r is what counts: by the geometry of the circles."""
    rod, guide = 0.35, 0.12
    for theta in np.radians([20.0, 100.0, 220.0, 300.0]):
        scene = crank_slider(0.1, rod, (), -math.copysign(1000.0, -math.sin(theta)), (0.0,) * 3)
        radii = (radius, radius, 0.02)
        rubs = tuple(PinFriction(pin, 0.02, r) for pin, r in zip("ABD", radii, strict=True))
        found = forces(dataclasses.replace(scene, friction=(*rubs, GuideFriction("slider", guide))), theta, 1.0, 0.0)
        known = friction_circles(theta, 0.1, rod, 1000.0, 0.02, radii, guide)
        assert bool(found.moves) and found.drive_torque == pytest.approx(known, rel=1e-11)


@pytest.mark.parametrize("side", [-1e-9, 1e-9])
@pytest.mark.parametrize("dead", [0.0, math.pi])
def test_a_dead_centre_under_load(dead, side):
    """Beside a dead centre the load has no arm: the drive overcomes the friction circles of the pins alone."""
    f, r, load = 0.1, 0.01, 500.0
    scene = crank_slider(masses=(0.0,) * 3)
    push = lj.OpposingForce("push", "slider", "D", magnitude=load)
    rubs = tuple(PinFriction(pin, f, r) for pin in "ABD")
    found = forces(dataclasses.replace(scene, loads=(push,), friction=rubs), dead + side, 1.0, 0.0)
    # rod and crank are on a line, the rod turns by 1/3 of the crank
    ratio = math.copysign(0.1 / 0.3, math.cos(dead))
    lost = f * r * load * (1 + (1 + ratio) + abs(ratio))
    assert found.drive_torque == pytest.approx(lost, rel=2e-2)  # to first order in the radius over the lengths
    losses = [-float(one.value * one.speed) for joint in found.friction.values() for one in joint.values()]
    assert found.drive_torque == pytest.approx(sum(losses), rel=1e-6)


def pump(**keys) -> lj.Scene:
    """A massless crank and rod, and a plunger with a load that begins and ends exactly at the dead centres, where it
    reverses; without weight all forces vanish where the plunger is not accelerated."""
    links = {"slider": lj.Link(mass=3.0)}
    mechanism = lj.slider_crank(0.04, 0.16, links=links, flywheel=28.0)
    load = lj.OpposingForce("water", "slider", "D", lj.Window(math.pi, 2 * math.pi), magnitude=2e3)
    rough = everywhere(mechanism, 0.07, 0.015)
    return lj.Scene(mechanism, (load,), lj.Vec(0.0, 0.0), 4 * math.pi, friction=rough, **keys)


def test_peaks_of_a_load_that_switches_at_a_dead_centre():
    """Several panels end there, and those between them have no width: their nodes are one place, where senses are
    rounding errors. The largest force is in the middle of the stroke, where the rod reverses and friction jumps."""
    middle = 1.5 * math.pi
    angles = np.sort(np.append(np.linspace(0.01, 6.27, 60), [middle - 1e-9, middle + 1e-9]))
    cycle = lj.analyse(pump(), angles=angles, constant_speed=True)
    peaks, force = lj.analysis.document(cycle)["peaks"], cycle.forces_constant_speed.reactions["B"]["rod"]
    largest = float(np.max(np.hypot(force.fx, force.fy)))
    for name in ("A.crank", "B.rod", "D.rod"):
        peak = peaks[f"peak_reaction_constant_speed.{name}"]
        assert peak["value"] == pytest.approx(largest, rel=1e-6) and peak["error"] < 1e-5 * largest
        assert peak["angle"] == pytest.approx(middle, abs=1e-6)


@pytest.mark.parametrize(("error", "found"), [(1e-13, True), (1e-9, False)])
def test_rounding_where_all_forces_vanish_is_no_locking(error, found):
    """At the second place the force is 1e-9 of that at the first. A step as long as a rounding error of the first is
    long beside it; a longer one says that the frictions do not follow yet."""
    pin, none = PinFriction("B", 0.07, 0.015), jnp.zeros((1, 2))
    force = jnp.asarray([[1e3, 1e-6]])
    unit = none[None]
    pushed = Linear((force, none, none), (unit, unit, unit), (none, none, none))
    contacts = Contacts((pin,), jnp.ones((1, 2)), jnp.ones((1, 2)), pushed)
    exact = -contacts.sizes((force, none, none))
    near = exact + error * jnp.max(jnp.abs(exact)), jnp.ones(2)
    ahead = jax.tree_util.Partial(jnp.ones_like)
    there = frictions_of(contacts, ahead, near, least=specks(near))
    np.testing.assert_array_equal(there.found, [True, found])
    np.testing.assert_allclose(there.values, exact, rtol=1e-15)


@pytest.mark.slow
def test_a_light_plunger_without_weight_has_a_motion():
    """Nodes are close to the place where all forces vanish; without friction the work of the load gives the torque."""
    found = lj.motion.steady_motion(pump())
    assert found.driven is not None and bool(found.driven.found)
    work = 2e3 * 0.08
    assert work < 2 * math.pi * float(found.driven.mean_torque) < 1.2 * work


@pytest.mark.slow
def test_a_motor_where_all_forces_vanish_at_a_place():
    """A motion with friction is found although at one place there is no force to judge the frictions by."""
    motor = lj.InductionMotor(550.0, 1380 * math.pi / 30, 1500 * math.pi / 30, 2.2, 1.8)
    drive = lj.MotorDrive(motor, lj.Transmission(11.5, 0.95), 0.0014)
    found = lj.motion.steady_motion(pump(motor=drive))
    assert found.driven is not None and bool(found.driven.found)
    mean, work = (
        float(found.driven.mean_torque),
        2e3 * 0.08,
    )  # force times stroke; friction takes less than a fifth of it
    assert work < 2 * math.pi * mean < 1.2 * work
    at_mean = 11.5 * 0.95 * float(motor.torque(11.5 * found.mean_speed))
    assert mean == pytest.approx(at_mean, rel=2e-3)  # δ is 0.02, of whose square the mean of the torque depends


def test_a_change_point_is_a_clear_result():
    """Where a parallelogram is flat, forces at its joints and thus friction are not known; beside it they are."""
    links = {name: lj.Link(length=long, mass=1.0, inertia=0.01) for name, long in
             (("crank", 0.1), ("coupler", 0.3), ("rocker", 0.1))}  # fmt: skip
    groups = [lj.Crank("crank", "A", "B"), lj.RRR(("coupler", "rocker"), "B", "D", "C", 1, "continue")]
    mechanism = lj.Mechanism({"A": lj.Vec(0.0, 0.0), "D": lj.Vec(0.3, 0.0)}, links, groups)
    scene = lj.Scene(mechanism, gravity=lj.Vec(0.0, -9.81), speed=10.0, friction=everywhere(mechanism, 0.1, 0.01))
    flat, beside = forces(scene, 0.0, 10.0, 0.0), forces(scene, 0.3, 10.0, 0.0)
    assert not bool(flat.moves) and flat.drive_torque == math.inf
    assert bool(beside.moves) and np.isfinite(beside.drive_torque)
