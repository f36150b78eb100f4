"""I1, drivers: a crank that rotates or oscillates about a point of the frame, and a slider on a guide of the frame."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from linkjax._types import as_float
from linkjax._vec import unit, zero
from linkjax.groups._base import AbstractGroup, Wrench
from linkjax.groups._drive import Drive
from linkjax.groups._guide import Guide, Slot, as_guide
from linkjax.groups._law import SENSES, AbstractLaw, Rotation, check_law, check_rotation
from linkjax.groups._pairs import FRAME, Joint
from linkjax.groups._state import LinkState, PointState


class AbstractDriver(AbstractGroup):
    """The link that the drive moves."""

    def driving(self):
        return self.link_names()[0]

    def on_frame(self):
        return self.needs()

    def singular_positions(self):
        return ()

    def margins(self, links, states, points, phi):
        return {}

    def transmission(self, states, points):
        return None


class Crank(AbstractDriver):
    """A crank `link` that turns about `pivot`; its far pin is `end`.

    `rotation` is "ccw" (counter-clockwise) or "cw". The crank angle φ always increases in time. The angle of the link
    is `phase + φ` (rad), clockwise `phase - φ`, and `phase + law(φ)` with a motion `law`. Raises `ValueError` for
    another rotation, and for "cw" together with a law, which determines the sense itself.
    """

    kind: ClassVar[str] = "crank"

    link: str = eqx.field(static=True)
    pivot: str = eqx.field(static=True)
    end: str = eqx.field(static=True)
    rotation: Rotation = eqx.field(static=True, default="ccw")
    phase: jnp.ndarray = eqx.field(converter=as_float, default=0.0)
    law: AbstractLaw | None = None

    def __check_init__(self):
        check_law(self.law)
        check_rotation("crank", self.rotation, self.law)

    @property
    def sense(self) -> int:
        """+1 for a counter-clockwise and -1 for a clockwise crank."""
        return SENSES[self.rotation]

    def follows(self):
        return self.law

    def as_drive(self):
        return Drive(self.link, FRAME, self.rotation, self.phase, self.law)

    def shaft(self):
        return self.sense

    def turning(self, sense):
        rotation = next(name for name, value in SENSES.items() if value == sense)
        phase = self.phase if self.law is None else self.phase + self.law.begins()
        return dataclasses.replace(self, rotation=rotation, phase=phase, law=None)

    def counts(self):
        return (self.link,)

    def link_names(self):
        return (self.link,)

    def pins(self):
        return {self.link: (self.pivot, self.end)}

    def solve(self, links, states, points, phi):
        if self.law is None:
            angle, w, e = self.sense * phi, jnp.full_like(phi, self.sense), jnp.zeros_like(phi)
        else:
            angle, w, e = self.law.at(phi)
        angle = self.phase + angle
        u = unit(angle)
        arm = u * links[self.link].length
        there = -arm if self.law is None else arm.perp() * e - arm * (w * w)
        return {self.link: LinkState(u, w, e, angle)}, {
            self.end: PointState(points[self.pivot].r + arm, arm.perp() * w, there)
        }

    def joints(self):
        pivot = Joint(self.pivot, self.pivot, self.link)
        return (pivot,) if self.law is None else (pivot, Joint(f"{self.link}.drive", self.pivot, self.link))

    def react(self, loads, states, points):
        load = loads[self.link]
        pivot = Wrench(-load.force, jnp.zeros_like(load.moment))
        if self.law is None:
            return (pivot,), -self.sense * load.moment
        return (pivot, Wrench(zero(), -load.moment)), -load.moment * states[self.link].w


class LinearDriver(AbstractDriver):
    """A driving `link` that moves along a `guide` of the frame: the rod of a hydraulic cylinder, a rack.

    `guide` may be the name of a frame point; the guide then passes through this point, parallel to x.
    Its own point `end`, the origin of its axes, is `law(φ)` (m) ahead of the foot of `through` on the path. Raises
    `TypeError` for anything but a motion law.
    """

    kind: ClassVar[str] = "linear_driver"

    link: str = eqx.field(static=True)
    end: str = eqx.field(static=True)
    guide: Guide = eqx.field(converter=as_guide)
    law: AbstractLaw

    def __check_init__(self):
        check_law(self.law)
        if self.law is None:
            raise TypeError(f"the linear driver {self.link!r} needs a motion law; write a Harmonic, a Spline or Moves")

    def follows(self):
        return self.law

    def link_names(self):
        return (self.link,)

    def sliding(self):
        return (Slot(self.link, self.guide),)

    def pins(self):
        return {self.link: (self.end, None)}

    def solve(self, links, states, points, phi):
        line, (s, d, dd) = self.guide.line(states, points), self.law.at(phi)
        r = line.base.r + line.t * s + line.t.perp() * line.offset
        return {self.link: line.state}, {self.end: PointState(r, line.t * d, line.t * dd)}

    def joints(self):
        return (
            Joint(f"{self.link}.guide", self.end, self.link, "frame", slides=True),
            Joint(f"{self.link}.drive", self.end, self.link, "frame"),
        )

    def react(self, loads, states, points):
        t, load = states[self.link].u, loads[self.link]
        n, push = t.perp(), -load.force.dot(t)
        guide = Wrench(n * -load.force.dot(n), -load.moment)
        return (guide, Wrench(t * push, jnp.zeros_like(push))), push * points[self.end].dr.dot(t)
