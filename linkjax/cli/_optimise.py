"""The command `optimise`.

The problem, one large program, is compiled first, and the analysis of the machines before and after at the same time.
Measured: the first run of the demo takes 42 s instead of 53 s. The measures before and after are read from these
analyses; a separate program for all measures took 25 s to compile.
"""

from __future__ import annotations

import contextlib
import functools
import json
import math
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from linkjax import __version__
from linkjax._display import Numbers
from linkjax._units import nearest
from linkjax.analysis import analyse, compile_ahead, plain
from linkjax.analysis import document as analysis_document
from linkjax.cli._app import app
from linkjax.cli._console import console
from linkjax.cli._options import (
    JsonFile,
    Nodes,
    Quiet,
    SceneName,
    Set,
    Units,
    changes_of,
    check_places,
    numbers_in,
    write_text,
)
from linkjax.cli._print import print_warnings
from linkjax.cli._print_optimum import amount
from linkjax.cli._print_optimum import comment as _comment
from linkjax.cli._print_optimum import print_optimum as _print
from linkjax.cli._said import messages_in, units_for
from linkjax.cli._targets import FreeStart, FunctionError, PathError, PositionError, target
from linkjax.cli._write import write_out
from linkjax.design import DesignError, Progress, document, limit, settled, solve
from linkjax.scenes import load, load_document, load_problem, text_of

ANGLES = 360
CHANGED = "the machine with the changes of its section [optimise]"

Starts = Annotated[
    int | None, typer.Option(min=1, max=10_000, help="Number of starts: the scene itself, the others random designs.")
]
Limits = Annotated[
    list[str] | None,
    typer.Option(
        "--limit", metavar="CONSTRAINT", help='Add or replace a constraint, e.g. "delta <= 0.15". May be repeated.'
    ),
]
Free = Annotated[
    list[str] | None,
    typer.Option(
        "--free",
        metavar="NAME=RANGE",
        help='Design variable with its range, e.g. links.rod.length="± 8 %"; =no fixes it. May be repeated.',
    ),
]
Minimise = Annotated[
    str | None, typer.Option(metavar="NAME", help="Objective: the measure or scene parameter to minimise.")
]
Maximise = Annotated[
    str | None, typer.Option(metavar="NAME", help="Objective: the measure or scene parameter to maximise.")
]
Solver = Annotated[str | None, typer.Option(help="Solver: cone (default), slsqp, trust-constr or multistart.")]
Out = Annotated[Path | None, typer.Option(help="Folder for optimised scene, JSON, report and figures.")]


@app.command(name="optimize", hidden=True)
@app.command(name="optimise")
def optimise_command(
    scene: SceneName,
    out: Out = None,
    json_file: JsonFile = None,
    minimise: Minimise = None,
    maximise: Maximise = None,
    path_error: PathError = None,
    function_error: FunctionError = None,
    position_error: PositionError = None,
    free_start: FreeStart = False,
    limits: Limits = None,
    free: Free = None,
    starts: Starts = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the random starts.")] = None,
    solver: Solver = None,
    nodes: Nodes = 96,
    units: Units = "",
    set_: Set = None,
    quiet: Quiet = False,
) -> None:
    """Optimise a machine.

    The section [optimise] of the scene has objective, design variables and constraints; options replace or add to them.
    """
    console.quiet = quiet
    numbers_in(units)  # an unknown unit is refused first
    machine, asked = load_problem(scene, changes_of(scene, set_))
    units = units_for(scene, changes_of(scene, set_), units)
    shown = numbers_in(units)
    with _named(scene):
        goal = target(path_error, function_error, position_error, free_start)
    if goal is not None and minimise is not None:
        raise DesignError(f"{scene}: objective", "two are given", "delete --minimise")
    if goal is not None or minimise is not None or maximise is not None:
        asked |= {"minimise": minimise if goal is None else goal, "maximise": maximise}
    given = {"starts": starts, "seed": seed, "solver": solver}
    asked |= {key: value for key, value in given.items() if value is not None}
    with _named(scene):
        _change(asked, limits, free)
        _check_given(asked)
        asked = settled(machine, **asked)
    changed = text_of(machine) != text_of(load(scene, changes_of(scene, set_)))
    if changed:
        console.print(f"before: {CHANGED}", highlight=False, markup=False)
    check_places(out, None, json_file)
    clock = time.perf_counter()
    with messages_in(shown), _named(scene), _Progress(shown) as progress:
        analysis = functools.partial(compile_ahead, machine, angles=ANGLES, nodes=nodes)
        found = solve(machine, **asked, nodes=nodes, callback=progress, meanwhile=analysis)
        before, after = (analyse(each, angles=ANGLES, nodes=nodes, throw=False) for each in (found.before, found.after))
    data = document(found, before, after, scene, __version__) | {"before_is": CHANGED if changed else "the machine"}
    _print(data, shown, time.perf_counter() - clock)
    told_before, told_after = (analysis_document(cycle, scene, __version__) for cycle in (before, after))
    print_warnings(told_before, shown, "before")
    print_warnings(told_after, shown, "after")
    if out:
        write_text(out / "optimised.toml", text_of(found.after, _comment(data), load_document(scene)))
    for file in (json_file, out and out / "optimum.json"):
        if file:
            data["scene_after"] = os.path.relpath(out / "optimised.toml", file.parent) if out else None
            write_text(file, json.dumps(plain(data), allow_nan=False))
    if out:
        write_out(told_after, found.after, out, before=(told_before, found.before), optimum=data, units=units)
    if found.interrupted:
        raise typer.Exit(130)
    if not found.feasible:
        raise typer.Exit(1)


@contextlib.contextmanager
def _named(place: str) -> Iterator[None]:
    """Errors raised inside begin with the scene, or with the option, that is wrong."""
    try:
        yield
    except DesignError as error:
        raise DesignError(f"{place}: {error.element}", error.problem, error.remedy) from error


def _change(asked: dict[str, Any], limits: list[str] | None, free: list[str] | None) -> None:
    """Constraints and design variables of the command line replace those of the scene with the same name."""
    for text in limits or ():
        with _named("--limit"):
            new = limit(text)
        kept = [old for old in asked["limits"] if (limit(old).name, limit(old).sense) != (new.name, new.sense)]
        asked["limits"] = [*kept, text]
    for text in free or ():
        name, equals, given = text.partition("=")
        if not equals:
            raise DesignError(f"--free: {text!r}", "is not NAME=RANGE", 'write e.g. --free links.rod.length="± 8 %"')
        name, given = name.strip(), given.strip()
        if given == "no" and name not in asked["free"]:
            raise DesignError(f"--free: {name}", "is not a design variable", nearest(name, asked["free"]))
        before = asked["free"].get(name)
        new_range = {**before, "range": given} if isinstance(before, dict) else given  # its linked parameters stay
        asked["free"] = {**asked["free"], name: new_range}
        if given == "no":
            del asked["free"][name]


def _check_given(asked: dict[str, Any]) -> None:
    """Raise `DesignError` without objective or design variables, with the option that gives them."""
    if asked.get("minimise") is None and asked.get("maximise") is None:
        remedy = "write --minimise NAME or --maximise NAME, or `minimise` or `maximise` in [optimise]"
        raise DesignError("objective", "none is given", remedy)
    if not asked["free"]:
        remedy = 'name one, e.g. --free flywheel.inertia="0 to 40 kg m^2", or in [optimise.free]'
        raise DesignError("free", "there is no design variable", remedy)


class _Progress:
    """Progress: a changing line on a terminal, otherwise one line per start."""

    def __init__(self, shown: Numbers):
        self.shown, self.begin, self.first = shown, time.perf_counter(), 0.0
        self.status = console.status("compiling …") if console.is_terminal else None
        self.last: Progress | None = None

    def __enter__(self) -> _Progress:
        if self.status is not None:
            self.status.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.status is not None:
            self.status.stop()
        self._start_ends(self.last)

    def __call__(self, now: Progress) -> None:
        if self.last is None or now.traded != self.last.traded:
            self.first = time.perf_counter()
        if self.last is not None and (now.traded, now.start) != (self.last.traded, self.last.start):
            self._start_ends(self.last)
        self.last = now
        if self.status is not None:
            self.status.update(self._line(now))

    def _line(self, now: Progress) -> str:
        spent = time.perf_counter() - self.begin
        left = (time.perf_counter() - self.first) * (now.starts - now.start) / now.start if now.start else math.nan
        violated = f", violated: {', '.join(now.violated)}" if now.violated else ""
        best = "none yet" if now.best is None else amount(now.best, now.unit, self.shown)
        ahead = f", about {left:.0f} s left" if now.start else ""
        at = amount(now.objective, now.unit, self.shown)
        return f"{_stage(now)} of {now.starts}, step {now.step}: {at}, best {best}{violated}; {spent:.0f} s{ahead}"

    def _start_ends(self, at: Progress | None) -> None:
        if at is None or self.status is not None:
            return
        violated = f", violated: {', '.join(at.violated)}" if at.violated else ""
        value = amount(at.objective, at.unit, self.shown)
        console.print(f"{_stage(at)}: {value} after {at.step} steps{violated}", highlight=False)


def _stage(at: Progress) -> str:
    return f"{at.traded}, bound {at.start + 1}" if at.traded else f"start {at.start + 1:3d}"
