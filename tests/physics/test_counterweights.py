"""Counterweights against one link of the same mass, centre and inertia, and against the definition of the ideal one."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import Counterweight, Link, StructureError, Vec
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.kinematics import pose
from linkjax.reduction import reduced_model
from tests.physics.machines import machine

W = dict[str, dict[str, Counterweight]]


def fitted(scene: lj.Scene, pieces: W) -> lj.Scene:
    links = {
        name: dataclasses.replace(link, counterweights=pieces.get(name, {}))
        for name, link in scene.mechanism.links.items()
    }
    return scene.with_mechanism(dataclasses.replace(scene.mechanism, links=links))


def cast(link: Link, *pieces: Counterweight) -> Link:
    """Link and pieces as one casting, by Steiner's theorem; its additional points stay, its old centre becomes one."""
    mass = link.mass + sum(p.mass for p in pieces)
    moment = link.centre * link.mass + sum((p.at * p.mass for p in pieces), Vec(0.0, 0.0))
    centre = moment * (1 / mass)
    inertia = link.inertia + link.mass * (link.centre - centre).squared()
    for p in pieces:
        own = 0.0 if p.inertia is None else p.inertia
        if p.thickness is not None and p.density is not None:
            own = 0.5 * p.mass * p.mass / (math.pi * p.thickness * p.density)  # ½ m R²
        inertia = inertia + own + p.mass * (p.at - centre).squared()
    points = {**link.points, link.centre_name: link.centre}
    return dataclasses.replace(
        link, mass=mass, centre=centre, inertia=inertia, points=points, centre_name=f"{link.centre_name}c"
    )


ANGLES = np.arange(24) * (2 * np.pi / 24)


@compiled_soon
def loaded(scene: lj.Scene, angles: jax.Array, acceleration: jax.Array):
    """Pose, reduction and forces at the nominal speed."""

    def at(phi):
        return (
            pose(scene.mechanism, phi),
            reduced_model(scene, phi),
            kinetostatics(scene, phi, scene.speed, acceleration),
        )

    return jax.vmap(at)(angles)


def heavy() -> tuple[lj.Scene, lj.Scene]:
    """The hay press with pieces on its crank, rod, block and rocker, and with castings instead of them."""
    scene = machine("hay-press")
    pieces: W = {
        "crank": {"W1": Counterweight(20.0, Vec(-0.2, 0.03), thickness=0.05, density=7850.0)},
        "rod": {"W2": Counterweight(3.0, Vec(-0.1, 0.02), inertia=0.01), "W3": Counterweight(2.0, Vec(0.3, -0.1))},
        "slider": {"W4": Counterweight(4.0, Vec(0.05, 0.02), inertia=0.02)},
        "rocker": {"W5": Counterweight(9.0, Vec(-0.15, 0.05), thickness=0.04, density=7100.0)},
    }
    links = {
        name: cast(link, *pieces[name].values()) if name in pieces else link
        for name, link in scene.mechanism.links.items()
    }
    return fitted(scene, pieces), scene.with_mechanism(dataclasses.replace(scene.mechanism, links=links))


def alike(one, two) -> None:
    """Every number of two results."""
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(two), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * float(np.max(np.abs(b))) + 1e-9)


def test_heavy_ones_are_part_of_their_link():
    """Reduction and every force, while the crank accelerates."""
    one, two = (loaded(scene, jnp.asarray(ANGLES), jnp.asarray(300.0)) for scene in heavy())
    alike(one[1:], two[1:])
    assert {"W1", "W2", "W3", "W4", "W5"} <= one[0].points.keys()


@pytest.mark.slow
def test_a_whole_analysis_with_heavy_ones():
    """All of its results."""
    one, two = (lj.analyse(scene, angles=24) for scene in heavy())
    for got in (one, two):
        assert max(float(check) for check in jax.tree.leaves(got.checks)) < 1e-10
    assert float(one.delta) == pytest.approx(float(two.delta), rel=1e-9)
    for part in ("reduced", "forces", "forces_constant_speed", "work"):
        alike(getattr(one, part), getattr(two, part))


def test_ideal_ones_add_the_product_alone():
    """Shaking force -ω² m r on the crank by hand; torque of the weight; no inertia, weight or frame force at rest."""
    scene = machine("hay-press")
    product = {"crank": Vec(-3.0, 0.7), "rocker": Vec(-0.8, -0.3)}
    pieces: W = {name: {f"W{name}": Counterweight(1.0, at, ideal=True)} for name, at in product.items()}
    machines = (scene, fitted(scene, pieces))
    (here, before, one), (_, after, two) = (loaded(s, jnp.asarray(ANGLES), jnp.asarray(0.0)) for s in machines)
    np.testing.assert_allclose(after.inertia, before.inertia, rtol=1e-12)
    speed, phi = float(scene.speed), ANGLES
    crank = np.exp(1j * phi) * (-3.0 + 0.7j)
    rocker = here.links["rocker"]
    u = np.asarray(rocker.u.x) + 1j * np.asarray(rocker.u.y)
    second = -crank + (1j * np.asarray(rocker.e) - np.asarray(rocker.w) ** 2) * u * (-0.8 - 0.3j)
    gained = np.asarray(two.shaking.fx - one.shaking.fx) + 1j * np.asarray(two.shaking.fy - one.shaking.fy)
    np.testing.assert_allclose(gained, -(speed**2) * second, rtol=0, atol=1e-9 * np.max(np.abs(second)) * speed**2)
    np.testing.assert_allclose(two.weight.fy, one.weight.fy, rtol=1e-12)
    first = 1j * crank + 1j * np.asarray(rocker.w) * u * (-0.8 - 0.3j)
    torque = np.asarray(after.by_load["gravity"] - before.by_load["gravity"])
    np.testing.assert_allclose(torque, -9.8 * first.imag, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_gradients_of_a_counterweight():
    """Peak shaking force by mass and position of one on the crank, against differences; also from zero mass."""
    scene = machine("slider-crank")

    def peak(x):
        piece = Counterweight(x[0], Vec(x[1], x[2]), thickness=0.03, density=7850.0)
        return lj.measures.peak_shaking_force_constant_speed(fitted(scene, {"crank": {"W": piece}}))

    value, slope = compiled_soon(jax.vmap(peak)), compiled_soon(jax.grad(peak))
    steps = 1e-6 * jnp.eye(3)
    for x in (jnp.asarray([0.4, -0.06, 0.01]), jnp.asarray([0.0, -0.06, 0.01])):
        differences = (value(x[None] + steps) - value(x[None] - steps)) / 2e-6
        np.testing.assert_allclose(slope(x), differences, rtol=0, atol=1e-6 * float(jnp.max(jnp.abs(differences))))


def test_what_cannot_be():
    with pytest.raises(ValueError, match="thickness and density"):
        Counterweight(1.0, Vec(0.1, 0.0), thickness=0.1)
    with pytest.raises(ValueError, match="inertia of a counterweight is already given by inertia"):
        Counterweight(1.0, Vec(0.1, 0.0), inertia=0.1, ideal=True)
    with pytest.raises(ValueError, match="inertia and thickness"):
        Counterweight(1.0, Vec(0.1, 0.0), inertia=0.1, thickness=0.1, density=7850.0)
    pair: Any = (0.1, 0.0)
    with pytest.raises(TypeError, match="Vec"):
        Counterweight(1.0, pair)
    scene = machine("hay-press")
    for link in ("rod", "slider"):
        with pytest.raises(StructureError, match=f"link '{link}' has no fixed pivot"):
            fitted(scene, {link: {"W": Counterweight(1.0, Vec(0.1, 0.0), ideal=True)}})
    with pytest.raises(StructureError, match="'G' is already used"):
        fitted(scene, {"rocker": {"G": Counterweight(1.0, Vec(0.1, 0.0))}})


def test_in_a_scene_file():
    extra = {
        "links.crank.counterweights": {"W1": {"mass": "12 kg", "at": "-150 mm", "thickness": "60 mm", "density": 7850}},
        "links.rocker.counterweights": {"W2": {"mass": 1, "at": {"along": "-0.4 m", "across": "0.1 m"}, "ideal": True}},
    }
    links = lj.load("hay-press", extra).mechanism.links
    disc, ideal = links["crank"].counterweights["W1"], links["rocker"].counterweights["W2"]
    assert (float(disc.mass), float(disc.at.x), float(disc.at.y)) == (12.0, -0.15, 0.0)
    radius = math.sqrt(12.0 / (math.pi * 0.06 * 7850.0))
    assert disc.radius() == pytest.approx(radius)
    assert float(disc.own_inertia()) == pytest.approx(0.5 * 12.0 * radius**2)
    assert ideal.ideal
    assert (float(ideal.at.x), float(ideal.at.y)) == (-0.4, 0.1)
    for wrong, says in (
        ({"mass": 1}, r"links.crank.counterweights.W1.at"),
        ({"mass": -1, "at": 0}, "must not be negative"),
        ({"mass": 1, "at": 0, "thickness": "6 cm"}, "add density"),
        ({"mass": 1, "at": 0, "inertia": 1, "thickness": 1, "density": 1}, "given twice"),
        ({"mass": 1, "at": 0, "inertia": 1, "ideal": True}, "has no effect"),
        ({"mas": 1, "at": 0}, "mass"),
    ):
        with pytest.raises(lj.SceneError, match=says):
            lj.load("hay-press", {"links.crank.counterweights": {"W1": wrong}})
    with pytest.raises(lj.SceneError, match="ideal"):
        lj.load("hay-press", {"links.rod.counterweights": {"W1": {"mass": 1, "at": 0, "ideal": True}}})
