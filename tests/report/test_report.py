"""The HTML report: self-contained, well formed, and its numbers are those of the analysis."""

from __future__ import annotations

import dataclasses
import json
import math
import re

import pytest

import linkjax as lj
from linkjax._units import QuantityError, display_units
from linkjax.analysis import peak_shown
from linkjax.report import _tables, write_report
from linkjax.report._cells import Cells, Numbers
from linkjax.report._optimum import asked
from linkjax.viz import write_figures
from tests.report.optimum import OPTIMUM
from tests.report.pages import assert_printed, read
from tests.viz.cycles import SCENES, STANDARD, analysed

PLAIN = Numbers()


@pytest.fixture(scope="module", params=SCENES)
def report(request, tmp_path_factory):
    scene, data = analysed(request.param)
    path = write_report(data, scene, tmp_path_factory.mktemp(request.param) / "report.html", figures=[])
    return scene, data, read(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["quick-return", *(pytest.param(n, marks=pytest.mark.slow) for n in ("hay-press", "four-bar"))]
)
def test_self_contained_and_well_formed(name, tmp_path):
    scene, data = analysed(name)
    path = write_report(data, scene, tmp_path / "report.html", figures=write_figures(data, scene, tmp_path))
    again = write_report(data, scene, tmp_path / "again.html", figures=tmp_path)
    assert write_report(data, scene, tmp_path / "drawn.html").read_bytes() == path.read_bytes() == again.read_bytes()
    text = path.read_text(encoding="utf-8")
    assert len(text.encode()) <= 1.5e6
    assert not re.search(r"https?:|//www|@import|<link|<img|src=|NaN|Infinity", text)
    page = read(path)
    assert page.counts["svg"] == len(STANDARD)  # the page draws the machine by itself
    assert page.counts["figure"] == len(STANDARD)
    assert page.counts["script"] == 2
    assert len(page.ids) == len(set(page.ids))
    assert {link.removeprefix("#") for link in page.links} <= set(page.ids)
    for picture in STANDARD[1:]:
        assert picture.caption in page.text


@pytest.mark.slow
def test_panels_over_the_crank_angle_are_marked(tmp_path):
    scene, data = analysed("slider-crank")
    page = write_report(data, scene, tmp_path / "report.html").read_text(encoding="utf-8")
    panels = re.findall(r'data-panel="([^"]+)" data-end="(\d+)"', page)
    assert {end for _, end in panels} == {"360"}
    assert len(panels) == 6 + 6 + 4 + 2 + 2 + 2 + 2 + 5 + 2 + 2
    for left, top, right, bottom in ([float(edge) for edge in panel.split()] for panel, _ in panels):
        assert 0 < left < right < 518.4
        assert 0 < top < bottom


def test_results(report):
    scene, data, page = report
    motion, rpm = data["motion"], 30 / math.pi
    assert_printed(page.row("coefficient of speed fluctuation δ")[0], motion["delta"], "")
    assert PLAIN.quantity(motion["delta_error"], "", 2) in page.row("coefficient of speed fluctuation δ")[1]
    for name, key in (("mean", "mean_speed"), ("max", "max_speed"), ("min", "min_speed")):
        assert_printed(page.row(f"{name} crank speed")[0], motion[key], "rpm", rpm)
    for name, key in (("max", "angle_of_max"), ("min", "angle_of_min")):
        at = page.row(f"{name} crank speed")[1].removeprefix("at ")
        if scene.mechanism.prescribed:  # the law has one speed
            assert at == "" and motion["delta"] == 0
        else:
            assert_printed(at, motion[key], "°", 180 / math.pi)
    assert_printed(page.row("mean drive torque")[0], motion["mean_drive_torque"], "N·m")
    power = motion["mean_drive_torque"] * scene.cycle / motion["period"]
    assert_printed(page.row("mean drive power")[0], power, "W")
    wheel = data["flywheel"]
    assert_printed(page.row("flywheel inertia, given")[0], wheel["given"], "kg·m²")
    if wheel["for_target_delta"] is not None:
        assert_printed(page.row("flywheel inertia for target δ")[0], wheel["for_target_delta"], "kg·m²")
    assert page.row("method")[0].startswith(f"{data['model']['method']}: ")
    assert data["result"]["message"] in page.text


def assert_peak(cells: list[str], data: dict, name: str, unit: str) -> None:
    """Value, error and crank angle as printed; both angles of equal peaks, none of a constant or of zero."""
    (value, _, at), peak = cells, data["peaks"][name]
    shown, angle, _ = peak_shown(data, name)
    assert_printed(value, shown, unit)
    if at == "–":
        assert math.isnan(angle)
        return
    places = [peak["angle"], peak["tied"]] if " and " in at else [peak["angle"]]
    for text, place in zip(at.split(" and "), places, strict=True):
        assert_printed(text, place, "°", 180 / math.pi)


def test_peaks(report):
    scene, data, page = report
    plain = ("shaking_force", "frame_force", "shaking_moment", "drive_torque", "net_frame_force")
    names = {name.replace("_", " "): f"peak_{name}" for name in plain if f"peak_{name}" in data["peaks"]}
    ways = [f"{way}_{name}" for name in ("shaking_moment", "drive_torque") for way in ("max", "min")]
    names |= {name.replace("_", " "): name for name in ways}
    for name in data["peaks"]:
        if name.startswith("peak_reaction."):
            joint, _, link = name.removeprefix("peak_reaction.").rpartition(".")
            names[f"guide force on {link}" if joint.endswith("guide") else f"joint force {joint} on {link}"] = name
    assert len(names) == len(data["peaks"]) // 2
    for label, name in names.items():
        cells, unit = page.row(label), "N·m" if label.split()[-1] in ("torque", "moment") else "N"
        head, dot, element = name.partition(".")
        both = [name, f"{head}_constant_speed{dot}{element}"][: 1 if scene.mechanism.prescribed else 2]
        assert len(cells) == 3 * len(both)
        for i, peak in enumerate(both):
            assert_peak(cells[3 * i : 3 * i + 3], data, peak, unit)


def test_links_groups_and_dead_centres(report):
    scene, data, page = report
    for name, link in scene.mechanism.links.items():
        (row,) = [each for each in page.rows if each[0] == name and len(each) == 6 and each[1] != "length"]
        _, _, mass, centre, inertia, _ = row
        assert_printed(mass, float(link.actual().mass), "kg")
        assert_printed(inertia, float(link.actual().inertia), "kg·m²")
        assert centre.startswith(link.centre_name)
    for name, group in data["groups"].items():
        kind, margins, _ = page.row(name, cells=4)
        assert kind == group["formula"]
        for side, least in group.get("margins", {}).items():
            assert f"{side} {PLAIN.quantity(least['value'], '', 4)}" in margins
    for entry in data["dead_centres"]:
        kind = "point" if "point" in entry else "link"
        angles, covered, ratio = page.row(f"{kind} {entry[kind]}", cells=4)
        assert f"{math.degrees(entry['angle']):.3f}°" in angles
        stroke = data["strokes" if kind == "point" else "swings"][entry[kind]]
        unit, scale = ("m", 1.0) if kind == "point" else ("°", 180 / math.pi)
        assert_printed(covered, stroke["value"], unit, scale)
        if stroke["time_ratio"] is None:  # it has no return
            assert ratio == "–"
        else:
            assert_printed(ratio, stroke["time_ratio"], "")


def test_checks_pass_or_fail(tmp_path):
    scene, data = analysed("four-bar")
    worse = {**data, "checks": {"virtual_power": 1e-3, "energy_closure": 1e-12, "force_balance": math.nan}}
    failed = {**worse, "result": {"code": 2, "message": "It stops."}}
    page = read(write_report(failed, scene, tmp_path / "new" / "report.html", figures=[]))
    verdicts = [row[-1] for row in page.rows if row[-1].startswith(("✓", "✗"))]
    assert verdicts == ["✗ fail", "✓ pass", "✗ fail"]
    assert "It stops." in page.text
    assert page.counts["svg"] == 1


def test_what_the_machine_before_cannot_do(tmp_path):
    """Reported beside the later machine, whose speed is smoother than required without any flywheel."""
    scene, data = analysed("slider-crank")
    stuck = {**data, "result": {"code": 3, "message": "It does not run."}}
    even = {**data, "flywheel": {**data["flywheel"], "for_target_delta": -0.1}}
    page = read(write_report(even, scene, tmp_path / "report.html", figures=[], before=(stuck, scene)))
    assert "Before: It does not run." in page.text
    needed = page.row("flywheel inertia for target δ", cells=4)
    assert needed[1] == "none"
    assert "exact value" not in needed[2]


def test_names_are_escaped(tmp_path):
    scene, data = analysed("slider-crank")
    evil = '<script>alert(1)</script> & "quoted" $body'
    loads = tuple(dataclasses.replace(load, name=evil) for load in scene.loads)
    shares = {evil if name != "gravity" else name: share for name, share in data["reduced"]["torque_by_load"].items()}
    strange = {**data, "scene": evil, "reduced": {**data["reduced"], "torque_by_load": shares}}
    scene = dataclasses.replace(scene, title=evil, loads=loads)
    part = {key: strange[key] for key in ("angles", "points", "links", "reduced", "motion", "scene")}
    figures = write_figures(part, scene, tmp_path)
    page = read(write_report(strange, scene, tmp_path / "report.html", figures=figures))
    assert page.counts["script"] == 2
    assert "</script>" not in page.scripts[0]
    assert json.loads(page.scripts[0])["machines"][0]["loads"][0]["text"].startswith(evil)
    assert page.text.count(evil) >= 6  # title, heading, load table, drawings


def test_errors_decide_the_digits():
    assert PLAIN.measured(386518.2006744361, 254.93, "N") == ("386.5 kN", "± 255 N")
    assert PLAIN.measured(1.1215243498820249, 1.7e-9) == ("1.12152435", "± 1.7·10⁻⁹")
    assert PLAIN.measured(0.5, 0.0) == ("0.5000000000", "± 0")
    assert PLAIN.measured(2.0, 5.0, "N") == ("0 N", "± 5.0 N")
    assert PLAIN.measured(math.nan, 1.0) == ("–", "")


def test_what_was_put_in_stays_short():
    assert PLAIN.shown(0.3, "m") == "300 mm"
    assert PLAIN.shown(-9.81, "m/s²") == "−9.81 m/s²"
    assert PLAIN.shown(30e3, "N") == "30 kN"
    assert PLAIN.shown(0.0, "kg") == "0 kg"


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """The press compared with one with a shorter neighbour of its rocker: everything in it, in chosen units."""
    scene, data = analysed("hay-press")
    before = {**data, "motion": {**data["motion"], "delta": 0.5, "max_speed": 100.0}}
    path = tmp_path_factory.mktemp("compared") / "report.html"
    write_report(data, scene, path, figures=[], before=(before, scene), optimum=OPTIMUM, units="m, rad/s, kN, kN m")
    return data, read(path)


def test_before_and_after(compared):
    data, page = compared
    before, after, _ = page.row("coefficient of speed fluctuation δ")
    assert_printed(before, 0.5, "")
    assert_printed(after, data["motion"]["delta"], "")
    before, after, remark = page.row("max crank speed")
    assert before == "100.000 rad/s"
    assert_printed(after, data["motion"]["max_speed"], "rad/s")
    assert remark.endswith("°")
    peak = data["peaks"]["peak_drive_torque"]["value"]
    true, constant = [row for row in page.rows if row[0] == "drive torque"]
    assert_printed(true[1], peak, "kN·m", 1e-3)
    assert true[2].endswith("kN·m")
    assert_printed(constant[1], data["peaks"]["peak_drive_torque_constant_speed"]["value"], "kN·m", 1e-3)


def test_units_that_were_chosen(compared):
    _, page = compared
    assert page.row("rod", cells=6)[0] == "1.02 m"
    assert "at 73.3038 rad/s mean speed" in page.text
    assert "30 kN against the motion" in [row[2] for row in page.rows if row[0] == "hay"]


def test_optimisation(compared):
    _, page = compared
    assert page.row("objective") == ["minimise peak shaking force"]
    assert page.row("constraints") == ["peak drive torque at most 52 kN·m; min margin at least 0.01"]
    both = {**OPTIMUM["limits"]["min_margin"], "bound": 0.02}
    limits = {"min_margin at least": both, "min_margin at most": {**both, "sense": "at most"}}
    shown = asked(Cells(), {**OPTIMUM, "limits": limits})
    assert "min margin at least 0.02; min margin at most 0.02" in shown
    assert page.row("design variables") == ["links.rod.length (0.95 m … 1.15 m); points.E.turned (20° … 40°)"]
    assert page.row("solver") == ["cone: largest magnitudes"]
    assert page.row("before") == ["the machine as it was"]
    assert page.row("cases (the objective is the worst)") == ["full, empty"]
    assert page.row("peak shaking force, worst case") == ["400.00 kN", "300.00 kN", "−25.0 %", "objective"]
    assert page.row("steady-state margin", cells=5) == ["–", "0.20000", "–", ""]
    assert page.row("links.rod.length") == ["1.00000 m", "0.950000 m", "0.95 m", "1.15 m", "at lower bound", "1234"]
    assert page.row("points.E.turned") == ["30.0000°", "35.0000°", "20°", "40°", "no effect", ""]
    wanted = [
        "70.000 kN·m",
        "52.000 kN·m",
        "at most 52 kN·m",
        "",
        "",
        "90.000°, 120.000°",
    ]  # no multiplier if constraints conflict
    assert page.row("peak drive torque", cells=7) == wanted
    assert page.row("min margin", cells=7)[4] == "violated"
    assert page.row("linked: links.link4.length", cells=7)[:2] == ["0.500000 m", "0.475000 m"]
    assert page.row("residual of the optimality conditions (KKT)") == ["3.0·10⁻¹⁰"]
    assert page.row("cycle evaluations") == ["143"]
    assert page.row("starts") == ["1 of 2 reached the optimum; 1 feasible"]
    assert page.row("2", cells=5) == ["–", "no", "0.10", "20"]
    assert page.row("peak drive torque", cells=2) == ["satisfied"]  # in the list of conflicting constraints
    assert page.row("min margin", cells=2) == ["violated"]
    assert "Limits clash." in page.text
    assert page.counts["svg"] == 3  # the display, the history and the trade-off


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("mm, furlong", "unknown unit 'furlong'"),
        ("mm, cm", "two units of length"),
        ("N^2", "belongs to no quantity that is shown"),
        ("3 mm", "cannot read the unit"),
    ],
)
def test_units_that_cannot_be(text, problem):
    with pytest.raises(QuantityError, match=problem):
        display_units(text)


def test_display_units():
    found = display_units("mm, rpm, kN, kN m, deg, kJ, kg cm^2")
    assert found["m"] == (1000.0, "mm")
    assert found["m/rad^2"] == (1000.0, "mm/rad²")
    assert found["rad/s"] == (pytest.approx(30 / math.pi, rel=1e-15), "rpm")
    assert found["N m"] == (1e-3, "kN·m")
    assert found["rad"] == (pytest.approx(180 / math.pi, rel=1e-15), "°")
    assert found["J"] == (1e-3, "kJ")
    assert found["kg m^2"] == (1e4, "kg·cm²")
    assert display_units("") == {}


def test_machines_before_and_after_need_the_same_angles(tmp_path):
    scene, data = analysed("four-bar")
    fewer = {**data, "angles": data["angles"][::2]}
    with pytest.raises(ValueError, match="before and after have different crank angles"):
        write_report(data, scene, tmp_path / "report.html", figures=[], before=(fewer, scene))


def test_the_numbers_of_a_motor():
    text = re.sub(r"<[^>]*>", "|", _tables.motor(Cells(), lj.load("pump-with-motor")))
    for row in ("kind||induction motor, type plate", "rated power||3 kW", "rated speed||1435 rpm", "ratio||8.2"):
        assert row in text, text
    assert _tables.motor(Cells(), lj.load("slider-crank")) == ""


def test_the_numbers_of_friction():
    text = re.sub(r"<[^>]*>", "|", _tables.friction(Cells(), lj.load("friction-slider-crank")))
    assert re.search(r"\|A\|+0\.1\|+radius 10 mm\|", text), text
    assert _tables.friction(Cells(), lj.load("slider-crank")) == ""
