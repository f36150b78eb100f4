# pyright: reportFunctionMemberAccess=false, reportOperatorIssue=false
"""Motor, transmission and rotor at the crank: the equation of motion, energy, a gear that sticks, refused input."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from linkjax.drives import (
    ConstantTorque,
    DCMotor,
    MotorDrive,
    NoMotor,
    Servo,
    Transmission,
    disc_flywheel,
    inertia_of_gd2,
    rim_flywheel,
    servo_margins,
)
from tests.helpers import assert_gradients_agree

LOSSY = Transmission(5.0, 0.9, 0.8, 0.02)
DRIVE = MotorDrive(DCMotor(100.0, 0.05, 0.6366), LOSSY, 0.3)


def arrays(*values: float) -> list[jax.Array]:
    return [jnp.asarray(value) for value in values]


@pytest.mark.parametrize("rotor", [0.0, 0.3])
@pytest.mark.parametrize("inertia", [0.0, 4.0])
@pytest.mark.parametrize("speed", [-10.0, 0.0, 20.0, 30.5, 40.0])
def test_the_acceleration_solves_the_equation_of_motion(speed, inertia, rotor):
    drive = MotorDrive(DRIVE.motor, LOSSY, rotor)
    if inertia == rotor == 0:
        assert float(drive.crank_acceleration(*arrays(3.0, 0.0, speed))) == 0.0
        return
    crank_torque = jax.jit(lambda w, e: drive.crank_torque(w, e))
    for net in (-30000.0, -3000.0, -200.0, 0.0, 200.0, 3000.0, 30000.0):
        if inertia == 0 and rotor > 0 and net == 0:
            continue

        def missing(rate, net=net):
            return net + float(crank_torque(*arrays(speed, rate))) - inertia * rate

        got = float(drive.crank_acceleration(*arrays(net, inertia, speed)))
        truth = brentq(missing, -1e7, 1e7, xtol=1e-9)
        assert got == pytest.approx(truth, rel=1e-9, abs=1e-8)
        effective = float(drive.effective_inertia(*arrays(net, inertia, speed)))
        slope = (missing(got + 1e-3) - missing(got - 1e-3)) / 2e-3
        assert effective == pytest.approx(-slope, rel=1e-4)


@pytest.mark.parametrize("creep", [0.0, 0.02])
@pytest.mark.parametrize("speed", [-25.0, 25.0, 35.0])
@pytest.mark.parametrize("rate", [-50.0, 0.0, 50.0])
def test_energy(speed, rate, creep):
    """Power of the motor = rotor's kinetic energy + power on the crank + losses, by the efficiency of the direction."""
    drive = MotorDrive(DRIVE.motor, Transmission(5.0, 0.9, 0.8, creep), 0.3)
    w, e = arrays(speed, rate)
    motor = float(drive.motor_power(w))
    shaft_speed = float(drive.motor_speed(w))
    assert speed == pytest.approx(shaft_speed / 5 * (1 - creep), rel=1e-14)
    rotor = 0.3 * shaft_speed * float(drive.motor_speed(e))
    crank = float(drive.crank_torque(w, e)) * speed
    lost = float(drive.power_loss(w, e))
    assert motor == pytest.approx(rotor + crank + lost, rel=1e-12)
    given = motor - rotor
    assert crank == pytest.approx(given * 0.9 * (1 - creep) if given > 0 else given / 0.8, rel=1e-12)
    assert lost > 0
    needed = drive.required_torque(drive.crank_torque(w, e), w, e)
    assert float(needed) == pytest.approx(float(drive.motor_torque(w)), rel=1e-12)


def test_a_lossless_drive_is_a_larger_inertia():
    drive = MotorDrive(DRIVE.motor, Transmission(5.0), 0.3)
    net, inertia, speed = arrays(-100.0, 4.0, 28.0)
    assert float(drive.rotor_inertia()) == 0.3 * 25
    got = float(drive.crank_acceleration(net, inertia, speed))
    assert got == pytest.approx((-100 + 5 * float(drive.motor_torque(speed))) / (4 + 7.5), rel=1e-14)
    assert float(drive.effective_inertia(net, inertia, speed)) == pytest.approx(11.5)
    free = MotorDrive()
    assert isinstance(free.motor, NoMotor) and float(free.crank_torque(speed, net)) == 0.0
    assert float(free.crank_acceleration(net, inertia, speed)) == -25.0


def test_gradients(rng):
    for net, speed in ((-100.0, 28.0), (-3000.0, 40.0), (500.0, 20.0)):
        tree = (DRIVE, *arrays(net, 4.0, speed))
        assert_gradients_agree(lambda t: t[0].crank_acceleration(*t[1:]), tree, rng)
        assert_gradients_agree(lambda t: t[0].crank_torque(t[3], t[1]), tree, rng)
    rest = (MotorDrive(ConstantTorque(0.0), LOSSY, 0.0), *arrays(0.0, 0.0, 0.0))
    slopes = jax.grad(lambda t: t[0].crank_acceleration(*t[1:]))(rest)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(slopes))


def test_a_gear_that_sticks():
    """LossyGearDemo1 of the Modelica Standard Library: ratio 2, efficiency 0.5 both ways, J1 = 1, J2 = 1.5."""
    gear, j2 = Transmission(2.0, 0.5, 0.5), jnp.asarray(1.5)

    def drive(t):
        return MotorDrive(ConstantTorque(10 * jnp.sin(2 * jnp.pi * t)), gear, 1.0)

    rate = jax.jit(lambda t, w: drive(t).crank_acceleration(-10 + 2.5 * t, j2, w))
    starts = jax.jit(lambda t: tuple(drive(t).breakaway(-10 + 2.5 * t, j2)))
    stuck = jax.jit(lambda t: drive(t).breakaway(-10 + 2.5 * t, j2).stuck)
    tiny, pauses, peaks, t = 1e-12, [], [], 0.0
    while t < 0.5:
        forward, backward = (float(each) for each in starts(jnp.asarray(t)))
        if forward <= 0 <= backward:
            assert bool(stuck(jnp.asarray(t)))
            after = [s for s in np.linspace(t, 0.5, 800)[1:] if not bool(stuck(jnp.asarray(s)))]
            assert after
            ahead = float(starts(jnp.asarray(after[0]))[0]) > 0
            side = 0 if ahead else 1
            end = brentq(lambda s, side=side: float(starts(jnp.asarray(s))[side]), t + 1e-9, after[0], xtol=1e-12)
            pauses.append((t, end))
            t, sense = end + 1e-9, 1.0 if ahead else -1.0
        else:
            sense = 1.0 if forward > 0 else -1.0

        def stops(s, w):
            return w[0]

        stops.terminal, stops.direction = True, -sense
        run = solve_ivp(
            lambda s, w, sense=sense: [float(rate(*arrays(s, sense * max(sense * w[0], tiny))))],
            (t, 0.5), [sense * tiny], events=stops, rtol=1e-10, atol=1e-13, max_step=2e-3, dense_output=True,
        )  # fmt: skip
        assert run.sol is not None
        times = np.linspace(run.t[0], run.t[-1], 20001)
        speeds = run.sol(times)[0]
        best = int(np.argmax(sense * speeds))
        peaks.append((times[best], speeds[best]))
        t = run.t[-1]
    np.testing.assert_allclose(pauses, [(0.0805, 0.1995), (0.3713, 0.4645)], rtol=0, atol=1e-4)
    # the first motion is backward, the second forward
    assert peaks[0][1] == pytest.approx(-0.0208415, abs=2e-6) and peaks[0][0] == pytest.approx(0.04, abs=2e-3)
    assert peaks[1][1] == pytest.approx(0.013702123, abs=2e-7) and peaks[1][0] == pytest.approx(0.3135, abs=2e-3)


def test_a_servo_within_its_limits():
    servo = Servo(300.0, 40.0)
    drive = MotorDrive(servo, Transmission(5.0, 0.9), 0.01)
    speed, rate, torque = (jnp.asarray(part) for part in ([20.0, 50.0], [100.0, -100.0], [90.0, -30.0]))
    margins = servo_margins(drive, torque, speed, rate)
    assert float(margins.speed) == pytest.approx(1 - 250 / 300)
    assert float(margins.torque) == pytest.approx(1 - (90 / 4.5 + 5) / 40)
    assert float(servo.torque(jnp.asarray(299.0))) == 40.0 and float(servo.torque(jnp.asarray(301.0))) == 0.0
    with pytest.raises(TypeError, match="only a Servo has limits, not DCMotor"):
        servo_margins(DRIVE, torque, speed, rate)


def test_flywheels():
    """Against the integral of r² dm over the body."""
    disc = disc_flywheel(40.0, 7850.0, diameter=0.9)
    r = np.linspace(0, 0.45, 20001)
    j = np.trapezoid(2 * math.pi * 7850 * float(disc.width) * r**3, r)
    assert j == pytest.approx(40.0, rel=1e-7) and float(disc.mass) == pytest.approx(8 * 40 / 0.81)
    other = disc_flywheel(40.0, 7850.0, width=disc.width)
    assert float(other.diameter) == pytest.approx(0.9, rel=1e-14)
    rim = rim_flywheel(40.0, 7850.0, 1.2, shape=1.5)
    assert float(rim.height) == pytest.approx(1.5 * float(rim.width))
    inner, outer = (0.6 + sign * float(rim.height) / 2 for sign in (-1, 1))
    r = np.linspace(inner, outer, 20001)
    j = np.trapezoid(2 * math.pi * 7850 * float(rim.width) * r**3, r)
    assert j == pytest.approx(40.0 * (1 + (float(rim.height) / 1.2) ** 2), rel=1e-7)
    for key in ("width", "height"):
        again = rim_flywheel(40.0, 7850.0, 1.2, **{key: getattr(rim, key)})
        np.testing.assert_allclose(again, rim, rtol=1e-13)
    assert float(inertia_of_gd2(2.0)) == 0.5 and float(inertia_of_gd2(9.80665, weight=True)) == 0.25


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Transmission(0.0), r"ratio of a transmission is 0\.0"),
        (lambda: Transmission(1.0, 1.1), r"efficiency of a transmission is 1\.1"),
        (lambda: Transmission(1.0, 0.9, 0.0), r"efficiency_back of a transmission is 0\.0"),
        (lambda: Transmission(1.0, creep=1.0), r"creep of a transmission is 1\.0"),
        (lambda: MotorDrive(NoMotor(), Transmission(), -1.0), r"inertia of a MotorDrive is -1\.0"),
        (lambda: Servo(0.0, 1.0), "max_speed of a servo motor"),
        (lambda: disc_flywheel(1.0, 7850.0), "needs one of diameter, width"),
        (lambda: disc_flywheel(1.0, 7850.0, 1.0, 1.0), "needs one of diameter, width"),
        (lambda: rim_flywheel(1.0, -1.0, 1.0, 1.0), "density of a rim flywheel"),
    ],
)
def test_bad_numbers_are_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()
