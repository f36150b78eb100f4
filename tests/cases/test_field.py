# pyright: reportOptionalMemberAccess=false, reportArgumentType=false
"""Machines from public exercises, examples and bug reports, against closed forms and printed values of the source."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax.analysis import document
from linkjax.cli import main
from linkjax.cli._console import console
from linkjax.kinematics import crank_ranges, pose, prepared
from linkjax.scenes import load, loads_text
from tests.cases.drawn import circles

FIELD = Path(__file__).parent / "field"
NEAR = 1e-9


def scene(name: str) -> lj.Scene:
    return load(FIELD / f"{name}.toml")


def lengths(machine: lj.Scene) -> dict[str, float]:
    return {name: float(link.length) for name, link in machine.mechanism.links.items()}


def places(machine: lj.Scene, angles) -> dict[str, Any]:
    """Positions of all points at crank angles."""

    def at(phi):
        return {name: (state.r.x + 0 * phi, state.r.y + 0 * phi) for name, state in pose(ready, phi).points.items()}

    ready = prepared(machine.mechanism)
    here = jax.jit(jax.vmap(at))(jnp.asarray(angles, dtype=float))
    return {name: np.asarray(x) + 1j * np.asarray(y) for name, (x, y) in here.items()}


@pytest.mark.parametrize("name", ["f01-sketch", "f01b-phase"])
def test_a_four_bar_has_the_lengths_and_places_of_its_drawing(name):
    machine = scene(name)
    exact = {"crank": 1.0, "coupler": math.sqrt(10), "rocker": math.sqrt(5)}
    assert lengths(machine) == pytest.approx(exact, rel=NEAR)
    at = places(machine, [0.0])
    assert {p: complex(at[p][0]) for p in "ABCD"} == pytest.approx({"A": 0, "B": 1j, "C": 3 + 2j, "D": 4}, abs=4 * NEAR)


def test_a_phase_that_is_as_drawn_makes_the_same_machine():
    one, two = scene("f01-sketch"), scene("f01b-phase")
    leaves = (jax.tree.leaves(each.mechanism) for each in (one, two))
    assert one.mechanism.formula() == two.mechanism.formula()
    np.testing.assert_allclose(*(np.array([float(leaf) for leaf in each]) for each in leaves), rtol=0, atol=1e-14)


def test_a_four_bar_in_centimetres_has_the_range_its_lengths_allow():
    """PMKS, issue 91: the coupler is not longer than drawn; the crank stops where coupler and rocker are stretched."""
    machine = scene("c10-pmks91")
    assert lengths(machine)["CBE"] == pytest.approx(43.471e-3, abs=5e-7)
    (only,) = crank_ranges(machine.mechanism)
    assert [math.degrees(end) for end in (only.start, only.stop)] == pytest.approx([-163.5440, 124.4662], abs=5e-5)
    a, b, c, d = 41 + 37.5j, 12.44 + 1.96j, -23.2 - 22.93j, 1.65 + 13.22j  # mm
    crank, reach, frame = abs(b - a), abs(c - b) + abs(d - c), abs(d - a)
    half = math.acos((crank**2 + frame**2 - reach**2) / (2 * crank * frame))
    drawn = float(np.angle((b - a) / (d - a)))
    ends = sorted(math.remainder(sign * half - drawn, 2 * math.pi) for sign in (-1, 1))
    assert (only.start, only.stop) == pytest.approx(ends, abs=1e-12)


def torque_of_f02(phi):
    """The torque that balances the load, -F dx/dφ, and the angle between the rod and the normal of the guide."""
    r, rod, force = 0.05, 0.15, -1000.0
    tilt = np.arcsin(r * np.sin(phi) / rod)
    return force * r * np.sin(phi + tilt) / np.cos(tilt), np.pi / 2 + tilt


@pytest.fixture(scope="module")
def static():
    return lj.analyse(scene("f02-static"), angles=jnp.radians(jnp.arange(0.0, 360.0, 30.0)))


def test_a_machine_without_masses_has_the_torque_of_its_load(static):
    phi = np.asarray(static.angles)
    torque, transmission = torque_of_f02(phi)
    np.testing.assert_allclose(static.forces_constant_speed.drive_torque, torque, rtol=0, atol=1e-9)
    data = document(static)
    (group,) = (each for each in data["groups"].values() if each["kind"] == "RRP")
    np.testing.assert_allclose(group["transmission_angle"], transmission, atol=1e-12)


def test_a_machine_without_masses_has_no_number_of_a_motion(static):
    assert static.missing.reason.startswith("no actual motion: nothing has a mass")
    data = document(static)
    for key in ("speed", "acceleration", "delta", "max_speed", "min_speed", "period", "steady_state_margin"):
        assert data["motion"][key] is None, key
    assert data["forces"] is None


def test_a_machine_without_masses_is_analysed_by_the_command(command):
    """The message gives the reason why there is no motion, and no coefficient of speed fluctuation."""
    code, out = command("analyse", str(FIELD / "f02-static.toml"), "--angles", "12")
    assert code == 0
    assert "nothing has a mass" in out
    assert "δ" not in out
    assert "delta" not in out


@pytest.fixture
def command(monkeypatch, capsys):
    """Exit code and printed text, including errors, of one call."""

    def called(*words: str) -> tuple[int, str]:
        monkeypatch.setattr("sys.argv", ["linkjax", *words])
        monkeypatch.setattr(console, "quiet", False)
        with pytest.raises(SystemExit) as left:
            main()
        return int(left.value.code or 0), " ".join("".join(capsys.readouterr()).split())

    return called


def jansen(phi) -> dict[str, np.ndarray]:
    """Jansen's leg by circles, with the orientation of Jansen's drawing (mm)."""
    o, g = 0j, -38 - 7.8j
    m = o + 15 * np.exp(1j * np.asarray(phi))
    top = circles(m, 50.0, g, 41.5, -1)
    low = circles(m, 61.9, g, 39.3, 1)
    turn = (top - g) / np.abs(top - g)
    far = g + turn * (2.6098795 + 40.0149788j)
    knee = circles(far, 39.4, low, 36.7, -1)
    turn = (knee - low) / np.abs(knee - low)
    return {"J2": top, "J3": far, "J4": low, "J5": knee, "F": low + turn * (-7.7465940 + 48.3837812j)}


def test_jansens_leg_walks_along_its_path():
    phi = np.linspace(0, 2 * math.pi, 73)
    at, exact = places(scene("c15-jansen"), phi), jansen(phi)
    assert 1000 * complex(at["F"][0]) == pytest.approx(-43.1601 - 91.7569j, abs=1e-4)
    for name, path in exact.items():
        np.testing.assert_allclose(1000 * at[name], path, rtol=0, atol=1e-9, err_msg=name)


@pytest.mark.slow
def test_jansens_leg_runs_at_constant_speed():
    """For all masses; over a cycle, weight and inertia do no work."""
    cycle = lj.analyse(scene("c15-jansen"), constant_speed=True)
    assert cycle.missing is None
    torque = np.asarray(cycle.forces_constant_speed.drive_torque)
    assert abs(np.mean(torque)) < 1e-9 * np.max(np.abs(torque))


@pytest.mark.slow
def test_jansens_leg_without_a_motion_is_told_with_all_else(command, tmp_path):
    """The masses cannot carry the machine through its cycle: the command fails, but prints the results that exist."""
    file = tmp_path / "leg.json"
    code, out = command("analyse", str(FIELD / "c15-jansen.toml"), "--angles", "36", "--json", str(file))
    data = json.loads(file.read_text(encoding="utf-8"))
    assert code == 1
    assert "no steady-state motion" in out
    assert "no steady-state motion" in data["result"]["message"]
    assert not any(data["motion"][key] for key in ("delta", "speed", "time"))
    foot = data["points"]["F"]
    assert (foot["x"][0], foot["y"][0]) == pytest.approx((-43.1601e-3, -91.7569e-3), abs=1e-7)
    assert len(data["forces_constant_speed"]["drive_torque"]) == 36


THREE = """
speed = "450 rpm"
mean = "midrange"
[fixed]
A = [0, 0]
[links.shaft]
length = "100 mm"
[flywheel]
inertia = "360 kg m^2"
[[groups]]
kind = "crank"
link = "shaft"
pivot = "A"
end = "B"
"""


@pytest.mark.slow
def test_an_engine_of_three_cranks_fluctuates_as_its_turning_moment_says():
    """3600 sin φ + 7500 sin 3φ (N m), as means over 36 windows: all of its work from one zero to another."""
    ends = np.radians(np.arange(0.0, 361.0, 10.0))
    work = -3600 * np.cos(ends) - 2500 * np.cos(3 * ends)  # integrated
    torques = -np.diff(work) / np.radians(10.0)
    text = THREE + "".join(
        f'[[loads]]\nname = "cell{i}"\nlink = "shaft"\ntorque = "{torque!r} N m"\n'
        f'window = ["{10 * i} deg", "{10 * i + 10} deg"]\n'
        for i, torque in enumerate(torques.tolist())
    )
    cycle = lj.analyse(loads_text(text))
    exact = float(np.ptp(work)) / (360 * (450 * math.pi / 30) ** 2)
    assert float(cycle.delta) == pytest.approx(exact, rel=1e-9)
    assert float(cycle.delta) == pytest.approx(0.0152607, abs=5e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("turns", "printed"), [(5, 326.6), pytest.param(20, 339.5, marks=pytest.mark.slow)])
def test_a_punching_press_has_the_flywheel_of_its_source(turns, printed):
    """From 160 to 140 rpm: the work of a blow minus that of the motor during the blow. At 150 rpm and 30 blows per
    minute one turn in five has a blow, as in the source; and one turn in twenty."""
    cycle = lj.analyse(load(FIELD / "c27-turns20.toml", {"cycle_turns": turns}))
    drop = 7200 * math.pi / 2 * (1 - 1 / (4 * turns))
    exact = 2 * drop / ((160**2 - 140**2) * (math.pi / 30) ** 2)
    assert exact == pytest.approx(printed, abs=0.05)
    assert float(document(cycle)["flywheel"]["for_target_delta"]) == pytest.approx(exact, rel=1e-9)


@pytest.mark.slow
def test_many_turns_cost_little():
    """A load that opposes a shaft that turns one way is the same signed torque, in 200 turns as in one; its closed form
    is that of the press above."""
    text = (FIELD / "c27-turns20.toml").read_text().replace("cycle_turns = 20", "cycle_turns = 200")
    signed = text.replace("opposing = true\n", "").replace('"7200', '"-7200')
    one, two = (lj.analyse(loads_text(each), angles=8) for each in (text, signed))
    assert float(one.delta) == pytest.approx(float(two.delta), rel=1e-9)
    drop = 7200 * math.pi / 2 * (1 - 1 / 800)
    exact = 2 * drop / ((160**2 - 140**2) * (math.pi / 30) ** 2)
    assert float(one.flywheel.for_target_delta) == pytest.approx(exact, rel=1e-9)
