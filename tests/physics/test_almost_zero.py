"""Panels where the force of a pin almost vanishes: its size is hardly smooth there."""

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax.motion._edges import EXTRA, Candidates, edges_of
from linkjax.motion._grid import Grid, make_grid
from linkjax.motion._switching import _almost_zero, _rubs_change

TURN = 2 * np.pi
NONE = Candidates(jnp.zeros(0), jnp.zeros(0))


@pytest.fixture(scope="module")
def grid() -> Grid:
    return make_grid(lj.load("slider-crank"), 400)


@pytest.mark.parametrize("distance", [0.0, 1e-3, 0.05])
def test_extra_panels_leave_the_others_as_they_were(distance):
    fixed, places = [jnp.asarray(0.2), jnp.asarray(3.3)], np.asarray([0.9, 1.4, 2.4])
    before = np.asarray(edges_of(fixed, NONE, None, 18, TURN, True, 2))
    beside = Candidates(jnp.asarray(places), jnp.full(3, distance))
    after = np.asarray(edges_of(fixed, NONE, beside, 18 + EXTRA, TURN, True, 2))
    assert np.all(np.min(np.abs(before[:, None] - after[None]), axis=1) < 1e-12)
    for place in places:
        i = np.searchsorted(after, place) - 1
        j = np.searchsorted(before, place) - 1
        assert after[i + 1] - after[i] < 0.51 * (before[j + 1] - before[j])


def test_the_deepest_of_many_minima_is_the_last(grid):
    """Fourteen, one of which is almost zero, at 6.06 rad: 49 d² + 49.5 x² + ..., with zeros of the square at a distance
    of 7 d / √49.5."""
    place, distance = 6.06, 1e-3
    off = np.asarray(grid.nodes) - place
    square = np.sin(7 * off) ** 2 + (7 * distance) ** 2 + (1 - np.cos(off))
    found = _almost_zero(grid, jnp.asarray(square), 6)
    least = int(np.argmin(found.distance))
    assert float(found.angle[least]) == pytest.approx(place, abs=1e-8)
    assert float(found.distance[least]) == pytest.approx(7 * distance / np.sqrt(49.5), rel=1e-9)


def test_pins_of_one_rod_are_one_place_and_rounding_is_none(grid, rng):
    off = np.asarray(grid.nodes) - 2.0
    square = jnp.asarray(4 * np.sin(off / 2) ** 2 + 1e-4)
    noise = jnp.asarray(1e-26 * rng.random(off.shape))
    found = _rubs_change(grid, [], [noise, square, square], 6, 2)
    used = np.isfinite(found.beside.distance)
    assert np.sum(used) == 1
    assert float(found.beside.angle[used][0]) % TURN == pytest.approx(2.0, abs=1e-8)
    assert float(found.beside.distance[used][0]) == pytest.approx(0.01, rel=1e-9)
    ends = np.sort(found.ends[np.isfinite(found.ends)] % TURN)
    np.testing.assert_allclose(ends, [2 - 0.08, 2 - 0.01, 2 + 0.01, 2 + 0.08], rtol=1e-4)
