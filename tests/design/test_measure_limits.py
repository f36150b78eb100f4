"""Measures of elements as constraints and objectives, for every crank angle of a window too; and subgradients."""

from __future__ import annotations

import functools
import json
import math

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


def in_line(offset: float = 0.0) -> lj.Scene:
    return lj.Scene(slider_crank(0.06, 0.3, offset), speed=10.0)


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
    found = measures.subgradients(in_line(0.02), "time_ratio.D")
    assert len(found) == 1 and math.isnan(found[0].angle)
    assert jnp.isfinite(found[0].gradient.mechanism.links["rod"].length)
