"""Cost of an analysis, against the stored counts: plain scenes must not become more expensive unnoticed.

If a count changes for a good reason, renew the file, `python -m benchmarks.cost --compiled --write`, and give the
reason in the commit.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import pytest

from benchmarks.cost import NAMES, OF_SCENES, cost, equations, kept, loops, processor, programs, steps

WITHIN = 0.03
ANOTHER = 0.25  # with another version of jax, or compiled on another processor, than that of the counts
PLAIN = "slider-crank"
EVERY = [(scene, program) for scene in NAMES for program in programs(scene)]


def compare(scene: str, program: str, compiled: bool):
    file = kept()
    for stage, found in cost(scene, program, compiled).items():
        same = file["jax"] == jax.__version__ and (stage == "lowered" or file.get("processor") == processor())
        known = file[stage][scene][program]
        for what in ("flops", "bytes"):
            change = found[what] / known[what] - 1
            assert abs(change) <= (WITHIN if same else ANOTHER), f"{100 * change:+.1f} % {what} ({stage})"
        assert not same or found.get("loops") == known.get("loops"), "loops run otherwise"


@pytest.mark.parametrize("program", OF_SCENES)
def test_a_plain_scene_as_handed_to_the_compiler(program):
    compare(PLAIN, program, compiled=False)


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "program"), EVERY)
def test_every_scene_as_it_leaves_the_compiler(scene, program):
    compare(scene, program, compiled=True)


@pytest.mark.slow
@pytest.mark.parametrize("scene", kept().get("steps", {}))
def test_the_steps_along_a_path(scene):
    """Their number depends on the motion of the links, to a step or two because of rounding."""
    assert steps(scene) == pytest.approx(kept()["steps"][scene], rel=WITHIN)


@pytest.mark.parametrize(
    "scene", [s if s == PLAIN else pytest.param(s, marks=pytest.mark.slow) for s in kept().get("equations", {})]
)
def test_equations_of_an_analysis(scene):
    """They are what a first analysis of a machine waits for."""
    known, found = kept()["equations"][scene], equations(scene)
    assert found is not None
    assert found["programs"] <= known["programs"]
    assert found["equations"] <= (1 + WITHIN) * known["equations"]


def test_trips_are_counted():
    """Three by two iterations, one of them in a loop that the data end."""

    def ends(x):
        return jax.lax.while_loop(lambda x: x < 9.0, lambda x: 2 * x, x)

    def program(x):
        return jax.lax.scan(lambda x, _: (jax.lax.fori_loop(0, 2, lambda _, x: ends(x), x), None), x, length=3)[0]

    assert loops(jax.make_jaxpr(program)(jnp.asarray(1.0))) == {"3": 1, "3 2": 1, "3 2 ?": 1}


def test_every_scene_is_counted():
    file = kept()
    for stage in ("lowered", "compiled"):
        assert {name: set(counts) for name, counts in file[stage].items()} == {
            name: set(programs(name)) for name in NAMES
        }
