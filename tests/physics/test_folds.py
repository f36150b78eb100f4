"""Groups of higher class beside the ends of their ranges, anywhere between points of the path: four-bars in closed
form."""

from __future__ import annotations

import dataclasses
import math
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import PRP, RRR, Crank, Flywheel, Gear, Guide, Link, Mechanism, Teeth, Vec
from linkjax._compile import compiled_soon
from linkjax.groups import General, Slot
from linkjax.kinematics import Prepared, crank_ranges, margins, pose, prepared

STEP = math.radians(1.0)  # of the path
EPS = float(np.finfo(float).eps)
SOME = 16  # four-bars
WHEEL = Gear("wheel", "D", Teeth((20, 30)), "crank", "A")
BEFORE = np.asarray([10.0**-k for k in range(2, 12)])  # rad from the fold


def four_bar(numbers, general: bool, wheel: bool = False, sketch: Vec | None = None) -> Mechanism:
    """A four-bar from the lengths of crank, coupler, rocker and frame and the phase of its crank; its dyad in closed
    form, or closed by Newton's method; with a gear at D, after it or in it."""
    a, b, c, d, phase = numbers
    none = jnp.zeros_like(jnp.asarray(d))
    links = {"crank": Link(length=a), "coupler": Link(length=b), "rocker": Link(length=c)}
    links |= {"wheel": Link()} if wheel else {}
    fixed, crank = {"A": Vec(none, none), "D": Vec(d, none)}, Crank("crank", "A", "B", phase=phase)
    closed = [crank, RRR(("coupler", "rocker"), "B", "D", "C", 1), *([WHEEL] if wheel else [])]
    if not general:
        return Mechanism(fixed, links, closed)
    sketch = pose(Mechanism(fixed, links, closed), none).points["C"].r if sketch is None else sketch
    members = (("coupler", ("B", "C")), ("rocker", ("D", "C")), *((("wheel", ("D",)),) if wheel else ()))
    loose = General(members, ("B", "D"), {"C": sketch}, gears=(WHEEL,) if wheel else ())
    return Mechanism(fixed, links, [crank, loose])


def least(mechanism: Mechanism | Prepared, phi) -> jax.Array:
    """The least margin at a crank angle."""
    return jnp.min(jnp.stack([side.value for g in margins(mechanism, phi).values() for side in g.values()]))


def drawn(rng: np.random.Generator) -> tuple[np.ndarray, float, float]:
    """A random four-bar that folds or stretches at a crank angle at a random point of a step, without another end
    between this angle and zero; that angle, and 1 if it is above."""
    while True:
        a, b, c, d = 10 ** rng.uniform(-1, 0, 4)
        above = bool(rng.integers(2))  # it stretches above, or folds below
        cosine = (a * a + d * d - (b + c if above else b - c) ** 2) / (2 * a * d)
        if abs(cosine) > 0.98:
            continue
        side = 1.0 if above else -1.0
        end = side * (rng.integers(10, 40) + rng.choice([0.3, 0.6, 0.9, 0.97, 0.999])) * STEP
        phase = math.acos(cosine) - end
        far = np.sqrt(a * a + d * d - 2 * a * d * np.cos(phase + np.linspace(0, end, 500)[:-1]))
        if np.all(far < b + c) and np.all(far > abs(b - c)):
            return np.asarray([a, b, c, d, phase]), end, side


@pytest.mark.slow
def test_a_fold_anywhere_in_a_step(rng):
    """Positions, first and second coefficients and their derivatives with respect to lengths, forward and reverse, are
    as accurate as the numbers of the design permit, to the last 1e-11 rad: ten times the effect of a rounding of each,
    by the derivatives of the closed form."""

    def figures(mechanism, phi):
        here = pose(mechanism, phi).points["C"]
        return jnp.stack([here.r.x, here.r.y, here.dr.x, here.dr.y, here.ddr.x, here.ddr.y])

    def one(numbers, end, side):
        sketch = pose(four_bar(numbers, False), jnp.zeros(())).points["C"].r
        paths = prepared(four_bar(numbers, True, sketch=sketch)).paths

        def closed(x):
            return figures(four_bar(x[:5], False), x[5])

        def followed(x):
            return Prepared(four_bar(x[:5], True, sketch=sketch), paths)

        def general(x):
            return figures(followed(x), x[5])

        def at(distance):
            x = jnp.append(numbers, end - side * distance)
            exact, slope, size = closed(x), jax.jacfwd(closed)(x), jnp.abs(x)
            bend = jax.jacfwd(jax.jacfwd(closed))(x)
            found = general(x), jax.jacfwd(general)(x)[:, :4], jax.jacrev(general)(x)[:, :4]
            values, slopes = jnp.abs(exact) + jnp.abs(slope) @ size, jnp.abs(slope[:, :4]) + jnp.abs(bend[:, :4]) @ size
            known = (exact, values), (slope[:, :4], slopes), (slope[:, :4], slopes)
            off = [jnp.max(jnp.abs(f - k) / some) / EPS for f, (k, some) in zip(found, known, strict=True)]
            here = pose(followed(x), x[5])
            gap = here.points["C"].r - here.points["D"].r - here.links["rocker"].u * numbers[2]
            return jnp.stack(off), jnp.sqrt(gap.squared()) / jnp.max(numbers[1:3]), least(followed(x), x[5])

        return jax.vmap(at)(jnp.asarray(BEFORE))

    rows = zip(*(drawn(rng) for _ in range(SOME)), strict=True)
    designs = tuple(jnp.asarray(np.asarray(part)) for part in rows)
    off, gap, margin = compiled_soon(lambda designs: jax.lax.map(lambda each: one(*each), designs))(designs)
    assert np.max(off) <= 10
    assert np.max(gap) <= 1e-14
    assert np.min(margin) > 0


def ends(mechanism: Mechanism) -> list[tuple[float, float]]:
    return [(each.start, each.stop) for each in crank_ranges(mechanism)]


@pytest.mark.slow
@pytest.mark.parametrize("phase", [-47.5, -47.2, -46.7])
def test_a_gap_between_two_places_of_the_path(phase):
    """A dyad that folds over slightly less than a degree between two points: the path must not continue beyond in the
    other assembly mode."""
    a, d, lack = 0.13, 0.416, -1e-5
    b = 1.7 * (d - a)
    numbers = (a, b, (b * (1 + lack) - (d - a)) / (1 - lack), d, phase * STEP)
    closed, general = four_bar(numbers, False), four_bar(numbers, True)
    (only,) = ends(closed)
    assert 0.9 * STEP < only[0] + 2 * math.pi - only[1] < STEP
    np.testing.assert_allclose(ends(general), [only], atol=1e-12)
    angles = jnp.asarray([only[0] + 1e-3, -3.0, -0.1, 0.1, only[1] - 1e-3])
    found, known = (places(machine, angles) for machine in (prepared(general), closed))
    np.testing.assert_allclose(found, known, atol=1e-11)


@compiled_soon
def places(mechanism: Mechanism | Prepared, angles: jax.Array) -> jax.Array:
    def at(phi):
        here = pose(mechanism, phi).points["C"].r
        return jnp.stack([here.x, here.y])

    return jax.vmap(at)(angles)


@pytest.mark.slow
def test_what_lies_beyond_a_gap_is_another_assembly():
    """A crank with two ranges: in the second, which its path may reach on the wrong side only, no margin is above
    zero at positions on that side, and no range is reported there."""
    for numbers in (
        (0.741311835, 0.495710799, 0.726643918, 0.605965677, 0.934331916),
        (0.435196576, 0.475771549, 0.318996948, 0.484100176, 1.280477872),
    ):
        closed, general = four_bar(numbers, False), four_bar(numbers, True)
        first, second = ends(closed)
        assert first[0] < 0 < first[1]
        np.testing.assert_allclose(ends(general)[0], first, atol=1e-12)
        assert all(stop - start > 1e-3 for start, stop in ends(general))
        angles = jnp.linspace(*second, 1000)[1:-1]
        found, known = (places(machine, angles) for machine in (prepared(general), closed))
        margin = beyond(prepared(general), angles)
        same = np.max(np.abs(found - known), axis=1) < 1e-6
        assert not np.any((np.asarray(margin) > 0) & ~same)


@compiled_soon
def beyond(mechanism: Mechanism | Prepared, angles: jax.Array) -> jax.Array:
    return jax.vmap(lambda phi: least(mechanism, phi))(angles)


@pytest.mark.slow
def test_a_wheel_in_a_group_that_does_not_come_round():
    """It is in mesh with a crank that could: its angles continue below zero, and beyond a turn, as in closed form."""
    numbers = (0.3, 0.25, 0.2, 0.4, 0.1)
    closed, general = (four_bar(numbers, kind, wheel=True) for kind in (False, True))
    np.testing.assert_allclose(ends(general), ends(closed), atol=1e-12)
    turns, inside = 2 * math.pi * np.arange(-2, 3), np.asarray([-1.0, -0.1, 0.0, 0.1, 1.0])
    angles = jnp.asarray(np.add.outer(turns, inside).ravel())
    found, known = (turned(prepared(machine), angles) for machine in (general, closed))
    np.testing.assert_allclose(found[:, :2], known[:, :2], atol=1e-13)
    assert np.all(found[:, 2] > 0)


@compiled_soon
def turned(mechanism: Mechanism | Prepared, angles: jax.Array) -> jax.Array:
    """Angles of gear and rocker direction, and the least margin."""

    def at(phi):
        here = pose(mechanism, phi).links
        wheel = here["wheel"].angle
        assert wheel is not None
        return jnp.stack([wheel, here["rocker"].u.y, least(mechanism, phi)])

    return jax.vmap(at)(angles)


@pytest.mark.slow
def test_a_group_too_short_at_crank_angle_zero():
    """Stretched between B and D, which are 0.9 m apart, links of 0.45 m in total leave a closure error of 0.15 m at
    each of three pins: the reported value is not less, and not much more, though the last iterations are slow."""
    machine = four_bar((0.1, 0.35, 0.1, 1.0, 0.0), True, sketch=Vec(0.6, 0.1))
    machine = dataclasses.replace(machine, flywheel=Flywheel(1.0))
    with pytest.raises(lj.MachineError, match=r"'coupler-rocker' .* crank angle zero.* joints B, C, D\.") as told:
        lj.analyse(lj.Scene(machine, speed=3.0), angles=8, nodes=32)
    left = re.search(r"smallest gap is (\S+) m", str(told.value))
    assert left is not None and 0.15 <= float(left[1]) < 0.19


@pytest.mark.slow
def test_a_general_group_behind_a_dyad_too_short_at_crank_angle_zero():
    """The dyad is reported, with its reach: closure errors after it have no meaning."""
    machine = four_bar((0.1, 0.35, 0.1, 1.0, 0.0), False)
    links = {**machine.links, "rod": Link(length=0.5), "lever": Link(length=0.5)}
    behind = General((("rod", ("C", "F")), ("lever", ("E", "F"))), ("C", "E"), {"F": Vec(0.6, 0.5)})
    fixed, groups = {**machine.fixed, "E": Vec(1.0, 0.9)}, [*machine.groups, behind]
    told = (
        r"'coupler-rocker' cannot be assembled at .* 'B' and 'D' are 1.1 m apart, and 'coupler' \(0.35 m\) and 'rocker'"
    )
    with pytest.raises(lj.MachineError, match=told):
        lj.analyse(lj.Scene(Mechanism(fixed, links, groups, flywheel=Flywheel(1.0)), speed=3.0), angles=8, nodes=32)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_blocks_without_arms_of_any_size(size):
    """Two blocks on two guides have no length for comparison; closed to rounding in micrometres and in megametres."""
    links = {"crank": Link(length=0.13 * size), "one": Link(), "two": Link()}
    fixed = {"A": Vec(0.0, 0.0), "P": Vec(0.1 * size, 0.25 * size)}
    guides = (Guide("P", 0.4, 0.02 * size), Guide("B", 1.2, -0.01 * size, "crank"))
    crank, dyad = Crank("crank", "A", "B"), PRP(("one", "two"), "C", guides)
    closed = Mechanism(fixed, links, [crank, dyad])
    sketch = {"C": pose(closed, jnp.zeros(())).points["C"].r}
    slots = tuple(map(Slot, dyad.blocks, dyad.slots))
    general = Mechanism(fixed, links, [crank, General((("one", ("C",)), ("two", ("C",))), (), sketch, slots)])
    angles = jnp.linspace(-0.5, 1.8, 60)
    angles = angles[np.asarray(beyond(closed, angles)) > 0.05]
    assert angles.size > 40 and np.all(np.asarray(beyond(prepared(general), angles)) > 0)
    np.testing.assert_allclose(places(prepared(general), angles), places(closed, angles), rtol=1e-13, atol=1e-14 * size)
