# pyright: reportArgumentType=false
"""Drivers with a motion law: the laws against SciPy, forces and power of the drive, refused input."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import linkjax as lj
from linkjax import RRP, Crank, Flywheel, Guide, Harmonic, LinearDriver, Link, Mechanism, Spline, StructureError, Vec
from linkjax.analysis import document
from linkjax.design import number
from linkjax.measures import MEASURES, evaluate
from tests.physics.machines import PRESCRIBED, machine

KNOTS = np.array([0.3, 0.9, 2.0, 2.2, 4.0, 5.5])
VALUES = np.array([0.1, 0.4, 0.7, 0.65, -0.2, 0.0])


def test_the_spline_is_that_of_scipy():
    law = Spline(tuple(KNOTS), VALUES)
    phi = np.linspace(-7.0, 14.0, 300)
    known = CubicSpline([*KNOTS, KNOTS[0] + 2 * math.pi], [*VALUES, VALUES[0]], bc_type="periodic")
    got = jax.vmap(law.at)(jnp.asarray(phi))
    for order, part in enumerate(got):
        truth = known(KNOTS[0] + np.mod(phi - KNOTS[0], 2 * math.pi), order)
        np.testing.assert_allclose(part, truth, rtol=0, atol=1e-13 * np.max(np.abs(truth)))


@pytest.mark.parametrize("law", [Harmonic(0.2, 1.1), Spline(tuple(KNOTS), VALUES)])
def test_rates_are_derivatives(law):
    phi = jnp.linspace(0.1, 6.2, 40)
    d = jax.vmap(jax.grad(lambda x: law.at(x).value))(phi)
    dd = jax.vmap(jax.grad(jax.grad(lambda x: law.at(x).value)))(phi)
    got = jax.vmap(law.at)(phi)
    np.testing.assert_allclose(got.d, d, rtol=0, atol=1e-14)
    np.testing.assert_allclose(got.dd, dd, rtol=0, atol=1e-13)


def test_harmonic_ends():
    start, middle, stop = (Harmonic(0.2, 1.1).at(jnp.asarray(phi)) for phi in (0.0, math.pi / 2, math.pi))
    assert (float(start.value), float(stop.value)) == (0.2, 1.1) and float(middle.value) == pytest.approx(0.65)
    assert float(start.d) == 0.0 and abs(float(stop.d)) < 1e-15 and float(start.dd) > 0 > float(stop.dd)


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) for n in PRESCRIBED])
def test_the_analysis(name):
    """The speed is the prescribed one; drive force or torque times the driver velocity is the power of the loads."""
    scene = machine(name)
    cycle = lj.analyse(scene, angles=72)
    w = float(scene.speed)
    np.testing.assert_array_equal(cycle.speed, w)
    assert float(cycle.steady.delta) == 0.0 and not np.any(cycle.acceleration)
    np.testing.assert_allclose(cycle.time, np.asarray(cycle.angles) / w, atol=1e-12)
    assert max(float(check) for check in jax.tree.leaves(cycle.checks)) < 1e-10
    one, other = cycle.peaks, cycle.peaks_constant_speed
    np.testing.assert_allclose(one.value, other.value, rtol=1e-9)
    np.testing.assert_allclose(one.angle, other.angle, rtol=1e-9)
    rounding = 1e-12 * np.asarray(other.value)  # errors are differences of such values
    assert np.all(np.abs(np.asarray(one.error) - other.error) <= 1e-9 * np.asarray(other.error) + rounding)
    driver = scene.mechanism.driving_link
    (drive,) = cycle.forces.reactions[f"{driver}.drive"].values()
    if name == "hydraulic":
        v = cycle.pose.points["B"].dr
        power = drive.fx * v.x + drive.fy * v.y
        along = np.asarray([math.cos(0.2), math.sin(0.2)])
        across = np.stack([drive.fx, drive.fy], -1) @ np.array([-along[1], along[0]])
        assert np.max(np.abs(across)) < 1e-12 * np.max(np.abs(drive.fx))
    else:
        power = drive.moment * cycle.pose.links[driver].w
        assert not np.any(drive.fx) and not np.any(drive.fy)
    size = np.max(np.abs(power))
    np.testing.assert_allclose(cycle.forces.drive_torque, power, rtol=0, atol=1e-14 * size)
    assert float(cycle.work["drive"]) == pytest.approx(-sum(float(v) for k, v in cycle.work.items() if k != "drive"))
    data = document(cycle)
    assert data["model"]["method"] == "prescribed" and "has a motion law" in data["model"]["why"]
    assert {("point" if "point" in at else "link", next(iter(at.values()))) for at in data["dead_centres"]} >= {
        ("point", "B") if name == "hydraulic" else ("link", "crank")
    }
    stroke = data["strokes"]["B"] if name == "hydraulic" else data["swings"]["crank"]
    assert stroke["value"] == pytest.approx(0.12 if name == "hydraulic" else 1.6, rel=1e-12)
    assert stroke["time_ratio"] == pytest.approx(1.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", PRESCRIBED)
def test_every_measure_has_a_value_and_a_slope(name):
    scene = machine(name)

    def every(scene):
        found = evaluate(scene, list(MEASURES.values()))
        return jnp.stack([found[key] for key in sorted(MEASURES)])

    values, slopes = jax.jit(every)(scene), jax.jit(jax.jacfwd(every))(scene)
    assert bool(jnp.all(jnp.isfinite(values)))
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(slopes))
    got = dict(zip(sorted(MEASURES), values.tolist(), strict=True))
    assert got["delta"] == got["flywheel_for_target_delta"] == 0.0
    assert got["max_crank_speed"] == pytest.approx(float(scene.speed)) == got["min_crank_speed"]
    assert got["peak_reaction"] == pytest.approx(got["peak_reaction_constant_speed"], rel=1e-12)


@pytest.mark.slow
def test_a_spline_drives_as_the_law_that_it_follows():
    scene = machine("hydraulic")
    driver = scene.mechanism.groups[0]
    assert isinstance(driver, LinearDriver)
    knots = np.arange(48) * (2 * math.pi / 48)
    law = Spline(tuple(knots), jax.vmap(driver.law.at)(jnp.asarray(knots)).value)
    groups = [LinearDriver(driver.link, driver.end, driver.guide, law), *scene.mechanism.groups[1:]]
    m = scene.mechanism
    twin = scene.with_mechanism(Mechanism(m.fixed, {n: m.links[n] for n in m.link_names}, groups))
    at = np.linspace(0.05, 6.2, 30)
    one, two = (lj.analyse(each, angles=at) for each in (scene, twin))
    assert max(float(check) for check in jax.tree.leaves(two.checks)) < 1e-10
    size = np.max(np.abs(one.forces.drive_torque))
    np.testing.assert_allclose(two.forces.drive_torque, one.forces.drive_torque, rtol=0, atol=2e-3 * size)


def test_the_trammel():
    """Two blocks on crossed guides of the frame, one of them driven: every point of the bar moves on an ellipse."""
    links = {"shoe": Link(), "bar": Link(length=0.5, points={"T": Vec(0.2, 0.0), "U": Vec(0.7, 0.0)}), "block": Link()}
    law = Harmonic(0.4, -0.4)
    groups = [LinearDriver("shoe", "P", "O", law), RRP("bar", "block", "P", "Q", Guide("O", math.pi / 2))]
    mechanism = Mechanism({"O": Vec(0.0, 0.0)}, links, groups)
    here = jax.vmap(lambda phi: lj.pose(mechanism, phi))(jnp.linspace(0.0, 6.0, 31))
    for point, reach in (("T", 0.2), ("U", 0.7)):
        at = here.points[point].r
        along, across = 0.5 - reach, reach  # semi-axes
        np.testing.assert_allclose((at.x / along) ** 2 + (at.y / across) ** 2, 1.0, rtol=1e-14)


def simple(**keys) -> Mechanism:
    links = {"crank": Link(length=0.1), "rod": Link(length=0.3), "block": Link()}
    return Mechanism({"A": Vec(0, 0)}, links, [Crank("crank", "A", "B", **keys), RRP("rod", "block", "B", "D", "A")])


def test_what_is_refused():
    swinging = simple(law=Harmonic(0.0, 1.0))
    with pytest.raises(StructureError, match="target_delta: has no effect: the driver follows a law"):
        lj.Scene(swinging, target_delta=0.1)
    with pytest.raises(ValueError, match="takes its sense from the law"):
        simple(law=Harmonic(0.0, 1.0), rotation="cw")
    with pytest.raises(ValueError, match="there is no equation of motion to solve"):
        lj.analyse(lj.Scene(swinging), method="diffrax")
    with pytest.raises(StructureError, match=r"the cycle of 6\.28319 rad is not a multiple of the period of the law"):
        lj.Scene(simple(law=Spline((0.0, 1.0, 2.0), [0.0, 1.0, 0.5], 4 * math.pi)))
    assert lj.Scene(simple(law=Spline((0.0, 1.0, 2.0), [0.0, 1.0, 0.5], 4 * math.pi)), cycle_turns=2).cycle_turns == 2
    with pytest.raises(ValueError, match="needs three or more angles that increase"):
        Spline((0.0, 2.0, 1.0), [0.0, 1.0, 0.5])
    with pytest.raises(ValueError, match="needs three or more angles that increase"):
        Spline((0.0, 1.0, 7.0), [0.0, 1.0, 0.5])
    with pytest.raises(ValueError, match="a value at each of its 3 angles"):
        Spline((0.0, 1.0, 2.0), [0.0, 1.0])
    slide = [LinearDriver("block", "D", "A", Harmonic(0.0, 0.1))]
    with pytest.raises(StructureError, match="flywheel: needs a crank as the driver"):
        Mechanism({"A": Vec(0, 0)}, {"block": Link()}, slide, Flywheel(1.0))
    with pytest.raises(StructureError, match="the guide is on 'block', a link of the group itself"):
        Mechanism(
            {"A": Vec(0, 0)},
            {"block": Link()},
            [LinearDriver("block", "D", Guide("A", on="block"), Harmonic(0.0, 0.1))],
        )


def test_numbers_of_a_law():
    slide, swing = machine("hydraulic"), machine("swinging")
    assert number(slide, "groups.ram.law.stop").unit == "m" and number(swing, "groups.crank.law.stop").unit == "rad"


SLIDE = """
speed = "10 rpm"
[fixed]
A = [0, 0]
[links.piston]
mass = "2 kg"
[links.rod]
length = "300 mm"
[links.block]
mass = "1 kg"
[[groups]]
kind = "linear_driver"
link = "piston"
end = "B"
guide = { through = "A" }
law = { start = "0 mm", stop = "120 mm" }
[[groups]]
kind = "RRP"
link = "rod"
from = "B"
end = "D"
block = "block"
guide = { through = "A", along = "90 deg" }
"""


@pytest.mark.parametrize(
    ("old", "new", "key", "says"),
    [
        (', stop = "120 mm"', "", "groups[0].law", "has start, but a law has start and stop, or angles and values"),
        ('{ start = "0 mm", stop = "120 mm" }', "{}", "groups[0].law", "has no key"),
        ('start = "0 mm"', 'start = "0 deg"', "groups[0].law.start", "an angle where a length is needed"),
        ('start = "0 mm", stop = "120 mm"', 'angles = [0, "1 rad"], values = [0, 1]', "groups[0].law.angles",
         "three or more"),
        ('start = "0 mm", stop = "120 mm"', 'angles = [0, "1 rad", "2 rad"], values = [0, 1]', "groups[0].law.values",
         "2 values at 3 angles"),
        ('speed = "10 rpm"', 'speed = "10 rpm"\nflywheel = { inertia = 1 }', "flywheel", "there is no shaft for it"),
        ('speed = "10 rpm"', 'speed = "10 rpm"\ntarget_delta = 0.1', "target_delta", "the driver follows a law"),
        ('guide = { through = "A" }', 'guide = { through = "D", on = "rod" }', "groups[0].guide.on",
         "the guide of a linear driver is on the frame"),
        ('law = { start = "0 mm", stop = "120 mm" }', "", "groups[0].law", "missing"),
    ],
)  # fmt: skip
def test_messages(old, new, key, says):
    assert SLIDE.count(old) == 1
    with pytest.raises(lj.SceneError) as caught:
        lj.scenes.loads_text(SLIDE.replace(old, new), "slide.toml")
    assert caught.value.key == key and says in str(caught.value)


def test_values_of_a_spline_are_free_numbers():
    """By name; at a knot the crank is at its value, for all values of the others."""
    links = {"crank": Link(length=0.1, mass=1.0)}
    crank = lj.Crank("crank", "A", "B", law=Spline(tuple(KNOTS), VALUES))
    scene = lj.Scene(Mechanism({"A": lj.Vec(0.0, 0.0)}, links, [crank]), (), speed=3.0)
    names = [f"groups.crank.law.values[{i}]" for i in range(len(KNOTS))]
    assert [name for name in lj.design.numbers(scene) if ".law." in name] == names

    def stands(values):
        made = lj.design.changed(scene, dict(zip(names, values, strict=True))).mechanism
        return jnp.stack([jnp.asarray(lj.pose(made, jnp.asarray(phi)).links["crank"].angle) for phi in KNOTS])

    np.testing.assert_allclose(jax.jacfwd(stands)(jnp.asarray(VALUES)), np.eye(len(KNOTS)), atol=1e-14)
    np.testing.assert_allclose(stands(jnp.asarray(VALUES) + 0.1), np.asarray(VALUES) + 0.1, atol=1e-14)
