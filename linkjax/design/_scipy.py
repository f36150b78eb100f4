"""SciPy's SLSQP and trust-constr on the same problem, with exact derivatives.

The peak becomes an epigraph: t is to be small, every row of the objective at most t, every row of a limit at most its
level. Values and slopes of all rows come from one evaluation. Source: Nocedal and Wright, Numerical Optimization, 2006,
ch. 18 and 19.
"""

from __future__ import annotations

import contextlib
import dataclasses
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from linkjax.design._cone import Path, arrived, begin, descend
from linkjax.design._point import MET, Point, certify, look, rank
from linkjax.design._problem import Problem

HUGE = 1e3  # what stands for a row that is no number, scaled
ROUNDING = 1e-9  # relative difference of two objectives that the certificate may decide
AGAIN = 6  # runs, each from the best design of those before


def slsqp(
    problem: Problem, z: np.ndarray, *, tolerance: float = 1e-7, steps: int = 200, callback: Callable | None = None
) -> Path:
    """Go from a design, in units of the variables' ranges, to a local optimum by SLSQP.

    As `descend`: an unsound design is first made sound, `callback(point, certificate)` hears of every step, and the path
    ends with a certificate of residual `tolerance`, after so many steps of one run, or where no run improves any more.
    """
    return _followed(_run_slsqp, problem, z, tolerance, steps, callback)


def trust(
    problem: Problem, z: np.ndarray, *, tolerance: float = 1e-7, steps: int = 400, callback: Callable | None = None
) -> Path:
    """Go from a design, in units of the variables' ranges, to a local optimum by trust-constr; as `slsqp`."""
    return _followed(_run_trust, problem, z, tolerance, steps, callback)


class _Epigraph:
    """The rows of a problem as functions of (z, t); `best` is the best design seen, by limits first."""

    def __init__(self, problem: Problem, path: Path, tolerance: float, callback: Callable | None):
        self.problem, self.path, self.tolerance, self.callback = problem, path, tolerance, callback
        self.point = self.best = path.point

    def at(self, z: np.ndarray) -> Point:
        """The design, evaluated once however often it is asked for."""
        z = np.clip(z, 0.0, 1.0)
        if not np.array_equal(z, self.point.z):
            self.point = look(self.problem, z)
            if rank(self.point) < rank(self.best):
                self.best = self.point
        return self.point

    def spare(self, x: np.ndarray) -> Float[np.ndarray, " rows"]:
        """What every row may still grow."""
        point = self.at(x[:-1])
        goals = [x[-1] - block.sizes for block in point.goals]
        limits = [block.level - block.sizes for block in [*point.limits, *point.sound]]
        return np.nan_to_num(np.concatenate([*goals, *limits]), nan=-HUGE, posinf=HUGE, neginf=-HUGE)

    def slopes(self, x: np.ndarray) -> Float[np.ndarray, "rows unknowns"]:
        """Gradients of `spare`."""
        point = self.at(x[:-1])
        by_z = np.concatenate([-block.gradients() for block in point.every])
        by_t = np.zeros((len(by_z), 1))
        by_t[: sum(len(block.rows) for block in point.goals)] = 1.0
        return np.nan_to_num(np.concatenate([by_z, by_t], axis=1), nan=0.0, posinf=0.0, neginf=0.0)

    def heard(self, x: np.ndarray, *_) -> None:
        """A step was taken."""
        point = arrived(self.path, self.at(x[:-1]))
        if self.callback is not None:
            self.callback(point, self.path.certificate)
        if self.path.certificate.residual <= self.tolerance and point.violation <= MET:
            raise StopIteration


def _followed(run: Callable, problem: Problem, z, tolerance: float, steps: int, callback) -> Path:
    """Runs of a solver, one after the other, until the certificate is good or nothing improves. Where the limits clash
    these solvers stop anywhere: what violates least is left to `descend`."""
    path = begin(problem, z, steps)
    if callback is not None and path.point.unsound <= 0:
        callback(path.point, path.certificate)
    epigraph = _Epigraph(problem, path, tolerance, callback)
    for _ in range(AGAIN):
        residual = path.certificate.residual
        if path.point.unsound > 0 or residual <= tolerance:
            break
        with warnings.catch_warnings(), contextlib.suppress(np.linalg.LinAlgError, ValueError):
            warnings.simplefilter("ignore")  # of values out of bounds; and a solver may lose itself: what it saw counts
            run(epigraph, np.append(epigraph.best.z, epigraph.best.value), steps)
        _settle(epigraph, path)
        if path.certificate.residual > 0.5 * residual:
            break
    path.converged = path.certificate.residual <= tolerance
    if path.point.violation > MET:
        rest = descend(problem, path.point.z, tolerance=tolerance, steps=steps, callback=callback)
        return dataclasses.replace(rest, history=[*path.history, *rest.history[1:]])
    return path


def _settle(epigraph: _Epigraph, path: Path) -> None:
    """End at the best design; where rounding alone sets the last one apart, at the better certified of the two."""
    best, last = epigraph.best, path.point
    certificate = certify(best)
    near = rank(last)[0] <= 0 and last.value <= best.value + ROUNDING * max(1.0, abs(best.value))
    if near and path.certificate.residual < certificate.residual:
        epigraph.best = last
    elif last is not best:
        path.point, path.certificate = best, certificate
        path.history.append(best.course)


def _run_slsqp(epigraph: _Epigraph, x: np.ndarray, steps: int) -> None:
    from scipy.optimize import minimize

    unit = np.eye(x.size)[-1]
    minimize(
        lambda x: x[-1], x, jac=lambda x: unit, method="SLSQP", bounds=[(0.0, 1.0)] * (x.size - 1) + [(None, None)],
        constraints=[{"type": "ineq", "fun": epigraph.spare, "jac": epigraph.slopes}], callback=epigraph.heard,
        options={"maxiter": steps, "ftol": 1e-14},
    )  # fmt: skip


def _run_trust(epigraph: _Epigraph, x: np.ndarray, steps: int) -> None:
    from scipy import optimize as imported
    from scipy.sparse import csc_matrix

    scipy: Any = imported  # its types are too narrow

    unit, nought = np.eye(x.size)[-1], np.zeros((x.size, x.size))
    ends = np.append(np.zeros(x.size - 1), -np.inf), np.append(np.ones(x.size - 1), np.inf)
    rows = scipy.NonlinearConstraint(
        epigraph.spare, 0.0, np.inf, jac=lambda x: csc_matrix(epigraph.slopes(x)), hess=scipy.BFGS()
    )
    scipy.minimize(
        lambda x: x[-1], x, jac=lambda x: unit, hess=lambda x: nought, method="trust-constr",
        bounds=scipy.Bounds(*ends), constraints=[rows], callback=epigraph.heard,
        options={
            "maxiter": steps, "sparse_jacobian": True, "initial_barrier_parameter": 1e-2,
            "initial_barrier_tolerance": 1e-2, "xtol": 1e-12, "barrier_tol": 1e-10,
            "gtol": 1e-16,  # a larger one ends the run while the barrier still stands
        },
    )  # fmt: skip
