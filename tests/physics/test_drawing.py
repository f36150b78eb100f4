"""Machines as drawn: the data of the sketch, and their consequences in the true position."""

from __future__ import annotations

import cmath
import dataclasses
import itertools
import math
import re

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import RRR, Mechanism, Vec
from linkjax._compile import compiled_soon
from linkjax.groups import Crank, Drive, General, Guide, Slot
from linkjax.kinematics import (
    AssemblyModes,
    assembly_modes,
    dead_centres,
    margins,
    open_at_start,
    pose,
    prepared,
    strokes,
)
from linkjax.mechanism import Link, StructureError, linkage
from linkjax.scenes import loads_text, text_of


def places(mechanism, names, phi=0.0) -> dict[str, complex]:
    """Positions of points."""
    at = pose(mechanism, jnp.asarray(phi)).points
    return {name: complex(at[name].r.x, at[name].r.y) for name in names}


def xy(at: complex) -> tuple[float, float]:
    return at.real, at.imag


LEAN = cmath.exp(0.6j)
SPOTS = {"B": 0.1 * cmath.exp(1.1j), "E": 0.07 * cmath.exp(-0.8j), "C": LEAN * (0.35 + 0.03j), "G": 0.3 - 0.25j,
         "F": -0.2 + 0.5j}  # fmt: skip


ORDERS = list(zip(itertools.permutations("ABE"), [0.12, -0.12, 0.12j] * 2, strict=True))


@pytest.mark.parametrize(("pins", "on_ram"), ORDERS)
def test_without_any_length_it_stands_as_sketched(pins, on_ram):
    """Every sketch with blocks on their guides is a machine: a crank with three pins, in any order, and a ram with
    additional pins ahead of the first, behind or beside it."""
    spots = {**SPOTS, "D": SPOTS["C"] + LEAN * on_ram, "X": SPOTS["C"] - LEAN * (0.05 + 0.02j)}
    fixed = {"A": 0j, "H": 0.5 - 0.1j, "J": -0.4 + 0.5j}
    links = {name: Link(pins=tuple(own)) for name, own in {
        "crank": pins, "rod": "BC", "ram": "CDX", "arm": "DF", "shoe": "F", "bar": "EG", "lever": "HG"}.items()
    }  # fmt: skip
    slots = [Slot("ram", Guide("A", 0.6, 0.03)), Slot("shoe", Guide("J"))]
    at = {**spots, **fixed}
    phase = cmath.phase(at[pins[1]] - at[pins[0]])
    made = linkage({p: xy(z) for p, z in fixed.items()}, links, Drive("crank", phase=phase), slots,
                   {p: xy(z) for p, z in spots.items()})  # fmt: skip
    assert isinstance(made.driver, Crank)
    for name, there in places(made, spots).items():
        assert there == pytest.approx(spots[name], abs=1e-15)


def test_a_crank_has_the_shape_that_is_sketched():
    """If the phase differs slightly from the sketch, the crank is turned, not deformed; for another phase the machine
    is refused."""
    links = {"crank": Link(pins=("A", "B", "E")), "coupler": Link(pins=("B", "C")), "rocker": Link(pins=("D", "C")),
             "rod": Link(pins=("E", "G")), "lever": Link(pins=("D", "G"))}  # fmt: skip
    sketch = {"B": (0.0, 0.1), "E": (-0.1, 0.0), "C": (0.3, 0.25), "G": (0.3, -0.25)}
    for length in (0.0, 0.1):
        given = links | {"crank": dataclasses.replace(links["crank"], length=length)}

        def made(phase, given=given):
            return linkage({"A": (0, 0), "D": (0.4, 0)}, given, Drive("crank", phase=phase), sketch=sketch)

        off = 1e-3
        turned = 0.1j * cmath.exp(1j * off)
        assert places(made(math.pi / 2 + off), "BE") == pytest.approx({"B": turned, "E": 1j * turned}, abs=1e-16)
        with pytest.raises(StructureError, match=r"drive\.phase: is 0 deg, but 'crank' is drawn at 90 deg; delete it "):
            made(0.0)


def test_pins_of_a_link_whose_second_pin_is_a_marked_point():
    """A third pin is at its position in the sketch, even if the axis of the link does not run through the second."""
    links = {"crank": Link(pins=("A", "B"), length=0.1), "rocker": Link(pins=("D", "C"), length=0.25),
             "coupler": Link(pins=("B", "C", "E"), points={"C": lj.Vec(0.2, 0.2)}),
             "arm": Link(pins=("E", "F")), "lever": Link(pins=("D", "F"))}  # fmt: skip
    sketch = {"B": (0.1, 0.0), "C": (0.3, 0.2), "E": (0.1, 0.3), "F": (0.5, 0.3)}
    made = linkage({"A": (0, 0), "D": (0.45, 0)}, links, Drive("crank"), sketch=sketch)
    at = made.links["coupler"].points["E"]
    assert (float(at.x), float(at.y)) == pytest.approx((0.0, 0.3), abs=1e-16)  # its axis lies along x in the sketch


@pytest.mark.slow
def test_sides_are_those_of_the_true_places():
    """A pin sketched far off its position does not reverse the dyad attached to it."""
    links = {"crank": Link(pins=("A", "B"), length=0.1), "coupler": Link(pins=("B", "E", "C"), length=0.15,
             points={"C": lj.Vec(0.35, 0.0)}), "rocker": Link(pins=("D", "C"), length=0.25),
             "arm": Link(pins=("E", "G"), length=0.3), "lever": Link(pins=("D", "G"), length=0.3)}  # fmt: skip

    def made(drive, **sketch):
        near = {"B": (0.1, 0.0), "C": (0.36, 0.25), "G": (0.4, 0.15), **sketch}
        return linkage({"A": (0, 0), "D": (0.38, 0)}, links, drive, sketch=near)

    exact = made(Drive("crank"), E=(0.2, 0.1))
    here = pose(exact, jnp.zeros(()))
    turned = math.atan2(*(float(v) for v in (here.links["coupler"].u.y, here.links["coupler"].u.x)))
    for drive in (Drive("crank"), Drive("coupler", "crank", phase=turned)):
        rough = made(drive, E=(0.44, 0.1))
        assert places(rough, "EG") == pytest.approx(places(exact, "EG"), abs=1e-12)


@pytest.mark.parametrize(
    "drive",
    [Drive("crank"), pytest.param(Drive("coupler", "crank", phase=0.9), marks=pytest.mark.slow)],
    ids=["dyad", "general"],
)
@pytest.mark.parametrize("far", [lj.Vec(0.3, 0.0), lj.Vec(0.28, 0.1)])
def test_a_second_pin_that_is_a_marked_point(drive, far):
    """It is at the given point, for any length: the machine whose coupler has that distance as its length. Its mass
    centre is in the axes of the link, not of the line between the pins."""
    reach = math.hypot(float(far.x), float(far.y))
    lean = math.atan2(float(far.y), float(far.x))
    plain = {"crank": Link(pins=("A", "B"), length=0.1), "rocker": Link(pins=("D", "C"), length=0.25),
             "coupler": Link(pins=("B", "C"), length=reach, centre=Vec(0.13, 0.05))}  # fmt: skip
    centre = Vec(0.13, 0.05).turned(Vec(math.cos(lean), math.sin(lean)))
    for length in (0.0, 0.35):
        marked = plain | {"coupler": Link(pins=("B", "C"), length=length, points={"C": far}, centre=centre)}
        turned = drive if drive.link == "crank" else dataclasses.replace(drive, phase=drive.phase - lean)
        one, two = (
            linkage({"A": (0, 0), "D": (0.38, 0)}, links, how, sketch={"B": (0.1, 0.0), "C": (0.3, 0.25)})
            for links, how in ((plain, drive), (marked, turned))
        )
        assert places(two, ("B", "C", "S3")) == pytest.approx(places(one, ("B", "C", "S3")), abs=1e-12)


def test_a_crank_held_anywhere_is_a_crank():
    """With its frame pin third, or its far pin an additional point, it takes a flywheel, is written and read again."""
    rest = {"coupler": Link(pins=("B", "C"), length=0.35), "rocker": Link(pins=("D", "C"), length=0.25)}
    fixed, sketch = {"A": (0.0, 0.0), "D": (0.38, 0.0)}, {"C": (0.36, 0.25)}
    usual = linkage(fixed, {"crank": Link(pins=("A", "B"), length=0.1, mass=1.0)} | rest, Drive("crank"), (), sketch)
    turned = cmath.exp(0.4j)
    for crank, phase in [
        (Link(pins=("B", "X", "A"), length=0.02, points={"A": lj.Vec(0.1, 0.0)}, mass=1.0), math.pi),
        (Link(pins=("A", "B"), points={"B": lj.Vec(0.1 * turned.real, 0.1 * turned.imag)}, mass=1.0), -0.4),
    ]:
        made = linkage(fixed, {"crank": crank} | rest, Drive("crank", phase=phase), (), sketch, lj.Flywheel(2.0))
        assert made.formula() == usual.formula()
        scene = lj.Scene(made, speed=3.0)
        again = loads_text(text_of(scene)).mechanism
        for phi in (0.0, 1.3):
            assert places(made, "BC", phi) == pytest.approx(places(usual, "BC", phi), abs=1e-15)
            assert places(again, "BC", phi) == pytest.approx(places(usual, "BC", phi), abs=1e-15)


@pytest.mark.slow
def test_a_drive_half_a_turn_off():
    """Between a block and a link, and in a group of higher class that is not drawn: reported, not closed otherwise."""
    links = {"crank": Link(pins=("A", "B"), length=0.1), "die": Link(pins=("B",)),
             "lever": Link(pins=("P", "E"), length=0.4)}  # fmt: skip
    given = {"fixed": {"A": (0, 0), "P": (-0.2, 0)}, "links": links, "slots": [Slot("die", Guide("P", on="lever"))],
             "sketch": {"B": (0.07, 0.07), "E": (0.15, 0.1)}}  # fmt: skip
    stands = math.atan2(0.07, 0.27) - math.pi / 4
    made = linkage(drive=Drive("die", "crank", phase=stands), **given)
    with pytest.raises(StructureError, match=r"drive\.phase: is 149\..* deg, but 'die' is drawn at -29.*to 'crank'"):
        linkage(drive=Drive("die", "crank", phase=stands + math.pi), **given)
    group = made.groups[0]
    assert isinstance(group, General)

    def margin(phase):
        drive = Drive("die", "crank", phase=phase)
        other = lj.Mechanism(made.fixed, made.links, [dataclasses.replace(group, drive=drive)])
        found = compiled_soon(lambda m: margins(prepared(m), jnp.zeros(())))(other)
        return float(found["crank-die-lever"]["loops"].value)

    assert margin(stands) > 0.05
    assert margin(stands + math.pi) == -1.0


FIVE = {"a": Link(pins=("A", "B"), length=0.1), "b": Link(pins=("A", "E"), length=0.15),
        "c": Link(pins=("B", "C"), length=0.3), "d": Link(pins=("D", "C"), length=0.25),
        "e": Link(pins=("C", "E"), length=0.3)}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("driver", "against"),
    [("a", "b"), pytest.param("e", "d", marks=pytest.mark.slow)],
    ids=["on one shaft", "of three at a pin"],
)
def test_links_at_one_pin_driven_against_each_other(driver, against):
    """Two on one shaft of the frame, two of three at a pin: the machine that a crank drives, at another rate."""

    def made(drive):
        sketch = {"B": (0.0, 0.1), "E": (0.14, -0.04), "C": (0.26, 0.2)}
        return linkage({"A": (0, 0), "D": (0.3, 0)}, FIVE, drive, sketch=sketch)

    usual = made(Drive("a", phase=math.pi / 2))
    here = pose(usual, jnp.zeros(())).links
    start = [math.atan2(float(here[name].u.y), float(here[name].u.x)) for name in (driver, against)]
    other = made(Drive(driver, against, phase=start[0] - start[1]))
    assert other.formula() == ("I1+II1(a, b, c, d, e)" if driver == "a" else "I1+III3(a, b, c, d, e)")
    there = pose(other, jnp.zeros(())).links
    pace = float(here[driver].w - here[against].w)
    for name in FIVE:
        assert (float(there[name].u.x), float(there[name].u.y)) == pytest.approx(
            (float(here[name].u.x), float(here[name].u.y)), abs=1e-14
        )
        assert float(there[name].w) == pytest.approx(float(here[name].w) / pace, rel=1e-12)


def test_a_truss_on_the_frame():
    """Rigid links may be drawn, also before the crank: links attached to them are attached to a point of the frame."""
    truss = {"one": Link(pins=("D", "H")), "two": Link(pins=("G", "H"))}
    bars = {"crank": Link(pins=("A", "B"), length=0.1), "coupler": Link(pins=("B", "C"), length=0.35),
            "rocker": Link(pins=("H", "C"), length=0.25)}  # fmt: skip
    fixed, sketch = {"A": (0, 0), "D": (0.4, 0), "G": (0.6, 0)}, {"H": (0.5, 0.1), "C": (0.36, 0.25)}
    made = linkage(fixed, truss | bars, Drive("crank"), sketch=sketch)
    assert made.formula() == "I1(crank) → II1(coupler, rocker); II1(one, two)"
    plain = linkage({"A": (0, 0), "H": (0.5, 0.1)}, bars, Drive("crank"), sketch={"C": sketch["C"]})
    assert places(made, "HBC", 0.7) == pytest.approx(places(plain, "HBC", 0.7), abs=1e-15)
    on_top = truss | {"crank": Link(pins=("H", "B"), length=0.1)}
    with pytest.raises(
        StructureError,
        match=r"drive: moves 'crank' relative to 'two', but one, two cannot move relative to the frame; delete these",
    ):
        linkage(fixed, on_top, Drive("crank", "two"), sketch={"H": (0.5, 0.1)})


CYLINDER = {"boom": Link(pins=("A", "B"), length=0.3), "barrel": Link(pins=("P", "H"), length=0.15),
            "rod": Link(pins=("B",))}  # fmt: skip


@pytest.mark.slow
def test_a_cylinder_named_the_other_way_round():
    """Its barrel on its rod is equivalent to its rod on its barrel."""
    law, slots = lj.Harmonic(0.34, 0.37), [Slot("rod", Guide("P", on="barrel"))]
    given = {"A": (0, 0), "P": (0.4, 0)}, CYLINDER
    one, two = (
        linkage(*given, drive, slots, {"B": (0.15, 0.25), "H": (0.33, 0.08)})
        for drive in (Drive("rod", "barrel", law=law), Drive("barrel", "rod", law=law))
    )
    assert two == one
    text = text_of(lj.Scene(one, speed=1.0))
    turned = text.replace('link = "rod"', 'link = "barrel"').replace('on = "barrel"', 'on = "rod"', 1)
    assert text.index("[drive]") < text.index('on = "barrel"') < text.index("[[slots]]") and turned != text
    assert loads_text(turned).mechanism.driving_link == "rod"


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"links": {"frame": Link(pins=("A", "B"), length=0.1)}}, r"links\.frame: the name is reserved for the frame"),
        ({"links": {"boom": Link(pins=("A", "B"), length=jnp.asarray([0.3, 0.4]))}},
         r"links\.boom: has numbers that are traced or batched; build the mechanism with plain numbers, then"),
        ({"drive": Drive("rod", "barrel", law=lj.Harmonic(jnp.ones(2), 0.2))}, "drive: has numbers that are traced or"),
        ({"slots": [Slot("rod", Guide("P", jnp.ones(2), on="barrel"))]}, "slot of rod: has numbers that are traced or"),
        ({"slots": [Slot("rod", Guide("P", on="barrel")), Slot("barrel", Guide("B", on="rod"))]},
         "slot of rod: slides along 'barrel', which itself slides along 'rod'"),
        ({"links": {"rod": Link(pins=("B",), mass_properties="section", area=1.0, density=1.0)}},
         r"links\.rod: mass_properties 'section' needs a length, but this block has none"),
        ({"fixed": {"A": (0, 0, 0), "P": (0.4, 0)}}, r"fixed\.A: must be x and y, but is \(0, 0, 0\)"),
        ({"drive": Drive("boom", "boom")}, "drive: moves 'boom' relative to 'boom'; name a link, and what it moves"),
        ({"drive": Drive("frame", "boom")}, "drive: moves 'frame' relative to 'boom'; name a link, and what it moves"),
    ],
)  # fmt: skip
def test_what_no_drawing_can_hold(given, told):
    usual = {
        "fixed": {"A": (0, 0), "P": (0.4, 0)},
        "drive": Drive("rod", "barrel", law=lj.Harmonic(0.3, 0.33)),
        "slots": [Slot("rod", Guide("P", on="barrel"))],
        "sketch": {"B": (0.15, 0.25), "H": (0.33, 0.08)},
    }
    links = CYLINDER | given.pop("links", {})
    with pytest.raises(StructureError, match=told):
        linkage(links=links, **{**usual, **given})


@pytest.mark.slow
def test_dead_centres_where_two_links_are_driven_against_each_other():
    """A slider stops where crank and rod are in line; its stroke is twice the crank."""
    links = {"crank": Link(pins=("A", "B"), length=0.1), "rod": Link(pins=("B", "C"), length=0.3),
             "ram": Link(pins=("C",))}  # fmt: skip
    sketch = {"B": (0.07, 0.07), "C": (0.36, 0.0)}
    made = linkage({"A": (0, 0)}, links, Drive("crank", "rod", phase=1.0), [Slot("ram", Guide("A"))], sketch)
    found, covered = compiled_soon(lambda m: (dead := dead_centres(m), strokes(m, dead)))(made)
    stops = np.sort(np.asarray(found["C"].angle[found["C"].true]) % (2 * math.pi))
    assert stops == pytest.approx([math.pi - 1.0, 2 * math.pi - 1.0], abs=1e-12)
    assert float(covered["C"]) == pytest.approx(0.2, abs=1e-14)
    assert not np.any(found["crank"].true)


def triad(base, plate) -> AssemblyModes:
    """The assembly modes of a plate on three legs, given their positions in one of them."""
    at = dict(zip("BCDEFG", (*base, *plate), strict=True))
    links = {"crank": Link(pins=("A", "B"), length=0.3), "plate": Link(pins=("E", "F", "G")),
             "leg1": Link(pins=("B", "E")), "leg2": Link(pins=("C", "F")), "leg3": Link(pins=("D", "G"))}  # fmt: skip
    fixed = {"A": xy(at["B"] - 0.3), "C": xy(at["C"]), "D": xy(at["D"])}
    made = linkage(fixed, links, Drive("crank"), sketch={p: xy(at[p]) for p in "BEFG"})
    return assembly_modes(made)["plate-leg1-leg2-leg3"]


def test_a_triad_that_can_move_by_itself():
    """Equal legs, parallel as drawn, on a plate like its base: it moves along circles, so no list of modes is complete;
    the message says this, and not that there is no mode."""
    base = 0j, 1 + 0j, 2 + 0j
    found = triad(base, [z + 0.3 + 0.5j for z in base])
    assert found.moves and not found.all_found
    assert str(found).endswith("; the group has positions in which it can move with the crank fixed")
    assert len(found.sketches) <= 6


def test_a_triad_whose_circles_share_a_line():
    """Legs on one line and all pins of a plate on one line: every mode has its mirror image, and all are found."""
    found = triad((0j, 1 + 0j, 2.2 + 0j), (0.3 + 0.5j, 1.0 + 0.5j, 1.9 + 0.5j))
    ways = [np.array([complex(s[p].x, s[p].y) for p in "EFG"]) for s in found.sketches]
    assert found.all_found and not found.moves and len(ways) in (2, 4, 6)
    for way in ways:
        assert sum(np.abs(way - other.conj()).max() < 1e-9 for other in ways) == 1
        assert np.abs(way - way.conj()).max() > 0.1


@pytest.mark.parametrize(("unit", "told"), [
    (1000.0, "sketch: does not fit the lengths: from 'B' to 'C' of 'coupler' it is 1000 times as large as the link"),
    (0.001, "sketch: does not fit the lengths: from 'B' to 'C' of 'coupler' it is 1000 times as small as the link"),
])  # fmt: skip
def test_a_sketch_in_another_unit(unit, told):
    """Reported with the factor, whichever of the two is wrong; a rough sketch of twice or half the size is accepted."""
    links = {"crank": Link(pins=("A", "B"), length=0.1), "coupler": Link(pins=("B", "C"), length=0.3),
             "rocker": Link(pins=("D", "C"), length=0.25)}  # fmt: skip

    def made(scale):
        sketch = {"B": (0.1 * scale, 0.0), "C": (0.28 * scale, 0.24 * scale)}
        return linkage({"A": (0, 0), "D": (0.38, 0)}, links, Drive("crank"), sketch=sketch)

    with pytest.raises(StructureError, match=told):
        made(unit)
    assert places(made(2.0), "C") == pytest.approx(places(made(0.5), "C"), abs=1e-15)


def press(
    crank: float = 0.1, coupler: float = 0.3, rocker: float = 0.25, E: tuple = (0.2, -0.1), drawn: dict | None = None
):
    """A four-bar whose rocker is a plate that pulls a ram, with rough positions of its pins."""
    links = {"crank": Link(pins=("A", "B"), length=crank), "coupler": Link(pins=("B", "C"), length=coupler),
             "rocker": Link(pins=("D", "C", "E"), length=rocker, points={"E": Vec(*E)}),
             "rod": Link(pins=("E", "U"), length=0.5), "ram": Link(pins=("U",))}  # fmt: skip
    sketch = {"C": (0.28, 0.24), "E": (0.4, 0.22), "U": (0.9, 0.2)} | (drawn or {})
    fixed = {"A": (0.0, 0.0), "D": (0.38, 0.0), "T": (0.0, 0.2)}
    return linkage(fixed, links, Drive("crank"), [Slot("ram", Guide("T"))], sketch=sketch)


@pytest.mark.parametrize(("given", "told"), [
    ({"rocker": 25.0}, "links.rocker.length: is 25 m from 'D' to 'C', but 0.26 m in the sketch; "
     'write the intended length, e.g. length = "260 mm", or correct the sketch'),
    ({"coupler": 0.03}, "links.coupler.length: is 0.03 m from 'B' to 'C', but 'crank' is placed so that 'B' is "
     "0.3 m from the sketched point 'C'; write the intended length, "),
    ({"crank": 0.02, "coupler": 0.02}, "links.coupler.length: is 0.02 m from 'B' to 'C', but 'crank' is placed so that "
     "'B' is 0.3538 m from the sketched point 'C'; write the intended length, "),
    ({"crank": 100.0}, "links.crank.length: is 100 m, so that 'B' is 99.72 m from the sketched point 'C', but "
     """'coupler' spans 0.3 m; write the intended unit, e.g. length = "100 mm\""""),
    ({"E": (2.0, -1.0)}, "links.rocker.points.E: makes the distance from 'C' to 'E' 2.016 m, but 0.1217 m in the"),
    ({"drawn": {"E": (0.2, 0.05)}}, "sketch.E: is to the left of the line from 'D' to 'C', but 'rocker' has it on "
     "the other side; change the sign of its `across` on the link, or sketch it near (0.396, 0.232) m"),
])  # fmt: skip
def test_a_sketch_that_disagrees_with_one_link(given, told):
    press()  # rough positions are accepted, also of two points that are near each other
    press(E=(0.25, 0.01), drawn={"E": (0.33, 0.25)})
    with pytest.raises(StructureError) as caught:
        press(**given)
    assert str(caught.value).startswith(told)


def test_a_crank_in_another_unit_that_nothing_reaches():
    """Its pin runs in a slot: only its size is unusual."""
    links = {
        "crank": Link(pins=("O", "B"), length=100.0),
        "lever": Link(pins=("P", "E"), length=0.3),
        "die": Link(pins=("B",)),
    }
    with pytest.raises(
        StructureError, match=r"links\.crank\.length: is 100 m, but the rest of the drawing is only 0\.34 m across"
    ):
        linkage({"O": (0, 0), "P": (0, -0.04)}, links, Drive("crank"), [Slot("die", Guide("P", on="lever"))],
                sketch={"E": (0.0, 0.3)})  # fmt: skip


def test_rough_sketches_and_odd_machines_pass():
    """Two pins of a plate near each other, a yoke beside its crank pivot, a long slider motion: none is refused;
    a law that demands an unreachable position is reported for the drive."""
    links = {"crank": Link(pins=("A", "B"), length=0.1), "rod": Link(pins=("B", "C"), length=0.3),
             "bell": Link(pins=("D", "E", "C"), length=0.006, points={"C": Vec(0.0, 0.25)}),
             "pull": Link(pins=("E", "U"), length=0.3), "ram": Link(pins=("U",))}  # fmt: skip
    linkage({"A": (0, 0), "D": (0.38, 0), "T": (0, 0)}, links, Drive("crank"), [Slot("ram", Guide("T"))],
            sketch={"C": (0.3, 0.24), "E": (0.374, 0.001), "U": (0.68, 0.0)})  # fmt: skip
    links = {"crank": Link(pins=("O", "B"), length=0.5), "die": Link(pins=("B",)), "yoke": Link(pins=("V",))}
    slots = [Slot("yoke", Guide("T")), Slot("die", Guide("V", math.pi / 2, on="yoke"))]
    linkage({"O": (0, 0), "T": (0.02, 0)}, links, Drive("crank"), slots, sketch={"V": (0.01, 0.0)})
    links = {
        "ram": Link(pins=("U",)),
        "rod": Link(pins=("U", "C"), length=0.5),
        "arm": Link(pins=("D", "C"), length=0.3),
    }
    with pytest.raises(
        StructureError, match=r"drive: places 'ram' so that 'U' is .* from the sketched point 'C', but 'rod' spans"
    ):
        linkage({"T": (0, 0), "D": (0.3, 0)}, links, Drive("ram", law=lj.Harmonic(100.0, 101.0)),
                [Slot("ram", Guide("T"))], sketch={"C": (0.3, 0.3)})  # fmt: skip


def test_a_change_point_at_the_start_is_not_open():
    """A parallelogram in line with its frame: its margin is zero except for rounding."""
    for arm, span, lean in ((0.3, 0.7, 0.3), (0.39, 1.164, 1.931), (0.615, 0.709, 2.350)):
        at = cmath.rect(span, lean)
        links = {"crank": Link(length=arm), "coupler": Link(length=span), "rocker": Link(length=arm)}
        groups = [Crank("crank", "A", "B", phase=lean), RRR(("coupler", "rocker"), "B", "D", "C")]
        assert open_at_start(Mechanism({"A": Vec(0.0, 0.0), "D": Vec(*xy(at))}, links, groups)) == ""


def test_pins_that_nothing_else_names():
    """Too many degrees of freedom: the pin that is missing elsewhere is reported."""
    links = {"crank": Link(pins=("A", "B"), length=0.1), "coupler": Link(pins=("B", "C"), length=0.3),
             "rocker": Link(pins=("D", "K"), length=0.25)}  # fmt: skip
    told = r"coupler, rocker can still move .*; pins of one link only: 'C' of 'coupler', 'K' of 'rocker'; add a binary"
    with pytest.raises(StructureError, match=told):
        linkage({"A": (0, 0), "D": (0.38, 0)}, links, Drive("crank"), sketch={"C": (0.28, 0.24)})


def test_what_cannot_be_assembled_is_told_in_lengths():
    """At crank angle zero, already by `structure`."""
    assert open_at_start(press()) == ""
    said = open_at_start(press(coupler=0.065, rocker=0.06, E=(0.1, -0.1)))
    told = (
        "'coupler-rocker' cannot be assembled at crank angle zero (stretched): its pins 'B' and 'D' are 0.28 m apart, "
    )
    assert said == f"{told}and 'coupler' (0.065 m) and 'rocker' (0.06 m) do not reach that far"
    said = open_at_start(press(E=(0.3, -1.2), drawn={"E": (1.3, 0.8), "U": (1.5, 0.2)}))
    told = r"its pin 'E' is [\d.]+ m off the path of 'U', and 'rod' \(0.5 m\) does not reach that far"
    assert re.fullmatch(rf"'rod-ram' cannot be .* \((left|right)\): {told}", said)


@pytest.mark.slow
def test_a_machine_whose_numbers_changed_since_it_was_sketched():
    """Written, it is sketched in its present position, where its own sketch would be refused."""
    scene = lj.load("elliptic-trammel")
    group = scene.mechanism.groups[0]
    assert isinstance(group, General) and group.drive is not None
    moved = dataclasses.replace(group, drive=dataclasses.replace(group.drive, phase=math.radians(160.0)))
    other = scene.with_mechanism(Mechanism(scene.mechanism.fixed, scene.mechanism.links, [moved]))
    text = text_of(other)
    with pytest.raises(ValueError, match=r"drive\.phase"):
        loads_text(text[: text.index("[sketch]")] + text_of(scene)[text_of(scene).index("[sketch]") :])
    names = ("X", "Y", "Q")
    assert places(loads_text(text).mechanism, names) == pytest.approx(places(other.mechanism, names), abs=1e-15)
    assert places(other.mechanism, "Y")["Y"] == pytest.approx(0.3j * math.sin(math.radians(160.0)), abs=1e-12)


def test_a_mass_belongs_to_the_reference_length_that_is_given():
    """If the length itself comes from the sketch."""
    coupler = Link(mass=2.0, reference_length=1.0, mass_properties="scaled", pins=("B", "C"))
    links = {"crank": Link(length=0.1, pins=("A", "B")), "rocker": Link(length=0.25, pins=("D", "C"))}
    made = linkage(
        {"A": (0, 0), "D": (0.35, 0)}, links | {"coupler": coupler}, Drive("crank"), sketch={"C": (0.3, 0.25)}
    )
    assert float(made.links["coupler"].actual().mass) == pytest.approx(2.0 * math.hypot(0.2, 0.25), rel=1e-14)
