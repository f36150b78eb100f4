"""Friction in scene files: all joints and single ones, materials, written and read again, contradictions."""

from __future__ import annotations

import json

import jax
import numpy as np
import pytest

import linkjax as lj
from linkjax.elements import material_friction, seat_friction
from linkjax.friction import GuideFriction, MeshFriction, PinFriction, Thrust, everywhere
from linkjax.scenes import SceneError, loads_text, text_of
from tests.test_cli import run

ALL = {"friction": {"coefficient": 0.1, "radius": "10 mm"}}


def same(one: lj.Scene, other: lj.Scene) -> bool:
    (a, first), (b, second) = jax.tree.flatten(one.friction), jax.tree.flatten(other.friction)
    return first == second and all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


def test_all_joints():
    scene = lj.load("slider-crank", ALL)
    expected = everywhere(scene.mechanism, 0.1, 0.01)
    assert [each.joint for each in scene.friction] == ["O", "C", "P", "piston.guide"]
    assert same(scene, lj.Scene(scene.mechanism, speed=1.0, friction=expected))


def test_single_joints():
    """What is not given is that of all joints; a joint with a coefficient of zero has no friction."""
    joints = {
        "O": {"coefficient": 0},
        "C": {"material": "bronze-steel", "lubricated": True, "bearing": "run-in"},
        "P": {"coefficient": 0.0015, "mean_diameter": "46 mm", "thrust": {"force": "2 kN", "outer": "40 mm"}},
        "piston.guide": {"seat": 1.27, "length": "120 mm"},
    }
    scene = lj.load("slider-crank", {"friction": {**ALL["friction"], "guide": 0.12}, "joints": joints})
    pin, rolling, guide = scene.friction
    assert isinstance(pin, PinFriction) and isinstance(rolling, PinFriction) and isinstance(guide, GuideFriction)
    assert float(pin.coefficient) == material_friction("steel-bronze", lubricated=True) and pin.bearing == "run-in"
    assert float(pin.radius) == 0.01 and float(rolling.radius) == 0.023
    assert rolling.thrust is not None
    assert float(rolling.thrust.couple()) == float(Thrust(2000.0, 0.04, 0.0015).couple())
    assert guide.length is not None
    assert float(guide.equivalent()) == float(seat_friction(0.12, 1.27)) and float(guide.length) == 0.12
    assert same(loads_text(text_of(scene)), scene)


def test_what_a_joint_takes_from_all_joints():
    """That the materials are lubricated; but a rolling bearing has no worn journal."""
    common = {"material": "steel-steel", "lubricated": True, "radius": "10 mm", "bearing": "run-in"}
    joints = {"C": {"material": "steel-bronze"}, "P": {"coefficient": 0.0015, "mean_diameter": "46 mm"}}
    joints["P"]["bearing"] = "given"  # as it is anyway
    first, second, rolling, _ = lj.load("slider-crank", {"friction": common, "joints": joints}).friction
    assert isinstance(first, PinFriction) and isinstance(second, PinFriction) and isinstance(rolling, PinFriction)
    assert float(second.coefficient) == material_friction("steel-bronze", lubricated=True)
    assert (first.bearing, second.bearing, rolling.bearing) == ("run-in", "run-in", "given")


def test_guides_alone():
    found = lj.load("slider-crank", {"friction": {"guide": 0.2}}).friction
    assert [each.joint for each in found] == ["piston.guide"]


def test_static_friction():
    """Of one joint, of all, and of the materials where the table has it."""
    joints = {"C": {"coefficient": 0.1, "static": 0.2}, "P": {"material": "steel-steel"}}
    common = {"coefficient": 0.1, "static": 0.15, "radius": "10 mm", "guide": 0.12}
    scene = lj.load("slider-crank", {"friction": common, "joints": joints})
    found = {each.joint: each.static for each in scene.friction if isinstance(each, PinFriction | GuideFriction)}
    assert {name: None if value is None else float(value) for name, value in found.items()} == {
        "O": 0.15, "C": 0.2, "P": 0.15, "piston.guide": None
    }  # fmt: skip
    assert same(loads_text(text_of(scene)), scene)
    table = lj.load("slider-crank", {"friction": {"material": "bronze-bronze", "lubricated": True, "radius": "9 mm"}})
    assert all(getattr(each, "static", 0) is None for each in table.friction)


def test_meshes():
    """All of them, and one; an efficiency of one is without loss."""
    scene = lj.load("geared-press", {"friction": {"mesh_efficiency": 0.98}})
    assert same(scene, lj.Scene(scene.mechanism, speed=1.0, friction=(MeshFriction("wheel", 0.98),)))
    other = lj.load("geared-press", {"joints": {"wheel.mesh": {"efficiency": 0.97}}})
    (mesh,) = other.friction
    assert isinstance(mesh, MeshFriction) and float(mesh.efficiency) == 0.97
    assert same(loads_text(text_of(other)), other)
    none = {**ALL["friction"], "mesh_efficiency": 0.9}
    kept = lj.load("geared-press", {"friction": none, "joints": {"wheel.mesh": {"efficiency": 1}}})
    assert "wheel.mesh" not in [each.joint for each in kept.friction]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"friction": {"mesh_efficiency": 1.1}}, "friction.mesh_efficiency = 1.1: is above one; write a number"),
        ({"joints": {"wheel.mesh": {"efficiency": 98}}}, "is above one; write a number up to 1"),
        ({"joints": {"wheel.mesh": {"efficiency": 0}}}, "must be greater than zero"),
        ({"joints": {"gear.mesh": {"efficiency": 0.9}}}, "there is no such mesh; write one of wheel.mesh"),
        ({"joints": {"wheel.mesh": {"coefficient": 0.1}}}, "it is a key of a pin or a guide"),
        ({"joints": {"B": {"efficiency": 0.9}}}, "has no effect: B is a pin; delete it; it is a key of a mesh"),
    ],
)
def test_contradictions_of_meshes(changes, says):
    with pytest.raises(SceneError) as caught:
        lj.load("geared-press", changes)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"friction": {"coefficient": 0.1}}, 'joints.O: the pin has no radius, at which it rubs; add radius = "20 mm"'),
        ({"friction": {"radius": "9 mm"}}, "friction.coefficient: missing; add coefficient"),
        (
            {"friction": {"radius": "9 mm", "guide": 0.1}},
            "has no effect: no pin has a coefficient of friction; add coefficient = 0.1, or coefficient = 0 for",
        ),
        ({"friction": {"mu": 0.1}}, "not a known key; friction is"),
        ({"friction": 0.1}, "a number where a table is needed"),
        ({"friction": {"material": "wood-steel"}}, "not in the table; write one of steel-steel"),
        ({"friction": {"material": "bronze-bronze", "coefficient": 0.1}}, "given, and coefficient too"),
        ({"friction": {"coefficient": 0.1, "lubricated": True}}, "has no effect without a material"),
        ({**ALL, "joints": {"C": {"mean_diameter": "46 mm", "bearing": "unworn"}}}, "delete bearing, or mean_diameter"),
        ({"joints": {"X": {"coefficient": 0.1}}}, "there is no such pin; write one of O, C, P"),
        ({"joints": {"rod.guide": {"coefficient": 0.1}}}, "there is no such guide; write one of piston.guide"),
        ({"joints": {"C": {"radius": "3 mm"}}}, "has no coefficient of friction; add"),
        ({"joints": [{"type": "revolute"}]}, "a pin is a point that two links name"),
        ({**ALL, "joints": {"piston.guide": {"radius": "3 mm"}}}, "has no effect: piston.guide is a guide"),
        ({**ALL, "joints": {"C": {"groove": "45 deg"}}}, "has no effect: C is a pin"),
        ({**ALL, "joints": {"piston.guide": {"seat": 3}}}, "write a number from 1 to"),
        ({**ALL, "joints": {"piston.guide": {"seat": 1.2, "groove": "45 deg"}}}, "given, and groove too"),
        ({**ALL, "joints": {"C": {"thrust": {"force": "1 N", "outer": "1 mm", "inner": "2 mm"}}}}, "below the outer"),
    ],
)  # fmt: skip
def test_contradictions(changes, says):
    with pytest.raises(SceneError) as caught:
        lj.load("slider-crank", changes)
    assert says in str(caught.value)
    assert str(caught.value).startswith("slider-crank.toml: ")


def test_materials_may_have_dashes():
    """As they are printed in the table of docs/friction.md."""
    names = ("steel-bronze", "steel–bronze", "bronze − steel")
    scenes = [lj.load("slider-crank", {"friction": {"radius": "9 mm", "material": name}}) for name in names]
    assert same(scenes[0], scenes[1]) and same(scenes[0], scenes[2])


@pytest.mark.slow
def test_a_machine_that_locks_ends_with_an_error(monkeypatch, capsys, tmp_path):
    """Everything is written, and the exit code says that the machine does not move."""
    rough = ("--set", 'friction={coefficient=3, radius="90 mm"}', "--constant-speed", "--quiet", "--angles", "12")
    code, _, err = run(monkeypatch, capsys, "analyse", "slider-crank", *rough, "--json", str(tmp_path / "a.json"))
    assert code == 1 and "friction locks the machine" in err and len(err.strip().split("\n")) == 1
    assert json.loads((tmp_path / "a.json").read_text())["result"]["name"] == "locked"
