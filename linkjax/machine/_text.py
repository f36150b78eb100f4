"""A scene in plain text: what `print(scene)` shows. Numbers have their units; a dash means: does not exist."""

from __future__ import annotations

from typing import Any

import numpy as np

from linkjax._display import NONE, Numbers, aligned
from linkjax.drives import MotorDrive, Servo
from linkjax.friction import AbstractFriction, GuideFriction, MeshFriction, PinFriction
from linkjax.groups import FRAME, Harmonic, Moves, Spline
from linkjax.loads import (
    AbstractLoad,
    Damper,
    Drag,
    DragTorque,
    Force,
    OpposingForce,
    OpposingTorque,
    Passage,
    Spring,
    Torque,
    TorsionDamper,
    TorsionSpring,
    Window,
)
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
        *(() if scene.motor is None else (("motor", motor_text(scene.motor, SHOW)),)),
    ]
    pieces = [(name, *each) for name in mechanism.link_names
              for each in mechanism.links[name].counterweights.items()]  # fmt: skip
    weights = [("counterweight", "link", "mass", "place", "inertia")] if pieces else []
    for link, name, piece in pieces:
        own = "ideal" if piece.ideal else SHOW.shown(piece.own_inertia(), "kg·m²")
        weights.append((name, link, SHOW.shown(piece.mass, "kg"), SHOW.place((piece.at.x, piece.at.y)), own))
    loads = [("load", "size", "on", "crank angle"), *map(_load, scene.loads)] if scene.loads else [("load", NONE)]
    rubs = (
        [("friction in", "coefficient", "pin, guide or mesh"), *(friction_text(each, SHOW) for each in scene.friction)]
        if scene.friction
        else []
    )
    tables = [aligned(rows) for rows in (_links(mechanism), weights, rubs, loads) if rows]
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


def friction_text(friction: AbstractFriction, show: Numbers) -> tuple[str, str, str]:
    """A joint with friction, its coefficient, and what else its friction depends on."""
    if isinstance(friction, PinFriction):
        more = [f"radius {show.shown(friction.radius, 'm')}"]
        more += [] if friction.bearing == "given" else [f"{friction.bearing} bearing"]
        more += [] if friction.thrust is None else [f"thrust face under {show.shown(friction.thrust.force, 'N')}"]
    elif isinstance(friction, GuideFriction):
        given = (("groove of", friction.groove, "rad"), ("length", friction.length, "m"))
        more = [f"{name} {show.shown(value, unit)}" for name, value, unit in given if value is not None]
        more += [] if friction.seat is None else [f"curved seat, factor {float(friction.seat):g}"]
    elif isinstance(friction, MeshFriction):
        return friction.joint, NONE, f"efficiency {100 * float(friction.efficiency):g} %"
    else:
        return friction.joint, NONE, type(friction).__name__
    more = more or ["flat"]
    more += [] if friction.static is None else [f"static coefficient {float(friction.static):g}"]
    return friction.joint, f"{float(friction.coefficient):g}", ", ".join(more)


def _load(load: AbstractLoad) -> tuple[str, ...]:
    return load.name, load_size(SHOW, load), load_place(load), when_text(SHOW, load.window)


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
    text = f"whole way of {window.of}"
    for part, size in (("first", window.first), ("last", window.last)):
        if size is not None:
            text = f"{part} {show.bound(size, window.unit)} of {window.of}"
    if window.between is not None:
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
    if isinstance(load, Spring | TorsionSpring):
        return _spring(show, load)
    if isinstance(load, Damper | TorsionDamper):
        return show.shown(load.coefficient, "N·s/m" if load.point else "N·m·s/rad")
    if isinstance(load, Drag | DragTorque):
        units = ("N·s/m", "N·s²/m²") if load.point else ("N·m·s/rad", "N·m·s²/rad²")
        parts = {"linear": (load.linear, units[0]), "quadratic": (load.quadratic, units[1])}
        return ", ".join(f"{key} {show.shown(*part)}" for key, part in parts.items() if float(part[0])) or NONE
    return table_text(show, load) or NONE


def _spring(show: Numbers, load: Spring | TorsionSpring) -> str:
    """Stiffness, length or angle without load, and preload of a spring."""
    preload = show.shown(load.preload, "N" if load.point else "N·m")
    if not float(load.stiffness):
        return f"{preload}, constant"
    if isinstance(load, Spring):
        text = f"{show.shown(load.stiffness, 'N/m')}, free length {show.shown(load.free_length, 'm')}"
    else:
        text = f"{show.shown(load.stiffness, 'N·m/rad')}, free angle {show.bound(load.free_angle, 'rad')}"
    return f"{text}, preload {preload}" if float(load.preload) else text


def load_place(load: AbstractLoad, between: str = " ") -> str:
    """Where a load acts: a link and its point, with a string between them, or two of both; no frame for a couple."""
    ends = [end for end in load.attachments() if end != (FRAME, "")]
    return " and ".join(between.join(part for part in end if part) for end in ends)


def speed_text(scene: Any, show: Numbers) -> str:
    """The nominal crank speed, and whether it is constant, or which mean it is."""
    constant = scene.constant_speed or scene.mechanism.prescribed
    return f"{show.bound(scene.speed, 'rad/s')}, {'constant' if constant else f'{scene.mean} mean'}"


def motor_text(drive: MotorDrive, show: Numbers) -> str:
    """The kind of a motor, its torque at rest and its speed without load, the ratio and the rotor."""
    motor, parts = drive.motor, [type(drive.motor).__name__]
    if isinstance(motor, Servo):
        parts += [f"up to {show.shown(motor.max_torque, 'N·m')}, {show.bound(motor.max_speed, 'rad/s')}"]
    else:
        idle = motor.no_load_speed()
        parts += [f"{show.shown(motor.stall_torque(), 'N·m')} at rest"]
        parts += [] if idle is None or not np.isfinite(idle) else [f"{show.bound(idle, 'rad/s')} without load"]
    gear = drive.transmission
    parts += [f"ratio {float(gear.ratio):g}"] * (float(gear.ratio) != 1)
    parts += [] if gear.efficiency is None else [f"efficiency {float(gear.efficiency):g}"]
    return ", ".join([*parts, f"rotor {show.shown(drive.inertia, 'kg·m²')}"])


def drive_text(mechanism: Mechanism, show: Numbers) -> str:
    """What drives, and how it moves: its rotation, or its motion law."""
    drive, slides = mechanism.driver.as_drive(), mechanism.driver.drive_slides()
    assert drive is not None  # see `check_structure`
    law, who = drive.law, drive.link if drive.on == "frame" else f"{drive.link} on {drive.on}"
    phase = 0.0 if slides or drive.phase is None else float(drive.phase)
    if law is None:
        return f"{who} rotates {ROTATION[drive.rotation]}, phase {show.turned(phase)}"
    if not isinstance(law, Harmonic | Spline | Moves):
        return f"{who} follows the motion law {type(law).__name__}"
    values = [float(value) for value in _places(law)]
    low, high = (show.shown(v, "m") if slides else show.turned(phase + v) for v in (min(values), max(values)))
    how = "harmonic" if isinstance(law, Harmonic) else f"spline through {len(values)} positions"
    how = f"law of {len(law.moves)} moves" if isinstance(law, Moves) else how
    return f"{who} {'moves' if slides else 'oscillates'} between {low} and {high} ({how})"


def _places(law: Harmonic | Spline | Moves) -> list[Any]:
    """The values between which a law moves."""
    if isinstance(law, Spline):
        return list(law.values)
    if isinstance(law, Harmonic):
        return [law.start, law.stop]
    return [law.start, *(move.to for move in law.moves if move.to is not None)]
