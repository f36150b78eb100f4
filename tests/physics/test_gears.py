# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportOptionalMemberAccess=false
"""Gears in mesh: closed forms, gears whose revolutions are counted, refused input, and machines drawn with them.

Their kinematics and forces are compared with 50 digits and with one-sided contacts together with all other machines
(`geared` in machines.py); MuJoCo models of them are in tests/exchange.
"""

import math

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
    Guide,
    Link,
    Mechanism,
    Pinion,
    Rack,
    RackPair,
    Slot,
    StructureError,
    Teeth,
    Vec,
    linkage,
)
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.kinematics import Prepared, assembly_margins, margins, pose, prepared
from linkjax.machine import ready
from linkjax.mechanism import structure
from tests.helpers import ANGLES, at, same, xy

FIXED = {"A": Vec(0.0, 0.0), "D": Vec(0.3, 0.0)}


def test_cardans_wheels():
    """A gear inside a ring of twice its size: a point of its pitch circle moves along a diameter."""
    links = {"arm": Link(length=0.1, mass=1.0), "planet": Link(length=0.1, mass=2.0)}
    planet = Gear("planet", "B", Teeth((20, 40), internal=True), "frame", "A", "Q", carrier="arm")
    mechanism = Mechanism({"A": Vec(0.0, 0.0)}, links, [Crank("arm", "A", "B"), planet])
    q, wheel = at(mechanism).points["Q"], at(mechanism).links["planet"]
    np.testing.assert_allclose(q.r.x, 0.2 * np.cos(ANGLES), atol=1e-16)
    np.testing.assert_allclose(q.ddr.x, -0.2 * np.cos(ANGLES), atol=1e-15)
    np.testing.assert_allclose(q.r.y, 0.0, atol=5e-17)
    assert np.all(np.asarray(wheel.w) == -1.0)
    force = lj.Force("pull", "planet", point="Q", force=Vec(7.0, 0.0))  # along the diameter: power of the drive
    scene = lj.Scene(mechanism, (force,), speed=3.0)
    drive = [
        float(kinetostatics(scene, jnp.asarray(phi), jnp.asarray(1e-9), jnp.asarray(0.0)).drive_torque)
        for phi in ANGLES[1:4]
    ]
    np.testing.assert_allclose(drive, 7.0 * 0.2 * np.sin(ANGLES[1:4]), rtol=1e-12)


@pytest.mark.parametrize(
    ("teeth", "inside", "ratio"), [((40, 20), False, -0.5), ((20, 60), True, 3.0), ((60, 20), True, 1 / 3)]
)
def test_willis(teeth, inside, ratio):
    """Revolutions of a gear on an arm around a fixed gear, and on a frame around a rotating one."""
    links = {name: Link(length=0.1, mass=1.0) for name in ("arm", "wheel")}
    wheel = Gear("wheel", "B", Teeth(teeth, inside), "frame", "A", carrier="arm")
    found = at(Mechanism(FIXED, links, [Crank("arm", "A", "B"), wheel])).links["wheel"]
    np.testing.assert_allclose(found.w, 1 - ratio, rtol=1e-15)
    wheel = Gear("wheel", "D", Teeth(teeth, inside), "arm", "A", phase=0.2)
    found = at(Mechanism(FIXED, links, [Crank("arm", "A", "B", "cw", 0.7), wheel])).links["wheel"]
    np.testing.assert_allclose(found.angle, 0.2 + ratio * (0.7 - ANGLES), rtol=1e-14)


def drag_link(*more, turns: int = 1, **links: Link) -> lj.Scene:
    """A double crank: its second crank rotates fully, non-uniformly; followed by gears."""
    lengths = {"crank": 0.3, "coupler": 0.25, "second": 0.28}
    own = {name: Link(length=length, mass=1.0, inertia=0.01) for name, length in lengths.items()}
    groups = [Crank("crank", "A", "B"), RRR(("coupler", "second"), "B", "D", "C", 1), *more]
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(0.1, 0.0), "E": Vec(0.6, 0.0), "F": Vec(0.9, 0.0)}
    mechanism = Mechanism(fixed, {**own, **links}, groups)
    return lj.Scene(mechanism, (lj.OpposingTorque("brake", "second", magnitude=2.0),), speed=5.0, cycle_turns=turns)


BELTS = [pytest.param(Belt(0.06, 0.09, crossed=crossed), marks=pytest.mark.slow) for crossed in (True, False)]


@pytest.mark.parametrize("mesh", [Teeth((20, 30)), *BELTS])
def test_turns_of_what_turns_all_round_are_counted(mesh):
    """One and a half turns for each of the second crank: unwrapped by hand, over two turns of the crank."""
    scene = drag_link(Gear("wheel", "E", mesh, "second", "D", None, 0.3), turns=2, wheel=Link(mass=1.0, inertia=0.01))
    mechanism = prepared(scene.mechanism, 2)
    angles = np.linspace(0.0, 4 * math.pi, 401)
    found = at(mechanism, angles)
    second, wheel = (np.asarray(found.links[name].u.x) + 1j * np.asarray(found.links[name].u.y)
                     for name in ("second", "wheel"))  # fmt: skip
    ratio = float(mesh.ratio())
    np.testing.assert_allclose(wheel, np.exp(1j * (0.3 + ratio * np.unwrap(np.angle(second)))), atol=1e-12)
    assert float(found.links["wheel"].angle[200]) == pytest.approx(
        0.3 + ratio * (np.angle(second[0]) + 2 * math.pi), abs=1e-12
    )
    assert all(float(side.value) > 0 for side in margins(mechanism, jnp.asarray(1.0))["wheel"].values())


@pytest.mark.slow
def test_an_analysis_over_counted_turns():
    """Two turns of the crank, and three of the gear."""
    wheel = Gear("wheel", "E", Teeth((20, 30)), "second", "D", None, 0.3)
    cycle = lj.analyse(drag_link(wheel, turns=2, wheel=Link(mass=1.0, inertia=0.01)), angles=36)
    assert float(cycle.checks.virtual_power) < 1e-12 and float(cycle.checks.force_balance) < 1e-12


@pytest.mark.slow
def test_what_does_not_come_back_is_told():
    """After one turn the gear has made one and a half."""
    wheel = Gear("wheel", "E", Teeth((20, 30)), "second", "D")
    with pytest.raises(lj.MachineError, match="'wheel' does not return to its initial position within cycle_turns"):
        lj.analyse(drag_link(wheel, wheel=Link(mass=1.0, inertia=0.01)), angles=36)
    with pytest.raises(lj.MachineError, match="'rack' does not return to its initial position"):
        lj.analyse(drag_link(Rack("rack", "R", "E", "second", "D", 0.05), rack=Link(mass=1.0)), angles=36)


def least(mechanism: Mechanism | Prepared, turns: int = 1) -> dict[str, float]:
    """Whether gears return to their initial angle, as margins over the cycle."""
    found = compiled_soon(assembly_margins, static=("cycle_turns",))(mechanism, cycle_turns=turns)
    return {group: float(sides["turns"].value) for group, sides in found.items() if "turns" in sides}


@pytest.mark.slow
def test_behind_a_counted_wheel():
    """A second gear, and a rack, are checked like the first."""
    one = Gear("one", "E", Teeth((20, 20)), "second", "D")
    wheels = {name: Link(mass=1.0, inertia=0.01) for name in ("one", "two")}
    scene = drag_link(one, Gear("two", "F", Teeth((40, 20)), "one", "E"), **wheels)
    assert least(scene.mechanism) == {"one": 1.0, "two": -1e-6}
    assert least(scene.mechanism, 2) == {"one": 1.0, "two": 1.0}
    assert float(margins(scene.mechanism, jnp.asarray(0.3))["two"]["turns"].value) == 1.0  # assembled at every angle
    rack = drag_link(one, Rack("rack", "R", "F", "one", "E", 0.05), one=wheels["one"], rack=Link(mass=1.0))
    assert least(rack.mechanism)["rack"] < 0
    belt = drag_link(Gear("one", "E", Belt(0.05, 0.05), "second", "D"), one=wheels["one"])
    again = lj.design.changed(ready(belt).scene, {"groups.one.belt.radii[0]": 0.06})
    assert least(belt.mechanism)["one"] == 1.0 and least(again.mechanism)["one"] < 0


def test_angles_beyond_the_cycle():
    """A pose does not depend on the cycle: the gear continues correctly, a turn and a half for each."""
    scene = drag_link(Gear("wheel", "E", Teeth((20, 30)), "second", "D"), turns=2, wheel=Link(mass=1.0))
    first, *later = (float(pose(scene.mechanism, jnp.asarray(1.0 + 2 * math.pi * k)).links["wheel"].angle)
                     for k in (0, 1, 2, -1))  # fmt: skip
    np.testing.assert_allclose(np.asarray(later) - first, -1.5 * 2 * math.pi * np.array([1, 2, -1]), rtol=1e-13)


@pytest.mark.parametrize(("fast", "counts"), [(7, True), (121, True), (400, False)])
def test_fast_wheels_are_counted(fast, counts):
    """A double crank after a gear of many turns per turn of the crank; too many are reported."""
    links = {"crank": Link(length=0.1, mass=1.0), "quick": Link(length=0.3, mass=1.0)}
    links |= {name: Link(length=long, mass=1.0) for name, long in (("coupler", 0.25), ("second", 0.28), ("out", 0.0))}
    groups = [Crank("crank", "D", "X"), Gear("quick", "A", Teeth((5, 5 * fast)), "crank", "D", "B"),
              RRR(("coupler", "second"), "B", "G", "C"), Gear("out", "D", Teeth((20, 20)), "second", "G")]  # fmt: skip
    mechanism = prepared(Mechanism({**FIXED, "G": Vec(0.1, 0.0)}, links, groups))
    if counts:
        assert float(mechanism.paths[-1].covered()[0]) == pytest.approx(-2 * math.pi * fast, rel=1e-12)
    assert (least(mechanism)["out"] > 0) == counts


def five_bar(teeth: tuple[int, int], turns: int) -> lj.Scene:
    """Two cranks in mesh, and a dyad between them."""
    lengths = {"crank": 0.06, "wheel": 0.05, "left": 0.25, "right": 0.22}
    links = {name: Link(length=length, mass=1.0, inertia=0.01) for name, length in lengths.items()}
    groups = [
        Crank("crank", "A", "B"),
        Gear("wheel", "D", Teeth(teeth), "crank", "A", "C", 0.4),
        RRR(("left", "right"), "B", "C", "P", 1),
    ]
    return lj.Scene(Mechanism(FIXED, links, groups), (lj.OpposingTorque("brake", "left", magnitude=2.0),), speed=5.0,
                    cycle_turns=turns)  # fmt: skip


def test_another_number_of_turns_is_refused():
    """With the right one."""
    with pytest.raises(
        StructureError, match=r"'wheel' .*cycle_turns = 1 \(it turns -0.5 times\); write cycle_turns = 2"
    ):
        five_bar((40, 20), 1)
    with pytest.raises(StructureError, match=r" = 2 \(it turns -1.42857 times\); write cycle_turns = 7"):
        five_bar((28, 20), 2)


@pytest.mark.slow
def test_a_cycle_of_several_turns():
    """Half the turns need two of the crank."""
    cycle = lj.analyse(five_bar((40, 20), 2), angles=72)
    assert float(cycle.checks.energy_closure) < 1e-12
    path = xy(cycle.pose.points["P"].r)
    assert np.max(np.abs(path[:, :36] - path[:, 36:])) > 0.01  # the second turn differs


def test_gradients_through_a_belt():
    """Derivatives of a pulley angle with respect to its radius, and of a shaft reaction with respect to the tension."""
    links = {name: Link(length=long, mass=1.0) for name, long in (("crank", 0.1), ("rod", 0.35), ("lever", 0.3))}
    links |= {"pulley": Link(mass=1.0, inertia=0.01)}
    groups = [Crank("crank", "A", "B"), RRR(("rod", "lever"), "B", "D", "C"),
              Gear("pulley", "E", Belt(0.04, 0.06, tension=20.0), "lever", "D")]  # fmt: skip
    mechanism = Mechanism({**FIXED, "E": Vec(0.5, 0.1)}, links, groups)
    scene = lj.Scene(mechanism, (lj.Torque("load", "pulley", torque=3.0),), speed=5.0)

    def swing(radius, tension):
        changed = lj.design.changed(
            scene, {"groups.pulley.belt.radii[0]": radius, "groups.pulley.belt.tension": tension}
        )
        made = ready(changed)
        turn = [jnp.asarray(pose(made.mechanism, jnp.asarray(phi)).links["pulley"].angle) for phi in (0.4, 2.0)]
        force = kinetostatics(made, jnp.asarray(1.0), jnp.asarray(5.0), jnp.asarray(0.0)).reactions["E"]["pulley"]
        return turn[1] - turn[0], force.magnitude

    (angle, _), (slope, pull) = compiled_soon(lambda r, t: (swing(r, t), jax.jacfwd(swing, (0, 1))(r, t)))(0.04, 20.0)
    assert float(slope[0]) == pytest.approx(-float(angle) / 0.04, rel=1e-12) and float(slope[1]) == 0.0
    back = compiled_soon(jax.jacrev(swing, (0, 1)))(0.04, 20.0)
    np.testing.assert_allclose(np.ravel(back), np.ravel((slope, pull)), rtol=1e-12)
    h = 1e-3
    forces = [float(compiled_soon(swing)(0.04, 20.0 + k * h)[1]) for k in (1, -1)]
    assert float(pull[1]) == pytest.approx((forces[0] - forces[1]) / (2 * h), rel=1e-7)


@pytest.mark.slow
def test_a_belt_that_cannot_be():
    """Two pulleys of 0.15 m, 0.29 m apart, have no space for crossed strands."""
    links = {"crank": Link(length=0.1, mass=1.0, inertia=0.1), "wheel": Link(mass=1.0, inertia=0.01)}
    groups = [Crank("crank", "A", "B"), Gear("wheel", "D", Belt(0.15, 0.15, crossed=True), "crank", "A")]
    scene = lj.Scene(Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.32, 0.0)}, links, groups), (), speed=5.0)
    gap = margins(prepared(scene.mechanism), jnp.asarray(0.0))["wheel"]["apart"]
    assert float(gap.value) == pytest.approx(1 - 0.3 / 0.32, rel=1e-14)
    scene = lj.design.changed(scene, {"fixed.D.x": 0.29})
    with pytest.raises(lj.MachineError, match="'wheel' has pulleys that are too close to each other for their belt"):
        lj.analyse(scene, angles=12)


BARS = {name: Link(length=0.1, mass=1.0) for name in ("crank", "wheel", "other")}
CRANK = Crank("crank", "A", "B")


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Teeth((20, 0)), r"must be two integers from 1 to 100000, but are \(20, 0\)"),
        (lambda: Teeth((20, 20), internal=True), "internal pair must differ in size, but have 20 teeth each"),
        (lambda: Belt(0.0, 0.1), "radius of a belt must be above zero, but is 0.0 m"),
        (lambda: Rack("rack", "R", "A", "crank", "A", -0.1), "radius of a rack must be above zero"),
        (lambda: Pinion("wheel", "D", "rack", "R", 0.1, side=2), "side of a pinion must be 1 or -1"),
        (lambda: Gear("wheel", "B", Teeth((20, 20)), "crank", "A", carrier="crank"), "name another carrier"),
        (lambda: Mechanism(FIXED, BARS, [CRANK, Gear("wheel", "D", Teeth((20, 20)), "other", "A")]),
         "link 'other' is not attached yet; move this group after the one that introduces it"),
        (lambda: Mechanism(FIXED, BARS, [CRANK, Gear("wheel", "D", Teeth((20, 20)), "crank", "B")]),
         "point 'B' is not of the frame"),
        (lambda: Mechanism(FIXED, BARS, [CRANK, Gear("wheel", "B", Teeth((20, 20)), "crank", "A")]),
         "point 'B' is not of the frame"),
        (lambda: Teeth((20, 20), pressure_angle=20.0), "must be from 0 to 60 degrees, but is 20.0 rad"),
        (lambda: Belt(0.1, 0.1, tension=-5.0), "the slack strand of a belt must not be negative, but is -5.0 N"),
        (lambda: Rack("rack", "R", Guide("A", on="crank"), "crank", "B", 0.1), "slides on 'crank', its own gear"),
        (lambda: Gear("wheel", "D", Teeth((20, 20)), "wheel", "A"), "in mesh with itself"),
        (lambda: Mechanism(FIXED, {"crank": BARS["crank"], "other": Link(mass=1.0)}, [
            CRANK, Rack("other", "A", "D", "crank", "A", 0.05)]), "point name 'A' is already used"),
        (lambda: Mechanism(FIXED, BARS, [CRANK, Pinion("wheel", "D", "crank", "B", 0.05)]),
         "'crank' does not slide along 'frame'; it slides along: nothing"),
        (lambda: lj.Scene(Mechanism(FIXED, {**BARS, "wheel": Link(mass=1.0), "other": Link(mass=1.0)}, [
            CRANK, Gear("wheel", "D", Teeth((20, 20)), "crank", "A"), Rack("other", "R", "D", "wheel", "D", 0.05)])),
         "'wheel' turns -1 times in a cycle, so the rack does not return"),
        (lambda: General((("wheel", ("D",)),), ("D",), {}, gears=(Gear("wheel", "E", Teeth((20, 20)), "crank", "A"),)),
         "the group of wheel: a gear turns about 'E', which is not a pin of 'wheel'; its pins are D"),
        (lambda: General((("wheel", ("D",)), ("rack", ("R",))), ("D",), {}, (Slot("rack", "D"),), gears=(
            Gear("wheel", "D", Teeth((20, 20)), "crank", "A"), Rack("rack", "R", "A", "wheel", "D", 0.05))),
         "the rack 'rack' has no slot; add a slot along the same guide"),
        (lambda: lj.Scene(Mechanism(FIXED, {"crank": BARS["crank"], "wheel": Link(mass=1.0), "rack": Link(mass=1.0)}, [
            CRANK, General((("wheel", ("D",)), ("rack", ("R",))), ("D",), {"R": Vec(0.3, 0.05)}, (Slot("rack", "D"),),
            gears=(Gear("wheel", "D", Teeth((20, 20)), "crank", "A"), Rack("rack", "R", "D", "wheel", "D", 0.05)))])),
         "'wheel' turns -1 times in a cycle, so the rack does not return"),
    ],
)  # fmt: skip
def test_refused(make, told):
    """Invalid gears, and gears that are attached to nothing."""
    with pytest.raises((ValueError, StructureError), match=told):
        make()


def drawn(drive: Drive, racks=(), gears=None, **more) -> Mechanism:
    """A five-bar with a press and a lever on a rack, as links and joints."""
    pins = {"crank": ("A", "B"), "wheel": ("D", "C"), "left": ("B", "P"), "right": ("C", "P"), "rod": ("P", "U"),
            "ram": ("U",), "sector": ("W", "V")}  # fmt: skip
    lengths = {"crank": 0.06, "wheel": 0.05, "left": 0.25, "right": 0.22, "rod": 0.42, "ram": 0.0, "sector": 0.06}
    links = {name: Link(length=lengths[name], mass=1.0, pins=at) for name, at in pins.items()}
    fixed = {**FIXED, "G": Vec(0.2, -0.1), "W": Vec(0.42, -0.06)}
    sketch = {"B": (0.06, 0.0), "C": (0.347, 0.017), "P": (0.2, 0.2), "U": (0.5, -0.1)}
    gears = [GearPair("wheel", "crank", Teeth((30, 30)), 0.35)] if gears is None else gears
    racks = racks or [RackPair("ram", "sector", 0.04, start=0.25)]
    return linkage(fixed, links, drive, [Slot("ram", Guide("G"))], sketch, gears=gears, racks=racks, **more)


def test_drawn_with_gears():
    """The parts of a machine that is drawn, its mobility, and the same motion when the other gear drives."""
    mechanism = drawn(Drive("crank"))
    assert mechanism.formula() == "I1(crank) → G(wheel) → II1(left, right) → II2(rod, ram) → G(sector)"
    found = structure(mechanism)
    assert found.mobility == 1 and found.mobility_formula() == "W = 3 n - 2 p - h = 3·7 - 2·9 - 2 = 1"
    assert found.formula(letters=True).startswith("R(crank) → RG(wheel) → RRR(left, right)")
    other = drawn(Drive("wheel", rotation="cw", phase=0.35))
    assert other.formula().startswith("I1(wheel) → G(crank) → II1(left, right)")
    one, two = at(mechanism), at(other)
    for name in ("B", "C", "P", "U", "V"):
        for a, b in zip(one.points[name], two.points[name], strict=True):
            np.testing.assert_allclose((a.x, a.y), (b.x, b.y), atol=2e-15)


def test_a_rack_that_drives():
    """The ram driven along its guide: the gears follow from the far side, by the chain rule."""
    mechanism, phi = drawn(Drive("crank")), jnp.asarray(1.2)
    here = pose(mechanism, phi)
    far = float(here.points["U"].r.x) - 0.2
    links = {name: mechanism.links[name] for name in ("ram", "sector")}
    by_ram = linkage(
        {"G": Vec(0.2, -0.1), "W": Vec(0.42, -0.06)},
        links,
        Drive("ram", law=lj.Harmonic(far, far + 0.02)),
        [Slot("ram", Guide("G"))],
        racks=[RackPair("ram", "sector", 0.04, start=0.25)],
    )
    assert by_ram.formula() == "I1(ram) → G(sector)"
    there = pose(by_ram, jnp.asarray(0.0))
    np.testing.assert_allclose(xy(there.points["V"].r), xy(here.points["V"].r), atol=1e-15)
    by_wheel = linkage(
        {"G": Vec(0.2, -0.1), "W": Vec(0.42, -0.06)},
        links,
        Drive("sector", law=lj.Harmonic(0.1, 0.4)),
        [Slot("ram", Guide("G"))],
        {"U": (0.454, -0.1)},
        racks=[RackPair("ram", "sector", 0.04, start=0.25)],
    )
    assert by_wheel.formula() == "I1(sector) → G(ram)"
    turned = pose(by_wheel, jnp.asarray(0.0))
    assert float(turned.points["U"].r.x) == pytest.approx(0.2 + 0.25 + 0.04 * 0.1, abs=1e-15)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"gears": [GearPair("wheel", "crnk", Teeth((30, 30)))]}, "link 'crnk' is not defined; did you mean 'crank'"),
        (
            {"gears": [GearPair("wheel", "ram", Teeth((30, 30)))]},
            "'wheel' and 'ram' are in mesh, but have no common carrier",
        ),
        ({"gears": []}, "with the drive held, .* can still move at"),
        ({"racks": [RackPair("rod", "sector", 0.04)]}, "'rod' is a rack, but is not the block of any slot"),
        ({"racks": [RackPair("ram", "rod", 0.04)]}, "its gear 'rod' is not pinned to 'frame'"),
    ],
)
def test_drawn_wrong(change, told):
    """Errors in drawings with gears."""
    with pytest.raises(StructureError, match=told):
        drawn(Drive("crank"), **change)


@pytest.mark.parametrize("lean", [175.0, 185.0])
def test_a_train_over_an_idler(lean):
    """Gears with one pin; after them a dyad with its pin as sketched, for every revolution of the gears."""
    pins = {"crank": ("A", "B"), "idler": ("D",), "wheel": ("E", "C"), "left": ("B", "P"), "right": ("C", "P")}
    lengths = {"crank": 0.05, "wheel": 0.05, "left": 0.4, "right": 0.4}
    links = {name: Link(length=lengths.get(name, 0.0), mass=1.0, pins=at) for name, at in pins.items()}
    gears = [GearPair("idler", "crank", Teeth((20, 20)), math.radians(lean)),
             GearPair("wheel", "idler", Teeth((40, 20)), 0.1)]  # fmt: skip
    fixed = {"A": (0.0, 0.0), "D": (0.2, 0.0), "E": (0.4, 0.0)}
    found = linkage(fixed, links, Drive("crank"), (), {"B": (0.05, 0.0), "P": (0.2, 0.3)}, gears=gears)
    here = pose(found, jnp.asarray(0.0))
    angle = 0.1 - 0.5 * math.radians(lean)
    assert float(here.links["wheel"].angle) == pytest.approx(angle, abs=1e-15)
    np.testing.assert_allclose(
        xy(here.points["C"].r), [0.4 + 0.05 * math.cos(angle), 0.05 * math.sin(angle)], atol=1e-15
    )
    assert float(here.points["P"].r.y) > 0


def test_racks_in_any_order():
    """One that drives, and one that is driven."""
    links = {
        "one": Link(mass=1.0, pins=("U",)),
        "wheel": Link(mass=1.0, pins=("D",)),
        "two": Link(mass=1.0, pins=("V",)),
    }
    slots = [Slot("one", Guide("A")), Slot("two", Guide("A", 0.0, 0.2))]
    racks = [RackPair("one", "wheel", 0.1, start=0.05), RackPair("two", "wheel", 0.1, -1, start=0.02)]
    for given in (racks, racks[::-1]):
        found = linkage({"A": (0.0, 0.0), "D": (0.3, 0.1)}, links, Drive("one", law=lj.Harmonic(0.06, 0.2)), slots,
                        racks=given)  # fmt: skip
        assert found.formula() == "I1(one) → G(wheel) → G(two)"
        at_end = pose(found, jnp.asarray(math.pi))
        assert float(at_end.links["wheel"].angle) == pytest.approx(1.5, rel=1e-14)  # one 0.15 m ahead of its start
        np.testing.assert_allclose(xy(at_end.points["V"].r), [0.02 - 0.15, 0.2], atol=1e-15)


def test_a_rack_that_stands_elsewhere_than_sketched():
    """Its position follows from its start and its gear; the reported start agrees with the sketch."""
    links = {"wheel": Link(length=0.2, mass=1.0, pins=("D", "E")), "rack": Link(mass=1.0, pins=("V",))}

    def made(start: float) -> lj.Mechanism:
        racks = [RackPair("rack", "wheel", 0.1, start=start)]
        drive = Drive("wheel", law=lj.Harmonic(2.0, 2.5))
        return linkage({"A": (0.0, 0.0), "D": (0.3, 0.1)}, links, drive, [Slot("rack", Guide("A"))],
                       {"V": (0.35, 0.0)}, racks=racks)  # fmt: skip

    told = r'is 0\.3 m along its guide at crank angle zero, but is drawn at 0\.35 m; write start = "0\.15 m", delete it'
    with pytest.raises(StructureError, match=f"rack rack: with this start it {told}"):
        made(0.1)
    assert float(pose(made(0.15), jnp.asarray(0.0)).points["V"].r.x) == pytest.approx(0.35, abs=1e-15)


def test_written_and_read_back():
    """A drawn machine with gears as a scene file, to the last bit."""
    same(lj.Scene(drawn(Drive("crank")), (), speed=5.0))
