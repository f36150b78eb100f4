"""What is refused, what is said then, and where the limits lie."""

from __future__ import annotations

import math

import pytest

from linkjax import MachineError, Result
from linkjax.mechanism import StructureError
from linkjax.rolling import (
    Rolling,
    chain,
    check,
    closing_clearance,
    closing_eccentricity,
    closing_outer_radius,
    closure_gap,
    fitting_bodies,
    margins,
)
from tests.rolling.walk import walk


@pytest.mark.parametrize(
    ("bodies", "turns", "message"),
    [
        (2, 1, "bodies: 2 bodies cannot close in 1 turns; use at least 3 bodies"),
        (4, 2, "bodies: 4 bodies cannot close in 2 turns; use at least 5 bodies, or fewer turns"),
        (
            9,
            3,
            "bodies: 9 bodies in 3 turns already close with bodies 3, turns 1; use numbers without a common divisor",
        ),
        (8, 0, "bodies: 8 bodies in 0 turns; write positive integers"),
        (True, 1, "bodies: True bodies"),
    ],
)
def test_numbers_that_make_no_chain(bodies, turns, message):
    with pytest.raises(StructureError) as caught:
        Rolling(0.04, 0.09, bodies, turns)
    assert str(caught.value).startswith(message)
    with pytest.raises(StructureError):
        closing_outer_radius(0.04, bodies, turns=turns)


@pytest.mark.parametrize(
    ("design", "message"),
    [
        (Rolling(0.04, 0.044, 8, eccentricity=0.005),
         "The rings touch or intersect: the outer radius 44 mm is not larger than inner radius plus eccentricity, "
         "45 mm. Use a smaller eccentricity or a larger outer radius (89.9399821 mm closes the chain)."),
        (Rolling(-0.04, 0.095, 8), "inner radius -0.04 m, outer radius 0.095 m, eccentricity 0 m: radii must be "),
        (Rolling(0.04, float("nan"), 8), "inner radius 0.04 m, outer radius nan m, eccentricity 0 m: radii must be "),
    ],
)  # fmt: skip
def test_rings_that_do_not_suit(design, message):
    with pytest.raises(MachineError) as caught:
        check(design)
    assert str(caught.value).startswith(message) and caught.value.result == Result.CANNOT_BE_ASSEMBLED


@pytest.mark.parametrize(("outer", "e", "closing"), [(0.08, 0.005, "89.9399821 mm"), (0.095, 0.0, "89.5931524 mm")])
def test_chains_that_do_not_close(outer, e, closing):
    """The gap by the walk from body to body, the other numbers by Steiner's condition as it is printed."""
    steps = walk(0.04, outer, e, 0.0, 9)
    gap = 360 - math.degrees(steps[-1][0] - steps[0][0])
    sine = math.sqrt(((outer - 0.04) ** 2 - e**2) / ((outer + 0.04) ** 2 - e**2))
    what = "leaves a gap of" if gap > 0 else "overlaps itself by"
    told = (
        f"The chain does not close: it {what} {abs(gap):.3f}°; these rings fit {math.pi / math.asin(sine):.4f} bodies "
        f"in 1 turn, not 8. It closes with an outer radius of {closing}"
    )
    s2 = math.sin(math.pi / 8) ** 2
    squared = ((outer - 0.04) ** 2 - s2 * (outer + 0.04) ** 2) / (1 - s2)
    told += f" or an eccentricity of {1e3 * math.sqrt(squared):.9g} mm." if squared > 0 else "."
    with pytest.raises(MachineError) as caught:
        check(Rolling(0.04, outer, 8, eccentricity=e))
    assert str(caught.value) == told


def test_what_the_messages_propose_closes():
    for design in (Rolling(0.04, 0.08, 8, eccentricity=0.005), Rolling(0.04, 0.095, 8)):
        check(Rolling(0.04, closing_outer_radius(0.04, 8, design.eccentricity), 8, eccentricity=design.eccentricity))
    check(Rolling(0.04, 0.095, 8, eccentricity=closing_eccentricity(0.04, 0.095, 8)))
    check(Rolling(0.04, 0.0899399821, 8, eccentricity=0.005))  # rounded as the message writes it


def test_the_printed_radius_closes_within_its_digits():
    check(Rolling(0.04, 0.0895931, 8))
    with pytest.raises(MachineError, match="does not close"):
        check(Rolling(0.04, 0.08959, 8))


def test_a_chain_closes_from_the_concentric_ring_on():
    """With given rings the eccentricity exists just where they are no closer than the concentric ones."""
    least = float(closing_outer_radius(0.04, 8))
    for outer, exists in ((0.999 * least, False), (1.001 * least, True), (10 * least, True)):
        design = Rolling(0.04, outer, 8, eccentricity=closing_eccentricity(0.04, outer, 8))
        assert (float(margins(design).closing) > 0) == exists == (abs(float(closure_gap(design))) < 1e-12)
        assert float(margins(design).rings) > 0


def test_an_overlap_of_more_than_a_body_is_no_gap():
    """The last body stands well beyond the first, clear of it: the angle tells, the clearance does not."""
    design = Rolling(0.04, 0.2, 8)
    assert float(closing_clearance(design)) > 0 > float(closure_gap(design))
    assert float(fitting_bodies(design)) < 6
    with pytest.raises(MachineError, match="overlaps itself by"):
        check(design)


@pytest.mark.parametrize("e", [0.01, -0.01])
def test_the_margin_of_the_rings_is_the_smallest_body(e):
    """Twice its radius over that of the outer ring: the body on the line of centres, at the narrow side."""
    narrow = math.pi if e > 0 else 0.0
    smallest = chain(Rolling(0.04, 0.1, 8, eccentricity=e, start=narrow)).radii[0]
    assert float(margins(Rolling(0.04, 0.1, 8, eccentricity=e)).rings) == pytest.approx(
        2 * float(smallest) / 0.1, rel=1e-13
    )
