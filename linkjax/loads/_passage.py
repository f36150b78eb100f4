"""Windows that are given by what happens: where a point is on its way, or at which angle a link is."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._types import as_float, known
from linkjax._vec import unit
from linkjax.groups import Guide, LinkState, PointState, Seen
from linkjax.kinematics import Pose
from linkjax.mechanism import Mechanism

SENSES = {"point": ("+", "-"), "link": ("ccw", "cw")}
PARTS = ("first", "last", "between")
STILL = 1e-9  # of the speed of a point: a coordinate that changes more slowly does not change


def _pair(values: Any) -> Any:
    """Two numbers as float arrays; None for None."""
    if values is None:
        return None
    if not isinstance(values, tuple | list) or len(values) != 2:
        raise ValueError(f"between of a window is {values!r}; write two values, (low, high)")
    return tuple(as_float(value) for value in values)


class Passage(eqx.Module):
    """The part of its ways on which a `point` (or a `link`) lets a load act, the window of a load.

    A way leads from one dead centre to the next (of a link: from one limit position to the next). The load acts on the
    `first` or `last` part of each way, or while the coordinate is `between` two values, low and high. On a way shorter
    than `first` or `last` the load acts all the time. `going` restricts it to ways in one sense: "+" or "-" for a
    point, "ccw" or "cw" for a link; it may be all that is given, for whole ways.

    The coordinate of a point of a slider is that along its guide, from the guide's point (m); that of any point with a
    `direction` (rad, from the x axis) is its component in this direction, from the origin of the frame (m); that of a
    link is its angle (rad), where whole turns make no difference.
    Raises `ValueError` unless one element is given with at most one part, and with that or `going`; unless lengths are
    positive, and low is less than high.
    """

    point: str = eqx.field(static=True, default="", kw_only=True)
    link: str = eqx.field(static=True, default="", kw_only=True)
    going: str = eqx.field(static=True, default="", kw_only=True)
    first: Array | None = eqx.field(converter=as_float, default=None, kw_only=True)
    last: Array | None = eqx.field(converter=as_float, default=None, kw_only=True)
    between: tuple[Array, Array] | None = eqx.field(converter=_pair, default=None, kw_only=True)
    direction: Array | None = eqx.field(converter=as_float, default=None, kw_only=True)

    def __check_init__(self):
        if bool(self.point) == bool(self.link):
            problem = f"names {'both a point and a link' if self.point else 'neither a point nor a link'}"
            raise ValueError(f"a window that is no range of crank angle {problem}; name one point or one link")
        given = [part for part in PARTS if getattr(self, part) is not None]
        senses = SENSES["point" if self.point else "link"]
        if len(given) > 1:
            raise ValueError(
                f"the window of {self.of!r} has {' and '.join(given)}; write one of first, last and between"
            )
        if not given and not self.going:
            raise ValueError(
                f"the window of {self.of!r} says nothing about its way; write one of first, last and between, or "
                f'going = "{senses[0]}" or "{senses[1]}" alone for its whole way in one sense'
            )
        if self.going not in ("", *senses):
            which = f"the {'point' if self.point else 'link'} {self.of!r}"
            remedy = f'write "{senses[0]}" or "{senses[1]}", or omit it for both'
            raise ValueError(f"going is {self.going!r}, but the window is about {which}; {remedy}")
        if self.link and self.direction is not None:
            raise ValueError(f"direction is given for the link {self.link!r}; delete it, or name a point")
        for part in given:
            self._check_numbers(part)

    def _check_numbers(self, part: str) -> None:
        values = [known(value) for value in (self.between or (getattr(self, part),))]
        if any(value is None for value in values):
            return
        sizes: list[Any] = values
        if not all(np.all(np.isfinite(value)) for value in sizes):
            raise ValueError(f"{part} of the window of {self.of!r} is not finite; write a finite number")
        if part != "between":
            if np.any(sizes[0] <= 0):
                raise ValueError(f"{part} of the window of {self.of!r} must be greater than zero; write a length of "
                                 "the way, or omit `window` for a permanent load")  # fmt: skip
            return
        low, high = sizes
        if np.any(low >= high):
            also = ", or add 360 deg to the second to pass through zero" if self.link else ""
            raise ValueError(f"between of the window of {self.of!r} does not increase; write the lower value "
                             f"first{also}; `going` says in which sense it is passed")  # fmt: skip
        if self.link and np.any(high - low >= 2 * math.pi):
            raise ValueError(f"between of the window of {self.of!r} is a whole turn or more; omit `window` for a "
                             "permanent load")  # fmt: skip

    @property
    def of(self) -> str:
        """The point or link."""
        return self.point or self.link

    @property
    def unit(self) -> str:
        """Unit of its coordinate."""
        return "m" if self.point else "rad"

    @property
    def cuts(self) -> bool:
        """Whether a link may pass it once in every revolution."""
        return bool(self.link) and self.between is not None


class Watched(NamedTuple):
    """What a `Passage` or another coordinate needs of a pose, at one or many places."""

    window: Any
    guide: Guide | None
    points: dict[str, PointState]
    links: dict[str, LinkState]

    def seen(self) -> Seen:
        """The coordinate, with its first and second derivatives with respect to the crank angle."""
        window = self.window
        if window.link:
            link = self.links[window.link]
            return Seen(jnp.arctan2(link.u.y, link.u.x), link.w, link.e)
        at = self.points[window.point]
        if self.guide is not None:
            return self.guide.line(self.links, self.points).along(at)
        assert window.direction is not None  # see `guide_of`
        axis = unit(window.direction)
        return Seen(at.r.dot(axis), at.dr.dot(axis), at.ddr.dot(axis))

    def pace(self) -> Array:
        """The first kinematic coefficient to which that of the coordinate is compared: if it is only a rounding error
        of this, the coordinate does not change."""
        if self.window.link:
            return jnp.ones_like(self.links[self.window.link].w)
        v = self.points[self.window.point].dr
        return jnp.abs(v.x) + jnp.abs(v.y)


def watched(mechanism: Mechanism, window: Any, pose: Pose) -> Watched:
    """What a window, or another coordinate, needs of a pose of the mechanism."""
    if window.link:
        return Watched(window, None, {}, {window.link: pose.links[window.link]})
    guide = guide_of(mechanism, window)
    through, on = ((), ()) if guide is None else ((guide.through,), () if guide.on == "frame" else (guide.on,))
    points = {name: pose.points[name] for name in (window.point, *through)}
    return Watched(window, guide, points, {name: pose.links[name] for name in on})


def guide_of(mechanism: Mechanism, window: Any) -> Guide | None:
    """The guide along which the point of a window, or of another coordinate, is measured; None with a `direction`, and
    for a link."""
    return None if window.link or window.direction is not None else mechanism.guides_of(window.point)[0]
