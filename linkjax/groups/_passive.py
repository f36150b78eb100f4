"""Redundant links (passive constraints): they only repeat constraints, and can move because their dimensions fit.

Examples are a third parallel crank and a second guide beside the first. The forces that they share with other links are
statically indeterminate: they depend on the fit of the redundant links. Here redundant links carry none of them.
Source: passive constraints, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 2.
"""

from __future__ import annotations

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from linkjax._numerics import largest, safe_divide, safe_sqrt
from linkjax._vec import zero
from linkjax.groups._base import AbstractGroup, Margin, Wrench, check_apart
from linkjax.groups._guide import Guide, Slot, as_guide
from linkjax.groups._lost import Lost
from linkjax.groups._pairs import Joint
from linkjax.groups._state import LinkState

FITS = 1e-6  # largest misfit of a redundant link, relative to its length or to the longest link


def fit(off, size) -> Margin:
    """The margin of a misfit `off`: one for an exact fit, zero for the largest misfit."""
    value, d, dd = (safe_divide(part, FITS * size) for part in off)
    sign = jnp.sign(value)
    return Margin(1 - jnp.abs(value), -sign * d, -sign * dd)


def misfit(at: Lost, what: str, of: str) -> str:
    """The problem of a redundant link that does not fit."""
    return f"does not fit: at {at.degrees:.2f} degrees {what} {(1 - at.value) * FITS:.3g} of {of}"


class RedundantLink(AbstractGroup):
    """A `link` between the existing points `from_` and `to`, whose distance is always its length.

    Its pin at `to` only transmits a force across its axis, so the link carries only its own weight, inertia and loads.
    Where the distance changes, its margin `fits` is negative.
    """

    kind: ClassVar[str] = "redundant_link"

    link: str = eqx.field(static=True)
    from_: str = eqx.field(static=True)
    to: str = eqx.field(static=True)

    def __check_init__(self):
        check_apart(self.kind, self.from_, self.to)

    def link_names(self):
        return (self.link,)

    def passive(self):
        return True

    def pins(self):
        return {self.link: (self.from_, self.to)}

    def shared(self):
        return {self.from_: "", self.to: ""}

    def _span(self, points):
        """Vector from the first pin to the second, with its derivatives."""
        a, b = points[self.from_], points[self.to]
        return b.r - a.r, b.dr - a.dr, b.ddr - a.ddr

    def solve(self, links, states, points, phi):
        s, ds, dds = self._span(points)
        square = jnp.where(s.squared() > 0, s.squared(), 1.0)
        w = s.cross(ds) / square
        e = s.cross(dds) / square - 2 * s.dot(ds) * w / square
        return {self.link: LinkState(s / safe_sqrt(square, 1.0), w, e)}, {}

    def singular_positions(self):
        return ("fits",)

    def margins(self, links, states, points, phi):
        s, ds, dds = self._span(points)
        length, r = links[self.link].length, safe_sqrt(s.squared())
        d = safe_divide(s.dot(ds), r)
        return {"fits": fit((r - length, d, safe_divide(s.dot(dds) + ds.squared() - d * d, r)), length)}

    def lost(self, at):
        return misfit(at, "its error is", "its length"), ""

    def transmission(self, states, points):
        return None

    def joints(self):
        return Joint(self.from_, self.from_, self.link), Joint(self.to, self.to, self.link)

    def react(self, loads, states, points):
        s, load = self._span(points)[0], loads[self.link]
        none = jnp.zeros_like(load.moment)
        across = s.perp() * safe_divide(-load.moment, s.squared())
        return (Wrench(-(load.force + across), none), Wrench(across, none)), None


class RedundantSlider(AbstractGroup):
    """A `block` pinned to the existing point `from_`, which always stays on the `guide`.

    The guide only transmits a couple, so the block carries only its own weight, inertia and loads. Where the point
    leaves the guide, its margin `fits` is negative. A `Mechanism` raises `StructureError` unless both exist.
    """

    kind: ClassVar[str] = "redundant_slider"

    block: str = eqx.field(static=True)
    from_: str = eqx.field(static=True)
    guide: Guide = eqx.field(converter=as_guide)

    def link_names(self):
        return (self.block,)

    def passive(self):
        return True

    def sliding(self):
        return (Slot(self.block, self.guide),)

    def pins(self):
        return {self.block: (self.from_, None)}

    def shared(self):
        return {self.from_: ""}

    def solve(self, links, states, points, phi):
        return {self.block: self.guide.line(states, points).state}, {}

    def singular_positions(self):
        return ("fits",)

    def margins(self, links, states, points, phi):
        size = largest(jnp.stack([link.length for link in links.values()]))
        return {"fits": fit(self.guide.line(states, points).height(points[self.from_]), size)}

    def lost(self, at):
        return misfit(at, "the distance of its pin from the guide is", "the longest link"), ""

    def transmission(self, states, points):
        return None

    def joints(self):
        return (
            Joint(self.from_, self.from_, self.block),
            Joint(f"{self.block}.guide", self.from_, self.block, self.guide.on, slides=True),
        )

    def react(self, loads, states, points):
        load = loads[self.block]
        return (Wrench(-load.force, jnp.zeros_like(load.moment)), Wrench(zero(), -load.moment)), None
