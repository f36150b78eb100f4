"""Rolling bodies on the command line: `show` and `analyse`."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

import linkjax
from linkjax import __version__
from linkjax._display import NONE, Numbers
from linkjax._results import MachineError
from linkjax.analysis import plain
from linkjax.cli._console import console, elapsed
from linkjax.cli._options import write_text
from linkjax.rolling import MEMBER_NAMES, RollingMachine, check, document, rolling_rows, structure_of, tidy
from linkjax.scenes import SceneError

Data = dict[str, Any]


def show_rolling(machine: RollingMachine, name: str, show: Numbers) -> None:
    """Print rings, bodies and drive."""
    console.print(Text(machine.title or name, style="bold"))
    for key, value in rolling_rows(machine, show):
        console.print(f"{key:10s} {value}", highlight=False, markup=False)


def analyse_rolling(
    machine: RollingMachine, name: str, show: Numbers, units: str, angles: int, *, out: Path | None,
    json_file: Path | None, csv_folder: Path | None,
) -> None:  # fmt: skip
    """Print tables and write the requested files. Raises `MachineError` if the chain does not close."""
    with elapsed("analysing"):
        data = document(machine, angles, name, __version__)
    if json_file:
        write_text(json_file, json.dumps(plain(data), allow_nan=False))
    if csv_folder:
        _write_csv(data, csv_folder)
    try:
        check(machine.design)
    except MachineError as error:
        raise MachineError(f"Scene {machine.title or name!r}: {error}", error.result) from error
    _print(tidy(data), machine, show)
    if out:
        with elapsed("drawing"):  # viz and report load matplotlib, so only here
            figures = linkjax.viz.write_rolling_figures(data, out, units)
            linkjax.viz.animate_rolling(data, out / "machine.gif", units)
            linkjax.report.write_rolling_report(data, out / "report.html", units=units)
        told = f"\n{len(figures) // 2} figures (PNG and SVG), machine.gif and report.html in {out}"
        console.print(told, highlight=False)


def refuse(scene: str, given: dict[str, bool]) -> None:
    """Raise `SceneError` for an option that is for linkages only."""
    for option, wanted in given.items():
        if wanted:
            raise SceneError(scene, option, None, "is not available for rolling bodies", "omit it")


def _print(data: Data, machine: RollingMachine, show: Numbers) -> None:
    rings, limits, motion, bodies = data["rings"], data["limits"], data["motion"], data["bodies"]
    console.print(Text(machine.title or data["scene"], style="bold"))
    console.print(f"{structure_of(machine)}\n", highlight=False)
    inner, outer, e = show.told([rings[key] for key in ("inner_radius", "outer_radius", "eccentricity")], "m", 9)
    largest, smallest = show.told([limits["max_radius"], limits["min_radius"]], "m", 9)
    apart = limits["min_clearance"]
    rows = [
        ("radius of the inner ring", inner),
        ("radius of the outer ring", outer),
        ("eccentricity", e),
        ("largest body that fits", largest),
        ("smallest body that fits", smallest),
        ("number of bodies that fills these rings", show.quantity(limits["fitting_bodies"], "", 9)),
        ("gap between last and first body", show.quantity(data["chain"]["closing_clearance"], "m", 2)),
        ("smallest clearance of other bodies", NONE if apart is None else show.quantity(apart, "m", 6)),
        *((f"speed of the {MEMBER_NAMES[key]}", show.speed(motion[key])) for key in MEMBER_NAMES),
        ("sliding speed between neighbours", show.quantity(motion["rubbing"], "m/s", 6)),
    ]
    table = Table(box=None, show_header=False, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    console.print(table, highlight=False)
    if apart is not None and apart < 0:
        more = "bodies of different turns overlap in the plane: arrange them in separate planes"
        console.print(f"WARNING: {more}", style="bold", highlight=False)
    table = Table("body", "radius", "at", "x", "y", "speed", box=None, pad_edge=False)
    columns = [show.told(bodies[key].tolist(), "m", 9) for key in ("radius", "x", "y")]
    for i, (radius, x, y) in enumerate(zip(*columns, strict=True)):
        table.add_row(str(i + 1), radius, show.turned(bodies["angle"][i]), x, y, show.speed(motion["bodies"][i]))
    console.print()
    console.print(table, highlight=False)
    console.print(f"\nchecks     contacts {data['checks']['contacts']:.0e}", highlight=False)


def _write_csv(data: Data, folder: Path) -> None:
    """Write the bodies, one per row, and all positions over the angle of the driven member, as in the JSON document."""
    bodies, path = data["bodies"], data["path"]
    spins = data["motion"]["bodies"]
    columns = {"body": range(1, len(spins) + 1), **bodies, "speed": spins}
    _write(folder / "bodies.csv", columns)
    columns = {"angle": data["angles"], "carrier": path["carrier"]}
    for ring in ("inner", "outer"):
        columns |= {f"{part}_{ring}": path[ring][part] for part in ("x", "y", "angle")}
    for i in range(len(spins)):
        columns |= {f"x_{i + 1}": path["x"][i], f"y_{i + 1}": path["y"][i], f"angle_{i + 1}": path["body_angles"][i]}
    _write(folder / "path.csv", columns)


def _write(file: Path, columns: dict[str, Any]) -> None:
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            writer.writerow([repr(float(value)) if not isinstance(value, int) else value for value in row])
