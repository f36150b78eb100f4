"""Dampers and drag: forces, power and share by hand, at given crank speeds."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax.forces import kinetostatics
from linkjax.loads import Instant, power
from tests.helpers import assert_gradients_agree

CRANK, SPEED = 0.020, 12.0
PHI = np.linspace(0.1, 6.0, 9)
YOKE = lj.scotch_yoke(CRANK)
MADE = dataclasses.replace(YOKE, fixed={**YOKE.fixed, "Q": lj.Vec(-0.05, 0.0), "R": lj.Vec(0.01, 0.06)})
PRESS = lj.load("hay-press")
BETWEEN = lj.Damper("between", "rod", "E", "rocker", to_point="S5", coefficient=300.0)
HINGE = lj.TorsionDamper("hinge", "rocker", "link4", coefficient=4.0)
AIR = lj.Drag("air", "rod", "E", linear=7.0, quadratic=3.0)
FAN = lj.DragTorque("fan", "rocker", linear=0.4, quadratic=0.02)
EVERY = (BETWEEN, lj.TorsionDamper("shaft", "crank", coefficient=0.5), HINGE, AIR, FAN)


def shares(load: lj.loads.AbstractLoad, made=MADE, speed=SPEED) -> np.ndarray:
    """Share in the reduced torque (N m) over the crank angle, at a crank speed."""
    at = jax.jit(jax.vmap(lambda phi: load.share(lj.pose(made, phi), Instant(phi, phi, jnp.asarray(speed)))))
    return np.asarray(at(PHI))


@pytest.mark.parametrize("speed", [SPEED, 3.0])
def test_a_damper_on_the_line_of_a_scotch_yoke(speed):
    """x = r cos φ: the length changes at - r ω sin φ, and the power is - c r² ω² sin² φ."""
    found = shares(lj.Damper("d", "yoke", "E", to_point="Q", coefficient=40.0), speed=speed)
    np.testing.assert_allclose(found * speed, -40.0 * (CRANK * speed * np.sin(PHI)) ** 2, rtol=1e-12, atol=1e-16)
    assert np.all(found <= 0)


def test_a_damper_beside_the_line():
    """Length √((x - a)² + b²), whose rate is (x - a) ẋ / length; the force is along the line."""
    load = lj.Damper("d", "yoke", "E", to_point="R", coefficient=40.0)
    x, v = CRANK * np.cos(PHI) - 0.01, -CRANK * SPEED * np.sin(PHI)
    rate = x * v / np.hypot(x, 0.06)
    np.testing.assert_allclose(shares(load) * SPEED, -40.0 * rate**2, rtol=1e-11, atol=1e-16)
    (one,) = load.wrenches(lj.pose(MADE, jnp.asarray(PHI[2])), Instant(*map(jnp.asarray, (PHI[2], PHI[2], SPEED))))
    size = np.hypot(x, 0.06)[2]
    force = 40.0 * rate[2] * np.array([-x[2], 0.06]) / size
    np.testing.assert_allclose([float(one.force.x), float(one.force.y)], force, rtol=1e-12)


def test_torsion_dampers():
    """On the crank - c ω; between two links - c (ω₁ - ω₂)² times the speed."""
    np.testing.assert_allclose(shares(lj.TorsionDamper("d", "crank", coefficient=0.3)), -0.3 * SPEED, rtol=1e-14)
    links = jax.vmap(lambda phi: lj.pose(PRESS.mechanism, phi).links)(PHI)
    rate = np.asarray(links["rocker"].w - links["link4"].w)
    np.testing.assert_allclose(shares(HINGE, PRESS.mechanism), -4.0 * rate**2 * SPEED, rtol=1e-13)


def test_drag_against_the_closed_form():
    """On the yoke v = r ω sin φ: power - c₁ v² - c₂ |v|³; on the crank - c₁ ω² - c₂ ω³."""
    v = CRANK * SPEED * np.sin(PHI)
    found = shares(lj.Drag("d", "yoke", "E", linear=40.0, quadratic=70.0)) * SPEED
    np.testing.assert_allclose(found, -40.0 * v**2 - 70.0 * np.abs(v) ** 3, rtol=1e-12, atol=1e-16)
    found = shares(lj.DragTorque("d", "crank", linear=0.2, quadratic=0.01)) * SPEED
    np.testing.assert_allclose(found, -0.2 * SPEED**2 - 0.01 * SPEED**3, rtol=1e-14)


def test_the_drag_torque_of_a_link_that_turns_clockwise():
    made = lj.four_bar(0.5, 0.1, 0.5, 0.1, rotation="cw")
    here, at = lj.pose(made, jnp.asarray(1.0)), Instant(*map(jnp.asarray, (1.0, 1.0, SPEED)))
    (one,) = lj.DragTorque("d", "crank", linear=0.2, quadratic=0.01).wrenches(here, at)
    assert float(one.couple) == pytest.approx(0.2 * SPEED + 0.01 * SPEED**2)  # against the rotation


@pytest.mark.parametrize("load", EVERY, ids=lambda load: load.name)
def test_the_share_is_the_power_of_the_forces_and_never_drives(load):
    """Every force times the velocity of its point, in numbers, divided by the crank speed."""
    for phi in PHI[::3]:
        here = lj.pose(PRESS.mechanism, jnp.asarray(phi))
        at = Instant(jnp.asarray(phi), jnp.asarray(phi), jnp.asarray(SPEED))
        total = 0.0
        for link, point, force, couple in load.wrenches(here, at):
            total += float(couple) * float(here.links[link].w) * SPEED
            if point:
                v = SPEED * np.array([float(here.points[point].dr.x), float(here.points[point].dr.y)])
                total += float(v @ np.array([float(force.x), float(force.y)]))
        share = float(load.share(here, at))
        assert share == pytest.approx(total / SPEED, rel=1e-12) and share < 0
        assert share == float(power(here, load.wrenches(here, at)))


def test_kinetostatics_knows_the_speed():
    """The drive torque at constant speed without masses is minus the share."""
    load = lj.Damper("d", "yoke", "E", to_point="Q", coefficient=40.0)
    scene = lj.Scene(MADE, (load,), speed=SPEED)
    assert scene.loads[0].depends_on == {"position", "speed"} and not scene.loads[0].opposing
    forces = kinetostatics(scene, jnp.asarray(PHI[3]), jnp.asarray(SPEED), jnp.zeros(()))
    assert float(forces.drive_torque) == pytest.approx(-shares(load)[3], rel=1e-12)
    assert float(forces.net_frame.fx) == pytest.approx(0.0, abs=1e-14)  # the damper pulls the frame back


def test_between_two_links_it_is_no_load_on_the_whole():
    phi, speed, none = (jnp.asarray(x) for x in (0.7, SPEED, 0.0))
    with_it, without = (kinetostatics(dataclasses.replace(PRESS, loads=loads), phi, speed, none)
                        for loads in ((BETWEEN, HINGE), ()))  # fmt: skip
    for key in ("fx", "fy"):
        assert float(getattr(with_it.loads, key)) == pytest.approx(0.0, abs=1e-10)
        assert float(getattr(with_it.net_frame, key)) == pytest.approx(float(getattr(without.net_frame, key)), rel=1e-9)
    assert float(with_it.loads.moment) == pytest.approx(0.0, abs=1e-9)


def test_no_singularity_at_rest(rng):
    """At a dead centre the velocity is zero: force and gradients exist, also at crank speed zero."""

    def share(linear, quadratic, phi, speed):
        drag = lj.Drag("d", "yoke", "E", linear=linear, quadratic=quadratic)
        fan = lj.DragTorque("f", "crank", linear=linear, quadratic=quadratic)
        here, at = lj.pose(MADE, phi), Instant(phi, phi, speed)
        return drag.share(here, at) + fan.share(here, at)

    slopes = jax.jit(jax.grad(share, argnums=(0, 1, 2, 3)))
    for phi, speed in ((0.0, SPEED), (math.pi, SPEED), (1.0, 0.0), (0.0, 0.0)):
        assert np.all(np.isfinite(np.asarray(slopes(40.0, 70.0, phi, speed))))


@pytest.mark.slow
def test_gradients_with_respect_to_design_loads_and_speed(rng):
    def total(tree):
        scene, speed = tree

        def at(phi):
            here = lj.pose(scene.mechanism, phi)
            share = sum(load.share(here, Instant(phi, phi, speed)) for load in scene.loads)
            return share + 0.1 * kinetostatics(scene, phi, speed, jnp.zeros(())).reactions["G"]["link4"].fy

        return jnp.sum(jax.vmap(at)(jnp.asarray([0.4, 2.0])) ** 2)

    assert_gradients_agree(total, (dataclasses.replace(PRESS, loads=EVERY), jnp.asarray(SPEED)), rng)


def test_what_is_refused():
    negative = (
        lambda: lj.Damper("d", "yoke", "E", to_point="Q", coefficient=-1.0),
        lambda: lj.Drag("d", "yoke", "E", linear=-1.0),
        lambda: lj.Drag("d", "yoke", "E", quadratic=-1.0),
    )
    for make in negative:
        with pytest.raises(ValueError, match=r"of load 'd' must not be negative, but is -1\.0; write zero"):
            make()
    with pytest.raises(ValueError, match="coefficient of load 'd' is nan; write a finite number"):
        lj.TorsionDamper("d", "crank", coefficient=math.nan)
    with pytest.raises(ValueError, match="quadratic of load 'd' is inf; write a finite number"):
        lj.DragTorque("d", "crank", quadratic=math.inf)
    refused = {
        "link 'yoke' never turns, so there is no motion": lj.DragTorque("d", "yoke", linear=1.0),
        "point 'A' never moves, so there is no motion": lj.Drag("d", "crank", "A", linear=1.0),
        "link 'yoke' never turns, and its other end neither": lj.TorsionDamper("d", "yoke", coefficient=1.0),
        "point 'A' never moves, and its other end neither": lj.Damper("d", "crank", "A", to_point="Q", coefficient=1.0),
    }
    for message, load in refused.items():
        with pytest.raises(lj.StructureError, match=message):
            lj.Scene(MADE, (load,))
    here = lj.pose(MADE, jnp.asarray(1.0))
    with pytest.raises(ValueError, match="load 'd' depends on the crank speed, which is not known here"):
        lj.DragTorque("d", "crank", linear=1.0).share(here, Instant(jnp.asarray(1.0), jnp.asarray(1.0)))


@pytest.mark.slow
def test_an_analysis_with_a_wanted_fluctuation_and_a_damper():
    """The flywheel that the analysis finds gives the wanted δ, by the motion with this flywheel."""
    two = lj.load("two-cylinder")
    loads = (*two.loads, lj.TorsionDamper("oil", "crank", coefficient=0.3))
    scene = lj.Scene(two.mechanism, loads, two.gravity, two.speed, 0.02)
    cycle = lj.analyse(scene, angles=24)
    assert cycle.flywheel is not None
    wheel = lj.Flywheel(float(cycle.flywheel.for_target_delta))
    heavy = lj.Mechanism(two.mechanism.fixed, two.mechanism.links, two.mechanism.groups, wheel)
    found = lj.steady_motion(lj.Scene(heavy, loads, two.gravity, two.speed))
    assert float(found.delta) == pytest.approx(0.02, rel=1e-7)
