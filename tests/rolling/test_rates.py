"""Speeds, by the velocities of material points at the contacts: rolling without slip, neighbours that rub."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from linkjax._vec import Vec
from linkjax.mechanism import StructureError
from linkjax.rolling import MEMBERS, Rolling, RollingMachine, chain, closing_outer_radius, rates

STEP = 2e-6
at = jax.jit(RollingMachine.at)
HELD = [(held, driven) for held in MEMBERS for driven in MEMBERS if held != driven]


def machine(held: str, driven: str, speed: float = 3.0, e: float = 0.005, start: float = 0.3) -> RollingMachine:
    design = Rolling(0.04, closing_outer_radius(0.04, 8, e), 8, eccentricity=e, start=start)
    return RollingMachine(design, held, driven, speed)


def points(at: Vec) -> np.ndarray:
    return np.asarray(at.x) + 1j * np.asarray(at.y)


def velocities(of: RollingMachine, contact: str, shift: int = 0) -> dict[str, np.ndarray]:
    """Velocities of the material points of rings and bodies that are at a kind of contact at time zero.

    Each point is fixed to its member by hand: its centre as the chain moves, turned by the member's own speed; so the
    speeds are tested against the places of the members, which know nothing of them.
    """
    now, speeds = at(of, 0.0), jax.jit(RollingMachine.speeds)(of)
    there = points(getattr(now, contact))
    found = {}
    for name in ("inner", "outer", "bodies"):
        where = {"inner": "inner_centre", "outer": "outer_centre", "bodies": "centres"}[name]
        arms = np.roll(there, shift) - points(getattr(now, where))
        ends = []
        for time in (STEP, -STEP):
            centre = points(getattr(at(of, of.speed * time), where))
            ends.append(centre + arms * np.exp(1j * np.asarray(getattr(speeds, name)) * time))
        found[name] = (ends[0] - ends[1]) / (2 * STEP)
    return found


@pytest.mark.parametrize(("held", "driven"), HELD)
@pytest.mark.parametrize("e", [0.0, 0.005, 0.1])
def test_bodies_roll_on_both_rings_without_slip(held, driven, e):
    of = machine(held, driven, e=e)
    fastest = (
        abs(velocities(of, "outer_contacts")["outer"]).max() + abs(velocities(of, "inner_contacts")["inner"]).max()
    )
    assert fastest > 1e-3
    for contact, ring in (("inner_contacts", "inner"), ("outer_contacts", "outer")):
        found = velocities(of, contact)
        assert np.abs(found[ring] - found["bodies"]).max() < 1e-8 * fastest


@pytest.mark.parametrize(("held", "driven"), HELD)
def test_neighbours_rub(held, driven):
    """At the contact of i and i + 1: the velocity of the point of one against that of the other, along the tangent."""
    of = machine(held, driven)
    own = velocities(of, "neighbour_contacts")["bodies"]
    next_ = np.roll(velocities(of, "neighbour_contacts", shift=1)["bodies"], -1)
    speed = own - next_
    np.testing.assert_allclose(np.abs(speed), float(of.speeds().rubbing), rtol=1e-8)
    centres = points(of.at(0.0).centres)
    line = (np.roll(centres, -1) - centres) / np.abs(np.roll(centres, -1) - centres)
    assert np.abs((speed * line.conj()).real).max() < 1e-8 * float(of.speeds().rubbing)


def test_speeds_of_the_classical_cases():
    """A planetary bearing with its outer ring held; with the line of centres held, two rings in opposite senses."""
    of = machine("outer", "inner", e=0.0)
    inner, outer = 0.04, float(of.design.outer_radius)
    assert float(of.turned(1.0).carrier) == pytest.approx(inner / (inner + outer), rel=1e-14)
    size = float(chain(of.design).radii[0])
    # the body's axis runs at the speed of its centre, and its outer contact rests
    assert float(of.turned(1.0).bodies[0]) == pytest.approx(
        -float(of.turned(1.0).carrier) * (inner + size) / size, rel=1e-12
    )
    fixed = machine("carrier", "inner").turned(1.0)
    assert float(fixed.outer) == pytest.approx(-inner / float(machine("carrier", "inner").design.outer_radius))
    assert float(fixed.rubbing) == pytest.approx(2 * inner)


@pytest.mark.parametrize(("held", "driven"), HELD)
def test_all_ways_to_say_the_same_speeds(held, driven):
    of = machine(held, driven)
    found = of.speeds()
    for missing in MEMBERS:
        given = {member: getattr(found, member) for member in MEMBERS if member != missing}
        again = rates(of.design, **given)
        np.testing.assert_allclose(getattr(again, missing), getattr(found, missing), rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(again.bodies, found.bodies, rtol=1e-12, atol=1e-13)
    assert float(getattr(found, held)) == 0 and float(getattr(found, driven)) == 3.0


def test_clockwise_is_the_mirror():
    there, back = machine("outer", "inner", 3.0).speeds(), machine("outer", "inner", -3.0).speeds()
    np.testing.assert_array_equal(there.bodies, -back.bodies)
    assert float(there.rubbing) == float(back.rubbing) > 0
    mirrored = chain(machine("outer", "inner", start=-0.3).design)
    made = chain(machine("outer", "inner", start=0.3).design)
    order = np.r_[0, np.arange(7, 0, -1)]
    np.testing.assert_allclose(points(mirrored.centres)[order], points(made.centres).conj(), rtol=0, atol=1e-16)


@pytest.mark.parametrize(("held", "driven"), HELD)
def test_a_cycle_is_one_turn_of_the_line_of_centres(held, driven):
    of = machine(held, driven)
    turned = of.turned(of.cycle)
    whole = turned.carrier if held != "carrier" else getattr(turned, driven)
    assert float(whole) == pytest.approx(2 * math.pi, rel=1e-14)
    np.testing.assert_allclose(points(of.at(of.cycle).centres), points(of.at(0.0).centres), rtol=0, atol=1e-15)
    still = {"inner": "inner_centre", "outer": "outer_centre"}.get(held)
    if still:
        np.testing.assert_allclose(points(getattr(of.at(1.0), still)), points(getattr(of.at(0.0), still)), atol=1e-17)


def test_what_is_held_and_driven_is_checked():
    with pytest.raises(StructureError, match="driven: 'inner' is both held and driven; choose two"):
        machine("inner", "inner")
    with pytest.raises(StructureError, match="held: is 'ring'; write one of inner, outer, carrier"):
        machine("ring", "inner")
    with pytest.raises(ValueError, match="exactly two of inner, outer and carrier"):
        rates(machine("inner", "outer").design, inner=1.0)
    with pytest.raises(ValueError, match="exactly two of inner, outer and carrier"):
        rates(machine("inner", "outer").design, inner=1.0, outer=jnp.asarray(0.0), carrier=2.0)
