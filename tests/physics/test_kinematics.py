# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportIndexIssue=false
# pyright: reportReturnType=false, reportOptionalMemberAccess=false
"""Positions and kinematic coefficients against nested differentiation, 50-digit arithmetic and symmetry."""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from linkjax import RPP, RPR, RRP, RRR, Crank, Guide, Link, Mechanism, Vec
from linkjax._compile import compiled_soon
from linkjax.groups import Gear, General, LinkState, Pinion, PointState, Rack
from linkjax.kinematics import dead_centres, margins, pose, strokes, transmission_angles
from tests.physics import oracle
from tests.physics.machines import ALIKE, BUILT_IN, COMPOSED, PRESCRIBED, machine, mirrored, moved, resized

EVERY = (*BUILT_IN, *COMPOSED, *PRESCRIBED)
MACHINES = [pytest.param(name, marks=pytest.mark.slow) if name in ALIKE else name for name in EVERY]
SOON = [pytest.param(name, marks=pytest.mark.slow) if name in (*ALIKE, "triad") else name for name in EVERY]
ANGLES = np.linspace(-3.0, 9.0, 25)
EPS = np.finfo(float).eps


class Sheet(NamedTuple):
    """Poses over the angles, with the derivatives of the positions by nested forward mode."""

    points: dict[str, PointState]
    links: dict[str, LinkState]
    first: Any
    second: Any
    transmission: dict[str, jax.Array]


@compiled_soon
def sheet(mechanism: Mechanism, phi: jax.Array) -> Sheet:
    def at(phi):
        def place(phi):
            here = pose(mechanism, phi)
            return {n: p.r for n, p in here.points.items()}, {n: link.u for n, link in here.links.items()}

        def slope(phi):
            return jax.jvp(place, (phi,), (jnp.ones_like(phi),))[1]

        here = pose(mechanism, phi)
        first, second = jax.jvp(slope, (phi,), (jnp.ones_like(phi),))
        return Sheet(here.points, here.links, first, second, transmission_angles(mechanism, phi))

    return jax.vmap(at)(phi)


@functools.cache
def computed(name: str) -> Sheet:
    return jax.device_get(sheet(machine(name).mechanism, jnp.asarray(ANGLES)))


def plane(v) -> np.ndarray:
    return np.asarray(v.x) + 1j * np.asarray(v.y)


def close(value, truth, tolerance: float):
    """Equal relative to the largest magnitude over the cycle."""
    value, truth = np.asarray(value), np.asarray(truth)
    size = np.max(np.abs(truth))
    assert np.max(np.abs(value - truth)) <= tolerance * size


@pytest.mark.parametrize("name", SOON)
def test_coefficients_are_derivatives_of_the_position(name):
    got = computed(name)
    (points, links), (points2, links2) = got.first, got.second
    for p, state in got.points.items():
        if p in machine(name).mechanism.fixed:
            assert not np.any(plane(state.dr)) and not np.any(plane(state.ddr))
            continue
        close(plane(state.dr), plane(points[p]), 1e-13)
        close(plane(state.ddr), plane(points2[p]), 1e-12)
    for name, state in got.links.items():
        u, du, ddu = plane(state.u), plane(links[name]), plane(links2[name])
        np.testing.assert_allclose(np.abs(u), 1.0, atol=4 * EPS)
        scale = 1 + np.max(np.abs(state.w)) ** 2
        np.testing.assert_allclose(state.w, (u.conjugate() * du).imag, atol=1e-13 * scale)
        np.testing.assert_allclose(state.e, (u.conjugate() * ddu).imag, atol=1e-12 * scale)


@pytest.mark.parametrize("name", MACHINES)
def test_coefficients_against_50_digits(name):
    got = computed(name)
    truth = [oracle.exact(machine(name).mechanism, phi) for phi in ANGLES]
    for p, state in got.points.items():
        for i, part in enumerate((state.r, state.dr, state.ddr)):
            exact = [complex(t.points[p][i]) for t in truth]
            if any(exact):
                close(plane(part), exact, 1e-12)
            else:
                assert not np.any(plane(part))
    for link, state in got.links.items():
        for i, part in enumerate((plane(state.u), state.w, state.e)):
            exact = np.asarray([complex(t.links[link][i]) for t in truth])
            np.testing.assert_allclose(part, exact, atol=1e-12 * max(1.0, np.max(np.abs(exact))))


@pytest.mark.parametrize("name", MACHINES)
def test_transmission_angles(name):
    """Angle between the two links; between the rod, or the line from pivot to pin, and the normal of the guide."""
    got, mechanism = computed(name), machine(name).mechanism
    directions = oracle.assemble(mechanism, ANGLES)[1]
    seen = 0
    for g in mechanism.groups[1:]:
        if isinstance(g, General | Gear | Rack | Pinion):
            continue
        one, two = g.link_names()
        turn = directions[two] / directions[one]
        truth = np.abs(np.angle(turn))
        if isinstance(g, RRP):  # from the left normal of the guide: 90 degrees when the rod is along it
            truth = np.abs(np.angle(directions[one] / (1j * directions[two])))
        if isinstance(g, RPP | RRP) and g.guide.on != "frame":
            assert np.ptp(np.angle(directions[two])) > 0.1
        if isinstance(g, RPR):  # from the left normal of the lever: 90 degrees where the pin is on its axis
            points = oracle.assemble(mechanism, ANGLES)[0]
            truth = np.abs(np.angle((points[g.from_] - points[g.about]) / (1j * directions[one])))
        np.testing.assert_allclose(got.transmission["-".join((one, two))], truth, atol=1e-12)
        seen += 1
    assert seen == len(got.transmission) > 0


@pytest.mark.parametrize(
    "name", ["hay-press", "coupler-points", "clockwise", "slotted-levers", "moving-guides", "hydraulic"]
)
def test_mirror_image(name):
    """Rotation in the opposite sense is the mirror image."""
    got = computed(name)
    image = jax.device_get(sheet(mirrored(machine(name).mechanism), jnp.asarray(ANGLES)))
    for p, state in got.points.items():
        for one, two in zip(state, image.points[p], strict=True):
            np.testing.assert_allclose(plane(two), plane(one).conjugate(), atol=1e-15)
    for link, state in got.links.items():
        np.testing.assert_allclose(plane(image.links[link].u), plane(state.u).conjugate(), atol=4 * EPS)
        np.testing.assert_allclose(image.links[link].w, -state.w, rtol=1e-13, atol=1e-15)
        np.testing.assert_allclose(image.links[link].e, -state.e, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", SOON)
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_scale(name, factor):
    got = computed(name)
    other = jax.device_get(sheet(resized(machine(name), factor).mechanism, jnp.asarray(ANGLES)))
    for p, state in got.points.items():
        for one, two in zip(state, other.points[p], strict=True):
            np.testing.assert_allclose(plane(two), factor * plane(one), atol=1e-12 * factor)
    for link, state in got.links.items():
        np.testing.assert_allclose(other.links[link].w, state.w, atol=1e-12)
        np.testing.assert_allclose(other.links[link].e, state.e, atol=1e-11)


@pytest.mark.parametrize("name", SOON)
def test_translation_of_the_frame(name):
    """Elsewhere on the frame all results are the same, with fewer digits because of the large coordinates."""
    away = (300.0, -70.0)
    got, there = computed(name), moved(machine(name).mechanism, *away)
    other = jax.device_get(sheet(there, jnp.asarray(ANGLES)))
    lost = 300 * EPS
    condition = 30 * max(1.0, *(float(np.max(np.abs(link.e))) for link in got.links.values())) ** 2
    for p, state in got.points.items():
        np.testing.assert_allclose(plane(other.points[p].r), plane(state.r) + complex(*away), atol=condition * lost)
        np.testing.assert_allclose(plane(other.points[p].dr), plane(state.dr), atol=condition * lost)
        np.testing.assert_allclose(plane(other.points[p].ddr), plane(state.ddr), atol=10 * condition * lost)


DEAD = ("stretched", "folded", "folded with the second link longer", "left", "right", "one to a million")


def near_dead(case: str, distance: float, phi: float) -> Mechanism:
    """A machine whose dyad is this close to a singular position (a fraction of its length) at the crank angle `phi`."""
    crank = Link(length=0.13)
    pin = 0.13 * complex(math.cos(phi), math.sin(phi))
    if case in ("left", "right"):
        along, height = 0.3, (0.09 if case == "left" else -0.09)
        length = abs(height) / (1 - distance)
        offset = (pin * complex(math.cos(along), -math.sin(along))).imag - height
        group = RRP("rod", "block", "B", "D", Guide("A", along, offset))
        links = {"crank": crank, "rod": Link(length=length), "block": Link()}
        return Mechanism({"A": Vec(0.0, 0.0)}, links, [Crank("crank", "A", "B"), group])
    far = complex(0.41, -0.07)
    r = abs(far - pin)
    if case == "stretched":  # (l1 + l2 - r) / (l1 + l2) = distance
        one = 0.4 * r
        two = r / (1 - distance) - one
    elif case == "folded":  # (r - l1 + l2) / (l1 + l2) = distance
        one = 1.7 * r
        two = (one * (1 + distance) - r) / (1 - distance)
    elif case == "folded with the second link longer":
        two = 1.6 * r
        one = (two * (1 + distance) - r) / (1 - distance)
    else:  # a second link so short that both margins are below 1e-6
        one, two = r * (1 + (1 - distance) * 1e-6), r * 1e-6
    links = {"crank": crank, "one": Link(length=one), "two": Link(length=two)}
    fixed = {"A": Vec(0.0, 0.0), "F": Vec(far.real, far.imag)}
    return Mechanism(fixed, links, [Crank("crank", "A", "B"), RRR(("one", "two"), "B", "F", "G", 1)])


def parts(mechanism: Mechanism, points, directions) -> list:
    """Coordinates of the dyad's pin, then the components of its links' directions (complex arguments)."""
    last = mechanism.groups[-1]
    if isinstance(last, RRP):
        found = points[last.end], directions[last.link]
    else:
        assert isinstance(last, RRR)
        found = points[last.meet], *(directions[name] for name in last.links)
    return [part for z in found for part in (z.real, z.imag)]


@pytest.mark.parametrize("case", DEAD)
def test_errors_near_a_dead_position_are_those_of_the_problem(case):
    """At most ten times the effect of half a rounding unit in every number of the design, the angle and the result."""
    values = jax.jit(lambda m, phi: (pose(m, phi), margins(m, phi)))
    phi = 0.83
    for exponent in range(2, 8 if case == "one to a million" else 13):
        distance = 10.0**-exponent
        mechanism = near_dead(case, distance, phi)
        here, nearness = jax.device_get(values(mechanism, jnp.asarray(phi)))
        if case != "one to a million":
            assert list(nearness.values())[-1][case.split()[0]].value == pytest.approx(distance, rel=1e-9, abs=2e-15)
        points = {name: complex(p.r.x, p.r.y) for name, p in here.points.items()}
        got = parts(mechanism, points, {name: complex(link.u.x, link.u.y) for name, link in here.links.items()})
        with mpmath.workdps(50):
            leaves, rebuild = jax.tree.flatten(mechanism)
            leaves = [mpmath.mpf(float(leaf)) for leaf in leaves]

            def truth(angle, leaves, mechanism=mechanism, rebuild=rebuild):
                return parts(mechanism, *oracle.assemble(rebuild.unflatten(leaves), angle, mpmath))

            angle, nudge = mpmath.mpf(phi), 1 + mpmath.mpf(distance) * mpmath.mpf("1e-12")
            exact = truth(angle, leaves)
            others = [truth(angle * nudge, leaves)]
            others += [truth(angle, [*leaves[:i], leaf * nudge, *leaves[i + 1 :]]) for i, leaf in enumerate(leaves)]
            felt = [sum(abs(o[k] - e) for o in others) / (nudge - 1) for k, e in enumerate(exact)]
            errors = [abs(g - e) for g, e in zip(got, exact, strict=True)]
        for k, (error, condition) in enumerate(zip(errors, felt, strict=True)):
            size = abs(complex(*exact[k - k % 2 : k - k % 2 + 2]))
            assert error <= 10 * (EPS / 2) * (float(condition) + size), (distance, k)


@pytest.mark.parametrize("name", ["hay-press", "four-bar", "two-on-one-crank", "clockwise"])
def test_dead_centres(name):
    """Where sliders and rockers stop: sign changes on a fine scan, bisected; strokes as integrals of the speed."""
    mechanism = machine(name).mechanism
    found = compiled_soon(dead_centres)(mechanism)
    covered = compiled_soon(strokes)(mechanism, found)
    found = jax.device_get(found)
    begin = -0.1
    scan = np.linspace(begin, begin + 2 * np.pi, 2001)
    expected = set()
    for g in mechanism.groups[1:]:
        for link, (origin, _) in g.pins().items():
            slides = isinstance(g, RRP) and link == g.block
            if not slides and origin not in mechanism.fixed:
                continue

            def speed(phi, slides=slides, link=link, origin=origin):
                here = oracle.rates(mechanism, np.atleast_1d(phi))
                v = (here.points[origin].v / here.links[link].r).real if slides else here.links[link].v
                return v if np.ndim(phi) else float(v[0])

            v = speed(scan)
            truth = [brentq(speed, scan[i], scan[i + 1], xtol=1e-14) for i in np.flatnonzero(v[1:] * v[:-1] < 0)]
            key = origin if slides else link
            expected.add(key)
            got = found[key].angle[found[key].present & (found[key].distance < 1e-6)]
            got = np.sort(begin + np.mod(got - begin, 2 * np.pi))
            assert not found[key].overflow and len(truth) >= 2
            np.testing.assert_allclose(got, truth, atol=1e-11)
            ways = [quad(speed, *ends, epsabs=1e-13, epsrel=1e-13)[0] for ends in itertools.pairwise(truth)]
            assert float(covered[key]) == pytest.approx(np.ptp(np.cumsum([0.0, *ways])), rel=1e-12)
    assert set(found) == set(covered) == expected
