"""Transient motion: SciPy, closed forms, published numbers, energy, and derivatives of events."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.motion import is_stiff, run_in_angle, run_in_time, steady_motion
from linkjax.runs import starting_torque
from tests.physics import oracle
from tests.physics.driven import line, slider_crank
from tests.physics.machines import machine

TIMES = np.asarray([0.0, 0.1, 1.0])


def wheel(*loads: lj.Torque | lj.OpposingTorque | lj.TorsionDamper, inertia: Any = 0.6, motor=None) -> lj.Scene:
    """A wheel alone."""
    links = {"wheel": lj.Link(length=0.1, inertia=inertia)}
    mechanism = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, [lj.Crank("wheel", "A", "B")], lj.Flywheel(0.0))
    return lj.Scene(mechanism, loads, speed=10.0, motor=motor)


def brake(size) -> lj.OpposingTorque:
    return lj.OpposingTorque("brake", "wheel", magnitude=size)


def damper(size) -> lj.TorsionDamper:
    return lj.TorsionDamper("damper", "wheel", coefficient=size)


def bar(length: float, mass: float) -> lj.Link:
    return lj.Link(length=length, mass=mass, inertia=mass * (length**2 + 0.05**2) / 12, centre=lj.Vec(length / 2, 0.0))


def damped_four_bar() -> lj.Scene:
    """The steel bars of MSL's PlanarFourbar, as a plane machine with a damper at the crank."""
    links = {
        "crank": bar(0.4, 7.7),
        "coupler": bar(math.hypot(0.1, 1.1), 21.26231995808548),
        "rocker": bar(math.hypot(0.65, 0.1), 12.659710946542186),
    }
    groups = [lj.Crank("crank", "A", "B"), lj.RRR(("coupler", "rocker"), "B", "D", "C", side=-1)]
    pins = {"A": lj.Vec(0.0, 0.0), "D": lj.Vec(-0.15, 1.0)}
    loads = (lj.TorsionDamper("damper", "crank", coefficient=0.1),)
    return lj.Scene(lj.Mechanism(pins, links, groups), loads, gravity=lj.Vec(0.0, -9.80665), speed=10.0)


def test_a_pump_from_rest():
    """Published: the slider-crank S with T = 2 (1 - ω/40) and -5 v on the piston, by two methods."""
    scene = slider_crank(line())
    found = lj.run(scene, time=1.0, points=11)
    assert bool(found.starts) and bool(found.complete) and not bool(found.stopped)
    np.testing.assert_allclose(found.angle[jnp.asarray([1, 10])], [0.70901052, 21.83971597], rtol=0, atol=6e-9)
    np.testing.assert_allclose(found.speed[jnp.asarray([1, 10])], [11.67259464, 29.47831234], rtol=0, atol=6e-9)
    np.testing.assert_allclose(found.motor_torque, 2 * (1 - found.speed / 40), rtol=1e-12)


@pytest.mark.slow
def test_a_run_over_angle_is_the_run_over_time():
    scene = slider_crank(line())
    found = lj.run(scene, time=1.0, points=11)
    again = compiled_soon(run_in_angle)(scene, found.angle[1:], found.speed[1])
    np.testing.assert_allclose(again.speed, found.speed[1:], rtol=1e-8)
    np.testing.assert_allclose(again.time, found.time[1:] - 0.1, atol=1e-8)


@pytest.mark.slow
def test_a_run_up_with_losses_and_a_rotor():
    """Motor over a gear of efficiency 0.8: DOP853 with its own choice of the direction of power, and the energy."""
    gear = lj.Transmission(ratio=2.0, efficiency=0.8)
    motor = lj.MotorDrive(lj.LineMotor(no_load=80.0, stall=1.2), gear, inertia=0.001)
    scene = slider_crank(motor, gravity=lj.Vec(0.0, -9.81), pump=4.0)
    bare, times = slider_crank(None, gravity=lj.Vec(0.0, -9.81), pump=None), np.linspace(0.0, 0.8, 9)

    def rate(_, state):
        phi, w = state
        here = oracle.reduction(bare, np.asarray([phi]))
        slide = float(lj.pose(bare.mechanism, jnp.asarray(phi)).points["D"].dr.x)
        net = here.torque[0] - 4.0 * slide**2 * w - 0.5 * here.slope[0] * w * w
        gains = []
        for share in (0.8, 1 / 0.8):
            gain = (net + 2 * share * 1.2 * (1 - 2 * w / 80)) / (here.inertia[0] + 2 * share * 0.001 * 2)
            gains.append((gain, 1.2 * (1 - 2 * w / 80) - 0.001 * 2 * gain))
        return [w, gains[0][0] if gains[0][1] > 0 else gains[1][0]]

    want = solve_ivp(rate, (0.0, 0.8), [0.0, 0.0], "DOP853", times, rtol=1e-9, atol=1e-10).y
    found = lj.run(scene, time=0.8, points=9)
    np.testing.assert_allclose(found.angle, want[0], atol=1e-7)
    np.testing.assert_allclose(found.speed, want[1], atol=1e-6)
    energies = found.energies
    assert energies is not None
    assert float(energies.error) <= 1e-8
    assert float(energies.losses[-1]) > 0 > float(energies.loads["pump"][-1])
    work = energies.motor[-1] - energies.losses[-1] + sum(load[-1] for load in energies.loads.values())
    np.testing.assert_allclose(work, energies.kinetic[-1], rtol=1e-8)


@pytest.mark.slow
def test_the_energy_of_springs():
    """The work on a spring is minus the gain of its energy."""
    scene = slider_crank(line())
    spring = lj.Spring("spring", "slider", "D", to_point="A", stiffness=40.0, free_length=0.25)
    found = lj.run(dataclasses.replace(scene, loads=(*scene.loads, spring)), time=0.5, points=21)
    assert found.energies is not None
    gained = found.energies.springs - found.energies.springs[0]
    assert float(jnp.max(jnp.abs(gained))) > 0.1
    np.testing.assert_allclose(found.energies.loads["spring"], -gained, atol=1e-8)


@pytest.mark.slow
def test_a_free_machine_that_swings_back():
    """Published: the damped four-bar from rest passes standstills; phi and omega at 1 s and 3 s."""
    scene = damped_four_bar()
    times = jnp.asarray([0.0, 1.0, 3.0])
    found = run_in_time(scene, times, jnp.asarray(0.0), jnp.asarray(0.0), through_rest=True, tolerance=1e-12)
    np.testing.assert_allclose(found.angle[1:], [-1.821090896533, -1.936628026465], atol=1e-9)
    np.testing.assert_allclose(found.speed[1:], [12.455705724480, -12.335128090815], atol=1e-8)
    assert not bool(found.stalled)
    ends = run_in_time(scene, times, jnp.asarray(0.0), jnp.asarray(0.0))  # gravity pulls it backward: no start
    assert bool(ends.stalled)
    assert float(ends.stall_time) == 0.0


class Rest:
    """The speed, second of a state, is zero: the end of an integration by SciPy."""

    terminal, direction = True, 0

    def __call__(self, _, state):
        return state[1]


@pytest.mark.slow
def test_dry_friction_on_a_pendulum():
    """It swings, each time less, and rests where friction holds it: parts between standstills by DOP853."""
    a, mass, inertia, friction = 0.3, 2.0, 0.6, 0.5
    links = {"bob": lj.Link(length=0.5, mass=mass, inertia=inertia - mass * a * a, centre=lj.Vec(a, 0.0))}
    mechanism = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, [lj.Crank("bob", "A", "B")], lj.Flywheel(0.0))
    loads = (lj.OpposingTorque("friction", "bob", magnitude=friction),)
    scene = lj.Scene(mechanism, loads, gravity=lj.Vec(0.0, -9.81), speed=5.0)
    found = lj.run(scene, time=10.0, points=11, through_rest=True)
    time, angle, sense = 0.0, 0.0, -1
    while sense:

        def rate(_, state, sense=sense):
            return [state[1], (-mass * 9.81 * a * math.cos(state[0]) - sense * friction) / inertia]

        rest = Rest()
        rest.direction = -sense
        way = solve_ivp(rate, (time, 20.0), [angle, 0.0], "DOP853", rtol=1e-12, atol=1e-13, events=rest)
        time, angle = float(way.t[-1]), float(way.y[0, -1])
        pull = -mass * 9.81 * a * math.cos(angle)
        sense = 0 if abs(pull) <= friction else int(np.sign(pull))
    assert bool(found.stopped) and not bool(found.goes_back)
    assert float(found.stop_time) == pytest.approx(time, abs=1e-7)
    assert float(found.stop_angle) == pytest.approx(angle, abs=1e-8)
    assert float(found.angle[-1]) == float(found.stop_angle)
    assert found.energies is not None
    assert float(found.energies.error) <= 1e-8


@pytest.mark.slow
def test_a_run_down_by_a_damper():
    """omega = omega0 exp(-c t / J); it never stops, and is at 1 % after J / c ln 100."""
    found = lj.run(wheel(damper(0.1)), start_speed=10.0)
    np.testing.assert_allclose(found.speed, 10 * np.exp(-np.asarray(found.time) / 6), atol=1e-9)
    assert not bool(found.stopped)
    assert float(found.run_down_time) == pytest.approx(6 * math.log(100), rel=1e-9)


@pytest.mark.slow
def test_a_run_down_by_a_brake():
    """Stop after J omega0 / M, exactly."""
    found = lj.run(wheel(brake(3.0), motor=line()), start_speed=10.0, motor=False)
    assert bool(found.stopped)
    assert float(found.stop_time) == pytest.approx(2.0, rel=1e-12)
    assert float(found.stop_angle) == pytest.approx(10.0, rel=1e-12)
    assert float(found.run_down_time) == float(found.stop_time)
    assert not np.any(found.motor_torque)


def braked(x: jax.Array) -> lj.Scene:
    return wheel(brake(3.0 * x[0]), damper(0.1 * x[1]), inertia=0.6 * x[2])


def stop_of(x: jax.Array) -> jax.Array:
    """Angle and time of the standstill of a wheel with brake and damper, in closed form."""
    torque, damping, inertia = 3.0 * x[0], 0.1 * x[1], 0.6 * x[2]
    time = inertia / damping * jnp.log(1 + damping * 10 / torque)
    return jnp.stack([(inertia * 10 - torque * time) / damping, time])


@pytest.mark.slow
def test_derivatives_of_a_standstill():
    x = jnp.ones(3)

    def stop(x):
        found = lj.run(braked(x), start_speed=10.0, time=4.0, points=5)
        return jnp.stack([found.stop_angle, found.stop_time])

    np.testing.assert_allclose(stop(x), stop_of(x), rtol=1e-9)
    np.testing.assert_allclose(jax.jit(jax.jacrev(stop))(x), jax.jacrev(stop_of)(x), atol=1e-6)


@pytest.mark.slow
def test_a_standstill_beyond_a_switch():
    """The derivative of the stopping angle with respect to the angle at which a brake begins: 1 by energy, and with
    respect to its torque; a brake in a window of the crank angle."""

    def scene(x):
        load = lj.OpposingTorque("brake", "wheel", magnitude=6.0 * x[1], window=lj.Window(2.0 * x[0], 6.2))
        return wheel(load)

    def stop(x):
        return lj.run(scene(x), start_speed=5.0, time=4.0, points=5).stop_angle

    x = jnp.ones(2)  # ½ J ω² = M (φ - φ_on)
    assert float(stop(x)) == pytest.approx(2.0 + 0.5 * 0.6 * 25 / 6, rel=1e-9)
    np.testing.assert_allclose(jax.jit(jax.grad(stop))(x), [2.0, -0.5 * 0.6 * 25 / 6], atol=1e-6)


@pytest.mark.slow
def test_derivatives_of_the_run_up_time():
    """With respect to the motor's line and the flywheel: against differences."""

    def time(x):
        scene = slider_crank(line(40.0 * x[0], 2.0 * x[1]), flywheel=0.01 * x[2])
        return lj.run(scene, time=1.1, points=5).run_up_time

    x, h = jnp.ones(3), 1e-3
    slope = jax.jit(jax.grad(time))(x)
    for i, one in enumerate(np.eye(3)):
        near, far = (float(time(x + k * h * one) - time(x - k * h * one)) for k in (1, 2))
        assert float(slope[i]) == pytest.approx((8 * near - far) / (12 * h), rel=1e-5), i


@pytest.mark.slow
def test_the_run_up_ends_at_the_steady_motion():
    """At the run-up time the speed is 99 % of that of the steady-state motion at that angle, and not before."""
    scene = slider_crank(line())
    found = lj.run(scene)
    when = float(found.run_up_time)
    assert 0.5 < when < float(found.time[-1])
    there = run_in_time(scene, jnp.asarray([0.0, when]), jnp.asarray(0.0), jnp.asarray(0.0))
    motion = compiled_soon(steady_motion)(scene)
    steady = motion.at(scene, motion.grid.place(there.angle[1]))[0]
    assert float(there.speed[1] / steady) == pytest.approx(0.99, abs=1e-7)


@pytest.mark.slow
def test_a_machine_that_does_not_start():
    """Static load torque above the motor's torque at rest: it stays, and the margin says so."""
    motor = lj.MotorDrive(lj.LineMotor(no_load=40.0, stall=2.0))
    found = lj.run(wheel(brake(2.5), motor=motor), time=1.0, points=5)
    assert not bool(found.starts)
    assert bool(found.stopped)
    assert float(found.stop_time) == 0.0
    assert not np.any(found.speed)
    assert found.starting is not None
    assert float(found.starting.margin) == pytest.approx(2.0 / 2.5 - 1, rel=1e-12)
    assert not bool(found.starting.everywhere)


@pytest.mark.slow
def test_the_start_from_every_angle():
    """Against the greatest static torque of the hay press on many angles, one-sided at its switches."""
    scene = dataclasses.replace(machine("hay-press"), motor=lj.MotorDrive(lj.ConstantTorque(100.0)))
    found = compiled_soon(starting_torque)(scene)
    angles = np.linspace(0.0, scene.cycle, 7201)
    load = -np.asarray(oracle.reduction(scene, angles).torque)
    assert float(found.load_torque) == pytest.approx(load.max(), rel=1e-5)
    assert float(found.load_torque) >= load.max() * (1 - 1e-9)
    assert float(found.margin) == pytest.approx(100.0 / load.max() - 1, rel=1e-4)


@pytest.mark.slow
def test_loads_and_motor_at_times():
    """A load between two times, and a motor that is switched off: piecewise uniform acceleration."""
    scene = wheel(lj.Torque("load", "wheel", torque=-1.2), motor=lj.MotorDrive(lj.ConstantTorque(3.0)))
    found = lj.run(scene, time=3.0, points=7, acting={"load": (0.5, 2.5)}, motor=(0.0, 1.5))
    want, speed = [0.0], 0.0
    for at in np.arange(0.0, 3.0, 0.5):
        speed += 0.5 / 0.6 * (3.0 * (at < 1.5) - 1.2 * (0.5 <= at < 2.5))
        want.append(speed)
    np.testing.assert_allclose(found.speed, want, atol=1e-9)
    assert found.energies is not None
    assert float(found.energies.error) <= 1e-9


@pytest.mark.slow
def test_a_stiff_drive():
    """A motor that holds its speed: the implicit method is chosen, and the speed is that without load."""
    scene, soft = slider_crank(line(40.0, 1e6)), slider_crank(line())
    assert is_stiff(scene)
    assert not is_stiff(soft)
    found = run_in_time(scene, jnp.asarray([0.0, 0.2]), jnp.asarray(0.0), jnp.asarray(0.0), through_rest=True)
    assert float(found.speed[1]) == pytest.approx(40.0, rel=1e-4)
    other = run_in_time(soft, jnp.asarray(TIMES), jnp.asarray(0.0), jnp.asarray(0.0), through_rest=True,
                        solver=diffrax.Kvaerno5())  # fmt: skip
    np.testing.assert_allclose(other.speed[1:], [11.67259464, 29.47831234], rtol=1e-6)


def test_the_reduced_model_at_a_speed():
    """Loads that depend on the speed need it; opposing loads act against the motion."""
    scene, phi = slider_crank(line()), jnp.asarray(0.7)
    with pytest.raises(lj.StructureError, match=r"load 'pump': depends on the crank speed.*write speed="):
        lj.reduced_model(scene, phi)
    slide = lj.pose(scene.mechanism, phi).points["D"].dr.x
    for speed in (-3.0, 0.0, 4.0):
        here = lj.reduced_model(scene, phi, speed=jnp.asarray(speed))
        np.testing.assert_allclose(here.by_load["pump"], -5.0 * slide**2 * speed, rtol=1e-12)
    for speed in (-3.0, 4.0):
        here = lj.reduced_model(wheel(brake(2.0)), phi, speed=jnp.asarray(speed))
        assert float(here.torque) == -2.0 * np.sign(speed)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"time": 1.0, "cycles": 2.0}, "give one of them"),
        ({"time": -1.0}, "above zero"),
        ({"points": 1}, "2 or more"),
        ({"start_speed": -1.0}, "through_rest"),
        ({"acting": {"lead": (0.0, 1.0)}}, "no such load"),
        ({"acting": {"load": (1.0, 0.0)}}, "on before off"),
    ],
)
def test_bad_input(given, text):
    with pytest.raises(lj.StructureError, match=text):
        lj.run(wheel(lj.Torque("load", "wheel", torque=-1.2)), **given)


def test_runs_need_a_characteristic():
    scene = dataclasses.replace(wheel(), motor=lj.MotorDrive(lj.Servo(10.0, 5.0)), constant_speed=True)
    with pytest.raises(lj.StructureError, match="servo motor follows a motion law"):
        lj.run(scene, time=1.0)
