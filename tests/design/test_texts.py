"""Problems given as strings: ranges, constraints, names, and invalid strings."""

from __future__ import annotations

import math

import pytest

import linkjax as lj
from linkjax import Case, DesignError, Variable, at_least, at_most
from linkjax.design._texts import settled_case, settled_free, settled_limit, variable
from linkjax.measures import delta

PRESS = lj.load("hay-press")


@pytest.mark.parametrize(
    ("name", "given", "low", "high"),
    [
        ("flywheel.inertia", (0, 40), 0.0, 40.0),
        ("flywheel.inertia", "0 to 40 kg m^2", 0.0, 40.0),
        ("flywheel.inertia", "0 kg m^2 … 4e5 kg cm^2", 0.0, 40.0),
        ("links.rod.length", ("0.95 m", "1100 mm"), 0.95, 1.1),
        ("links.rod.length", ["0.95 m", 1.1], 0.95, 1.1),
        ("links.rod.length", "950..1100 mm", 0.95, 1.1),
        ("links.rod.length", "± 8 %", 1.02 * 0.92, 1.02 * 1.08),
        ("links.rod.length", "+-8%", 1.02 * 0.92, 1.02 * 1.08),
        ("links.rod.length", "within 20 mm", 1.0, 1.04),
        ("links.rod.points.E.across", "-300 to 300 mm", -0.3, 0.3),
        ("speed", "400 to 700 rpm", 400 * math.pi / 30, 700 * math.pi / 30),
        ("loads.hay.window.on", "80 to 100 deg", math.radians(80), math.radians(100)),
        ("loads.hay.force", "1e0 to +3e1 kN", 1e3, 3e4),
        ("links.rod.points.E.across", "−5 to 5 mm", -5e-3, 5e-3),
        ("flywheel.inertia", "± 3 kg m^2", 0.0, 3.0),
    ],
)
def test_ranges(name, given, low, high):
    found = variable(PRESS, name, given)
    assert (found.name, found.linked) == (name, ())
    assert (found.lower, found.upper) == pytest.approx((low, high), rel=1e-14)


def test_free_numbers_in_all_ways():
    tied = {"links.rod.length": {"range": "± 8 %", "linked": ["links.link4.length"]}}
    assert settled_free(PRESS, tied)[0].linked == ("links.link4.length",)
    assert settled_free(PRESS, [Variable("speed", 1.0, 2.0)]) == [Variable("speed", 1.0, 2.0)]


@pytest.mark.parametrize(
    ("given", "name", "sense", "unit", "bound"),
    [
        ("delta <= 0.15", "delta", "at most", "1", 0.15),
        ("delta ≥ 0.15", "delta", "at least", "1", 0.15),
        ("flywheel.inertia<=19.23 kg m^2", "flywheel.inertia", "at most", "kg m^2", 19.23),
        ("min_transmission_angle >= 10 deg", "min_transmission_angle", "at least", "rad", math.radians(10)),
        ("peak_reaction <= initial", "peak_reaction", "at most", "N", "initial"),
        (at_most("peak_reaction", "120 kN"), "peak_reaction", "at most", "N", 1.2e5),
        (at_least(delta, 0.1), "delta", "at least", "1", 0.1),
        (at_most(lambda scene: scene.speed, "3 kg m", unit="kg m", name="product"), "product", "at most", "kg m", 3.0),
    ],
)
def test_limits(given, name, sense, unit, bound):
    found = settled_limit(PRESS, given)
    assert (found.name, found.sense, found.term.unit) == (name, sense, unit)
    assert found.bound == (bound if bound == "initial" else pytest.approx(bound, rel=1e-14))


def test_cases_with_units():
    case = settled_case(PRESS, Case("idle", {"loads.hay.force": "0 N", "speed": "400 rpm"}))
    assert case.changes == pytest.approx({"loads.hay.force": 0.0, "speed": 400 * math.pi / 30})


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda: variable(PRESS, "links.rod.length", "5 kg to 6 kg"), "rod.length: '5 kg': a mass where a length"),
        (lambda: variable(PRESS, "links.rod.length", "wide"), 'is not a range; write e.g. "0 to 40 kg'),
        (lambda: variable(PRESS, "links.rod.length", (1.0,)), "is not a pair of bounds; write two"),
        (lambda: variable(PRESS, "links.rod.length", "± x %"), "is not a percentage"),
        (lambda: variable(PRESS, "flywheel.inertia", "± 8 %"), "gives no range"),
        (lambda: variable(PRESS, "links.rod.length", ("1 m", None)), "None is not a number; write a number in m"),
        (lambda: variable(PRESS, "links.rot.length", "± 8 %"), "did you mean 'links.rod.length'"),
        (lambda: settled_limit(PRESS, "delta < 0.15"), "'delta < 0.15': is not a constraint; write e.g."),
        (lambda: settled_limit(PRESS, "detla <= 0.15"), "detla: is neither a measure nor.* mean 'delta'"),
        (lambda: settled_limit(PRESS, "delta <= 3 kg"), "delta: '3 kg': a mass where a plain number"),
        (lambda: settled_limit(PRESS, at_most(lambda s: s.speed, "3 kg", unit="kg m")), "is not a number in kg m"),
        (lambda: settled_limit(PRESS, "delta <= today"), "it is called 'initial' now"),
        (lambda: settled_case(PRESS, Case("idle", {"loads.hey.force": 0.0})), "did you mean 'loads.hay.force'"),
        (lambda: lj.optimise(PRESS, {"speed": (1.0, 2.0)}, "detla"), "did you mean 'delta'"),
        (lambda: lj.optimise(PRESS, {"speed": (1.0, 2.0)}, "delta", solver="cones"), "did you mean 'cone'"),
        (lambda: lj.optimise(PRESS, {"speed": (1.0, 2.0)}, "flywheel.inertia", limits=["speed <= 70 rad/s"],
                             trade_off=("delta", [0.1])), "'delta' is not a constraint of this problem"),
    ],
)  # fmt: skip
def test_what_cannot_be_understood(ask, says):
    with pytest.raises(DesignError, match=says):
        ask()
