"""Machines that pass through their change points: smooth with branch = "continue", refused with a fixed side."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import RRP, RRR, Belt, Crank, Flywheel, Gear, Link, Mechanism, OpposingTorque, Torque, Vec
from linkjax.groups import BranchPath
from linkjax.kinematics import min_margin, pose, prepared

PLACES = np.concatenate([at + s * 10.0 ** -np.arange(1.0, 13.0) for at in (0.0, math.pi) for s in (1, -1)])
ANGLES = np.concatenate([np.linspace(0.0, 2 * math.pi, 73), np.mod(PLACES, 2 * math.pi)])
poses = jax.jit(lambda m, phi: jax.vmap(lambda one: pose(m, one))(phi))


def four_bar(crank: float, coupler: float, rocker: float, frame: float, side: int = 1, branch: str = "continue"):
    links = {
        name: Link(length=length, mass=1.0, inertia=0.01, centre=Vec(0.5 * length, 0.02))
        for name, length in (("crank", crank), ("coupler", coupler), ("rocker", rocker))
    }
    groups = [Crank("crank", "A", "B"), RRR(("coupler", "rocker"), "B", "D", "C", side, branch)]
    return Mechanism({"A": Vec(0.0, 0.0), "D": Vec(frame, 0.0)}, links, groups, Flywheel(1.0))


def slider(branch: str = "continue") -> Mechanism:
    links = {"crank": Link(length=0.2), "rod": Link(length=0.2), "ram": Link(mass=2.0)}
    groups = [Crank("crank", "A", "B"), RRP("rod", "ram", "B", "D", "A", 1, branch)]
    return Mechanism({"A": Vec(0.0, 0.0)}, links, groups, Flywheel(1.0))


def check(state, exact, first, second):
    """Position, first and second coefficients of a point: 15, 13 and 11 digits, also at the change point."""
    for part, truth, tolerance in zip(state, (exact, first, second), (1e-14, 1e-12, 1e-10), strict=True):
        np.testing.assert_allclose(part.x + 1j * part.y, truth, rtol=0, atol=tolerance)


RHOMBUS = pytest.param((0.3, 0.3, 0.3, 0.3), marks=pytest.mark.slow, id="rhombus")


@pytest.mark.parametrize("lengths", [pytest.param((0.1, 0.4, 0.1, 0.4), id="parallelogram"), RHOMBUS])
def test_a_parallelogram_stays_one(lengths):
    """The coupler keeps its direction, the rocker turns with the crank."""
    here = jax.device_get(poses(prepared(four_bar(*lengths)), jnp.asarray(ANGLES)))
    arm = lengths[0] * np.exp(1j * ANGLES)
    check(here.points["C"], lengths[3] + arm, 1j * arm, -arm)
    np.testing.assert_allclose(here.links["coupler"].u.y, 0.0, atol=1e-14)
    np.testing.assert_allclose(here.links["coupler"].w, 0.0, atol=1e-12)
    np.testing.assert_allclose(here.links["rocker"].w, 1.0, rtol=1e-12)
    np.testing.assert_allclose(here.links["rocker"].e, 0.0, atol=1e-10)


@pytest.mark.slow
def test_an_antiparallelogram_stays_one():
    """Crossed, the tangents of the half angles of crank and rocker have a constant product."""
    here = jax.device_get(poses(prepared(four_bar(0.1, 0.4, 0.1, 0.4, -1)), jnp.asarray(ANGLES)))
    half = np.exp(0.5j * ANGLES)
    turned = np.conj(0.6 * np.real(half) + 1j * np.imag(half))  # the rocker's half angle: tan ψ/2 = -tan(φ/2) / 0.6
    turned = turned / np.abs(turned)
    slope = -0.6 / (0.36 * np.cos(ANGLES / 2) ** 2 + np.sin(ANGLES / 2) ** 2)
    np.testing.assert_allclose(here.links["rocker"].u.x + 1j * here.links["rocker"].u.y, turned**2, atol=1e-13)
    np.testing.assert_allclose(here.links["rocker"].w, slope, atol=1e-11)


@pytest.mark.slow
def test_a_kite_stays_one():
    """The far pin is the mirror image of the crank's pivot in the line from crank pin to rocker's pivot; on the other
    branch it stays on the pivot."""
    here = jax.device_get(poses(prepared(four_bar(0.1, 0.1, 0.4, 0.4)), jnp.asarray(ANGLES)))
    line = 0.1 * np.exp(1j * ANGLES) - 0.4
    line = line / np.abs(line)
    c = here.points["C"].r
    np.testing.assert_allclose(c.x + 1j * c.y, 0.4 - 0.4 * line**2, atol=1e-14)
    here = jax.device_get(poses(prepared(four_bar(0.1, 0.1, 0.4, 0.4, -1)), jnp.asarray(ANGLES)))
    check(here.points["C"], 0.0, 0.0, 0.0)


@pytest.mark.slow
def test_a_kite_on_its_own_line_needs_two_turns():
    """Crank and frame of equal length: the pin moves on the half angle, and returns only after two turns."""
    machine = prepared(four_bar(0.3, 0.4, 0.4, 0.3), 2)
    phi = np.concatenate([ANGLES, ANGLES + 2 * math.pi])
    here = jax.device_get(poses(machine, jnp.asarray(phi)))
    reach = 0.3 * np.cos(phi / 2) + np.sqrt(0.16 - 0.09 * np.sin(phi / 2) ** 2)
    c = here.points["C"].r
    np.testing.assert_allclose(c.x + 1j * c.y, reach * np.exp(0.5j * phi), atol=1e-14)
    assert float(min_margin(machine, 2)) > 0 > float(min_margin(four_bar(0.3, 0.4, 0.4, 0.3)))


def test_a_slider_with_a_rod_as_long_as_its_crank():
    """2 r cos φ: through the dead centre, where the crank is perpendicular to the guide."""
    phi = np.mod(ANGLES + 0.5 * math.pi, 2 * math.pi)
    here = jax.device_get(poses(prepared(slider()), jnp.asarray(phi)))
    check(here.points["D"], 0.4 * np.cos(phi), -0.4 * np.sin(phi), -0.4 * np.cos(phi))
    np.testing.assert_allclose(here.links["rod"].w, -1.0, rtol=1e-12)


@pytest.mark.slow
def test_where_there_is_no_change_point_nothing_changes():
    one, two = (four_bar(0.1, 0.4, 0.3, 0.4, branch=branch) for branch in ("fixed", "continue"))
    one, two = (jax.device_get(poses(prepared(m), jnp.asarray(ANGLES))) for m in (one, two))
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(two), strict=True):
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-14)


def test_the_course_belongs_to_its_numbers():
    """A newly built mechanism has no path, and no path has derivatives with respect to the design."""
    machine = prepared(four_bar(0.1, 0.4, 0.1, 0.4))
    assert isinstance(machine.paths[1], BranchPath)
    again = dataclasses.replace(machine.mechanism, flywheel=Flywheel(2.0))
    assert isinstance(again, Mechanism) and not hasattr(again.groups[1], "path")
    slopes = jax.grad(lambda m: pose(m, jnp.asarray(0.0)).points["C"].r.x)(machine)
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(slopes))
    assert not any(np.any(leaf) for leaf in jax.tree.leaves(slopes.paths))


def test_a_branch_that_is_none():
    with pytest.raises(ValueError, match='branch of an RRR must be "fixed" or "continue", but is \'smooth\''):
        four_bar(0.1, 0.4, 0.1, 0.4, branch="smooth")


@pytest.mark.slow
def test_a_parallelogram_at_work():
    """A brake on the rocker acts like a brake on the crank: constant speed. Reactions are reported as unbounded."""
    scene = lj.Scene(four_bar(0.1, 0.4, 0.1, 0.4), (OpposingTorque("brake", "rocker", magnitude=3.0),), speed=10.0)
    cycle = lj.analyse(scene, angles=36)
    assert int(cycle.result) == 0 and float(cycle.delta) < 1e-10
    assert list(np.flatnonzero(np.isnan(cycle.reactions["C"]["rocker"].fx))) == [0, 18]
    np.testing.assert_allclose(cycle.forces_constant_speed.drive_torque, 3.0, rtol=1e-9)
    names = lj.measures.peak_names(scene)
    assert all(np.isinf(v) == n.startswith("peak_reaction") for n, v in zip(names, cycle.peaks.value, strict=True))
    assert max(float(x) for x in (cycle.checks.virtual_power, cycle.checks.force_balance)) < 1e-10
    with pytest.raises(lj.MachineError, match="does not return to its initial position"):
        lj.analyse(lj.Scene(four_bar(0.3, 0.4, 0.4, 0.3), scene.loads, speed=10.0), angles=36)
    with pytest.raises(lj.MachineError, match="has a change point at"):
        fixed = four_bar(0.1, 0.4, 0.1, 0.4, branch="fixed")
        lj.analyse(lj.Scene(fixed, scene.loads, speed=10.0), angles=36)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("machine", "places"),
    [
        pytest.param(four_bar(0.1, 0.4, 0.1, 0.4, -1, "fixed"), (0, 180), id="antiparallelogram"),
        pytest.param(four_bar(0.3, 0.3, 0.3, 0.3, 1, "fixed"), (0, 180), id="rhombus"),
        pytest.param(slider("fixed"), (90, 270), id="slider-crank"),
    ],
)
def test_a_fixed_side_at_a_bifurcation(machine, places):
    """Where all links are in line, or rod and crank at a right angle, both assembly modes coincide: reported."""
    scene = lj.Scene(machine, (Torque("brake", "crank", torque=-1.0),), Vec(0.0, -9.81), speed=10.0)
    with pytest.raises(lj.MachineError, match=r"has a change point at .* so the motion is undetermined") as told:
        lj.analyse(scene, angles=36)
    assert told.value.result is lj.Result.CANNOT_BE_ASSEMBLED
    at = float(str(told.value).split("change point at ")[1].split()[0])
    assert min(abs(math.remainder(at - place, 360)) for place in places) < 0.01
    assert abs(float(min_margin(machine))) < 1e-9


@pytest.mark.slow
def test_a_slider_at_work():
    """Drive torque at constant speed: the brake's and that of the ram, m x′ x″ ω²."""
    scene = lj.Scene(slider(), (Torque("brake", "crank", torque=-1.0),), speed=10.0)
    cycle = lj.analyse(scene, angles=36)
    assert int(cycle.result) == 0
    phi, drive = np.asarray(cycle.angles), np.asarray(cycle.forces_constant_speed.drive_torque)
    (rod,) = [side for sides in cycle.reactions.values() for name, side in sides.items() if name == "rod"][:1]
    assert list(np.flatnonzero(np.isnan(rod.fx))) == [9, 27]
    np.testing.assert_allclose(drive, 1.0 + 2.0 * 0.16 * np.sin(phi) * np.cos(phi) * 100.0, atol=1e-9)


@pytest.mark.parametrize("law", [
    (0.0, math.pi), *(pytest.param(law, marks=pytest.mark.slow) for law in ((0.0, math.pi / 3), (math.pi / 6, math.pi)))
])  # fmt: skip
def test_a_law_that_turns_back_at_a_change_point(law):
    """The motion reaches the change point and reverses: it stays a parallelogram, returning to its initial position."""
    machine = four_bar(0.1, 0.4, 0.1, 0.4)
    crank = Crank("crank", "A", "B", law=lj.Harmonic(*law))
    machine = prepared(Mechanism(machine.fixed, machine.links, [crank, machine.groups[1]], machine.flywheel))
    angles = jnp.linspace(0.0, 6.28, 101)
    here = poses(machine, angles)
    rocker, crank = here.links["rocker"], here.links["crank"]
    np.testing.assert_allclose((rocker.u.x, rocker.u.y), (crank.u.x, crank.u.y), atol=1e-11)
    np.testing.assert_allclose(rocker.w, crank.w, atol=1e-10)
    assert float(min_margin(machine)) > 0


def test_a_wheel_on_a_kite_that_is_nearly_one():
    """The far pins of the dyad pass each other so closely that a link turns half a revolution in less than a path step:
    gears on it are correct, against an equally fine scan, or the driving link is reported as too fast."""
    rng, at = np.random.default_rng(7), np.linspace(0.1, 6.2, 12)

    @jax.jit
    def turned(lengths, phase):
        machine = four_bar(*lengths, branch="fixed")
        wheel = Gear("wheel", "E", Belt(0.1, 0.1), "rocker", "D")
        groups = [Crank("crank", "A", "B", phase=phase), machine.groups[1], wheel]
        links, fixed = {**machine.links, "wheel": Link()}, {**machine.fixed, "E": Vec(9.0, 0.0)}
        made = prepared(Mechanism(fixed, links, groups))
        angles = jax.vmap(lambda phi: pose(made, phi).links["wheel"].angle)(jnp.asarray(at))
        return angles, made.along()["wheel"].returns()

    counted, far = [], 0
    for exponent in np.linspace(-9.0, -2.0, 120):
        near = 10.0**exponent * rng.choice([-1.0, 1.0])
        crank, coupler, phase = rng.uniform(0.1, 0.3), rng.uniform(0.4, 0.6), rng.uniform(0.1, 6.2)
        rocker, frame = coupler + crank * abs(near) * rng.uniform(-0.9, 0.9), crank * (1 + near)
        known = rocker_angle(crank, coupler, rocker, near, at + phase)
        angles, comes_back = turned((crank, coupler, rocker, frame), phase)
        angles = np.asarray(angles)
        if bool(comes_back):
            counted.append(exponent)
            np.testing.assert_allclose(angles - angles[0], known - known[0], atol=1e-9)
        far += exponent > -4
    assert sum(exponent > -4 for exponent in counted) > 0.6 * far


def rocker_angle(crank: float, coupler: float, rocker: float, near: float, at: np.ndarray) -> np.ndarray:
    """The rocker angle, unwrapped through angles as close to the passage as it is narrow, for a frame longer than the
    crank by this fraction."""
    passage = np.geomspace(1e-14, 0.3, 3000)
    scan = np.unique(np.concatenate([at, np.linspace(at[0], at[-1], 2000), 2 * np.pi - passage, 2 * np.pi + passage]))
    off = scan - 2 * np.pi
    away = crank * (-near - 2 * np.sin(off / 2) ** 2 + 1j * np.sin(off))  # from D to B
    r = abs(away)
    bend = np.arccos(np.clip((r * r + rocker**2 - coupler**2) / (2 * r * rocker), -1.0, 1.0))
    return np.interp(at, scan, np.unwrap(np.angle(away)) - bend)
