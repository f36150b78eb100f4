"""All the ways in which a general group can be assembled at one crank angle.

Source: a plate on three legs closes where a trigonometric polynomial in its angle vanishes, of six roots at most
(Hunt, Structural kinematics of in-parallel-actuated robot arms, 1983); at most C(2 k, k) ways for k loops of turning
pairs: Wampler, Solving the kinematics of planar mechanisms by Dixon determinant, J. Mech. Des. 123 (2001).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from linkjax._types import Scalar
from linkjax._vec import Vec
from linkjax.groups import General, closed_to
from linkjax.kinematics._pose import before_group, prepared
from linkjax.mechanism import Mechanism

STARTS = 60  # random starts for every way that there may be
SAME = 1e-6  # of directions: two ways that differ by less are one


class Assemblies(NamedTuple):
    """The ways found to assemble a group, each as places of its pins (m), which will do as a sketch; how many there can
    be at most, and whether these are all."""

    sketches: list[dict[str, Vec]]
    at_most: int
    all_found: bool

    def __str__(self) -> str:
        return (
            f"all {len(self.sketches)}" if self.all_found else f"found {len(self.sketches)} of at most {self.at_most}"
        )


def assemblies(mechanism: Mechanism, phi: Scalar | float = 0.0) -> dict[str, Assemblies]:
    """The ways to assemble every general group at the crank angle `phi` (rad), by the name of the group; the groups
    before it stand as the mechanism's own.

    Those of a triad (a link on three others, all pinned) are the real roots of its sextic, and all of them. Others are
    sought from random starts, always the same ones. Numbers must be known: neither traced nor batched.
    """
    mechanism, found = prepared(mechanism), {}
    angle = jnp.asarray(phi, dtype=float)
    for number, group in enumerate(mechanism.groups):
        if isinstance(group, General):
            states, points = before_group(mechanism, number, angle)
            found["-".join(group.link_names())] = _assemblies(group, mechanism.links, states, points, angle)
    return found


def _assemblies(group: General, links, states, points, phi) -> Assemblies:
    places = {link: {p: complex(at.x, at.y) for p, at in spots.items()} for link, spots in group.places(links).items()}
    pairs = group.pairs()
    loops = len(pairs) - len(group.members)
    at_most = math.comb(2 * loops, loops)
    outer = {name: complex(at.r.x, at.r.y) for name, at in points.items()}
    starts = _of_triad(group, places, outer)
    exact = starts is not None
    if starts is None:
        rng, size = np.random.default_rng(0), float(group.size(links))
        middle = np.mean([outer[p] for p in group.outer] or [0j])
        shape = (STARTS * at_most, len(group.members))
        at = middle + size * (rng.normal(size=shape) + 1j * rng.normal(size=shape))
        starts = _rows(at, np.exp(2j * np.pi * rng.uniform(size=shape)))

    def close(start):
        z, _, gap = group.closed(links, states, points, phi, start)
        return z, gap, group.reversed(links, states, points, phi, z)

    z, gap, astern = jax.jit(jax.vmap(close))(jnp.asarray(starts))
    kept: list[np.ndarray] = []
    for each, left, other_way in zip(np.asarray(z), np.asarray(gap), np.asarray(astern), strict=True):
        if (
            left < closed_to(each.dtype)
            and not other_way
            and all(np.max(np.abs(each - other)[:, 2:]) > SAME for other in kept)
        ):
            kept.append(each)
    kept.sort(key=lambda each: [round(float(v), 9) for v in each[:, 2:].ravel()])
    sketches = [_spots(group, places, each) for each in kept]
    return Assemblies(sketches, at_most, exact or len(kept) == at_most)


def _rows(at: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Origins and directions as configurations, shape (ways, links, 4)."""
    return np.stack([np.real(at), np.imag(at), np.real(u), np.imag(u)], axis=-1)


def _spots(group: General, places, z: np.ndarray) -> dict[str, Vec]:
    """Where the pins are in a configuration."""
    found = {}
    for (link, pins), row in zip(group.members, z, strict=True):
        for pin in pins:
            at = complex(row[0], row[1]) + places[link][pin] * complex(row[2], row[3])
            if pin not in group.outer:
                found.setdefault(pin, Vec(at.real, at.imag))
    return found


def _of_triad(group: General, places, outer: dict[str, complex]) -> np.ndarray | None:
    """The configurations of a plate on three legs, all joints turning; None for any other group."""
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

    def origin(theta):
        """Where the plate's origin is for its first two differences of circles, over the common denominator."""
        arms = near[:, None] * np.exp(1j * theta)[None] - far[:, None]
        apart = 2 * (arms[1:] - arms[:1])
        right = (length[1:, None] ** 2 - length[:1, None] ** 2) - (np.abs(arms[1:]) ** 2 - np.abs(arms[:1]) ** 2)
        bottom = np.imag(np.conj(apart[0]) * apart[1])
        return 1j * (right[1] * apart[0] - right[0] * apart[1]), bottom, arms[0]

    def left(theta):
        top, bottom, arm = origin(theta)
        return (np.abs(top + arm * bottom) ** 2 - (length[0] * bottom) ** 2) / np.max(length) ** 6

    count = 16  # more than twice the degree of the polynomial
    terms = np.fft.fft(left(np.arange(count) * (2 * np.pi / count))) / count
    polynomial = np.roll(terms, count // 2)[::-1][:-1]  # of exp(i theta), highest power first
    big = np.abs(polynomial) > 1e-12 * np.max(np.abs(polynomial))
    polynomial = polynomial[np.argmax(big) : len(big) - np.argmax(big[::-1])]
    z = np.roots(polynomial)
    theta = np.angle(z[np.abs(np.abs(z) - 1) < 1e-3])
    top, bottom, _ = origin(theta)
    good = np.abs(bottom) > 0
    theta, base = theta[good], top[good] / bottom[good]
    rows = []
    for turn, at in zip(np.exp(1j * theta), base, strict=True):
        where = {plates[0]: (at, turn)}
        for (leg, out, inner), spot in zip(joined, near, strict=True):
            span = (at + spot * turn - outer[out]) / (places[leg][inner] - places[leg][out])
            u = span / abs(span)
            where[leg] = (outer[out] - places[leg][out] * u, u)
        rows.append([where[link] for link, _ in group.members])
    made = np.array(rows).reshape((-1, len(group.members), 2))
    return _rows(made[..., 0], made[..., 1])
