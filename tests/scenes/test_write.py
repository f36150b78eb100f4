"""Scenes written as files: the scene that is read back is the same, to the last bit."""

from __future__ import annotations

import dataclasses
import re

import jax
import numpy as np
import pytest

import linkjax as lj
from linkjax import StructureError, Torque
from linkjax.design import changed, numbers
from linkjax.groups import AbstractLaw
from linkjax.scenes import build, load_document, loads_text, read_document, text_of
from linkjax.scenes._in_units import in_units, units_in
from tests.physics.machines import BUILT_IN, COMPOSED, PRESCRIBED, machine


def rich() -> lj.Scene:
    """With all possible content of a file: weights, sections, scaled links, all kinds of loads, a clockwise crank."""
    changes = {
        "rotation": "cw",
        "mean": "midrange",
        "cycle_turns": 2,
        "gravity": ["1 m/s^2", "-9.81 m/s^2"],
        "links.rod.mass_properties": "scaled",
        "links.rod.length": "1.01 m",
        "links.link4": {"length": "500 mm", "mass_properties": "section", "area": "400 mm^2", "density": 7850},
        "links.crank.counterweights": {"W1": {"mass": 3, "at": "-0.1 m", "thickness": "5 cm", "density": 7850}},
        "links.rocker.counterweights": {
            "W2": {"mass": 1, "at": {"at": "0.1 m", "turned": "170 deg"}, "ideal": True},
            "W3": {"mass": 2, "at": "0.3 m", "inertia": "0.1 kg m^2"},
        },
    }
    scene = lj.load("hay-press", changes)
    window = lj.Window(0.3, 4.0)
    more = (
        Torque("motor", "crank", torque=-3.3),
        lj.Spring("spring", "rod", "E", to_point="F", stiffness=2e3, free_length=0.1, preload=-4.0, window=window),
        lj.Spring("between", "rod", "E", "rocker", to_point="G", stiffness=2e3),
        lj.TorsionSpring("twist", "rocker", stiffness=3.0, free_angle=-0.4, preload=1.0),
        lj.TorsionSpring("hinge", "rocker", "link4", stiffness=3.0, free_angle=0.4),
        lj.Damper("damper", "slider", "D", to_point="A", coefficient=5.0),
        lj.TorsionDamper("rub", "rocker", "link4", coefficient=5.0),
        lj.Drag("air", "slider", "D", linear=1.0, quadratic=2.0, reacts_on="frame"),
        lj.DragTorque("fan", "crank", linear=1.0, quadratic=2.0, window=lj.Passage(point="D", last=0.01)),
    )
    return dataclasses.replace(scene, loads=(*scene.loads, *more))


@pytest.mark.parametrize(
    "name", [*(n for n in (*BUILT_IN, *COMPOSED, *PRESCRIBED) if n not in ("triad", "rolling")), "rich"]
)
def test_read_back_to_the_last_bit(name, rng):
    scene = rich() if name == "rich" else machine(name)
    values = {n: float(at.read(scene)) * (1 + 1e-3 * rng.random()) for n, at in numbers(scene).items()}
    scene = changed(scene, values)
    text = text_of(scene, "what it is\nand why")
    assert text.startswith("# what it is\n# and why\n")
    again = loads_text(text)
    assert jax.tree.structure(again) == jax.tree.structure(scene)
    for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(scene), strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize("name", lj.scene_names())
def test_in_the_units_of_another_file(name, rng):
    """The same scene to the last bit, in the units of its own file; digits as written where nothing has changed."""
    given, scene = load_document(name), lj.load(name)
    shown = {unit for unit in units_in(given.table).values() if unit not in ("1", "deg")}
    assert shown
    values = {n: float(at.read(scene)) * (1 + 1e-3 * rng.random()) for n, at in numbers(scene).items()}
    moved = changed(scene, values)
    for each in (scene, moved):
        text = text_of(each, like=given)
        again = loads_text(text)
        for parameter, at in numbers(each).items():  # a sketch is written anew
            assert float(at.read(again)) == float(at.read(each)), parameter
        assert not re.search(r"\d m\"", text) or "mm" not in shown
    if "mm" not in shown:
        return
    lengths = [link.get("length") for link in given.table["links"].values() if "length" in link]
    assert all(f'"{length}"' in text_of(scene, like=given) for length in lengths if length.endswith("mm"))


def test_defaults_that_the_other_file_does_not_give():
    """They are left out, and written where the scene would be another without them."""
    text = """
        speed = "60 rpm"
        fixed.A = [0, 0]
        links.crank = { length = "60 mm", uniform = true, mass = "2 kg" }
        [[groups]]
        kind = "crank"
        link = "crank"
        pivot = "A"
        end = "B"
        """
    document = read_document(text, "crank.toml")
    scene = build(document)
    shorter, longer = text_of(scene, like=document), text_of(scene)
    for left_out in ("gravity", "flywheel", "phase", "centre_name"):
        assert left_out in longer and left_out not in shorter
    heavy = dataclasses.replace(scene, gravity=lj.Vec(0.0, -9.8))
    assert "gravity" in text_of(heavy, like=document)
    renamed = text.replace("uniform = true", 'centre_name = "S1"')
    assert "centre_name" in text_of(build(read_document(renamed)), like=read_document(renamed))


@pytest.mark.parametrize(
    ("value", "unit", "wanted"),
    [
        ("0.3 m", "mm", "300 mm"),
        ("-0.0 m", "mm", "0 mm"),
        ("73.30382858376184 rad/s", "rpm", "700 rpm"),
        ("1e-12 kg m^2", "g mm^2", "0.001 g mm^2"),
        ("0.38971143170299744 m", "mm", "389.71143170299744 mm"),
        ("3e20 N", "kN", "3E+17 kN"),
        ("B", "mm", "B"),
    ],
)
def test_quantities_in_another_unit(value, unit, wanted):
    si = units_in({"x": f"1 {unit}"})
    assert in_units({"x": [value], "title": value}, si) == {"x": [wanted], "title": value}


class Constant(AbstractLaw):
    """A motion law that scene files do not support."""

    def at(self, phi):
        raise NotImplementedError


def test_what_a_file_cannot_say():
    own = machine("swinging")
    crank = dataclasses.replace(own.mechanism.groups[0], law=Constant())
    with pytest.raises(StructureError, match="scene files do not support laws of the kind Constant"):
        text_of(
            dataclasses.replace(
                own, mechanism=dataclasses.replace(own.mechanism, groups=(crank, *own.mechanism.groups[1:]))
            )
        )
    scene = machine("slider-crank")
    batch = changed(scene, {"speed": np.ones(2)})
    with pytest.raises(StructureError, match="one scene at a time"):
        text_of(batch)
