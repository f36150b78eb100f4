"""Motion of a chain of rolling bodies: held member, driven member and speed; check that the chain closes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._display import Numbers
from linkjax._results import MachineError, Result
from linkjax._types import Scalar, as_float
from linkjax._vec import Vec
from linkjax.mechanism import StructureError
from linkjax.rolling._chain import Chain, chain, closure_gap, moved
from linkjax.rolling._closing import Margins, closing_eccentricity, closing_outer_radius, fitting_bodies, margins
from linkjax.rolling._design import Rolling
from linkjax.rolling._rates import Rates, rates
from linkjax.rolling._text import rolling_text

MEMBERS = ("inner", "outer", "carrier")
CLOSED = 1e-5  # rad: largest gap between last and first body of a closed chain


class RollingMachine(eqx.Module):
    """A design with a held member and a driven member, which rotates at `speed` (rad/s, counter-clockwise positive).

    Members are the rings, "inner" and "outer", and the line of centres, "carrier". The centre of a held ring is fixed;
    both centres are fixed if the line of centres is held or the rings are concentric. Raises `StructureError` unless
    held and driven are two different members.
    """

    design: Rolling
    held: str = eqx.field(static=True, default="outer")
    driven: str = eqx.field(static=True, default="inner")
    speed: Array = eqx.field(converter=as_float, default=1.0)
    title: str = eqx.field(static=True, default="")

    def __check_init__(self):
        for key in ("held", "driven"):
            if getattr(self, key) not in MEMBERS:
                raise StructureError(key, f"is {getattr(self, key)!r}", f"write one of {', '.join(MEMBERS)}")
        if self.held == self.driven:
            raise StructureError("driven", f"{self.held!r} is both held and driven", "choose two different members")

    def __str__(self) -> str:
        return rolling_text(self)

    @property
    def cycle(self) -> Scalar:
        """Angle (rad) of the driven member for one turn of the line of centres; one turn if that is held."""
        ratio = self.turned(1.0).carrier
        return 2 * math.pi / jnp.where(self.held == "carrier", 1.0, ratio)

    def turned(self, angle: Any) -> Rates:
        """Angles of all members when the driven member has turned by `angle` (rad); for a speed, all speeds."""
        given = {self.held: jnp.zeros_like(as_float(angle)), self.driven: as_float(angle)}
        return rates(self.design, **given)

    def speeds(self) -> Rates:
        """Speeds of all members (rad/s)."""
        return self.turned(self.speed)

    def rest(self) -> Vec:
        """Fixed point of the line of centres (m): the centre of the outer ring if it is held, otherwise the origin."""
        e = self.design.eccentricity
        return Vec(e if self.held == "outer" else jnp.zeros_like(e), jnp.zeros_like(e))

    def at(self, angle: Any) -> Chain:
        """The chain in the frame (m) when the driven member has turned by `angle` (rad)."""
        return moved(chain(self.design), self.turned(angle).carrier, self.rest())


def check(design: Rolling) -> None:
    """Raise `MachineError`, with problem and remedy, unless rings and bodies form a closed chain.

    Radii must be positive, the outer radius larger than inner radius plus eccentricity, and the gap or overlap between
    the last and the first body at most 1e-5 rad.
    """
    wrong = problem(design)
    if wrong:
        raise MachineError(wrong, Result.CANNOT_BE_ASSEMBLED)


class Closing(NamedTuple):
    """Quantities to check the closure of a chain."""

    margins: Margins
    gap: Scalar
    outer_radius: Scalar
    eccentricity: Scalar
    bodies: Scalar


@compiled_soon
def closing(design: Rolling) -> Closing:
    """Margins, gap, and the outer radius, eccentricity and (real) number of bodies that would close the chain."""
    inner, outer, e, bodies, turns = (
        design.inner_radius, design.outer_radius, design.eccentricity, design.bodies, design.turns
    )  # fmt: skip
    wider = closing_outer_radius(inner, bodies, e, turns)
    other = closing_eccentricity(inner, outer, bodies, turns)
    return Closing(margins(design), closure_gap(design), wider, other, fitting_bodies(design))


def problem(design: Rolling) -> str:
    """Error message of `check`; empty if the chain closes."""
    found = closing(design)
    return _rings(design, found) or _closing(design, found)


def _rings(design: Rolling, found: Closing) -> str:
    """Error message for invalid rings; empty if the rings are valid."""
    inner, outer, e = (float(x) for x in (design.inner_radius, design.outer_radius, design.eccentricity))
    if not (np.isfinite([inner, outer, e]).all() and inner > 0 and outer > 0):
        return f"inner radius {inner:g} m, outer radius {outer:g} m, eccentricity {e:g} m: radii must be positive"
    if float(found.margins.rings) > 0:
        return ""
    show = Numbers()
    return (
        f"The rings touch or intersect: the outer radius {show.shown(outer, 'm')} is not larger than inner radius plus "
        f"eccentricity, {show.shown(inner + abs(e), 'm')}. Use a smaller eccentricity or a larger outer radius "
        f"({show.quantity(float(found.outer_radius), 'm', 9)} closes the chain)."
    )


def _closing(design: Rolling, found: Closing) -> str:
    """Error message for a chain that does not close, with remedies; empty if it closes."""
    gap, show = float(found.gap), Numbers()
    if abs(gap) <= CLOSED:
        return ""
    ways = [f"an outer radius of {show.quantity(float(found.outer_radius), 'm', 9)}"]
    if float(found.margins.closing) >= 0:
        ways.append(f"an eccentricity of {show.quantity(float(found.eccentricity), 'm', 9)}")
    what = "leaves a gap of" if gap > 0 else "overlaps itself by"
    return (
        f"The chain does not close: it {what} {show.turned(abs(gap))}; these rings fit {float(found.bodies):.4f} "
        f"bodies in {design.turns} turn{'s' if design.turns > 1 else ''}, not {design.bodies}. "
        f"It closes with {' or '.join(ways)}."
    )
