"""Hard cases of driven motion: soft to stiff motors, short blows, standstills, power that flows back; against SciPy."""

from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.motion import Steady, steady_motion
from tests.physics.driven import line, shoot, slider_crank

steady = compiled_soon(steady_motion, static=("nodes",))
ANGLES = np.linspace(0.05, 2 * math.pi, 40)
NONE = (0.0, 1.0, 2.0)  # torque (N m), from and to an angle (rad)


@compiled_soon
def speeds(motion: Steady, scene: lj.Scene, angles: jax.Array) -> jax.Array:
    return jax.vmap(lambda phi: motion.at(scene, motion.grid.place(phi))[0])(angles)


def driven(stall: float, flywheel: float, one=NONE, two=NONE, no_load: float = 40.0, drag: float = 1e-3) -> lj.Scene:
    """A slider-crank with a fan, two torques on its crank in windows, and a motor with a straight characteristic."""
    scene = slider_crank(line(no_load, stall), flywheel, pump=None, speed=no_load)
    loads = [
        lj.Torque(name, "crank", torque=size, window=lj.Window(jnp.asarray(on), jnp.asarray(off)))
        for name, (size, on, off) in (("one", one), ("two", two))
    ]
    return dataclasses.replace(scene, loads=(*loads, lj.DragTorque("fan", "crank", linear=drag)))


def agrees(
    scene: lj.Scene,
    stall: float,
    no_load: float = 40.0,
    drag: float = 1e-3,
    to: float = 1e-9,
    layer: float = 0.0,
    **how,
) -> Steady:
    """The motion of a scene, whose speeds, period and δ agree with those by SciPy. A jump of the
    load is followed by a short layer if the motor is stiff, where speeds may be off by more than δ, by `layer`."""
    found = steady(scene, nodes=192)
    assert found.driven is not None and bool(found.driven.found)
    plain = dataclasses.replace(scene, loads=scene.loads[:2], motor=None)
    start = float(speeds(found, scene, found.grid.edges[:1])[0])
    lap = shoot(plain, lambda _, w: stall * (1 - w / no_load) - drag * w, start, **how)
    expected, size = lap.speeds(ANGLES), np.max(lap.speeds(ANGLES))
    assert np.max(np.abs(speeds(found, scene, jnp.asarray(ANGLES)) - expected)) < max(to, layer) * size
    assert float(found.period) == pytest.approx(lap.period, rel=to)
    assert float(found.driven.multiplier) == pytest.approx(lap.multiplier, abs=1e-4 if how else 1e-6)
    jumps = (np.asarray(found.grid.edges)[:, None] + np.asarray([-1e-9, 1e-9])).ravel()
    dense = lap.speeds(np.concatenate([np.linspace(0, scene.cycle, 20001), jumps]))
    away = abs(np.ptp(dense) / float(found.mean_speed) - float(found.delta))
    assert away <= max(1e-6 * float(found.delta), float(found.delta_error)) + to  # a dense sample misses the extreme
    return found


@pytest.mark.slow
@pytest.mark.parametrize("stall", [0.6, 10.0, 200.0, 4e3, 8e4, 5e5])
def test_time_constants_over_six_decades(stall):
    """From a second to a microsecond, on a machine that turns in a sixth of a second."""
    how = {"method": "Radau", "rtol": 1e-11} if stall > 100 else {}
    found = agrees(driven(stall, 0.01, (-0.05, 1.0, 3.0)), stall, layer=1e-6 if how else 0.0, **how)
    assert found.driven is not None
    assert 0 <= float(found.driven.multiplier) < 1


@pytest.mark.slow
def test_a_load_of_ten_thousand_times_its_mean():
    """In a window of 0.036 degrees, at whose end the speed is least."""
    width = math.radians(0.036)
    found = agrees(driven(2.0, 0.05, (-4000.0, 2.0, 2.0 + width)), 2.0, to=1e-8)
    assert abs(math.remainder(float(found.angle_of_min) - 2.0 - width, 2 * math.pi)) < 1e-9


@pytest.mark.slow
def test_switches_that_coincide():
    agrees(driven(2.0, 0.05, (-1.0, 1.0, 2.5), (0.8, 2.5, 4.0)), 2.0)
    agrees(driven(2.0, 0.05, (-1.0, 1.0, 2.5), (0.8, 1.0, 2.5)), 2.0)


@pytest.mark.slow
def test_no_flywheel():
    agrees(driven(0.6, 0.0, (-0.02, 1.0, 3.0)), 0.6)


@pytest.mark.slow
def test_a_load_that_drives_the_motor():
    """The motor brakes: it turns faster than without a load, and its work is negative."""
    found = agrees(driven(2.0, 0.05, (1.0, 0.5, 6.0)), 2.0)
    assert float(found.mean_speed) > 40 and float(found.mean_drive_torque) < 0


@pytest.mark.slow
def test_two_turns_a_cycle_with_a_motor():
    """A stroke in every second turn."""
    scene = dataclasses.replace(driven(2.0, 0.05, (-1.0, 7.0, 8.5)), cycle_turns=2)
    found = agrees(scene, 2.0)
    assert float(found.period) == pytest.approx(4 * math.pi / float(found.mean_speed), rel=1e-12)


@pytest.mark.slow
def test_a_motor_that_is_too_weak():
    """The load takes 3 rad · 8 N m in every turn, more than the motor gives at the slowest speed looked at, 0.02 times
    the nominal one; no flywheel helps."""
    scene = dataclasses.replace(driven(2.0, 0.05, (-8.0, 1.0, 4.0)), target_delta=0.1)
    lack = 24.0 - 2 * math.pi * (2.0 * 0.98 - 1e-3 * 0.8)
    found = steady(scene, nodes=192)
    assert found.driven is not None and not bool(found.driven.found)
    assert float(found.driven.gain) == pytest.approx(-lack, rel=1e-9)
    assert float(found.steady_state_margin) < 0 and float(found.angle_of_min) == pytest.approx(4.0, rel=1e-12)
    cycle = lj.analyse(scene, angles=36, throw=False)
    assert cycle.missing is not None and cycle.flywheel is None
    assert f"{lack:.4g} J are missing in the cycle" in cycle.missing.reason
    assert "flywheel" not in cycle.missing.reason


@pytest.mark.slow
def test_a_flywheel_too_small_for_the_stroke():
    """The motor carries the work of 10 J in every turn, but without a flywheel the machine stops in the middle of it.
    The message names the flywheel with which it runs, and it does."""
    scene = dataclasses.replace(driven(4.0, 0.0, (-20.0, 1.0, 1.5)), target_delta=0.1)
    cycle = lj.analyse(scene, angles=36, throw=False)
    assert cycle.missing is not None and cycle.flywheel is not None and cycle.flywheel.for_target_delta is not None
    need = float(cycle.flywheel.for_target_delta)
    assert f"a flywheel of {need:.4g} kg m^2" in cycle.missing.reason and "cannot carry" in cycle.missing.reason
    found = agrees(driven(4.0, need, (-20.0, 1.0, 1.5)), 4.0)
    assert float(found.delta) == pytest.approx(0.1, rel=1e-8)
    without = lj.analyse(driven(4.0, 0.0, (-20.0, 1.0, 1.5)), angles=36, throw=False)
    assert without.missing is not None and "add a flywheel, or" in without.missing.reason
