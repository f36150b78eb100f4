"""Output of the command line at single crank angles, its units, and values that do not exist: closed forms by hand."""

import math
import re

import pytest

from linkjax import cli
from linkjax.cli._console import console
from linkjax.scenes import loads_text

SLIDER_CRANK = """speed = "10 rad/s"
[fixed]
A = [0, 0]
[links.crank]
length = "100 mm"
mass = "1 kg"
inertia = "0.002 kg m^2"
[links.rod]
length = "300 mm"
mass = "2 kg"
inertia = "0.01 kg m^2"
centre = "150 mm"
[links.ram]
mass = "3 kg"
[flywheel]
inertia = "4000 kg m^2"
[[groups]]
kind = "crank"
link = "crank"
pivot = "A"
end = "B"
[[groups]]
kind = "RRP"
link = "rod"
from = "B"
end = "C"
block = "ram"
guide = { through = "A" }
"""
SHAFT = """speed = "1150 rpm"
[fixed]
A = [0, 0]
[links.shaft]
pins = ["A", "B"]
length = "100 mm"
[flywheel]
inertia = "12.5 kg m^2"
[drive]
link = "shaft"
[[loads]]
name = "punch"
link = "shaft"
torque = "1000 N m"
opposing = true
window = ["0 deg", "60 deg"]
"""


@pytest.fixture
def call(monkeypatch, capsys, tmp_path):
    """Exit code, output and error messages of one call."""
    (tmp_path / "slider.toml").write_text(SLIDER_CRANK, encoding="utf-8")
    (tmp_path / "shaft.toml").write_text(SHAFT, encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr("sys.argv", ["linkjax", *map(str, arguments)])
        monkeypatch.setattr(console, "quiet", False)
        monkeypatch.setattr(console, "width", 160)
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        out, err = capsys.readouterr()
        return stopped.value.code or 0, out, err

    return run


def row(out: str, *names: str, last: bool = True) -> list[str]:
    """The cells of the last (or first) row of a table that begins with these names."""
    lines = [line.split() for line in out.splitlines()]
    rows = [line for line in lines if line[: len(names)] == list(names)]
    return rows[-1 if last else 0][len(names) :]


def said(out: str, name: str) -> str:
    """The value after a name at the beginning of a line."""
    return next(line for line in out.splitlines() if line.startswith(name)).removeprefix(name).strip()


def test_what_vanishes_is_printed_as_zero(call):
    """Without load or weight the torque that balances the cycle is zero, despite rounding errors; at a dead centre J
    has zero slope; a zero or constant value has no angle of its maximum."""
    code, out, _ = call("analyse", "slider.toml", "--angles", 36, "--at", 0)
    assert code == 0
    assert said(out, "mean drive torque") == "0 N·m" and said(out, "mean power") == "0 W"
    assert row(out, "drive", "torque", last=False)[:3] == ["0", "N·m", "–"]
    assert ", J' 0 kg·m², Q 0 N·m, ω 10.0000" in out and "drive torque 0 N·m" in out
    assert not re.search(r"\d ?[nµ][NW]|(?<![\d.])0·10", out), out


@pytest.mark.slow
def test_what_is_constant_has_no_angle(call):
    """1000 N m over 60 of 360 degrees are 166.667 N m on average; a massless shaft carries nothing."""
    code, out, _ = call("analyse", "shaft.toml", "--angles", 36)
    assert code == 0 and said(out, "mean drive torque") == "166.667 N·m"
    assert row(out, "drive", "torque", last=False)[:3] == ["166.667", "N·m", "–"]
    assert row(out, "shaking", "force") == ["0", "N", "–", "0", "N", "–"]


def test_velocities_accelerations_and_forces_at_angles(call):
    """At the outer dead centre of a slider-crank with r = 0.1 m, l = 0.3 m: the slider has -r w^2 (1 + r/l), the middle
    of the rod the mean of that and -r w^2; the pin C carries the slider's 3 kg, the frame all three masses."""
    code, out, _ = call("analyse", "slider.toml", "--angles", 36, "--at", 0, "--at", "90", "--constant-speed",
                        "--units", "m, N")  # fmt: skip
    assert code == 0
    first, second = out.split("\nat 0° of crank angle, ")[1].split("\nat 90° of crank angle, ")
    for part in (first, second):
        assert part.startswith("constant nominal speed\ncrank speed 10.00000 rad/s, angular acceleration 0 rad/s²")
    slider, middle = 10 * (1 + 1 / 3), 10 * (1 + 1 / 6)
    points = first.split("|a| [m/s²]")[1].split("\nlink ")[0]  # the table of velocities
    assert row(points, "B") == ["0", "1", "1", "−10", "0", "10"]
    assert row(points, "C") == ["0", "0", "0", "−13.3333", "0", "13.3333"]
    assert float(row(points, "S2")[5]) == pytest.approx(middle, rel=1e-5)
    assert row(first, "rod")[3:] == [f"{-10 / 3:.5f}".replace("-", "−"), "0"]
    assert row(first, "C", "rod", "ram")[2] == f"{3 * slider:g}"
    assert f"magnitude {3 * slider + 2 * middle:.5f} N; shaking moment about A 0 N·m" in first
    tilt = math.asin(1 / 3)  # of the rod at 90 degrees; its angular velocity is zero, so the slider moves as B does
    points = second.split("|a| [m/s²]")[1].split("\nlink ")[0]
    assert row(points, "C")[2] == "1" and row(second, "rod")[3] == "0"
    turning = 100 * 0.1 / (0.3 * math.cos(tilt))  # r w^2 = l e cos(tilt)
    assert float(row(second, "rod")[4]) == pytest.approx(turning, rel=1e-5)


def test_an_acceleration_that_is_given(call):
    """A shaft of J = 12.5 kg m^2 at 10 rad/s^2 needs 125 N m without load and 1000 N m more with the load; its
    end, 0.1 m off, has 0.1 e along its path and 0.1 w^2 across."""
    words = ("analyse", "shaft.toml", "--angles", 36, "--at", 30, "--at", 90, "--acceleration")
    for value in ("10 rad/s^2", "10"):
        code, out, _ = call(*words, value, "--units", "N m, m")
        assert code == 0
        loaded, free = out.split("at 30° of crank angle, ")[1].split("at 90° of crank angle, ")
        assert "nominal speed and given acceleration\ncrank speed 1150.000 rpm, angular acceleration 10 rad/s²" in out
        assert "drive torque 1125.000 N·m" in loaded and "drive torque 125.0000 N·m" in free
        speed = 1150 * math.pi / 30
        assert row(free.split("\nlink ")[0], "B")[3:5] == ["−1", f"{-0.1 * speed**2:.2f}".replace("-", "−")]
        assert row(free, "shaft")[3:] == ["1150", "10"]
    code, _, err = call("analyse", "shaft.toml", "--acceleration", "10 rad/s^2")
    assert code == 2 and "--acceleration" in err and "add a crank angle, e.g. --at 60" in err
    code, _, err = call(*words, "10 rad/s")
    assert code == 2 and "a speed of rotation where an angular acceleration is needed" in err


def test_speeds_are_printed_as_they_were_given(call):
    for given, shown in (("10 rad/s", "10 rad/s"), ("2 rev/s", "2 rev/s"), ("700 rpm", "700 rpm"), ("10", "10 rad/s"),
                         ("360 deg/s", "360 deg/s")):  # fmt: skip
        code, out, _ = call("show", "slider.toml", "--set", f"speed={given}")
        assert code == 0 and said(out, "speed").startswith(f"{shown}, time mean")
    code, out, _ = call("show", "slider.toml", "--units", "rpm")
    assert said(out, "speed").startswith("95.493 rpm")
    code, out, _ = call("show", "rolling-eccentric", "--set", "speed=2 rev/s")
    assert code == 0 and "at 2 rev/s" in said(out, "drive")


def test_messages_keep_to_the_units(call):
    """A rod of 3 in, 76.2 mm, shorter than the crank; a speed too low for a blow of 1 MN m, in units of the scene."""
    code, _, err = call("analyse", "slider.toml", "--angles", 36, "--set", "links.rod.length=76.2 mm", "--units", "in")
    assert code == 1 and "'rod' (3 in) does not reach that far" in err and " m " not in err
    _, _, err = call("analyse", "slider.toml", "--angles", 36, "--set", "links.rod.length=76.2 mm")
    assert "'rod' (76.2 mm) does not reach that far" in err
    code, _, err = call(
        "analyse", "shaft.toml", "--angles", 36, "--set", "speed=20 rpm", "--set", "loads.punch.torque=1 MN m"
    )
    assert code == 1 and "at a mean speed of 20 rpm: " in err and "that has one is " in err and "rad/s" not in err
    found = float(re.search(r"that has one is (\S+) rpm", err)[1])  # type: ignore[index]
    slow = ("analyse", "shaft.toml", "--angles", 36, "--set", "speed=20 rpm", "--set", "loads.punch.torque=1 MN m")
    code, _, err = call(*slow)
    assert code == 1 and "at a mean speed of 20 rpm: " in err and "that has one is " in err and "rad/s" not in err
    found = float(re.search(r"that has one is (\S+) rpm", err)[1])  # type: ignore[index]
    code, _, err = call(*slow, "--units", "rad/s")
    assert "at a mean speed of 2.0944 rad/s: " in err
    again = float(re.search(r"that has one is (\S+) rad/s", err)[1])  # type: ignore[index]
    assert again == pytest.approx(found * math.pi / 30, rel=1e-5)


def test_a_failed_run_leaves_no_folder(call, tmp_path):
    before = sorted(tmp_path.iterdir())
    short = ("--angles", 36, "--set", "links.rod.length=50 mm")
    assert call("analyse", "slider.toml", *short, "--out", tmp_path / "new" / "deep")[0] == 1
    assert sorted(tmp_path.iterdir()) == before
    for words in (
        ("--out", "slider.toml/new"),
        ("--csv", "slider.toml"),
        ("--json", "slider.toml/all.json"),
        ("--json", "."),
    ):
        code, _, err = call("analyse", "slider.toml", *words)
        assert code == 2 and "choose another place" in err
    assert sorted(tmp_path.iterdir()) == before
    assert call("analyse", "slider.toml", "--angles", 36, "--json", "made/all.json", "--csv", "tables/made")[0] == 0
    assert (tmp_path / "made/all.json").exists() and (tmp_path / "tables/made/points.csv").exists()


@pytest.mark.slow
def test_the_law_that_helps_is_named_as_the_scene_has_it(call):
    """A crank that cannot rotate fully oscillates by `drive.law` in a drawn scene, else by the law of its group."""
    short = SLIDER_CRANK.replace('length = "300 mm"', 'length = "80 mm"')
    drawn = short.split("[[groups]]")[0].replace('length = "100 mm"', 'pins = ["A", "B"]\nlength = "100 mm"')
    drawn = drawn.replace('length = "80 mm"', 'pins = ["B", "C"]\nlength = "80 mm"')
    drawn = drawn.replace("[links.ram]", '[links.ram]\npins = ["C"]')
    drawn += (
        '[drive]\nlink = "crank"\n[[slots]]\nblock = "ram"\nguide = { through = "A" }\n[sketch]\nC = ["180 mm", 0]\n'
    )
    for text, key in ((short, "groups[0].law"), (drawn, "drive.law")):
        assert loads_text(text)
        with open("short.toml", "w", encoding="utf-8") as file:
            file.write(text)
        code, _, err = call("analyse", "short.toml", "--angles", 36)
        law = re.search(rf"e\.g\. {re.escape(key)} = \{{ (start = \"\S+ deg\", stop = \"\S+ deg\") \}}", err)
        assert code == 1 and law, err
        place = 'end = "B"\n' if key.startswith("groups") else '[drive]\nlink = "crank"\n'
        fixed = text.replace(place, f"{place}law = {{ {law[1]} }}\n", 1).replace(
            '[flywheel]\ninertia = "4000 kg m^2"\n', ""
        )
        with open("short.toml", "w", encoding="utf-8") as file:
            file.write(fixed)
        assert call("analyse", "short.toml", "--angles", 36)[0] == 0


def test_why_a_measure_has_no_value(call):
    words = ("--measure", "drive_torque@30deg", "--measure", "delta", "--measure", "stroke.C")
    code, out, _ = call("analyse", "slider.toml", "--angles", 36, "--constant-speed", *words)
    assert code == 0
    constant = "at constant speed: drive_torque_constant_speed@30deg"
    assert said(out, "drive_torque@30deg ").split(maxsplit=1) == ["–", f"no actual motion; {constant}"]
    assert said(out, "delta ").split(maxsplit=1) == ["–", "no actual motion"]
    assert said(out, "stroke.C ") == "200.00000 mm"
