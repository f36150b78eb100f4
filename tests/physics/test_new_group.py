"""A structural group written outside linkjax, as a user would: nothing else has to change for it.

The slotted lever of a shaper: a block on the crank pin slides along a lever that oscillates about the frame, and the
lever drives the ram.
"""

from __future__ import annotations

import math
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import RRP, Crank, Flywheel, Link, Mechanism, OpposingForce, Vec, Window
from linkjax._compile import compiled_soon
from linkjax._numerics import safe_sqrt
from linkjax.analysis import document
from linkjax.groups import AbstractGroup, Joint, LinkState, Lost, Margin, PointState, Wrench
from linkjax.kinematics import pose, shortfall, transmission_angles
from linkjax.measures import peak_names
from tests.exchange.mujoco_road import compared


class SlottedLever(AbstractGroup):
    """A `block` pinned at `from_` slides along a `lever` pinned at `about`, the origin of the lever."""

    kind: ClassVar[str] = "slotted lever"

    block: str = eqx.field(static=True)
    lever: str = eqx.field(static=True)
    from_: str = eqx.field(static=True)
    about: str = eqx.field(static=True)
    end: str = eqx.field(static=True)

    def link_names(self):
        return (self.block, self.lever)

    def needs(self):
        return (self.from_, self.about)

    def pins(self):
        return {self.block: (self.from_, None), self.lever: (self.about, self.end)}

    def _reach(self, points):
        """Distance of the block from the lever pivot, its derivatives, and the state of the lever."""
        b, a = points[self.from_], points[self.about]
        d, v, c = b.r - a.r, b.dr - a.dr, b.ddr - a.ddr
        r = safe_sqrt(d.squared())
        u = d / r
        dr, w = v.dot(u), u.cross(v) / r
        return r, dr, c.dot(u) + r * w * w, LinkState(u, w, (u.cross(c) - 2 * dr * w) / r)

    def solve(self, links, states, points, phi):
        state, at, length = self._reach(points)[-1], points[self.about], links[self.lever].length
        arm = state.u * length
        turned = arm.perp()
        end = PointState(at.r + arm, at.dr + turned * state.w, at.ddr + turned * state.e - arm * (state.w * state.w))
        return {self.block: state, self.lever: state}, {self.end: end}

    def singular_positions(self):
        return ("pivot",)

    def margins(self, links, states, points, phi):
        r, dr, ddr, _ = self._reach(points)
        length = links[self.lever].length
        return {"pivot": Margin(r / length, dr / length, ddr / length)}

    def transmission(self, states, points):
        return jnp.full_like(states[self.lever].w, math.pi / 2)

    def joints(self):
        return (
            Joint(self.from_, self.from_, self.block),
            Joint(f"{self.block}.guide", self.from_, self.block, self.lever, slides=True),
            Joint(self.about, self.about, self.lever),
        )

    def react(self, loads, states, points):
        r, _, _, state = self._reach(points)
        on_block, on_lever = loads[self.block], loads[self.lever]
        normal = state.u.perp() * ((on_lever.moment + on_block.moment) / r)
        guide = Wrench(normal, -on_block.moment)
        none = jnp.zeros_like(r)
        return (Wrench(-(on_block.force + normal), none), guide, Wrench(normal - on_lever.force, none)), None


@pytest.fixture(scope="module")
def shaper() -> lj.Scene:
    links = {
        "crank": Link(length=0.12, mass=3.0, inertia=0.01, centre=Vec(0.03, 0.01)),
        "block": Link(mass=1.2, inertia=0.004, centre=Vec(0.02, -0.01)),
        "lever": Link(length=0.75, mass=6.0, inertia=0.3, centre=Vec(0.35, 0.02), points={"K": Vec(0.5, 0.1)}),
        "rod": Link(length=0.3, mass=1.5, inertia=0.01, centre=Vec(0.15, 0.0)),
        "ram": Link(mass=20.0, centre=Vec(0.05, 0.02)),
    }
    groups = [
        Crank("crank", "O", "B"),
        SlottedLever("block", "lever", "B", "P", "E"),
        RRP("rod", "ram", "E", "R", "T", -1),
    ]
    fixed = {"O": Vec(0.0, 0.0), "P": Vec(0.0, -0.35), "T": Vec(0.0, 0.38)}
    cut = OpposingForce("cut", "ram", "R", magnitude=2000.0, window=Window(math.radians(20.0), math.radians(160.0)))
    return lj.Scene(Mechanism(fixed, links, groups, Flywheel(2.0)), (cut,), Vec(0.0, -9.81), 12.0, title="Shaper")


@pytest.mark.slow
def test_the_whole_analysis_holds(shaper):
    cycle = lj.analyse(shaper, angles=72)
    assert shaper.mechanism.formula() == "I1(crank) → II3(block, lever) → II2(rod, ram)"
    assert max(float(check) for check in jax.tree.leaves(cycle.checks)) < 1e-10
    assert cycle.forces.reactions["block.guide"].keys() == {"block", "lever"}
    assert 0 < float(cycle.delta_error) < 1e-6 * float(cycle.delta)
    # the lever is nearest to its singular position when crank and lever are in line
    assert float(cycle.margins["block-lever"]["pivot"].value) == pytest.approx((0.35 - 0.12) / 0.75, rel=1e-12)
    assert float(cycle.work["drive"]) == pytest.approx(-float(cycle.work["cut"]), rel=1e-12)


@pytest.mark.slow
def test_it_can_be_drawn(shaper, tmp_path):
    cycle = lj.analyse(shaper, angles=24)
    assert {p.name for p in lj.viz.write_figures(document(cycle), shaper, tmp_path)} >= {"machine.svg"}
    assert [name for name in peak_names(shaper) if "block" in name] == [
        "peak_reaction.B.block",
        "peak_reaction.block.guide.block",
    ]


class Told(SlottedLever):
    """The same with messages."""

    kind: ClassVar[str] = "slotted lever with messages"

    def lost(self, at):
        return f"is on its pivot at {at.degrees:.1f} degrees", "Move the pivot."

    def shortfall(self, side, links, states, points):
        return f"its block is on {self.about!r}"


def test_what_follows_from_its_joints(shaper):
    lever = shaper.mechanism.groups[1]
    told = Told(lever.block, lever.lever, lever.from_, lever.about, lever.end)
    assert AbstractGroup.needs(told) == told.needs() == ("B", "P")
    assert (told.brings(), told.guides(), told.translating()) == (("E",), (), ())
    assert lj.topology.class_of(told) == lj.topology.class_of(lever) == ("II3", "RPR")
    assert told.driving() is told.as_drive() is told.shaft() is None
    assert not (told.numerical() or told.continues() or told.drive_slides())


def test_its_own_messages(shaper):
    """Where it cannot be assembled, the group itself says why and what to change."""
    driver, lever, ram = shaper.mechanism.groups
    told = Told(lever.block, lever.lever, lever.from_, lever.about, lever.end)
    fixed = {**shaper.mechanism.fixed, "P": Vec(0.0, -0.12)}
    mechanism = Mechanism(fixed, shaper.mechanism.links, (driver, told, ram))
    assert shortfall(mechanism, "block-lever", "pivot", 4.7) == "its block is on 'P'"
    assert told.lost(Lost("pivot", -0.1, 270.0))[1] == "Move the pivot."
    assert lever.lost(Lost("pivot", -0.1, 270.0)) is None  # the general message
    assert lever.lost(Lost("pivot", -0.1, 270.0, "astray"))[0].startswith("does not return")


def test_positions_and_rates(shaper):
    """The lever angle in closed form, every rate by nested differentiation."""
    phi = jnp.linspace(0.1, 6.2, 17)

    @compiled_soon
    def sheet(mechanism, phi):
        def place(phi):
            here = pose(mechanism, phi)
            return {name: at.r for name, at in here.points.items()}, {name: at.u for name, at in here.links.items()}

        def slope(phi):
            return jax.jvp(place, (phi,), (jnp.ones_like(phi),))[1]

        def at(phi):
            return (
                pose(mechanism, phi),
                transmission_angles(mechanism, phi),
                *jax.jvp(slope, (phi,), (jnp.ones_like(phi),)),
            )

        return jax.vmap(at)(phi)

    here, transmission, (first, turning), (second, _) = sheet(shaper.mechanism, phi)
    lever = here.links["lever"]
    expected = np.arctan2(0.35 + 0.12 * np.sin(phi), 0.12 * np.cos(phi))
    np.testing.assert_allclose(np.arctan2(lever.u.y, lever.u.x), expected, rtol=1e-13)
    for name, at in here.points.items():
        for got, wanted in ((at.dr, first[name]), (at.ddr, second[name])):
            np.testing.assert_allclose(got.x, wanted.x, rtol=0, atol=1e-12)
            np.testing.assert_allclose(got.y, wanted.y, rtol=0, atol=1e-12)
    for name, at in here.links.items():
        np.testing.assert_allclose(at.u.cross(turning[name]), at.w, rtol=0, atol=1e-13)
    np.testing.assert_allclose(transmission["block-lever"], math.pi / 2)


@pytest.mark.slow
def test_gradients_flow_through_it(shaper):
    """δ over the lever length and the pivot height, against central differences."""

    def delta(x):
        mechanism = shaper.mechanism
        links = {**mechanism.links, "lever": eqx.tree_at(lambda link: link.length, mechanism.links["lever"], x[0])}
        fixed = {**mechanism.fixed, "P": Vec(jnp.zeros(()), x[1])}
        changed = eqx.tree_at(lambda m: (m.links, m.fixed), mechanism, (links, fixed))
        return lj.measures.delta(eqx.tree_at(lambda scene: scene.mechanism, shaper, changed))

    x, h = jnp.asarray([0.75, -0.35]), 1e-5
    slope = compiled_soon(jax.grad(delta))(x)
    value = compiled_soon(jax.vmap(delta))
    steps = h * jnp.eye(2)
    differences = (value(x[None] + steps) - value(x[None] - steps)) / (2 * h)
    np.testing.assert_allclose(slope, differences, rtol=1e-6)


def test_it_is_solved_in_mujoco(shaper):
    """The export uses the joints of a group: a block has the axes of its guide."""
    apart = compared(shaper)
    assert apart.position < 1e-12
    assert apart.torque < 1e-8
