"""Runs with friction: closed forms, static friction, a machine that locks on its way, an independent integration."""

from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.design import changed, numbers
from linkjax.friction import GuideFriction, PinFriction, Thrust, everywhere
from tests.physics import rubbed
from tests.physics.test_friction import crank_slider

J, COUPLE = 0.5, 2.0  # flywheel (kg m²), and the couple of its thrust face (N m)


def spinner(torque: float = 0.0, static: float | None = None) -> lj.Scene:
    """A flywheel with a thrust face, and a motor of this torque at rest, if any."""
    mechanism = lj.Mechanism(
        {"A": lj.Vec(0.0, 0.0)}, {"crank": lj.Link(length=0.1)}, (lj.Crank("crank", "A", "B"),), lj.Flywheel(J)
    )
    face = Thrust(1000.0, 0.03, COUPLE / 20.0, bearing="unworn")  # 2/3 R f Q
    motor = lj.MotorDrive(lj.LineMotor(no_load=20.0, stall=torque)) if torque else None
    rubs = (PinFriction("A", 0.0, 0.01, thrust=face, static=static),)
    return lj.Scene(mechanism, speed=10.0, friction=rubs, motor=motor)


@pytest.mark.slow
def test_run_down():
    """The couple of friction is constant: standstill after J ω / M, and at ½ J ω² / M."""
    found = lj.run(spinner(), start_speed=10.0)
    assert bool(found.stopped)
    assert found.stop_time == pytest.approx(J * 10.0 / COUPLE, rel=1e-12)
    assert found.stop_angle == pytest.approx(0.5 * J * 100.0 / COUPLE, rel=1e-12)
    assert found.energies is not None
    assert found.energies.loads["friction"][-1] == pytest.approx(-0.5 * J * 100.0, rel=1e-12)


@pytest.mark.slow
def test_run_up():
    """With the line T₀ (1 - ω / n) it approaches n (1 - M / T₀), with 99 % after the time J n / T₀ ln 100."""
    scene = spinner(8.0)
    expected = J * 20.0 / 8.0 * math.log(100.0)
    assert lj.run_up_time(scene) == pytest.approx(expected, rel=1e-9)
    margin = lj.starting_torque(scene)
    assert margin.load_torque == pytest.approx(COUPLE, rel=1e-12)
    assert margin.margin == pytest.approx(8.0 / COUPLE - 1, rel=1e-12)


def slider(torque: float, guide: float, static: float | None = None) -> lj.Scene:
    """A light slider-crank against a force, with friction in its guide, and a motor."""
    scene = crank_slider(force=0.0, masses=(0.1, 0.0, 0.3))
    load = lj.OpposingForce("push", "slider", "D", magnitude=100.0)
    motor = lj.MotorDrive(lj.LineMotor(no_load=40.0, stall=torque))
    return dataclasses.replace(
        scene, loads=(load,), motor=motor, friction=(GuideFriction("slider", guide, static=static),)
    )


@pytest.mark.slow
@pytest.mark.parametrize("way", [1.0, 0.999])
def test_static_friction_decides_the_start(way):
    """At 60° the crank needs F r sin(θ + β) / (cos β - f sin β): with the static coefficient, although less keeps it in
    motion."""
    theta, f = math.radians(60.0), 0.8
    beta = math.asin(math.sin(theta) / 3)
    needed = 10.0 * math.sin(theta + beta) / (math.cos(beta) - f * math.sin(beta))
    found = lj.run(slider(needed * (2 - way) * (1 + 1e-9 if way == 1.0 else 1), 0.1, f), start_angle=theta, time=0.05)
    idle = lj.run(slider(needed * way * (1 - 1e-9), 0.1, f), start_angle=theta, time=0.05)
    assert bool(found.starts) and not bool(found.stopped)
    assert not bool(idle.starts) and not np.any(idle.speed)
    assert lj.starting_torque(slider(50.0, 0.1, f)).load_torque >= needed


def test_a_machine_that_locks_stops_there():
    """The guide locks where f tan β reaches one, soon after it with masses that push on: the crank stops at once,
    although its flywheel has most of its energy."""
    f = 4.0
    limit = math.asin(3 * math.sin(math.atan(1 / f)))
    scene = slider(100.0, f)
    heavy = dataclasses.replace(scene.mechanism, flywheel=lj.Flywheel(0.5))
    free = dataclasses.replace(scene.with_mechanism(heavy), motor=None)
    found = lj.run(free, start_angle=0.1, start_speed=30.0, time=0.05)
    assert bool(found.stopped)
    assert limit < found.stop_angle < limit + 0.01
    just = int(np.sum(np.asarray(found.time) < float(found.stop_time))) - 1
    assert found.speed[just] > 20.0 and found.time[just + 1] - found.time[just] == pytest.approx(1e-4, rel=1e-9)
    assert found.energies is not None
    assert found.energies.error < 1e-9
    assert lj.starting_torque(scene).load_torque == math.inf


@pytest.mark.slow
def test_an_independent_integration():
    """Newton-Euler equations of all links, repeated until frictions agree, integrated by DOP853."""
    scene = slider(30.0, 0.2)
    scene = dataclasses.replace(scene, friction=everywhere(scene.mechanism, 0.1, 0.01, 0.2))
    motor, end = scene.motor, 0.04
    assert motor is not None

    def rate(_, state):
        phi, speed = (np.asarray([part]) for part in state)

        def missing(gain):
            needed = rubbed.solve(scene, phi, speed, np.asarray([gain])).solution.drive[0]
            return float(needed) - 30.0 * (1 - state[1] / 40.0)

        return [state[1], brentq(missing, -3e4, 3e4, xtol=1e-9)]

    known = solve_ivp(rate, (0.0, end), [0.2, 20.0], "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    found = lj.run(scene, start_angle=0.2, start_speed=20.0, time=end, points=3)
    assert 0.8 < known[0] < 1.5
    assert (float(found.angle[-1]), float(found.speed[-1])) == pytest.approx(tuple(known), rel=1e-9)
    assert found.energies is not None
    assert found.energies.error < 1e-10


@pytest.mark.slow
def test_derivatives_of_a_run_up():
    """By static and kinetic coefficients and the radius: forward as reverse, and as differences."""
    scene = slider(60.0, 0.2)
    scene = dataclasses.replace(scene, friction=everywhere(scene.mechanism, 0.1, 0.01, 0.2))
    names = ("joints.B.radius", "joints.slider.guide.coefficient", "links.rod.length")
    first = jnp.stack([numbers(scene)[name].read(scene) for name in names])

    def value(given):
        return lj.run_up_time(changed(scene, dict(zip(names, given, strict=True))), 0.5)

    slopes = compiled_soon(lambda x: (jax.jacfwd(value)(x), jax.grad(value)(x)))
    ahead, back = (np.asarray(each) for each in slopes(first))
    np.testing.assert_allclose(ahead, back, rtol=1e-6)  # both are those of steps of an integrator
    single = compiled_soon(value)
    for i, size in enumerate(np.asarray(first)):
        h = 1e-4 * size
        low, high = (float(single(first.at[i].add(step))) for step in (-h, h))
        assert (high - low) / (2 * h) == pytest.approx(ahead[i], rel=1e-6)
