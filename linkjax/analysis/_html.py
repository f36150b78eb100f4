"""A cycle in a notebook: the machine, crank speed and drive torque as small drawings, and the text of `print(cycle)`.

Drawn as SVG by hand, because a notebook shows every result of a cell, and loading a plotting library takes seconds.
The figures of `linkjax.viz` are complete; these have pins, links, sliders and paths alone.
"""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

import numpy as np

from linkjax._display import Numbers
from linkjax.analysis._text import cycle_text
from linkjax.kinematics import Pose

SIZE, WIDTH, HEIGHT, EDGE = 260.0, 300.0, 112.0, 16.0  # of the drawing, and of a curve, in CSS pixels
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
TEXT = 'font-family="sans-serif" font-size="10" fill="currentColor"'
SHOW = Numbers()


def cycle_html(cycle: Any) -> str | None:
    """The drawing, the curves and the text of a cycle; None for a batch of cycles, or a traced one."""
    try:
        if np.ndim(cycle.result):
            return None
        parts = [_machine(cycle), *_curves(cycle)]
    except (AttributeError, TypeError, ValueError):  # what numpy raises for tracers
        return None
    boxes = "".join(f'<div style="margin:4px 12px 4px 0">{part}</div>' for part in parts if part)
    text = html.escape(cycle_text(cycle))
    return f'<div style="display:flex;flex-wrap:wrap;align-items:center">{boxes}</div><pre>{text}</pre>'


def _places(pose: Pose) -> dict[str, np.ndarray]:
    """The positions of all points (m) at all angles, each of shape (2, angles)."""
    shape = next(iter(pose.links.values())).w.shape
    return {
        name: np.stack([np.broadcast_to(np.asarray(part, float), shape) for part in (at.r.x, at.r.y)])
        for name, at in pose.points.items()
    }


def _clearest(places: list[np.ndarray]) -> int:
    """The angle at which the two joints that are nearest to each other are farthest apart."""
    apart = [np.hypot(*(a - b)) for i, a in enumerate(places) for b in places[:i]]
    return int(np.argmax(np.nan_to_num(np.min(apart, axis=0), nan=-1.0))) if apart else 0


def _machine(cycle: Any) -> str:
    """Links, pins, sliders and the paths of pins to scale, at the angle at which they are seen best."""
    mechanism, places = cycle.scene.mechanism, _places(cycle.pose)
    pinned = [pair for group in mechanism.groups for pair in group.pins().items()]
    links = {name: [p for p in ends if p is not None] for name, ends in pinned}
    sliders = {joint.link: joint.point for group in mechanism.groups for joint in group.joints() if joint.slides}
    pins = list(dict.fromkeys(p for ends in links.values() for p in ends))
    corners = {name: list(dict.fromkeys((*ends, *mechanism.links[name].points))) for name, ends in links.items()}
    used = list(dict.fromkeys(p for ends in corners.values() for p in ends))
    every = np.concatenate([places[p] for p in used], axis=1)
    every = every[:, np.all(np.isfinite(every), axis=0)]
    if not every.size:
        return ""
    low, high = every.min(axis=1), every.max(axis=1)
    size = float(np.max(high - low)) or 1.0
    scale, k = (SIZE - 2 * EDGE) / size, _clearest([places[p] for p in pins])
    width, height = (float(x) * scale + 2 * EDGE for x in high - low)

    def drawn(at: np.ndarray) -> np.ndarray:
        return np.stack([EDGE + (at[0] - low[0]) * scale, EDGE + (high[1] - at[1]) * scale])

    shapes = [_line(drawn(places[p]), "#999999", 0.7) for p in used]
    for i, (name, ends) in enumerate(corners.items()):
        colour, outline = COLOURS[i % len(COLOURS)], [places[p][:, k] for p in ends]
        if len(outline) > 1:
            shapes.append(_line(drawn(np.stack(outline + outline[:1] * (len(outline) > 2), axis=1)), colour, 4.0))
        if name in sliders:
            axis = cycle.pose.links[name].u
            across, up = (float(np.broadcast_to(part, np.shape(cycle.angles))[k]) for part in (axis.x, axis.y))
            shapes.append(_block(drawn(places[sliders[name]][:, k]), float(np.degrees(np.arctan2(up, across))), colour))
    for p in pins:
        x, y = drawn(places[p][:, k])
        if p in mechanism.fixed:
            shapes.append(f'<path d="M{x:.1f} {y:.1f}l-6 10h12z" fill="currentColor"/>')
        shapes.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="white" stroke="black"/>')
        shapes.append(f'<text x="{x + 5:.1f}" y="{y - 5:.1f}" {TEXT}>{html.escape(p)}</text>')
    return _svg(width, height, shapes, f"{cycle.scene.title or 'Machine'} at {np.degrees(cycle.angles[k]):.0f}°")


def _block(at: np.ndarray, angle: float, colour: str) -> str:
    """A slider at a place of the drawing, turned counter-clockwise by an angle (degrees)."""
    place = f"translate({at[0]:.1f} {at[1]:.1f}) rotate({-angle:.1f})"
    line = f'fill="none" stroke="{colour}" stroke-width="2"'
    return f'<rect x="-11" y="-7" width="22" height="14" {line} transform="{place}"/>'


def _curves(cycle: Any) -> list[str]:
    """Crank speed and drive torque over the crank angle: that of the actual motion, unless it is constant."""
    found: list[tuple[str, Callable[[float], str], Any]] = []
    if cycle.speed is not None:
        found.append(("crank speed", SHOW.speed, cycle.speed))
    constant = cycle.forces is None or (cycle.steady is not None and cycle.steady.driven is None)
    forces: Any = cycle.forces_constant_speed if constant else cycle.forces
    where = " at constant speed" if constant else ""
    found.append((f"drive torque{where}", lambda value: SHOW.quantity(value, "N·m"), forces.drive_torque))
    angles = np.degrees(np.asarray(cycle.angles, float))
    return [_curve(name, shown, angles, np.asarray(values, float)) for name, shown, values in found]


def _curve(name: str, shown: Any, angles: np.ndarray, values: np.ndarray) -> str:
    """One curve with its name, least and greatest value."""
    good = values[np.isfinite(values)]
    if not good.size:
        return ""
    low, high = float(good.min()), float(good.max())
    top, bottom = 18.0, HEIGHT - 14.0
    span = high - low if high - low > 1e-9 * max(abs(low), abs(high)) else 1.0
    across = angles * (WIDTH / (angles[-1] or 1.0))
    at = np.stack([across, bottom - (values - low) / span * (bottom - top)])
    shapes = [
        f'<path d="M0 {bottom:.0f}H{WIDTH:.0f}" stroke="currentColor" stroke-width="0.5"/>',
        _line(at, COLOURS[0], 1.5),
        f'<text x="0" y="10" {TEXT}>{name}: {html.escape(shown(low))} to {html.escape(shown(high))}</text>',
        f'<text x="0" y="{HEIGHT - 2:.0f}" {TEXT}>{angles[0]:.0f}°</text>',
        f'<text x="{WIDTH:.0f}" y="{HEIGHT - 2:.0f}" text-anchor="end" {TEXT}>{angles[-1]:.0f}°</text>',
    ]
    return _svg(WIDTH, HEIGHT, shapes, f"{name} over the crank angle")


def _line(at: np.ndarray, colour: str, width: float) -> str:
    """A line through points, shape (2, points), interrupted where they are not finite."""
    good = np.all(np.isfinite(at), axis=0)
    steps = [f"{'L' if i and good[i - 1] else 'M'}{at[0, i]:.1f} {at[1, i]:.1f}" for i in np.flatnonzero(good)]
    line = f'fill="none" stroke="{colour}" stroke-width="{width}" stroke-linejoin="round" stroke-linecap="round"'
    return f'<path d="{"".join(steps)}" {line}/>'


def _svg(width: float, height: float, shapes: list[str], label: str) -> str:
    size = f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{html.escape(label)}" {size}>'
    return f"{head}{''.join(shapes)}</svg>"
