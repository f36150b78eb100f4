# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportIndexIssue=false
# pyright: reportReturnType=false, reportOptionalMemberAccess=false
"""Forces against the Newton-Euler equations of all links simultaneously, momentum, virtual power, and brute force."""

from __future__ import annotations

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.forces import Forces, kinetostatics, other_sides
from linkjax.measures import peak_names
from tests.physics import newton_euler, oracle
from tests.physics.machines import ALIKE, BUILT_IN, COMPOSED, PRESCRIBED, machine

EVERY = (*BUILT_IN, *COMPOSED, *PRESCRIBED)
MACHINES = [pytest.param(name, marks=pytest.mark.slow) if name in ALIKE else name for name in EVERY]
ANGLES = np.radians(np.arange(12) * 30.0 + 7.0)
STATES = {"constant speed": (1.0, 0.0), "speeding up": (0.8, 0.6), "slowing down": (1.1, -0.9)}  # times ω, ω²


@compiled_soon
def forces_at(scene, phi, speed, acceleration, side) -> Forces:
    return jax.vmap(lambda *at: kinetostatics(scene, *at))(phi, speed, acceleration, side)


def forces(scene, phi, speed, acceleration, side=None) -> Forces:
    phi = np.asarray(phi, dtype=float)
    every = (np.broadcast_to(x, phi.shape) for x in (phi, speed, acceleration, phi if side is None else side))
    return jax.device_get(forces_at(scene, *(jnp.asarray(x, dtype=float) for x in every)))


def states(name: str):
    """Crank angles, speeds and accelerations: every angle in every state."""
    w = float(machine(name).speed)
    parts = [(ANGLES, np.full_like(ANGLES, a * w), np.full_like(ANGLES, b * w * w)) for a, b in STATES.values()]
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


@functools.cache
def computed(name: str) -> Forces:
    return forces(machine(name), *states(name))


@functools.cache
def truth(name: str) -> newton_euler.Solution:
    return newton_euler.solve(machine(name), *states(name))


def plane(f) -> np.ndarray:
    return np.asarray(f.fx) + 1j * np.asarray(f.fy)


def largest(name: str) -> float:
    return max(float(np.max(np.abs(force))) for force, _ in truth(name).reactions.values())


@pytest.mark.parametrize("name", MACHINES)
def test_newton_euler(name):
    got, known = computed(name), truth(name)
    size = largest(name)
    assert {(joint, link) for joint, sides in got.reactions.items() for link in sides} == set(known.reactions)
    for (joint, link), (force, moment) in known.reactions.items():
        np.testing.assert_allclose(plane(got.reactions[joint][link]), force, rtol=0, atol=1e-12 * size)
        reach = max(1e-9, np.max(np.abs(moment)))
        np.testing.assert_allclose(got.reactions[joint][link].moment, moment, rtol=0, atol=1e-11 * reach)
    np.testing.assert_allclose(got.drive_torque, known.drive, rtol=0, atol=1e-12 * np.max(np.abs(known.drive)))


@pytest.mark.parametrize("name", MACHINES)
def test_virtual_power(name):
    """The drive torque is that of the energy balance of the whole machine."""
    phi, speed, acceleration = states(name)
    reduced = oracle.reduction(machine(name), phi)
    parts = reduced.inertia * acceleration, 0.5 * reduced.slope * speed**2, -reduced.torque
    size = np.max(sum(np.abs(part) for part in parts))
    np.testing.assert_allclose(computed(name).drive_torque, sum(parts), rtol=0, atol=1e-12 * size)


@pytest.mark.parametrize("name", MACHINES)
def test_shaking_is_the_loss_of_momentum(name):
    """Force and moment about the crank pivot, from differences of momentum and angular momentum."""
    scene, (phi, speed, acceleration) = machine(name), states(name)
    mechanism = scene.mechanism
    about = oracle.rates(mechanism, phi).points[mechanism.groups[0].needs()[0]].r

    def momentum(phi):
        here = oracle.rates(mechanism, phi)
        linear, angular = 0j, float(mechanism.flywheel.inertia) * here.links[mechanism.driving_link].v
        for link, b in oracle.numbers(mechanism).bodies.items():
            s = here.points[next(iter(b.places))]
            linear = linear + b.mass * s.v
            angular = angular + b.mass * ((s.r - about).conjugate() * s.v).imag + b.inertia * here.links[link].v
        return np.stack([linear.real, linear.imag, angular])

    h = 1e-3
    slope = (8 * (momentum(phi + h) - momentum(phi - h)) - momentum(phi + 2 * h) + momentum(phi - 2 * h)) / (12 * h)
    loss = -(slope * speed**2 + momentum(phi) * acceleration)
    got = computed(name).shaking
    for value, known in zip((got.fx, got.fy, got.moment), loss, strict=True):
        np.testing.assert_allclose(value, known, rtol=0, atol=1e-8 * np.max(np.abs(loss)))


@pytest.mark.parametrize("name", MACHINES)
def test_what_the_frame_feels(name):
    """Sum of the reactions of the frame; shaking + weight + loads; and without loads that react on the frame."""
    scene, (phi, _, _) = machine(name), states(name)
    got, known, mechanism = computed(name), truth(name), scene.mechanism
    here = oracle.rates(mechanism, phi)
    about = here.points[mechanism.groups[0].needs()[0]].r

    def cross(point, force):
        return ((here.points[point].r - about).conjugate() * force).imag if point else 0.0

    force, moment = 0j, 0.0
    for j in newton_euler.joints(mechanism):
        if j.by == "frame":
            one, couple = known.reactions[j.name, j.link]
            force, moment = force - one, moment - couple - cross(j.point, one)
    size, reach = largest(name), np.max(np.abs(moment)) + np.max(np.abs(known.drive))
    np.testing.assert_allclose(plane(got.frame), force, rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(got.frame.moment, moment, rtol=0, atol=1e-11 * reach)
    applied = oracle.applied(scene, phi, here)
    weight = [part for key, part in applied.items() if key.startswith("weight of ")]
    loads = [applied[load.name] for load in scene.loads]
    own = [applied[load.name] for load in scene.loads if load.reacts_on == "frame"]
    total = got.shaking
    for value, group in ((got.weight, weight), (got.loads, loads)):
        np.testing.assert_allclose(plane(value), sum(f for _, _, f, _ in group) + 0 * phi, rtol=0, atol=1e-12 * size)
        couple = sum(c + cross(p, f) for _, p, f, c in group)
        np.testing.assert_allclose(value.moment, couple + 0 * phi, rtol=0, atol=1e-12 * reach)
        total = type(total)(*(a + b for a, b in zip(total, value, strict=True)))
    np.testing.assert_allclose(plane(got.frame), plane(total), rtol=0, atol=1e-12 * size)
    turns = 0 if mechanism.prescribed else mechanism.groups[0].sense  # the drive of a law is a joint of the frame
    np.testing.assert_allclose(got.frame.moment, total.moment + turns * got.drive_torque, rtol=0, atol=1e-11 * reach)
    net = plane(got.frame) - sum(f for _, _, f, _ in own)
    np.testing.assert_allclose(plane(got.net_frame), net, rtol=0, atol=1e-12 * size)
    couple = got.frame.moment - sum(c + cross(p, f) for _, p, f, c in own)
    np.testing.assert_allclose(got.net_frame.moment, couple, rtol=0, atol=1e-11 * reach)


@pytest.mark.parametrize("name", MACHINES)
def test_action_and_reaction(name):
    """Away from the frame the sum of the forces at a joint is zero, and both links of each force are named."""
    by, got = other_sides(machine(name)), computed(name).reactions
    assert {j: set(sides) for j, sides in by.items()} == {j: set(sides) for j, sides in got.items()}
    expected: dict[str, dict[str, set[str]]] = {}
    for j in newton_euler.joints(machine(name).mechanism):
        expected.setdefault(j.name, {}).setdefault(j.link, set()).add(j.by)
        if j.by != "frame":
            expected[j.name].setdefault(j.by, set()).add(j.link)
    assert {j: {link: set(b.split("+")) for link, b in sides.items()} for j, sides in by.items()} == expected
    inner = 0
    for joint, sides in got.items():
        if "frame" not in by[joint].values():
            inner += 1
            rest = sum(plane(f) for f in sides.values())
            assert np.max(np.abs(rest)) <= 1e-13 * largest(name)
    assert inner


def test_guide_couple():
    """The mass centre of the piston is ahead of its pin: the guide balances the moment of its weight, nothing else."""
    scene = machine("slider-crank")
    piston = scene.mechanism.links["piston"]
    couple = computed("slider-crank").reactions["piston.guide"]["piston"].moment
    held = float(piston.centre.x) * float(piston.mass) * -float(scene.gravity.y)
    assert held > 0.1
    np.testing.assert_allclose(couple, held, rtol=1e-12)


def reversal(name: str) -> tuple[float, float]:
    """Crank angle where the slider with an active opposing load stops, and the size of the load."""
    scene = machine(name)
    load = next(load for load in scene.loads if load.opposing and load.point)
    guide = next(g.guide for g in scene.mechanism.groups if getattr(g, "end", "") == load.point and g.kind == "RRP")

    def speed(phi):
        here = oracle.rates(scene.mechanism, np.atleast_1d(phi))
        return (here.points[load.point].v / np.exp(1j * float(guide.along))).real

    scan = np.linspace(0.01, 2 * math.pi - 0.01, 400)
    v, on = speed(scan), oracle.active(load, scan, scene.cycle)
    i = np.flatnonzero((v[1:] * v[:-1] < 0) & (on[1:] * on[:-1] > 0))[0]
    return brentq(lambda phi: speed(phi)[0], scan[i], scan[i + 1], xtol=1e-15), float(load.magnitude)


@pytest.mark.parametrize(
    ("name", "kind"),
    [("hay-press", "window"), ("four-bar", "window"), ("hay-press-slider", "reversal"), ("clockwise", "reversal")],
)
def test_limits_at_a_jump(name, kind):
    """At a jump: the right-hand limit; the left-hand limit on request."""
    scene, w = machine(name), float(machine(name).speed)
    if kind == "window":
        load = next(load for load in scene.loads if load.window is not None)
        at, jump = float(load.window.on), float(load.magnitude)
    else:
        at, jump = reversal(name)
    near = 1e-4 * np.asarray([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
    both = forces(scene, at + near, w, 0.0)
    here = forces(scene, [at, at], w, 0.0, side=[at - 0.01, at + 0.01])
    plain = forces(scene, [at, at], w, 0.0)
    known = newton_euler.solve(scene, at + near, np.full(6, w), np.zeros(6))
    size = largest(name)
    to_jump = np.asarray([[1.0, -3.0, 3.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 3.0, -3.0, 1.0]])  # extrapolates each side
    gap = 0.0
    for (joint, link), (force, _) in known.reactions.items():
        np.testing.assert_allclose(plane(both.reactions[joint][link]), force, rtol=0, atol=1e-10 * size)
        limits = to_jump @ force
        np.testing.assert_allclose(plane(here.reactions[joint][link]), limits, rtol=0, atol=1e-8 * size)
        np.testing.assert_allclose(plane(plain.reactions[joint][link]), limits[[1, 1]], rtol=0, atol=1e-8 * size)
        gap = max(gap, abs(limits[1] - limits[0]))
    assert gap > 0.1 * jump


@pytest.mark.parametrize("name", lj.scene_names())
def test_every_peak_has_a_name_of_its_own(name):
    """Also where four links are joined at a pin, each of which may carry it."""
    names = peak_names(lj.load(name))
    assert len(set(names)) == len(names)


def magnitudes(scene, phi, speed, acceleration) -> np.ndarray:
    """Everything with a reported peak, rows in the order of `peak_names`, from the Newton-Euler equations: sizes, and
    for the largest value the number with its sign, for the smallest its opposite."""
    known, mechanism = newton_euler.solve(scene, phi, speed, acceleration), scene.mechanism
    here = oracle.rates(mechanism, phi)
    about = here.points[mechanism.groups[0].needs()[0]].r
    moment = 0.0
    for name, b in oracle.numbers(mechanism).bodies.items():
        s = here.points[next(iter(b.places))]
        moment = moment + ((s.r - about).conjugate() * known.momentum_rate[name]).imag + known.spin_rate[name]
    frame = sum(known.reactions[j.name, j.link][0] for j in newton_euler.joints(mechanism) if j.by == "frame")
    found = {"shaking_force": sum(known.momentum_rate.values()), "frame_force": frame}
    found |= {"shaking_moment": -moment, "drive_torque": known.drive}
    own = [load.name for load in scene.loads if load.reacts_on == "frame"]
    acting = oracle.applied(scene, phi, here)
    found["net_frame_force"] = frame + sum(acting[name][2] for name in own)
    found |= {f"reaction.{joint}.{link}": force for (joint, link), (force, _) in known.reactions.items()}
    rows = []
    for way, _, name in (each.partition("_") for each in peak_names(scene)):
        value = found[name] + 0 * phi
        rows.append({"peak": np.abs(value), "max": value.real, "min": -value.real}[way])
    return np.stack(rows)


@pytest.mark.parametrize("name", [n if n == "slider-crank" else pytest.param(n, marks=pytest.mark.slow) for n in EVERY])
def test_peaks_and_checks(name):
    """Suprema over 20 000 angles and both sides of every jump, with a finer search around the highest."""
    scene = machine(name)
    cycle = lj.analyse(scene, angles=24)
    for check in (cycle.checks.virtual_power, cycle.checks.energy_closure, cycle.checks.force_balance):
        assert float(check) <= 1e-10
    crank = jax.jit(jax.vmap(lambda phi: cycle.steady.at(scene, cycle.steady.grid.place(phi))))
    scan = np.linspace(0.0, scene.cycle, 20_000, endpoint=False)
    edges = np.concatenate([oracle.jumps(scene) - 1e-10, oracle.jumps(scene) + 1e-10])
    opposite = np.asarray([-1.0 if each.startswith("min") else 1.0 for each in peak_names(scene)])
    for peak, constant in ((cycle.peaks, False), (cycle.peaks_constant_speed, True)):

        def sizes(phi, constant=constant):
            if constant:
                return magnitudes(scene, phi, np.full_like(phi, float(scene.speed)), np.zeros_like(phi))
            return magnitudes(scene, phi, *(np.asarray(x) for x in crank(jnp.asarray(phi))))

        coarse = sizes(np.concatenate([scan, edges]))
        tops = np.concatenate([scan, edges])[np.argmax(coarse, axis=1)]
        fine = sizes((tops[:, None] + np.linspace(-1, 1, 401) * scan[1]).ravel()).reshape((len(tops), len(tops), 401))
        known = np.maximum(coarse.max(axis=1), np.diagonal(fine).max(axis=0))
        assert peak.value.shape == known.shape
        # at a reversal the load has the direction of a speed of 1e-9: accurate to eight digits
        value = opposite * np.asarray(peak.value)
        np.testing.assert_allclose(value, known, rtol=1e-8)
        assert np.all(np.abs(value - known) <= np.asarray(peak.error) + 1e-8 * np.abs(known))
        at = np.asarray(peak.angle)
        there = np.max([np.diagonal(sizes(at + side)) for side in (-1e-9, 1e-9)], axis=0)
        np.testing.assert_allclose(there, known, rtol=1e-6)
