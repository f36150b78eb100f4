"""The stated error of δ over the true error, of random scenes of every model of motion.

Run: python -m benchmarks.error_bound [MODEL ...] [--designs COUNT]      default: 50 designs of each model

True errors come from `TRUTH` nodes, with friction from `FINE`, and count as 1e-11 where they are smaller. A design
counts if a steady-state motion exists and the truth is better known than both errors. One line per model and number of
nodes: designs, designs whose stated error is below the true one, the share within a thousand times, and the decades of
stated over true error at the 0, 50, 95 and 100 % quantiles; and the largest true error of all designs with a motion.
One compiled program per model and number of nodes; about ten seconds each, with friction half a minute.
"""

from __future__ import annotations

import argparse
import math
import zlib
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import linkjax as lj
from benchmarks._timing import line
from linkjax._compile import compiled_soon, keep_in
from linkjax.friction import GuideFriction, everywhere
from linkjax.motion import steady_motion

NODES, TRUTH, LEAST, FAR = (32, 64), 192, 1e-11, 1e3
RUBBED, FINE = (96, 400), 1500  # with friction, whose panels have at least eight nodes, whatever is asked for
TORQUE = 2.0  # N m, the unit of random motors


class Model(NamedTuple):
    """A machine from random numbers in [0, 1): its scene, how many numbers it takes, and the numbers of nodes."""

    scene: Callable[[Any], lj.Scene]
    numbers: int
    nodes: tuple[int, ...] = NODES
    truth: int = TRUTH


def between(low: float, high: float, u: Any) -> Any:
    """A number between two positive ones, uniform on a logarithmic scale."""
    return jnp.exp(math.log(low) + (math.log(high) - math.log(low)) * u)


def crank_slider(u: Any, loads: tuple, motor: lj.MotorDrive | None = None, **given: Any) -> lj.Scene:
    """A slider-crank with random rod, offset, masses and flywheel, from five numbers."""
    links = {
        "crank": lj.Link(length=0.1, mass=0.2, inertia=2e-4, centre=lj.Vec(0.05, 0.0)),
        "rod": lj.Link(length=between(0.17, 0.5, u[0]), mass=between(0.1, 1.0, u[1]), inertia=2e-3),
        "slider": lj.Link(mass=between(0.1, 2.0, u[2])),
    }
    guide = lj.Guide("A", offset=0.05 * u[3])
    groups = [lj.Crank("crank", "A", "B"), lj.RRP("rod", "slider", "B", "D", guide)]
    flywheel = lj.Flywheel(between(5e-3, 1.0, u[4]))
    machine = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, groups, flywheel)
    return lj.Scene(machine, loads, **{"speed": 25.0, **given}, motor=motor)


def drag(u: Any) -> lj.Drag:
    """A pump that resists in proportion to the speed of the slider."""
    return lj.Drag("pump", "slider", "D", linear=between(0.3, 8.0, u))


def thrown(u: Any) -> lj.OpposingForce:
    """A force against the slider within a window."""
    return lj.OpposingForce("cut", "slider", "D", magnitude=between(1.0, 20.0, u), window=lj.Window(1.0, 4.5))


def gear(u: Any) -> lj.Transmission:
    """A gear without losses."""
    return lj.Transmission(ratio=between(2.0, 8.0, u))


def line_motor(u: Any, speed: float = 40.0) -> lj.LineMotor:
    """A straight characteristic, from soft to stiff."""
    return lj.LineMotor(no_load=speed, stall=TORQUE * between(1.0, 40.0, u))


def table_motor(u: Any) -> lj.TableMotor:
    """A characteristic with a saddle."""
    top = TORQUE * between(1.0, 10.0, u)
    return lj.TableMotor(speeds=(0.0, 10.0, 30.0, 40.0), torques=(top, 0.6 * top, 1.5 * top, 0.0))


def dc_motor(u: Any, v: Any) -> lj.DCMotor:
    """A DC motor for 40 rad/s without load."""
    constant = between(0.3, 1.0, u)
    return lj.DCMotor(voltage=40.0 * constant, resistance=constant**2 * between(0.3, 20.0, v), constant=constant)


def plate(u: Any, v: Any, **given: Any) -> lj.InductionMotor:
    """An induction motor by its type plate."""
    rated = 157.08 * (1 - between(0.02, 0.08, u))
    return lj.InductionMotor(between(40.0, 400.0, v), rated, 157.08, 2.6, **given)


def circuit(u: Any) -> lj.InductionCircuit:
    """An induction motor by its circuit."""
    rotor = between(5.0, 30.0, u)
    return lj.InductionCircuit(230.0, 50.0, 2, 12.0, rotor, 250.0, 15.0, 15.0)


def four_bar(u: Any, motor: lj.MotorDrive | None) -> lj.Scene:
    """The built-in four-bar with random masses and flywheel and a damper on its rocker."""
    scene = lj.load("four-bar")
    damper = lj.TorsionDamper("damper", "rocker", coefficient=between(0.5, 8.0, u[0]))
    flywheel = lj.Flywheel(between(0.5, 5.0, u[1]))
    machine = scene.mechanism
    machine = lj.Mechanism(machine.fixed, machine.links, machine.groups, flywheel)
    return lj.Scene(machine, (*scene.loads, damper), speed=scene.speed, gravity=scene.gravity, motor=motor)


def rubbed(scene: lj.Scene, u: Any, guide: float | None = None) -> lj.Scene:
    """The scene with friction in all its joints, of random size, from three numbers; the guide has this length (m)."""
    machine = scene.mechanism
    coefficient, radius, sliding = between(0.005, 0.2, u[0]), between(2e-3, 3e-2, u[1]), between(0.005, 0.3, u[2])
    found = everywhere(machine, coefficient, radius, sliding)
    if guide is not None:
        found = (*found[:-1], GuideFriction("slider", sliding, length=guide))
    return lj.Scene(machine, scene.loads, speed=scene.speed, gravity=scene.gravity, mean=scene.mean,
                    motor=scene.motor, friction=found)  # fmt: skip


MODELS = {
    "quadrature": Model(lambda u: crank_slider(u, (thrown(u[5]),)), 6),
    "quadrature midrange": Model(lambda u: crank_slider(u, (thrown(u[5]),), mean="midrange"), 6),
    "constant torque, pump": Model(lambda u: crank_slider(u, (drag(u[5]),)), 6),
    "constant torque, pump, midrange": Model(lambda u: crank_slider(u, (drag(u[5]),), mean="midrange"), 6),
    "line motor, pump": Model(lambda u: crank_slider(u, (drag(u[5]),), lj.MotorDrive(line_motor(u[6]))), 7),
    "line motor, cut": Model(
        lambda u: crank_slider(u, (thrown(u[5]),), lj.MotorDrive(line_motor(u[6], 120.0), gear(u[7]))), 8
    ),
    "table motor, pump": Model(lambda u: crank_slider(u, (drag(u[5]),), lj.MotorDrive(table_motor(u[6]))), 7),
    "DC motor, fan": Model(
        lambda u: crank_slider(
            u, (lj.DragTorque("fan", "crank", quadratic=between(1e-4, 2e-3, u[5])),),
            lj.MotorDrive(dc_motor(u[6], u[7]), inertia=between(1e-4, 1e-2, u[8])),
        ), 9,
    ),
    "induction motor, pump": Model(
        lambda u: crank_slider(u, (drag(u[5]),), lj.MotorDrive(plate(u[6], u[7]), lj.Transmission(ratio=5.5))), 8
    ),
    "induction circuit, cut": Model(
        lambda u: crank_slider(u, (thrown(u[5]),), lj.MotorDrive(circuit(u[6]), lj.Transmission(ratio=5.5))), 7
    ),
    "line motor, lossy gear, pump": Model(
        lambda u: crank_slider(
            u, (drag(u[5]),),
            lj.MotorDrive(
                line_motor(u[6], 120.0), lj.Transmission(3.0, 0.6 + 0.38 * u[7], 0.6 + 0.3 * u[7]),
                inertia=between(1e-4, 3e-3, u[8]),
            ),
        ), 9,
    ),
    "four-bar, damper, line motor": Model(
        lambda u: four_bar(u, lj.MotorDrive(lj.LineMotor(no_load=12.0, stall=between(150.0, 3e3, u[2])))), 3
    ),
    "friction, cut": Model(lambda u: rubbed(crank_slider(u, (thrown(u[5]),)), u[6:]), 9, RUBBED, FINE),
    "friction, cut, midrange": Model(
        lambda u: rubbed(crank_slider(u, (thrown(u[5]),), mean="midrange"), u[6:]), 9, RUBBED, FINE
    ),
    "friction, line motor, pump": Model(
        lambda u: rubbed(crank_slider(u, (drag(u[5]),), lj.MotorDrive(line_motor(u[6]))), u[7:]), 10, RUBBED, FINE
    ),
    "friction, guide with edges, pump": Model(
        lambda u: rubbed(crank_slider(u, (drag(u[5]),)), u[6:], 0.05), 9, RUBBED, FINE
    ),
    "friction, four-bar, line motor": Model(
        lambda u: rubbed(
            four_bar(u, lj.MotorDrive(lj.LineMotor(no_load=12.0, stall=between(150.0, 3e3, u[2])))), u[3:]
        ), 6, RUBBED, FINE,
    ),
}  # fmt: skip


def found_by(model: Model, nodes: int) -> Callable[[jax.Array], tuple[jax.Array, ...]]:
    """δ, its stated error, and whether a steady-state motion exists, of many designs."""

    def one(numbers):
        motion = steady_motion(model.scene(numbers), nodes)
        runs = (motion.steady_state_margin > 0) & ~motion.grid.overflow
        return motion.delta, motion.delta_error, runs

    return compiled_soon(lambda numbers: jax.lax.map(one, numbers, batch_size=10))


def measured(name: str, count: int) -> list[np.ndarray]:
    """Stated over true errors of the designs of a model, for every number of nodes."""
    model, rng = MODELS[name], np.random.default_rng(zlib.crc32(name.encode()))
    numbers = jnp.asarray(rng.random((count, model.numbers)))
    truth, surely, runs = (np.asarray(part) for part in found_by(model, model.truth)(numbers))
    ratios = []
    for nodes in model.nodes:
        value, stated, there = (np.asarray(part) for part in found_by(model, nodes)(numbers))
        wrong = np.maximum(np.abs(value - truth), LEAST)
        known = runs & there & (surely < np.maximum(3 * LEAST, 0.1 * np.maximum(wrong, stated)))
        found = (stated / wrong)[known]
        ratios.append(found)
        decades = np.log10(np.quantile(found, [0, 0.5, 0.95, 1])) if found.size else np.full(4, np.nan)
        shown = " ".join(f"{d:5.2f}" for d in decades)
        below, near = int(np.sum(found < 1)), np.mean(found <= FAR) if found.size else math.nan
        every = wrong[runs & there]
        print(f"{name:32s} {nodes:4d} nodes {found.size:4d} of {count} below {below:3d} "
              f"within 1000 {near:5.3f} decades {shown} largest error of {every.size} {np.max(every, initial=0.0):.1e}",
              flush=True)  # fmt: skip
    return ratios


def main() -> None:
    """Every model, then all together."""
    parser = argparse.ArgumentParser(description="Stated error of δ over the true one.")
    parser.add_argument("models", nargs="*", metavar="MODEL", help="; ".join(MODELS))
    parser.add_argument("--designs", type=int, default=50)
    asked = parser.parse_args()
    lj.enable_x64()
    keep_in(None)  # programs of functions made here have no name of their own
    every = np.concatenate([part for name in asked.models or MODELS for part in measured(name, asked.designs)])
    line("error_bound.cases", every.size, "designs_times_nodes")
    line("error_bound.below", int(np.sum(every < 1)), "cases")
    line("error_bound.within_1000", float(np.mean(every <= FAR)), "share")
    line("error_bound.largest", float(np.log10(np.max(every))), "decades")


if __name__ == "__main__":
    main()
