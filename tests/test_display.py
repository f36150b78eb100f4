"""Number formats for output: prefixes, chosen units, digits within the error."""

import math

import pytest

from linkjax._display import Numbers, number, prefixed
from linkjax._units import display_units, unit_of


@pytest.mark.parametrize(
    ("size", "unit", "factor", "shown"),
    [
        (0.3, "m", 1e3, "mm"),
        (25.0, "m", 1.0, "m"),
        (2e-5, "m/rad²", 1e6, "µm/rad²"),
        (0.0, "m", 1e3, "mm"),
        (30e3, "N", 1e-3, "kN"),
        (999.0, "N·m", 1.0, "N·m"),
        (2e7, "W", 1e-6, "MW"),
        (0.02, "N", 1e3, "mN"),
        (0.02, "kg·m²", 1.0, "kg·m²"),
        (2e-5, "kg·m²", 1e6, "10⁻⁶ kg·m²"),
        (4e5, "kg·m²", 1.0, "kg·m²"),
        (4e6, "kg·m²", 1e-6, "10⁶ kg·m²"),
        (3.0, "", 1.0, ""),
    ],
)
def test_prefixes(size, unit, factor, shown):
    assert prefixed(size, unit) == (pytest.approx(factor, rel=1e-12), shown)


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(1.121524, 4, "1.122"), (-0.0144957, 4, "−0.01450"), (99999.6, 4, "100000"), (0.0, 4, "0"), (3e-12, 2, "3.0e−12")],
)
def test_numbers(value, digits, text):
    assert number(value, digits) == text


def test_chosen_units_are_taken_everywhere():
    show = Numbers(display_units("m, N, rad/s, rad, N m"))
    assert show.quantity(30e3, "N") == "30000 N"
    assert show.told([0.3, -0.25], "m", 4) == ["0.3000 m", "−0.2500 m"]
    assert show.told([math.pi, None], "rad") == ["3.1416 rad", "–"]
    assert show.told([2.0], "rad/s") == ["2.00000 rad/s"]
    assert show.told([2e-5, 1.0], "N m", 3) == ["0.0000200 N·m", "1.00 N·m"]
    assert show.place((0.3, -0.1)) == "(0.3, −0.1) m"
    assert show.bound(math.pi / 2, "rad") == "1.5708 rad"


def test_without_any_they_suit_the_largest():
    show = Numbers()
    assert show.told([0.3, -0.025], "m", 4) == ["300.0 mm", "−25.00 mm"]
    assert show.told([math.pi / 2], "rad") == ["90.000°"]
    assert show.told([math.radians(4e-4)], "rad", 3) == ["0.000400°"]
    assert (show.turned(-1e-9), show.bound(-0.0, "rad"), show.turned(math.pi)) == ("0.000°", "0°", "180.000°")
    assert show.told([math.pi], "rad/s") == ["30.0000 rpm"]
    assert show.told([math.inf], "N") == ["∞"] and show.told([math.nan], "N") == ["–"]
    assert show.place((0.0, -9.8), "m/s²") == "(0, −9.8) m/s²"
    assert show.shown(40, "kg·m²") == "40 kg·m²"
    assert show.bound(None, "N") == "–"
    assert show.place((math.nan, 1.0)) == "(–, 1000) mm"
    assert (show.shown(math.inf, "N"), show.bound(1e-7, "1")) == ("–", "1·10⁻⁷")
    assert (show.shown(2e-5, "kg·m²"), show.place((0.3, -1e-9))) == ("20·10⁻⁶ kg·m²", "(300, −1·10⁻⁶) mm")
    assert (show.shown(-0.0, "N"), show.place((-0.0, 0.0))) == ("0 N", "(0, 0) mm")
    assert show.measured(1.1215243512, 1e-8) == ("1.12152435", "± 1.0·10⁻⁸")


def test_digits_and_prefixes_for_what_stands_elsewhere():
    """A speed has the digits that its error allows; a torque at one angle the unit of its peak."""
    show = Numbers()
    speed = 0.568487 * math.pi / 30
    assert [show.speed(speed, error=error) for error in (0.0, speed / 2000, speed / 20, 2 * speed)] == [
        "0.568487 rpm", "0.5685 rpm", "0.57 rpm", "0.6 rpm",
    ]  # fmt: skip
    assert show.alike([0.6038807], "N·m", 7) == ["603.8807 mN·m"]
    assert show.alike([0.6038807], "N·m", 7, largest=90.0) == ["0.6038807 N·m"]


def test_what_is_below_its_error_is_zero():
    show = Numbers()
    assert show.quantity(1.06581e-14, "N·m", 6, beside=100.0) == "0 N·m"
    assert show.quantity(1.06581e-9, "N·m", 6, beside=100.0) == "1.06581 nN·m"
    assert show.alike([4000.0, 0.0], "kg·m²") == ["4000.0 kg·m²", "0 kg·m²"]
    assert show.alike([4000.0, 1e-12], "kg·m²") == ["4000.0 kg·m²", "0 kg·m²"]
    assert show.told([3e4, 2e-9], "N", 6) == ["30.0000 kN", "0 kN"]
    assert show.told([None, 2e-9], "N", 6, beside=3e4) == ["–", "0 N"]
    assert show.measured(1e-12, 2e-11)[0] == "0" and show.measured(3e-11, 2e-11)[0] != "0"


def test_units_that_follow_from_others():
    """Factors by their definitions: an inch is 25.4 mm, a pound-force 4.4482216152605 N."""
    found = display_units("in, lbf")
    assert found["N m"] == (pytest.approx(1 / (4.4482216152605 * 0.0254), rel=1e-14), "lbf·in")
    assert found["m/s"] == (pytest.approx(1 / 0.0254, rel=1e-14), "in/s")
    assert found["m/s^2"] == (pytest.approx(1 / 0.0254, rel=1e-14), "in/s²")
    assert display_units("mm, lbf")["N m"] == found["N m"]
    assert display_units("ft, lbf")["N m"] == (pytest.approx(1 / (4.4482216152605 * 0.3048), rel=1e-14), "lbf·ft")
    assert display_units("mm, N")["N m"] == (1000.0, "N·mm")
    assert display_units("mm, N, N m, m/s^2")["N m"] == (1.0, "N·m")
    assert display_units("mm, N, N m, m/s^2")["m/s^2"] == (1.0, "m/s²")
    assert "N m" not in display_units("mm, rpm") and "m/s" not in display_units("N")
    assert Numbers(found).quantity(1.0, "N·m", 5) == "8.8507 lbf·in"


def test_the_unit_of_a_speed():
    assert [unit_of(value) for value in ("700 rpm", "-2e1 rev/s", 10, 1.5, "fast", None, True)] == [
        "rpm", "rev/s", "rad/s", "rad/s", "", "", "rad/s",
    ]  # fmt: skip


def test_squares_of_lengths_and_angles():
    """The prefix belongs to the metre: a square millimetre is 1e-6 m²."""
    assert Numbers().told([9.1e-3, 2e-4], "m^2", 4) == ["9100 mm²", "200.0 mm²"]
    assert Numbers().told([2.5], "m^2", 3) == ["2.50 m²"]
    assert Numbers().told([3e-14], "m^2", 2) == ["30·10⁻¹⁵ m²"]
    assert Numbers().told([3e-5], "rad^2", 2) == ["30·10⁻⁶ rad²"]
