"""The built-in machines with a motor, and the door with a spring: energies and torques by separate formulas."""

from __future__ import annotations

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from tests.test_cli import call as call

RPM = np.pi / 30
MEASURES = ("energy_per_cycle", "slow_down", "rms_motor_torque", "mean_motor_torque", "min_motor_power", "delta")
BELT = 0.99  # speed that is left behind a belt
G, K, FREE, Q = 9.81, 3000.0, 0.9, (-0.5, 0.15)  # the door's spring as in its file: stiffness, free length, lower end
BEST = (3090.26, 0.701593, (-0.309370, 0.3))


def found(name: str) -> dict[str, float]:
    return {each: float(value) for each, value in lj.measures.evaluate(lj.load(name), MEASURES).items()}


@pytest.mark.slow
def test_a_stroke_of_the_punch_press():
    """50 kN on 8 mm are 400 J, taken from the motor through a belt that loses 5 % of torque and 1 % of speed."""
    punch = found("punch-press")
    assert punch["min_motor_power"] > 0
    assert punch["energy_per_cycle"] == pytest.approx(50e3 * 8e-3 / (0.95 * BELT), rel=1e-9)
    rated = 1100 / (920 * RPM)
    assert punch["mean_motor_torque"] < punch["rms_motor_torque"] < rated
    assert 0.5 * punch["delta"] < punch["slow_down"] < punch["delta"] < 0.15


@pytest.mark.slow
def test_a_stroke_of_the_pump():
    """5 kN on 160 mm are 800 J; the valves take ∫ c v² |dx| = c ∫ |x'|³ ω² dφ more, with the actual speed ω(φ)."""
    pump, cycle = found("pump-with-motor"), lj.analyse(lj.load("pump-with-motor"), angles=1440)
    assert cycle.speed is not None
    phi, speed = np.asarray(cycle.angles), np.asarray(cycle.speed)
    rod = np.sqrt(0.32**2 - (0.08 * np.sin(phi)) ** 2)
    slope = 0.08 * np.sin(phi) + 0.08**2 * np.sin(phi) * np.cos(phi) / rod
    valves = 120 * 2 * np.pi * np.mean(np.abs(slope) ** 3 * speed**2)
    given = pump["energy_per_cycle"] * 0.95 * BELT
    assert given == pytest.approx(800 + valves, rel=1e-6)
    assert pump["rms_motor_torque"] < 3000 / (1435 * RPM) and pump["delta"] < 0.06


@pytest.mark.slow
def test_the_press_does_not_run_hot():
    """Its motor gives the work of the hay and what the belt loses, in both directions."""
    press, cycle = found("press-with-motor"), lj.analyse(lj.load("press-with-motor"), angles=1440)
    assert cycle.forces is not None
    torque = 2 * np.pi * np.asarray(cycle.forces.drive_torque)
    ahead, back = (np.mean(np.maximum(sign * torque, 0.0)) for sign in (1, -1))
    assert ahead - back == pytest.approx(-float(cycle.work["hay"]), rel=1e-4)
    assert press["energy_per_cycle"] == pytest.approx(ahead / (0.96 * BELT) - 0.96 * back, rel=1e-4)
    assert press["rms_motor_torque"] < 132e3 / (1440 * RPM) and press["delta"] < 0.15


@pytest.mark.slow
@pytest.mark.parametrize("name", ["punch-press", "pump-with-motor", "press-with-motor"])
def test_it_runs_up(call, tmp_path, name):
    code, text, err = call("run", name, "--json", tmp_path / "run.json")
    assert (code, err) == (0, "") and "run-up time" in text
    data = json.loads((tmp_path / "run.json").read_text())
    assert data["run_up_time"] > 0 and data["energies"]["error"] < 1e-8


def energy(arm, spring=(K, FREE, Q)):
    """Potential energy (J) of the door over the angle of its arm (rad): weights by the law of cosines, and spring."""
    stiffness, free, end = spring
    a, d = np.array(-0.325 + 1.34j), np.array(-0.675 + 1.375j)
    b = a + 0.8542 * np.exp(1j * arm)
    reach = np.abs(d - b)
    corner = np.arccos((1.2**2 + reach**2 - 0.7722**2) / (2 * 1.2 * reach))
    along = (d - b) / reach * np.exp(-1j * corner)  # from B to C, which lies to the right of the line from B to D
    c = b + 1.2 * along
    weight = 45 * (b + 0.5 * along).imag + 4 * ((a + b) / 2).imag + 3.6 * ((c + d) / 2).imag
    length = np.abs(a - 0.25 * np.exp(1j * arm) - complex(*end))
    return G * weight + 0.5 * stiffness * (length - free) ** 2


def torque(arm, spring=(K, FREE, Q)):
    """That holds the door (N m)."""
    h = 1e-5
    return (energy(arm + h, spring) - energy(arm - h, spring)) / (2 * h)


def test_the_torque_on_the_arm_of_the_door():
    """Where the arm moves at constant speed, the torque on the law is that on the arm."""
    scene = lj.load("spring-door")
    phi = np.radians([12.0, 40.0, 66.0, 98.0, 120.0])
    ours = jax.vmap(lambda phi: lj.reduced_model(scene, phi).torque)(jnp.asarray(phi))
    arm = phi - np.radians(67.6 + 5.0)
    np.testing.assert_allclose(-np.asarray(ours), torque(arm), rtol=1e-7, atol=1e-5)


@pytest.mark.slow
def test_the_torques_that_the_file_of_the_door_states():
    """Without a spring, with the one of the file, and with the best; a thousand times slower, so that nothing
    accelerates the door, the peaks are those of the potential energy."""
    fine = np.radians(np.linspace(-62.6, 51.2, 4001))
    found = []
    for stiffness, free, (x, y) in ((0.0, FREE, Q), (K, FREE, Q), BEST):
        new = {"stiffness": f"{stiffness} N/m", "free_length": f"{free} m"}
        given = {f"loads.balance.{key}": value for key, value in new.items()} | {"fixed.Q": [f"{x} m", f"{y} m"]}
        slow, peak = (
            float(
                lj.measures.evaluate(lj.load("spring-door", given | more), ["peak_drive_torque"])["peak_drive_torque"]
            )
            for more in ({"speed": "0.00075 rpm"}, {})
        )
        assert np.abs(torque(fine, (stiffness, free, (x, y)))).max() == pytest.approx(slow, rel=1e-6)
        found.append(f"{peak:.3g}")
    assert found == ["283", "87.6", "16.3"]


@pytest.mark.slow
def test_the_best_spring_of_the_door(rng):
    """Certified, and better than 20000 random springs."""
    scene, asked = lj.load_problem("spring-door")
    best = lj.optimise(scene, **asked)
    assert best.feasible and best.kkt_residual < 1e-8
    spring = [best.variables[f"loads.balance.{each}"][1] for each in ("stiffness", "free_length")]
    end = [best.variables[f"fixed.Q.{each}"][1] for each in "xy"]
    np.testing.assert_allclose([*spring, *end], [*BEST[:2], *BEST[2]], rtol=1e-5)
    arm = np.radians(np.linspace(-62.6, 51.2, 60))
    low = [1000, 0.6, -0.6, 0.1]
    peaks = [
        np.abs(torque(arm, (k, free, (x, y)))).max()
        for k, free, x, y in rng.uniform(low, [6000, 0.75, -0.2, 0.3], (20000, 4))
    ]
    assert min(peaks) > np.abs(torque(arm, BEST)).max()
