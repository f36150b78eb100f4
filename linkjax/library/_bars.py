"""Linkages of bars and pins."""

from __future__ import annotations

from jax.typing import ArrayLike

from linkjax._vec import Vec
from linkjax.groups import RRR, Crank, Rotation
from linkjax.library._parts import Links, Place, check_closes, check_positive, origin, parts, vec
from linkjax.mechanism import Flywheel, Mechanism

CARRIERS: dict[str, tuple[str, str]] = {  # the link with E and the link with F
    "watt-1": ("coupler", "rocker"),
    "watt-2": ("rocker", "frame"),
    "stephenson-1": ("crank", "rocker"),
    "stephenson-3": ("coupler", "frame"),
}


def four_bar(
    crank: ArrayLike, coupler: ArrayLike, rocker: ArrayLike, frame: ArrayLike, *,
    side: int = 1, rotation: Rotation = "ccw", links: Links = None, flywheel: ArrayLike = 0.0,
) -> Mechanism:  # fmt: skip
    """A four-bar linkage with the bars `crank` A–B, `coupler` B–C, `rocker` D–C and the distance A–D `frame` (m).

    A is the origin, D lies on the x axis. C is to the left of the line from B to D, or to its right with `side=-1`;
    with `rotation="cw"` the crank turns clockwise. `links` gives masses and coupler points of links, without length:
    `{"coupler": Link(mass=1.2, points={"E": Vec(0.1, 0.05)})}`. `flywheel` is the inertia of the flywheel (kg m²).
    `linkjax.margins` shows whether the crank can rotate fully. Raises `ValueError` for lengths that are not positive,
    and where one bar is longer than the other three together.
    """
    check_positive("four_bar", crank=crank, coupler=coupler, rocker=rocker, frame=frame)
    check_closes("four_bar", crank=crank, coupler=coupler, rocker=rocker, frame=frame)
    bars = parts("four_bar", {"crank": crank, "coupler": coupler, "rocker": rocker}, links)
    return Mechanism({"A": origin(), "D": Vec(frame, 0.0)}, bars, _four(side, rotation), Flywheel(flywheel))


def six_bar(
    kind: str, crank: ArrayLike, coupler: ArrayLike, rocker: ArrayLike, frame: ArrayLike,
    rod: ArrayLike, lever: ArrayLike, e: Place, f: Place, *,
    side: int = 1, second_side: int = 1, rotation: Rotation = "ccw", links: Links = None, flywheel: ArrayLike = 0.0,
) -> Mechanism:  # fmt: skip
    """A six-bar linkage driven by its crank on the frame: a `four_bar` with points A B C D, and two more bars, `rod`
    E–G and `lever` F–G (m).

    `kind` selects the links of E and F: "watt-1" coupler and rocker, "watt-2" rocker and frame, "stephenson-1" crank
    and rocker, "stephenson-3" coupler and frame. `e` and `f` are their positions in the axes of that link, or on the
    frame (m). G is to the left of the line from E to F, or to its right with `second_side=-1`. The other arguments are
    those of `four_bar`.

    "stephenson-2" is not available: driven by a crank on the frame it is of class III or IV and needs
    `linkjax.groups.General`. Raises `ValueError` as `four_bar` does, and for an unknown `kind`.
    """
    if kind not in CARRIERS:
        other = "driven from the frame it is of class III or IV; build it with a Crank and linkjax.groups.General"
        remedy = other if kind == "stephenson-2" else f"write one of {', '.join(CARRIERS)}"
        raise ValueError(f"kind of a six_bar is {kind!r}; {remedy}")
    check_positive("six_bar", crank=crank, coupler=coupler, rocker=rocker, frame=frame, rod=rod, lever=lever)
    check_closes("six_bar", crank=crank, coupler=coupler, rocker=rocker, frame=frame)
    marks: dict[str, dict[str, Vec]] = {}
    for link, point, at in zip(CARRIERS[kind], "EF", (e, f), strict=True):
        marks.setdefault(link, {})[point] = vec(at)
    lengths = {"crank": crank, "coupler": coupler, "rocker": rocker, "rod": rod, "lever": lever}
    fixed = {"A": origin(), "D": Vec(frame, 0.0), **marks.pop("frame", {})}
    groups = [*_four(side, rotation), RRR(("rod", "lever"), "E", "F", "G", second_side)]
    return Mechanism(fixed, parts("six_bar", lengths, links, marks), groups, Flywheel(flywheel))


def _four(side: int, rotation: Rotation) -> list:
    return [Crank("crank", "A", "B", rotation), RRR(("coupler", "rocker"), "B", "D", "C", side)]
