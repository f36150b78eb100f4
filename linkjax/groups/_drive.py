"""The drive: which link it moves relative to which other one, and how."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import as_float
from linkjax._vec import Vec
from linkjax.groups._guide import Slot
from linkjax.groups._law import SENSES, AbstractLaw, Rotation, check_law, check_rotation
from linkjax.groups._pairs import FRAME
from linkjax.groups._state import LinkState


class Drive(eqx.Module):
    """The drive moves `link` relative to `on` ("frame" or another link).

    For two links pinned to each other, the drive is rotary: the angle of `link` relative to `on` is `phase + φ` (rad),
    `phase - φ` with the `rotation` "cw" (clockwise), or `phase + law(φ)`. For the block of a slot, the drive is linear:
    the block is `law(φ)` (m) along its guide; a motion law is required. Without a `phase` or a law, the sketch of a
    `linkage` gives the position of the link at crank angle zero. This also holds for a `Harmonic` law without a start.
    Without a sketch the phase is zero. Raises `ValueError` for another rotation, and for "cw" together with a law.
    """

    link: str = eqx.field(static=True)
    on: str = eqx.field(static=True, default="frame")
    rotation: Rotation = eqx.field(static=True, default="ccw")
    phase: Array | None = eqx.field(converter=as_float, default=None)
    law: AbstractLaw | None = None

    def __check_init__(self):
        check_law(self.law, drawn=True)
        check_rotation("drive", self.rotation, self.law)

    @property
    def sense(self) -> int:
        """+1 for a counter-clockwise and -1 for a clockwise drive."""
        return SENSES[self.rotation]

    def at(self, phi: Array, slides: bool) -> tuple[Array, Array, Array]:
        """Coordinate of the drive at a crank angle, with its first and second derivatives."""
        phase = jnp.zeros_like(phi) if self.phase is None else self.phase
        if self.law is not None:
            s, d, dd = self.law.at(phi)
            return (s if slides else s + phase), d, dd
        return phase + self.sense * phi, jnp.full_like(phi, self.sense), jnp.zeros_like(phi)

    def begins(self, slides: bool) -> float:
        """Coordinate of the drive at crank angle zero (rad or m)."""
        return float(self.at(jnp.zeros(()), slides)[0])

    def angle(self, states: Mapping[str, LinkState]) -> Array:
        """Angle of a rotary drive (rad), from the states of its links."""
        u = states[self.link].u
        on = Vec(1.0, 0.0) if self.on == FRAME else states[self.on].u
        return jnp.atan2(on.cross(u), on.dot(u))


def driven_slot(drive: Drive, slots: Sequence[Slot]) -> int | None:
    """Number of the slot that a drive moves; None for a rotary drive."""
    ends = (drive.link, drive.on)
    return next((i for i, slot in enumerate(slots) if (slot.block, slot.guide.on) == ends), None)


def check_drive(drive: Drive, names: Sequence[str], slots: Sequence[Slot]) -> None:
    """Raise `ValueError` for a drive that is impossible in a group of these links."""
    if drive.link not in names or drive.on not in (*names, FRAME):
        problem = f"the drive moves {drive.link!r} relative to {drive.on!r}; name links of the group, or the frame"
        raise ValueError(f"the group of {', '.join(names)}: {problem}")
    check_law(drive.law)
    if driven_slot(drive, slots) is not None and drive.law is None:
        raise ValueError(f"the drive moves {drive.link!r} along a guide, which requires a motion law; set `law`")
