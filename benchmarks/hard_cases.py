"""The figures and tables of docs/hard-cases.md: errors near singular positions, at change points, at all scales.

Run: python -m benchmarks.hard_cases [NAME ...]       about five minutes for all; written to docs/images
Reference values come from the tests: 160 digits, or closed forms.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import linkjax as lj
from benchmarks import float32
from linkjax._config import use_compilation_cache
from linkjax.kinematics import crank_ranges, margins, pose, prepared
from tests.physics import near_dead, test_change_points, test_degenerate, test_hard_cases, test_scales

IMAGES = Path(__file__).parents[1] / "docs" / "images"
PARTS = ("position", "coefficients", "reactions", "gradients")
COLOURS = dict(zip(PARTS, ("#0072B2", "#009E73", "#E69F00", "#D55E00"), strict=True))


def singular_positions() -> Figure:
    """Error of each part over the distance, with the effect of half a rounding error in every number."""
    figure = Figure(figsize=(9.0, 5.6), layout="constrained")
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    distances = 10.0 ** -np.arange(2.0, 15.0)
    for ax, case in zip(axes.flat, near_dead.CASES, strict=True):
        found = [near_dead.judged(case, float(d)) for d in distances]
        for part in PARTS:
            sizes = [np.max(f[part].size) for f in found]
            errors = [max(np.max(f[part].error) / s, 1e-17) for f, s in zip(found, sizes, strict=True)]
            allowed = [near_dead.HALF * np.max(f[part].condition + f[part].size) / s
                       for f, s in zip(found, sizes, strict=True)]  # fmt: skip
            ax.loglog(distances, allowed, "-", color=COLOURS[part], linewidth=1)
            ax.loglog(distances, errors, "o", color=COLOURS[part], markersize=3, label=part)
        worst = max(f[part].excess() for f in found for part in PARTS)
        print(f"{case:16s} largest error over the bound from the condition number: {worst:.2f}")
        ax.set_title(case, fontsize="medium")
        ax.grid(color="0.9")
    axes[0, 0].invert_xaxis()
    axes[0, 0].legend(frameon=False, fontsize="small", loc="upper left")
    figure.supxlabel("distance to the singular position, relative to the length")
    figure.supylabel("relative error (dots), condition number × 1.1e-16 (lines)")
    return figure


def change_points() -> Figure:
    """A slider-crank through its change points, and errors over the distance to a change point."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    phi = jnp.linspace(0.0, 2 * math.pi, 361)
    for branch, style in (("fixed", "--"), ("continue", "-")):
        machine = prepared(test_change_points.slider(branch))
        x = jax.jit(jax.vmap(lambda one, m=machine: pose(m, one).points["D"].r.x))(phi)
        left.plot(np.degrees(phi), x, style, label=f'branch = "{branch}"')
    left.set(
        xlabel="crank angle (degrees)", ylabel="slider (m)", title="rod length = crank length", xticks=range(0, 361, 90)
    )
    left.legend(frameon=False, fontsize="small")
    away = np.geomspace(1e-12, 1.0, 61)
    machine = prepared(test_change_points.four_bar(0.1, 0.4, 0.1, 0.4))
    here = jax.jit(jax.vmap(lambda one: pose(machine, one)))(jnp.asarray(math.pi + away))
    rocker, u = here.links["rocker"], np.exp(1j * (math.pi + away))
    errors = {
        "direction": np.abs(np.asarray(rocker.u.x) + 1j * np.asarray(rocker.u.y) - u),
        "first coefficient": np.abs(np.asarray(rocker.w) - 1),
        "second coefficient": np.abs(np.asarray(rocker.e)),
    }
    for name, error in errors.items():
        right.loglog(away, np.maximum(error, 1e-17), ".-", markersize=3, linewidth=0.7, label=name)
        print(f"parallelogram, rocker: largest error of the {name} {np.max(error):.1e}")
    right.set(
        xlabel="angle from the change point (rad)", ylabel="error", title="parallelogram, rocker", ylim=(5e-18, 1e-9)
    )
    right.legend(frameon=False, fontsize="small")
    return figure


def range_of_a_crank() -> Figure:
    """Margins of a four-bar whose crank cannot rotate fully, and the ends of its range."""
    figure = Figure(figsize=(7.0, 3.4), layout="constrained")
    ax = figure.subplots()
    machine, phi = test_hard_cases.four_bar(0.3, 0.35, 0.15, 0.4), jnp.linspace(-math.pi, math.pi, 361)
    found = jax.jit(jax.vmap(lambda one: margins(machine, one)["coupler-rocker"]))(phi)
    for side, margin in found.items():
        ax.plot(np.degrees(phi), margin.value, label=side)
    ax.axhline(0.0, color="0.3", linewidth=0.8)
    for one in crank_ranges(machine):
        ends = (math.degrees(math.remainder(a, 2 * math.pi)) for a in (one.start, one.stop))
        ax.axvspan(*ends, color="#009E73", alpha=0.15)
        exact = [math.acos((0.25 - r**2) / 0.24) for r in (0.2, 0.5)]
        wrong = max(min(abs(abs(math.remainder(a, 2 * math.pi)) - e) for e in exact) for a in (one.start, one.stop))
        print(f"crank range {one}: error of its ends {wrong:.1e} rad")
    ax.set(xlabel="crank angle (degrees)", ylabel="margin", xticks=range(-180, 181, 60),
           title="crank 0.3, coupler 0.35, rocker 0.15, frame 0.4 m")  # fmt: skip
    ax.legend(frameon=False)
    return figure


def bars(scenes: dict[str, Iterable[dict[str, near_dead.Judged]]]) -> Figure:
    """Largest error over the bound from the condition number of the problem, by scene and part."""
    figure = Figure(figsize=(8.0, 0.45 * len(scenes) + 1.0), layout="constrained")
    ax = figure.subplots()
    for k, (name, judged) in enumerate(scenes.items()):
        found = [{part: each.excess() for part, each in one.items()} for one in judged]
        worst = {part: max(one[part] for one in found) for part in PARTS}
        print(f"{name:36s} " + "  ".join(f"{part} {worst[part]:.2f}" for part in PARTS), flush=True)
        for i, part in enumerate(PARTS):
            ax.barh(k + 0.2 * (i - 1.5), worst[part], 0.18, color=COLOURS[part], label=None if k else part)
    ax.axvline(10.0, color="0.3", linestyle="--", linewidth=1)
    ax.set(xscale="log", xlim=(1e-3, 30.0), xlabel="error over effect of half a rounding in every number (limit 10)")
    ax.set_yticks(range(len(scenes)), list(scenes))
    ax.invert_yaxis()
    ax.legend(frameon=False, fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def scales() -> Figure:
    """Machines with very different sizes, or far from the origin, at three crank angles each."""

    def judged(scene: lj.Scene) -> Iterator[dict[str, near_dead.Judged]]:
        return (near_dead.judge(test_scales.turned(scene, angle)) for angle in test_scales.LATER)

    return bars({name: judged(scene) for name, scene in test_scales.HARD.items()})


def degenerate() -> Figure:
    """Machines with zero dimensions."""
    return bars({name: [test_degenerate.judged(name)] for name in test_degenerate.DEGENERATE})


def single_precision() -> Figure:
    """Correct digits in float32 for each built-in scene; no bar where there is nothing to compare."""
    figure = Figure(figsize=(8.0, 8.5), layout="constrained")
    ax, colours = figure.subplots(), ("#0072B2", "#009E73", "#CC79A7", "#E69F00", "#D55E00")
    for k, scene in enumerate(float32.NAMES):
        found = float32.digits(scene)
        print(float32.row(scene, found), flush=True)
        for i, what in enumerate(float32.PARTS):
            label = None if k else what.replace("_", " ")
            ax.barh(k + 0.16 * (i - 2), found.get(what, 0.0), 0.15, color=colours[i], label=label)
    ax.axvline(4.0, color="0.3", linestyle="--", linewidth=1)
    ax.set_yticks(range(len(float32.NAMES)), float32.NAMES, fontsize="small")
    ax.set(xlabel="digits in float32", xlim=(0.0, 8.0), ylim=(len(float32.NAMES) - 0.4, -0.6))
    figure.legend(frameon=False, fontsize="small", ncols=5, loc="outside upper center")
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "crank-ranges": range_of_a_crank,
    "change-points": change_points,
    "scales": scales,
    "degenerate": degenerate,
    "singular-positions": singular_positions,
    "float32": single_precision,
}


def main() -> None:
    """Draw the selected figures."""
    parser = argparse.ArgumentParser(description="The figures of docs/hard-cases.md.")
    parser.add_argument("names", nargs="*", help="names of figures (default: all)")
    names = parser.parse_args().names or list(FIGURES)
    use_compilation_cache()
    IMAGES.mkdir(parents=True, exist_ok=True)
    for name in names:
        file = IMAGES / f"hard-{name}.png"
        FIGURES[name]().savefig(file, dpi=100)
        Image.open(file).convert("RGB").quantize(64).save(file, optimize=True)


if __name__ == "__main__":
    main()
