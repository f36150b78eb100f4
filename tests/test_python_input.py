"""Errors in a machine written in Python are reported in one line. In a separate process, because the type checks of
the tests would find them first."""

import subprocess
import sys

PROGRAM = """
import dataclasses
import equinox as eqx
import jax.numpy as jnp
import linkjax as lj
from linkjax import Force, Link, OpposingForce, Scene, Torque, Vec, Window
lj.enable_x64()
def with_(mechanism, where, value):
    return dataclasses.replace(eqx.tree_at(where, mechanism, jnp.asarray(value)))
mechanism, at = lj.load("four-bar").mechanism, ("work", "rocker", "C")
for wrong in (
    lambda: Link(length="300 mm"),
    lambda: Window("10 deg", 1.0),
    lambda: Force(*at, force=(0.0, 1.0)),
    lambda: Force(*at, force=Vec(0.0, float("nan"))),
    lambda: Torque("work", "rocker", torque=float("nan")),
    lambda: OpposingForce(*at, magnitude=-1.0),
    lambda: OpposingForce(*at, magnitude=Vec(1.0, 0.0)),
    lambda: Scene(mechanism, Torque("work", "rocker", torque=1.0)),
    lambda: Scene(mechanism, (Torque("work", "rocker", torque=1.0, window=Window(1.0, 1.0)),)),
    lambda: lj.Crank("crank", "A", "B", rotation="left"),
    lambda: Scene("four-bar"),
    lambda: lj.analyse(mechanism),
    lambda: lj.optimise(mechanism, {}, "delta"),
    lambda: lj.crank_ranges(Scene(mechanism)),
    lambda: lj.margins(Scene(mechanism), 0.0),
    lambda: lj.pose(Scene(mechanism), 0.0),
    lambda: lj.dead_centres(Scene(mechanism)),
    lambda: lj.kinematics.min_margin(Scene(mechanism)),
    lambda: lj.pose("four-bar", 0.0),
    lambda: Scene(mechanism, motor=lj.NoMotor()),
    lambda: lj.MotorDrive(24.0),
    lambda: lj.MotorDrive(lj.NoMotor(), 5.0),
    lambda: with_(mechanism, lambda m: m.links["coupler"].mass, float("nan")),
    lambda: with_(mechanism, lambda m: m.fixed["A"].x, float("inf")),
    lambda: Scene(mechanism, gravity=Vec(0.0, float("nan"))),
    lambda: Scene(mechanism, (Torque("work", "rocker", torque=1.0, window=Window(float("nan"), 1.0)),)),
    lambda: Scene(mechanism, (Torque("work", "rocker", torque=1.0, window=Window(180.0, 360.0)),)),
    lambda: lj.Counterweight(mass=-1.0),
    lambda: lj.RRR(("coupler",), "B", "D", "C"),
    lambda: lj.LinearDriver("crank", "B", "A", None),
    lambda: lj.structure(Scene(mechanism)),
    lambda: lj.dead_centres(mechanism, 0),
    lambda: lj.crank_ranges(mechanism, 0),
    lambda: lj.flywheel_for(Scene(mechanism), -0.1),
):
    try:
        wrong()
    except (TypeError, ValueError) as error:
        print(f"{type(error).__name__}: {error}")
"""
TOLD = """
TypeError: '300 mm' where a number is needed; write it in SI units, e.g. 0.3 for 300 mm
TypeError: '10 deg' where a number is needed; write it in SI units, e.g. 0.3 for 300 mm
TypeError: force of load 'work' must be a Vec, but is (0.0, 1.0); write Vec(x, y), in N
ValueError: force.y of load 'work' is nan; write a finite number
ValueError: torque of load 'work' is nan; write a finite number
ValueError: magnitude of load 'work' must not be negative, but is -1.0; write zero or more; use Force or \
Torque for a load that drives
TypeError: Vec(x=f64[], y=f64[]) where a number is needed; write it in SI units, e.g. 0.3 for 300 mm
StructureError: loads: are Torque; write a tuple of loads, (load,) for a single one
StructureError: loads[0] (work): window start and end coincide; omit `window` for a permanent load, or delete a load \
that never acts
ValueError: rotation of a crank must be "ccw" (counter-clockwise) or "cw", but is 'left'
StructureError: mechanism: is str; write a Mechanism, e.g. from lj.library
TypeError: a Scene is needed, not Mechanism; write Scene(mechanism, loads, speed=...)
TypeError: a Scene is needed, not Mechanism; write Scene(mechanism, loads, speed=...)
TypeError: a Mechanism is needed, not Scene; write scene.mechanism
TypeError: a Mechanism is needed, not Scene; write scene.mechanism
TypeError: a Mechanism is needed, not Scene; write scene.mechanism
TypeError: a Mechanism is needed, not Scene; write scene.mechanism
TypeError: a Mechanism is needed, not Scene; write scene.mechanism
TypeError: a Mechanism is needed, not str; write a Mechanism, e.g. from lj.library
StructureError: motor: is NoMotor; write a MotorDrive, e.g. MotorDrive(DCMotor(24.0, 0.5, 0.1))
TypeError: motor of a MotorDrive is 24.0; write e.g. DCMotor(24.0, 0.5, 0.1)
TypeError: transmission of a MotorDrive is 5.0; write e.g. Transmission(ratio=5.0, efficiency=0.95)
StructureError: links.coupler.mass: is nan; write a finite number
StructureError: fixed.A.x: is inf; write a finite number
StructureError: gravity.y: is nan; write a finite number
StructureError: loads[0].window.on: is nan; write a finite number
StructureError: loads[0] (work): its window is at 360 rad, far outside of the cycle of 6.28319 rad; write radians, \
e.g. math.radians(180)
ValueError: mass of a counterweight must not be negative, but is -1.0; write zero or more
ValueError: an RRR needs two links, but has ('coupler',)
TypeError: the linear driver 'crank' needs a motion law; write a Harmonic, a Spline or Moves
TypeError: a Mechanism is needed, not Scene; of a scene write scene.mechanism
ValueError: cycle_turns is 0; write an integer of 1 or more
ValueError: cycle_turns is 0; write an integer of 1 or more
ValueError: delta is -0.1; write a coefficient of speed fluctuation above zero, e.g. 0.05
"""


def test_every_mistake_is_one_clear_line():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == TOLD.strip().splitlines()
