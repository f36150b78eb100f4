"""The two balancing problems of the baseline, solved by linkjax with the same 360 angles and ideal counterweights."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from linkjax.design import Limit, Problem, Variable, as_rows, as_term, at_most
from linkjax.measures import min_margin, peak_shaking_force_constant_speed
from linkjax.reduction import mass_sums

MEAN_SPEED = 73.27
REACH = {"crank": 30.0, "rocker": 10.0}  # largest mass-radius products (kg m)
LENGTHS = {"rod": (0.9, 1.2), "link4": (0.45, 0.56), "rocker": (0.28, 0.36)}


def press() -> lj.Scene:
    """The hay press with an ideal counterweight of 1 kg on crank and rocker: its position (m) is the product (kg m)."""
    scene = lj.load("hay-press-slider")
    links = dict(scene.mechanism.links)
    for name in REACH:
        piece = lj.Counterweight(1.0, lj.Vec(0.0, 0.0), ideal=True)
        links[name] = dataclasses.replace(links[name], counterweights={f"W{name}": piece})
    return scene.with_mechanism(dataclasses.replace(scene.mechanism, links=links))


def shaking(scene: lj.Scene) -> jax.Array:
    """Shaking force (N) at 360 angles."""

    def at(phi):
        _, second = mass_sums(lj.pose(scene.mechanism, phi))
        return jnp.stack([second.x, second.y]) * MEAN_SPEED**2

    return jax.vmap(at)(jnp.arange(360.0) * (math.pi / 180))


def cosine(scene: lj.Scene) -> jax.Array:
    """Cosine of the transmission angle of the dyad at 360 angles."""
    angles = jax.vmap(lambda phi: lj.transmission_angles(scene.mechanism, phi)["link4-rocker"])
    return jnp.cos(angles(jnp.arange(360.0) * (math.pi / 180)))[:, None]


def product(link: str) -> Limit:
    """The constraint on the mass-radius product of a counterweight."""

    def size(scene: lj.Scene) -> jax.Array:
        at = scene.mechanism.links[link].counterweights[f"W{link}"].at
        return jnp.stack([at.x, at.y])[None]

    return at_most(as_rows(size, "kg m", f"product of {link}"), REACH[link])


def problem(number: int) -> Problem:
    """Problem 1 or 2 of `baselines/optimise_slsqp.py`."""
    free = [
        Variable(f"links.{link}.counterweights.W{link}.at.{part}", -reach, reach)
        for link, reach in REACH.items()
        for part in ("along", "across")
    ]
    limits = [product(link) for link in REACH]
    if number == 2:
        free += [Variable(f"links.{link}.length", *ends) for link, ends in LENGTHS.items()]
        limits.append(at_most(as_rows(cosine, name="transmission"), 0.99))
    return Problem(press(), free, as_rows(shaking, "N"), limits)


def starts(posed: Problem, admissible) -> list[np.ndarray]:
    """The ten starts of the baseline, from the same random numbers; `admissible(x)` is its test of a start."""
    rng, found = np.random.default_rng(0), []
    while len(found) < 10:
        polar = rng.random(4) * [30, 2 * np.pi, 10, 2 * np.pi]
        geometry = np.array([0.9, 0.45, 0.28]) + rng.random(3) * [0.3, 0.11, 0.08]
        x = [polar[0] * np.cos(polar[1]), polar[0] * np.sin(polar[1]), polar[2] * np.cos(polar[3])]
        x = np.asarray([*x, polar[2] * np.sin(polar[3]), *geometry])[: len(posed.variables)]
        if admissible(x):
            found.append(x)
    return found


def between_nodes(number: int) -> Problem:
    """Problem 1 or 2 with the peak of the continuous cycle instead of the largest value at 360 angles."""
    on_angles = problem(number)
    scene = dataclasses.replace(on_angles.scene, speed=MEAN_SPEED)
    limits = [limit for limit in on_angles.asked[1:] if limit.term.name != min_margin.name]
    return Problem(scene, on_angles.variables, as_term(peak_shaking_force_constant_speed), limits)


def measured(posed: Problem, solver: Callable, begin: list[np.ndarray]) -> tuple[list[float], int, float, float]:
    """Optima from every start (kN), evaluations, wall time and its share for evaluations (s), compiled."""
    span, spent, at = posed.upper - posed.lower, 0.0, posed.at

    def timed(x):
        nonlocal spent
        clock = time.perf_counter()
        found = at(x)
        spent += time.perf_counter() - clock
        return found

    solver(posed, (begin[0] - posed.lower) / span)  # warm
    posed.evaluations = 0
    with mock.patch.object(posed, "at", timed):
        clock = time.perf_counter()
        found = [1e-3 * solver(posed, (x - posed.lower) / span).point.blocks[0].value for x in begin]
        wall = time.perf_counter() - clock
    return found, posed.evaluations, wall, spent


def main() -> None:
    """Both problems with every method, one line per result."""
    from benchmarks.baselines import optimise_slsqp as baseline
    from linkjax.design import descend, slsqp

    for number, count in ((1, 4), (2, 7)):
        posed = problem(number)

        def admissible(x):
            with np.errstate(invalid="ignore"):
                force, cos = baseline.shaking(x)
            return bool(np.isfinite(force).all() and np.abs(cos).max() < 0.99)

        begin = starts(posed, admissible)
        results = {name: measured(posed, solver, begin) for name, solver in (("cone", descend), ("slsqp", slsqp))}
        baseline.calls, clock = 0, time.perf_counter()
        with np.errstate(invalid="ignore"):
            theirs = [baseline.solve(count, x) for x in begin]
        wall = time.perf_counter() - clock
        results["slsqp_differences"] = theirs, baseline.calls, wall, wall
        best = min(min(found) for found, *_ in results.values())
        for name, (found, calls, wall, spent) in results.items():
            reached = sum(value <= best * (1 + 1e-6) for value in found)
            print(f"balance.problem{number}.{name}.best {min(found):.8g} kN")
            print(f"balance.problem{number}.{name}.reached {reached} of_10")
            print(f"balance.problem{number}.{name}.evaluations {calls} calls")
            print(f"balance.problem{number}.{name}.wall {wall:.3g} s")
            if name != "slsqp_differences":
                print(f"balance.problem{number}.{name}.overhead {wall / spent - 1:.2g} of_evaluations")
        found, calls, wall, spent = measured(between_nodes(number), descend, begin)
        print(f"balance.problem{number}.between_nodes.best {min(found):.8g} kN")
        print(f"balance.problem{number}.between_nodes.evaluations {calls} calls")
        print(f"balance.problem{number}.between_nodes.wall {wall:.3g} s")
        print(f"balance.problem{number}.between_nodes.overhead {wall / spent - 1:.2g} of_evaluations")
    demo()


def demo() -> None:
    """The problem of the hay press scene, ten design variables, from ten starts: the scene and nine at random."""
    from linkjax.design import descend, settled, slsqp

    scene, asked = lj.load_problem("hay-press")
    asked = settled(scene, **asked)
    posed = Problem(scene, asked["free"], asked["minimise"], asked["limits"])
    span, rng = posed.upper - posed.lower, np.random.default_rng(asked["seed"])
    begin = [np.clip(posed.start, posed.lower, posed.upper)]
    begin += [posed.lower + rng.random(span.size) * span for _ in range(asked["starts"] - 1)]
    results = {name: measured(posed, solver, begin) for name, solver in (("cone", descend), ("slsqp", slsqp))}
    best = min(min(found) for found, *_ in results.values())
    for name, (found, calls, wall, spent) in results.items():
        print(f"balance.demo.{name}.best {min(found):.8g} kN")
        print(f"balance.demo.{name}.reached {sum(value <= best * (1 + 1e-6) for value in found)} of_10")
        print(f"balance.demo.{name}.evaluations {calls} calls")
        print(f"balance.demo.{name}.wall {wall:.3g} s")
        print(f"balance.demo.{name}.overhead {wall / spent - 1:.2g} of_evaluations")


if __name__ == "__main__":
    main()
