"""Cost of an analysis: floating-point operations, bytes and loops of every built-in scene, and of its gradient.

Run: python -m benchmarks.cost [--compiled] [--write] [SCENE ...]      (default: every scene)

Programs, at 64 nodes: `cycle`, the program of `benchmarks.throughput` (kinematics, reduction, steady-state motion, δ,
peak shaking force); `gradient`, of δ and of the peaks of shaking force and joint reactions, with respect to all scene
parameters; `analysis`, everything that `linkjax.analyse` computes, at 36 angles. For rolling bodies
`gradient` is that of the closure error with respect to the design. XLA counts the operations of a program before
compilation (`lowered`, seconds per scene), with --compiled also after compilation for one use (half a minute per
scene). XLA counts the body of a loop once, so `loops` gives the iterations: those of every loop, after those of the
enclosing loops, and the number of such loops; `?` where the number depends on the data. These are the steps along the
path of a group of higher class; `steps` counts them while the path is prepared (times the iterations within).
`equations` are those of all programs that one call of `linkjax.analyse` asks for, before anything is compiled. --write
renews `benchmarks/cost.json`, which the tests compare with.
"""

from __future__ import annotations

import argparse
import collections
import json
import platform
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import jax
import jax.numpy as jnp

import linkjax as lj
from linkjax import _compile
from linkjax._compile import SOONER
from linkjax.analysis import compile_ahead
from linkjax.groups import General
from linkjax.kinematics import prepared
from linkjax.measures import delta, evaluate, peak_reaction, peak_shaking_force_constant_speed
from linkjax.rolling import RollingMachine, chain, clearances, closing_clearance, closure_gap, margins
from linkjax.scenes import load_rolling, rolling_names

FILE = Path(__file__).with_name("cost.json")
NODES, ANGLES = 64, 36
PARTS = ("steps", "equations", "lowered", "compiled")
Machine = lj.Scene | RollingMachine


def cycle(scene: lj.Scene) -> Any:
    """δ and peak shaking force."""
    return evaluate(scene, [delta, peak_shaking_force_constant_speed], NODES)


def slope(scene: lj.Scene) -> Any:
    """δ and peaks with the gradient of their sum."""

    def scalar(scene):
        found = evaluate(scene, [delta, peak_shaking_force_constant_speed, peak_reaction], NODES)
        return sum(found.values(), jnp.zeros(()))

    return jax.value_and_grad(scalar)(scene)


def analysis(scene: lj.Scene) -> Any:
    """The whole analysis."""
    return lj.analyse(scene, angles=ANGLES, nodes=NODES, throw=False)


def rolled(machine: RollingMachine) -> Any:
    """The chain with its clearances and margins, speeds, and the positions of all bodies over a cycle."""
    design = machine.design
    along = jnp.linspace(0.0, machine.cycle, ANGLES, endpoint=False)
    return chain(design), clearances(design), margins(design), machine.speeds(), jax.vmap(machine.at)(along)


def rolled_slope(machine: RollingMachine) -> Any:
    """The derivatives of the closure error of the chain with respect to all numbers of the design."""
    return jax.jacrev(lambda design: (closure_gap(design), closing_clearance(design)))(machine.design)


OF_SCENES: dict[str, Callable] = {"cycle": cycle, "gradient": slope, "analysis": analysis}
OF_ROLLING: dict[str, Callable] = {"gradient": rolled_slope, "analysis": rolled}
NAMES = [*lj.scene_names(), *rolling_names()]


def programs(name: str) -> dict[str, Callable]:
    """The programs of a built-in scene."""
    return OF_SCENES if name in lj.scene_names() else OF_ROLLING


def machine(name: str) -> Machine:
    """A built-in scene, or rolling bodies."""
    return lj.load(name) if name in lj.scene_names() else load_rolling(name)


def cost(name: str, program: str, compiled: bool = False) -> dict[str, dict[str, Any]]:
    """Operations, bytes and loops of a program for a built-in scene, lowered, and on request compiled."""
    traced = jax.jit(programs(name)[program]).trace(machine(name))
    lowered = traced.lower()
    found = {"lowered": _counts(lowered) | {"loops": dict(sorted(loops(traced.jaxpr).items()))}}
    return found | {"compiled": _counts(lowered.compile(compiler_options=SOONER))} if compiled else found


def _counts(program: Any) -> dict[str, Any]:
    found = program.cost_analysis()
    assert found is not None, "this XLA does not count"
    return {"flops": float(found["flops"]), "bytes": float(found["bytes accessed"])}


def loops(jaxpr: Any, around: tuple[str, ...] = ()) -> collections.Counter[str]:
    """The number of loops for each number of iterations, with those of the enclosing loops."""
    found: collections.Counter[str] = collections.Counter()
    for equation in jaxpr.eqns:
        trips = {"scan": str(equation.params.get("length")), "while": "?"}.get(equation.primitive.name)
        here = around if trips is None else (*around, trips)
        if trips is not None:
            found[" ".join(here)] += 1
        inside = jax.tree.leaves(list(equation.params.values()), is_leaf=lambda x: hasattr(x, "eqns"))
        for inner in (x for x in inside if hasattr(x, "eqns")):
            found += loops(inner, here)
    return found


def equations(name: str) -> dict[str, int] | None:
    """How many programs an analysis of a scene asks for, and their equations: all of the jaxprs, those of every inner
    jaxpr once where it stands; None for rolling bodies. Nothing is compiled."""
    scene, found = machine(name), list[int]()
    if not isinstance(scene, lj.Scene):
        return None

    def counted(traced, *_, **__):
        found.append(inner_equations(traced.jaxpr))

    _compile.forget()
    with (
        mock.patch.object(jax.stages.Traced, "lower", counted),
        mock.patch.object(_compile, "_aside", lambda *_: None),
        mock.patch.object(_compile, "_kept_in", lambda *_: None),
    ):
        compile_ahead(scene)
    _compile.forget()  # what was traced here cannot run
    return {"programs": len(found), "equations": sum(found)}


def inner_equations(jaxpr: Any) -> int:
    """The equations of a jaxpr and of every jaxpr in it."""
    inside = jax.tree.leaves([e.params for e in jaxpr.eqns], is_leaf=lambda x: hasattr(x, "eqns"))
    return len(jaxpr.eqns) + sum(inner_equations(inner) for inner in inside if hasattr(inner, "eqns"))


def steps(name: str) -> int | None:
    """Closure solutions of groups of higher class while the path of a scene is prepared; None for rolling bodies."""
    scene, count, closed = machine(name), collections.Counter[str](), General.closed
    if not isinstance(scene, lj.Scene) or not any(isinstance(group, General) for group in scene.mechanism.groups):
        return None

    def counted(*given, **named):
        jax.debug.callback(lambda: count.update(["closed"]))
        return closed(*given, **named)

    jax.clear_caches()  # clear programs traced without counting; below, those with counting
    with mock.patch.object(General, "closed", counted):
        jax.block_until_ready(jax.tree.leaves(jax.jit(lambda m: prepared(m, scene.cycle_turns))(scene.mechanism)))
        jax.effects_barrier()
    jax.clear_caches()
    return count["closed"]


def kept() -> dict[str, Any]:
    """The content of the file; empty if there is no file."""
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}


def processor() -> str:
    """The processor: what the compiler makes of a program depends on it, by up to 16 % of the operations."""
    info = Path("/proc/cpuinfo")
    found = re.search(r"model name\s*:\s*(.*)", info.read_text(encoding="utf-8")) if info.exists() else None
    return found[1] if found else platform.machine()


def main() -> None:
    """Print the table, and renew the file on request."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("scenes", nargs="*", metavar="SCENE")
    words.add_argument("--compiled", action="store_true", help="also count after compilation")
    words.add_argument("--write", action="store_true", help=f"renew {FILE.name}")
    asked = words.parse_args()
    before = kept()
    if before.get("jax") != jax.__version__:
        before = {}  # counts of different versions are not comparable
    content = {"jax": jax.__version__, "processor": before.get("processor"), "nodes": NODES, "angles": ANGLES}
    content |= {part: dict(before.get(part, {})) for part in PARTS}
    if asked.compiled and content["processor"] != processor():
        content |= {"processor": processor(), "compiled": {}}
    print(f"{'':20}" + "".join(f"{program + ' kflop':>17}{'kB':>9}" for program in OF_SCENES))
    for name in asked.scenes or NAMES:
        jax.clear_caches()  # the memory of one process is limited
        found = {program: cost(name, program, asked.compiled) for program in programs(name)}
        for stage in ("lowered", "compiled")[: 1 + asked.compiled]:
            content[stage][name] = counts = {program: both[stage] for program, both in found.items()}
            cells = ((counts[p]["flops"] / 1e3, counts[p]["bytes"] / 1e3) for p in OF_SCENES if p in counts)
            print(f"{name:20}" + "".join(f"{flops:17.1f}{size:9.0f}" for flops, size in cells), stage, flush=True)
        if (path := steps(name)) is not None:
            content["steps"][name] = path
        if (traced := equations(name)) is not None:
            content["equations"][name] = traced
            print(f"{name:20}{traced['equations']:17d} equations in {traced['programs']} programs of an analysis")
        if asked.write:
            content |= {part: dict(sorted(content[part].items())) for part in PARTS}
            FILE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
