"""Checks of the loads of a scene against its mechanism."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linkjax._types import known
from linkjax._units import nearest
from linkjax.groups import FRAME
from linkjax.loads import AbstractLoad, Passage, Window
from linkjax.machine._coordinates import check_table
from linkjax.machine._passages import check_passage
from linkjax.mechanism import Mechanism, StructureError


def check_loads(mechanism: Mechanism, loads: Sequence[AbstractLoad], cycle: float) -> None:
    """Raise `StructureError` for a load whose name is used already, whose window is invalid, or that acts on an unknown
    link or point, or where nothing moves. `cycle` is the length of the cycle (rad)."""
    seen = {"gravity", "drive"}
    for number, load in enumerate(loads):
        element = f"loads[{number}] ({load.name})"
        if load.name in seen:
            raise StructureError(element, f"the name {load.name!r} is used already", "give every load its own name")
        seen.add(load.name)
        if isinstance(load.window, Passage):
            check_passage(f"loads[{number}].window ({load.name})", mechanism, load.window)
        elif load.window is not None and _whole(load.window, cycle):
            remedy = "omit `window` for a permanent load, or delete a load that never acts"
            raise StructureError(element, "window start and end coincide", remedy)
        elif load.window is not None and (far := _far(load.window, cycle)):
            problem = f"its window is at {far:.6g} rad, far outside of the cycle of {cycle:.6g} rad"
            raise StructureError(element, problem, "write radians, e.g. math.radians(180)")
        ends = load.attachments()
        for link in (load.link, *(link for link, _ in ends if link != FRAME)):
            if link not in mechanism.links:
                raise StructureError(element, f"link {link!r} is not defined", nearest(link, mechanism.links))
        _check_moves(element, mechanism, load)
        for link, point in ends:
            own = mechanism.points_on(link)
            if point and point not in own:
                where = "a point of the frame" if link == FRAME else f"on link {link!r}"
                raise StructureError(element, f"point {point!r} is not {where}", _remedy(mechanism, link, point))
        check_table(element, mechanism, cycle, load)


def _remedy(mechanism: Mechanism, link: str, point: str) -> str:
    """The remedy for a point that is not on its link."""
    holders = [name for name in mechanism.links if point in mechanism.points_on(name)] if link == FRAME else []
    return f"name its link too, {holders[0]!r}" if holders else nearest(point, mechanism.points_on(link))


def _check_moves(element: str, mechanism: Mechanism, load: AbstractLoad) -> None:
    """Raise `StructureError` for a load against a motion, or between two points, where nothing moves."""
    ends = load.attachments()
    against = load.opposing or "speed" in load.depends_on
    if not (against or (len(ends) > 1 and load.point)) or any(_moves(mechanism, *end) for end in ends):
        return
    what = f"point {load.point!r}" if load.point else f"link {load.link!r}"
    does, kind = ("moves", "point") if load.point else ("turns", "link")
    if len(ends) > 1:
        problem, why = f"{what} never {does}, and its other end neither", "so the load has no effect"
    else:
        problem, why = f"{what} never {does}", "so there is no motion to oppose"
    raise StructureError(element, f"{problem}, {why}", f"name another {kind}, or delete the load")


def _moves(mechanism: Mechanism, link: str, point: str) -> bool:
    """Whether a point moves, or, without a point, whether a link may turn."""
    if point:
        return point not in mechanism.fixed
    return link != FRAME and link not in {name for group in mechanism.groups for name in group.translating()}


def _far(window: Window, cycle: float) -> float:
    """An end of a window that is more than two cycles from zero, as numbers in degrees are; zero if there is none."""
    ends = [np.ravel(end) for part in (window.on, window.off) if (end := known(part)) is not None]
    every = np.concatenate(ends) if ends else np.zeros(1)
    most = every[np.argmax(np.abs(every))] if every.size else 0.0
    return float(most) if abs(most) > 2 * cycle else 0.0


def _whole(window: Window, cycle: float) -> bool:
    """Whether the ends of a window are one place of the cycle."""
    on, off = known(window.on), known(window.off)
    if on is None or off is None or on.ndim:
        return False
    turns = np.round((off - on) / cycle)
    return bool(np.any(np.abs(off - on - turns * cycle) < 1e-9 * cycle))
