"""Cranks that cannot rotate fully: the ends of their ranges, against the law of cosines, and the messages."""

import dataclasses
import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import root_scalar

import linkjax as lj
from linkjax import RPR, RRP, RRR, Crank, Flywheel, Guide, Link, Mechanism, Vec
from linkjax._compile import compiled_soon
from linkjax.groups import Drive, General, Slot
from linkjax.kinematics import crank_ranges, dead_centres, pose, prepared
from linkjax.mechanism import linkage
from linkjax.scenes import load
from tests.physics.test_hard_cases import four_bar


def body(length: float) -> Link:
    return Link(length=length, mass=1.0, inertia=0.01, centre=Vec(0.5 * length, 0.02))


def stretched(crank: float, reach: float, frame: float) -> float:
    """Crank angle at which the far pin of the crank is at this distance from the rocker's pivot: the law of cosines."""
    return math.acos((crank**2 + frame**2 - reach**2) / (2 * crank * frame))


@pytest.mark.parametrize("rotation", ["ccw", "cw"])
def test_a_four_bar_that_stretches(rotation):
    """A double rocker: the dyad stretches symmetrically on either side of the line of centres."""
    machine = four_bar(0.3, 0.25, 0.2, 0.4)
    machine = dataclasses.replace(machine, groups=(Crank("crank", "A", "B", rotation), machine.groups[1]))
    (only,) = crank_ranges(machine)
    end = stretched(0.3, 0.45, 0.4)
    assert (only.start, only.stop) == pytest.approx((-end, end), abs=1e-12)
    assert (only.at_start, only.at_stop) == ("coupler-rocker, stretched",) * 2


def test_a_four_bar_that_folds_and_stretches():
    """Two ranges, each between a folded and a stretched dyad; the phase of the crank shifts them."""
    lengths, phase = (0.3, 0.35, 0.15, 0.4), 0.7
    machine = four_bar(*lengths)
    machine = dataclasses.replace(machine, groups=(Crank("crank", "A", "B", phase=phase), machine.groups[1]))
    near, far = (stretched(0.3, reach, 0.4) for reach in (0.2, 0.5))
    found = crank_ranges(machine)
    exact = sorted([(near - phase, far - phase), (2 * math.pi - far - phase, 2 * math.pi - near - phase)],
                   key=lambda r: (not r[0] <= 0 <= r[1], r[0]))  # fmt: skip
    np.testing.assert_allclose([(r.start, r.stop) for r in found], exact, atol=1e-12)
    assert {r.at_start for r in found} | {r.at_stop for r in found} == {
        "coupler-rocker, folded",
        "coupler-rocker, stretched",
    }


@pytest.mark.slow
def test_a_crank_longer_than_its_rod():
    """|r sin φ - e| = l: ranges about both dead centres."""
    links = {"crank": body(0.3), "rod": body(0.2), "ram": Link(mass=1.0)}
    groups = [Crank("crank", "A", "B"), RRP("rod", "ram", "B", "D", Guide("A", offset=0.05))]
    machine = Mechanism({"A": Vec(0.0, 0.0)}, links, groups)
    found = crank_ranges(machine)
    up, down = math.asin(0.25 / 0.3), math.asin(0.15 / 0.3)
    exact = [(-down, up), (math.pi - up, math.pi + down)]
    np.testing.assert_allclose([(r.start, r.stop) for r in found], exact, atol=1e-12)
    assert {found[0].at_stop, found[1].at_start} == {"rod-ram, left"}
    with pytest.raises(lj.MachineError, match="prescribe an oscillation within the first range, ") as told:
        lj.analyse(lj.Scene(machine, speed=3.0), angles=8, nodes=32)
    assert str(told.value).count("hange lengths") == 1 and "named" not in str(told.value)


@pytest.mark.slow
def test_a_narrow_gap_between_two_degrees():
    """A gap, or a range, narrower than the steps of the search is found too."""
    frame, half = 0.4, 1e-3
    reach = math.sqrt(0.1**2 + frame**2 - 2 * 0.1 * frame * math.cos(math.pi - half))
    (only,) = crank_ranges(four_bar(0.1, 0.6 * reach, 0.4 * reach, frame))
    assert (only.start, only.stop) == pytest.approx((-math.pi + half, math.pi - half), abs=1e-12)
    reach = math.sqrt(0.1**2 + frame**2 - 2 * 0.1 * frame * math.cos(half))
    (only,) = crank_ranges(four_bar(0.1, 0.6 * reach, 0.4 * reach, frame))
    assert (only.start, only.stop) == pytest.approx((-half, half), abs=1e-12)


def test_cranks_that_come_round_and_none():
    assert crank_ranges(four_bar(0.1, 0.4, 0.3, 0.4)) == ((0.0, 2 * math.pi, "", ""),)
    assert crank_ranges(four_bar(0.1, 0.2, 0.1, 1.0)) == ()
    alone = Mechanism({"A": Vec(0.0, 0.0)}, {"crank": Link(length=0.1)}, [Crank("crank", "A", "B")])
    assert crank_ranges(alone) == ((0.0, 2 * math.pi, "", ""),)


@pytest.mark.slow
def test_the_second_group_ends_it():
    """A lever with an eccentric slot on the rocker side: the range is that in which both groups close."""
    links = {"crank": body(0.3), "coupler": body(0.25), "rocker": body(0.2), "lever": body(0.5), "die": Link()}
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0), "P": Vec(0.05, 0.0)}
    groups = [
        Crank("crank", "A", "B"),
        RRR(("coupler", "rocker"), "B", "D", "C", 1),
        RPR("lever", "die", "B", "P", "E", offset=0.27),
    ]
    found = crank_ranges(Mechanism(fixed, links, groups))
    end, inner = stretched(0.3, 0.45, 0.4), stretched(0.3, 0.27, 0.05)
    exact = [(inner, end), (2 * math.pi - end, 2 * math.pi - inner)]
    np.testing.assert_allclose([(r.start, r.stop) for r in found], exact, atol=1e-12)
    assert [r.at_start for r in found] == ["lever-die, pivot", "coupler-rocker, stretched"]


@pytest.mark.slow
def test_two_dyads_one_lost_beside_the_other():
    """Where the first folds the second moves as the root of the distance, and may fail slightly earlier: random
    six-bars against a fine scan of both by the law of cosines, bisected on whether both close."""
    rng, beside = np.random.default_rng(5), 0
    for _ in range(60):
        a, b, c, d = rng.uniform(0.2, 0.9, 4)
        e, off, turned = rng.uniform(0.2, 0.9), rng.uniform(-0.3, 0.3), rng.uniform(-1.5, 1.5)

        def margins_at(x, a=a, b=b, c=c, d=d, e=e, off=off, turned=turned):
            away = d - a * np.exp(1j * x)
            r = abs(away)
            foot = (r * r + b * b - c * c) / (2 * r)
            hinge = d - away + away / r * (foot + 1j * np.sqrt(np.maximum(b * b - foot * foot, 0.0)))
            return np.minimum(b + c - r, r - abs(b - c)), e - abs((hinge * np.exp(-1j * turned)).imag - off)

        def closes(x, margins_at=margins_at):
            one, two = margins_at(x)
            return (one > 0) & (two > 0)

        scan = np.linspace(-math.pi, math.pi, 200001)
        sound = closes(scan)
        low, high = scan[:-1][sound[1:] != sound[:-1]], scan[1:][sound[1:] != sound[:-1]]
        begun = closes(low)
        for _ in range(50):
            middle = 0.5 * (low + high)
            low, high = (
                np.where((closes(middle) == begun) == side, middle, at) for side, at in ((True, low), (False, high))
            )
        links = {"crank": body(a), "coupler": body(b), "rocker": body(c), "rod": body(e), "ram": Link(mass=1.0)}
        groups = [
            Crank("crank", "A", "B"),
            RRR(("coupler", "rocker"), "B", "D", "C", 1),
            RRP("rod", "ram", "C", "H", Guide("A", turned, off)),
        ]
        found = crank_ranges(Mechanism({"A": Vec(0.0, 0.0), "D": Vec(d, 0.0)}, links, groups))
        told = np.sort([math.remainder(end, 2 * math.pi) for each in found if each.at_start for end in each[:2]])
        assert len(found) == (len(low) // 2 if len(low) else sound[0])
        np.testing.assert_allclose(told, 0.5 * (low + high), atol=1e-11)
        for each in found:
            for end, why in ((each.start, each.at_start), (each.stop, each.at_stop)):
                first = abs(margins_at(end)[0]) < 1e-9
                assert why.startswith("coupler-rocker" if first else "rod-ram" if why else "")
        folds = margins_at(low)
        beside += int(np.sum((abs(folds[0]) > 1e-9) & (folds[0] < 0.02)))
    assert beside > 3


@pytest.mark.slow
def test_a_triad_ends_where_the_other_way_round_it_reverses():
    """A six-bar of Stephenson's third kind, driven by its lever: one group of class III. The range of the lever is that
    with the crank as the driver, between limit positions found in closed form, group by group."""
    usual = load("stephenson-3").mechanism
    here = pose(usual, jnp.zeros(()))
    sketch = {p: here.points[p].r for p in "BCEG"}
    links = {name: dataclasses.replace(link, pins=PINS[name], centre_name="") for name, link in usual.links.items()}
    other = linkage(usual.fixed, links, Drive("lever", phase=lever_angle(here)), sketch=sketch)
    assert other.formula() == "I1(lever) → III3(arm, coupler, crank, rocker)"
    ends = dead_centres(usual)["lever"]
    turned = [float(lever_angle(pose(usual, at)) - lever_angle(here)) for at in ends.angle[ends.true]]
    only, *_ = crank_ranges(other)
    assert len(turned) == 2 and min(turned) < 0.0 < max(turned)
    assert (only.start, only.stop) == pytest.approx((min(turned), max(turned)), abs=1e-12)
    assert only.at_start == only.at_stop == "arm-coupler-crank-rocker, loops"


def lever_angle(here):
    return jnp.arctan2(here.links["lever"].u.y, here.links["lever"].u.x)


PINS = {"crank": ("A", "B"), "coupler": ("B", "C", "E"), "rocker": ("D", "C"), "arm": ("E", "G"), "lever": ("F", "G")}


@pytest.mark.slow
def test_what_is_said_of_it():
    """The message has the range, and a law within it, with which the machine runs."""
    scene = lj.Scene(dataclasses.replace(four_bar(0.3, 0.25, 0.2, 0.4), flywheel=Flywheel(1.0)), speed=3.0)
    with pytest.raises(lj.MachineError) as told:
        lj.analyse(scene, angles=8, nodes=32)
    end = math.degrees(stretched(0.3, 0.45, 0.4))
    text = str(told.value)
    assert "'coupler-rocker' cannot be assembled at 180.00 degrees" in text
    assert f"from {-end:.4f} to {end:.4f} degrees of crank angle" in text
    assert f'law = {{ start = "{-0.8 * end:.4f} deg", stop = "{0.8 * end:.4f} deg" }}' in text


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.8, 1.05])
def test_an_oscillating_drive(share):
    """Within the range it runs, beyond it the message gives the end of the range."""
    end = stretched(0.3, 0.45, 0.4)
    machine = four_bar(0.3, 0.25, 0.2, 0.4)
    crank = Crank("crank", "A", "B", law=lj.Harmonic(-share * end, share * end))
    scene = lj.Scene(dataclasses.replace(machine, groups=(crank, machine.groups[1])), speed=3.0)
    if share < 1:
        cycle = lj.analyse(scene, angles=8, nodes=32)
        assert int(cycle.result) == 0 and float(np.max(cycle.checks.virtual_power)) < 1e-12
    else:
        with pytest.raises(
            lj.MachineError, match=f"to {math.degrees(end):.4f} degrees .* its motion law exceeds that range"
        ):
            lj.analyse(scene, angles=8, nodes=32)


def test_a_dyad_that_continues_has_its_limits_too():
    """A crank that cannot rotate fully still has ranges; a kite passes through all its change points."""
    one, two = (crank_ranges(three(branch, (0.3, 0.2, 0.2, 0.3))) for branch in ("fixed", "continue"))
    assert len(one) == len(two) == 1
    assert (two[0].start, two[0].stop) == pytest.approx((one[0].start, one[0].stop), abs=1e-8)
    (kite,) = crank_ranges(three("continue", (0.2, 0.3, 0.3, 0.2)))
    assert (kite.start, kite.stop) == (0.0, 2 * math.pi)


def three(branch: str, lengths: tuple[float, float, float, float]) -> Mechanism:
    """A four-bar with a phase, whose dyad keeps its side or continues through change points."""
    machine = four_bar(*lengths)
    dyad = dataclasses.replace(machine.groups[1], branch=branch)
    return dataclasses.replace(machine, groups=(Crank("crank", "A", "B", phase=0.5), dyad))


@pytest.mark.slow
def test_a_general_group_is_followed_both_ways():
    """Upwards to the end of its range, and downwards from zero to the other end: the four-bar in closed form."""
    links = {"crank": Link(length=0.3), "coupler": Link(length=0.25), "rocker": Link(length=0.2)}
    fixed, crank = {"A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0)}, Crank("crank", "A", "B", phase=0.5)
    members = (("coupler", ("B", "C")), ("rocker", ("D", "C")))
    general = Mechanism(fixed, links, [crank, General(members, ("B", "D"), {"C": Vec(0.45, 0.19)})])
    closed = Mechanism(fixed, links, [crank, RRR(("coupler", "rocker"), "B", "D", "C", 1)])
    (one,), (two,) = crank_ranges(general), crank_ranges(closed)
    assert (one.start, one.stop) == pytest.approx((two.start, two.stop), abs=1e-12)
    at = compiled_soon(lambda m, phi: jax.vmap(lambda one: pose(m, one).points["C"].r)(phi))
    angles = jnp.linspace(two.start + 1e-3, two.stop - 1e-3, 40)
    found, known = at(prepared(general), angles), at(closed, angles)
    np.testing.assert_allclose((found.x, found.y), (known.x, known.y), atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("end", ["start", "stop"])
def test_crank_angle_zero_beside_the_end_of_a_range(end):
    """The path then continues from its last point to its first: the four-bar in closed form, on both sides of zero."""
    links = {"crank": Link(length=0.3), "coupler": Link(length=0.25), "rocker": Link(length=0.2)}
    fixed, beside = {"A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0)}, 1e-4 if end == "stop" else -1e-4
    closed = Mechanism(fixed, links, [Crank("crank", "A", "B"), RRR(("coupler", "rocker"), "B", "D", "C", 1)])
    limit = getattr(crank_ranges(closed)[0], end)
    known = jax.vmap(lambda phi: pose(closed, phi).points["C"])
    away = jnp.asarray([0.5 * beside, 0.0, -beside, -50 * beside, -300 * beside, -2000 * beside])
    wanted = known(limit - beside + away)
    members = (("coupler", ("B", "C")), ("rocker", ("D", "C")))
    general = General(members, ("B", "D"), {"C": Vec(wanted.r.x[1], wanted.r.y[1])})
    found = jax.vmap(lambda phi: pose(made, phi).points["C"])
    made = prepared(Mechanism(fixed, links, [Crank("crank", "A", "B", phase=limit - beside), general]))
    here = found(away)
    np.testing.assert_allclose((here.r.x, here.r.y), (wanted.r.x, wanted.r.y), atol=1e-12)
    np.testing.assert_allclose((here.dr.x, here.dr.y), (wanted.dr.x, wanted.dr.y), rtol=1e-8)


@pytest.mark.parametrize("phase", [1.0, 4.0])
def test_a_geared_five_bar_over_both_turns_of_its_cycle(phase):
    """The second turn differs from the first: |D + c exp i(phase - φ/2) - b exp iφ| = l + r, at every sign change."""
    links = {name: body(length) for name, length in (("crank", 0.05), ("wheel", 0.04), ("left", 0.1), ("right", 0.1))}
    groups = [
        Crank("crank", "A", "B"),
        lj.Gear("wheel", "D", lj.Teeth((40, 20)), "crank", "A", "C", phase=phase),
        RRR(("left", "right"), "B", "C", "P"),
    ]
    machine = Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.18, 0.0)}, links, groups, flywheel=Flywheel(1.0))

    def apart(phi):
        return abs(0.18 + 0.04 * np.exp(1j * (phase - 0.5 * phi)) - 0.05 * np.exp(1j * phi)) - 0.2

    scan = np.linspace(0.0, 4 * np.pi, 4001)
    signs = [i for i in range(4000) if apart(scan[i]) * apart(scan[i + 1]) < 0]
    ends = np.asarray([root_scalar(apart, bracket=(scan[i], scan[i + 1]), xtol=1e-15).root for i in signs])
    found = crank_ranges(machine, 2)
    np.testing.assert_allclose(np.sort(np.ravel([r[:2] for r in found]) % (4 * np.pi)), ends, atol=1e-12)
    assert all(apart(0.5 * (r.start + r.stop)) < 0 for r in found)
    assert len(ends) > 2


SLOW = {
    "half": (lj.Teeth((40, 20)), -1 / 2),
    "third": (lj.Teeth((60, 20)), -1 / 3),
    "belt": (lj.Belt(0.0141, 0.01), 0.01 / 0.0141),
}


@pytest.mark.slow
@pytest.mark.parametrize("phase", [1.0, 4.0])
@pytest.mark.parametrize("ratio", SLOW)
def test_a_crank_that_swings_in_gear_with_a_slow_wheel(ratio, phase):
    """Not periodic, as is permitted here: |D + c exp i(phase + k φ) - b exp iφ| = l + r, nearest to the beginning of
    the law on either side, which may be more than a turn away."""
    wheels, k = SLOW[ratio]

    def apart(phi):
        return abs(0.18 + 0.04 * np.exp(1j * (phase + k * phi)) - 0.05 * np.exp(1j * phi)) - 0.2

    for begin in (-0.5, 2.0):
        if apart(begin) < 0:
            exact = [next_root(apart, begin, way) for way in (-1, 1)]
            swings = geared(wheels, begin, phase)
            crank = dataclasses.replace(swings.groups[0], law=None)
            turns = dataclasses.replace(swings, groups=(crank, *swings.groups[1:]))
            found = [crank_ranges(swings)[0], *crank_ranges(turns)]
            ends = [(each.start, each.stop) for each in found if each.start <= begin <= each.stop]
            assert len(ends) == 2 and ends == [pytest.approx(exact, abs=1e-12)] * 2


def next_root(function, begin: float, way: int) -> float:
    far = begin + way * np.linspace(0.0, 30.0, 30001)
    i = int(np.argmax(function(far) > 0))
    return root_scalar(function, bracket=(far[i - 1], far[i]), xtol=1e-15).root


def geared(wheels, begin: float, phase: float) -> Mechanism:
    """A five-bar whose second crank is a gear in mesh with the first, which oscillates."""
    links = {name: body(length) for name, length in (("crank", 0.05), ("wheel", 0.04), ("left", 0.1), ("right", 0.1))}
    groups = [
        Crank("crank", "A", "B", law=lj.Harmonic(begin, begin + 0.3)),
        lj.Gear("wheel", "D", wheels, "crank", "A", "C", phase=phase),
        RRR(("left", "right"), "B", "C", "P"),
    ]
    return Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.18, 0.0)}, links, groups, flywheel=Flywheel(1.0))


@pytest.mark.parametrize("begin", [7.0, 9.0, 16.0, -6.0, -9.0])
def test_where_a_law_begins_where_nothing_closes(begin):
    """Ranges of a machine that is not periodic are reported within a turn on either side: the next comes first, then
    those after it, then those before."""
    wheels, k = SLOW["third"]

    def apart(phi):
        return abs(0.18 + 0.04 * np.exp(1j * (4.0 + k * phi)) - 0.05 * np.exp(1j * phi)) - 0.2

    scan = begin + np.linspace(-30.0, 30.0, 60001)
    signs = [i for i in range(60000) if apart(scan[i]) * apart(scan[i + 1]) < 0]
    ends = [root_scalar(apart, bracket=(scan[i], scan[i + 1]), xtol=1e-15).root for i in signs]
    closed = [pair for pair in itertools.pairwise(ends) if apart(0.5 * sum(pair)) < 0]
    near = [pair for pair in closed if pair[0] < begin + 2 * math.pi and pair[1] > begin - 2 * math.pi]
    known = sorted(near, key=lambda pair: (not pair[0] <= begin <= pair[1], pair[1] < begin, pair))
    found = crank_ranges(geared(wheels, begin, 4.0))
    for number, (told, exact) in enumerate(zip(found, known, strict=True)):
        for end, why, at in ((told.start, told.at_start, exact[0]), (told.stop, told.at_stop, exact[1])):
            assert end == pytest.approx(at, abs=1e-12) if why else number and abs(end - begin) > 2 * math.pi - 1e-9


@pytest.mark.parametrize("teeth", [20, 500])
def test_a_gearbox_before_a_double_rocker(teeth):
    """The crank makes many turns from end to end: the law of cosines for the gear, by the ratio. Beyond 32 turns on
    either side the searched range is reported."""
    links = {"crank": Link(length=0.01), "wheel": body(0.3), "coupler": body(0.25), "rocker": body(0.2)}
    groups = [
        Crank("crank", "M", "N", law=lj.Harmonic(0.3, 2.0)),
        lj.Gear("wheel", "A", lj.Teeth((20 * teeth, 20)), "crank", "M", "B"),
        RRR(("coupler", "rocker"), "B", "D", "C", 1),
    ]
    fixed = {"M": Vec(0.0, 1.0), "A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0)}
    (found,) = crank_ranges(Mechanism(fixed, links, groups))
    end = stretched(0.3, 0.45, 0.4) * teeth
    if teeth == 20:
        assert (found.start, found.stop) == pytest.approx((-end, end), abs=1e-11)
        assert found.at_start == found.at_stop == "coupler-rocker, stretched"
    else:
        assert found == (0.3 - 64 * math.pi, 0.3 + 64 * math.pi, "", "")


def test_a_gearbox_whose_law_begins_out_of_range():
    """The range is some turns further on, by the law of cosines for the gear."""
    links = {"crank": Link(length=0.01), "wheel": body(0.3), "coupler": body(0.25), "rocker": body(0.2)}
    groups = [
        Crank("crank", "M", "N", law=lj.Harmonic(0.3, 2.0)),
        lj.Gear("wheel", "A", lj.Teeth((400, 20)), "crank", "M", "B", phase=2.5),
        RRR(("coupler", "rocker"), "B", "D", "C", 1),
    ]
    fixed = {"M": Vec(0.0, 1.0), "A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0)}
    found, end = crank_ranges(Mechanism(fixed, links, groups))[0], stretched(0.3, 0.45, 0.4)
    assert (found.start, found.stop) == pytest.approx((20 * (2.5 - end), 20 * (2.5 + end)), abs=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("law", [None, lj.Harmonic(0.4, 0.5)])
def test_a_general_group_that_never_repeats(law):
    """It closes at every crank angle, but an irrational belt ratio is not periodic: the searched range is reported."""
    lengths = {"crank": 0.028, "wheel": 0.069, "left": 0.15, "right": 0.14}
    links = {name: body(length) for name, length in lengths.items()}
    crank, fixed = Crank("crank", "A", "B", law=law), {"A": Vec(0.0, 0.0), "D": Vec(0.148, 0.0)}
    wheel = lj.Gear("wheel", "D", lj.Belt(0.0289, 0.0441), "crank", "A", "C")
    dyad = RRR(("left", "right"), "B", "C", "P")
    here = pose(Mechanism(fixed, links, [crank, wheel, dyad]), jnp.zeros(())).points["P"].r
    general = General((("left", ("B", "P")), ("right", ("C", "P"))), ("B", "C"), {"P": here})
    reach = [abs(0.148 + s * 0.069 + t * 0.028) for s in (-1, 1) for t in (-1, 1)]
    assert min(reach) > 0.01 and max(reach) < 0.29  # the distance of the pins is between these
    (found,) = crank_ranges(Mechanism(fixed, links, [crank, wheel, general]))
    begin = 0.0 if law is None else 0.4
    assert found == (begin - 16 * math.pi, begin + 16 * math.pi, "", "")


@pytest.mark.parametrize("general", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("radius", [0.02, 0.1])
@pytest.mark.parametrize("begin", [None, 1.0])
def test_a_pinion_moves_a_rack(begin, radius, general):
    """Several turns of a crank push a pin along a line, |start + r φ - D| <= l1 + l2: a rack never returns, with or
    without a law."""
    links = {"crank": Link(length=0.01), "rack": Link(), "coupler": body(0.25), "rocker": body(0.2)}
    guide, law = Guide("A", offset=-0.02), None if begin is None else lj.Harmonic(begin, 2.0)
    crank, rack = Crank("crank", "A", "N", law=law), lj.Rack("rack", "R", guide, "crank", "A", radius, start=0.1)
    fixed, dyad = {"A": Vec(0.0, 0.0), "D": Vec(0.2, 0.3)}, RRR(("coupler", "rocker"), "R", "D", "C", 1)
    machine, zero = Mechanism(fixed, links, [crank, rack, dyad]), begin or 0.0
    here = {name: state.r for name, state in pose(machine, jnp.zeros(())).points.items()}
    if general:
        members = (("rack", ("R",)), ("coupler", ("R", "C")), ("rocker", ("D", "C")))
        loop = General(members, ("D",), {p: here[p] for p in "RC"}, (Slot("rack", guide),), gears=(rack,))
        machine = Mechanism(fixed, links, [crank, loop])
    across = math.sqrt(0.45**2 - (0.3 - float(here["R"].y)) ** 2)
    exact = [zero + (0.2 + side * across - float(here["R"].x)) / radius for side in (-1, 1)]
    assert abs(float(here["R"].x)) == pytest.approx(0.1 + radius * zero, abs=1e-15)
    (found,) = crank_ranges(machine)
    assert (found.start, found.stop) == pytest.approx(exact, abs=1e-11)


@pytest.mark.slow
def test_what_is_said_of_a_crank_in_gear_with_a_slow_wheel():
    """The range is that about the beginning of its law, also if a group of higher class closes the loop."""
    machine = geared(SLOW["half"][0], -0.5, 4.0)
    (low, high), *_ = (each[:2] for each in crank_ranges(machine))
    members, here = (("left", ("B", "P")), ("right", ("C", "P"))), pose(machine, jnp.zeros(()))
    general = General(members, ("B", "C"), {"P": here.points["P"].r})
    law = lj.Harmonic(-0.5, high + 0.2)
    groups = (dataclasses.replace(machine.groups[0], law=law), machine.groups[1], general)
    other = dataclasses.replace(machine, groups=groups)
    found = crank_ranges(other)[0]
    assert (found.start, found.stop) == pytest.approx((low, high), abs=1e-12)
    with pytest.raises(lj.MachineError) as told:
        lj.analyse(lj.Scene(other, speed=3.0), angles=8, nodes=32)
    text = str(told.value)
    assert f"{math.degrees(low):.4f} to {math.degrees(high):.4f} degrees of crank angle" in text
    assert f'law = {{ start = "{math.degrees(-0.5):.4f} deg", stop = ' in text


@pytest.mark.slow
def test_what_is_said_where_the_law_cannot_begin_where_it_is_drawn():
    """A double rocker that does not close at crank angle zero, and beside it a group of higher class drawn there."""
    links = {"crank": body(0.3), "coupler": body(0.25), "rocker": body(0.2), "rod": body(0.9), "lever": body(0.8)}
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(-0.4, 0.0), "E": Vec(0.6, 0.0)}
    r = 0.3  # from E to B at crank angle zero; the tip of the triangle on it
    x = (0.9**2 + r**2 - 0.8**2) / (2 * r)
    sketch = {"F": Vec(0.3 + x, math.sqrt(0.9**2 - x**2))}
    groups = [
        Crank("crank", "A", "B"),
        RRR(("coupler", "rocker"), "B", "D", "C", 1),
        General((("rod", ("B", "F")), ("lever", ("E", "F"))), ("B", "E"), sketch),
    ]
    scene = lj.Scene(Mechanism(fixed, links, groups, flywheel=Flywheel(1.0)), speed=3.0)
    with pytest.raises(lj.MachineError) as told:
        lj.analyse(scene, angles=8, nodes=32)
    end = math.degrees(stretched(0.3, 0.45, 0.4))
    text = str(told.value)
    assert f"from {180 - end:.4f} to {180 + end:.4f} degrees of crank angle" in text
    assert "e.g. groups[0].law = { start = " in text
    assert '" }, and draw it at its start, or change lengths' in text
