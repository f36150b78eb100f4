"""Wall time of a steady-state motion with a motor over the error of ω(φ): collocation, and diffrax with shooting.

Run: python -m benchmarks.driven [SCENE ...] [--designs COUNT] [--plot docs/images/driven_speed_error.png]
     python -m benchmarks.driven [SCENE ...] --blocks COUNT ...     collocation alone, in one block: for a GPU

Each method gives the crank speed at 64 angles and the mean speed, in one compiled program; collocation gives δ, too.
Diffrax is not charged for the angles at which loads switch. The reference is diffrax at 1e-13, whose steps end at all
these angles; the error is the greatest one of the 64 speeds, relative. Ratios are those of paired rounds. For one
design they are at equal error: the time of diffrax is interpolated between its tolerances, or that of its least error
where collocation is more accurate. For many designs (collocation by `map_designs`, diffrax by single runs and by
`map_designs`) each method has its first setting with an error of at most 1e-9 on the original scene, so that the errors
differ.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from benchmarks._timing import by_turns, line, ratio
from benchmarks.baselines.steady_diffrax import breaks_of, shooting
from linkjax._config import use_compilation_cache
from linkjax.motion import steady_motion

NODES = (48, 96, 144)
TOLERANCES = tuple(10.0**-k for k in (6, 8, 10, 12))
SOLVERS = {"Dopri8": diffrax.Dopri8, "Tsit5": diffrax.Tsit5}
ANGLES, FINE, WANTED = 64, 256, 1e-9
BLOCK, ROUNDS = 10, 5


def pump(motor: lj.MotorDrive) -> lj.Scene:
    """A slider-crank with a pump that resists in proportion to the speed of the piston."""
    links = {
        "crank": lj.Link(length=0.1, mass=0.2, inertia=0.2 * 0.1**2 / 12, centre=lj.Vec(0.05, 0.0)),
        "rod": lj.Link(length=0.3, mass=0.2, inertia=0.2 * 0.3**2 / 12, centre=lj.Vec(0.15, 0.0)),
        "slider": lj.Link(mass=0.4),
    }
    groups = [lj.Crank("crank", "A", "B"), lj.RRP("rod", "slider", "B", "D", lj.Guide("A"))]
    machine = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, groups, lj.Flywheel(0.01))
    return lj.Scene(machine, (lj.Drag("pump", "slider", "D", linear=5.0),), speed=25.0, motor=motor)


def pump_line() -> lj.Scene:
    """The pump with a motor whose characteristic is a straight line."""
    return pump(lj.MotorDrive(lj.LineMotor(no_load=40.0, stall=2.0)))


def pump_induction() -> lj.Scene:
    """The pump with an induction motor and a gear."""
    motor = lj.InductionMotor(rated_power=30.0, rated_speed=148.0, synchronous_speed=157.08, breakdown_ratio=2.5)
    return pump(lj.MotorDrive(motor, lj.Transmission(ratio=5.5), inertia=1e-4))


def four_bar() -> lj.Scene:
    """The built-in four-bar with a damper on its rocker and a motor."""
    scene = lj.load("four-bar")
    damper = lj.TorsionDamper("damper", "rocker", coefficient=4.0)
    motor = lj.MotorDrive(lj.LineMotor(no_load=100.0, stall=60.0), lj.Transmission(ratio=10.0), inertia=0.01)
    return dataclasses.replace(scene, loads=(*scene.loads, damper), motor=motor, target_delta=None)


def hay_press() -> lj.Scene:
    """The hay press with a flywheel, and a motor with a belt that loses power and creeps."""
    scene = lj.load("hay-press")
    belt = lj.Transmission(ratio=2.0, efficiency=0.96, creep=0.01)
    motor = lj.MotorDrive(lj.LineMotor(no_load=180.0, stall=4000.0), belt, inertia=0.5)
    mechanism = dataclasses.replace(scene.mechanism, flywheel=lj.Flywheel(12.0))
    return dataclasses.replace(scene, mechanism=mechanism, motor=motor, target_delta=None)


SCENES = {"pump-line": pump_line, "pump-induction": pump_induction, "four-bar": four_bar, "hay-press": hay_press}


class Point(NamedTuple):
    """One method with one setting: wall time of one motion (s) and the error of its speeds."""

    way: str
    setting: str
    seconds: float
    error: float


class Case(NamedTuple):
    """A scene, the angles (rad), and what diffrax is given: the grid of its loads and the angles where they switch."""

    scene: lj.Scene
    angles: jax.Array
    given: tuple[Any, jax.Array]


def case_of(scene: lj.Scene) -> Case:
    """A scene with what the methods are given."""
    grid, breaks = breaks_of(scene, 8)
    low = float(grid.edges[0])
    angles = low + (np.arange(ANGLES) + 0.37) * (scene.cycle / ANGLES)
    return Case(scene, jnp.asarray(angles), (grid, jnp.asarray(breaks)))


def ours(case: Case, nodes: int) -> Callable[[lj.Scene], tuple[jax.Array, ...]]:
    """δ, mean speed, the speeds at the angles and the times there, of a scene by collocation."""

    def of(scene):
        found = steady_motion(scene, nodes)
        places = jax.vmap(found.grid.place)(case.angles)
        speeds = jax.vmap(lambda place: found.at(scene, place)[0])(places)
        return found.delta, found.mean_speed, speeds, found.clock.at(places)

    return of


def peer(case: Case, solver: str) -> Callable[..., tuple[jax.Array, ...]]:
    """Mean speed and the speeds at the angles, of a scene and a tolerance by diffrax."""

    def of(scene, tolerance):
        lap = shooting(scene, *case.given, case.angles, tolerance, SOLVERS[solver]())
        return lap.mean, lap.speeds

    return of


def reference(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """The speeds (rad/s) and times (s) by diffrax at 1e-13, with steps that end at all angles and switches."""
    grid, breaks = breaks_of(case.scene, FINE)
    ends = jnp.sort(jnp.concatenate([jnp.asarray(breaks), case.angles]))
    run = jax.jit(lambda scene: shooting(scene, grid, ends, case.angles, jnp.asarray(1e-13)))
    lap = run(case.scene)
    return np.asarray(lap.speeds), np.asarray(lap.times)


def error(speeds: Any, truth: np.ndarray) -> float:
    """The greatest error of the speeds, relative to the greatest speed."""
    return float(np.max(np.abs(np.asarray(speeds) - truth)) / np.max(np.abs(truth)))


def late(case: Case, nodes: int, truth: np.ndarray) -> float:
    """The greatest error of the times between the angles, relative to the period."""
    _, mean, _, found = jax.jit(ours(case, nodes))(case.scene)
    times = np.asarray(found) - truth
    return float(np.max(np.abs(times - times[0])) * mean / case.scene.cycle)


def measured(case: Case, truth: np.ndarray) -> tuple[list[Point], dict[str, np.ndarray]]:
    """All methods and settings of one design in alternating rounds; and the times of every round."""
    runs, found, names = [], [], []
    for nodes in NODES:
        program = jax.jit(ours(case, nodes))
        runs.append(lambda program=program: program(case.scene))
        found.append(error(runs[-1]()[2], truth))
        names.append(("collocation", f"{nodes} nodes"))
    for name in SOLVERS:
        program = jax.jit(peer(case, name))
        for tolerance in TOLERANCES:
            tol = jnp.asarray(tolerance)
            runs.append(lambda program=program, tol=tol: program(case.scene, tol))
            found.append(error(runs[-1]()[1], truth))
            names.append((f"diffrax {name}", f"{tolerance:.0e}"))
    times = by_turns(*runs, rounds=ROUNDS)
    points = [Point(way, to, float(np.median(t)), e) for (way, to), t, e in zip(names, times, found, strict=True)]
    return points, {f"{way} {setting}": t for (way, setting), t in zip(names, times, strict=True)}


def at_error(points: list[Point], times: dict[str, np.ndarray], wanted: float) -> np.ndarray:
    """Times of diffrax in every round (s) at an error, by its faster method: interpolated on logarithmic scales, or at
    the least error reached."""
    every = []
    for way in dict.fromkeys(p.way for p in points if p.way != "collocation"):
        some = sorted((p for p in points if p.way == way), key=lambda p: p.error)
        logs = np.log([max(p.error, 1e-16) for p in some])
        rounds = np.log(np.stack([times[f"{p.way} {p.setting}"] for p in some]))
        every.append(np.exp([np.interp(math.log(wanted), logs, column) for column in rounds.T]))
    return np.min(every, axis=0)


def designs(scene: lj.Scene, count: int) -> lj.Scene:
    """Random designs: masses, flywheel, loads and motor within two per cent, all dimensions and windows as they are,
    as diffrax is given the angles at which loads switch."""
    rng = np.random.default_rng(0)

    def varied(scene):
        masses = [link.mass for link in scene.mechanism.links.values()]
        load = scene.loads[-1]
        sizes = [getattr(load, name) for name in ("magnitude", "linear", "coefficient") if hasattr(load, name)]
        return [*masses, scene.mechanism.flywheel.inertia, *sizes, *jax.tree.leaves(scene.motor)]

    many = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (count, *jnp.shape(leaf))), scene)
    fresh = [jnp.asarray(np.asarray(x) * rng.uniform(0.98, 1.0, count)) for x in varied(scene)]
    return eqx.tree_at(varied, many, fresh)


def many(name: str, case: Case, nodes: int, tolerance: float, count: int) -> None:
    """The same for many designs, each row per design."""
    scenes, tol = designs(case.scene, count), jnp.asarray(tolerance)
    single, tree = jax.jit(peer(case, "Dopri8")), jax.tree.structure(case.scene)
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(scenes)]
    some = [jax.tree.unflatten(tree, [jnp.asarray(leaf[i]) for leaf in leaves]) for i in range(min(count, 50))]
    mine = lj.map_designs(ours(case, nodes), block=BLOCK)
    mapped = lj.map_designs(lambda scene: peer(case, "Dopri8")(scene, tol), block=BLOCK)
    wrong = error(mine(scenes)[2], np.asarray(mapped(scenes)[1]))
    a, b, c = by_turns(
        lambda: mine(scenes), lambda: mapped(scenes), lambda: [single(scene, tol) for scene in some], rounds=ROUNDS
    )
    a, b, c = a / count, b / count, c / len(some)
    line(f"{name}.many.collocation", 1e6 * np.median(a), "us/design")
    line(f"{name}.many.diffrax_mapped", 1e6 * np.median(b), "us/design")
    line(f"{name}.many.diffrax_single", 1e6 * np.median(c), "us/design")
    line(f"{name}.many.difference", wrong, "relative")
    ratio(f"{name}.many.times_diffrax_single", c / a)
    ratio(f"{name}.many.times_diffrax_mapped", b / a)


def alone(name: str, case: Case, count: int) -> None:
    """Collocation of many designs in one block, per design."""
    scenes, mine = designs(case.scene, count), lj.map_designs(ours(case, NODES[1]), block=count)
    assert np.all(np.isfinite(np.asarray(mine(scenes)[2])))
    (times,) = by_turns(lambda: mine(scenes), rounds=ROUNDS)
    line(f"{name}.block_of_{count}.collocation", 1e6 * np.median(times) / count, "us/design")


def plot(found: dict[str, list[Point]], file: Path) -> None:
    """Time over error, one panel for each scene."""
    from matplotlib.figure import Figure

    rows = math.ceil(len(found) / 2)
    figure = Figure(figsize=(9.0, 3.2 * rows), layout="constrained")
    colours = ("#0072B2", "#009E73", "#E69F00")
    places = figure.subplots(rows, 2, squeeze=False).ravel()
    for axes in places[len(found) :]:
        axes.remove()
    for axes, (name, points) in zip(places, found.items(), strict=False):
        for way, colour, marker in zip(dict.fromkeys(p.way for p in points), colours, "osD", strict=False):
            some = [p for p in points if p.way == way]
            axes.loglog(
                [max(p.error, 1e-16) for p in some], [1e3 * p.seconds for p in some], f"{marker}-", color=colour,
                label=way, markersize=4,
            )  # fmt: skip
        axes.set_title(name, fontsize="medium")
        axes.invert_xaxis()
        axes.grid(which="major", color="0.9")
        axes.legend(frameon=False, fontsize="small")
    figure.supxlabel("relative error of ω(φ)")
    figure.supylabel("wall time (ms)")
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=100)


def main() -> None:
    """Measure, print, and plot on request."""
    parser = argparse.ArgumentParser(description="Steady-state motion with a motor: wall time over error.")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=", ".join(SCENES))
    parser.add_argument("--designs", type=int, default=1000)
    parser.add_argument("--blocks", type=int, nargs="*", default=[])
    parser.add_argument("--plot", type=Path)
    asked = parser.parse_args()
    lj.use_cpu_devices()
    lj.enable_x64()
    use_compilation_cache()
    every = {}
    for name in asked.scenes or SCENES:
        case = case_of(SCENES[name]())
        for count in asked.blocks:
            alone(name, case, count)
        if asked.blocks:
            continue
        truth, times_there = reference(case)
        every[name], times = measured(case, truth)
        for p in every[name]:
            print(f"{name:16s} {p.way:16s} {p.setting:>10s} {1e3 * p.seconds:10.3f} ms {p.error:11.1e}", flush=True)
        if asked.plot:
            plot(every, asked.plot)
        good = [(nodes, p) for nodes, p in zip(NODES, every[name], strict=False) if p.error <= WANTED]
        nodes, best = good[0] if good else (NODES[-1], every[name][len(NODES) - 1])
        line(f"{name}.one.nodes", nodes, "nodes")
        line(f"{name}.one.error", best.error, "relative")
        line(f"{name}.one.error_of_times", late(case, nodes, times_there), "of_the_period")
        ratio(
            f"{name}.one.times_diffrax", at_error(every[name], times, best.error) / times[f"collocation {nodes} nodes"]
        )
        if asked.designs:
            peers = [(t, p) for t, p in zip(TOLERANCES, every[name][len(NODES) :], strict=False) if p.error <= WANTED]
            many(name, case, nodes, peers[0][0] if peers else TOLERANCES[-1], asked.designs)


if __name__ == "__main__":
    main()
