"""A scene in plain text: what `print(scene)` shows. Numbers have their units; a dash means: does not exist."""

from __future__ import annotations

from typing import Any

import numpy as np

from linkjax._display import NONE, Numbers, aligned
from linkjax.groups import Harmonic, Spline
from linkjax.loads import AbstractLoad, Force, OpposingForce, OpposingTorque, Passage, Torque, Window
from linkjax.machine._load_text import table_text
from linkjax.mechanism import Mechanism

SHOW = Numbers()
PERMANENT = "permanent"  # a load without a window
ROTATION = {"ccw": "counter-clockwise", "cw": "clockwise"}


def scene_text(scene: Any) -> str:
    """Drive, speed, structure, frame, links and loads of a scene; one line where its numbers are those of several
    designs, traced, or placeholders."""
    try:
        return "\n".join(_lines(scene))
    except (AttributeError, TypeError, ValueError):  # what float() raises for these
        title = f"{scene.title}: " if scene.title else ""
        return f"{title}{scene.mechanism.formula()} (traced numbers, or several designs)"


def _lines(scene: Any) -> list[str]:
    mechanism = scene.mechanism
    target = "" if scene.target_delta is None else f", target δ {float(scene.target_delta):g}"
    fixed = ", ".join(f"{name} {SHOW.place((at.x, at.y))}" for name, at in mechanism.fixed.items())
    head = [
        ("drive", drive_text(mechanism, SHOW)),
        ("speed", speed_text(scene, SHOW)),
        ("cycle", f"{scene.cycle_turns} turn{'s' * (scene.cycle_turns > 1)} of the crank"),
        ("structure", mechanism.formula()),
        ("fixed points", fixed or NONE),
        ("gravity", SHOW.place((scene.gravity.x, scene.gravity.y), "m/s²")),
        ("flywheel", f"{SHOW.shown(mechanism.flywheel.inertia, 'kg·m²')}{target}"),
    ]
    pieces = [(name, *each) for name in mechanism.link_names
              for each in mechanism.links[name].counterweights.items()]  # fmt: skip
    weights = [("counterweight", "link", "mass", "place", "inertia")] if pieces else []
    for link, name, piece in pieces:
        own = "ideal" if piece.ideal else SHOW.shown(piece.own_inertia(), "kg·m²")
        weights.append((name, link, SHOW.shown(piece.mass, "kg"), SHOW.place((piece.at.x, piece.at.y)), own))
    loads = [("load", "size", "on", "crank angle"), *map(_load, scene.loads)] if scene.loads else [("load", NONE)]
    tables = [aligned(rows) for rows in (_links(mechanism), weights, loads) if rows]
    return [scene.title or "Scene", *aligned(head), *(line for table in tables for line in ("", *table))]


def _links(mechanism: Mechanism) -> list[tuple[str, ...]]:
    rows = [("link", "length", "mass", "inertia", "mass centre", "points")]
    for name in mechanism.link_names:
        link, body = mechanism.links[name], mechanism.links[name].actual()
        points = ", ".join(f"{point} {SHOW.place((at.x, at.y))}" for point, at in body.points.items())
        rows.append((
            name, SHOW.shown(link.length, "m") if float(link.length) > 0 else NONE, SHOW.shown(body.mass, "kg"),
            SHOW.shown(body.inertia, "kg·m²"), f"{link.centre_name} {SHOW.place((body.centre.x, body.centre.y))}",
            points or NONE,
        ))  # fmt: skip
    return rows


def _load(load: AbstractLoad) -> tuple[str, ...]:
    return load.name, load_size(SHOW, load), f"{load.link} {load.point}".strip(), when_text(SHOW, load.window)


def when_text(show: Numbers, window: Window | Passage | None) -> str:
    """When a load with this window acts."""
    if window is None:
        return PERMANENT
    if isinstance(window, Passage):
        return passage_text(show, window)
    if np.ndim(window.on):
        return f"in {np.size(window.on)} ranges of crank angle"
    return f"{show.bound(window.on, 'rad')} to {show.bound(window.off, 'rad')}"


def passage_text(show: Numbers, window: Passage) -> str:
    """A window that is given by what happens: "last 8 mm of D, going -"."""
    if window.between is None:
        part, size = ("first", window.first) if window.last is None else ("last", window.last)
        assert size is not None  # one of the three is given
        text = f"{part} {show.bound(size, window.unit)} of {window.of}"
    else:
        low, high = (show.bound(value, window.unit) for value in window.between)
        text = f"{window.of} between {low} and {high}"
    along = "" if window.direction is None else f" along {show.bound(window.direction, 'rad')}"
    return f"{text}{along}{f', going {window.going}' if window.going else ''}"


def load_size(show: Numbers, load: AbstractLoad) -> str:
    """How large a load is, and how it is directed."""
    if isinstance(load, Force):
        return show.place((load.force.x, load.force.y), "N")
    if isinstance(load, OpposingForce):
        return f"{show.shown(load.magnitude, 'N')} against the motion"
    if isinstance(load, Torque):
        return show.shown(load.torque, "N·m")
    if isinstance(load, OpposingTorque):
        return f"{show.shown(load.magnitude, 'N·m')} against the rotation"
    return table_text(show, load) or NONE


def speed_text(scene: Any, show: Numbers) -> str:
    """The nominal crank speed, and whether it is constant, or which mean it is."""
    constant = scene.constant_speed or scene.mechanism.prescribed
    return f"{show.bound(scene.speed, 'rad/s')}, {'constant' if constant else f'{scene.mean} mean'}"


def drive_text(mechanism: Mechanism, show: Numbers) -> str:
    """What drives, and how it moves: its rotation, or its motion law."""
    drive, slides = mechanism.driver.as_drive(), mechanism.driver.drive_slides()
    assert drive is not None  # see `check_structure`
    law, who = drive.law, drive.link if drive.on == "frame" else f"{drive.link} on {drive.on}"
    phase = 0.0 if slides or drive.phase is None else float(drive.phase)
    if law is None:
        return f"{who} rotates {ROTATION[drive.rotation]}, phase {show.turned(phase)}"
    if not isinstance(law, Harmonic | Spline):
        return f"{who} follows the motion law {type(law).__name__}"
    places: Any = law.values if isinstance(law, Spline) else (law.start, law.stop)
    values = [float(value) for value in places]
    low, high = (show.shown(v, "m") if slides else show.turned(phase + v) for v in (min(values), max(values)))
    how = "harmonic" if isinstance(law, Harmonic) else f"spline through {len(law.values)} positions"
    return f"{who} {'moves' if slides else 'oscillates'} between {low} and {high} ({how})"
