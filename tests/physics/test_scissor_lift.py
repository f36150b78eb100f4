# pyright: reportArgumentType=false
"""A scissor lift raised by its cylinder, one group with the drive inside, against the equations of statics and the
printed values.

Source: a paper on a scissor lift of two bars of 2.94 m, cylinder from the fixed foot to an eye 0.5 m above the hinge,
3125 N at every bar's end. Printed with two pairs of bars side by side on a cylinder: 27448 N at 45 degrees. Its 66530 N
at 11.2 degrees belong to 11.1 (the equations give 66001.55), and its hinge forces do not satisfy its own equations.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import Counterweight, Force, Link, Vec
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.kinematics import pose
from linkjax.machine import ready

L, B, F = 1.47, 0.5, 3125.0
LOW, HIGH = math.radians(11.2), math.radians(45.0)
ALPHA = np.radians([11.2, 15, 20, 25, 30, 35, 40, 45])
BETA = [21.907, 28.554, 36.472, 43.442, 49.541, 54.885, 59.595, 63.785]  # printed
NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)  # over the half cycle of raising: rounding (smooth function)
EYE, BASE, G = 1.2, complex(0.7, 0.1), 9.81  # other anchors
EXACT = 1e-12


def stroke(alpha):
    """Length of the cylinder, pin to pin."""
    return np.hypot((L - B) * np.cos(alpha), (L + B) * np.sin(alpha))


def to_and_fro(share):
    """Crank angle at which a cosine has this fraction of its range."""
    return np.arccos(np.clip(1 - 2 * share, -1.0, 1.0))  # a rounding error beyond an end counts as the end


def loaded(mechanism, pairs: int = 1, **of) -> lj.Scene:
    loads = tuple(
        Force(f"load on {link}", link, p, force=Vec(0.0, -F * pairs)) for link, p in (("bar", "T"), ("other", "U"))
    )
    return lj.Scene(mechanism, loads, speed=0.1, title="Scissor lift", **of)


@compiled_soon
def _at(scene, phi, speed):
    return jax.vmap(lambda phi: (pose(scene.mechanism, phi), kinetostatics(scene, phi, speed, 0 * phi)))(phi)


def at(scene, phi, speed: float = 0.0):
    """Poses and forces at crank angles, at rest or at constant speed."""
    return jax.device_get(_at(ready(scene), jnp.asarray(phi), jnp.asarray(speed)))


@pytest.fixture(scope="module")
def story():
    """Poses and forces while it is raised, at the quadrature nodes, then at the bar angles of the printed table."""
    printed = to_and_fro((stroke(ALPHA) - stroke(LOW)) / (stroke(HIGH) - stroke(LOW)))
    phi = np.concatenate([0.5 * math.pi * (1 + NODES), printed])
    return at(loaded(lj.scissor_lift(2 * L, B, LOW, HIGH)), phi)


@pytest.fixture(scope="module")
def raised(story):
    """At the bar angles of the printed table: links and joint forces."""
    here, forces = jax.tree.map(lambda leaf: leaf[NODES.size :], story)
    return here.links, forces.reactions


def test_the_cylinder_angle(raised):
    at, _ = raised
    np.testing.assert_allclose(np.arctan2(at["bar"].u.y, at["bar"].u.x), ALPHA, atol=1e-14)
    beta = np.degrees(np.arctan2(at["barrel"].u.y, at["barrel"].u.x))
    np.testing.assert_allclose(beta, BETA, atol=6e-4)
    np.testing.assert_allclose(np.tan(np.radians(beta)), (L + B) / (L - B) * np.tan(ALPHA), rtol=EXACT)


def test_the_cylinder_force(raised):
    """P = F s / (b sin α)."""
    drive = raised[1]["rod.drive"]["rod"]
    push = np.hypot(drive.fx, drive.fy)
    np.testing.assert_allclose(push, F * stroke(ALPHA) / (B * np.sin(ALPHA)), rtol=EXACT)
    assert 2 * push[-1] == pytest.approx(27448.2468, rel=1e-8) and round(2 * push[-1]) == 27448
    assert 2 * push[0] == pytest.approx(66001.55, rel=1e-8)


def test_feet_and_hinge(raised):
    """Feet carry F each and no horizontal force; the hinge −F (L − b) / (b tan α) and −F (L + b) / b."""
    forces = raised[1]
    np.testing.assert_allclose(forces["roller.guide"]["roller"].fy, F, rtol=EXACT)
    foot = forces["O"]["bar"], forces["O"]["barrel"]
    np.testing.assert_allclose(sum(f.fx for f in foot), 0.0, atol=EXACT * 1e4 * F)
    np.testing.assert_allclose(sum(f.fy for f in foot), F, rtol=EXACT)
    hinge = forces["C"]["other"]
    np.testing.assert_allclose(hinge.fx, -F * (L - B) / (B * np.tan(ALPHA)), rtol=EXACT)
    np.testing.assert_allclose(hinge.fy, -F * (L + B) / B, rtol=EXACT)


def test_the_work_of_a_stroke(story):
    """The cylinder work of two pairs from lowest to highest position is the energy of the loads: 18848.06 J."""
    torque = 2 * story[1].drive_torque[: NODES.size]
    work = 0.5 * math.pi * np.sum(WEIGHTS * torque)
    assert work == pytest.approx(4 * F * 2 * L * (math.sin(HIGH) - math.sin(LOW)), rel=EXACT)
    assert round(work, 2) == 18848.06


def heavy() -> lj.Scene:
    """Two pairs with weights, the cylinder on a separate base, the bar angle as a cosine."""
    masses = {
        "bar": Link(mass=40.0, inertia=9.0, centre=Vec(1.3, 0.05)),
        "other": Link(mass=35.0, centre=Vec(1.6, -0.04), counterweights={"W": Counterweight(5.0, Vec(2.0, 0.1))}),
        "barrel": Link(), "rod": Link(mass=25.0),
    }  # fmt: skip
    base = Vec(BASE.real, BASE.imag)
    lift = lj.scissor_lift(2 * L, EYE, LOW, HIGH, base=base, pairs=2, by_bar=True, links=masses)
    return loaded(lift, 2, gravity=Vec(0.0, -G))


@pytest.fixture(scope="module")
def even():
    """At equal steps of the bar angle."""
    alpha = np.linspace(LOW, HIGH, 11)
    return alpha, *at(heavy(), to_and_fro((alpha - LOW) / (HIGH - LOW)))


@pytest.mark.slow
def test_bars_that_follow_a_cosine(even):
    """The bar angle is the prescribed one, with both derivatives with respect to the crank angle."""
    alpha, here, _ = even
    bar, half = here.links["bar"], 0.5 * (HIGH - LOW)
    np.testing.assert_allclose(np.arctan2(bar.u.y, bar.u.x), alpha, atol=1e-14)
    phi = to_and_fro((alpha - LOW) / (HIGH - LOW))
    np.testing.assert_allclose(bar.w, half * np.sin(phi), atol=EXACT)
    np.testing.assert_allclose(bar.e, half * np.cos(phi), atol=EXACT)


@pytest.mark.slow
def test_two_pairs_with_weights(even):
    """The cylinder force by virtual work: two pairs of loads and bars, one cylinder. The ground carries everything."""
    alpha, _, forces = even
    cosine, sine = np.cos(alpha), np.sin(alpha)
    axis = (L - EYE) * cosine + 1j * (L + EYE) * sine - BASE
    slope = (np.conj(axis) * (-(L - EYE) * sine + 1j * (L + EYE) * cosine)).real / np.abs(axis)
    bars = 40 * (1.3 * cosine - 0.05 * sine) + 35 * (1.6 * cosine - 0.04 * sine) + 5 * (2.0 * cosine + 0.1 * sine)
    work = 2 * (2 * F * 2 * L * cosine + G * bars) + 25 * G * (L + EYE) * cosine  # over dα
    reactions = forces.reactions
    drive = reactions["rod.drive"]["rod"]
    np.testing.assert_allclose(drive.fx + 1j * drive.fy, work / slope * axis / np.abs(axis), rtol=EXACT)
    feet = reactions["O"]["bar"], reactions["A"]["barrel"], reactions["roller.guide"]["roller"]
    np.testing.assert_allclose(sum(f.fy for f in feet), 4 * F + 185 * G, rtol=EXACT)
    across = [f.fx for f in feet]
    np.testing.assert_allclose(sum(across), 0.0, atol=EXACT * np.max(np.abs(across)))


def test_what_two_pairs_weigh():
    """A second pair doubles everything except the cylinder; an ideal disc beside another equals one twice as thick."""
    links = heavy().mechanism.links
    disc = Counterweight(3.0, Vec(0.1, 0.0), thickness=0.02, density=7800.0)
    one, two = (
        lj.scissor_lift(2 * L, B, LOW, HIGH, pairs=n, links={"bar": Link(counterweights={"W": disc})}) for n in (1, 2)
    )
    weights = [lift.links["bar"].counterweights["W"] for lift in (one, two)]
    assert [float(links[name].mass) for name in ("bar", "other", "rod")] == [80.0, 70.0, 25.0]
    assert float(links["bar"].inertia) == 18.0 and float(links["other"].counterweights["W"].mass) == 10.0
    assert float(weights[1].own_inertia()) == pytest.approx(2 * float(weights[0].own_inertia()), rel=1e-15)


@pytest.mark.slow
def test_the_work_of_a_stroke_in_motion():
    """Bars, blocks and cylinder begin and end at rest: the forces that move them in between, thousands of newtons, add
    nothing to the work for weights and loads."""
    (_, still), (_, moved) = (at(heavy(), 0.5 * math.pi * (1 + NODES), speed) for speed in (0.0, 10.0))
    high, low = (np.exp(1j * a) for a in (HIGH, LOW))
    turned = high - low
    bars = (40 * (1.3 + 0.05j) * turned + 35 * (1.6 + 0.04j) * turned + 5 * (2.0 - 0.1j) * turned).imag
    gained = 2 * (4 * F * L * turned.imag + G * bars) + 25 * G * (L + EYE) * turned.imag
    for forces in (still, moved):
        assert 0.5 * math.pi * np.sum(WEIGHTS * forces.drive_torque) == pytest.approx(gained, rel=EXACT)
    assert np.max(np.abs(moved.drive_torque - still.drive_torque)) > 0.05 * np.max(still.drive_torque)
