"""Where a drawing and its numbers disagree, or say too little: the key that is named, and the remedy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from linkjax.scenes import SceneError, loads_text
from tests.physics import oracle

HEAD = 'speed = "60 rpm"\n'
BARS = (
    HEAD
    + """
[fixed]
A = [0, 0]
D = ["400 mm", 0]
[links.crank]
pins = ["A", "B"]
[links.coupler]
pins = ["B", "C"]
[links.rocker]
pins = ["D", "C"]
[drive]
link = "crank"
[sketch]
B = ["60 mm", "80 mm"]
C = ["350 mm", "250 mm"]
"""
)
RAM = (
    HEAD
    + """
[fixed]
A = [0, 0]
[links.crank]
pins = ["A", "B"]
[links.rod]
pins = ["B", "C"]
[links.ram]
pins = ["C"]
[[slots]]
block = "ram"
guide = { through = "A" }
[drive]
link = "crank"
[sketch]
B = ["60 mm", "80 mm"]
C = ["350 mm", 0]
"""
)
PLATE = BARS.replace('"B", "C"]', '"B", "C", "P"]\nsides = { B-C = "340 mm", B-P = "200 mm", C-P = "250 mm" }', 1)
PLATE += 'P = ["120 mm", "270 mm"]\n'
WHEELS = (
    BARS.replace(
        "[drive]",
        '[links.wheel]\npins = ["A", "Q"]\n[[gears]]\nlink = "wheel"\nto = "rocker"\nteeth = [20, 40]\n[drive]',
    )
    .replace("A = [0, 0]", 'A = [0, 0]\nE = ["500 mm", 0]')
    .replace('pins = ["A", "Q"]', 'pins = ["E", "Q"]')
)
WHEELS += 'Q = ["520 mm", 0]\n'
RACK = RAM.replace(
    "[drive]",
    '[links.wheel]\npins = ["E", "Q"]\n'
    '[[racks]]\nlink = "ram"\nto = "wheel"\nradius = "50 mm"\nside = "right"\n[drive]',
).replace("A = [0, 0]", 'A = [0, 0]\nE = ["300 mm", "-50 mm"]')
RACK += 'Q = ["300 mm", "-20 mm"]\n'


def edit(text: str, *pairs: str) -> str:
    """A text with others in it replaced, two by two, where they stand first."""
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


DRIVE = '[drive]\nlink = "crank"'
SLIDE = '[drive]\nlink = "ram"\nstroke = { start = "250 mm", stop = "200 mm" }'
# fmt: off
CASES = {  # text, key, part of the problem, remedy
    "a block beside its guide": (edit(RAM, 'C = ["350 mm", 0]', 'C = ["350 mm", "30 mm"]'), "slots[0]",
        "'C' is drawn 0.03 m to the left of the path", 'write offset = "0.03 m", correct `along` of the guide'),
    "a phase that disagrees": (edit(BARS, DRIVE, DRIVE + '\nphase = "30 deg"'), "drive.phase",
        "is 30 deg, but 'crank' is drawn at 53.13010235 deg", "delete it for the angle drawn, or correct the sketch"),
    "a law that disagrees": (
        edit(BARS, DRIVE, DRIVE + '\nlaw = { start = "90 deg", stop = "120 deg" }'), "drive.law",
        "starts at 90 deg, but 'crank' is drawn at 53.13010235 deg", 'write start = "53.13010235 deg"'),
    "a stroke that disagrees": (edit(RAM, DRIVE, SLIDE), "drive.stroke",
        "starts at 0.25 m, but 'ram' is drawn at 0.35 m", 'write start = "0.35 m", or correct the sketch'),
    "a stroke that goes nowhere": (
        edit(RAM, DRIVE, '[drive]\nlink = "ram"\nstroke = { stop = "350 mm" }'), "drive.stroke",
        "stops where it starts: 'ram' is drawn at 0.35 m", "write another stop"),
    "a stroke from nowhere": (
        edit(RAM, DRIVE, '[drive]\nlink = "ram"\nstroke = { stop = "300 mm" }', 'C = ["350 mm", 0]\n', ""),
        "drive.stroke", "has no start, and the sketch does not show the displacement of 'ram' relative to 'frame'",
        "write start, or sketch this link"),
    "a law from nowhere": (
        edit(BARS, DRIVE, DRIVE + '\nlaw = { stop = "120 deg" }', 'B = ["60 mm", "80 mm"]\n', ""), "drive.law",
        "has no start, and the sketch does not show the angle of 'crank'", "write start, or sketch this link"),
    "sides that are no triangle": (edit(PLATE, "200 mm", "20 mm"), "links.coupler.sides", "form no triangle",
        "correct one of them"),
    "sides given twice": (edit(PLATE, "{ B-C", '{ C-B = "340 mm", B-C'), "links.coupler.sides", "is given twice",
        "delete one of them"),
    "sides whose pin is drawn on neither side": (
        edit(PLATE, '"120 mm", "270 mm"', '"180 mm", "151 mm"'), "links.coupler.sides",
        "puts 'P' 0.1458 m beside the line from 'B' to 'C', but it is sketched on this line",
        "sketch 'P' on the intended side"),
    "a pin between its two places": (
        edit(BARS, 'pins = ["B", "C"]', 'pins = ["B", "C"]\nlength = "300 mm"', 'pins = ["D", "C"]',
             'pins = ["D", "C"]\nlength = "250 mm"', '"350 mm", "250 mm"', '"270 mm", "31 mm"'),
        "sketch.C", "is midway between the two positions that the lengths allow for 'C'",
        "sketch it nearer to the intended position"),
    "a slider between its two places": (
        edit(RAM, 'pins = ["B", "C"]', 'pins = ["B", "C"]\nlength = "300 mm"', '"350 mm", 0', '"60 mm", 0'),
        "sketch.C", "the two positions that the lengths allow for 'C', (0.3491, 0) m and (-0.2291, 0) m",
        "sketch it nearer to the intended position"),
    "a wheel that disagrees": (edit(WHEELS, "teeth = [20, 40]", 'teeth = [20, 40]\nphase = "77 deg"'), "gears[0].phase",
        "with this phase 'wheel' is at -125.6198649 deg at crank angle zero, but is drawn at 0 deg",
        'write phase = "-157.3801351 deg", delete it for the one drawn, or correct the sketch'),
    "a rack that disagrees": (edit(RACK, 'radius = "50 mm"', 'radius = "50 mm"\nstart = "1 m"'), "racks[0].start",
        "with this start 'wheel' is at 744.8451337 deg at crank angle zero, but is drawn at 90 deg",
        'write start = "0.4285398163 m", delete it for the start drawn, or correct the sketch'),
    "a rack on the other side": (edit(RACK, 'side = "right"', 'side = "left"'), "racks[0].side",
        "with this side 'wheel' is on the left of the guide, but it is drawn on the right",
        "delete it for the side drawn, or correct the sketch"),
    "a block with a length the other way": (
        edit(RAM, 'pins = ["C"]', 'pins = ["C", "W"]\nlength = "40 mm"') + 'W = ["310 mm", 0]\n', "links.ram.length",
        "puts 'W' 0.04 m along and 0 m across its guide from 'C', but it is drawn -0.04 m along",
        "a block has the axes of its guide: correct the value, or omit it"),
    "a block with a point on the other side": (
        edit(RAM, 'pins = ["C"]', 'pins = ["C", "W"]\npoints.W = { along = "40 mm", across = "-30 mm" }')
        + 'W = ["390 mm", "30 mm"]\n', "links.ram.points.W", "but it is drawn 0.04 m along and 0.03 m across",
        "a block has the axes of its guide: correct the value, or omit it"),
    "a point of the frame in two places": (BARS + 'D = ["410 mm", 0]\n', "sketch.D",
        "is 0.01 m from its place in [fixed], (0.4, 0) m", "delete it, or correct one of the two"),
    "a sketch whose unit is forgotten": (
        edit(BARS, 'B = ["60 mm", "80 mm"]', "B = [60, 80]", 'C = ["350 mm", "250 mm"]', "C = [350, 250]"), "sketch",
        "has plain numbers, which are metres, and is 350 m large beside 0.4 m", "write it in the unit of the other"),
    "sides of a link of two pins": (
        edit(BARS, 'pins = ["A", "B"]', 'pins = ["A", "B"]\nsides = { A-B = "100 mm" }'), "links.crank.sides",
        "the link has 2 pins", "give its length instead"),
}
# fmt: on


@pytest.mark.parametrize("case", CASES)
def test_the_key_and_the_remedy_are_named(case):
    text, key, problem, remedy = CASES[case]
    with pytest.raises(SceneError) as caught:
        loads_text(text)
    error = caught.value
    assert error.key == key
    assert problem in error.problem
    assert remedy in error.remedy


@pytest.mark.parametrize("text", [BARS, RAM, PLATE, WHEELS, RACK], ids=["bars", "ram", "plate", "wheels", "rack"])
def test_without_the_mistake_it_is_a_machine(text):
    assert loads_text(text).mechanism.groups


def test_a_rack_is_on_the_side_where_its_wheel_is_drawn():
    """It moves as the rim does where both touch: the wheel below, turned on from 90 to 120 degrees, carries it back."""
    for text in (RACK, edit(RACK, 'side = "right"\n', "")):
        text = edit(text, '[drive]\nlink = "crank"', '[drive]\nlink = "wheel"\nlaw = { stop = "120 deg" }')
        text = edit(text, '[links.crank]\npins = ["A", "B"]\n', "", '[links.rod]\npins = ["B", "C"]\n', "",
                    'B = ["60 mm", "80 mm"]\n', "")  # fmt: skip
        ram = oracle.assemble(loads_text(text).mechanism, np.asarray(math.pi))[0]["C"]
        assert complex(ram) == pytest.approx(0.35 - 0.05 * math.pi / 6, abs=1e-12)


def test_the_gear_that_is_wrong_is_named_and_not_one_that_it_drives():
    """Gears may stand in any order."""
    text = edit(
        WHEELS, "[[gears]]", '[links.last]\npins = ["F", "R"]\n'
        '[[gears]]\nlink = "last"\nto = "wheel"\nteeth = [20, 20]\n[[gears]]',
        "teeth = [20, 40]", 'teeth = [20, 40]\nphase = "77 deg"', 'E = [', 'F = ["600 mm", 0]\nE = [',
    )  # fmt: skip
    with pytest.raises(SceneError) as caught:
        loads_text(text + 'R = ["620 mm", 0]\n')
    assert caught.value.key == "gears[1].phase"
