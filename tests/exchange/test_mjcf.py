# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
"""Exported MuJoCo models: their content, that they run, and mechanisms that cannot be exported."""

from __future__ import annotations

import dataclasses
import math

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import linkjax as lj
from linkjax import Counterweight, Link, Mechanism, StructureError, Vec
from linkjax.exchange import to_mjcf
from linkjax.groups import Drive, Guide, Slot
from linkjax.kinematics import pose
from linkjax.mechanism import Flywheel, linkage
from tests.physics.machines import machine


def names(model, kind: mujoco.mjtObj, count: int) -> set[str]:
    return {mujoco.mj_id2name(model, kind, i) for i in range(count)}


def test_what_is_in_a_model():
    """Bodies, joints and sites have the names of links and points; one loop of a four-bar is closed; the flywheel is
    the armature of the crank's joint; masses, mass centres and inertias are those of the links."""
    scene = machine("four-bar")
    model = mujoco.MjModel.from_xml_string(to_mjcf(scene))
    assert names(model, mujoco.mjtObj.mjOBJ_BODY, model.nbody) == {"world", "crank", "coupler", "rocker"}
    assert names(model, mujoco.mjtObj.mjOBJ_JOINT, model.njnt) == {"crank", "coupler", "rocker"}
    sites = {"A", "B", "C", "D", "T", "S1", "S2", "S3", "rocker.C"}
    assert names(model, mujoco.mjtObj.mjOBJ_SITE, model.nsite) == sites
    assert model.neq == 1 and model.eq_type[0] == mujoco.mjtEq.mjEQ_CONNECT
    np.testing.assert_allclose(model.eq_solref[0], [0.0002, 1])
    np.testing.assert_allclose(model.eq_solimp[0, :2], 0.9999)
    np.testing.assert_array_equal(model.opt.gravity, [0, -9.81, 0])
    assert model.joint("crank").armature[0] == 1.5
    assert model.body("coupler").mass[0] == 3.1
    np.testing.assert_allclose(model.body("coupler").ipos, [0.19, 0.035, 0], rtol=1e-15)
    np.testing.assert_allclose(model.body("rocker").inertia, 900e-6 * 7850 * 0.26**3 / 12, rtol=1e-14)
    assert model.actuator("drive").trnid[0] == model.joint("crank").id


def test_a_mechanism_without_a_scene_has_no_gravity():
    model = mujoco.MjModel.from_xml_string(to_mjcf(machine("four-bar").mechanism))
    assert not np.any(model.opt.gravity)


@pytest.mark.parametrize("phi", [0.0, 2.0])
def test_it_stands_at_the_crank_angle(phi):
    scene = machine("quick-return")
    model = mujoco.MjModel.from_xml_string(to_mjcf(scene, phi))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name, point in pose(scene.mechanism, jnp.asarray(phi)).points.items():
        np.testing.assert_allclose(data.site(name).xpos, [point.r.x, point.r.y, 0], atol=1e-15)


def test_links_without_mass():
    """They get the given fraction of the heaviest, and with the square of the largest distance on a link an inertia."""
    links = {"crank": Link(length=0.1, mass=2.0, inertia=0.01), "rod": Link(length=0.4, mass=1.0), "ram": Link()}
    groups = [lj.Crank("crank", "A", "B"), lj.RRP("rod", "ram", "B", "D", "A")]
    model = mujoco.MjModel.from_xml_string(to_mjcf(Mechanism({"A": Vec(0.0, 0.0)}, links, groups), massless=1e-6))
    assert model.body("ram").mass[0] == 2e-6 and model.body("rod").mass[0] == 1.0
    np.testing.assert_allclose(model.body("rod").inertia, 2e-6 * 0.4**2)
    np.testing.assert_allclose(model.body("ram").inertia, 2e-6 * 0.4**2)


def test_counterweights_are_part_of_their_link():
    """Mass, mass centre, and inertia about it by Steiner's theorem; an ideal one does not change mass and inertia about
    the pivot."""
    disc = Counterweight(mass=2.0, at=Vec(-0.1, 0.0), inertia=0.003)
    ideal = Counterweight(mass=0.5, at=Vec(0.0, 0.2), ideal=True)
    crank = Link(length=0.1, mass=3.0, inertia=0.05, centre=Vec(0.05, 0.0), counterweights={"W": disc, "I": ideal})
    four_bar = machine("four-bar").mechanism
    links = {**{name: four_bar.links[name] for name in four_bar.link_names}, "crank": crank}
    crank = dataclasses.replace(crank, length=0.12)
    links["crank"] = crank
    model = mujoco.MjModel.from_xml_string(to_mjcf(Mechanism(four_bar.fixed, links, four_bar.groups, Flywheel())))
    body = model.body("crank")
    centre = np.array([(3 * 0.05 - 2 * 0.1) / 5, 0.5 * 0.2 / 5])
    assert body.mass[0] == 5.0
    np.testing.assert_allclose(body.ipos[:2], centre, rtol=1e-14)
    about_pivot = 0.05 + 3 * 0.05**2 + 0.003 + 2 * 0.1**2
    np.testing.assert_allclose(body.inertia[2] + 5 * centre @ centre, about_pivot, rtol=1e-14)


@pytest.mark.parametrize("name", ["hay-press", "quick-return", "moving-guides"])
def test_it_runs(name):
    """Half a second of free motion in steps of 0.1 ms: loops stay closed, and the energy changes by 0.1 % at most
    of the work of the weights."""
    model = mujoco.MjModel.from_xml_string(to_mjcf(machine(name), 0.3))
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    data = mujoco.MjData(model)
    gap, energy = 0.0, []
    for _ in range(5000):
        mujoco.mj_step(model, data)
        gap = max(gap, float(np.max(np.abs(data.efc_pos))))
        energy.append(data.energy.copy())
    potential, kinetic = np.transpose(energy)
    assert gap < 1e-6
    assert np.ptp(potential + kinetic) < 1e-3 * np.max(kinetic)


def test_where_it_cannot_be_assembled():
    scene = machine("four-bar")
    short = dataclasses.replace(scene.mechanism.links["coupler"], length=0.2)
    links = {name: scene.mechanism.links[name] for name in scene.mechanism.link_names} | {"coupler": short}
    lost = Mechanism(scene.mechanism.fixed, links, scene.mechanism.groups)
    to_mjcf(lost, 0.0)
    with pytest.raises(lj.MachineError, match=r"'coupler-rocker' cannot be assembled at 180 degrees: .*'stretched'"):
        to_mjcf(lost, math.pi)


def test_an_ideal_counterweight_that_no_body_can_have():
    ideal = Counterweight(mass=50.0, at=Vec(-0.3, 0.0), ideal=True)
    scene = machine("four-bar")
    links = {name: scene.mechanism.links[name] for name in scene.mechanism.link_names}
    links["crank"] = dataclasses.replace(links["crank"], counterweights={"W": ideal})
    with pytest.raises(
        StructureError, match=r"links\.crank: its ideal counterweight makes its mass or inertia unphysical"
    ):
        to_mjcf(Mechanism(scene.mechanism.fixed, links, scene.mechanism.groups))


def test_one_machine_at_a_time():
    many = lj.four_bar(jnp.array([0.1, 0.11]), 0.35, 0.25, 0.38)
    with pytest.raises(StructureError, match="its numbers are traced or batched; export one machine at a time"):
        to_mjcf(many)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("link", "on", "phase"),
    [
        ("rod", "ram", -0.25),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in (("crank", "rod", 1.0), ("rod", "crank", -1.0))),
    ],
)
def test_a_motor_between_two_moving_links(link, on, phase):
    """It moves as fast as one link turns relative to the other, for every position of their pin in the tree."""
    links = {"crank": Link(pins=("A", "B"), length=0.1), "rod": Link(pins=("B", "C"), length=0.3),
             "ram": Link(pins=("C",), mass=1.0)}  # fmt: skip
    sketch = {"B": lj.Vec(0.07, 0.07), "C": lj.Vec(0.36, 0.0)}
    drive = Drive(link, on, phase=phase)
    made = linkage({"A": lj.Vec(0.0, 0.0)}, links, drive, [Slot("ram", Guide("A"))], sketch)
    model = mujoco.MjModel.from_xml_string(lj.to_mjcf(made))
    data = mujoco.MjData(model)
    turning = {name: float(state.w) for name, state in lj.pose(made, jnp.zeros(())).links.items()} | {"world": 0.0}
    for name in links:
        if model.joint(name).type == mujoco.mjtJoint.mjJNT_HINGE:
            parent = model.body(model.body(name).parentid[0]).name
            data.qvel[model.joint(name).dofadr[0]] = turning[name] - turning[parent]
    mujoco.mj_forward(model, data)
    assert turning[link] - turning[on] == pytest.approx(1.0, abs=1e-12)
    assert data.actuator("drive").velocity[0] == pytest.approx(1.0, abs=1e-12)
