"""The steady-state motion with friction: Newton-Euler equations of all links at its speeds and accelerations, its own
slope, the wanted mean, nodes, gradients, limits."""

from __future__ import annotations

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from benchmarks import error_bound
from linkjax._compile import compiled_soon
from linkjax.design import changed
from linkjax.friction import GuideFriction, PinFriction, everywhere
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.measures import Parts
from linkjax.motion import Steady, make_grid
from tests.physics import driven, rubbed

PHI = np.linspace(0, 2 * np.pi, 48, endpoint=False) + 0.013
STEP = 1e-4


def slider_crank(friction: float, **given) -> lj.Scene:
    """The slider-crank of Exudyn's test data with a flywheel, and the same friction in every joint."""
    bars = [
        lj.Link(length=size, mass=0.2, inertia=0.2 * size**2 / 12, centre=lj.Vec(size / 2, 0.0)) for size in (0.1, 0.3)
    ]
    links = {"crank": bars[0], "rod": bars[1], "slider": lj.Link(mass=0.4)}
    groups = [lj.Crank("crank", "A", "B"), lj.RRP("rod", "slider", "B", "D", lj.Guide("A"))]
    mechanism = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, groups, lj.Flywheel(0.01))
    every = everywhere(mechanism, friction, 0.01) if friction else ()
    return lj.Scene(mechanism, speed=30.0, friction=every, **given)


PUMP = (lj.Drag("pump", "slider", "D", linear=5.0),)
CUT = (lj.OpposingForce("cut", "slider", "D", magnitude=60.0, window=lj.Window(1.0, 2.9)),)
MOTOR = lj.MotorDrive(lj.LineMotor(no_load=40.0, stall=2.0))
MACHINES = {
    "motor and pump": lambda f: slider_crank(f, loads=PUMP, motor=MOTOR),
    "constant torque and cut": lambda f: slider_crank(f, loads=CUT),
}
QUICK = "constant torque and cut"
machines = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == QUICK else pytest.mark.slow) for name in MACHINES]
)


@functools.cache
def motion(name: str, friction: float = 0.1, nodes: int = 144) -> Steady:
    return lj.steady_motion(MACHINES[name](friction), nodes)


@compiled_soon
def at_angles(made: ReadyScene, found: Steady, phi: jax.Array) -> tuple[jax.Array, jax.Array]:
    return jax.vmap(lambda phi: found.at(made, found.grid.place(phi)))(phi)


def moved(name: str, phi: np.ndarray) -> list[np.ndarray]:
    """Crank speed and acceleration at crank angles."""
    return [np.asarray(each) for each in at_angles(ready(MACHINES[name](0.1)), motion(name), jnp.asarray(phi))]


@machines
def test_newton_euler(name):
    """The drive torque of all links' equations, with friction repeated until it agrees, is that of the drive."""
    scene, (speed, acceleration) = MACHINES[name](0.1), moved(name, PHI)
    drag = ("slider", "D", 5.0) if scene.motor else None
    bare = dataclasses.replace(scene, loads=()) if scene.motor else scene
    known = rubbed.solve(bare, PHI, speed, acceleration, drag)
    given = 2 * (1 - speed / 40) if scene.motor else np.full_like(PHI, float(motion(name).mean_drive_torque))
    np.testing.assert_allclose(known.solution.drive, given, rtol=0, atol=1e-12 * np.abs(given).max())


@machines
def test_the_acceleration_is_the_slope_of_the_speed(name):
    """Away from the ends of panels, where the acceleration has a kink."""
    edges = np.asarray(motion(name).grid.edges)
    far = np.min(np.abs((PHI[:, None] - edges[None] + np.pi) % (2 * np.pi) - np.pi), axis=1) > 2 * STEP
    (down, _), (_, acceleration), (up, _) = (moved(name, PHI[far] + k * STEP) for k in (-1, 0, 1))
    slope = (up**2 - down**2) / (4 * STEP)
    np.testing.assert_allclose(acceleration, slope, rtol=0, atol=1e-7 * np.abs(acceleration).max())


def test_panels_end_around_the_place_where_the_force_of_a_pin_is_least():
    """The force of the wrist pin almost vanishes: its square has zeros beside the real axis, and friction is hardly
    smooth there. Panels end on either side, as far away as these zeros."""
    found, scene = motion(QUICK), MACHINES[QUICK](0.1)
    fine = np.linspace(4.95, 5.25, 3001)  # about 284° to 301°
    force, _ = rubbed.solve(scene, fine, *moved(QUICK, fine)).solution.reactions["D", "rod"]
    least = np.argmin(np.abs(force))
    assert 0 < least < fine.size - 1
    off = np.abs(force[least] / np.gradient(force, fine)[least])
    for sense in (-1, 1):
        assert np.min(np.abs(np.asarray(found.grid.edges) - fine[least] - sense * off)) < 0.1 * off


@pytest.mark.slow
def test_panels_are_for_what_is_asked_for():
    """Traced, a grid has panels for the kinks of the actual motion, of that at constant speed, or of both."""
    rubs = PinFriction("B", 0.1, 0.01), GuideFriction("slider", 0.1)
    scene = dataclasses.replace(MACHINES["motor and pump"](0.1), friction=rubs)

    def panels(moves: bool = True, still: bool = True) -> int:
        return jax.eval_shape(lambda s: Parts(s, moves=moves, still=still).grid.half, scene).size

    assert panels(still=False) < panels() > panels(moves=False)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["delta", "loss.D", "loss_constant_speed.D", "peak_reaction_constant_speed.D.rod"])
def test_a_measure_alone(name):
    """It is the same as with all kinks of both motions."""
    machine = MACHINES["motor and pump"](0.1)
    alone = jax.jit(lambda scene: lj.measures.evaluate(scene, [name])[name])(machine)
    assert float(alone) == pytest.approx(float(lj.measures.evaluate(machine, [name])[name]), rel=1e-10)


def test_a_loss_in_one_pin_alone():
    """Its force almost vanishes twice in a turn at constant speed."""
    machine = driven.slider_crank(None, pump=None)
    machine = dataclasses.replace(machine, friction=(PinFriction("D", 0.1, 0.01),))
    name = "loss_constant_speed.D"
    few, many = (float(lj.measures.evaluate(machine, [name], nodes)[name]) for nodes in (96, 1500))
    assert few == pytest.approx(many, rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("force", ["25 kN", "20 kN"])
def test_losses_where_more_forces_almost_vanish(force):
    """More pins than places with panels of their own, the last of them after many extremes of the same force."""
    scene = lj.load("press-with-friction", {"loads.hay.force": force})
    names = [f"loss_constant_speed.{joint}" for joint in "ABDEFG"]
    few, many = (lj.measures.evaluate(scene, names, nodes) for nodes in (96, 1500))
    for name in names:
        assert float(few[name]) == pytest.approx(float(many[name]), rel=1e-9), name


@pytest.mark.slow
def test_gradients_where_forces_of_pins_almost_vanish():
    """Losses of two pins of the hay press, whose forces fall to 0.0001 and 0.0015 of their largest."""
    scene = lj.load("press-with-friction")
    names = "loss_constant_speed.E", "loss_constant_speed.G"

    @compiled_soon
    def both(x):
        def value(x):
            found = lj.measures.evaluate(changed(scene, {"fixed.F.x": x}), names)
            return jnp.stack([found[each] for each in names])

        return jax.jvp(value, (x,), (jnp.ones(()),))

    at, h = float(scene.mechanism.fixed["F"].x), 3e-5
    rows = [np.asarray(both(jnp.asarray(at + step * h))[0]) for step in (-2, -1, 1, 2)]
    differences = (rows[0] - 8 * rows[1] + 8 * rows[2] - rows[3]) / (12 * h)
    np.testing.assert_allclose(both(jnp.asarray(at))[1], differences, rtol=1e-6)


@compiled_soon
def edges_by_offset(offset: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The edges of the panels of a slider-crank whose guide rubs, and their derivatives by its offset."""

    def edges(offset: jax.Array) -> jax.Array:
        scene = slider_crank(0.0)
        crank, rod = scene.mechanism.groups
        groups = (crank, dataclasses.replace(rod, guide=lj.Guide("A", offset=offset)))
        mechanism = dataclasses.replace(scene.mechanism, groups=groups)
        return make_grid(
            dataclasses.replace(scene, mechanism=mechanism, friction=(GuideFriction("slider", 0.1),)), 64
        ).edges

    return jax.jvp(edges, (offset,), (jnp.ones(()),))


def test_dead_centres_move_with_the_offset():
    """Where a guide begins to rub the other way: sin φ = e / (l ± r), and so is its derivative."""
    offset = 0.12
    found, slopes = (np.asarray(each) for each in edges_by_offset(jnp.asarray(offset)))
    for reach, turned in ((0.4, 0.0), (0.2, math.pi)):
        at = int(np.argmin(np.abs(found - turned - math.asin(offset / reach))))
        assert found[at] == pytest.approx(turned + math.asin(offset / reach), rel=1e-14)
        assert slopes[at] == pytest.approx(1 / math.sqrt(reach**2 - offset**2), rel=1e-13)


def test_the_mean_speed_is_the_wanted_one():
    found = motion(QUICK)
    assert found.mean_speed == pytest.approx(30.0, rel=1e-12)
    phi = np.asarray(found.grid.nodes).ravel()
    weights = np.asarray(found.grid.half[:, None] * found.grid.rule.w[None]).ravel()
    speed, _ = moved(QUICK, phi)
    assert 2 * np.pi / np.sum(weights / speed) == pytest.approx(30.0, rel=1e-11)


@pytest.mark.slow
@machines
def test_independent_of_the_number_of_nodes(name):
    many, few, fewer = motion(name), motion(name, nodes=128), motion(name, nodes=96)
    for part in ("delta", "mean_speed", "mean_drive_torque", "max_speed", "min_speed"):
        assert getattr(few, part) == pytest.approx(float(getattr(many, part)), rel=1e-11)
    for found in (few, fewer):  # many panels end at kinks, so that 96 nodes leave few for each
        assert abs(found.delta - many.delta) <= found.delta_error < 1e-8


@machines
def test_panels_end_where_friction_has_a_kink(name):
    """At reversals of the rod and the slider, and where the guide is loaded from the other side."""
    found, scene = motion(name), MACHINES[name](0.1)
    edges = np.degrees(np.asarray(found.grid.edges))
    for reversal in (0.0, 90.0, 180.0, 270.0):  # of the slider, and of the rod
        assert np.min(np.abs(edges % 360 - reversal)) < 1e-9
    fine = np.linspace(0, 2 * np.pi, 721, endpoint=False) + 1e-3
    speed, acceleration = moved(name, fine)
    drag = ("slider", "D", 5.0) if scene.motor else None
    bare = dataclasses.replace(scene, loads=()) if scene.motor else scene
    normal = rubbed.solve(bare, fine, speed, acceleration, drag).solution.reactions["slider.guide", "slider"][0].imag
    changes = np.flatnonzero(normal[:-1] * normal[1:] < 0)
    assert changes.size >= 2
    for i in changes:
        assert np.min(np.abs(edges - np.degrees(fine[i]) - 0.25)) < 0.26


@pytest.mark.slow
@machines
def test_the_frictionless_limit_is_linear(name):
    free, small, smaller = (motion(name, f, 96) for f in (0.0, 2e-4, 1e-4))
    for part in ("delta", "mean_drive_torque"):
        values = [float(getattr(each, part)) for each in (free, small, smaller)]
        assert (values[1] - values[0]) / (values[2] - values[0]) == pytest.approx(2, rel=2e-3)


def test_a_gradient_can_be_traced():
    """In a fast test, with friction in two joints: the gradients themselves are compared in the slow ones."""
    rubs = PinFriction("B", 0.1, 0.01), GuideFriction("slider", 0.1)
    scene = dataclasses.replace(MACHINES["motor and pump"](0.1), friction=rubs)
    shapes = jax.eval_shape(jax.grad(lambda s: lj.steady_motion(s, 96).delta), scene)
    assert jax.tree.structure(shapes) == jax.tree.structure(scene)


@pytest.mark.slow
@machines
def test_gradients(name):
    """δ, mean drive torque and greatest speed by coefficients, radii, lengths and masses."""
    scene = MACHINES[name](0.1)
    leaves, tree = jax.tree.flatten((scene.friction, scene.mechanism.links))
    base, made = jnp.stack(leaves), ready(scene)

    def all_of(x: jax.Array) -> jax.Array:
        friction, links = jax.tree.unflatten(tree, list(x))
        mechanism = dataclasses.replace(scene.mechanism, links=links)
        found = lj.steady_motion(made.of(Scene(**{**vars(scene), "mechanism": mechanism, "friction": friction})), 96)
        return jnp.stack([found.delta, found.mean_drive_torque, found.max_speed])

    along = jax.jit(lambda x, way: jax.jvp(all_of, (x,), (way,)))
    way = np.random.default_rng(2).uniform(-1, 1, base.size) * np.asarray(base)
    h = 1e-4
    (down, _), (_, slope), (up, _) = (along(base + k * h * way, way) for k in (-1, 0, 1))
    difference = np.asarray((up - down) / (2 * h))
    np.testing.assert_allclose(slope, difference, rtol=1e-5)
    weights = jnp.asarray([1.0, 0.7, 0.03])
    reverse = jax.jit(jax.grad(lambda x: weights @ all_of(x)))(base)
    assert reverse @ way == pytest.approx(float(weights @ slope), rel=1e-9)
    assert np.all(np.isfinite(reverse))


@pytest.mark.slow
def test_a_machine_that_locks_has_no_motion():
    """A guide with a coefficient of 4: the rod, at most 19.5° from the guide, pushes it fast."""
    scene = MACHINES["motor and pump"](0.0)
    free = lj.steady_motion(dataclasses.replace(scene, friction=(GuideFriction("slider", 2.5),)), 96)
    locked = lj.steady_motion(dataclasses.replace(scene, friction=(GuideFriction("slider", 4.0),)), 96)
    assert locked.driven is not None and free.driven is not None
    assert bool(free.driven.found) == (math.sqrt(8) > 2.5)  # cot of the largest angle of the rod
    assert not bool(locked.driven.found) and float(locked.steady_state_margin) < 0
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(locked))


@pytest.mark.slow
def test_a_machine_that_stalls_is_checked_at_constant_speed():
    """A motion that does not exist has no balance of power: nothing warns of figures that are right."""
    cut = (dataclasses.replace(CUT[0], magnitude=400.0),)
    cycle = lj.analyse(slider_crank(0.1, loads=cut, motor=MOTOR), angles=12, nodes=48)
    assert cycle.steady is None and cycle.missing is not None
    assert 0 <= float(cycle.checks.virtual_power) < 1e-14 and float(cycle.checks.force_balance) < 1e-14


@pytest.mark.slow
def test_the_stated_error_is_honest_for_random_machines():
    """30 slider-cranks with random lengths, masses and frictions, against 1500 nodes; more in the benchmark."""
    for ratios in error_bound.measured("friction, cut", 30):
        assert ratios.size >= 15 and np.min(ratios) >= 1  # others have no motion, or errors of rounding
