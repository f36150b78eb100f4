"""Motors against published machines, measurements, and SciPy; gradients; refused input."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq, minimize_scalar

from linkjax._interpolate import interpolate
from linkjax.drives import (
    AbstractMotor,
    ConstantTorque,
    DCMotor,
    InductionCircuit,
    InductionMotor,
    LineMotor,
    NoMotor,
    TableMotor,
    phase_voltage_of,
    warm_resistance,
)
from tests.helpers import assert_gradients_agree

RPM = 2 * math.pi / 60
X_M, X_S = 3 * math.sqrt(1 - 0.0667), 3 * (1 - math.sqrt(1 - 0.0667))
TEXTBOOK = InductionCircuit(100.0, 50.0, 2, 0.03, 0.04, X_M, X_S, X_S)  # IMC_DOL, Modelica Standard Library
PLATE = InductionMotor(18500.0, 1462.5 * RPM, 1500 * RPM, 2.6, 2.2)
TABLE = TableMotor([0.0, 40.0, 90.0, 130.0, 150.0, 160.0], [55.0, 50.0, 70.0, 95.0, 60.0, -5.0])
MOTORS = {
    "none": NoMotor(),
    "constant": ConstantTorque(12.0),
    "line": LineMotor([(1200 * RPM, 0.0), (1120 * RPM, 176.0)]),
    "no load": LineMotor(no_load=157.0, stall=2000.0),
    "table": TABLE,
    "dc": DCMotor(100.0, 0.05, 0.6366),
    "plate": PLATE,
    "kloss": InductionMotor(18500.0, 1462.5 * RPM, 1500 * RPM, 2.6, q=0.4),
    "circuit": TEXTBOOK,
}


def at(motor: AbstractMotor, speed: float) -> float:
    return float(motor.torque(jnp.asarray(speed)))


def test_a_dc_motor_by_its_plate():
    motor = DCMotor.rated(100.0, 0.05, 100.0, 1425 * RPM)
    assert float(motor.constant) == pytest.approx(0.636619772367581, rel=1e-14)
    assert float(motor.no_load_speed()) == pytest.approx(157.07963267948963, rel=1e-14)
    speed = brentq(lambda w: at(motor, w) - 63.66, 100.0, 157.0, xtol=1e-13)
    assert speed == pytest.approx(149.22589497732278, rel=1e-13)
    assert float(motor.current(jnp.asarray(speed))) == pytest.approx(99.99689416376309, rel=1e-12)


def test_the_equivalent_circuit_of_the_textbook():
    assert at(TEXTBOOK, 1440.45 * RPM) == pytest.approx(161.41360497, rel=1e-9)
    assert at(TEXTBOOK, 0.0) == pytest.approx(159.22001949, rel=1e-9) == float(TEXTBOOK.stall_torque())
    most = minimize_scalar(lambda n: -at(TEXTBOOK, n * RPM), bounds=(1000, 1400), method="bounded",
                           options={"xatol": 1e-6})  # fmt: skip
    assert -most.fun == pytest.approx(386.9126, abs=5e-5)  # half of the last digit printed
    assert most.x == pytest.approx(1203.4, abs=0.05)
    assert float(TEXTBOOK.breakdown_slip()) == pytest.approx(1 - most.x / 1500, abs=1e-6)


@pytest.mark.parametrize("speed", [-400.0, 0.0, 1203.0, 1440.0, 1499.0, 1500.0, 1600.0, 3100.0])
def test_the_circuit_is_that_of_complex_impedances(speed):
    """Torque from the current of the rotor, found in complex numbers."""
    s = 1 - speed / 1500
    if s == 0:
        assert at(TEXTBOOK, 1500 * RPM) == pytest.approx(0.0, abs=1e-10)
        return
    rotor, stator, branch = 0.04 / s + 1j * X_S, 0.03 + 1j * X_S, 1j * X_M
    current = 100 / (stator + rotor * branch / (rotor + branch)) * branch / (rotor + branch)
    assert at(TEXTBOOK, speed * RPM) == pytest.approx(3 * abs(current) ** 2 * 0.04 / s / (1500 * RPM), rel=1e-12)


def test_a_measured_induction_motor():
    """18.5 kW, 400 V in delta, measured (IMC_withLosses, Modelica Standard Library)."""
    power = [1845, 3549, 5325, 7521, 9372, 11010, 12930, 14950, 16360, 18500, 20180, 22170]
    speeds = [1496, 1493, 1490, 1486, 1482, 1479, 1475, 1471, 1467, 1462, 1458, 1453]
    motor = InductionCircuit(
        phase_voltage_of(400.0, "delta"), 50.0, 2, warm_resistance(0.56, 3.92e-3, 70.0),
        warm_resistance(0.42, 4.031e-3, 70.0), 66.4, 1.52, 2.31, 180.0, 1462.5 * RPM,
    )  # fmt: skip
    found = [brentq(lambda n, p=p: at(motor, n * RPM) * n * RPM - p, 1440, 1499) for p in power]
    assert np.max(np.abs(np.asarray(found) - speeds)) < 1.4
    idle = motor.no_load_speed()
    assert float(motor.torque(idle)) == pytest.approx(0.0, abs=1e-10) and 1499 * RPM < float(idle) < 1500 * RPM
    assert at(motor, 1462.5 * RPM) == pytest.approx(
        float(motor.electrical_torque(jnp.asarray(1462.5 * RPM))) - 180 / (1462.5 * RPM), rel=1e-13
    )


def test_kloss_of_the_textbook_machine():
    """The torque at rest by the breakdown point: with q = 2 s_b R1/R2' close to the exact 159.22 N m, plain too low."""
    s_b, most = float(TEXTBOOK.breakdown_slip()), at(TEXTBOOK, 1500 * RPM * (1 - float(TEXTBOOK.breakdown_slip())))
    q = 2 * s_b * 0.03 / 0.04  # both resistances as seen from the rotor
    for factor, rest in ((q, 160.03), (0.0, 147.23)):
        s = 0.02
        rated = most * (2 + factor) / (s / s_b + s_b / s + factor)
        speed = 1500 * RPM * (1 - s)
        motor = InductionMotor(rated * speed, speed, 1500 * RPM, most / rated, q=factor)
        assert float(motor.breakdown_slip()) == pytest.approx(s_b, rel=1e-12)
        assert at(motor, 0.0) == pytest.approx(rest, abs=0.005)  # printed with two decimals
        assert at(motor, speed) == pytest.approx(rated, rel=1e-13)


@pytest.mark.parametrize("start", [None, 0.4, 2.2, 2.59])
@pytest.mark.parametrize("q", [0.0, 0.5])
def test_the_type_plate(start, q):
    motor = InductionMotor(18500.0, 1462.5 * RPM, 1500 * RPM, 2.6, start, q)
    rated, top = 18500 / (1462.5 * RPM), 1500 * RPM
    assert at(motor, 1462.5 * RPM) == pytest.approx(rated, rel=1e-13)
    breakdown = top * (1 - float(motor.breakdown_slip()))
    assert at(motor, breakdown) == pytest.approx(2.6 * rated, rel=1e-13)
    slope = jax.grad(motor.torque)
    assert float(slope(jnp.asarray(breakdown))) == pytest.approx(0.0, abs=1e-9 * rated)
    if start is not None:
        assert at(motor, 0.0) == pytest.approx(start * rated, rel=1e-13)
        plain = InductionMotor(18500.0, 1462.5 * RPM, 1500 * RPM, 2.6, q=q)
        stable = jnp.linspace(breakdown, 1.1 * top, 50)
        np.testing.assert_allclose(motor.torque(stable), plain.torque(stable), rtol=1e-14)
    speeds = jnp.linspace(-2 * top, breakdown, 400)
    torques = np.asarray(motor.torque(speeds))
    assert np.all(np.diff(torques) >= 0) and np.all(torques > 0)
    above = jnp.linspace(0.0, top, 30)
    mirrored = motor.torque(top + above) + InductionMotor(18500.0, 1462.5 * RPM, top, 2.6, q=q).torque(top - above)
    assert np.max(np.abs(np.asarray(mirrored))) < 1e-11 * rated


def test_a_table_is_the_monotone_cubic_of_scipy():
    speeds, torques = (np.asarray(jnp.stack(part)) for part in (TABLE.speeds, TABLE.torques))
    known = PchipInterpolator(speeds, torques)
    inside = np.linspace(speeds[0], speeds[-1], 300)
    np.testing.assert_allclose(TABLE.torque(jnp.asarray(inside)), known(inside), rtol=0, atol=1e-12)
    for end, beyond in ((0.0, -30.0), (160.0, 200.0)):
        line = float(known(end)) + float(known(end, 1)) * (beyond - end)
        assert at(TABLE, beyond) == pytest.approx(line, rel=1e-12)
    two = TableMotor([10.0, 20.0], [5.0, 1.0])
    np.testing.assert_allclose(two.torque(jnp.asarray([0.0, 15.0, 30.0])), [9.0, 3.0, -3.0], rtol=1e-14)


def test_interpolation_between_values(rng):
    knots = np.cumsum(rng.uniform(0.1, 1.0, 12))
    values = rng.normal(size=12)
    x = np.linspace(knots[0], knots[-1], 400)
    given = (jnp.asarray(x), jnp.asarray(knots), jnp.asarray(values))
    np.testing.assert_allclose(interpolate(*given, "cubic"), PchipInterpolator(knots, values)(x), rtol=0, atol=1e-13)
    np.testing.assert_allclose(interpolate(*given, "linear"), np.interp(x, knots, values), rtol=0, atol=1e-14)
    flat = interpolate(jnp.asarray([knots[0] - 1, knots[-1] + 1]), given[1], given[2], "cubic")
    np.testing.assert_allclose(flat, values[[0, -1]], rtol=1e-15)


@pytest.mark.parametrize("name", MOTORS)
def test_every_motor(name, rng):
    """The shape of its torque is that of the speeds; at the speed without load there is none; gradients agree."""
    motor = MOTORS[name]
    speeds = jnp.asarray(rng.uniform(-50.0, 190.0, (2, 5)))
    torque = motor.torque(speeds)
    assert torque.shape == (2, 5) and np.all(np.isfinite(torque))
    assert float(motor.stall_torque()) == at(motor, 0.0)
    idle = motor.no_load_speed()
    if idle is not None:
        assert float(motor.torque(idle)) == pytest.approx(0.0, abs=1e-10 * abs(float(motor.stall_torque())))
    assert all(np.isfinite(knot) for knot in motor.knots())
    weights = jnp.asarray(rng.normal(size=10))
    if name == "none":
        assert not np.any(torque)
        return
    assert_gradients_agree(lambda pair: jnp.sum(weights * pair[0].torque(pair[1]).ravel()), (motor, speeds), rng)
    every = jnp.stack([*motor.knots(), jnp.zeros(()), *((idle,) if idle is not None else ())])
    slopes = jax.jacrev(lambda motor: motor.torque(every))(motor)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(slopes))


@pytest.mark.parametrize("name", ["table", "plate", "kloss", "circuit"])
def test_kinks_are_where_the_knots_say(name, rng):
    """Away from the knots the second derivative is continuous: it hardly changes over a tiny step."""
    motor, step = MOTORS[name], 1e-7
    bend = jax.jit(jax.vmap(jax.grad(jax.grad(motor.torque))))
    speeds = rng.uniform(-50.0, 190.0, 2000)
    one, two = (np.asarray(bend(jnp.asarray(speeds + move))) for move in (0.0, step))
    assert np.max(np.abs(two - one)) < 1e-5 * np.max(np.abs(one))
    jumps = [abs(float(bend(jnp.asarray([knot + step]))[0] - bend(jnp.asarray([knot - step]))[0]))
             for knot in motor.knots()]  # fmt: skip
    assert all(jump > 1e-4 * np.max(np.abs(one)) for jump in jumps[:2])  # at the synchronous speed only with q


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ConstantTorque(math.nan), "torque of a constant-torque motor is nan"),
        (lambda: LineMotor(), "has points, or no_load and stall"),
        (lambda: LineMotor(no_load=3.0), "has points, or no_load and stall"),
        (lambda: LineMotor(no_load=3.0, stall=-1.0), r"stall of a line motor is -1\.0; write a finite number above"),
        (lambda: LineMotor([(1.0, 2.0)]), "are not two pairs"),
        (lambda: LineMotor([(1.0, 2.0), (1.0, 3.0)]), r"have the speed 1 rad/s \(9\.5493 rpm\)"),
        (lambda: LineMotor([(1.0, 2.0), (math.inf, 3.0)]), "is not finite"),
        (lambda: TableMotor([1.0, 2.0], [1.0]), "2 speeds and 1 torques"),
        (lambda: TableMotor([1.0, 1.0], [1.0, 2.0]), "do not increase"),
        (lambda: TableMotor([1.0, math.nan], [1.0, 2.0]), "is not finite"),
        (lambda: DCMotor(100.0, 0.0, 1.0), r"resistance of a DC motor is 0\.0"),
        (lambda: DCMotor.rated(100.0, 2.0, 60.0, 100.0), r"leaves -20\.0 V"),
        (lambda: InductionMotor(1e3, 157.0, 150.0, 2.0), "not below the synchronous"),
        (lambda: InductionMotor(1e3, 150.0, 157.0, 1.0), "not above one"),
        (lambda: InductionMotor(1e3, 150.0, 157.0, 2.0, 2.0), "not below its breakdown_ratio"),
        (lambda: InductionMotor(1e3, 100.0, 157.0, 3.0, 2.0), "has no effect: its breakdown slip is"),
        (lambda: InductionCircuit(100.0, 50.0, 0, 1.0, 1.0, 1.0, 1.0, 1.0), "pole_pairs of an induction motor is 0"),
        (lambda: InductionCircuit(100.0, 50.0, 2, 1.0, 0.0, 1.0, 1.0, 1.0), "rotor_resistance of an induction motor"),
        (lambda: InductionCircuit(100.0, 50.0, 2, 1.0, 1.0, 1.0, 1.0, 1.0, 180.0), "has no speed"),
        (lambda: phase_voltage_of(400.0, "triangle"), 'write "delta" or "star"'),
    ],
)
def test_bad_numbers_are_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()
    assert float(phase_voltage_of(400.0, "star")) == pytest.approx(400 / math.sqrt(3), rel=1e-15)
