"""Every solver against the same optima: closed forms, the SciPy baseline; costs and failures."""

from __future__ import annotations

import numpy as np
import pytest

import linkjax as lj
from benchmarks import balance
from benchmarks.baselines import optimise_slsqp as baseline
from linkjax import DesignError, Variable, at_most
from linkjax.design import Problem, _multistart, as_term, descend, multistart, slsqp, trust
from linkjax.design._point import look
from linkjax.measures import delta, min_transmission_angle, peak_shaking_force_constant_speed
from tests.design.test_optimise import AT, rotor

SOLVERS = ("cone", "slsqp", "trust-constr", "multistart")


@pytest.fixture
def few(monkeypatch):
    """A small batch of starts: these problems are easy."""
    monkeypatch.setattr(_multistart, "CROWD", 8)
    monkeypatch.setattr(_multistart, "TURNS", 30)


def counted(problem: Problem) -> list[None]:
    """One entry for every call of the compiled program from now on."""
    calls, run = [], problem._run
    problem.evaluations = 0
    problem._run = lambda *args: (calls.append(None), run(*args))[1]
    return calls


def posed(number: int) -> tuple[Problem, list[np.ndarray]]:
    """A problem of the baseline, and its ten starts relative to the ranges."""
    problem = balance.problem(number)

    def admissible(x):
        with np.errstate(invalid="ignore"):
            force, cosine = baseline.shaking(x)
        return bool(np.isfinite(force).all() and np.abs(cosine).max() < 0.99)

    starts = balance.starts(problem, admissible)
    return problem, [(x - problem.lower) / (problem.upper - problem.lower) for x in starts]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "best", "cone", "sqp"),
    [(1, 52.786870, 319, 510), pytest.param(2, 47.623038, 414, 663, marks=pytest.mark.slow)],
)
def test_the_baselines_problems(number, best, cone, sqp, few):
    """Ten of ten starts at the optimum of the baseline with a quarter of its evaluations (1277 and 1658), and four
    tenths for the same method with exact gradients; every call is counted. One start for the two slower solvers."""
    problem, starts = posed(number)
    calls = counted(problem)
    for solver, count, most in ((descend, 10, cone), (slsqp, 10, sqp), (trust, 1, 1000), (multistart, 1, None)):
        before = problem.evaluations
        calls.clear()
        for z in starts[:count]:
            path = solver(problem, z)
            assert 1e-3 * path.point.blocks[0].value == pytest.approx(best, rel=1e-6)
            assert path.point.violation <= 1e-8
            assert path.certificate.residual < 1e-6
            assert path.converged
        evaluations = problem.evaluations - before
        crowd = 0 if most else _multistart.CROWD * (_multistart.TURNS + 1)
        assert evaluations == len(calls) + crowd
        assert most is None or evaluations <= most


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_rotor_is_balanced(solver, few):
    """With tight bounds for the counterweight the remainder is m r ω² of the unreachable part."""
    free = {f"{AT}.along": (-0.05, 0.1), f"{AT}.across": (-0.1, 0.1)}
    found = lj.optimise(rotor(), free, peak_shaking_force_constant_speed, solver=solver)
    assert found.solver == solver
    assert found.feasible
    assert found.objective == pytest.approx(0.01 * 400, rel=1e-6)
    np.testing.assert_allclose(found.x, [-0.05, -0.02], rtol=0, atol=1e-5)
    assert found.kkt_residual < 1e-6
    assert found.bound_multiplier[f"{AT}.along"] == pytest.approx(400.0, rel=1e-4)  # N per m of the bound: m ω²


@pytest.mark.slow
def test_lost_machines_are_led_back(few):
    """Coupler and rocker far too short: every solver makes them long enough, and none raises or diverges."""
    free = [Variable(f"links.{name}.length", 0.02, 0.6) for name in ("coupler", "rocker")]
    problem = Problem(lj.load("four-bar"), free, as_term(min_transmission_angle), maximise=True)
    for z in (np.zeros(2), np.array([0.05, 0.02])):
        assert look(problem, z).unsound > 1
        for solver in (descend, slsqp, trust, multistart):
            path = solver(problem, z, steps=60)
            assert path.point.unsound <= 1e-8
            assert np.isfinite(path.point.value)
            objective, violation = np.transpose(path.history)
            assert np.isfinite(violation).all() and np.isfinite(objective[-1])
            assert (np.isfinite(objective) | (violation > 0)).all()  # an objective exists if the machine is assembled
            assert path.point.value < -0.3  # maximised: more than 0.3 of the initial value


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["slsqp", "multistart"])
def test_no_feasible_design(solver, few):
    """δ and the flywheel conflict, and are named; the violation is the smallest, as with the cone solver."""

    def wheel(scene):
        return scene.mechanism.flywheel.inertia

    found = lj.optimise(lj.load("slider-crank"), {"flywheel.inertia": (0.0, 50.0)}, wheel, solver=solver,
                        limits=[at_most(delta, 1e-4), at_most(wheel, 0.01, name="flywheel")])  # fmt: skip
    assert not found.feasible
    assert set(found.conflicts) == {"delta", "flywheel"}
    least = descend(found.problem, np.array([0.5])).point
    z = (found.x - found.problem.lower) / (found.problem.upper - found.problem.lower)
    assert look(found.problem, z).violation == pytest.approx(least.violation, rel=1e-6)


def test_an_unknown_solver():
    with pytest.raises(DesignError, match="slsqp"):
        lj.optimise(rotor(), {"speed": (1.0, 2.0)}, delta, solver="slsq")
