"""Reference cases G1-G5, G7-G10 and T5: values computed elsewhere by two methods, and printed values of the sources.

Tolerances are those stated with the cases. `tests/data` contains the numbers.
"""

from __future__ import annotations

import json
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import RRP, Crank, Force, Link, Mechanism, Vec
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.kinematics import dead_centres, pose
from linkjax.motion import flywheel_for, make_grid, node_values, steady_motion
from linkjax.reduction import reduced_model
from tests.helpers import ROOT
from tests.physics import oracle
from tests.physics.machines import machine

GOLDEN = json.loads((ROOT / "tests/data/golden.json").read_text(encoding="utf-8"))
PRINTED = json.loads((ROOT / "tests/data/printed.json").read_text(encoding="utf-8"))
LINKS = {"1": "crank", "2": "rod", "3": "slider", "4": "link4", "5": "rocker"}
NOMINAL = 700 * math.pi / 30


@compiled_soon
def story(scene, phi, speed):
    def at(phi, speed):
        return (
            pose(scene.mechanism, phi),
            reduced_model(scene, phi),
            kinetostatics(scene, phi, speed, jnp.zeros_like(speed)),
        )

    return jax.vmap(at)(phi, speed)


def told(scene, degrees, speeds) -> Any:
    phi = jnp.radians(jnp.asarray(degrees, dtype=float))
    return jax.device_get(story(scene, phi, jnp.asarray(speeds, dtype=float)))


@pytest.fixture(scope="module")
def at45():
    """The hay press at 45 degrees: at rest, at unit speed, and at 700 rpm; the cycle's twelve positions at 10 rad/s."""
    degrees = [45, 45, 45, *range(0, 360, 30)]
    return told(machine("hay-press"), degrees, [0.0, 1.0, NOMINAL, *[10.0] * 12])


def parts(state, i=0):
    return [[float(v.x[i]), float(v.y[i])] for v in state]


@pytest.mark.parametrize("point", ["B", "D", "S2", "E", "G", "S4", "S5"])
def test_g1_to_g3_kinematics(at45, point):
    np.testing.assert_allclose(parts(at45[0].points[point]), GOLDEN["press.kin45"][point], rtol=0, atol=1e-9)


@pytest.mark.parametrize("order", ["positions", "first", "second"])
def test_g1_to_g3_as_printed(at45, order):
    table = PRINTED[order]
    number = ("positions", "first", "second").index(order)
    for point, printed in table["values"].items():
        got = parts(at45[0].points[point])[number]
        for value, known in zip(got, printed, strict=True):
            assert known is None or abs(value - known) <= table["tolerance"], point


def test_g4_rates_of_the_links(at45):
    for number, link in LINKS.items():
        got = at45[0].links[link]
        assert got.w[0] == pytest.approx(GOLDEN["press.kin45"]["w"][number], abs=1e-9)
        assert got.e[0] == pytest.approx(GOLDEN["press.kin45"]["e"][number], abs=1e-9)
        for value, known, tolerance in zip(
            (got.w[0], got.e[0]),
            PRINTED["rates"]["values"].get(link, ()),
            PRINTED["rates"]["tolerances"].get(link, ()),
            strict=False,
        ):
            assert abs(value - known) <= tolerance
    rates = [at45[0].links[link] for link in ("rod", "link4", "rocker")]
    assert [r.w[0] for r in rates] == pytest.approx([-0.212622, -1.097494, -1.752557], abs=1e-6)
    assert [r.e[0] for r in rates[:2]] == pytest.approx([0.203009, -3.258201], abs=1e-6)


def test_g5_reduction(at45):
    reduced = at45[1]
    assert reduced.inertia[0] == pytest.approx(6.248729, rel=1e-5)
    assert reduced.slope[0] == pytest.approx(12.2366, rel=1e-5)
    assert reduced.by_load["gravity"][0] == pytest.approx(-57.5408, rel=1e-5)
    assert reduced.torque[0] == reduced.by_load["gravity"][0]  # 45 degrees is outside the load's window
    printed = PRINTED["reduced_inertia"]
    assert reduced.inertia[0] == pytest.approx(printed["value"], rel=printed["relative"])


def test_the_cycle_in_twelve_positions(at45):
    poses, reduced, forces = at45
    d, g, links = poses.points["D"], poses.points["G"], poses.links
    columns = [
        d.r.x, d.dr.x, d.ddr.x, g.r.x, g.r.y, links["rod"].w, links["link4"].w, links["rocker"].w, links["rocker"].e,
        reduced.inertia, reduced.by_load["gravity"],
    ]  # fmt: skip
    golden = np.asarray(GOLDEN["press.cycle"]["rows"])
    slopes = GOLDEN["press.cycle"]["columns"].index("dI/dphi")
    np.testing.assert_allclose(
        np.stack(columns, axis=-1)[3:], np.delete(golden, [0, slopes, 13], axis=1), rtol=1e-9, atol=1e-9
    )
    # the slope in the table is a difference quotient: 1.6e-8 wrong at 60 degrees, by 50-digit arithmetic
    np.testing.assert_allclose(reduced.slope[3:], golden[:, slopes], rtol=0, atol=2e-8)
    truth = oracle.reduction(machine("hay-press"), np.radians(golden[:, 0])).slope
    np.testing.assert_allclose(reduced.slope[3:], truth, rtol=0, atol=1e-12)
    torque = forces.drive_torque[3:] + reduced.by_load["hay"][3:]  # the table contains gravity and inertia only
    np.testing.assert_allclose(torque, golden[:, -1], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("case", "number"), [("static", 0), ("700rpm", 2)])
def test_g7_newton_euler(at45, case, number):
    forces, golden = at45[2], GOLDEN[f"press.kinetostatics45.{case}"]
    on = {"A": "crank", "B": "rod", "D": "slider", "E": "link4", "G": "rocker", "F": "rocker"}
    size = max(abs(v) for v in golden.values())
    for joint, link in on.items():
        got = forces.reactions[joint][link]
        np.testing.assert_allclose([got.fx[number], got.fy[number]], [golden[f"{joint}{c}"] for c in "xy"], rtol=1e-8)
        assert got.moment[number] == 0
    guide = forces.reactions["slider.guide"]["slider"]
    assert guide.fy[number] == pytest.approx(golden["N"], rel=1e-8)
    assert (guide.fx[number], guide.moment[number]) == pytest.approx((0.0, golden["Mg"]), abs=1e-12 * size)
    assert forces.drive_torque[number] == pytest.approx(golden["T"], rel=1e-8)
    assert forces.drive_torque[number] == pytest.approx({"static": 57.5408, "700rpm": 32933.93}[case], rel=1e-6)


def test_g8_forces_on_the_frame(at45):
    """The forces of joints and guide on the frame are weight and inertia."""
    forces, scene = at45[2], machine("hay-press")
    into = [forces.reactions["A"]["crank"], forces.reactions["F"]["rocker"], forces.reactions["slider.guide"]["slider"]]
    mass = 5 + 15 + 40 + 3.2 + 10
    for number, speed in ((0, 0.0), (1, 1.0), (2, NOMINAL)):
        reaction = -sum(complex(f.fx[number], f.fy[number]) for f in into)
        inertia = complex(*GOLDEN["press.shaking45_per_w2"]) * speed**2
        size = max(abs(complex(f.fx[number], f.fy[number])) for f in into)
        assert abs(reaction - inertia - mass * complex(0, float(scene.gravity.y))) <= 1e-9 * size
        assert abs(complex(forces.frame.fx[number], forces.frame.fy[number]) - reaction) <= 1e-9 * size
        assert abs(complex(forces.shaking.fx[number], forces.shaking.fy[number]) - inertia) <= 1e-9 * max(1, speed**2)


def test_inertia_of_each_link(at45):
    """d'Alembert forces and couples at unit crank speed."""
    poses = at45[0]
    for number, link in LINKS.items():
        mass = {"1": 5.0, "2": 15.0, "3": 40.0, "4": 3.2, "5": 10.0}[number]
        golden = GOLDEN["press.inertia45_per_w1sq"][number]
        a = poses.points[f"S{number}"].ddr
        body = poses.bodies[link][f"S{number}"]
        assert (body.mass[0], poses.links[link].w[0]) == (mass, pytest.approx(GOLDEN["press.kin45"]["w"][number]))
        got = [-mass * a.x[0], -mass * a.y[0], -body.inertia[0] * poses.links[link].e[0]]
        np.testing.assert_allclose(got, [golden[k] for k in ("Fx", "Fy", "M")], rtol=1e-9, atol=1e-12)


@pytest.fixture(scope="module")
def regime():
    @compiled_soon
    def turn(scene, target):
        grid = make_grid(scene, 192)
        here = node_values(scene, grid)
        return steady_motion(scene, 192), here, flywheel_for(scene, target, 192)

    return turn(machine("hay-press"), jnp.asarray(0.15))


def test_g9_steady_cycle_and_flywheel(regime):
    motion, here, flywheel = regime
    golden = GOLDEN["press.dynamics"]
    assert float(motion.delta) == pytest.approx(1.1215, rel=5e-4)
    assert float(flywheel) == pytest.approx(19.231, rel=5e-4)
    known = {"delta0": motion.delta, "IM_for_0p15": flywheel, "mean_drive_torque": motion.mean_drive_torque}
    known |= {"wmax0": motion.max_speed, "wmin0": motion.min_speed}
    for name, value in known.items():
        assert float(value) == pytest.approx(golden[name], rel=5e-4), name
    assert golden["I_min"] < float(jnp.min(here.inertia)) < float(jnp.max(here.inertia)) < golden["I_max"] * (1 + 1e-6)


def test_the_mean_drive_torque_in_closed_form(regime):
    """In the window the rocker oscillates in one direction: the work is force times radius times angle."""
    on, off = np.radians([90.0, 335.0])
    before, after = (oracle.assemble(machine("hay-press").mechanism, phi)[1]["rocker"] for phi in (on, off))
    swing = abs(np.angle(after / before))
    assert float(regime[0].mean_drive_torque) == pytest.approx(30e3 * 0.2 * swing / (2 * math.pi), rel=1e-9)


def test_g10_stroke_of_the_rocker():
    found = jax.device_get(compiled_soon(dead_centres)(machine("hay-press").mechanism))["rocker"]
    angles = np.sort(np.degrees(found.angle[found.present]))
    assert angles == pytest.approx([81.4346, 347.4388], abs=5e-5)  # all digits printed


def test_t5_slider_crank():
    known = GOLDEN["textbook.slider_crank"]
    masses = known["m"]
    mechanism = Mechanism(
        {"A": Vec(0.0, 0.0)},
        {
            "crank": Link(length=known["l1"], mass=masses[0], centre=Vec(known["xs1"], 0.0)),
            "rod": Link(length=known["l2"], mass=masses[1], centre=Vec(known["xs2"], 0.0), inertia=known["J2"]),
            "slider": Link(mass=masses[2]),
        },
        [Crank("crank", "A", "B"), RRP("rod", "slider", "B", "C", "A")],
    )
    scene = lj.Scene(mechanism, (Force("load", "slider", "C", force=Vec(known["slider_force_x"], 0.0)),))
    forces = told(scene, [known["theta_deg"]], [known["w"]])[2]
    guide = forces.reactions["slider.guide"]["slider"]
    on = [forces.reactions[joint][link] for joint, link in (("A", "crank"), ("B", "rod"), ("C", "slider"))]
    got = [part[0] for f in on for part in (f.fx, f.fy)] + [guide.fy[0], guide.moment[0], forces.drive_torque[0]]
    np.testing.assert_allclose(got, known["x"], rtol=1e-9, atol=1e-9)
    assert got[-1] == pytest.approx(-4.8919315, rel=1e-7)
