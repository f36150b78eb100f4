# pyright: reportArgumentType=false
"""A scissor lift raised by its cylinder, one group with the drive inside, against the equations of statics and the
figures printed with them.

Source: a paper on a scissor lift of two bars of 2.94 m, cylinder from the fixed foot to an eye 0.5 m above the hinge,
3125 N at every bar's end. Printed with two pairs of bars on a cylinder: 27448 N at 45 degrees. Its 66530 N at 11.2
degrees are those of 11.1 (the equations give 66001.55), and its hinge forces do not fulfil its own equations.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import Force, Vec
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.kinematics import pose, prepared

L, B, F, STEPS = 1.47, 0.5, 3125.0, 201
LOW, HIGH = math.radians(11.2), math.radians(45.0)
ALPHA = np.radians([11.2, 15, 20, 25, 30, 35, 40, 45])
BETA = [21.907, 28.554, 36.472, 43.442, 49.541, 54.885, 59.595, 63.785]  # printed


def stroke(alpha):
    """Length of the cylinder, pin to pin."""
    return np.hypot((L - B) * np.cos(alpha), (L + B) * np.sin(alpha))


@pytest.fixture(scope="module")
def lift() -> lj.Scene:
    mechanism = lj.scissor_lift(2 * L, B, LOW, HIGH)
    loads = tuple(Force(f"load on {link}", link, p, force=Vec(0.0, -F)) for link, p in (("bar", "T"), ("other", "U")))
    return lj.Scene(mechanism, loads, speed=0.1, title="Scissor lift")


@compiled_soon
def _at(scene, phi):
    return jax.vmap(lambda phi: (pose(scene.mechanism, phi), kinetostatics(scene, phi, scene.speed, 0 * phi)))(phi)


@pytest.fixture(scope="module")
def story(lift):
    """Poses and forces at 201 steps of the law from lowest to highest, then at the bar angles of the printed table."""
    half = 0.5 * (stroke(HIGH) - stroke(LOW))
    printed = np.arccos(np.clip(1 - (stroke(ALPHA) - stroke(LOW)) / half, -1, 1))
    phi = np.concatenate([np.linspace(0.0, math.pi, STEPS), printed])
    return _at(lift.with_mechanism(prepared(lift.mechanism)), jnp.asarray(phi))


@pytest.fixture(scope="module")
def raised(story):
    """At the bar angles of the printed table: links and joint forces."""
    here, forces = jax.tree.map(lambda leaf: leaf[STEPS:], story)
    return here.links, forces.reactions


def test_the_cylinder_angle(raised):
    at, _ = raised
    np.testing.assert_allclose(np.arctan2(at["bar"].u.y, at["bar"].u.x), ALPHA, atol=2e-8)  # dead centres of the law
    beta = np.degrees(np.arctan2(at["barrel"].u.y, at["barrel"].u.x))
    np.testing.assert_allclose(beta, BETA, atol=6e-4)
    np.testing.assert_allclose(np.tan(np.radians(beta)), (L + B) / (L - B) * np.tan(ALPHA), rtol=1e-7)


def test_the_cylinder_force(raised):
    drive = raised[1]["rod.drive"]["rod"]
    push = np.hypot(drive.fx, drive.fy)
    np.testing.assert_allclose(push, F * stroke(ALPHA) / (B * np.sin(ALPHA)), rtol=1e-7)
    assert 2 * push[-1] == pytest.approx(27448.2468, rel=1e-7) and round(2 * push[-1]) == 27448
    assert 2 * push[0] == pytest.approx(66001.55, rel=1e-6)


def test_feet_and_hinge(raised):
    """Feet carry F each and nothing sideways; the hinge −F (L − b) / (b tan α) and −F (L + b) / b."""
    forces = raised[1]
    np.testing.assert_allclose(forces["roller.guide"]["roller"].fy, F, rtol=1e-9)
    foot = forces["O"]["bar"], forces["O"]["barrel"]
    np.testing.assert_allclose(sum(np.asarray(f.fx) for f in foot), 0.0, atol=1e-7)
    np.testing.assert_allclose(sum(np.asarray(f.fy) for f in foot), F, rtol=1e-9)
    hinge = forces["C"]["other"]
    np.testing.assert_allclose(hinge.fx, -F * (L - B) / (B * np.tan(ALPHA)), rtol=1e-7)
    np.testing.assert_allclose(hinge.fy, -F * (L + B) / B, rtol=1e-9)


def test_the_work_of_a_stroke(story):
    """What two pairs ask of the cylinder from the lowest to the highest position is what the loads gain: 18848.06 J."""
    torque = 2 * np.asarray(story[1].drive_torque)[:STEPS]
    work = np.sum((torque[:-1:2] + 4 * torque[1::2] + torque[2::2]) * (math.pi / (STEPS - 1)) / 3)
    assert work == pytest.approx(4 * F * 2 * L * (math.sin(HIGH) - math.sin(LOW)), rel=1e-7)
    assert work == pytest.approx(18848.06, abs=0.01)
