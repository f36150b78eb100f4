"""Accuracy in single precision: by comparison, and a warning where it is fewer than four digits."""

import math
import subprocess
import sys

import pytest

import linkjax as lj
from benchmarks.float32 import NAMES, PARTS, digits
from linkjax.analysis import float32_digits
from tests.helpers import ROOT

DELTA = "import linkjax as lj; print(float(lj.steady_motion(lj.load('slider-crank')).delta))"
NEARLY = """
import linkjax as lj
from linkjax import *
links = {n: Link(length=l, mass=1.0, inertia=0.01) for n, l in (("crank", 0.1), ("one", 0.3), ("two", X))}
groups = [Crank("crank", "A", "B"), RRR(("one", "two"), "B", "D", "C", 1)]
machine = Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0)}, links, groups, Flywheel(1.0))
lj.analyse(Scene(machine, (OpposingTorque("brake", "two", magnitude=3.0),), speed=10.0), angles=36, throw=False)
"""

GEARED = """
import linkjax as lj
from linkjax import *
links = {n: Link(length=l) for n, l in (("crank", 0.02), ("wheel", 0.02), ("left", 0.15), ("right", 0.12))}
groups = [Crank("crank", "A", "B", phase=0.7), Gear("wheel", "D", Teeth((40, 20)), "crank", "A", "C", phase=1.0),
          RRR(("left", "right"), "B", "C", "P")]
(found,) = lj.crank_ranges(Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.18, 0.0)}, links, groups), 2)
print(*found[:2], found[2:] == ("", ""))
"""


QUICK = "rolling-eccentric"


def table() -> dict[str, dict[str, float]]:
    """The table of docs/hard-cases.md for every scene, by part."""
    text = (ROOT / "docs/hard-cases.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:1] == "|"]
    return {
        name: {part: float(cell) for part, cell in zip(PARTS, cells, strict=True) if cell != "–"}
        for name, *cells in rows
        if name in NAMES
    }


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n != QUICK)) for n in NAMES])
def test_the_digits_that_are_told(name):
    """Within half a digit, because rounding differs between processors. δ is one number, not the worst of many: more
    than six digits of it are accidental."""
    found, told = (
        {part: min(x, 6.0) if part == "delta" else x for part, x in of.items()} for of in (digits(name), table()[name])
    )
    assert found == pytest.approx(told, abs=0.5)


@pytest.mark.slow
def test_digits_of_a_scene():
    """Six or seven for positions and coefficients; for δ as many as in a separate process in float32."""
    found = float32_digits(lj.load("slider-crank"))
    assert all(5.5 < found[part] < 7.5 for part in ("position", "coefficients", "drive_torque"))
    run = subprocess.run([sys.executable, "-c", DELTA], capture_output=True, text=True, check=True)
    full = float(lj.steady_motion(lj.load("slider-crank")).delta)
    apart = [full * 10 ** -found["delta"], abs(float(run.stdout) - full)]  # a difference of speeds near one
    assert max(apart) < 8 * 2.0**-23 and min(apart) > 0, apart


@pytest.mark.slow
@pytest.mark.parametrize(("length", "warned"), [("0.200001", True), ("0.25", False)])
def test_a_warning_near_a_dead_position(length, warned):
    """A dyad that is a millionth from its stretched position, and one far from it."""
    run = subprocess.run(
        [sys.executable, "-c", NEARLY.replace("X", length)], capture_output=True, text=True, check=True
    )
    assert ("float32 gives this machine about" in run.stderr) == warned


def test_a_geared_machine_that_comes_round():
    """After two turns the machine returns to its initial position: its pins are never 0.27 or 0.03 m apart."""
    run = subprocess.run([sys.executable, "-c", GEARED], capture_output=True, text=True, check=True)
    start, stop, free = run.stdout.split()
    assert (float(start), float(stop), free) == (0.0, 4 * math.pi, "True")
