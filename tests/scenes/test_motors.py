"""The table `[motor]`: what is read is the motor of its kind, written and read again to the last bit; messages."""

from __future__ import annotations

import json
import math

import jax
import jax.numpy as jnp
import jsonschema
import numpy as np
import pytest

import linkjax as lj
from linkjax.design import DesignError, changed, number, numbers
from linkjax.drives import AbstractMotor
from linkjax.scenes import SceneError, json_schema, loads_text, text_of
from linkjax.scenes._write import table_of

RPM = 2 * math.pi / 60
SHAFT = """speed = "300 rpm"
[fixed]
A = [0, 0]
[links.crank]
length = "100 mm"
mass = "1 kg"
[flywheel]
inertia = "2 kg m^2"
[[groups]]
kind = "crank"
link = "crank"
pivot = "A"
end = "B"
"""
SWING = SHAFT.replace('end = "B"', 'end = "B"\nlaw = { start = "0 deg", stop = "60 deg" }').replace(
    '[flywheel]\ninertia = "2 kg m^2"\n', ""
)
CIRCUIT = """kind = "induction"
frequency = "50 Hz"
pole_pairs = 2
stator_resistance = "0.71 ohm"
rotor_resistance = "540 mΩ"
magnetizing_reactance = 66.4
stator_reactance = "1.52 V/A"
rotor_reactance = "2.31 ohm"
friction_power = "180 W"
friction_speed = "1462.5 rpm"
"""
PLATE = """kind = "induction"
rated_power = "18.5 kW"
rated_speed = "1462 rpm"
synchronous_speed = "1500 rpm"
breakdown_ratio = 2.5
"""
CASES = {  # keys, motor, a speed (rad/s) and the torque there (N m)
    "none": ('kind = "none"', lj.NoMotor, 3.0, 0.0),
    "torque": ('kind = "torque"\ntorque = "-3 N m"', lj.ConstantTorque, 3.0, -3.0),
    "line": ('kind = "line"\npoints = [["1200 rpm", "0 N m"], ["1120 rpm", "176 N m"]]', lj.LineMotor, 1160 * RPM, 88),
    "no load": ('kind = "line"\nno_load_speed = "60 rpm"\nstall_torque = 8', lj.LineMotor, math.pi, 4.0),
    "table": ('kind = "table"\nspeeds = [0, "10 rad/s"]\ntorques = ["4 N m", 2]', lj.TableMotor, 5.0, 3.0),
    "dc": ('kind = "dc"\nvoltage = "100 V"\nresistance = "0.05 ohm"\nconstant = "0.5 N m/A"', lj.DCMotor, 190.0, 50.0),
    "dc by plate": ('kind = "dc"\nvoltage = "0.1 kV"\nresistance = 0.05\nrated_current = "100 A"\n'
                    'rated_speed = "1425 rpm"', lj.DCMotor, 1425 * RPM, 63.6619772367581),
    "plate": (PLATE, lj.InductionMotor, 1462 * RPM, 18500 / (1462 * RPM)),
    "plate and start": (PLATE + "starting_ratio = 2.0\nq = 0.3", lj.InductionMotor, 0.0, 2 * 18500 / (1462 * RPM)),
    "circuit": (CIRCUIT + 'line_voltage = "400 V"\nconnection = "delta"', lj.InductionCircuit, 1462.5 * RPM, None),
    "circuit by phase": (CIRCUIT + 'phase_voltage = "400 V"', lj.InductionCircuit, 1462.5 * RPM, None),
}  # fmt: skip
GEAR = "\nratio = 4.5\nefficiency = 0.9\nefficiency_back = 0.8\ncreep = 0.02\n"


def scene(keys: str) -> lj.Scene:
    return loads_text(f"{SHAFT}[motor]\n{keys}\n")


@pytest.mark.parametrize("gear", ["", GEAR + 'inertia = "0.12 kg m^2"', '\ngd2 = "0.48 kg m^2"'])
@pytest.mark.parametrize("name", CASES)
def test_read_and_written_to_the_last_bit(name, gear):
    keys, kind, speed, torque = CASES[name]
    made = scene(keys + gear)
    assert made.motor is not None
    motor = made.motor.motor
    assert isinstance(motor, kind) and isinstance(motor, AbstractMotor)
    got = float(motor.torque(jnp.asarray(speed)))
    assert got == pytest.approx(torque if torque is not None else 122.0, rel=1e-12 if torque is not None else 0.03)
    assert float(made.motor.inertia) == pytest.approx(0.12 if gear else 0.0)
    assert float(made.motor.transmission.ratio) == (4.5 if "ratio" in gear else 1.0)
    again = loads_text(text_of(made))
    assert jax.tree.structure(again) == jax.tree.structure(made)
    assert all(np.array_equal(a, b) for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(made), strict=True))
    schema = jsonschema.Draft202012Validator(json.loads(json.dumps(json_schema())))
    assert not list(schema.iter_errors(table_of(made)))
    assert "motor " in str(made) and type(motor).__name__ in str(made)


@pytest.mark.parametrize("keys", ["", 'kind = "balance"'])
def test_the_torque_that_balances_is_no_motor(keys):
    assert scene(keys).motor is None
    assert jax.tree.structure(scene(keys)) == jax.tree.structure(loads_text(SHAFT))
    assert "motor" not in text_of(scene(keys))


def test_a_motor_by_changes_of_keys():
    made = lj.load("hay-press", {"motor.kind": "torque", "motor.torque": "3 N m", "motor.ratio": 3}).motor
    assert made is not None and isinstance(made.motor, lj.ConstantTorque) and float(made.transmission.ratio) == 3
    made = lj.load("hay-press", {"motor": {"kind": "dc", "voltage": 24, "resistance": 0.5, "constant": 0.1}}).motor
    assert made is not None and isinstance(made.motor, lj.DCMotor)
    for key in ("motor.torque", "motor.ratio"):
        with pytest.raises(SceneError, match="kind"):
            lj.load("hay-press", {key: 3})


def test_gd2_by_its_unit():
    for text in ("0.48 kg m^2", "4.707192 N m^2", "0.48 kp m^2"):
        made = scene(f'kind = "none"\ngd2 = "{text}"').motor
        assert made is not None and float(made.inertia) == pytest.approx(0.12, rel=1e-12)


def test_a_servo():
    servo = '[motor]\nkind = "servo"\nmax_speed = "3000 rpm"\nmax_torque = "40 N m"\n'
    made = loads_text(SWING + servo).motor
    assert made is not None and isinstance(made.motor, lj.Servo)
    assert loads_text(f"constant_speed = true\n{SHAFT}{servo}").motor is not None
    for text, part in ((SHAFT + servo, "follows a motion law"), (SWING + '[motor]\nkind = "none"\n', "no effect")):
        with pytest.raises(SceneError, match=part) as caught:
            loads_text(text)
        assert caught.value.key == "motor"


def test_numbers_are_design_variables():
    """Every number of a motor has the name of its key, its unit, and is changed in its place."""
    table = scene(CASES["table"][0] + GEAR)
    names = [name.removeprefix("motor.") for name in numbers(table) if name.startswith("motor.")]
    assert names == ["speeds[0]", "speeds[1]", "torques[0]", "torques[1]", "ratio", "efficiency", "efficiency_back",
                     "creep", "inertia"]  # fmt: skip
    new = changed(table, {"motor.torques[1]": "1 N m", "motor.ratio": 6.0, "motor.inertia": "0.2 kg m^2"}).motor
    assert new is not None and isinstance(new.motor, lj.TableMotor)
    assert float(new.motor.torques[1]) == 1.0 and float(new.inertia) == 0.2 and float(new.transmission.ratio) == 6.0
    line = scene(CASES["line"][0])
    assert number(line, "motor.points[1][0]").unit == "rad/s" and number(line, "motor.points[1][1]").unit == "N m"
    assert float(number(line, "motor.points[1][1]").read(line)) == 176.0
    for name, key, unit in (("no load", "no_load_speed", "rad/s"), ("no load", "stall_torque", "N m"),
                            ("torque", "torque", "N m"), ("dc", "constant", "V s"), ("plate", "rated_power", "W"),
                            ("plate", "breakdown_ratio", "1"), ("circuit", "frequency", "Hz")):  # fmt: skip
        assert number(scene(CASES[name][0]), f"motor.{key}").unit == unit
    volts = changed(scene(CASES["dc"][0]), {"motor.voltage": "90 V", "motor.constant": "500 N mm/A"}).motor
    assert volts is not None and float(volts.motor.torque(jnp.zeros(()))) == pytest.approx(900.0)
    with pytest.raises(DesignError, match="is not a scene parameter"):
        number(loads_text(SHAFT), "motor.ratio")


@pytest.mark.parametrize(
    ("keys", "key", "says"),
    [
        ('kind = "diesel"', "motor.kind", "not a known kind of motor"),
        ('ratio = 2\ntorque = "3 N m"', "motor.kind", 'add kind = "torque", "line"'),
        ('kind = "torque"', "motor.torque", 'add torque = "60 N m"'),
        ('kind = "torque"\ntorque = "3 N"', "motor.torque", "a force where a torque is needed"),
        ('kind = "torque"\ntorque = 3\nefficiency = 1.2', "motor.efficiency", "above one; write e.g. 0.95"),
        ('kind = "torque"\ntorque = 3\ncreep = 1', "motor.creep", "write a part of the speed"),
        ('kind = "torque"\ntorque = 3\nratio = 0', "motor.ratio", "must be greater than zero"),
        ('kind = "balance"\ntorque = "3 N m"', "motor.torque", 'only a motor of the kind "torque" has this key: write'),
        ('kind = "torque"\ntorque = 3\ngear_ratio = 2', "motor.gear_ratio", "did you mean 'ratio'?"),
        ('kind = "torque"\ntorque = 3\ngd2 = 3', "motor.gd2", "GD² without a unit"),
        ('kind = "torque"\ntorque = 3\ngd2 = "3 kg"', "motor.gd2", "24 N m^2"),
        ('kind = "torque"\ntorque = 3\ngd2 = "3 kg m^2"\ninertia = 1', "motor.gd2", "given twice"),
        ('kind = "line"', "motor", "has points, or no_load_speed and stall_torque"),
        ('kind = "line"\nstall_torque = 3', "motor", "has points, or no_load_speed and stall_torque"),
        ('kind = "line"\npoints = [["1 rpm", 3]]', "motor.points", "a list of 1 where two values are needed"),
        ('kind = "line"\npoints = [["1 rpm", 3], ["1 rpm", 2]]', "motor", "write two speeds"),
        ('kind = "line"\npoints = [["1 m", 3], ["1 rpm", 2]]', "motor.points[0][0]", "a length where a speed"),
        ('kind = "table"\nspeeds = [0, 1]\ntorques = [1]', "motor", "a torque for each"),
        ('kind = "table"\nspeeds = [1, 1]\ntorques = [1, 2]', "motor", "do not increase"),
        ('kind = "dc"\nvoltage = "1 V"\nresistance = "1 ohm"', "motor", "has constant, or constant and rated_current"),
        ('kind = "dc"\nvoltage = "1 A"\nresistance = "1 ohm"\nconstant = 1', "motor.voltage", "a current where a volt"),
        (PLATE.replace("1462", "1562"), "motor.rated_speed", "(1562 rpm), not below the synchronous"),
        (PLATE.replace("2.5", "0.9"), "motor.breakdown_ratio", "not above one"),
        (PLATE + "starting_ratio = 3", "motor.starting_ratio", "not below its breakdown_ratio"),
        (CIRCUIT, "motor", "has phase_voltage, or line_voltage and connection"),
        (CIRCUIT + "phase_voltage = 400\npoles = 4", "motor.poles", "half the number of poles"),
        (CIRCUIT.replace("= 2\n", "= 2.5\n") + "phase_voltage = 400", "motor.pole_pairs", "half the number of poles"),
    ],
)
def test_messages(keys, key, says):
    with pytest.raises(SceneError) as caught:
        scene(keys)
    message = str(caught.value)
    assert caught.value.key == key and says in message, message
    assert "\n" not in message and len(message) < 500


@pytest.mark.slow
def test_an_analysis_with_a_motor():
    """What does not depend on the motor is as without it."""
    made, plain = scene(CASES["dc"][0]), loads_text(SHAFT)
    one, two = (lj.analyse(each, angles=8) for each in (made, plain))
    np.testing.assert_allclose(one.pose.points["B"].r.x, two.pose.points["B"].r.x, rtol=1e-15)


def test_a_flywheel_on_another_shaft():
    """It counts with the square of the ratio: 2 kg m² at 4.5 times the crank speed are 40.5 kg m² on the crank."""
    made = loads_text(SHAFT.replace('inertia = "2 kg m^2"', 'inertia = "2 kg m^2"\nratio = 4.5'))
    assert float(made.mechanism.flywheel.inertia) == 40.5
    assert float(loads_text(text_of(made)).mechanism.flywheel.inertia) == 40.5
    with pytest.raises(SceneError, match=r"flywheel\.ratio"):
        loads_text(SHAFT.replace('inertia = "2 kg m^2"', 'inertia = "2 kg m^2"\nratio = 0'))
