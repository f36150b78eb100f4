"""Speed compared with peers, one line per result: `name value unit`.

Run: python -m benchmarks.throughput [ROW ...]      rows: kinematics cycle one gradient (default: all)

Every result is printed with its baseline from the same run. Ratios are medians of paired rounds, with quartiles: they
are the speed-up of linkjax over the peer (for `gradient`: its time over that of the value).
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")
os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # else idle threads of one program occupy the cores of the other

import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from benchmarks import press
from benchmarks._timing import by_turns, line, ratio
from linkjax._config import use_compilation_cache
from linkjax.measures import delta, evaluate, peak_shaking_force_constant_speed

BLOCKS = {"kinematics": 50, "cycle": 50, "gradient": 25}
REFERENCE = 0.0903376816582  # δ of hay-press-slider


def kinematics() -> None:
    """Kinematics, reduction and mass sums of many designs, the same eight outputs as with numba."""
    from benchmarks.baselines import kinematics_numba as peer

    for count in (1000, 10_000):
        numbers, out = press.designs(count), np.empty((count, press.NODES, 8))
        ours, mine = lj.map_designs(press.eight, block=BLOCKS["kinematics"]), jnp.asarray(numbers)
        peer.sweep(numbers, press.NODES, out)
        differences = [
            float(np.max(np.abs(np.asarray(part) - out[:, :, i])) / np.max(np.abs(out[:, :, i])))
            for i, part in enumerate(ours(mine))
        ]
        a, b = by_turns(lambda ours=ours, mine=mine: ours(mine), lambda n=numbers, o=out: peer.sweep(n, press.NODES, o))
        rate = count * press.NODES / 1e6
        line(f"kinematics.{count}.linkjax", rate / np.median(a), "M_positions/s")
        line(f"kinematics.{count}.numba", rate / np.median(b), "M_positions/s")
        line(f"kinematics.{count}.largest_difference", max(differences), "relative")
        ratio(f"kinematics.{count}.times_numba", b / a)


def whole_cycle(design: jax.Array) -> dict[str, jax.Array]:
    """δ and peak shaking force of one design, 64 nodes."""
    return evaluate(press.scene_of(design), [delta, peak_shaking_force_constant_speed], press.NODES)


def cycle() -> None:
    """A whole cycle compared with numba for the kinematics alone, at the same number of positions."""
    from benchmarks.baselines import kinematics_numba as peer

    count = 10_000
    numbers, out = press.designs(count), np.empty((count, press.NODES, 8))
    ours, mine = lj.map_designs(whole_cycle, block=BLOCKS["cycle"]), jnp.asarray(numbers)
    a, b = by_turns(lambda: ours(mine), lambda: peer.sweep(numbers, press.NODES, out))
    line("cycle.linkjax", count / np.median(a), "designs/s")
    line("cycle.numba_bare_kinematics", count / np.median(b), "designs/s")
    ratio("cycle.times_numba_bare_kinematics", b / a)


def one() -> None:
    """One design, and a batch, compared with the integrators of SciPy at equal or smaller error of δ."""
    from benchmarks.baselines.steady_scipy import shooting

    errors = {name: abs(shooting(name) / REFERENCE - 1) for name in ("LSODA", "DOP853")}
    scene = lj.load("hay-press-slider")

    def program(nodes):
        return jax.jit(lambda scene: delta(scene, nodes))

    wrong = {nodes: abs(float(program(nodes)(scene)) / REFERENCE - 1) for nodes in (48, 64, 72, 80, 96)}
    nodes, error = next((n, e) for n, e in wrong.items() if e <= min(errors.values()))
    ours = program(nodes)
    count = 10_000
    many = lj.map_designs(lambda design: delta(press.scene_of(design), nodes), block=BLOCKS["cycle"])
    mine = jnp.asarray(press.designs(count))
    times = by_turns(lambda: shooting("LSODA"), lambda: shooting("DOP853"), lambda: ours(scene), lambda: many(mine))
    lsoda, dop853, single, batch = times
    line("one_design.nodes", nodes, "nodes")
    line("one_design.linkjax", 1e3 * np.median(single), "ms")
    line("one_design.linkjax.error", error, "relative")
    for name, taken in (("LSODA", lsoda), ("DOP853", dop853)):
        line(f"one_design.{name}", 1e3 * np.median(taken), "ms")
        line(f"one_design.{name}.error", errors[name], "relative")
    better = np.minimum(lsoda, dop853)
    ratio("one_design.times_scipy", better / single)
    line("batch.linkjax", 1e6 * np.median(batch) / count, "us/design")
    ratio("batch.times_scipy", better / (batch / count))


def gradient() -> None:
    """Gradient of the cycle with respect to all numbers of the design, and its value, each in its best blocks."""
    mine = jnp.asarray(press.designs(4000))
    value = lj.map_designs(whole_cycle, block=BLOCKS["cycle"])

    def scaled(design):
        found = whole_cycle(design)
        return found["delta"] + 1e-4 * found["peak_shaking_force_constant_speed"]

    slope = lj.map_designs(jax.grad(scaled), block=BLOCKS["gradient"])
    a, b = by_turns(lambda: slope(mine), lambda: value(mine))
    line("gradient.gradient", 1e6 * np.median(a) / len(mine), "us/design")
    line("gradient.value", 1e6 * np.median(b) / len(mine), "us/design")
    ratio("gradient.times_value", a / b)


ROWS = {row.__name__: row for row in (kinematics, cycle, one, gradient)}


def main(names: list[str]) -> None:
    """Run the selected rows."""
    lj.use_cpu_devices()
    use_compilation_cache()
    line("devices", len(jax.devices()), jax.devices()[0].device_kind.replace(" ", "_"))
    for name in names or ROWS:
        ROWS[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
