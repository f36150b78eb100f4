"""Which motor and which flywheel for the hay press: the least flywheel for each motor of a list.

Run: python -m studies.press_motor.study [OUT]       table on the screen, trade_off.png in OUT (default: here)
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import linkjax as lj
from linkjax.design import Optimum

HERE = Path(__file__).parent
RPM = math.pi / 30
SPEED, SYNCHRONOUS, CREEP, DELTA = 700 * RPM, 1500.0, 0.01, 0.15
INERTIAS = np.geomspace(10.0, 320.0, 11)  # kg m^2, of the flywheels in the figure
MEASURES = ("delta", "slow_down", "rms_motor_torque", "max_motor_torque", "energy_per_cycle")
HEADS = ("motor", "slip", "flywheel", "delta", "slow-down", "RMS/rated", "max/rated", "kJ/cycle")
WIDTH = 18
COLOURS = ("#0072B2", "#56B4E9", "#D55E00", "#009E73", "#8a8a8a")


class Plate(NamedTuple):
    """A type plate: rated power (kW) and speed (rpm), breakdown and starting torque over rated; rotor (kg m²)."""

    power: float
    speed: float
    breakdown: float
    starting: float
    rotor: float

    @property
    def name(self) -> str:
        """As in the table."""
        return f"{self.power:g} kW, {self.speed:g} rpm"

    @property
    def torque(self) -> float:
        """Rated torque (N m)."""
        return 1e3 * self.power / (self.speed * RPM)


PLATES = (  # invented, but as in catalogues: four poles, 0.8 %, 4 % and 8 % slip
    Plate(132, 1488, 2.8, 2.3, 2.7),
    Plate(160, 1488, 2.8, 2.3, 3.2),
    Plate(132, 1440, 2.6, 2.2, 2.7),
    Plate(132, 1380, 2.6, 2.4, 2.9),
    Plate(110, 1440, 2.6, 2.2, 2.2),
)


class Row(NamedTuple):
    """The press with a motor and a flywheel (kg m²), whether that is enough, and the measures in SI units."""

    plate: Plate
    flywheel: float
    enough: bool
    measures: dict[str, float]


def press(plate: Plate) -> lj.Scene:
    """The press with this motor, and the belt that gives 700 rpm at rated speed."""
    return lj.load(
        "press-with-motor",
        {
            "motor.rated_power": f"{plate.power} kW",
            "motor.rated_speed": f"{plate.speed} rpm",
            "motor.breakdown_ratio": plate.breakdown,
            "motor.starting_ratio": plate.starting,
            "motor.inertia": plate.rotor,
            "motor.ratio": plate.speed * RPM * (1 - CREEP) / SPEED,
        },
    )


def with_flywheel(scene: lj.Scene, inertia: float) -> lj.Scene:
    """The press with a flywheel of this inertia (kg m²)."""
    return eqx.tree_at(lambda scene: scene.mechanism.flywheel.inertia, scene, jnp.asarray(inertia))


def measured(scene: lj.Scene, inertia: float) -> dict[str, float]:
    """The measures (SI) with this flywheel (kg m²)."""
    found = lj.measures.evaluate(with_flywheel(scene, inertia), MEASURES)
    return {name: float(value) for name, value in found.items()}


def least_flywheel(plate: Plate) -> Optimum:
    """The least flywheel with which the RMS torque of the motor is at most its rated torque, and δ at most 0.15."""
    return lj.optimise(
        press(plate),
        free={"flywheel.inertia": f"{INERTIAS[0]} to {INERTIAS[-1]} kg m^2"},
        minimise="flywheel.inertia",
        limits=[f"rms_motor_torque <= {plate.torque} N m", f"delta <= {DELTA}"],
    )


def chosen(plate: Plate) -> Row:
    """The press with this motor and its least flywheel; without one, with the largest flywheel in the list."""
    best = least_flywheel(plate)
    inertia = float(best.after.mechanism.flywheel.inertia) if best.feasible else float(INERTIAS[-1])
    return Row(plate, inertia, best.feasible, measured(press(plate), inertia))


def cells(row: Row) -> tuple[str, ...]:
    """One row of the table."""
    found, rated = row.measures, row.plate.torque
    return (
        row.plate.name,
        f"{100 * (1 - row.plate.speed / SYNCHRONOUS):.1f} %",
        f"{row.flywheel:.1f}" if row.enough else "none",
        f"{found['delta']:.4f}",
        f"{100 * found['slow_down']:.2f} %",
        f"{found['rms_motor_torque'] / rated:.3f}",
        f"{found['max_motor_torque'] / rated:.3f}",
        f"{found['energy_per_cycle'] / 1e3:.3f}",
    )


def draw(rows: Sequence[Row], path: Path) -> None:
    """RMS torque over rated torque, and δ, over the inertia of the flywheel."""
    figure, (heat, rest) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    for row, colour in zip(rows, COLOURS, strict=True):
        curve = [measured(press(row.plate), inertia) for inertia in INERTIAS]
        torques = [found["rms_motor_torque"] / row.plate.torque for found in curve]
        heat.plot(INERTIAS, torques, color=colour, label=row.plate.name)
        rest.plot(INERTIAS, [found["delta"] for found in curve], color=colour)
        if row.enough:
            heat.plot(row.flywheel, row.measures["rms_motor_torque"] / row.plate.torque, "o", color=colour)
            rest.plot(row.flywheel, row.measures["delta"], "o", color=colour)
    for axes, label, most in ((heat, "RMS torque / rated torque", 1.0), (rest, "δ", DELTA)):
        axes.axhline(most, color="#8a8a8a", linewidth=0.8, linestyle="--")
        axes.set(xscale="log", xlabel="inertia of the flywheel [kg·m²]", ylabel=label)
    heat.legend(frameon=False)
    figure.savefig(path, dpi=120)


def main(out: Path = HERE) -> None:
    """Print the table and draw the figure."""
    lj.enable_x64()
    rows = []
    print("".join(head.rjust(WIDTH) for head in HEADS))
    for plate in PLATES:
        rows.append(chosen(plate))
        print("".join(cell.rjust(WIDTH) for cell in cells(rows[-1])), flush=True)
    out.mkdir(parents=True, exist_ok=True)
    draw(rows, out / "trade_off.png")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
