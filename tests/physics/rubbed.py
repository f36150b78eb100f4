"""Friction of joints by an independent road: Newton-Euler equations of all links, repeated until frictions agree."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from linkjax.friction import GuideFriction, PinFriction
from tests.physics import newton_euler, oracle

ROUNDS = 400
FACTORS = {"given": 1.0, "unworn": math.pi / 2, "run-in": 4 / math.pi}


Pair = tuple[str, frozenset[str]]  # a joint and its two links


class Rubbed(NamedTuple):
    """The forces; for every joint, by the pair of its links, friction along the relative motion and its speed at unit
    crank speed; and the number of rounds."""

    solution: newton_euler.Solution
    friction: dict[Pair, np.ndarray]
    speed: dict[Pair, np.ndarray]
    rounds: int


def _motions(scene, here: oracle.Rates):
    """For every joint with friction: (joint, friction, direction of a guide or None, relative speed)."""
    by_joint = {each.joint: each for each in scene.friction}
    origins = scene.mechanism.origins()
    for joint in newton_euler.joints(scene.mechanism):
        friction = by_joint.get(joint.name)
        if friction is None or joint.drive or joint.mesh:
            continue
        if not joint.guide:
            under = 0.0 if joint.by == "frame" else here.links[joint.by].v
            yield joint, friction, None, here.links[joint.link].v - under
            continue
        p = here.points[joint.point]
        v = p.v
        if joint.by != "frame":
            base = here.points[origins[joint.by]]
            v = v - base.v - 1j * here.links[joint.by].v * (p.r - base.r)
        along = here.links[joint.link].r
        yield joint, friction, along, (v / along).real


def _size(friction: Any, force: np.ndarray, couple: np.ndarray) -> np.ndarray:
    f = float(friction.coefficient)
    if isinstance(friction, PinFriction):
        thrust = 0.0
        if (face := friction.thrust) is not None:
            big, small = float(face.outer), float(face.inner)
            mean = 2 / 3 * (big**3 - small**3) / (big**2 - small**2) if face.bearing == "unworn" else (big + small) / 2
            thrust = float(face.coefficient) * float(face.force) * mean
        return FACTORS[friction.bearing] * f * float(friction.radius) * np.abs(force) + thrust
    assert isinstance(friction, GuideFriction)
    f = f if friction.groove is None else f / math.sin(float(friction.groove))
    if friction.length is None:
        return f * np.abs(force)
    half = float(friction.length) / 2  # two edges, which are loaded on opposite sides where the block tilts
    edges = np.abs(np.abs(force) / 2 + couple / (2 * half)) + np.abs(np.abs(force) / 2 - couple / (2 * half))
    return f * edges


def solve(scene, phi, speed, acceleration, drag=None) -> Rubbed:
    """Forces with friction at arrays of crank angle (rad), speed (rad/s) and acceleration (rad/s²). `drag` is a load
    that the oracle does not know: link, point, and resistance (N s/m)."""
    here = oracle.rates(scene.mechanism, phi)
    if drag is not None:
        link, point, resistance = drag
        drag = [(link, point, -resistance * here.points[point].v * speed, 0 * phi)]
    moves = list(_motions(scene, here))
    sizes = [np.zeros_like(phi) for _ in moves]
    count, found, change = 0, None, np.inf
    while count < ROUNDS and change > 0:
        count += 1
        more = list(drag or ())
        for (joint, _, along, pace), size in zip(moves, sizes, strict=True):
            against = -np.sign(pace) * size
            for link, sign in ((joint.link, 1), (joint.by, -1)):
                if link == "frame":
                    continue
                force = 0j * phi if along is None else sign * against * along
                more.append((link, joint.point, force, sign * against if along is None else 0 * phi))
        found = newton_euler.solve(scene, phi, speed, acceleration, more=more)
        new = [_size(each[1], *found.reactions[each[0].name, each[0].link]) for each in moves]
        change = max(float(np.max(np.abs(a - b))) for a, b in zip(new, sizes, strict=True))
        change = 0.0 if change <= 1e-14 * max(float(np.max(size)) for size in new) else change
        sizes = new
    assert found is not None
    pairs = [(joint.name, frozenset((joint.link, joint.by))) for joint, *_ in moves]
    friction = {pair: -size * (pace != 0) for pair, size, (*_, pace) in zip(pairs, sizes, moves, strict=True)}
    return Rubbed(found, friction, {pair: np.abs(move[3]) for pair, move in zip(pairs, moves, strict=True)}, count)
