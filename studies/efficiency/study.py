"""Where the power goes in the hay press with friction, and what smaller journals or rolling bearings gain.

Run: python -m studies.efficiency.study [OUT]       tables on the screen, losses.png in OUT (default: here)
"""

import dataclasses
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import linkjax as lj
from linkjax.friction import PinFriction

HERE = Path(__file__).parent
PRESSURE, WIDTH = 50e6, 1.25  # Pa, the most on the projected area of a bush; its length over its diameter
ROLLING = {"A": 0.110, "B": 0.100, "F": 0.080}  # m, mean diameters of roller bearings that take the place of bushes
ROLLER = 0.0018  # their coefficient
COLOURS = ("#8a8a8a", "#0072B2", "#D55E00", "#009E73")
Losses = dict[str, float]


def least_radius(force: float) -> float:
    """The least radius (m) of a journal under a force (N), for the pressure on its projected area."""
    return math.sqrt(force / (PRESSURE * 4 * WIDTH))


def losses(scene: lj.Scene) -> tuple[Losses, lj.Cycle]:
    """Work (J) that the friction of every joint takes in a cycle, and the analysis."""
    cycle = lj.analyse(scene, angles=72)
    assert cycle.friction is not None
    return {name: float(loss) for name, loss in cycle.friction.loss.items()}, cycle


def peaks(scene: lj.Scene, pins: Sequence[str]) -> dict[str, float]:
    """The greatest force (N) of some pins."""
    names = {
        pin: name
        for pin in pins
        for name in lj.measures.measure_names(scene)
        if name.startswith(f"peak_reaction.{pin}.")
    }
    found = lj.measures.evaluate(scene, list(names.values()))
    return {pin: float(found[name]) for pin, name in names.items()}


def smaller(scene: lj.Scene) -> lj.design.Optimum:
    """The journals as small as their pressure allows, and the best rod: the efficiency as large as possible."""
    radii = {each.joint: float(each.radius) for each in scene.friction if isinstance(each, PinFriction)}
    least = {pin: least_radius(force) for pin, force in peaks(scene, tuple(radii)).items()}
    free = {f"joints.{pin}.radius": (least[pin], radius) for pin, radius in radii.items() if least[pin] < radius}
    return lj.optimise(
        scene, free={**free, "links.rod.length": "± 3 %"}, maximise="efficiency",
        limits=["delta <= 0.15", "min_transmission_angle >= initial"], starts=1,
    )  # fmt: skip


def rolling(scene: lj.Scene) -> lj.Scene:
    """Roller bearings in place of the largest bushes."""
    rubs = tuple(
        PinFriction(each.joint, ROLLER, ROLLING[each.joint] / 2) if each.joint in ROLLING else each
        for each in scene.friction
    )
    return dataclasses.replace(scene, friction=rubs)


def study(out: Path = HERE) -> dict[str, tuple[Losses, lj.Cycle]]:
    """Losses of all variants."""
    scene = lj.load("press-with-friction")
    best = smaller(scene)
    print(best)
    variants = {"as built": scene, "smaller journals": best.after, "roller bearings": rolling(scene),
                "both": rolling(best.after)}  # fmt: skip
    found = {name: losses(each) for name, each in variants.items()}
    joints = list(next(iter(found.values()))[0])
    print(f"\n{'J per cycle':18s}" + "".join(f"{name:>18s}" for name in found))
    for joint in joints:
        print(f"{joint:18s}" + "".join(f"{each[joint]:18.1f}" for each, _ in found.values()))
    for label, value in (("efficiency", "efficiency"), ("delta", "delta")):
        print(f"{label:18s}" + "".join(f"{float(getattr(cycle, value)):18.4f}" for _, cycle in found.values()))
    figure, ax = plt.subplots(figsize=(7.0, 3.6), layout="constrained")
    rows, height = np.arange(len(joints)), 0.8 / len(found)
    for number, (name, (each, cycle)) in enumerate(found.items()):
        title = f"{name}, {100 * float(cycle.efficiency or 0):.1f} %"
        ax.barh(rows + number * height, [each[joint] for joint in joints], height, color=COLOURS[number], label=title)
    ax.set(yticks=rows + 0.4 - height / 2, xlabel="friction, J per cycle", title="Hay press with friction: efficiency")
    ax.set_yticklabels(joints)
    ax.invert_yaxis()
    ax.legend()
    figure.savefig(out / "losses.png", dpi=150, metadata={"Software": None})
    return found


if __name__ == "__main__":
    lj.enable_x64()
    study(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
