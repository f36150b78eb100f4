"""The study of the scissor lift: the equations of the paper at any angle, and optimal anchors."""

import jax.numpy as jnp
import numpy as np
import pytest

from studies.scissor_lift import study

L, B, F = 1.47, 0.5, 3125.0
TEXT = (study.HERE / "README.md").read_text(encoding="utf-8")
ANCHORS = (1.47, 1.2074, 0.0)  # as in the README


def force_of_one_pair(anchors, alpha):
    """By the work of the loads, 4 F L cos α dα, and that of the cylinder."""
    eye, x, y = anchors
    off = np.array([(L - eye) * np.cos(alpha) - x, (L + eye) * np.sin(alpha) - y])
    slope = (-(L - eye) * np.sin(alpha) * off[0] + (L + eye) * np.cos(alpha) * off[1]) / np.hypot(*off)
    return np.hypot(*off), 4 * F * L * np.cos(alpha) / slope


def test_driven_by_the_bar():
    """Original design: P = F s / (b sin α), printed 27448 N for two pairs at 45 degrees."""
    alpha = study.ALPHA
    length, force = (np.asarray(each) for each in study.course(study.AS_DRAWN, jnp.asarray(alpha)))
    np.testing.assert_allclose(length, np.hypot((L - B) * np.cos(alpha), (L + B) * np.sin(alpha)), rtol=1e-14)
    np.testing.assert_allclose(force, F * length / (B * np.sin(alpha)), rtol=1e-12)
    assert 2 * force[-1] == pytest.approx(27448, rel=1e-5) and 2 * force[0] == pytest.approx(66001.55, rel=1e-8)
    away = np.array([1.2, 0.9, 0.2])
    for ours, exact in zip(study.course(away, jnp.asarray(alpha)), force_of_one_pair(away, alpha), strict=True):
        np.testing.assert_allclose(ours, exact, rtol=1e-12)


def test_no_other_anchors_are_better(rng):
    """20000 random anchors, of which those with an allowed ratio count; the program finds those in the README (slow
    test). Their peaks are those at 60 angles, which are not above those of the continuous stroke; the force here
    decreases throughout, so its peak is that of the lowest position."""
    alpha = np.linspace(study.LOW, study.HIGH, 60)
    fine = force_of_one_pair(ANCHORS, np.linspace(study.LOW, study.HIGH, 20001))[1]
    assert np.all(np.diff(fine) < 0)
    told = 2 * fine[0]
    assert told == pytest.approx(29235.41, rel=1e-4) and "29235.41" in TEXT
    better = 0
    for anchors in rng.uniform(0, 1, (20000, 3)) * [L, 2 * L * np.cos(study.HIGH), study.CLOSED]:
        length, force = force_of_one_pair(anchors, alpha)
        kept = length[-1] <= study.RATIO * length[0] and length[0] >= 0.5 and force.min() > 0
        better += bool(kept and 2 * force.max() < told * (1 - 1e-4))
    assert better == 0


@pytest.mark.slow
def test_driven_by_the_cylinder():
    """Feet, hinge and cylinder over the stroke by the equations of the paper, and by virtual work for other anchors."""
    alpha = np.linspace(study.LOW, study.HIGH, 21)
    lift = study.driven(alpha)
    np.testing.assert_allclose(lift.alpha, alpha, atol=1e-14)
    np.testing.assert_allclose(np.tan(lift.beta), (L + B) / (L - B) * np.tan(alpha), rtol=1e-12)
    np.testing.assert_allclose(lift.force, 2 * F * lift.length / (B * np.sin(alpha)), rtol=1e-12)
    np.testing.assert_allclose(lift.feet, np.array([[F], [F], [0.0]]) + 0 * alpha, rtol=1e-12, atol=1e-8 * F)
    np.testing.assert_allclose(lift.hinge[0], -F * (L - B) / (B * np.tan(alpha)), rtol=1e-12)
    np.testing.assert_allclose(lift.hinge[1], -F * (L + B) / B, rtol=1e-12)
    lift = study.driven(alpha, ANCHORS)
    length, force = force_of_one_pair(ANCHORS, alpha)
    np.testing.assert_allclose(lift.length, length, rtol=1e-13)
    np.testing.assert_allclose(lift.force, 2 * force, rtol=1e-12)
    gained = 4 * F * 2 * L * (np.sin(study.HIGH) - np.sin(study.LOW))
    for anchors in (study.AS_DRAWN, ANCHORS):
        assert study.work(anchors) == pytest.approx(gained, rel=1e-12)


@pytest.mark.slow
def test_the_program_finds_the_anchors():
    """The best of 60 angles is the best of the continuous stroke: its force is largest at the lowest position."""
    anchors = study.best()
    assert anchors == pytest.approx(ANCHORS, abs=6e-5)
    length, force = force_of_one_pair(anchors, np.linspace(study.LOW, study.HIGH, 20001))
    assert length[-1] / length[0] == pytest.approx(study.RATIO, abs=1e-9)
    assert np.all(np.diff(force) < 0)
    top = study.peak(anchors)
    assert float(top.value) == pytest.approx(2 * force[0], rel=1e-12) and float(top.error) < 1e-6 * float(top.value)
