"""Friction of joints by an independent road: Newton-Euler equations of all links, repeated until frictions agree."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from linkjax.friction import GuideFriction, MeshFriction, PinFriction
from linkjax.groups import Rack
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
    """For every joint with friction: (joint, friction, direction of a guide or rack or None, relative speed, the link
    that friction acts on, too)."""
    by_joint = {each.joint: each for each in scene.friction}
    origins = scene.mechanism.origins()
    wheels = {f"{wheel.link}.mesh": wheel for group in scene.mechanism.groups for wheel in group.wheels()}
    for joint in newton_euler.joints(scene.mechanism):
        friction = by_joint.get(joint.name)
        if friction is None or joint.drive:
            continue
        by, wheel = joint.by, wheels.get(joint.name)
        if wheel is not None:
            by = wheel.guide.on if isinstance(wheel, Rack) else wheel.carrier
        if not (joint.guide or isinstance(wheel, Rack)):
            under = 0.0 if by == "frame" else here.links[by].v
            yield joint, friction, None, here.links[joint.link].v - under, by
            continue
        p = here.points[joint.point]
        v = p.v
        if by != "frame":
            base = here.points[origins[by]]
            v = v - base.v - 1j * here.links[by].v * (p.r - base.r)
        along = here.links[joint.link].r
        yield joint, friction, along, (v / along).real, by


def _lost(friction: MeshFriction, along: Any, pace: np.ndarray, force: np.ndarray, couple: np.ndarray) -> np.ndarray:
    """What a mesh loses on its gear or rack: of the power that goes in, the share 1 - η."""
    to_it = np.sign(pace) * (couple if along is None else (force / along).real)
    share = float(friction.efficiency)
    return np.where(to_it > 0, to_it - share * to_it, -to_it / share + to_it)


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
    f = f if friction.seat is None else f * float(friction.seat)
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
    way = np.where(np.asarray(speed) < 0, -1.0, 1.0)  # backwards everything moves the other way
    moves = [(joint, rubs, along, way * pace, by) for joint, rubs, along, pace, by in _motions(scene, here)]
    sizes = [np.zeros_like(phi) for _ in moves]
    count, found, change = 0, None, np.inf
    while count < ROUNDS and change > 0:
        count += 1
        more = list(drag or ())
        for (joint, _, along, pace, by), size in zip(moves, sizes, strict=True):
            against = -np.sign(pace) * size
            for link, sign in ((joint.link, 1), (by, -1)):
                if link == "frame":
                    continue
                force = 0j * phi if along is None else sign * against * along
                more.append((link, joint.point, force, sign * against if along is None else 0 * phi))
        found = newton_euler.solve(scene, phi, speed, acceleration, more=more)
        new = []
        for joint, rubs, along, pace, _ in moves:
            load = found.reactions[joint.name, joint.link]
            new.append(_lost(rubs, along, pace, *load) if joint.mesh else _size(rubs, *load))
        change = max(float(np.max(np.abs(a - b))) for a, b in zip(new, sizes, strict=True))
        change = 0.0 if change <= 1e-14 * max(float(np.max(size)) for size in new) else change
        sizes = new
    assert found is not None
    pairs = [(joint.name, frozenset((joint.link, joint.by))) for joint, *_ in moves]
    friction = {pair: -size * (pace != 0) for pair, size, (*_, pace, _) in zip(pairs, sizes, moves, strict=True)}
    return Rubbed(found, friction, {pair: np.abs(move[3]) for pair, move in zip(pairs, moves, strict=True)}, count)
