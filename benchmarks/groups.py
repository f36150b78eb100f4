"""Cost of a group: time per position over the number of groups, and class II groups compared with numba.

Run: python -m benchmarks.groups [--plot FILE] [ROW ...]     rows: growth numba (default: both)

`growth`: a chain of four-bars, 1 to 16 dyads, time per position with a straight-line fit. `numba`: four-bar,
quick-return and Stephenson III, positions with first and second coefficients of all pins. Both programs write the same
numbers to memory (this program stops if they differ by more than 1e-12). Results are the speed-up of linkjax over
numba, as medians of paired ratios. numba writes into the same memory every time; linkjax, like any JAX program, into
new arrays, for which freed memory is kept. On a shared machine the best turns are more reliable than the medians,
because threads that wait for each other are slowed down most.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from benchmarks._timing import by_turns, keep_memory, line, ratio
from linkjax._config import use_compilation_cache
from linkjax.kinematics import pose

NODES, DESIGNS, BLOCK = 64, 4000, 50
COUNTS = (1, 2, 3, 4, 6, 8, 10, 12, 14, 16)
SPREAD = 1e-3  # relative, of every number, between designs
AGREE = 1e-12  # relative to the largest: both must write the same numbers


def chain(count: int) -> lj.Mechanism:
    """A crank and so many dyads, each driven by an arm on the rocker of the previous one."""
    fixed, links = {"A": lj.Vec(0.0, 0.0)}, {"crank": lj.Link(length=0.1)}
    groups: list[lj.groups.AbstractGroup] = [lj.Crank("crank", "A", "K0")]
    for i in range(1, count + 1):
        fixed[f"F{i}"] = lj.Vec(0.38 * i, 0.02 * i)
        links |= {f"a{i}": lj.Link(length=0.35), f"b{i}": lj.Link(length=0.25, points={f"K{i}": lj.Vec(0.08, -0.05)})}
        groups.append(lj.RRR((f"a{i}", f"b{i}"), f"K{i - 1}", f"F{i}", f"G{i}"))
    return lj.Mechanism(fixed, links, groups)


def many(tree, count: int):
    """Random designs around one design, in every leaf."""
    rng = np.random.default_rng(0)
    return jax.tree.map(lambda d: jnp.asarray(d * (1 + SPREAD * rng.normal(size=(count, *jnp.shape(d))))), tree)


def pins(mechanism: lj.Mechanism, names: list[str], links: list[str]) -> list[jax.Array]:
    """r, r', r'' of points, ω' and ε' of links, at all angles."""

    def at(phi):
        here = pose(mechanism, phi)
        vectors = [v for name in names for v in here.points[name]]
        rates = [rate for name in links for rate in (here.links[name].w, here.links[name].e)]
        return [*(part for v in vectors for part in (v.x, v.y)), *rates]

    return jax.vmap(at)(jnp.arange(NODES) * (2 * jnp.pi / NODES))


def growth(file: Path | None) -> None:
    """Time per position over the number of groups."""
    runs: list[Callable[[], object]] = []
    for count in COUNTS:
        names = [f"G{i}" for i in range(1, count + 1)]
        links = [f"{side}{i}" for i in range(1, count + 1) for side in "ab"]
        ours = lj.map_designs(lambda m, names=names, links=links: pins(m, names, links), block=BLOCK)
        designs = many(chain(count), DESIGNS // 4)
        runs.append(lambda ours=ours, designs=designs: ours(designs))
    each = np.asarray([np.median(t) for t in by_turns(*runs)]) / (DESIGNS // 4 * NODES) * 1e9
    slope, start = np.polyfit(COUNTS, each, 1)
    for count, taken in zip(COUNTS, each, strict=True):
        line(f"growth.{count}", taken, "ns/position")
    line("growth.a_group", slope, "ns")
    line("growth.besides", start, "ns")
    off = each - (start + slope * np.asarray(COUNTS))
    line("growth.straight", 1 - np.sum(off**2) / np.sum((each - np.mean(each)) ** 2), "R2")
    line("growth.steepest", np.max(np.diff(each) / np.diff(COUNTS)) / slope, "times_the_slope")
    if file is not None:
        plot(file, each, float(slope), float(start))


def plot(file: Path, each: np.ndarray, slope: float, start: float) -> None:
    """The measured times and their straight-line fit."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 16], [start, start + 16 * slope], color="0.6", label=f"{slope:.0f} ns per group")
    axes.plot(COUNTS, each, "o", label="measured")
    axes.set(xlabel="groups (RRR) after the crank", ylabel="ns per position", xlim=(0, 16.5), ylim=(0, None))
    axes.legend(frameon=False)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=100)


# fixed points, links, coupler points, in the order of the numbers of the baseline; then the outputs
MACHINES = {
    "four-bar": (("A", "D"), ("crank", "coupler", "rocker"), {}, ["B", "C"], ["coupler", "rocker"]),
    "quick-return": (("O", "P", "T"), ("crank", "lever", "rod"), {}, ["B", "E", "R"], ["lever", "rod"]),
    "stephenson-3": (("A", "D", "F"), ("crank", "coupler", "rocker", "arm", "lever"), {"E": "coupler"},
                     ["B", "C", "E", "G"], ["coupler", "rocker", "arm", "lever"]),
}  # fmt: skip


def with_numbers(mechanism: lj.Mechanism, name: str, numbers: jax.Array) -> lj.Mechanism:
    """The built-in machine with these numbers, in the order of the baseline."""
    spots, bars, marks, _, _ = MACHINES[name]
    values = iter(numbers)
    fixed = {spot: lj.Vec(next(values), next(values)) for spot in spots}
    links = dict(mechanism.links)
    for bar in bars:
        links[bar] = dataclasses.replace(links[bar], length=next(values))
    for mark, bar in marks.items():
        points = {**links[bar].points, mark: lj.Vec(next(values), next(values))}
        links[bar] = dataclasses.replace(links[bar], points=points)
    return lj.Mechanism(fixed, links, mechanism.groups)


def numbers_of(mechanism: lj.Mechanism, name: str) -> np.ndarray:
    """The numbers of the built-in machine, in the order of the baseline."""
    spots, bars, marks, _, _ = MACHINES[name]
    places = [mechanism.fixed[spot] for spot in spots]
    held = [mechanism.links[bar].points[mark] for mark, bar in marks.items()]
    lengths = [float(mechanism.links[bar].length) for bar in bars]
    first, last = ([float(part) for at in some for part in (at.x, at.y)] for some in (places, held))
    return np.asarray([*first, *lengths, *last])


def numba() -> None:
    """Class II groups compared with loops written by hand."""
    from benchmarks.baselines.dyads_numba import SWEEPS

    for name, (_, _, _, points, links) in MACHINES.items():
        mechanism, rng = lj.load(name).mechanism, np.random.default_rng(0)
        base = numbers_of(mechanism, name)
        designs = base * (1 + SPREAD * rng.normal(size=(DESIGNS, len(base))))
        out = np.empty((DESIGNS, NODES, 6 * len(points) + 2 * len(links)))
        mine = jnp.asarray(designs)
        ours = lj.map_designs(
            lambda d, m=mechanism, name=name, p=points, k=links: pins(with_numbers(m, name, d), p, k), block=BLOCK
        )
        sweep = SWEEPS[name]
        sweep(designs, NODES, out)
        apart = [np.max(np.abs(np.asarray(x) - out[:, :, i])) / np.max(np.abs(out[:, :, i - i % 2]))
                 for i, x in enumerate(ours(mine)) if np.any(out[:, :, i])]  # fmt: skip
        if not max(apart) <= AGREE:
            raise SystemExit(f"numba.{name}: linkjax and numba differ by {max(apart):.1e}; times are not comparable")
        a, b = by_turns(lambda ours=ours, mine=mine: ours(mine), lambda s=sweep, d=designs, o=out: s(d, NODES, o))
        rate = DESIGNS * NODES / 1e6
        for who, taken in (("linkjax", a), ("numba", b)):
            line(f"numba.{name}.{who}", rate / np.median(taken), "M_positions/s")
            line(f"numba.{name}.{who}.best", rate / np.min(taken), "M_positions/s")
        line(f"numba.{name}.largest_difference", max(apart), "relative")
        ratio(f"numba.{name}.times_numba", b / a)


def main() -> None:
    """Run the selected rows."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("rows", nargs="*", metavar="ROW", help="growth, numba")
    words.add_argument("--plot", type=Path, default=Path("out/groups.png"), metavar="FILE")
    asked = words.parse_args()
    keep_memory()
    lj.use_cpu_devices()
    use_compilation_cache()
    for row in asked.rows or ("numba", "growth"):
        if row == "growth":
            growth(asked.plot)
        else:
            numba()


if __name__ == "__main__":
    main()
