"""Every mistake gives one line with file, key, value and remedy."""

import pickle

import pytest

from linkjax.scenes import SceneError, load, loads_text
from tests.helpers import PACKAGE

PRESS = (PACKAGE / "scenes/builtin/hay-press.toml").read_text(encoding="utf-8")
CRANK = 'kind = "crank"\nlink = "crank"\npivot = "A"\nend = "B"'
DYAD = 'kind = "RRR"\nlinks = ["crank", "rod"]\nfrom = "A"\nto = "F"\nmeet = "B"'
SECTION = 'mass_properties = "section"\narea = "1 mm^2"\ndensity = "1 kg/m^3"'


def edit(*pairs: str) -> str:
    """The hay press with strings replaced in pairs, each at its first occurrence."""
    text = PRESS
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


LONG = "…"  # a table whose content is its key: it is not shown
# fmt: off
CASES = {  # file, key, part of the value as shown, part of the problem, part of the remedy
    "unknown key": (edit('mass = "5 kg"', 'mas = "5 kg"'), "links.crank.mas", '"5 kg"', "not a known key", "'mass'"),
    "the everyday word": (edit('mass = "5 kg"', 'weight = "5 kg"'), "links.crank.weight", '"5 kg"', "not a known key",
        "'mass'"),
    "unknown table": (edit("[links.crank]", "[link.crank]"), "link", LONG, "not a known key", "'links'"),
    "unknown key of a place": (edit("turned =", "turnd ="), "links.rod.points.E.turnd", '"30 deg"', "not a known key",
        "did you mean 'turned'?"),
    "unknown key of a guide": (edit('along = "0', 'angle = "0'), "groups[1].guide.angle", '"0 deg"', "not a known key",
        "did you mean 'along'?"),
    "key of another kind of group": (edit('end = "D"', 'end = "D"\nmeet = "X"'), "groups[1].meet", '"X"',
        "not a known key", "known here: block, branch, end, from, guide"),
    "a link with the name of a side, twice": (
        edit("[links.link4]", "[links.left]", '"link4", "rocker"', '"left", "left"'), "groups[2].links",
        '["left", "left"]', "link 'left' already belongs to a group", "use each link once",
    ),
    "missing key": (edit('speed = "700 rpm"', ""), "speed", "", "missing", 'add speed = "700 rpm"'),
    "missing key of a group": (edit('pivot = "A"', ""), "groups[0].pivot", "", "missing", 'add pivot = "A"'),
    "missing key of a load": (edit('link = "rocker"', ""), "loads[0].link", "", "missing", 'add link = "slider"'),
    "missing kind": (edit('kind = "RRP"', ""), "groups[1].kind", "", "missing", '"RPP", "gear", "rack" or "pinion"'),
    "missing table": ("speed = 1", "fixed", "", "missing", "add a table [fixed]"),
    "missing links": ("speed = 1\n[fixed]", "links", "", "missing", "[links.crank]"),
    "missing groups": ("speed = 1\n[fixed]\n[links]", "groups", "", "missing", "add a table [[groups]]"),
    "wrong dimension": (edit('"300 mm"', '"30 kg"'), "links.crank.length", '"30 kg"', "a mass where a length is needed",
        'e.g. "300 mm"'),
    "unparsable": (edit('"300 mm"', '"three"'), "links.crank.length", '"three"', "cannot be read", 'e.g. "300 mm"'),
    "unknown unit": (edit('"300 mm"', '"300 mmm"'), "links.crank.length", '"300 mmm"', "unknown unit 'mmm'", "'mm'"),
    "negative mass": (edit('"5 kg"', '"-5 kg"'), "links.crank.mass", '"-5 kg"', "must not be negative", "zero or more"),
    "negative length": (edit('"300 mm"', "-1"), "links.crank.length", "-1", "must not be negative", "zero or more"),
    "negative inertia": (edit('"0.65 kg', '"-0.65 kg'), "links.crank.inertia", "-0.65", "negative", "zero or more"),
    "negative distance": (edit('"450 mm"', "-1"), "links.rod.points.E.at", "-1", "negative", "turn it by 180 deg"),
    "negative speed": (edit('"700', '"-700'), "speed", '"-700 rpm"', "must not be negative", 'rotation = "cw"'),
    "negative target": (edit("target_delta = 0.15", "target_delta = -0.02"), "target_delta", "-0.02", "negative",
        "write a plain number above zero, e.g. 0.15"),
    "speed zero": (edit('"700 rpm"', "0"), "speed", "0", "must be greater than zero", '"700 rpm"'),
    "gravity upwards": (edit('"9.8', '"-9.8'), "gravity", '"-9.8 m/s^2"', "must not be negative", "[gx, gy]"),
    "not a number": (edit('"5 kg"', "nan"), "links.crank.mass", "nan", "not a finite number", '"5 kg"'),
    "infinite": (edit('"5 kg"', "-inf"), "links.crank.mass", "-inf", "not a finite number", '"5 kg"'),
    "not a number in a text": (edit('"5 kg"', '"nan kg"'), "links.crank.mass", '"nan kg"', "not a finite", '"5 kg"'),
    "angle without unit": (edit('"30 deg"', "30"), "links.rod.points.E.turned", "30", "without a unit", '"30 deg"'),
    "angle without unit in a list": (edit('"335 deg"', "335"), "loads[0].window[1]", "335", "without a unit",
        "335 rad"),
    "a date": (edit('"5 kg"', "1979-05-27"), "links.crank.mass", "1979-05-27", "a date or time where", '"5 kg"'),
    "a truth value": (edit('"5 kg"', "true"), "links.crank.mass", "true", "a truth value where a mass", '"5 kg"'),
    "a list of one": (edit('["570 mm", "580 mm"]', "[1]"), "fixed.F", "[1]", "a list of 1", "[first, second]"),
    "no list": (edit("A = [0, 0]", "A = 0"), "fixed.A", "0", "an integer where a list of two", "square brackets"),
    "a text for a list": (edit('["link4", "rocker"]', '"link4"'), "groups[2].links", '"link4"', "a string where",
        "[first"),
    "a number for a text": (edit('"Hay press"', "3"), "title", "3", "where a string is needed",
        'in double quotes, e.g. "Hay'),
    "a text for true": (edit("= true", '= "true"'), "loads[0].opposing", '"true"', "a string where true",
        "without quotes"),
    "a number for a table": ("flywheel = 3\n" + PRESS, "flywheel",
        "3", "where a table is needed", "write [flywheel]"),
    "a number for points": (edit("points.E = {", "points = 3 # {"), "links.rod.points", "3", "where a table",
        "[links.rod.p"),
    "one group": ("speed = 1\nfixed = {}\nlinks = {}\ngroups = {}", "groups", "{}", "a table where a list",
        "[[groups]]"),
    "a number for a group": ("speed = 1\nfixed = {}\nlinks = {}\ngroups = [3]", "groups[0]", "3", "where a table",
        "[[groups]]"),
    "turns": ("cycle_turns = 1.5\n" + PRESS, "cycle_turns", "1.5", "not an integer from 1 to 1000",
        "number of turns in one cycle"),
    "no turns": ("cycle_turns = 0\n" + PRESS, "cycle_turns", "0", "not an integer from 1 to 1000",
        "number of turns in one cycle"),
    "wrong kind": (edit('"RRR"', '"rrr"'), "groups[2].kind", '"rrr"', "not a known kind", 'did you mean "RRR"?'),
    "unknown kind": (edit('"RRR"', '"RPRP"'), "groups[2].kind", '"RPRP"', "not a known kind",
        'write "crank" or "linear_driver" or "RRP"'),
    "kind of a number": (edit('"RRR"', "3"), "groups[2].kind", "3", "where a string is needed", 'e.g. "crank"'),
    "wrong side": (edit('"left"', '"up"'), "groups[2].side", '"up"', "not one of the choices", '"left" or "right"'),
    "wrong case": ('mean = "Time"\n' + PRESS, "mean", '"Time"', "not one of the choices", 'did you mean "time"?'),
    "bad name": (edit('"G"', '"G.1"'), "groups[2].meet", '"G.1"', "not a usable name", "begin with a letter"),
    "bad name of a key": (edit("F = [", '"F 1" = ['), 'fixed."F 1"', '["570 mm"', "not a usable name",
        "begin with a letter"),
    "point undefined": (edit('from = "E"', 'from = "Q"'), "groups[2].from", '"Q"', "point 'Q' is not defined",
        "B, D, E, F"),
    "point later": (PRESS.replace('from = "B"', 'from = "G"'), "groups[1].from", '"G"', "does not exist yet",
        "move this group after"),
    "guide on a moving point": (edit('through = "A"', 'through = "B"'), "groups[1].guide.through", '"B"',
        "not a point of", "A, F"),
    "link undefined": (edit('"rod"', '"rodd"'), "groups[1].link", '"rodd"', "link 'rodd' is not defined", "'rod'"),
    "link twice": (edit('["link4"', '["rod"'), "groups[2].links", '["rod"', "already belongs to a group",
        "each link once"),
    "link idle": (edit("[links.link4]", "[links.spare]\n[links.link4]"), "links.spare", "{}", "belongs to no group",
        "delete it"),
    "link called frame": (edit("[links.crank]", "[links.frame]"), "links.frame", LONG, "reserved for the frame",
        "another name"),
    "pin twice": (edit('meet = "G"', 'meet = "D"'), "groups[2].meet", '"D"', "'D' is already used", "its own name"),
    "pin on its own beginning": (edit('end = "D"', 'end = "B"'), "groups[1].end", '"B"', "'B' is already used",
        "its own name"),
    "point twice": (edit("points.E", "points.A"), "links.rod.points.A", "{at", "'A' is already used", "its own name"),
    "mass centre twice": (edit('meet = "G"', 'meet = "S2"'), "links.rod.centre_name", "",
        "default name of this mass centre is S2", 'centre_name = "C2"'),
    "load twice": (PRESS + '[[loads]]\nname = "hay"\nlink = "rocker"\ntorque = 1\n', "loads[1].name", '"hay"',
        "'hay' is used already", "its own name"),
    "load called gravity": (edit('"hay"', '"gravity"'), "loads[0].name", '"gravity"', "reserved for the weight",
        "another name"),
    "load on no link": (edit('link = "rocker"', 'link = "rocket"'), "loads[0].link", '"rocket"', "not defined",
        "'rocker'"),
    "load off its link": (edit('"S5"', '"E"'), "loads[0].point", '"E"', "'E' is not on link 'rocker'",
        "known here: F, G, S5"),
    "load nowhere": (edit('point = "S5"', ""), "loads[0].point", "", "missing", "where the force acts"),
    "load of nothing": (edit('force = "30 kN"', ""), "loads[0].force", "", "missing", 'torque = "60 N m"'),
    "force and torque": (edit('point = "S5"', "torque = 1"), "loads[0].torque", "1", "not both", "two [[loads]]"),
    "torque at a point": (edit('force = "30 kN"', "torque = 1"), "loads[0].point", '"S5"', "a torque has no point",
        "delete"),
    "force without direction": (edit("= true", "= false"), "loads[0].force", '"30 kN"', "has no direction",
        "opposing = true"),
    "force with two": (edit('"30 kN"', '[0, "1 N"]'), "loads[0].force", '[0, "1 N"]', "two components",
        "delete opposing"),
    "force negative": (edit('"30 kN"', "-3"), "loads[0].force", "-3", "must not be negative",
        "the motion gives the direction"),
    "torque negative": (edit('force = "30 kN"', "torque = -1", 'point = "S5"', ""), "loads[0].torque", "-1", "negative",
        "magnitude"),
    "window empty": (edit('"335 deg"', '"450 deg"'), "loads[0].window", '["90 deg", "450 deg"]',
        "start and end coincide", "omit `window` for a permanent load"),
    "window too long": (edit('"335 deg"', '"500 deg"'), "loads[0].window", '"500 deg"', "longer than the cycle of 360",
        "within one"),
    "first a dyad": (edit(CRANK, DYAD), "groups[0].kind", '"RRR"', "first group must be the driver", 'kind = "crank"'),
    "two cranks": (
        PRESS + '[[groups]]\nkind = "crank"\nlink = "spare"\npivot = "F"\nend = "H"\n[links.spare]\nlength = 1\n',
        "groups[3].kind", '"crank"', "more than one driver", "for a mobility of one"),
    "no groups": ("speed = 1\nfixed = {}\nlinks = {}\ngroups = []", "groups", "[]", "missing", "first the crank"),
    "dyad on one point": (edit('to = "F"', 'to = "E"'), "groups[2].to", '"E"', "same point as `from`",
        "second link starts"),
    "crank of no length": (edit('"300 mm"', "0"), "links.crank.length", "0", "zero, but groups[0] needs a bar",
        "distance between its pins"),
    "rod without length": (edit('length = "1020 mm"', ""), "links.rod.length", "", "missing, but groups[1] needs a bar",
        'length = "300 mm"'),
    "block with a length": (edit('mass = "40 kg"', "length = 1"), "links.slider.length", "1", "is the slider (block)",
        "one pin only"),
    "block that scales": (edit('mass = "40 kg"', 'mass_properties = "scaled"'), "links.slider.mass_properties",
        '"scaled"', "no length to which its mass", 'always "fixed"'),
    "section and mass": (edit("centre = 0", SECTION), "links.crank.mass", '"5 kg"', "given twice", "delete mass"),
    "section without area": (edit('mass = "3.2 kg"', 'mass_properties = "section"'), "links.link4.area", "", "missing",
        'area = "600 mm^2"'),
    "area without section": (edit("centre = 0", "area = 1"), "links.crank.area", "1", "has no effect", '"section"'),
    "reference without scaled": (edit("centre = 0", "reference_length = 1"), "links.crank.reference_length", "1",
        "has no effect", '"scaled"'),
    "reference zero": (edit("centre = 0", 'mass_properties = "scaled"\nreference_length = 0'),
        "links.crank.reference_length", "0", "greater than zero", "the masses belong to"),
    "quotes forgotten": (edit('"300 mm"', "300 mm"), "line 15", "length = 300 mm", "not valid TOML",
        "in double quotes"),
    "quote open": (edit('"300 mm"', '"300 mm'), "line 15", 'length = "300 mm', "not valid TOML", "close every quote"),
    "bracket open": (edit("[fixed]", "[fixed"), "line 10", "[fixed", "not valid TOML", "close every quote and bracket"),
    "key twice": (edit("centre = 0", 'mass = "1 kg"'), "line 18", 'mass = "1 kg"', "not valid TOML",
        "every key and table once"),
    "table twice": (edit("[links.rod]", "[links.crank]"), "line 20", "[links.crank]", "not valid TOML",
        "key and table once"),
    "list with single brackets": (edit("[[groups]]", "[groups]"), "line 48", "[[groups]]", "not valid TOML",
        "double brackets, e.g. [[groups]]"),
    "empty": ("", "", "", "the scene is empty", "linkjax new NAME"),
    "nothing but comments": ("# Hay press\n", "", "", "the scene is empty", "linkjax new NAME"),
    "lists without end": ("a = " + "[" * 5000, "", "", "not readable as TOML", "nested lists"),
    "number without end": ("cycle_turns = 1" + "0" * 5000, "", "", "not readable as TOML", "plain numbers"),
}
# fmt: on


@pytest.mark.parametrize("name", CASES)
def test_message(name):
    text, key, value, problem, remedy = CASES[name]
    with pytest.raises(SceneError) as caught:
        loads_text(text, "press.toml")
    error = caught.value
    assert error.source == "press.toml" and error.key == key
    assert problem in error.problem and remedy in error.remedy
    message = str(error)
    assert "\n" not in message and len(message) < 400
    assert message.startswith("press.toml: ") and message.endswith(f": {error.problem}; {error.remedy}")
    place = message.removeprefix("press.toml: ").removesuffix(f"{error.problem}; {error.remedy}")
    stands = place.removeprefix(key)
    assert place.startswith(key) and (stands == ": " if value == LONG else value in stands)
    assert (error.value is None) == (value == "")


def test_unknown_before_missing():
    """A misspelt key is also a missing one: the misspelling is reported, wherever it is."""
    with pytest.raises(SceneError, match=r"groups\[0\]\.pivt = \"A\": not a known key; did you mean 'pivot'"):
        loads_text(edit('speed = "700 rpm"', "", 'pivot = "A"', 'pivt = "A"'))


@pytest.mark.parametrize(
    ("name", "problem", "remedy"),
    [
        ("hay-pres", "no such scene file", "did you mean 'hay-press'?"),
        ("hay-press.toml", "no such scene file", "did you mean 'hay-press'?"),
        (
            "missing.toml",
            "no such scene file",
            "built-in scene: andrews-squeezer, combine-cutter, combine-shoe, elliptic-trammel, ",
        ),
        ("mine", "no such scene file", "did you mean 'mine.toml'?"),
        ("mne.toml", "no such scene file", "did you mean 'mine.toml'?"),
        ("folder", "cannot be read: a folder", "path of a .toml file"),
        ("latin.toml", "not encoded in UTF-8 (byte 10)", "save the file as UTF-8"),
        ("no\0name", "no such scene file", "path of a .toml file"),
        ("", "no such scene file", "path of a .toml file"),
        ("long" * 1000, "no such scene file", "path of a .toml file"),
    ],
)
def test_files_that_cannot_be_read(name, problem, remedy, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "mine.toml").write_text(PRESS, encoding="utf-8")
    (tmp_path / "latin.toml").write_bytes('title = "Mühle"'.encode("latin-1"))
    with pytest.raises(SceneError) as caught:
        load(name)
    assert problem in caught.value.problem and remedy in caught.value.remedy
    assert str(caught.value).startswith(name or '""') and caught.value.key == ""


def test_a_text_is_no_path():
    with pytest.raises(SceneError, match="<text>: is not a name or path; read a scene in a string with loads_text"):
        load(PRESS)


def test_the_file_is_named(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xef\xbb\xbf" + edit('"5 kg"', '"5 m"').replace("\n", "\r\n").encode())  # as some editors save
    with pytest.raises(SceneError) as caught:
        load(path)
    assert str(caught.value).startswith(f'{path}: links.crank.mass = "5 m": a length where a mass is needed; ')


def test_errors_travel_between_processes():
    with pytest.raises(SceneError) as caught:
        loads_text(edit('"5 kg"', '"5 m"'), "press.toml")
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value) and again.key == "links.crank.mass" and again.value == "5 m"


DRAWN = """speed = "60 rpm"
[fixed]
A = [0, 0]
[links.crank]
pins = ["A", "B"]
length = "100 mm"
[links.rod]
pins = ["B", "C"]
length = "300 mm"
[links.ram]
pins = ["C"]
[[slots]]
block = "ram"
guide = { through = "A" }
[drive]
link = "crank"
"""


@pytest.mark.parametrize(("old", "new", "key", "remedy"), [
    ('block = "ram"', 'block = "ram"\noffset = "5 mm"', "slots[0].offset", "write it inside of guide, guide = { of"),
    ('link = "crank"', 'link = "crank"\nstart = "0 deg"', "drive.start", "write it inside of law, law = { start = "),
    ('link = "crank"', 'link = "crank"\nspeed = "60 rpm"', "drive.speed",
        "write speed at the top of the file, above t"),
    ('block = "ram"', 'block = "ram"\nstroke = "5 mm"', "slots[0].stroke", "write it under [drive]"),
    ('link = "crank"', 'link = "crank"\nmass = "1 kg"', "drive.mass", "write it under the [links.…] table of this"),
])  # fmt: skip
def test_a_key_in_the_wrong_table(old, new, key, remedy):
    """Of a machine drawn by links and joints: the right position of the key."""
    with pytest.raises(SceneError) as caught:
        loads_text(DRAWN.replace(old, new))
    assert (caught.value.key, caught.value.problem) == (key, "not a known key")
    assert caught.value.remedy.startswith(remedy)
