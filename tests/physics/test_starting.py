"""Measures of a start from rest: closed forms, a run, derivatives, machines that do not start."""

from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.measures import evaluate, measure_names, named
from tests.helpers import assert_gradients_agree
from tests.physics.driven import line, slider_crank

INERTIA, NO_LOAD, STALL, BRAKE = 0.6, 40.0, 12.0, 5.0


def wheel(inertia=INERTIA, stall=STALL, brake=BRAKE) -> lj.Scene:
    """A wheel with a line motor, against a constant torque."""
    links = {"wheel": lj.Link(length=0.1, inertia=inertia)}
    mechanism = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, [lj.Crank("wheel", "A", "B")], lj.Flywheel(0.0))
    load = lj.OpposingTorque("brake", "wheel", magnitude=brake)
    motor = lj.MotorDrive(lj.LineMotor(no_load=NO_LOAD, stall=stall))
    return lj.Scene(mechanism, (load,), speed=25.0, motor=motor)


def both(numbers) -> jax.Array:
    found = evaluate(wheel(*numbers), ["run_up_time", "starting_torque_margin"])
    return jnp.stack([found["run_up_time"], found["starting_torque_margin"]])


values = compiled_soon(both)


TIME = INERTIA * NO_LOAD / STALL * math.log(100)


@pytest.mark.slow
def test_a_wheel():
    """ω = ω_s (1 - exp(-t / τ)) with τ = J ω_0 / T_0: 99 % after τ ln 100."""
    found = evaluate(wheel(), ["run_up_time", "starting_torque_margin"])
    assert float(found["run_up_time"]) == pytest.approx(TIME, rel=1e-9)
    assert float(found["starting_torque_margin"]) == pytest.approx(STALL / BRAKE - 1, rel=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("way", [jax.jacfwd, jax.jacrev])
def test_derivatives_of_a_wheel(way):
    """In closed form, forward and reverse; a motion that starts at rest has the derivatives of a very slow start."""
    slopes = compiled_soon(way(both))(jnp.asarray([INERTIA, STALL, BRAKE]))
    expected = [[TIME / INERTIA, -TIME / STALL, 0.0], [0.0, 1 / BRAKE, -STALL / BRAKE**2]]
    np.testing.assert_allclose(slopes, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_a_wheel_that_does_not_start():
    """An infinite time without slope, a negative margin with one."""
    numbers = jnp.asarray([INERTIA, STALL, 1.5 * STALL])
    time, margin = values(numbers)
    assert float(time) == math.inf and float(margin) == pytest.approx(-1 / 3)
    slopes = np.asarray(compiled_soon(jax.jacrev(both))(numbers))
    assert np.all(slopes[0] == 0) and slopes[1, 1] == pytest.approx(1 / (1.5 * STALL))


@pytest.mark.slow
def test_a_slider_crank():
    """The time of a run, from two crank angles; forward and reverse derivatives and differences."""
    scene = slider_crank(line(stall=4.0), gravity=lj.Vec(0.0, -9.81))
    found = evaluate(scene, ["run_up_time", "run_up_time@90deg", "starting_torque_margin"])
    for name, angle in (("run_up_time", 0.0), ("run_up_time@90deg", math.pi / 2)):
        run = lj.run(scene, start_angle=angle, time=1.5 * float(found[name]), points=31)
        assert float(found[name]) == pytest.approx(float(run.run_up_time), rel=1e-9)
    assert float(found["starting_torque_margin"]) == float(lj.starting_torque(scene).margin)
    numbers = jnp.asarray([0.01, 4.0, 5.0])

    def time(numbers):
        motor = line(stall=numbers[1])
        made = slider_crank(motor, flywheel=numbers[0], pump=numbers[2], gravity=lj.Vec(0.0, -9.81))
        return named("run_up_time@90deg")(made)

    rng = np.random.default_rng(2)
    assert_gradients_agree(time, numbers, rng, forward=1e-8, difference=1e-5, step=3e-4, directions=2)


def test_scenes_without_a_start():
    free = dataclasses.replace(wheel(), motor=None)
    for name in ("run_up_time", "starting_torque_margin"):
        assert name in measure_names(wheel()) and name not in measure_names(free)
        with pytest.raises(lj.StructureError, match="no motor to start it"):
            evaluate(free, [name])
    with pytest.raises(lj.StructureError, match="is one value of the whole cycle"):
        evaluate(wheel(), ["starting_torque_margin@60deg"])
    with pytest.raises(lj.StructureError, match="no motor to start it"):
        lj.run_up_time(free)
