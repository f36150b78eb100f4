"""The study of the scissor lift: the paper's equations at any angle, and anchors that no others beat."""

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from studies.scissor_lift import study

L, B, F = 1.47, 0.5, 3125.0
TEXT = (study.HERE / "README.md").read_text(encoding="utf-8")
ANCHORS = (1.47, 1.2074, 0.0)  # as the README tells them


def force_of_one_pair(anchors, alpha):
    """By the work of the loads, 4 F L cos α dα, and that of the cylinder."""
    eye, x, y = anchors
    off = np.array([(L - eye) * np.cos(alpha) - x, (L + eye) * np.sin(alpha) - y])
    slope = (-(L - eye) * np.sin(alpha) * off[0] + (L + eye) * np.cos(alpha) * off[1]) / np.hypot(*off)
    return np.hypot(*off), 4 * F * L * np.cos(alpha) / slope


def test_driven_by_the_bar():
    """As drawn: P = F s / (b sin α), printed 27448 N for two pairs at 45 degrees."""
    alpha = study.ALPHA
    length, force = (np.asarray(each) for each in study.course(study.AS_DRAWN, jnp.asarray(alpha)))
    np.testing.assert_allclose(length, study.cylinder(alpha), rtol=1e-14)
    np.testing.assert_allclose(force, F * length / (B * np.sin(alpha)), rtol=1e-12)
    assert 2 * force[-1] == pytest.approx(27448, rel=1e-5) and 2 * force[0] == pytest.approx(66001.55, rel=1e-7)
    away = np.array([1.2, 0.9, 0.2])
    for ours, exact in zip(study.course(away, jnp.asarray(alpha)), force_of_one_pair(away, alpha), strict=True):
        np.testing.assert_allclose(ours, exact, rtol=1e-12)


def test_no_other_anchors_are_better(rng):
    """20000 anchors at random, those that keep the ratio; the README's are found by the program (slow test)."""
    alpha = np.linspace(study.LOW, study.HIGH, 60)
    told = 2 * force_of_one_pair(ANCHORS, alpha)[1].max()
    assert told == pytest.approx(29235.41, rel=1e-4) and "29235.41" in TEXT
    better = 0
    for anchors in rng.uniform(0, 1, (20000, 3)) * [L, 2 * L * np.cos(study.HIGH), study.CLOSED]:
        length, force = force_of_one_pair(anchors, alpha)
        kept = length[-1] <= study.RATIO * length[0] and length[0] >= 0.5 and force.min() > 0
        better += bool(kept and 2 * force.max() < told * (1 - 1e-4))
    assert better == 0


@pytest.mark.slow
def test_driven_by_the_cylinder():
    """Feet, hinge and cylinder over the stroke by the paper's equations; both ways of driving agree."""
    alpha = np.linspace(study.LOW, study.HIGH, 21)
    lift = study.by_cylinder(alpha)
    np.testing.assert_allclose(lift.alpha, alpha, atol=3e-8)
    np.testing.assert_allclose(np.tan(lift.beta), (L + B) / (L - B) * np.tan(alpha), rtol=1e-6)
    np.testing.assert_allclose(lift.force, study.course(study.AS_DRAWN, jnp.asarray(alpha))[1], rtol=1e-6)
    np.testing.assert_allclose(lift.feet, np.array([[0.0], [F], [F]]) + 0 * alpha, atol=1e-5)
    np.testing.assert_allclose(lift.hinge[0], -F * (L - B) / (B * np.tan(alpha)), rtol=1e-6)
    np.testing.assert_allclose(lift.hinge[1], -F * (L + B) / B, rtol=1e-8)


@pytest.mark.slow
def test_the_program_finds_the_anchors():
    anchors = study.best()
    assert anchors == pytest.approx(ANCHORS, abs=6e-5)
    assert isinstance(study.by_bar(anchors[0]), lj.Scene)
    length, force = study.course(anchors, jnp.linspace(study.LOW, study.HIGH, 2001))
    assert float(length[-1] / length[0]) == pytest.approx(study.RATIO, abs=1e-9)
    gained = 4 * F * 2 * L * (np.sin(study.HIGH) - np.sin(study.LOW)) / 2
    assert float(jnp.trapezoid(force, length)) == pytest.approx(gained, rel=1e-5)
    assert 2 * float(force.max()) == pytest.approx(
        2 * force_of_one_pair(anchors, np.linspace(study.LOW, study.HIGH, 2001))[1].max(), rel=1e-12
    )
