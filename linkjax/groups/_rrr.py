"""II1 (RRR): two links, three pins.

Source: any text on Assur groups, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 4 (closure) and
ch. 13 (reactions); the crossing height in product form is Heron's formula.
"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._vec import Vec
from linkjax.groups._base import AbstractGroup, Margin, Wrench, check_apart, check_side
from linkjax.groups._branch_path import IN_LINE, TOUCHING, check_branch
from linkjax.groups._pairs import Joint
from linkjax.groups._state import LinkState, PointState


class RRR(AbstractGroup):
    """Two links, the first from point `from_`, the second from point `to`, joined by the pin `meet`.

    `side` is +1 when `meet` lies to the left of the directed line from `from_` to `to`, -1 when to the right. With
    `branch` "continue", `side` applies just after crank angle zero; the motion continues smoothly through change
    points, where the side changes. Raises `ValueError` for another `side` or `branch`, unless there are two links, and
    where both ends are the same point.
    """

    kind: ClassVar[str] = "RRR"

    links: tuple[str, str] = eqx.field(static=True)
    from_: str = eqx.field(static=True)
    to: str = eqx.field(static=True)
    meet: str = eqx.field(static=True)
    side: int = eqx.field(static=True, default=1)
    branch: str = eqx.field(static=True, default="fixed")

    def __check_init__(self):
        check_side(self.kind, self.side)
        check_branch(self.kind, self.branch)
        check_apart(self.kind, self.from_, self.to)
        if isinstance(self.links, str) or len(self.links) != 2:
            raise ValueError(f"an RRR needs two links, but has {self.links!r}")

    def link_names(self):
        return self.links

    def pins(self):
        return {self.links[0]: (self.from_, self.meet), self.links[1]: (self.to, self.meet)}

    def solve(self, links, states, points, phi, path=None):
        l1, l2 = links[self.links[0]].length, links[self.links[1]].length
        a, b = points[self.from_], points[self.to]
        side = self.side if path is None else self.side * path.flips(phi)
        p, q, h, r = self._crossing(links, points, side)
        det = side * h * r
        if path is not None:  # zero at a change point
            least = 1e-12 * l1 * l2
            det = jnp.where(jnp.abs(det) < least, least, det)
        dv = a.dr - b.dr
        w1, w2 = -dv.dot(q) / det, -dv.dot(p) / det
        da = a.ddr - b.ddr - p * (w1 * w1) + q * (w2 * w2)
        e1, e2 = -da.dot(q) / det, -da.dot(p) / det
        if path is not None:
            near, span = path.near(phi), b.r - a.r
            arm, first, second = (Vec(*part) for part in (near.value, near.d, near.dd))
            other = arm - span, first + dv, second - (b.ddr - a.ddr)
            turning = arm.cross(first) / l1**2, other[0].cross(other[1]) / l2**2
            bending = arm.cross(second) / l1**2, other[0].cross(other[2]) / l2**2
            smooth = (arm, other[0], *turning, *bending)
            p, q, w1, w2, e1, e2 = near.instead((p, q, w1, w2, e1, e2), smooth)
        first, second = LinkState(p / l1, w1, e1), LinkState(q / l2, w2, e2)
        meet = PointState(a.r + p, a.dr + p.perp() * w1, a.ddr + p.perp() * e1 - p * (w1 * w1))
        return {self.links[0]: first, self.links[1]: second}, {self.meet: meet}

    def _crossing(self, links, points, side):
        """The links as vectors from the outer pins to the inner pin, its distance from the line of the outer pins, and
        the distance between these."""
        l1, l2 = links[self.links[0]].length, links[self.links[1]].length
        span = points[self.to].r - points[self.from_].r
        r = safe_sqrt(span.squared(), 1.0)
        along = span / r
        # h = distance of the inner pin from the line a-b, by Heron's product, accurate near a singular position
        squared = (l1 + l2 - r) * (l1 + l2 + r) * (r - l1 + l2) * (r + l1 - l2)
        h = safe_sqrt(squared, jnp.asarray(1.0)) / (2 * r)
        h = jnp.where(squared > 0, h, 0.1 * (l1 + l2))  # a finite placeholder where the margin is negative
        foot = 0.5 * (r + (l1 - l2) * (l1 + l2) / r)
        up = along.perp() * (side * h)
        return along * foot + up, along * (foot - r) + up, h, r

    def gaps(self, links, states, points):
        """Both distances to a singular position as smooth functions, their derivatives, and the tolerance of zero."""
        l1, l2 = links[self.links[0]].length, links[self.links[1]].length
        a, b = points[self.from_], points[self.to]
        s, ds, dds = b.r - a.r, b.dr - a.dr, b.ddr - a.ddr
        total, apart = l1 + l2, jnp.abs(l1 - l2)
        d, dd = 2 * s.dot(ds), 2 * (s.dot(dds) + ds.squared())
        found = jnp.stack([jnp.stack([total**2 - s.squared(), -d, -dd]), jnp.stack([s.squared() - apart**2, d, dd])])
        zero = 2 * TOUCHING * jnp.stack([jnp.ones_like(total), apart / total + TOUCHING])
        return (*(found / total**2).T, zero)

    def coordinates(self, links, states, points, sense):
        """The coordinates that a polynomial interpolates through a change point."""
        p = self._crossing(links, points, self.side * sense)[0]
        return jnp.stack([p.x, p.y])

    def singular_positions(self):
        return ("stretched", "folded")

    def margins(self, links, states, points, phi, path=None):
        l1, l2 = links[self.links[0]].length, links[self.links[1]].length
        a, b = points[self.from_], points[self.to]
        s, ds, dds = b.r - a.r, b.dr - a.dr, b.ddr - a.ddr
        r = safe_sqrt(s.squared())
        dr = safe_divide(s.dot(ds), r)
        ddr = safe_divide(s.dot(dds) + ds.squared() - dr * dr, r)
        total, beyond = l1 + l2, TOUCHING if self.branch == "continue" else 0.0  # motion passes through change points
        return {
            "stretched": Margin((total - r) / total + beyond, -dr / total, -ddr / total),
            "folded": Margin((r - jnp.abs(l1 - l2)) / total + beyond, dr / total, ddr / total),
        }

    def continues(self):
        return self.branch == "continue"

    def continued(self):
        return dataclasses.replace(self, branch="continue")

    def shortfall(self, side, links, states, points):
        away = float(safe_sqrt((points[self.to].r - points[self.from_].r).squared()))
        one, two = (f"{link!r} ({float(links[link].length):.4g} m)" for link in self.links)
        pins = f"its pins {self.from_!r} and {self.to!r} are {away:.4g} m apart"
        far = side == "stretched"
        return f"{pins}, and {one} and {two} {'do not reach that far' if far else 'differ in length by more'}"

    def followed(self, counted):
        return self.continues()

    def returns(self, path):
        return path.comes_back()

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
        if self.branch == "continue":  # zero at a change point, where reactions are unbounded
            least = IN_LINE * safe_sqrt(p.squared() * q.squared(), 1.0)
            det = jnp.where(jnp.abs(det) < least, least, det)
        m1, m2 = loads[one].moment, loads[two].moment
        inner = -(p * m2 + q * m1) / det  # force at the inner pin on link one by link two
        none = jnp.zeros_like(det)
        forces = -(loads[one].force + inner), -(loads[two].force - inner), inner
        return tuple(Wrench(force, none) for force in forces), None
