"""Scenes written as files: the scene that is read back is the same, to the last bit."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest

import linkjax as lj
from linkjax import StructureError, Torque
from linkjax.design import changed, numbers
from linkjax.groups import AbstractLaw
from linkjax.scenes import loads_text, text_of
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
