"""Lengths with a ratio of 1e6, masses of 1e9, machines a million link lengths from the origin, millimetres."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import linkjax as lj
from linkjax import PRP, RPP, RPR, RRP, RRR, Crank, Flywheel, Guide, Link, Mechanism, Vec
from linkjax.groups import Gear, Teeth
from tests.physics.machines import moved, resized
from tests.physics.near_dead import HALF, PHI, computed, judge

EPS = 2 * HALF


def body(length: float, mass: float) -> Link:
    return Link(length=length, mass=mass, inertia=0.02 * mass * length**2, centre=Vec(0.4 * length, 0.1 * length))


def chain(crank: float, one: float, two: float, far: complex, masses: tuple[float, float] = (1.3, 0.8)) -> lj.Scene:
    """A four-bar; the topology of the machines with a stretched dyad."""
    links = {"crank": body(crank, 1.0), "one": body(one, masses[0]), "two": body(two, masses[1])}
    groups = [Crank("crank", "A", "B"), RRR(("one", "two"), "B", "F", "G", 1)]
    fixed = {"A": Vec(0.0, 0.0), "F": Vec(far.real, far.imag)}
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.1)), gravity=Vec(0.5, -9.81))


def sliding(kind: str, crank: float = 0.13, rod: float = 0.4, far: complex = 0.05 - 0.3j) -> lj.Scene:
    """A crank with a slider, a slotted lever, a slider with a slot, or blocks in a slot of the frame and in its own."""
    links = {
        "crank": body(crank, 1.0),
        "one": Link(mass=1.3, inertia=0.01, centre=Vec(0.03, 0.02)) if kind == "PRP" else body(rod, 1.3),
        "two": Link(mass=0.8, inertia=0.01, centre=Vec(0.02, 0.01)),
    }
    group = {
        "RRP": RRP("one", "two", "B", "D", Guide("A", 0.3, 0.05)),
        "RPR": RPR("one", "two", "B", "P", "E", offset=0.02),
        "RPP": RPP("one", "two", "B", "Q", Guide("P", 0.3, 0.02), 1.9, -0.01),
        "PRP": PRP(("one", "two"), "M", (Guide("P", 0.3, 0.02), Guide("B", 0.27, -0.01, "crank"))),
    }[kind]  # fmt: skip
    fixed = {"A": Vec(0.0, 0.0), "P": Vec(far.real, far.imag)}
    return lj.Scene(Mechanism(fixed, links, [Crank("crank", "A", "B"), group], Flywheel(0.1)), gravity=Vec(0.5, -9.81))


def geared() -> lj.Scene:
    """A dyad on a gear."""
    links = {"crank": body(0.13, 1.0), "wheel": body(0.1, 1.0), "one": body(0.4, 1.3), "two": body(0.3, 0.8)}
    gear = Gear("wheel", "W", Teeth((20, 40)), "crank", "A", "C", 0.4)
    groups = [Crank("crank", "A", "B"), gear, RRR(("one", "two"), "C", "F", "G", 1)]
    fixed = {"A": Vec(0.0, 0.0), "W": Vec(0.3, 0.05), "F": Vec(0.7, -0.1)}
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.1)), gravity=Vec(0.5, -9.81))


def away(scene: lj.Scene, x: float, y: float) -> lj.Scene:
    return dataclasses.replace(scene, mechanism=moved(scene.mechanism, x, y))


def turned(scene: lj.Scene, angle: float) -> lj.Scene:
    """The machine at a later position in its cycle."""
    crank, *others = scene.mechanism.groups
    groups = [dataclasses.replace(crank, phase=angle), *others]
    return dataclasses.replace(scene, mechanism=dataclasses.replace(scene.mechanism, groups=tuple(groups)))


PLAIN = chain(0.13, 0.4, 0.3, 0.45 - 0.07j)
HARD = {
    "first link a million times longer": chain(0.13, 2e5, 0.19, 2e5 + 0.05 - 0.07j),
    "second link a million times longer": chain(0.13, 0.2, 2e5, 2e5 + 0.05 - 0.07j),
    "crank a million times shorter": chain(4e-7, 0.4, 0.3, 0.45 - 0.07j),
    "first mass 1e-9 of the second": chain(0.13, 0.4, 0.3, 0.45 - 0.07j, (1e-9, 1.0)),
    "second mass 1e-9 of the first": chain(0.13, 0.4, 0.3, 0.45 - 0.07j, (1.0, 1e-9)),
    "a million lengths away": away(PLAIN, 4e5, -2e5),
    "millimetres": resized(PLAIN, 1e3),
    "RRP, crank a million times shorter": sliding("RRP", crank=4e-7),
    "RPR, crank a million times shorter": sliding("RPR", crank=4e-7),
    "RPP, guide a million lengths away": sliding("RPP", far=2e5 - 0.3j),
    "RPR, a million lengths away": away(sliding("RPR"), 4e5, -2e5),
    "gears, a million lengths away": away(geared(), 4e5, -2e5),
}
LATER = (0.0, 1.9, 3.7)  # rad, after the crank angle at which errors are checked


@pytest.mark.parametrize(
    ("name", "angle"),
    [pytest.param(n, a, marks=[pytest.mark.slow] * (a > 0 or n[:2] in ("RP", "ge"))) for n in HARD for a in LATER],
)
def test_errors_are_those_of_the_problem(name, angle):
    """Ten times the effect of half a rounding unit in every number; for positions that of the largest coordinate."""
    scene = turned(HARD[name], angle)
    found = judge(scene)
    assert {part: each.excess() for part, each in found.items() if each.excess() > 10} == {}
    largest = max(float(jnp.abs(leaf)) for leaf in jax.tree.leaves((scene.mechanism.fixed, scene.mechanism.links)))
    assert np.max(found["position"].error) <= 20 * EPS * max(1.0, largest)


@pytest.mark.slow
@pytest.mark.parametrize("angle", LATER)
@pytest.mark.parametrize("kind", ["RRP", "RPR", "RPP", "PRP"])
def test_other_groups_a_million_lengths_away(kind, angle):
    """The error of positions is that of the largest coordinate, of all else this over the shortest length."""
    found, lost = judge(turned(away(sliding(kind), 4e5, -2e5), angle)), EPS * 4e5
    assert np.max(found["position"].error) <= 10 * lost
    for part in ("coefficients", "reactions"):
        assert np.max(found[part].error) <= 10 * lost / 0.13 * np.max(found[part].size)


LONG = {
    "RRP, rod": sliding("RRP", rod=2e5),
    "RPR, lever": sliding("RPR", rod=2e5, far=2e5 - 0.3j),
    "PRP, guide": sliding("PRP", far=2e5 - 0.3j),
}


@pytest.mark.slow
@pytest.mark.parametrize("angle", LATER)
@pytest.mark.parametrize("name", LONG)
def test_sliders_with_a_part_a_million_times_longer(name, angle):
    """Errors of positions, coefficients and forces are those of the problem; a couple is a force times the difference
    of two positions, and so as accurate as the largest of them is rounded."""
    found = judge(turned(LONG[name], angle))
    assert {part: found[part].excess() for part in ("position", "coefficients") if found[part].excess() > 10} == {}
    error, condition, size = (part.reshape((-1, 3)) for part in found["reactions"])
    allowed = HALF * (condition + size)
    places = np.max(found["position"].size)
    allowed[:, 2] += HALF * places * np.max(size[:, :2])
    assert np.all(error <= 10 * allowed)


@pytest.mark.parametrize("factor", [2.0**-10, 2.0**20])
def test_powers_of_two_change_no_digit(factor):
    """The equations contain no absolute length: scaled by a power of two every result is the same, to the last bit."""
    one, two = (computed(scene, jnp.asarray(PHI))[0] for scene in (PLAIN, resized(PLAIN, factor, factor**2, 1.0)))
    pin, rates = one["position"][:2], one["coefficients"][:4]
    np.testing.assert_array_equal(two["position"][:2], factor * pin)
    np.testing.assert_array_equal(two["position"][2:], one["position"][2:])  # directions
    np.testing.assert_array_equal(two["coefficients"][:4], factor * rates)
    np.testing.assert_array_equal(two["coefficients"][4:], one["coefficients"][4:])
    np.testing.assert_array_equal(two["reactions"], factor**3 * one["reactions"])


def test_the_crossing_in_product_form():
    """If one link is a million times longer its circle is nearly a line: the difference of squares loses the digits
    that the product keeps."""
    scene = HARD["first link a million times longer"]
    got = np.asarray(computed(scene, jnp.asarray(PHI))[0]["position"][:2])
    m = scene.mechanism
    pin = 0.13 * np.exp(1j * PHI)
    far, one, two = complex(m.fixed["F"].x, m.fixed["F"].y), float(m.links["one"].length), float(m.links["two"].length)

    def crossing(number, sqrt, squares: bool):
        span = number(far) - number(pin)
        r = sqrt(span.real**2 + span.imag**2)
        a, b = number(one).real, number(two).real
        foot = (r * r + a * a - b * b) / (2 * r) if squares else (r + (a - b) * (a + b) / r) / 2
        height = a * a - foot * foot if squares else (a + b - r) * (a + b + r) * (r - a + b) * (r + a - b) / (4 * r * r)
        at = number(pin) + span / r * (foot + 1j * sqrt(height))
        return at

    with mpmath.workdps(50):
        truth = complex(crossing(mpmath.mpc, mpmath.sqrt, False))
        assert abs(complex(crossing(mpmath.mpc, mpmath.sqrt, True)) - truth) < 1e-20  # the same in exact numbers
    wrong = abs(complex(*got) - truth)
    squares = abs(complex(crossing(np.complex128, np.sqrt, True)) - truth)
    assert wrong < 10 * EPS * one
    assert squares > 1e4 * max(wrong, EPS * one)


def test_what_a_result_far_away_is_worth():
    """A million lengths from the origin six digits vanish, and no more; the machine itself is the same."""
    here, there = (computed(scene, jnp.asarray(PHI))[0] for scene in (PLAIN, HARD["a million lengths away"]))
    shift = np.asarray([4e5, -2e5])
    assert np.max(np.abs(there["position"][:2] - shift - here["position"][:2])) < 10 * EPS * 4e5
    for part in ("coefficients", "reactions"):
        size = np.max(np.abs(here[part]))
        assert 1e-13 < np.max(np.abs(there[part] - here[part])) / size < 1e-8


def test_leaves_are_what_is_said():
    """The ratios of the machines above are as their names say."""
    lengths = [float(link.length) for link in HARD["first link a million times longer"].mechanism.links.values()]
    masses = [float(link.mass) for link in HARD["first mass 1e-9 of the second"].mechanism.links.values()]
    assert max(lengths) / min(lengths) > 1e6 and max(masses) / min(masses) > 0.99e9
    assert eqx.tree_equal(jax.tree.structure(PLAIN), jax.tree.structure(HARD["millimetres"]))
