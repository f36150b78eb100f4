"""Significant results of an analysis, on the screen and in the report."""

import math
import re

import numpy as np

import linkjax as lj
from linkjax.analysis import acts_text, document, measure_scales, peak_names, peak_shown, still_rows
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


def test_peaks_of_a_locked_machine_have_no_place():
    """The largest force is infinite wherever it locks, and there is no least one; elsewhere an infinite force has its
    place."""
    locked = synthetic(math.inf, 1.0, 0.0, math.inf) | {"friction": {"locks": True}}
    for key, value in (
        ("peak_reaction.B.rod", math.inf),
        ("max_drive_torque", math.inf),
        ("min_drive_torque", math.nan),
    ):
        np.testing.assert_equal(peak_shown(locked, key), (value, math.nan, math.nan))
    assert peak_shown(synthetic(math.inf, 1.0, 0.0), "peak_reaction.B.rod")[1] == 1.0


def test_mean_power_at_constant_speed():
    """Of two turns at 10 rad/s, in which the drive supplies 80 J more than it takes."""
    data = {"angles": np.arange(8) * math.pi / 2, "energies": {"drive": {"supplied": 100.0, "absorbed": 20.0}}}
    rows = dict(still_rows(data, 10.0, Cells()))
    assert rows["mean power at constant speed"] == f"{80 / (0.4 * math.pi):.4f} W"
    idle = {**data, "energies": {"drive": {"supplied": 0.0, "absorbed": 0.0}}}
    assert "mean power at constant speed" not in dict(still_rows(idle, 10.0, Cells()))


def test_what_cannot_shake_has_no_peaks_of_shaking():
    names = ("peak_shaking_force", "max_shaking_moment", *(f"{way}_drive_torque" for way in ("peak", "max", "min")))
    cases = ((0.0, 0.0, 2.0, 3), (0.0, 0.0, 0.0, 0), (1.0, 0.0, 0.0, 5), (0.0, 5.0, 0.0, 5))  # the last at dead centres
    for inertia, force, torque, number in cases:
        peaks = {name: {"value": 0.0, "angle": 1.0, "error": 0.0} for name in names}
        peaks["peak_shaking_force"]["value"], peaks["peak_drive_torque"]["value"] = force, torque
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
