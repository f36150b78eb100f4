"""The command `element`: elements with friction in closed form."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

import linkjax
from linkjax._display import NONE, Numbers
from linkjax._units import QuantityError, quantity
from linkjax.cli._app import app
from linkjax.cli._console import console
from linkjax.cli._options import JsonFile, Quiet, Units, check_places, numbers_in, write_text
from linkjax.elements import NAMED, element_document, groove_friction, material_friction
from linkjax.scenes import SceneError

UNITS = {"length": "m", "angle": "rad", "force": "N", "number": ""}
MAY_BE_ZERO = ("friction", "inner", "pivot", "distance", "flank")


def _given(text: str, **more: Any) -> Any:
    return typer.Option(metavar="VALUE", help=text, **more)


Value = str | None


@app.command(name="element")
def element_command(
    name: Annotated[str, typer.Argument(metavar="ELEMENT", help=f"One of {', '.join(NAMED)}.")],
    angle: Annotated[Value, _given("Angle of the element, e.g. 20deg.")] = None,
    friction: Annotated[Value, _given("Coefficient of friction.")] = None,
    material: Annotated[
        Value, _given('Materials in place of --friction, e.g. "steel-bronze", from the table of the docs.')
    ] = None,
    lubricated: Annotated[bool, typer.Option("--lubricated", help="With --material: lubricated.")] = False,
    static: Annotated[bool, typer.Option("--static", help="With --material: friction at rest, for starting.")] = False,
    groove: Annotated[Value, _given("Half angle of a wedge-shaped groove, e.g. 35deg.")] = None,
    bearing: Annotated[Value, _given("Journal and thrust ring: unworn or run-in.")] = None,
    load: Annotated[Value, _given('Load of the element, e.g. "2 kN"; default 1 N.')] = None,
    diameter: Annotated[Value, _given("Screw: mean diameter.")] = None,
    lead: Annotated[Value, _given("Screw: lead, which is pitch times starts.")] = None,
    flank: Annotated[Value, _given("Screw: half the angle of a triangular thread, e.g. 30deg.")] = None,
    radius: Annotated[Value, _given("Journal: radius. Gripping cam: radius of the disc.")] = None,
    distance: Annotated[Value, _given("Journal: distance of the driving force from the axis.")] = None,
    outer: Annotated[Value, _given("Thrust ring: outer radius.")] = None,
    inner: Annotated[Value, _given("Thrust ring: inner radius.")] = None,
    eccentricity: Annotated[Value, _given("Gripping cam: distance of its pivot from its centre.")] = None,
    pivot: Annotated[Value, _given("Gripping cam: radius of the friction circle at its pivot.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="File for a drawing: .svg, .png or .pdf.")] = None,
    json_file: JsonFile = None,
    units: Units = "",
    quiet: Quiet = False,
) -> None:
    """Force, efficiency and self-locking of an element with friction: screw, wedge, journal and others."""
    console.quiet = quiet
    shown = numbers_in(units)
    texts = {
        "angle": angle, "friction": friction, "load": load, "diameter": diameter, "lead": lead, "flank": flank,
        "radius": radius, "distance": distance, "outer": outer, "inner": inner, "eccentricity": eccentricity,
        "pivot": pivot,
    }  # fmt: skip
    check_places(None, None, json_file)
    check_places(None, None, out)
    if out and out.suffix not in (".svg", ".png", ".pdf"):
        raise SceneError("--out", "", str(out), "is no picture", "write a file name that ends in .svg, .png or .pdf")
    try:
        given = {key: _number(key, text) for key, text in texts.items() if text is not None}
        given |= _friction(given, material, lubricated, static, groove)
        data = element_document(name, given, bearing)
    except ValueError as error:
        raise SceneError(f"element {name}", "", None, str(error), "linkjax element --help lists the options") from error
    if json_file:
        write_text(json_file, json.dumps(data, allow_nan=False))
    print_element(data, shown)
    if out:
        out.parent.mkdir(parents=True, exist_ok=True)
        linkjax.viz.element_figure(data, shown).savefig(out, dpi=150)  # viz loads matplotlib, so only here
        console.print(f"drawing: {out}", highlight=False)


def _number(key: str, text: str) -> float:
    """The number of an option, with its unit; angles without one are in degrees."""
    dimension = next(each.inputs[key][0] for each in NAMED.values() if key in each.inputs)
    try:
        return quantity(f"{float(text):.17g} deg", dimension) if dimension == "angle" else quantity(text, dimension)
    except QuantityError as error:
        raise SceneError(f"--{key}", "", text, error.problem, error.remedy) from error
    except ValueError:
        pass
    try:
        return quantity(text, dimension)
    except QuantityError as error:
        raise SceneError(f"--{key}", "", text, error.problem, error.remedy) from error


def _friction(
    given: dict[str, float], material: str | None, lubricated: bool, static: bool, groove: str | None
) -> dict[str, float]:
    """The coefficient of friction, from a number or materials, in a groove."""
    if material is not None and "friction" in given:
        raise ValueError("--friction and --material are both given; give one of them")
    if material is None and (lubricated or static):
        raise ValueError("--lubricated and --static apply to --material")
    if material is not None:
        given = {**given, "friction": material_friction(material, lubricated=lubricated, static=static)}
    if groove is not None and "friction" in given:
        half = _number("angle", groove)
        given = {**given, "friction": float(groove_friction(given["friction"], half))}
    return {key: given[key] for key in ("friction",) if key in given}


def print_element(data: dict[str, Any], show: Numbers) -> None:
    """Print the results of an element."""
    named = NAMED[data["element"]]
    console.print(data["title"], style="bold", highlight=False)
    table = Table(box=None, pad_edge=False, show_header=False)
    for key, (dimension, meaning) in named.inputs.items():
        if key in data["given"]:
            value = data["given"][key]
            table.add_row(meaning, show.turned(value) if dimension == "angle" else show.shown(value, UNITS[dimension]))
    if "bearing" in data["given"]:
        table.add_row("bearing", data["given"]["bearing"])
    if "load" not in data["given"]:
        table.add_row("load", "1 N")
    console.print(table, highlight=False)
    console.print()
    (_print_ways if named.ways else _print_bearing)(data, show)


def _print_ways(data: dict[str, Any], show: Numbers) -> None:
    named = NAMED[data["element"]]
    kind = "force" if named.unit == "N" else "torque"
    table = Table("", kind, "efficiency", "locks", "now", box=None, pad_edge=False)
    for key, words in zip(("forward", "backward"), named.ways, strict=True):
        way = data[key]
        effort = NONE if way["effort"] is None else show.quantity(way["effort"], named.unit)
        table.add_row(words, effort, _share(way["efficiency"]), _limit(data["element"], key, way["limit"], show),
                      "locks" if way["locks"] else "moves")  # fmt: skip
    console.print(table, highlight=False)
    if data["forward"]["locks"]:
        console.print("It locks forward: no effort suffices, however large.", highlight=False)
    if data["backward"]["locks"]:
        console.print(f"It is self-locking: without effort it stays where it is. The negative {kind} drives it back.",
                      highlight=False)  # fmt: skip


def _share(value: float | None) -> str:
    return NONE if value is None else f"{100 * value:.2f} %".replace("-", "−")


def _limit(name: str, way: str, limit: float, show: Numbers) -> str:
    """At which angles an element locks."""
    if not limit > 0:
        return "never"
    if limit >= math.pi / 2:
        return "at any angle"
    below = way == "backward" or name == "slider"
    return f"{'up to' if below else 'from'} {show.turned(limit)}"


def _print_bearing(data: dict[str, Any], show: Numbers) -> None:
    rows = [("friction torque", show.quantity(data["torque"], "N m"))]
    if data["element"] == "journal":
        rows.append(("friction circle, radius", show.quantity(data["circle"], "m")))
        rows.append(("equivalent coefficient", f"{data['friction']:.5g}"))
        if "margin" in data:
            efficiency = data.get("efficiency")
            rows.append(("efficiency of the force", _share(efficiency)))
            rows.append(("under this force", "locked" if data["margin"] <= 0 else "turns"))
    else:
        rows.append(("radius of friction", show.quantity(data["radius"], "m")))
    table = Table(box=None, pad_edge=False, show_header=False)
    for row in rows:
        table.add_row(*row)
    console.print(table, highlight=False)
