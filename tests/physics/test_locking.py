"""Self-locking, back-driving and losses: closed forms of a slider-crank, published work, both sides of locking."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.patches import Rectangle
from scipy.optimize import brentq

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax._results import Result
from linkjax.analysis import document, plain
from linkjax.design import changed, numbers
from linkjax.forces import kinetostatics, locking_of_pose
from linkjax.friction import GuideFriction, PinFriction, everywhere
from linkjax.kinematics import pose
from linkjax.machine import ready
from linkjax.viz import friction_figure
from tests.physics import rubbed
from tests.physics.test_friction import crank_slider
from tests.viz.test_figures import assert_tidy

R, L, F = 0.1, 0.3, 200.0  # crank and rod of `crank_slider` (m), and a force that resists (N)
ANGLES = np.radians([10.0, 40.0, 75.0, 100.0, 150.0, 200.0, 260.0, 330.0])


@pytest.mark.slow
def test_useful_loads_that_drive_do_no_useful_work():
    """A load that helps the crank round: the machine does nothing useful, and the efficiency is zero, with a remark."""
    scene = crank_slider(friction=(PinFriction("A", 0.1, 0.02),))
    help_round = lj.Torque("wind", "crank", torque=5.0)
    scene = dataclasses.replace(scene, loads=(help_round,), useful=("wind",), constant_speed=True)
    assert float(lj.measures.evaluate(scene, ["efficiency_constant_speed"])["efficiency_constant_speed"]) == 0.0
    cycle = lj.analyse(scene, angles=12)
    assert cycle.efficiency == 0.0 and "the drive does no net work, loads drive the machine" in str(cycle)


@pytest.mark.slow
def test_useful_loads_beside_others_that_drive():
    """What a brake takes of the work of another load is useful or not, and the remarks say what drives."""
    scene = crank_slider(friction=(PinFriction("A", 0.1, 0.02),))
    help_round = lj.Torque("wind", "crank", torque=5.0)
    brake = lj.Torque("brake", "crank", torque=-3.0)  # what is left drives the drive
    scene = dataclasses.replace(scene, loads=(help_round, brake), useful=("brake",), constant_speed=True)
    assert float(lj.measures.evaluate(scene, ["efficiency_constant_speed"])["efficiency_constant_speed"]) == 0.0
    cycle = lj.analyse(scene, angles=12)
    assert cycle.efficiency == 0.0
    scene = dataclasses.replace(scene, loads=(help_round, dataclasses.replace(brake, torque=jnp.asarray(-6.0))))
    free = str(lj.analyse(dataclasses.replace(resisted(), constant_speed=True), angles=12))
    assert "100 %\n" in free  # up to rounding, and without a remark
    other = lj.analyse(dataclasses.replace(scene, useful=("wind",)), angles=12)
    assert other.efficiency == 0.0 and "the useful loads drive the machine, or do no work" in str(other)
    cycle = lj.analyse(scene, angles=12)
    assert (
        cycle.efficiency is not None and cycle.efficiency > 1 and "other loads drive the machine as well" in str(cycle)
    )


def test_the_locking_factor_is_one_of_the_cycle():
    scene = crank_slider(friction=(PinFriction("A", 0.1, 0.02),))
    with pytest.raises(lj.mechanism.StructureError, match="not one at a crank angle; delete the crank angle"):
        lj.measures.evaluate(scene, ["locking_factor@60deg"])


@compiled_soon
def lockings(scene: lj.Scene, phi: jax.Array):
    made = ready(scene)

    def one(phi):
        here, at = pose(made.mechanism, phi), made.instant(phi, phi, jnp.zeros(()))
        return locking_of_pose(made.scene, here, at, made.scene.active(phi))

    return jax.vmap(one)(phi)


@compiled_soon
def torques(scene: lj.Scene, phi: jax.Array, speed: jax.Array):
    found = jax.vmap(lambda phi: kinetostatics(scene, phi, speed, jnp.zeros(())))(phi)
    return found.drive_torque, found.moves


def resisted(friction=(), masses=(0.0, 0.0, 0.0)) -> lj.Scene:
    """The slider-crank against a force on its slider, which always resists."""
    scene = crank_slider(masses=masses)
    load = lj.OpposingForce("push", "slider", "D", magnitude=F)
    return dataclasses.replace(scene, loads=(load,), friction=friction, useful=("push",))


def factor(scene: lj.Scene, angles=ANGLES) -> np.ndarray:
    return 1 / np.asarray(lockings(scene, jnp.asarray(angles)).inverse)


def test_locking_of_a_guide():
    """A rod without mass pushes the slider at the angle β: it locks for f tan β = 1, whatever the load."""
    beta = np.arcsin(R / L * np.sin(ANGLES))
    found = factor(resisted((GuideFriction("slider", 0.3),)))
    np.testing.assert_allclose(found, 1 / np.abs(np.tan(beta)) / 0.3, rtol=1e-13)


def test_no_load_counts_where_frictions_grow_without_bound():
    """Far from dead centres they do so here: the factor is the same in all digits with weights and without."""
    light, heavy = resisted(), dataclasses.replace(resisted(masses=(2.0, 3.0, 4.0)), gravity=lj.Vec(0.0, -9.81))
    rough, far = everywhere(light.mechanism, 0.1, 0.01, 0.3), ANGLES[[1, 2, 3, 6]]
    found, expected = (factor(dataclasses.replace(each, friction=rough), far) for each in (heavy, light))
    np.testing.assert_allclose(found, expected, rtol=1e-13)


def test_close_to_a_dead_centre():
    """Where coefficients 1000 times as large do not lock the machine, the factor counts as infinite; its derivatives
    are finite on both sides."""
    off = np.concatenate([np.geomspace(1e-9, 1e-2, 22), -np.geomspace(1e-9, 1e-2, 22)])
    angles = np.concatenate([off, np.pi + off])
    beta = np.abs(np.arcsin(R / L * np.sin(angles)))
    scene, every = resisted((GuideFriction("slider", 0.3),)), resisted(masses=(0.2, 0.2, 0.4))
    inverse = np.asarray(lockings(scene, jnp.asarray(angles)).inverse)
    expected = 0.3 * np.tan(beta)
    np.testing.assert_allclose(inverse, np.where(expected > 1e-3, expected, 0.0), rtol=1e-13)
    every = dataclasses.replace(every, friction=everywhere(every.mechanism, 0.1, 0.01, 0.3))
    found = compiled_soon(lambda s: jax.jvp(lambda s: lockings.function(s, jnp.asarray(angles)).inverse, (s,), (s,)))(
        every
    )
    assert all(np.all(np.isfinite(part)) for part in found)


def test_torque_of_both_directions():
    """The rod carries F / (cos β ∓ f |sin β|), forwards and backwards."""
    f, scene = 0.9, resisted((GuideFriction("slider", 0.9),))
    beta = np.arcsin(R / L * np.sin(ANGLES))
    arm = R * np.sin(ANGLES + beta) / np.cos(beta)
    for way in (1.0, -1.0):
        expected = F * np.abs(arm) * np.cos(beta) / (np.cos(beta) - way * f * np.abs(np.sin(beta)))
        found, moves = torques(scene, jnp.asarray(ANGLES), jnp.asarray(way))
        assert bool(jnp.all(moves))
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_both_sides_of_the_limit():
    """With friction in all joints the machine moves just below the factor, and locks just above it."""
    scene = resisted()

    def times(factor: float) -> lj.Scene:
        return dataclasses.replace(scene, friction=everywhere(scene.mechanism, 0.1 * factor, 0.01, 0.3 * factor))

    limits = factor(times(1.0))
    guide = factor(resisted((GuideFriction("slider", 0.3),)))
    assert np.all(limits <= guide * (1 + 1e-8)) and np.min(limits / guide) < 0.9  # two solutions meet before
    for angle, limit in zip(ANGLES, limits, strict=True):
        for side in (1 - 1e-6, 1 + 1e-6):
            torque, moves = torques(times(limit * side), jnp.asarray([angle]), jnp.asarray(1.0))
            assert bool(moves[0]) is (side < 1)
            assert np.isfinite(torque[0]) == (side < 1)


def test_a_tilted_machine_that_locks_stays_locked():
    """A short guide locks in motion, since the rod tilts the slider. Beyond that the equations have other solutions
    again, which do not continue the one without friction: the machine does not move with them."""
    scene, angles = lj.load("slider-crank"), jnp.asarray([1.6196, 1.674, 1.753])
    rubs = everywhere(scene.mechanism, 0.1, 0.02, 0.1)
    rubs = tuple(dataclasses.replace(r, length=0.02) if isinstance(r, GuideFriction) else r for r in rubs)
    coefficients = jnp.append(jnp.asarray([0.05, 0.4]), jnp.linspace(0.74, 2.0, 64))

    @compiled_soon
    def moves(coefficients, angles):
        def one(coefficient, phi):
            friction: Any = tuple(dataclasses.replace(r, coefficient=coefficient) for r in rubs)
            made = dataclasses.replace(scene, friction=friction)
            return kinetostatics(made, phi, jnp.asarray(30.0), jnp.zeros(())).moves

        return jax.vmap(lambda phi: jax.vmap(lambda each: one(each, phi))(coefficients))(angles)

    found = np.asarray(moves(coefficients, angles))
    assert np.all(found[:, :3]) and not np.any(found[:, -1])
    assert not np.any(found[0, 3:])  # at 1.6196 rad it locks at 0.7436
    assert not np.any(found[:, 1:] & ~found[:, :-1])  # more friction never sets it free


def test_the_factor_in_single_precision():
    """Close to locking the equations are ill-conditioned: more than two digits are left."""
    scene = resisted()
    scene = dataclasses.replace(scene, friction=everywhere(scene.mechanism, 0.1, 0.01, 0.3))
    wide = factor(scene)
    with jax.enable_x64(False):
        narrow = jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf), dtype=jnp.float32), scene)
        inverse = jax.jit(lockings.function)(narrow, jnp.asarray(ANGLES, dtype=jnp.float32)).inverse
    np.testing.assert_allclose(1 / np.asarray(inverse), wide, rtol=5e-3)


@pytest.mark.slow
def test_both_sides_of_the_limit_with_gears():
    """Reactions of gears are not linear in the friction: by Newton's method from factor to factor."""
    scene, angles = lj.load("geared-press"), np.radians([70.0, 280.0])

    def times(more: float) -> lj.Scene:
        return dataclasses.replace(scene, friction=everywhere(scene.mechanism, 0.1 * more, 0.01))

    limits = factor(times(1.0), angles)
    for angle, limit in zip(angles, limits, strict=True):
        for side in (1 - 1e-6, 1 + 1e-6):
            torque, moves = torques(times(limit * side), jnp.asarray([angle]), jnp.asarray(1.0))
            assert bool(moves[0]) is (side < 1)
            assert np.isfinite(torque[0]) == (side < 1)


def pushed(force: lj.Vec, masses: tuple[float, float, float], friction: tuple[Any, ...]) -> lj.Scene:
    """The slider-crank with weights and a constant force on its slider."""
    scene = dataclasses.replace(crank_slider(masses=masses), gravity=lj.Vec(0.0, -9.81))
    return dataclasses.replace(scene, loads=(lj.Force("push", "slider", "D", force=force),), friction=friction)


@pytest.mark.parametrize(
    ("masses", "load", "coefficient", "radius", "limit"),
    [
        ((24.5, 24.7, 16.9), 298.0, (0.19, 0.19, 0.19, 0.2029), (0.03, 0.0868, 0.0185), (6.18719, 9.952544003142632)),
        ((4.63, 3.98, 0.205), 60.48, (0.1, 0.171, 0.162, 0.0636), (0.01, 0.0067, 0.022), (3.6018, 52.68439530812407)),
    ],
)
def test_no_solution_beyond_the_end_counts(masses, load, coefficient, radius, limit):
    """Beyond the factor at which the machine locks the equations have other solutions, which the steps from factor to
    factor must not reach. Numbers by a continuation in small steps of equations written by hand."""
    pins = (PinFriction(each, f, r) for each, f, r in zip("ABD", coefficient, radius, strict=False))
    rubs = (*pins, GuideFriction("slider", coefficient[3]))
    scene = pushed(lj.Vec(load, 0.0), masses, rubs)
    angle, expected = limit
    found = factor(scene, np.asarray([angle]))[0]
    assert found == pytest.approx(expected, rel=1e-9)
    for side in (1 - 1e-6, 1 + 1e-6):
        more = tuple(dataclasses.replace(r, coefficient=r.coefficient * found * side) for r in rubs)
        _, moves = torques(dataclasses.replace(scene, friction=more), jnp.asarray([angle]), jnp.asarray(0.0))
        assert bool(moves[0]) is (side < 1)


def with_end(end: str) -> tuple[lj.Scene, float, tuple[str, ...]]:
    """A slider-crank whose solution has such an end at a crank angle, and the names of numbers."""
    light, rod = resisted(), "links.rod.length"
    if end == "two solutions meet":
        names = ("joints.B.coefficient", "joints.D.radius", "joints.slider.guide.coefficient", rod)
        return dataclasses.replace(light, friction=everywhere(light.mechanism, 0.1, 0.01, 0.3)), 0.3, names
    load = lj.OpposingForce("push", "slider", "D", magnitude=300.0)
    heavy = pushed(lj.Vec(0.0, 0.0), (20.0, 20.0, 20.0), everywhere(light.mechanism, 0.1, 0.05))
    return dataclasses.replace(heavy, loads=(load,)), 4.7653, ("joints.B.radius", "links.slider.mass", rod)


def test_a_load_that_friction_holds_alone():
    """Links without mass, and a load on the slider that drives it: where the friction of its guide is as large as the
    load, no pin has a force any more, whatever the crank angle and their own friction."""

    def inverse(given):
        along, across, guide, radius = given
        friction = everywhere(crank_slider().mechanism, 0.1, radius, guide)
        scene = pushed(lj.Vec(along, across), (0.0, 0.0, 0.0), friction)
        return lockings.function(scene, jnp.asarray([1.5427])).inverse[0]

    numbers = jnp.asarray([-425.0, 38.0, 0.26, 0.01])
    value, slope = compiled_soon(jax.value_and_grad(inverse))(numbers)
    assert value == pytest.approx(0.26 * 38 / 425, rel=1e-12)
    np.testing.assert_allclose(slope * numbers / value, [-1.0, 1.0, 1.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("end", ["two solutions meet", "the guide force changes its side"])
def test_a_factor_has_exact_derivatives(end):
    """By coefficient, radius, lengths and masses: forward as reverse, and as differences."""
    scene, angle, names = with_end(end)
    known = numbers(scene)
    first = jnp.stack([known[name].read(scene) for name in names])

    def value(given):
        there = changed(scene, dict(zip(names, given, strict=True)))
        return jnp.log(lockings.function(there, jnp.asarray([angle])).inverse[0])

    slopes = compiled_soon(lambda x: (jax.jacfwd(value)(x), jax.grad(value)(x)))
    ahead, back = (np.asarray(each) for each in slopes(first))
    np.testing.assert_allclose(ahead, back, rtol=1e-9)
    single = compiled_soon(value)
    for i, size in enumerate(np.asarray(first)):
        h = 1e-4 * size
        low, high = (float(single(first.at[i].add(step))) for step in (-h, h))
        assert (high - low) / (2 * h) == pytest.approx(ahead[i], rel=1e-5, abs=1e-7 / size)


def test_friction_without_load_never_locks():
    free = dataclasses.replace(resisted((GuideFriction("slider", 0.3),)), loads=(), useful=())
    assert not np.any(lockings(free, jnp.asarray(ANGLES)).inverse)


@functools.cache
def published() -> lj.Cycle:
    """The slider-crank of the published digits, with 200 N, at constant speed."""
    scene = crank_slider(force=-F)
    scene = dataclasses.replace(scene, friction=everywhere(scene.mechanism, 0.1, 0.01), useful=("push",))
    return lj.analyse(scene, angles=72, constant_speed=True)


@pytest.mark.slow
def test_work_lost_in_a_turn():
    """By the sum of many torques and as published, 4.957994 J, where the last digit
    is that of a coarser sum. The drive gives what friction takes, since a constant force does no work in a turn."""
    cycle = published()
    run, works = cycle.friction, cycle.energies
    assert run is not None and works is not None
    lost = sum(float(each) for each in run.loss.values())
    count = 20000
    phi = jnp.asarray((np.arange(count) + 0.5) * 2 * math.pi / count)
    torque, _ = torques(cycle.scene, phi, cycle.scene.speed)
    assert lost == pytest.approx(2 * math.pi * float(jnp.mean(torque)), rel=2e-6)
    assert lost == pytest.approx(4.957994, abs=1e-6)
    assert works["friction"].net == pytest.approx(-lost, rel=1e-11)
    assert works["drive"].net == pytest.approx(lost, rel=1e-11)
    assert cycle.efficiency == pytest.approx(0.0, abs=1e-11)  # the force gives back what it takes


def test_the_figure_of_losses():
    """Bars as long as the losses, and curves that are the power."""
    cycle = published()
    run = cycle.friction
    assert run is not None
    figure = friction_figure(plain(document(cycle)), cycle.scene)
    assert_tidy(figure)
    top, bottom = figure.axes
    lengths = [bar.get_width() for bar in top.patches if isinstance(bar, Rectangle)]
    np.testing.assert_allclose(lengths, [float(each) for each in run.loss.values()], rtol=1e-12)
    for power, curve in zip(run.power.values(), bottom.lines, strict=False):
        phi, drawn = (np.asarray(part, float) for part in curve.get_data())
        np.testing.assert_allclose(phi[:-1], np.degrees(np.asarray(cycle.angles)), rtol=1e-12)
        np.testing.assert_allclose(drawn[:-1], power, rtol=1e-12)


def test_power_at_every_angle():
    """The drive gives the frictionless power and that of every joint."""
    cycle = published()
    run, forces = cycle.friction, cycle.forces
    assert run is not None and forces is not None
    power = sum(np.asarray(each) for each in run.power.values())
    assert np.min(power) > 0
    free = np.asarray(forces.drive_torque) - power / float(cycle.scene.speed)
    np.testing.assert_allclose(run.frictionless_torque, free, rtol=0, atol=1e-12 * np.max(np.abs(free)))
    without = dataclasses.replace(cycle.scene, friction=())
    bare, _ = torques(without, cycle.angles, cycle.scene.speed)
    np.testing.assert_allclose(run.frictionless_torque, bare, rtol=0, atol=1e-12 * np.max(np.abs(free)))
    ratio = np.asarray(run.efficiency) * np.asarray(forces.drive_torque)
    np.testing.assert_allclose(ratio, bare, rtol=0, atol=1e-12 * np.max(np.abs(free)))
    back, _ = torques(cycle.scene, cycle.angles, -cycle.scene.speed)
    np.testing.assert_allclose(run.backward_torque, back, rtol=0, atol=1e-12 * np.max(np.abs(free)))


@pytest.mark.slow
def test_mechanical_advantage():
    """Without masses it is the efficiency over the velocity at unit crank speed, and without friction its inverse."""
    scene = resisted()
    scene = dataclasses.replace(scene, friction=everywhere(scene.mechanism, 0.1, 0.01))
    cycle = lj.analyse(scene, angles=10, constant_speed=True)
    assert cycle.loads is not None and cycle.forces is not None and cycle.friction is not None
    force = cycle.loads["push"].force
    assert force is not None
    phi = np.asarray(cycle.angles)
    beta = np.arcsin(R / L * np.sin(phi))
    velocity = R * np.abs(np.sin(phi + beta) / np.cos(beta))
    away = velocity > 1e-3  # from the dead centres
    found = np.asarray(force.magnitude)[away] / np.abs(np.asarray(cycle.forces.drive_torque))[away]
    np.testing.assert_allclose(found, np.asarray(cycle.friction.efficiency)[away] / velocity[away], rtol=1e-10)


@functools.cache
def locked() -> lj.Cycle:
    """A guide so rough that the machine locks for f tan β > 1."""
    return lj.analyse(resisted((GuideFriction("slider", 4.0),), (0.2, 0.0, 0.4)), angles=360, constant_speed=True)


def test_a_locked_machine_is_a_result():
    cycle = locked()
    data = plain(document(cycle))
    limit = math.degrees(math.asin(L / R * math.sin(math.atan(1 / 4.0))))
    beyond = np.abs(np.abs(np.degrees(np.asarray(cycle.angles)) % 180 - 90)) < 90 - limit
    run = cycle.friction
    assert run is not None and bool(run.locks)
    assert np.array_equal(~np.asarray(run.moves), beyond) and 0 < np.sum(beyond) < 360
    assert data["result"]["code"] == Result.LOCKED
    first = math.degrees(float(cycle.angles[int(np.argmax(beyond))]))
    assert f"locks the machine at {first:.3f}°" in data["result"]["message"]
    assert f"torque on {cycle.scene.mechanism.driving_link} keeps" in data["result"]["message"]
    assert "slider.guide" in data["result"]["message"] and str(cycle).startswith("Scene: friction locks")
    assert cycle.energies is None and data["efficiency"] == 0
    lost = data["forces_constant_speed"]["reactions"]["B"]["rod"]["fx"]
    assert np.array_equal([each is None for each in lost], beyond)
    peaks = data["peaks"]
    assert peaks["peak_drive_torque_constant_speed"]["value"] is None
    assert peaks["peak_shaking_force_constant_speed"]["value"] > 0
    assert float(np.min(run.locking_factor)) == pytest.approx(1 / math.tan(math.asin(R / L)) / 4.0, rel=1e-8)
    assert max(data["checks"][key] for key in ("virtual_power", "force_balance")) < 1e-12


@pytest.mark.slow
def test_measures_of_friction():
    """Efficiency, losses, locking factor and δ: those of the analysis; forward as reverse, and as differences."""
    scene = resisted(masses=(0.2, 0.2, 0.4))
    mechanism = dataclasses.replace(scene.mechanism, flywheel=lj.Flywheel(0.05))
    scene = dataclasses.replace(
        scene.with_mechanism(mechanism), friction=everywhere(mechanism, 0.1, 0.01, 0.3), target_delta=0.05
    )
    asked = ("efficiency", "efficiency_constant_speed", "loss.B", "loss.slider.guide", "loss_constant_speed.D",
             "efficiency@60deg", "locking_factor where 20deg to 60deg", "delta",
             "flywheel_for_target_delta")  # fmt: skip
    names = ("joints.B.coefficient", "joints.D.radius", "joints.slider.guide.coefficient", "links.rod.length",
             "links.slider.mass")  # fmt: skip
    known = numbers(scene)
    first = jnp.stack([known[name].read(scene) for name in names])

    def values(given):
        found = lj.measures.evaluate(changed(scene, dict(zip(names, given, strict=True))), asked)
        return jnp.stack([found[name] for name in asked])

    forward = compiled_soon(lambda x, t: jax.jvp(values, (x,), (t,)))
    backward = compiled_soon(lambda x, w: jax.vjp(values, x)[1](w)[0])
    middle = np.asarray(forward(first, jnp.zeros_like(first))[0])
    ahead = np.stack([np.asarray(forward(first, unit)[1]) for unit in jnp.eye(len(names))], axis=1)
    back = np.stack([np.asarray(backward(first, unit)) for unit in jnp.eye(len(asked))])
    size = np.asarray(first)
    scale = np.linalg.norm(back * size, axis=1, keepdims=True)
    assert np.max(np.abs(ahead - back) * size / scale) < 1e-9
    for i in range(len(names)):
        h = 1e-4 * size[i]
        low, high = (np.asarray(forward(first.at[i].add(step), first)[0]) for step in (-h, h))
        assert np.max(np.abs((high - low) / (2 * h) - ahead[:, i]) * size[i] / scale[:, 0]) < 1e-5, names[i]
    cycle = lj.analyse(scene, angles=24)
    assert cycle.friction is not None and cycle.friction_constant_speed is not None
    assert middle[0] == pytest.approx(cycle.efficiency, rel=1e-9)
    assert middle[2] == pytest.approx(float(cycle.friction.loss["B"]), rel=1e-9)
    assert middle[4] == pytest.approx(float(cycle.friction_constant_speed.loss["D"]), rel=1e-9)
    assert middle[5] == pytest.approx(float(cycle.friction.efficiency[4]), rel=1e-9)
    assert middle[7] == pytest.approx(float(cycle.delta), rel=1e-9)


def test_pins_that_overlap_lock_a_link():
    """A link without weight pulls along a tangent of the friction circles of its pins that crosses between them, and
    there is none once the circles overlap: λ 2 f r = L, at every angle (Newton's method from zero finds no solution
    long before)."""
    scene = lj.load("toggle-clamp")
    program = compiled_soon(jax.value_and_grad(lambda scene, phi: lockings(scene, phi).inverse[0]))
    for degrees in (190.0, 202.5, 235.0):
        inverse, slope = program(scene, jnp.radians(jnp.asarray([degrees])))
        assert float(inverse) == pytest.approx(2 * 0.15 * 5e-3 / 0.06, rel=1e-12)
        assert float(slope.mechanism.links["link"].length) == pytest.approx(-2 * 0.15 * 5e-3 / 0.06**2, rel=1e-10)


def test_a_toggle_clamp_holds_near_its_dead_centre():
    """Where the workpiece cannot push the lever back: friction takes more than the workpiece gives. The angle is
    that of the equations of all links, and to first order that of the friction circles."""
    scene = lj.load("toggle-clamp")
    phi = jnp.linspace(0.8 * math.pi, math.pi - 1e-3, 400)  # the law closes the clamp until 180 degrees
    law = scene.mechanism.driver.follows()
    assert law is not None
    angle = np.degrees(np.asarray(jax.vmap(law.at)(phi)[0]))
    free, _ = torques(dataclasses.replace(scene, friction=()), phi, scene.speed)
    back, moves = torques(scene, phi, -scene.speed)
    free, back = np.asarray(free), np.asarray(back)
    assert bool(jnp.all(moves))
    pushed = free > 1e-6 * np.max(free)
    holds = pushed & (back < 0)
    assert 1.5 < np.max(angle[holds]) < np.min(angle[pushed & ~holds]) < 2.3
    # the force is a tangent of the circles f r of its pins, crossed, and misses that of the bearing: to first order
    # R φ (1 + R / L) = f r (2 + 2 R / L), less what the guide takes
    f, r, crank, link = 0.15, 5e-3, 0.04, 0.06
    limit = math.degrees(f * r * (2 + 2 * crank / link) / (crank * (1 + crank / link)))
    assert np.max(angle[holds]) == pytest.approx(limit, abs=0.03)
    # with a constant force, exactly: where the equations of all links need no torque
    pushed_on = dataclasses.replace(scene, loads=(lj.Force("workpiece", "plunger", "B", force=lj.Vec(-1e3, 0.0)),))
    held, slow = int(np.flatnonzero(holds)[0]), 1e-9  # so slow that inertia does nothing

    def needed(at: float) -> float:
        there = np.asarray([at])
        return float(rubbed.solve(pushed_on, there, -slow + 0 * there, 0 * there).solution.drive[0])

    known = brentq(needed, float(phi[held - 8]), float(phi[held + 8]))
    found, _ = torques(pushed_on, jnp.asarray([known]), jnp.asarray(-slow))
    size, _ = torques(pushed_on, phi[:1], jnp.asarray(slow))
    assert abs(float(found[0])) < 1e-9 * abs(float(size[0]))


@pytest.mark.slow
def test_an_efficiency_is_improved():
    """A longer rod and a smaller journal: both at their bounds, with the locking factor and a loss limited."""
    scene = lj.load("friction-slider-crank")
    best = lj.optimise(
        scene, free={"links.rod.length": ("250 mm", "500 mm"), "joints.B.radius": ("8 mm", "20 mm")},
        maximise="efficiency", limits=["locking_factor >= 20", "loss.B <= 1.5 J"], starts=1,
    )  # fmt: skip
    before, after = lj.analyse(scene, angles=24), lj.analyse(best.after, angles=24)
    assert before.efficiency is not None and after.efficiency is not None
    assert after.efficiency > before.efficiency + 0.01
    assert best.objective == pytest.approx(after.efficiency, rel=1e-9)
    assert best.kkt_residual < 1e-6
