"""Measures of elements as constraints and objectives, for every crank angle of a window too; and subgradients."""

from __future__ import annotations

import functools
import json
import math
import re

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import measures
from linkjax.design import DesignError
from linkjax.design._texts import settled_limit
from linkjax.groups import RRP
from linkjax.library import slider_crank
from tests.physics.machines import machine
from tests.test_cli import run

FREE = {"links.coupler.length": "± 20 %", "links.rocker.length": "± 20 %"}
SLACK = 1e-6  # a residual of 1e-7 allows a slack of that divided by the multiplier


@pytest.fixture
def call(monkeypatch, capsys):
    """Exit code, standard output and standard error of one optimisation."""
    return functools.partial(run, monkeypatch, capsys, "optimise")


def optimised(call, tmp_path, scene: str, *words: str) -> dict:
    """The document of an optimisation from the command line alone."""
    code, _, error = call(scene, "--json", tmp_path / "found.json", *words)
    assert code == 0, error
    return json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_four_bar_whose_rocker_keeps_its_angle(call, tmp_path):
    """The peak torque is lowered, and the swing stays at least what it was: it is held at that, with a multiplier."""
    words = [word for name, ends in FREE.items() for word in ("--free", f"{name}={ends}")]
    words += ["--minimise", "peak_drive_torque_constant_speed", "--limit", "swing.rocker >= initial"]
    found = optimised(call, tmp_path, "four-bar", *words)
    goal, limit = found["objective"], found["limits"]["swing.rocker"]
    assert goal["after"] < 0.9 * goal["before"] and found["kkt_residual"] < 1e-7
    assert limit["active"] and limit["value"] == pytest.approx(limit["before"], rel=SLACK)
    a, b, c, d = (0.12, *(found["variables"][f"links.{name}.length"]["after"] for name in ("coupler", "rocker")), 0.4)
    ends = [math.acos((c * c + d * d - reach**2) / (2 * c * d)) for reach in (b + a, b - a)]
    assert limit["value"] == pytest.approx(ends[0] - ends[1], rel=1e-10)


@pytest.mark.slow
def test_a_stroke_that_is_held(call, tmp_path):
    """A stroke held from both sides while the largest guide force becomes smaller."""
    words = ["--free", "links.crank.length=30 to 50 mm", "--free", "links.rod.length=150 to 190 mm"]
    words += ["--free", "groups.rod-piston.guide.offset=-20 to 20 mm"]
    words += ["--minimise", "peak_reaction_constant_speed.piston.guide.piston"]
    words += ["--limit", "stroke.P >= 78 mm", "--limit", "stroke.P <= 78 mm"]
    found = optimised(call, tmp_path, "slider-crank", *words)
    goal = found["objective"]
    assert goal["after"] < 0.95 * goal["before"] and found["kkt_residual"] < 1e-7
    crank, rod, offset = (each["after"] for each in found["variables"].values())
    ends = [math.sqrt((rod + way * crank) ** 2 - offset**2) for way in (-1, 1)]
    assert ends[1] - ends[0] == pytest.approx(0.078, rel=SLACK)


@pytest.mark.slow
def test_a_reach_at_every_crank_angle(call, tmp_path):
    """The coupler point stays below a height in a window, between the nodes too, and may be higher elsewhere."""
    words = [word for name, ends in FREE.items() for word in ("--free", f"{name}={ends}")]
    words += ["--maximise", "max_y.T", "--limit", "y.T <= 300 mm where 110 deg to 200 deg"]
    found = optimised(call, tmp_path, "four-bar", *words)
    changes = {name: f"{each['after']!r} m" for name, each in found["variables"].items()}
    scene = lj.design.changed(machine("four-bar"), changes)
    cycle = lj.analyse(scene, angles=3600)
    height, angles = np.asarray(cycle.pose.points["T"].r.y), np.degrees(np.asarray(cycle.angles))
    inside = (angles > 110 - 1e-9) & (angles < 200 + 1e-9)
    assert np.max(height[inside]) == pytest.approx(0.3, abs=1e-6)  # a grid of 3600 angles misses less
    assert np.max(height[inside]) < 0.3 + SLACK < np.max(height)
    assert found["objective"]["after"] == pytest.approx(np.max(height), abs=1e-6)


def test_a_constraint_without_a_window_holds_always():
    """And the other sense is that of the smallest value; an acceleration is limited by its largest magnitude."""
    limit = lj.at_least("x.P", "0.1 m")
    assert (limit.name, limit.term.smallest) == ("min_x.P", True)
    assert settled_limit(machine("slider-crank"), "acceleration.P <= 500 m/s^2").name == "peak_acceleration.P"
    with pytest.raises(DesignError, match="has no min that can be limited"):
        lj.at_least("velocity.P", "0 m/s")


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ("stroke.X <= 80 mm", "'X' is not a point of a slider of this machine"),
        ("stroke.P <= 80", "a number without a unit"),
        ("stroke.P <= 80 deg", "stroke.P"),
        ("x.P >= 0 where 90 deg", "'90 deg' is not a window; write e.g. where 90deg to 180deg"),
        ("x.P >= 0 where here to 180 deg", "'here' is not a crank angle"),
        ("strok.P <= 80 mm", "did you mean"),
    ],
)
def test_constraints_that_are_refused(limit, words):
    """With the name and the remedy, before anything is compiled."""
    scene = machine("slider-crank")
    with pytest.raises(DesignError) as error:
        settled_limit(scene, limit)
    assert words in str(error.value)


@pytest.mark.slow
def test_other_names_of_the_machine_are_the_same_problem():
    """A constraint on an element by its name: a program without names has it, too."""
    scene = machine("four-bar")
    found = lj.optimise(scene, FREE, "peak_drive_torque_constant_speed", limits=["swing.rocker >= initial"], nodes=48)
    assert "swing.rocker" in found.limits and "<0" not in str(found)


def in_line(offset: float = 0.0, links: dict[str, lj.Link] | None = None) -> lj.Scene:
    return lj.Scene(slider_crank(0.06, 0.3, offset, links=links), speed=10.0)


@pytest.mark.slow
def test_equal_peaks_with_the_same_gradient_are_one():
    """In line, the rod turns fastest at both dead centres, with ω r / l, which changes in the same way at both."""
    found = measures.subgradients(in_line(), "peak_angular_velocity_constant_speed.rod")
    assert len(found) == 1
    links = found[0].gradient.mechanism.links
    assert float(links["rod"].length) == pytest.approx(-10 * 0.06 / 0.09, rel=1e-9)
    assert float(links["crank"].length) == pytest.approx(10 / 0.3, rel=1e-9)


@pytest.mark.slow
def test_subgradients_are_the_slopes_to_either_side():
    """In line, the transmission angle is least at both quarter turns: sin = (r ± e) / l of its difference from 90°."""
    found = measures.subgradients(in_line(), "min_transmission_angle")
    groups = [each.gradient.mechanism.groups[1] for each in found]
    slopes = sorted(float(group.guide.offset) for group in groups if isinstance(group, RRP))
    steep = 1 / math.sqrt(0.3**2 - 0.06**2)
    assert slopes == pytest.approx([-steep, steep], rel=1e-9)
    assert sorted(math.degrees(each.angle) for each in found) == pytest.approx([90.0, 270.0], abs=1e-4)
    value, h = measures.named("min_transmission_angle"), 1e-6
    sides = [(float(value(in_line(way * h))) - float(value(in_line()))) / h for way in (-1, 1)]
    assert sides == pytest.approx([slopes[0], slopes[0]], rel=1e-4)  # it becomes smaller in both directions


def test_subgradients_of_a_measure_without_rows():
    """One gradient, that of the measure."""
    found = measures.subgradients(in_line(0.02), "path_length.D")
    assert len(found) == 1 and math.isnan(found[0].angle)
    assert jnp.isfinite(found[0].gradient.mechanism.links["rod"].length)


HEAVY = {"rod": lj.Link(mass=4.0, uniform=True), "slider": lj.Link(mass=40.0)}
OFFSET = {"groups.rod-slider.guide.offset": "0 to 100 mm"}


def offset_in(scene: lj.Scene) -> float:
    """The offset of the guide, or the derivative with respect to it."""
    group = scene.mechanism.groups[1]
    assert isinstance(group, RRP)
    return float(group.guide.offset)


def stroke(rod: float, offset: float, crank: float = 0.06) -> float:
    """The stroke of an offset slider-crank (closed form)."""
    return math.sqrt((rod + crank) ** 2 - offset**2) - math.sqrt((rod - crank) ** 2 - offset**2)


@pytest.mark.parametrize("start", [0.0, 0.002, 0.02])
def test_a_longer_stroke_by_an_offset(start):
    """Near the in-line design the stroke hardly changes with the offset, and is symmetrical about it: the optimum is
    where the offset is just large enough."""
    press = in_line(start, HEAVY)
    found = lj.optimise(press, free=OFFSET, minimise="groups.rod-slider.guide.offset", limits=["stroke.D >= 123 mm"])
    offset = offset_in(found.after)
    assert found.feasible and found.kkt_residual < 1e-6 and stroke(0.3, offset) == pytest.approx(0.123, rel=1e-8)


@pytest.mark.parametrize("start", [0.0, 0.002])
def test_a_quick_return_from_an_in_line_press(start):
    """At the in-line design both ways take equally long, and the time ratio has a kink."""
    press = in_line(start, HEAVY)
    goal, limits = "peak_reaction_constant_speed.B.rod", ["time_ratio.D >= 1.05"]
    found = lj.optimise(press, free=OFFSET, minimise=goal, limits=limits)
    e = offset_in(found.after)
    apart = math.acos(e / 0.36) - math.acos(e / 0.24)
    assert found.feasible and found.kkt_residual < 1e-6 and found.evaluations < 40
    assert (math.pi + apart) / (math.pi - apart) == pytest.approx(1.05, rel=1e-8)


def test_the_time_ratio_of_equal_ways_has_two_gradients():
    press = in_line()
    both = [offset_in(each.gradient) for each in measures.subgradients(press, "time_ratio.D", 32)]
    slope = 4 * (1 / 0.24 - 1 / 0.36) / (2 * math.pi)  # of (π + a) / (π - a), where a is e / 0.24 - e / 0.36
    assert sorted(both) == pytest.approx([-slope, slope], rel=1e-9)


def test_a_transmission_angle_in_a_window():
    """It is that of the rod and the normal of the guide: 90° less the rod's own angle (closed form)."""
    press = in_line()
    names = [f"min_transmission_angle.rod-slider where {text}" for text in ("0deg to 30deg", "-30deg to 100deg")]
    found = list(measures.evaluate(press, names, 48).values())
    wanted = [math.pi / 2 - math.asin(0.2 * math.sin(math.radians(angle))) for angle in (30, 90)]
    assert [float(each) for each in found] == pytest.approx(wanted, rel=1e-12)
    free = {"links.rod.length": "200 to 400 mm"}
    limits = ["min_transmission_angle.rod-slider >= 84 deg where 0 deg to 30 deg"]
    best = lj.optimise(press, free=free, minimise="links.rod.length", limits=limits)
    assert float(best.after.mechanism.links["rod"].length) == pytest.approx(0.03 / math.cos(math.radians(84)), rel=1e-7)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("max_x.D where 10deg to 400deg", "its window of 390 degrees is longer than the cycle of 360 degrees"),
        ("min_transmission_angle where 0deg to 9deg", "names no group; write e.g. min_transmission_angle.rod-slider"),
        ("stroke.D where 0deg to 9deg", "is not an extreme, and has no window; write stroke"),
        ("time_ratio.rod", "'rod' is not a slider or rocker of this machine"),
        ("max_acceleration.D", "write peak_acceleration or rms_acceleration"),
    ],
)
def test_names_of_measures_that_are_refused(text, says):
    press = in_line()
    with pytest.raises(lj.StructureError, match=re.escape(says)):
        measures.evaluate(press, [text])


def test_constraints_with_a_remedy():
    press = lj.load("four-bar")
    with pytest.raises(DesignError, match=r"limit min_transmission_angle\.coupler-rocker from below"):
        settled_limit(press, "transmission_angle.coupler-rocker >= 40 deg")
    with pytest.raises(
        DesignError, match=r'write two constraints, "swing\.rocker >= 80 deg" and "swing\.rocker <= 80 deg"'
    ):
        settled_limit(press, "swing.rocker = 80 deg")
