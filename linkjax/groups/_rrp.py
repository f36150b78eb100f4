"""II2 (RRP): a rod and a block on a straight guide of the frame or of a link, with offset and inclination."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from linkjax._numerics import once, safe_sqrt
from linkjax.groups._base import AbstractGroup, Margin, Wrench, check_side
from linkjax.groups._branch_path import IN_LINE, TOUCHING, check_branch
from linkjax.groups._guide import Guide, Slot, as_guide
from linkjax.groups._pairs import Joint
from linkjax.groups._state import LinkState, PointState


class RRP(AbstractGroup):
    """A rod `link` from point `from_` to the pin `end` of a sliding `block`.

    The `guide` is the path of the pin. It may be the name of a frame point; the path then passes through this point,
    parallel to x. `side` is +1 when the pin is ahead of the foot of the perpendicular from `from_` on the path, -1 when
    it is behind. The block's axes are along the path and to its left. With `branch` "continue", `side` applies just
    after crank angle zero; the motion continues smoothly through change points, where the side changes.
    """

    kind: ClassVar[str] = "RRP"

    link: str = eqx.field(static=True)
    block: str = eqx.field(static=True)
    from_: str = eqx.field(static=True)
    end: str = eqx.field(static=True)
    guide: Guide = eqx.field(converter=as_guide)
    side: int = eqx.field(static=True, default=1)
    branch: str = eqx.field(static=True, default="fixed")

    def __check_init__(self):
        check_side(self.kind, self.side)
        check_branch(self.kind, self.branch)

    def link_names(self):
        return (self.link, self.block)

    def sliding(self):
        return (Slot(self.block, self.guide),)

    def pins(self):
        return {self.link: (self.from_, self.end), self.block: (self.end, None)}

    def solve(self, links, states, points, phi, path=None):
        length = links[self.link].length
        line, b = self.guide.line(states, points), points[self.from_]
        t, n = line.t, line.t.perp()
        height, along = line.height(b), line.along(b)
        q = once(height.value)
        h = self._reach(length, q) * (self.side if path is None else self.side * path.flips(phi))
        over = h
        if path is not None:  # zero at a change point
            over = jnp.where(jnp.abs(h) < 1e-12 * length, 1e-12 * length, h)
        w = -height.d / over  # relative to the guide the pin does not move across it: height' + w h = 0
        e = -(height.dd + w * w * q) / over
        if path is not None:
            near = path.near(phi)
            turning = (q * near.d[0] - near.value[0] * height.d) / length**2
            bending = (q * near.dd[0] - near.value[0] * height.dd) / length**2
            h, w, e = near.instead((h, w, e), (near.value[0], turning, bending))
        rod = t * h - n * q
        carrier = line.state
        if line.turning is None:
            end = PointState(b.r + rod, t * (along.d + w * q), t * (along.dd + e * q - w * w * h))
        else:
            w, e = w + carrier.w, e + carrier.e
            end = PointState(b.r + rod, b.dr + rod.perp() * w, b.ddr + rod.perp() * e - rod * (w * w))
        return {self.link: LinkState(rod / length, w, e), self.block: carrier}, {self.end: end}

    def _reach(self, length, q):
        """Distance of the pin along the guide from the foot of `from_`; a placeholder where the margin is negative."""
        squared = (length - q) * (length + q)
        return once(jnp.where(squared > 0, safe_sqrt(squared, 1.0), 0.1 * length))

    def gaps(self, links, states, points):
        """Both distances to a singular position, their derivatives, and the tolerance of zero."""
        length = links[self.link].length
        height = jnp.stack(self.guide.line(states, points).height(points[self.from_])) / length
        whole = jnp.zeros_like(height).at[0].set(1.0)
        return (*jnp.stack([whole - height, whole + height]).T, jnp.full(2, TOUCHING))

    def coordinates(self, links, states, points, sense):
        """The coordinates that a polynomial interpolates through a change point."""
        q = self.guide.line(states, points).height(points[self.from_]).value
        h = self._reach(links[self.link].length, q) * self.side * sense
        return jnp.stack([h, jnp.zeros_like(h)])

    def singular_positions(self):
        return ("left", "right")

    def margins(self, links, states, points, phi, path=None):
        length = links[self.link].length
        q, dq, ddq = self.guide.line(states, points).height(points[self.from_])
        beyond = TOUCHING if self.branch == "continue" else 0.0  # motion passes through change points
        return {
            "left": Margin((length - q) / length + beyond, -dq / length, -ddq / length),
            "right": Margin((length + q) / length + beyond, dq / length, ddq / length),
        }

    def continues(self):
        return self.branch == "continue"

    def continued(self):
        return dataclasses.replace(self, branch="continue")

    def shortfall(self, side, links, states, points):
        off = abs(float(self.guide.line(states, points).height(points[self.from_]).value))
        rod = f"{self.link!r} ({float(links[self.link].length):.4g} m) does not reach that far"
        return f"its pin {self.from_!r} is {off:.4g} m off the path of {self.end!r}, and {rod}"

    def followed(self, counted):
        return self.continues()

    def returns(self, path):
        return path.comes_back()

    def transmission(self, states, points):
        u, t = points[self.end].r - points[self.from_].r, states[self.block].u
        return jnp.atan2(jnp.abs(u.dot(t)), t.cross(u))

    def joints(self):
        return (
            Joint(self.from_, self.from_, self.link),
            Joint(self.end, self.end, self.link, self.block),
            Joint(f"{self.block}.guide", self.end, self.block, self.guide.on, slides=True),
        )

    def react(self, loads, states, points):
        t = states[self.block].u
        n = t.perp()
        rod = points[self.end].r - points[self.from_].r
        on_rod, on_block = loads[self.link], loads[self.block]
        push = on_block.force.dot(t)
        reach = rod.dot(t)
        if self.branch == "continue":  # zero at a change point, where reactions are unbounded
            least = IN_LINE * safe_sqrt(rod.squared(), 1.0)
            reach = jnp.where(jnp.abs(reach) < least, least, reach)
        lift = -(on_rod.moment + push * rod.cross(t)) / reach
        pin = t * push + n * lift  # force on the rod by the block
        normal = lift - on_block.force.dot(n)
        none = jnp.zeros_like(normal)
        guide = Wrench(n * normal, -on_block.moment)
        return (Wrench(-(on_rod.force + pin), none), Wrench(pin, none), guide), None
