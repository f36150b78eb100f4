"""II5 (RPP): a block pinned to a point slides in the slot of a slider, which slides on a guide: a Scotch yoke.

Source: any text on Assur groups, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 4 (closure) and
ch. 13 (reactions).
"""

from __future__ import annotations

import math
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from linkjax._numerics import safe_sqrt
from linkjax._types import as_float, known
from linkjax._vec import unit
from linkjax.groups._base import AbstractGroup, Margin, Wrench
from linkjax.groups._guide import Guide, Line, Slot, as_guide, crossing
from linkjax.groups._pairs import Joint


class RPP(AbstractGroup):
    """A slider `link` on a `guide`, and a `block` pinned at the point `from_` that slides in the slider's slot.

    `guide` may be the name of a frame point; the guide then passes through this point, parallel to x. `end` is the
    slider's own point on the path of the guide, and its origin; its axis is along the path. The slot is at the angle
    `slot` (rad) to this axis, shifted from `end` to the slot's left by `offset` (m). The block has the slot's axes.
    """

    kind: ClassVar[str] = "RPP"

    link: str = eqx.field(static=True)
    block: str = eqx.field(static=True)
    from_: str = eqx.field(static=True)
    end: str = eqx.field(static=True)
    guide: Guide = eqx.field(converter=as_guide)
    slot: jnp.ndarray = eqx.field(converter=as_float, default=math.pi / 2)
    offset: jnp.ndarray = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        slot = known(self.slot)
        if slot is not None and np.any(np.abs(np.sin(slot)) < 1e-9):
            raise ValueError(f"the slot of an RPP must not be parallel to its guide, but its angle to it is {slot} rad")

    def link_names(self):
        return (self.link, self.block)

    def sliding(self):
        return Slot(self.link, self.guide), Slot(self.block, Guide(self.end, self.slot, self.offset, self.link))

    def pins(self):
        return {self.link: (self.end, None), self.block: (self.from_, None)}

    def solve(self, links, states, points, phi):
        path = self.guide.line(states, points)
        slot = Line(points[self.from_], unit(self.slot).turned(path.t), -self.offset, path.state)
        return {self.link: path.state, self.block: slot.state}, {self.end: crossing(path, slot)}

    def singular_positions(self):
        return ("parallel",)

    def margins(self, links, states, points, phi):
        sine = unit(self.slot).y
        none = jnp.zeros_like(points[self.from_].r.x)
        return {"parallel": Margin(safe_sqrt(sine * sine) + none, none, none)}

    def lost(self, at):
        return at.parallel() if at.side == "parallel" else super().lost(at)

    def transmission(self, states, points):
        u, v = states[self.link].u, states[self.block].u
        return jnp.atan2(jnp.abs(u.cross(v)), u.dot(v))

    def joints(self):
        return (
            Joint(self.from_, self.from_, self.block),
            Joint(f"{self.block}.guide", self.from_, self.block, self.link, slides=True),
            Joint(f"{self.link}.guide", self.end, self.link, self.guide.on, slides=True),
        )

    def react(self, loads, states, points):
        t, s = states[self.link].u, states[self.block].u
        on_slide, on_block = loads[self.link], loads[self.block]
        push = s.perp() * (-on_slide.force.dot(t) / t.cross(s))  # force on the block by the slot
        lift = t.perp() * (push - on_slide.force).dot(t.perp())
        arm = points[self.from_].r - points[self.end].r
        couple = arm.cross(push) - on_slide.moment - on_block.moment
        none = jnp.zeros_like(couple)
        return (Wrench(-(on_block.force + push), none), Wrench(push, -on_block.moment), Wrench(lift, couple)), None
