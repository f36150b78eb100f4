"""Machines drawn by hand, from books and examples of other programs: their positions and crank ranges."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax.kinematics import crank_ranges, pose, prepared
from linkjax.scenes import load, loads_text, text_of
from tests.cases.drawn import Figure
from tests.physics import oracle

SCENES = Path(__file__).parent / "scenes"
EVERY = sorted(path.stem for path in SCENES.glob("*.toml"))
ROUGH = {"hoecken", "klann"}  # rough sketches: the lengths are valid
SLOW = {"boom", "pyslvs-inverted-slider", "pyslvs-stephenson-2", "pyslvs-stephenson-3", "pyslvs-watt-2-slider"}
CHANGES = {"pyslvs-parallel"}  # without an own motion: see below
NEAR = 1e-9  # of the size
ROUNDED = {"pyslvs-watt-2-slider": 1e-4, "pyslvs-crank-slider-p": 1e-6, "roberts": 1e-6}  # also offsets and sides
ANGLES, MOST = 12, 128
FEW = ["bonnet-hinge", "peaucellier", "shaper", "toggle-press"]  # the others are slow


@functools.cache
def figure(name: str) -> Figure:
    return Figure(SCENES / f"{name}.toml")


@functools.cache
def machine(name: str) -> lj.Scene:
    return load(SCENES / f"{name}.toml")


@functools.cache
def _posed(name: str):
    ready = prepared(machine(name).mechanism)

    def at(phi):
        return {point: (state.r.x + 0 * phi, state.r.y + 0 * phi) for point, state in pose(ready, phi).points.items()}

    return jax.jit(jax.vmap(at))


def places(name: str, angles) -> dict[str, Any]:
    """Positions of points at crank angles, at most `MOST`, by linkjax: one program for each machine."""
    every = np.zeros(MOST)
    every[: len(angles)] = angles
    here = _posed(name)(jnp.asarray(every))
    return {point: (np.asarray(x) + 1j * np.asarray(y))[: len(angles)] for point, (x, y) in here.items()}


def some(names, slow=frozenset(SLOW)):
    return [pytest.param(name, marks=pytest.mark.slow) if name in slow else name for name in names]


def test_there_are_more_than_thirty():
    assert len(EVERY) > 30


@pytest.mark.parametrize("name", [name for name in EVERY if name not in ROUGH | {"trammel", "locomotive"}])
def test_every_joint_is_where_it_is_drawn_at_crank_angle_zero(name):
    """Rounded offsets move sliders by their last digit."""
    drawing = figure(name)
    at, _ = oracle.assemble(machine(name).mechanism, np.zeros(()))
    for point, spot in drawing.spots.items():
        if point in at:
            assert abs(at[point] - spot) < ROUNDED.get(name, NEAR) * drawing.size, point


@pytest.mark.parametrize("name", some(name for name in EVERY if name not in CHANGES))
def test_every_joint_is_where_the_closed_loops_have_it(name):
    """At crank angles through the range, upwards from crank angle zero: all loops closed in NumPy."""
    drawing = figure(name)
    path, end = drawing.walk(math.pi if drawing.law else 2 * math.pi)
    chosen = [path[i] for i in np.linspace(0, len(path) - 1 - (end is not None), ANGLES).astype(int)]
    at = places(name, [phi for phi, _ in chosen])
    for i, (_, x) in enumerate(chosen):
        for point, spot in drawing.spots_at(x).items():
            assert abs(at[point][i] - spot) < NEAR * drawing.size, point


@pytest.mark.parametrize("name", some((name for name in EVERY if not figure(name).law), frozenset(EVERY) - {*FEW}))
def test_a_crank_goes_as_far_as_its_loops_close(name):
    """The range that contains crank angle zero: a whole turn, or from one fold to the other."""
    drawing, found = figure(name), crank_ranges(machine(name).mechanism)[0]
    if name in CHANGES or drawing.walk(2 * math.pi)[1] is None:
        assert tuple(found) == (0.0, 2 * math.pi, "", "")
    else:
        ends = [drawing.walk(sign * 2 * math.pi)[1] for sign in (-1, 1)]
        assert (found.start, found.stop) == pytest.approx(ends, abs=1e-9)


@pytest.mark.slow
def test_a_parallelogram_that_nothing_holds_is_not_run_through_its_change_point():
    """Two cranks and a coupler alone may move in two ways from the stretched position: this is reported with the angle,
    and with the key for a continuous parallelogram."""
    told = r'change point at 90\.00 degrees of crank angle \(stretched\).* Set branch = "continue" at the top'
    with pytest.raises(lj.MachineError, match=told):
        lj.analyse(machine("pyslvs-parallel"))
    text = (SCENES / "pyslvs-parallel.toml").read_text(encoding="utf-8")
    smooth = loads_text('branch = "continue"\n' + text)
    again = loads_text(text_of(smooth))
    phi = jnp.linspace(0.0, 2 * math.pi, 25)
    for scene in (smooth, again):
        ready = prepared(scene.mechanism)
        points = jax.vmap(lambda phi, ready=ready: pose(ready, phi).points)(phi)
        np.testing.assert_allclose(points["C"].r.x - points["B"].r.x, 0.1, rtol=1e-12)
        np.testing.assert_allclose(points["C"].r.y - points["B"].r.y, 0.0, atol=1e-13)
