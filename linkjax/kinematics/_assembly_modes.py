"""All assembly modes of a group of higher class at one crank angle.

Source: a plate on three legs closes at the roots of a trigonometric polynomial in its angle, at most six (Hunt,
Structural kinematics of in-parallel-actuated robot arms, 1983). A group with k loops of revolute joints has at most
C(2 k, k) modes: Wampler, Solving the kinematics of planar mechanisms by Dixon determinant, J. Mech. Des. 123 (2001).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from linkjax._lapack import svd
from linkjax._types import Scalar
from linkjax._vec import Vec
from linkjax.groups import General, closed_to
from linkjax.kinematics._pose import Prepared, before_group, prepared
from linkjax.mechanism import Mechanism
from linkjax.topology import pairs_of

STARTS = 60  # random starts per possible mode
SAME = 1e-6  # of directions: two modes that differ by less are the same
HELD = 1e-4  # below this least singular value of the closure Jacobian, two modes coincide or the group can move
NEAR = 3e-3  # largest error of a multiple root of a polynomial
MOVED = 1e-3  # of directions: two singular solutions that differ by less are the same


class AssemblyModes(NamedTuple):
    """The assembly modes found for one group.

    `sketches` holds the positions of its pins (m) in every mode; each can serve as a sketch. There are at most
    `upper_bound` modes, and `all_found` says whether the list is complete. `moves` says whether the group also has
    positions, not listed, in which it can move with the crank fixed.
    """

    sketches: list[dict[str, Vec]]
    upper_bound: int
    all_found: bool
    moves: bool = False

    def __str__(self) -> str:
        count = len(self.sketches)
        found = f"all {count}" if self.all_found else f"found {count} of at most {self.upper_bound}"
        return f"{found}; the group has positions in which it can move with the crank fixed" if self.moves else found


def assembly_modes(mechanism: Mechanism | Prepared, phi: Scalar | float = 0.0) -> dict[str, AssemblyModes]:
    """The assembly modes of every group of higher class without gears, at the crank angle `phi` (rad).

    The keys are the names of the groups, e.g. "plate-leg1-leg2-leg3". Dyads and groups with gears are not included. The
    groups before each one keep the assembly mode of `mechanism`.

    For a triad (a link pinned to three others) the modes are the real roots of its sextic. All of them are found,
    except for special dimensions such as equal and parallel legs. For other groups the modes are sought from random
    starts, the same in every call. If the group can move with the crank fixed, only the modes in which it cannot are
    listed. Not for use under JAX transformations: dimensions must be numbers, neither traced nor batched.
    """
    ready, found = prepared(mechanism), {}
    angle = jnp.asarray(phi, dtype=float)
    for number, group in enumerate(ready.mechanism.groups):
        if group.numerical() and not group.wheels():
            states, points = before_group(ready, number, angle)
            found["-".join(group.link_names())] = _assemblies(group, ready.mechanism.links, states, points, angle)
    return found


def _assemblies(group: Any, links, states, points, phi) -> AssemblyModes:
    places = {link: {p: complex(at.x, at.y) for p, at in spots.items()} for link, spots in group.places(links).items()}
    loops = len(pairs_of(group)) - len(group.members)
    upper_bound = math.comb(2 * loops, loops)
    outer = {name: complex(at.r.x, at.r.y) for name, at in points.items()}
    starts = _of_triad(group, places, outer)
    exact = starts is not None
    if starts is None:
        rng, size = np.random.default_rng(0), float(group.size(links, points))
        middle = np.mean([outer[p] for p in group.outer] or [0j])
        shape = (STARTS * upper_bound, len(group.members))
        at = middle + size * (rng.normal(size=shape) + 1j * rng.normal(size=shape))
        starts = _rows(at, np.exp(2j * np.pi * rng.uniform(size=shape)))

    def close(start):
        z, _, gap = group.closed(links, states, points, phi, start)
        slopes = group.opened(links, states, points, phi, z, jnp.zeros(3 * len(group.members)))[1]
        least = svd(slopes)[1][-1]
        return z, gap, group.reversed(links, states, points, phi, z), least

    kept: list[np.ndarray] = []
    loose: list[np.ndarray] = []  # singular: to first order, the joints do not constrain all links
    for each, left, astern, least in zip(*map(np.asarray, jax.jit(jax.vmap(close))(jnp.asarray(starts))), strict=True):
        known = loose if least < HELD else kept
        apart = MOVED if least < HELD else SAME
        if (
            left < closed_to(each.dtype)
            and not astern
            and all(np.max(np.abs(each - other)[:, 2:]) > apart for other in known)
        ):
            known.append(each)
    moves = len(loose) > upper_bound
    kept = sorted(kept if moves else kept + loose, key=lambda each: [round(float(v), 9) for v in each[:, 2:].ravel()])
    sketches = [_spots(group, places, each) for each in kept]
    return AssemblyModes(sketches, upper_bound, not moves and (exact or len(kept) == upper_bound), moves)


def _rows(at: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Origins and directions as configurations, shape (modes, links, 4)."""
    return np.stack([np.real(at), np.imag(at), np.real(u), np.imag(u)], axis=-1)


def _spots(group: General, places, z: np.ndarray) -> dict[str, Vec]:
    """Positions of the pins in a configuration."""
    found = {}
    for (link, pins), row in zip(group.members, z, strict=True):
        for pin in pins:
            at = complex(row[0], row[1]) + places[link][pin] * complex(row[2], row[3])
            if pin not in group.outer:
                found.setdefault(pin, Vec(at.real, at.imag))
    return found


def _of_triad(group: General, places, outer: dict[str, complex]) -> np.ndarray | None:
    """The configurations of a plate on three legs with revolute joints only; None for any other group, and if the three
    circles are concentric."""
    legs = {link: pins for link, pins in group.members if len(set(pins) & set(group.outer)) == 1 and len(pins) == 2}
    plates = [link for link, _ in group.members if link not in legs]
    if len(group.members) != 4 or len(legs) != 3 or len(plates) != 1 or group.slots or group.drive is not None:
        return None
    joined = [(leg, next(p for p in pins if p in group.outer), next(p for p in pins if p not in group.outer))
              for leg, pins in legs.items()]  # fmt: skip
    if any(inner not in dict(group.members)[plates[0]] for _, _, inner in joined):
        return None
    far = np.array([outer[out] for _, out, _ in joined])
    near = np.array([places[plates[0]][inner] for _, _, inner in joined])
    length = np.array([abs(places[leg][inner] - places[leg][out]) for leg, out, inner in joined])

    def lines(theta):
        """The vector of the first leg less the plate's origin, and the differences of the circle equations, in which
        the product of `apart` and the plate's origin is `right`."""
        arms = near[:, None] * np.exp(1j * theta)[None] - far[:, None]
        right = (length[1:, None] ** 2 - length[:1, None] ** 2) - (np.abs(arms[1:]) ** 2 - np.abs(arms[:1]) ** 2)
        return arms[0], 2 * (arms[1:] - arms[:1]), right

    def crossing(apart, right):
        """The intersection of two lines: numerator and common denominator."""
        return 1j * (right[1] * apart[0] - right[0] * apart[1]), np.imag(np.conj(apart[0]) * apart[1])

    def left(theta):
        arm, *both = lines(theta)
        top, bottom = crossing(*both)
        return (np.abs(top + arm * bottom) ** 2 - (length[0] * bottom) ** 2) / size**6

    size, count = np.max(length), 16  # more than twice the degree of the polynomial
    terms = np.fft.fft(left(np.arange(count) * (2 * np.pi / count))) / count
    polynomial = np.roll(terms, count // 2)[::-1][:-1]  # of exp(i theta), highest power first
    big = np.abs(polynomial) > 1e-12 * np.max(np.abs(polynomial))
    polynomial = polynomial[np.argmax(big) : len(big) - np.argmax(big[::-1])]
    z = np.roots(polynomial)
    made = []
    for theta in np.angle(z[np.abs(np.abs(z) - 1) < NEAR]):
        arm, apart, right = (each[..., 0] for each in lines(np.array([theta])))
        if np.max(np.abs(apart)) < 10 * NEAR * size:
            return None  # three concentric circles: the plate can rotate
        top, bottom = crossing(apart, right)
        if np.abs(bottom) > 1e-6 * size**2:
            made.append((np.exp(1j * theta), top / bottom))
            continue
        k = np.argmax(np.abs(apart))  # the two lines coincide: their intersections with the first circle
        foot, along = right[k] * apart[k] / np.abs(apart[k]) ** 2, 1j * apart[k] / np.abs(apart[k])
        middle = -np.real((foot + arm) * np.conj(along))
        reach = np.sqrt(np.maximum(middle**2 - np.abs(foot + arm) ** 2 + length[0] ** 2, 0.0))
        made += [(np.exp(1j * theta), foot + along * (middle + side * reach)) for side in (1, -1)]
    rows = []
    for turn, at in made:
        where = {plates[0]: (at, turn)}
        for (leg, out, inner), spot in zip(joined, near, strict=True):
            span = (at + spot * turn - outer[out]) / (places[leg][inner] - places[leg][out])
            u = span / abs(span)
            where[leg] = (outer[out] - places[leg][out] * u, u)
        rows.append([where[link] for link, _ in group.members])
    ways = np.array(rows).reshape((-1, len(group.members), 2))
    return _rows(ways[..., 0], ways[..., 1])
