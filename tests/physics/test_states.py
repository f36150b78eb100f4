"""All steady-state motions of a machine, stable and unstable, against SciPy."""

from __future__ import annotations

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import pytest
from scipy.interpolate import PchipInterpolator

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.motion import steady_motion, steady_states
from tests.physics.driven import line, shoot, slider_crank
from tests.physics.machines import machine

SPEEDS, TORQUES, BRAKE = (0.0, 10.0, 30.0, 40.0), (2.0, 1.0, 3.0, 0.0), 0.09
steady = compiled_soon(steady_motion)


def three_crossings() -> lj.Scene:
    """A fan crosses the characteristic of a motor three times."""
    motor = lj.MotorDrive(lj.TableMotor(speeds=SPEEDS, torques=TORQUES))
    scene = slider_crank(motor, pump=None, speed=35.0, flywheel=0.5)
    return dataclasses.replace(scene, loads=(lj.DragTorque("fan", "crank", linear=BRAKE),))


@pytest.mark.slow
def test_a_motor_with_three_crossings():
    """Two states are stable, and `speed` chooses one of them; the one between is unstable."""
    scene = three_crossings()
    states = steady_states(scene)
    assert [float(each.driven.multiplier) < 1 for each in states if each.driven] == [True, False, True]
    for each, speed in ((states[0], 12.0), (states[2], 35.0)):
        alone = steady(eqx.tree_at(lambda s: s.speed, scene, jnp.asarray(speed)))
        assert alone.driven is not None and int(alone.driven.number) == 2
        assert float(alone.mean_speed) == pytest.approx(float(each.mean_speed), rel=1e-11)
    plain, characteristic = dataclasses.replace(scene, loads=(), motor=None), PchipInterpolator(SPEEDS, TORQUES)
    for each in states:
        lap = shoot(plain, lambda _, w: float(characteristic(w)) - BRAKE * w, float(each.mean_speed))
        assert each.driven is not None
        assert float(each.period) == pytest.approx(lap.period, rel=1e-9)
        assert float(each.driven.multiplier) == pytest.approx(lap.multiplier, rel=1e-6)


@pytest.mark.slow
def test_a_range_of_speeds():
    scene = three_crossings()
    assert len(steady_states(scene, slowest=14.0, fastest=50.0)) == 2
    assert steady_states(scene, slowest=50.0, fastest=90.0) == ()


def test_states_need_a_motor_and_a_range():
    with pytest.raises(lj.StructureError, match="motor: there is none"):
        steady_states(machine("slider-crank"))
    with pytest.raises(lj.StructureError, match="9 rad/s is not between zero and 2 rad/s"):
        steady_states(slider_crank(line()), slowest=9.0, fastest=2.0)
