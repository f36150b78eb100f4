"""The report in a browser: the machine moves to the right positions, with a cursor in every diagram."""

from __future__ import annotations

import json
import math
import re
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax.analysis import document
from linkjax.report import write_report
from tests.report.optimum import OPTIMUM
from tests.report.pages import assert_printed
from tests.viz.cycles import analysed

ANGLES = (0.0, 37.31, 71.8, 90.0, 200.45, 359.9)
A4 = 680  # pixels at 96 per inch between margins of 15 mm
SET = "(slider, angle) => { slider.value = angle; slider.dispatchEvent(new Event('input')); }"


class Case(NamedTuple):
    """A report and its source data."""

    url: str
    scene: Any
    before: Any
    data: dict[str, Any]


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Case:
    """The hay press compared with one with a longer rod, with an optimisation."""
    scene, data = analysed("hay-press")
    before = lj.load("hay-press", {"links.rod.length": "1.08 m"})
    old = document(lj.analyse(before), "before", lj.__version__)
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_report(data, scene, path, before=(old, before), optimum=OPTIMUM)
    assert path.stat().st_size <= 3e6
    return Case(path.as_uri(), scene, before, data)


@pytest.fixture
def page(browser, case):
    """The report, opened; any error on the page, and any request to other addresses, fails the test."""
    opened = browser.new_page(viewport={"width": 1280, "height": 900})
    trouble: list[str] = []
    opened.on("console", lambda message: trouble.append(f"console: {message.text}"))
    opened.on("pageerror", lambda error: trouble.append(f"error: {error}"))
    opened.on("request", lambda request: trouble.append(request.url) if request.url != case.url else None)
    opened.goto(case.url)
    yield opened
    opened.close()
    assert trouble == []


def view(page) -> dict[str, Any]:
    return json.loads(page.locator("#machine-data").text_content())


def turn(page, angle: float) -> None:
    page.locator("#angle").evaluate(SET, angle)


def drawn(page, group: str) -> dict[str, tuple[float, float]]:
    """Positions of the joints in the picture, by name."""
    script = "all => all.map(c => [c.dataset.point, Number(c.getAttribute('cx')), Number(c.getAttribute('cy'))])"
    found = page.locator(f"#stage .{group} circle[data-point]").evaluate_all(script)
    return {name: (x, y) for name, x, y in found}


def rounded(decimals: int) -> float:
    """The largest error of a number printed with so many decimals."""
    return 0.5 * 10.0**-decimals + 1e-9


def shown_angle(page) -> float:
    return float(page.locator("#angle-shown").text_content().rstrip("°"))


@pytest.mark.parametrize("angle", ANGLES)
def test_pins_stand_where_the_mechanism_puts_them(page, case, angle):
    """Against the closed-form pose: to a hundredth of a point of the picture, in which the machine has about 500."""
    turn(page, angle)
    assert shown_angle(page) == pytest.approx(angle, abs=rounded(1))
    data = view(page)
    for group, scene in (("machine", case.scene), ("before", case.before)):
        pose = lj.pose(scene.mechanism, jnp.asarray(math.radians(angle)))
        found = drawn(page, group)
        assert set(found) == {"A", "B", "D", "E", "F", "G"}
        for name, (x, y) in found.items():
            at = pose.points[name].r
            wanted = data["left"] + data["scale"] * float(at.x), data["base"] - data["scale"] * float(at.y)
            assert math.hypot(x - wanted[0], y - wanted[1]) < 0.01


def test_a_clean_document_is_printed(page):
    """On paper: all tables and figures, none wider than the page, and nothing to click on; as PDF on A4."""
    on_screen = page.locator("figure svg, table").count()
    page.emulate_media(media="print")
    page.set_viewport_size({"width": A4, "height": 1000})
    assert [name for name in ("#controls", "nav", ".pad", ".screen") if page.locator(name).first.is_visible()] == []
    boxes = [each.bounding_box() for each in page.locator("figure svg, table").all() if each.is_visible()]
    assert len(boxes) == on_screen > 20
    assert all(box["x"] >= 0 and box["x"] + box["width"] <= A4 + 1 and box["height"] > 0 for box in boxes)
    pages = re.findall(rb"/MediaBox ?\[0 0 (\S+) (\S+)\]", page.pdf(prefer_css_page_size=True))
    assert len(pages) > 5
    assert all((round(float(w)), round(float(h))) == (595, 842) for w, h in pages)


def test_play_follows_the_true_motion(browser, case):
    """In a cycle of 4 s, 1.3 s are 1.3 / 4 of the period; the clock of the page is set by hand."""
    page = browser.new_page()
    page.clock.install(time=0)
    page.goto(case.url)
    page.clock.pause_at(1000)
    turn(page, 0)
    button = page.get_by_role("button", name="Play")
    button.click()
    page.clock.run_for(1300)
    page.get_by_role("button", name="Pause").click()
    reached = shown_angle(page)
    motion = case.data["motion"]
    times = np.append(motion["time"], motion["period"])
    angles = np.degrees(np.append(case.data["angles"], case.scene.cycle))
    low, high = np.interp(np.array([1.25, 1.32]) / 4 * motion["period"], times, angles)
    assert low < reached < high
    assert abs(reached - 360 * 1.3 / 4) > 5  # not the angle of a uniform motion
    page.clock.run_for(1000)
    assert shown_angle(page) == reached
    assert button.is_visible()
    page.close()


def test_controls_are_labelled_and_take_keys(page):
    slider = page.get_by_role("slider", name="Crank angle")
    turn(page, 100)
    slider.focus()
    page.keyboard.press("ArrowRight")
    assert 100 < shown_angle(page) <= 110
    page.keyboard.press("Home")
    assert shown_angle(page) == 0
    assert slider.get_attribute("aria-valuetext") == "0°"
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "play"
    page.get_by_label("Playback time").select_option("1")
    page.get_by_label("Names").uncheck()
    assert not page.locator("#names").is_visible()


@pytest.mark.parametrize("angle", [90.0, 180.0, 330.0])
def test_every_diagram_has_a_cursor_at_the_angle(page, angle):
    turn(page, angle)
    panels = page.locator("g[data-panel]")
    script = """panels => panels.map(p => [p.dataset.panel.split(' ').map(Number), Number(p.dataset.end),
        Number(p.querySelector('.cursor').getAttribute('x1'))])"""
    found = panels.evaluate_all(script)
    assert len(found) == 6 + 6 + 4 + 2 + 2 + 2 + 2 + 7 + 2 + 2
    for (left, _, right, _), end, x in found:
        assert end == 360
        assert x == pytest.approx(left + (right - left) * angle / 360, abs=rounded(2))
    # and against the text under the axis of the speeds
    speed = page.locator("svg[aria-label^='Speed and angular']")
    label = speed.get_by_text(f"{angle:.0f}", exact=True).last.bounding_box()
    line = speed.locator(".cursor").last.bounding_box()
    assert label["x"] + label["width"] / 2 == pytest.approx(line["x"] + line["width"] / 2, abs=1.5)


def test_dots_run_along_the_hodographs(page):
    script = """all => all.map(g => [['cx', 'cy'].map(k => Number(g.querySelector('.spot').getAttribute(k))),
        g.querySelector('path').getAttribute('d').match(/-?[\\d.]+ -?[\\d.]+/g).map(p => p.split(' ').map(Number))])"""
    turn(page, 90)
    found = page.locator("g.hodograph").evaluate_all(script)
    assert len(found) == 7 + 7 + 2 * 7 + 2
    for spot, ends in found:
        assert len(ends) == 361
        assert spot == pytest.approx(ends[90], abs=rounded(2))


def test_a_click_in_a_diagram_sets_the_angle(page):
    pad = page.locator("svg[aria-label^='Reduced inertia'] .pad").first
    pad.scroll_into_view_if_needed()
    box = pad.bounding_box()
    pad.click(position={"x": 0.25 * box["width"], "y": 0.4 * box["height"]})
    assert shown_angle(page) == pytest.approx(90, abs=1)


def test_the_machine_before_can_be_hidden(page):
    old = page.locator(".before")
    visible = [old.nth(i).is_visible() for i in range(old.count())]
    assert sum(visible) > 60
    assert page.locator("#stage .before").is_visible()
    page.get_by_label("Before").uncheck()
    assert not any(old.nth(i).is_visible() for i in (0, 1, old.count() // 2, old.count() - 1))
    assert not page.locator("#stage .before").is_visible()
    assert page.locator("#stage .machine").is_visible()
    page.get_by_label("Before").check()
    assert page.locator("#stage .before").is_visible()


def test_numbers_on_the_page_are_those_of_the_document(page, case):
    def cells(name: str) -> list[str]:
        row = page.locator("tr", has=page.get_by_role("rowheader", name=name, exact=True))
        return row.locator("td").all_inner_texts()

    motion = case.data["motion"]
    assert_printed(cells("coefficient of speed fluctuation δ")[1], motion["delta"], "")
    assert_printed(cells("max crank speed")[1], motion["max_speed"], "rpm", 30 / math.pi)
    assert_printed(cells("mean drive torque")[1], motion["mean_drive_torque"], "N·m")
    assert_printed(cells("shaking moment")[1], case.data["peaks"]["peak_shaking_moment"]["value"], "N·m")
    assert page.locator(".verdict").last.inner_text() == case.data["result"]["message"]
    angles = view(page)["machines"][0]["points"]["G"]["x"]
    assert np.allclose(angles, case.data["points"]["G"]["x"], rtol=1e-8, atol=0)


def test_units_change_labels_and_numbers(browser, tmp_path):
    scene, data = analysed("hay-press")
    path = write_report(data, scene, tmp_path / "report.html", units="m, rad/s, MN")
    page = browser.new_page()
    page.goto(path.as_uri())
    speed = page.locator("svg[aria-label^='Speed and angular']")
    assert speed.get_by_text("speed ω  (rad/s)").count() == 1
    assert speed.get_by_text("rpm").count() == 0
    assert page.locator("svg[aria-label^='Magnitudes of the joint'] text", has_text="(MN)").count() == 7
    assert page.locator("#stage .scale").text_content() == "0.2 m"
    assert page.locator("#stage .load text").text_content() == "hay 0.03 MN"
    row = page.locator("tr", has=page.get_by_role("rowheader", name="max crank speed", exact=True))
    assert_printed(row.locator("td").first.inner_text(), data["motion"]["max_speed"], "rad/s")
    page.close()


def test_paper_has_no_controls(page):
    page.emulate_media(media="print")
    for hidden in ("#controls", "nav"):
        assert not page.locator(hidden).is_visible()
    assert not page.locator(".cursor").first.is_visible()
    assert page.locator("#stage").is_visible()


@pytest.mark.parametrize("size", [(1280, 900), (390, 844), (320, 640)])
def test_nothing_sticks_out_sideways(page, tmp_path, size):
    page.set_viewport_size({"width": size[0], "height": size[1]})
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    assert page.locator("#controls").bounding_box()["height"] < 0.2 * size[1]
    page.screenshot(path=tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 10_000
