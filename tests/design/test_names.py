"""Scene parameters by name: every one is found, read and changed, and no other one changes."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import DesignError
from linkjax.design import changed, number, numbers


def scene() -> lj.Scene:
    weights = {"W": {"mass": 3, "at": {"along": "-0.1 m", "across": "0.02 m"}, "thickness": "5 cm", "density": 7850}}
    return lj.load("hay-press", {"links.crank.counterweights": weights})


def test_every_number_is_where_its_name_says():
    """Changing one changes one leaf of the tree, the one that is read back."""
    machine = scene()
    known = numbers(machine)
    leaves = jax.tree.leaves(machine)
    moved = set()
    for name in known:
        other = changed(machine, {name: 0.123})
        assert float(known[name].read(other)) == 0.123
        different = [i for i, (a, b) in enumerate(zip(leaves, jax.tree.leaves(other), strict=True)) if a is not b]
        assert len(different) == 1, name
        moved.add(different[0])
    assert len(moved) == len(known)
    assert len(leaves) - len(known) <= 2  # the required δ is not a number of the machine


@pytest.mark.parametrize(
    ("name", "value", "unit"),
    [
        ("links.rod.length", 1.02, "m"),
        ("links.rod.points.E.along", 0.45 * np.cos(np.pi / 6), "m"),
        ("links.crank.counterweights.W.mass", 3.0, "kg"),
        ("links.crank.counterweights.W.at.across", 0.02, "m"),
        ("links.crank.counterweights.W.thickness", 0.05, "m"),
        ("fixed.F.y", 0.58, "m"),
        ("flywheel.inertia", 0.0, "kg m^2"),
        ("groups.rod-slider.guide.along", 0.0, "rad"),
        ("loads.hay.force", 30e3, "N"),
        ("loads.hay.window.on", np.pi / 2, "rad"),
        ("speed", 700 * np.pi / 30, "rad/s"),
        ("gravity.y", -9.8, "m/s^2"),
    ],
)
def test_values_and_units(name, value, unit):
    found = number(scene(), name)
    assert float(found.read(scene())) == pytest.approx(value, rel=1e-15)
    assert found.unit == unit


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("links.rod.lenght", "did you mean 'links.rod.length'"),
        ("links.rod.points.E", "it has: links.rod.points.E.along, links.rod.points.E.across"),
        ("nothing", "is not a scene parameter"),
    ],
)
def test_unknown_names(name, says):
    with pytest.raises(DesignError, match=says):
        number(scene(), name)


def test_a_slot_has_no_guide_of_the_frame():
    """Names follow the keys of scene files: `offset` of an RPR is beside its `kind`, that of an RRP in `guide`."""
    known = [name for name in numbers(lj.load("quick-return")) if name.startswith("groups.")]
    guide = [f"groups.rod-ram.guide.{key}" for key in ("along", "offset")]
    assert known == ["groups.crank.phase", "groups.lever-die.offset", *guide]


def test_differentiable():
    machine = scene()
    slope = jax.grad(lambda x: changed(machine, {"links.rod.length": x}).mechanism.links["rod"].length ** 2)
    assert float(slope(jnp.asarray(3.0))) == 6.0


@pytest.mark.parametrize("constant_speed", [False, True])
def test_what_belongs_to_a_motion_that_does_not_exist_is_not_optimised(constant_speed):
    """Refused before any step, and not certified at zero."""
    links = {"crank": lj.Link(length=0.1), "rod": lj.Link(length=0.3), "slider": lj.Link(mass=1.0 * constant_speed)}
    groups = [lj.Crank("crank", "A", "B"), lj.RRP("rod", "slider", "B", "C", lj.Guide("A"))]
    scene = lj.Scene(lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, groups), speed=5.0, constant_speed=constant_speed)
    why = "the scene is for constant speed" if constant_speed else "the machine has no mass"
    with pytest.raises(DesignError, match=f"delta: needs the actual motion, but {why}"):
        lj.optimise(scene, free={"links.rod.length": (0.25, 0.35)}, minimise="delta", starts=1)
    with pytest.raises(DesignError, match=r"or use peak_reaction_constant_speed\.B\.rod$"):
        lj.optimise(scene, free={"links.rod.length": (0.25, 0.35)}, minimise="peak_reaction.B.rod", starts=1)
