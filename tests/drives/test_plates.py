# pyright: reportArgumentType=false, reportOptionalMemberAccess=false
"""What type plates say: rated torque, breakdown torque, limits; the recommended δ by kind of machine."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax.drives import RECOMMENDED_DELTA, AbstractMotor, recommended_delta
from linkjax.scenes import loads_text, text_of
from tests.helpers import ROOT

PLATE = lj.InductionMotor(18500.0, 153.1, 157.08, 2.5, 2.0)
CIRCUIT = lj.InductionCircuit(230.0, 50.0, 2, 0.71, 0.54, 66.4, 1.52, 2.31, 180.0, 153.0)


@pytest.mark.parametrize("motor", [PLATE, CIRCUIT])
def test_the_breakdown_torque_is_the_greatest(motor):
    """Against the characteristic at many speeds; that of a circuit is the greatest before friction, which is small."""
    speeds = jnp.linspace(0.0, float(motor.no_load_speed()), 20001)
    limit = float(motor.torque_limit())
    assert limit == pytest.approx(float(jnp.max(motor.torque(speeds))), rel=1e-6 if motor is PLATE else 1e-4)


def test_rated_torques():
    assert float(PLATE.rated_torque()) == pytest.approx(18500.0 / 153.1, rel=1e-14)
    motor = lj.DCMotor.rated(100.0, 0.05, 100.0, 149.2)
    rated = motor.rated_torque()
    assert rated is not None and float(rated) == pytest.approx(float(motor.torque(jnp.asarray(149.2))), rel=1e-12)
    for other in (lj.DCMotor(100.0, 0.05, 0.6), lj.LineMotor(no_load=40.0, stall=2.0), lj.ConstantTorque(3.0), CIRCUIT):
        assert other.rated_torque() is None and other.speed_limit() is None
    assert lj.LineMotor(no_load=40.0, stall=2.0).torque_limit() is None
    servo: AbstractMotor = lj.Servo(300.0, 40.0)
    assert (servo.rated_torque(), float(servo.torque_limit()), float(servo.speed_limit())) == (None, 40.0, 300.0)


def test_a_rated_current_beside_the_constant():
    """A plate is written with its constant and its current, and read again as the same motor."""
    head = """\
speed = "60 rpm"
[fixed]
A = [0, 0]
[links.crank]
length = "100 mm"
mass = "1 kg"
[[groups]]
kind = "crank"
link = "crank"
pivot = "A"
end = "B"
[motor]
kind = "dc"
voltage = "100 V"
resistance = "0.05 ohm"
rated_current = "100 A"
"""
    one = loads_text(f'{head}rated_speed = "1425 rpm"\n')
    again = loads_text(text_of(one))
    assert one.motor is not None and again.motor is not None
    assert float(one.motor.motor.rated_torque()) == float(again.motor.motor.rated_torque())
    beside = loads_text(f'{head}constant = "0.6366 V s"\n').motor
    assert beside is not None and float(beside.motor.rated_torque()) == pytest.approx(63.66)
    with pytest.raises(ValueError, match="rated_current of a DC motor"):
        lj.DCMotor(100.0, 0.05, 0.6, -1.0)


def test_the_recommended_fluctuation():
    """The table of the documentation is the data; the source has reciprocals of whole numbers, rounded."""
    text = (ROOT / "docs/motors.md").read_text(encoding="utf-8")
    for kind, (low, high, drive) in RECOMMENDED_DELTA.items():
        shown = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        assert f"| {kind} | {drive} | {shown} |" in text
        assert 0 < low <= high < 1
        steadiness = np.asarray([1 / high, 1 / low])
        np.testing.assert_allclose(steadiness, np.round(steadiness), rtol=0.03)
    assert recommended_delta("pump").high == 0.05
    with pytest.raises(ValueError, match="did you mean 'pump'"):
        recommended_delta("pumps")
