"""I1: the driving crank, turning about a point of the frame."""

from __future__ import annotations

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from linkjax._types import as_float
from linkjax._vec import Vec, unit, zero
from linkjax.groups._base import AbstractGroup, Joint, LinkState, PointState, Wrench


class Crank(AbstractGroup):
    """A crank `link` turning about `pivot`, with its far pin called `end`.

    `turns` is +1 for counter-clockwise and -1 for clockwise rotation; the crank angle φ always grows in time, and the
    link stands at `phase + turns φ` (`phase` in rad).
    """

    kind: ClassVar[str] = "crank"
    formula: ClassVar[str] = "I1"
    dead_positions: ClassVar[tuple[str, ...]] = ()

    link: str = eqx.field(static=True)
    pivot: str = eqx.field(static=True)
    end: str = eqx.field(static=True)
    turns: int = eqx.field(static=True, default=1)
    phase: jnp.ndarray = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        if self.turns not in (1, -1):
            raise ValueError(f"turns of a crank must be 1 (counter-clockwise) or -1, but is {self.turns!r}")

    def link_names(self):
        return (self.link,)

    def needs(self):
        return (self.pivot,)

    def on_frame(self):
        return (self.pivot,)

    def pins(self):
        return {self.link: (self.pivot, self.end)}

    def solve(self, links, points, phi):
        u = unit(self.phase + self.turns * phi)
        w = jnp.full_like(phi, self.turns)
        state = LinkState(u, w, jnp.zeros_like(phi))
        arm = u * links[self.link].length
        return {self.link: state}, {self.end: PointState(points[self.pivot].r + arm, arm.perp() * w, -arm)}

    def margins(self, links, points):
        return {}

    def transmission(self, states, points):
        return None

    def joints(self):
        return (Joint(self.pivot, self.pivot, self.link),)

    def react(self, loads, states, points):
        load = loads[self.link]
        return (Wrench(-load.force, jnp.zeros_like(load.moment)),), -self.turns * load.moment


def at_rest(r: Vec) -> PointState:
    """A point of the frame."""
    return PointState(r, zero(), zero())
