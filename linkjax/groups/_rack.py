"""G: a rack moved by a gear, and a gear (pinion) turned by a rack.

Source: rolling of the pitch circle on the pitch line of the rack, e.g. Artobolevsky, Theory of Mechanisms and Machines,
1988, ch. 7.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import as_float, known
from linkjax.groups._base import AbstractGroup, Coupling, Wrench, check_side
from linkjax.groups._counted_turns import always, counted, nothing
from linkjax.groups._gear import AbstractWheel
from linkjax.groups._guide import Guide, Line, Slot, as_guide
from linkjax.groups._mesh import PRESSURE, check_pressure, push
from linkjax.groups._pairs import FRAME, Joint


def check_radius(kind: str, radius: Array) -> None:
    """Raise ValueError for an invalid pitch radius."""
    value = known(radius)
    if value is not None and not (value > 0).all():
        raise ValueError(f"radius of a {kind} must be above zero, but is {value} m")


class Rack(AbstractGroup):
    """A rack `link` that slides along a `guide`, moved by the gear `to` of pitch `radius` (m) about `centre`.

    The gear's centre is a point of the link (or frame) that carries the guide. It is to the left of the guide's
    direction for `side` +1, to the right for -1. The rack's own point `end`, the origin of its axes, is `start` (m)
    ahead of the foot of `through` on the path when the gear, relative to the carrier, is at zero. For a slider pulled
    by a belt or cable, the `pressure_angle` (rad, default 20 degrees) is zero. Raises `ValueError` for an invalid
    radius, side or pressure angle.
    """

    kind: ClassVar[str] = "rack"

    link: str = eqx.field(static=True)
    end: str = eqx.field(static=True)
    guide: Guide = eqx.field(converter=as_guide)
    to: str = eqx.field(static=True)
    centre: str = eqx.field(static=True)
    radius: Array = eqx.field(converter=as_float)
    side: int = eqx.field(static=True, default=1)
    start: Array = eqx.field(converter=as_float, default=0.0)
    pressure_angle: Array = eqx.field(converter=as_float, default=PRESSURE)

    def __check_init__(self):
        check_side(self.kind, self.side)
        check_radius(self.kind, self.radius)
        check_pressure(self.kind, self.pressure_angle)
        if self.to == self.guide.on:
            raise ValueError(f"rack {self.link!r} slides on {self.to!r}, its own gear; name the link that carries both")

    def mates(self) -> tuple[str, str]:
        """The links whose angles it follows."""
        return self.to, self.guide.on

    def link_names(self):
        return (self.link,)

    def lies_on(self):
        return ((self.guide.on, self.centre), (self.to, self.centre))

    def sliding(self):
        return (Slot(self.link, self.guide),)

    def pins(self):
        return {self.link: (self.end, None)}

    def wheels(self):
        return (self,)

    def faster(self) -> int:
        """One: a rack has no turns."""
        return 1

    def coupling(self) -> Coupling:
        """The quantity that the mesh keeps constant."""
        rolled = self.side * self.radius
        return Coupling({self.to: -rolled, self.guide.on: rolled}, {self.link: jnp.ones_like(rolled)}, self.start)

    def with_constant(self, value: float) -> Rack:
        """The same with another constant of its mesh."""
        return dataclasses.replace(self, start=value)

    def pitch_circles(self, apart: Callable[[str, str], float]) -> tuple[tuple[str, str, float], ...]:
        """Circles to draw, as (link, centre, radius in m), from the distance `apart` of two points (m)."""
        return ((self.to, self.centre, float(self.radius)),)

    def crossed(self) -> bool | None:
        """Whether the strands of its belt cross; None without a belt."""
        return None

    def solve(self, links, states, points, phi, path=None):
        there, on = (counted(name, k, states, path, phi) for k, name in enumerate(self.mates()))
        rolled = [self.side * self.radius * (a - b) for a, b in zip(there, on, strict=True)]
        line = self.guide.line(states, points)
        return {self.link: line.state}, {self.end: line.point(self.start + rolled[0], rolled[1], rolled[2])}

    def singular_positions(self):
        return ("turns",)

    def margins(self, links, states, points, phi, path=None):
        return {"turns": always(phi)}

    def followed(self, counted):
        return not set(self.mates()) <= counted

    def counts(self):
        return (self.link,)

    def returns(self, path):
        there, on = path.covered()
        return nothing(jnp.where(path.too_fast(), jnp.inf, jnp.abs(there - on)))

    def transmission(self, states, points):
        return None

    def joints(self):
        return (
            Joint(f"{self.link}.guide", self.end, self.link, self.guide.on, slides=True),
            Joint(f"{self.link}.mesh", self.end, self.link, self.to, meshes=True),
        )

    def exerted(self, pull: Array, states, points) -> Wrench:
        """Force on the rack and its moment about the rack's own point, for the force `pull` along the guide."""
        t = states[self.link].u
        n = t.perp() * float(self.side)
        force = t * pull - n * push(pull, self.pressure_angle)
        arm = points[self.centre].r - n * self.radius - points[self.end].r
        return Wrench(force, arm.cross(force))

    def react(self, loads, states, points):
        t, load = states[self.link].u, loads[self.link]
        mesh, across = self.exerted(-load.force.dot(t), states, points), t.perp()
        guide = Wrench(across * -(load.force + mesh.force).dot(across), -(load.moment + mesh.moment))
        return (guide, mesh), None


class Pinion(AbstractWheel):
    """A gear `link` of pitch `radius` (m) that turns about `pivot`, moved by the rack `to`.

    `pivot` is a point of the `carrier`, the frame or the link along which the rack slides. It is to the left of the
    rack's direction for `side` +1, to the right for -1. Relative to the carrier, the gear is at `phase` (rad) when the
    rack's point `at` is `start` (m) ahead of `through` along the rack. `through` is another point of the carrier, by
    default the pivot. The turns are counted as those of a `Gear`. `end` names a pin of the gear at its length, if it
    has one. `pressure_angle` (rad, default 20 degrees) is that of the teeth. Raises `ValueError` for an invalid radius,
    side or pressure angle.
    """

    kind: ClassVar[str] = "pinion"

    link: str = eqx.field(static=True)
    pivot: str = eqx.field(static=True)
    to: str = eqx.field(static=True)
    at: str = eqx.field(static=True)
    radius: Array = eqx.field(converter=as_float)
    side: int = eqx.field(static=True, default=1)
    end: str | None = eqx.field(static=True, default=None)
    phase: Array = eqx.field(converter=as_float, default=0.0)
    carrier: str = eqx.field(static=True, default=FRAME)
    pressure_angle: Array = eqx.field(converter=as_float, default=PRESSURE)
    through: str = eqx.field(static=True, default="")
    start: Array = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        check_side(self.kind, self.side)
        check_radius(self.kind, self.radius)
        check_pressure(self.kind, self.pressure_angle)

    def mates(self) -> tuple[str, ...]:
        """The links whose angles it follows."""
        return (self.carrier,)

    def lies_on(self):
        return (*((self.carrier, p) for p in (self.pivot, self.through) if p), (self.to, self.at))

    def slides_on(self):
        return ((self.to, self.carrier),)

    def pins(self):
        return {self.link: (self.pivot, self.end)}

    def joints(self):
        return self.in_gear(self.to)

    def coupling(self) -> Coupling:
        """The quantity that the mesh keeps constant."""
        one, per = jnp.ones_like(self.radius), self.side / self.radius
        return Coupling({self.link: one, self.carrier: -one}, {self.to: -per}, self.phase - per * self.start)

    def pitch_circles(self, apart: Callable[[str, str], float]) -> tuple[tuple[str, str, float], ...]:
        """Circles to draw, as (link, centre, radius in m), from the distance `apart` of two points (m)."""
        return ((self.link, self.pivot, float(self.radius)),)

    def solve(self, links, states, points, phi, path=None):
        rack, base = states[self.to], points[self.through or self.pivot]
        s, d, dd = Line(base, rack.u, jnp.zeros_like(phi), rack).along(points[self.at])
        s, d, dd = (self.side * x / self.radius for x in (s - self.start, d, dd))
        on, w, e = counted(self.carrier, 0, states, path, phi)
        return self.placed(self.end, links, points, on + self.phase + s, w + d, e + dd)

    def singular_positions(self):
        return ()

    def margins(self, links, states, points, phi, path=None):
        return {}

    def followed(self, counted):
        return not set(self.mates()) <= counted

    def counts(self):
        return (self.link,)

    def react(self, loads, states, points):
        t, load = states[self.to].u, loads[self.link]
        n, moment = t.perp() * float(self.side), -load.moment
        pull = self.side * moment / self.radius  # acts at the pitch point, one radius to the right of the pivot
        force = t * pull + n * push(pull, self.pressure_angle)
        return (Wrench(-(load.force + force), jnp.zeros_like(moment)), Wrench(force, moment)), None
