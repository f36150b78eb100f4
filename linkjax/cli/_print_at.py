"""Tables of all results at single crank angles on the screen."""

from __future__ import annotations

import math
from typing import Any

from rich.table import Table
from rich.text import Text

from linkjax._display import ROUNDING, Numbers, above, prefixed, short, turning
from linkjax.analysis import CONSTANT, force_scale, torque_scale
from linkjax.cli._console import console
from linkjax.machine import Scene

Data = dict[str, Any]
Rows = dict[tuple[str, ...], dict[str, float]]
PLACES = {"x": "m", "y": "m", "dx": "m/rad", "dy": "m/rad", "ddx": "m/rad²", "ddy": "m/rad²"}
MOVES = {"vx": "m/s", "vy": "m/s", "v": "m/s", "ax": "m/s²", "ay": "m/s²", "a": "m/s²"}
TURNS = {"angle": "rad", "d": "", "dd": "", "w": "rad/s", "e": "rad/s²"}
PULLS = {"fx": "N", "fy": "N", "force": "N", "moment": "N·m"}
HEADINGS = {
    "dx": "x'", "dy": "y'", "ddx": "x''", "ddy": "y''", "v": "|v|", "a": "|a|", "d": "ω'", "dd": "ε'", "w": "ω",
    "e": "ε", "force": "|f|",
}  # fmt: skip


def print_at(data: Data, machine: Scene, show: Numbers, given: bool = False) -> None:
    """Print all results at the one crank angle of a document, in the motion of its forces. `given`: that motion has
    nominal speed and a given acceleration."""
    speed, slope, motion = _motion(data, machine, given)
    at = f"\nat {show.bound(data['angles'][0], 'rad')} of crank angle, {motion}"
    console.print(at, style="bold", highlight=False, markup=False)
    crank = f"crank speed {show.speed(speed, 7)}, angular acceleration {_acceleration(show, slope, speed)}"
    console.print(crank, highlight=False)
    _print_rows({(name,): _first(point) for name, point in data["points"].items()}, ("point",), PLACES, show)
    moves = {(name,): _moving(_first(point), speed, slope) for name, point in data["points"].items()}
    size = max((abs(value) for row in moves.values() for value in (row["v"] * speed, row["a"])), default=0.0)
    _print_rows(moves, ("point",), MOVES, show, {"a": size})
    links = {(name,): _turning(_first(link), speed, slope) for name, link in data["links"].items()}
    _print_rows(links, ("link",), TURNS, show, {"e": speed**2})
    _print_forces(data, show)
    reduced, torque = data["reduced"], torque_scale(data)
    inertia, slope = show.alike([reduced["inertia"][0], reduced["inertia_slope"][0]], "kg·m²", 7)
    both = [reduced["torque"][0], _forces(data)["drive_torque"][0]]
    largest = max((abs(peak["value"]) for name, peak in data["peaks"].items() if "drive_torque" in name), default=0.0)
    load, drive = show.alike(both, "N·m", 7, torque, largest)  # at every crank angle in the same unit
    console.print(f"J {inertia}, J' {slope}, Q {load}, ω {show.speed(speed, 7)}, drive torque {drive}", highlight=False)


def _motion(data: Data, machine: Scene, given: bool) -> tuple[float, float, str]:
    """Crank speed, angular acceleration, and the name of the motion."""
    run, model = data["motion"], data["model"]
    if given:
        return float(run["speed"][0]), float(run["acceleration"][0]), "nominal speed and given acceleration"
    if model["constant_speed"] or run["speed"] is None:
        return float(machine.speed), 0.0, "constant nominal speed"
    what = "prescribed motion" if model["method"] == "prescribed" else "actual motion"
    return float(run["speed"][0]), float(run["acceleration"][0]), what


def _acceleration(show: Numbers, value: float, speed: float) -> str:
    factor, label = show.units.get("rad/s^2", (1.0, "rad/s²"))
    return f"{short(factor * above(value, speed**2))} {label}"


def _first(row: Data) -> dict[str, float]:
    return {key: float(value[0]) for key, value in row.items()}


def _moving(point: dict[str, float], speed: float, slope: float) -> dict[str, float]:
    """Velocity and acceleration of a point in the axes of the frame, and their magnitudes."""
    vx, vy = point["dx"] * speed, point["dy"] * speed
    ax, ay = (point[f"dd{axis}"] * speed**2 + point[f"d{axis}"] * slope for axis in "xy")
    return {"vx": vx, "vy": vy, "v": math.hypot(vx, vy), "ax": ax, "ay": ay, "a": math.hypot(ax, ay)}


def _turning(link: dict[str, float], speed: float, slope: float) -> dict[str, float]:
    return {**link, "w": link["d"] * speed, "e": link["dd"] * speed**2 + link["d"] * slope}


def _pull(force: Data) -> dict[str, float]:
    fx, fy, moment = (float(force[key][0]) for key in ("fx", "fy", "moment"))
    return {"fx": fx, "fy": fy, "force": math.hypot(fx, fy), "moment": moment}


def _forces(data: Data) -> Data:
    """Forces in the requested motion, or at constant speed if that does not exist."""
    return data["forces"] or data["forces_constant_speed"]


def _print_forces(data: Data, show: Numbers) -> None:
    """Print joint forces with their magnitudes, and the shaking force."""
    suffixes = (CONSTANT, "")  # a given acceleration belongs to neither motion
    beside = {"f": max(force_scale(data, suffix) for suffix in suffixes)}
    beside |= {"force": beside["f"], "moment": max(torque_scale(data, suffix) for suffix in suffixes)}
    sides = {
        (joint, link, side["by"]): _pull(side)
        for joint, links in _forces(data)["reactions"].items()
        for link, side in links.items()
    }
    _print_rows(sides, ("joint", "on", "by"), PULLS, show, beside)
    shaking = _forces(data)["shaking"]
    whole = {key: above(value, beside[key.rstrip("xy")]) for key, value in _pull(shaking).items()}
    size = show.quantity(whole["force"], "N", 7)
    parts = show.place((whole["fx"], whole["fy"]), "N")
    moment = show.quantity(whole["moment"], "N·m", 7)
    console.print(f"shaking force {parts}, magnitude {size}; shaking moment about {shaking['about']} {moment}",
                  highlight=False, markup=False)  # fmt: skip


def _print_rows(
    rows: Rows, names: tuple[str, ...], columns: dict[str, str], show: Numbers, beside: dict[str, float] | None = None
) -> None:  # fmt: skip
    """Print rows as a table; columns of one unit share its prefix. `beside`: other large values, by kind of column."""
    clean = _without_noise({name: {key: row[key] for key in columns} for name, row in rows.items()}, beside or {})
    scales = {}
    for unit in set(columns.values()):
        alike = [abs(row[key]) for row in clean.values() for key in columns if columns[key] == unit]
        scales[unit] = prefixed(max(alike, default=0.0), unit, show.units)
    scales["rad"] = show.units.get("rad", (180 / math.pi, "°"))
    scales |= {"rad/s": turning(show.units), "rad/s²": show.units.get("rad/s^2", (1.0, "rad/s²"))}
    table = Table(*names, box=None, pad_edge=False)
    for key, unit in columns.items():
        label, heading = scales[unit][1], HEADINGS.get(key, key)
        table.add_column(Text(f"{heading} [{label}]" if label else heading))
    for name, row in clean.items():
        table.add_row(*name, *(short(scales[columns[key]][0] * value) for key, value in row.items()))
    console.print(table, highlight=False)


def _without_noise(rows: Rows, beside: dict[str, float]) -> Rows:
    """The rows with zero for values that are rounding beside the largest of their kind (x and y together)."""
    largest = dict(beside)
    for row in rows.values():
        for key, value in row.items():
            largest[key.rstrip("xy")] = max(largest.get(key.rstrip("xy"), 0.0), 0.1 * abs(value))
    return {
        name: {key: 0.0 if abs(value) <= ROUNDING * largest[key.rstrip("xy")] else value for key, value in row.items()}
        for name, row in rows.items()
    }
