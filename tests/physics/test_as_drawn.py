"""A machine drawn by coordinates alone has, at crank angle zero, every joint at its drawn position."""

from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np
import pytest

from linkjax.kinematics import pose
from tests.physics import oracle
from tests.physics.drawings import Drawing, geared, linkage_of

NEAR = 1e-9  # of the size of the drawing
SOON, LATER = range(50), range(50, 1000)
BATCH = 25


def drawn(number: int) -> Drawing:
    """A separate machine for every number; every fourth has gears."""
    rng = np.random.default_rng((28, number))
    return geared(rng) if number % 4 == 0 else linkage_of(rng)


def off(drawing: Drawing, points: dict[str, complex]) -> float:
    """The largest distance of a joint from its drawn position, relative to the size of the drawing."""
    return max(abs(points[name] - at) for name, at in drawing.spots.items()) / drawing.size()


def batches(numbers: range) -> list[range]:
    return [numbers[i : i + BATCH] for i in range(0, len(numbers), BATCH)]


FIRST, *OTHERS = [*batches(SOON), *batches(LATER)]
EVERY = [FIRST, *(pytest.param(each, marks=pytest.mark.slow) for each in OTHERS)]


@pytest.mark.parametrize("numbers", EVERY, ids=lambda numbers: f"{numbers[0]}-{numbers[-1]}")
def test_every_joint_is_where_it_is_drawn(numbers):
    """Random linkages of four to eight links and machines with gears, any joint as the drive; positions by the oracle.
    Lengths given as drawn, here for half of the links of every second machine, change nothing."""
    for number in numbers:
        drawing, rng = drawn(number), np.random.default_rng((30, number))
        given = [name for name in drawing.pins if number % 2 and rng.random() < 0.5]
        points, _ = oracle.assemble(drawing.built(given), np.zeros(()))
        assert off(drawing, points) < NEAR, (number, drawing)


@pytest.mark.slow
def test_another_length_changes_no_other():
    """One length of a drawn machine is given, slightly longer than drawn: the others stay those of the drawing."""
    for number in range(1, 40):
        drawing = drawn(number)
        usual, blocks = drawing.built(), {block for block, *_ in drawing.slots}
        for name in [name for name, pins in drawing.pins.items() if name not in blocks and len(pins) > 1][:2]:
            other = drawing.built([name], 1.01)
            for link in drawing.pins:
                much = 1.01 if link == name else 1.0
                length = much * float(usual.links[link].length)
                assert float(other.links[link].length) == pytest.approx(length, rel=1e-12), (number, name, link)


@pytest.mark.slow
@pytest.mark.parametrize(
    "numbers", [*EVERY[:2], *(pytest.param(each, marks=pytest.mark.slow) for each in batches(range(50, 1000)))],
    ids=lambda numbers: f"{numbers[0]}-{numbers[-1]}",
)  # fmt: skip
def test_a_drawing_moved_or_mirrored_is_the_same_machine(numbers):
    """Rotated, shifted or mirrored: the same lengths and groups, and the same motion, transformed."""
    for number in numbers:
        drawing, rng = drawn(number), np.random.default_rng((29, number))
        shift = drawing.size() * complex(*rng.uniform(-2, 2, 2))
        other, there = drawing.moved(rng.uniform(-math.pi, math.pi), shift, bool(rng.random() < 0.5))
        one, two = drawing.built(), other.built()
        assert one.formula() == two.formula(), number
        for name, link in one.links.items():
            assert float(two.links[name].length) == pytest.approx(float(link.length), rel=NEAR), number
        phi = np.asarray(1e-3)
        with np.errstate(invalid="ignore"):  # NaN where a machine drawn at the end of its range stops
            before, after = (oracle.assemble(machine, phi)[0] for machine in (one, two))
        for name in drawing.spots:
            if np.isfinite(before[name]):
                assert abs(after[name] - there(complex(before[name]))) < 1e-7 * drawing.size(), (number, name)


@pytest.mark.parametrize("number", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_linkjax_puts_them_there(number):
    """The same for the pose that linkjax itself computes."""
    drawing = drawn(number)
    points = pose(drawing.built(), jnp.zeros(())).points
    assert off(drawing, {name: complex(at.r.x, at.r.y) for name, at in points.items()}) < NEAR
