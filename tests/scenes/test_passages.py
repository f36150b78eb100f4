"""Windows that are given by what happens, in scene files: what is read, written, shown, and what bad input gets."""

import dataclasses
import math

import numpy as np
import pytest

import linkjax as lj
from linkjax.analysis import document
from linkjax.design import changed, numbers
from linkjax.report import write_report
from linkjax.scenes import SceneError, load, loads_text, text_of
from linkjax.viz import machine_view
from linkjax.viz._style import spans
from tests.test_cli import run

PRESS = """
title = "Punch press"
speed = "60 rpm"
[fixed]
A = [0, 0]
[links.crank]
length = "60 mm"
mass = "5 kg"
inertia = "0.05 kg m^2"
[links.rod]
length = "300 mm"
[links.ram]
mass = "40 kg"
[flywheel]
inertia = "20 kg m^2"
[[groups]]
kind = "crank"
link = "crank"
pivot = "A"
end = "B"
[[groups]]
kind = "RRP"
link = "rod"
from = "B"
end = "D"
block = "ram"
guide = { through = "A" }
side = "+"
[[loads]]
name = "punch"
link = "ram"
point = "D"
force = "50 kN"
opposing = true
window = """
LAST = '{ point = "D", last = "8 mm", going = "-" }'


def passage(window: str) -> lj.Passage:
    """The window of the punch."""
    found = loads_text(PRESS + window).loads[0].window
    assert isinstance(found, lj.Passage)
    return found


def test_windows_are_read_in_si_units():
    found = passage(LAST)
    assert (found.point, found.link, found.going) == ("D", "", "-")
    assert found.last is not None and float(found.last) == 0.008
    assert found.first is None and found.between is None and found.direction is None
    two = passage('{ point = "B", between = ["-1 cm", "50 mm"], direction = "y" }').between
    assert two is not None and [float(value) for value in two] == [-0.01, 0.05]
    for text, angle in (("x", 0.0), ("y", math.pi / 2), ("30 deg", math.pi / 6)):
        direction = passage(f'{{ point = "B", first = "1 mm", direction = "{text}" }}').direction
        assert direction is not None
        np.testing.assert_allclose(direction, angle, rtol=1e-15)
    swing = passage('{ link = "rod", between = ["-5 deg", "5 deg"], going = "ccw" }')
    assert swing.link == "rod" and swing.going == "ccw"
    np.testing.assert_allclose(np.array(swing.between), np.radians([-5, 5]), rtol=1e-15)


@pytest.mark.parametrize("window", [
    LAST,
    '{ point = "D", first = "1 in" }',
    '{ point = "B", between = ["-1 cm", "1 cm"], going = "+", direction = "17 deg" }',
    '{ link = "rod", between = ["-0.7 deg", "5 deg"], going = "cw" }',
    '{ link = "rod", last = "0.1 rad" }',
    '{ point = "D", going = "+" }',
    '{ link = "rod", going = "cw" }',
])  # fmt: skip
def test_what_is_written_is_read_again_to_the_last_bit(window):
    scene = loads_text(PRESS + window)
    again = loads_text(text_of(scene))
    assert text_of(again) == text_of(scene)
    for key in dataclasses.fields(lj.Passage):
        assert np.all(np.array(getattr(again.loads[0].window, key.name)) == getattr(scene.loads[0].window, key.name))


def test_a_window_of_several_ranges_is_not_written():
    with pytest.raises(lj.StructureError, match="several ranges of crank angle"):
        text_of(lj.motion.at_crank_angles(loads_text(PRESS + LAST)))


def test_its_numbers_are_scene_parameters(tmp_path):
    scene = loads_text(PRESS + LAST)
    found = numbers(scene)
    assert found["loads.punch.window.last"].unit == "m" and found["loads.punch.window.last"].least == 0
    last = found["loads.punch.window.last"]
    assert float(last.read(changed(scene, {last.name: 0.01}))) == 0.01
    other = numbers(loads_text(PRESS + '{ point = "B", between = ["0 mm", "9 mm"], direction = "y" }'))
    names = [f"loads.punch.window.{key}" for key in ("between[0]", "between[1]", "direction")]
    assert [other[name].unit for name in names] == ["m", "m", "rad"]
    file = tmp_path / "press.toml"
    file.write_text(PRESS + LAST, encoding="utf-8")
    again = load(file, {"loads.punch.window.last": "9 mm"})
    assert float(last.read(again)) == 0.009


# fmt: off
BAD = {  # window, key, part of the problem, part of the remedy
    "unknown point": ('{ point = "Q", last = "8 mm" }', ".point", "point 'Q' is not defined", "known here: A, B, D"),
    "fixed point": ('{ point = "A", last = "8 mm" }', ".point", "point 'A' never moves", "name another point"),
    "no direction": ('{ point = "B", last = "8 mm" }', ".point", "is on no slider", 'direction = "x", "y" or an angle'),
    "unknown link": ('{ link = "rad", last = "8 deg" }', ".link", "link 'rad' is not defined", "did you mean 'rod'?"),
    "a link that never turns": ('{ link = "ram", last = "8 deg" }', ".link", "link 'ram' never turns",
        "name a point of this link"),
    "nothing": ('{ point = "D", last = "0 mm" }', ".last", "must be greater than zero", "write a length above zero"),
    "negative": ('{ point = "D", first = "-8 mm" }', ".first", "must not be negative", "`going` gives its sense"),
    "reversed": ('{ point = "D", between = ["50 mm", "10 mm"] }', "", "does not increase", "the lower value first"),
    "reversed angles": ('{ link = "rod", between = ["350 deg", "10 deg"] }', "", "does not increase", "add 360 deg"),
    "a whole turn": ('{ link = "rod", between = ["0 deg", "360 deg"] }', "", "a whole turn or more", "omit `window`"),
    "the sense of a link": ('{ point = "D", last = "8 mm", going = "ccw" }', ".going", "not one of the choices",
        'write "+" or "-"'),
    "the sense of a point": ('{ link = "rod", last = "8 deg", going = "+" }', ".going", "not one of the choices",
        'write "ccw" or "cw"'),
    "two parts": ('{ point = "D", last = "8 mm", between = ["1 mm", "2 mm"] }', "", "has last and between",
        "write one of first, last and between"),
    "no part": ('{ point = "D" }', "", "says nothing about its way", 'going = "+" or "-" alone for its whole way'),
    "no point": ('{ last = "8 mm" }', ".point", "missing", 'add point = "D"'),
    "point and link": ('{ point = "D", link = "rod", last = "8 mm" }', "", "names both a point and a link",
        "name one point or one link"),
    "a length for an angle": ('{ link = "rod", last = "8 mm" }', ".last", "a length where an angle is needed", "deg"),
    "an angle for a length": ('{ point = "D", last = "8 deg" }', ".last", "an angle where a length is needed", "mm"),
    "misspelt": ('{ point = "D", lst = "8 mm" }', ".lst", "not a known key", "did you mean 'last'?"),
    "one value": ('{ point = "D", between = ["8 mm"] }', ".between", "a list of 1", "write [first, second]"),
}
# fmt: on


@pytest.mark.parametrize("name", BAD)
def test_bad_windows(name):
    window, key, problem, remedy = BAD[name]
    with pytest.raises(SceneError) as error:
        loads_text(PRESS + window)
    assert error.value.key == f"loads[0].window{key}"
    assert problem in error.value.problem and remedy in error.value.remedy


@pytest.mark.parametrize(("keys", "says"), [
    ({"point": "D", "last": 0.0}, "last of the window of 'D' must be greater than zero"),
    ({"point": "D", "last": math.nan}, "last of the window of 'D' is not finite"),
    ({"point": "D", "last": 0.1, "going": "up"}, 'going is \'up\', but .* the point \'D\'; write "\\+" or "-"'),
    ({"last": 0.1}, "neither a point nor a link"),
    ({"point": "D", "between": (0.1,)}, r"write two values, \(low, high\)"),
    ({"link": "rod", "between": (0.0, 7.0)}, "a whole turn or more"),
    ({"link": "rod", "last": 0.1, "direction": 0.3}, "direction is given for the link 'rod'"),
])  # fmt: skip
def test_bad_windows_in_python(keys, says):
    with pytest.raises(ValueError, match=says):
        lj.Passage(**keys)


def test_unknown_elements_in_python():
    scene = loads_text(PRESS + LAST)
    with pytest.raises(lj.StructureError, match=r"loads\[0\].window \(punch\): point 'Q' is not defined"):
        other = dataclasses.replace(scene.loads[0], window=lj.Passage(point="Q", last=0.1))
        dataclasses.replace(scene, loads=(other,))


@pytest.fixture(scope="module")
def analysed():
    scene = loads_text(PRESS + LAST)
    return scene, document(lj.analyse(scene, angles=72))


def test_figures_and_report_show_when_the_load_acts(analysed, tmp_path):
    scene, data = analysed
    [(name, [(on, off)])] = spans(data, scene)
    assert name == "punch"
    np.testing.assert_allclose([on, off], np.degrees(data["windows"]["punch"][0]))
    np.testing.assert_allclose([on, off], [146.7785, 180.0], atol=1e-4)
    view = machine_view(data, scene)
    np.testing.assert_allclose(view["machines"][0]["loads"][0]["windows"], data["windows"]["punch"])
    write_report(data, scene, tmp_path / "press.html", figures=())
    text = (tmp_path / "press.html").read_text(encoding="utf-8")
    assert "last 8 mm of D, going -: 146.779° to 180.000°" in text


def test_the_command_line_shows_when_the_load_acts(tmp_path, monkeypatch, capsys):
    file = tmp_path / "press.toml"
    file.write_text(PRESS + LAST, encoding="utf-8")
    code, shown, _ = run(monkeypatch, capsys, "show", file)
    assert code == 0
    assert "punch: 50 kN against the motion, on ram D, last 8 mm of D, going -" in shown
    code, found, _ = run(monkeypatch, capsys, "analyse", file, "--constant-speed")
    assert code == 0
    assert "load punch acts" in found and "146.779° to 180.000°" in found
