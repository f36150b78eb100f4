"""The study of the press's efficiency: its README, and the least radius of a journal."""

from __future__ import annotations

import pytest

import linkjax as lj
from studies.efficiency import study

TEXT = (study.HERE / "README.md").read_text(encoding="utf-8")
CELLS = [[cell.strip() for cell in row.strip("|").split("|")] for row in TEXT.splitlines() if row.startswith("|")]
ROWS = {first.split(",")[0]: rest for first, *rest in CELLS}


def test_the_least_radius():
    """The force on the projected area 2 r · b, with the length b = 1.25 · 2 r, is the pressure."""
    radius = study.least_radius(286e3)
    assert 286e3 / (2 * radius * 1.25 * 2 * radius) == pytest.approx(50e6, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("column", "change"), [(0, lambda scene: scene), (2, study.rolling)])
def test_the_losses_of_the_readme(column, change):
    found, cycle = study.losses(change(lj.load("press-with-friction")))
    for joint, loss in found.items():
        assert f"{loss:.1f}" == ROWS[joint][column]
    assert cycle.efficiency is not None
    assert f"{100 * cycle.efficiency:.1f} %" == ROWS["efficiency"][column]
