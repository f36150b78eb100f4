"""Geometry needed to draw a machine: points of each link, pivots, sliders, guides, mass centres."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from linkjax._display import Units, prefixed
from linkjax.loads import AbstractLoad, Damper, Force, OpposingForce, OpposingTorque, Spring, Torque
from linkjax.machine import Scene
from linkjax.mechanism import Link
from linkjax.viz._style import Data, closed, lost, ranges
from linkjax.viz._ties import Tie, ties_of
from linkjax.viz._wheels import Strands, Wheel, wheels_of

Place = tuple[float, float]
Places = dict[str, np.ndarray]
SMALL = 1e-3  # of its largest value: a smaller load is not drawn


class Shape(NamedTuple):
    """A link to draw: its pins, its additional points, its mass centre (None without mass), whether it is a slider
    (`block`), its counterweights with their radii (m; None unless a disc), and for a slider whether its guide moves."""

    link: str
    pins: tuple[str, ...]
    marked: tuple[str, ...]
    centre: str | None
    block: bool
    weights: dict[str, float | None]
    upon: bool = False


class Guide(NamedTuple):
    """A straight guide of the frame: its slider, its direction (rad) and the two ends of the stroke of the pin."""

    block: str
    angle: float
    ends: tuple[np.ndarray, np.ndarray]


class Slot(NamedTuple):
    """A straight guide on the link `on`, in the axes of that link with origin at its point `origin`: direction (rad),
    and the two ends of the stroke of the slider pin."""

    on: str
    origin: str
    angle: float
    ends: tuple[np.ndarray, np.ndarray]

    def drawn(self, at: Places) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Its two ends and its direction at the position of the link."""
        axes = _axes(at[self.on])
        along = axes @ np.array([math.cos(self.angle), math.sin(self.angle)])
        return at[self.origin] + axes @ self.ends[0], at[self.origin] + axes @ self.ends[1], along


class Arrow(NamedTuple):
    """An active load: a force arrow along `along` with its head at `at`, or a torque of sense `turn` about `at`."""

    text: str
    at: np.ndarray
    along: np.ndarray
    turn: int


class Skeleton(NamedTuple):
    """All parts to draw, independent of the crank angle, and the bounds of the drawing (m)."""

    shapes: tuple[Shape, ...]
    pivots: tuple[str, ...]
    joints: tuple[str, ...]
    guides: tuple[Guide, ...]
    slots: tuple[Slot, ...]
    traced: tuple[str, ...]
    wheels: tuple[Wheel, ...]
    belts: tuple[Strands, ...]
    ties: tuple[Tie, ...]
    low: np.ndarray
    high: np.ndarray

    @property
    def size(self) -> float:
        """Longer side of the rectangle that holds all points over the cycle."""
        return float(np.max(self.high - self.low)) or 1.0


def skeleton(data: Data, scene: Scene) -> Skeleton:
    """The parts to draw, from the scene of a machine and the paths of its points."""
    mechanism = scene.mechanism
    shapes, joints = [], []
    for group in mechanism.groups:
        upon = {joint.link: joint.by for joint in group.joints() if joint.slides}
        for name, ends in group.pins().items():
            link = mechanism.links[name]
            pins = tuple(p for p in ends if p is not None)
            heavy = float(link.actual().mass) > 0
            shapes.append(Shape(name, pins, tuple(link.points), link.centre_name if heavy else None, name in upon,
                                _weights(link), upon.get(name, "frame") != "frame"))  # fmt: skip
            joints += [p for p in pins if p not in joints]
    ties = ties_of(scene)
    held = dict.fromkeys(p for tie in ties for p in tie.ends)
    joints += [p for p in held if p in mechanism.fixed and p not in joints]
    drawn = {p for s in shapes for p in (*s.pins, *s.marked, *s.weights, *([s.centre] if s.centre else []))} | {*held}
    paths = {p: path(data, p) for p in data["points"] if p in drawn}
    discs = [(p, r) for s in shapes for p, r in s.weights.items() if r]
    wheels, belts = wheels_of(scene, lambda point: path(data, point))
    discs += [(wheel.point, wheel.radius) for wheel in wheels]
    rims = [path(data, p) + side * r for p, r in discs for side in (-1, 1)]
    sound = np.concatenate([*paths.values(), *rims], axis=1)
    sound = sound[:, np.all(np.isfinite(sound), axis=0)]
    if not sound.size:
        sound = np.zeros((2, 1))
    pivots = tuple(p for p in joints if p in mechanism.fixed)
    loaded = {load.point for load in scene.loads}
    traced = tuple(p for s in shapes for p in (*s.pins[1:], *s.marked, s.centre)
                   if p and (p != s.centre or p in loaded) and p in paths)  # fmt: skip
    guides = tuple(g for g in (_guide(data, shape, paths) for shape in shapes if shape.block and not shape.upon) if g)
    low, high = sound.min(axis=1), sound.max(axis=1)
    return Skeleton(tuple(shapes), pivots, tuple(joints), guides, _slots(data, scene), tuple(dict.fromkeys(traced)),
                    wheels, belts, ties, low, high)  # fmt: skip


def _slots(data: Data, scene: Scene) -> tuple[Slot, ...]:
    """The guides on moving links."""
    found, origins = [], scene.mechanism.origins()
    for joint in (joint for group in scene.mechanism.groups for joint in group.joints()):
        if not joint.slides or joint.by is None or joint.by == "frame":
            continue
        heading, origin = data["links"][joint.by]["angle"], origins[joint.by]
        off = path(data, joint.point) - path(data, origin)
        turn = closed(data, heading)
        local = np.stack([np.cos(turn) * off[0] + np.sin(turn) * off[1], np.cos(turn) * off[1] - np.sin(turn) * off[0]])
        lean = np.asarray(data["links"][joint.link]["angle"], float) - np.asarray(heading, float)
        good = np.all(np.isfinite(local), axis=0)
        if not good.any() or not np.isfinite(lean).any():
            continue
        local, angle = local[:, good], float(np.ravel(lean)[np.isfinite(np.ravel(lean))][0])
        stroke = np.array([math.cos(angle), math.sin(angle)]) @ local
        found.append(Slot(joint.by, origin, angle, (local[:, stroke.argmin()], local[:, stroke.argmax()])))
    return tuple(found)


def _axes(heading: np.ndarray) -> np.ndarray:
    """Rotation matrix from the axes of a link with the direction `heading` to the frame."""
    c, s = heading / (math.hypot(*heading) or 1.0)
    return np.array([[c, -s], [s, c]])


def _weights(link: Link) -> dict[str, float | None]:
    radii = {name: piece.radius() for name, piece in link.counterweights.items() if float(piece.mass) > 0}
    return {name: None if radius is None else float(radius) for name, radius in radii.items()}


def outline(shape: Shape, at: Places, flat: float) -> list[str]:
    """Corner points of a link, in order: one, two for a bar, more for a plate; a width below `flat` (m) makes a bar."""
    names = list(dict.fromkeys((*shape.pins, *shape.marked)))
    corners = np.stack([at[p] for p in names])
    if len(names) < 2:
        return names
    axis = corners[1] - corners[0]
    axis = axis / (math.hypot(*axis) or 1.0)
    off, on = (corners - corners[0]) @ np.array([-axis[1], axis[0]]), (corners - corners[0]) @ axis
    if np.ptp(off) < flat:
        return [names[int(np.argmin(on))], names[int(np.argmax(on))]]
    out = corners - corners.mean(axis=0)
    return [names[i] for i in np.argsort(np.arctan2(out[:, 1], out[:, 0]))]


def path(data: Data, point: str) -> np.ndarray:
    """Path of a point over the closed cycle, shape (2, angles + 1)."""
    where = data["points"][point]
    return np.stack([closed(data, where["x"]), closed(data, where["y"])])


def _guide(data: Data, shape: Shape, paths: Places) -> Guide | None:
    """The guide of a slider whose pin moves on a straight line of the frame; None otherwise."""
    angle = float(np.mean(np.asarray(data["links"][shape.link]["angle"], float)))
    along = np.array([math.cos(angle), math.sin(angle)])
    track = paths[shape.pins[0]]
    track = track[:, np.all(np.isfinite(track), axis=0)]
    if not track.size:
        return None
    stroke, off = along @ track, along[0] * track[1] - along[1] * track[0]
    if np.ptp(off) > 1e-6 * max(np.ptp(stroke), 1e-12):
        return None
    base = track[:, 0] - along * stroke[0]
    return Guide(shape.link, angle, (base + along * stroke.min(), base + along * stroke.max()))


def places(data: Data, scene: Scene, angle: float) -> Places:
    """Positions of all points and directions of all links, by name, at a crank angle (rad), by cubic Hermite
    interpolation between the tabulated angles."""
    angles, cycle = np.asarray(data["angles"], float), scene.cycle
    knots = np.append(angles, angles[0] + cycle)
    angle = angles[0] + (angle - angles[0]) % cycle
    i = int(np.clip(np.searchsorted(knots, angle, side="right") - 1, 0, angles.size - 1))
    h, j = knots[i + 1] - knots[i], (i + 1) % angles.size
    t = (angle - knots[i]) / h
    near, far = (1 + 2 * t) * (1 - t) ** 2, t * t * (3 - 2 * t)
    leave, arrive = h * t * (1 - t) ** 2, h * t * t * (t - 1)

    def between(p, x, dx):
        value, slope = (np.broadcast_to(np.asarray(p[k], float), angles.shape) for k in (x, dx))
        return near * value[i] + far * value[j] + leave * slope[i] + arrive * slope[j]

    ways = {name: heading(data, name) for name in data["links"]}
    return {n: np.array([between(p, "x", "dx"), between(p, "y", "dy")]) for n, p in {**data["points"], **ways}.items()}


def heading(data: Data, link: str) -> dict[str, np.ndarray]:
    """Unit vector along a link and its first kinematic coefficient, with the keys of a point."""
    angle, rate = (np.asarray(data["links"][link][key], float) for key in ("angle", "d"))
    return {"x": np.cos(angle), "y": np.sin(angle), "dx": -np.sin(angle) * rate, "dy": np.cos(angle) * rate}


def velocity(data: Data, scene: Scene, point: str, angle: float) -> np.ndarray:
    """First kinematic coefficient of a point at a crank angle, linear between the tabulated angles."""
    p, phi = data["points"][point], np.append(np.asarray(data["angles"], float), scene.cycle)
    return np.array([np.interp(angle % scene.cycle, phi, closed(data, p[k])) for k in ("dx", "dy")])


def arrows(data: Data, scene: Scene, angle: float, units: Units | None = None) -> list[Arrow]:
    """The loads that act at a crank angle."""
    found, at = [], places(data, scene, angle)
    origins = scene.mechanism.origins()
    for load in scene.loads:
        if not acts(data, scene, load, angle):
            continue
        nothing = np.zeros(2)
        if isinstance(load, Force | OpposingForce):
            if isinstance(load, Force):
                force = np.array([float(load.force.x), float(load.force.y)])
                size = math.hypot(*force)
            else:
                force, size = -velocity(data, scene, load.point, angle), float(load.magnitude)
            if size > 0 and math.hypot(*force) > 0:
                text = f"{load.name} {amount(size, 'N', units)}"
                found.append(Arrow(text, at[load.point], force / math.hypot(*force), 0))
        elif isinstance(load, Torque | OpposingTorque):
            if isinstance(load, Torque):
                torque = float(load.torque)
            else:
                link = data["links"][load.link]
                phi = np.append(np.asarray(data["angles"], float), scene.cycle)
                torque = -float(load.magnitude * np.sign(np.interp(angle % scene.cycle, phi, closed(data, link["d"]))))
            if torque != 0:
                text = f"{load.name} {amount(abs(torque), 'N·m', units)}"
                found.append(Arrow(text, at[origins[load.link]], nothing, 1 if torque > 0 else -1))
        elif not isinstance(load, Spring | Damper):  # those are drawn themselves
            found += _varying(data, load, angle % scene.cycle, at[load.point or origins[load.link]], units)
    return found


def varying(data: Data, load: AbstractLoad) -> tuple[np.ndarray, np.ndarray, str] | None:
    """Force or torque of a load of varying size, such as a table or gas, at the crank angles of the analysis: direction
    (one or two rows; zero where it is too small to be drawn), magnitude and unit. None where it does nothing."""
    run = (data.get("loads") or {}).get(load.name)
    if run is None:
        return None
    every = [np.broadcast_to(np.asarray(run[key], float), (np.size(data["angles"]),))
             for key in ("fx", "fy", "moment") if key in run]  # fmt: skip
    parts = np.stack(every)
    size = np.linalg.norm(parts, axis=0)
    if not np.max(size) > 0:
        return None
    drawn = size > SMALL * np.max(size)
    return np.where(drawn, parts / np.where(drawn, size, 1.0), 0.0), size, "N" if len(parts) > 1 else "N·m"


def _varying(data: Data, load: AbstractLoad, angle: float, place: np.ndarray, units: Units | None) -> list[Arrow]:
    """A load of varying size as it acts at the nearest crank angle of the analysis."""
    found = varying(data, load)
    if found is None:
        return []
    i = int(np.argmin(np.abs(np.asarray(data["angles"], float) - angle)))
    along, size, unit = found[0][:, i], float(found[1][i]), found[2]
    if not np.any(along):
        return []
    text = f"{load.name} {amount(size, unit, units)}"
    return [Arrow(text, place, np.zeros(2), int(along[0])) if along.size == 1 else Arrow(text, place, along, 0)]


def acts(data: Data, scene: Scene, load: AbstractLoad, angle: float) -> bool:
    """Whether a load acts at a crank angle (rad)."""
    found, cycle = ranges(data, scene, load), scene.cycle
    if found is None:
        return True
    return any((angle - on) % cycle < ((off - on) % cycle if off < cycle else off - on) for on, off in found)


def amount(value: float, unit: str, units: Units | None = None) -> str:
    """Magnitude of a load with its unit, as written beside its arrow."""
    factor, shown = prefixed(value, unit, units)
    return f"{factor * value:.4g} {shown}"


def clearest(data: Data, scene: Scene, look: Skeleton) -> float:
    """Crank angle (rad, a multiple of 5 degrees) with most loads active and, among these, the joints best separated."""
    best, chosen = (-1, -1.0), 0.0
    good = ~lost(data)
    angles = np.asarray(data["angles"], float)
    for angle in np.radians(np.arange(0, 360 * scene.cycle_turns, 5)):
        at = places(data, scene, float(angle))
        spots = np.stack([at[p] for p in look.joints])
        gaps = np.hypot(*(spots[:, None] - spots[None]).T) + np.eye(len(spots)) * 1e9
        lengths = [at[s.pins[1]] - at[s.pins[0]] for s in look.shapes if len(s.pins) > 1]
        spread = min((abs(a[0] * b[1] - a[1] * b[0]) / (math.hypot(*a) * math.hypot(*b) or 1.0)
                      for i, a in enumerate(lengths) for b in lengths[:i]), default=1.0)  # fmt: skip
        working = sum(acts(data, scene, load, float(angle)) for load in scene.loads)
        sound = bool(good[int(np.argmin(np.abs(angles - angle)))])
        score = (working if sound else -1, float(gaps.min()) / look.size * (0.15 + spread))
        if score > best:
            best, chosen = score, float(angle)
    return chosen
