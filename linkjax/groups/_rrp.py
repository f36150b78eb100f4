"""II2 (RRP): a rod and a block that slides on a straight guide of the frame, offset and inclined as one likes."""

from __future__ import annotations

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from linkjax._numerics import once, safe_sqrt
from linkjax._types import as_float
from linkjax._vec import unit
from linkjax.groups._base import AbstractGroup, Joint, LinkState, Margin, PointState, Wrench, check_side


class RRP(AbstractGroup):
    """A rod `link` from point `from_` to the pin `end` of a sliding `block`.

    The path of the pin is the line through the frame point `through`, at `along` (rad) to the x axis, shifted to its
    left by `offset` (m). `side` is +1 when the pin lies ahead of the foot of the perpendicular, -1 when behind.
    """

    kind: ClassVar[str] = "RRP"
    formula: ClassVar[str] = "II2"
    dead_positions: ClassVar[tuple[str, ...]] = ("left", "right")

    link: str = eqx.field(static=True)
    block: str = eqx.field(static=True)
    from_: str = eqx.field(static=True)
    end: str = eqx.field(static=True)
    through: str = eqx.field(static=True)
    side: int = eqx.field(static=True, default=1)
    along: jnp.ndarray = eqx.field(converter=as_float, default=0.0)
    offset: jnp.ndarray = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        check_side(self.kind, self.side)

    def link_names(self):
        return (self.link, self.block)

    def needs(self):
        return (self.from_, self.through)

    def pins(self):
        return {self.link: (self.from_, self.end), self.block: (self.end, None)}

    def on_frame(self):
        return (self.through,)

    def translating(self):
        return (self.block,)

    def _height(self, points):
        """Distance of the rod's first pin from the path, along the path's left normal, and its derivatives."""
        n = unit(self.along).perp()
        b = points[self.from_]
        return (b.r - points[self.through].r).dot(n) - self.offset, b.dr.dot(n), b.ddr.dot(n)

    def solve(self, links, points, phi):
        length = links[self.link].length
        t = unit(self.along)
        n = t.perp()
        b = points[self.from_]
        q = once(self._height(points)[0])
        squared = (length - q) * (length + q)
        h = once(jnp.where(squared > 0, safe_sqrt(squared, 1.0), 0.1 * length)) * self.side  # or a flagged placeholder
        rod = t * h - n * q
        w = -b.dr.dot(n) / h  # the pin's velocity has no part normal to the guide: b' . n + w (rod . t) = 0
        e = -(b.ddr.dot(n) + w * w * q) / h
        slide = b.dr.dot(t) + w * q
        slide2 = b.ddr.dot(t) + e * q - w * w * h
        end = PointState(b.r + rod, t * slide, t * slide2)
        still = jnp.zeros_like(w)
        return {self.link: LinkState(rod / length, w, e), self.block: LinkState(t, still, still)}, {self.end: end}

    def margins(self, links, points):
        length = links[self.link].length
        q, dq, ddq = self._height(points)
        return {
            "left": Margin((length - q) / length, -dq / length, -ddq / length),
            "right": Margin((length + q) / length, dq / length, ddq / length),
        }

    def transmission(self, states, points):
        u, t = states[self.link].u, unit(self.along)
        return jnp.atan2(jnp.abs(u.dot(t)), t.cross(u))

    def joints(self):
        return (
            Joint(self.from_, self.from_, self.link),
            Joint(self.end, self.end, self.link, self.block),
            Joint(f"{self.block}.guide", self.end, self.block, "frame"),
        )

    def react(self, loads, states, points):
        t = unit(self.along)
        n = t.perp()
        rod = points[self.end].r - points[self.from_].r
        on_rod, on_block = loads[self.link], loads[self.block]
        push = on_block.force.dot(t)
        lift = -(on_rod.moment + push * rod.cross(t)) / rod.dot(t)
        pin = t * push + n * lift  # force on the rod by the block
        normal = lift - on_block.force.dot(n)
        none = jnp.zeros_like(normal)
        guide = Wrench(n * normal, -on_block.moment)
        return (Wrench(-(on_rod.force + pin), none), Wrench(pin, none), guide), None
