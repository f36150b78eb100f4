"""The machines that the physics tests share, and their transformations: mirrored, scaled, moved."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from linkjax import (
    PRP,
    RPP,
    RPR,
    RRP,
    RRR,
    Crank,
    Flywheel,
    Force,
    Guide,
    Link,
    Mechanism,
    OpposingForce,
    OpposingTorque,
    Torque,
    Vec,
    Window,
)
from linkjax.friction import GuideFriction, PinFriction
from linkjax.groups import Belt, Gear, General, Pinion, Rack, Slot, Teeth
from linkjax.kinematics import min_margin

BUILT_IN = ("hay-press", "hay-press-slider", "slider-crank", "four-bar", "quick-return", "scotch-yoke")
# of these and the next, those whose parts others have
ALIKE = ("hay-press-slider", "quick-return", "two-on-one-crank", "coupler-points", "rolling")
COMPOSED = (
    "two-on-one-crank",
    "coupler-points",
    "clockwise",
    "slotted-levers",
    "moving-guides",
    "triad",
    "geared",
    "rolling",
)
PRESCRIBED = ("swinging", "hydraulic")  # by a motion law


def turn(degrees: float) -> float:
    return math.radians(degrees)


def _two_on_one_crank() -> lj.Scene:
    """Two sliders, on inclined guides, and a dyad, all on the pin of one crank."""
    links = {
        "crank": Link(length=0.11, mass=2.0, inertia=0.01, centre=Vec(0.02, -0.01)),
        "rod1": Link(length=0.42, mass=1.5, inertia=0.02, centre=Vec(0.2, 0.01), points={"K": Vec(0.1, 0.12)}),
        "ram": Link(mass=4.0, centre=Vec(0.03, 0.02)),
        "rod2": Link(length=0.38, mass=1.2, inertia=0.015, centre=Vec(0.15, 0.0)),
        "pump": Link(mass=2.5, centre=Vec(-0.02, 0.01)),
        "coupler": Link(length=0.4, mass=1.1, inertia=0.02, centre=Vec(0.2, 0.03)),
        "rocker": Link(length=0.3, mass=1.3, inertia=0.01, centre=Vec(0.12, -0.02)),
    }
    groups = [
        Crank("crank", "A", "B"),
        RRP("rod1", "ram", "B", "D", Guide("A", turn(20.0), 0.02)),
        RRP("rod2", "pump", "B", "P", Guide("C", turn(-65.0), -0.015), -1),
        RRR(("coupler", "rocker"), "B", "F", "G", 1),
    ]
    fixed = {"A": Vec(0.05, -0.02), "C": Vec(0.02, 0.03), "F": Vec(-0.25, -0.2)}
    loads = (
        OpposingForce("press", "ram", "D", magnitude=900.0, window=Window(turn(200.0), turn(20.0)), reacts_on="frame"),
        Force("cut", "rod1", "K", force=Vec(30.0, -80.0)),
        OpposingTorque("brake", "rocker", magnitude=9.0),
    )
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(1.2)), loads, Vec(0.0, -9.81), 30.0, 0.05, title="Two")


def _coupler_points() -> lj.Scene:
    """Groups attached to coupler points: a dyad on the coupler of a four-bar, a slider on the rocker of that dyad."""
    links = {
        "crank": Link(length=0.1, mass=1.0, inertia=0.004, centre=Vec(0.03, 0.0)),
        "coupler": Link(length=0.35, mass=1.4, inertia=0.02, centre=Vec(0.16, 0.03), points={"E": Vec(0.2, 0.14)}),
        "rocker": Link(length=0.25, mass=1.6, inertia=0.012, centre=Vec(0.12, 0.01), points={"H": Vec(0.1, -0.08)}),
        "arm": Link(length=0.3, mass=0.9, inertia=0.01, centre=Vec(0.1, 0.0), points={"T": Vec(0.15, -0.1)}),
        "lever": Link(length=0.26, mass=1.2, inertia=0.011, centre=Vec(0.1, 0.02), points={"M": Vec(0.2, 0.05)}),
        "rod": Link(length=0.5, mass=1.0, inertia=0.02, centre=Vec(0.25, 0.0)),
        "slide": Link(mass=3.0, centre=Vec(0.0, 0.04)),
    }
    groups = [
        Crank("crank", "A", "B", phase=0.4),
        RRR(("coupler", "rocker"), "B", "D", "C", 1),
        RRR(("arm", "lever"), "E", "F", "G", -1),
        RRP("rod", "slide", "M", "P", Guide("F", turn(100.0), 0.03)),
    ]
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(0.38, 0.02), "F": Vec(0.45, 0.4)}
    loads = (
        OpposingForce("tool", "arm", "T", magnitude=120.0, window=Window(turn(30.0), turn(190.0))),
        Force("push", "rocker", "H", force=Vec(-40.0, 25.0), window=Window(turn(300.0), turn(80.0)), reacts_on="frame"),
        Torque("motor", "crank", torque=1.5),
    )
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.5)), loads, Vec(1.0, -9.5), 25.0, 0.05, title="Coupler")


def _clockwise() -> lj.Scene:
    """A clockwise crank with a phase, off the origin; an inclined guide, offset and reversed; right-hand dyad."""
    links = {
        "crank": Link(
            length=0.08, mass=1.0, inertia=0.003, centre=Vec(0.02, 0.01), reference_length=0.1, mass_properties="scaled"
        ),
        "rod": Link(length=0.31, mass=1.1, inertia=0.01, centre=Vec(0.12, 0.02), points={"E": Vec(0.2, -0.09)}),
        "block": Link(mass=2.2, centre=Vec(0.02, -0.03)),
        "bar": Link(
            length=0.28, mass=0.8, inertia=0.008, centre=Vec(0.1, 0.0), points={"N": Vec(0.1, 0.06)},
            reference_length=0.25, mass_properties="scaled",
        ),
        "rocker": Link(length=0.24, area=6e-4, density=7850.0, mass_properties="section"),
    }  # fmt: skip
    groups = [
        Crank("crank", "O", "B", "cw", phase=0.7),
        RRP("rod", "block", "B", "D", Guide("O", turn(35.0), 0.012), -1),
        RRR(("bar", "rocker"), "E", "F", "G", -1),
    ]
    fixed = {"O": Vec(0.3, -0.2), "F": Vec(-0.05, -0.02)}
    loads = (
        OpposingForce("saw", "block", "D", magnitude=200.0),
        OpposingTorque("rub", "rocker", magnitude=4.0, window=Window(turn(100.0), turn(260.0)), reacts_on="frame"),
        Force("pull", "bar", "N", force=Vec(15.0, 10.0), window=Window(turn(10.0), turn(170.0))),
    )
    return lj.Scene(
        Mechanism(fixed, links, groups, Flywheel(0.4)), loads, Vec(0.0, -9.81), 40.0, 0.05, title="Clockwise"
    )


def _slotted_levers() -> lj.Scene:
    """A lever with an eccentric slot about the frame drives a ram; a cylinder oscillates about the ram, its rod on a
    point of the lever, reversed."""
    links = {
        "crank": Link(length=0.12, mass=3.0, inertia=0.01, centre=Vec(0.03, 0.01)),
        "lever": Link(length=0.75, mass=6.0, inertia=0.3, centre=Vec(0.35, 0.02), points={"K": Vec(0.5, 0.1)}),
        "die": Link(mass=1.2, inertia=0.004, centre=Vec(0.02, -0.01)),
        "rod": Link(length=0.3, mass=1.5, inertia=0.01, centre=Vec(0.15, 0.0)),
        "ram": Link(mass=20.0, centre=Vec(0.05, 0.02)),
        "barrel": Link(length=0.2, mass=2.5, inertia=0.02, centre=Vec(-0.1, 0.01), points={"N": Vec(0.1, 0.05)}),
        "piston": Link(mass=1.0, inertia=0.01, centre=Vec(0.1, 0.0)),
    }
    groups = [
        Crank("crank", "O", "B"),
        RPR("lever", "die", "B", "P", "E", offset=0.03),
        RRP("rod", "ram", "E", "R", "T", -1),
        RPR("barrel", "piston", "K", "R", "Q", -1, offset=-0.02),
    ]
    fixed = {"O": Vec(0.0, 0.0), "P": Vec(0.02, -0.35), "T": Vec(0.0, 0.38)}
    loads = (
        OpposingForce("cut", "ram", "R", magnitude=2000.0, window=Window(turn(20.0), turn(160.0)), reacts_on="frame"),
        Force("pull", "barrel", "N", force=Vec(-30.0, 40.0)),
        OpposingTorque("rub", "lever", magnitude=12.0),
        Torque("twist", "piston", torque=3.0, window=Window(turn(200.0), turn(300.0))),
    )
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(2.0)), loads, Vec(0.0, -9.81), 12.0, 0.05, title="Levers")


def _moving_guides() -> lj.Scene:
    """On the rocker of a four-bar: a guide with a slider, and a slider with a slot driven by the crank; a pin between
    a slot of the coupler and one of the frame; a dyad on the slider with the slot."""
    links = {
        "crank": Link(length=0.1, mass=1.0, inertia=0.004, centre=Vec(0.03, 0.0)),
        "coupler": Link(length=0.35, mass=1.4, inertia=0.02, centre=Vec(0.16, 0.03), points={"E": Vec(0.2, 0.14)}),
        "rocker": Link(length=0.25, mass=1.6, inertia=0.012, centre=Vec(0.12, 0.01), points={"H": Vec(0.1, -0.08)}),
        "rod": Link(length=0.3, mass=0.9, inertia=0.01, centre=Vec(0.14, 0.01)),
        "block": Link(mass=1.2, inertia=0.003, centre=Vec(0.02, 0.01), points={"K": Vec(0.05, 0.02)}),
        "slide": Link(mass=2.0, inertia=0.008, centre=Vec(0.03, -0.02), points={"N": Vec(0.06, 0.05)}),
        "die": Link(mass=0.4, inertia=0.001, centre=Vec(0.01, 0.0)),
        "stone": Link(mass=0.5, inertia=0.002, centre=Vec(0.0, 0.01)),
        "shoe": Link(mass=0.7, inertia=0.001, centre=Vec(0.02, 0.0)),
        "bar": Link(length=0.4, mass=0.8, inertia=0.01, centre=Vec(0.2, 0.0), points={"T": Vec(0.2, 0.06)}),
        "lever": Link(length=0.3, mass=1.0, inertia=0.009, centre=Vec(0.12, 0.02)),
    }
    groups = [
        Crank("crank", "A", "B", phase=0.4),
        RRR(("coupler", "rocker"), "B", "D", "C"),
        RRP("rod", "block", "E", "P", Guide("D", 0.3, 0.02, "rocker"), -1),
        RPP("slide", "die", "B", "Q", Guide("H", -0.4, 0.03, "rocker"), 1.9, -0.015),
        PRP(("stone", "shoe"), "M", (Guide("E", 1.2, 0.01, "coupler"), Guide("D", 0.1, -0.02)), -1),
        RRR(("bar", "lever"), "N", "F", "G", -1),
    ]
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(0.38, 0.02), "F": Vec(0.35, 0.45)}
    loads = (
        OpposingForce("tool", "shoe", "M", magnitude=60.0, window=Window(turn(30.0), turn(190.0))),
        Force("push", "block", "K", force=Vec(-40.0, 25.0), window=Window(turn(300.0), turn(80.0)), reacts_on="frame"),
        OpposingTorque("rub", "lever", magnitude=4.0),
        Torque("twist", "slide", torque=1.5),
    )
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.5)), loads, Vec(1.0, -9.5), 20.0, 0.05, title="Guides")


def _triad() -> lj.Scene:
    """A plate on three bars, one of which is moved by the crank (class III), with a slider on a corner of the plate."""
    links = {
        "crank": Link(length=0.045, mass=1.0, inertia=0.002, centre=Vec(0.02, 0.0)),
        "plate": Link(length=0.25, mass=2.0, inertia=0.02, centre=Vec(0.12, 0.05), points={"G": Vec(0.1, 0.2)}),
        "bar1": Link(length=0.3, mass=0.8, inertia=0.006, centre=Vec(0.15, 0.0)),
        "bar2": Link(length=0.32, mass=0.9, inertia=0.007, centre=Vec(0.15, 0.01)),
        "bar3": Link(length=0.35, mass=0.7, inertia=0.006, centre=Vec(0.17, 0.0), points={"T": Vec(0.2, 0.05)}),
        "rod": Link(length=0.3, mass=0.6, inertia=0.005, centre=Vec(0.15, 0.0)),
        "ram": Link(mass=2.0, centre=Vec(0.02, 0.01)),
    }
    triad = General(
        (("plate", ("E", "F", "G")), ("bar1", ("B", "E")), ("bar2", ("C", "F")), ("bar3", ("D", "G"))),
        ("B", "C", "D"), {"E": Vec(0.15, 0.28), "F": Vec(0.4, 0.25), "G": Vec(0.25, 0.45)},
    )  # fmt: skip
    groups = [Crank("crank", "A", "B"), triad, RRP("rod", "ram", "G", "P", Guide("D", 2.8, 0.1))]
    fixed = {"A": Vec(0.0, 0.0), "C": Vec(0.55, -0.05), "D": Vec(0.3, 0.75)}
    loads = (
        OpposingForce("press", "ram", "P", magnitude=60.0, window=Window(turn(40.0), turn(200.0)), reacts_on="frame"),
        Force("pull", "plate", "G", force=Vec(10.0, -30.0)),
        OpposingTorque("rub", "bar2", magnitude=3.0),
    )
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.5)), loads, Vec(0.0, -9.81), 20.0, 0.05, title="Triad")


def _swinging() -> lj.Scene:
    """A crank that oscillates between two angles moves an offset four-bar, and a slider."""
    links = {
        "crank": Link(length=0.2, mass=1.0, inertia=0.01, centre=Vec(0.1, 0.01)),
        "coupler": Link(length=0.5, mass=1.4, inertia=0.02, centre=Vec(0.25, 0.03), points={"E": Vec(0.3, 0.1)}),
        "rocker": Link(length=0.4, mass=1.6, inertia=0.012, centre=Vec(0.2, 0.01)),
        "rod": Link(length=0.45, mass=0.9, inertia=0.01, centre=Vec(0.2, 0.0)),
        "ram": Link(mass=3.0, centre=Vec(0.02, 0.01)),
    }
    groups = [
        Crank("crank", "A", "B", phase=0.2, law=lj.Harmonic(0.3, 1.9)),
        RRR(("coupler", "rocker"), "B", "D", "C"),
        RRP("rod", "ram", "E", "P", Guide("D", 0.4, 0.1)),
    ]
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(0.5, 0.02)}
    loads = (
        OpposingForce("press", "ram", "P", magnitude=80.0, window=Window(turn(20.0), turn(150.0))),
        Force("pull", "coupler", "E", force=Vec(10.0, -20.0)),
        OpposingTorque("rub", "rocker", magnitude=5.0, reacts_on="frame"),
    )
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.3)), loads, Vec(0.0, -9.81), 8.0, title="Swinging")


def _hydraulic() -> lj.Scene:
    """A linear driver on an inclined, offset guide moves a lever, and a lever with a slot."""
    links = {
        "ram": Link(mass=3.0, inertia=0.01, centre=Vec(-0.1, 0.01), points={"K": Vec(0.05, 0.04)}),
        "bar": Link(length=0.5, mass=1.4, inertia=0.02, centre=Vec(0.25, 0.03)),
        "lever": Link(length=0.4, mass=1.6, inertia=0.012, centre=Vec(0.2, 0.01), points={"T": Vec(0.3, 0.1)}),
        "arm": Link(length=0.5, mass=1.1, inertia=0.012, centre=Vec(0.2, 0.0)),
        "die": Link(mass=0.4, inertia=0.001, centre=Vec(0.01, 0.0)),
    }
    groups = [
        lj.LinearDriver("ram", "B", Guide("A", 0.2, 0.1), lj.Harmonic(0.02, 0.14)),
        RRR(("bar", "lever"), "B", "D", "C"),
        RPR("arm", "die", "K", "F", "G", -1, 0.02),
    ]
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(0.5, 0.0), "F": Vec(0.1, -0.3)}
    loads = (
        OpposingForce("weight", "lever", "T", magnitude=90.0, window=Window(turn(10.0), turn(170.0))),
        Torque("spring", "arm", torque=-6.0),
        Force("push", "ram", "K", force=Vec(-30.0, 5.0), window=Window(turn(200.0), turn(300.0)), reacts_on="frame"),
    )
    return lj.Scene(Mechanism(fixed, links, groups), loads, Vec(0.5, -9.81), 6.0, title="Hydraulic")


def _geared() -> lj.Scene:
    """Gears of all kinds: a five-bar between crank and gear, one inside a ring gear of the frame on the crank pin, one
    on a lever around a fixed gear, a belt from that lever, racks, and a pinion."""

    def link(length: float, mass: float, **points: Vec) -> Link:
        return Link(length=length, mass=mass, inertia=0.02 * mass * (0.2 + length) ** 2,
                    centre=Vec(0.4 * length + 0.01, 0.01), points=points)  # fmt: skip

    links = {
        "crank": link(0.06, 1.0), "wheel": link(0.05, 1.5), "left": link(0.25, 0.8), "right": link(0.22, 0.7),
        "planet": link(0.06, 0.9, K=Vec(0.01, 0.04)), "coupler": link(0.3, 1.0), "lever": link(0.2, 1.2),
        "pulley": link(0.07, 1.1), "rack": link(0.0, 1.4), "sector": link(0.08, 0.6), "idler": link(0.0, 0.5),
        "slide": link(0.0, 0.6),
    }  # fmt: skip
    groups = [
        Crank("crank", "A", "B"),
        Gear("wheel", "D", Teeth((30, 30)), "crank", "A", "C", 0.4),
        RRR(("left", "right"), "B", "C", "P", 1),
        Gear("planet", "B", Teeth((20, 40), internal=True), "frame", "A", "Q", 0.3, "crank"),
        RRR(("coupler", "lever"), "P", "E", "R", -1),
        Gear("pulley", "F", Belt(0.03, 0.05, tension=40.0), "lever", "E", "T", 0.2),
        Rack("rack", "U", Guide("F", -0.3, 0.02), "pulley", "F", 0.03, -1, 0.1),
        Pinion("sector", "G", "rack", "U", 0.04, 1, "V", 0.1),
        Gear("idler", "R", Teeth((25, 35), pressure_angle=0.4), "frame", "E", None, 0.5, "lever"),
        Rack("slide", "W", Guide("R", 0.8, 0.01, "lever"), "idler", "R", 0.02, 1, 0.05),
    ]
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(0.3, 0.0), "E": Vec(0.45, 0.3), "F": Vec(0.6, 0.35), "G": Vec(0.8, 0.1)}
    loads = (
        OpposingForce("press", "rack", "U", magnitude=30.0, window=Window(turn(40.0), turn(200.0)), reacts_on="frame"),
        Force("pull", "planet", "K", force=Vec(10.0, -30.0)),
        Force("weight", "sector", "V", force=Vec(5.0, -20.0)),
        OpposingTorque("rub", "pulley", magnitude=1.0),
    )
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.3)), loads, Vec(0.0, -9.81), 15.0, 0.05, title="Gears")


def _rolling() -> lj.Scene:
    """A lever with a gear that rolls on one of the frame and moves a rack along the lever, and a pulley on its other
    arm with a belt to the frame: the crank moves the rack by a rod, so all are solved simultaneously."""

    def link(length: float, mass: float, **points: Vec) -> Link:
        return Link(length=length, mass=mass, inertia=0.02 * mass * (0.2 + length) ** 2,
                    centre=Vec(0.4 * length + 0.01, 0.01), points=points)  # fmt: skip

    links = {
        "crank": link(0.05, 1.0), "lever": link(0.2, 1.5, F=Vec(-0.12, 0.05)), "wheel": link(0.04, 0.8),
        "rack": link(0.0, 1.2), "rod": link(0.35, 0.9), "pulley": link(0.06, 0.7), "coupler": link(0.4, 1.0),
        "slide": link(0.0, 2.0),
    }  # fmt: skip
    along = Guide("E", 0.3, 0.04, "lever")
    members = {"lever": "DEF", "wheel": "ET", "rack": "U", "rod": "BU", "pulley": "FV"}
    sketch = {"E": (0.5, 0.1), "F": (0.2, 0.15), "T": (0.54, 0.1), "U": (0.4, 0.1), "V": (0.2, 0.2)}
    together = General(
        tuple((name, tuple(pins)) for name, pins in members.items()), ("B", "D"),
        {name: Vec(*at) for name, at in sketch.items()}, (Slot("rack", along),),
        gears=(
            Gear("wheel", "E", Teeth((20, 36)), "frame", "D", None, 0.4, "lever"),
            Rack("rack", "U", along, "wheel", "E", 0.05, -1, -0.1),
            Gear("pulley", "F", Belt(0.03, 0.05, crossed=True, tension=30.0), "frame", "D", None, 0.7, "lever"),
        ),
    )  # fmt: skip
    groups = [Crank("crank", "A", "B"), together, RRP("coupler", "slide", "V", "W", Guide("A", 0.1, -0.05))]
    fixed = {"A": Vec(0.05, 0.1), "D": Vec(0.3, 0.0)}
    loads = (
        OpposingForce("press", "rack", "U", magnitude=30.0, window=Window(turn(40.0), turn(200.0)), reacts_on="frame"),
        Force("pull", "wheel", "T", force=Vec(10.0, -30.0)),
        OpposingTorque("rub", "pulley", magnitude=1.0),
    )
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(0.3)), loads, Vec(0.0, -9.81), 12.0, 0.05, title="Rolling")


@functools.cache
def machine(name: str) -> lj.Scene:
    """A built-in scene, or one composed here."""
    made = _two_on_one_crank, _coupler_points, _clockwise, _slotted_levers, _moving_guides, _triad, _geared, _rolling
    made = *made, _swinging, _hydraulic
    composed = dict(zip((*COMPOSED, *PRESCRIBED), made, strict=True))
    return composed[name]() if name in composed else lj.load(name)


def mirrored(mechanism: Mechanism) -> Mechanism:
    """The mirror image in the x axis; the crank rotates in the opposite sense."""

    def flip(at: Vec) -> Vec:
        return Vec(at.x, -at.y)

    def link(old: Link) -> Link:
        points = {name: flip(at) for name, at in old.points.items()}
        return dataclasses.replace(old, centre=flip(old.centre), points=points)

    def flipped(guide: Guide) -> Guide:
        return dataclasses.replace(guide, along=-guide.along, offset=-guide.offset)

    def group(old):
        if isinstance(old, Crank) and isinstance(old.law, lj.Harmonic):
            assert old.law.start is not None
            law = lj.Harmonic(-old.law.start, -old.law.stop)
            return dataclasses.replace(old, law=law, phase=-old.phase)
        if isinstance(old, lj.LinearDriver):
            return dataclasses.replace(old, guide=flipped(old.guide))
        if isinstance(old, Crank):
            return dataclasses.replace(old, rotation="cw" if old.rotation == "ccw" else "ccw", phase=-old.phase)
        if isinstance(old, RRP):
            return dataclasses.replace(old, guide=flipped(old.guide))
        if isinstance(old, RPR):
            return dataclasses.replace(old, offset=-old.offset)
        if isinstance(old, RPP):
            return dataclasses.replace(old, guide=flipped(old.guide), slot=-old.slot, offset=-old.offset)
        if isinstance(old, General):
            slots = tuple(dataclasses.replace(slot, guide=flipped(slot.guide)) for slot in old.slots)
            gears = tuple(group(gear) for gear in old.gears)
            sketch = {p: flip(at) for p, at in old.sketch.items()}
            return dataclasses.replace(old, sketch=sketch, slots=slots, gears=gears)
        if isinstance(old, PRP):
            return dataclasses.replace(old, slots=tuple(map(flipped, old.slots)), side=-old.side)
        if isinstance(old, Gear):
            return dataclasses.replace(old, phase=-old.phase)
        if isinstance(old, Rack):
            return dataclasses.replace(old, guide=flipped(old.guide), side=-old.side)
        if isinstance(old, Pinion):
            return dataclasses.replace(old, side=-old.side, phase=-old.phase)
        return dataclasses.replace(old, side=-old.side)

    links = {name: link(mechanism.links[name]) for name in mechanism.link_names}
    fixed = {name: flip(at) for name, at in mechanism.fixed.items()}
    return Mechanism(fixed, links, [group(g) for g in mechanism.groups], mechanism.flywheel)


def resized(scene: lj.Scene, lengths: float = 1.0, masses: float = 1.0, times: float = 1.0) -> lj.Scene:
    """The same machine in other units: every number scaled by its dimension."""
    inertias, forces = masses * lengths**2, masses * lengths / times**2

    def link(old: Link) -> Link:
        own = {"inertia": old.inertia * inertias, "centre": old.centre * lengths}
        if old.uniform:  # which has neither
            own = {"inertia": jnp.zeros(()), "centre": Vec(0.0, 0.0)}
        return dataclasses.replace(
            old, length=old.length * lengths, mass=old.mass * masses, **own,
            points={name: at * lengths for name, at in old.points.items()},
            reference_length=None if old.reference_length is None else old.reference_length * lengths,
            area=None if old.area is None else old.area * lengths**2,
            density=None if old.density is None else old.density * (masses / lengths**3),
        )  # fmt: skip

    def group(old):
        if isinstance(old, PRP):
            return dataclasses.replace(old, slots=tuple(group(slot) for slot in old.slots))
        if isinstance(old, lj.LinearDriver):
            assert isinstance(old.law, lj.Harmonic) and old.law.start is not None
            law = lj.Harmonic(old.law.start * lengths, old.law.stop * lengths)
            return dataclasses.replace(old, guide=group(old.guide), law=law)
        if isinstance(old, Gear) and isinstance(old.mesh, Belt):
            mesh, tension = old.mesh, old.mesh.tension * forces
            return dataclasses.replace(
                old, mesh=Belt(mesh.radius * lengths, mesh.other * lengths, mesh.crossed, tension)
            )
        if isinstance(old, Rack):
            start = old.start * lengths
            return dataclasses.replace(old, radius=old.radius * lengths, start=start, guide=group(old.guide))
        if isinstance(old, Pinion):
            return dataclasses.replace(old, radius=old.radius * lengths)
        if isinstance(old, RRP | RPP):
            old = dataclasses.replace(old, guide=group(old.guide))
        if isinstance(old, General):
            slots = tuple(dataclasses.replace(slot, guide=group(slot.guide)) for slot in old.slots)
            gears = tuple(group(gear) for gear in old.gears)
            drive = old.drive
            if drive is not None and old.driven_slot() is not None:
                assert isinstance(drive.law, lj.Harmonic) and drive.law.start is not None
                law = lj.Harmonic(drive.law.start * lengths, drive.law.stop * lengths)
                phase = None if drive.phase is None else drive.phase * lengths
                drive = dataclasses.replace(drive, phase=phase, law=law)
            sketch = {p: at * lengths for p, at in old.sketch.items()}
            return dataclasses.replace(old, sketch=sketch, slots=slots, gears=gears, drive=drive)
        if isinstance(old, RPR | RPP | Guide):
            return dataclasses.replace(old, offset=old.offset * lengths)
        return old

    def friction(old):
        if isinstance(old, PinFriction):
            thrust = old.thrust
            if thrust is not None:
                own = {"outer": thrust.outer * lengths, "inner": thrust.inner * lengths}
                thrust = dataclasses.replace(thrust, force=thrust.force * forces, **own)
            return dataclasses.replace(old, radius=old.radius * lengths, thrust=thrust)
        if isinstance(old, GuideFriction) and old.length is not None:
            return dataclasses.replace(old, length=old.length * lengths)
        return old

    def window(old):
        if not isinstance(old, lj.Passage) or not old.point:
            return old
        own = {name: getattr(old, name) for name in ("first", "last", "between")}
        return dataclasses.replace(old, **{k: jax.tree.map(lambda x: x * lengths, v) for k, v in own.items()})

    def load(old):
        if getattr(old, "window", None) is not None:
            old = dataclasses.replace(old, window=window(old.window))
        if isinstance(old, lj.Spring):
            return dataclasses.replace(
                old, stiffness=old.stiffness * (forces / lengths), free_length=old.free_length * lengths,
                preload=old.preload * forces,
            )  # fmt: skip
        if isinstance(old, lj.Drag):
            slow = times / lengths
            linear, quadratic = old.linear * (forces * slow), old.quadratic * (forces * slow**2)
            return dataclasses.replace(old, linear=linear, quadratic=quadratic)
        if isinstance(old, Force):
            return dataclasses.replace(old, force=old.force * forces)
        if isinstance(old, lj.Table):
            along, size = lengths if old.over and old.over.point else 1.0, forces if old.point else forces * lengths
            scaled = {"at": [x * along for x in old.at], "values": jax.tree.map(lambda x: x * size, old.values)}
            assert old.coming is None
            return dataclasses.replace(old, **scaled)
        size = forces if isinstance(old, OpposingForce) else forces * lengths
        if isinstance(old, Torque):
            return dataclasses.replace(old, torque=old.torque * size)
        return dataclasses.replace(old, magnitude=old.magnitude * size)

    def motor(old):
        if old is None:
            return None
        assert isinstance(old.motor, lj.InductionMotor)
        rated = dataclasses.replace(
            old.motor, rated_power=old.motor.rated_power * (forces * lengths / times),
            rated_speed=old.motor.rated_speed / times, synchronous_speed=old.motor.synchronous_speed / times,
        )  # fmt: skip
        return dataclasses.replace(old, motor=rated, inertia=old.inertia * inertias)

    m = scene.mechanism
    return dataclasses.replace(
        scene,
        motor=motor(scene.motor),
        mechanism=Mechanism(
            {name: at * lengths for name, at in m.fixed.items()},
            {name: link(m.links[name]) for name in m.link_names},
            [group(g) for g in m.groups],
            Flywheel(m.flywheel.inertia * inertias),
        ),
        loads=tuple(load(old) for old in scene.loads),
        friction=tuple(friction(old) for old in scene.friction),
        gravity=scene.gravity * (lengths / times**2),
        speed=scene.speed / times,
    )


def moved(mechanism: Mechanism, x: float, y: float) -> Mechanism:
    """The same machine elsewhere on the frame."""
    fixed = {name: at + Vec(x, y) for name, at in mechanism.fixed.items()}
    links = {name: mechanism.links[name] for name in mechanism.link_names}

    def group(old):
        if isinstance(old, General):
            return dataclasses.replace(old, sketch={p: at + Vec(x, y) for p, at in old.sketch.items()})
        return old

    return Mechanism(fixed, links, [group(g) for g in mechanism.groups], mechanism.flywheel)


def same_compilation(one, other) -> bool:
    """Whether two trees share their compiled programs."""
    return jax.tree.structure(one) == jax.tree.structure(other)


def array(values) -> jax.Array:
    return jnp.asarray(values, dtype=float)


class Drawn(NamedTuple):
    """The structure of a random group."""

    kind: str
    start: str
    side: int


def composed_at_random(seed: int) -> lj.Scene:
    """A crank and two or three groups of random kinds on random points, that can be assembled with a margin."""
    rng = np.random.default_rng(seed)
    count, margin = int(rng.integers(2, 4)), jax.jit(min_margin)
    structure = [
        Drawn(str(rng.choice(["RRR", "RRP"])), f"P{rng.integers(0, i + 1)}", int(rng.choice([-1, 1])))
        for i in range(count)
    ]
    for _ in range(2000):
        scene = _dimensioned(structure, rng)
        if float(margin(scene.mechanism)) > 0.05:
            return scene
    raise AssertionError("no machine that can be assembled was drawn")


def _dimensioned(structure: list[Drawn], rng: np.random.Generator) -> lj.Scene:
    """Random numbers for a structure; assembly may be impossible."""

    def bar(length: float) -> Link:
        centre = Vec(rng.uniform(0.3, 0.6) * length, rng.uniform(-0.1, 0.1) * length)
        return Link(length=length, mass=rng.uniform(1, 3), inertia=rng.uniform(0.05, 0.2) * length**2, centre=centre)

    fixed = {"A": Vec(0.0, 0.0)}
    links = {"crank": dataclasses.replace(bar(0.1), counterweights={"W": lj.Counterweight(2.0, Vec(-0.05, 0.0), 0.01)})}
    groups: list[lj.groups.AbstractGroup] = [Crank("crank", "A", "P0")]
    loads: list = []
    for i, (kind, start, side) in enumerate(structure, 1):
        if kind == "RRP":
            links[f"rod{i}"], links[f"block{i}"] = bar(rng.uniform(0.3, 0.6)), Link(mass=rng.uniform(1, 3))
            guide = Guide("A", rng.uniform(-3, 3), rng.uniform(-0.03, 0.03))
            groups.append(RRP(f"rod{i}", f"block{i}", start, f"P{i}", guide, side))
            loads.append(OpposingForce(f"load{i}", f"block{i}", f"P{i}", magnitude=rng.uniform(50, 300)))
        else:
            links[f"bar{i}"], links[f"arm{i}"] = bar(rng.uniform(0.25, 0.5)), bar(rng.uniform(0.2, 0.4))
            fixed[f"F{i}"] = Vec(rng.uniform(-0.4, 0.4), rng.uniform(-0.4, 0.4))
            groups.append(RRR((f"bar{i}", f"arm{i}"), start, f"F{i}", f"P{i}", side))
            loads.append(OpposingTorque(f"load{i}", f"arm{i}", magnitude=rng.uniform(2, 10)))
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(2.0)), tuple(loads), Vec(0.0, -9.81), 30.0, title="Random")
