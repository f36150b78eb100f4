"""Linkages with sliders."""

from __future__ import annotations

import math

from jax.typing import ArrayLike

from linkjax._numerics import safe_sqrt
from linkjax._types import as_float
from linkjax._vec import Vec
from linkjax.groups import RPP, RPR, RRP, RRR, Crank, Guide, Rotation
from linkjax.library._parts import Links, Place, check_closes, check_positive, numbers, origin, parts, vec
from linkjax.mechanism import Flywheel, Mechanism


def slider_crank(
    crank: ArrayLike, rod: ArrayLike, offset: ArrayLike = 0.0, *,
    side: int = 1, rotation: Rotation = "ccw", links: Links = None, flywheel: ArrayLike = 0.0,
) -> Mechanism:  # fmt: skip
    """A slider-crank: `crank` A–B, `rod` B–D (m), and a `slider` pinned at D, which moves along x.

    A is the origin; the path of D is `offset` (m) above it. D is ahead of B, or behind it with `side=-1`; with
    `rotation="cw"` the crank turns clockwise. `links` gives masses and coupler points of links, without length:
    `{"slider": Link(mass=3.0)}`. `flywheel` is the inertia of the flywheel (kg m²).
    Raises `ValueError` for lengths that are not positive, and where the rod cannot reach the path at any crank angle.
    """
    check_positive("slider_crank", crank=crank, rod=rod)
    values = numbers(crank, rod, offset)
    if values and abs(values[2]) >= values[0] + values[1]:
        raise ValueError(
            f"offset of a slider_crank is {values[2]:g}, but crank and rod reach only "
            f"{values[0] + values[1]:g}; reduce the offset, or lengthen the rod"
        )
    links = parts("slider_crank", {"crank": crank, "rod": rod, "slider": 0.0}, links)
    groups = [Crank("crank", "A", "B", rotation), RRP("rod", "slider", "B", "D", Guide("A", 0.0, offset), side)]
    return Mechanism({"A": origin()}, links, groups, Flywheel(flywheel))


def scotch_yoke(
    crank: ArrayLike, *, rotation: Rotation = "ccw", links: Links = None, flywheel: ArrayLike = 0.0
) -> Mechanism:  # fmt: skip
    """A Scotch yoke: the pin B of the `crank` (m) moves a slider `die` in the vertical slot of a `yoke`, which moves
    along x as a pure cosine: its point E is at (crank cos φ, 0).

    A, the origin, is the pivot of the crank. `rotation`, `links` and `flywheel` are as for `slider_crank`.
    Raises `ValueError` for a length that is not positive.
    """
    check_positive("scotch_yoke", crank=crank)
    links = parts("scotch_yoke", {"crank": crank, "yoke": 0.0, "die": 0.0}, links)
    groups = [Crank("crank", "A", "B", rotation), RPP("yoke", "die", "B", "E", Guide("A"))]
    return Mechanism({"A": origin()}, links, groups, Flywheel(flywheel))


def quick_return(
    crank: ArrayLike, distance: ArrayLike, lever: ArrayLike, rod: ArrayLike, height: ArrayLike, *,
    side: int = -1, rotation: Rotation = "ccw", links: Links = None, flywheel: ArrayLike = 0.0,
) -> Mechanism:  # fmt: skip
    """A quick-return drive: the pin B of the `crank` O–B moves a slider `die` in a slotted `lever` P–E, whose end moves
    a `ram` through a `rod` E–R.

    O is the origin, P lies `distance` (m) below it. The path of R runs along x, `height` (m) above O, through the
    point T above O; R is behind E, or ahead of it with `side=1`. If the crank is shorter than the distance, the lever
    oscillates (shaper drive); if it is longer, the lever rotates (Whitworth). `rotation`, `links` and `flywheel` are as
    for `slider_crank`. Raises `ValueError` for lengths that are not positive, and where crank and distance are equal.
    """
    check_positive("quick_return", crank=crank, distance=distance, lever=lever, rod=rod)
    values = numbers(crank, distance)
    if values and values[0] == values[1]:
        raise ValueError(
            f"crank and distance of a quick_return are both {values[0]:g}, so the die meets the lever's pivot; "
            "shorten the crank for an oscillating lever, lengthen it for a rotating one"
        )
    links = parts("quick_return", {"crank": crank, "lever": lever, "die": 0.0, "rod": rod, "ram": 0.0}, links)
    fixed = {"O": origin(), "P": Vec(0.0, -as_float(distance)), "T": Vec(0.0, height)}
    groups = [
        Crank("crank", "O", "B", rotation),
        RPR("lever", "die", "B", "P", "E"),
        RRP("rod", "ram", "E", "R", Guide("T"), side),
    ]
    return Mechanism(fixed, links, groups, Flywheel(flywheel))


def toggle_press(
    crank: ArrayLike, rod: ArrayLike, upper: ArrayLike, lower: ArrayLike, pivot: Place, *,
    side: int = 1, rotation: Rotation = "ccw", links: Links = None, flywheel: ArrayLike = 0.0,
) -> Mechanism:  # fmt: skip
    """A toggle press: `crank` A–B and `rod` B–C extend and fold the toggle of the bars `upper` D–C and `lower` C–E,
    which moves a `ram`, pinned at E, up and down.

    A is the origin, D is the frame point at `pivot` (m), and E moves straight below it. C is to the left of the line
    from B to D, or to its right with `side=-1`. `rotation`, `links` and `flywheel` are as for `slider_crank`.
    Raises `ValueError` for lengths that are not positive, and where crank, rod and upper bar cannot be assembled at any
    crank angle.
    """
    check_positive("toggle_press", crank=crank, rod=rod, upper=upper, lower=lower)
    pivot = vec(pivot)
    check_closes("toggle_press", crank=crank, rod=rod, upper=upper, pivot=safe_sqrt(pivot.squared()))
    lengths = {"crank": crank, "rod": rod, "upper": upper, "lower": lower, "ram": 0.0}
    groups = [
        Crank("crank", "A", "B", rotation),
        RRR(("rod", "upper"), "B", "D", "C", side),
        RRP("lower", "ram", "C", "E", Guide("D", -math.pi / 2)),
    ]
    return Mechanism({"A": origin(), "D": pivot}, parts("toggle_press", lengths, links), groups, Flywheel(flywheel))
