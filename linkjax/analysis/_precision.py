"""Digits of a machine's results in single precision."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._search import scan_angles
from linkjax._types import as_float
from linkjax.analysis._cycle import Cycle
from linkjax.forces import kinetostatics
from linkjax.kinematics import pose
from linkjax.machine import Scene, ready
from linkjax.motion import at_crank_angles, steady_motion

FEWEST = 4  # digits, below which there is a warning
COMPARED = 90  # crank angles per turn


def float32_digits(scene: Scene, nodes: int = 96) -> dict[str, float]:
    """Correct decimal digits of a scene's results in float32, by comparison with float64.

    Of `position`, `coefficients` (first and second), `drive_torque` at constant nominal speed, each relative to its
    largest magnitude over the cycle, and of `delta`. Computes everything in both precisions. The scene's numbers are
    rounded to float32 first, which is part of the error. Raises `RuntimeError` from JAX if the precision cannot be
    changed; not for use under jax transformations. Functions compiled before are compiled anew afterwards: JAX keeps
    constants in the precision in which it met them first.
    """
    found = []
    try:
        for wide in (True, False):
            jax.clear_caches()
            with jax.enable_x64(wide):
                kind = jnp.float64 if wide else jnp.float32
                given = jax.tree.map(lambda leaf, kind=kind: jnp.asarray(np.asarray(leaf), dtype=kind), scene)
                found.append([np.asarray(part, dtype=float) for part in _figures(given, nodes)])
    finally:
        jax.clear_caches()
    names = ("position", "coefficients", "drive_torque", "delta")
    return {name: _digits(one, two) for name, one, two in zip(names, *found, strict=True)}


def _figures(scene: Scene, nodes: int) -> tuple[Array, ...]:
    """The quantities compared, each of shape (quantities, angles) except the last."""
    made = ready(at_crank_angles(jax.tree.map(as_float, scene)))
    scene = made.scene
    phi = scan_angles(scene.cycle_turns, COMPARED)

    def at(phi):
        here = pose(made.mechanism, phi)
        points, links = here.points.values(), here.links.values()
        torque = kinetostatics(made, phi, scene.speed, jnp.zeros_like(phi)).drive_torque
        return (
            jnp.stack([x for p in points for x in (p.r.x, p.r.y)]),
            jnp.stack([x for p in points for v in (p.dr, p.ddr) for x in (v.x, v.y)]
                      + [x for link in links for x in (link.w, link.e)]),
            torque[None],
        )  # fmt: skip

    rows = jax.jit(jax.vmap(at, out_axes=1))(phi)
    return (*rows, jax.jit(lambda made: steady_motion(made, nodes).delta)(made)[None, None])


def _digits(exact: np.ndarray, rough: np.ndarray) -> float:
    """Digits in which two results agree, relative to the largest magnitude of each row; the fewest of all rows."""
    size = np.max(np.abs(exact), axis=1)
    there = size > 1e-6 * np.max(size)  # quantities that hardly change are not compared
    wrong = np.max(np.abs(exact - rough), axis=1)[there] / size[there]
    return float(np.min(-np.log10(np.maximum(wrong, np.finfo(float).eps)), initial=16.0))


def fewest_digits(cycle: Cycle) -> float:
    """Approximate number of correct digits of an analysis in the precision in force: the least of those of kinematic
    coefficients at the least assembly margin, where rounding errors grow as its inverse (docs/hard-cases.md), of δ,
    which is a difference of speeds, and of the checks of the analysis."""
    rounding = float(jnp.finfo(cycle.angles.dtype).eps)
    worst = float(jnp.maximum(cycle.checks.virtual_power, cycle.checks.force_balance))
    sizes = [float(m.value) for sides in cycle.margins.values() for m in sides.values()]
    sizes += [] if cycle.delta is None else [float(cycle.delta)]
    worst = max([worst, rounding, *(rounding / size for size in sizes if size > 0)])
    return -math.log10(worst)
