"""Every figure of every built-in machine; warnings are errors throughout."""

from __future__ import annotations

import dataclasses
import math

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import linkjax as lj
from linkjax import viz
from linkjax._display import number
from linkjax._units import display_units
from linkjax.analysis import positions
from linkjax.viz._curves import hodograph, moving
from linkjax.viz._forces import cases, joints
from linkjax.viz._write import _has
from tests.helpers import PACKAGE
from tests.report.optimum import OPTIMUM
from tests.viz.cycles import SCENES, STANDARD, analysed

PICTURE = {picture.name: picture for picture in STANDARD}


def curves(figure: Figure) -> list[np.ndarray]:
    """All lines of a figure with more than constant data, as (x, y) rows."""
    lines = [np.asarray(line.get_xydata(), float) for ax in figure.axes for line in ax.get_lines()]
    return [line.T for line in lines if len(line) > 2]


def written(figure: Figure) -> list[Text]:
    """All visible text in a figure."""
    texts = list(figure.texts)
    for legend in figure.legends:
        texts += legend.get_texts()
    for ax in (ax for ax in figure.axes if ax.axison):
        texts += [*ax.texts, ax.title]
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            texts += [axis.label, *(tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high)]
    texts += [text for ax in figure.axes if not ax.axison for text in ax.texts]
    return [text for text in texts if text.get_text() and text.get_visible()]


def assert_tidy(figure: Figure) -> None:
    """No text extends beyond the figure, no panel title overlaps the next panel's."""
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()  # pyright: ignore[reportAttributeAccessIssue]
    page = figure.bbox
    for text in written(figure):
        box = text.get_window_extent(renderer)
        inside = box.x0 >= page.x0 and box.y0 >= page.y0 and box.x1 <= page.x1 + 1 and box.y1 <= page.y1
        assert inside, f"{text.get_text()} at {box}"
    heads = [ax.title.get_window_extent(renderer) for ax in figure.axes if ax.title.get_text()]
    for i, one in enumerate(heads):
        assert not any(one.overlaps(other) for other in heads[:i])


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("picture", PICTURE)
def test_every_figure_of_every_scene(picture, name):
    scene, data = analysed(name)
    needs = PICTURE[picture].needs
    if (needs == "free motion" and scene.mechanism.prescribed) or (needs == "friction" and not scene.friction):
        return
    before = matplotlib.rcParams.copy()
    figure = PICTURE[picture].draw(data, scene)
    assert matplotlib.rcParams == before
    assert_tidy(figure)
    found = curves(figure)
    assert found
    assert all(np.all(np.isfinite(curve)) for curve in found)
    assert any(np.ptp(curve[1]) > 0 for curve in found)


def test_no_global_drawing_state():
    assert not [path for path in (PACKAGE / "viz").glob("*.py") if "pyplot" in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("name", SCENES)
def test_curves_are_the_data(name):
    scene, data = analysed(name)
    phi = np.degrees(np.append(data["angles"], scene.cycle))
    names = ("points", "inertia", "torque", "drive", "shaking", "reactions")
    drawn = {picture: curves(PICTURE[picture].draw(data, scene)) for picture in names}

    def found(picture: str, values: np.ndarray) -> bool:
        wanted = np.append(values, values[0])
        for x, y in drawn[picture]:
            if len(x) == len(phi) and np.allclose(x, phi):
                scale = 10.0 ** round(math.log10(np.max(np.abs(y)) / np.max(np.abs(wanted)) or 1.0))
                if np.allclose(y, scale * wanted, rtol=1e-12, atol=1e-12 * np.max(np.abs(y))):
                    return True
        return False

    crank = scene.mechanism.groups[0]
    end = crank.pins()[crank.link_names()[0]][1]
    assert found("points", data["points"][end]["x"])
    assert found("points", data["points"][end]["ddy"])
    assert found("inertia", data["reduced"]["inertia"])
    assert found("inertia", data["reduced"]["inertia_slope"])
    assert found("torque", data["reduced"]["torque"])
    assert found("drive", data["forces_constant_speed"]["drive_torque"])
    assert found("shaking", data["forces"]["shaking"]["moment"])
    for joint, link, _ in joints(data):
        for forces in (data["forces"], data["forces_constant_speed"]):
            side = forces["reactions"][joint][link]
            assert found("reactions", np.hypot(side["fx"], side["fy"]))


@pytest.mark.parametrize("name", SCENES)
def test_extremes_of_the_speed_are_marked(name):
    scene, data = analysed(name)
    motion = data["motion"]
    figure = viz.speed_figure(data, scene)
    marks = [np.asarray(line.get_xydata())[0] for line in figure.axes[0].get_lines() if line.get_marker() in ("o", "s")]
    wanted = [(math.degrees(motion[f"angle_of_{w}"]), motion[f"{w}_speed"] * 30 / math.pi) for w in ("max", "min")]
    assert np.allclose(marks, wanted, rtol=1e-12)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert f"δ = {number(motion['delta'])}" in texts


def test_every_joint_is_shown_once():
    _, data = analysed("hay-press")
    assert sorted(joint for joint, _, _ in joints(data)) == ["A", "B", "D", "E", "F", "G", "slider.guide"]


def test_one_motion_alone():
    scene, data = analysed("four-bar")
    assert [case.name for case in cases(data)] == ["actual motion", "constant speed"]
    constant = {**data, "model": {**data["model"], "constant_speed": True}}
    assert [case.name for case in cases(constant)] == ["constant speed"]
    true = {key: part for key, part in data.items() if key != "forces_constant_speed"}
    assert [case.name for case in cases(true)] == ["actual motion"]
    for document in (constant, true):
        for picture in ("drive", "shaking", "reactions", "reaction-hodographs"):
            assert curves(PICTURE[picture].draw(document, scene))


@pytest.mark.parametrize("picture", [name for name in PICTURE if name != "friction"])
def test_lost_angles_leave_a_gap(picture):
    scene, data = analysed("four-bar")
    lost = np.zeros(len(data["angles"]), int)
    lost[100:140] = 3
    figure = PICTURE[picture].draw({**data, "result": {**data["result"], "per_angle": lost}}, scene)
    figure.canvas.draw()
    found = [curve for curve in curves(figure) if curve.shape[1] == len(lost) + 1]
    assert any(np.all(np.isnan(curve[1, 100:140])) and np.all(np.isfinite(curve[1, :100])) for curve in found)


@pytest.mark.parametrize("picture", PICTURE)
def test_two_turns(picture):
    scene, data = analysed("slider-crank")
    count = len(data["angles"])

    def twice(value, climb=0.0):
        if isinstance(value, dict):
            return {key: twice(part) for key, part in value.items()}
        return np.append(value, value + climb) if np.shape(value) == (count,) else value

    double = twice(data) | {"angles": twice(data["angles"], 2 * math.pi)}
    double["links"]["crank"]["angle"] = twice(data["links"]["crank"]["angle"], 2 * math.pi)
    figure = PICTURE[picture].draw(double, dataclasses.replace(scene, cycle_turns=2))
    assert_tidy(figure)
    if picture in ("points", "speed", "reactions"):
        assert {ax.get_xlim() for ax in figure.axes} == {(0.0, 720.0)}


@pytest.mark.parametrize("picture", PICTURE)
def test_names_are_not_read_as_formulas(picture):
    scene, data = analysed("four-bar")
    loads = tuple(dataclasses.replace(load, name=f"_{load.name} $x^2$ 5 $") for load in scene.loads)
    named = {f"_{name} $x^2$ 5 $" if name != "gravity" else name: share
             for name, share in data["reduced"]["torque_by_load"].items()}  # fmt: skip
    strange = {**data, "reduced": {**data["reduced"], "torque_by_load": named}}
    figure = PICTURE[picture].draw(strange, dataclasses.replace(scene, loads=loads, title="5 $ a_b $"))
    figure.canvas.draw()


def behind(figure: Figure) -> list[np.ndarray]:
    """The curves of the machine before."""
    lines = [line for ax in figure.axes for line in ax.get_lines() if str(line.get_gid()).startswith("before-")]
    return [np.asarray(line.get_xydata(), float).T for line in lines]


@pytest.mark.parametrize("picture", [name for name in PICTURE if name not in ("machine", "friction")])
def test_the_machine_before_lies_behind(picture):
    """The same machine with everything doubled: each of its curves is drawn, in the units of those in front."""
    scene, data = analysed("slider-crank")

    def doubled(value):
        if isinstance(value, dict):
            return {key: doubled(part) for key, part in value.items()}
        return 2 * value if isinstance(value, float | np.ndarray) and np.asarray(value).dtype.kind == "f" else value

    old = doubled(data) | {"angles": data["angles"]}
    figure = PICTURE[picture].draw(data, scene, before=old)
    assert_tidy(figure)
    found = behind(figure)
    assert found
    assert "before" in " ".join(text.get_text() for text in figure.legends[0].get_texts())
    if picture in ("points", "inertia", "speed", "reactions", "shaking"):
        front = [curve[1] for curve in curves(figure) if curve.shape[1] == 361]
        assert all(any(np.allclose(curve[1], 2 * other) for other in front) for curve in found)


def test_a_machine_before_with_other_parts():
    """Points, links and joints that it lacks are omitted."""
    scene, data = analysed("hay-press")
    _, other = analysed("slider-crank")
    for picture in STANDARD[1:]:
        assert picture.name == "friction" or curves(picture.draw(data, scene, before=other))


def test_units_that_were_chosen():
    scene, data = analysed("hay-press")
    units = display_units("m, rad/s, MN, kJ")
    titles = {name: [ax.get_title(loc="left") for ax in PICTURE[name].draw(data, scene, units=units).axes]
              for name in ("points", "speed", "reactions", "torque")}  # fmt: skip
    assert titles["points"][2] == "x′, first coefficient  (m/rad)"
    assert titles["speed"][0] == "speed ω  (rad/s)"
    assert all(title.endswith("(MN)") for title in titles["reactions"])
    assert titles["torque"][1].endswith("(kJ)")
    top = PICTURE["speed"].draw(data, scene, units=units).axes[0]
    assert f"ω max {number(data['motion']['max_speed'])} rad/s" in " ".join(text.get_text() for text in top.texts)


def test_course_of_an_optimisation():
    (_, history), (_, trade) = viz.courses(OPTIMUM, {})
    assert_tidy(history)
    assert_tidy(trade)
    left, right = history.axes
    assert left.get_title(loc="left") == "peak shaking force  (kN)"
    assert np.allclose(left.lines[0].get_ydata(), [1e-3 * step["objective"] for step in OPTIMUM["history"]])
    assert right.get_yscale() == "log"
    line, crosses = trade.axes[0].lines
    assert np.allclose(line.get_xdata(), [44, 48, 52, 56, 60, 64])
    assert np.allclose(crosses.get_xydata(), [[40, 400]])
    calm = {**OPTIMUM, "history": [{"objective": None, "violation": 0.0}], "trade_off": None}
    ((_, history),) = viz.courses(calm, {})
    assert_tidy(history)


def test_no_figure_of_torques_without_any():
    """Without actual motion and loads there is nothing to draw but rounding errors."""
    scene, data = analysed("hay-press")
    model, reduced = {**data["model"], "method": "constant speed"}, data["reduced"]
    still = {**data, "model": model, "motion": {**data["motion"], "speed": None}}
    free = {name: 0.0 * np.asarray(share) for name, share in reduced["torque_by_load"].items()}
    assert _has(still, "torques", scene)
    assert not _has({**still, "reduced": {**reduced, "torque_by_load": free}}, "torques", scene)


def test_labels_stand_beside_a_straight_hodograph():
    """Of a slider, whose hodograph is a line: across it, not on it; along a circle they point outwards."""
    angles = np.linspace(0, 360, 37)
    cosine, sine = np.cos(np.radians(angles)), np.sin(np.radians(angles))
    line, circle = Figure().subplots(1, 2)
    hodograph(line, angles, np.stack([cosine + 0.3 * cosine**2, 0 * cosine]), {"color": "k"})
    hodograph(circle, angles, np.stack([cosine, sine]), {"color": "k"})
    beside = [np.asarray(text.get_position()) for text in line.texts]
    assert len(beside) >= 3 and all(x == 0 and y > 8 for x, y in beside)
    outwards = [np.asarray(text.get_position()) @ np.asarray(text.xy) for text in circle.texts]
    assert len(outwards) == 4 and all(8 < out < 9 for out in outwards)


def test_a_mass_centre_at_a_pin_has_the_curves_of_the_pin():
    """One elsewhere has its own, also where it moves alike, as that of a piston beside its pin."""
    aside = lj.load("slider-crank")
    light = lj.Scene(lj.slider_crank(0.04, 0.16, links={"slider": lj.Link(mass=3.0)}))
    names = {}
    for case, scene in (("aside", aside), ("light", light)):
        data = positions(scene)
        names[case] = moving(data, scene)
        assert _has(data, PICTURE["mass-centres"].needs, scene) == bool(names[case].centres)
    assert names["aside"] == ({"C": "C", "P": "P"}, {"S1": "S1", "S2": "S2", "S3": "S3"})
    assert names["light"] == ({"B": "B, S2", "D": "D, S3"}, {})


def test_the_limits_of_the_transmission_angle_have_a_legend():
    scene, data = analysed("hay-press")
    texts = [text.get_text() for text in written(PICTURE["links"].draw(data, scene))]
    assert "recommended limits of μ" in texts
