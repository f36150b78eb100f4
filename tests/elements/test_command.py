"""The command `element`: its text, JSON, drawing and messages."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from PIL import Image

from linkjax.elements import MATERIALS, NAMED, element_document
from linkjax.viz import element_figure
from tests.helpers import ROOT
from tests.test_cli import call as call

GIVEN = {
    "slider": {"angle": 0.5},
    "incline": {"angle": 0.3},
    "screw": {"diameter": 0.02, "lead": 0.005},
    "wedge-press": {"angle": 0.3},
    "gripping-cam": {"eccentricity": 0.01, "radius": 0.03, "angle": 0.4},
    "journal": {"radius": 0.01, "distance": 0.004},
    "thrust-ring": {"outer": 0.05, "inner": 0.01},
}


@pytest.fixture
def run(call):
    """The text of a call that succeeds."""

    def made(*options: str) -> str:
        code, text, complaint = call(*options)
        assert (code, complaint) == (0, "")
        return text

    return made


def test_wedge_press(run):
    text = run("element", "wedge-press", "--angle", "20deg", "--friction", "0.1", "--load", "5kN")
    rows = {line.split("  ")[0]: line.split() for line in text.splitlines()}
    assert rows["pressing"] == ["pressing", "3.0546", "kN", "59.58", "%", "from", "78.579°", "moves"]
    assert rows["released"] == ["released", "754.29", "N", "41.45", "%", "up", "to", "11.421°", "moves"]


def test_a_screw_that_holds_its_load(run):
    text = run("element", "screw", "--diameter", "20 mm", "--lead", "5 mm", "--friction", "0.1", "--load", "2 kN")
    assert "It is self-locking: without effort it stays where it is." in text
    assert "−405.23 mN m" in text and "locks" in text


def test_materials_in_a_groove(run, tmp_path):
    file = tmp_path / "slider.json"
    options = ("--material", "steel-steel", "--lubricated", "--groove", "30deg", "--json", str(file))
    text = run("element", "slider", "--angle", "5", *options)
    assert "It locks forward" in text
    data = json.loads(file.read_text(encoding="utf-8"))
    assert data["given"]["friction"] == pytest.approx(0.15, rel=1e-14)  # 0.075 / sin 30°
    assert data["forward"]["effort"] is None and data["forward"]["locks"] is True
    assert data["given"]["angle"] == pytest.approx(math.radians(5), rel=1e-15)


def test_a_journal_and_a_thrust_ring(run):
    text = run("element", "journal", "--radius", "10mm", "--friction", "0.1", "--load", "300 N", "--distance", "4 mm",
               "--bearing", "run-in")  # fmt: skip
    assert "381.97 mN m" in text and "1.2732 mm" in text and "68.17 %" in text
    text = run("element", "thrust-ring", "--outer", "50mm", "--inner", "20mm", "--friction", "0.1", "--load", "1kN",
               "--units", "cm")  # fmt: skip
    assert "3.7143 N m" in text and "3.7143 cm" in text


@pytest.mark.parametrize("name", NAMED)
def test_every_drawing(run, tmp_path, name: str):
    """Each of them has a picture with something in both of its halves."""
    file = tmp_path / "pictures" / f"{name}.png"
    options = [f"--{key}={value} m" if key != "angle" else f"--angle={value} rad" for key, value in GIVEN[name].items()]
    text = run("element", name, *options, "--friction", "0.1", "--out", str(file))
    assert "drawing: " in text
    picture = Image.open(file).convert("L")
    width, height = picture.size
    for half in (picture.crop((0, 60, width // 2, height)), picture.crop((width // 2, 60, width, height))):
        assert np.asarray(half).min() < 80
    data = element_document(name, {**GIVEN[name], "friction": 3.0})  # beyond locking, too
    assert element_figure(data).axes


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (("wedge",), "there is no element 'wedge'; did you mean 'wedge-press'?"),
        (("wedge-press", "--friction", "0.1"), "wedge-press needs its angle (angle of the wedge)"),
        (("wedge-press", "--angle", "20deg"), "wedge-press needs its friction (coefficient of friction)"),
        (("wedge-press", "--angle", "95deg", "--friction", "0.1"), "angle of the wedge press is 1.658063"),
        (("incline", "--angle", "5mm", "--friction", "0.1"), "--angle"),
        (("screw", "--angle", "5", "--friction", "0.1"), "screw has no angle; it takes diameter, lead"),
        (("slider", "--angle", "5", "--friction", "0.1", "--bearing", "unworn"), "slider has no bearing"),
        (("slider", "--angle", "5", "--friction", "0.1", "--static"), "--lubricated and --static apply to --material"),
        (("slider", "--angle", "5", "--friction", "0.1", "--material", "steel-steel"), "are both given; give one"),
        (("slider", "--angle", "5", "--material", "steel-bronze", "--static"), "give friction as a number"),
        (("slider", "--angle", "5", "--friction", "0.1", "--out", "a.txt"), "that ends in .svg, .png or .pdf"),
    ],
)
def test_bad_input(call, options: tuple[str, ...], match: str):
    code, _, complaint = call("element", *options)
    assert code == 2 and match in complaint


def test_the_page_has_the_table_of_materials():
    text = (ROOT / "docs/friction.md").read_text(encoding="utf-8")
    for pair, row in MATERIALS.items():
        first, second = pair.split("-")
        rows = [line for line in text.splitlines() if line.startswith(f"| {first}–")]
        (line,) = [line for line in rows if second in line.split("|")[1].strip().partition("–")[2].split(" or ")]
        shown = [cell.strip() for cell in line.split("|")[2:-1]]
        for cell, value in zip(shown, row, strict=True):
            numbers = [] if cell == "–" else [float(part) for part in cell.split(" to ")]
            assert sorted({*numbers}) == sorted({*(value or ())})
    assert [name for name in NAMED if f"| `{name}`" not in text] == []
