"""Sums of squares for synthesis, against an independent four-bar in NumPy and SciPy's least squares."""

from __future__ import annotations

import functools
import math
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

import linkjax as lj
from linkjax import DesignError, Link, Vec
from linkjax.design import document, settled
from linkjax.measures import Parts

TRUE = np.array([0.1, 0.25, 0.3, 0.35, 0.12, 0.08])  # crank, coupler, rocker, frame, coupler point
FREE = ("links.crank.length", "links.coupler.length", "links.rocker.length", "fixed.D.x",
        "links.coupler.points.E.along", "links.coupler.points.E.across")  # fmt: skip
PHI = np.linspace(0.3, 5.9, 9)


def closed(x, phi):
    """Coupler point (n, 2) and rocker angle (n,) of a four-bar, with complex numbers."""
    crank, coupler, rocker, frame, along, across = x
    b = crank * np.exp(1j * np.asarray(phi))
    line = frame - b
    far = np.abs(line)
    a = (coupler**2 - rocker**2 + far**2) / (2 * far)
    c = b + line / far * (a + 1j * np.sqrt(coupler**2 - a**2))
    e = b + (c - b) / coupler * (along + 1j * across)
    return np.stack([e.real, e.imag], 1), np.angle(c - frame), np.angle(c - b)


def four_bar(x) -> lj.Scene:
    crank, coupler, rocker, frame, along, across = map(float, x)
    links = {"coupler": Link(points={"E": Vec(along, across)})}
    return lj.Scene(lj.four_bar(crank, coupler, rocker, frame, links=links), speed=1.0)


@pytest.fixture(scope="module")
def start() -> lj.Scene:
    return four_bar(TRUE * [1.1, 0.9, 1.1, 1.05, 0.8, 1.2])


def ranges(scale: float = 0.5) -> dict:
    return {name: (float((1 - scale) * t), float((1 + scale) * t)) for name, t in zip(FREE, TRUE, strict=True)}


@pytest.fixture(scope="module")
def exact(start):
    """The four-bar from nine points of its own coupler curve."""
    return lj.optimise(start, ranges(), lj.path_error("E", closed(TRUE, PHI)[0], PHI))


def test_a_four_bar_is_recovered_from_its_coupler_curve(exact):
    """Zero residual: in few evaluations to rounding, and certified."""
    assert exact.feasible and exact.kkt_residual <= 1e-7
    np.testing.assert_allclose(exact.x, TRUE, rtol=0, atol=1e-10)
    assert 0 <= exact.objective < 1e-22
    assert exact.evaluations <= 25
    assert exact.starts_at_optimum == 1


def test_values_are_those_of_the_closed_form(exact, start):
    x = [before for before, _ in exact.variables.values()]
    wanted = float(np.sum((closed(x, PHI)[0] - closed(TRUE, PHI)[0]) ** 2))
    assert exact.objective_before == pytest.approx(wanted, rel=1e-12)
    plain = lj.analyse(start, angles=8, throw=False)
    history = document(exact, plain, plain)["history"]
    assert history[0]["objective"] == pytest.approx(wanted, rel=1e-12)
    assert document(exact, plain, plain)["objective"]["unit"] == "m^2"
    assert exact.starts[0].objective == exact.objective


NEAR = closed(TRUE, PHI)[0] + 0.004 * np.random.default_rng(5).standard_normal((PHI.size, 2))
WEIGHTS = np.linspace(0.5, 2.0, PHI.size)


@pytest.fixture(scope="module")
def reference():
    """SciPy's optimum for points that no four-bar passes through."""
    roots = np.sqrt(WEIGHTS)[:, None]
    return least_squares(lambda x: (roots * (closed(x, PHI)[0] - NEAR)).ravel(), TRUE, xtol=1e-15, ftol=1e-15,
                         gtol=1e-15, x_scale=TRUE)  # fmt: skip


@pytest.mark.parametrize("solver", ["cone", "slsqp", pytest.param("trust-constr", marks=pytest.mark.slow),
                                    pytest.param("multistart", marks=pytest.mark.slow)])  # fmt: skip
def test_residuals_that_do_not_vanish(start, reference, solver):
    asked = lj.path_error("E", NEAR, PHI, weights=WEIGHTS)
    found = lj.optimise(start, ranges(), asked, solver=solver)
    assert found.feasible and found.kkt_residual <= 1e-6
    assert found.objective == pytest.approx(2 * reference.cost, rel=1e-9)
    np.testing.assert_allclose(found.x, reference.x, rtol=1e-5)


def test_a_function_of_ones_own_is_the_same(start, reference):
    """The same residuals written by the user, with own numbers for an offset that is known to be zero."""

    def away(scene, own):
        at = Parts(scene).machine.sample(jnp.asarray(PHI) + own["turn"], dynamics=False).pose.points["E"].r
        return jnp.stack([at.x, at.y], 1)[: PHI.size] - jnp.asarray(NEAR)

    free = {**ranges(), "own.turn": "-1e-9 to 1e-9 rad"}
    found = lj.optimise(start, free, lj.sum_of_squares(away, WEIGHTS, unit="m^2"))
    assert found.objective == pytest.approx(2 * reference.cost, rel=1e-6)
    assert found.problem.numbers[-1].unit == "rad"
    assert found.variables["own.turn"][0] == 0.0


def test_a_multiplier_of_squares_is_a_price(start):
    """The bound of a link at its optimum: improvement of the sum per metre, by differences."""

    def best(least):
        free = {**ranges(), "links.crank.length": (least, 0.15)}
        return lj.optimise(start, free, lj.path_error("E", NEAR, PHI))

    found = best(0.104)
    low, high = best(0.104 - 1e-5).objective, best(0.104 + 1e-5).objective
    assert found.bound_multiplier["links.crank.length"] == pytest.approx((high - low) / 2e-5, rel=1e-4)


def test_a_sum_of_squares_as_a_constraint(start):
    """The smallest frame with a bounded error: the bound is reached, in the unit of the square."""
    limit = lj.at_most(lj.path_error("E", closed(TRUE, PHI)[0], PHI), "20 mm^2")
    found = lj.optimise(start, ranges(), "fixed.D.x", limits=[limit])
    assert found.feasible
    assert found.limits["path_error"].bound == pytest.approx(20e-6, rel=1e-12)
    assert found.limits["path_error"].value == pytest.approx(20e-6, rel=1e-6)
    assert found.x[3] < TRUE[3]


@pytest.mark.parametrize("kind", ["path", "function", "position"])
def test_gradients(kind):
    """Slopes of every residual against differences of the closed form; own numbers among the variables."""
    points, rocker, coupler = closed(TRUE, PHI)
    turn, add = 0.05, 0.02
    asked = {
        "path": lambda: lj.path_error("E", points, PHI, start="own.start"),
        "function": lambda: lj.function_error("rocker", PHI, rocker, start="own.start", offset="own.offset"),
        "position": lambda: lj.position_error("coupler", np.column_stack([points, coupler]), PHI, point="E",
                                              length=0.2, start="own.start"),
    }[kind]()  # fmt: skip
    scene = four_bar(TRUE)
    free = {**ranges(), "own.start": {"range": "± 20 deg", "initial": turn}}
    if kind == "function":
        free["own.offset"] = {"range": "± 20 deg", "initial": add}
    problem = lj.design.Problem(scene, **_asked(settled(scene, free, asked)))

    def residuals(x):
        e, r, c = closed(x[:6], PHI + x[6])
        turned = {"path": (), "function": (r - rocker - x[-1],), "position": (0.2 * (c - coupler),)}[kind]
        parts = [*([] if kind == "function" else [e - points]), *(part[:, None] for part in turned)]
        return np.concatenate(parts, axis=1).ravel()

    x = problem.start
    block = problem.at(x)[0]
    np.testing.assert_allclose(block.vectors[0], residuals(x), rtol=0, atol=1e-14)
    step = 1e-6
    slope = np.stack([(residuals(x + step * u) - residuals(x - step * u)) / (2 * step) for u in np.eye(x.size)], 1)
    np.testing.assert_allclose(block.slope[0], slope, rtol=0, atol=1e-8)
    assert block.value == pytest.approx(float(np.sum(residuals(x) ** 2)), rel=1e-12)


def _asked(arguments):
    return {"variables": arguments["free"], "objective": arguments["minimise"]}


def test_free_crank_angles(start):
    """Nine points of the coupler curve without their crank angles; the machine is fixed but for one length."""
    points, machine = closed(TRUE, PHI)[0], four_bar(TRUE)
    found = lj.optimise(machine, {"links.coupler.length": (0.2, 0.3)}, lj.path_error("E", points))
    assert found.feasible and found.objective < 1e-18
    angles = [after for name, (_, after) in found.variables.items() if name.startswith("own.angle")]
    np.testing.assert_allclose(np.mod(angles, 2 * math.pi), PHI, rtol=0, atol=1e-7)


def test_offsets_of_a_function(start):
    """Both angles measured from unknown directions."""
    values = closed(TRUE, PHI + 0.2)[1] - 0.3
    degrees = [f"{math.degrees(value):.15g} deg" for value in values]
    asked = lj.function_error("rocker", PHI, degrees, start="own.a", offset="own.b")
    names = FREE[:2]
    scene = lj.design.changed(four_bar(TRUE), {FREE[1]: 0.24})
    found = lj.optimise(scene, {name: ranges()[name] for name in names}, asked)
    assert found.objective < 1e-20
    assert found.variables["own.a"][1] == pytest.approx(0.2, abs=1e-8)
    assert found.variables["own.b"][1] == pytest.approx(0.3, abs=1e-8)
    assert "own.a" in str(found) and "°" in str(found)


def test_own_numbers_in_constraints(start):
    """A constraint on an own number, and an objective that uses two of them: a closed form."""

    def away(scene, own):
        return (own["x"] - 3.0) ** 2 + (own["y"] - 4.0) ** 2

    limit = lj.at_most(lambda scene, own: own["x"] + own["y"], 5.0, name="sum")
    found = lj.optimise(start, {"own.x": "0 to 10", "own.y": (0, 10)}, away, limits=[limit])
    np.testing.assert_allclose(found.x, [2.0, 3.0], rtol=0, atol=1e-6)
    assert found.limits["sum"].multiplier == pytest.approx(2.0, rel=1e-5)


def test_two_worst_cases(start):
    """The larger of two sums: at the optimum of a closed form they are equal."""

    def away(scene, own):
        return jnp.stack([own["x"] - scene.speed, 0.5])

    cases = [lj.Case("one", {"speed": 1.0}), lj.Case("two", {"speed": 2.0})]
    found = lj.optimise(start, {"own.x": (0.0, 10.0)}, lj.sum_of_squares(away), cases=cases)
    assert found.objective == pytest.approx(0.25 + 0.25, rel=1e-8)
    assert found.x[0] == pytest.approx(1.5, rel=1e-6)


def _used(scene, own):
    return jnp.stack([own["start"]])


def _two(scene):
    return jnp.ones(2)


path = functools.partial(lj.path_error, "E")
BAD = {
    "lengths differ": (lambda: path([[0, 0], [1, 1]], [0.0]), "path_error: angles: has 1 crank angles for 2 wanted"),
    "NaN": (lambda: path([[0, math.nan]], [0.0]), "path_error: points[0]: nan is not a finite number"),
    "no points": (lambda: path([], []), "path_error: points: is empty"),
    "three numbers": (lambda: path([[0, 1, 2]], [0.0]), "points[0]: [0, 1, 2] has not 2 values"),
    "a wrong unit": (lambda: path([["1 kg", 0]], [0.0]), "'1 kg': a mass where a length is needed"),
    "negative weight": (lambda: path([[0, 1]], [0.0], weights=[-1.0]), "has a weight of -1"),
    "weights": (lambda: path([[0, 1]], [0.0], weights=[1.0, 2.0]), "has shape (2,), not (1,)"),
    "start": (lambda: path([[0, 1]], [0.0], start="start"), "'start' is not the name of an own number"),
    "start without angles": (lambda: path([[0, 1]], start="own.s"), "is given, but all crank angles are free"),
    "unknown point": (lambda: lj.path_error("Q", [[0, 1]], [0.0]), "path_error: Q: is not a point of the machine"),
    "frame": (lambda: lj.path_error("A", [[0, 1]], [0.0]), "is a point of the frame, which does not move"),
    "unknown link": (lambda: lj.function_error("roker", [0.0], [0.0]), "is not a link of the machine; did you mean"),
    "no length": (lambda: lj.position_error("coupler", [[0, 1, 0]], [0.0]), "position_error: length: is 0"),
    "other link": (lambda: lj.position_error("rocker", [[0, 1, 0]], [0.0], point="E", length=1.0), "is a point of"),
    "no function": (lambda: lj.sum_of_squares(cast(Any, [1.0])), "list is not a function"),
    "a number": (lambda: lj.sum_of_squares(lambda scene: scene.speed, name="f"), "f: returns one number, not the res"),
    "None": (lambda: lj.sum_of_squares(lambda scene: None, name="f"), "f: returns None, which is not an array"),
    "three axes": (lambda: lj.sum_of_squares(lambda scene: jnp.ones((1, 1, 1)), name="f"), "shape (1, 1, 1)"),
    "weights of a function": (lambda: lj.sum_of_squares(_two, [1.0, 2.0, 3.0]), "_two: returns residuals of"),
    "all weights zero": (lambda: lj.sum_of_squares(_two, [0.0, 0.0]), "has no weight above zero"),
    "never freed": (lambda: lj.sum_of_squares(_used), "own.start: is used by a function, but is not a"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input(start, case):
    make, says = BAD[case]
    with pytest.raises(DesignError) as error:
        lj.optimise(start, {"links.crank.length": (0.05, 0.15)}, make())
    assert says in str(error.value)


@pytest.mark.parametrize(
    ("free", "says"),
    [
        ({"own.start": "0 to 1"}, "own.start: is a design variable, but no function uses it"),
        ({"own.start": ("0 m", "1 rad")}, "has values in different units: m and rad"),
        ({"own.start": {"range": "0 to 1", "initial": 2.0}}, "its initial value 2 is not within its bounds 0 and 1"),
        ({"own.start": {"range": "0 to 1", "linked": ["speed"]}}, "unknown key 'linked'"),
        ({"links.crank.length": {"range": "± 5 %", "initial": 1.0}}, "unknown key 'initial'"),
        ({"own.a b": "0 to 1"}, "own.a b: is not a name"),
        ({"own.start": "0 furlong to 1 furlong"}, "furlong"),
        ([lj.Variable("own.start", 0.0, 1.0, linked=("speed",))], "own numbers cannot be linked"),
        ([lj.Variable("speed", 0.0, 1.0, initial=0.5)], "its initial value is that of the scene"),
    ],
)
def test_wrong_own_numbers(start, free, says):
    with pytest.raises(DesignError) as error:
        lj.optimise(start, free, "links.crank.length")
    assert says in str(error.value)


def test_own_numbers_have_units_and_initial_values(start):
    found = settled(start, {"own.a": "0 to 360 deg", "own.b": ("10 mm", "0.03 m"), "own.c": "± 2",
                            "own.d": {"range": "0 to 90 deg", "initial": "30 deg"}}, delta_like)["free"]  # fmt: skip
    assert [(v.unit, v.lower, v.upper) for v in found] == [
        ("rad", 0.0, pytest.approx(2 * math.pi)), ("m", 0.01, 0.03), ("1", -2.0, 2.0), ("rad", 0.0, math.pi / 2),
    ]  # fmt: skip
    values = [float(v.number(start).read(start)) for v in found]
    assert values == pytest.approx([math.pi, 0.02, 0.0, math.pi / 6])


def delta_like(scene: lj.Scene) -> jax.Array:
    return scene.speed
