"""Quantities as strings: values to the last digit, and refused strings."""

import math
import subprocess
import sys
from fractions import Fraction

import pytest

from linkjax.scenes import QuantityError, quantity
from tests.helpers import ROOT

EXACT = [  # string, dimension, SI value as a fraction
    ("300 mm", "length", Fraction(3, 10)),
    ("570 mm", "length", Fraction(57, 100)),
    (" 1_000.5cm ", "length", Fraction(10005, 1000)),
    ("-.5e1 in", "length", -5 * Fraction(254, 10000)),
    ("12 feet", "length", 12 * Fraction(3048, 10000)),
    ("3 µm", "length", Fraction(3, 10**6)),
    ("2 metres", "length", Fraction(2)),
    ("1 lb", "mass", Fraction(45359237, 10**8)),
    ("2.5 t", "mass", Fraction(2500)),
    ("5 g", "mass", Fraction(5, 1000)),
    ("0.65 kg m^2", "inertia", Fraction(65, 100)),
    ("0.65 kg·m²", "inertia", Fraction(65, 100)),
    ("65e4 g*mm**2", "inertia", Fraction(65, 10**5)),
    ("6.5 kg cm2", "inertia", Fraction(65, 10**5)),
    ("9.81 m/s^2", "acceleration", Fraction(981, 100)),
    ("9.81 m s^-2", "acceleration", Fraction(981, 100)),
    ("9.81 m/s/s", "acceleration", Fraction(981, 100)),
    ("7.85 g/cm^3", "density", Fraction(7850)),
    ("600 mm^2", "area", Fraction(6, 10**4)),
    ("30 kN", "force", Fraction(30000)),
    ("2 kp", "force", 2 * Fraction(980665, 100000)),
    ("60 Nm", "torque", Fraction(60)),
    ("0.06 kN m", "torque", Fraction(60)),
    ("60 J", "torque", Fraction(60)),
    ("30 deg", "angle", Fraction(math.pi) / 6),
    ("-335°", "angle", -335 * Fraction(math.pi) / 180),
    ("0.25 turn", "angle", Fraction(math.pi) / 2),
    ("1.5 rad", "angle", Fraction(3, 2)),
    ("700 rpm", "speed", 700 * Fraction(math.pi) / 30),
    ("2 rev/s", "speed", 4 * Fraction(math.pi)),
    ("73.27 rad/s", "speed", Fraction(7327, 100)),
    ("0.15", "number", Fraction(15, 100)),
    ("0", "length", Fraction(0)),
    (0, "angle", Fraction(0)),
    (3, "length", Fraction(3)),
    (0.3, "mass", Fraction(0.3)),
]


@pytest.mark.parametrize(("value", "dimension", "exact"), EXACT, ids=lambda x: str(x)[:20])
def test_values_are_the_nearest_floats(value, dimension, exact):
    assert quantity(value, dimension) == float(exact)


WRONG = [  # value, dimension, parts of the message
    ("30 kg", "length", "a mass where a length is needed", '"300 mm"'),
    ("5 Hz", "speed", "a frequency where a speed of rotation is needed", '"700 rpm"'),
    ("5 kg/m", "mass", "a quantity in kg/m where a mass is needed", '"5 kg"'),
    ("15 deg", "number", "an angle where a plain number is needed", "0.15"),
    ("0 kg", "length", "a mass where a length is needed", '"300 mm"'),
    ("3 mmm", "length", "unknown unit 'mmm'", "did you mean 'mm'?"),
    ("3 MM", "length", "unknown unit 'MM'", "known here"),
    ("3 Ns", "force", "unknown unit 'Ns'", '"30 kN"'),
    ("300", "length", "a number without a unit", "a number without quotes is in m"),
    ("30", "angle", "a number without a unit", '"30 deg"'),
    (30, "angle", "an angle without a unit", '"30 deg" or "30 rad"'),
    (1e-9, "angle", "an angle without a unit", '"1e-09 rad"'),
    ("0,3 m", "length", "cannot be read", "decimal point"),
    ("three", "length", "cannot be read", '"300 mm"'),
    ("", "length", "cannot be read", '"300 mm"'),
    ("1/50", "number", "not a plain number", "write 0.02"),
    ("1430 1/min", "speed", "turns per minute are called rpm", 'write "1430 rpm"'),
    ("1430 min^-1", "speed", "turns per minute are called rpm", 'write "1430 rpm"'),
    ("2 %", "number", "not a plain number", "write 0.02"),
    ("1/2 in", "length", "cannot read the unit '/2 in'", "divide by /"),
    ("3 m/", "length", "cannot read the unit", "divide by /"),
    ("3 * m", "length", "cannot read the unit", "divide by /"),
    ("3 m^99", "length", "cannot read the unit", "raise by ^"),
    ("3 m_", "length", "cannot read the unit", "raise by ^"),
    ("9**9**9 m", "length", "cannot read the unit", "raise by ^"),
    ("3 " + "m " * 40, "length", "cannot read the unit", "raise by ^"),
    ("nan m", "length", "not a finite number", '"300 mm"'),
    ("-inf", "length", "not a finite number", '"300 mm"'),
    (math.inf, "mass", "not a finite number", '"5 kg"'),
    (math.nan, "mass", "not a finite number", '"5 kg"'),
    (10**400, "mass", "not a finite number", '"5 kg"'),
    ("1e400 kg", "mass", "not a finite number", '"5 kg"'),
    ("1e9999999 kg", "mass", "not a finite number", '"5 kg"'),
    (f"1e{'9' * 30} kg", "mass", "not a finite number", '"5 kg"'),
    (True, "mass", "a truth value where a mass is needed", '"5 kg"'),
    ([1], "mass", "a list where a mass is needed", '"5 kg"'),
    ({}, "mass", "a table where a mass is needed", '"5 kg"'),
    ("__import__('os')", "length", "cannot be read", '"300 mm"'),
    ("1 __import__", "length", "cannot read the unit", '"300 mm"'),
]


@pytest.mark.parametrize(("value", "dimension", "problem", "remedy"), WRONG, ids=lambda x: str(x)[:20])
def test_what_is_refused(value, dimension, problem, remedy):
    with pytest.raises(QuantityError) as caught:
        quantity(value, dimension)
    assert problem in caught.value.problem and remedy in caught.value.remedy
    assert str(caught.value) == f"{caught.value.problem}; {caught.value.remedy}"


def test_vast_texts_are_refused_at_once():
    for text in ("1" * 10**5 + " kg x", "1 " + "k" * 10**5, "(" * 10**5, "1e5" * 10**4, "1 kg " + "/" * 10**5):
        with pytest.raises(QuantityError):
            quantity(text, "mass")


def test_pint_is_imported_when_a_unit_is_read():
    code = "import sys; from linkjax.scenes import quantity; quantity(0.3, 'length'); print('pint' in sys.modules);"
    code += "quantity('3 mm', 'length'); print('pint' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.split() == ["False", "True"]
