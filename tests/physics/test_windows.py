"""Windows that are given by what happens: their ends, the derivatives of these, and what follows from them."""

import dataclasses
import math
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import linkjax as lj
from linkjax.forces import kinetostatics
from linkjax.groups import AbstractLaw
from linkjax.groups._law import Moved
from linkjax.motion import (
    at_crank_angles,
    make_grid,
    node_values,
    run_in_angle,
    steady_by_diffrax,
    steady_motion,
)

CRANK, ROD, OFFSET, LAST, PUNCH = 0.060, 0.300, 0.0, 0.008, 50e3
FINE = 1e-12  # rad


def press(crank=CRANK, rod=ROD, offset=OFFSET, window=None, turns=1, load=PUNCH, **keys) -> lj.Scene:
    """A punch press: a slider-crank with a flywheel. Its punch acts on the last 8 mm before the far dead centre."""
    links = {
        "crank": lj.Link(length=crank, mass=5.0, inertia=0.05),
        "rod": lj.Link(length=rod, mass=15.0, inertia=0.42, centre=lj.Vec(0.1, 0.0)),
        "ram": lj.Link(mass=40.0),
    }
    guide = lj.Guide("A", 0.0, offset)
    groups = [lj.Crank("crank", "A", "B"), lj.RRP("rod", "ram", "B", "D", guide)]
    mechanism = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, groups, lj.Flywheel(20.0))
    window = lj.Passage(point="D", last=LAST, going="-") if window is None else window
    loads = (lj.OpposingForce("punch", "ram", "D", magnitude=load, window=window),)
    return lj.Scene(mechanism, loads, speed=2 * math.pi, cycle_turns=turns, **keys)


def used(scene: lj.Scene) -> np.ndarray:
    """The ranges of crank angle in which the first load acts."""
    window = at_crank_angles(scene).loads[0].window
    assert isinstance(window, lj.Window)
    return np.array(window.used(scene.cycle))


def works(scene: lj.Scene) -> dict[str, float]:
    """Work of every load in a cycle (J)."""
    grid = make_grid(scene, 192)
    weights = np.asarray(grid.half)[:, None] * grid.rule.w[None]
    return {name: float(np.sum(weights * share)) for name, share in node_values(scene, grid).by_load.items()}


def place(phi, crank, rod, offset):
    """Position of the ram of the press (mpmath)."""
    return crank * mpmath.cos(phi) + mpmath.sqrt(rod**2 - (crank * mpmath.sin(phi) - offset) ** 2)


def exact_ends(crank, rod, offset, last, digits=40) -> list[mpmath.mpf]:
    """Where the punch begins and ends to act (rad): at the dead centre crank and rod are folded, in line."""
    with mpmath.workdps(digits):
        crank, rod, offset, last = (mpmath.mpf(value) for value in (crank, rod, offset, last))
        dead = mpmath.pi + mpmath.asin(offset / (rod - crank))
        begin = place(dead, crank, rod, offset) + last
        on = mpmath.findroot(lambda phi: place(phi, crank, rod, offset) - begin, dead - mpmath.sqrt(2 * last / crank))
        return [on, dead]


def floats(values) -> np.ndarray:
    return np.array([float(value) for value in values])


def test_the_punch_of_a_press_begins_where_the_closed_form_says():
    ends = used(press())[0]
    np.testing.assert_allclose(ends, floats(exact_ends(CRANK, ROD, 0, LAST)), rtol=0, atol=FINE)
    on = ends[0]
    assert abs(60 * math.cos(on) + math.sqrt(300**2 - (60 * math.sin(on)) ** 2) - 248) < 1e-10


def test_the_punch_of_a_press_whose_crank_angle_begins_at_the_top():
    """The last 8 mm before the dead centre in which crank and rod are stretched, by the law of cosines."""
    window = lj.Passage(point="D", last=LAST, going="+")
    scene = press(window=window)
    crank = lj.Crank("crank", "A", "B", phase=math.pi)
    groups = (crank, *scene.mechanism.groups[1:])
    scene = scene.with_mechanism(dataclasses.replace(scene.mechanism, groups=groups))
    away = CRANK + ROD - LAST
    begin = math.pi - math.acos((CRANK**2 + away**2 - ROD**2) / (2 * CRANK * away))
    assert math.degrees(begin) == pytest.approx(152.6079, abs=5e-5)
    np.testing.assert_allclose(used(scene)[0], [begin, math.pi], rtol=0, atol=FINE)


def test_the_same_with_an_offset_guide():
    for offset in (0.02, -0.05):
        want = floats(exact_ends(CRANK, ROD, offset, LAST))
        np.testing.assert_allclose(used(press(offset=offset))[0], want, rtol=0, atol=FINE)


def test_a_tiny_part_of_the_way_between_two_places_of_the_scan():
    for last in (1e-4, 1e-7):
        window = lj.Passage(point="D", last=last, going="-")
        want = floats(exact_ends(CRANK, ROD, 0.02, last))
        # the position is known to rounding, and the angle to rounding divided by s'
        rounding = 4 * np.finfo(float).eps * ROD / math.sqrt(2 * last * CRANK)
        np.testing.assert_allclose(used(press(offset=0.02, window=window))[0], want, rtol=0, atol=FINE + rounding)


@pytest.mark.parametrize("offset", [0.02, -0.05])
def test_a_whole_way_in_one_sense(offset):
    """Between the dead centres, where crank and rod are in line; work = force times stroke."""

    def acts(offset):
        window = at_crank_angles(press(offset=offset, window=lj.Passage(point="D", going="-"))).loads[0].window
        assert isinstance(window, lj.Window)
        return jnp.stack([window.on, window.off], axis=-1).ravel()

    out, back = math.asin(offset / (ROD + CRANK)), math.pi + math.asin(offset / (ROD - CRANK))
    found, slopes = jax.jvp(acts, (jnp.asarray(offset),), (jnp.ones(()),))
    on_off = np.asarray(found)[np.asarray(slopes) != 0]
    np.testing.assert_allclose(np.sin(on_off), np.sin([out, back]), rtol=0, atol=FINE)
    np.testing.assert_allclose(np.cos(on_off), np.cos([out, back]), rtol=0, atol=FINE)
    rates = [1 / math.sqrt((ROD + sense * CRANK) ** 2 - offset**2) for sense in (1, -1)]
    np.testing.assert_allclose(np.asarray(slopes)[np.asarray(slopes) != 0], rates, rtol=1e-10)
    stroke = math.sqrt((ROD + CRANK) ** 2 - offset**2) - math.sqrt((ROD - CRANK) ** 2 - offset**2)
    work = works(press(offset=offset, window=lj.Passage(point="D", going="-")))
    assert work["punch"] == pytest.approx(-PUNCH * stroke, rel=1e-10)


def ends(values) -> jax.Array:
    """Where the punch begins and ends to act (rad), from crank, rod, offset and the last part of the way (m)."""
    crank, rod, offset, last = values
    window = at_crank_angles(press(crank, rod, offset, lj.Passage(point="D", last=last, going="-"))).loads[0].window
    assert isinstance(window, lj.Window)
    return jnp.stack([window.on[0], window.off[0]])


def test_its_ends_move_with_the_design_as_the_closed_form_says():
    at = [CRANK, ROD, 0.02, LAST]
    forward, reverse = (np.asarray(jax.jit(jac(ends))(jnp.asarray(at))) for jac in (jax.jacfwd, jax.jacrev))
    want, step = np.zeros((2, 4)), mpmath.mpf(10) ** -15
    for i in range(4):
        with mpmath.workdps(40):
            high, low = ([mpmath.mpf(v) + sign * step * (j == i) for j, v in enumerate(at)] for sign in (1, -1))
            sides = zip(exact_ends(*high), exact_ends(*low), strict=True)
            want[:, i] = floats((b - a) / (2 * step) for b, a in sides)
    np.testing.assert_allclose(forward, want, rtol=1e-11, atol=1e-11 * np.abs(want).max())
    np.testing.assert_allclose(reverse, forward, rtol=1e-12, atol=1e-12 * np.abs(want).max())


@pytest.mark.slow
def test_the_work_of_the_punch_is_its_force_times_the_way_and_the_energy_balance_closes():
    cycle = lj.analyse(press(offset=0.02), angles=90)
    np.testing.assert_allclose(cycle.work["punch"], -PUNCH * LAST, rtol=1e-13)
    np.testing.assert_allclose(cycle.work["drive"], PUNCH * LAST, rtol=1e-13)
    assert float(cycle.checks.energy_closure) < 1e-12
    assert float(cycle.checks.virtual_power) < 1e-11
    assert float(cycle.delta_error) < 1e-8
    found = lj.analysis.document(cycle)["windows"]
    np.testing.assert_allclose(found["punch"][0], floats(exact_ends(CRANK, ROD, 0.02, LAST)), rtol=0, atol=FINE)
    assert "load punch acts" in str(cycle) and "last 8 mm of D, going -" in str(cycle.scene)


def motion(values) -> jax.Array:
    """δ, balancing drive torque and largest speed, from crank, rod, offset, last part of the way and force."""
    crank, rod, offset, last, load = values
    window = lj.Passage(point="D", last=last, going="-")
    found = steady_motion(press(crank, rod, offset, window, load=load), 48)
    return jnp.stack([found.delta, found.mean_drive_torque, found.max_speed])


@pytest.mark.slow
def test_gradients_through_the_moving_window_are_those_of_differences():
    at = np.array([CRANK, ROD, 0.02, LAST, PUNCH])
    value, forward = jax.jit(lambda x: (motion(x), jax.jacfwd(motion)(x)))(at)
    reverse = jax.jit(jax.jacrev(motion))(at)
    run, want = jax.jit(jax.vmap(motion)), np.zeros((3, 5))
    steps = 1e-3 * np.abs(at)
    places = [at + k * steps[i] * np.eye(5)[i] for i in range(5) for k in (-2, -1, 1, 2)]
    rows = np.asarray(run(np.array(places))).reshape(5, 4, 3)
    for i, (a, b, c, d) in enumerate(rows):
        want[:, i] = (a - 8 * b + 8 * c - d) / (12 * steps[i])
    scale = np.abs(want * at).max(axis=1, keepdims=True) / at
    assert np.max(np.abs(np.asarray(forward) - want) / scale) < 1e-8
    np.testing.assert_allclose(np.asarray(reverse) / scale, np.asarray(forward) / scale, rtol=0, atol=1e-12)
    # the torque is the work of the punch per radian, exactly
    turn = 2 * math.pi
    np.testing.assert_allclose(forward[1], [0, 0, 0, PUNCH / turn, LAST / turn], rtol=1e-10, atol=1e-9)
    assert float(value[0]) > 0.1


@pytest.mark.slow
def test_the_gradient_of_a_peak_at_the_moving_end_of_a_window():
    # the drive torque at constant speed is largest where the punch begins to act
    at, step = jnp.array([CRANK, ROD, 0.02, LAST]), 1e-4

    def peak(values):
        crank, rod, offset, last = values
        scene = press(crank, rod, offset, lj.Passage(point="D", last=last, going="-"))
        return lj.measures.peak_drive_torque_constant_speed(scene, 48)

    found = np.asarray(jax.jit(jax.grad(peak))(at))
    sides = np.asarray(
        jax.jit(jax.vmap(peak))(jnp.stack([at * (1 + s * step * row) for row in np.eye(4) for s in (1, -1)]))
    )
    want = (sides[::2] - sides[1::2]) / (2 * step * np.asarray(at))
    scale = np.max(np.abs(want * at)) / np.asarray(at)
    assert np.max(np.abs(found - want) / scale) < 1e-7


def test_a_way_shorter_than_the_last_part_is_used_as_a_whole():
    window = lj.Passage(point="D", last=1.0, going="-")
    _, dead = floats(exact_ends(CRANK, ROD, 0.02, LAST))
    outer = math.asin(0.02 / (ROD + CRANK))
    np.testing.assert_allclose(used(press(offset=0.02, window=window)), [[outer, dead]], rtol=0, atol=FINE)
    both = lj.Passage(point="D", first=1.0)
    np.testing.assert_allclose(used(press(offset=0.02, window=both)), [[0.0, 2 * math.pi]], rtol=0, atol=FINE)
    stroke = math.sqrt(0.36**2 - 0.02**2) - math.sqrt(0.24**2 - 0.02**2)
    np.testing.assert_allclose(works(press(offset=0.02, window=both))["punch"], -2 * PUNCH * stroke, rtol=1e-10)


def test_a_position_that_is_never_reached_leaves_no_doubt():
    """Neither of one end of a window nor of both: the range ends with the way, and δ is that of the same ways."""
    whole = steady_motion(press(load=100.0, window=lj.Passage(point="D", going="-")))
    for between in ((0.2, 0.8), (0.7, 0.8)):
        found = steady_motion(press(load=100.0, window=lj.Passage(point="D", between=between, going="-")))
        assert float(found.delta_error) < 1e-9
        if between[0] < 0.24:
            assert float(found.delta) == pytest.approx(float(whole.delta), rel=1e-12)


@pytest.mark.slow
def test_a_position_that_is_never_reached_is_reported_and_finite():
    window = lj.Passage(point="D", between=(0.7, 0.8))
    with pytest.warns(UserWarning, match="load 'punch' never acts: its window is D between 700 mm and 800 mm, but D "
                                         "moves between 240 mm and 360 mm"):  # fmt: skip
        cycle = lj.analyse(press(window=window), angles=90)
    assert float(cycle.work["punch"]) == 0
    assert lj.analysis.document(cycle)["windows"] == {"punch": []}
    assert "load punch acts" in str(cycle) and "never" in str(cycle)
    slope = jax.jit(jax.grad(lambda low: steady_motion(press(window=lj.Passage(point="D", between=(low, 0.8)))).delta))
    assert float(slope(0.7)) == 0


@pytest.mark.slow
def test_why_a_load_never_acts():
    for window, why in (
        (lj.Passage(point="D", first=0.01, direction=math.pi / 2), "D does not move in this direction"),
        (lj.Passage(link="crank", last=0.1), "crank has no such limit position"),
        (lj.Passage(link="crank", going="ccw"), "its window is whole way of crank, going ccw, but crank has no such"),
    ):
        with pytest.warns(UserWarning, match=why):
            lj.analyse(press(window=window), angles=8)


Position = Callable[[np.ndarray], np.ndarray]


def happening(position: Position, low: float, high: float, sense: int, turn: float = 0.0) -> np.ndarray:
    """Ranges of crank angle in which a coordinate is between two values and moves in a sense (0: any), by brute force:
    where the answer changes on a fine grid, bisected. Slopes are complex steps; whole turns make no difference."""

    def acts(phi: np.ndarray) -> np.ndarray:
        seen = position(phi + 1e-30j)
        value, slope = np.real(seen), np.imag(seen)
        value = (value - low) % turn + low if turn else value
        return (value >= low) & (value < high) & ((sense == 0) | (np.sign(slope) == sense))

    grid = np.linspace(0, 2 * math.pi, 20001) + 1e-4
    answer = acts(grid)
    changes = np.flatnonzero(answer[1:] != answer[:-1])
    a, b = grid[changes], grid[changes + 1]
    for _ in range(60):
        middle = 0.5 * (a + b)
        same = acts(middle) == answer[changes]
        a, b = np.where(same, middle, a), np.where(same, b, middle)
    on, off = b[~answer[changes]], b[answer[changes]]
    if off[0] < on[0]:
        off = np.roll(off, -1)
    return np.stack([on, off], axis=1) % (2 * math.pi)


def quick_return(window) -> lj.Scene:
    mechanism = lj.library.quick_return(0.1, 0.2, 0.5, 0.3, 0.25, links={"ram": lj.Link(mass=20.0)}, flywheel=60.0)
    loads = (lj.OpposingForce("cut", "ram", "R", magnitude=2e3, window=window),)
    return lj.Scene(mechanism, loads, speed=6.0)


def ram(phi):
    """Position of the ram of the quick return."""
    x, y = 0.1 * np.cos(phi), 0.2 + 0.1 * np.sin(phi)
    far = 0.5 / np.sqrt(x * x + y * y)
    return x * far - np.sqrt(0.3**2 - (0.45 - y * far) ** 2)


@pytest.mark.parametrize(("going", "sense"), [("+", 1), ("-", -1), ("", 0)])
def test_the_ram_of_a_quick_return_between_two_positions(going, sense):
    scene = quick_return(lj.Passage(point="R", between=(-0.45, -0.15), going=going))
    want = happening(ram, -0.45, -0.15, sense)
    np.testing.assert_allclose(used(scene), want[np.argsort(want[:, 0])], rtol=0, atol=1e-11)
    np.testing.assert_allclose(works(scene)["cut"], -2e3 * 0.3 * (1 if going else 2), rtol=1e-8)


def four_bar(window) -> lj.Scene:
    mechanism = lj.library.four_bar(
        0.1, 0.35, 0.25, 0.4, links={"rocker": lj.Link(mass=4.0, inertia=0.1)}, flywheel=1.0
    )
    return lj.Scene(mechanism, (lj.OpposingTorque("brake", "rocker", magnitude=30.0, window=window),), speed=20.0)


def rocker(phi):
    """Angle of the rocker of the four-bar, from half its tangent (Freudenstein)."""
    x, y = 0.4 - 0.1 * np.cos(phi), -0.1 * np.sin(phi)
    k = (x * x + y * y + 0.25**2 - 0.35**2) / (2 * 0.25)
    return 2 * np.arctan((-y - np.sqrt(x * x + y * y - k * k)) / (k - x))


@pytest.mark.parametrize(("going", "sense"), [("ccw", 1), ("cw", -1), ("", 0)])
def test_a_rocker_between_two_angles(going, sense):
    low, high = math.radians(105), math.radians(130)
    scene = four_bar(lj.Passage(link="rocker", between=(low, high), going=going))
    want = happening(rocker, low, high, sense, 2 * math.pi)
    np.testing.assert_allclose(used(scene), want[np.argsort(want[:, 0])], rtol=0, atol=1e-11)
    # whole turns make no difference
    more = four_bar(lj.Passage(link="rocker", between=(low - 4 * math.pi, high - 4 * math.pi), going=going))
    np.testing.assert_allclose(used(more), used(scene), rtol=0, atol=1e-13)
    np.testing.assert_allclose(works(scene)["brake"], -30.0 * (high - low) * (1 if going else 2), rtol=1e-10)


def test_the_last_degrees_of_a_rocker():
    scene = four_bar(lj.Passage(link="rocker", last=math.radians(5)))
    fine = rocker(np.linspace(0, 2 * math.pi, 400001)) % (2 * math.pi)
    most, least, five = fine.max(), fine.min(), math.radians(5)
    up = happening(rocker, most - five, most + 1e-3, 1, 2 * math.pi)
    down = happening(rocker, least - 1e-3, least + five, -1, 2 * math.pi)
    want = np.concatenate([up, down])
    np.testing.assert_allclose(used(scene), want[np.argsort(want[:, 0])], rtol=0, atol=1e-8)  # of the sampled extremes


@pytest.mark.slow
def test_a_link_that_rotates_fully_passes_its_window_in_every_revolution():
    window = lj.Passage(link="crank", between=(math.radians(350), math.radians(370)))
    want = np.radians([[350, 10], [350 + 360, 10 + 360]])
    np.testing.assert_allclose(used(press(window=window))[0], want[0], rtol=0, atol=FINE)
    found = used(press(window=window, turns=2))
    np.testing.assert_allclose(found, np.radians([[350, 370], [710, 10]]), rtol=0, atol=FINE)
    nearly = lj.Passage(link="crank", between=(0.0, math.radians(359.99)))
    np.testing.assert_allclose(used(press(window=nearly)), np.radians([[0, 359.99]]), rtol=0, atol=FINE)
    wrong = lj.Passage(link="crank", between=(0.0, 1.0), going="cw")
    assert len(used(press(window=wrong))) == 0


@pytest.mark.slow
def test_a_load_acts_on_every_way_of_a_cycle_of_two_turns():
    on, off = floats(exact_ends(CRANK, ROD, 0.02, LAST))
    turn = 2 * math.pi
    found = used(press(offset=0.02, turns=2))
    np.testing.assert_allclose(found, [[on, off], [on + turn, off + turn]], rtol=0, atol=FINE)
    np.testing.assert_allclose(works(press(offset=0.02, turns=2))["punch"], -2 * PUNCH * LAST, rtol=1e-12)
    both = used(press(offset=0.02, turns=2, window=lj.Passage(point="D", last=LAST)))
    assert both.shape == (4, 2)


@pytest.mark.slow
def test_a_coupler_point_in_a_direction():
    # y of the crank pin is r sin φ
    window = lj.Passage(point="B", last=0.03, direction=math.pi / 2)
    want = np.radians([[30, 90], [210, 270]])
    np.testing.assert_allclose(used(press(window=window)), want, rtol=0, atol=FINE)
    across = lj.Passage(point="B", between=(-0.03, 0.03), going="-", direction=math.radians(30))
    np.testing.assert_allclose(used(press(window=across)), np.radians([[90, 150]]), rtol=0, atol=FINE)


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_units_make_no_difference(size):
    window = lj.Passage(point="D", last=LAST * size, going="-")
    scene = press(CRANK * size, ROD * size, 0.02 * size, window)
    want = floats(exact_ends(CRANK, ROD, 0.02, LAST))
    np.testing.assert_allclose(used(scene)[0], want, rtol=0, atol=FINE)


def test_a_clockwise_crank():
    mechanism = lj.library.slider_crank(CRANK, ROD, rotation="cw")
    loads = (
        lj.OpposingForce("punch", "slider", "D", magnitude=1.0, window=lj.Passage(point="D", last=LAST, going="-")),
    )
    want = floats(exact_ends(CRANK, ROD, 0, LAST))
    np.testing.assert_allclose(used(lj.Scene(mechanism, loads))[0], want, rtol=0, atol=FINE)


@pytest.mark.slow
def test_other_loads_switch_at_the_same_dead_centre():
    first = press(offset=0.02)
    pull = lj.Force("pull", "ram", "D", force=lj.Vec(-900.0, 0.0), window=lj.Passage(point="D", first=0.02, going="+"))
    weight = lj.Torque("start", "crank", torque=20.0, window=lj.Window(0.3, 1.0))
    scene = dataclasses.replace(first, loads=(*first.loads, pull, weight))
    for name, work in {"pull": -900.0 * 0.02, "start": 20.0 * 0.7, "punch": -PUNCH * LAST}.items():
        np.testing.assert_allclose(works(scene)[name], work, rtol=1e-12)


@pytest.mark.slow
def test_diffrax_and_runs_see_the_same_window():
    scene = press(offset=0.02)
    by_diffrax, by_quadrature = steady_by_diffrax(scene, 48), steady_motion(scene, 96)
    error = float(by_diffrax.delta_error + by_quadrature.delta_error)
    assert abs(float(by_diffrax.delta - by_quadrature.delta)) < error < 1e-5
    run = run_in_angle(scene, jnp.array([0.5, 0.5 + 2 * math.pi]), jnp.asarray(9.0), jnp.asarray(0.0))
    inertia = float(lj.reduced_model(at_crank_angles(scene), jnp.asarray(0.5)).inertia)
    lost = 0.5 * inertia * (9.0**2 - float(run.speed[-1]) ** 2)
    np.testing.assert_allclose(lost, PUNCH * LAST, rtol=1e-8)


@pytest.mark.slow
def test_one_crank_angle_does_not_show_a_window_and_the_remedy_works():
    scene, phi = press(), jnp.asarray(2.8)
    for ask in (
        lambda made: lj.reduced_model(made, phi).torque,
        lambda made: kinetostatics(made, phi, jnp.asarray(1.0), jnp.asarray(0.0)).drive_torque,
    ):
        with pytest.raises(lj.StructureError, match=r"load 'punch': .* motion of 'D'.* lj.motion.at_crank_angles"):
            ask(scene)
        assert np.isfinite(float(ask(at_crank_angles(scene))))
    resolved = at_crank_angles(scene)
    found, again = (steady_motion(made, 48) for made in (scene, resolved))
    np.testing.assert_allclose(again.delta, found.delta, rtol=1e-13)


@pytest.mark.slow
def test_many_windows_at_once():
    lengths = jnp.array([0.004, 0.008, 0.2])

    def torque(last):
        return steady_motion(press(window=lj.Passage(point="D", last=last, going="-")), 48).mean_drive_torque

    want = PUNCH * np.minimum(lengths, 2 * CRANK) / (2 * math.pi)
    np.testing.assert_allclose(jax.jit(jax.vmap(torque))(lengths), want, rtol=1e-12)


def test_numbers_of_a_window_are_leaves():
    leaves = jax.tree.leaves(eqx.filter(lj.Passage(point="D", between=(0.1, 0.2), direction=0.3), eqx.is_array))
    assert [float(leaf) for leaf in leaves] == [0.1, 0.2, 0.3]
    assert make_grid(press(), 48).passages[0].on.shape == (2,)


def shaken(law: AbstractLaw, turns: int = 1) -> lj.Scene:
    """A crank that follows a law, with a load on the last bit of each of its ways."""
    window = lj.Passage(link="crank", last=0.01)
    mechanism = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, {"crank": lj.Link(0.1)}, [lj.Crank("crank", "A", "B", law=law)])
    return lj.Scene(mechanism, (lj.Torque("brake", "crank", torque=1.0, window=window),), cycle_turns=turns)


class Rest(AbstractLaw):
    """Forth, a rest, and back."""

    def at(self, phi):
        s = jnp.clip(jnp.abs(phi - math.pi) / 2, 0.4, jnp.inf) - 0.4
        ahead = jnp.where(jnp.abs(phi - math.pi) > 0.8, jnp.sign(phi - math.pi), 0.0)
        return Moved(s**2, s * ahead, 0.5 * ahead**2)


def test_more_ways_than_slots_and_rests_are_refused():
    many = lj.Spline(tuple(0.3 * k for k in range(12)), tuple(0.1 * (-1) ** k for k in range(12)))
    for law in (many, Rest()):
        with pytest.raises(lj.StructureError, match="more ways per crank turn than can be represented, or rests"):
            at_crank_angles(shaken(law))
        assert bool(make_grid(shaken(law), 24).overflow)
    harmonic = shaken(lj.Harmonic(0.2, 0.5))
    want = math.acos(1 - 0.01 / 0.15)
    np.testing.assert_allclose(used(harmonic), [[math.pi - want, math.pi], [2 * math.pi - want, 0]], atol=FINE)


@pytest.mark.slow
def test_the_optimiser_moves_a_window():
    free = {"loads.punch.window.last": ("4 mm", "12 mm")}
    found = lj.optimise(press(offset=0.02), free=free, minimise="delta", limits=["mean_drive_torque >= 50 N m"])
    # the torque is force times way per radian
    window = found.after.loads[0].window
    assert isinstance(window, lj.Passage) and window.last is not None
    np.testing.assert_allclose(window.last, 2 * math.pi * 50.0 / PUNCH, rtol=1e-8)
