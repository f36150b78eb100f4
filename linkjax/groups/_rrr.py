"""II1 (RRR): two links, three pins.

Source: any text on Assur groups, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 4 (closure) and
ch. 13 (reactions); the crossing height in product form is Heron's formula.
"""

from __future__ import annotations

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax.groups._base import AbstractGroup, Joint, Margin, Wrench, check_apart, check_side
from linkjax.groups._state import LinkState, PointState


class RRR(AbstractGroup):
    """Two links, the first from point `from_`, the second from point `to`, meeting in a pin `meet`.

    `side` is +1 when `meet` lies to the left of the directed line from `from_` to `to`, -1 when to the right.
    """

    kind: ClassVar[str] = "RRR"
    dead_positions: ClassVar[tuple[str, ...]] = ("stretched", "folded")

    links: tuple[str, str] = eqx.field(static=True)
    from_: str = eqx.field(static=True)
    to: str = eqx.field(static=True)
    meet: str = eqx.field(static=True)
    side: int = eqx.field(static=True, default=1)

    def __check_init__(self):
        check_side(self.kind, self.side)
        check_apart(self.kind, self.from_, self.to)

    def link_names(self):
        return self.links

    def needs(self):
        return (self.from_, self.to)

    def pins(self):
        return {self.links[0]: (self.from_, self.meet), self.links[1]: (self.to, self.meet)}

    def solve(self, links, states, points, phi):
        l1, l2 = links[self.links[0]].length, links[self.links[1]].length
        a, b = points[self.from_], points[self.to]
        span = b.r - a.r
        r = safe_sqrt(span.squared(), 1.0)
        along = span / r
        # h = height of the crossing over the line a-b, from Heron's product: no digits lost near a dead position
        squared = (l1 + l2 - r) * (l1 + l2 + r) * (r - l1 + l2) * (r + l1 - l2)
        h = safe_sqrt(squared, jnp.asarray(1.0)) / (2 * r)
        h = jnp.where(squared > 0, h, 0.1 * (l1 + l2))  # cannot close: a finite placeholder, flagged by the margin
        foot = 0.5 * (r + (l1 - l2) * (l1 + l2) / r)
        up = along.perp() * (self.side * h)
        p, q = along * foot + up, along * (foot - r) + up
        det = self.side * h * r
        dv = a.dr - b.dr
        w1, w2 = -dv.dot(q) / det, -dv.dot(p) / det
        da = a.ddr - b.ddr - p * (w1 * w1) + q * (w2 * w2)
        e1, e2 = -da.dot(q) / det, -da.dot(p) / det
        first, second = LinkState(p / l1, w1, e1), LinkState(q / l2, w2, e2)
        meet = PointState(a.r + p, a.dr + p.perp() * w1, a.ddr + p.perp() * e1 - p * (w1 * w1))
        return {self.links[0]: first, self.links[1]: second}, {self.meet: meet}

    def margins(self, links, states, points, phi):
        l1, l2 = links[self.links[0]].length, links[self.links[1]].length
        a, b = points[self.from_], points[self.to]
        s, ds, dds = b.r - a.r, b.dr - a.dr, b.ddr - a.ddr
        r = safe_sqrt(s.squared())
        dr = safe_divide(s.dot(ds), r)
        ddr = safe_divide(s.dot(dds) + ds.squared() - dr * dr, r)
        total = l1 + l2
        return {
            "stretched": Margin((total - r) / total, -dr / total, -ddr / total),
            "folded": Margin((r - jnp.abs(l1 - l2)) / total, dr / total, ddr / total),
        }

    def transmission(self, states, points):
        u, v = points[self.meet].r - points[self.from_].r, points[self.meet].r - points[self.to].r
        return jnp.atan2(jnp.abs(u.cross(v)), u.dot(v))

    def joints(self):
        one, two = self.links
        return Joint(self.from_, self.from_, one), Joint(self.to, self.to, two), Joint(self.meet, self.meet, one, two)

    def react(self, loads, states, points):
        one, two = self.links
        p, q = points[self.meet].r - points[self.from_].r, points[self.meet].r - points[self.to].r
        det = p.cross(q)
        m1, m2 = loads[one].moment, loads[two].moment
        inner = -(p * m2 + q * m1) / det  # force at the inner pin on link one by link two
        none = jnp.zeros_like(det)
        forces = -(loads[one].force + inner), -(loads[two].force - inner), inner
        return tuple(Wrench(force, none) for force in forces), None
