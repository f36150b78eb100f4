"""A coursework on the two-cylinder machine: its sums over twelve positions compared with the exact cycle.

Run: python -m studies.two_cylinder.study [OUT]       tables on the screen, twelve_positions.png in OUT (default: here)
"""

import sys
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import linkjax as lj

HERE = Path(__file__).parent
BLUE, VERMILION, GREY = "#0072B2", "#D55E00", "#8a8a8a"


class Sums(NamedTuple):
    """The table of the coursework, from position 0 to the end of the turn.

    Angles (rad), reduced torque of weights and forces (N m), its work (J), the constant drive torque (N m, one number),
    its work (J), and the sum of both works, the change of kinetic energy (J).
    """

    angles: np.ndarray
    resistance: np.ndarray
    resistance_work: np.ndarray
    drive: float
    drive_work: np.ndarray
    energy: np.ndarray


def sums(scene: lj.Scene, positions: int = 12) -> Sums:
    """The method of the coursework: reduced torque at so many positions, trapezoidal rule."""
    angles = np.linspace(0.0, 2 * np.pi, positions + 1)
    torque = np.asarray(jax.vmap(lambda phi: lj.reduced_model(scene, phi).torque)(jnp.asarray(angles)))
    work = np.concatenate([[0.0], np.cumsum(0.5 * (torque[1:] + torque[:-1]) * (2 * np.pi / positions))])
    drive = float(-work[-1] / (2 * np.pi))
    return Sums(angles, torque, work, drive, drive * angles, drive * angles + work)


def exact(scene: lj.Scene, angles: int = 720) -> Sums:
    """The same for the exact cycle; the energy is that of the moving links at their actual speed."""
    cycle = lj.analyse(scene, angles=angles)
    ends = np.linspace(0.0, 2 * np.pi, angles + 1)
    energy = np.asarray(0.5 * cycle.reduced.inertia * cycle.speed**2)
    energy, torque = (np.append(values, values[0]) for values in (energy - energy[0], np.asarray(cycle.reduced.torque)))
    drive = float(cycle.steady.mean_drive_torque)
    return Sums(ends, torque, energy - drive * ends, drive, drive * ends, energy)


def draw(coarse: Sums, fine: Sums, path: Path) -> None:
    """Torque, work and energy of both methods over the crank angle."""
    figure, panels = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
    parts = (
        ("resistance", "reduced torque [N·m]"),
        ("resistance_work", "its work [J]"),
        ("energy", "energy change [J]"),
    )
    for axes, (part, label) in zip(panels, parts, strict=True):
        axes.plot(np.degrees(fine.angles), getattr(fine, part), color=BLUE, label="exact")
        x, y = np.degrees(coarse.angles), getattr(coarse, part)
        axes.plot(x, y, "o-", color=VERMILION, linewidth=1, markersize=4, label="12 positions")
        axes.set(xlabel="crank angle [°]", ylabel=label, xlim=(0, 360), xticks=range(0, 361, 60))
        axes.axhline(0.0, color=GREY, linewidth=0.6)
    panels[1].legend(frameon=False)
    figure.savefig(path, dpi=120)


def main(out: Path = HERE) -> None:
    """Print the tables and draw the figure."""
    lj.enable_x64()
    scene = lj.load("two-cylinder")
    coarse, fine = sums(scene), exact(scene)
    heads = ("position", "M_O [N m]", "A_O [J]", "A_P [J]", "energy [J]", "exact [J]")
    print("".join(f"{head:>12s}" for head in heads))
    columns = coarse.resistance, coarse.resistance_work, coarse.drive_work, coarse.energy, fine.energy[::60]
    for n, row in enumerate(zip(*columns, strict=True)):
        print(f"{n:12d}" + "".join(f"{x:12.4f}" for x in row))
    print(
        f"\n{'positions':>12s}{'drive [N m]':>14s}{'work [J]':>14s}{'error':>10s}{'energy span [J]':>18s}{'error':>10s}"
    )
    span = np.ptp(fine.energy)
    for count in (12, 24, 36, 72, 360):
        each = sums(scene, count)
        errors = each.drive / fine.drive - 1, np.ptp(each.energy) / span - 1
        start = f"{each.drive:14.6f}{each.resistance_work[-1]:14.6f}{errors[0]:10.3%}"
        print(f"{count:12d}{start}{np.ptp(each.energy):18.4f}{errors[1]:10.3%}")
    print(f"{'exact':>12s}{fine.drive:14.6f}{fine.resistance_work[-1]:14.6f}{'':10s}{span:18.4f}")
    out.mkdir(parents=True, exist_ok=True)
    draw(coarse, fine, out / "twelve_positions.png")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
