"""Springs, dampers and drag in scene files: every key, the messages, and where they are shown."""

import dataclasses
import json
import math
import re

import jax
import numpy as np
import pytest

import linkjax as lj
from linkjax import cli
from linkjax.design import number
from linkjax.scenes import SceneError, load, loads_text
from tests.helpers import PACKAGE, same

PRESS = (PACKAGE / "scenes/builtin/hay-press.toml").read_text(encoding="utf-8").split("[[loads]]")[0]
REST = '\n[[loads]]\nname = "x"\n'
KINDS = {
    "spring": (
        'kind = "spring"\nlink = "rod"\npoint = "E"\nto = "F"\nstiffness = "2084 N/m"\nfree_length = "30 mm"\n'
        'preload = "24.91 N"',
        lj.Spring("x", "rod", "E", to_point="F", stiffness=2084.0, free_length=0.03, preload=24.91),
    ),
    "spring between links": (
        'kind = "spring"\nlink = "rod"\npoint = "E"\nto = { link = "rocker", point = "S5" }\nstiffness = 0\n'
        'preload = "-1 kN"\nwindow = ["0 deg", "90 deg"]',
        lj.Spring("x", "rod", "E", "rocker", to_point="S5", stiffness=0.0, preload=-1e3,
                  window=lj.Window(0.0, math.pi / 2)),
    ),
    "torsion spring": (
        'kind = "torsion_spring"\nlink = "rocker"\nstiffness = "2 N m/rad"\nfree_angle = "180 deg"',
        lj.TorsionSpring("x", "rocker", stiffness=2.0, free_angle=math.pi),
    ),
    "torsion spring between links": (
        'kind = "torsion_spring"\nlink = "rocker"\nto = "link4"\nstiffness = "2 N m/rad"\nfree_angle = 0\n'
        'preload = "3 N m"',
        lj.TorsionSpring("x", "rocker", "link4", stiffness=2.0, free_angle=0.0, preload=3.0),
    ),
    "damper": (
        'kind = "damper"\nlink = "slider"\npoint = "D"\nto = "A"\ncoefficient = "0.2 kN s/m"',
        lj.Damper("x", "slider", "D", to_point="A", coefficient=200.0),
    ),
    "torsion damper": (
        'kind = "torsion_damper"\nlink = "rocker"\nto = "link4"\ncoefficient = "0.5 N m s/rad"',
        lj.TorsionDamper("x", "rocker", "link4", coefficient=0.5),
    ),
    "drag": (
        'kind = "drag"\nlink = "slider"\npoint = "D"\nlinear = "4 N s/m"\nquadratic = "0.8 N s^2/m^2"\n'
        'reacts_on = "frame"',
        lj.Drag("x", "slider", "D", linear=4.0, quadratic=0.8, reacts_on="frame"),
    ),
    "drag torque": (
        'kind = "drag_torque"\nlink = "crank"\nquadratic = "2e-4 N m s^2/rad^2"',
        lj.DragTorque("x", "crank", quadratic=2e-4),
    ),
    "force": (
        'kind = "force"\nlink = "slider"\npoint = "D"\nforce = ["1 N", "2 N"]',
        lj.Force("x", "slider", "D", force=lj.Vec(1.0, 2.0)),
    ),
    "torque": ('kind = "torque"\nlink = "rod"\ntorque = "1 N m"', lj.Torque("x", "rod", torque=1.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_is_read_and_written(name):
    text, want = KINDS[name]
    scene = loads_text(PRESS + REST + text)
    (found,) = scene.loads
    assert jax.tree.structure(found) == jax.tree.structure(want)
    for one, two in zip(jax.tree.leaves(found), jax.tree.leaves(want), strict=True):
        assert float(one) == float(two)
    same(scene)


def edit(name: str, old: str, new: str) -> str:
    """One of the loads above with one key changed."""
    text = KINDS[name][0]
    assert old in text
    return text.replace(old, new)


# fmt: off
WRONG = {  # load, key, parts of the message
    "a negative stiffness": (edit("spring", '"2084 N/m"', '"-2 N/m"'), "stiffness", "must not be negative", "2 kN/m"),
    "a stiffness without unit": (edit("spring", '"2084 N/m"', '"2084"'), "stiffness", "a number without a unit", ""),
    "a torsional stiffness of a spring": (edit("spring", "N/m", "N m/rad"), "stiffness",
        "a torsional stiffness where a stiffness is needed", '"2 kN/m"'),
    "a torque per degree": (edit("torsion spring", "N m/rad", "N m"), "stiffness",
        "a torque where a torsional stiffness is needed", '"5 N m/rad"'),
    "a negative free length": (edit("spring", '"30 mm"', '"-3 mm"'), "free_length", "must not be negative", ""),
    "no stiffness": (edit("spring", 'stiffness = "2084 N/m"\n', ""), "stiffness", "missing", 'stiffness = "2 kN/m"'),
    "no other end": (edit("spring", 'to = "F"\n', ""), "to", "missing", 'add to = "A"'),
    "a moving point as one of the frame": (edit("spring", '"F"', '"G"'), "to", "'G' is not a point of the frame",
        "name its link too, 'link4'"),
    "an unknown point of the frame": (edit("spring", '"F"', '"Z"'), "to", "'Z' is not a point of the frame", "A, F"),
    "an unknown link at the other end": (edit("spring between links", '"rocker"', '"rocket"'), "to.link",
        "'rocket' is not defined", "did you mean 'rocker'?"),
    "a point off its link": (edit("spring between links", '"S5"', '"D"'), "to.point",
        "'D' is not on link 'rocker'", ""),
    "one link": (edit("spring between links", '"rocker", point = "S5"', '"rod", point = "B"'), "link",
        "link 'rod' has both ends of load 'x'", "another link"),
    "no point at the other end": (edit("spring between links", ', point = "S5"', ""), "to.point", "missing", ""),
    "a list at the other end": (edit("spring", '"F"', '["F"]'), "to", "a list where a string is needed", ""),
    "a point of a torsion spring": (edit("torsion spring", "stiffness", 'point = "G"\nstiffness'), "point",
        "not a known key", ""),
    "the angle of a torsion spring": (edit("torsion spring", "free_angle", "angle"), "angle", "free_angle", ""),
    "a damper without coefficient": (edit("damper", "coefficient", "c"), "c", "did you mean 'coefficient'?", ""),
    "a spring constant of a damper": (edit("damper", "coefficient", "stiffness"), "stiffness",
        'only a load of the kind "spring"', ""),
    "drag without coefficients": (
        'kind = "drag"\nlink = "slider"\npoint = "D"', "linear", "missing", 'add linear = "200 N s/m", or quadratic'),
    "a negative drag": (edit("drag torque", '"2e-4', '"-2e-4'), "quadratic", "must not be negative", ""),
    "drag at a fixed point": (edit("drag", 'link = "slider"\npoint = "D"', 'link = "crank"\npoint = "A"'), "point",
        "point 'A' never moves", "name another point"),
    "a force as a torque": (edit("force", '"force"', '"torque"'), "kind", "has a force", "delete kind"),
    "a torque as a force": (edit("torque", '"torque"', '"force"'), "kind", "has a torque", "delete kind"),
    "a torque without one": ('kind = "torque"\nlink = "rod"', "torque", "missing", 'torque = "60 N m"'),
    "a load with nothing": ('link = "rod"', "force", "missing", "a spring, damper or drag has a kind"),
}
# fmt: on


@pytest.mark.parametrize("name", WRONG)
def test_what_is_refused(name):
    text, key, *parts = WRONG[name]
    with pytest.raises(SceneError) as caught:
        loads_text(PRESS + REST + text, "bad.toml")
    message = str(caught.value)
    assert caught.value.key == f"loads[0].{key}", message
    assert all(part in message for part in parts), message
    assert "\n" not in message and len(message) < 500


@pytest.mark.parametrize(
    ("kind", "key", "value", "unit"),
    [
        ("spring", "stiffness", 2084.0, "N/m"),
        ("spring", "free_length", 0.03, "m"),
        ("spring", "preload", 24.91, "N"),
        ("torsion spring", "stiffness", 2.0, "N m/rad"),
        ("torsion spring", "free_angle", math.pi, "rad"),
        ("torsion spring", "preload", 0.0, "N m"),
        ("damper", "coefficient", 200.0, "N s/m"),
        ("torsion damper", "coefficient", 0.5, "N m s/rad"),
        ("drag", "quadratic", 0.8, "N s^2/m^2"),
        ("drag torque", "linear", 0.0, "N m s/rad"),
        ("drag torque", "quadratic", 2e-4, "N m s^2/rad^2"),
    ],
)
def test_their_numbers_are_scene_parameters(kind, key, value, unit):
    scene = loads_text(PRESS + REST + KINDS[kind][0])
    found = number(scene, f"loads.x.{key}")
    assert float(found.read(scene)) == pytest.approx(value, rel=1e-15) and found.unit == unit
    assert found.least == (-math.inf if key in ("preload", "free_angle") else 0.0)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "press.toml").write_text(PRESS + REST + KINDS["spring"][0], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(monkeypatch, *words):
    monkeypatch.setattr("sys.argv", ["linkjax", *words])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return stopped.value.code


def test_keys_are_set_by_path(folder):
    changes = {"loads.x.stiffness": "3 kN/m", "loads.x.window": ["0 deg", "90 deg"]}
    (spring,) = load(folder / "press.toml", changes).loads
    assert isinstance(spring, lj.Spring) and float(spring.stiffness) == 3000.0
    with pytest.raises(SceneError, match=re.escape("did you mean 'loads[0].stiffness'?")):
        load(folder / "press.toml", {"loads.x.k": 1})


@pytest.mark.slow
def test_the_commands_show_a_spring(folder, monkeypatch, capsys):
    assert run(monkeypatch, "show", "press.toml") == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "x: 2.084 kN/m, free length 30 mm, preload 24.91 N, on rod E and frame F, permanent" in out
    words = ("analyse", "press.toml", "--angles", "24", "--json", "out.json", "--out", "out")
    assert run(monkeypatch, *words) == 0
    found = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    assert "peak_net_frame_force" in found["peaks"]
    assert np.ptp(found["reduced"]["torque_by_load"]["x"]) > 1.0 and abs(found["work"]["x"]) < 1e-9
    page = next((folder / "out").glob("*.html")).read_text(encoding="utf-8")
    assert "rod, at E and frame, at F" in page and '"ties"' in page


def test_sizes_are_shown_with_units():
    """A constant force, couples, dampers and drag."""
    loads = tuple(dataclasses.replace(found, name=f"x{i}") for i, (_, found) in enumerate(KINDS.values()))
    text = str(dataclasses.replace(loads_text(PRESS), loads=loads))
    for part in (
        "−1 kN, constant", "rod E and rocker S5",
        "2 N·m/rad, free angle 180°", "2 N·m/rad, free angle 0°, preload 3 N·m",
        "200 N·s/m", "500 mN·m·s/rad", "linear 4 N·s/m, quadratic 800 mN·s²/m²", "quadratic 200 µN·m·s²/rad²",
    ):  # fmt: skip
        assert part in text, text
