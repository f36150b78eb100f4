"""What a cycle costs: floating-point operations and bytes of every built-in scene, and of its gradient.

Run: python -m benchmarks.cost [--compiled] [--write] [SCENE ...]      (default: every scene)

A cycle is what `benchmarks.throughput` times: kinematics, reduction, steady motion, δ and peak shaking force at 64
nodes. XLA counts the program as it is handed to the compiler (`lowered`, seconds a scene), or with --compiled as it
leaves it (a minute a scene); loops count once. --write renews `benchmarks/cost.json`, which the tests compare with.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax

import linkjax as lj
from linkjax.measures import delta, evaluate, peak_shaking_force_constant_speed

FILE = Path(__file__).with_name("cost.json")
NODES = 64
Cost = dict[str, float]


def cycle(scene: lj.Scene) -> dict[str, jax.Array]:
    """δ and peak shaking force."""
    return evaluate(scene, [delta, peak_shaking_force_constant_speed], NODES)


def slope(scene: lj.Scene) -> Any:
    """Gradient of both by every number of the scene."""

    def scalar(scene):
        found = cycle(scene)
        return found["delta"] + 1e-4 * found["peak_shaking_force_constant_speed"]

    return jax.grad(scalar)(scene)


PROGRAMS: dict[str, Callable] = {"cycle": cycle, "gradient": slope}


def cost(name: str, program: str, compiled: bool = False) -> Cost:
    """Operations and bytes of a program for a built-in scene."""
    lowered = jax.jit(PROGRAMS[program]).lower(lj.load(name))
    found = lowered.compile().cost_analysis() if compiled else lowered.cost_analysis()
    assert found is not None, "this XLA does not count"
    return {"flops": float(found["flops"]), "bytes": float(found["bytes accessed"])}


def kept() -> dict[str, Any]:
    """The file, empty where there is none."""
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}


def main() -> None:
    """Print the table, and renew the file if asked to."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("scenes", nargs="*", metavar="SCENE")
    words.add_argument("--compiled", action="store_true", help="as it leaves the compiler")
    words.add_argument("--write", action="store_true", help=f"renew {FILE.name}")
    asked = words.parse_args()
    stage, before = "compiled" if asked.compiled else "lowered", kept()
    if asked.write and before.get("jax") != jax.__version__:
        before = {}  # counts of different versions do not compare
    found = dict(before.get(stage, {}))
    print(f"{'scene':20}{'cycle kflop':>13}{'kB':>9}{'gradient kflop':>16}{'kB':>9}{'times':>7}   {stage}")
    for name in asked.scenes or lj.scene_names():
        jax.clear_caches()  # one process has room for so many programs only
        found[name] = {program: cost(name, program, asked.compiled) for program in PROGRAMS}
        one, two = found[name]["cycle"], found[name]["gradient"]
        print(f"{name:20}{one['flops'] / 1e3:13.1f}{one['bytes'] / 1e3:9.0f}{two['flops'] / 1e3:16.1f}"
              f"{two['bytes'] / 1e3:9.0f}{two['flops'] / one['flops']:7.2f}", flush=True)  # fmt: skip
        if asked.write:
            content = {**before, "jax": jax.__version__, "nodes": NODES, stage: dict(sorted(found.items()))}
            FILE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
