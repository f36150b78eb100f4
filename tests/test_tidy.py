"""Significant results of an analysis, on the screen and in the report."""

import math
import re

import numpy as np

import linkjax as lj
from linkjax.analysis import acts_text, document, measure_scales, peak_names, peak_shown
from linkjax.report import _tables
from linkjax.report._cells import Cells
from linkjax.scenes import loads_text
from tests.test_cli_at import SLIDER_CRANK


def synthetic(force: float, error: float, least: float, torque: float = 0.0, mean: float = 0.0) -> dict:
    """A document of one joint whose force is between two sizes, beside one of 1 kN, and of the drive torque."""
    angles = np.linspace(0.0, 6.0, 12)
    size = np.linspace(least, force, 12) if math.isfinite(force) else np.full(12, math.nan)
    joint = {"fx": 0.6 * size, "fy": -0.8 * size, "moment": 0.0 * size}
    peaks = {
        "peak_reaction.B.rod": {"value": force, "angle": 1.0, "error": error},
        "peak_reaction.C.rod": {"value": 1000.0, "angle": 2.0, "error": 1e-9},
        **{f"{way}_drive_torque": {"value": torque, "angle": 3.0, "error": 1e-9} for way in ("peak", "max", "min")},
    }
    return {
        "angles": angles, "points": {"B": {"x": np.cos(angles), "y": np.sin(angles)}}, "peaks": peaks,
        "reduced": {"inertia": np.ones(12)}, "model": {"constant_speed": False},
        "motion": {"mean_speed": 10.0, "mean_drive_torque": mean}, "forces": {"reactions": {"B": {"rod": joint}}},
    }  # fmt: skip


def told(key: str, *numbers: float) -> tuple[float, bool]:
    """The reported value of a peak, and whether it has an angle."""
    value, angle, _ = peak_shown(synthetic(*numbers), key)
    return value, math.isfinite(angle)


def test_a_range_ends_at_the_end_of_the_cycle():
    """A range that ends at crank angle zero is told with 360°; one that goes on beyond it is not."""
    two_turns = {"angles": np.arange(12) * math.pi / 3}
    for ranges, text in (((3.0, 0.0), "171.887° to 720.000°"), ((3.0, 1.0), "171.887° to 57.296°")):
        assert acts_text(two_turns | {"windows": {"push": [ranges]}}, "push", Cells()) == text
    one_turn = {"angles": np.arange(12) * math.pi / 6, "windows": {"push": [(0.0, 0.0)]}}
    assert acts_text(one_turn, "push", Cells()) == "0.000° to 360.000°"


def test_peaks():
    assert told("peak_reaction.B.rod", 5.0, 1e-6, 1.0) == (5.0, True)
    assert told("peak_reaction.B.rod", 5.0, 1e-6, 5.0 - 1e-7) == (5.0, False)  # the same everywhere, within its error
    assert told("peak_reaction.B.rod", 5.0, 1e-6, 5.0 - 1e-5) == (5.0, True)
    assert told("peak_reaction.B.rod", 1e-10, 1e-20, 0.0) == (0.0, False)  # rounding beside 1 kN
    assert told("peak_reaction.B.rod", 5.0, 6.0, 0.0) == (0.0, False)  # below its error
    assert told("peak_reaction.B.rod", math.inf, 1.0, 0.0) == (math.inf, True)  # unbounded, at a change point
    assert told("peak_reaction.B.rod", 5.0, math.inf, 0.0)[0] == 5.0
    assert told("peak_drive_torque", 5.0, 1.0, 0.0, 360.0, -360.0) == (360.0, False)
    assert told("peak_drive_torque", 5.0, 1.0, 0.0, 360.0, 359.0) == (360.0, True)
    assert told("peak_drive_torque", 5.0, 1.0, 0.0, 1e-14, 1e-14) == (0.0, False)


def test_what_cannot_shake_has_no_peaks_of_shaking():
    names = ("peak_shaking_force", "max_shaking_moment", "peak_drive_torque")
    for inertia, force, number in ((0.0, 0.0, 1), (1.0, 0.0, 3), (0.0, 5.0, 3)):  # the last at dead centres alone
        peaks = {name: {"value": 0.0, "angle": 1.0, "error": 0.0} for name in names}
        peaks["peak_shaking_force"]["value"] = force
        data = synthetic(5.0, 1e-6, 1.0) | {"reduced": {"inertia": np.full(12, inertia)}, "peaks": peaks}
        data["forces"]["shaking"] = {"fx": np.linspace(0.0, force, 12), "fy": np.zeros(12), "moment": np.zeros(12)}
        assert len(peak_names(data)) == number


def test_measures_of_an_optimisation():
    units = {"mean_drive_torque": "N m", "peak_drive_torque": "N m", "delta": "1", "peak_reaction": "N"}
    before = {"mean_drive_torque": 1e-15, "peak_drive_torque": -8.0, "delta": 0.1, "peak_reaction": None}
    found = measure_scales({"units": units, "before": before, "after": {**before, "peak_drive_torque": 2.0}})
    assert found == {"N": 0.0, "N m": 8.0, "W": 0.0}
    assert Cells().several([1e-15, 0.0], "N m", 5, found["N m"])[0].text == "0 N·m"


def test_the_report_of_a_machine_that_idles():
    """Without load or weight the constant torque and its power are exactly zero."""
    scene = loads_text(SLIDER_CRANK)
    data = document(lj.analyse(scene, angles=36))
    text = _tables.results(Cells(), data, scene) + re.sub(r"± ?[^<]*", "", _tables.peaks(Cells(), data))
    row = re.search(r"drive torque</th>(.*?)</tr>", _tables.peaks(Cells(), data))
    assert row and re.findall(r">([^<]*)</td>", row[1])[0] == "0 N·m"
    assert re.search(r"mean drive torque</th><td[^>]*>0 N·m<", text)
    assert re.search(r"mean drive power</th><td[^>]*>0 W<", text)
    assert not re.search(r"\d (nN|nW|µW)", text)
