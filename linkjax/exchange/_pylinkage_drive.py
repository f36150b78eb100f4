"""The motion of the driver of a pylinkage file: rotation, law, and angle at crank angle zero."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from linkjax.groups import AbstractLaw, Harmonic, Rotation, Spline
from linkjax.mechanism import StructureError

Drawn = Mapping[str, Any]
DISAGREE = 1e-3  # of the drawing's size: allowed difference of a number from a drawing that is true to scale
SAME = 1e-9  # rad
MOST_STEPS = 10000
STEP = 2 * math.pi / 360  # default step of pylinkage's drivers (rad)
KNOTS = 16  # of the law of an arc driver that begins inside its arc, in one cycle


class Motion(NamedTuple):
    """The rotation of a driver ("ccw" or "cw"), its angle (rad) at crank angle zero, its law where it oscillates, and a
    note for the user, or an empty string."""

    rotation: Rotation
    phase: float
    law: AbstractLaw | None
    note: str


def motion_of(bar: Drawn, end: str, arm: complex, size: float) -> Motion:
    """The motion of a driver whose pin `end` is drawn at `arm` from its pivot, in a drawing of this size.

    At crank angle zero the driver is where it is drawn. Raises `StructureError` for a driver that does not move, and
    where its initial angle disagrees with the drawing, unless a number of pylinkage's steps leads from this angle to
    the drawing (pylinkage keeps the initial angle while it steps).
    """
    speed, seen = float(bar.get("angular_velocity", STEP)), math.atan2(arm.imag, arm.real)
    if speed == 0:
        raise StructureError(bar["id"], "does not turn: angular_velocity is 0", "write another angular velocity")
    arc, near = None, DISAGREE * size / abs(arm)
    if bar.get("type") == "arc_driver":
        arc = float(bar.get("arc_start", 0.0)), float(bar.get("arc_end", math.pi))
        if arc[0] >= arc[1]:
            problem = f"oscillates from arc_start {arc[0]:.6g} rad to arc_end {arc[1]:.6g} rad"
            raise StructureError(bar["id"], problem, "write an arc_end above arc_start")
        middle = (arc[0] + arc[1]) / 2
        seen = middle + math.remainder(seen - middle, math.tau)
        if not arc[0] - near <= seen <= arc[1] + near:
            problem = f"{end!r} is drawn at {seen:.6g} rad, outside the arc from {arc[0]:.6g} to {arc[1]:.6g} rad"
            raise StructureError(bar["id"], problem, "correct arc_start and arc_end, or move the joint")
    note, given = "", bar.get("initial_angle")
    if given is not None:
        off = math.remainder(seen - given, math.tau)
        if abs(off) > near:
            steps = _steps_between(float(given), seen, speed, arc)
            if steps is None:
                problem = f"initial_angle is {given:.6g} rad, but {end!r} is drawn at {seen:.6g} rad"
                remedy = "delete initial_angle to start at the drawn angle, or draw all joints at the initial angle"
                raise StructureError(bar["id"], problem, remedy)
            note = f"{bar['id']}: starts where it is drawn, {steps} steps after its initial_angle of {given:.6g} rad"
    if arc is None:
        return Motion("ccw" if speed > 0 else "cw", seen, None, note)
    said = f"{bar['id']}: moves between {arc[0]:.6g} and {arc[1]:.6g} rad as a cosine, not at constant speed"
    return Motion("ccw", 0.0, _law(seen, arc, speed > 0), "; ".join(filter(None, (said, note))))


def _steps_between(given: float, seen: float, speed: float, arc: tuple[float, float] | None) -> int | None:
    """The number of pylinkage's steps from one angle of a driver to another; None if it never gets there."""
    for steps, angle in enumerate(itertools.islice(_stepped(given, speed, arc), MOST_STEPS), 1):
        if abs(math.remainder(angle - seen, math.tau)) < SAME:
            return steps
    return None


def _stepped(angle: float, speed: float, arc: tuple[float, float] | None) -> Iterator[float]:
    """Angles of a driver after each of pylinkage's steps."""
    sense = 1.0
    while True:
        angle += sense * speed
        if arc is not None and angle >= arc[1]:
            angle, sense = 2 * arc[1] - angle, -1.0
        elif arc is not None and angle <= arc[0]:
            angle, sense = 2 * arc[0] - angle, 1.0
        angle = angle if arc is None else max(arc[0], min(arc[1], angle))
        yield angle


def _law(seen: float, arc: tuple[float, float], rises: bool) -> AbstractLaw:
    """An oscillation over an arc, as a cosine, from a start angle in the arc.

    From an end of the arc it is harmonic. From an angle in between it is a spline through points of the cosine. The
    start and both ends are among the points. They are symmetric about each end, so the spline reverses there."""
    start, stop = arc
    if seen <= start + SAME or seen >= stop - SAME:
        return Harmonic(seen, stop if seen <= start + SAME else start)
    middle, half = (start + stop) / 2, (stop - start) / 2
    top = math.acos((seen - middle) / half) * (1 if rises else -1)  # crank angle of the upper end
    even = top + 2 * math.pi / KNOTS * np.arange(KNOTS)
    mirror = [angle % (2 * math.pi) for angle in (0.0, 2 * top)]
    gaps = [np.abs(np.remainder(even - at + math.pi, 2 * math.pi) - math.pi) for at in mirror]
    ends = np.arange(KNOTS) % (KNOTS // 2) == 0
    kept = even[ends | (np.minimum(*gaps) > math.pi / KNOTS / 2)] % (2 * math.pi)
    pairs = {float(angle): middle + half * math.cos(angle - top) for angle in kept}
    pairs |= {float(angle): seen for angle in mirror}
    angles = sorted(pairs)
    return Spline(tuple(angles), tuple(pairs[angle] for angle in angles))
