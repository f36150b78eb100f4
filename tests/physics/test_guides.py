# pyright: reportArgumentType=false
"""Guides on moving links, sliders and crossing slots (RRP, RPP, PRP): closed forms, ends of ranges, messages."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import PRP, RPP, RRP, RRR, Crank, Guide, Link, Mechanism, StructureError, Vec
from linkjax._compile import compiled_soon
from linkjax.kinematics import assembly_margins, dead_centres, pose, strokes, transmission_angles

ANGLES = jnp.linspace(0.0, 2 * math.pi, 37)
poses = compiled_soon(lambda mechanism: jax.vmap(lambda phi: pose(mechanism, phi))(ANGLES))


def yoke(slot: float, offset: float = 0.0, along: float = 0.0, path: float = 0.0) -> Mechanism:
    """A crank of 0.1 m drives a slider through a slot."""
    links = {"crank": Link(length=0.1), "yoke": Link(points={"N": Vec(0.3, 0.1)}), "die": Link()}
    guide = Guide("A", along, path)
    groups = [Crank("crank", "A", "B"), RPP("yoke", "die", "B", "E", guide, slot, offset)]
    return Mechanism({"A": Vec(0.2, -0.1)}, links, groups)


@pytest.mark.parametrize(
    ("slot", "offset", "along", "path"), [(math.pi / 2, 0, 0, 0), (1.1, 0.02, 0.4, -0.03), (-2.0, -0.05, -1.0, 0.01)]
)
def test_the_scotch_yoke(slot, offset, along, path):
    """x = r (cos α − sin α / tan β) + ..., α the crank's angle to the guide, β the slot's: a pure harmonic."""
    here = poses(yoke(slot, offset, along, path))
    phi = np.asarray(ANGLES) - along
    t, n = np.array([math.cos(along), math.sin(along)]), np.array([-math.sin(along), math.cos(along)])
    constant = (path - 0.0) / math.tan(slot) + offset / math.sin(slot)
    x = 0.1 * (np.cos(phi) - np.sin(phi) / math.tan(slot)) + constant
    d = 0.1 * (-np.sin(phi) - np.cos(phi) / math.tan(slot))
    end = here.points["E"]
    place = np.array([0.2, -0.1]) + x[:, None] * t + path * n
    for got, wanted in ((end.r, place), (end.dr, d[:, None] * t), (end.ddr, (constant - x)[:, None] * t)):
        np.testing.assert_allclose(np.stack([got.x, got.y], -1), wanted, rtol=0, atol=2e-16)
    for link in ("yoke", "die"):
        assert not np.any(here.links[link].w) and not np.any(here.links[link].e)
    point = here.points["N"]
    np.testing.assert_allclose(np.stack([point.r.x, point.r.y], -1), place + 0.3 * t + 0.1 * n, atol=2e-16)
    np.testing.assert_array_equal(point.dr.x, end.dr.x)
    mechanism = yoke(slot, offset, along, path)
    (margin,) = assembly_margins(mechanism)["yoke-die"].values()
    assert float(margin.value) == pytest.approx(abs(math.sin(slot)), rel=1e-15)
    angle = transmission_angles(mechanism, jnp.asarray(0.3))["yoke-die"]
    assert math.sin(angle) == pytest.approx(abs(math.sin(slot)), rel=1e-12)
    dead = dead_centres(mechanism)
    assert set(dead) == {"E"}
    reach = float(strokes(mechanism, dead)["E"])
    assert reach == pytest.approx(0.2 / abs(math.sin(slot)), rel=1e-12)


@pytest.mark.slow
def test_the_built_in_yoke():
    """Reduced inertia J + m (r sin φ)², reduced torque −F r sin φ while the piston moves out, work 2 F r."""
    scene = lj.load("scotch-yoke")
    cycle = lj.analyse(scene, angles=90)
    phi = np.asarray(cycle.angles)
    inertia = 4.0 + 0.02 + 4 * 0.01**2 + 0.5 * 0.08**2 + 12 * (0.08 * np.sin(phi)) ** 2
    np.testing.assert_allclose(cycle.reduced.inertia, inertia, rtol=1e-14)
    out = phi >= math.pi
    np.testing.assert_allclose(cycle.reduced.by_load["pressure"][out], 3000 * 0.08 * np.sin(phi[out]), atol=1e-11)
    assert not np.any(cycle.reduced.by_load["pressure"][~out])
    assert float(cycle.work["pressure"]) == pytest.approx(-2 * 3000 * 0.08, rel=1e-13)
    assert float(cycle.steady.mean_drive_torque) == pytest.approx(2 * 3000 * 0.08 / (2 * math.pi), rel=1e-13)
    assert max(float(check) for check in jax.tree.leaves(cycle.checks)) < 1e-10
    # the guide balances the moment of the slot force: the piston force runs through A, the slot force through the pin
    w = float(scene.speed)
    at = lj.analyse(scene, angles=90, constant_speed=True).forces
    push = -12 * 0.08 * w**2 * np.cos(phi) + np.where(out, 3000.0, 0.0)
    np.testing.assert_allclose(np.asarray(at.reactions["die.guide"]["die"].fx), -push, rtol=0, atol=1e-9)
    couple = push * 0.08 * np.sin(phi) + 12 * 9.81 * 0.06
    np.testing.assert_allclose(at.reactions["yoke.guide"]["yoke"].moment, couple, rtol=0, atol=1e-9)


def test_a_guide_on_the_crank_itself():
    """A rod from a frame point to a block on a radial guide of the crank: at the crank angle, at a distance from the
    law of cosines; the block turns with the crank."""
    links = {"crank": Link(length=0.1), "rod": Link(length=0.5), "block": Link()}
    groups = [Crank("crank", "A", "B"), RRP("rod", "block", "F", "D", Guide("A", on="crank"))]
    here = poses(Mechanism({"A": Vec(0.0, 0.0), "F": Vec(0.2, 0.0)}, links, groups))
    phi = np.asarray(ANGLES)
    s = 0.2 * np.cos(phi) + np.sqrt(0.25 - (0.2 * np.sin(phi)) ** 2)
    np.testing.assert_allclose(here.points["D"].r.x, s * np.cos(phi), atol=1e-15)
    np.testing.assert_allclose(here.points["D"].r.y, s * np.sin(phi), atol=1e-15)
    np.testing.assert_allclose(here.links["block"].w, 1.0, rtol=1e-15)
    np.testing.assert_allclose(np.hypot(here.points["D"].r.x - 0.2, here.points["D"].r.y), 0.5, rtol=1e-15)


def crossing(side: int = 1) -> Mechanism:
    """A pin in a radial slot of the crank and in an upright slot of the frame: it runs along x = 0.3."""
    links = {"crank": Link(length=0.1), "one": Link(), "two": Link()}
    slots = (Guide("A", on="crank"), Guide("C", math.pi / 2))
    swing = Crank("crank", "A", "B", law=lj.Harmonic(-0.9, 0.7))
    return Mechanism({"A": Vec(0.0, 0.0), "C": Vec(0.3, 0.5)}, links, [swing, PRP(("one", "two"), "M", slots, side)])


def test_crossing_slots():
    """y = 0.3 tan θ, y' = 0.3 θ' / cos² θ, and the margin cos θ."""
    here = poses(crossing())
    phi = np.asarray(ANGLES)
    theta, d, dd = -0.1 - 0.8 * np.cos(phi), 0.8 * np.sin(phi), 0.8 * np.cos(phi)
    at = here.points["M"]
    np.testing.assert_allclose(at.r.x, 0.3, rtol=1e-15)
    np.testing.assert_allclose(at.r.y, 0.3 * np.tan(theta), atol=1e-15)
    np.testing.assert_allclose(at.dr.y, 0.3 * d / np.cos(theta) ** 2, atol=1e-15)
    bend = 0.3 * (dd + 2 * d**2 * np.tan(theta)) / np.cos(theta) ** 2
    np.testing.assert_allclose(at.ddr.y, bend, atol=3e-15)
    assert not np.any(at.dr.x) or np.max(np.abs(at.dr.x)) < 1e-16
    (least,) = assembly_margins(crossing())["one-two"].values()
    assert float(least.value) == pytest.approx(math.cos(0.9), rel=1e-14)
    (other,) = assembly_margins(crossing(-1))["one-two"].values()
    assert float(other.value) == pytest.approx(-1.0, rel=1e-12)  # the second slot points to the left of the first


def test_slots_that_become_parallel_are_told():
    swing = Crank("crank", "A", "B")
    turning = Mechanism(
        {"A": Vec(0.0, 0.0), "C": Vec(0.3, 0.5)}, {"crank": Link(length=0.1), "one": Link(), "two": Link()},
        [swing, PRP(("one", "two"), "M", (Guide("A", on="crank"), Guide("C", math.pi / 2)))],
    )  # fmt: skip
    with pytest.raises(lj.MachineError, match=r"'one-two' cannot be assembled over the cycle: at 180\.00 degrees"):
        lj.analyse(lj.Scene(turning, speed=3.0), angles=8)
    slope = jax.grad(lambda m: lj.measures.min_margin(lj.Scene(m)))(turning)
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(slope))


@pytest.mark.parametrize(
    ("guide", "says"),
    [
        (Guide("A", on="rocker"), "groups.2. .RRP.: the guide is on link 'rocker', but point 'A' is not; known here: "),
        (Guide("D", on="rod"), "the guide is on 'rod', a link of the group itself; name the frame, or a link"),
        (Guide("D", on="roker"), "the guide is on link 'roker', which is not attached yet; did you mean 'rocker'"),
        (Guide("C"), "the guide is of the frame, but point 'C' is not; known here: A, D"),
        (Guide("X", on="rocker"), "point 'X' is not defined"),
    ],
)
def test_wrong_guides(guide, says):
    links = {name: Link(length=length) for name, length in (("crank", 0.1), ("coupler", 0.4), ("rocker", 0.3))}
    links |= {"rod": Link(length=0.3), "block": Link()}
    groups = [Crank("crank", "A", "B"), RRR(("coupler", "rocker"), "B", "D", "C"), RRP("rod", "block", "B", "P", guide)]
    with pytest.raises(StructureError, match=says):
        Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0)}, links, groups)


def test_both_slots_on_one_link():
    with pytest.raises(ValueError, match="two links, but both are on 'frame'"):
        PRP(("one", "two"), "M", (Guide("A"), Guide("C", 1.0)))
