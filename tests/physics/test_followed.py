"""How far groups of higher class can be followed: against a fine continuation in NumPy independent of linkjax, and
against the closed form of four-bars whose ranges have narrow gaps or are narrow themselves."""

from __future__ import annotations

import cmath
import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import Crank, Flywheel, Gear, Link, Mechanism, Teeth, Vec
from linkjax._compile import compiled_soon
from linkjax.groups import General
from linkjax.kinematics import Prepared, crank_ranges, min_margin, pose, prepared
from tests.physics.test_folds import STEP, beyond, ends, four_bar, least, places

LONGEST = 4 * math.pi  # rad that the continuation goes on either side
WIDEST = 5e-3  # rad: its steps


class Made(NamedTuple):
    """A machine, the closure errors for its coordinates at a crank angle (and their derivatives with respect to these),
    coordinates at crank angle zero, and the link whose angle is the last of them."""

    mechanism: Mechanism
    closure: Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]
    start: np.ndarray
    link: str


def point(z: complex) -> Vec:
    return Vec(z.real, z.imag)


def triad(crank: float, phase: float, pivots: tuple[complex, complex], corners: tuple[complex, ...]) -> Made:
    """A plate on three legs, one of them on the crank, at crank angle zero."""
    ends = crank * cmath.exp(1j * phase), *pivots
    legs = [abs(corner - end) for corner, end in zip(corners, ends, strict=True)]
    axis = corners[1] - corners[0]
    inside = [(corner - corners[0]) / (axis / abs(axis)) for corner in corners]
    links = {name: Link(length=leg) for name, leg in zip(("one", "two", "three"), legs, strict=True)}
    links |= {"crank": Link(length=crank), "plate": Link(length=abs(axis), points={"R": point(inside[2])})}
    members = ("plate", ("P", "Q", "R")), ("one", ("B", "P")), ("two", ("D", "Q")), ("three", ("E", "R"))
    group = General(members, ("B", "D", "E"), dict(zip("PQR", map(point, corners), strict=True)))
    fixed = {"A": Vec(0.0, 0.0), "D": point(pivots[0]), "E": point(pivots[1])}

    def closure(x, phi):
        gap, rows = on_legs(x, (crank * cmath.exp(1j * (phase + phi)), *pivots), inside, legs)
        return np.asarray(gap), np.asarray(rows)

    start = np.asarray([corners[0].real, corners[0].imag, cmath.phase(axis)])
    return Made(Mechanism(fixed, links, [Crank("crank", "A", "B", phase=phase), group]), closure, start, "plate")


def on_legs(x, hinges, inside, legs) -> tuple[list[float], list[list[float]]]:
    """Closure errors of the legs of a plate with its first corner at x[0], x[1], turned by x[2], and derivatives."""
    turn = cmath.exp(1j * x[2])
    rods = [x[0] + 1j * x[1] + at * turn - hinge for at, hinge in zip(inside, hinges, strict=True)]
    gap = [abs(rod) ** 2 - leg**2 for rod, leg in zip(rods, legs, strict=True)]
    moves = [(1.0, 1j, 1j * at * turn) for at in inside]
    return gap, [[2 * (rod.conjugate() * d).real for d in each] for rod, each in zip(rods, moves, strict=True)]


def planet(lengths: tuple[float, float, float], pivot: complex, teeth: int, angles: tuple[float, float, float]) -> Made:
    """A five-bar whose third link is a gear on the coupler in mesh with the crank, pinned at both ends."""
    ratio, (crank, coupler, wheel) = -teeth / 20, lengths
    phase = angles[2] - angles[1] - ratio * (angles[0] - angles[1])
    b = crank * cmath.exp(1j * angles[0])
    c = b + coupler * cmath.exp(1j * angles[1])
    e = c + wheel * cmath.exp(1j * angles[2])
    last = abs(e - pivot)
    links = {"crank": Link(length=crank), "coupler": Link(length=coupler), "one": Link(length=wheel)}
    links["last"] = Link(length=last)
    gear = Gear("one", "C", Teeth((20, teeth)), "crank", "B", phase=phase, carrier="coupler")
    members = ("coupler", ("B", "C")), ("one", ("C", "E")), ("last", ("D", "E"))
    group = General(members, ("B", "D"), {"C": point(c), "E": point(e)}, gears=(gear,))

    def closure(x, phi):
        at = angles[0] + phi
        third = phase + x[0] + ratio * (at - x[0])
        arms = crank * cmath.exp(1j * at), coupler * cmath.exp(1j * x[0]), wheel * cmath.exp(1j * third)
        rod = sum(arms) - pivot
        slope = 2 * (rod.conjugate() * 1j * (arms[1] + (1 - ratio) * arms[2])).real
        return np.asarray([abs(rod) ** 2 - last**2]), np.asarray([[slope]])

    fixed = {"A": Vec(0.0, 0.0), "D": point(pivot)}
    driver = Crank("crank", "A", "B", phase=angles[0])
    return Made(Mechanism(fixed, links, [driver, group]), closure, np.asarray([angles[1]]), "coupler")


def followed(made: Made, way: float) -> tuple[float, dict[float, np.ndarray]]:
    """The range on one side (rad), infinite if it is long, and its coordinates on the way: by small steps that are
    halved if Newton's method does not close, jumps, or changes the sign of the Jacobian."""
    x, before, phi, last, step, seen = made.start, None, 0.0, 0.0, WIDEST, {}
    sense = np.sign(np.linalg.det(made.closure(x, 0.0)[1]))
    while step > 1e-9:
        if abs(phi) > LONGEST:
            return math.inf, seen
        at = phi + way * step
        y = x if before is None else x + (x - before) * step / last
        for _ in range(8):
            gap, matrix = made.closure(y, at)
            if np.linalg.det(matrix) == 0:
                break
            y = y - np.linalg.solve(matrix, gap)
        gap, matrix = made.closure(y, at)
        if np.max(np.abs(gap)) < 1e-12 and np.max(np.abs(y - x)) < 0.1 and np.sign(np.linalg.det(matrix)) == sense:
            x, before, phi, last, step = y, x, at, step, min(2 * step, WIDEST)
            if len(seen) < 2 or abs(phi - max(seen, key=abs)) > 0.05:
                seen[phi] = x
        else:
            step /= 2
    return phi, {**seen, phi: x}


def drawn(rng: np.random.Generator, wheel: bool) -> Made:
    if wheel:
        crank, coupler, third = 10 ** rng.uniform(-0.7, 0, 3)
        pivot, teeth = complex(*rng.uniform(-1, 1, 2)), int(rng.choice([20, 40, 60]))
        first, second, last = rng.uniform(-3, 3, 3)
        return planet((crank, coupler, third), pivot, teeth, (first, second, last))
    d, e, *corners = [complex(*rng.uniform(-1, 1, 2)) for _ in range(5)]
    return triad(10 ** rng.uniform(-1, -0.2), rng.uniform(-3, 3), (d, e), tuple(corners))


# its Jacobian's least singular value falls to 3e-3 of its usual size, and not further; its range is longer than a
# turn
NEARLY = triad(
    0.2893764517344917,
    0.0812154470454618,
    (0.2552414679827295 + 0.1011863735245293j, -0.3263341261111028 + 0.28315834925836025j),
    (
        -0.8332169505921887 - 0.041961147073588556j,
        -0.09435639633549409 - 0.5735392595387565j,
        0.13617654665421663 + 0.3398386411132117j,
    ),
)


@compiled_soon(static=("link",))
def angles_of(mechanism: Mechanism | Prepared, link: str, at: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Angles of a link (rad), and the least margin."""

    def one(phi):
        u = pose(mechanism, phi).links[link].u
        return jnp.atan2(u.y, u.x), least(mechanism, phi)

    return jax.vmap(one)(at)


@pytest.mark.slow
@pytest.mark.parametrize("wheel", [False, True])
def test_ranges_of_random_machines(rng, wheel):
    """Ends of ranges to 1e-6 rad, also of those longer than a turn; positions in between; and no limited range is
    reported as a full rotation."""
    longer = 0
    for made in [*(drawn(rng, wheel) for _ in range(24)), *([] if wheel else [NEARLY])]:
        (low, below), (high, above) = (followed(made, way) for way in (-1.0, 1.0))
        found = crank_ranges(made.mechanism)[0]
        assert bool(found.at_start) == math.isfinite(low + high)
        if not found.at_start:
            continue
        longer += high - low > 2 * math.pi
        np.testing.assert_allclose((found.start, found.stop), (low, high), atol=1e-6)
        assert float(min_margin(made.mechanism)) < 0
        first = max(low, high - 2 * math.pi + 2 * STEP)  # the longest range that the path over one turn can store
        seen = {at: x for at, x in {**below, **above}.items() if first + 1e-3 < at < min(high, 2 * math.pi) - 1e-3}
        at = np.resize(list(seen), 256)
        found, margin = angles_of(prepared(made.mechanism), link=made.link, at=jnp.asarray(at))
        off = np.asarray(found) - np.asarray([seen[each][-1] for each in at])
        assert np.max(np.abs(np.sin(0.5 * off))) < 1e-9
        assert np.min(margin) > 0
    assert wheel or longer


def gap(width: float, at: float) -> tuple[float, ...]:
    """A four-bar that folds over a gap of this width (rad), at a crank angle."""
    a, d = 0.13, 0.416
    b = 1.7 * math.sqrt((d - a) ** 2 + 4 * a * d * math.sin(width / 4) ** 2)
    return a, b, b / 1.7 * 0.7, d, -at


def gaps(fold: float, stretch: float, at: float) -> tuple[float, ...]:
    """One that folds over a gap of this width (rad) at a crank angle, and stretches over another half a turn later."""
    a, d = 0.13, 0.416
    near = math.sqrt((d - a) ** 2 + 4 * a * d * math.sin(fold / 4) ** 2)
    far = math.sqrt((d + a) ** 2 - 4 * a * d * math.sin(stretch / 4) ** 2)
    return a, (far + near) / 2, (far - near) / 2, d, -at


def island(half: float, middle: float) -> tuple[float, ...]:
    """One that can be assembled within half this width (rad) on either side of a crank angle."""
    a, d = 0.13, 0.416
    reach = math.sqrt((d - a) ** 2 + 4 * a * d * math.sin(half / 2) ** 2)
    return a, 0.6 * reach, 0.4 * reach, d, -middle


FOUR_BARS = {
    "gap 0.7 degrees, before zero": gap(0.012, -0.97 * STEP),
    "gap 0.3 degrees, between places": gap(5e-3, -2.5 * STEP),
    "gap 0.3 degrees, behind zero": gap(5e-3, 0.5 * STEP),
    "gap 1 mrad, before zero": gap(1e-3, -0.97 * STEP),
    "gap 0.5 mrad": gap(5e-4, 57.13 * STEP),
    "gap 0.2 mrad": gap(2e-4, 57.5 * STEP),
    "two gaps of 0.6 degrees": gaps(0.01, 0.01, 1.5 * STEP),
    "two gaps, 2 mrad and 6 degrees": gaps(2e-3, 0.1, 57.1 * STEP),
    "range 0.4 degrees": island(0.2 * STEP, 0.0),
    "range 0.8 degrees": island(0.4 * STEP, 0.5 * 0.4 * STEP),
    "range 1.8 degrees": island(0.9 * STEP, -0.9 * 0.9 * STEP),
    "range 3 degrees": island(1.6 * STEP, 0.0),
    "range 7 degrees": island(3.3 * STEP, 0.5 * 3.3 * STEP),
}


@pytest.mark.slow
@pytest.mark.parametrize("numbers", FOUR_BARS.values(), ids=FOUR_BARS)
def test_narrow_gaps_and_narrow_ranges(numbers):
    """The range about crank angle zero as in closed form, positions in it, no wrong position reported as assembled; and
    an analysis reports that the crank cannot rotate fully."""
    closed, general = four_bar(numbers, False), four_bar(numbers, True)
    (first, *_), found = ends(closed), ends(general)
    assert first[0] < 0 < first[1]
    np.testing.assert_allclose(found, [first], atol=1e-9)
    inside = np.linspace(*first, 402)[1:-1]
    at = jnp.asarray(np.concatenate([inside, np.linspace(-7, 7, 405)]))
    known, got = places(closed, at), places(prepared(general), at)
    off = np.max(np.abs(np.asarray(got - known)), axis=1)
    sound, true = np.asarray(beyond(prepared(general), at)) > 0, np.asarray(beyond(closed, at)) > 1e-10
    assert np.max(off[:400]) < 1e-9
    assert np.all(sound[:400])
    assert np.max(off[sound & true], initial=0.0) < 1e-9 and not np.any(sound & ~true & (off > 1e-7))
    machine = dataclasses.replace(general, flywheel=Flywheel(1.0))
    with pytest.raises(lj.MachineError, match=r"'coupler-rocker' cannot be assembled at .* It can be assembled from -"):
        lj.analyse(lj.Scene(machine, speed=3.0), angles=8, nodes=32)
