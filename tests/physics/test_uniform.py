"""Uniform bars and plates, and the rule "stretched": against closed forms, integrals and numbers given by hand."""

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import Link, StructureError, Vec
from linkjax.machine import nameless
from linkjax.measures import peak_shaking_force_constant_speed
from linkjax.scenes import SceneError, load, loads_text, text_of

M = 2.5


def plate(corners: dict[str, complex], length: float = 1.0, **keys) -> Link:
    """A uniform plate with the pins A and B at 0 and `length`; a corner of these names is a pin."""
    points = {name: Vec(at.real, at.imag) for name, at in corners.items() if name not in ("A", "B")}
    return Link(length=length, mass=M, points=points, pins=("A", "B"), uniform=tuple(corners), **keys)


def told(link: Link) -> tuple[complex, float, float]:
    """Centre, inertia and mass."""
    body = link.actual()
    return complex(float(body.centre.x), float(body.centre.y)), float(body.inertia), float(body.mass)


def polar(base: float, height: float) -> float:
    """Second polar moment of a rectangle per area, about its centre."""
    return (base**2 + height**2) / 12


def test_a_bar():
    assert told(Link(length=0.6, mass=M, uniform=True)) == pytest.approx((0.3, M * 0.36 / 12, M), rel=1e-15)


def test_a_bar_to_a_pin_that_is_a_point():
    bar = Link(mass=M, pins=("A", "B"), points={"B": Vec(0.3, -0.4)}, uniform=True)
    assert told(bar) == pytest.approx((0.15 - 0.2j, M * 0.25 / 12, M), rel=1e-15)


def test_a_triangle():
    """Centroid at the mean of the corners; per area (a² + b² + c²) / 36."""
    third = 0.4 + 0.7j
    sides = 1.0 + abs(third) ** 2 + abs(third - 1) ** 2
    for corners in ({"A": 0j, "B": 1 + 0j, "E": third}, {"E": third, "B": 1 + 0j, "A": 0j}):  # either way round
        assert told(plate(corners)) == pytest.approx(((1 + third) / 3, M * sides / 36, M), rel=1e-14)


@pytest.mark.parametrize("turned", [0.0, 0.3, 2.0, -1.2])
def test_a_rectangle_anywhere_on_the_link(turned):
    """Off the axis of the link, turned, beside its pins."""
    base, height, middle, turn = 0.5, 0.2, 3 - 7j, complex(math.cos(turned), math.sin(turned))
    places = {"E": -base - 1j * height, "F": base - 1j * height, "G": base + 1j * height, "H": -base + 1j * height}
    found = told(plate({name: middle + 0.5 * at * turn for name, at in places.items()}))
    assert found == pytest.approx((middle, M * polar(base, height), M), rel=1e-13)


def test_an_l_shape_is_two_rectangles():
    """A polygon that is not convex, with a pin at one corner: the sum of two rectangles by Steiner's theorem."""
    corners = {"A": 0j, "E": 4 + 0j, "F": 4 + 1j, "G": 1 + 1j, "H": 1 + 3j, "I": 3j}
    areas, centres, own = (4.0, 2.0), (2 + 0.5j, 0.5 + 2j), (polar(4, 1), polar(1, 2))
    middle = sum(a * c for a, c in zip(areas, centres, strict=True)) / 6
    per_area = sum(a * (j + abs(c - middle) ** 2) for a, c, j in zip(areas, centres, own, strict=True)) / 6
    assert told(plate(corners)) == pytest.approx((middle, M * per_area, M), rel=1e-14)


def test_a_plate_far_from_its_pins_keeps_its_digits():
    far = 1e4 + 2e4j
    corners = {"E": far, "F": far + 1, "G": far + 1 + 1j, "H": far + 1j}
    assert told(plate(corners))[1] == pytest.approx(M / 6, rel=1e-9)


def test_stretched_by_hand():
    """Twice as long: the same mass, the centre and the points twice as far, the radius of gyration twice as large."""
    link = Link(
        length=0.8, mass=M, inertia=0.03, centre=Vec(0.1, 0.02), points={"E": Vec(0.3, -0.1)}, reference_length=0.4,
        mass_properties="stretched",
    )  # fmt: skip
    assert told(link) == pytest.approx((0.2 + 0.04j, 0.12, M), rel=1e-15)
    assert complex(link.actual().points["E"].x, link.actual().points["E"].y) == pytest.approx(0.6 - 0.2j, rel=1e-15)


@pytest.mark.parametrize(
    ("rule", "mass", "grown"), [("fixed", 1.0, False), ("stretched", 1.0, True), ("scaled", 1.5, True)]
)
def test_a_uniform_plate_follows_its_length(rule, mass, grown):
    """1.5 times as long: `mass_properties` moves the points and the mass, the plate is that of the new geometry."""
    keys = {} if rule == "fixed" else {"reference_length": 1.0}
    third = 0.4 + 0.7j
    link = plate({"A": 0j, "B": 1 + 0j, "E": third}, 1.5, mass_properties=rule, **keys)
    at = 1.5 * third if grown else third
    sides = 1.5**2 + abs(at) ** 2 + abs(at - 1.5) ** 2
    assert told(link) == pytest.approx(((1.5 + at) / 3, mass * M * sides / 36, mass * M), rel=1e-14)


def test_a_uniform_bar_is_that_of_its_section():
    """Scaled, it is the bar with the same mass per length."""
    bar = Link(length=0.9, mass=1.0, reference_length=0.5, mass_properties="scaled", uniform=True)
    section = Link(length=0.9, area=1e-3, density=2e3, mass_properties="section")
    assert told(bar) == pytest.approx(told(section), rel=1e-15)


def links(even: bool) -> dict[str, Link]:
    """A four-bar with a uniform plate as coupler and a uniform rocker, or with the same numbers by hand."""
    points = {"E": Vec(0.12, 0.16), "T": Vec(0.1, 0.05)}
    crank = Link(length=0.1, mass=1.0, inertia=0.002, centre=Vec(0.02, 0.0))
    if even:
        coupler = Link(length=0.36, mass=3.0, points=points, uniform=("E", "B", "C"))
        return {"crank": crank, "coupler": coupler, "rocker": Link(length=0.26, mass=2.0, uniform=True)}
    sides = 0.36**2 + 0.12**2 + 0.16**2 + 0.24**2 + 0.16**2
    coupler = Link(length=0.36, mass=3.0, inertia=3.0 * sides / 36, centre=Vec(0.16, 0.16 / 3), points=points)
    return {
        "crank": crank, "coupler": coupler,
        "rocker": Link(length=0.26, mass=2.0, inertia=2.0 * 0.26**2 / 12, centre=Vec(0.13, 0.0)),
    }  # fmt: skip


def four_bar(even: bool = True) -> lj.Scene:
    groups = [lj.Crank("crank", "A", "B"), lj.RRR(("coupler", "rocker"), "B", "D", "C", 1)]
    mechanism = lj.Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0)}, links(even), groups, lj.Flywheel(0.5))
    return lj.Scene(mechanism, gravity=Vec(0.0, -9.81), speed=20.0)


@pytest.fixture(scope="module")
def slope():
    """The measure, and its derivatives with respect to a length and a corner, as one program for numbers."""
    scene = four_bar()

    def measure(x):
        names = ("links.coupler.length", "links.rocker.length", "links.coupler.points.E.across")
        changed = lj.design.changed(scene, dict(zip(names, x, strict=True)))
        return peak_shaking_force_constant_speed(changed)

    return jax.jit(jax.value_and_grad(measure))


@pytest.mark.slow
def test_a_machine_of_uniform_links_is_that_of_the_same_numbers_by_hand(slope):
    value, _ = slope(jnp.array([0.36, 0.26, 0.16]))
    assert float(value) == pytest.approx(float(peak_shaking_force_constant_speed(four_bar(False))), rel=1e-11)


@pytest.mark.slow
def test_derivatives_are_those_of_differences(slope):
    """Central differences of fourth order, for both lengths and a corner point."""
    x = np.array([0.36, 0.26, 0.16])
    _, exact = slope(jnp.array(x))
    for i, h in enumerate(1e-3 * x):
        step = h * np.eye(3)[i]
        one, two = ((slope(x + k * step)[0] - slope(x - k * step)[0]) / (2 * k * h) for k in (1, 2))
        assert float(exact[i]) == pytest.approx(float(4 * one - two) / 3, rel=1e-6)


def test_what_is_computed_is_no_scene_parameter():
    known = lj.design.numbers(four_bar())
    assert {"links.rocker.mass", "links.rocker.length", "links.coupler.mass", "links.coupler.points.E.across"} <= {
        *known
    }
    assert not {name for name in known if "rocker" in name and ("inertia" in name or "centre" in name)}


def test_names_are_no_part_of_the_program():
    """Two machines that differ in the names of a corner, a pin and a link have the same structure without names."""
    text = SCENE.replace('"C"', '"G"').replace('"E"', '"H"').replace("points.E", "points.H").replace("rocker", "lever")
    (one, names), (two, others) = (nameless(loads_text(each)) for each in (SCENE, text))
    assert jax.tree.structure(one) == jax.tree.structure(two)
    assert names is not None and names.back(one).mechanism.links["coupler"].uniform == ("E", "B", "C")
    assert others is not None and others.back(two).mechanism.links["coupler"].uniform == ("H", "B", "G")


SCENE = """
speed = 10
[fixed]
A = [0, 0]
D = [0.4, 0]
[links.crank]
length = "100 mm"
[links.coupler]
length = "360 mm"
mass = "3 kg"
uniform = ["E", "B", "C"]
points.E = { along = "120 mm", across = "16 cm" }
[links.rocker]
length = 0.26
mass = "2000 g"
uniform = true
[[groups]]
kind = "crank"
link = "crank"
pivot = "A"
end = "B"
[[groups]]
kind = "RRR"
links = ["coupler", "rocker"]
from = "B"
to = "D"
meet = "C"
"""
DRAWN = """
speed = 10
[fixed]
A = [0, 0]
D = [0.4, 0]
[links.crank]
pins = ["A", "B"]
[links.coupler]
pins = ["C", "B", "E"]
sides = { C-B = "360 mm", B-E = "200 mm", E-C = "289 mm" }
mass = "3 kg"
uniform = ["E", "B", "C"]
[links.rocker]
pins = ["D", "C"]
mass = "2 kg"
uniform = true
[drive]
link = "crank"
[sketch]
B = [0.1, 0]
C = [0.33, 0.28]
E = [0.1, 0.2]
"""


def test_a_scene_in_groups_is_read_and_written():
    scene = loads_text(SCENE)
    by_hand = links(False)
    for name in ("coupler", "rocker"):
        assert told(scene.mechanism.links[name]) == pytest.approx(told(by_hand[name]), rel=1e-14)
    again = loads_text(text_of(scene))
    assert again.mechanism.links["coupler"].uniform == ("E", "B", "C")
    assert again.mechanism.links["rocker"].uniform is True
    assert text_of(again) == text_of(scene)


def test_a_drawn_scene_is_read_and_written():
    """A ternary plate by the distances between its pins, a rocker measured from the sketch."""
    scene = loads_text(DRAWN)
    centre, inertia, _ = told(scene.mechanism.links["coupler"])
    assert inertia == pytest.approx(3.0 * (0.36**2 + 0.2**2 + 0.289**2) / 36, rel=1e-13)
    third = scene.mechanism.links["coupler"].points["E"]
    assert centre == pytest.approx((0.36 + complex(third.x, third.y)) / 3, rel=1e-13)
    span = scene.mechanism.links["rocker"].length
    assert told(scene.mechanism.links["rocker"])[1] == pytest.approx(2.0 * float(span) ** 2 / 12, rel=1e-13)
    assert text_of(loads_text(text_of(scene))) == text_of(scene)


def test_stretched_in_a_scene_takes_the_previous_length():
    """`--set` makes the rod 1.5 times as long; the scene is written with its reference length."""
    changes = {"links.rod.mass_properties": "stretched", "links.rod.length": "1.53 m"}
    old, new = (told(load("hay-press", each).mechanism.links["rod"]) for each in ({}, changes))
    assert new == pytest.approx((1.5 * old[0], 1.5**2 * old[1], old[2]), rel=1e-14)
    scene = load("hay-press", changes)
    assert text_of(loads_text(text_of(scene))) == text_of(scene)


def edit(old: str, new: str, text: str = SCENE) -> str:
    assert old in text
    return text.replace(old, new, 1)


BAR, PLATE, E = "uniform = true", 'uniform = ["E", "B", "C"]', 'points.E = { along = "120 mm", across = "16 cm" }'


@pytest.mark.parametrize(
    ("text", "key", "problem", "remedy"),
    [
        (edit(BAR, BAR + '\ncentre = "130 mm"'), "links.rocker.centre", "given twice", "delete centre, or uniform"),
        (edit(BAR, BAR + "\ninertia = 0"), "links.rocker.inertia", "given twice", "delete inertia, or uniform"),
        (edit(BAR, BAR + '\narea = "1 cm^2"'), "links.rocker.area", "has no effect", "instead of uniform"),
        (edit(BAR, BAR + "\ndensity = 7850"), "links.rocker.density", "has no effect", "instead of uniform"),
        (edit('mass = "2000 g"', ""), "links.rocker.mass", "missing", "the mass of the bar or plate"),
        (edit('mass = "2000 g"', "mass = 0"), "links.rocker.mass", "must be greater than zero", "or delete uniform"),
        (edit('mass = "2000 g"', 'mass_properties = "section"\narea = 1\ndensity = 1'), "links.rocker.uniform",
         "is a uniform bar", "delete uniform"),
        (edit(PLATE, 'uniform = ["B", "C"]'), "links.coupler.uniform", "names 2 corners", "three or more"),
        (edit(PLATE, "uniform = []"), "links.coupler.uniform", "names 0 corners", "three or more"),
        (edit(PLATE, 'uniform = ["B", "C", "F"]'), "links.coupler.uniform", "'F' is not a pin or point", "known here"),
        (edit(PLATE, 'uniform = ["B", "C", "E", "B"]'), "links.coupler.uniform", "'B' is named twice", "joined to"),
        (edit(E, 'points.E = "100 mm"'), "links.coupler.uniform", "enclose no area", "off the line"),
        (edit(PLATE, 'uniform = ["B", "C", "E", "F"]\npoints.F = { along = "100 mm", across = "-50 mm" }'),
         "links.coupler.uniform", "edges B-C and E-F of the plate cross", "order of its outline"),
        (edit(PLATE, 'uniform = "yes"'), "links.coupler.uniform", "where true or false is needed", "true or false"),
        (edit('uniform = ["E", "B", "C"]', BAR, DRAWN), "links.coupler.uniform", "has sides", '["C", "B", "E"]'),
        (edit(BAR, 'reference_length = "1 m"'), "links.rocker.reference_length", "has no effect", '"stretched"'),
    ],
)  # fmt: skip
def test_contradictions_are_refused(text, key, problem, remedy):
    with pytest.raises(SceneError) as caught:
        loads_text(text)
    assert caught.value.key == key
    assert problem in caught.value.problem and remedy in caught.value.remedy


def test_contradictions_in_python_are_refused():
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"uniform": True}, "without 'mass'"),
        ({"uniform": True, "mass": 1.0, "inertia": 1.0}, "'inertia' of a uniform link is given"),
        ({"uniform": True, "mass": 1.0, "centre": Vec(0.0, 1.0)}, "'centre' of a uniform link is given"),
        ({"uniform": True, "mass": 1.0, "area": 1.0}, "'area' of a uniform link has no effect"),
        ({"uniform": ("A", "B"), "mass": 1.0}, "names 2 corners"),
    ]
    for keys, says in wrong:
        with pytest.raises(ValueError, match=says):
            Link(length=1.0, **keys)
    with pytest.raises(TypeError, match="'uniform' of a link is 'ABC'"):
        Link(length=1.0, mass=1.0, uniform="ABC")
    with pytest.raises(ValueError, match="needs reference_length"):
        Link(length=1.0, mass=1.0, mass_properties="stretched")
    with pytest.raises(ValueError, match="corner 'A' of a uniform plate has no position"):
        Link(length=1.0, mass=1.0, uniform=("A", "B", "C")).actual()


def test_a_slider_is_no_bar():
    made = load("slider-crank").mechanism
    block = made.groups[1].link_names()[1]
    even = Link(mass=1.0, uniform=True)
    with pytest.raises(StructureError, match=rf"links\.{block}\.uniform: a uniform bar has two pins, but this link"):
        dataclasses.replace(made, links={**made.links, block: even})
