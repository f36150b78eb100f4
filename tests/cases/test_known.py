"""Machines drawn by hand, as described in books: exact lines, strokes, rocker angles, time ratios, by closed forms."""

from __future__ import annotations

import functools
import math

import jax
import numpy as np
import pytest

from linkjax.kinematics import dead_centres, strokes
from tests.cases.drawn import circles
from tests.cases.test_scenes import machine, places

TURN = np.radians(np.arange(0.0, 360.0, 5.0))
PART = np.linspace(-1.8, 1.8, 73)


@functools.cache
def _ends(name: str):
    def found(mechanism):
        dead = dead_centres(mechanism)
        return dead, strokes(mechanism, dead)

    return jax.device_get(jax.jit(found)(machine(name).mechanism))


def covered(name: str, *what: str) -> list[float]:
    """Strokes of sliders (m) or oscillation angles of links (rad)."""
    return [float(_ends(name)[1][each]) for each in what]


def test_peaucellier_draws_a_line():
    assert np.ptp(places("peaucellier", PART)["P"].real) < 1e-15
    assert np.ptp(places("peaucellier", PART)["P"].imag) > 0.1


def test_hoecken_draws_nearly_a_line():
    """Straight within a thousandth for half a turn about the inner position of the crank, and not beyond."""
    at = places("hoecken", math.pi - np.radians(np.arange(-90.0, 91.0, 5.0)) - math.pi)["T"]
    assert np.ptp(at.imag) < 0.005 * np.ptp(at.real)
    assert 1000 * complex(at[18]) == pytest.approx(complex(40, 2 * math.sqrt(50**2 - 30**2)), abs=1e-9)


def test_the_middle_of_watts_link_draws_nearly_a_line():
    at = places("watt-line", np.linspace(-0.3, 0.3, 31))["M"]
    assert np.ptp(at.real) < 0.01 * np.ptp(at.imag)


def test_roberts_draws_nearly_a_line_through_both_pivots():
    at = places("roberts", np.linspace(-0.6, 0.29, 31))["P"]
    assert np.abs(at.imag).max() < 0.01 * np.ptp(at.real)


def test_the_rod_of_a_trammel_crosses_its_slides():
    """Both ends stay on the axes through all change points, twice the distances on the crank away."""
    at, angle = places("trammel", TURN), math.atan2(3, 4) - TURN
    np.testing.assert_allclose(at["C"], 0.1 * np.cos(angle), atol=1e-15)
    np.testing.assert_allclose(at["D"], 0.1j * np.sin(angle), atol=1e-15)


def test_cardans_gears_draw_a_line():
    at, angle = places("cardan-gears", TURN)["P"], math.atan2(4, 3) + TURN
    np.testing.assert_allclose(at, 0.1 * np.cos(angle), atol=1e-15)


def test_a_pantograph_draws_three_times_as_large():
    at = places("pantograph", TURN)
    np.testing.assert_allclose(at["G"], 3 * at["E"], atol=1e-15)
    assert np.ptp(at["E"].real) > 0.02


def test_an_inclined_scotch_yoke_is_a_harmonic_of_larger_stroke():
    """The slot is inclined by 60 degrees: x = r sin(60 degrees - φ) / sin 60 degrees."""
    lean = math.radians(60)
    x = 0.03 * np.sin(lean - TURN) / math.sin(lean)
    np.testing.assert_allclose(places("scotch-yoke-inclined", TURN)["E"], x, atol=1e-16)
    assert covered("scotch-yoke-inclined", "E") == pytest.approx([0.06 / math.sin(lean)])


def times(name: str, pin: str) -> tuple[float, float]:
    """Crank angles of the two strokes of a slider, the longer one first."""
    found = _ends(name)[0][pin]
    one, two = sorted(found.angle[found.present & (found.distance < 1e-6)] % (2 * math.pi))
    return max(two - one, 2 * math.pi - two + one), min(two - one, 2 * math.pi - two + one)


def test_whitworths_ram_returns_quickly():
    """The lever rotates fully and is level at the ends: crank angles on both sides of its level position."""
    half = math.acos(40 / 100)
    assert times("whitworth", "R") == pytest.approx((2 * math.pi - 2 * half, 2 * half), rel=1e-12)
    assert covered("whitworth", "R") == pytest.approx([2 * 0.07])


def test_a_shapers_lever_swings_between_the_tangents_to_the_crank_circle():
    swing = 2 * math.asin(4 / 12)
    assert covered("shaper", "rocker") == pytest.approx([swing])
    assert times("shaper", "rocker") == pytest.approx((math.pi + swing, math.pi - swing), rel=1e-12)


@pytest.mark.slow
def test_an_offset_crank_slider_has_the_stroke_of_its_triangles():
    """Stretched and folded: right-angled triangles over the offset of 35 mm."""
    crank, rod, off = abs(20.0014 + 14.999j), abs(74.9986 - 49.999j), 35.0
    stroke = math.sqrt((crank + rod) ** 2 - off**2) - math.sqrt((rod - crank) ** 2 - off**2)
    assert covered("pyslvs-three-bar", "C") == pytest.approx([stroke / 1000])


@pytest.mark.slow
def test_a_pump_jack_lifts_by_the_swing_of_its_beam():
    """The cable follows the horsehead: the beam angle between stretched and folded crank and pitman, times 3.2 m."""
    o, s, b, c = -3.2 + 1.5j, 6j, -2.2 + 1.5j, -3 + 6.2j
    crank, pitman, beam = abs(b - o), abs(c - b), abs(c - s)
    angle = [math.acos((abs(s - o) ** 2 + beam**2 - (pitman + sign * crank) ** 2) / (2 * abs(s - o) * beam))
             for sign in (1, -1)]  # fmt: skip
    assert covered("pump-jack", "beam", "T") == pytest.approx([angle[0] - angle[1], 3.2 * (angle[0] - angle[1])])


@pytest.mark.slow
def test_both_wipers_swing_alike():
    o, s, b, c = 250 - 40j, 0j, 250 + 10j, 20 - 75j
    crank, rod, arm = abs(b - o), abs(c - b), abs(c - s)
    angle = [math.acos((abs(s - o) ** 2 + arm**2 - (rod + sign * crank) ** 2) / (2 * abs(s - o) * arm))
             for sign in (1, -1)]  # fmt: skip
    assert covered("wiper", "left", "right") == pytest.approx([angle[0] - angle[1]] * 2)


def test_a_rack_turns_its_pinion_by_its_stroke():
    """Crank of 40 mm, rod to a path 20 mm below: the pinion turns by the stroke divided by its radius."""
    rod = abs(154 - 52j)
    stroke = math.sqrt((rod + 40) ** 2 - 20**2) - math.sqrt((rod - 40) ** 2 - 20**2)
    assert covered("rack-feed", "C", "pinion") == pytest.approx([stroke / 1000, stroke / 50])
    at = places("rack-feed", TURN)  # the gear is to the right of the rack: a forward motion turns it clockwise
    turned = np.unwrap(np.angle((at["E"] - at["D"]) / 1j))
    np.testing.assert_allclose(turned, -(at["C"].real - 0.13) / 0.05, atol=1e-13)


def test_the_coupler_of_a_geared_five_bar_closes_its_circles():
    """The pinion turns against the gear, twice as fast; P is at least 105 mm above both, on the left of the line."""
    b = 30 * np.exp(1j * (math.atan2(4, 3) + TURN))
    c = 90 + 15 * np.exp(1j * (math.pi / 2 - 2 * TURN))
    exact = circles(b, abs(42 + 81j), c, abs(30 - 90j), 1)
    np.testing.assert_allclose(1000 * places("geared-five-bar", TURN)["P"], exact, atol=1e-11)


def test_a_lift_rises_as_its_foot_goes_in():
    """From 0.96 m to 0.6 m, of bars of 1 m: from 0.28 m to 0.8 m; the table stays level."""
    at = places("scissor-lift", [0.0, math.pi / 2, math.pi])
    foot = np.array([0.96, 0.78, 0.6])
    np.testing.assert_allclose(at["D"], 1j * np.sqrt(1 - foot**2), atol=1e-15)
    np.testing.assert_allclose(at["E"].imag, at["D"].imag, atol=1e-15)


@pytest.mark.slow
def test_a_boom_rises_by_the_triangle_of_its_cylinder():
    """From the drawn length to 2.1 m: the angle at the foot of the boom between foot and eye of the cylinder."""
    p, c = 0.5 - 0.4j, 1.7 + 0.5j
    drawn, long = (abs(c) ** 2 + abs(p) ** 2 - np.array([abs(c - p), 2.1]) ** 2) / (2 * abs(c) * abs(p))
    at = places("boom", [0.0, math.pi])["T"]
    assert float(np.angle(at[1] / at[0])) == pytest.approx(math.acos(long) - math.acos(drawn), abs=1e-12)


def test_an_ackermann_trapezium_turns_the_inner_wheel_further():
    """Steered by 40 degrees to one side: the other arm from the circle of the tie rod, with a smaller outer angle."""
    at = places("ackermann", [0.0, math.pi])
    arm, tie = abs(0.07 - 0.18j), 1.26
    b = -0.7 + (0.07 - 0.18j) * np.exp(-1j * (math.radians(40) + math.atan2(-0.18, 0.07)))
    c = circles(b, tie, 0.7, arm, -1)
    assert complex(at["B"][1]) == pytest.approx(complex(b), abs=1e-12)
    assert complex(at["C"][1]) == pytest.approx(complex(c), abs=1e-12)


def test_a_klann_leg_walks():
    """The foot stays within 5 mm of the ground for two fifths of a turn, on a stride of more than 55 mm."""
    at = 1000 * places("klann", TURN)["G"]
    low = at[at.imag < at.imag.min() + 5]
    assert len(low) > 0.4 * len(at)
    assert np.ptp(low.real) > 55
    assert min(abs(at - complex(-31.7, -56.4))) < 0.1


@pytest.mark.slow
def test_a_needle_goes_down_by_the_triangles_of_its_crank():
    crank, rod, off = 15.0, abs(2 - 39j), 2.0
    stroke = math.sqrt((crank + rod) ** 2 - off**2) - math.sqrt((rod - crank) ** 2 - off**2)
    assert covered("sewing-machine", "N") == pytest.approx([stroke / 1000])


def test_a_press_is_down_where_its_crank_and_pull_are_in_line():
    """Then the knee, which never becomes straight, is nearest to its straight position."""
    o, f = -420 - 100j, 300j
    crank, pull, upper, lower = 60.0, abs(370 + 90j), abs(-50 - 250j), abs(50 - 250j)
    knee = circles(o, crank + pull, f, upper, -1)
    exact = knee.imag - math.sqrt(lower**2 - knee.real**2)
    there = float(np.angle((knee - o) / 1j)) + np.linspace(-1e-4, 1e-4, 101)
    assert 1000 * float(places("toggle-press", there)["R"].imag.min()) == pytest.approx(exact, abs=1e-8)
