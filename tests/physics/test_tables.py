"""Loads given by tables: their work by other integrals, jumps, kinks, branches, derivatives, energy and power."""

from __future__ import annotations

import itertools
import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator

import linkjax as lj
from linkjax.design import changed
from linkjax.machine import ready
from linkjax.measures import delta
from linkjax.motion import make_grid, node_values, steady_motion, trapezoid_torque
from tests.helpers import assert_gradients_agree

TURN = 2 * math.pi
R, L = 0.06, 0.24  # crank and rod of the two-cylinder machine, upright


@pytest.fixture(scope="module")
def machine() -> lj.Scene:
    return lj.load("two-cylinder")


def with_loads(scene: lj.Scene, *loads, **others) -> lj.Scene:
    return lj.Scene(scene.mechanism, loads, speed=scene.speed, **others)


def height(phi):
    """Position of the piston D, and its first derivative."""
    rod = np.sqrt(L**2 - (R * np.cos(phi)) ** 2)
    return R * np.sin(phi) + rod, R * np.cos(phi) + R**2 * np.cos(phi) * np.sin(phi) / rod


def exact(integrand, breaks) -> float:
    """An integral over the cycle between breaks."""
    ends = [0.0, *sorted(breaks), TURN]
    return sum(quad(integrand, a, b, epsabs=1e-12, epsrel=1e-12)[0] for a, b in itertools.pairwise(ends))


def share(scene: lj.Scene, phi: float, side: float | None = None) -> float:
    return float(lj.reduced_model(scene, jnp.asarray(phi), None if side is None else jnp.asarray(side)).torque)


def works(scene: lj.Scene, nodes: int = 96) -> dict[str, float]:
    """The work of every load in a cycle, by quadrature on its grid."""
    grid = make_grid(scene, nodes)
    weights, shares = grid.half[:, None] * grid.rule.w[None], node_values(scene, grid).by_load
    return {name: float(jnp.sum(weights * share)) for name, share in shares.items()}


def test_a_torque_over_the_crank_angle_is_the_work_of_its_lines(machine):
    """On the crank itself the torque is the reduced torque; a trapezoidal sum over its knots is exact."""
    knots, values = np.radians([10.0, 90.0, 200.0, 300.0]), [1.0, 5.0, -3.0, 2.0]
    scene = with_loads(machine, lj.Table("cell", "crank", at=knots, values=values))
    work = np.trapezoid([*values, values[0]], [*knots, knots[0] + TURN])
    assert works(scene)["cell"] == pytest.approx(work, rel=1e-13)
    for phi in (0.0, 1.0, 3.3, 6.2, 7.0, -0.5):
        line = np.interp(phi, np.concatenate([knots - TURN, knots, knots + TURN]), np.tile(values, 3))
        assert share(scene, phi) == pytest.approx(line, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["linear", "cubic"])
def test_a_force_over_the_crank_angle_works_on_the_velocity_of_its_point(machine, method):
    knots, values = np.radians([0.0, 40.0, 120.0, 250.0, 300.0]), [100.0, 300.0, -200.0, -250.0, 50.0]
    load = lj.Table("gas", "piston3", "D", at=knots, values=values, method=method, direction=np.pi / 2)
    scene = with_loads(machine, load)
    long = np.concatenate([knots + k * TURN for k in range(-2, 3)])
    other = PchipInterpolator(long, np.tile(values, 5))
    curve = other if method == "cubic" else lambda phi: np.interp(phi, long, np.tile(values, 5))
    work = exact(lambda phi: curve(phi) * height(phi)[1], knots)
    cycle = lj.analyse(scene, angles=12, nodes=192)
    assert float(cycle.work["gas"]) == pytest.approx(work, rel=1e-11)
    angles = np.asarray(cycle.angles)
    np.testing.assert_allclose(cycle.reduced.torque, curve(angles) * height(angles)[1], atol=1e-10)
    assert float(cycle.checks.virtual_power) < 1e-10 and float(cycle.checks.energy_closure) < 1e-9
    assert float(cycle.checks.force_balance) < 1e-10


@pytest.mark.parametrize("method", ["linear", "cubic"])
def test_a_jump_has_a_value_on_either_side(machine, method):
    at = np.radians([0.0, 90.0, 180.0, 270.0])
    load = lj.Table("cell", "crank", at=at, values=[(3.0, 1.0), (4.0, -2.0), 0.0, 2.0], method=method)
    scene = with_loads(machine, load)
    for k in (-1, 0, 1, 3):
        phi = math.pi / 2 + k * TURN
        assert share(scene, phi) == pytest.approx(-2.0, abs=1e-9)
        assert share(scene, phi, phi - 0.1) == pytest.approx(4.0, abs=1e-9)
        assert share(scene, k * TURN) == pytest.approx(1.0, abs=1e-9)
        assert share(scene, k * TURN, k * TURN - 1e-3) == pytest.approx(3.0, abs=1e-9)
    parts = [(at[:2], [1.0, 4.0]), ([*at[1:], TURN], [-2.0, 0.0, 2.0, 3.0])]
    work = sum(
        PchipInterpolator(x, y).integrate(x[0], x[-1]) if method == "cubic" else np.trapezoid(y, x) for x, y in parts
    )
    assert works(scene)["cell"] == pytest.approx(work, rel=1e-12)


@pytest.mark.slow
def test_cells_of_constant_torque_are_windows(machine):
    """A table of jumps is the same as loads with windows: δ, error and peaks."""
    torques = [12.0, -3.0, 5.0, -20.0]
    ends = [TURN * i / 4 for i in range(5)]
    windows = [
        lj.Torque(f"w{i}", "crank", torque=torque, window=lj.Window(ends[i], ends[i + 1]))
        for i, torque in enumerate(torques)
    ]
    jumps = [(torques[i - 1], torques[i]) for i in range(4)]
    one = with_loads(machine, lj.Table("cells", "crank", at=ends[:4], values=jumps))
    two = with_loads(machine, *windows)
    assert float(delta(one)) == pytest.approx(float(delta(two)), rel=1e-12)


def three_crank(method: str, count: int) -> tuple[lj.Scene, np.ndarray, np.ndarray]:
    """The torque 3600 sin φ + 7500 sin 3φ (N m) on a shaft, against its rotation, in a table."""
    at = np.arange(count) * TURN / count
    values = -(3600 * np.sin(at) + 7500 * np.sin(3 * at))
    shaft = lj.Mechanism(
        {"A": lj.Vec(0.0, 0.0)}, {"shaft": lj.Link(length=0.1)}, [lj.Crank("shaft", "A", "B")], lj.Flywheel(360.0)
    )
    load = lj.Table.row("gas", "shaft", values=values, method=method)
    return lj.Scene(shaft, (load,), speed=450 * math.pi / 30, mean="midrange"), at, values


CELLS = (-2232.407319, -6173.494109, -8681.467863, -9224.227787, -7785.282395, -4864.250596, -1339.523722, 1770.00662,
         3580.221667, 3580.221667, 1770.00662, -1339.523722, -4864.250596, -7785.282395, -9224.227787, -8681.467863,
         -6173.494109, -2232.407319)  # fmt: skip


@pytest.mark.slow
def test_an_engine_of_three_cranks():
    """Cells of 10 degrees are the means of 3600 sin φ + 7500 sin 3φ; their δ is 0.0152607, and so is that of a cubic
    table of the torque itself, within its error of interpolation."""
    ends = np.radians(np.arange(0.0, 361.0, 10.0))
    means = np.diff(3600 * np.cos(ends) + 2500 * np.cos(3 * ends)) / np.radians(10.0)
    cells = np.asarray([*CELLS, *(-each for each in CELLS)])
    np.testing.assert_allclose(means, cells, atol=6e-7)
    scene, at, values = three_crank("cubic", 72)
    jumps = [(cells[i - 1], cells[i]) for i in range(36)]
    stepped = lj.Table("gas", "shaft", at=ends[:-1], values=jumps)
    printed = float(delta(eqx.tree_at(lambda s: s.loads, scene, (stepped,), is_leaf=lambda x: x is scene.loads)))
    assert printed == pytest.approx(0.0152607, abs=5e-8)
    curve = PchipInterpolator(np.concatenate([at - TURN, at, at + TURN]), np.tile(values, 3))
    fine = np.linspace(0.0, TURN, 7201)
    work = np.asarray([curve.integrate(0.0, x) for x in fine])
    swing = np.ptp(work - work[-1] * fine / TURN)
    exact = swing / (360 * (450 * math.pi / 30) ** 2)
    found = float(delta(scene))
    assert found == pytest.approx(exact, rel=1e-6)
    assert found == pytest.approx(0.0152607, rel=2e-3)
    fine_table = float(delta(three_crank("cubic", 360)[0]))
    assert fine_table == pytest.approx(0.0152607, rel=2e-5)


def test_rows_of_a_coursework(machine):
    """Twelve values are 30 degrees apart; the torque that balances them is their negative mean."""
    values = [0.0, 10.0, 22.0, 31.0, 12.0, -4.0, -8.0, -3.0, 1.0, 5.0, 9.0, 2.0]
    scene = with_loads(machine, lj.Table.row("sheet", "crank", values=values))
    load = scene.loads[0]
    assert isinstance(load, lj.Table)
    assert [float(angle) for angle in load.at] == pytest.approx(list(np.radians(np.arange(0, 360, 30))))
    steady = steady_motion(scene)
    assert float(steady.mean_drive_torque) == pytest.approx(-np.mean(values), rel=1e-13)
    assert float(trapezoid_torque(scene, 12)) == pytest.approx(-np.mean(values), rel=1e-13)


@pytest.mark.slow
def test_the_drive_torque_of_a_coursework(machine):
    """Trapezoids over twelve positions, with forces switched at positions: 85.837169 N m; exact is 552 J in a turn."""
    assert float(trapezoid_torque(machine, 12)) == pytest.approx(85.837169, abs=5e-7)
    assert float(trapezoid_torque(machine, 24)) == pytest.approx(87.351172, abs=5e-7)
    assert float(steady_motion(machine).mean_drive_torque) == pytest.approx(552 / TURN, rel=1e-11)
    assert pytest.approx(87.853529, abs=5e-7) == 552 / TURN
    with pytest.raises(ValueError, match="write the number of positions"):
        trapezoid_torque(machine, 1)


def test_a_drive_torque_by_trapezoids_contains_loads_that_depend_on_the_speed(machine):
    """A damper between crank and frame takes coefficient · ω at every position."""
    damped = with_loads(machine, *machine.loads, lj.TorsionDamper("oil", "crank", coefficient=0.3))
    more = trapezoid_torque(damped, 12) - trapezoid_torque(with_loads(machine, *machine.loads), 12)
    assert float(more) == pytest.approx(0.3 * float(machine.speed), rel=1e-12)


@pytest.mark.slow
def test_a_table_beside_a_damper(machine):
    """The motion depends on the speed, and its panels end at the positions of the table: the works balance, and that of
    the table is a closed form, with its end values beyond the last position, up to R + L."""
    going, coming, reach = [0.0, -300.0, -200.0], [0.0, 0.0, 50.0], R + L - 0.28
    cut = lj.Table("cut", "piston3", "D", at=[0.19, 0.23, 0.28], values=going, coming=coming, over=OVER)
    scene = with_loads(machine, *machine.loads, cut, lj.TorsionDamper("oil", "crank", coefficient=0.3))
    motion = steady_motion(scene)
    forth, back = -150 * 0.04 - 250 * 0.05 - 200 * reach, -25 * 0.05 - 50 * reach
    assert works(scene)["cut"] == pytest.approx(forth + back, rel=1e-9)
    grid = motion.grid
    speeds = motion.node_speeds(node_values(scene, grid).inertia)
    oil = 0.3 * float(jnp.sum(grid.half[:, None] * grid.rule.w[None] * speeds))
    assert oil > 0.3 * float(machine.speed) * TURN  # the mean of the square exceeds the square of the mean
    assert float(motion.mean_drive_torque) * TURN == pytest.approx(oil - sum(works(scene).values()), rel=1e-9)


@pytest.mark.slow
def test_a_table_over_the_stroke_works_on_the_way(machine):
    """The work is the area of the loop, whatever the crank: on both ways by straight lines and by cubics."""
    at, going, coming = [0.18, 0.2, 0.25, 0.30], [0.0, 10.0, 20.0, 5.0], [-30.0, -20.0, -10.0, 0.0]
    for method in ("linear", "cubic"):
        load = lj.Table("cut", "piston3", "D", at=at, values=going, coming=coming, over=lj.Coordinate(point="D"),
                        method=method)  # fmt: skip
        one, two = (
            np.trapezoid(each, at) if method == "linear" else PchipInterpolator(at, each).integrate(at[0], at[-1])
            for each in (going, coming)
        )
        assert works(with_loads(machine, load), 128)["cut"] == pytest.approx(one - two, rel=1e-9)


def test_panels_end_where_the_stroke_passes_a_knot(machine):
    at = [0.17, 0.19, 0.24, 0.31]  # the first and the last are never reached
    load = lj.Table("cut", "piston3", "D", at=at, values=[0.0, 5.0, 1.0, 2.0], over=lj.Coordinate(point="D"))
    edges = np.asarray(make_grid(with_loads(machine, load), 96).edges) % TURN
    fine = np.linspace(0.0, TURN, 100001)
    for value in (0.19, 0.24):
        beyond = height(fine)[0] - value
        for cell in np.flatnonzero(beyond[:-1] * beyond[1:] < 0):
            crossing = fine[cell] - beyond[cell] * (fine[1] - fine[0]) / (beyond[cell + 1] - beyond[cell])
            assert np.min(np.abs(edges - crossing)) < 1e-8
    for reversal in (math.pi / 2, 3 * math.pi / 2):
        assert np.min(np.abs(edges - reversal)) < 1e-12


def test_a_table_over_a_direction_or_an_angle(machine):
    """The crank pin B over its height, R sin φ; and a torque over the angle of the rod, which swings."""
    pin = lj.Table("pin", "crank", "B", at=[-0.05, 0.0, 0.04], values=[3.0, 1.0, 2.0], direction=0.0,
                   over=lj.Coordinate(point="B", direction=math.pi / 2))  # fmt: skip
    scene = with_loads(machine, pin)
    for phi in (0.3, 1.7, 4.0):
        force = np.interp(R * np.sin(phi), [-0.05, 0.0, 0.04], [3.0, 1.0, 2.0])
        assert share(scene, phi) == pytest.approx(-force * R * np.sin(phi), abs=1e-12)
    ends, torques = np.radians([80.0, 88.0, 104.0]), [2.0, -1.0, 4.0]
    rod = lj.Table("rod", "rod2", at=ends, values=torques, coming=[0.0, 0.0, 0.0], over=lj.Coordinate(link="rod2"))
    scene = with_loads(machine, rod)
    swing = np.arcsin(R / L)
    fine = np.linspace(math.pi / 2 - swing, math.pi / 2 + swing, 200001)
    assert works(scene, 192)["rod"] == pytest.approx(np.trapezoid(np.interp(fine, ends, torques), fine), rel=1e-7)


def test_the_angle_of_a_link_that_rotates_fully(machine):
    """The crank: the table is read within half a turn of its middle, and the end values hold beyond it."""
    at, values = np.radians([30.0, 60.0, 90.0]), [1.0, 3.0, 2.0]
    scene = with_loads(machine, lj.Table("crank", "crank", at=at, values=values, over=lj.Coordinate(link="crank")))
    area = np.trapezoid(values, at)
    held = 1.0 * (math.radians(30.0) + math.radians(120.0)) + 2.0 * math.radians(150.0)
    assert works(scene)["crank"] == pytest.approx(area + held, rel=1e-11)


@pytest.mark.slow
def test_derivatives_with_respect_to_a_table(machine):
    """Of δ and the drive torque with respect to values, knots and jumps, and to the lengths of the machine."""
    rng = np.random.default_rng(3)
    cells = lj.Table("cells", "crank", at=np.radians([5.0, 80.0, 170.0, 260.0]), values=[4.0, (9.0, -7.0), 3.0, -2.0])
    cut = lj.Table("cut", "piston3", "D", at=[0.19, 0.24, 0.29], values=[0.0, 400.0, 100.0],
                   coming=[0.0, -150.0, 0.0], over=lj.Coordinate(point="D"), method="cubic")  # fmt: skip
    scene = with_loads(machine, cells, cut)

    def measured(given):
        loads, length = given
        changed_ = changed(scene, {"links.rod2.length": length})
        steady = steady_motion(eqx.tree_at(lambda s: s.loads, changed_, loads), 128)
        return steady.mean_drive_torque + 1e3 * steady.delta

    assert_gradients_agree(measured, (scene.loads, jnp.asarray(L)), rng, difference=2e-6)


def test_forces_take_the_table_and_react_on_the_frame(machine):
    """In equilibrium at constant speed the drive torque is the negative share; the reaction acts on the frame."""
    load = lj.Table("gas", "piston3", "D", at=[0.0, 2.0, 4.0], values=[100.0, 500.0, 200.0], reacts_on="frame")
    cycle = lj.analyse(with_loads(machine, load), angles=12, constant_speed=True)
    frame, net = cycle.forces_constant_speed.frame, cycle.forces_constant_speed.net_frame
    np.testing.assert_allclose(np.asarray(frame.fy) - np.asarray(net.fy), np.interp(
        np.asarray(cycle.angles), [0.0, 2.0, 4.0, TURN], [100.0, 500.0, 200.0, 100.0]), atol=1e-9)  # fmt: skip


def test_a_table_of_two_turns_needs_a_cycle_of_two(machine):
    load = lj.Table("gas", "crank", at=[0.0, 5.0, 9.0], values=[1.0, 2.0, 4.0], cycle_turns=2)
    with pytest.raises(lj.StructureError, match="not a multiple of the period of the table"):
        with_loads(machine, load)
    two = with_loads(machine, load, cycle_turns=2)
    work = np.trapezoid([1.0, 2.0, 4.0, 1.0], [0.0, 5.0, 9.0, 2 * TURN])
    assert works(two)["gas"] == pytest.approx(work, rel=1e-12)
    once = lj.Table("gas", "crank", at=[0.0, 5.0], values=[1.0, 2.0])
    twice = works(with_loads(machine, once, cycle_turns=2))["gas"]
    assert twice == pytest.approx(2 * np.trapezoid([1.0, 2.0, 1.0], [0.0, 5.0, TURN]), rel=1e-12)


OVER = lj.Coordinate(point="D")
BAD = {
    "one value": ({"at": [0.0], "values": [1.0]}, "write two or more"),
    "too few values": ({"at": [0.0, 1.0], "values": [1.0]}, "a value for each"),
    "decreasing": ({"at": [1.0, 0.5], "values": [1.0, 2.0]}, "write them in order"),
    "equal": ({"at": [1.0, 1.0], "values": [1.0, 2.0]}, "as a pair"),
    "more than a cycle": ({"at": [0.0, 7.0], "values": [1.0, 2.0]}, "increase cycle_turns"),
    "closed": ({"at": [0.0, 1.0, TURN], "values": [1.0, 2.0, 1.0]}, "omit the last"),
    "not finite": ({"at": [0.0, 1.0], "values": [1.0, math.nan]}, "write finite numbers"),
    "method": ({"at": [0.0, 1.0], "values": [1.0, 2.0], "method": "spline"}, "linear.*cubic"),
    "coming": ({"at": [0.0, 1.0], "values": [1.0, 2.0], "coming": [1.0, 2.0]}, "over = Coordinate"),
    "jump over a stroke": ({"at": [0.0, 1.0], "values": [(1.0, 3.0), 2.0], "over": OVER}, "loads with windows"),
    "turns": ({"at": [0.0, 1.0], "values": [1.0, 2.0], "cycle_turns": 0}, "an integer of 1 or more"),
    "turns over a stroke": ({"at": [0.0, 1.0], "values": [1.0, 2.0], "over": OVER, "cycle_turns": 2}, "delete it"),
    "direction of a torque": ({"at": [0.0, 1.0], "values": [1.0, 2.0], "direction": 0.0}, "name a point"),
    "a triple": ({"at": [0.0, 1.0], "values": [(1.0, 2.0, 3.0), 2.0]}, r"\(before, after\)"),
    "no list": ({"at": 3.0, "values": [1.0, 2.0]}, "write e.g."),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_tables_are_refused(name):
    fields, remedy = BAD[name]
    with pytest.raises((ValueError, TypeError), match=remedy):
        lj.Table("cut", "piston3", **fields)


def test_tables_that_do_not_fit_the_machine_are_refused(machine):
    def refused(match, point="", link="piston3", **fields):
        load = lj.Table("cut", link, point, at=[0.0, 1.0], values=[1.0, 2.0], **fields)
        with pytest.raises(lj.StructureError, match=match):
            with_loads(machine, load)

    refused("point 'B' is on no slider", link="crank", over=lj.Coordinate(point="B"))
    refused("point 'X' is not defined", over=lj.Coordinate(point="X"))
    refused("never moves", over=lj.Coordinate(point="O"))
    refused("link 'X' is not defined", over=lj.Coordinate(link="X"))
    refused("never turns", over=lj.Coordinate(link="piston3"))
    refused("add the direction of the force", point="B", link="crank")


def test_a_load_alone_does_not_know_the_guides(machine):
    load = lj.Table("cut", "piston3", "D", at=[0.0, 1.0], values=[1.0, 2.0], over=OVER)
    phi = jnp.asarray(0.3)
    here = lj.pose(machine.mechanism, phi)
    with pytest.raises(ValueError, match="guides of a mechanism"):
        load.share(here, lj.loads.Instant(phi, phi))
    made = ready(with_loads(machine, load))
    inside = float(load.share(here, made.instant(phi, phi)))
    assert inside == pytest.approx((1 + height(0.3)[0]) * height(0.3)[1], rel=1e-12)
