"""G: a gear in mesh with an existing link, by teeth or by a belt.

Source: Willis' formula for gears on a moving carrier, e.g. Artobolevsky, Theory of Mechanisms and Machines, 1988,
ch. 7.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import as_float
from linkjax._vec import Vec, unit
from linkjax.groups._base import AbstractGroup, Coupling, Wrench
from linkjax.groups._counted_turns import always, counted, nothing
from linkjax.groups._mesh import Belt, Mesh, Teeth
from linkjax.groups._pairs import FRAME, Joint
from linkjax.groups._state import LinkState, carried


class AbstractWheel(AbstractGroup):
    """A gear `link` that turns about `pivot`."""

    link: eqx.AbstractVar[str]
    pivot: eqx.AbstractVar[str]

    def link_names(self):
        return (self.link,)

    def wheels(self):
        return (self,)

    def faster(self) -> int:
        """How many times as fast as the slower gear of its mesh the faster one turns, rounded up."""
        return 1

    def transmission(self, states, points):
        return None

    def crossed(self) -> bool | None:
        """Whether the strands of its belt cross; None without a belt."""
        return None

    def in_gear(self, to: str) -> tuple[Joint, Joint]:
        """Its joints, for a mesh with this link."""
        mesh = Joint(f"{self.link}.mesh", self.pivot, self.link, to, meshes=True)
        return Joint(self.pivot, self.pivot, self.link), mesh

    def placed(self, end: str | None, links, points, angle, w, e):
        """State of the gear at an angle (rad), and of its pin `end`, if it has one."""
        state = LinkState(unit(angle), w, e, angle)
        if end is None:
            return {self.link: state}, {}
        length = links[self.link].length
        return {self.link: state}, {end: carried(points[self.pivot], state, Vec(length, jnp.zeros_like(length)))}


class Gear(AbstractWheel):
    """A gear `link` that turns about `pivot`, in mesh with the link `to` (or "frame") that turns about `centre`.

    Both points belong to the `carrier`, the frame or an existing link. Relative to it, the gear is at `phase` (rad)
    when `to` is at zero, and turns in the ratio of the `mesh`. If `to` is neither a crank nor a gear, its angle at
    crank angle zero is taken within half a turn of zero. `end` names a pin of the gear at its length, if it has one.
    Raises `ValueError` for an invalid mesh, and for a gear in mesh with its own carrier.
    """

    kind: ClassVar[str] = "gear"

    link: str = eqx.field(static=True)
    pivot: str = eqx.field(static=True)
    mesh: Mesh
    to: str = eqx.field(static=True)
    centre: str = eqx.field(static=True)
    end: str | None = eqx.field(static=True, default=None)
    phase: Array = eqx.field(converter=as_float, default=0.0)
    carrier: str = eqx.field(static=True, default=FRAME)

    def __check_init__(self):
        if not isinstance(self.mesh, Teeth | Belt):
            raise ValueError(f"the mesh of gear {self.link!r} is {self.mesh!r}; write Teeth((40, 20)) or a Belt")
        if self.link in (self.to, self.carrier):
            raise ValueError(f"gear {self.link!r} is in mesh with itself, or is its own carrier; name another link")
        if self.to == self.carrier or self.pivot == self.centre:
            both = f"{self.to!r} about {self.centre!r}"
            raise ValueError(f"gear {self.link!r} is in mesh with {both}, its carrier or axis; name another carrier")

    def mates(self) -> tuple[str, str]:
        """The links whose angles it follows."""
        return self.to, self.carrier

    def lies_on(self):
        return ((self.carrier, self.pivot), (self.carrier, self.centre), (self.to, self.centre))

    def pins(self):
        return {self.link: (self.pivot, self.end)}

    def joints(self):
        return self.in_gear(self.to)

    def faster(self):
        return self.mesh.faster()

    def coupling(self) -> Coupling:
        """The quantity that the mesh keeps constant."""
        ratio = self.mesh.ratio()
        return Coupling({self.link: jnp.ones_like(ratio), self.to: -ratio, self.carrier: ratio - 1}, {}, self.phase)

    def with_constant(self, value: float) -> Gear:
        """The same with another constant of its mesh."""
        return dataclasses.replace(self, phase=value)

    def pitch_circles(self, apart: Callable[[str, str], float]) -> tuple[tuple[str, str, float], ...]:
        """Circles to draw, as (link, centre, radius in m), from the distance `apart` of two points (m)."""
        own, other = self.mesh.radii(apart(self.pivot, self.centre))
        return (self.link, self.pivot, own), (self.to, self.centre, other)

    def crossed(self):
        return self.mesh.crossed if isinstance(self.mesh, Belt) else None

    def solve(self, links, states, points, phi, path=None):
        there, on = (counted(name, k, states, path, phi) for k, name in enumerate(self.mates()))
        ratio = self.mesh.ratio()
        angle, w, e = (b + ratio * (a - b) for a, b in zip(there, on, strict=True))
        return self.placed(self.end, links, points, angle + self.phase, w, e)

    def singular_positions(self):
        return ("turns", "apart")

    def margins(self, links, states, points, phi, path=None):
        apart = self.mesh.apart(points[self.centre].r - points[self.pivot].r)
        return {"turns": always(phi), "apart": apart}

    def lost(self, at):
        return at.apart() if at.side == "apart" else super().lost(at)

    def followed(self, counted):
        return isinstance(self.mesh, Belt) or not set(self.mates()) <= counted

    def counts(self):
        return (self.link,)

    def returns(self, path):
        there, on = path.covered()
        return nothing(path.missed(on + self.mesh.ratio() * (there - on)))

    def react(self, loads, states, points):
        load = loads[self.link]
        mesh = self.mesh.exerted(points[self.centre].r - points[self.pivot].r, -load.moment)
        return (Wrench(-(load.force + mesh.force), jnp.zeros_like(load.moment)), mesh), None
