# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportOptionalMemberAccess=false
"""Gears in mesh that are coupled with other links and solved simultaneously: their initial angles, phases and starts
that contradict the sketch and their remedies, revolutions, and motions that are not periodic.

Gears by themselves are in test_gears.py.
"""

import cmath
import dataclasses
import math
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import (
    RRR,
    Belt,
    Crank,
    Drive,
    Gear,
    GearPair,
    General,
    Link,
    Mechanism,
    Rack,
    Slot,
    StructureError,
    Teeth,
    Vec,
    linkage,
)
from linkjax.kinematics import assembly_margins, margins, pose, prepared
from linkjax.kinematics._pose import before_group
from linkjax.mechanism import links_of
from linkjax.scenes import SceneError, loads_text, text_of
from tests.helpers import ANGLES, at, same, xy
from tests.physics.machines import machine

SUN = {"sun": Link(length=0.05, mass=1.0, pins=("A", "S")), "arm": Link(length=0.1, mass=1.0, pins=("A", "B")),
       "planet": Link(length=0.05, mass=1.0, pins=("B", "Q"))}  # fmt: skip


def epicyclic(drive: Drive, **changes) -> Mechanism:
    """A sun gear, and a planet inside a ring of the frame."""
    planet = {"phase": 0.3, **changes}
    gears = [
        GearPair("planet", "sun", Teeth((20, 40)), **planet),
        GearPair("planet", "frame", Teeth((20, 80), internal=True), 0.0),
    ]
    sketch = {"B": (0.1, 0.0)}
    return linkage({"A": Vec(0.0, 0.0)}, SUN, drive, (), sketch, gears=gears)


@pytest.mark.slow
def test_wheels_that_only_come_out_together():
    """The sun or the arm drives the same machine: one solves arm and planet simultaneously, the other in sequence."""
    by_arm, by_sun = epicyclic(Drive("arm", phase=0.0)), epicyclic(Drive("sun", phase=0.15))
    assert by_arm.formula() == "I1(arm) → G(planet) → G(sun)"
    assert by_sun.formula() == "I1(sun) → G(arm, planet)"
    one, two = (
        at(by_arm),
        at(prepared(by_sun, 3), 3 * ANGLES),
    )  # 1 + 80 / 40 turns of the sun for one of the arm: Willis
    for name in SUN:
        np.testing.assert_allclose(two.links[name].angle, one.links[name].angle, atol=1e-13)
        np.testing.assert_allclose(two.links[name].w, one.links[name].w / 3, rtol=1e-14)
    for name in "BQS":
        np.testing.assert_allclose(xy(two.points[name].ddr), xy(one.points[name].ddr) / 9, atol=1e-15)


@pytest.mark.slow
def test_phases_and_sketch_that_contradict_each_other():
    """Coupled gears are at the angles given by their phases: the reported one is that of the sketch, and agrees."""
    with pytest.raises(StructureError, match=r"'arm' is at .*, but is drawn at 0 deg; write phase = ") as told:
        epicyclic(Drive("sun"), phase=3.0)
    found = re.search(r'phase = "(.*) deg" for the pair', str(told.value))
    assert found is not None
    gears = [GearPair("planet", "sun", Teeth((20, 40)), 3.0),
             GearPair("planet", "frame", Teeth((20, 80), internal=True), math.radians(float(found[1])))]  # fmt: skip
    made = linkage({"A": Vec(0.0, 0.0)}, SUN, Drive("sun"), (), {"B": (0.1, 0.0)}, gears=gears)
    assert float(at(made, jnp.zeros(1)).links["arm"].angle[0]) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.slow
def test_a_belt_that_cannot_be_in_a_loop():
    """Also if arm and pulley are coupled, overlapping pulleys leave no space for a belt between them."""

    def least(radius: float) -> dict[str, float]:
        gears = [GearPair("planet", "sun", Belt(0.03, 0.02, crossed=True), 0.3),
                 GearPair("planet", "frame", Belt(0.02, radius, crossed=True))]  # fmt: skip
        sketch = {"B": (0.1, 0.001)}
        made = linkage({"A": Vec(0.0, 0.0)}, SUN, Drive("sun", phase=0.45), (), sketch, gears=gears)
        found = margins(prepared(made, 1), jnp.zeros(()))["arm-planet"]
        return {side: float(margin.value) for side, margin in found.items()}

    for radius in (0.079, 0.081):  # on an arm of 0.1 m
        found = least(radius)
        assert found["loops"] > 0
        assert found["apart"] == pytest.approx(1 - (radius + 0.02) / 0.1, rel=1e-12)


def test_a_wheel_with_one_pin_cannot_drive():
    """Its angle is not defined."""
    links = {"arm": SUN["arm"], "planet": Link(mass=1.0, pins=("B",))}
    with pytest.raises(StructureError, match=r"planet.* does not show its direction; give it another pin"):
        linkage({"A": Vec(0.0, 0.0)}, links, Drive("planet", "arm"), (), {"B": (0.1, 0.001)},
                gears=[GearPair("planet", "frame", Teeth((20, 40)))])  # fmt: skip


@pytest.mark.slow
def test_the_remedy_is_for_what_was_drawn():
    """A gear drawn from the sun to the planet, solved in the opposite order: its own phase is reported, and agrees."""
    sketch = {"B": (0.001, 0.1)}

    def made(phase: float) -> Mechanism:
        gears = [GearPair("planet", "frame", Teeth((20, 80), internal=True), 0.0),
                 GearPair("sun", "planet", Teeth((40, 20)), phase)]  # fmt: skip
        return linkage({"A": Vec(0.0, 0.0)}, SUN, Drive("sun"), (), sketch, gears=gears)

    with pytest.raises(StructureError, match=r"'arm' is at .*, but is drawn at 89\.42.* deg") as told:
        made(0.0)
    found = re.search(r'phase = "(.*) deg" for the pair \'sun\' and \'planet\'', str(told.value))
    assert found is not None
    here = at(made(math.radians(float(found[1]))), jnp.zeros(1))
    assert float(here.links["arm"].angle[0]) == pytest.approx(math.atan2(0.1, 0.001), abs=1e-5)


@pytest.mark.parametrize(("phase", "told"), [(1.0, "'planet' is at -28.64"), (3.0, "'planet' is at -85.94")])
def test_a_drive_on_the_arm_has_a_phase_too(phase, told):
    """The planet is driven relative to the arm: its phase and that of its teeth leave one position for both."""
    links = {name: dataclasses.replace(SUN[name], centre_name="") for name in ("arm", "planet")}
    with pytest.raises(StructureError, match=told):
        linkage({"A": Vec(0.0, 0.0)}, links, Drive("planet", "arm", phase=0.0), (),
                {"B": (0.1, 0.001), "Q": (0.15, 0.0015)},
                gears=[GearPair("planet", "frame", Teeth((20, 40)), phase)])  # fmt: skip


@pytest.mark.slow
def test_a_drive_on_the_arm_starts_where_it_is_drawn():
    """With the correct phase, which follows from Willis: planet = phase + (1 + 40 / 20) arm, and planet = arm."""
    links = {name: dataclasses.replace(SUN[name], centre_name="") for name in ("arm", "planet")}
    lean = math.atan2(0.001, 0.1)
    made = linkage({"A": Vec(0.0, 0.0)}, links, Drive("planet", "arm"), (), {"B": (0.1, 0.001), "Q": (0.15, 0.0015)},
                   gears=[GearPair("planet", "frame", Teeth((20, 40)), -2 * lean)])  # fmt: skip
    here = at(prepared(made, 2))
    np.testing.assert_allclose(here.links["arm"].angle, lean + ANGLES / 2, atol=1e-13)
    np.testing.assert_allclose(here.links["planet"].angle, lean + 3 * ANGLES / 2, atol=1e-13)


def tied(phase: float) -> Mechanism:
    """Two gears in mesh that a crank moves by rods from their common pin."""
    where = {"A": 0.3j, "B": 0.03 + 0.3j, "D": 0.2 + 0j, "E": 0.4 + 0j, "P": 0.3 + 0.3j,
             "C": 0.2 + 0.06 * cmath.exp(2.0j), "F": 0.4 + 0.06 * cmath.exp(0.8j)}  # fmt: skip
    pins = {"crank": "AB", "pull": "BP", "one": "DC", "two": "EF", "left": "CP", "right": "FP"}
    links = {name: Link(length=abs(where[a] - where[b]), mass=1.0, pins=(a, b)) for name, (a, b) in pins.items()}
    spots = {name: (z.real, z.imag) for name, z in where.items()}
    return linkage(
        {name: spots[name] for name in "ADE"}, links, Drive("crank"), (), {name: spots[name] for name in "BCFP"},
        gears=[GearPair("two", "one", Teeth((20, 20)), 2.8 + phase)],
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("turns", [0, 1])
def test_whole_turns_of_a_phase_change_nothing(turns):
    """Gears with rods are at their drawn angles, whatever revolution their phase is given in."""
    mechanism = tied(2 * math.pi * turns)
    assert mechanism.formula() == "I1(crank) → G(pull, one, two, left, right)"
    here = at(mechanism, jnp.zeros(1))
    np.testing.assert_allclose(xy(here.points["P"].r)[:, 0], [0.3, 0.3], atol=1e-13)
    assert float(here.links["one"].angle[0]) == pytest.approx(2.0, abs=1e-12)
    assert float(here.links["two"].angle[0]) == pytest.approx(0.8, abs=1e-12)


THREE = [
    ((2.5, -2.9, -2.5), -1.0, "two-three", 0, 0), ((2.5, -2.9, -2.5), -1.0, "three-two", 0, 1),
    ((2.0, 0.8, 1.2), -0.5, "three-two", 1, 0), ((2.0, 0.8, 1.2), -0.5, "three-two", -1, 1),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("stand", "ratio", "second", "turns", "order"), THREE)
def test_three_wheels_tied_to_one_body(stand, ratio, second, turns, order):
    """They are at their drawn angles, in any order and revolution, whichever of two gears is named first."""
    where = {"A": 0.5j, "B": 0.05 + 0.5j, "V": 0.2 + 0.5j, "P": 0.3 + 0.4j, "Q": 0.4 + 0.35j, "R": 0.6 + 0.42j,
             "D": 0.2 + 0j, "E": 0.4 + 0j, "G": 0.6 + 0j}  # fmt: skip
    where |= {end: where[at] + 0.06 * cmath.exp(1j * angle) for end, at, angle in zip("CFH", "DEG", stand, strict=True)}
    pins = {"crank": "AB", "bar": "BV", "one": "DC", "two": "EF", "three": "GH", "left": "CP", "middle": "FQ",
            "right": "HR", "body": "VP"}  # fmt: skip
    links = {name: Link(length=abs(where[a] - where[b]), mass=1.0, pins=(a, b)) for name, (a, b) in pins.items()}
    turn = cmath.exp(1j * cmath.phase(where["P"] - where["V"]))
    on = {name: (where[name] - where["V"]) / turn for name in "QR"}
    links["body"] = dataclasses.replace(
        links["body"], pins=("V", "P", "Q", "R"), points={name: Vec(z.real, z.imag) for name, z in on.items()}
    )
    one, two, three = stand
    teeth = Teeth((20, 20)) if ratio == -1.0 else Teeth((40, 20))
    ends = ("two", "three", two - ratio * three) if second == "two-three" else ("three", "two", three - ratio * two)
    gears = [GearPair("two", "one", Teeth((20, 20)), math.remainder(two + one, 2 * math.pi) + 2 * math.pi * turns),
             GearPair(*ends[:2], teeth, math.remainder(ends[2], 2 * math.pi))]  # fmt: skip
    spots = {name: (z.real, z.imag) for name, z in where.items()}
    made = linkage({name: spots[name] for name in "ADEG"}, links, Drive("crank"), (),
                   {name: spots[name] for name in "BVPQRCFH"}, gears=gears[:: -1 if order else 1])  # fmt: skip
    here = at(made, jnp.zeros(1))
    for name in "BVPQRCFH":
        np.testing.assert_allclose(xy(here.points[name].r)[:, 0], spots[name], atol=1e-12)
    for name, angle in zip(("one", "two", "three"), stand, strict=True):
        assert float(here.links[name].angle[0]) == pytest.approx(angle, abs=1e-11)


BEHIND = {name: Link(mass=1.0, inertia=0.01) for name in ("wheel", "rack", "out", "other")}
TOGETHER = General((("wheel", ("E",)), ("rack", ("R",))), ("E",), {"R": Vec(0.3, 0.05)}, (Slot("rack", "E"),), gears=(
    Gear("wheel", "E", Teeth((20, 20)), "second", "D"), Rack("rack", "R", "E", "wheel", "E", 0.05)))  # fmt: skip


def double_crank(*more, fast: int | None = None) -> Mechanism:
    """Its second crank rotates fully, non-uniformly; a gear of many turns drives it if `fast`."""
    lengths = {"crank": 0.3, "coupler": 0.25, "second": 0.28}
    links = {name: Link(length=long, mass=1.0, inertia=0.01) for name, long in lengths.items()}
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(0.1, 0.0), "E": Vec(0.6, 0.0), "F": Vec(0.9, 0.0)}
    first = [Crank("crank", "A", "B")]
    if fast is not None:
        links |= {"slow": Link(length=0.1, mass=1.0, inertia=1.0)}
        first = [Crank("slow", "F", "X"), Gear("crank", "A", Teeth((5, 5 * fast)), "slow", "F", "B")]
    behind = {name: link for name, link in BEHIND.items() if any(name in group.link_names() for group in more)}
    return Mechanism(fixed, links | behind, [*first, RRR(("coupler", "second"), "B", "D", "C", 1), *more])


@pytest.mark.slow
def test_racks_that_run_away_behind_a_link_that_turns_round():
    """Inside a group that is solved simultaneously, and after one, as by themselves."""
    alone = assembly_margins(double_crank(*TOGETHER.gears))
    more = [Gear("out", "F", Teeth((40, 20)), "wheel", "E"), Rack("other", "U", "F", "out", "F", 0.05)]
    behind = assembly_margins(double_crank(TOGETHER, *more))
    assert float(alone["wheel"]["turns"].value) == 1.0
    for least in (alone["rack"]["turns"], behind["wheel-rack"]["loops"], behind["out"]["turns"],
                  behind["other"]["turns"]):  # fmt: skip
        assert float(least.value) == -1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fast", "more", "told"),
    [
        (400, TOGETHER.gears[:1], "group 'wheel' has wheels that follow a link which turns too fast.*unevenly"),
        (400, [TOGETHER], "group 'wheel-rack' has wheels that follow a link which turns too fast.*unevenly"),
        (None, [TOGETHER], "group 'wheel-rack' does not return to its initial position"),
    ],
)
def test_what_is_told_of_wheels_that_do_not_come_back(fast, more, told):
    """Which group, and why."""
    with pytest.raises(lj.MachineError, match=told):
        lj.analyse(lj.Scene(double_crank(*more, fast=fast), (), speed=5.0), angles=12)


@pytest.mark.slow
def test_racks_that_contradict_the_sketch():
    """A rack coupled with its gear is at its start: the reported start is that of the sketch, and agrees."""
    text = text_of(machine("rolling"))
    with pytest.raises(SceneError, match=r"'rack' stands at .* m along its guide .*; write start = ") as told:
        loads_text(text.replace('start = "-0.1 m"', 'start = "-0.3 m"'))
    found = re.search(r"write start = (.*) for the rack", str(told.value))
    assert found is not None

    def start(way, lever):  # by Willis the gear is at 0.4 + 2.8 lever, and rolls on the rack with 0.05 m
        return way + 0.05 * (0.4 + 1.8 * lever)

    lever = cmath.phase((0.3 - 0.05j) / (0.32 - 0.05j))  # from F to E: as sketched, and in its own axes
    sketched = -0.1 * math.cos(lever + 0.3)  # of U before E, along the guide
    assert f"but at {sketched:.4g} in the sketch" in str(told.value)
    assert float(found[1]) == pytest.approx(start(sketched, lever), rel=1e-5)  # six digits are reported
    made = loads_text(text.replace('start = "-0.1 m"', f'start = "{found[1]} m"')).mechanism
    here = pose(made, jnp.zeros(()))
    along = here.links["lever"].u.turned(Vec(math.cos(0.3), math.sin(0.3)))
    way = float((here.points["U"].r - here.points["E"].r).dot(along))
    assert start(way, float(here.links["lever"].angle)) == pytest.approx(float(found[1]), abs=1e-14)


@pytest.mark.slow
def test_where_wheels_in_a_loop_begin():
    """From a rough sketch they are turned so that teeth and racks fit best, close to the sketch; carriers are counted
    from within half a revolution of zero."""
    scene = machine("rolling")
    group = scene.mechanism.groups[1]
    assert isinstance(group, General)
    links, still = links_of(scene.mechanism, group), jnp.zeros(())
    known = before_group(scene.mechanism, 1, still)
    rim = {name: at for name, at in group.sketch.items() if name != "E"}
    group = eqx.tree_at(lambda g: g.sketch, group, rim)
    drawn = group.sketched(links, *known, still)
    begun, _ = group.wound(links, *known, still, drawn[:, :2], drawn[:, 2])
    gap, matrix = group.opened(links, *known, still, begun, jnp.zeros(15))
    rows, wheels = slice(-3, None), [5, 14]  # angles of gear and pulley
    np.testing.assert_allclose(matrix[rows][:, wheels].T @ gap[rows], 0.0, atol=1e-15)
    assert float(jnp.linalg.norm(gap[rows])) < 0.1 * float(jnp.linalg.norm(drawn))
    ahead = jnp.stack([jnp.cos(begun[1, 2]), jnp.sin(begun[1, 2])])
    np.testing.assert_allclose(begun[1, :2] + 0.04 * ahead, [0.54, 0.1], atol=1e-15)  # T, the point of the rim
    z, _, left, whole = group.assembled(links, *known, still)
    assert float(left) < 1e-14 and not np.any(whole)
    later, _ = group.wound(links, *known, still, z[:, :2], z[:, 2].at[0].add(2 * math.pi))
    np.testing.assert_allclose(later, z, atol=1e-14)


def test_a_cycle_of_a_sun():
    """The number of turns of the sun after which the machine returns to its initial position."""
    machine = epicyclic(Drive("sun", phase=0.15))
    with pytest.raises(StructureError, match=r"'arm' .* \(it turns 0.333333 times\); write cycle_turns = 3"):
        lj.Scene(machine, speed=5.0)
    lj.Scene(machine, speed=5.0, cycle_turns=3)


def test_written_and_read_back():
    """As a scene file, to the last bit."""
    same(lj.Scene(epicyclic(Drive("sun", phase=0.15)), speed=5.0, cycle_turns=3))


@pytest.mark.slow
def test_what_comes_out_together_is_found_apart():
    """As a file, a machine solved simultaneously is decomposed into the smallest groups, and moves as before."""
    scene = machine("rolling")
    again = loads_text(text_of(scene)).mechanism
    assert again.formula() == "I1(crank) → G(lever, wheel, rack, rod) → G(pulley) → II2(coupler, slide)"
    one, two = at(scene.mechanism), at(again)
    for name in "BEFTUVW":
        np.testing.assert_allclose(xy(two.points[name].ddr), xy(one.points[name].ddr), atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("crank", [1.007, 0.997])
def test_a_wheel_of_a_general_group_on_a_fast_link(crank):
    """Ten times as fast as the second link of a drag link near its change point, more than three turns between two
    points of the path: it turns as that link does, unwrapped in small steps, and as it does by itself."""
    links = {name: Link(length=length) for name, length in (("crank", crank), ("coupler", 2.0), ("second", 2.0))}
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(1.0, 0.0), "E": Vec(9.6, 0.0)}
    groups = [Crank("crank", "A", "B", phase=0.4), RRR(("coupler", "second"), "B", "D", "C", 1)]
    gear = Gear("wheel", "E", Belt(0.02, 0.2), "second", "D")
    general = General((("wheel", ("E",)),), ("E",), {}, gears=(gear,))
    fine = np.concatenate([[0.0], 2 * np.pi - 0.4 + np.linspace(-0.3, 0.3, 60001)])
    b = crank * np.exp(1j * (fine + 0.4)) - 1.0
    r = abs(b)
    second = np.unwrap(np.angle(b * (0.5 + 1j * np.sqrt(np.maximum(4 - r * r / 4, 0.0)) / r * -1)))
    steps = np.arange(1, 60001, 97)
    turned = []
    for last in (gear, general):
        ready = prepared(Mechanism(fixed, {**links, "wheel": Link()}, [*groups, last]))
        here = jax.vmap(lambda phi, m=ready: (pose(m, phi).links["wheel"].angle, margins(m, phi)["wheel"]))(
            jnp.asarray(fine[steps])
        )
        assert min(float(jnp.min(side.value)) for side in here[1].values()) > 0.9
        turned.append(np.asarray(here[0]))
        known = 10 * (second[steps] - second[steps[0]])
        np.testing.assert_allclose(turned[-1] - turned[-1][0], known, atol=1e-8)
    np.testing.assert_allclose(turned[1], turned[0], atol=1e-9)


@pytest.mark.slow
def test_loose_wheels_do_not_make_ranges_longer():
    """A gear in mesh with the crank does not return to its initial position; the range is that of the other links."""
    links = {name: Link(length=length) for name, length in (("crank", 0.3), ("coupler", 0.25), ("rocker", 0.2))}
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0), "E": Vec(-0.5, 0.0)}
    crank, dyad = Crank("crank", "A", "B"), RRR(("coupler", "rocker"), "B", "D", "C")
    wheel = General((("wheel", ("E",)),), ("E",), {}, gears=(Gear("wheel", "E", Teeth((20, 33)), "crank", "A"),))
    alone = lj.crank_ranges(Mechanism(fixed, links, [crank, dyad]))
    found = lj.crank_ranges(Mechanism(fixed, {**links, "wheel": Link()}, [crank, wheel, dyad]))
    assert len(found) == len(alone) == 1
    np.testing.assert_allclose(found[0][:2], alone[0][:2], atol=1e-12)
