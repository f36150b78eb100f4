"""Forces where the other flanks of gears are loaded, or the other strand of a belt is tight: they have a kink there.

Extremes against a search by the forces themselves, root mean squares against integrals between the kinks.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import linkjax as lj
from linkjax import measures
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.groups import Belt
from linkjax.motion import make_grid
from linkjax.motion._divided import _divided
from tests.physics.machines import machine

PINS = ("A.crank", "D.wheel")
NAMES = tuple(f"{way}_reaction{motion}.{pin}" for motion in ("", "_constant_speed") for pin in PINS
              for way in ("peak", "min", "rms"))  # fmt: skip


def press(belt: bool) -> lj.Scene:
    """The geared press on a spring instead of its load, with unequal halves: with gears its first bearing carries most
    where the torque between them changes, with a tight belt least."""
    scene = lj.load("geared-press", {"groups[1].phase": "172 deg", "links.crank.length": "55 mm"})
    spring = lj.Spring("work", "ram", "Q", to_point="F", stiffness=2e5, free_length=0.7)
    made = scene.mechanism
    groups = list(made.groups)
    if belt:
        groups[1] = dataclasses.replace(groups[1], mesh=Belt(0.08, 0.08, crossed=True, tension=3e3))
    made = lj.Mechanism(made.fixed | {"F": lj.Vec(0.0, -0.1)}, made.links, groups, made.flywheel)
    return dataclasses.replace(scene, mechanism=made, loads=(spring,))


@pytest.fixture(scope="module", params=[pytest.param(False, marks=pytest.mark.slow), True], ids=["gears", "belt"])
def one(request):
    return press(request.param)


def reaction(scene: lj.Scene, pin: str):
    """Functions of crank angles at constant speed: length of the reaction, and moment through the mesh."""
    joint, link = pin.split(".")

    @jax.jit
    def both(phi):
        found = jax.vmap(lambda phi: kinetostatics(scene, phi, scene.speed, jnp.zeros(())))(phi).reactions
        return jnp.hypot(found[joint][link].fx, found[joint][link].fy), found["wheel.mesh"]["wheel"].moment

    def part(number):
        def at(phi):
            found = np.asarray(both(np.atleast_1d(phi))[number])
            return found if np.ndim(phi) else float(found[0])

        return at

    return part(0), part(1)


def closer(force, scan: np.ndarray, pick) -> float:
    """An extreme by scans of ever smaller ranges."""
    middle, width = scan[pick(force(scan))], scan[1]
    for _ in range(8):
        near = middle + np.linspace(-width, width, 201)
        middle, width = near[pick(force(near))], width / 50
    return float(np.max(force(np.asarray([middle]))))


@pytest.mark.parametrize("pin", PINS)
def test_extremes_and_means_at_constant_speed(one, pin):
    """The extremes by scans, and the mean squares by adaptive quadrature between the kinks."""
    found = measures.evaluate(one, NAMES)
    force, moment = reaction(one, pin)
    scan = np.linspace(0.0, 2 * np.pi, 2001)
    for way, pick in (("peak", np.argmax), ("min", np.argmin)):
        wanted = closer(force, scan, pick)
        assert float(found[f"{way}_reaction_constant_speed.{pin}"]) == pytest.approx(wanted, rel=1e-11)
    changes = np.flatnonzero(np.diff(np.sign(moment(scan))))
    assert changes.size >= 2
    ends: list = [brentq(moment, scan[i], scan[i + 1], xtol=1e-14) for i in changes]
    ends = [*ends, ends[0] + 2 * np.pi]
    parts = [quad(lambda phi: force(phi) ** 2, *each, epsabs=0, epsrel=1e-11)[0] for each in itertools.pairwise(ends)]
    mean = np.sqrt(sum(parts) / (2 * np.pi))
    assert float(found[f"rms_reaction_constant_speed.{pin}"]) == pytest.approx(mean, rel=1e-10)


@pytest.mark.slow
def test_they_do_not_depend_on_the_number_of_nodes(one):
    """In the actual motion, too; without panels that end at the kinks they differed by up to 8e-4. An analysis finds
    the same peaks."""
    few, many = (np.asarray(list(measures.evaluate(one, NAMES, nodes).values())) for nodes in (96, 150))
    np.testing.assert_allclose(few, many, rtol=1e-11)
    cycle, names = lj.analyse(one, angles=4), measures.peak_names(one)
    for peaks, motion in ((cycle.peaks, ""), (cycle.peaks_constant_speed, "_constant_speed")):
        for pin in PINS:
            found = float(peaks.value[names.index(f"peak_reaction.{pin}")])
            assert found == pytest.approx(few[NAMES.index(f"peak_reaction{motion}.{pin}")], rel=1e-11)


SLOPES = ("peak_reaction.A.crank", "min_reaction.D.wheel", "rms_reaction_constant_speed.D.wheel")


@compiled_soon
def forward(scene: lj.Scene, along: lj.Scene) -> tuple[jax.Array, jax.Array]:
    """The measures of `SLOPES`, and their derivatives along a direction."""
    return jax.jvp(lambda scene: jnp.stack(list(measures.evaluate(scene, SLOPES).values())), (scene,), (along,))


@compiled_soon
def backward(scene: lj.Scene, weights: jax.Array) -> lj.Scene:
    return jax.grad(lambda scene: weights @ jnp.stack(list(measures.evaluate(scene, SLOPES).values())))(scene)


@pytest.mark.slow
def test_their_gradients(one):
    """Forward, reverse and by differences, along a direction in which all numbers of the machine change."""
    leaves, tree = jax.tree.flatten(one)
    sizes = np.random.default_rng(5).uniform(-0.01, 0.01, len(leaves))
    along = jax.tree.unflatten(tree, [leaf * size for leaf, size in zip(leaves, sizes, strict=True)])
    h = 0.02

    def moved(step):
        return jax.tree.map(lambda leaf, part: leaf + step * part, one, along)

    at = {k: forward(moved(k * h), along) for k in (-2, -1, 0, 1, 2)}
    slopes = np.asarray(at[0][1])
    wanted = (8 * (at[1][0] - at[-1][0]) - (at[2][0] - at[-2][0])) / (12 * h)
    np.testing.assert_allclose(slopes, wanted, rtol=1e-6)
    for i, unit in enumerate(jnp.eye(len(SLOPES))):
        parts = zip(jax.tree.leaves(backward(one, unit)), jax.tree.leaves(along), strict=True)
        assert sum(float(leaf * part) for leaf, part in parts) == pytest.approx(slopes[i], rel=1e-9)


@pytest.mark.slow
def test_what_jumps_together_where_the_cycle_begins():
    """A load ends at 360 degrees, where the acceleration of the law jumps: the rack never has both the load and the
    acceleration afterwards. Its forces are constant between jumps, so the curves have the peaks."""
    ends = [lj.Move(2.0, math.radians(120), "trapezoidal"), lj.Move(None, math.radians(60), "dwell")]
    law = lj.Moves(0.0, [*ends, lj.Move(0.0, math.radians(120), "trapezoidal"), lj.Move(shape="dwell")])
    links = {"crank": lj.Link(length=0.02, mass=1.0, inertia=0.01), "rack": lj.Link(mass=5.0)}
    groups = [lj.Crank("crank", "A", "B", law=law), lj.Rack("rack", "P", lj.Guide("Q"), "crank", "A", 0.05)]
    made = lj.Mechanism({"A": lj.Vec(0, 0), "Q": lj.Vec(0, -0.05)}, links, groups)
    window = lj.Window(math.radians(300), math.radians(360))
    load = lj.Force("work", "rack", point="P", force=lj.Vec(-200.0, 0.0), window=window)
    cycle = lj.analyse(lj.Scene(made, (load,), speed=20.0), angles=720)
    names, forces = measures.peak_names(cycle.scene), cycle.forces
    assert forces is not None and cycle.peaks is not None
    for joint, link in (("A", "crank"), ("rack.guide", "rack"), ("rack.mesh", "rack")):
        on = forces.reactions[joint][link]
        highest = np.max(np.hypot(np.asarray(on.fx), np.asarray(on.fy)))
        found = float(cycle.peaks.value[names.index(f"peak_reaction.{joint}.{link}")])
        assert found == pytest.approx(highest, rel=1e-12)


def test_angles_beside_reactions():
    """Angles of links that turn unevenly are the same, whatever else is asked for."""
    bars = {"crank": 0.25, "rod": 0.22, "out": 0.24}
    links = {name: lj.Link(length=length, mass=1.0, inertia=0.01) for name, length in bars.items()}
    links["wheel"] = lj.Link(length=0.1, mass=6.0, inertia=0.03, centre=lj.Vec(0.08, 0.0))
    groups = [lj.Crank("crank", "A", "B"), lj.RRR(("rod", "out"), "B", "D", "C"),
              lj.Gear("wheel", "E", lj.Teeth((20, 40)), "out", "D", "W")]  # fmt: skip
    made = lj.Mechanism({"A": lj.Vec(0, 0), "D": lj.Vec(0.17, 0), "E": lj.Vec(0.47, 0)}, links, groups)
    scene = lj.Scene(made, speed=5.0, gravity=lj.Vec(0, -9.81))
    angles = ("max_angle.wheel", "min_angle.out")
    alone, both = (measures.evaluate(scene, (*angles, *more)) for more in ((), ("peak_reaction_constant_speed.D.out",)))
    for name in angles:
        assert float(both[name]) == pytest.approx(float(alone[name]), rel=1e-13)


def test_a_gear_that_turns_fast():
    """An eccentric planet turns five times with its arm: the torque through its mesh changes its sign ten times."""
    links = {"arm": lj.Link(length=0.12, mass=2.0, inertia=0.01),
             "planet": lj.Link(length=0.1, mass=6.0, inertia=0.03, centre=lj.Vec(0.06, 0.01))}  # fmt: skip
    planet = lj.Gear("planet", "B", lj.Teeth((20, 80)), "frame", "A", "W", carrier="arm")
    made = lj.Mechanism({"A": lj.Vec(0, 0)}, links, [lj.Crank("arm", "A", "B"), planet])
    scene = lj.Scene(made, speed=6.0, gravity=lj.Vec(0, -9.81))
    name = "rms_reaction_constant_speed.A.arm"
    few, many = (float(measures.evaluate(scene, (name,), nodes)[name]) for nodes in (96, 150))
    assert few == pytest.approx(many, rel=1e-11)


def test_spare_edges_do_not_depend_on_rounding():
    """Where panels are equally wide, the same one is halved however their widths are rounded."""
    grid = make_grid(machine("slider-crank"), 48)
    widest = np.flatnonzero(np.isclose(grid.half, np.max(grid.half), rtol=1e-12))
    assert widest.size > 1
    spare = [jnp.full((1, 2), jnp.inf)]
    made = [_divided(dataclasses.replace(grid, half=grid.half.at[i].multiply(1 + 1e-14)), spare).edges for i in widest]
    np.testing.assert_array_equal(made, [made[0]] * len(made))
