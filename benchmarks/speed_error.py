"""Wall time of one steady cycle over the error of its δ: the methods of linkjax, SciPy, textbooks, float32.

Run: python -m benchmarks.speed_error [--plot FILE]       (plot in docs/speed.md: docs/images/speed_error.png)
Machine: `hay-press-slider`; one design, compiled; medians of rounds. Times of different runs are not comparable.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from benchmarks._timing import by_turns
from benchmarks.baselines.steady_scipy import REFERENCE, shooting, trapezoid
from linkjax._config import use_compilation_cache
from linkjax.motion import steady_by_diffrax, steady_motion

NODES = (32, 48, 64, 80, 96, 128, 160, 224, 320)
POSITIONS = (12, 24, 36, 72, 360)
TOLERANCES = tuple(10.0**-k for k in range(4, 13))
SOLVERS = {"Tsit5": diffrax.Tsit5, "Dopri8": diffrax.Dopri8}


class Point(NamedTuple):
    """One method to compute δ: its name, its setting, wall time (s) and relative error."""

    way: str
    setting: str
    seconds: float
    error: float


def panels(precision: str) -> list[Point]:
    """Quadrature on panels, by the number of nodes."""
    scene, points = lj.load("hay-press-slider"), []
    for nodes in NODES:
        run = jax.jit(lambda scene, nodes=nodes: steady_motion(scene, nodes).delta)
        (taken,) = by_turns(lambda run=run: run(scene))
        points.append(Point(f"panels, {precision}", f"{nodes} nodes", float(np.median(taken)), error(run(scene))))
    return points


def by_diffrax() -> list[Point]:
    """The equation of motion by diffrax, by tolerance (one compilation per solver)."""
    scene, points = lj.load("hay-press-slider"), []
    for name, solver in SOLVERS.items():
        run = jax.jit(lambda scene, tol, solver=solver: steady_by_diffrax(scene, tolerance=tol, solver=solver()).delta)
        for tolerance in TOLERANCES:
            tol = jnp.asarray(tolerance)
            (taken,) = by_turns(lambda run=run, tol=tol: run(scene, tol))
            points.append(Point(f"diffrax {name}", f"{tolerance:.0e}", float(np.median(taken)), error(run(scene, tol))))
    return points


def peers() -> list[Point]:
    """SciPy with shooting, and the equal steps of the textbooks."""
    points = []
    for method in ("LSODA", "DOP853"):
        (taken,) = by_turns(lambda method=method: shooting(method), rounds=7)
        points.append(Point(f"SciPy {method}", "1e-10", float(np.median(taken)), error(shooting(method))))
    for count in POSITIONS:
        (taken,) = by_turns(lambda count=count: trapezoid(count))
        points.append(Point("trapezoid", f"{count} steps", float(np.median(taken)), error(trapezoid(count))))
    return points


def error(delta) -> float:
    """Relative error of δ."""
    return abs(float(delta) / REFERENCE - 1)


def float32() -> list[Point]:
    """The panels in single precision: in another process, because precision is a global setting."""
    command = [sys.executable, "-m", "benchmarks.speed_error", "--float32"]
    found = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return [Point(*row) for row in json.loads(found)]


def plot(points: list[Point], file: Path) -> None:
    """Time over error, one line per method."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.8), layout="constrained")
    axes = figure.subplots()
    colours = ("#0072B2", "#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7", "#000000")
    for way, colour, marker in zip(dict.fromkeys(p.way for p in points), colours, "osD^vP*", strict=False):
        some = [p for p in points if p.way == way]
        axes.loglog([p.error for p in some], [1e3 * p.seconds for p in some], f"{marker}-", color=colour, label=way)
    axes.set(xlabel="relative error of δ", ylabel="wall time of one cycle (ms)", title="hay-press-slider, one design")
    axes.invert_xaxis()
    axes.grid(which="major", color="0.9")
    axes.legend(frameon=False, fontsize="small")
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=120)


def main() -> None:
    """Measure, print, and plot on request."""
    parser = argparse.ArgumentParser(description="Wall time of one steady cycle over the error of its δ.")
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--float32", action="store_true", help="only the panels, in single precision, as JSON")
    asked = parser.parse_args()
    use_compilation_cache()
    if asked.float32:
        print(json.dumps(panels("float32")))
        return
    points = [*panels("float64"), *float32(), *by_diffrax(), *peers()]
    print(f"{'method':18s} {'setting':>10s} {'ms':>10s} {'error of δ':>11s}")
    for p in points:
        print(f"{p.way:18s} {p.setting:>10s} {1e3 * p.seconds:10.3f} {p.error:11.1e}")
    if asked.plot:
        plot(points, asked.plot)


if __name__ == "__main__":
    main()
