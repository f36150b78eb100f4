"""The command `run`: transient motion."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table
from rich.text import Text

import linkjax
from linkjax import __version__
from linkjax._display import NONE, Numbers
from linkjax._units import QuantityError, quantity
from linkjax.analysis import analyse, document
from linkjax.cli._app import app
from linkjax.cli._console import console, elapsed
from linkjax.cli._options import (
    JsonFile,
    Quiet,
    SceneName,
    Set,
    Units,
    changes_of,
    check_places,
    numbers_in,
    write_text,
)
from linkjax.cli._said import messages_in, units_for
from linkjax.machine import Scene
from linkjax.mechanism import StructureError
from linkjax.runs import run, run_document
from linkjax.scenes import SceneError, load, load_document

ROWS = 12  # of the printed table
FRAMES, MOST_FRAMES = 25, 250  # of the animation, in a second and in all


@app.command(name="run")
def run_command(
    scene: SceneName,
    time: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Time of the run in s; by default some time after run-up or run-down."),
    ] = None,
    cycles: Annotated[
        float | None, typer.Option(metavar="NUMBER", help="Cycles of the run, in place of --time.")
    ] = None,
    from_speed: Annotated[
        str | None,
        typer.Option(
            "--from-speed",
            metavar="SPEED",
            help='Crank speed at the start with its unit, e.g. "700 rpm"; default rest, without a motor the speed of '
            "the scene.",
        ),
    ] = None,
    start_angle: Annotated[
        str,
        typer.Option("--start-angle", metavar="ANGLE", help="Crank angle at the start: degrees, or with a unit."),
    ] = "0",
    motor_off: Annotated[
        bool, typer.Option("--motor-off", help="The motor is off; its rotor and transmission turn with the machine.")
    ] = False,
    through_rest: Annotated[
        bool, typer.Option("--through-rest", help="Go on after a standstill, if the machine swings back.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for figures and an animation in real time.")] = None,
    json_file: JsonFile = None,
    units: Units = "",
    set_: Set = None,
    quiet: Quiet = False,
) -> None:
    """Compute the transient motion of a machine: run-up, run-down, standstill."""
    console.quiet = quiet
    changes = changes_of(scene, set_)
    if load_document(scene).rolling:
        raise SceneError(scene, "", None, "rolling bodies have no motor and no loads", "give the scene of a linkage")
    with messages_in(numbers_in(units)):
        machine = load(scene, changes)
    units = units_for(scene, changes, units)
    shown, off = numbers_in(units), motor_off or machine.motor is None
    angle, speed = _angle(start_angle), _speed(from_speed, float(machine.speed) if off else 0.0)
    check_places(out, None, json_file)
    with elapsed("computing"), messages_in(shown):
        try:
            found = run(machine, start_angle=angle, start_speed=speed, time=time, cycles=cycles, motor=not motor_off,
                        through_rest=through_rest)  # fmt: skip
        except StructureError as error:
            raise SceneError(scene, error.element, None, error.problem, error.remedy) from error
    data = run_document(found, scene, __version__)
    if json_file:
        write_text(json_file, json.dumps(data, allow_nan=False))
    print_run(data, machine, shown)
    if out:
        _write(data, machine, out, scene, units)
    if problem := _problem(data, off, shown):
        console.print(f"WARNING: {problem}", style="bold", highlight=False, markup=False)
        raise typer.Exit(1)


def _angle(text: str) -> float:
    """A crank angle in radians, from degrees or a string with a unit."""
    try:
        return quantity(f"{float(text):.17g} deg", "angle")
    except QuantityError as error:
        raise SceneError("--start-angle", "", text, error.problem, "give degrees, e.g. 90") from error
    except ValueError:
        pass
    try:
        return quantity(text, "angle")
    except QuantityError as error:
        raise SceneError("--start-angle", "", text, error.problem, error.remedy) from error


def _speed(text: str | None, default: float) -> float:
    """A crank speed in rad/s, from a string with a unit, or a plain zero."""
    if text is None:
        return default
    try:
        number = float(text)
    except ValueError:
        number = None
    try:
        if number is not None and number != 0:
            raise QuantityError("is a speed without a unit", f'write e.g. "{number:g} rpm"')
        return 0.0 if number is not None else quantity(text, "speed")
    except QuantityError as error:
        raise SceneError("--from-speed", "", text, error.problem, error.remedy) from error


def _problem(data: dict[str, Any], off: bool, show: Numbers) -> str:
    """Why a machine did not run; empty if it did."""
    if not data["complete"]:
        return "the solver ran out of steps; values after that are not those of the machine"
    if not data["starts"]:
        return "the machine does not start from this crank angle; more starting torque is needed"
    if data["stopped"] and not off:
        return f"the machine stalls at {show.turned(data['stop_angle'])}, with the motor on"
    return ""


def print_run(data: dict[str, Any], machine: Scene, show: Numbers) -> None:
    """Print a table of the motion, and what happened."""
    console.print(Text(machine.title or data["scene"], style="bold"))
    count = len(data["time"])
    rows = np.unique(np.linspace(0, count - 1, ROWS).round().astype(int)).tolist()
    driven = machine.motor is not None and any(data["motor_torque"])
    columns = {
        "time": show.alike([data["time"][i] for i in rows], "s"),
        "crank angle": [show.turned(data["angle"][i]) for i in rows],
        "speed": [show.speed(data["speed"][i]) for i in rows],
    }
    if driven:
        columns["motor torque"] = show.alike([data["motor_torque"][i] for i in rows], "N·m")
        columns["motor power"] = show.alike([data["motor_power"][i] for i in rows], "W")
    table = Table(box=None, pad_edge=False)
    for name in columns:
        table.add_column(name, justify="right")
    for row in zip(*columns.values(), strict=True):
        table.add_row(*row)
    console.print(table)
    for name, text in _events(data, show).items():
        console.print(f"{name:24s} {text}", highlight=False, markup=False)


def _events(data: dict[str, Any], show: Numbers) -> dict[str, str]:
    found = {}
    if data["run_up_time"] is not None:
        found["run-up time"] = f"{show.quantity(data['run_up_time'], 's')} to 99 % of the steady-state speed"
    if data["stopped"]:
        after = ", then it turns backward" if data["goes_back"] else ""
        when = show.quantity(data["stop_time"], "s")
        found["standstill"] = f"at {show.turned(data['stop_angle'])} after {when}{after}"
    elif data["run_down_time"] is not None:
        found["run-down time"] = f"{show.quantity(data['run_down_time'], 's')} to 1 % of the speed at the start"
    if (starting := data["starting"]) is not None:
        margin = starting["margin"]
        worst = NONE if margin is None else f"{100 * margin:+.1f} %, least at {show.turned(starting['angle'])}"
        starts = "starts at all crank angles" if starting["everywhere"] else "does not start from there"
        found["starting-torque margin"] = f"{'no load resists' if margin is None else worst}; {starts}"
    if (energies := data.get("energies")) is not None:
        parts = {"motor": energies["motor"], "losses": energies["losses"], **energies["loads"]}
        parts = {name: values[-1] for name, values in parts.items() if any(values)}
        works = [f"{name} {show.quantity(value, 'J')}" for name, value in parts.items()]
        kinetic = energies["kinetic"]
        found["work"] = ", ".join([*works, f"gain of kinetic energy {show.quantity(kinetic[-1] - kinetic[0], 'J')}"])
    return found


def _write(data: dict[str, Any], machine: Scene, out: Path, name: str, units: str) -> None:
    """Write the figures, and the animation in real time."""
    with elapsed("drawing"):  # viz loads matplotlib, so only here
        figures = linkjax.viz.write_run_figures(data, machine, out, units=units)
        frames = max(2, min(MOST_FRAMES, math.ceil(FRAMES * data["time"][-1])))
        angles = np.interp(np.linspace(0.0, data["time"][-1], frames), data["time"], data["angle"])
        drawn = document(analyse(machine, constant_speed=True, throw=False), name, __version__)
        linkjax.viz.animate(drawn, machine, out / "machine.gif", angles=angles, seconds=data["time"][-1], units=units)
    console.print(f"\n{len(figures) // 2} figures (PNG and SVG) and machine.gif in {out}", highlight=False)
