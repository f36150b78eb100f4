# pyright: reportArgumentType=false
"""The same machines in MuJoCo: positions by its constraints, drive torques by its inverse dynamics."""

from __future__ import annotations

import dataclasses

import pytest

import linkjax as lj
from linkjax import Counterweight, Crank, Flywheel, Guide, Link, Mechanism, Vec
from linkjax.groups import General, Slot
from tests.exchange.mujoco_road import check
from tests.physics.machines import BUILT_IN, COMPOSED, PRESCRIBED, machine


@pytest.mark.parametrize("name", [
    pytest.param(n, marks=pytest.mark.slow) if n in ("rolling", "triad", "geared") else n
    for n in (*BUILT_IN, *COMPOSED, *PRESCRIBED)
])  # fmt: skip
def test_known_machines(name, figures):
    check(machine(name), name, figures)


def balanced() -> lj.Scene:
    """A press with a disc and an ideal counterweight."""
    press = machine("hay-press")
    links = {name: press.mechanism.links[name] for name in press.mechanism.link_names}
    disc = Counterweight(mass=12.0, at=Vec(-0.2, 0.02), thickness=0.03, density=7850.0)
    ideal = Counterweight(mass=1.5, at=Vec(-0.1, 0.05), ideal=True)
    for name, piece in (("crank", {"W1": disc, "W2": ideal}), ("rod", {"W3": disc})):
        links[name] = dataclasses.replace(links[name], counterweights=piece)
    m = press.mechanism
    return dataclasses.replace(press, mechanism=Mechanism(m.fixed, links, m.groups, Flywheel(3.0)))


def cross() -> lj.Scene:
    """A bar held by three sliders, two pinned to the frame and one to the crank: only sliding joints on the bar."""
    links = {
        "crank": Link(length=0.1, mass=1.0, inertia=0.01),
        "bar": Link(length=0.5, mass=2.0, inertia=0.05, centre=Vec(0.25, 0.02), points={"K": Vec(0.2, 0.1)}),
        "one": Link(mass=0.4, inertia=0.001, centre=Vec(0.02, 0.0)),
        "two": Link(),
        "three": Link(mass=0.5),
    }
    slots = (Slot("one", Guide("O", on="bar")), Slot("two", Guide("O", 0.1, 0.02, "bar")),
             Slot("three", Guide("K", 1.5, 0.01, "bar")))  # fmt: skip
    group = General(
        (("bar", ("O", "T")), ("one", ("B",)), ("two", ("C",)), ("three", ("D",))),
        ("B", "C", "D"), {"O": Vec(-0.4, 0.0), "T": Vec(0.1, 0.0)}, slots,
    )  # fmt: skip
    fixed = {"A": Vec(0.0, 0.0), "C": Vec(0.6, 0.05), "D": Vec(-0.2, 0.3)}
    return lj.Scene(Mechanism(fixed, links, [Crank("crank", "A", "B"), group]), (), Vec(0.0, -9.81), 10.0)


@pytest.mark.parametrize("made", [balanced, pytest.param(cross, marks=pytest.mark.slow)])
def test_odd_machines(made, figures):
    check(made(), made.__name__, figures)
