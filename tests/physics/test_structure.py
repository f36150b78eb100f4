"""Structure: mobility, Assur groups, classes and formulas, of every chain there is with up to eight links."""

from __future__ import annotations

import dataclasses
import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.analysis import analyse
from linkjax.groups import FRAME, RPP, RPR, RRP, RRR, Crank, Drive, General, Guide, Slot
from linkjax.kinematics import Prepared, assembly_modes, pose, prepared
from linkjax.mechanism import Link, Mechanism, StructureError, linkage, structure
from linkjax.scenes import load, loads_text, text_of
from linkjax.topology import Pair, blocks, classified, freedom
from tests.physics.chains import chains, driven_chains, grounded, links_of, named, sliding
from tests.physics.machines import machine


def smallest_parts(links, pairs, drive) -> list[frozenset[str]]:
    """The parts by trying all sets of links, smallest first: those fixed by their joints and links placed before."""
    placed, found = {FRAME}, []
    while len(placed) <= len(links):
        rest = [name for name in links if name not in placed]
        for part in (set(c) for size in range(1, len(rest) + 1) for c in itertools.combinations(rest, size)):
            touching = [p for p in pairs if set(p.ends) & part and set(p.ends) <= part | placed]
            if 2 * len(touching) + (drive in touching) == 3 * len(part):
                found.append(frozenset(part))
                placed |= part
                break
    return found


def class_of(part, pairs) -> str:
    """Class and order of a group (of II its letters) by trying all sets of its links for bodies, and all its loops."""
    body, inner = {name: name for name in part}, [p for p in pairs if set(p.ends) <= set(part)]
    for size in range(2, len(part)):
        for some in map(set, itertools.combinations(part, size)):
            if 2 * sum(set(p.ends) <= some for p in inner) == 3 * (len(some) - 1):
                body |= dict.fromkeys(some, body[min(some)])
    ends = [tuple(body.get(end, end) for end in p.ends) for p in pairs]
    kept = [(a, b, p.letter) for (a, b), p in zip(ends, pairs, strict=True) if a != b]
    names = sorted(set(body.values()))
    within = [(a, b) for a, b, _ in kept if a in names and b in names]
    if len(names) == 2:
        outer = {name: letter for a, b, letter in kept for name in (a, b) if name in names and (a, b) not in within}
        (middle,) = (letter for a, b, letter in kept if (a, b) in within)
        first, last = sorted((outer[name] for name in names), key="RP".index)
        return {"RRR": "II1", "RRP": "II2", "RPR": "II3", "PRP": "II4", "RPP": "II5"}[first + middle + last]

    def loops(at: str, goal: str, seen: tuple[str, ...]):
        """Lengths of the paths from link to link."""
        if at == goal:
            yield len(seen)
        for a, b in within:
            for here, there in ((a, b), (b, a)):
                if here == at and there not in seen and {a, b} != {seen[0], goal}:
                    yield from loops(there, goal, (*seen, there))

    shortest = [min(loops(a, b, (a,)), default=2) for a, b in within]
    sides = max(2, *shortest, *(n for name in names if (n := sum(name in kept_[:2] for kept_ in kept)) > 2))
    return f"{['II', 'III', 'IV', 'V', 'VI'][sides - 2]}{len(kept) - len(within)}"


def test_known_numbers_of_chains():
    assert [len(chains(n)) for n in (4, 6, 8)] == [1, 2, 16]
    assert [grounded(n) for n in (4, 6, 8)] == [1, 5, 71]
    assert [len(driven_chains(n, at_ground=True)) for n in (4, 6, 8)] == [1, 9, 153]
    assert [len(driven_chains(n, at_ground=False)) for n in (4, 6, 8)] == [2, 25, 575]


EIGHT = pytest.param(8, marks=pytest.mark.slow)


@pytest.mark.parametrize("count", [4, 6, EIGHT])
def test_parts_of_every_chain(count):
    """Every ground and every driving joint: the same parts as by trying all sets of links, in a possible order."""
    kinds = set()
    for chain, ground, edge in driven_chains(count, at_ground=False):
        pairs, links = named(chain, ground), links_of(chain, ground)
        drive = next(p for p in pairs if p.name == f"j{edge[0]}{edge[1]}")
        assert freedom(links, pairs, drive) == (1, (), (), True)
        found = blocks(links, pairs, drive)
        assert {frozenset(part) for part in found} == set(smallest_parts(links, pairs, drive))
        placed = {FRAME}
        for part in found:
            touching = [p for p in pairs if set(p.ends) & set(part) and set(p.ends) <= {*part, *placed}]
            assert 2 * len(touching) + (drive in touching) == 3 * len(part)
            placed |= set(part)
            if drive not in touching:
                kinds.add(classified(part, touching)[0])
                assert classified(part, touching)[0] == class_of(part, touching)
            else:  # with the drive fixed its two links are one
                one, on = sorted(drive.ends, key=lambda end: end == FRAME)
                held = [p._replace(**{k: on if v == one else v for k, v in (("one", p.one), ("other", p.other))})
                        for p in touching if p != drive]  # fmt: skip
                rest = tuple(name for name in part if name != one)
                assert not rest or classified(rest, held)[0] == class_of(rest, held)
    assert kinds == {4: {"II1"}, 6: {"II1", "III3", "IV2"}, 8: {"II1", "III3", "IV2"} | kinds}[count]


@pytest.mark.parametrize("count", [4, 6, EIGHT])
def test_every_replacement_by_a_slider(count):
    """One joint of every chain becomes a slider: the same parts, with the letter in its position."""
    assert len(sliding(count)) == {4: 3, 6: 54, 8: 1377}[count]
    for chain, ground, edge, other in sliding(count):
        links = links_of(chain, ground)
        turns, slides = named(chain, ground), named(chain, ground, {other: "P"})
        drive = next(p for p in slides if p.name == f"j{edge[0]}{edge[1]}")
        assert freedom(links, slides, drive) == (1, (), (), True)
        order = blocks(links, slides, drive)
        assert order == blocks(links, turns, drive)
        for part in order:
            touching = [p for p in slides if set(p.ends) & set(part)]
            touching = [p for p in touching if set(p.ends) <= {FRAME, *links} and p != drive]
            mine = [p for p in touching if _within(p, part, order)]
            if drive.one not in part:
                assert classified(part, mine)[0] == class_of(part, mine)


def _within(pair: Pair, part, order) -> bool:
    """Whether a pair is solved with this part: the later of its two ends is in it."""
    place = {name: i for i, names in enumerate(order) for name in names} | {FRAME: -1}
    return max(place[end] for end in pair.ends) == place[part[0]]


# ---- drawn by links and joints


def drawn(mechanism: Mechanism, **changes) -> Mechanism:
    """A mechanism of groups, taken as links and joints."""
    here = pose(mechanism, jnp.zeros(())).points
    pins, slots = {}, []
    used = {p for g in mechanism.groups for p in g.needs()}
    for group in mechanism.groups:
        for name, ends in group.pins().items():
            own = [p for p in mechanism.links[name].points if p in used]
            pins[name] = (*(p for p in ends if p), *own)
        if isinstance(group, RRP):
            slots.append(Slot(group.block, group.guide))
        if isinstance(group, RPR):
            slots.append(Slot(group.block, Guide(group.about, 0.0, group.offset, group.link)))
        if isinstance(group, RPP):
            slots += [
                Slot(group.link, group.guide),
                Slot(group.block, Guide(group.end, group.slot, group.offset, group.link)),
            ]
    crank = mechanism.driver
    assert isinstance(crank, lj.Crank)
    links = {n: dataclasses.replace(mechanism.links[n], pins=pins[n], centre_name="") for n in mechanism.link_names}
    sketch = {p: here[p].r for names in pins.values() for p in names if p not in mechanism.fixed}
    given = {
        "drive": Drive(crank.link, rotation=crank.rotation, phase=crank.phase, law=crank.law),
        "slots": slots,
        "sketch": sketch,
    }
    return linkage(mechanism.fixed, links, **{**given, **changes}, flywheel=mechanism.flywheel)


@pytest.mark.parametrize("name", ["hay-press", "quick-return", "scotch-yoke", "four-bar", "slider-crank"])
def test_groups_are_found_again(name):
    """The built-in machines, drawn by links and joints, are the same machines, except for names of pins."""
    given = load(name).mechanism
    again = drawn(given)
    assert again.formula() == given.formula()
    plain = [dataclasses.replace(link, pins=()) for link in again.links.values()]
    assert jax.tree.structure(plain) == jax.tree.structure(list(given.links.values()))
    for one, two in zip(jax.tree.leaves(again), jax.tree.leaves(given), strict=True):
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("name", ["two-on-one-crank", "coupler-points", "clockwise"])
def test_composed_machines_are_found_again(name):
    """The same groups, in their own order."""
    given = machine(name).mechanism
    again = drawn(given)
    assert sorted(lj.topology.class_of(g)[0] for g in again.groups) == sorted(
        lj.topology.class_of(g)[0] for g in given.groups
    )
    phi = jnp.asarray([0.3, 2.1, 4.4])
    one, two = (compiled_soon(lambda m: jax.vmap(lambda p: pose(m, p).points)(phi))(m) for m in (given, again))
    for point in one:
        np.testing.assert_allclose(one[point].ddr.x, two[point].ddr.x, rtol=1e-12, atol=1e-12)


def six_bar(drive: Drive, **extra) -> Mechanism:
    """A four-bar whose coupler has a third pin, to which a rod and a ram are attached."""
    links = {
        "crank": Link(length=0.1, mass=1.0, inertia=0.01, centre=lj.Vec(0.03, 0.01), pins=("A", "B")),
        "coupler": Link(length=0.35, mass=1.4, inertia=0.02, centre=lj.Vec(0.16, 0.03), pins=("B", "C", "E"),
                        points={"E": lj.Vec(0.2, 0.1), "K": lj.Vec(0.1, -0.1)}),
        "rocker": Link(length=0.25, mass=1.6, inertia=0.012, centre=lj.Vec(0.12, 0.01), pins=("D", "C")),
        "rod": Link(length=0.5, mass=0.9, inertia=0.01, centre=lj.Vec(0.2, 0.0), pins=("E", "P")),
        "ram": Link(mass=3.0, centre=lj.Vec(0.02, 0.01), pins=("P",)),
    }  # fmt: skip
    sketch = {"B": (0.09, 0.03), "C": (0.35, 0.25), "E": (0.2, 0.25), "P": (0.7, 0.0)}
    return linkage({"A": (0, 0), "D": (0.4, 0)}, links, drive, [Slot("ram", Guide("D"))], sketch, **extra)


def angle(state) -> float:
    return math.atan2(float(state.u.y), float(state.u.x))


@pytest.mark.parametrize(("driver", "against", "formula"), [
    ("rocker", "frame", "I1(rocker) → II1(crank, coupler) → II2(rod, ram)"),
    pytest.param(
        "coupler", "crank", "I1+II1(crank, coupler, rocker) → II2(rod, ram)", marks=pytest.mark.slow
    ),
    pytest.param("rod", "coupler", "I1+III3(crank, coupler, rocker, rod, ram)", marks=pytest.mark.slow),
])  # fmt: skip
def test_another_link_drives(driver, against, formula):
    """The same machine in the same position; coefficients are those of the crank by the chain rule."""
    usual = six_bar(Drive("crank", phase=0.0))
    here = pose(usual, jnp.asarray(0.3))
    on = LinkAtRest if against == "frame" else here.links[against]
    start = angle(here.links[driver]) - (0.0 if against == "frame" else angle(here.links[against]))
    other = six_bar(Drive(driver, against, phase=start))
    assert other.formula() == formula
    there = pose(other, jnp.zeros(()))
    pace = float(here.links[driver].w - on.w)
    bend = float(here.links[driver].e - on.e)
    for name, link in here.links.items():
        again = there.links[name]
        np.testing.assert_allclose([again.u.x, again.u.y], [link.u.x, link.u.y], atol=2e-15)
        np.testing.assert_allclose(again.w, link.w / pace, rtol=2e-13)
        np.testing.assert_allclose(again.e, (link.e - link.w * bend / pace) / pace**2, rtol=1e-11, atol=1e-12)
    for name, point in here.points.items():
        again = there.points[name]
        np.testing.assert_allclose([again.r.x, again.r.y], [point.r.x, point.r.y], atol=2e-15)
        np.testing.assert_allclose(again.dr.x, point.dr.x / pace, rtol=1e-12, atol=1e-14)


class LinkAtRest:
    """The frame."""

    w, e = 0.0, 0.0


def test_lengths_from_the_sketch():
    links = {"crank": Link(pins=("A", "B")), "coupler": Link(pins=("B", "C", "E")), "rocker": Link(pins=("D", "C"))}
    sketch = {"B": (0.0, 0.1), "C": (0.3, 0.3), "E": (0.1, 0.4)}
    found = linkage({"A": (0, 0), "D": (0.4, 0)}, links, Drive("crank", phase=math.pi / 2), sketch=sketch)
    at = pose(found, jnp.zeros(())).points
    for point, (x, y) in sketch.items():
        np.testing.assert_allclose([at[point].r.x, at[point].r.y], [x, y], atol=2e-16)


BARS = {"crank": Link(length=0.1, pins=("A", "B")), "coupler": Link(length=0.3, pins=("B", "C")),
        "rocker": Link(length=0.25, pins=("D", "C"))}  # fmt: skip
GROUND = {"A": (0.0, 0.0), "D": (0.3, 0.0)}
SKETCH = {"C": (0.3, 0.25)}


def wrong(says: str, fixed=GROUND, links=BARS, drive=None, slots=(), sketch=SKETCH):
    with pytest.raises(StructureError, match=says):
        linkage(fixed, links, drive or Drive("crank"), slots, sketch)


def test_what_does_not_hang_together_is_told():
    bar = {"bar": Link(length=0.2, pins=("B", "C"))}
    wrong(
        r"coupler, bar form an overconstrained chain: one of the joints B, C is redundant \(W = .* = 0\)",
        links=BARS | bar,
    )
    tie = {"tie": Link(length=0.2, pins=("K", "L"))}
    held = {**BARS, "coupler": Link(length=0.3, pins=("B", "C", "K"), points={"K": lj.Vec(0.1, 0.1)}),
            "rocker": Link(length=0.25, pins=("D", "C", "L"), points={"L": lj.Vec(0.1, 0.1)})}  # fmt: skip
    wrong(r"links: nothing can move \(W = 3 n - 2 p = 3·4 - 2·6 = 0\): the joints A, B, C, K, D, L make "
          "crank, coupler, rocker, tie a rigid chain; delete tie, or", links=held | tie, sketch={})  # fmt: skip
    arm = {"arm": Link(length=0.2, pins=("C", "K"))}
    wrong("with the drive held, arm can still move at C: 2 degrees .*; pins of one link only: 'K' of 'arm'; add a "
          "binary link", links=BARS | arm)  # fmt: skip
    far = {"far": Link(length=0.1, pins=("X", "Y"))}
    wrong(r"links.far: not connected to the frame: far \(pins X, Y\); let it share a pin", links=BARS | far)
    wrong("drive: 'crank' and 'rocker' share no joint", drive=Drive("crank", "rocker"))
    wrong("drive: link 'crnk' is not defined; did you mean 'crank'", drive=Drive("crnk"))
    fast = {"one": Link(length=0.2, pins=("A", "B")), "two": Link(length=0.2, pins=("D", "B"))}
    wrong("nothing can move .*: the joints .* make one, two a rigid chain; delete two, or", links=fast,
          drive=Drive("one"), sketch={})  # fmt: skip
    wrong("links.crank: has no pins", links=BARS | {"crank": Link(length=0.1)})
    wrong("links.coupler: the position of its pin 'C' is unknown; add it to the sketch", sketch={})
    wrong("sketch.Q: is not a point of any link", sketch={"Q": (0, 0)})
    block = {"block": Link(pins=("C",))}
    wrong("link 'blok' is not defined; did you mean 'block'", links=BARS | block, slots=[Slot("blok", Guide("A"))])
    wrong("guide is on 'frame', but point 'Z' is not", links=BARS | block, slots=[Slot("block", Guide("Z"))])
    ram = {
        "crank": Link(pins=("B",)),
        "rod": Link(length=0.3, pins=("B", "C")),
        "lever": Link(length=0.2, pins=("D", "C")),
    }
    wrong(
        "moves 'crank' along a guide, but has no motion law; give the drive a law",
        links=ram,
        slots=[Slot("crank", Guide("A"))],
    )


@pytest.mark.parametrize("length", [0.0, 0.2])
@pytest.mark.parametrize(
    ("chains", "told"),
    [
        ({"a": "BE", "b": "EC", "rocker": "DC"}, "a, b, rocker can still move at B, E, C, D: 2 degrees"),
        ({"coupler": "BC", "rocker": "DC", "a": "CE", "b": "EF", "c": "MF"},
         "a, b, c can still move at C, E, F, M: 2 degrees"),
        ({"a": "BE", "b": "EF", "c": "FC", "rocker": "DC"}, "rocker can still .* 3 degrees"),
    ],
)  # fmt: skip
def test_chains_with_too_many_links_are_told_as_such(length, chains, told):
    """They are not treated as redundant, even if a chain of one degree of freedom remains without them."""
    links = {"crank": Link(length=0.1, pins=("A", "B"))}
    links |= {name: Link(length=length, pins=tuple(pins)) for name, pins in chains.items()}
    sketch = {"C": (0.3, 0.25), "E": (0.1, 0.25), "F": (0.5, 0.3)}
    used = {p: at for p, at in sketch.items() if any(p in pins for pins in chains.values())}
    wrong(told, {"M": (0.7, 0.0), **GROUND}, links, sketch=used)


def test_a_drive_that_drives_nothing():
    motor = {"motor": Link(length=0.05, pins=("K", "L"))}
    loose = r"it moves 'motor' alone, which is joined only to 'frame' .*; pins of one link only: 'L' of 'motor'; "
    wrong(
        loose + "join another link to one of its pins \\(L\\), or drive another",
        GROUND | {"K": (0.0, -0.1)},
        BARS | motor,
        Drive("motor"),
    )
    frame = GROUND | {"F": (0.5, 0.0)}
    truss = BARS | {"coupler": Link(length=0.3, pins=("D", "C")), "rocker": Link(length=0.25, pins=("F", "C"))}
    wrong("it moves 'crank' alone", frame, truss, sketch={"C": (0.4, 0.2)})
    still = [Crank("crank", "A", "B"), RRR(("coupler", "rocker"), "D", "F", "C")]
    bars = {name: dataclasses.replace(link, pins=()) for name, link in BARS.items()}
    with pytest.raises(
        StructureError,
        match=r"groups\[1\] \(RRR\): the driver moves 'crank' alone; coupler, rocker "
        "are attached to the frame and do not move; attach it to a point of 'crank', such as B",
    ):
        Mechanism({p: lj.Vec(*at) for p, at in frame.items()}, bars, still)


def test_three_slides_in_a_row_have_no_class():
    links = {"crank": BARS["crank"], "one": Link(pins=("X",)), "two": Link(pins=("Z",))}
    slots = [Slot("one", Guide("B", 0.3, on="crank")), Slot("two", Guide("X", 0.9, on="one")), Slot("two", Guide("D"))]
    wrong("slot of two: is in two slots, which .* form no Assur group; use a second block", links=links,
          slots=slots, sketch={"X": (0.3, 0.1), "Z": (0.3, 0.3)})  # fmt: skip


def test_links_that_hold_each_other_fast_count_as_one():
    """A cylinder between coupler and rocker makes one body of all three if it is fixed; a triangle of bars is one."""
    coupler = Link(length=0.3, pins=("B", "C", "E"), points={"E": lj.Vec(0.1, 0.15)})
    rocker = Link(length=0.25, pins=("D", "C", "F"), points={"F": lj.Vec(0.1, -0.1)})
    links = {**BARS, "coupler": coupler, "rocker": rocker, "barrel": Link(length=0.1, pins=("E", "H")),
             "rod": Link(pins=("F",))}  # fmt: skip
    sketch = {"B": (0.0707, 0.0707), "C": (0.3114, 0.2497), "E": (0.0614, 0.2508), "F": (0.4045, 0.0953),
              "H": (0.1525, 0.2095)}  # fmt: skip
    drive = Drive("rod", "barrel", law=lj.Harmonic(0.3766, 0.3806))
    made = linkage(GROUND, links, drive, [Slot("rod", Guide("E", on="barrel"))], sketch)
    assert made.formula() == "I1+II1(crank, coupler, rocker, barrel, rod)"
    bars = [Pair("R", p, one, other) for p, one, other in (
        ("B", "a", "crank"), ("P", "a", "b"), ("Q", "a", "c"), ("S", "b", "c"), ("C", "c", "d"), ("D", "d", FRAME))
    ]  # fmt: skip
    assert classified("abcd", bars) == ("II1", "RRR")


@pytest.mark.slow
def test_a_drawn_machine_is_written_and_read_back():
    for drive in (Drive("crank", rotation="cw", phase=0.3), Drive("coupler", "crank", phase=0.8)):
        scene = lj.Scene(six_bar(drive), speed=3.0)
        again = loads_text(text_of(scene))
        assert again.mechanism.formula() == scene.mechanism.formula()
        assert jax.tree.structure(again.mechanism.links) == jax.tree.structure(scene.mechanism.links)
        one, two = (pose(prepared(s.mechanism), jnp.asarray(0.1)).points for s in (scene, again))
        for point in one:
            np.testing.assert_allclose(one[point].ddr.x, two[point].ddr.x, rtol=1e-12, atol=1e-13)
    triad = machine("triad")
    again = loads_text(text_of(triad))
    assert again.mechanism.formula() == triad.mechanism.formula()
    assert isinstance(again.mechanism.groups[1], General)


def test_what_slides_on_a_link_of_a_dyad_comes_later():
    """The rocker of a four-bar carries a guide: its dyad has a closed form nevertheless."""
    links = {**BARS, "rod": Link(length=0.3, pins=("B", "P")), "block": Link(pins=("P",))}
    slots = [Slot("block", Guide("D", 0.3, 0.02, "rocker"))]
    found = linkage(GROUND, links, Drive("crank", phase=1.0), slots, {**SKETCH, "P": (0.22, 0.19)})
    assert found.formula() == "I1(crank) → II1(coupler, rocker) → II2(rod, block)"
    assert [group.kind for group in found.groups] == ["crank", "RRR", "RRP"]


@pytest.mark.slow
def test_a_drive_between_two_links_in_true_motion():
    """Energy, virtual power and forces balance when the drive turns two moving links relative to each other."""
    links = {
        "base": Link(length=0.5, mass=2.0, inertia=0.1, centre=lj.Vec(0.2, 0.0), pins=("A", "B")),
        "disc": Link(length=0.08, mass=1.0, inertia=0.01, centre=lj.Vec(0.02, 0.0), pins=("B", "C")),
        "rod": Link(length=0.3, mass=0.7, inertia=0.01, centre=lj.Vec(0.2, 0.0), pins=("D", "C")),
    }
    found = linkage(
        {"A": (0, 0), "D": (0.6, 0.1)}, links, Drive("disc", "base"), sketch={"B": (0.35, 0.35), "C": (0.42, 0.33)}
    )
    scene = lj.Scene(
        found, (lj.OpposingTorque("rub", "rod", magnitude=1.0),), lj.Vec(0.0, -9.81), 10.0, title="Tilting"
    )
    done = analyse(scene)
    checks = done.checks
    assert max(float(checks.virtual_power), float(checks.energy_closure), float(checks.force_balance)) < 1e-12
    assert found.driving_link == "disc" and structure(found).formula(numbers=True) == "I1+II1(0,1,2,3)"


def test_formulas():
    found = structure(load("hay-press").mechanism)
    assert (found.mobility, len(found.pairs)) == (1, 7)
    assert found.formula(numbers=True) == "I1(0,1) → II2(2,3) → II1(4,5)"
    assert found.formula(letters=True) == "R(crank) → RRP(rod, slider) → RRR(link4, rocker)"
    assert structure(machine("triad").mechanism).formula(letters=True).split(" → ")[1].startswith("RRR-RRR(")
    assert lj.topology.class_of(RRR(("a", "b"), "P", "Q", "M")) == ("II1", "RRR")


def plate_angles(mechanism: Mechanism | Prepared, phi: float) -> list[float]:
    """Angles of the triad's plate where it closes: the plate on two legs, on both sides, until the third fits."""
    at = pose(mechanism, jnp.asarray(phi)).points
    b, c, d = (complex(at[p].r.x, at[p].r.y) for p in "BCD")
    near, lengths = {"F": 0.25 + 0j, "G": 0.1 + 0.2j}, (0.3, 0.32, 0.35)

    def left(turn, side):
        first, second = b, c - near["F"] * np.exp(1j * turn)  # E on both circles
        span = second - first
        far = np.maximum((lengths[0] + lengths[1]) ** 2 - abs(span) ** 2, 0) * (
            abs(span) ** 2 - (lengths[0] - lengths[1]) ** 2
        )
        foot = 0.5 * (1 + (lengths[0] ** 2 - lengths[1] ** 2) / abs(span) ** 2)
        e = first + span * (foot + 0.5j * side * np.sqrt(np.maximum(far, 0)) / abs(span) ** 2)
        return np.where(far > 0, abs(e + near["G"] * np.exp(1j * turn) - d) - lengths[2], np.nan)

    found, turns = [], np.linspace(-math.pi, math.pi, 20001)
    for side in (1, -1):
        values = left(turns, side)
        for i in np.flatnonzero(values[:-1] * values[1:] < 0):
            found.append(brentq(lambda t, s=side: float(left(np.asarray(t), s)), turns[i], turns[i + 1], xtol=1e-14))
    return sorted(found)


@pytest.mark.slow
@pytest.mark.parametrize("phi", [0.0, 2.0])
def test_all_assemblies_of_a_triad(phi):
    """All roots of its sextic: as many as a search over the plate angle finds, at the same positions."""
    mechanism = machine("triad").mechanism
    (found,) = assembly_modes(mechanism, phi).values()
    turns = [math.atan2(*(float(v) for v in ((s["F"] - s["E"]).y, (s["F"] - s["E"]).x))) for s in found.sketches]
    np.testing.assert_allclose(sorted(turns), plate_angles(prepared(mechanism), phi), atol=1e-9)
    assert found.all_found and found.upper_bound == 6 and len(turns) >= 2


@pytest.mark.slow
def test_a_triad_in_six_ways(rng):
    """A plate on three legs with six real roots: a search from random starts finds the same ones. (Its
    dimensions are the usual example of planar platforms on three legs.)"""
    far, legs = np.array([0, 15.91, 10j]), np.array([14.98, 15.38, 12.0])
    ahead = (17.04**2 + 20.84**2 - 16.54**2) / (2 * 17.04)  # the plate's sides are 17.04, 20.84 and 16.54
    near = np.array([0, 17.04, ahead + 1j * math.sqrt(20.84**2 - ahead**2)])

    def spots_of(x):
        return x[0] + 1j * x[1] + near * np.exp(1j * x[2])

    def left(x):
        return np.abs(spots_of(x) - far) - legs

    known: list[np.ndarray] = []
    for start in rng.uniform((-20, -20, -math.pi), (20, 20, math.pi), (300, 3)):
        x = fsolve(left, start, xtol=1e-13, full_output=True)[0]
        new = all(np.max(np.abs(spots_of(x) - other)) > 1e-3 for other in known)
        known += [spots_of(x)] if new and np.max(np.abs(left(x))) < 1e-11 else []
    assert len(known) == 6
    links = {"crank": Link(length=1.0, pins=("A", "B")), "plate": Link(length=17.04, pins=("E", "F", "G"),
             points={"G": lj.Vec(near[2].real, near[2].imag)})}  # fmt: skip
    links |= {f"leg{i}": Link(length=legs[i], pins=("BCD"[i], "EFG"[i])) for i in range(3)}
    fixed = {"A": (-1.0, 0.0), "C": (15.91, 0.0), "D": (0.0, 10.0)}
    sketch = {"E": (14.9, -1.3), "F": (24.0, 13.0), "G": (8.5, 18.5)}
    made = linkage(fixed, links, Drive("crank"), sketch=sketch)
    (found,) = assembly_modes(made).values()
    assert found.all_found and str(found) == "all 6"
    ours = [np.array([float(s[p].x) + 1j * float(s[p].y) for p in "EFG"]) for s in found.sketches]
    for spots in known:
        assert min(np.max(np.abs(spots - way)) for way in ours) < 1e-9
    for way, sketch in zip(ours, found.sketches, strict=True):
        at = pose(linkage(fixed, links, Drive("crank"), sketch=sketch), jnp.zeros(())).points
        np.testing.assert_allclose([complex(at[p].r.x, at[p].r.y) for p in "EFG"], way, atol=1e-11)


@pytest.mark.slow
def test_ways_to_assemble_a_scissor_lift():
    (found,) = assembly_modes(load("scissor-lift").mechanism).values()
    assert 2 <= len(found.sketches) <= found.upper_bound and "of at most" in str(found)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"coupler": Link(length=0.3, pins=("B", "C"), points={"B": lj.Vec(0.1, 0.0)})},
         "'B' is the origin of its axes"),
        ({"coupler": Link(length=0.3, pins=("B", "C"), points={"D": lj.Vec(0.1, 0.0)})},
         "the point name 'D' is already used by 'rocker'"),
        ({"crank": Link(length=0.1, pins=("A", "S1")), "coupler": Link(length=0.3, pins=("S1", "C"))},
         "the point name 'S1' is already used"),
    ],
)  # fmt: skip
def test_names_that_stand_for_two_points(changes, told):
    """A pin that is an additional point, or a mass centre, of another link."""
    with pytest.raises(StructureError, match=told):
        linkage({"A": (0, 0), "D": (0.35, 0)}, BARS | changes, Drive("crank"), sketch={"C": (0.3, 0.25)})


def test_a_phase_that_is_not_that_of_the_sketch():
    """The drive would close in another way, so both are named."""
    sketch = {"B": (-0.1, 0.0), "C": (0.2, 0.2)}
    with pytest.raises(
        StructureError, match=r"drive\.phase: is 0 deg, but 'coupler' is drawn at -146\.3.* deg to 'crank'; delete it"
    ):
        linkage({"A": (0, 0), "D": (0.35, 0)}, BARS, Drive("coupler", "crank", phase=0.0), sketch=sketch)


def test_scaled_by_a_length_of_the_sketch():
    """The given mass belongs to the length from the sketch."""
    coupler = Link(mass=2.0, reference_length=0.0, mass_properties="scaled", pins=("B", "C"))
    made = linkage(
        {"A": (0, 0), "D": (0.35, 0)}, BARS | {"coupler": coupler}, Drive("crank"), sketch={"C": (0.3, 0.25)}
    )
    assert float(made.links["coupler"].actual().mass) == pytest.approx(2.0, rel=1e-15)


def test_no_group_creates_the_point_that_its_guide_passes_through():
    """The point exists before; the origin of a block is a new one."""
    links, fixed = {"a": Link(length=0.1), "b": Link(), "c": Link()}, {"A": lj.Vec(0.0, 0.0), "Q": lj.Vec(1.0, 0.0)}
    crank, along = Crank("a", "A", "B"), Guide("Q", 0.5)
    for groups in (
        [lj.LinearDriver("b", "Q", along, lj.Harmonic(0.0, 0.1))],
        [crank, RPP("b", "c", "B", "Q", along)],
        [crank, lj.PRP(("b", "c"), "Q", (Guide("A", on="a"), along))],
    ):
        with pytest.raises(StructureError, match="point name 'Q' is already used; give every point its own name"):
            Mechanism(fixed, links, groups)
