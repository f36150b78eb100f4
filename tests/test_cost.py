"""What a cycle costs, against the counts that are kept: plain scenes must not become dearer unnoticed.

Where a count is off and ought to be, renew the file: `python -m benchmarks.cost --write`, for the second test with
`--compiled`, and say in the commit what made it dearer.
"""

from __future__ import annotations

import jax
import pytest

from benchmarks.cost import PROGRAMS, cost, kept
from linkjax.scenes import scene_names

WITHIN = 0.03
ANOTHER = 0.25  # with another version of jax than the one that was counted with, which may lower a little differently
QUICK = [("slider-crank", "cycle")]
EVERY = [(scene, program) for scene in scene_names() for program in PROGRAMS]


def compare(scene: str, program: str, stage: str):
    file = kept()
    within = WITHIN if file["jax"] == jax.__version__ else ANOTHER
    known, found = file[stage][scene][program], cost(scene, program, stage == "compiled")
    for what, count in found.items():
        change = count / known[what] - 1
        assert abs(change) <= within, f"{scene}, {program}: {100 * change:+.1f} % {what} ({stage})"


@pytest.mark.parametrize(
    ("scene", "program"), [*QUICK, *(pytest.param(*c, marks=pytest.mark.slow) for c in EVERY if c not in QUICK)]
)
def test_handed_to_the_compiler(scene, program):
    compare(scene, program, "lowered")


@pytest.mark.slow
@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("scene", scene_names())
def test_compiled(scene, program):
    compare(scene, program, "compiled")


def test_every_scene_is_counted():
    assert set(kept()["lowered"]) == set(kept()["compiled"]) == set(scene_names())
