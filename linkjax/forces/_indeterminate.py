"""Joints whose reactions equilibrium alone does not tell."""

from __future__ import annotations

import math

import jax.numpy as jnp

from linkjax.groups import place_name
from linkjax.kinematics import pose, prepared
from linkjax.mechanism import Mechanism, shared_forces, structure

ANGLES = (1.0, 2.3)  # rad, at which it is looked for


def indeterminate(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of the joints of a machine with passive links whose reactions depend on how tight these fit.

    Their reactions are computed as if the passive links carried nothing but themselves. Empty for a machine without
    passive links. Not for use under jax transformations: reads the numbers of the design.
    """
    if not any(group.passive() for group in mechanism.groups):
        return ()
    found, ready = structure(mechanism), prepared(mechanism)
    pairs = [pair for pair in found.pairs if pair.letter != "G"]
    points = {joint.name: joint.point for group in mechanism.groups for joint in group.joints()}
    shared: dict[str, None] = {}
    for phi in ANGLES:
        here, lies = pose(ready, jnp.asarray(phi)), {}
        for pair in pairs:
            at, u = here.points[points[pair.name]].r, here.links[pair.one].u
            lies[place_name(pair)] = float(at.x), float(at.y), math.atan2(float(u.y), float(u.x))
        shared |= dict.fromkeys(pair.name for pair in shared_forces(found.links, pairs, lies))
    return tuple(shared)
