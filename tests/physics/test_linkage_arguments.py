"""Wrong arguments of `linkage`: each gets a `StructureError` that names the element, the problem and the remedy.

The errors are raised in a process of its own, since the type checks of the tests would come first.
"""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from linkjax.scenes import SceneError, loads_text
from tests.scenes.test_bad_scenes import text_of

PROGRAM = """
import json, math, sys
import jax.numpy as jnp
from linkjax.groups import Drive, GearPair, Guide, RackPair, Slot, Teeth
from linkjax.mechanism import Link, StructureError, linkage
BARS = {"crank": Link(pins=("A", "B"), length=0.1), "coupler": Link(pins=("B", "C"), length=0.3),
        "rocker": Link(pins=("D", "C"), length=0.25)}
USUAL = {"fixed": {"A": (0, 0), "D": (0.38, 0)}, "links": BARS, "drive": Drive("crank"), "sketch": {"C": (0.28, 0.24)}}
PLATE = {"links": BARS | {"coupler": Link(pins=("B", "C", "P"))}, "sketch": {"C": (0.28, 0.24), "P": (0.2, 0.4)}}
RAM = {"links": BARS | {"ram": Link(pins=("E",))}, "slots": [Slot("ram", Guide("A"))],
       "sketch": {"C": (0.28, 0.24), "E": (0.3, 0.0)}}
YOKE = {"links": {"crank": BARS["crank"], "die": Link(pins=("B",)), "yoke": Link(pins=("V",))},
        "sketch": {"V": (0.1, 0.0)}}
PAIR = {"links": BARS | {"one": Link(pins=("V",)), "two": Link(pins=("V",))},
        "sketch": {"C": (0.28, 0.24), "V": (0.38, 0.0)}}
TRAMMEL = {"fixed": {"O": (0, 0)}, "drive": Drive("bar", "stone"), "slots": [Slot("shoe", Guide("O", math.pi / 2))],
           "links": {"stone": Link(pins=("X",)), "bar": Link(pins=("X", "Y", "O")), "shoe": Link(pins=("Y",))},
           "sketch": {"X": (0.15, 0.0), "Y": (0.0, 0.26)}}
for given in json.load(sys.stdin):
    try:
        linkage(**USUAL | eval(given))
        print("no error")
    except StructureError as error:
        print(error)
    except Exception as error:
        print(type(error).__name__, str(error).splitlines()[:1])
"""
CASES = {  # arguments: the beginning of the message
    '{"drive": "crank"}': "drive: must be a Drive, but is 'crank'; write e.g. Drive(",
    '{"drive": Drive(1)}': "drive: the name 1 is not a string; write names in quotes",
    '{"links": BARS | {"rocker": ("D", "C")}}': "links.rocker: must be a Link, but is ('D', 'C'); write Link(",
    '{"links": BARS | {"rocker": Link(pins=(1, "C"))}}': "links.rocker.pins: the name 1 is not a string; write names",
    '{"links": {**BARS, 2: BARS["rocker"]}}': "links: the name 2 is not a string; write names in quotes",
    '{"fixed": [("A", (0, 0))]}': "fixed: must be a dictionary, but is [('A', (0, 0))]; write e.g. {",
    '{"fixed": {"A": ("0 mm", 0)}}': "fixed.A: must be x and y, but is ('0 mm', 0); write (x, y) in metres",
    '{"sketch": [("C", (0, 1))]}': "sketch: must be a dictionary, but is [('C', (0, 1))]; write e.g. {",
    '{"slots": [("rocker", "A")]}': "slots[0]: must be a Slot, but is ('rocker', 'A'); write e.g. slots=[Slot(",
    '{"slots": None}': "slots: must be a list, but is None; write e.g. slots=[Slot(",
    '{"gears": GearPair("crank", "rocker", Teeth((20, 20)))}': "gears: must be a list, but is GearPair(",
    '{"racks": [GearPair("crank", "rocker", Teeth((20, 20)))]}': "racks[0]: must be a RackPair, but is GearPair(",
    '{"gears": [GearPair("crank", "rocker", (20, 20))]}':
        "gear of crank: its mesh must be Teeth or a Belt, but is (20, 20); write e.g. Teeth(",
    '{"flywheel": 2.5}': "flywheel: must be a Flywheel, but is 2.5; write e.g. Flywheel(",
    '{"branch": "left"}': "branch: is 'left'; write \"fixed\" or",
    '{**RAM, "racks": [RackPair("ram", "crank", jnp.ones(2))]}': "rack ram: has numbers that are traced or batched; ",
    '{**PLATE, "sides": {"coupler": [0.3, 0.2]}}': "links.coupler.sides: must be a dictionary, but is [0.3, 0.2]; ",
    '{**PLATE, "sides": {"coupler": {5: 0.3}}}': "links.coupler.sides: 5 are not two pins of the link; its pins are B",
    '{**PLATE, "sides": {"coupler": {("B", "C"): "300 mm"}}}':
        "links.coupler.sides: B-C is '300 mm'; write a distance above zero, in metres",
    '{**PLATE, "sides": {"plate": {("B", "C"): 0.3}}}': "links.plate.sides: link 'plate' is not defined; known here: ",
    '{**YOKE, "slots": [Slot("yoke", Guide("A")), Slot("die", Guide("V", 0.0, on="yoke"))]}':
        "slot of die: is parallel to the guide of 'yoke', so the position of 'yoke' is undetermined; change `along`",
    '{**PAIR, "slots": [Slot("one", Guide("A")), Slot("two", Guide("D", 1.0))]}':
        "links: one, two form no group: the two slots of a PRP must be on two links, but both are on 'frame'; ",
    "TRAMMEL": "drive: moves 'bar' relative to 'stone', but bar, shoe cannot move relative to the frame; delete these ",
}  # fmt: skip


def test_wrong_arguments_are_named():
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=json.dumps([*CASES]), capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr
    messages = run.stdout.splitlines()
    assert len(messages) == len(CASES)
    for message, says in zip(messages, CASES.values(), strict=True):
        assert message.startswith(says), message
        assert "; " in message and len(message) < 500


def test_a_drive_against_a_link_beside_the_rigid_part():
    """The trammel's bar pinned to the frame: the stone alone moves, and the drive is named at its key."""
    text = text_of("elliptic-trammel").replace('pins = ["X", "Y"]', 'pins = ["X", "Y", "O"]')
    text = text.replace('[[slots]]\nblock = "stone"\nguide = { through = "O" }\n', "")
    with pytest.raises(SceneError, match="but bar, shoe cannot move relative to the frame") as caught:
        loads_text(text)
    assert caught.value.key == "drive.link"
