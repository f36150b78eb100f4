"""Features of other programs that linkjax does not have: the message says so, or names the right key."""

import re
import typing

import pytest

from linkjax import cli
from linkjax.scenes import SceneError, load, loads_text
from linkjax.scenes._absent import ABSENT, MEANT
from linkjax.scenes._groups import Group
from linkjax.scenes._joints import Drive, Slot
from linkjax.scenes._keys import fields
from linkjax.scenes._loads import Load
from linkjax.scenes._models import Link, SceneFile
from linkjax.scenes._motors import Motor
from tests.helpers import PACKAGE

PRESS = (PACKAGE / "scenes/builtin/hay-press.toml").read_text(encoding="utf-8")
SHAFT = """title = "Press with an induction motor's torque-speed line (Shigley 16: T = a + b omega)"
speed = "1150 rpm"
[fixed]
A = [0, 0]
[links.shaft]
pins = ["A", "B"]
length = "100 mm"
[flywheel]
inertia = "12.5 kg m^2"
[drive]
link = "shaft"
[sketch]
B = ["100 mm", 0]
[[loads]]
name = "punch"
link = "shaft"
torque = "1000 N m"
opposing = true
window = ["0 deg", "60 deg"]
"""
MOTOR = SHAFT.replace(
    '[drive]\nlink = "shaft"\n',
    '[drive]\nlink = "shaft"\ntorque = { at = ["1200 rpm", "1120 rpm"], values = ["0 N m", "176 N m"] }\n',
)
YOKE = """title = "Spring on a Scotch yoke: preload 24.91 N, 2084 N/m, crank 20 mm (13strings/ME204)"
speed = "60 rpm"
[fixed]
O = [0, 0]
[links.crank]
length = "20 mm"
[links.yoke]
mass = "0.1 kg"
[links.die]
[flywheel]
inertia = "0.1 kg m^2"
[[groups]]
kind = "crank"
link = "crank"
pivot = "O"
end = "C"
[[groups]]
kind = "RPP"
link = "yoke"
end = "P"
guide = { through = "O" }
block = "die"
from = "C"
"""
SPRING = """[[springs]]
name = "return"
link = "yoke"
point = "P"
to = "O"
stiffness = "2084 N/m"
preload = "24.91 N"
"""
LOAD = '[[loads]]\nname = "return"\nlink = "yoke"\npoint = "P"\n'
FIVE_BAR = """speed = "60 rpm"
[fixed]
A = [0, 0]
E = ["300 mm", 0]
[links.left]
pins = ["A", "B"]
length = "100 mm"
[links.coupler1]
pins = ["B", "C"]
length = "250 mm"
[links.coupler2]
pins = ["C", "D"]
length = "250 mm"
[links.right]
pins = ["E", "D"]
length = "100 mm"
[sketch]
B = [0, "100 mm"]
C = ["150 mm", "300 mm"]
D = ["300 mm", "100 mm"]
[drive]
link = "left"
"""


def add(text: str, after: str, more: str) -> str:
    """A scene file with a line added after the first such line."""
    assert f"{after}\n" in text
    return text.replace(f"{after}\n", f"{after}\n{more}\n", 1)


A_SPRING, NO_TABLE = '[[loads]] with kind = "spring"', '[[loads]] with kind = "table"'
ONE = "linkjax has one drive"
TABLE_OF = 'force = { at = ["0 deg", "90 deg"], values = ["0 N", "30 kN"] }'
# fmt: off
CASES = {  # file, key, parts of the message
    "a motor's torque-speed line": (MOTOR, "drive.torque", "[motor], with `kind`", "constant torque that balances"),
    "the power of the drive": (add(SHAFT, 'link = "shaft"', 'power = "5 kW"'), "drive.power", "[motor]", "`speed`"),
    "a motor of the drive": (add(SHAFT, 'link = "shaft"', 'motor = "dc"'), "drive.motor", "[motor]", "`ratio`"),
    "springs": (YOKE + SPRING, "springs", A_SPRING, "a spring is a load"),
    "dampers": (YOKE + '[[dampers]]\nlink = "yoke"\n', "dampers", '[[loads]] with kind = "damper"', "a load"),
    "a torsion spring of a link": (
        add(PRESS, 'mass = "15 kg"', 'stiffness = "2 N m/rad"'), "links.rod.stiffness", A_SPRING, "torsion_spring"),
    "drag": (YOKE + '[drag]\nlink = "yoke"\n', "drag", 'kind = "drag"', "drag_torque"),
    "several springs in one": (
        YOKE + LOAD + 'kind = "springs"\nto = "O"\n', "loads[0].kind", A_SPRING, "not a known kind of load"),
    "an unknown kind of load": (
        YOKE + LOAD + 'kind = "magnet"\n', "loads[0].kind", 'write "force" or "spring"', "not a known kind of load"),
    "a kind that is a number": (YOKE + LOAD + "kind = 1\n", "loads[0].kind", "an integer where a string", ""),
    "a load with a stiffness": (
        YOKE + LOAD + 'stiffness = "2 N/mm"\n', "loads[0].stiffness",
        'only a load of the kind "spring" or "torsion_spring" has this key', 'write kind = "spring"'),
    "a load with another end": (YOKE + LOAD + 'to = "O"\n', "loads[0].to", 'write kind = "spring"', '"damper"'),
    "a spring constant": (
        YOKE + LOAD + 'kind = "spring"\nto = "O"\nk = "2 N/mm"\n', "loads[0].k", "did you mean 'stiffness'?",
        'Write e.g. stiffness = "2 kN/m"'),
    "a type": (YOKE + LOAD + 'type = "spring"\n', "loads[0].type", "did you mean 'kind'?", ""),
    "the pressure of a load": (add(PRESS, 'name = "hay"', 'pressure = "6 bar"'),
        "loads[0].pressure", '[[loads]] with kind = "gas"', "`bore`"),
    "an indicator diagram": (PRESS + '[gas]\nbore = "80 mm"\n', "gas", '[[loads]] with kind = "gas"', ""),
    "a table of forces": (PRESS.replace('force = "30 kN"', TABLE_OF), "loads[0].force", NO_TABLE,
        "a table where a force is needed"),
    "a table of torques": (SHAFT.replace('torque = "1000 N m"', "torque = { at = [0], values = [1] }"),
        "loads[0].torque", NO_TABLE, "a table where a torque is needed"),
    "a list of torques": (SHAFT.replace('torque = "1000 N m"', "torque = [0, 10, 20]"), "loads[0].torque", NO_TABLE,
        "a list where a torque is needed"),
    "two drives": (SHAFT.replace("[drive]", "[[drive]]"), "drive", "a list where a table is needed", ONE),
    "a list of drives": ('drives = ["left", "right"]\n' + FIVE_BAR, "drives", ONE, "one degree of freedom"),
    "two links driven": (FIVE_BAR.replace('link = "left"', 'link = ["left", "right"]'), "drive.link", ONE, ""),
    "motors": (SHAFT + '[[motors]]\nlink = "shaft"\n', "motors", ONE, ""),
    "two cranks": (PRESS + '[[groups]]\nkind = "crank"\nlink = "c"\npivot = "F"\nend = "H"\n[links.c]\nlength = 1\n',
        "groups[3].kind", ONE, "gears"),
    "friction of a group": (add(PRESS, 'kind = "RRR"', "friction = 0.1"), "groups[2].friction",
        "friction is [friction] for all joints", "[joints.B] for one"),
    "friction of a link": (add(PRESS, 'mass = "15 kg"', "mu = 0.1"), "links.rod.mu", "friction is [friction]", ""),
    "friction": ("friction = 0.1\n" + PRESS, "friction", "write [friction] with its keys below it", ""),
    "efficiency": ("efficiency = 0.9\n" + PRESS, "efficiency", "`efficiency` under [motor]", ""),
    "efficiency of a drive": (add(SHAFT, 'link = "shaft"', "efficiency = 1"), "drive.efficiency", "under [motor]", ""),
    "an engine": (PRESS + '[engine_layout]\nkind = "V"\n', "engine_layout", "no engine layouts yet", ""),
    "cams": (PRESS + '[[cams]]\nlink = "crank"\n', "cams", "there are no cams", "`law` of the drive"),
    "a cam as a group": (PRESS.replace('kind = "RRR"', 'kind = "cam"'), "groups[2].kind", "there are no cams", "`law`"),
    "contact": (PRESS + "[contact]\nk = 1\n", "contact", "no contact and no clearance", ""),
    "joints": (PRESS + '[[joints]]\nname = "A"\n', "joints", "name in their `pins`", "[[slots]]"),
    "ground": (PRESS.replace("[fixed]", "[ground]"), "ground", "did you mean 'fixed'?", ""),
    "bars": (PRESS.replace("[links.crank]", "[bars.crank]"), "bars", "did you mean 'links'?", ""),
    "omega": (PRESS.replace('speed = "700', 'omega = "700'), "omega", "did you mean 'speed'?", ""),
    "rpm": (PRESS.replace('speed = "700 rpm"', "rpm = 700"), "rpm",
        "did you mean 'speed'?", 'speed = "700 rpm"'),
    "rpm of the drive": (add(SHAFT, 'link = "shaft"', "rpm = 700"), "drive.rpm",
        "write speed at the top of the file", ""),
    "forces": (PRESS.replace("[[loads]]", "[[forces]]"), "forces", "did you mean 'loads'?", ""),
    "a moment": (SHAFT.replace('torque = "1000', 'moment = "1000'), "loads[0].moment", "did you mean 'torque'?", ""),
    "sliders": (PRESS + '[[sliders]]\nname = "D"\n', "sliders", "a slider is a link without length", "[[slots]]"),
    "a belt": (SHAFT + "[[belts]]\nradii = [1, 2]\n", "belts", "did you mean 'gears'?", ""),
    "cog": (PRESS.replace('centre = 0', 'cog = 0', 1), "links.crank.cog", "did you mean 'centre'?", ""),
    "thickness": (add(PRESS, 'mass = "15 kg"', 'thickness = "5 mm"'), "links.rod.thickness",
        "mass and inertia", "density"),
    "actuators": (SHAFT + "[[actuators]]\nk = 1\n", "actuators", ONE, ""),
}
# fmt: on


@pytest.mark.parametrize("name", CASES)
def test_what_is_not_there_is_said(name):
    text, key, *parts = CASES[name]
    with pytest.raises(SceneError) as caught:
        loads_text(text, "bad.toml")
    message = str(caught.value)
    assert caught.value.key == key
    assert all(part in message for part in parts), message
    assert "\n" not in message and len(message) < 500


def test_a_five_bar_with_two_motors():
    """Two driven cranks are two degrees of freedom, by 3·4 - 2·5 = 2: one drive is too few, and only one exists."""
    with pytest.raises(SceneError) as caught:
        loads_text(FIVE_BAR)
    message = str(caught.value)
    assert "2 degrees of freedom" in message and "linkjax drives one joint only and has no second drive" in message
    assert "couple 'left' and 'right' by gears ([[gears]]), or add a binary link (-1 degree of freedom)" in message
    coupled = FIVE_BAR + '[[gears]]\nlink = "right"\nto = "left"\nteeth = [20, 20]\n'
    assert loads_text(coupled).mechanism.driving_link == "left"


def test_the_same_by_set():
    for key, part in (("springs", A_SPRING), ("groups[2].friction", "[friction]"), ("omega", "did you mean 'speed'?")):
        with pytest.raises(SceneError, match=re.escape(part)):
            load("hay-press", {key: 1})


def test_the_command_says_it_in_one_line(tmp_path, monkeypatch, capsys):
    for text, part in ((MOTOR, "[motor]"), (YOKE + SPRING, '[[loads]] with kind = "spring"')):
        (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
        monkeypatch.setattr("sys.argv", ["linkjax", "analyse", str(tmp_path / "bad.toml")])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        out, err = capsys.readouterr()
        assert stopped.value.code == 2 and not out and len(err.splitlines()) == 1 and part in err


def test_what_is_there_is_not_said_to_be_absent():
    """The list shrinks: no row names a key that the format supports in the same table."""
    groups, loads, motors = (
        {key for branch in typing.get_args(typing.get_args(union)[0]) for key in fields(typing.get_args(branch)[0])}
        for union in (Group, Load, Motor)
    )
    tables = {"": set(fields(SceneFile)), "links": set(fields(Link)), "loads": loads, "groups": groups,
              "drive": set(fields(Drive)), "slots": set(fields(Slot)), "motor": motors}  # fmt: skip
    for row in ABSENT:
        for table in tables if row.tables == "*" else row.tables.split() or [""]:
            assert not tables[table] & set(row.words.split()), (table, row.says)
    words = [word for words in MEANT.values() for word in words.split()]
    assert all(word == word.lower() for word in words)
