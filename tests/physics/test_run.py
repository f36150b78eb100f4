"""The equation of motion from any state: SciPy, energy, two methods compared, stalls, and derivatives."""

from __future__ import annotations

import itertools
import math

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import root_scalar

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.motion import run_in_angle, run_in_time, steady_by_diffrax, steady_motion
from linkjax.motion._torque import torque_at
from linkjax.reduction import Reduced
from tests.physics import oracle, shooting
from tests.physics.machines import machine

in_angle, in_time = compiled_soon(run_in_angle), compiled_soon(run_in_time)
STATES = [("clockwise", -7.9, 43.0, -2.0), ("hay-press", 1.3, 80.0, 400.0), ("four-bar", 20.0, 15.0, 0.5)]


def by_scipy(scene: lj.Scene, angles: np.ndarray, speed: float, drive: float) -> tuple[np.ndarray, np.ndarray]:
    """Speeds and times at crank angles by DOP853, divided at every jump of the loads and at every requested angle."""
    jumps = np.mod(oracle.jumps(scene), scene.cycle)
    turns = np.arange(math.floor(angles[0] / scene.cycle), math.ceil(angles[-1] / scene.cycle) + 1)
    cuts = np.unique(np.concatenate([angles, (jumps[None] + scene.cycle * turns[:, None]).ravel()]))
    cuts = cuts[(cuts >= angles[0]) & (cuts <= angles[-1])]

    def rate(phi, state, smooth):
        inertia, slope, torque = smooth(phi)
        return [(torque + drive - 0.5 * slope * state[0] ** 2) / (inertia * state[0]), 1 / state[0]]

    states = [[speed, 0.0]]
    for low, high in itertools.pairwise(cuts):
        off = 1e-13 * (high - low)
        smooth = shooting.Fitted(scene, low + off, high - off)
        ends, given = (smooth.low, smooth.high), {"args": (smooth,), "rtol": 1e-12, "atol": 1e-15}
        states.append(solve_ivp(rate, ends, states[-1], "DOP853", **given).y[:, -1])
    found = np.asarray(states)[np.searchsorted(cuts, angles)]
    return found[:, 0], found[:, 1]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "angle", "speed", "drive"), STATES)
def test_both_roads_from_any_state(name, angle, speed, drive):
    """More than a cycle from a state that is not steady, with a torque that does not balance the cycle."""
    scene = machine(name)
    angles = angle + np.linspace(0.0, 9.0, 7)
    speeds, times = by_scipy(scene, angles, speed, drive)
    one = in_angle(scene, jnp.asarray(angles), jnp.asarray(speed), jnp.asarray(drive))
    two = in_time(scene, jnp.asarray(times + 0.3), jnp.asarray(angle), jnp.asarray(speed), jnp.asarray(drive))
    assert not bool(one.stalled)
    assert not bool(two.stalled)
    np.testing.assert_allclose(one.speed, speeds, rtol=1e-8)
    np.testing.assert_allclose(one.time, times, rtol=1e-8)
    np.testing.assert_allclose(two.angle, angles, rtol=0, atol=2e-8)
    np.testing.assert_allclose(two.speed, speeds, rtol=1e-8)


@pytest.mark.slow
def test_the_steady_regime_repeats_itself():
    """Started in the steady-state motion, a run stays there: three cycles later, the same speed and three periods."""
    scene = machine("hay-press-slider")
    motion = compiled_soon(steady_motion)(scene)
    start = jnp.asarray(1.0)
    speed, _ = compiled_soon(lambda motion, scene, phi: motion.at(scene, motion.grid.place(phi)))(motion, scene, start)
    got = in_angle(scene, start + scene.cycle * jnp.arange(4.0), speed, motion.mean_drive_torque)
    np.testing.assert_allclose(got.speed, float(speed), rtol=1e-8)
    np.testing.assert_allclose(got.time, float(motion.period) * np.arange(4.0), rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("road", ["angle", pytest.param("time", marks=pytest.mark.slow)])
def test_a_machine_that_stalls(road):
    """It is reported, the result is infinite from there on, and it stops where its kinetic energy is zero."""
    scene = machine("hay-press-slider")
    start, drive = 1.7, 0.0
    angles = start + np.linspace(0.0, 2.0, 401)
    inertia = oracle.reduction(scene, angles[:1]).inertia[0]
    gained = np.concatenate([[0.0], np.cumsum([shooting.work(scene, a, b) for a, b in itertools.pairwise(angles)])])
    speed = 5.0
    left = 0.5 * inertia * speed**2 + gained
    assert left[0] > 0 > left[-1]
    stop = np.interp(0.0, -left, angles)
    if road == "angle":
        got = in_angle(scene, jnp.asarray(angles), jnp.asarray(speed), jnp.asarray(drive))
    else:
        times = jnp.linspace(0.0, 1.0, 401)
        got = in_time(scene, times, jnp.asarray(start), jnp.asarray(speed), jnp.asarray(drive))
    assert bool(got.stalled)
    done = np.isfinite(np.asarray(got.speed))
    assert done[0]
    assert not done[-1]
    assert np.all(np.diff(done.astype(int)) <= 0)
    assert not np.any(np.isnan(np.asarray([got.angle, got.speed, got.time])))
    last = np.asarray(got.angle)[done][-1]
    assert stop - 0.02 < last < stop + 1e-4
    # exactly: where the kinetic energy is zero, and the time to there without the singularity at the end
    place = root_scalar(
        lambda phi: 0.5 * inertia * speed**2 + shooting.work(scene, start, phi), bracket=(stop - 0.05, stop + 0.05)
    ).root

    def slowness(x):
        phi = place - x**2
        kinetic = -shooting.work(scene, phi, place)
        return 2 * x * math.sqrt(oracle.reduction(scene, np.asarray([phi])).inertia[0] / (2 * kinetic))

    duration = quad(slowness, 1e-9, math.sqrt(place - start), epsabs=0, epsrel=1e-9)[0]
    assert float(got.stall_angle) == pytest.approx(place, abs=1e-7)
    assert float(got.stall_time) == pytest.approx(duration, rel=1e-6)


@pytest.mark.slow
def test_start_from_rest():
    """A crank alone with a constant torque: φ = ½ (T / J) t²."""
    scene = lj.Scene(_crank_alone(), speed=10.0)
    times = jnp.linspace(0.0, 2.0, 5)
    got = in_time(scene, times, jnp.asarray(0.4), jnp.asarray(0.0), jnp.asarray(3.0))
    assert not bool(got.stalled)
    np.testing.assert_allclose(got.angle, 0.4 + 0.5 * (3.0 / 0.6) * np.asarray(times) ** 2, rtol=1e-9)
    back = in_time(scene, times, jnp.asarray(0.4), jnp.asarray(0.0), jnp.asarray(-3.0))
    assert bool(back.stalled)
    assert not np.any(np.isfinite(np.asarray(back.angle)[1:]))


def window(scene: lj.Scene) -> lj.Window:
    """Times at which the load of the press acts."""
    found = scene.loads[0].window
    assert isinstance(found, lj.Window)
    return found


def _crank_alone() -> lj.Mechanism:
    links = {"crank": lj.Link(length=0.1, inertia=0.6)}
    return lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, [lj.Crank("crank", "A", "B")], lj.Flywheel(0.0))


def _sensitivity(function, adjoint, design):
    """Gradient along the design: by reverse mode, or by forward mode, as the adjoint permits."""
    if isinstance(adjoint, diffrax.ForwardMode):
        return jax.jacfwd(lambda x: function(x, adjoint))(design)
    return jax.grad(lambda x: function(x, adjoint))(design)


@pytest.mark.slow
@pytest.mark.parametrize("road", ["angle", "time"])
def test_derivatives_from_any_state(road):
    """For start, torque, a length, and the angles at which the load switches: both adjoints against differences."""
    scene, tolerance = machine("hay-press-slider"), 1e-12
    ends = window(scene).on, window(scene).off
    origin = jnp.asarray([1.3, 80.0, 400.0, 1.0, *(float(a) for a in ends), 1.0])

    def end(x, adjoint=None):
        changed = eqx.tree_at(
            lambda s: (s.mechanism.links["rod"].length, window(s).on, window(s).off),
            scene, (scene.mechanism.links["rod"].length * x[3], x[4], x[5]),
        )  # fmt: skip
        if road == "angle":
            angles = jnp.stack([x[0], x[0] + 2.9 * x[6], x[0] + 7.7 * x[6]])
            got = run_in_angle(changed, angles, x[1], x[2], tolerance=tolerance, adjoint=adjoint)
            return got.speed[1] + 1e3 * got.time[2]
        times = jnp.asarray([0.0, 0.05, 0.1]) * x[6]
        got = run_in_time(changed, times, x[0], x[1], x[2], tolerance=tolerance, adjoint=adjoint)
        return got.speed[1] + 10.0 * got.angle[2]

    value = jax.jit(end)
    reverse, forward = (
        np.asarray(jax.jit(lambda x, a=a: _sensitivity(end, a, x))(origin))
        for a in (diffrax.RecursiveCheckpointAdjoint(), diffrax.ForwardMode())
    )
    size = float(np.linalg.norm(reverse))
    np.testing.assert_allclose(forward, reverse, rtol=0, atol=1e-9 * size)
    for i, one in enumerate(np.eye(origin.size)):
        h = 1e-3 * max(1.0, float(origin[i])) if i in (1, 2) else 1e-3
        near, far = (float(value(origin + k * h * one) - value(origin - k * h * one)) for k in (1, 2))
        assert abs((8 * near - far) / (12 * h) - reverse[i]) <= 1e-6 * max(size, abs(reverse[i])), i


@pytest.mark.slow
@pytest.mark.parametrize("adjoint", [diffrax.ForwardMode(), diffrax.RecursiveCheckpointAdjoint()])
def test_derivatives_of_the_steady_regime_by_diffrax(adjoint):
    """For a length and the angle at which the load begins: the equation of motion against the quadrature."""
    scene = machine("hay-press-slider")

    def delta(x, road, **options):
        changed = eqx.tree_at(
            lambda s: (s.mechanism.links["rod"].length, window(s).on),
            scene, (scene.mechanism.links["rod"].length * x[0], window(scene).on * x[1]),
        )  # fmt: skip
        return road(changed, **options).delta

    origin = jnp.ones(2)
    known = jax.jit(jax.grad(lambda x: delta(x, steady_motion, nodes=160)))(origin)
    got = jax.jit(lambda x: _sensitivity(lambda x, adjoint: delta(x, steady_by_diffrax, adjoint=adjoint), adjoint, x))
    np.testing.assert_allclose(got(origin), known, rtol=1e-6)


def decaying(x: jax.Array, start: jax.Array, times: np.ndarray) -> tuple[jax.Array, jax.Array]:
    """Speed and angle of a wheel of 0.3 kg m² alone with T = a - b ω - c ε: (J + c) ε = a - b ω."""
    final, pace = x[0] / x[1], x[1] / (0.3 + x[2])
    gone = (start - final) * jnp.exp(-pace * times)
    return final + gone, final * times + (start - final - gone) / pace


@pytest.mark.slow
@pytest.mark.parametrize("over", ["angle", pytest.param("time", marks=pytest.mark.slow)])
def test_a_drive_torque_that_depends_on_speed_and_acceleration(over):
    """With the derivatives by a, b and c."""
    scene = lj.Scene(lj.Mechanism({"O": lj.Vec(0.0, 0.0)}, {"disc": lj.Link(length=0.1, mass=2.0, inertia=0.3)},
                                  (lj.Crank("disc", "O", "E"),)), speed=10.0)  # fmt: skip
    x, times, start = jnp.asarray([6.0, 0.4, 0.2]), np.linspace(0.0, 2.0, 5), jnp.asarray(3.0)
    speeds, angles = decaying(x, start, times)

    def run(x):
        def torque(phi, speed, acceleration):
            return x[0] - x[1] * speed - x[2] * acceleration

        if over == "time":
            found = run_in_time(scene, jnp.asarray(times), jnp.zeros(()), start, torque, adjoint=diffrax.ForwardMode())
            return jnp.stack([found.speed, found.angle])
        found = run_in_angle(scene, angles, start, torque, adjoint=diffrax.ForwardMode())
        return jnp.stack([found.speed, found.time])

    other = angles if over == "time" else times
    value, slope = run(x), jax.jacfwd(run)(x)
    np.testing.assert_allclose(value, np.stack([speeds, other]), rtol=1e-8, atol=1e-9)
    by_speed, by_angle = jax.jacfwd(lambda x: decaying(x, start, times))(x)
    late = -by_angle / speeds[:, None]  # at a fixed angle the time changes by -dφ / ω, and the speed by ε times that
    gain = (x[0] - x[1] * speeds) / (0.3 + x[2])
    known = (by_speed, by_angle) if over == "time" else (by_speed + gain[:, None] * late, late)
    np.testing.assert_allclose(slope, np.stack(known), rtol=1e-6, atol=1e-7)


def test_a_torque_that_is_not_linear_in_the_acceleration():
    """J ε = Q + a - c ε |ε| has a closed form; J ε = Q + c ε² + a has none for a large a: infinite, not a number."""
    inertia, a = 0.3, 5.0
    here = Reduced(jnp.asarray(inertia), jnp.zeros(()), jnp.asarray(2.0), {})
    at = jnp.zeros(()), jnp.ones(())
    for c in (0.01, 0.4, 50.0):
        rate = (-inertia + math.sqrt(inertia**2 + 4 * c * (2.0 + a))) / (2 * c)
        found = torque_at(here, lambda phi, w, e, c=c: a - c * e * jnp.abs(e), *at)
        np.testing.assert_allclose(found, inertia * rate - 2.0, rtol=1e-12)
    assert torque_at(here, lambda phi, w, e: a + 0.4 * e**2, *at) == jnp.inf
    for gain in (0.3, 0.5):  # no effective inertia is left, or a negative one
        assert torque_at(here, lambda phi, w, e, gain=gain: gain * e, *at) == jnp.inf
