"""Steady-state motion under torques that depend on the speed: SciPy, published numbers, energy, derivatives."""

from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.machine import ready
from linkjax.motion import Steady, at_nodes, flywheel_for, grid_with_kinks, steady_motion, steady_on
from linkjax.sampling import Sampler
from tests.physics import shooting
from tests.physics.driven import line, shoot, slider_crank
from tests.physics.machines import machine

steady = compiled_soon(steady_motion, static=("nodes",))
ANGLES = np.linspace(0.05, 2 * math.pi, 40)


@compiled_soon
def speeds(motion: Steady, scene: lj.Scene, angles: jax.Array) -> jax.Array:
    return jax.vmap(lambda phi: motion.at(scene, motion.grid.place(phi))[0])(angles)


def test_a_pump_with_a_motor():
    """Published: slider-crank with T = 2 (1 - ω/40) and -5 v on the piston; DOP853 at 1e-13 and an energy integral."""
    found = steady(slider_crank(line()))
    assert found.driven is not None
    assert float(found.period) == pytest.approx(0.234702480734, abs=1e-12)
    assert float(found.mean_speed) == pytest.approx(26.770851707770, rel=1e-12)
    assert float(found.max_speed) == pytest.approx(30.073746764842, rel=1e-11)
    assert float(found.min_speed) == pytest.approx(23.838643247398, rel=1e-11)
    assert float(found.mean_drive_torque) * 2 * math.pi == pytest.approx(4.103543706651, rel=1e-12)
    assert float(found.driven.multiplier) == pytest.approx(0.28557260, abs=1e-8)
    assert abs(float(found.delta) - 0.232906430677) <= float(found.delta_error) < 1e-9
    start = speeds(found, slider_crank(line()), jnp.zeros(1))
    assert float(start[0]) == pytest.approx(29.749740950780, rel=1e-11)


def test_excess_work_is_that_of_the_loads():
    """10 N m against a quarter of a turn, balanced by 2.5 N m throughout: (10 - 2.5) π/2, however much the speed of a
    motor with a small flywheel varies."""
    links = {"shaft": lj.Link(length=0.1)}
    shaft = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, [lj.Crank("shaft", "A", "B")], lj.Flywheel(0.05))
    load = lj.OpposingTorque("cut", "shaft", magnitude=10.0, window=lj.Window(0.0, math.pi / 2))
    scene = lj.Scene(shaft, (load,), speed=30.0, motor=lj.MotorDrive(lj.LineMotor(no_load=40.0, stall=10.0)))
    found = steady(scene)
    assert float(found.delta) > 0.2
    assert float(found.excess_work) == pytest.approx(7.5 * math.pi / 2, rel=1e-12)


@pytest.mark.slow
def test_the_same_by_an_analysis():
    """Forces, works and checks of the motion found: the motor's work is that of the pump."""
    cycle = lj.analyse(slider_crank(line()), angles=24)
    assert cycle.missing is None and cycle.work is not None
    assert float(cycle.work["drive"]) == pytest.approx(-float(cycle.work["pump"]), rel=1e-12)
    assert float(cycle.checks.virtual_power) < 1e-13
    assert float(cycle.checks.energy_closure) < 1e-10
    assert float(cycle.checks.force_balance) < 1e-13
    assert cycle.forces is not None and cycle.speed is not None
    np.testing.assert_allclose(cycle.forces.drive_torque, 2 * (1 - np.asarray(cycle.speed) / 40), rtol=1e-9)


@pytest.mark.slow
def test_a_punch_press_with_a_line_motor():
    """A shaft with a flywheel, 1000 N m over 60 degrees, 1200 rpm without load and 176 N m at 1120 rpm, by DOP853. A
    textbook prints δ = 0.0545 for it, which belongs to a flywheel of 1.146 kg m²."""
    links = {"shaft": lj.Link(length=0.1)}
    shaft = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, [lj.Crank("shaft", "A", "B")], lj.Flywheel(12.5))
    rpm = math.pi / 30
    motor = lj.MotorDrive(lj.LineMotor([(1200 * rpm, 0.0), (1120 * rpm, 176.0)]))
    load = lj.OpposingTorque("punch", "shaft", magnitude=1000.0, window=lj.Window(0.0, math.pi / 3))
    scene = lj.Scene(shaft, (load,), speed=1150 * rpm, motor=motor)
    found = steady(scene)
    lap = shoot(scene, lambda _, w: 176 * (1200 * rpm - w) / (80 * rpm), 1150 * rpm)
    np.testing.assert_allclose(speeds(found, scene, jnp.asarray(ANGLES)), lap.speeds(ANGLES), rtol=1e-9)
    assert float(found.period) == pytest.approx(lap.period, rel=1e-11)
    ends = sorted(lap.speeds(np.asarray([0.0, math.pi / 3])))
    assert abs(float(found.delta) - (ends[1] - ends[0]) * lap.period / scene.cycle) < 1e-10
    assert found.driven is not None
    assert float(found.driven.multiplier) == pytest.approx(lap.multiplier, abs=1e-5)


CASES = [
    ("hay-press", 400.0, 90.0, 2.0, 20.0),
    ("four-bar", 8.0, 30.0, 0.4, 2.0),
    ("quick-return", 60.0, 40.0, 1.0, 5.0),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "stall", "no_load", "rotor", "ratio"),
    CASES[1:2] + [pytest.param(*case, marks=pytest.mark.slow) for case in (CASES[0], CASES[2])],
)
def test_a_motor_on_a_machine(name, stall, no_load, rotor, ratio):
    """ω(φ) at 40 angles against DOP853, with a gear and a rotor, a fan on the crank and all loads of the scene."""
    plain = machine(name)
    motor = line(
        no_load * ratio, 20 * stall / ratio, transmission=lj.Transmission(ratio=ratio), inertia=rotor / ratio**2
    )
    fan = lj.DragTorque("fan", plain.mechanism.driving_link, quadratic=1e-3 * stall / no_load)
    scene = dataclasses.replace(plain, motor=motor, loads=(*plain.loads, fan), target_delta=None, speed=0.9 * no_load)
    found = steady(scene, nodes=192)
    assert found.driven is not None and bool(found.driven.found)

    def extra(_, w):
        return 20 * stall * (1 - w / no_load) - 1e-3 * stall / no_load * w * w

    lap = shoot(dataclasses.replace(plain, target_delta=None), extra, float(found.mean_speed), rotor)
    size = np.max(lap.speeds(ANGLES))
    assert np.max(np.abs(speeds(found, scene, jnp.asarray(ANGLES)) - lap.speeds(ANGLES))) < 1e-9 * size
    assert float(found.period) == pytest.approx(lap.period, rel=1e-10)


@pytest.mark.slow
def test_power_both_ways_through_a_lossy_gear():
    """A light flywheel: power flows to the crank and back, with other losses. By DOP853 with events where the torque of
    the shaft changes its sign."""
    ratio, forward, back, rotor, pump = 3.0, 0.7, 0.6, 0.0005, 2.0
    gear = lj.Transmission(ratio, forward, back)
    scene = slider_crank(line(120.0, 4 / 3, transmission=gear, inertia=rotor), flywheel=0.0005, pump=pump)
    smooth = shooting.Fitted(dataclasses.replace(scene, loads=(), motor=None), 1e-13, 2 * math.pi - 1e-13)

    def state(phi, w):
        inertia, slope, torque = smooth(phi)
        net, motor = torque + _pump(phi, w, pump) - 0.5 * slope * w * w, 4 / 3 * (1 - ratio * w / 120)
        gain = ratio * (forward if inertia * motor > net * rotor * ratio else 1 / back)
        rate = (net + gain * motor) / (inertia + gain * rotor * ratio)
        return rate, motor - rotor * ratio * rate

    class Turns:
        """The power changes its direction."""

        terminal, direction = True, 0.0

        def __call__(self, phi, y):
            return state(phi, y[0])[1]

    def lap(w):
        y, phi, changes = [w, 0.0], 0.0, 0
        while phi < 2 * math.pi - 1e-9:
            turns = Turns()
            turns.direction = -np.sign(state(phi + 1e-9, y[0])[1])
            given = {"rtol": 1e-12, "atol": 1e-14, "events": turns, "max_step": 0.1}
            way = solve_ivp(lambda p, y: [state(p, y[0])[0] / y[0], 1 / y[0]], (phi, 2 * math.pi), y, "DOP853", **given)
            y, phi, changes = way.y[:, -1], way.t[-1] + 1e-12, changes + len(way.t_events[0])
        return y, changes

    w = 38.0
    for _ in range(14):
        w = lap(w)[0][0]
    (end, period), changes = lap(w)
    assert changes == 4 and abs(end - w) < 1e-10
    found = steady(scene)
    assert float(speeds(found, scene, jnp.zeros(1))[0]) == pytest.approx(w, rel=1e-10)
    assert float(found.period) == pytest.approx(period, rel=1e-10)
    assert float(found.delta_error) < 1e-10


@pytest.mark.slow
def test_a_constant_torque_against_a_pump():
    """Without a motor the drive torque is constant and gives the wanted mean speed, whatever the pump takes."""
    scene = slider_crank()
    found = steady(scene)
    assert found.driven is not None
    assert float(found.mean_speed) == pytest.approx(25.0, rel=1e-13)
    drive = float(found.mean_drive_torque)
    lap = shoot(dataclasses.replace(scene, loads=()), lambda phi, w: drive + _pump(phi, w, 5.0), 25.0)
    np.testing.assert_allclose(speeds(found, scene, jnp.asarray(ANGLES)), lap.speeds(ANGLES), rtol=1e-10)


def _pump(phi: float, speed: float, c: float) -> float:
    """Torque of the pump, from the closed form of the slider's velocity."""
    bow = math.sqrt(0.3**2 - (0.1 * math.sin(phi)) ** 2)
    slope = -0.1 * math.sin(phi) - 0.1**2 * math.sin(phi) * math.cos(phi) / bow
    return -c * slope**2 * speed


@pytest.mark.slow
def test_a_weak_damper_is_the_limit_of_none():
    """As the pump becomes weaker the motion tends to that by quadrature, which has no equation in the speed."""
    none = steady(slider_crank(pump=None))
    assert none.driven is None
    away = [abs(float(steady(slider_crank(pump=c)).delta - none.delta)) for c in (1e-3, 1e-6, 1e-9)]
    assert away[1] == pytest.approx(1e-3 * away[0], rel=5e-3)  # linear in c; the next term is c times as large
    assert away[2] < 1e-11


@pytest.mark.slow
def test_midrange_mean_with_a_pump():
    """The wanted mean speed is the mean of the extremes."""
    found = steady(slider_crank(mean="midrange"))
    assert 0.5 * float(found.max_speed + found.min_speed) == pytest.approx(25.0, rel=1e-11)
    assert float(found.mean_speed) == pytest.approx(25.0, rel=1e-11)


MEASURED = ("delta", "mean_speed", "period", "max_speed", "min_speed", "mean_drive_torque")


def several(scene: lj.Scene) -> jax.Array:
    found = steady_motion(scene)
    return jnp.stack([getattr(found, name) for name in MEASURED])


@pytest.mark.slow
@pytest.mark.parametrize("motor", [True, False])
def test_derivatives(motor):
    """Forward, reverse and fourth-order differences by every number of the machine, the pump and the motor."""
    scene = slider_crank(line(transmission=lj.Transmission(1.3, 0.95, 0.9), inertia=0.002) if motor else None)
    leaves = jax.tree.leaves(scene)
    size = np.asarray([abs(float(leaf)) or 0.03 for leaf in leaves])

    @compiled_soon
    def moved(scene, by):
        leaves, tree = jax.tree.flatten(scene)
        return several(jax.tree.unflatten(tree, [leaf + d for leaf, d in zip(leaves, by, strict=True)]))

    ahead = compiled_soon(jax.jacfwd(moved, argnums=1))(scene, jnp.zeros(len(leaves))) * size[None]
    back = compiled_soon(jax.jacrev(moved, argnums=1))(scene, jnp.zeros(len(leaves))) * size[None]
    norm = np.linalg.norm(back, axis=1, keepdims=True)
    assert np.max(np.abs(ahead - back) / norm) < 1e-12
    h, differences = 1e-3, []
    for i in range(len(leaves)):
        f = [np.asarray(moved(scene, h * k * size[i] * jnp.eye(len(leaves))[i])) for k in (-2, -1, 1, 2)]
        differences.append((f[0] - f[3] + 8 * (f[2] - f[1])) / (12 * h))
    assert np.max(np.abs(np.stack(differences, axis=1) - back) / norm) < 1e-6


@pytest.mark.slow
def test_a_motor_that_is_too_weak():
    """No steady-state motion is a result: finite, a negative margin with a slope, and an analysis that says so."""
    weak = slider_crank(lj.MotorDrive(lj.ConstantTorque(-0.1)))
    found, slope = compiled_soon(jax.value_and_grad(lambda s: steady_motion(s).steady_state_margin))(weak)
    assert float(found) < 0
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(slope))
    assert float(slope.motor.motor.value) > 0
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(steady(weak)))
    cycle = lj.analyse(weak, angles=8)
    assert cycle.missing is not None and "steady" in str(cycle.missing)


@pytest.mark.slow
def test_the_stated_error_with_motors():
    """Of thirty random motors and flywheels, from soft to stiff: never below the true error, rarely far above it."""
    rng = np.random.default_rng(5)
    designs = [
        slider_crank(line(float(no_load), float(stall)), flywheel=float(inertia), pump=float(pump), speed=0.7 * no_load)
        for no_load, stall, inertia, pump in zip(
            rng.uniform(20, 60, 30), 10 ** rng.uniform(0.3, 2, 30), 10 ** rng.uniform(-3, 0.5, 30),
            10 ** rng.uniform(-1, 0.7, 30), strict=True)
    ]  # fmt: skip
    ratios = []
    for scene in designs:
        truth = steady(scene, nodes=320)
        assert truth.driven is not None and bool(truth.driven.found)
        for nodes in (32, 48, 64, 96, 128):
            found = steady(scene, nodes=nodes)
            ratios.append(float(found.delta_error) / max(abs(float(found.delta - truth.delta)), 1e-11))
    assert min(ratios) >= 1
    assert np.mean(np.asarray(ratios) <= 1e3) >= 0.95 and max(ratios) <= 1e5


WANTED = {
    "line": (line(), 0.0),
    "knots": (lj.MotorDrive(lj.TableMotor((0.0, 10.0, 30.0, 40.0), (5.66, 3.4, 8.5, 0.0))), 1.16),
    "lossy": (line(120.0, 4 / 3, transmission=lj.Transmission(3.0, 0.7, 0.6), inertia=0.0005), 2.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WANTED)
@pytest.mark.parametrize("delta", [0.02, 0.15])
def test_flywheel_for_a_wanted_fluctuation_with_a_motor(name, delta):
    """The motion with the flywheel found has the wanted fluctuation, also where its kinks lie elsewhere than with the
    given one: knots of the motor, changes of the direction of the power through a lossy gear."""
    motor, pump = WANTED[name]
    scene = slider_crank(motor, pump=pump)
    needed = float(compiled_soon(lambda s: flywheel_for(s, delta))(scene))
    there = steady(slider_crank(motor, flywheel=needed, pump=pump), nodes=160)
    assert float(there.delta) == pytest.approx(delta, rel=1e-8)


@pytest.mark.slow
def test_knots_at_few_nodes():
    """A motor that passes a knot of its table four times per turn. Each kink is found once: its own panel edge is no
    second one. δ with few nodes is right within its stated error."""
    table = lj.TableMotor(speeds=(0.0, 10.0, 30.0, 40.0), torques=(5.66, 3.4, 8.5, 0.0))
    scene = slider_crank(lj.MotorDrive(table), flywheel=0.0102, pump=1.16)
    few, many = steady(scene, nodes=32), steady(scene, nodes=192)
    assert abs(float(few.delta - many.delta)) <= float(few.delta_error) < 1e-9


@pytest.mark.slow
def test_the_guess_of_a_grid_is_only_a_guess():
    """A motor with knots, whose motion is found on two grids in turn: from the first motion, without it, and from a
    wrong one it is the same."""
    table = lj.TableMotor(speeds=(0.0, 10.0, 30.0, 40.0), torques=(5.66, 3.4, 8.5, 0.0))
    machine = Sampler(ready(slider_crank(lj.MotorDrive(table), flywheel=0.0102, pump=1.16)))
    grid = grid_with_kinks(machine, 48)
    assert bool(grid.guess.known) and int(grid.guess.number) == 1
    wrong = dataclasses.replace(grid.guess, squares=9.0 * grid.guess.squares)
    at = at_nodes(machine, grid)
    one, two, three = (
        steady_on(machine, dataclasses.replace(grid, guess=guess), at) for guess in (grid.guess, None, wrong)
    )
    for other in (two, three):
        assert float(other.mean_speed) == pytest.approx(float(one.mean_speed), rel=1e-14)
        assert float(other.delta) == pytest.approx(float(one.delta), rel=1e-12)
