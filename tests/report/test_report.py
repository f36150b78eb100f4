"""The HTML report: self-contained, well formed, and its numbers are those of the analysis."""

from __future__ import annotations

import base64
import dataclasses
import math
import re
from html.parser import HTMLParser

import pytest

from linkjax.report import write_report
from linkjax.report._cells import measured, quantity, shown
from linkjax.viz import PICTURES, animate, write_figures
from tests.viz.cycles import SCENES, analysed

VOID = {"meta", "img", "br", "hr", "link", "input"}
POWERS = {"": 0, "k": 3, "M": 6, "m": -3, "µ": -6, "n": -9, "G": 9}
FIGURES = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")


class Page(HTMLParser):
    """Tables by row, and what a well-formed page has."""

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.links, self.rows, self.sources = [], [], [], [], []
        self.counts, self.text = {}, ""

    def handle_starttag(self, tag, attrs):
        self.counts[tag] = self.counts.get(tag, 0) + 1
        found = dict(attrs)
        self.ids += [found["id"]] if "id" in found else []
        self.links += [found["href"]] if "href" in found else []
        self.links += re.findall(r"url\((#[^)]+)\)", " ".join(value or "" for value in found.values()))
        self.sources += [found["src"]] if "src" in found else []
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data

    def row(self, name: str, cells: int | None = None) -> list[str]:
        """The one row of that name (and so many cells), its name left out."""
        (found,) = [row[1:] for row in self.rows if row[0] == name and cells in (None, len(row))]
        return found


def read(path) -> Page:
    page = Page()
    page.feed(path.read_text(encoding="utf-8"))
    page.close()
    assert not page.open
    return page


def assert_printed(text: str, value: float, unit: str, scale: float = 1.0) -> None:
    """The text is the value to the digits printed, in the unit with or without a prefix."""
    found = re.fullmatch(r"(−?[\d.]+)(?:·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))? ?(.*)", text)
    assert found, text
    mantissa, power, printed = found.groups()
    exponent = int((power or "0").translate(FIGURES))
    if printed != unit:
        assert printed.endswith(unit), text
        prefix = printed.removesuffix(unit)
        exponent += POWERS[prefix] if prefix in POWERS else int(prefix[2:].strip().translate(FIGURES))
    step = 10.0 ** (exponent - len(mantissa.partition(".")[2]))
    number = float(mantissa.translate(FIGURES)) * 10.0**exponent
    assert abs(number - scale * value) <= 0.5000001 * step, (text, value)


@pytest.fixture(scope="module", params=SCENES)
def report(request, tmp_path_factory):
    scene, data = analysed(request.param)
    path = write_report(data, scene, [], tmp_path_factory.mktemp(request.param) / "report.html")
    return scene, data, read(path)


@pytest.mark.parametrize("name", ["hay-press", "four-bar"])
def test_self_contained_and_well_formed(name, tmp_path):
    scene, data = analysed(name)
    gif = animate(data, scene, tmp_path / "machine.gif")
    path = write_report(data, scene, write_figures(data, scene, tmp_path), tmp_path / "report.html", gif)
    assert write_report(data, scene, tmp_path, tmp_path / "again.html").read_bytes() == path.read_bytes()
    text = path.read_text(encoding="utf-8")
    assert len(text.encode()) <= 3e6
    assert not re.search(r"https?:|//www|@import|<script|<link", text)
    page = read(path)
    assert page.counts["svg"] == len(PICTURES)
    assert page.counts["figure"] == len(PICTURES) + 1
    assert len(page.ids) == len(set(page.ids))
    assert {link.removeprefix("#") for link in page.links} <= set(page.ids)
    (source,) = page.sources
    assert base64.b64decode(source.removeprefix("data:image/gif;base64,")) == gif.read_bytes()
    for picture in PICTURES:
        assert picture.caption in page.text


def test_results(report):
    scene, data, page = report
    motion, rpm = data["motion"], 30 / math.pi
    assert_printed(page.row("coefficient of speed fluctuation δ")[0], motion["delta"], "")
    assert quantity(motion["delta_error"], "", 2) in page.row("coefficient of speed fluctuation δ")[1]
    for name, key in (("mean", "mean_speed"), ("largest", "speed_max"), ("smallest", "speed_min")):
        assert_printed(page.row(f"{name} speed")[0], motion[key], "rpm", rpm)
    for name, key in (("largest", "angle_of_max"), ("smallest", "angle_of_min")):
        assert_printed(page.row(f"{name} speed")[1].removeprefix("at "), motion[key], "°", 180 / math.pi)
    assert_printed(page.row("drive torque, constant")[0], motion["drive_torque_mean"], "N·m")
    power = motion["drive_torque_mean"] * scene.cycle / motion["period"]
    assert_printed(page.row("drive power, mean")[0], power, "W")
    wheel = data["flywheel"]
    assert_printed(page.row("flywheel, given")[0], wheel["given"], "kg·m²")
    if wheel["for_target_delta"] is not None:
        assert_printed(page.row("flywheel, needed")[0], wheel["for_target_delta"], "kg·m²")
    assert data["result"]["message"] in page.text


def test_peaks(report):
    _, data, page = report
    names = {"shaking force": "shaking_force", "drive torque": "drive_torque", "shaking moment": "shaking_moment"}
    for name in data["peaks"]:
        if name.startswith("reaction.") and not name.endswith("_constant_speed"):
            joint, _, link = name.removeprefix("reaction.").rpartition(".")
            names[f"guide force on {link}" if joint.endswith("guide") else f"joint force {joint} on {link}"] = name
    assert len(names) == len(data["peaks"]) // 2 - 1  # all but the frame force
    for label, name in names.items():
        cells, unit = page.row(label), "N·m" if label.split()[-1] in ("torque", "moment") else "N"
        for peak, (value, _, at) in zip((name, f"{name}_constant_speed"), (cells[:3], cells[3:]), strict=True):
            assert_printed(value, data["peaks"][peak]["value"], unit)
            assert_printed(at, data["peaks"][peak]["angle"], "°", 180 / math.pi)


def test_links_groups_and_dead_centres(report):
    scene, data, page = report
    for name, link in scene.mechanism.links.items():
        _, mass, centre, inertia, _ = page.row(name, cells=6)
        assert_printed(mass, float(link.actual().mass), "kg")
        assert_printed(inertia, float(link.actual().inertia), "kg·m²")
        assert centre.startswith(link.centre_name)
    for name, group in data["groups"].items():
        kind, margins, _ = page.row(name, cells=4)
        assert kind == group["formula"]
        for side, least in group.get("margins", {}).items():
            assert f"{side} {quantity(least['value'], '', 4)}" in margins
    for entry in data["dead_centres"]:
        kind = "point" if "point" in entry else "link"
        angles = page.row(f"{kind} {entry[kind]}")[0]
        assert f"{math.degrees(entry['angle']):.3f}°" in angles


def test_checks_pass_or_fail(tmp_path):
    scene, data = analysed("four-bar")
    worse = {**data, "checks": {"virtual_power": 1e-3, "energy_closure": 1e-12, "force_balance": math.nan}}
    failed = {**worse, "result": {"code": 2, "message": "It stops."}}
    page = read(write_report(failed, scene, [], tmp_path / "new" / "report.html"))
    verdicts = [row[-1] for row in page.rows if row[-1].startswith(("✓", "✗"))]
    assert verdicts == ["✗ fail", "✓ pass", "✗ fail"]
    assert "It stops." in page.text
    assert "svg" not in page.counts


def test_names_are_escaped(tmp_path):
    scene, data = analysed("slider-crank")
    evil = '<script>alert(1)</script> & "quoted" $body'
    loads = tuple(dataclasses.replace(load, name=evil) for load in scene.loads)
    shares = {evil if name != "gravity" else name: share for name, share in data["reduced"]["torque_by_load"].items()}
    strange = {**data, "scene": evil, "reduced": {**data["reduced"], "torque_by_load": shares}}
    scene = dataclasses.replace(scene, title=evil, loads=loads)
    part = {key: strange[key] for key in ("angles", "points", "links", "reduced", "motion", "scene")}
    page = read(write_report(strange, scene, write_figures(part, scene, tmp_path), tmp_path / "report.html"))
    assert "script" not in page.counts
    assert page.text.count(evil) >= 6  # title, heading, load table, drawings


def test_errors_decide_the_digits():
    assert measured(386518.2006744361, 254.93, "N") == ("386.5 kN", "± 255 N")
    assert measured(1.1215243498820249, 1.7e-9) == ("1.12152435", "± 1.7·10⁻⁹")
    assert measured(0.5, 0.0) == ("0.5000000000", "± 0")
    assert measured(2.0, 5.0, "N") == ("2.00 N", "± 5.0 N")
    assert measured(math.nan, 1.0) == ("–", "")


def test_what_was_put_in_stays_short():
    assert shown(0.3, "m") == "300 mm"
    assert shown(-9.81, "m/s²") == "−9.81 m/s²"
    assert shown(30e3, "N") == "30 kN"
    assert shown(0.0, "kg") == "0 kg"
