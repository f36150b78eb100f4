"""Mechanisms as pylinkage's JSON.

The format is that of `pylinkage.mechanism.mechanism_to_dict` (pylinkage 1.3): joints with their places, and links
with their joints; lengths are the distances of these places.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

from linkjax.exchange._tree import Places, assembled, places_of, plane
from linkjax.kinematics import Pose
from linkjax.mechanism import Mechanism, StructureError

Document = dict[str, Any]


def to_pylinkage(mechanism: Mechanism, steps: int = 360, name: str = "") -> Document:
    """A mechanism as pylinkage's JSON (a dictionary for `json.dumps`), at crank angle zero, whose crank makes one turn
    in `steps` steps.

    Points and links keep their names; lengths are in metres. Coupler points that other links are pinned to become
    joints of their link, other coupler points become trackers. The name of a slider is the name of its prismatic joint.
    Masses, mass centres and the flywheel are not written.

    pylinkage has rotating cranks, pins, and slides on the frame. Raises `StructureError` for everything else: other
    drivers and groups, guides on moving links, points on sliders. Raises it also for mechanisms that pylinkage's own
    solver steps wrongly: with slides or trackers it solves joints one by one, and uses places of the previous step for
    joints not yet solved. Raises `MachineError` where the mechanism cannot be assembled at crank angle zero.
    """
    here = assembled(mechanism, 0.0)
    places, used = places_of(mechanism), {p for group in mechanism.groups for p in group.needs()}
    joints = [_joint(p, "ground", here) for p in mechanism.fixed]
    links: list[Document] = [{"id": "frame", "type": "ground", "joints": list(mechanism.fixed)}]
    trackers: list[Document] = []
    for group in mechanism.groups:
        made = JOINTS[group.kind](group, places, here) if group.kind in JOINTS else None
        if made is None:
            what = UNABLE.get(group.kind, group.kind)
            raise StructureError("-".join(group.link_names()), f"pylinkage has no such group ({what})",
                                 "use only rotating cranks, RRR, and RRP on the frame")  # fmt: skip
        joints.append(made)
        drives = group.driving() is not None
        if drives:
            links.append(_driver(group, steps))
        bars: list[Document] = []
        for link, (origin, far) in group.pins().items():
            marked = [p for p in mechanism.links[link].point_names() if p not in (origin, far)]
            if far is None and marked:
                raise StructureError(f"links.{link}.points.{marked[0]}", "pylinkage has no points on a slider",
                                     "delete this point")  # fmt: skip
            pinned = [p for p in marked if p in used]
            if far is not None and (pinned or not drives):
                own = f"{link}.{pinned[0]}" if drives else link
                bars.append({"id": own, "type": "link", "joints": [origin, far, *pinned]})
            joints += [_joint(p, "revolute", here) for p in pinned]
            for point in (p for p in marked if p not in used):
                at, base, end = (places[link][p] for p in (point, origin, str(far)))
                trackers.append(_tracker(point, (at - base) * abs(end - base) / (end - base), origin, str(far), here))
        links += sorted(bars, key=lambda bar: len(bar["joints"]))  # pylinkage uses the first joints that it finds
    found = {"name": name or mechanism.formula(), "joints": joints + trackers, "links": links, "ground": "frame"}
    if trackers or any(joint["type"] == "prismatic" for joint in joints):
        _check_order(found)
    return found


def _pair(at: complex) -> list[float]:
    return [at.real, at.imag]


def _joint(point: str, kind: str, here: Pose) -> Document:
    return {"id": point, "type": kind, "position": _pair(plane(here.points[point].r))}


def _driver(crank: Any, steps: int) -> Document:
    return {
        "id": crank.link, "type": "driver", "joints": [crank.pivot, crank.end], "motor_joint": crank.pivot,
        "angular_velocity": crank.sense * math.tau / steps, "initial_angle": float(crank.phase),
    }  # fmt: skip


def _crank_pin(crank: Any, places: Places, here: Pose) -> Document | None:
    return _joint(crank.end, "revolute", here) if crank.law is None else None


def _inner_pin(dyad: Any, places: Places, here: Pose) -> Document | None:
    return _joint(dyad.meet, "revolute", here)


def _slide(group: Any, places: Places, here: Pose) -> Document | None:
    if group.guide.on != "frame":
        return None
    along, base = cmath.exp(1j * float(group.guide.along)), places["frame"][group.guide.through]
    line = {"axis": _pair(along), "line_point": _pair(base + 1j * float(group.guide.offset) * along)}
    return {**_joint(group.end, "prismatic", here), "name": group.block, **line}


JOINTS = {"crank": _crank_pin, "RRR": _inner_pin, "RRP": _slide}  # the joint that a kind of group adds, if it can
UNABLE = {"crank": "a crank that follows a law", "RRP": "a guide on a moving link"}  # groups of these kinds that cannot


def _tracker(point: str, place: complex, origin: str, far: str, here: Pose) -> Document:
    away = {"distance": abs(place), "angle": cmath.phase(place)}
    return {**_joint(point, "tracker", here), "ref_joint1_id": origin, "ref_joint2_id": far, **away}


def _check_order(document: Document) -> None:
    """Follow pylinkage's solver joint by joint: it uses the first joints that it finds on the links of a joint, solved
    or not. Raises `StructureError` where one is not solved."""
    kinds = {joint["id"]: joint["type"] for joint in document["joints"]}
    links = [link["joints"] for link in document["links"]]
    solved = {p for p, kind in kinds.items() if kind == "ground"} | {links[1][1]}
    waiting = [p for p, kind in kinds.items() if kind in ("revolute", "prismatic") and p not in solved]
    while waiting:
        ready = []
        for point in waiting:
            found = [p for link in links if point in link for p in link if p != point]
            needed = 1 if kinds[point] == "prismatic" else 2
            if sum(p in solved for p in found) < needed:
                continue
            if not solved.issuperset(found[:needed]):
                problem = "pylinkage would solve it from joints that are not solved yet"
                raise StructureError(point, problem, "delete coupler points and sliders to which no link is attached")
            ready.append(point)
            solved.add(point)
        waiting = [p for p in waiting if p not in ready]
