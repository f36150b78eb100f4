"""The course of a dyad through its change points, where its two assemblies meet and motion goes on into the other.

On either side of such an angle the coefficients are 0/0, and rounding grows as the inverse of the distance; the motion
itself is smooth. Close to it the crossing is therefore read off a polynomial through places further away.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import nearest_turn, wrapped

BRANCHES = ("fixed", "continue")
TOUCHING = 1e-9  # an assembly margin within this of zero is a change point
SLOTS = 6  # change points looked for in a turn
REACH = 0.3  # rad to either side, from which the polynomial takes its values
INSIDE = 0.1  # rad to either side, in which it is used
DEGREE = 15
NODES = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))  # Chebyshev's, none of them zero
IN_LINE = 1e-8  # sine of the angle between the links, below which reactions are not followed any further
BLUNTEST = 1e-4  # of the greatest bend of a gap, below which it touches zero so bluntly that motion turns back there
CLOSEST = 1e-6  # rad from a change point within which nothing has a derivative by the design


def _powers() -> np.ndarray:
    """The matrix that makes coefficients by powers of x in (-1, 1) out of values at the nodes."""
    series = np.polynomial.chebyshev.chebvander(NODES, DEGREE).T * (2 / (DEGREE + 1))
    series[0] /= 2
    rows = [np.pad(p, (0, DEGREE + 1 - p.size)) for p in map(np.polynomial.chebyshev.cheb2poly, np.eye(DEGREE + 1))]
    return np.stack(rows).T @ series


class Course(NamedTuple):
    """Crank angles of the change points (infinite where there are fewer), whether motion passes them or turns back
    there, and the polynomials of two coordinates of the crossing near each, by powers of the angle from it over
    `REACH`."""

    at: Array  # (slots,)
    passed: Array  # (slots,), one or zero
    series: Array  # (slots, 2, DEGREE + 1)

    def flips(self, phi: Array, cycle_turns: int) -> Array:
        """+1 where the dyad is on the side that it is on just after crank angle zero, -1 on the other."""
        place = wrapped(phi, 2 * jnp.pi * cycle_turns)
        return 1.0 - 2.0 * (jnp.sum(jnp.where((self.at > 0.0) & (self.at <= place), self.passed, 0.0)) % 2)

    def comes_back(self) -> Array:
        """Whether it is after all its turns where it began."""
        return jnp.sum(self.passed) % 2 == 0

    def trouble(self) -> str:
        """What is wrong with it: "astray" where it does not come back."""
        return "" if bool(self.comes_back()) else "astray"

    def touches(self) -> Array:
        """Whether there is any change point."""
        return jnp.any(jnp.isfinite(self.at))

    def near(self, phi: Array, cycle_turns: int) -> Near:
        """The crossing as the nearest polynomial has it."""
        found = jnp.isfinite(self.at)
        away = nearest_turn(phi - jnp.where(found, self.at, 0.0), 2 * jnp.pi * cycle_turns)
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
    """Whether a polynomial holds here, and none but it; two coordinates with their derivatives by the crank angle."""

    inside: Array
    closest: Array
    value: Array  # (2,)
    d: Array
    dd: Array

    def instead(self, direct: Any, smooth: Any) -> Any:
        """The smooth value where it holds, with the derivatives by the design of the direct one."""

        def chosen(a, b):
            slope = jnp.where(self.closest, jax.lax.stop_gradient(a), a)
            return jnp.where(self.inside, jax.lax.stop_gradient(b) + (slope - jax.lax.stop_gradient(slope)), a)

        return jax.tree.map(chosen, direct, smooth)


def check_branch(kind: str, branch: str) -> None:
    """Raise ValueError for a branch that is none."""
    if branch not in BRANCHES:
        raise ValueError(f'branch of an {kind} must be "fixed" or "continue", but is {branch!r}')


def course_of(gaps: Any, crossing: Any, steps: int, cycle_turns: int) -> Course:
    """Change points over some turns: where one of the `gaps` (value, slope, bend and what counts as zero at a crank
    angle, for each) touches zero; `crossing` gives the two coordinates at a crank angle for a side that is +1 just
    after crank angle zero."""
    whole = 2 * jnp.pi * cycle_turns
    scan = jnp.arange(steps * cycle_turns, dtype=float) * (whole / (steps * cycle_turns))
    _, slope, bend, _ = jax.vmap(gaps)(scan)  # (scan, gaps)
    sharp = BLUNTEST * jnp.max(jnp.abs(bend), axis=0)
    ahead = jnp.roll(slope, -1, axis=0)
    least = (slope <= 0) & (ahead > 0)
    start = scan[:, None] + jnp.where(least, -slope / jnp.where(least, ahead - slope, 1.0), 0.0) * scan[1]
    columns = jnp.broadcast_to(jnp.arange(slope.shape[1])[None], slope.shape)

    def sharpened(phi, column):
        for _ in range(6):
            _, d, dd, _ = (part[column] for part in gaps(phi))
            phi = phi - jnp.clip(jnp.where(dd > 0, d / jnp.where(dd > 0, dd, 1.0), 0.0), -scan[1], scan[1])
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
    course = Course(at, passed, jnp.zeros((at.size, 2, DEGREE + 1)))
    centre = jnp.where(jnp.isfinite(at), at, 0.0)
    angles = centre[:, None] + REACH * jnp.asarray(NODES)[None]
    values = jax.vmap(jax.vmap(lambda phi: crossing(phi, course.flips(phi, cycle_turns))))(angles)  # (slots, nodes, 2)
    return course._replace(series=jnp.einsum("kn,snc->sck", jnp.asarray(_powers()), values))
