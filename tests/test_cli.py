"""The command line: its files, output and exit codes."""

import io
import json
import math
import re
import time

import numpy as np
import pytest
from rich.console import Console

import linkjax as lj
from linkjax import cli
from linkjax._compile import compiled_soon
from linkjax._display import Numbers, number
from linkjax.cli._app import angle_of
from linkjax.cli._console import console, elapsed
from linkjax.cli._print import print_summary
from linkjax.motion import steady_motion
from tests.helpers import PACKAGE


def run(monkeypatch, capsys, *arguments):
    """Exit code, standard output and standard error of one call."""
    monkeypatch.setattr("sys.argv", ["linkjax", *map(str, arguments)])
    monkeypatch.setattr(console, "quiet", False)
    monkeypatch.setattr(console, "width", 160)
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    out, err = capsys.readouterr()
    return stopped.value.code or 0, out, err


@pytest.fixture
def call(monkeypatch, capsys):
    return lambda *arguments: run(monkeypatch, capsys, *arguments)


def test_scenes_lists_every_scene_with_its_structure(call):
    code, out, _ = call("scenes")
    assert code == 0
    for name in lj.scene_names():
        assert name in out
    assert "I1(crank) → II2(rod, slider) → II1(link4, rocker)" in out


def test_show_tells_what_the_scene_holds(call):
    code, out, _ = call("show", "hay-press", "--set", 'links.rod.length="1.1 m"')
    assert code == 0
    assert "700 rpm" in out
    assert "rod     1100 mm" in out
    assert "hay: 30 kN against the motion, on rocker S5, from 90° to 335°" in out
    code, out, _ = call("show", "hay-press", "--units", "m,rad/s,N,rad")
    assert code == 0
    assert "73.3038 rad/s" in out
    assert "1.02 m " in out
    assert "30000 N against the motion, on rocker S5, from 1.5708 rad to 5.84685 rad" in out


def test_new_writes_a_scene_that_loads_and_never_overwrites(call, tmp_path):
    path = tmp_path / "mine"
    assert call("new", path)[0] == 0
    assert lj.load(tmp_path / "mine.toml").mechanism.driving_link
    code, _, err = call("new", path)
    assert code == 2
    assert "already exists" in err
    for name in ("", ".toml"):
        code, _, err = call("new", name)
        assert code == 2 and "is not the name of a file" in err


def test_new_begins_with_any_built_in_machine(call, tmp_path):
    for name in (*lj.scene_names(), *lj.scenes.rolling_names()):
        path = tmp_path / f"my {name}.toml"
        assert call("new", path, "--like", name)[0] == 0
        mine, given = lj.scenes.load_document(path).table, lj.scenes.load_document(name).table
        assert mine == given | {"title": f"my {name}"}
        assert path.read_text(encoding="utf-8").count("#") > 3
    untitled = tmp_path / "old.toml"
    untitled.write_text('speed = "90 rpm"\n[links.crank]\ntitle = "no key"\n', encoding="utf-8")
    assert call("new", tmp_path / "b", "--like", untitled)[0] == 0
    made = lj.scenes.load_document(tmp_path / "b.toml").table
    assert (made["title"], made["links"]["crank"]["title"]) == ("b", "no key")
    code, _, err = call("new", tmp_path / "c", "--like", "hay-pres")
    assert code == 2 and "did you mean 'hay-press'" in err
    code, _, err = call("new", tmp_path / "c", "--like", "hay-press", "--kind", "rolling")
    assert code == 2 and "omit --kind" in err
    assert not (tmp_path / "c.toml").exists()


def test_show_draws_a_machine_without_an_analysis(call, tmp_path, monkeypatch):
    monkeypatch.setattr("linkjax.cli._app.analyse", None)
    for ending, begins in ((".svg", b"<?xml"), (".PNG", b"\x89PNG"), (".pdf", b"%PDF")):
        path = tmp_path / "new" / f"four{ending}"
        code, out, _ = call("show", "four-bar", "--out", path, "--at", "30", "--at", "2 rad")
        assert code == 0 and "written" in out
        assert path.read_bytes().startswith(begins)
    assert "φ = 30°" in (tmp_path / "new/four.svg").read_text(encoding="utf-8")
    assert call("show", lj.scenes.rolling_names()[0], "--out", tmp_path / "rings.svg")[0] == 0
    assert (tmp_path / "rings.svg").exists()


def test_a_machine_that_moves_only_in_part_is_drawn_there(call, tmp_path):
    short = ("--set", 'links.rocker.length="150 mm"')
    assert call("show", "four-bar", "--out", tmp_path / "a.svg", *short)[0] == 0
    found = lj.analysis.positions(lj.load("four-bar", {"links.rocker.length": "150 mm"}))["result"]["per_angle"]
    assert 0 < np.count_nonzero(found) < found.size
    code, _, err = call("show", "four-bar", "--out", tmp_path / "b.svg", *short, "--at", "0", "--at", "180")
    assert code == 1 and "cannot be assembled at 180.000° of crank angle" in err
    code, _, err = call("show", "four-bar", "--out", tmp_path / "b.svg", *short, "--set", 'links.coupler.length="9 mm"')
    assert code == 1 and "nor at any other crank angle" in err
    assert not (tmp_path / "b.svg").exists()


def test_show_gives_the_ranges_of_a_crank_that_cannot_rotate_fully(call):
    """With bars of 150 and 360 mm, and a frame of 400 mm, the dyad is stretched where the distance from B to D is
    510 mm."""
    code, out, _ = call("show", "four-bar", "--set", 'links.rocker.length="150 mm"')
    stretched = math.degrees(math.acos((120**2 + 400**2 - 510**2) / (2 * 120 * 400)))
    assert code == 0 and f"range      of crank angle: from −{stretched:.3f}° to {stretched:.3f}°;" in out
    code, out, _ = call("show", "four-bar", "--set", 'links.crank.length="2 m"')
    assert code == 0 and "range      none: the machine cannot be assembled at any crank angle" in out
    code, out, _ = call("show", "four-bar")
    assert code == 0 and "range  " not in out
    assert "1.5 kg·m², target" in out and not any(line.endswith(" ") for line in out.splitlines())


def test_titles_are_shown_as_they_are(call):
    code, out, _ = call("show", "hay-press", "--set", "title=Press [/v2] [bold]")
    assert code == 0
    assert "Press [/v2] [bold]" in out


@pytest.fixture(scope="module")
def analysed(tmp_path_factory):
    """One run of `analyse` with all outputs except the figures."""
    folder = tmp_path_factory.mktemp("analysed")
    with pytest.MonkeyPatch.context() as patch:
        words = ["analyse", "hay-press", "--json", folder / "all.json", "--csv", folder / "csv", "--angles", 72]
        patch.setattr("sys.argv", ["linkjax", *map(str, words)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
    return stopped.value.code or 0, folder


def test_positions_are_those_of_an_analysis(analysed):
    found, data = lj.analysis.positions(lj.load("hay-press"), 72), json.loads((analysed[1] / "all.json").read_text())
    for key in ("points", "links"):
        for name, one in found[key].items():
            for part, values in one.items():
                np.testing.assert_allclose(values, data[key][name][part], rtol=1e-12, atol=1e-14)


def test_analyse_writes_the_whole_document(analysed):
    code, folder = analysed
    assert code == 0
    data = json.loads((folder / "all.json").read_text())
    for key in ("scene", "linkjax_version", "precision", "model", "angles", "points", "links", "groups", "dead_centres",
                "reduced", "motion", "flywheel", "forces", "peaks", "checks", "result"):  # fmt: skip
        assert key in data
    assert data["precision"] == "float64"
    assert np.allclose(np.diff(data["angles"]), 2 * math.pi / 72, rtol=1e-12)
    assert set(data["points"]) == {"A", "B", "D", "E", "F", "G", "S1", "S2", "S3", "S4", "S5"}
    assert data["forces"]["reactions"]["B"]["rod"]["by"] == "crank"
    assert data["forces"]["reactions"]["slider.guide"]["slider"]["by"] == "frame"
    assert data["result"]["code"] == 0
    assert max(data["checks"].values()) < 1e-10


def test_the_document_agrees_with_python(analysed):
    data = json.loads((analysed[1] / "all.json").read_text())
    motion = compiled_soon(steady_motion)(lj.load("hay-press"))
    assert math.isclose(data["motion"]["delta"], float(motion.delta), rel_tol=1e-12)
    # dead centres of the slider are those of a crank in line with its guide
    slider = sorted(entry["angle"] for entry in data["dead_centres"] if entry.get("point") == "D")
    assert np.allclose(slider, [0.0, math.pi], atol=1e-9)


def test_quiet_prints_nothing_but_errors(call, tmp_path):
    code, out, err = call("analyse", "slider-crank", "--quiet", "--json", tmp_path / "cycle.json")
    assert (code, out, err) == (0, "", "")
    assert json.loads((tmp_path / "cycle.json").read_text())["motion"]["delta"] > 0
    code, out, err = call("analyse", "slider-crank", "--quiet", "--set", 'links.rod.length="1 mm"')
    assert (code, out) == (1, "")
    assert "rod" in err


def test_figures_not_to_be_trusted_are_announced(analysed, capsys, monkeypatch):
    """A check above its limit, or no check, and a result that is only a warning."""
    data = json.loads((analysed[1] / "all.json").read_text())
    machine = lj.load("hay-press")
    monkeypatch.setattr(console, "quiet", False)
    print_summary(data, machine, Numbers())
    assert "WARNING" not in capsys.readouterr().out
    for wrong in (1e-9, math.nan):
        print_summary({**data, "checks": {**data["checks"], "energy_closure": wrong}}, machine, Numbers())
        assert "WARNING: a check is above 1e-10; do not trust these figures" in capsys.readouterr().out
    told = {"code": 1, "name": "TOO_MANY_REVERSALS", "message": "Too many."}
    print_summary({**data, "result": told}, machine, Numbers())
    assert "WARNING: Too many." in capsys.readouterr().out


def test_long_work_shows_a_spinner_on_a_terminal(monkeypatch):
    """Nothing within the first second, then the current task and its duration; nothing at all on a file or pipe."""
    for terminal in (True, False):
        screen = io.StringIO()
        monkeypatch.setattr("linkjax.cli._console.console", Console(file=screen, force_terminal=terminal, width=80))
        with elapsed("drawing"):
            time.sleep(0.1)
        assert "drawing" not in screen.getvalue()
        with elapsed("drawing"):
            time.sleep(1.6)
        assert ("drawing … 1 s" in screen.getvalue()) == terminal
        monkeypatch.setattr("linkjax.cli._console.progress", lambda: (12, 66))
        with elapsed("analysing"):
            time.sleep(1.3)
        assert ("analysing, compiling: 12 of 66 programs … 1 s" in screen.getvalue()) == terminal


def test_long_compilation_says_so_where_there_is_no_terminal(monkeypatch):
    """Once, on the stream of errors, unless only errors are wanted; not where nothing is compiled."""
    monkeypatch.setattr("linkjax.cli._console.LONG", 0.05)
    said = []
    for quiet, programs in ((False, (12, 66)), (True, (12, 66)), (False, (66, 66))):
        errors = io.StringIO()
        monkeypatch.setattr("linkjax.cli._console.console", Console(file=io.StringIO(), quiet=quiet))
        monkeypatch.setattr("linkjax.cli._console.complaints", Console(file=errors, width=120))
        monkeypatch.setattr("linkjax.cli._console.progress", lambda programs=programs: programs)
        with elapsed("analysing"):
            time.sleep(0.3)
        said.append(errors.getvalue())
    assert said == ["analysing, compiling: 12 of 66 programs, once for machines of this structure\n", "", ""]


def test_tables_hold_the_same_numbers(analysed):
    """NumPy reads every table with the names and numbers of the JSON document."""
    folder = analysed[1]
    data = json.loads((folder / "all.json").read_text())
    moved = {"": data["forces"], "_constant_speed": data["forces_constant_speed"]}
    wanted = {
        "points": {f"{key}_{name}": column for name, at in data["points"].items() for key, column in at.items()},
        "links": {f"{column}_{name}": link[key] for name, link in data["links"].items()
                  for key, column in {"angle": "angle", "d": "dangle", "dd": "ddangle"}.items()},
        "groups": {f"transmission_angle_{name.replace('-', '_')}": group["transmission_angle"]
                   for name, group in data["groups"].items() if "transmission_angle" in group},
        "reduced": {"inertia": data["reduced"]["inertia"], "inertia_slope": data["reduced"]["inertia_slope"],
                    "torque": data["reduced"]["torque"],
                    **{f"torque_{load}": share for load, share in data["reduced"]["torque_by_load"].items()}},
        "motion": {key: data["motion"][key] for key in ("speed", "acceleration", "time", "power")},
        "loads": {f"power_{load}" if key == "power" else f"{key}_load_{load}": run[key]
                  for load, run in data["loads"].items() for key in ("fx", "fy", "moment", "power") if key in run},
        **{f"forces{suffix}": {
            **{f"{key}_{joint.replace('.', '_')}_{link}{suffix}": side[key] for joint, links in
               forces["reactions"].items() for link, side in links.items() for key in ("fx", "fy", "moment")},
            f"drive_torque{suffix}": forces["drive_torque"],
            **{f"{key}_{whole}{suffix}": forces[whole][key] for whole in ("shaking", "frame", "net_frame")
               for key in ("fx", "fy", "moment")},
        } for suffix, forces in moved.items()},
    }  # fmt: skip
    assert {path.name for path in (folder / "csv").iterdir()} == {f"{kind}.csv" for kind in wanted}
    for kind, columns in wanted.items():
        found = np.genfromtxt(folder / "csv" / f"{kind}.csv", delimiter=",", names=True)
        assert found.dtype.names is not None
        assert found.dtype.names == ("crank_angle", *columns)
        assert found["crank_angle"].tolist() == data["angles"] and len(data["angles"]) == 72
        for name, column in columns.items():
            assert found[name].tolist() == column, name


def test_two_columns_of_one_name_are_refused(call, tmp_path):
    four_bar = PACKAGE / "scenes/builtin/four-bar.toml"
    text = four_bar.read_text(encoding="utf-8").replace('name = "tool"', 'name = "a-b"')
    (tmp_path / "two.toml").write_text(text.replace('name = "ratchet"', 'name = "a_b"'), encoding="utf-8")
    code, _, err = call("analyse", tmp_path / "two.toml", "--angles", 36, "--csv", tmp_path / "csv")
    assert code == 2 and not (tmp_path / "csv").exists()
    assert "reduced.torque_by_load.a_b" in err and "has the column name 'torque_a_b'" in err and "rename" in err


def analyse_to_json(call, tmp_path, *words):
    code, out, err = call("analyse", "slider-crank", "--angles", 36, "--json", tmp_path / "it.json", *words)
    assert (code, err) == (0, "")
    return json.loads((tmp_path / "it.json").read_text()), out


@pytest.mark.slow
def test_the_roads_to_the_motion_agree(call, tmp_path):
    one, _ = analyse_to_json(call, tmp_path, "--nodes", 128)
    two, _ = analyse_to_json(call, tmp_path, "--nodes", 128, "--method", "diffrax")
    assert one["model"]["nodes"] == two["model"]["nodes"] == 132  # whole panels of at least 128 nodes in total
    assert "diffrax" in two["model"]["method"]
    assert "diffrax" not in one["model"]["method"]
    assert math.isclose(one["motion"]["delta"], two["motion"]["delta"], rel_tol=1e-9)
    np.testing.assert_allclose(two["motion"]["speed"], one["motion"]["speed"], rtol=1e-9)


def test_everything_at_one_angle_at_constant_speed_after_a_change(call, tmp_path):
    """`--at`, `--constant-speed`, `--units` and `--set` in one call, against the document and a hand calculation."""
    words = ("--at", "0.25 rev", "--constant-speed", "--units", "m,rad/s,N m,W", "--set", "speed=600 rpm")
    data, out = analyse_to_json(call, tmp_path, *words)
    assert data["motion"]["speed"] is None and data["work"] is None and data["model"]["method"] == "constant speed"
    assert all("_constant_speed" in name for name in data["peaks"])
    assert data["forces"] == data["forces_constant_speed"]
    assert "at 90° of crank angle" in out
    crank_pin = next(line.split() for line in out.splitlines() if line.startswith("C "))
    assert crank_pin[:5] == ["C", "0", "0.04", "−0.04", "0"]  # straight up, r' to the left
    reduced = next(line for line in out.splitlines() if line.startswith("J "))
    drive = data["forces"]["drive_torque"][9]
    assert f"J {number(data['reduced']['inertia'][9], 7)} kg·m²" in reduced
    assert f"ω {number(600 * math.pi / 30, 7)} rad/s" in reduced
    assert f"drive torque {number(drive, 7)} N·m" in reduced
    heads = dict(re.split(r"  +", line, maxsplit=1) for line in out.splitlines() if "  " in line.strip())
    assert heads["crank speed"] == f"{number(600 * math.pi / 30, 6)} rad/s, constant"
    supplied = data["energies"]["drive"]["supplied"] - data["energies"]["drive"]["absorbed"]
    assert heads["mean power at constant speed"] == f"{number(supplied * 10, 6)} W"  # ten turns per second
    assert "δ" not in out and "mean drive torque" not in out


@pytest.mark.parametrize(
    ("text", "degrees"),
    [
        ("90", 90),
        ("-90.", -90),
        ("1e2", 100),
        ("90°", 90),
        ("90 deg", 90),
        ("1.5707963267948966 rad", 90),
        (".25rev", 90),
    ],
)
def test_crank_angles(text, degrees):
    assert angle_of(text) == pytest.approx(math.radians(degrees), rel=1e-15)


def test_nothing_is_written_for_what_is_refused(call, tmp_path):
    assert call("analyse", "hay-press", "--at", "5 kg", "--out", tmp_path / "new")[0] == 2
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["analyse", "no-such-scene"], 2, "no such scene"),
        (["analyse", "hay-press", "--set", "links.rod.lenght=1 m"], 2, "length"),
        (["analyse", "hay-press", "--set", "links.rod.length"], 2, "KEY=VALUE"),
        (["analyse", "hay-press", "--set", "links.rod.length=-1 m"], 2, "links.rod.length"),
        (["analyse", "hay-press", "--method", "magic"], 2, "magic"),
        (["analyse", "hay-press", "--at", "nan"], 2, "not a finite number"),
        (["analyse", "hay-press", "--at", "0,30"], 2, "for several angles repeat --at"),
        (["analyse", "hay-press", "--at", "5 kg"], 2, "a mass where an angle is needed"),
        (["analyse", "hay-press", "--at", "1.2 raad"], 2, "did you mean 'rad'"),
        (["new", "no-such-folder/mine"], 2, "choose another place"),
        (["show", "hay-press", "--at", "60"], 2, "add --out picture.svg"),
        (["show", "hay-press", "--out", "press.gif"], 2, "a name that ends in .svg, .png, .pdf"),
        (["show", "hay-press", "--out", "pyproject.toml/a.svg"], 2, "choose another place"),
        (["analyse", "hay-press", "--out", "pyproject.toml/here"], 2, "choose another place"),
        (["analyse", "hay-press", "--angles", "72", "--set", "links.rocker.length=0.1 m"], 1, "link4-rocker"),
        (["analyse", "hay-press", "--angles", "72", "--set", "speed=20 rpm"], 1, "lowest mean speed"),
    ],
)
def test_exit_codes_and_messages(call, words, code, says):
    got, _, err = call(*words)
    assert got == code
    assert says in err


def test_export_to_mujoco(call, tmp_path):
    path = tmp_path / "bars.xml"
    code, out, _ = call("export", "four-bar", "--out", path, "--at", "30", "--set", 'links.crank.length="110 mm"')
    assert code == 0
    assert f"{path} written" in out
    wanted = lj.load("four-bar", {"links.crank.length": "110 mm"})
    assert path.read_text(encoding="utf-8") == lj.to_mjcf(wanted, math.radians(30))
    code, out, _ = call("export", "four-bar")
    assert code == 0
    assert out == lj.to_mjcf(lj.load("four-bar"))


def test_to_pylinkage_and_back(call, tmp_path):
    path = tmp_path / "bars.json"
    assert call("export", "four-bar", "--format", "pylinkage", "--out", path)[0] == 0
    assert json.loads(path.read_text(encoding="utf-8"))["name"] == "Crank-rocker"
    code, out, _ = call("import", path)
    assert code == 0
    assert "bars.toml written; next: linkjax show" in out
    scene = lj.load(tmp_path / "bars.toml")
    assert set(scene.mechanism.links) == {"crank", "coupler", "rocker"}
    assert float(scene.mechanism.links["coupler"].length) == pytest.approx(0.36, rel=1e-15)
    code, _, err = call("import", path)
    assert code == 2
    assert "already exists; choose another name with --out" in err
    assert call("import", path, "--out", tmp_path / "other.toml")[0] == 0


def test_what_cannot_be_exchanged(call, tmp_path):
    code, _, err = call("export", "quick-return", "--format", "pylinkage")
    assert code == 2
    assert "quick-return: lever-die: pylinkage has no such group (RPR); use only rotating cranks" in err
    code, _, err = call("export", "four-bar", "--set", 'links.coupler.length="100 mm"', "--at", "180")
    assert code == 1
    assert "'coupler-rocker' cannot be assembled at 180 degrees" in err
    code, _, err = call("export", "four-bar", "--format", "pylinkage", "--at", "30")
    assert code == 2
    assert "are at crank angle zero; omit --at" in err
    path = tmp_path / "broken.json"
    path.write_bytes(b"\xff\xfe")
    code, _, err = call("import", path)
    assert code == 2
    assert "not encoded in UTF-8 (byte 0); save" in err
    path.write_text('{"joints": [], "links": []}', encoding="utf-8")
    code, _, err = call("import", path)
    assert code == 2
    assert "broken.json: links: there must be one driver, but there are: none; write one" in err
    assert call("import", tmp_path / "missing.json")[0] == 2
    assert list(tmp_path.iterdir()) == [path]
