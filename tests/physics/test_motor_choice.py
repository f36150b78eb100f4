"""Choice of a motor: overload against the type plate, limits of a servo motor, operating loop, energy-mass diagram."""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import viz
from linkjax.analysis import document, energy_mass
from linkjax.report import write_report
from tests.physics.driven import slider_crank

PLATE = lj.InductionMotor(60.0, 38.0, 42.0, 2.2, 1.8)


@functools.cache
def pump() -> tuple[lj.Scene, lj.Cycle, dict[str, Any]]:
    """A slider-crank with a pump and an induction motor, analysed."""
    scene = slider_crank(lj.MotorDrive(PLATE, inertia=0.001))
    cycle = lj.analyse(scene, angles=360)
    return scene, cycle, document(cycle)


@pytest.mark.slow
def test_the_load_of_a_motor():
    """Ratios from the torques of the characteristic at the crank angles, over time."""
    _, cycle, data = pump()
    load, run = data["motor"]["overload"], data["motor"]
    rated = 60.0 / 38.0
    assert load["rated_torque"] == pytest.approx(rated) and load["torque_limit"] == pytest.approx(2.2 * rated)
    assert load["limit_is"] == "breakdown torque" and load["speed_limit"] is None and load["speed_over_limit"] is None
    torque = np.asarray(PLATE.torque(jnp.asarray(run["speed"])))
    weights = 1 / np.asarray(cycle.speed)
    rms = math.sqrt(np.sum(weights * torque**2) / np.sum(weights))
    assert load["rms_over_rated"] == pytest.approx(rms / rated, rel=1e-9)
    assert load["peak_over_rated"] == pytest.approx(np.max(np.abs(torque)) / rated, rel=1e-4)
    assert load["peak_over_limit"] == pytest.approx(load["peak_over_rated"] / 2.2)
    place = np.interp(load["angle_of_peak_torque"], data["angles"], torque)
    assert abs(place) == pytest.approx(load["peak_torque"], rel=1e-4)
    text = str(cycle)
    assert "0.9059 rms and 1.446 peak of rated torque" in text and "of breakdown torque" in text
    assert "motor overload" not in text


@pytest.mark.slow
def test_harmonics_of_an_analysis():
    """Those of a Fourier transform of the values shown, which is exact for a smooth motion."""
    _, cycle, data = pump()
    assert cycle.speed is not None and cycle.forces is not None and cycle.motor is not None
    for name, values in (
        ("crank_speed", cycle.speed), ("drive_torque", cycle.forces.drive_torque), ("motor_torque", cycle.motor.torque),
    ):  # fmt: skip
        found, series = data["harmonics"][name], np.fft.rfft(np.asarray(values)) / 360
        got = np.asarray(found["amplitude"]) * np.exp(-1j * np.asarray(found["phase"]))
        np.testing.assert_allclose(got, 2 * series[1:13], atol=1e-7 * abs(series[0]))
        assert found["mean"] == pytest.approx(series[0].real, rel=1e-9)


@pytest.mark.slow
def test_the_energy_mass_diagram():
    """Against the work of all torques, integrated by another method; the tangents bound the curve."""
    scene, cycle, data = pump()
    found = energy_mass(data, scene)
    assert cycle.motor is not None and cycle.speed is not None
    rise = np.asarray(cycle.reduced.torque) + np.asarray(PLATE.torque(cycle.motor.speed))
    series, order = np.fft.rfft(rise) / 360, np.arange(181)
    assert abs(series[0]) < 1e-9 * np.max(np.abs(rise))  # what the motor gives, the pump takes
    whole = np.fft.irfft(np.concatenate([[0], series[1:] / (1j * order[1:])]) * 360, 360)
    np.testing.assert_allclose(found.energy, whole - whole[0], atol=1e-7 * np.ptp(whole))
    steep = (found.energy - found.origin) / found.inertia
    np.testing.assert_allclose(steep, 0.5 * np.asarray(cycle.speed) ** 2, rtol=1e-12)
    assert 0 <= found.max_slope - np.max(steep) < 1e-3 * found.max_slope
    assert 0 <= np.min(steep) - found.min_slope < 1e-3 * found.min_slope
    for slope, (x, y) in ((found.max_slope, found.max_point), (found.min_slope, found.min_point)):
        assert (y - found.origin) / x == pytest.approx(slope, rel=1e-12)
        assert np.min(np.hypot((found.inertia - x) / x, (found.energy - y) / np.ptp(whole))) < 0.02


def test_figures_and_report(tmp_path):
    """The loop is on the characteristic; every figure and the table of harmonics are in the report."""
    scene, _, data = pump()
    figure = viz.operating_loop_figure(data, scene)
    lines = [np.asarray(line.get_xydata()) for line in figure.axes[0].get_lines()]
    loop = next(line for line in lines if len(line) == 361 and np.ptp(line[:, 1]) > 0 and line[0, 1] > line[60, 1] - 9)
    assert len(loop) == 361 and len(figure.axes) == 1
    speed = np.asarray(data["motor"]["speed"])
    np.testing.assert_allclose(PLATE.torque(jnp.asarray(speed)), data["motor"]["torque"], rtol=1e-8, atol=1e-9)
    assert len(viz.harmonics_figure(data, scene).axes) == 3
    viz.energy_mass_figure(data, scene, before=data)
    page = write_report(data, scene, tmp_path / "report.html").read_text(encoding="utf-8")
    for text in ("Operating loop", "Energy-mass diagram", "Harmonics over the crank angle", "motor load"):
        assert text in page


def test_without_a_motor():
    bare = slider_crank()
    with pytest.raises(ValueError, match="no motor whose torque depends on its speed"):
        viz.operating_loop_figure({"motor": None}, bare)
    with pytest.raises(ValueError, match="no harmonics"):
        viz.harmonics_figure({}, bare)
    with pytest.raises(ValueError, match="actual motion"):
        energy_mass({"motion": {"speed": None}}, bare)


SERVO = lj.Servo(max_speed=60.0, max_torque=9.0)


@functools.cache
def arm() -> lj.Cycle:
    """An arm that oscillates by 60 degrees, with a servo motor on a gear."""
    links = {"arm": lj.Link(length=0.1, inertia=0.5)}
    law = lj.Harmonic(0.0, math.pi / 3)
    swing = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, [lj.Crank("arm", "A", "B", law=law)])
    drive = lj.MotorDrive(SERVO, lj.Transmission(ratio=5.0), inertia=0.01)
    return lj.analyse(lj.Scene(swing, speed=20.0, motor=drive), angles=72)


@pytest.mark.slow
def test_the_limits_of_a_servo_motor():
    """θ = (π/6)(1 - cos φ): the motor has the speed u θ' ω and the torque (J/u + u J_m) θ'' ω²."""
    cycle, size, u = arm(), math.pi / 6, 5.0
    assert cycle.motor is not None
    phi = np.asarray(cycle.angles)
    np.testing.assert_allclose(cycle.motor.speed, u * size * 20 * np.sin(phi), atol=1e-11)
    most = (0.5 / u + u * 0.01) * size * 400
    np.testing.assert_allclose(cycle.motor.torque, most * np.cos(phi), atol=1e-11)
    load = document(cycle)["motor"]["overload"]
    assert load["peak_torque"] == pytest.approx(most, rel=1e-9)
    assert load["peak_over_limit"] == pytest.approx(most / 9.0) and load["limit_is"] == "torque limit"
    assert math.cos(load["angle_of_peak_torque"]) ** 2 == pytest.approx(1.0, abs=1e-6)
    assert load["peak_speed"] == pytest.approx(u * size * 20, rel=1e-9)
    assert load["speed_over_limit"] == pytest.approx(u * size * 20 / 60.0) and load["rated_torque"] is None
    text = str(cycle)
    assert "exceeds the torque limit by 249 %" in text and "the motor cannot follow this motion" in text
    assert "the speed" not in text.partition("motor overload")[2].partition("\n")[0]


@pytest.mark.slow
def test_a_servo_motor_also_accelerates_its_rotor():
    """Both ways the motor gives the kinetic energy of arm and rotor, ½ (J + u² J_m) (θ' ω)², and takes it back."""
    energies = arm().energies
    assert energies is not None
    kinetic = 0.5 * (0.5 + 5.0**2 * 0.01) * (math.pi / 6 * 20) ** 2
    assert float(energies["motor"].supplied) == pytest.approx(2 * kinetic, rel=1e-9)
    assert float(energies["motor"].absorbed) == pytest.approx(2 * kinetic, rel=1e-9)


@pytest.mark.slow
def test_the_crank_speed_of_a_motion_law_with_a_damper():
    """A load that depends on the speed changes the drive torque, but not the motion, which the law gives."""
    links = {"arm": lj.Link(length=0.1, inertia=0.5)}
    swing = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, [lj.Crank("arm", "A", "B", law=lj.Harmonic(0.0, math.pi / 3))])
    scene = lj.Scene(swing, speed=20.0, loads=(lj.TorsionDamper("oil", "arm", coefficient=9.0),))
    cycle, size = lj.analyse(scene, angles=72), math.pi / 6
    assert cycle.steady is not None and cycle.delta is not None
    assert float(cycle.delta) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose([cycle.steady.max_speed, cycle.steady.min_speed], 20.0, rtol=1e-12)
    np.testing.assert_allclose(cycle.steady.mean_drive_torque, 9.0 * 20 * size**2 / 2, rtol=1e-9)


@pytest.mark.slow
def test_a_servo_motor_with_a_lossy_gear():
    """Where the power changes its direction, the torque of the motor has a kink: its mean, root mean square, power and
    loss by Gauss's rule between the zeros of the power."""
    inertia, drag, w, size, ratio, rotor, ahead, back = 0.5, 9.0, 20.0, math.pi / 6, 5.0, 0.01, 0.8, 0.7
    swing = lj.Mechanism(
        {"A": lj.Vec(0.0, 0.0)}, {"arm": lj.Link(length=0.1, inertia=inertia)},
        [lj.Crank("arm", "A", "B", law=lj.Harmonic(0.0, 2 * size))],
    )  # fmt: skip
    motor = lj.MotorDrive(lj.Servo(200.0, 200.0), lj.Transmission(ratio, ahead, back), inertia=rotor)
    scene = lj.Scene(swing, (lj.TorsionDamper("oil", "arm", coefficient=drag),), speed=w, motor=motor)
    turn = math.pi - math.atan(inertia * w / drag)
    x, weights = np.polynomial.legendre.leggauss(40)
    panels = [
        (0.5 * (b - a), 0.5 * (a + b)) for a, b in itertools.pairwise((0, turn, math.pi, math.pi + turn, 2 * math.pi))
    ]
    phi = np.concatenate([middle + half * x for half, middle in panels])
    weights = np.concatenate([half * weights for half, _ in panels]) / (2 * math.pi)
    rate, bend = size * np.sin(phi) * w, size * np.cos(phi) * w**2
    torque = inertia * bend + drag * rate
    shaft = torque / ratio * np.where(torque * rate > 0, 1 / ahead, back) + rotor * ratio * bend
    power, lost = shaft * ratio * rate, (shaft - rotor * ratio * bend) * ratio * rate - torque * rate
    cycle = lj.analyse(scene, angles=36)
    run, energies = cycle.motor, cycle.energies
    assert run is not None and energies is not None
    means = [float(weights @ part) for part in (shaft, shaft**2, power, lost)]
    expected = [means[0], math.sqrt(means[1]), means[2], means[3] * 2 * math.pi / w]
    found = [float(part) for part in (run.mean_torque, run.rms_torque, run.mean_power, run.loss)]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    assert float(energies["transmission"].absorbed) == pytest.approx(float(run.loss), rel=1e-9)
    for name, value in zip(("mean_motor_torque", "rms_motor_torque", "mean_motor_power"), expected, strict=False):
        both = [lj.measures.evaluate(scene, [each])[each] for each in (name, f"{name}_constant_speed")]
        np.testing.assert_allclose(both, value, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_a_servo_motor_on_a_slider():
    """Its power is that of the drive, whatever the ratio (rad/m), and its force that on the guide."""
    links = {"rod": lj.Link(length=0.5, mass=2.0, inertia=0.1, centre=lj.Vec(0.25, 0.0)),
             "lever": lj.Link(length=0.4, mass=1.0, inertia=0.05, centre=lj.Vec(0.2, 0.0)),
             "push": lj.Link(length=0.1, mass=3.0)}  # fmt: skip
    law = lj.Harmonic(0.3, 0.5)
    groups = [lj.LinearDriver("push", "B", lj.Guide("A"), law), lj.RRR(("rod", "lever"), "B", "D", "C", side=1)]
    mechanism = lj.Mechanism({"A": lj.Vec(0.0, 0.0), "D": lj.Vec(0.8, 0.1)}, links, groups)
    drive = lj.MotorDrive(lj.Servo(1000.0, 50.0), lj.Transmission(ratio=100.0))
    scene = lj.Scene(mechanism, gravity=lj.Vec(0.0, -9.81), speed=10.0, motor=drive)
    cycle = lj.analyse(scene, angles=72)
    assert cycle.motor is not None and cycle.forces is not None
    phi = np.asarray(cycle.angles)
    np.testing.assert_allclose(cycle.motor.speed, 100 * 0.1 * 10 * np.sin(phi), atol=1e-10)
    power = np.asarray(cycle.forces.drive_torque) * 10.0
    np.testing.assert_allclose(cycle.motor.power, power, atol=1e-10 * np.max(np.abs(power)))
    force = cycle.forces.reactions["push.drive"]["push"].fx
    np.testing.assert_allclose(cycle.motor.torque, np.asarray(force) / 100, atol=1e-10 * np.max(np.abs(force)))
