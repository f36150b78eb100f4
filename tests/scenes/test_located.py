"""Errors of the layers below the reader name file, key and value; names of the first drafts say the new one."""

import re

import numpy as np
import pytest

from linkjax import cli
from linkjax._renamed import KINDS, RENAMED
from linkjax.groups import RRR
from linkjax.measures import MEASURES
from linkjax.mechanism import StructureError
from linkjax.scenes import SceneError, build_problem, load, load_rolling, loads_text, read_document
from linkjax.scenes import _build as reader
from linkjax.scenes import _build_rolling as rolling_reader
from linkjax.scenes._located import REPORT, located, part
from tests.scenes.fuzz import TEXTS

PRESS, SQUEEZER = TEXTS["hay-press"], TEXTS["andrews-squeezer"]
TABLE = {
    "links": {"rod": {"length": "1 m"}, "arm": {}},
    "drive": {"link": "rod", "on": "arm"},
    "groups": [{"kind": "crank", "link": "rod"}, {"kind": "RRR", "links": ["arm", "bar"]}],
}
ERRORS = [
    ZeroDivisionError("division by zero"), KeyError("rod"), RecursionError("too deep"), AssertionError(),
    np.linalg.LinAlgError("Singular matrix"), TypeError("a\nb " * 200), StructureError("nowhere", "is bad", "mend it"),
    StopIteration(), StructureError("slot of nothing", "is bad", "mend it"),
]  # fmt: skip


def refused(text: str) -> SceneError:
    """The error of a text, in one line that names the file."""
    with pytest.raises(SceneError) as caught:
        document = read_document(text, "bad.toml")
        build_problem(document) if "optimise" in document.table else loads_text(text, "bad.toml")
    message = str(caught.value)
    assert message.startswith("bad.toml: ") and len(message) < 500 and len(message.splitlines()) == 1
    return caught.value


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("path", [(), ("groups", 1), ("links", "rod")])
def test_whatever_is_raised_below_names_the_file(error, path):
    with pytest.raises(SceneError) as caught, located("bad.toml", TABLE), part(*path):
        raise error
    message = str(caught.value)
    assert message.startswith("bad.toml: ") and len(message) < 500 and len(message.splitlines()) == 1
    assert caught.value.__cause__ is error and (isinstance(error, StructureError) or type(error).__name__ in message)
    assert path == () or isinstance(error, StructureError) or caught.value.key.startswith(f"{path[0]}")
    assert isinstance(error, StructureError) or (str(error).split() or [""])[0].strip("'") in message


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("the group of rod: the drive moves 'rod' relative to 'arm'; name links of the group", "drive.on", "arm"),
        ("the group of arm, bar: its joints take 5; a point may be missing", "groups[1].links", ["arm", "bar"]),
        ("the slot of 'bar' is bad; mend it", "groups[1].links", ["arm", "bar"]),
        ("length of a link must not be negative; write zero or more", "", None),
        ("'nothing' is bad; mend it", "", None),
    ],
)
def test_the_names_in_a_message_lead_to_its_key(text, key, value):
    table = {**TABLE, "links": {}}
    with pytest.raises(SceneError) as caught, located("bad.toml", table):
        raise ValueError(text)
    assert (caught.value.key, caught.value.value) == (key, value)
    assert f"{caught.value.problem}; {caught.value.remedy}" == text


def test_a_drive_against_a_link_of_another_group():
    """The group of the drive, K1, K2, K3, K7, does not contain the other link."""
    text = SQUEEZER.replace('pins = ["A", "H"]', 'pins = ["A", "E"]')
    error = refused(text.replace('link = "K1"\nphase', 'link = "K2"\non = "K6"\nphase'))
    assert (error.key, error.value) in (("drive.on", "K6"), ("drive.link", "K2")) and "'K6'" in error.problem


def test_an_error_in_a_group_names_the_group(monkeypatch):
    def fails(self):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(RRR, "__check_init__", fails, raising=False)
    error = refused(PRESS)
    assert error.key == "groups[2]" and error.problem == "cannot be read: ZeroDivisionError: division by zero"
    assert error.remedy == REPORT


@pytest.mark.parametrize(("module", "name", "read"), [
    (reader, "Scene", lambda: load("hay-press")), (reader, "check_asked", lambda: build_problem(read_document(PRESS))),
    (rolling_reader, "RollingMachine", lambda: load_rolling("rolling-eccentric")),
])  # fmt: skip
def test_no_reader_lets_an_error_through(module, name, read, monkeypatch):
    def fails(*args, **kwargs):
        raise KeyError("links")

    monkeypatch.setattr(module, name, fails)
    with pytest.raises(SceneError, match=r"^(hay-press|rolling-eccentric)\.toml: |^<text>: "):
        read()


def test_a_deep_table_is_refused():
    for key in ("x", "links.rod.centre", "optimise.changes.x"):
        refused(f"{key}{'.x' * 3000} = 1\n{PRESS.replace('centre = ', 'area = ')}")
    with pytest.raises(SceneError, match=r"^hay-press\.toml: "):
        load("hay-press", {"links" + ".x" * 3000: 1})


def test_long_messages_are_cut():
    error = SceneError("a.toml", "k" * 300, "v" * 300, "p " * 300, "r " * 300)
    message = str(error)
    assert len(message) < 500 and message.endswith(" …") and "p p" in message and "r r" in message
    assert (error.problem, error.remedy) == ("p " * 300, "r " * 300)
    escaped = str(SceneError("a\n.toml", "", "b\u2028c", "d\x85e", "f\tg"))
    assert escaped == r'a\n.toml: "b\u2028c": d\x85e; f\tg'


def new_of(limit: str, **changes: str) -> str:
    """What is said of the hay press with another first limit, and other values of keys under [optimise]."""
    text = PRESS.replace('"delta <= 0.15"', f'"{limit}"')
    for key, value in changes.items():
        text = re.sub(rf"^{key} = .*\n", "", text, flags=re.MULTILINE)
        text = text.replace("[optimise]", f"[optimise]\n{key} = {value}", 1)
    return str(refused(text))


def old(new: str) -> list[str]:
    """The names of the first drafts for a new one."""
    return [name for names in (RENAMED, KINDS) for name, now in names.items() if now == new]


@pytest.mark.parametrize("kind", ["linear_driver", "redundant_link", "redundant_slider"])
def test_old_kinds(kind):
    for name in (each for each in old(kind) if each[0].isupper() == kind.startswith("redundant")):
        error = refused(PRESS.replace('kind = "RRR"', f'kind = "{name}"'))
        assert error.key == "groups[2].kind" and error.remedy == f'it is called "{kind}" now'


def test_old_keys():
    (linked,), (internal,) = old("linked"), old("internal")
    gears = TEXTS["geared-press"]
    error = refused(gears.replace("teeth = ", f"{internal} = true\nteeth = ", 1))
    assert error.key.endswith(f".{internal}") and error.remedy == "it is called 'internal' now"
    number = next(i for i, group in enumerate(read_document(gears).table["groups"]) if group["kind"] == "gear")
    with pytest.raises(SceneError, match="it is called 'internal' now"):
        load("geared-press", {f"groups[{number}].{internal}": True})
    ties = f'{{ range = "± 8 %", {linked} = ["links.link4.length"] }}'
    error = refused(PRESS.replace('"links.rod.length" = "± 8 %"', f'"links.rod.length" = {ties}'))
    assert error.key == 'optimise.free."links.rod.length"' and "it is called 'linked' now" in error.remedy


def test_old_names_of_solver_and_bound():
    assert "optimise.solver" in new_of("delta <= 0.15", solver=f'"{old("multistart")[0]}"')
    assert "it is called 'multistart' now" in new_of("delta <= 0.15", solver=f'"{old("multistart")[0]}"')
    message = new_of(f"delta <= {old('initial')[0]}")
    assert "optimise.limits[0]" in message and "it is called 'initial' now" in message


@pytest.mark.parametrize("name", [name for name, new in RENAMED.items() if new in MEASURES])
def test_old_measures(name):
    now = f"it is called {RENAMED[name]!r} now"
    assert now in new_of(f"{name} <= 1") and now in new_of("delta <= 0.15", minimise=f'"{name}"')


ASKED = {  # what stands under [optimise]: key, value that is named, problem
    "an unknown measure": ('minimise = "delt"', "minimise", "delt", "did you mean 'delta'"),
    "two objectives": ('minimise = "delta"\nmaximise = "delta"', "maximise", "delta", "delete one"),
    "an unknown limit": ('limits = ["delt <= 1"]', "limits[0]", "delt <= 1", "did you mean 'delta'"),
    "a limit in another unit": ('limits = ["speed >= 5 kg"]', "limits[0]", "speed >= 5 kg", "rpm"),
    "a limit twice": ('limits = ["delta <= 1", "delta <= 2"]', "limits", ["delta <= 1", "delta <= 2"], "keep one"),
    "an unknown variable": ("free = { sped = '± 8 %' }", "free.sped", "± 8 %", "did you mean 'speed'?"),
    "a range of nothing": ("free = { speed = '1 to 2 kg' }", "free.speed", "1 to 2 kg", "rpm"),
    "an unknown linked number": (
        "free = { speed = { range = '± 8 %', linked = ['sped'] } }", "free.speed.linked", ["sped"], "'speed'"),
    "an unknown number of a case": (
        "cases = [{ name = 'a', changes = { sped = '1 rpm' } }]", "cases[0].changes.sped", "1 rpm", "'speed'"),
    "an unknown trade-off": ("trade_off = { limit = 'delta', bounds = [1] }", "trade_off.limit", "delta", "known here"),
    "a bound in another unit": ("limits = ['delta <= 1']\ntrade_off = { limit = 'delta', bounds = ['1 m'] }",
        "trade_off.bounds", ["1 m"], "a plain number"),
    "a change of nothing": ('changes = { "links.rod.lenth" = 1 }', 'changes."links.rod.lenth"', 1, "links.rod.length"),
    "a change of the section": ('changes = { "optimise.seed" = 1 }', 'changes."optimise.seed"', 1, "edit [optimise]"),
}  # fmt: skip


@pytest.mark.parametrize("name", ASKED)
def test_what_is_asked_and_is_not_there(name):
    section, key, value, remedy = ASKED[name]
    error = refused(f"{PRESS.partition('[optimise]')[0]}[optimise]\n{section}\n")
    assert (error.key, error.value) == (f"optimise.{key}", value) and remedy in str(error)


def test_the_command_names_the_file(tmp_path, monkeypatch, capsys):
    (tmp_path / "bad.toml").write_text(PRESS.replace('"delta <= 0.15"', '"delt <= 0.15"'), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["linkjax", "optimise", "bad.toml"])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    err = capsys.readouterr().err
    assert stopped.value.code == 2 and len(err.splitlines()) == 1
    assert err.startswith('bad.toml: optimise.limits[0] = "delt <= 0.15": ')
