"""A block on a lever (RPR): closed forms of the quick return, and the end of its range."""

from __future__ import annotations

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import RPR, Crank, Link, Mechanism, Vec
from linkjax._compile import compiled_soon
from linkjax.analysis import document
from linkjax.forces import kinetostatics
from linkjax.kinematics import assembly_margins, pose, transmission_angles
from linkjax.measures import min_margin
from linkjax.viz import machine_view
from linkjax.viz._skeleton import places, skeleton

APART, AXIS = math.hypot(10, 350), math.atan2(350, 10)  # of the bearings (mm), direction from lever's to crank's
REST = math.asin(120 / APART)  # the lever angle when the crank is perpendicular to it


def geneva(crank: float, apart: float, offset: float = 0.0, side: int = 1) -> Mechanism:
    """A crank about the origin and a lever about a point below it."""
    links = {"crank": Link(length=crank, mass=1.0), "lever": Link(length=0.5, mass=2.0), "die": Link(mass=0.5)}
    groups = [Crank("crank", "O", "B"), RPR("lever", "die", "B", "P", "E", side, offset)]
    return Mechanism({"O": Vec(0.0, 0.0), "P": Vec(0.0, -apart)}, links, groups)


@pytest.mark.slow
def test_the_quick_return():
    """Oscillation angle, limit positions and time ratio of the shaper in closed form."""
    data = document(lj.analyse(lj.load("quick-return"), angles=36))
    lever, ram = data["swings"]["lever"], data["strokes"]["R"]
    assert lever["value"] == pytest.approx(2 * REST, rel=1e-12)
    assert lever["time_ratio"] == pytest.approx((math.pi + 2 * REST) / (math.pi - 2 * REST), rel=1e-9)
    ends = [(-0.01 + 0.75 * math.cos(at), -0.35 + 0.75 * math.sin(at)) for at in (AXIS - REST, AXIS + REST)]
    right, left = (x - math.sqrt(0.26**2 - (0.39 - y) ** 2) for x, y in ends)
    assert ram["value"] == pytest.approx(right - left, rel=1e-12)
    stops = sorted(each["angle"] for each in data["dead_centres"] if each.get("link") == "lever")
    assert stops == pytest.approx([AXIS + REST + 0.5 * math.pi, AXIS - REST + 1.5 * math.pi], abs=1e-12)
    assert max(data["checks"].values()) < 1e-12
    margin = data["groups"]["lever-die"]["margins"]["pivot"]
    assert margin["value"] == pytest.approx((APART - 120) / 750, rel=1e-12)
    assert margin["angle"] == pytest.approx(AXIS + math.pi, abs=1e-7)


def test_a_lever_that_comes_round():
    """A crank longer than the frame (Whitworth): both rotate fully; angle and rates in closed form."""
    mechanism, phi = geneva(0.2, 0.08), jnp.linspace(0.0, 6.2, 14)
    at = compiled_soon(jax.vmap(pose, in_axes=(None, 0)))(mechanism, phi).links["lever"]
    phi = np.asarray(phi)
    x, y = 0.2 * np.cos(phi), 0.08 + 0.2 * np.sin(phi)
    np.testing.assert_allclose(np.asarray(at.u.x) * y, np.asarray(at.u.y) * x, rtol=0, atol=1e-16)
    reach = x**2 + y**2
    np.testing.assert_allclose(at.w, (0.04 + 0.016 * np.sin(phi)) / reach, rtol=1e-13)
    slope = 0.016 * np.cos(phi) * (reach - 2 * (0.04 + 0.016 * np.sin(phi))) / reach**2
    np.testing.assert_allclose(at.e, slope, rtol=0, atol=1e-12 * np.max(np.abs(slope)))


@pytest.mark.parametrize("side", [1, -1])
def test_an_eccentric_slot(side):
    """The pin stays on the shifted line, ahead of or behind the pivot, for all scales of the numbers."""
    for scale in (1e-6, 1.0, 1e6):
        mechanism = geneva(0.1 * scale, 0.3 * scale, 0.04 * scale, side)
        mechanism = eqx.tree_at(lambda m: m.links["lever"].length, mechanism, jnp.asarray(0.5 * scale))
        here = compiled_soon(jax.vmap(pose, in_axes=(None, 0)))(mechanism, jnp.linspace(0.0, 6.0, 9))
        d, u = here.points["B"].r - here.points["P"].r, here.links["lever"].u
        np.testing.assert_allclose(u.cross(d), 0.04 * scale, rtol=1e-14)
        assert np.all(side * np.asarray(u.dot(d)) > 0.15 * scale)


@pytest.mark.parametrize(
    ("crank", "apart", "offset"), [(0.1, 0.12, 0.03), (0.1, 0.1, 0.0), (0.1, 0.1, 0.02), (0.1, 0.0, 0.2)]
)
def test_where_it_cannot_be(crank, apart, offset):
    """The pin closer to the pivot than the slot: shown by the margin, the gradient leads out."""
    mechanism = geneva(crank, apart, offset)
    least = compiled_soon(assembly_margins)(mechanism)["lever-die"]["pivot"]
    assert float(least.value) == pytest.approx((abs(crank - apart) - offset) / 0.5, abs=1e-9)
    assert float(least.value) <= 0 or (offset == 0 and float(least.value) < 1e-9)
    scene = lj.Scene(mechanism, speed=10.0)
    slope = compiled_soon(jax.grad(lambda s: min_margin(s)))(scene).mechanism
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(slope))
    if offset:
        assert float(slope.groups[1].offset) == pytest.approx(-1 / 0.5, rel=1e-9)
    if float(least.value) < 0:
        with pytest.raises(lj.MachineError, match="lever-die"):
            lj.analyse(scene, angles=8)


@pytest.mark.parametrize("offset", [0.0, 0.03])
def test_the_pin_right_on_the_pivot(offset):
    """Everything finite in both modes: position, rates, forces, transmission angle."""
    mechanism = dataclasses.replace(geneva(0.1, 0.0, offset), fixed={"O": Vec(0.0, 0.0), "P": Vec(0.1, 0.0)})
    scene = lj.Scene(mechanism, speed=10.0)
    leaves, tree = jax.tree.flatten(scene)
    start = jnp.stack([jnp.asarray(leaf, float) for leaf in leaves])

    def everything(numbers):
        at, phi = jax.tree.unflatten(tree, list(numbers)), jnp.zeros(())
        forces = kinetostatics(at, phi, at.speed, jnp.asarray(3.0))
        told = pose(at.mechanism, phi), forces, transmission_angles(at.mechanism, phi)
        return jnp.stack([jnp.asarray(leaf, float) for leaf in jax.tree.leaves(told)])

    values, backward, forward = compiled_soon(
        lambda x: (everything(x), jax.jacrev(everything)(x), jax.jacfwd(everything)(x))
    )(start)
    assert np.all(np.isfinite(values)) and np.all(np.isfinite(backward))
    np.testing.assert_allclose(forward, backward, rtol=1e-10, atol=1e-10)


@pytest.mark.slow
def test_the_offset_that_transmits_best():
    """None at all: the transmission angle is acute on one side and obtuse on the other, and its rows contain both."""
    scene = lj.Scene(geneva(0.1, 0.3), speed=10.0)
    found = lj.optimise(scene, {"groups.lever-die.offset": "-20 to 50 mm"}, maximise="min_transmission_angle",
                        starts=2)  # fmt: skip
    assert found.objective == pytest.approx(math.pi / 2, abs=1e-8)
    assert float(found.x[0]) == pytest.approx(0.0, abs=1e-9)
    assert found.kkt_residual <= 1e-6


@pytest.mark.slow
def test_how_it_is_drawn():
    """The block is parallel to its lever, at every crank angle."""
    scene = lj.load("quick-return")
    data = document(lj.analyse(scene, angles=36))
    look = skeleton(data, scene)
    (die,) = (shape for shape in look.shapes if shape.link == "die")
    assert die.block and die.upon
    (slot,) = look.slots
    assert (slot.on, slot.origin, slot.angle) == ("lever", "P", 0.0)
    assert {guide.block for guide in look.guides} == {"ram"}
    for i in (0, 7, 20):
        at = places(data, scene, data["angles"][i])
        angle = math.atan2(*at["die"][::-1])
        assert abs(math.remainder(angle - data["links"]["die"]["angle"][i], 2 * math.pi)) < 1e-12
        first, last, along = slot.drawn(at)
        np.testing.assert_allclose(along, [math.cos(angle), math.sin(angle)], atol=1e-12)
        assert 0 <= (at["B"] - first) @ along <= (last - first) @ along  # the block is between the ends of its slot
        assert abs((at["B"] - first) @ np.array([-along[1], along[0]])) < 1e-12
    (link,) = (link for link in machine_view(data, scene)["machines"][0]["links"] if link["name"] == "die")
    assert link["block"] and link["upon"]


def test_what_is_wrong_is_told():
    """The group that fails, not the one after it, which is only attached to an undefined position."""
    told = r"'lever-die' cannot be .* 268.36 degrees .* 'P' and 'B' are 0.2301 m apart, less than its offset of 0.24 m"
    with pytest.raises(lj.MachineError, match=told):
        lj.analyse(lj.load("quick-return", {"groups[1].offset": "240 mm"}), angles=8)
    with pytest.raises(ValueError, match="side of an RPR must be 1 or -1"):
        RPR("lever", "die", "B", "P", "E", 0)
    with pytest.raises(ValueError, match="both ends of an RPR are attached to the point 'P'; name two points"):
        RPR("lever", "die", "P", "P", "E")
    with pytest.raises(lj.SceneError, match=r'groups\[1\].from = "P": the same point as `about`'):
        lj.load("quick-return", {"groups[1].from": "P"})


@pytest.mark.slow
def test_gradients_of_a_cycle():
    """δ of the shaper over the pivot position, the lever length and the offset, against differences."""

    def found(x):
        scene = lj.load("quick-return")
        m = scene.mechanism
        lever = dataclasses.replace(m.links["lever"], length=x[0])
        group = dataclasses.replace(m.groups[1], offset=x[1])
        fixed = {**m.fixed, "P": Vec(x[2], x[3])}
        groups = (m.groups[0], group, m.groups[2])
        return lj.measures.delta(
            scene.with_mechanism(Mechanism(fixed, {**m.links, "lever": lever}, groups, m.flywheel)), 96
        )

    x = jnp.asarray([0.75, 0.02, 0.01, -0.35])
    slope = np.asarray(compiled_soon(jax.grad(found))(x))
    steps = jnp.concatenate([k * 1e-3 * jnp.eye(4) for k in (-2, -1, 1, 2)])
    f = np.asarray(compiled_soon(lambda x: jax.lax.map(found, x))(x[None] + steps)).reshape((4, 4))
    differences = (f[0] - f[3] + 8 * (f[2] - f[1])) / (12 * 1e-3)
    np.testing.assert_allclose(slope, differences, rtol=0, atol=1e-6 * float(np.linalg.norm(slope)))
