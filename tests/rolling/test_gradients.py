"""Gradients: forward, reverse and differences agree, also in the hard positions; and rings found by them."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import root

from linkjax.rolling import (
    Rolling,
    RollingMachine,
    centre_curve,
    chain,
    clearances,
    closing_clearance,
    closing_eccentricity,
    closing_inner_radius,
    closing_outer_radius,
    closure_gap,
    fitting_bodies,
    margins,
    rings_for,
)
from tests.helpers import assert_gradients_agree

WAVES = jnp.sin(jnp.arange(1.0, 9.0))  # weights, so that no symmetry hides an error
QUANTITIES = {
    "radii": lambda d: WAVES @ chain(d).radii,
    "angles": lambda d: WAVES @ chain(d).angles,
    "places": lambda d: WAVES @ chain(d).centres.x - WAVES @ chain(d).outer_contacts.y,
    "contacts": lambda d: WAVES @ (chain(d).neighbour_contacts.x + chain(d).inner_contacts.y),
    "closure": lambda d: closure_gap(d),
    "clearance of the ends": lambda d: closing_clearance(d),
    "clearances": lambda d: jnp.sum(WAVES[:, None] * clearances(d)),
    "fitting": lambda d: fitting_bodies(d),
    "margins": lambda d: margins(d).rings + 2 * margins(d).closing,
    "curve": lambda d: centre_curve(d).minor + centre_curve(d).at(0.7).x,
    "speeds": lambda d: WAVES @ RollingMachine(d).turned(1.0).bodies,
    "moved": lambda d: WAVES @ RollingMachine(d).at(0.8).centres.y,
}


@pytest.mark.parametrize("name", QUANTITIES)
@pytest.mark.parametrize("e", [pytest.param(0.005, marks=pytest.mark.slow), 0.03])
def test_gradients(name, e, rng):
    design = Rolling(0.04, 0.095, 8, eccentricity=e, start=0.3)
    assert_gradients_agree(QUANTITIES[name], design, rng, difference=1e-8)


HARD = {
    "concentric": Rolling(0.04, closing_outer_radius(0.04, 8), 8),
    "almost": Rolling(0.04, 0.09, 8, eccentricity=1e-12, start=np.pi),
    "all but touching": Rolling(0.04, 0.0450000000001, 8, eccentricity=0.005),
    "touching": Rolling(0.04, 0.045, 8, eccentricity=0.005),
    "crossing": Rolling(0.04, 0.044, 8, eccentricity=0.005, start=1.0),
    "apart": Rolling(0.04, 0.03, 8, eccentricity=0.2),
    "one and the same": Rolling(0.04, 0.04, 8),
    "inside out": Rolling(0.04, 0.02, 8),
}


@pytest.mark.parametrize("name", QUANTITIES)
def test_nothing_is_ever_nan(name):
    of = QUANTITIES[name]
    every = jax.jit(lambda design: (of(design), jax.grad(of)(design), jax.jacfwd(of)(design)))
    for case, design in HARD.items():
        value, *slopes = every(design)
        assert not np.isnan(float(value)), case
        assert all(np.isfinite(float(leaf)) for leaf in jax.tree.leaves(slopes)), case


def test_slopes_lead_back_from_beyond_the_limits():
    for design in (Rolling(0.04, 0.044, 8, eccentricity=0.005), Rolling(0.04, 0.042, 8)):
        assert float(margins(design).closing) < 0
        edge = jax.grad(lambda d: margins(d).rings)(design), jax.grad(lambda d: margins(d).closing)(design)
        assert all(float(slope.outer_radius) > 0 > float(slope.inner_radius) for slope in edge)
    crossing = jax.grad(lambda d: margins(d).rings)(Rolling(0.04, 0.044, 8, eccentricity=0.005))
    assert float(crossing.eccentricity) < 0


@pytest.mark.parametrize("e", [0.0, 1e-9, 0.005, 0.4])
def test_closing_radii(e, rng):
    """Their slopes from the condition itself, differentiated implicitly: (R - r)² - e² = 4 r R t²."""
    inner, t2 = 0.04, np.tan(np.pi / 8) ** 2
    outer = float(closing_outer_radius(inner, 8, e))
    by_outer = 2 * (outer - inner) - 4 * inner * t2
    slopes = jax.grad(lambda r, e: closing_outer_radius(r, 8, e), argnums=(0, 1))(inner, e)
    assert float(slopes[0]) == pytest.approx((2 * (outer - inner) + 4 * outer * t2) / by_outer, rel=1e-12)
    assert float(slopes[1]) == pytest.approx(2 * e / by_outer, rel=1e-12)
    back = jax.grad(lambda r, e: closing_inner_radius(r, 8, e), argnums=(0, 1))(outer, e)
    assert float(back[0]) == pytest.approx(1 / float(slopes[0]), rel=1e-12)
    assert float(back[1]) == pytest.approx(-float(slopes[1]) / float(slopes[0]), rel=1e-11, abs=1e-15)
    if e > 1e-6:
        by_e = jax.grad(lambda r: closing_eccentricity(inner, r, 8))(outer)
        assert float(by_e) == pytest.approx(1 / float(slopes[1]), rel=1e-8)


def test_closing_eccentricity_where_there_is_none():
    for outer in (0.07, 0.05, 0.04, 0.03):
        value, slope = jax.value_and_grad(lambda r: closing_eccentricity(0.04, r, 8))(outer)
        assert float(value) == float(slope) == 0.0
    squared = jax.grad(lambda e2: closing_outer_radius(0.04, 8, jnp.sqrt(e2)))(1e-14)
    t2 = np.tan(np.pi / 8) ** 2
    assert float(squared) == pytest.approx(1 / (4 * 0.04 * np.sqrt(t2 * (1 + t2))), rel=1e-6)  # dR/de² is finite


WANTED = [(27e-3, 22e-3, 8, 1), (5.0, 1.0, 12, 1), (1.0, 1.0, 5, 1), (3.0, 2.0, 4, 1), (3.0, 2.0, 10, 3)]


@pytest.mark.parametrize(("largest", "smallest", "bodies", "turns"), WANTED)
def test_rings_for_wanted_bodies(largest, smallest, bodies, turns, rng):
    design = rings_for(largest, smallest, bodies, turns)
    sizes = np.asarray(jax.jit(chain)(design).radii)
    assert sizes.max() == pytest.approx(largest, rel=1e-14)
    assert sizes.min() == pytest.approx(smallest, rel=1e-12)
    assert abs(float(closure_gap(design))) < 1e-13 * bodies

    def outer(wanted):
        return rings_for(wanted[0], wanted[1], bodies, turns).outer_radius

    assert_gradients_agree(outer, jnp.array([largest, smallest]), rng, difference=1e-8)


@pytest.mark.parametrize(("bodies", "start"), [(8, 0.0), (7, 0.0), (9, 0.2)])
def test_newton_finds_the_rings_for_wanted_bodies(bodies, start):
    """Closure and the sizes of two bodies, for both radii and the eccentricity; from a rough guess."""
    truth = Rolling(0.04, closing_outer_radius(0.04, bodies, 0.006), bodies, eccentricity=0.006, start=start)
    small = bodies // 2
    wanted = chain(truth).radii[jnp.array([0, small])]

    def missed(x):
        design = Rolling(x[0], x[1], bodies, eccentricity=x[2], start=start)
        sizes = chain(design).radii
        return jnp.array([closure_gap(design) * 0.1, sizes[0] - wanted[0], sizes[small] - wanted[1]])

    found = root(jax.jit(missed), np.array([0.05, 0.11, 0.001]), jac=jax.jit(jax.jacfwd(missed)), tol=1e-15)
    np.testing.assert_allclose(found.x, [0.04, float(truth.outer_radius), 0.006], rtol=1e-9)
    if bodies == 8:  # these are on the line of centres
        design = rings_for(wanted[0], wanted[1], bodies)
        np.testing.assert_allclose(found.x, [design.inner_radius, design.outer_radius, design.eccentricity], rtol=1e-9)
