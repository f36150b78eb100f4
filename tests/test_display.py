"""Numbers as people read them: prefixes, chosen units, digits that an error leaves."""

import math

import pytest

from linkjax._display import Numbers, number, prefixed
from linkjax._units import display_units


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
        (4e5, "kg·m²", 1e-3, "10³ kg·m²"),
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
