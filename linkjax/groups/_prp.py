"""II4 (PRP): two blocks pinned to each other, each in its own slot: the intersection of two slots.

Source: any text on Assur groups, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 4 (closure) and
ch. 13 (reactions).
"""

from __future__ import annotations

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from linkjax.groups._base import AbstractGroup, Margin, Wrench, check_side
from linkjax.groups._guide import Guide, Slot, as_guide, crossing
from linkjax.groups._pairs import Joint


def _guides(slots: tuple[Guide | str, Guide | str]) -> tuple[Guide, Guide]:
    if len(slots) != 2:
        raise ValueError(f"a PRP needs two slots, but {len(slots)} are given")
    one, two = slots
    return as_guide(one), as_guide(two)


class PRP(AbstractGroup):
    """Two `blocks` pinned to each other at `meet`, each in one of two `slots`, at least one of which moves.

    `side` is +1 when the direction of the second slot points to the left of that of the first, -1 when to its right.
    The group cannot be assembled where the slots are parallel. Each block has the axes of its slot.
    """

    kind: ClassVar[str] = "PRP"

    blocks: tuple[str, str] = eqx.field(static=True)
    meet: str = eqx.field(static=True)
    slots: tuple[Guide, Guide] = eqx.field(converter=_guides)
    side: int = eqx.field(static=True, default=1)

    def __check_init__(self):
        check_side(self.kind, self.side)
        if isinstance(self.blocks, str) or len(self.blocks) != 2:
            raise ValueError(f"a PRP needs two blocks, but has {self.blocks!r}")
        if self.slots[0].on == self.slots[1].on:
            raise ValueError(f"the two slots of a PRP must be on two links, but both are on {self.slots[0].on!r}")

    def link_names(self):
        return self.blocks

    def sliding(self):
        return tuple(Slot(block, guide) for block, guide in zip(self.blocks, self.slots, strict=True))

    def pins(self):
        return dict.fromkeys(self.blocks, (self.meet, None))

    def _lines(self, states, points):
        one, two = self.slots
        return one.line(states, points), two.line(states, points)

    def solve(self, links, states, points, phi):
        one, two = self._lines(states, points)
        a, b = self.blocks
        return {a: one.state, b: two.state}, {self.meet: crossing(one, two)}

    def singular_positions(self):
        return ("parallel",)

    def margins(self, links, states, points, phi):
        one, two = (line.state for line in self._lines(states, points))
        sine, cosine, turn = one.u.cross(two.u), one.u.dot(two.u), two.w - one.w
        d, dd = cosine * turn, cosine * (two.e - one.e) - sine * turn * turn
        return {"parallel": Margin(self.side * sine, self.side * d, self.side * dd)}

    def lost(self, at):
        return at.parallel() if at.side == "parallel" else super().lost(at)

    def transmission(self, states, points):
        u, v = (states[block].u for block in self.blocks)
        return jnp.atan2(jnp.abs(u.cross(v)), u.dot(v))

    def joints(self):
        one, two = (
            Joint(f"{block}.guide", self.meet, block, slot.on, slides=True)
            for block, slot in zip(self.blocks, self.slots, strict=True)
        )
        return one, two, Joint(self.meet, self.meet, *self.blocks)

    def react(self, loads, states, points):
        one, two = self.blocks
        s, t = states[one].u, states[two].u
        whole, sine = loads[one].force + loads[two].force, s.cross(t)
        first = s.perp() * (-whole.dot(t) / sine)  # by balance of both blocks along t
        second = t.perp() * (whole.dot(s) / sine)
        pin = -(loads[one].force + first)
        guides = (Wrench(force, -loads[name].moment) for force, name in ((first, one), (second, two)))
        return (*guides, Wrench(pin, jnp.zeros_like(sine))), None
