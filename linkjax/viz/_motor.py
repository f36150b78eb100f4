"""Figures for the choice of a motor: operating loop on the characteristic, energy-mass diagram, harmonics."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from linkjax._display import Units, number, prefixed, turning
from linkjax.analysis import energy_mass
from linkjax.drives import ConstantTorque, InductionMotor, NoMotor, Servo
from linkjax.machine import Scene
from linkjax.viz._style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    VERMILION,
    Data,
    before_keys,
    behind,
    closed,
    key,
    label,
    largest,
    sheet,
    styled,
)

LOADS = "loads alone, at the motor's shaft"
CURVE = 300  # points of a characteristic
BARS = {"drive_torque": BLUE, "motor_torque": VERMILION, "crank_speed": GREEN}
UNIT = {"N m": "N·m"}


def has_loop(data: Data, scene: Scene) -> bool:
    """Whether an analysis has an operating loop: the torque of the motor depends on its speed."""
    return bool(data.get("motor")) and scene.motor is not None and not isinstance(
        scene.motor.motor, ConstantTorque | NoMotor
    )  # fmt: skip


@styled
def operating_loop_figure(
    data: Data, scene: Scene, before: Data | None = None, units: Units | None = None
) -> Figure:  # fmt: skip
    """Torque of the motor over its speed in the cycle, on its characteristic; the torque that the loads alone need,
    without inertia and losses; and the rated point and the limits of the type plate.

    Raises `ValueError` without a motor whose torque depends on its speed.
    """
    if not has_loop(data, scene) or scene.motor is None:
        raise ValueError("the scene has no motor whose torque depends on its speed; add one for an operating loop")
    turn, per = turning(units)
    run, motor, found = data["motor"], scene.motor.motor, energy_of_loads(data)
    speed, torque = closed(data, run["speed"]), closed(data, run["torque"])
    load = run["overload"] or {}
    low, high = _reach(speed, motor)
    shafts = np.linspace(low, high, CURVE)
    curve = np.asarray(motor.torque(jnp.asarray(shafts)), float)
    rated = load.get("rated_torque")
    shown = [torque, found, *([curve] if _whole(motor, curve, torque) else [])]
    factor, unit = prefixed(largest(shown), "N·m", units)
    looks = {
        "characteristic": {"color": GREY, "linewidth": 1.2},
        "motor torque in the cycle": {"color": BLUE, "linewidth": 2.0},
        LOADS: {"color": VERMILION, "linewidth": 1.2, "linestyle": (0, (4, 1.4))},
    }
    if isinstance(motor, Servo):
        looks["limits"] = looks.pop("characteristic")
    if scene.mechanism.prescribed:  # the reduced torque is that on the phase of the law
        found = np.zeros_like(torque)
        del looks[LOADS]
    keys = [key(name, **look) for name, look in looks.items()]
    dot = {"color": BLACK, "marker": "D", "markersize": 4.5, "linewidth": 0}
    keys += [key("rated point", **dot)] if rated is not None else []
    keys += before_keys(before)
    figure, ((ax,),) = sheet("Operating loop of the motor", 1, 1, panel=3.0, keys=keys)
    if before and before.get("motor"):
        old = before["motor"]
        behind(ax, turn * closed(before, old["speed"]), factor * closed(before, old["torque"]))
    if isinstance(motor, Servo):
        x, y = turn * float(motor.max_speed), factor * float(motor.max_torque)
        ax.plot([-x, x, x, -x, -x], [-y, -y, y, y, -y], **looks["limits"])
    else:
        ax.plot(turn * shafts, factor * curve, **looks["characteristic"])
    if (loads := looks.get(LOADS)) is not None:
        ax.plot(turn * speed, factor * found, **loads)
    ax.plot(turn * speed, factor * torque, **looks["motor torque in the cycle"])
    if rated is not None:
        ax.plot([turn * _rated_speed(motor, float(rated), low, high)], [factor * float(rated)], **dot)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.set_title(label("torque at the motor's shaft", unit))
    ax.set_xlabel(f"motor speed  ({per})")
    return figure


def energy_of_loads(data: Data) -> np.ndarray:
    """The torque of the loads at the motor's shaft over the closed cycle (N m): that which balances the reduced torque
    without inertia and losses."""
    return -closed(data, data["reduced"]["torque"]) / float(data["motor"]["ratio"])


def _reach(speed: np.ndarray, motor: Any) -> tuple[float, float]:
    """The range of motor speeds that is drawn (rad/s)."""
    idle = None if isinstance(motor, Servo) else motor.no_load_speed()
    ends = [0.0, *speed[np.isfinite(speed)], *([] if idle is None or not np.isfinite(idle) else [float(idle)])]
    low, high = min(ends), max(ends)
    return low, high + 0.05 * max(high - low, 1e-9)


def _whole(motor: Any, curve: np.ndarray, torque: np.ndarray) -> bool:
    """Whether the axis is for the whole characteristic: not for that of a DC motor at rest, many times the torque."""
    return isinstance(motor, InductionMotor | Servo) or largest([curve]) < 8 * largest([torque])


def _rated_speed(motor: Any, rated: float, low: float, high: float) -> float:
    """The speed at which the characteristic has the rated torque, beyond the breakdown (rad/s)."""
    shafts = np.linspace(low, high, 4001)
    above = np.flatnonzero(np.asarray(motor.torque(jnp.asarray(shafts)), float) >= rated)
    return float(shafts[above[-1]]) if above.size else float(low)


@styled
def energy_mass_figure(
    data: Data, scene: Scene, before: Data | None = None, units: Units | None = None
) -> Figure:  # fmt: skip
    """Wittenbauer's energy-mass diagram: change of kinetic energy over reduced inertia, with the tangents that give the
    largest and the smallest speed; see `linkjax.analysis.energy_mass`."""
    found = energy_mass(data, scene)
    turn, per = turning(units)
    factor, unit = prefixed(largest([found.energy, np.asarray([found.origin])]), "J", units)
    mass, mass_unit = prefixed(largest([found.inertia]), "kg·m²", units)
    sides = (("max", found.max_slope, found.max_point, VERMILION), ("min", found.min_slope, found.min_point, GREEN))
    keys = [key("change of kinetic energy since φ = 0", color=BLUE, linewidth=1.7)]
    for which, slope, _, colour in sides:
        text = f"slope ω²/2 at ω {which} {number(turn * float(np.sqrt(2 * slope)))} {per}"
        keys.append(key(text, color=colour, linewidth=1.1))
    keys += before_keys(before)
    figure, ((ax,),) = sheet("Energy-mass diagram", 1, 1, panel=3.2, keys=keys)
    if before:
        old = energy_mass(before, scene)
        behind(ax, mass * closed(before, old.inertia), factor * closed(before, old.energy))
    end = 1.06 * largest([found.inertia])
    for _, slope, point, colour in sides:
        ax.plot([0.0, mass * end], [factor * found.origin, factor * (found.origin + slope * end)],
                color=colour, linewidth=1.1)  # fmt: skip
        ax.plot([mass * point[0]], [factor * point[1]], "o", color=colour, markersize=4)
    ax.plot(mass * closed(data, found.inertia), factor * closed(data, found.energy), color=BLUE, linewidth=1.7)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.set_xlim(left=0.0)
    ax.set_title(label("kinetic energy", unit))
    ax.set_xlabel(f"reduced inertia, with flywheel and rotor  ({mass_unit})")
    return figure


@styled
def harmonics_figure(
    data: Data, scene: Scene, before: Data | None = None, units: Units | None = None
) -> Figure:  # fmt: skip
    """Amplitudes of the harmonics of torque and speed by order of the crank's revolution. Raises `ValueError` where the
    document has none."""
    every = data.get("harmonics") or {}
    if not every:
        raise ValueError("the analysis has no harmonics; analyse a scene with a motor, or add lj.harmonics(...)")
    keys = before_keys(before)
    figure, rows = sheet("Harmonics over the crank angle", len(every), 1, panel=1.25, keys=keys)
    for row, (name, found) in zip(rows, every.items(), strict=True):
        ax, order = row[0], np.asarray(found["order"], float)
        amplitude = np.asarray(found["amplitude"], float)
        unit = str(UNIT.get(found["unit"], found["unit"]))
        factor, shown = turning(units) if unit == "rad/s" else prefixed(largest([amplitude]), unit, units)
        wide = 0.62 * float(order[0])
        ax.bar(order, factor * amplitude, width=wide, color=BARS.get(name.removesuffix("_constant_speed"), BLACK))
        old = ((before or {}).get("harmonics") or {}).get(name)
        if old is not None:
            behind(ax, old["order"], factor * np.asarray(old["amplitude"], float), linestyle="none", marker="_")
        mean = f"mean {number(factor * float(found['mean']))} {shown}"
        ax.set_title(label(f"{name.replace('_', ' ')}, {mean}; amplitude", shown))
        ax.set_xlim(0.0, float(order[-1]) + float(order[0]))
        ax.xaxis.set_major_locator(MaxNLocator(13, integer=True))
        ax.grid(visible=False, axis="x")
        ax.tick_params(axis="x", labelbottom=row is rows[-1])
    rows[-1][0].set_xlabel("order of the crank's revolution")
    return figure
