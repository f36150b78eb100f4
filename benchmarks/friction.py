"""Wall time of a steady-state motion with friction, by design in a batch, over that without friction; and its error.

Run: python -m benchmarks.friction [SCENE ...] [--designs COUNT] [--block COUNT] [--rows ROW ...]

Rows: `compile` `error` `time` (default: all). A block is what is computed together: 10 designs on a CPU, as many as its
memory holds on a GPU (`--block 20000 --designs 20000 --rows time`).

Both give δ, the mean speed and all joint reactions at the nodes, for designs with scaled rods, by `map_designs`;
without friction the motion is found by collocation, too, because the machine has a motor. Errors are those of δ against
that of `FINE` nodes, the largest of eight designs. Ratios are those of paired rounds. A value and a gradient of δ are
compiled, too. Compiling takes about four minutes.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import time
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from benchmarks._timing import by_turns, line, ratio
from benchmarks.driven import hay_press, pump_line
from linkjax._config import use_compilation_cache
from linkjax.friction import everywhere
from linkjax.machine import ready
from linkjax.motion import steady_motion
from linkjax.sampling import Sampler

SCENES = {"pump-line": pump_line, "hay-press": hay_press}
ROWS = ("compile", "error", "time")
NODES, FINE, BLOCK, ROUNDS, FEW = 96, 1000, 10, 7, 8


def rough(scene: lj.Scene) -> lj.Scene:
    """The scene with friction in all joints."""
    return dataclasses.replace(scene, friction=everywhere(scene.mechanism, 0.08, 0.02, 0.1))


def forces_of(scene: lj.Scene, nodes: int = NODES) -> tuple[Any, ...]:
    """δ, mean speed and joint reactions at the nodes."""
    found = steady_motion(scene, nodes)
    machine, grid = Sampler(ready(scene)), found.grid
    places = jax.tree.map(jnp.ravel, grid.node_places())
    poses = machine.sample(places.phi, places.side, dynamics=False).pose
    speed, gain = jax.vmap(lambda place: found.at(scene, place))(places)
    active = grid.active[places.panel]
    forces = machine.forces(places.phi, places.side, poses, active, speed, gain)
    return found.delta, found.mean_speed, forces.reactions


def delta(scene: lj.Scene) -> jax.Array:
    """The coefficient of speed fluctuation."""
    return steady_motion(scene, NODES).delta


def designs(scene: lj.Scene, count: int) -> lj.Scene:
    """As many designs of a scene, with rods of 97 to 103 % of its length."""
    leaves, tree = jax.tree.flatten(scene)
    many = jax.tree.unflatten(tree, [jnp.broadcast_to(leaf, (count, *jnp.shape(leaf))) for leaf in leaves])
    factors = jnp.linspace(0.97, 1.03, count)
    where = eqx.tree_at(lambda s: s.mechanism.links["rod"].length, many, many.mechanism.links["rod"].length * factors)
    return where


def compiling(name: str, cases: dict[str, lj.Scene]) -> None:
    """Print the time to compile a value and a gradient of one design."""
    for key, each in cases.items():
        for what, function in (("value", delta), ("gradient", jax.grad(delta))):
            start = time.perf_counter()
            jax.jit(function).lower(each).compile()
            line(f"{name}.{key}.{what}.compile", time.perf_counter() - start, "s")


def errors(name: str, cases: dict[str, lj.Scene]) -> None:
    """Print the largest error of δ."""
    for key, each in cases.items():
        few = designs(each, FEW)
        known, found = (jax.lax.map(lambda s, n=n: steady_motion(s, n).delta, few) for n in (FINE, NODES))
        line(f"{name}.{key}.delta_error", float(jnp.max(jnp.abs(found - known))), "")


def timed(name: str, cases: dict[str, lj.Scene], count: int, block: int) -> None:
    """Print times and their ratio."""
    mapped = lj.map_designs(forces_of, block=block)
    runs = [functools.partial(mapped, designs(each, count)) for each in cases.values()]
    times = by_turns(*runs, rounds=ROUNDS)
    for key, each in zip(cases, times, strict=True):
        line(f"{name}.{key}", 1e6 * float(np.median(each)) / count, "us_per_design")
    ratio(f"{name}.friction_over_frictionless", times[1] / times[0])


def main() -> None:
    """Run the benchmark."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("scenes", nargs="*", default=list(SCENES), metavar="SCENE")
    words.add_argument("--designs", type=int, default=200)
    words.add_argument("--block", type=int, default=BLOCK)
    words.add_argument("--rows", nargs="*", default=list(ROWS), choices=ROWS, metavar="ROW")
    asked = words.parse_args()
    lj.enable_x64()
    use_compilation_cache()
    line("device", len(jax.devices()), jax.devices()[0].device_kind.replace(" ", "_"))
    for name in asked.scenes:
        scene = SCENES[name]()
        cases = {"frictionless": scene, "friction": rough(scene)}
        if "compile" in asked.rows:
            compiling(name, cases)
        if "error" in asked.rows:
            errors(name, cases)
        if "time" in asked.rows:
            timed(name, cases, asked.designs, asked.block)


if __name__ == "__main__":
    main()
