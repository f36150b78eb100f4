"""The motion of a dyad through its change points, where its two assembly modes coincide and it passes into the other.

At a change point the kinematic coefficients are 0/0, and near it rounding errors grow as the inverse of the distance;
the motion itself is smooth. Near a change point the position of the inner pin is therefore taken from a polynomial
through positions further away.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import nearest_turn, wrapped
from linkjax._search import BRANCH_SCAN, scan_angles, scan_minima, to_minimum
from linkjax._tree import node

BRANCHES = ("fixed", "continue")
TOUCHING = 1e-9  # a margin within this of zero is a change point
SLOTS = 6  # largest number of change points per turn
REACH = 0.3  # rad to either side: range of the polynomial's nodes
INSIDE = 0.1  # rad to either side: range where it is used
DEGREE = 15
NODES = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))  # Chebyshev nodes, none of them zero
IN_LINE = 1e-8  # lower bound on the sine of the angle between the links in reactions
BLUNTEST = 1e-4  # second derivative of a gap, relative to its maximum, below which motion turns back
CLOSEST = 1e-6  # rad from a change point within which derivatives with respect to design variables are zero


def _powers() -> np.ndarray:
    """The matrix from values at the nodes to coefficients of the powers of x in (-1, 1)."""
    series = np.polynomial.chebyshev.chebvander(NODES, DEGREE).T * (2 / (DEGREE + 1))
    series[0] /= 2
    rows = [np.pad(p, (0, DEGREE + 1 - p.size)) for p in map(np.polynomial.chebyshev.cheb2poly, np.eye(DEGREE + 1))]
    return np.stack(rows).T @ series


@node
class BranchPath:
    """A dyad's path: crank angles of the change points in `cycle_turns` turns (infinite for unused slots), whether
    motion passes through them or turns back, and the polynomials of the two coordinates of the inner pin near each, in
    powers of the angle from it over `REACH`."""

    at: Array  # (slots,)
    passed: Array  # (slots,), one or zero
    series: Array  # (slots, 2, DEGREE + 1)
    cycle_turns: int = eqx.field(static=True)

    def flips(self, phi: Array) -> Array:
        """+1 where the dyad is on the same side as just after crank angle zero, -1 on the other side."""
        place = wrapped(phi, 2 * jnp.pi * self.cycle_turns)
        return 1.0 - 2.0 * (jnp.sum(jnp.where((self.at > 0.0) & (self.at <= place), self.passed, 0.0)) % 2)

    def comes_back(self) -> Array:
        """Whether the dyad returns to its initial position after `cycle_turns`."""
        return jnp.sum(self.passed) % 2 == 0

    def trouble(self) -> str:
        """The problem: "astray" if the dyad does not return; "" for none."""
        return "" if bool(self.comes_back()) else "astray"

    def touches(self) -> Array:
        """Whether there is any change point."""
        return jnp.any(jnp.isfinite(self.at))

    def near(self, phi: Array) -> Near:
        """The coordinates of the inner pin from the nearest polynomial."""
        found = jnp.isfinite(self.at)
        away = nearest_turn(phi - jnp.where(found, self.at, 0.0), 2 * jnp.pi * self.cycle_turns)
        away = jnp.where(found, away, jnp.inf)
        k = jnp.argmin(jnp.abs(away))
        distance = jnp.abs(away[k])
        inside = distance < INSIDE
        x = jnp.where(inside, away[k], 0.0) / REACH
        value = d = dd = jnp.zeros_like(self.series[k][:, 0])
        for c in self.series[k].T[::-1]:
            value, d, dd = c + x * value, value + x * d, 2 * d + x * dd
        return Near(inside, distance < CLOSEST, value, d / REACH, dd / REACH**2)


class Near(NamedTuple):
    """Whether the polynomial applies (`inside`), and without design derivatives (`closest`); the two coordinates of the
    inner pin with their derivatives with respect to the crank angle."""

    inside: Array
    closest: Array
    value: Array  # (2,)
    d: Array
    dd: Array

    def instead(self, direct: Any, smooth: Any) -> Any:
        """The smooth value where the polynomial applies, with the design derivatives of the direct value."""

        def chosen(a, b):
            slope = jnp.where(self.closest, jax.lax.stop_gradient(a), a)
            return jnp.where(self.inside, jax.lax.stop_gradient(b) + (slope - jax.lax.stop_gradient(slope)), a)

        return jax.tree.map(chosen, direct, smooth)


def check_branch(kind: str, branch: str) -> None:
    """Raise ValueError for an unknown branch."""
    if branch not in BRANCHES:
        raise ValueError(f'branch of an {kind} must be "fixed" or "continue", but is {branch!r}')


def branch_path(gaps: Any, crossing: Any, cycle_turns: int) -> BranchPath:
    """The path of a dyad through its change points in `cycle_turns` turns: where one of the gaps touches zero.

    `gaps` gives for each gap its value, first and second derivative and tolerance of zero at a crank angle. `crossing`
    gives the two coordinates of the inner pin at a crank angle, for a side that is +1 just after crank angle zero.
    """
    whole = 2 * jnp.pi * cycle_turns
    scan = jnp.asarray(scan_angles(cycle_turns, BRANCH_SCAN))
    _, slope, bend, _ = jax.vmap(gaps)(scan)  # (scan, gaps)
    sharp = BLUNTEST * jnp.max(jnp.abs(bend), axis=0)
    least, start = scan_minima(slope, scan)
    columns = jnp.broadcast_to(jnp.arange(slope.shape[1])[None], slope.shape)

    def sharpened(phi, column):
        for _ in range(6):
            _, d, dd, _ = (part[column] for part in gaps(phi))
            phi = to_minimum(phi, d, dd, scan[1])
        value, _, dd, zero = (part[column] for part in gaps(phi))
        return phi, jnp.abs(value) <= zero, dd > sharp[column]

    guess = jax.vmap(lambda phi: gaps(phi)[0])(start.ravel())
    guess = jnp.diagonal(guess.reshape((*start.shape, -1)), axis1=1, axis2=2)  # each gap at its own guess
    order = jnp.argsort(jnp.where(least, guess, jnp.inf).ravel())[: SLOTS * cycle_turns]
    phi, touches, crosses = jax.vmap(sharpened)(start.ravel()[order], columns.ravel()[order])
    phi = wrapped(phi, whole)
    phi = jnp.where(jnp.minimum(phi, whole - phi) < TOUCHING, 0.0, phi)
    at = jnp.where(touches & least.ravel()[order], phi, jnp.inf)
    rank = jnp.argsort(at)
    at, passed = at[rank], (crosses & jnp.isfinite(at))[rank].astype(at.dtype)
    path = BranchPath(at, passed, jnp.zeros((at.size, 2, DEGREE + 1)), cycle_turns)
    centre = jnp.where(jnp.isfinite(at), at, 0.0)
    angles = centre[:, None] + REACH * jnp.asarray(NODES)[None]
    values = jax.vmap(jax.vmap(lambda phi: crossing(phi, path.flips(phi))))(angles)  # (slots, nodes, 2)
    return dataclasses.replace(path, series=jnp.einsum("kn,snc->sck", jnp.asarray(_powers()), values))
