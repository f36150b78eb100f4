"""Time until the first answer: what is traced and compiled before a new machine runs, with `import jax` beside it.

Run: python -m benchmarks.start [ROW ...]    rows: analyse kept optimise problem unseen gradient designs (default: all)

Every figure in a process of its own; unless a row says so, with no kept program.
analyse: the first and the second `lj.analyse`, programs asked for and their equations: all equations of the jaxprs,
  those of every inner jaxpr once. kept: `linkjax analyse` for the first time and again, with kept programs.
optimise: `linkjax optimise hay-press` likewise. problem: the problem of `make demo` in Python, with programs kept, then
  in the same process again, then with other bounds and other numbers; and its evaluations by themselves.
unseen: a four-bar and a six-bar that no process has met, ten design variables, until the optimiser's first step.
gradient: the gradient of the peak reaction of kozhevnikov-press, and its memory.
designs: compiling a map over designs of hay-press, for four measures, and for their Jacobian by five lengths.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

SCENES = ("slider-crank", "hay-press", "kozhevnikov-press", "scissor-lift")
FREE = {
    "four-bar": {
        "minimise": "peak_shaking_force_constant_speed",
        "limits": ["delta <= 0.15", "min_transmission_angle >= initial"],
        "free": {
            "flywheel.inertia": "0 to 40 kg m^2",
            "links.coupler.length": "± 5 %",
            "links.coupler.mass": "± 20 %",
            "links.coupler.inertia": "± 20 %",
            "links.coupler.centre.along": "± 20 %",
            "links.crank.length": "± 5 %",
            "links.crank.mass": "± 20 %",
            "links.rocker.length": "± 5 %",
            "fixed.D.x": "± 3 %",
            "speed": "± 3 %",
        },
    }
}
LENGTHS = ("crank", "rod", "link4", "rocker")


def clock() -> Callable[[], float]:
    """Seconds since the last call."""
    last = [time.perf_counter()]

    def lap() -> float:
        last.append(time.perf_counter())
        return last[-1] - last[-2]

    return lap


def equations(jaxpr: Any) -> int:
    """The equations of a jaxpr and of every jaxpr in it, each once where it is written."""
    import jax

    found = len(jaxpr.eqns)
    for equation in jaxpr.eqns:
        for inner in jax.tree.leaves(list(equation.params.values()), is_leaf=lambda x: hasattr(x, "eqns")):
            found += equations(inner) if hasattr(inner, "eqns") else 0
    return found


def first_analysis(scene: str) -> dict[str, float]:
    """Seconds of import, first and second analysis, and what was traced, in this process."""
    lap = clock()
    import jax

    imported = lap()
    traced: list[int] = []
    lower = jax.stages.Traced.lower

    def counted(self: Any, *given: Any, **named: Any) -> Any:
        traced.append(equations(self.jaxpr))
        return lower(self, *given, **named)

    jax.stages.Traced.lower = counted
    import linkjax as lj

    lj.enable_x64()
    machine = lj.load(scene)
    times = []
    for _ in range(4):
        lap()
        jax.block_until_ready(jax.tree.leaves(lj.analyse(machine, throw=False)))
        times.append(lap())
    found = {"import jax": imported, "first": times[0], "second": min(times[1:])}
    return found | {"first/import": times[0] / imported, "programs": len(traced), "equations": sum(traced)}


def demo_problem(scene_name: str) -> dict[str, float]:
    """The demo's problem again and again in this process; programs may be kept from another process."""
    lap = clock()
    import linkjax as lj
    from linkjax.design import Problem, settled

    lj.enable_x64()
    scene, problem = lj.load_problem(scene_name)
    asked: dict[str, Any] = dict(problem)
    found: dict[str, Any] = {"import": lap()}
    best = lj.optimise(scene, **asked)
    found |= {"first": lap(), "evaluations": best.evaluations}
    for _ in range(2):
        lap()
        best = lj.optimise(scene, **asked)
        found["again"] = lap()
    wider = {name: (0.99 * low, 1.01 * high) for name, (low, high) in bounds(settled(scene, **asked)["free"]).items()}
    changed = dataclasses.replace(scene, speed=1.02 * scene.speed)
    lap()
    other = lj.optimise(changed, **{**asked, "free": wider, "seed": asked["seed"] + 1})
    found |= {"other numbers": lap(), "its evaluations": other.evaluations}
    given = settled(scene, **asked)
    posed = Problem(scene, given["free"], given["minimise"], given["limits"])
    x = posed.start
    lap()
    for _ in range(50):
        posed.at(x)
    found["one evaluation"] = lap() / 50
    return found | {"again/evaluations": found["again"] / (best.evaluations * found["one evaluation"])}


def bounds(variables: Any) -> dict[str, tuple[float, float]]:
    """Bounds of design variables (SI), by name."""
    return {v.name: (float(v.lower), float(v.upper)) for v in variables}


def unseen(scene: str) -> dict[str, float]:
    """A machine that no process has met, ten design variables: until the optimiser's first step, and one evaluation."""
    import linkjax as lj

    lj.enable_x64()
    machine, asked = (lj.load(scene), FREE[scene]) if scene in FREE else lj.load_problem(scene)
    begin, steps = time.perf_counter(), []

    class Stepped(Exception):
        pass

    def stepped(_: Any) -> None:
        steps.append(time.perf_counter() - begin)
        raise Stepped

    with contextlib.suppress(Stepped):
        lj.optimise(machine, **{**asked, "trade_off": None, "starts": 1}, callback=stepped)
    return {"first step": steps[0]}


def gradient_of_peak(scene: str) -> dict[str, float]:
    """The gradient of the largest joint force by every scene parameter."""
    import jax

    import linkjax as lj

    lj.enable_x64()
    machine, lap = lj.load(scene), clock()
    jax.block_until_ready(jax.grad(lj.measures.peak_reaction)(machine))
    found = {"first": lap(), "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6}
    jax.block_until_ready(jax.grad(lj.measures.peak_reaction)(machine))
    return found | {"again": lap()}


def map_over_designs(scene: str) -> dict[str, float]:
    """Compiling, and running for a block, a map over designs: four measures; and their Jacobian by five lengths."""
    import jax
    import jax.numpy as jnp

    import linkjax as lj

    lj.enable_x64()
    machine = lj.load(scene)
    asked = [
        lj.measures.delta,
        lj.measures.peak_shaking_force_constant_speed,
        lj.measures.min_transmission_angle,
        lj.measures.peak_drive_torque_constant_speed,
    ]

    def four(numbers: Any) -> Any:
        links = dict(machine.mechanism.links)
        for name, length in zip(LENGTHS, numbers, strict=False):
            links[name] = dataclasses.replace(links[name], length=length)
        fixed = dict(machine.mechanism.fixed)
        fixed["F"] = dataclasses.replace(fixed["F"], y=numbers[4])
        design = dataclasses.replace(machine.mechanism, links=links, fixed=fixed)
        return jnp.stack(list(lj.measures.evaluate(machine.with_mechanism(design), asked).values()))

    start = [machine.mechanism.links[name].length for name in LENGTHS] + [machine.mechanism.fixed["F"].y]
    numbers = jnp.stack([jnp.stack(start)] * 100)
    lap, found = clock(), {}
    for name, function in (("four measures", four), ("their Jacobian", jax.jacfwd(four))):
        mapped = lj.map_designs(function)
        lap()
        jax.block_until_ready(mapped(numbers))
        found[name] = lap()
        jax.block_until_ready(mapped(numbers))
        found[name] -= lap()
    return found


def command(*arguments: str) -> dict[str, float]:
    """A command twice, with an empty and then with a filled folder of kept programs, and `import jax` beside it."""
    found: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in ("first", "again"):
            begin = time.perf_counter()
            run([sys.executable, "-m", "linkjax", *arguments, "--quiet", "--out", f"{folder}/out-{name}"], folder)
            found[name] = time.perf_counter() - begin
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        run([sys.executable, "-c", "import jax"], None)
        times.append(time.perf_counter() - begin)
    found["python -c 'import jax'"] = sorted(times)[1]
    return found | {"again/import": found["again"] / sorted(times)[1]}


def run(arguments: list[str], folder: str | None) -> str:
    """What a command prints, with programs kept in a folder, or nowhere."""
    variables = {name: value for name, value in os.environ.items() if name != "JAX_COMPILATION_CACHE_DIR"}
    variables |= {"LINKJAX_CACHE": "off"} if folder is None else {"XDG_CACHE_HOME": folder}
    return subprocess.run(arguments, capture_output=True, text=True, check=True, env=variables).stdout


HERE = {
    function.__name__: function
    for function in (first_analysis, demo_problem, unseen, gradient_of_peak, map_over_designs)
}


def apart(name: str, scene: str, folder: str | None = None) -> dict[str, float]:
    """A figure in a process of its own."""
    return json.loads(run([sys.executable, __file__, "--here", name, scene], folder).splitlines()[-1])


def kept_problem() -> dict[str, float]:
    """The demo's problem in a process that finds its programs kept."""
    with tempfile.TemporaryDirectory() as folder:
        apart("demo_problem", "hay-press", folder)
        return apart("demo_problem", "hay-press", folder)


ROWS: dict[str, Callable[[], dict[str, dict[str, float]]]] = {
    "analyse": lambda: {scene: apart("first_analysis", scene) for scene in SCENES},
    "kept": lambda: {scene: command("analyse", scene) for scene in SCENES},
    "optimise": lambda: {"hay-press": command("optimise", "hay-press")},
    "problem": lambda: {"hay-press": kept_problem()},
    "unseen": lambda: {scene: apart("unseen", scene) for scene in ("four-bar", "hay-press")},
    "gradient": lambda: {"kozhevnikov-press": apart("gradient_of_peak", "kozhevnikov-press")},
    "designs": lambda: {"hay-press": apart("map_over_designs", "hay-press")},
}


def main() -> None:
    """One line for each figure; seconds, except where it is a count, a ratio, or memory (GB)."""
    if sys.argv[1:2] == ["--here"]:
        print(json.dumps(HERE[sys.argv[2]](sys.argv[3])))
        return
    for row in sys.argv[1:] or ROWS:
        for scene, found in ROWS[row]().items():
            figures = ", ".join(f"{name} {value:.4g}" for name, value in found.items())
            print(f"{row:9} {scene:18} {figures}", flush=True)


if __name__ == "__main__":
    main()
