"""Machines with a zero: masses, inertias, ground links, offsets; points that coincide or are in line."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import RRP, RRR, Crank, Flywheel, Guide, Link, Mechanism, Vec
from linkjax.groups import General
from linkjax.kinematics import min_margin, pose
from tests.physics import oracle
from tests.physics.near_dead import PHI, Judged, judge

NOTHING = Link()


def body(length: float, mass: float = 1.0, inertia: float = 0.01, centre: tuple[float, float] = (0.1, 0.02)) -> Link:
    return Link(length=length, mass=mass, inertia=inertia, centre=Vec(*centre))


def chain(*, frame: complex = 0.45 - 0.07j, one: Link | None = None, two: Link | None = None) -> lj.Scene:
    links = {"crank": body(0.13), "one": one or body(0.4), "two": two or body(0.3)}
    groups = [Crank("crank", "A", "B"), RRR(("one", "two"), "B", "F", "G", 1)]
    fixed = {"A": Vec(0.0, 0.0), "F": Vec(frame.real, frame.imag)}
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.1)), gravity=Vec(0.5, -9.81))


def crank_slider(phase: float = 0.0, guide: Guide | None = None) -> lj.Scene:
    links = {"crank": body(0.13), "one": body(0.4), "two": body(0.0)}
    groups = [Crank("crank", "A", "B", phase=phase), RRP("one", "two", "B", "D", guide or Guide("A"))]
    return lj.Scene(Mechanism({"A": Vec(0.0, 0.0)}, links, groups, Flywheel(0.1)), gravity=Vec(0.5, -9.81))


def second_dyad(at: Vec) -> lj.Scene:
    """A dyad on a point E of the coupler."""
    scene = chain(one=dataclasses.replace(body(0.4), points={"E": at}))
    links = {**scene.mechanism.links, "arm": body(0.3), "lever": body(0.25)}
    groups = [*scene.mechanism.groups, RRR(("arm", "lever"), "E", "H", "K", 1)]
    fixed = {**scene.mechanism.fixed, "H": Vec(0.5, 0.5)}
    return dataclasses.replace(scene, mechanism=Mechanism(fixed, links, groups, Flywheel(0.1)))


DEGENERATE = {
    "no mass": chain(one=body(0.4, 0.0, 0.0), two=body(0.3, 0.0, 0.0)),
    "no inertia": chain(one=body(0.4, 1.3, 0.0), two=body(0.3, 0.8, 0.0)),
    "no mass but inertia": chain(one=body(0.4, 0.0, 0.02)),
    "mass centres on the pins": chain(one=body(0.4, centre=(0.4, 0.0)), two=body(0.3, centre=(0.0, 0.0))),
    "mass centres in line": chain(one=body(0.4, centre=(0.1, 0.0)), two=body(0.3, centre=(-0.1, 0.0))),
    "links of the same length": chain(one=body(0.3), two=body(0.3)),
    "no offset": crank_slider(),
    "no ground": chain(frame=0j, one=body(0.3), two=body(0.2)),
    "points that coincide": second_dyad(Vec(0.4, 0.0)),
    "three pins in line": second_dyad(Vec(0.2, 0.0)),
    "guide along crank and rod": crank_slider(-PHI),
    "guide on the crank, along it": crank_slider(guide=Guide("B", on="crank")),
}


def judged(name: str) -> dict[str, Judged]:
    """With zero ground nothing moves relative to the crank: zero values are compared with the largest of their kind."""
    found = judge(DEGENERATE[name])
    if name != "no ground":
        return found
    return {part: each._replace(size=np.full_like(each.size, np.max(each.size))) for part, each in found.items()}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (i > 6)) for i, n in enumerate(DEGENERATE)]
)
def test_against_160_digits(name):
    """Positions, rates, reactions, and derivatives with respect to every number, including zeros."""
    assert {part: each.excess() for part, each in judged(name).items() if each.excess() > 10} == {}


def at(mechanism: Mechanism, phi) -> lj.kinematics.Pose:
    return jax.device_get(jax.vmap(lambda one: pose(mechanism, one))(jnp.atleast_1d(jnp.asarray(phi, dtype=float))))


def test_a_ground_of_length_zero_turns_as_one_body():
    """The dyad closes a triangle with the crank: nothing moves in it."""
    here = at(chain(frame=0j, one=body(0.3), two=body(0.2)).mechanism, np.linspace(0.0, 6.0, 7))
    for link in here.links.values():
        np.testing.assert_allclose(link.w, 1.0, atol=1e-15)
        np.testing.assert_allclose(link.e, 0.0, atol=1e-14)


def test_a_guide_along_the_rod():
    """In the dead centres of an in-line slider the rod is on the guide: x″ = -r (cos φ + r / l), ω′ = -r cos φ / l."""
    here = at(DEGENERATE["no offset"].mechanism, [0.0, math.pi])
    r, length, cosine = 0.13, 0.4, np.asarray([1.0, -1.0])
    np.testing.assert_allclose(here.points["D"].r.x, r * cosine + length, rtol=1e-15)
    np.testing.assert_allclose(here.points["D"].dr.x, 0.0, atol=1e-16)
    np.testing.assert_allclose(here.points["D"].ddr.x, -r * (cosine + r / length), rtol=1e-15)
    np.testing.assert_allclose(here.links["one"].w, -r * cosine / length, rtol=1e-15)
    np.testing.assert_allclose(here.links["one"].e, 0.0, atol=1e-16)


@pytest.mark.slow
def test_a_guide_along_the_rod_all_the_way():
    """A guide on the crank through the pin of the rod: the rod always stays along it, and turns with the crank."""
    links = {"crank": body(0.13), "rod": body(0.4), "block": NOTHING}
    groups = [Crank("crank", "A", "B"), RRP("rod", "block", "B", "D", Guide("B", 0.7, on="crank"))]
    phi = np.linspace(0.0, 6.0, 7)
    here = at(Mechanism({"A": Vec(0.0, 0.0)}, links, groups), phi)
    np.testing.assert_allclose(here.links["rod"].w, 1.0, atol=1e-15)
    np.testing.assert_allclose(here.links["rod"].e, 0.0, atol=1e-15)
    exact = (0.13 + 0.4 * np.exp(0.7j)) * np.exp(1j * phi)
    np.testing.assert_allclose(here.points["D"].r.x + 1j * here.points["D"].r.y, exact, atol=1e-15)
    np.testing.assert_allclose(here.points["D"].ddr.x + 1j * here.points["D"].ddr.y, -exact, atol=1e-15)


@pytest.mark.slow
def test_points_that_coincide():
    """An additional point on a pin moves as the pin does; a dyad may be attached to either."""
    mark = dataclasses.replace(body(0.4), points={"E": Vec(0.4, 0.0), "O": Vec(0.0, 0.0)})
    scene = chain(one=mark)
    links = {**scene.mechanism.links, "arm": body(0.3), "lever": body(0.25)}
    fixed = {**scene.mechanism.fixed, "H": Vec(0.5, 0.5), "A2": Vec(0.0, 0.0)}
    states = []
    for pin in ("E", "G"):  # an additional point, and the pin itself
        groups = [*scene.mechanism.groups, RRR(("arm", "lever"), pin, "H", "K", 1)]
        states.append(at(Mechanism(fixed, links, groups), [0.3, 2.0, 4.0]))
    one, two = states
    for a, b in (
        (one.points["E"], one.points["G"]),
        (one.points["O"], one.points["B"]),
        (one.points["K"], two.points["K"]),
    ):
        for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
            np.testing.assert_allclose(x, y, atol=2e-15 * max(1.0, np.max(np.abs(y))))


@pytest.mark.slow
def test_a_plate_with_three_pins_in_line():
    """A triad whose plate is a bar, against SciPy."""
    links = {
        "crank": body(0.045), "plate": dataclasses.replace(body(0.25), points={"G": Vec(0.12, 0.0)}),
        "bar1": body(0.3), "bar2": body(0.32), "bar3": body(0.33),
    }  # fmt: skip
    triad = General(
        (("plate", ("E", "F", "G")), ("bar1", ("B", "E")), ("bar2", ("C", "F")), ("bar3", ("D", "G"))),
        ("B", "C", "D"), {"E": Vec(0.15, 0.28), "F": Vec(0.4, 0.25), "G": Vec(0.27, 0.27)},
    )  # fmt: skip
    fixed = {"A": Vec(0.0, 0.0), "C": Vec(0.55, -0.05), "D": Vec(0.6, 0.3)}
    mechanism = Mechanism(fixed, links, [Crank("crank", "A", "B"), triad])
    phi = np.asarray([0.4, 2.2, 4.9])
    assert float(min_margin(mechanism)) > 0.01
    here, truth = at(mechanism, phi), oracle.rates(mechanism, phi)
    for p in "EFG":
        for part, exact in zip(here.points[p], truth.points[p], strict=True):
            np.testing.assert_allclose(part.x + 1j * part.y, exact, atol=1e-12)
