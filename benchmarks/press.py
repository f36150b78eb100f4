"""The hay press of the baselines as a linkjax scene, with its numbers in the order of the baseline designs."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from benchmarks.baselines.hay_press import DESIGN
from linkjax.kinematics import pose
from linkjax.loads import Instant
from linkjax.reduction import mass_sums, reduce_pose

NAMES = list(DESIGN)
NODES = 64


def scene_of(design: jax.Array) -> lj.Scene:
    """The built-in scene `hay-press-slider` with the numbers of a design, in the order of `NAMES`."""
    d = dict(zip(NAMES, design, strict=True))
    scene = lj.load("hay-press-slider")
    old, zero = scene.mechanism.links, jnp.zeros(())
    links = {
        "crank": lj.Link(length=d["l1"], mass=old["crank"].mass, centre_name="S1"),
        "rod": lj.Link(d["l2"], d["m2"], d["j2"], lj.Vec(d["c2"], zero), {"E": lj.Vec(d["ex"], d["ey"])}),
        "slider": lj.Link(mass=d["m3"]),
        "link4": lj.Link(d["l4"], d["m4"], d["j4"], lj.Vec(d["c4"], zero)),
        "rocker": lj.Link(d["l5"], d["m5"], d["j5"], lj.Vec(d["c5"], zero)),
    }
    fixed = {"A": lj.Vec(zero, zero), "F": lj.Vec(d["fx"], d["fy"])}
    mechanism = lj.Mechanism(fixed, links, scene.mechanism.groups, scene.mechanism.flywheel)
    return scene.with_mechanism(mechanism)


def eight(design: jax.Array) -> tuple[jax.Array, ...]:
    """The eight outputs of the baseline at `NODES` uniform crank angles, each of shape (angles,)."""
    scene = scene_of(design)

    def at(phi):
        here = pose(scene.mechanism, phi)
        reduced = reduce_pose(scene, Instant(phi, phi), here)
        first, second = mass_sums(here)
        inertia = reduced.inertia - scene.mechanism.flywheel.inertia
        slider = here.points["D"].dr.x
        weight = reduced.by_load["gravity"]
        return inertia, reduced.slope, weight, slider, first.x, first.y, second.x, second.y

    return jax.vmap(at)(jnp.arange(NODES) * (2 * jnp.pi / NODES))


def designs(count: int) -> np.ndarray:
    """Random designs around the press, the same as in the baseline."""
    rng = np.random.default_rng(0)
    return np.array(list(DESIGN.values())) * (1 + 1e-3 * rng.normal(size=(count, len(NAMES))))
