"""The reference path of a general group: where Newton's method begins at any crank angle."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import nearest_turn, wrapped
from linkjax.groups._winding import Winding


def closed_to(dtype: Any) -> float:
    """What an assembly may leave open, of the size of the group: some thousand times the rounding."""
    return float(jnp.finfo(dtype).eps) ** 0.6


def slow(dtype: Any) -> float:
    """What it may leave open where steps are slow: at a change point."""
    return float(jnp.finfo(dtype).eps) ** 0.4


def met(dtype: Any) -> float:
    """A least singular value below this is none: it is the root of what rounding leaves open where assemblies meet."""
    return 2 * float(jnp.finfo(dtype).eps) ** 0.5


class Track(NamedTuple):
    """Configurations of a group at equal steps of the crank, the mean of their Jacobian's determinant, whose sign tells
    assemblies apart, and what they leave open, of the size of the group; how the links turn round that its wheels are
    in gear with; and the first of the four places that say where the group is in the lower and the upper half of every
    step (as floating numbers, as all leaves of a mechanism are; below zero, or beyond the last, they go on at the other
    end); the size of the group (m); by how many whole turns its gears are off; and the crank angles (rad) between which
    it could not be followed, the first behind the second where it was followed all the way."""

    z: Array
    sense: Array
    gap: Array
    wound: Winding | None = None
    first: Array | None = None
    size: Array | None = None
    whole: Array | None = None
    lost: Array | None = None

    def place(self, phi: Array, turns: int) -> tuple[Array, Array]:
        """Step of the path at a crank angle, and how far in it; the path goes over so many turns."""
        count, span = self.sense.size - 1, 2 * jnp.pi * turns
        place = wrapped(phi, span) * (count / span)
        whole = jnp.clip(jnp.floor(place), 0, count - 1)
        return whole.astype(int), place - whole

    def nearby(self, phi: Array, turns: int) -> tuple[Array, Array]:
        """Four places of the path near a crank angle, on one side of where the group does not close (below zero, or
        beyond the last, they go on at the other end), and how far the angle is from the first of them, in steps."""
        i, rest = self.place(phi, turns)
        assert self.first is not None
        span = 2 * jnp.pi * turns
        beyond = wrapped(phi, span) - self.middle()
        within = self.ends() & (jnp.abs(beyond) < span / (self.sense.size - 1))
        first = self.first[jnp.where(within, beyond > 0, rest > 0.5).astype(int), i].astype(int)
        return first + jnp.arange(4), rest + (i - first).astype(rest.dtype)

    def _round(self, four: Array) -> tuple[Array, Array]:
        """Places of the path, which begins again where it ends, and how often they have come round."""
        last = self.sense.size - 1
        rounds = (four > last).astype(int) - (four < 0).astype(int)
        return four - rounds * last, rounds

    def sense_at(self, phi: Array, turns: int) -> Array:
        """The sense of the Jacobian's determinant at a crank angle."""
        return jnp.sign(self.sense[self._round(self.nearby(phi, turns)[0])[0][1]])

    def at(self, phi: Array, turns: int) -> Array:
        """The configuration at a crank angle, roughly: a cubic through four places of the path."""
        four, x = self.nearby(phi, turns)
        four, ahead = self._round(four)
        a, b, c, d = self.z[four]
        left, right = -(x - 1) * (x - 2) * (x - 3) / 6, x * (x - 1) * (x - 2) / 6
        if self.z.shape[2] == 3:  # angles go on from turn to turn
            span = 2 * jnp.pi * turns
            rounds = jnp.round((phi - wrapped(phi, span)) / span) + ahead.astype(phi.dtype)
            more = jnp.outer(rounds, self.z[-1, :, 2] - self.z[0, :, 2])
            a, b, c, d = (part.at[:, 2].add(of) for part, of in zip((a, b, c, d), more, strict=True))
        return a * left + b * (x * (x - 2) * (x - 3) / 2) - c * (x * (x - 1) * (x - 3) / 2) + d * right

    def elsewhere(self, phi: Array, turns: int) -> Array:
        """Whether the group is where it was not followed to, or in another assembly than it began with."""
        assert self.lost is not None
        here = wrapped(phi, 2 * jnp.pi * turns)
        unknown = (here > self.lost[0]) & (here < self.lost[1])
        return unknown | (self.sense_at(phi, turns) * self.sense[0] < 0)

    def ends(self) -> Array:
        """Whether it cannot be followed all the way."""
        assert self.lost is not None
        return self.lost[0] < self.lost[1]

    def middle(self) -> Array:
        """Crank angle (rad) in the middle of where it was not followed."""
        assert self.lost is not None
        return 0.5 * (self.lost[0] + self.lost[1])

    def astray(self) -> Array:
        """Whether it does not come back to where it began."""
        moved, turned = jnp.split(self.z[-1] - self.z[0], [2], axis=1)
        assert self.size is not None
        turned = nearest_turn(turned, 2 * jnp.pi) if self.z.shape[2] == 3 else turned
        apart = jnp.maximum(jnp.max(jnp.abs(turned)), jnp.max(jnp.abs(moved)) / self.size)  # racks only slide on
        return apart > jnp.finfo(apart.dtype).eps ** 0.4

    def trouble(self) -> str:
        """What is wrong with it: "ends" where it cannot be followed all the way, "change point" where it goes on in
        another assembly, "astray" where it does not come back; "" for nothing."""
        if bool(self.ends()):
            return "ends"
        flips = bool(jnp.any(jnp.sign(self.sense) != jnp.sign(self.sense[0])))
        return "change point" if flips else "astray" if bool(self.astray()) else ""
