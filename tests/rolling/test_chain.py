"""Positions, sizes and contacts of the bodies, against distances between centres and against 50 digits."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from linkjax._vec import Vec
from linkjax.rolling import (
    Rolling,
    centre_curve,
    clearances,
    closing_clearance,
    closing_eccentricity,
    closing_inner_radius,
    closing_outer_radius,
    closure_gap,
    fitting_bodies,
    margins,
    moved,
    ring_points,
    surface_points,
)
from linkjax.rolling import chain as plain_chain
from tests.rolling.walk import radius, walk

chain = jax.jit(plain_chain)
DESIGNS = [  # inner radius, eccentricity, bodies, turns, start
    (0.04, 0.0, 8, 1, 0.0),
    (0.04, 0.005, 8, 1, 0.3),
    (0.04, -0.005, 8, 1, 0.3),
    (0.04, 0.2, 8, 1, -2.0),
    (0.04, 1e-9, 7, 1, 1.0),
    (1.0, 0.7, 3, 1, 4.0),
    (1.0, 0.02, 60, 1, 0.0),
    (1.0, 0.9, 500, 1, math.pi),
    (0.04, 0.01, 7, 2, 0.1),
    (0.04, 0.01, 11, 5, 0.1),
    (40e6, 5e6, 8, 1, 2.0),
    (40e-9, 5e-9, 8, 1, 2.0),
]


def closed(inner, e, bodies, turns, start) -> Rolling:
    return Rolling(inner, closing_outer_radius(inner, bodies, e, turns), bodies, turns, e, start)


def points(at: Vec) -> Any:
    """A vector as complex numbers."""
    return np.asarray(at.x) + 1j * np.asarray(at.y)


@pytest.mark.parametrize("given", DESIGNS, ids=str)
def test_every_body_touches_both_rings_and_both_neighbours(given):
    design = closed(*given)
    made = chain(design)
    centres, radii = points(made.centres), np.asarray(made.radii)
    size = float(design.outer_radius)
    close = 2e-14 * size * (1 + len(radii) / 20)
    assert np.all(radii > 0)
    assert np.abs(np.abs(centres) - (given[0] + radii)).max() < close
    assert np.abs(np.abs(centres - given[1]) - (size - radii)).max() < close
    assert np.abs(np.abs(np.roll(centres, -1) - centres) - (radii + np.roll(radii, -1))).max() < close
    # a contact lies on both surfaces
    ends = ((made.inner_contacts, 0.0, given[0]), (made.outer_contacts, given[1], size))
    for contact, centre, ring in ends:
        assert np.abs(np.abs(points(contact) - centres) - radii).max() < close
        assert np.abs(np.abs(points(contact) - centre) - ring).max() < close
    beside = points(made.neighbour_contacts)
    assert np.abs(np.abs(beside - centres) - radii).max() < close
    assert np.abs(np.abs(beside - np.roll(centres, -1)) - np.roll(radii, -1)).max() < close
    np.testing.assert_allclose(made.angles, np.unwrap(np.angle(centres), period=2 * np.pi) +
                               2 * np.pi * np.round((made.angles[0] - np.angle(centres[0])) / (2 * np.pi)),
                               rtol=0, atol=1e-12)  # fmt: skip


@pytest.mark.parametrize("given", [d for d in DESIGNS if d[2] < 20 and d[3] == 1], ids=str)
def test_the_walk_from_body_to_body_ends_where_it_began(given):
    """With 50 digits and the closing radius in 50 digits; then the angles and radii of every body."""
    inner, e, bodies, turns, start = given
    t = mpmath.tan(mpmath.pi * turns / bodies)
    r, d = mpmath.mpf(inner), mpmath.mpf(e)
    middle = r * (1 + 2 * t * t)  # (R - r)^2 - e^2 = 4 r R t^2 solved for R
    outer = middle + mpmath.sqrt(middle * middle - (r - d) * (r + d))
    assert float(abs(outer - mpmath.mpf(float(closing_outer_radius(inner, bodies, e, turns)))) / outer) < 1e-15
    steps = walk(inner, outer, e, start, bodies + 1)
    assert abs(steps[-1][0] - steps[0][0] - 2 * mpmath.pi) < mpmath.mpf(10) ** -35
    made = chain(closed(*given))
    np.testing.assert_allclose(made.angles, [float(angle) for angle, _ in steps[:-1]], rtol=0, atol=4e-15 * bodies)
    np.testing.assert_allclose(made.radii, [float(size) for _, size in steps[:-1]], rtol=1e-13)


@pytest.mark.slow
def test_an_open_chain_touches_all_but_its_ends():
    design = Rolling(0.04, 0.1, 8, eccentricity=0.01, start=0.7)
    steps = walk(0.04, 0.1, 0.01, 0.7, 9)
    made = chain(design)
    np.testing.assert_allclose(made.angles, [float(angle) for angle, _ in steps[:-1]], rtol=0, atol=3e-14)
    gap = float(2 * mpmath.pi - (steps[-1][0] - steps[0][0]))
    assert gap < -0.1
    assert float(closure_gap(design)) == pytest.approx(gap, abs=3e-14)
    ends = points(made.centres)[[-1, 0]]
    assert float(closing_clearance(design)) == pytest.approx(
        abs(ends[0] - ends[1]) - float(made.radii[0] + made.radii[-1])
    )
    assert float(fitting_bodies(design)) < 8


@pytest.mark.parametrize("start", np.linspace(-7, 7, 15))
@pytest.mark.parametrize("e", [0.0, 0.005, 0.03])
def test_a_chain_that_closes_does_so_from_every_start(start, e):
    assert abs(float(closure_gap(closed(0.04, e, 8, 1, start)))) < 1e-14 * 20
    assert abs(float(closing_clearance(closed(0.04, e, 8, 1, start)))) < 1e-15


def test_the_closing_formulas_agree_with_each_other(rng):
    for bodies, turns in ((3, 1), (8, 1), (25, 1), (5, 2), (13, 4)):
        inner, e = rng.uniform(0.5, 2.0), rng.uniform(0.1, 3.0)
        outer = closing_outer_radius(inner, bodies, e, turns)
        assert float(closing_inner_radius(outer, bodies, e, turns)) == pytest.approx(inner, rel=1e-14)
        assert float(closing_eccentricity(inner, outer, bodies, turns)) == pytest.approx(e, rel=1e-11)
        assert float(fitting_bodies(Rolling(inner, outer, bodies, turns, e))) == pytest.approx(bodies, rel=1e-13)
        assert float(margins(Rolling(inner, outer, bodies, turns, e)).closing) == pytest.approx(
            (e / float(outer)) ** 2, rel=1e-11
        )


@pytest.mark.parametrize("q", [0.0, math.pi, 0.4, -2.2])
def test_points_of_working_surfaces_by_homogeneous_matrices(q):
    """Formulas (1)-(5) of the source: rotation to the body, then shift along it and rotation by q."""

    def rotation(angle, shift=0.0):
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c, -s, shift], [s, c, 0.0], [0.0, 0.0, 1.0]])

    design = closed(0.04, 0.005, 8, 1, 0.3)
    made = chain(design)
    ours = points(surface_points(made, q))
    for angle, size, found in zip(made.angles, made.radii, ours, strict=True):
        column = rotation(float(angle)) @ rotation(q, 0.04 + float(size)) @ np.array([float(size), 0.0, 1.0])
        assert abs(found - complex(column[0], column[1])) < 1e-16
    rings = ring_points(design, q)
    assert abs(complex(rings.inner.x, rings.inner.y)) == pytest.approx(0.04, rel=1e-15)
    far = complex(rings.outer.x, rings.outer.y) - 0.005
    assert abs(far) == pytest.approx(float(design.outer_radius), rel=1e-15)
    assert math.remainder(math.atan2(far.imag, far.real) - q, 2 * math.pi) == pytest.approx(0, abs=1e-15)


def test_surface_points_of_the_prototype_are_its_contacts():
    made = chain(closed(0.04, 0.0, 8, 1, 0.0))
    for angle, contact in ((0.0, made.outer_contacts), (math.pi, made.inner_contacts)):
        assert np.abs(points(surface_points(made, angle)) - points(contact)).max() < 1e-16
    each = jnp.linspace(0.0, 7.0, 8)
    assert points(surface_points(made, each))[3] == pytest.approx(points(surface_points(made, each[3]))[3])


@pytest.mark.parametrize("given", DESIGNS[:9], ids=str)
def test_centres_lie_on_the_ellipse(given):
    design = closed(*given)
    curve, at = centre_curve(design), points(chain(design).centres)
    off = at - points(curve.centre)
    size = float(design.outer_radius)
    assert np.abs((off.real / float(curve.major)) ** 2 + (off.imag / float(curve.minor)) ** 2 - 1).max() < 1e-13
    foci = [points(focus) for focus in curve.foci]
    assert list(foci) == [0, given[1]]
    assert np.abs(sum(abs(at - focus) for focus in foci) - (given[0] + size)).max() < 1e-14 * size
    drawn = points(curve.at(jnp.linspace(0.0, 6.0, 7)))
    assert np.abs(sum(abs(drawn - focus) for focus in foci) - (given[0] + size)).max() < 1e-14 * size


@pytest.mark.slow
def test_star_chains_overlap_and_simple_ones_do_not():
    for given in DESIGNS:
        apart = np.asarray(jax.jit(clearances)(closed(*given)))
        assert apart.shape == (given[2], given[2] - 3)
        if given[2] > 3:
            assert (apart.min() < 0) == (given[3] > 1)
    design = closed(0.04, 0.01, 7, 2, 0.1)
    made = chain(design)
    centres, radii = points(made.centres), np.asarray(made.radii)
    assert float(clearances(design)[1, 2]) == pytest.approx(
        abs(centres[1] - centres[5]) - radii[1] - radii[5], rel=1e-12
    )


def test_moving_keeps_shape_and_the_point_at_rest():
    design = closed(0.04, 0.005, 8, 1, 0.3)
    made = chain(design)
    for rest in (made.inner_centre, made.outer_centre):
        after = moved(made, 1.3, rest)
        turn = np.exp(1.3j)
        still = points(rest)
        for name in (
            "centres",
            "inner_contacts",
            "outer_contacts",
            "neighbour_contacts",
            "inner_centre",
            "outer_centre",
        ):
            want = still + turn * (points(getattr(made, name)) - still)
            assert np.abs(points(getattr(after, name)) - want).max() < 1e-16 * 4
        assert np.abs(points(after.directions) - turn * points(made.directions)).max() < 1e-15
        assert np.array_equal(after.radii, made.radii)
        outward = points(surface_points(after, 0.4)) - points(after.centres)
        before = points(surface_points(made, 0.4)) - points(made.centres)
        assert np.abs(outward - turn * before).max() < 1e-16


@pytest.mark.parametrize("factor", [1e3, 1e6, 1e-6])
def test_sizes_scale(factor):
    one, other = (closed(0.04 * f, 0.005 * f, 8, 1, 0.3) for f in (1.0, factor))
    np.testing.assert_allclose(chain(other).radii, factor * chain(one).radii, rtol=1e-14)
    np.testing.assert_allclose(chain(other).angles, chain(one).angles, rtol=0, atol=1e-14)
    np.testing.assert_allclose(jax.tree.leaves(margins(other)), jax.tree.leaves(margins(one)), rtol=1e-12)


def test_nearly_touching_rings():
    """A gap of 1e-9 of the size; the error of an angle before the inversion grows up to 1 / sqrt(1e-9) after it."""
    design = Rolling(1.0, 1.5 + 1e-9, 12, eccentricity=0.5, start=0.0)
    made = chain(design)
    assert float(made.radii[0]) == pytest.approx(0.5 + 5e-10, rel=1e-12)  # the widest point
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(made))
    centres, radii = points(made.centres), np.asarray(made.radii)
    assert np.abs(np.abs(np.diff(centres)) - (radii[:-1] + radii[1:])).max() < 1e-16 / 1e-9**0.5 * 10
    narrow = radius(mpmath.mpf(1), mpmath.mpf(float(design.outer_radius)), mpmath.mpf("0.5"), mpmath.pi)
    last = chain(Rolling(1.0, 1.5 + 1e-9, 12, eccentricity=0.5, start=math.pi)).radii[0]
    assert float(last) == pytest.approx(float(narrow), abs=1e-15)


def test_designs_are_vmapped():
    eccentricities = jnp.linspace(-0.02, 0.02, 5)

    def sizes(e):
        return chain(Rolling(0.04, closing_outer_radius(0.04, 8, e), 8, eccentricity=e)).radii

    together = jax.jit(jax.vmap(sizes))(eccentricities)
    for row, e in zip(together, eccentricities, strict=True):
        np.testing.assert_allclose(row, sizes(e), rtol=1e-14)
