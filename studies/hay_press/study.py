"""The hay press of a thesis: printed values compared with those of linkjax, then the press optimised.

Run: python -m studies.hay_press.study [OUT]       tables on the screen, shaking_force.png in OUT (default: here)
"""

import json
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import linkjax as lj

HERE = Path(__file__).parent
PRINTED = json.loads((HERE.parents[1] / "tests/data/printed.json").read_text(encoding="utf-8"))
BLUE, GREY = "#0072B2", "#8a8a8a"


def compared(press: lj.Scene) -> list[tuple[str, jax.Array, float, float]]:
    """All values that the thesis prints for 45 degrees, without its misprints: name, ours, printed, tolerance."""
    parts = jax.jit(lambda scene, phi: (lj.pose(scene.mechanism, phi), lj.reduced_model(scene, phi).inertia))
    at, inertia = parts(press, jnp.radians(45.0))
    rows = []
    for order, coefficient, mark in (("positions", "r", ""), ("first", "dr", "'"), ("second", "ddr", "''")):
        within = PRINTED[order]["tolerance"]
        for point, pair in PRINTED[order]["values"].items():
            ours = getattr(at.points[point], coefficient)
            both = zip("xy", (ours.x, ours.y), pair, strict=True)
            rows += [(f"{point} {axis}{mark}", value, printed, within) for axis, value, printed in both if printed]
    for link, pair in PRINTED["rates"]["values"].items():
        both = zip(("w", "e"), ("ω'", "ε'"), pair, PRINTED["rates"]["tolerances"][link], strict=True)
        rows += [(f"{link} {mark}", getattr(at.links[link], of), printed, within) for of, mark, printed, within in both]
    printed, within = PRINTED["reduced_inertia"]["value"], PRINTED["reduced_inertia"]["relative"]
    return [*rows, ("reduced inertia", inertia, printed, within * printed)]


def draw(before: lj.Cycle, after: lj.Cycle, path: Path) -> None:
    """Shaking force at constant speed, before and after: as a hodograph and over the crank angle."""
    figure, (polar, course) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained", width_ratios=(1.2, 1))
    for cycle, label, colour in ((before, "original design", GREY), (after, "optimised", BLUE)):
        force = cycle.forces_constant_speed.shaking
        fx, fy = (np.append(f, f[0]) / 1e3 for f in (force.fx, force.fy))
        polar.plot(fx, fy, color=colour, label=label)
        course.plot(np.linspace(0, 360, fx.size), np.hypot(fx, fy), color=colour, label=label)
    polar.set(aspect="equal", xlabel="horizontal [kN]", ylabel="vertical [kN]", title="Shaking force at 700 rpm")
    course.set(xlim=(0, 360), ylim=(0, None), xticks=range(0, 361, 60), xlabel="crank angle [°]", ylabel="size [kN]")
    course.legend(frameon=False)
    figure.savefig(path, dpi=120)


def main(out: Path = HERE) -> None:
    """Print both tables and draw the figure."""
    lj.enable_x64()
    print(f"{'at 45 degrees':18s}{'linkjax':>12s}{'printed':>12s}{'difference':>13s}")
    for name, ours, printed, _ in compared(lj.load("hay-press")):
        print(f"{name:18s}{ours:12.6f}{printed:12.4f}{ours - printed:13.1e}")
    scene, asked = lj.load_problem("hay-press")
    best = lj.optimise(scene, **asked)
    before, after = lj.analyse(best.before, angles=720), lj.analyse(best.after, angles=720)
    was, became = lj.analysis.measured(before), lj.analysis.measured(after)
    print(f"\n{'':42s}{'before':>12s}{'after':>12s}")
    for name in was:
        unit = lj.measures.MEASURES[name].unit
        print(f"{name:42s}{was[name]:12.5g}{became[name]:12.5g} {'' if unit == '1' else unit}")
    for name, (was_at, is_at) in best.variables.items():
        print(f"{name:42s}{was_at:12.5g}{is_at:12.5g}")
    for point in best.trade_off:
        print(f"with {best.traded} <= {point.bound:<18g}{'':12s}{point.objective:12.5g} N")
    print(
        f"\n{best.starts_at_optimum} of {len(best.starts)} starts reached the optimum, "
        f"KKT residual {best.kkt_residual:.0e}"
    )
    out.mkdir(parents=True, exist_ok=True)
    draw(before, after, out / "shaking_force.png")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
