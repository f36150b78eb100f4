"""Time until the first answer: what is traced and compiled before a new machine runs, with `import jax` beside it.

Run: python -m benchmarks.start [SCENE ...]      (default: slider-crank, hay-press, kozhevnikov-press, scissor-lift)

Every scene in a process of its own, with no kept program: seconds of `import jax`, of the first `lj.analyse`, and of
a second one; the first one over `import jax`; how many programs the analysis asks for, and their equations: all
equations of the jaxprs, those of every inner jaxpr once.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from typing import Any

SCENES = ("slider-crank", "hay-press", "kozhevnikov-press", "scissor-lift")


def equations(jaxpr: Any) -> int:
    """The equations of a jaxpr and of every jaxpr in it, each once where it is written."""
    import jax

    found = len(jaxpr.eqns)
    for equation in jaxpr.eqns:
        for inner in jax.tree.leaves(list(equation.params.values()), is_leaf=lambda x: hasattr(x, "eqns")):
            found += equations(inner) if hasattr(inner, "eqns") else 0
    return found


def first(scene: str) -> dict[str, float]:
    """Seconds of import, first and second analysis, and what was traced, in this process."""
    begin = time.perf_counter()
    import jax

    imported = time.perf_counter() - begin
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
    for _ in range(2):
        begin = time.perf_counter()
        jax.block_until_ready(jax.tree.leaves(lj.analyse(machine, throw=False)))
        times.append(time.perf_counter() - begin)
    return {
        "import": imported,
        "first": times[0],
        "second": times[1],
        "programs": len(traced),
        "equations": sum(traced),
    }


def apart(scene: str) -> dict[str, float]:
    """`first` in a process of its own that keeps nothing."""
    variables = {name: value for name, value in os.environ.items() if name != "JAX_COMPILATION_CACHE_DIR"}
    variables["LINKJAX_CACHE"] = "off"
    command = [sys.executable, __file__, "--here", scene]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=variables)
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    """One line for each scene."""
    if sys.argv[1:2] == ["--here"]:
        print(json.dumps(first(sys.argv[2])))
        return
    print(f"{'':18}{'import jax':>11}{'first':>9}{'second':>10}{'first/import':>14}{'programs':>10}{'equations':>11}")
    for scene in sys.argv[1:] or SCENES:
        found = apart(scene)
        print(f"{scene:18}{found['import']:9.2f} s{found['first']:7.1f} s{1e3 * found['second']:7.0f} ms"
              f"{found['first'] / found['import']:14.0f}{found['programs']:10.0f}{found['equations']:11.0f}",
              flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
