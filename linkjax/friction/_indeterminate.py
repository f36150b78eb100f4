"""Joints whose reactions are statically indeterminate."""

from __future__ import annotations

import math

import jax.numpy as jnp

from linkjax.kinematics import pose, prepared
from linkjax.mechanism import Mechanism, structure
from linkjax.topology import place_name, shared_forces

ANGLES = (1.0, 2.3)  # rad: crank angles at which equilibrium is examined


def indeterminate(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of the joints whose reactions are statically indeterminate, in a machine with redundant links.

    These reactions depend on the fit of the redundant links. They are computed on the assumption that redundant links
    carry only their own weight, inertia and loads. Empty for a machine without redundant links. Not for use under JAX
    transformations: dimensions must be numbers.
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
