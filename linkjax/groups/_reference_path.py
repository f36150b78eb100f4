"""The reference path of a group of higher class: start values of Newton's method at any crank angle.

Near a fold a group moves as the square root of the distance, which a polynomial through points one degree apart cannot
follow: near the ends of 13 % of random triads five steps did not close, some with errors within the tolerance of 4e-10.
So the path stores its ends; with them Newton's method starts a hundred times nearer.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import nearest_turn, wrapped
from linkjax._tree import node
from linkjax.groups._counted_turns import CountedTurns


def closed_to(dtype: Any) -> float:
    """Largest closure error, relative to the size of the group, that counts as closed: well above rounding."""
    return float(jnp.finfo(dtype).eps) ** 0.6


def slow(dtype: Any) -> float:
    """The same where Newton's method converges slowly: at a change point."""
    return float(jnp.finfo(dtype).eps) ** 0.4


def met(dtype: Any) -> float:
    """A smaller least singular value counts as zero: the square root of rounding, where assembly modes coincide."""
    return 2 * float(jnp.finfo(dtype).eps) ** 0.5


class Meshing(NamedTuple):
    """What the gears of a group need of its path: counted turns of the links that they follow, one row each, and the
    offset of their meshes in whole turns, shape (gears,)."""

    turns: CountedTurns
    whole: Array


@node
class ReferencePath:
    """Configurations `z` of a group at equal steps of the crank over `cycle_turns` turns, the mean `sense` of their
    Jacobian's determinant (its sign distinguishes assembly modes), and their closure errors `gap`, relative to the
    `size` of the group (m).

    `first` is, for the lower and the upper half of every step, the first of the four points of the path for
    interpolation (as floating-point numbers, like all leaves; below zero, or beyond the last, they continue at the
    other end). Between the crank angles `lost` (rad) the group could not be followed; the first exceeds the second if
    it was followed over the whole cycle. `tips` are the last configurations that were followed up and down from zero,
    `tips_at` their crank angles.
    """

    z: Array
    sense: Array
    gap: Array
    size: Array
    meshing: Meshing
    first: Array
    lost: Array
    tips: Array
    tips_at: Array
    cycle_turns: int = eqx.field(static=True)

    @property
    def span(self) -> float:
        """Crank angle (rad) that the path covers."""
        return 2 * np.pi * self.cycle_turns

    def place(self, phi: Array) -> tuple[Array, Array]:
        """Step of the path at a crank angle, and the fraction of it."""
        count = self.sense.size - 1
        place = wrapped(phi, self.span) * (count / self.span)
        whole = jnp.clip(jnp.floor(place), 0, count - 1)
        return whole.astype(int), place - whole

    def nearby(self, phi: Array) -> tuple[Array, Array]:
        """Four points of the path near a crank angle, on one side of where the group does not close (below zero, or
        beyond the last, they continue at the other end), and the distance of the angle from the first, in steps."""
        i, rest = self.place(phi)
        beyond = wrapped(phi, self.span) - self.middle()
        within = self.ends() & (jnp.abs(beyond) < self.span / (self.sense.size - 1))
        first = self.first[jnp.where(within, beyond > 0, rest > 0.5).astype(int), i].astype(int)
        return first + jnp.arange(4), rest + (i - first).astype(rest.dtype)

    def _round(self, four: Array) -> tuple[Array, Array]:
        """Points wrapped to the path, which repeats after its end, and the number of repetitions."""
        last = self.sense.size - 1
        rounds = (four > last).astype(int) - (four < 0).astype(int)
        return four - rounds * last, rounds

    def sense_at(self, phi: Array) -> Array:
        """The sign of the Jacobian's determinant at a crank angle."""
        return jnp.sign(self.sense[self._round(self.nearby(phi)[0])[0][1]])

    def at(self, phi: Array) -> Array:
        """The approximate configuration at a crank angle: a cubic through four points of the path, or through those of
        them that were reached and a nearby end of the path."""
        four, x = self.nearby(phi)
        rows, ahead = self._round(four)
        place = four.astype(phi.dtype)
        z, down = jnp.concatenate([self.z[rows], self.tips]), self._before_zero(place)
        if self.z.shape[2] == 3:  # angles increase from turn to turn
            ahead = jnp.concatenate([ahead, jnp.asarray([0, -1]) + down.astype(int)]).astype(phi.dtype)
            rounds = jnp.round((phi - wrapped(phi, self.span)) / self.span) + ahead
            z = z.at[:, :, 2].add(jnp.outer(rounds, self.z[-1, :, 2] - self.z[0, :, 2]))
        return jnp.tensordot(self._weights(place, rows, x), z, 1)

    def _before_zero(self, place: Array) -> Array:
        """Whether these four points of the path were reached downwards from zero."""
        return self.ends() & ((place[0] + 1.5) * (self.span / (self.sense.size - 1)) > self.middle())

    def _weights(self, place: Array, rows: Array, x: Array) -> Array:
        """Weights of four points of the path, and of its ends, at a point `x` steps from the first of them.

        Near the ends, interpolation uses an angle that varies as the square root of the distance, as the motion does
        where two assembly modes coincide.
        """
        step = self.span / (self.sense.size - 1)
        at = place * step - jnp.where(self._before_zero(place), self.span, 0.0)
        sound = self.gap[rows] < closed_to(self.gap.dtype)
        eases = self.ends() & jnp.any(sound)  # else the angle is amid the range that was not followed
        apart = jnp.abs(self.tips_at[:, None] - at[None]) * (1 / step)
        beside = (
            eases
            & jnp.any(sound[None] & (apart < 1), axis=1)
            & jnp.all(apart > jnp.finfo(apart.dtype).eps ** 0.5, axis=1)
        )
        there = jnp.concatenate([sound | ~eases, beside])
        low, high = self.lost[1] - self.span, self.lost[0]
        at = jnp.concatenate([at, self.tips_at, (at[0] + x * step)[None]])
        eased = jnp.arccos(jnp.clip((low + high - 2 * at) / (high - low), -1.0, 1.0))
        return _lagrange(jnp.where(eases, eased, at), there)

    def elsewhere(self, phi: Array) -> Array:
        """Whether the group could not be followed to here, or is in another assembly mode than at first.

        A position that the path does not reach cannot be assembled, even if the closure has a root there. The sign of
        the determinant is not sufficient: several of the six assembly modes of a triad share it, and Newton's method
        finds one of them beyond nearly every range.
        """
        here = wrapped(phi, self.span)
        unknown = (here > self.lost[0]) & (here < self.lost[1])
        return unknown | (self.sense_at(phi) * self.sense[0] < 0)

    def ends(self) -> Array:
        """Whether the group cannot be followed over the whole cycle."""
        return self.lost[0] < self.lost[1]

    def middle(self) -> Array:
        """Crank angle (rad) in the middle of the range that was not followed."""
        return 0.5 * (self.lost[0] + self.lost[1])

    def astray(self, but: np.ndarray | None = None) -> Array:
        """Whether the group does not return to its initial position; the links in `but` are ignored."""
        kept = self.z if but is None else self.z[:, ~but]
        moved, turned = jnp.split(kept[-1] - kept[0], [2], axis=1)
        turned = nearest_turn(turned, 2 * jnp.pi) if self.z.shape[2] == 3 else turned
        apart = jnp.maximum(
            jnp.max(jnp.abs(turned), initial=0.0), jnp.max(jnp.abs(moved), initial=0.0) / self.size
        )  # racks only slide
        return apart > jnp.finfo(apart.dtype).eps ** 0.4

    def trouble(self) -> str:
        """The problem: "ends" if the group cannot be followed over the whole cycle, "change point" if it passes into
        another assembly mode, "astray" if it does not return; "" for none."""
        if bool(self.ends()):
            return "ends"
        flips = bool(jnp.any(jnp.sign(self.sense) != jnp.sign(self.sense[0])))
        return "change point" if flips else "astray" if bool(self.astray()) else ""


def _lagrange(nodes: Array, there: Array) -> Array:
    """Weights of all nodes but the last, at the last node, for a polynomial through the nodes that are `there`."""
    nodes, x = nodes[:-1], nodes[-1]
    apart = nodes[:, None] - nodes[None]
    pairs = there[None] & (apart != 0)
    parts = jnp.where(pairs, (x - nodes)[None] / jnp.where(pairs, apart, 1.0), 1.0)
    return jnp.where(there, jnp.prod(parts, axis=1), 0.0)
