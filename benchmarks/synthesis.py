"""Path synthesis of four-bars: sums of squares against the same objective as one number.

Run: python -m benchmarks.synthesis [five | eighteen] [--starts 40]      about two minutes
Two cases of the literature (Cabrera and others, Optimal synthesis of mechanisms with genetic algorithms, 2002), random
starts within the published bounds, a crank that is the shortest link, assembled over the whole cycle:
* `five`: 5 points, crank angles given. Published sums of squares: 1.827e-6 (Cabrera 2002), 1.284e-6 (MUMSA, Cabrera
  2011), 1.924e-6 (HCDJ, Nguyen-Van 2021).
* `eighteen`: a closed path of 18 points, 20 degrees apart, first crank angle free. Published: 3.375e-2 (Cabrera 2002),
  1.941e-2 (MUMSA), 1.608e-2 (HCDJ), 9.115e-3 (krill herd, Bulatović 2016; first angle fitted again).
The values are recomputed from the published dimensions: github.com/sy-nguyen-van/DE_Jaya_Synthesis_Four_Bar_Mechanisms
and github.com/KmolYuan/four-bar-rs.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import time
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

import linkjax as lj
from linkjax import Link, Vec
from linkjax.design import Optimum, Term
from linkjax.measures import Parts

FIVE = [[3.0, 3.0], [2.759, 3.363], [2.372, 3.663], [1.89, 3.862], [1.355, 3.943]]
EIGHTEEN = [
    [0.5, 1.1], [0.4, 1.1], [0.3, 1.1], [0.2, 1.0], [0.1, 0.9], [0.05, 0.75], [0.02, 0.6], [0.0, 0.5], [0.0, 0.4],
    [0.03, 0.3], [0.1, 0.25], [0.15, 0.2], [0.2, 0.3], [0.3, 0.4], [0.4, 0.5], [0.5, 0.7], [0.6, 0.9], [0.6, 1.0],
]  # fmt: skip
BEST = {"five": 1.284e-6, "eighteen": 9.115e-3}  # the best published values
WANTED = {"five": 7.416e-7, "eighteen": 9.115e-3}
SEEDS = {"five": 0, "eighteen": 2}
FREE = {
    **{f"links.{name}.length": (1e-3, 50.0) for name in ("crank", "coupler", "rocker")}, "fixed.D.x": (1e-3, 50.0),
    "links.coupler.points.E.along": (-50.0, 50.0), "links.coupler.points.E.across": (-50.0, 50.0),
}  # fmt: skip


def scene(crank: float, coupler: float, rocker: float, frame: float, along: float, across: float) -> lj.Scene:
    """A four-bar with a coupler point, the frame along x."""
    links = {"coupler": Link(points={"E": Vec(along, across)})}
    return lj.Scene(lj.four_bar(crank, coupler, rocker, frame, links=links), speed=1.0)


def shortest() -> list:
    """The crank is not longer than any other link."""

    def longer(other: str) -> Callable[[lj.Scene], jnp.ndarray]:
        def by(scene):
            links = scene.mechanism.links
            far = scene.mechanism.fixed["D"].x if other == "frame" else links[other].length
            return links["crank"].length - far

        return by

    return [
        lj.at_most(longer(other), 0.0, unit="m", name=f"crank - {other}") for other in ("frame", "coupler", "rocker")
    ]


def five() -> tuple[lj.Scene, dict, Term]:
    """The five points, crank angles from 30 to 90 degrees."""
    return scene(2.0, 3.0, 3.5, 4.0, 1.5, 1.5), FREE, lj.path_error("E", FIVE, np.radians([30, 45, 60, 75, 90]))


def eighteen() -> tuple[lj.Scene, dict, Term]:
    """The closed path. The published variables are position and direction of the frame: here own numbers."""
    points, steps = jnp.asarray(EIGHTEEN), jnp.asarray(np.radians(20.0 * np.arange(18)))

    def away(scene, own):
        at = Parts(scene).machine.sample(steps + own["start"], dynamics=False).pose.points["E"].r
        c, s = jnp.cos(own["turn"]), jnp.sin(own["turn"])
        return jnp.stack([own["x"] + c * at.x - s * at.y, own["y"] + s * at.x + c * at.y], axis=-1) - points

    free = {**FREE, "own.x": (-50.0, 50.0), "own.y": (-50.0, 50.0),
            "own.turn": "0 to 360 deg", "own.start": "0 to 360 deg"}  # fmt: skip
    return scene(0.3, 3.0, 2.0, 3.5, 1.0, 1.0), free, lj.sum_of_squares(away, unit="m^2", name="path")


CASES = {"five": five, "eighteen": eighteen}


def run(name: str, squares: bool, starts: int) -> tuple[Optimum, float]:
    """The optimum of a case and the seconds it took, with compilation."""
    machine, free, goal = CASES[name]()
    if not squares:
        goal = dataclasses.replace(goal, rows=None, squares=False)
    clock = time.perf_counter()
    found = lj.optimise(machine, free, goal, limits=shortest(), starts=starts, seed=SEEDS[name])
    return found, time.perf_counter() - clock


def main() -> None:
    """Print a table for every case."""
    parser = argparse.ArgumentParser()
    parser.add_argument("case", nargs="?", choices=sorted(CASES))
    parser.add_argument("--starts", type=int, default=40)
    asked = parser.parse_args()
    lj.enable_x64()
    for name in [asked.case] if asked.case else CASES:
        print(f"{name} points, best published {BEST[name]:.4e}, {asked.starts} starts, seed {SEEDS[name]}")
        for squares in (True, False):
            found, seconds = run(name, squares, asked.starts)
            good = [s for s in found.starts if s.feasible and s.objective is not None]
            reached = sum(s.objective <= WANTED[name] for s in good if s.objective is not None)
            certified = sum(s.residual <= 1e-6 for s in good)
            best = math.nan if found.objective is None else found.objective
            print(f"  {'squares' if squares else 'one number':10s}  best {best:.5e}  KKT residual "
                  f"{found.kkt_residual:.1e}  below {WANTED[name]:.3e}: {reached} starts, certified: {certified}, "
                  f"feasible: {len(good)}  {found.evaluations} evaluations, {seconds:.1f} s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
