"""Springs: their forces, energy and torque by other methods, and what is refused."""

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import linkjax as lj
from linkjax.analysis import document
from linkjax.forces import kinetostatics
from linkjax.loads import Instant, power
from tests.helpers import assert_gradients_agree

PRELOAD, STIFFNESS, CRANK = 24.91, 2084.0, 0.020
MASS, GRAVITY, OUT, ARM, HEIGHT = 3.0, 9.81, 0.25, 0.1, 0.4
PHI = jnp.linspace(0.1, 6.0, 13)


def yoke(*loads: lj.loads.AbstractLoad, **keys) -> lj.Scene:
    """A Scotch yoke without mass and a frame point Q on the line of the yoke, outside of its stroke."""
    made = lj.scotch_yoke(CRANK)
    fixed = {**made.fixed, "Q": lj.Vec(-0.05, 0.0)}
    return lj.Scene(dataclasses.replace(made, fixed=fixed), loads, speed=2 * math.pi, **keys)


def lever(stiffness, **keys) -> lj.Scene:
    """A lever that a spring of free length zero, from C on the lever to D above its pivot, balances against gravity."""
    link = lj.Link(length=ARM, mass=MASS, centre=lj.Vec(OUT, 0.0))
    fixed = {"A": lj.Vec(0.0, 0.0), "D": lj.Vec(0.0, HEIGHT)}
    mechanism = lj.Mechanism(fixed, {"lever": link}, [lj.Crank("lever", "A", "C")])
    spring = lj.Spring("balance", "lever", "C", to_point="D", stiffness=stiffness)
    return lj.Scene(mechanism, (spring,), lj.Vec(0.0, -GRAVITY), speed=1.0, **keys)


def press(*loads: lj.loads.AbstractLoad) -> lj.Scene:
    """The hay press with these loads alone."""
    return dataclasses.replace(lj.load("hay-press"), loads=loads)


BETWEEN = lj.Spring("between", "rod", "E", "rocker", to_point="S5", stiffness=8e3, free_length=0.35, preload=120.0)
FRAMED = lj.Spring("framed", "link4", "G", to_point="A", stiffness=5e3, free_length=0.5, preload=-40.0)
TWIST = lj.TorsionSpring("twist", "rocker", stiffness=300.0, free_angle=2.5, preload=20.0)
HINGE = lj.TorsionSpring("hinge", "rocker", "link4", stiffness=200.0, free_angle=-1.0)
EVERY = (BETWEEN, FRAMED, TWIST, HINGE)


@functools.cache
def found() -> tuple[dict, dict, dict]:
    """Share, power of the wrenches, and minus the slope of the energy, of every spring over the crank angle."""
    scene = press(*EVERY)

    def at(phi):
        here, instant = lj.pose(scene.mechanism, phi), Instant(phi, phi)
        shares = {load.name: load.share(here, instant) for load in EVERY}
        powers = {load.name: power(here, load.wrenches(here, instant)) for load in EVERY}
        slopes = {
            load.name: -jax.grad(lambda x, load=load: load.energy(lj.pose(scene.mechanism, x)))(phi) for load in EVERY
        }
        return shares, powers, slopes

    return jax.jit(jax.vmap(at))(PHI)


@pytest.mark.parametrize("name", [load.name for load in EVERY])
def test_the_share_is_the_power_of_the_forces_and_the_slope_of_the_energy(name):
    shares, powers, slopes = (table[name] for table in found())
    size = float(jnp.max(jnp.abs(shares)))
    assert size > 1.0
    np.testing.assert_allclose(shares, powers, rtol=0, atol=1e-14 * size)
    np.testing.assert_allclose(shares, slopes, rtol=0, atol=1e-10 * size)


def closed_form(phi) -> mpmath.mpf:
    """Drive torque of the yoke (N m): the spring pulls with 24.91 N at least and 24.91 N + 2084 N/m · 40 mm at most."""
    r, preload, stiffness = (mpmath.mpf(str(value)) for value in (CRANK, PRELOAD, STIFFNESS))
    return -r * mpmath.sin(phi) * (preload + stiffness * r * (1 + mpmath.cos(phi)))


def test_the_drive_torque_of_a_scotch_yoke_with_a_spring():
    """Its peak is the largest value of r sin φ (66.59 N + 41.68 N cos φ), at 65.625 degrees before the far end."""
    with mpmath.workdps(30):
        peak = closed_form(mpmath.findroot(lambda phi: mpmath.diff(closed_form, phi), -1.15))
    free = 0.05 - CRANK  # the least length
    spring = lj.Spring("return", "yoke", "E", to_point="Q", stiffness=STIFFNESS, free_length=free, preload=PRELOAD)
    cycle = lj.analyse(yoke(spring, constant_speed=True), angles=24)
    want = [float(closed_form(mpmath.mpf(phi))) for phi in np.asarray(cycle.angles).tolist()]
    assert cycle.forces_constant_speed is not None
    np.testing.assert_allclose(cycle.forces_constant_speed.drive_torque, want, rtol=0, atol=1e-14)
    found = document(cycle)["peaks"]["max_drive_torque_constant_speed"]
    assert float(peak) == pytest.approx(1.526455274, abs=1e-9)
    assert found["value"] == pytest.approx(float(peak), rel=1e-12)
    assert abs(float(cycle.forces_constant_speed.net_frame.fx[1])) < 1e-13  # the spring pulls the frame back


@pytest.mark.slow
def test_a_spring_stores_what_it_takes_and_the_energy_balance_closes():
    scene = dataclasses.replace(lj.load("hay-press"), loads=(*lj.load("hay-press").loads, *EVERY))
    cycle = lj.analyse(scene, angles=24, nodes=256)
    for load in EVERY:
        assert abs(float(cycle.work[load.name])) < 1e-9 * float(jnp.max(jnp.abs(cycle.reduced.by_load[load.name])))
    for check in (cycle.checks.virtual_power, cycle.checks.energy_closure, cycle.checks.force_balance):
        assert float(check) < 1e-10


def test_a_spring_of_free_length_zero_balances_a_lever_at_every_angle():
    """The height of the mass and the square of the length are both affine in the sine of the angle, so that the sum of
    the energies is constant if k = m g l / (a b)."""
    right = MASS * GRAVITY * OUT / (ARM * HEIGHT)
    torque = jax.jit(jax.vmap(lambda phi: lj.reduced_model(lever(right), phi).torque))(PHI)
    np.testing.assert_allclose(torque, 0.0, atol=1e-12 * MASS * GRAVITY * OUT)


@pytest.mark.slow
def test_the_optimiser_finds_the_stiffness_that_balances_the_lever():
    right = MASS * GRAVITY * OUT / (ARM * HEIGHT)
    free = {"loads.balance.stiffness": ("50 N/m", "0.5 N/mm")}
    best = lj.optimise(lever(90.0), free, "peak_drive_torque_constant_speed")
    spring = best.after.loads[0]
    assert isinstance(spring, lj.Spring)
    assert float(spring.stiffness) == pytest.approx(right, rel=1e-9)


def test_no_singularity_at_length_zero():
    """C passes through the other end: a spring of free length zero is exact there, others have a zero force."""
    scene = lever(200.0)
    here = lj.pose(scene.mechanism, jnp.asarray(0.0))
    at, end = Instant(jnp.asarray(0.0), jnp.asarray(0.0)), {**scene.mechanism.fixed, "P": lj.Vec(ARM, 0.0)}
    scene = dataclasses.replace(scene, mechanism=dataclasses.replace(scene.mechanism, fixed=end))

    def made(stiffness, free, preload, phi):
        spring = lj.Spring("s", "lever", "C", to_point="P", stiffness=stiffness, free_length=free, preload=preload)
        damper = lj.Damper("d", "lever", "C", to_point="P", coefficient=stiffness)
        here, at = lj.pose(scene.mechanism, phi), Instant(phi, phi, 2.0)
        return spring.share(here, at) + damper.share(here, at) + spring.energy(here)

    for free, preload in ((0.0, 0.0), (0.03, 5.0)):
        slopes = jax.jit(jax.grad(made, argnums=(0, 1, 2, 3)))(200.0, free, preload, 0.0)
        assert np.all(np.isfinite(np.asarray(slopes)))
    share = jax.jit(lambda phi: lj.Spring("s", "lever", "C", to_point="P", stiffness=200.0).share(
        lj.pose(scene.mechanism, phi), Instant(phi, phi)))  # fmt: skip
    # 2 a sin(φ/2) long: the energy is 2 k a² sin²(φ/2), and the torque - k a² sin φ
    for phi in (-1e-9, 0.0, 1e-9, 0.7):
        assert float(share(phi)) == pytest.approx(-200.0 * ARM**2 * math.sin(phi), rel=1e-7, abs=0)
    (one,) = lj.Spring("s", "lever", "C", to_point="A", stiffness=0.0, preload=7.0).wrenches(here, at)
    assert float(one.force.x) == pytest.approx(-7.0) and float(one.force.y) == 0.0  # a constant force


def test_passing_the_free_length_is_smooth():
    """The tension is linear, negative below the free length: no kink, and a push in the same line."""
    spring = lj.Spring("s", "yoke", "E", to_point="Q", stiffness=1e3, free_length=0.05)
    scene = yoke(spring)
    for phi, stretch in ((0.0, CRANK), (math.pi / 2, 0.0), (math.pi, -CRANK)):
        here = lj.pose(scene.mechanism, jnp.asarray(phi))
        (one,) = spring.wrenches(here, Instant(jnp.asarray(phi), jnp.asarray(phi)))
        assert float(one.force.x) == pytest.approx(-1e3 * stretch, abs=1e-12)
        assert float(spring.tension(here)) == pytest.approx(1e3 * stretch, abs=1e-12)
        assert float(spring.length(here)) == pytest.approx(0.05 + stretch, abs=1e-15)


def test_a_spring_between_two_links_is_no_load_on_the_whole():
    """Equal and opposite: frame force and shaking force are as without it, joint forces are not."""
    phi, speed, none = (jnp.asarray(x) for x in (0.7, 70.0, 0.0))
    with_it, without = (kinetostatics(scene, phi, speed, none) for scene in (press(BETWEEN, HINGE), press()))
    for key in ("fx", "fy", "moment"):
        assert float(getattr(with_it.loads, key)) == pytest.approx(0.0, abs=1e-9)
        assert float(getattr(with_it.shaking, key)) == float(getattr(without.shaking, key))
        for table in ("frame", "net_frame"):
            one, two = (getattr(getattr(forces, table), key) for forces in (with_it, without))
            own = with_it.drive_torque - without.drive_torque if key == "moment" else 0.0
            assert float(one) == pytest.approx(float(two + own), rel=1e-9)
    assert abs(float(with_it.reactions["G"]["link4"].fy - without.reactions["G"]["link4"].fy)) > 100.0


def test_a_spring_to_the_frame_does_not_load_the_foundation():
    """The net frame force has the pull on the frame, which cancels that on the link; its moment differs by the drive
    torque only."""
    phi, speed, none = (jnp.asarray(x) for x in (0.7, 70.0, 0.0))
    with_it, without = (kinetostatics(scene, phi, speed, none) for scene in (press(FRAMED, TWIST), press()))
    for key in ("fx", "fy", "moment"):
        own = with_it.drive_torque - without.drive_torque if key == "moment" else 0.0
        one, two = (getattr(forces.net_frame, key) for forces in (with_it, without))
        assert float(one) == pytest.approx(float(two + own), rel=1e-9)
    assert abs(float(with_it.frame.fx - without.frame.fx)) > 100.0


def test_a_torsion_spring_on_the_rocker_of_a_parallelogram():
    """Crank and rocker are parallel, so the closed form is that of the crank angle, within half a turn."""
    made = lj.four_bar(0.5, 0.1, 0.5, 0.1, links={"crank": lj.Link(mass=1.0)})
    spring = lj.TorsionSpring("s", "rocker", stiffness=4.0, free_angle=0.3, preload=1.5)
    other = lj.TorsionSpring("o", "rocker", "coupler", stiffness=4.0, free_angle=0.3 + 4 * math.pi, preload=1.5)
    for phi in (0.5, 1.2, 2.8):
        here = lj.pose(made, jnp.asarray(phi))
        at = Instant(jnp.asarray(phi), jnp.asarray(phi))
        theta = math.atan2(float(here.links["rocker"].u.y), float(here.links["rocker"].u.x))
        rod = math.atan2(float(here.links["coupler"].u.y), float(here.links["coupler"].u.x))
        for load, turned in ((spring, theta - 0.3), (other, theta - rod - 0.3)):
            turned = math.remainder(turned, 2 * math.pi)
            couples = [float(one.couple) for one in load.wrenches(here, at)]
            assert couples[0] == pytest.approx(-(1.5 + 4.0 * turned), rel=1e-13)
            assert couples[1:] == ([-couples[0]] if load is other else [])
            assert float(load.energy(here)) == pytest.approx(1.5 * turned + 2.0 * turned**2, rel=1e-12)


@pytest.mark.slow
def test_a_torsion_spring_that_is_wound_over_half_a_turn_is_named():
    scene = dataclasses.replace(lever(100.0), loads=(lj.TorsionSpring("s", "lever", stiffness=1.0, free_angle=0.3),))
    with pytest.warns(UserWarning, match="torsion spring 's': 'lever' turns by more than half a turn from the free"):
        lj.analyse(scene, angles=24, throw=True)


def test_a_spring_in_a_window():
    spring = dataclasses.replace(FRAMED, window=lj.Window(0.0, 2.0))
    shares = [float(lj.reduced_model(press(spring), jnp.asarray(phi)).by_load["framed"]) for phi in (1.0, 3.0)]
    always = float(lj.reduced_model(press(FRAMED), jnp.asarray(1.0)).by_load["framed"])
    assert shares == [pytest.approx(always, rel=1e-14), 0.0]


@pytest.mark.slow
def test_gradients_with_respect_to_design_and_springs(rng):
    def total(scene):
        def at(phi):
            forces = kinetostatics(scene, phi, scene.speed, jnp.zeros(()))
            here = lj.reduced_model(scene, phi)
            return here.torque + 0.01 * forces.net_frame.fx + 0.1 * forces.reactions["G"]["link4"].fy

        return jnp.sum(jax.vmap(at)(jnp.asarray([0.4, 2.0, 4.4])) ** 2)

    assert_gradients_agree(total, press(*EVERY), rng)


WRONG = {
    "a negative stiffness": ({"stiffness": -1.0}, "stiffness of load 's' must not be negative"),
    "a negative free length": ({"free_length": -0.1}, "free_length of load 's' must not be negative"),
    "a preload that is not finite": ({"preload": math.inf}, "preload of load 's' is inf; write a finite number"),
    "both ends on one link": ({"to_link": "rod", "to_point": "B"}, "link 'rod' has both ends of load 's'; attach"),
    "the frame as its link": (
        {"link": "frame", "point": "F"},
        "has 'frame' as its link; write the moving link",
    ),
    "both ends at one point": ({"to_link": "link4", "to_point": "E"}, "point 'E' is both ends of load 's'"),
    "an unknown link": ({"to_link": "rocket"}, "loads[0] (s): link 'rocket' is not defined; did you mean 'rocker'?"),
    "an unknown point": ({"to_point": "Z"}, "loads[0] (s): point 'Z' is not a point of the frame"),
    "a moving point as one of the frame": (
        {"to_point": "G"},
        "is not a point of the frame; name its link too, 'link4'",
    ),
    "a point of another link": ({"to_link": "rocker", "to_point": "D"}, "point 'D' is not on link 'rocker'"),
    "two fixed points": ({"link": "crank", "point": "A"}, "point 'A' never moves, and its other end neither"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_refused(name):
    keys, message = WRONG[name]
    with pytest.raises((ValueError, lj.StructureError)) as caught:
        press(lj.Spring(**{"name": "s", "link": "rod", "point": "E", "to_point": "F", "stiffness": 1.0, **keys}))
    assert message in str(caught.value)


def test_what_is_refused_of_a_torsion_spring():
    with pytest.raises(ValueError, match="free_angle of load 's' is nan; write a finite number"):
        lj.TorsionSpring("s", "rod", stiffness=1.0, free_angle=math.nan)
    with pytest.raises(ValueError, match="link 'rod' has both ends of load 's'"):
        lj.TorsionSpring("s", "rod", "rod", stiffness=1.0, free_angle=0.0)
    with pytest.raises(lj.StructureError, match="link 'A' is not defined"):
        press(lj.TorsionSpring("s", "rod", "A", stiffness=1.0, free_angle=0.0))


def test_other_loads_have_two_ends_or_one_and_store_nothing():
    force = lj.Force("f", "rod", "E", force=lj.Vec(1.0, 2.0))
    assert force.attachments() == (("rod", "E"),) and FRAMED.attachments() == (("link4", "G"), ("frame", "A"))
    assert force.energy(lj.pose(press().mechanism, jnp.asarray(0.0))) is None
    assert (FRAMED.reacts_on, BETWEEN.reacts_on, TWIST.reacts_on, HINGE.reacts_on) == ("frame", None, "frame", None)
