"""II3 (RPR): a block that slides along a lever: the slotted lever of a shaper, an oscillating cylinder.

Source: any text on Assur groups, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 4 (closure) and
ch. 13 (reactions).
"""

from __future__ import annotations

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from linkjax._numerics import once, safe_divide, safe_sqrt
from linkjax._types import as_float
from linkjax._vec import Vec
from linkjax.groups._base import AbstractGroup, Margin, Wrench, check_apart, check_side
from linkjax.groups._guide import Guide, Slot
from linkjax.groups._pairs import Joint
from linkjax.groups._state import LinkState, PointState


class RPR(AbstractGroup):
    """A lever `link` pinned at the point `about`, and a `block` pinned at the point `from_` that slides along it.

    The pin of the block moves on a line of the lever, parallel to its axis and shifted to its left by `offset` (m).
    `side` is +1 when the pin is ahead of the lever's pivot, -1 when it is behind. `end` is the lever's far pin, on its
    axis. The margin is relative to the length of the lever. The block has the lever's axes.
    """

    kind: ClassVar[str] = "RPR"

    link: str = eqx.field(static=True)
    block: str = eqx.field(static=True)
    from_: str = eqx.field(static=True)
    about: str = eqx.field(static=True)
    end: str = eqx.field(static=True)
    side: int = eqx.field(static=True, default=1)
    offset: jnp.ndarray = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        check_side(self.kind, self.side)
        check_apart(self.kind, self.about, self.from_)

    def link_names(self):
        return (self.link, self.block)

    def pins(self):
        return {self.link: (self.about, self.end), self.block: (self.from_, None)}

    def sliding(self):
        return (Slot(self.block, Guide(self.about, 0.0, self.offset, self.link)),)

    def _span(self, points):
        """From the lever's pivot to the block's pin; of length one where they coincide (no positive margin)."""
        d = points[self.from_].r - points[self.about].r
        return Vec(jnp.where(d.squared() > 0, d.x, 1.0), d.y)

    def solve(self, links, states, points, phi):
        length = links[self.link].length
        a, b = points[self.about], points[self.from_]
        d, v, c = self._span(points), b.dr - a.dr, b.ddr - a.ddr
        squared = d.squared()
        ahead = squared - self.offset * self.offset
        s = once(jnp.where(ahead > 0, safe_sqrt(ahead, 1.0), 0.1 * length)) * self.side  # or a placeholder (negative
        # margin), with which the direction is finite, but not of length one
        whole = jnp.where(ahead > 0, squared, s * s + self.offset**2)
        u = (d * s - d.perp() * self.offset) / whole
        n = u.perp()
        w = v.dot(n) / s  # b - a = s u + h n, its rate s' u + s w n - h w u
        slide = v.dot(u) + self.offset * w
        e = (c.dot(n) - 2 * slide * w + self.offset * w * w) / s
        state, arm = LinkState(u, w, e), u * length
        end = PointState(a.r + arm, a.dr + arm.perp() * w, a.ddr + arm.perp() * e - arm * (w * w))
        return {self.link: state, self.block: state}, {self.end: end}

    def singular_positions(self):
        return ("pivot",)

    def margins(self, links, states, points, phi):
        length = links[self.link].length
        a, b = points[self.about], points[self.from_]
        d, v, c = b.r - a.r, b.dr - a.dr, b.ddr - a.ddr
        r = safe_sqrt(d.squared())
        dr = safe_divide(d.dot(v), r)
        ddr = safe_divide(d.dot(c) + v.squared() - dr * dr, r)
        off = safe_sqrt(self.offset * self.offset)  # with derivative zero at zero
        return {"pivot": Margin((r - off) / length, dr / length, ddr / length)}

    def shortfall(self, side, links, states, points):
        away = float(safe_sqrt((points[self.from_].r - points[self.about].r).squared()))
        offset = f"less than its offset of {abs(float(self.offset)):.4g} m"
        return f"its pins {self.about!r} and {self.from_!r} are {away:.4g} m apart, {offset}"

    def transmission(self, states, points):
        d = self._span(points)
        return jnp.atan2(jnp.abs(d.dot(states[self.link].u)), self.offset)

    def joints(self):
        return (
            Joint(self.about, self.about, self.link),
            Joint(self.from_, self.from_, self.block),
            Joint(f"{self.block}.guide", self.from_, self.block, self.link, slides=True),
        )

    def react(self, loads, states, points):
        u = states[self.link].u
        on_lever, on_block = loads[self.link], loads[self.block]
        s = self._span(points).dot(u)
        normal = u.perp() * ((on_lever.moment + on_block.moment) / s)
        none = jnp.zeros_like(s)
        pivot, pin = normal - on_lever.force, -(on_block.force + normal)
        return (Wrench(pivot, none), Wrench(pin, none), Wrench(normal, -on_block.moment)), None
