"""Families of measures against closed forms, dense samples, and names that are refused."""

from __future__ import annotations

import dataclasses
import functools
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import linkjax as lj
from linkjax import measures
from linkjax._compile import compiled_soon
from linkjax.kinematics import pose, prepared, transmission_of_pose
from linkjax.library import four_bar, quick_return, scotch_yoke, slider_crank
from linkjax.measures._strokes import _between
from linkjax.mechanism import StructureError
from tests.physics.machines import machine

EXACT = 1e-12


def value(mechanism: lj.Mechanism, *names: str) -> list[float]:
    """Measures of a machine that turns at 10 rad/s."""
    found = measures.evaluate(lj.Scene(mechanism, speed=10.0), names)
    return [float(found[name]) for name in names]


def test_stroke_of_a_slider_crank():
    """In line it is twice the crank; with an offset the difference of two sides of right triangles."""
    assert value(slider_crank(0.06, 0.3), "stroke.D") == pytest.approx([0.12], rel=EXACT)
    found = value(slider_crank(0.06, 0.3, 0.05), "stroke.D", "path_length.D", "min_x.D", "max_x.D")
    ends = [math.sqrt((0.3 + way * 0.06) ** 2 - 0.05**2) for way in (-1, 1)]
    assert found == pytest.approx([ends[1] - ends[0], 2 * (ends[1] - ends[0]), *ends], rel=EXACT)


def resting_bar() -> lj.Mechanism:
    """A four-bar whose crank a law moves from 0.3 to 1.9 rad, to 0.7 rad, where it rests, and back, where it rests."""
    there, back = [lj.Move(1.9, 1.1), lj.Move(0.7, 1.3, "cycloidal")], [lj.Move(0.3, 1.1, "trapezoidal")]
    law = lj.Moves(0.3, [*there, lj.Move(None, 0.9, "dwell"), *back, lj.Move(shape="dwell")])
    bars = {"crank": 0.1, "rod": 0.32, "rocker": 0.25}
    links = {name: lj.Link(length=length, mass=1.0, inertia=0.01) for name, length in bars.items()}
    groups = [lj.Crank("crank", "A", "B", law=law), lj.RRR(("rod", "rocker"), "B", "D", "C")]
    return lj.Mechanism({"A": lj.Vec(0, 0), "D": lj.Vec(0.3, 0)}, links, groups)


@pytest.mark.slow
def test_a_path_with_dwells():
    """The pin of a crank that a law moves: the crank times all that it turns there and back. Its least transmission
    angle is that of a dwell, and a measure and an analysis agree on it."""
    machine = resting_bar()
    (length, least) = value(machine, "path_length.B", "min_transmission_angle")
    assert length == pytest.approx(0.1 * 2 * (1.9 - 0.3), rel=EXACT)
    base = math.hypot(0.3 - 0.1 * math.cos(0.3), 0.1 * math.sin(0.3))  # the crank rests at 0.3 rad
    assert least == pytest.approx(math.acos((0.32**2 + 0.25**2 - base**2) / (2 * 0.32 * 0.25)), rel=EXACT)
    with pytest.raises(StructureError, match="motion law has dwells"):
        value(machine, "time_ratio.rocker")
    cycle = lj.analyse(lj.Scene(machine, speed=10.0), angles=4)
    assert not any(each.startswith("time_ratio") for each in measures.measure_names(cycle.scene))
    assert lj.analysis.measured(cycle)["min_transmission_angle"] == pytest.approx(least, rel=EXACT)


@pytest.mark.slow
def test_a_path_where_a_law_turns_back_within_a_move():
    """Ramps of the wrong height go back a little before they go ahead: for less than a step of the scan here."""
    ramp, back = lj.Move(0.115, 0.3), lj.Move(1.3, 0.3)
    law = lj.Moves(0.0, [ramp, lj.Move(1.2, 1.1, "constant_speed"), back, lj.Move(shape="4-5-6-7")])
    links = {"crank": lj.Link(length=0.2, mass=1.0, inertia=0.01)}
    machine = lj.Mechanism({"A": lj.Vec(0, 0)}, links, [lj.Crank("crank", "A", "B", law=law)])
    scan = np.linspace(0.0, 2 * math.pi, 100_001)
    speed = np.asarray(jax.vmap(law.at)(jnp.asarray(scan)).d)
    turns = np.flatnonzero(speed[:-1] * speed[1:] < 0)
    at: list = [brentq(lambda phi: float(law.at(jnp.asarray(phi)).d), scan[i], scan[i + 1], xtol=1e-14) for i in turns]
    angles = np.asarray(jax.vmap(law.at)(jnp.asarray([0.0, *at, 2 * math.pi])).value)
    assert turns.size > 1 and np.min(np.diff([0.0, *at])) < math.radians(2.8)
    assert value(machine, "path_length.B") == pytest.approx([0.2 * np.sum(np.abs(np.diff(angles)))], rel=EXACT)


@pytest.mark.slow
def test_dead_centres_where_a_law_turns_back():
    """The crank stops at 1.1 and at 4.4 rad, where it rests first; at 2.4 rad it rests and goes on. The rocker turns
    back there, too, and where crank and rod are in line. Time ratios do not exist."""
    made = resting_bar()
    cycle = lj.analyse(lj.Scene(made, speed=10.0), angles=4)
    stops = {link: np.sort(np.asarray(found.angle)[np.asarray(found.true)])
             for link, found in cycle.dead_centres.items()}  # fmt: skip
    np.testing.assert_allclose(stops["crank"], [1.1, 4.4], rtol=EXACT)
    np.testing.assert_allclose(stops["rocker"][1::2], [1.1, 4.4], rtol=EXACT)
    in_line = math.acos((0.42**2 + 0.3**2 - 0.25**2) / (2 * 0.42 * 0.3))
    law = made.driver.follows()
    assert law is not None
    there = [float(law.at(jnp.asarray(angle)).value) for angle in stops["rocker"][::2]]
    assert there == pytest.approx([in_line] * len(there), rel=EXACT)

    def rocker(crank: float) -> float:
        across, up = 0.1 * math.cos(crank) - 0.3, 0.1 * math.sin(crank)
        far = math.hypot(across, up)
        return math.atan2(up, across) - math.acos((far**2 + 0.25**2 - 0.32**2) / (2 * far * 0.25))

    assert float(cycle.strokes["crank"]) == pytest.approx(1.9 - 0.3, rel=EXACT)
    assert float(cycle.strokes["rocker"]) == pytest.approx(abs(rocker(1.9) - rocker(in_line)), rel=EXACT)
    swings = lj.analysis.document(cycle)["swings"]
    assert [each["time_ratio"] for each in swings.values()] == [None, None]


Q = 0.5 * math.pi
LAWS = {
    "through the dead centre, where it stops": [lj.Move(0.0, Q), lj.Move(1.2, Q), lj.Move(0.0, Q), lj.Move()],
    "where it rests": [lj.Move(0.0, 1.2), lj.Move(None, 0.6, "dwell"), lj.Move(1.2, 1.2), lj.Move()],
    "and keeps a value": [lj.Move(1.2, 1.2), lj.Move(1.2, 0.6), lj.Move(0.5, 1.2), lj.Move()],
}


@pytest.mark.parametrize("moves", LAWS.values(), ids=LAWS.keys())
def test_a_slider_turns_back_where_a_law_only_stops(moves):
    """At its own dead centre it does, and where the law turns back after a move to the same value. The slider's stroke
    is from the crank's greatest angle to its dead centre, once or several times."""
    links = {"crank": lj.Link(length=0.1, mass=1.0, inertia=0.01), "rod": lj.Link(length=0.3, mass=1.0, inertia=0.01),
             "slider": lj.Link(mass=1.0)}  # fmt: skip
    law = lj.Moves(-1.2, moves)
    groups = [lj.Crank("crank", "A", "B", law=law), lj.RRP("rod", "slider", "B", "D", lj.Guide("A"))]
    made = lj.Mechanism({"A": lj.Vec(0, 0)}, links, groups)
    found = lj.dead_centres(made)
    reach = 0.1 * math.cos(1.2) + math.sqrt(0.3**2 - (0.1 * math.sin(1.2)) ** 2)
    assert float(lj.strokes(made, found)["D"]) == pytest.approx(0.4 - reach, rel=EXACT)
    angles = np.sort(np.asarray(found["crank"].angle)[np.asarray(found["crank"].true)])
    assert angles.size == 2


@pytest.mark.slow
def test_time_ratio_of_a_law_of_two_turns():
    """There in 3 rad, and back in the rest of two turns: an analysis and a measure agree."""
    law = lj.Moves(0.3, [lj.Move(1.3, 3.0), lj.Move()], cycle=4 * math.pi)
    links = {"crank": lj.Link(length=0.1, mass=1.0, inertia=0.01)}
    made = lj.Mechanism({"A": lj.Vec(0, 0)}, links, [lj.Crank("crank", "A", "B", law=law)])
    scene = lj.Scene(made, speed=10.0, cycle_turns=2)
    swing = lj.analysis.document(lj.analyse(scene, angles=4))["swings"]["crank"]
    wanted = (4 * math.pi - 3) / 3
    measured = float(measures.evaluate(scene, ("time_ratio.crank",))["time_ratio.crank"])
    assert (swing["value"], swing["time_ratio"], measured) == pytest.approx((1.0, wanted, wanted), rel=EXACT)


def test_a_path_is_integrated_between_the_moves_wherever_a_point_is_slowest():
    """By rounding, places where a point is slowest may lie outside of the cycle; the speed still has its kinks at the
    ends of the moves only: between 1 and 3 rad it is three times as high."""
    for cuts in ((0.4, 2.0), (0.4, 2.0 + 2 * math.pi), (2.5 - 2 * math.pi, 9.9)):
        places, weights = _between(jnp.asarray(cuts), jnp.asarray([1.0, 3.0]), turns=1, count=1)
        at = np.asarray(places) % (2 * math.pi)
        speed = np.where((at > 1.0) & (at < 3.0), 3.0, 1.0)
        assert np.asarray(weights) @ speed == pytest.approx(2 * math.pi + 4.0, rel=EXACT)


def test_swing_and_time_ratio_of_a_crank_rocker():
    """From the triangles in which crank and coupler are in line."""
    a, b, c, d = 0.1, 0.4, 0.3, 0.4
    found = value(four_bar(a, b, c, d), "swing.rocker", "time_ratio.rocker", "swing.crank")
    at_frame = [math.acos((c * c + d * d - reach**2) / (2 * c * d)) for reach in (b + a, b - a)]
    at_crank = [math.acos((reach**2 + d * d - c * c) / (2 * reach * d)) for reach in (b + a, b - a)]
    ahead = math.pi + abs(at_crank[0] - at_crank[1])
    assert found[:2] == pytest.approx([at_frame[0] - at_frame[1], ahead / (2 * math.pi - ahead)], rel=EXACT)
    assert found[2] == pytest.approx(2 * math.pi, rel=1e-15)


def test_time_ratio_of_a_whitworth_drive():
    """The ram moves in a line through the pivot of the lever: the crank is ahead of it by 2 acos(100/150)."""
    shaper = quick_return(0.15, 0.1, 0.2, 0.6, -0.1)
    back = 2 * math.acos(100 / 150)
    expected = (2 * math.pi - back) / back
    assert expected == pytest.approx(2.7352, abs=5e-5)
    assert value(shaper, "time_ratio.R", "stroke.R") == pytest.approx([expected, 0.4], rel=EXACT)


def test_speeds_of_a_scotch_yoke():
    """Harmonic: r ω, r ω², and the root mean square of a sine."""
    names = ("max_velocity_constant_speed.E", "peak_acceleration_constant_speed.E", "rms_velocity_constant_speed.E")
    r = 0.05
    found = value(scotch_yoke(r), *names, "stroke.E", "path_length.B")
    expected = [r * 10, r * 100, r * 10 / math.sqrt(2), 2 * r, 2 * math.pi * r]
    assert found == pytest.approx(expected, rel=EXACT)


def test_a_crank_by_its_angle():
    """The angle of a crank is the crank angle from its phase, clockwise negative; its pin moves on a circle."""
    found = value(four_bar(0.1, 0.4, 0.3, 0.4), "angle.crank@60deg", "x.B@60deg", "y.B@60deg", "max_angle.crank")
    turned = math.radians(60)
    assert found == pytest.approx([turned, 0.1 * math.cos(turned), 0.1 * math.sin(turned), 2 * math.pi], rel=EXACT)
    back = value(four_bar(0.1, 0.4, 0.3, 0.4, rotation="cw"), "angle.crank@60deg", "min_angle.crank")
    assert back == pytest.approx([-turned, -2 * math.pi], rel=EXACT)
    speed = value(four_bar(0.1, 0.4, 0.3, 0.4, rotation="cw"), "max_angular_velocity_constant_speed.crank")
    assert speed == pytest.approx([-10.0], rel=EXACT)


def test_a_window_of_crank_angle():
    """Between 30° and 60° the pin of a crank is farthest at the first, and highest at the second."""
    names = "max_x.B where 30deg to 60deg", "max_y.B where 30deg to 60deg", "min_y.B where 300deg to 30deg"
    found = value(four_bar(0.1, 0.4, 0.3, 0.4), *names)
    expected = [0.1 * math.cos(math.pi / 6), 0.1 * math.sin(math.pi / 3), -0.1 * math.sin(math.pi / 3)]
    assert found == pytest.approx(expected, rel=EXACT)


def test_the_angle_of_a_link_that_turns_fully_in_a_window():
    """Its angle in the window, not that at the ends of the cycle."""
    names = ("max_angle.crank where 90deg to 180deg", "min_angle.crank where 90deg to 180deg")
    found = value(four_bar(0.1, 0.4, 0.3, 0.4), *names)
    assert np.degrees(found) == pytest.approx([180.0, 90.0], rel=EXACT)
    found = value(four_bar(0.1, 0.4, 0.3, 0.4, rotation="cw"), *names)
    assert np.degrees(found) == pytest.approx([-90.0, -180.0], rel=EXACT)


@pytest.mark.slow
def test_a_least_force_between_two_nodes():
    """A force that almost vanishes has a sharp minimum: a fine sample around it, from an analysis."""
    scene, name = machine("hay-press"), "min_reaction_constant_speed.E.link4"
    found = float(measures.evaluate(scene, [name])[name])
    coarse = lj.analyse(scene, angles=3600, constant_speed=True)
    force = coarse.forces.reactions["E"]["link4"]
    least = float(coarse.angles[np.argmin(np.hypot(force.fx, force.fy))])
    fine = lj.analyse(scene, angles=np.linspace(least - 2e-3, least + 2e-3, 4001), constant_speed=True)
    force = fine.forces.reactions["E"]["link4"]
    assert found == pytest.approx(float(np.min(np.hypot(force.fx, force.fy))), rel=1e-4)


def test_a_peak_is_the_larger_of_both_signs():
    """Two summits of almost equal height, of either sign."""
    scene = machine("hay-press")
    names = [f"{way}_angular_acceleration.crank" for way in ("peak", "max", "min")]
    peak, high, low = (float(each) for each in measures.evaluate(scene, names).values())
    assert peak == max(high, -low) and high > -low > 0.99 * high


@pytest.mark.parametrize("offset", [-0.4e-3, 0.4e-3])
def test_the_higher_of_two_summits_in_a_wide_panel(offset):
    """The transmission angle of a slider-crank is least where the crank is square to the guide, on either side; one of
    these angles is at the end of two panels of this machine, the other inside a wide one, between points of the search.
    """
    scene = machine("hay-press")
    moved = eqx.tree_at(lambda m: m.groups[1].guide.offset, scene.mechanism, jnp.asarray(offset))
    scene = scene.with_mechanism(moved)
    found = measures.evaluate(scene, ["min_transmission_angle.rod-slider"])
    assert float(found["min_transmission_angle.rod-slider"]) == pytest.approx(math.acos(0.3004 / 1.02), rel=1e-11)


def test_a_window_that_ends_where_a_load_switches():
    """The extreme in a range of crank angle does not move with the load that begins at the end of this range."""
    scene = machine("slider-crank")
    begin = math.radians(60.0)
    load = lj.Torque("step", "crank", torque=jnp.asarray(-3.0), window=lj.Window(jnp.asarray(begin), jnp.asarray(4.0)))
    scene = dataclasses.replace(scene, loads=(load,))
    measure, plain = measures.named("max_x.C where 60deg to 180deg"), "x.C@60deg"
    slope = compiled_soon(jax.grad(measure))(scene)
    assert float(slope.loads[0].window.on) == 0.0
    assert float(measure(scene)) == pytest.approx(float(measures.evaluate(scene, [plain])[plain]), rel=1e-12)


@pytest.mark.slow
def test_groups_with_a_transmission_angle():
    """Those that give one, in every built-in scene."""
    for name in lj.scene_names():
        scene = lj.load(name)
        ready = prepared(scene.mechanism, scene.cycle_turns)
        angles = jax.eval_shape(lambda ready: transmission_of_pose(ready.mechanism, pose(ready, jnp.zeros(()))), ready)
        assert set(measures.FAMILIES["min_transmission_angle"].names(scene)) == set(angles), name


@functools.cache
def dense(name: str) -> tuple[lj.Cycle, dict[str, float]]:
    """A cycle at many crank angles, and all measures."""
    scene = machine(name)
    found = measures.evaluate(scene, measures.measure_names(scene))
    return lj.analyse(scene, angles=4096), {name: float(each) for name, each in found.items()}


def over_the_cycle(cycle: lj.Cycle, quantity: str, element: str) -> np.ndarray:
    """A quantity from the arrays of a cycle: numbers, or the lengths of vectors."""
    constant = quantity.endswith("_constant_speed")
    quantity = quantity.removesuffix("_constant_speed")
    angles = np.asarray(cycle.angles)
    speed = np.full(angles.size, float(cycle.scene.speed)) if constant else np.asarray(cycle.speed)
    gain = np.zeros(angles.size) if constant else np.asarray(cycle.acceleration)
    forces = cycle.forces_constant_speed if constant else cycle.forces
    points, links = cycle.pose.points, cycle.pose.links
    if quantity in ("x", "y"):
        return np.asarray(getattr(points[element].r, quantity))
    if quantity in ("velocity", "acceleration"):
        p = points[element]
        first, second = (np.stack([part.x, part.y]) for part in (p.dr, p.ddr))
        return np.linalg.norm(first * speed if quantity == "velocity" else second * speed**2 + first * gain, axis=0)
    if quantity.startswith("angular"):
        w, e = links[element].w, links[element].e
        return np.asarray(w * speed if quantity == "angular_velocity" else e * speed**2 + w * gain)
    if quantity == "reaction":
        joint, _, link = element.rpartition(".")
        force = forces.reactions[joint][link]
        return np.hypot(force.fx, force.fy)
    if quantity == "drive_power":
        return np.asarray(forces.drive_torque) * speed
    if quantity == "drive_torque":
        return np.asarray(forces.drive_torque)
    if quantity == "shaking_moment":
        return np.asarray(forces.shaking.moment)
    force = getattr(forces, quantity.removesuffix("_force"))
    return np.hypot(force.fx, force.fy)


BESIDES = ("angle", "travel", "crank_speed")  # in the closed forms
SAMPLED = [
    name
    for name, family in measures.FAMILIES.items()
    if family.statistic and family.quantity is not None and family.quantity.name not in BESIDES
]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider-crank", pytest.param("hay-press", marks=pytest.mark.slow)])
def test_extremes_and_means_of_a_dense_sample(name):
    """4096 crank angles come as near to an extreme as its curvature allows; a mean has the error of its jumps."""
    cycle, found = dense(name)
    time = np.diff(np.asarray(cycle.time), append=float(cycle.steady.period))
    looked = 0
    for each in SAMPLED:
        statistic, _, quantity = each.partition("_")
        for full in (full for full in found if full.partition(".")[0] == each):
            element = full.partition(".")[2]
            if "guide" in element or (not element and "reaction" in full):
                continue  # with a sign, and of all joints: below
            values = over_the_cycle(cycle, quantity, element)
            size = float(np.max(np.abs(values))) or 1.0
            if statistic == "rms":
                weights: np.ndarray = np.ones(values.size) if quantity.endswith("_constant_speed") else time
                mean = np.sqrt(np.sum(weights * values**2) / np.sum(weights))
                assert found[full] == pytest.approx(mean, rel=2e-3, abs=1e-9 * size), full
            else:
                best = float({"peak": np.max(np.abs(values)), "max": np.max(values), "min": np.min(values)}[statistic])
                over = (found[full] - best) * (-1 if statistic == "min" else 1) / size
                assert -1e-9 < over < 2e-3, full  # loads jump between two sampled angles
            looked += 1
    assert looked > 90


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider-crank", "hay-press"])
def test_strokes_are_those_between_dead_centres(name):
    """The analysis finds the dead centres, the measures the outermost positions."""
    cycle, found = dense(name)
    for each, covered in cycle.strokes.items():
        measure = f"stroke.{each}" if each in cycle.pose.points else f"swing.{each}"
        assert found[measure] == pytest.approx(float(covered), rel=1e-11), each


def test_forces_in_a_guide_have_a_sign():
    """Positive to the left of the guide: of a slider in line with the crank, the y component."""
    scene = machine("slider-crank")
    cycle, found = dense("slider-crank")
    across = np.asarray(cycle.forces_constant_speed.reactions["piston.guide"]["piston"].fy)
    for way, best in (("max", np.max(across)), ("min", np.min(across))):
        size = float(np.max(np.abs(across)))
        assert found[f"{way}_reaction_constant_speed.piston.guide.piston"] == pytest.approx(best, abs=2e-4 * size)
    assert found["peak_reaction"] == max(each for full, each in found.items() if full.startswith("peak_reaction."))
    assert found["mean_drive_power"] == pytest.approx(
        float(cycle.steady.mean_drive_torque) * float(cycle.steady.mean_speed), rel=EXACT
    )
    assert scene.mechanism.links  # not prescribed


@pytest.mark.slow
def test_paths_of_all_points_of_a_trammel():
    """Every point of an elliptic trammel, one of which moves in a line: against the mean of its speed coefficient over
    4096 crank angles, which is exact for a periodic function."""
    scene = machine("elliptic-trammel")
    found = measures.evaluate(scene, [name for name in measures.measure_names(scene) if "path_length" in name])
    cycle = lj.analyse(scene, angles=4096)
    for full, length in found.items():
        p = cycle.pose.points[full.partition(".")[2]]
        speed = np.hypot(p.dr.x, p.dr.y)
        assert float(length) == pytest.approx(float(np.mean(speed)) * scene.cycle, rel=1e-6), full


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("stroke.X", "'X' is not a point of a slider of this machine; known here: P, S3"),
        ("stroke.C", "'C' is not a point of a slider"),
        ("stroke", "names no point; write e.g. stroke.P"),
        ("x.C", "has a value at every crank angle; write min_x.C, max_x.C, x.C@60deg"),
        ("x.C@here", "'here' is not a crank angle"),
        ("x.C@3mm", "'3mm' is not a crank angle"),
        ("stroke.P@60deg", "is one value of the whole cycle, not one at a crank angle; delete the crank angle"),
        ("max_x.C@60deg", "not one at a crank angle; write x.C@60deg, or delete the crank angle"),
        ("x.C@60", "'60' is a crank angle without a unit; write 60deg"),
        ("max_x.C where 30 to 50", "'30' is a crank angle without a unit"),
        ("x.C@nan deg", "write it e.g. as 60deg"),
        ("delta where 0deg to 10deg", "takes neither a window nor a crank angle; write delta"),
        ("stroke.P where 10deg to 20deg", "is not an extreme, and has no window"),
        ("swing.rodd", "'rodd' is not a moving link of this machine; did you mean 'rod'?"),
        ("peak_reaction.C.piston", "'C.piston' is not a joint with a link"),
        ("min_margin.rod", "'rod' is not a group"),
        ("peak_drive_torque.crank", "is of the whole machine, and takes no element"),
        ("strokes.P", "is not a measure; did you mean 'stroke'?"),
    ],
)
def test_names_that_are_refused(name, words):
    with pytest.raises(StructureError) as error:
        measures.evaluate(machine("slider-crank"), [name])
    assert words in str(error.value)
    assert name.partition("@")[0].partition(" where")[0] in str(error.value)
