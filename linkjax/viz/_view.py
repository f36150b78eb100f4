"""The machine as plain data for the animated drawing of the report, with the appearance of `machine_figure`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.colors import to_hex

from linkjax._display import Units
from linkjax.loads import AbstractLoad, Damper, Force, OpposingForce, OpposingTorque, Spring, Torque
from linkjax.machine import Scene
from linkjax.viz._machine import MARGIN, colour, scale_mark, tint
from linkjax.viz._skeleton import Places, Skeleton, amount, clearest, heading, outline, path, places, skeleton, varying
from linkjax.viz._style import Data, lost, ranges

WIDE, TALLEST = 560.0, 400.0  # typographic points
DIGITS = 9  # significant digits of coordinates: 1e-9 of the size of the machine


def machine_view(
    data: Data, scene: Scene, before: tuple[Data, Scene] | None = None, units: Units | None = None
) -> dict[str, Any]:
    """Data to draw the machine at any crank angle in the report, ready for `json.dumps`; lengths in m, angles in rad.

    A point (x, y) is drawn at (left + scale x, base - scale y) in a picture of `width` by `height`. Positions and first
    kinematic coefficients of the points are given at `angles` equal steps of the cycle, for cubic Hermite
    interpolation. `time` holds the times at these angles and at the end of the cycle; None without an actual motion.
    """
    machines = [(data, scene), *([before] if before else [])]
    looks = [skeleton(of, by) for of, by in machines]
    low = np.min([look.low for look in looks], axis=0)
    high = np.max([look.high for look in looks], axis=0)
    left, bottom, right, top = MARGIN
    spread = np.maximum(high - low, 1e-3 * max(look.size for look in looks))
    scale = float(np.min((np.array([WIDE, TALLEST]) - (left + right, bottom + top)) / spread))
    height = max(scale * float(spread[1]) + bottom + top, 120.0)
    middle = 0.5 * (low + high)
    length, text = scale_mark(0.22 * WIDE / scale, units)
    return {
        "width": WIDE,
        "height": round(height, 2),
        "scale": scale,
        "left": 0.5 * (WIDE + left - right) - scale * float(middle[0]),
        "base": 0.5 * (height + top - bottom) + scale * float(middle[1]),
        "cycle_turns": scene.cycle_turns,
        "angles": int(np.size(data["angles"])),
        "start": math.degrees(clearest(data, scene, looks[0])),
        "time": _times(data, scene),
        "bar": {"length": length, "text": text},
        "machines": [_machine(of, by, look, scale, units) for (of, by), look in zip(machines, looks, strict=True)],
    }


def _machine(data: Data, scene: Scene, look: Skeleton, scale: float, units: Units | None) -> dict[str, Any]:
    """One machine: its points over the angles, the parts drawn between them, and the loads."""
    at = places(data, scene, clearest(data, scene, look))
    links = []
    for i, shape in enumerate(look.shapes):
        links.append({
            "name": shape.link, "colour": to_hex(colour(i)), "fill": to_hex(tint(colour(i))),
            "dark": to_hex(tint(colour(i), 0.5)), "corners": outline(shape, at, 3 / scale), "block": shape.block,
            "upon": shape.upon, "arms": list(shape.marked) if shape.block else [], "pin": shape.pins[0],
            "weights": shape.weights,
        })  # fmt: skip
    turning = dict.fromkeys([*(s.link for s in look.shapes if s.block), *(slot.on for slot in look.slots),
                             *(wheel.link for wheel in look.wheels if wheel.link in data["links"])])  # fmt: skip
    dots = sorted({p for shape in look.shapes for p in shape.marked} - set(look.joints))
    return {
        "points": {p: _point(data, p, at) for p in data["points"]},
        "headings": {name: _heading(data, name) for name in turning},
        "slots": [
            {
                "on": slot.on,
                "origin": slot.origin,
                "angle": slot.angle,
                "ends": [[*map(float, end)] for end in slot.ends],
            }
            for slot in look.slots
        ],
        "wheels": [wheel._asdict() for wheel in look.wheels],
        "belts": [[belt.one._asdict(), belt.other._asdict(), belt.crossed] for belt in look.belts],
        "ties": [tie._asdict() for tie in look.ties],
        "lost": np.flatnonzero(lost(data)).tolist(),
        "links": links,
        "guides": [[*map(float, (*guide.ends[0], *guide.ends[1]))] for guide in look.guides],
        "guide_angles": [guide.angle for guide in look.guides],
        "pivots": list(look.pivots),
        "joints": list(look.joints),
        "dots": dots,
        "centres": [shape.centre for shape in look.shapes if shape.centre],
        "paths": list(look.traced),
        "names": _names(data, look),
        "loads": [load for each in scene.loads if (load := _load(data, scene, each, units))],
    }


def _point(data: Data, name: str, at: Places) -> dict[str, Any]:
    """Coordinates and first kinematic coefficients over the angles; only one pair of coordinates for a fixed point."""
    where = path(data, name)
    if np.all(where == where[:, :1]):
        return {"x": float(at[name][0]), "y": float(at[name][1])}
    count = np.size(data["angles"])
    found = data["points"][name]
    return {k: _short(np.broadcast_to(np.asarray(found[k], float), (count,))) for k in ("x", "y", "dx", "dy")}


def _heading(data: Data, link: str) -> dict[str, list[float]]:
    """Unit vector along a link, in the form of a moving point in `_point`."""
    count = np.size(data["angles"])
    return {key: _short(np.broadcast_to(part, (count,))) for key, part in heading(data, link).items()}


def _short(values: np.ndarray) -> list[float]:
    return [float(f"{value:.{DIGITS}g}") if math.isfinite(value) else 0.0 for value in values.tolist()]


def _times(data: Data, scene: Scene) -> list[float] | None:
    motion = data.get("motion", {})
    if motion.get("time") is None:
        return None
    time = np.append(np.asarray(motion["time"], float), float(motion.get("period", np.nan)))
    good = time.size == np.size(data["angles"]) + 1 and np.all(np.isfinite(time)) and np.all(np.diff(time) > 0)
    return _short(time) if good else None


def _names(data: Data, look: Skeleton) -> list[dict[str, Any]]:
    """Labels of points, one for points that coincide over the cycle, with the neighbouring points to avoid."""
    centres = [shape.centre for shape in look.shapes if shape.centre]
    pieces = [p for shape in look.shapes for p in shape.weights]
    marked = [p for shape in look.shapes for p in shape.marked]
    found: list[dict[str, Any]] = []
    for point in dict.fromkeys([*look.joints, *marked, *centres, *pieces]):
        where = path(data, point)
        where = where[:, np.all(np.isfinite(where), axis=0)]
        twin = next((e for e in found if np.allclose(path(data, e["point"])[:, : where.shape[1]], where,
                                                     atol=1e-6 * look.size, equal_nan=True)), None)  # fmt: skip
        if twin:
            twin["text"] += f", {point}"
            continue
        bodies = [s for s in look.shapes if point in (*s.pins, *s.marked, s.centre, *s.weights)]
        guide = next((g.angle for g in look.guides if g.block in [s.link for s in bodies]), None)
        near = dict.fromkeys(p for s in bodies for p in (*s.pins, *s.marked) if p != point)
        found.append({"text": point, "point": point, "faint": point in (*centres, *pieces), "near": list(near),
                      "pivot": point in look.pivots, "guide": guide})  # fmt: skip
    return found


def _load(data: Data, scene: Scene, load: Any, units: Units | None) -> dict[str, Any] | None:
    """A load: its point, its ranges of crank angle (None: permanent), and its direction: fixed, against the motion, or
    a sense of rotation. The sense of an opposing torque is given at every angle, and so are text and direction of a
    load of varying size; springs and dampers are drawn themselves."""
    entry: dict[str, Any] = {"windows": ranges(data, scene, load), "against": False, "along": None, "turn": None}
    if isinstance(load, Force | OpposingForce):
        entry["point"] = load.point
        if isinstance(load, Force):
            force = float(load.force.x), float(load.force.y)
            size = math.hypot(*force)
            entry["along"] = [part / (size or 1.0) for part in force]
        else:
            size, entry["against"] = float(load.magnitude), True
        text = amount(size, "N", units)
    elif isinstance(load, Torque | OpposingTorque):
        entry["point"] = scene.mechanism.origins()[load.link]
        if isinstance(load, Torque):
            size = float(load.torque)
            entry["turn"] = int(np.sign(size))
        else:
            size = float(load.magnitude)
            rate = np.broadcast_to(np.asarray(data["links"][load.link]["d"], float), (np.size(data["angles"]),))
            entry["turn"] = [int(sense) for sense in -np.sign(rate)]
        text = amount(abs(size), "N·m", units)
    else:
        return None if isinstance(load, Spring | Damper) else _varying(data, scene, load, units)
    return entry | {"text": f"{load.name} {text}"} if size else None


def _varying(data: Data, scene: Scene, load: AbstractLoad, units: Units | None) -> dict[str, Any] | None:
    """A load of varying size; its direction is zero where it is too small to be drawn."""
    found = varying(data, load)
    if found is None:
        return None
    along, size, unit = found
    entry = {"windows": None, "against": False, "along": None, "turn": None,
             "text": [f"{load.name} {amount(float(each), unit, units)}" for each in size],
             "point": load.point or scene.mechanism.origins()[load.link]}  # fmt: skip
    if len(along) == 1:
        return entry | {"turn": along[0].astype(int).tolist()}
    return entry | {"along": [_short(each) for each in along.T]}
