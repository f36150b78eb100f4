"""Correct digits in single precision for every built-in scene: the table of docs/hard-cases.md.

Run: python -m benchmarks.float32 [SCENE ...]      (default: every scene; half a minute per scene)
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from linkjax._search import scan_angles
from linkjax._types import as_float
from linkjax.analysis import float32_digits
from linkjax.forces import kinetostatics
from linkjax.machine import ready
from linkjax.measures import reaction_names
from linkjax.motion import at_crank_angles
from linkjax.rolling import RollingMachine
from linkjax.scenes import load_rolling, rolling_names

PARTS = ("position", "coefficients", "reactions", "drive_torque", "delta")
NAMES = [*lj.scene_names(), *rolling_names()]
STEPS = 90  # per turn, as in `float32_digits`
HARDLY = 1e-6  # of the largest value: smaller values are not compared
ALL = 15.0  # digits: nothing to compare, such as δ where a motion law prescribes the speed


def digits(name: str) -> dict[str, float]:
    """Correct digits in float32 for the results of a scene, by part; for rolling bodies positions and speed ratios."""
    if name in rolling_names():
        machine = load_rolling(name)
        found = {"position": shared(bodies, machine), "coefficients": shared(ratios, machine)}
    else:
        scene = lj.load(name)
        found = {**float32_digits(scene), "reactions": shared(reactions, scene)}
    return {part: found[part] for part in PARTS if found.get(part, ALL) < ALL}


def row(name: str, found: dict[str, float]) -> str:
    """One row of the table."""
    cells = (f"{found[part]:.1f}" if part in found else "–" for part in PARTS)
    return f"| {name} | {' | '.join(cells)} |"


def reactions(scene: lj.Scene) -> Any:
    """Forces at all joints at constant nominal speed, one row per joint."""
    made = ready(at_crank_angles(jax.tree.map(as_float, scene)))
    scene = made.scene

    def at(phi):
        found = kinetostatics(made, phi, scene.speed, jnp.zeros_like(phi)).reactions
        return jnp.stack([jnp.stack(found[joint][link][:2]) for joint, link in reaction_names(scene)])

    phi = scan_angles(scene.cycle_turns, STEPS) + 0.74 * math.pi / STEPS  # not where loads switch
    return jnp.moveaxis(jax.vmap(at)(phi), 0, -1).reshape((-1, 2 * phi.size))


def bodies(machine: RollingMachine) -> Any:
    """Positions of all bodies while the driven member turns, one row per coordinate."""
    centres = jax.vmap(machine.at)(jnp.linspace(0.0, machine.cycle, STEPS, endpoint=False)).centres
    return jnp.concatenate([centres.x, centres.y], axis=1).T


def ratios(machine: RollingMachine) -> Any:
    """Speeds of all members relative to the driven one."""
    return jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(machine.turned(1.0))])[:, None]


def shared(function: Callable[[Any], Any], given: Any) -> float:
    """Digits common to the results in float32 and in float64, relative to the largest of each row; the minimum."""
    found = []
    for kind in (jnp.float64, jnp.float32):
        jax.clear_caches()  # of constants in the other precision
        with jax.enable_x64(kind is jnp.float64):
            here = jax.tree.map(lambda leaf, kind=kind: jnp.asarray(np.asarray(leaf), dtype=kind), given)
            found.append(np.asarray(jax.jit(function)(here), dtype=float))
    exact, rough = found
    size = np.max(np.abs(exact), axis=1)
    there = size > HARDLY * np.max(size)
    wrong = np.max(np.abs(exact - rough), axis=1)[there] / size[there]
    return float(np.min(-np.log10(np.maximum(wrong, np.finfo(float).eps))))


if __name__ == "__main__":
    print("| scene | position | coefficients | reactions | drive torque | δ |\n|---|---|---|---|---|---|")
    for name in sys.argv[1:] or NAMES:
        jax.clear_caches()
        print(row(name, digits(name)), flush=True)
