"""Loads given by a table: a force or torque over the crank angle, the position of a point, or the angle of a link."""

from __future__ import annotations

import math
from typing import Any, Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._interpolate import Method, interpolate
from linkjax._types import as_float
from linkjax._vec import Vec, unit, zero
from linkjax.groups import Seen
from linkjax.kinematics import Pose
from linkjax.loads._coordinate import Coordinate, seen_at, sense_of, unwrapped
from linkjax.loads._curve import (
    TURN,
    Heights,
    check_knots,
    check_method,
    heights,
    listed,
    over_crank,
    repeated,
)
from linkjax.loads._loads import AbstractLoad, Applied, Instant, Window
from linkjax.loads._passage import Passage, guide_of


class Table(AbstractLoad):
    """A force at a `point` of a `link` (N), or without a point a torque on it (N m, positive counter-clockwise), by a
    table of `values`.

    `at` are crank angles (rad, increasing); the table repeats after `cycle_turns` turns of the crank. A value there may
    be a pair, the values before and after a jump. With `over`, a `Coordinate`, `at` are values of it instead (m, of a
    link rad), beyond which the end values hold; `coming` are then the values on the way back, while the coordinate
    decreases, by default the same. The angle of a link is that within half a turn of the middle of the table.

    `method` is "linear", straight lines between the values, or "cubic", a monotone cubic (Fritsch and Carlson, 1980).
    The force acts in the `direction` (rad, from the x axis), or by default along the guide of the point, positive in
    its sense. It acts within its `window`, or permanently if that is None.

    Raises `ValueError` unless there are two or more values at as many increasing numbers `at`, within one period, and
    for keys that contradict each other; `TypeError` for anything but numbers.
    """

    name: str = eqx.field(static=True)
    link: str = eqx.field(static=True)
    point: str = eqx.field(static=True, default="")
    at: tuple[Array, ...] = eqx.field(converter=listed, kw_only=True)
    values: Heights = eqx.field(converter=heights, kw_only=True)
    coming: tuple[Array, ...] | None = eqx.field(converter=listed, default=None, kw_only=True)
    over: Coordinate | None = eqx.field(default=None, kw_only=True)
    direction: Array | None = eqx.field(converter=as_float, default=None, kw_only=True)
    method: Literal["linear", "cubic"] = eqx.field(static=True, default="linear", kw_only=True)
    cycle_turns: int = eqx.field(static=True, default=1, kw_only=True)
    window: Window | Passage | None = eqx.field(default=None, kw_only=True)
    reacts_on: Literal["frame"] | None = eqx.field(static=True, default=None, kw_only=True)

    @classmethod
    def row(cls, name: str, link: str, point: str = "", *, values: Any, cycle_turns: int = 1, **others: Any) -> Table:
        """A table of values at equally spaced crank angles, the first at crank angle zero: twelve values are 30 degrees
        apart. `others` are further fields."""
        row = heights(values)
        at = [TURN * cycle_turns * i / max(1, len(row)) for i in range(len(row))]
        return cls(name, link, point, at=at, values=row, cycle_turns=cycle_turns, **others)

    def __check_init__(self):
        what = f"load {self.name!r}"
        check_method(what, self.method)
        if not isinstance(self.cycle_turns, int) or self.cycle_turns < 1:
            raise ValueError(f"cycle_turns of {what} is {self.cycle_turns!r}; write an integer of 1 or more")
        if self.direction is not None and not self.point:
            raise ValueError(f"{what} has a direction, but no point: it is a torque; delete direction, or name a point")
        if self.over is None:
            if self.coming is not None:
                raise ValueError(f"{what} has values for the way back, but is a table over the crank angle; "
                                 "name the coordinate, over = Coordinate(...), or delete coming")  # fmt: skip
            check_knots(f"angles of {what}", self.at, self.values, "rad", self.period)
            return
        if self.cycle_turns != 1:
            raise ValueError(f"cycle_turns of {what} has no effect: the table is over a coordinate; delete it")
        if any(isinstance(value, tuple) for value in self.values):
            raise ValueError(f"{what} has a jump, but is a table over a coordinate; write several loads with windows")
        for key, values in (("values", self.values), ("values on the way back", self.coming)):
            if values is not None:
                width = TURN if self.over.link else None
                check_knots(f"{key} of {what}", self.at, values, self.over.unit, width)

    @property
    def period(self) -> float:
        """Crank angle (rad) after which a table over the crank angle repeats."""
        return 2 * math.pi * self.cycle_turns

    @property
    def unit(self) -> str:
        """Unit of its values."""
        return "N" if self.point else "N m"

    def kinks(self, cycle):
        return repeated(self.at, self.period, cycle) if self.over is None else ()

    def crossed(self):
        return self.over

    def levels(self, ends):
        return jnp.stack(list(self.at))

    def level_count(self):
        return 0 if self.over is None else len(self.at)

    def size(self, pose: Pose, at: Instant) -> Array:
        """The value of the table at an instant (N or N m)."""
        if self.over is None:
            return over_crank(self.at, self.values, self.method, self.period, at)
        return branched(self.over, seen_at(self.over, pose, at), self.at, (self.values, self.coming), self.method, at)

    def wrenches(self, pose, at):
        size = self.size(pose, at)
        if not self.point:
            return [Applied(self.link, None, zero(), size)]
        along = unit(self.direction) if self.direction is not None else along_guide(self.point, pose, at)
        return [Applied(self.link, self.point, along * size, jnp.zeros_like(at.phi))]


def branched(over: Coordinate, seen: Seen, knots: Any, branches: Any, method: Method, at: Instant) -> Array:
    """The value of a table over a coordinate, from its values while it increases, and while it decreases (None: the
    same)."""
    places = jnp.stack(list(knots))
    x = unwrapped(seen, 0.5 * (places[0] + places[-1]), at) if over.link else seen.value
    going, coming = branches
    there = interpolate(x, places, jnp.stack(list(going)), method)
    if coming is None:
        return there
    back = interpolate(x, places, jnp.stack(list(coming)), method)
    return jnp.where(sense_of(seen, at) > 0, there, back)


def along_guide(point: str, pose: Pose, at: Instant) -> Vec:
    """The direction of the guide of a point."""
    if at.mechanism is None:
        raise ValueError(f"the direction of the guide of {point!r} needs a mechanism; use ReadyScene.instant(phi)")
    guide = guide_of(at.mechanism, Coordinate(point=point))
    assert guide is not None  # the scene has checked it
    return guide.line(pose.links, pose.points).t
