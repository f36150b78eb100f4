"""A scissor lift: printed forces compared with ours, then the cylinder anchors optimised for the smallest peak force.

Run: python -m studies.scissor_lift.study [OUT]       tables on the screen, two figures in OUT (default: here)
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize

import linkjax as lj
from linkjax.forces import kinetostatics
from linkjax.machine import ready
from linkjax.measures import Parts
from linkjax.motion import Peak, peaks

HERE = Path(__file__).parent
HALF, EYE, LOAD, PAIRS = 1.47, 0.5, 3125.0, 2
LOW, HIGH = math.radians(11.2), math.radians(45.0)
CLOSED = 2 * HALF * math.sin(LOW)  # height of the lowered platform
RATIO = 1.8  # of the maximum to the minimum cylinder length
ALPHA = np.radians([11.2, 15, 20, 25, 30, 35, 40, 45])
PRINTED_BETA = (21.907, 28.554, 36.472, 43.442, 49.541, 54.885, 59.595, 63.785)
PRINTED_FORCE = {11.2: 66530.0, 45.0: 27448.0}  # two pairs
PRINTED_FRAME = {11.2: 66630.71, 45.0: 27459.84}  # the same from a bar model in three dimensions
PRINTED_JOINTS = (3125.0, 3125.0, 0.0, -2209.12, 2210.87)  # R, T, Q, X, Y of one pair, at both of these angles
AS_DRAWN = np.array([EYE, 0.0, 0.0])
BLUE, VERMILION, GREY = "#0072B2", "#D55E00", "#8a8a8a"


class Driven(NamedTuple):
    """The lift driven by its cylinder: angles (rad), cylinder length (m) and force, joint forces of one pair (N)."""

    alpha: jax.Array
    beta: jax.Array
    length: jax.Array
    force: jax.Array  # both pairs
    feet: jax.Array  # R, vertical, at the roller; T, vertical, and Q, horizontal, at fixed foot and cylinder bearing
    hinge: jax.Array  # X, horizontal, and Y, vertical, on the brace
    torque: jax.Array  # drive torque (N m), both pairs


def lift(anchors) -> lj.Scene:
    """Both pairs. The bar angle follows a cosine from lowest to highest and back while the cylinder drives.

    `anchors`: the distance of the eye above the centre hinge on the brace, and the position of the base on the frame.
    """
    eye, x, y = anchors
    mechanism = lj.scissor_lift(2 * HALF, eye, LOW, HIGH, base=lj.Vec(x, y), pairs=PAIRS, by_bar=True)
    down = lj.Vec(0.0, -PAIRS * LOAD)
    loads = tuple(lj.Force(link, link, end, force=down) for link, end in (("bar", "T"), ("other", "U")))
    return lj.Scene(mechanism, loads, speed=0.1)


@jax.jit
def at_phases(scene: lj.Scene, phi) -> Driven:
    """The lift at these phases (rad) of the cosine."""
    made = ready(scene)

    def at(phi):
        return lj.pose(made.mechanism, phi), kinetostatics(made, phi, scene.speed, 0 * phi)

    here, forces = jax.vmap(at)(phi)
    push, foot, bearing, roller, hinge = (
        forces.reactions[joint][link]
        for joint, link in (
            ("rod.drive", "rod"),
            ("O", "bar"),
            ("A", "barrel"),
            ("roller.guide", "roller"),
            ("C", "other"),
        )
    )
    bar, axis = here.links["bar"].u, here.links["barrel"].u
    feet = jnp.stack([roller.fy, foot.fy + bearing.fy, foot.fx + bearing.fx])
    return Driven(
        jnp.arctan2(bar.y, bar.x), jnp.arctan2(axis.y, axis.x),
        jnp.sqrt((here.points["E"].r - here.points["A"].r).squared()), jnp.hypot(push.fx, push.fy),
        feet / PAIRS, jnp.stack([hinge.fx, hinge.fy]) / PAIRS, forces.drive_torque,
    )  # fmt: skip


def driven(alpha: np.ndarray, anchors: Sequence[float] | np.ndarray = AS_DRAWN) -> Driven:
    """Forces at these bar angles."""
    swing = np.arccos(np.clip(1 - 2 * (alpha - LOW) / (HIGH - LOW), -1, 1))
    return jax.device_get(at_phases(lift(anchors), jnp.asarray(swing)))


def work(anchors) -> float:
    """Work of the cylinder (J) while it raises the lift: quadrature with 40 nodes, exact to rounding."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    torque = at_phases(lift(anchors), jnp.asarray(0.5 * math.pi * (1 + nodes))).torque
    return 0.5 * math.pi * float(np.sum(weights * np.asarray(torque)))


@jax.jit
def peak(anchors) -> Peak:
    """Largest force of the cylinder over the continuous stroke, both pairs, with its phase and an error bound."""

    def push(regime, at):
        force = regime.forces(at).reactions["rod.drive"]["rod"]
        return jnp.stack([force.fx, force.fy])[None]

    return jax.tree.map(lambda x: x[0], peaks(Parts(lift(anchors)).constant_speed, push))


def by_bar(eye) -> lj.Scene:
    """One pair driven by its bar: the crank angle is the bar angle, and the cylinder eye is a point of the brace."""
    links = {
        "bar": lj.Link(length=2 * HALF, points={"C": lj.Vec(HALF, 0.0)}),
        "brace": lj.Link(length=HALF, points={"E": lj.Vec(-eye, 0.0), "U": lj.Vec(-HALF, 0.0)}),
        "roller": lj.Link(),
    }
    groups = [lj.Crank("bar", "O", "T"), lj.RRP("brace", "roller", "C", "R", lj.Guide("O"))]
    loads = tuple(lj.Force(link, link, end, force=lj.Vec(0.0, -LOAD)) for link, end in (("bar", "T"), ("brace", "U")))
    return lj.Scene(lj.Mechanism({"O": lj.Vec(0.0, 0.0)}, links, groups), loads, speed=0.1)


def lengths(anchors, alpha):
    """Cylinder length (m), its slope over the bar angle, and the torque that holds the bar (N m), one pair."""
    eye, x, y = anchors
    scene = by_bar(eye)
    at = lj.pose(scene.mechanism, alpha).points["E"]
    off = at.r - lj.Vec(x, y)
    length = jnp.sqrt(off.squared())
    return length, off.dot(at.dr) / length, -lj.reduced_model(scene, alpha).torque


@jax.jit
def course(anchors, alpha):
    """Cylinder length and force of one pair over the bar angle."""
    length, slope, torque = jax.vmap(lengths, (None, 0))(anchors, alpha)
    return length, torque / slope


def best(points: int = 60) -> np.ndarray:
    """Anchors of the smallest peak force: SLSQP on the largest force, with the gradients at all angles."""
    alpha = jnp.linspace(LOW, HIGH, points)

    def limits(x):
        length, slope, torque = jax.vmap(lengths, (None, 0))(x[:3], alpha)
        held = x[3] * slope - torque / 1e4  # x[3]: the peak, in 10 kN
        return jnp.concatenate([held, jnp.array([RATIO - length[-1] / length[0], length[0] - 0.5])])

    limits, slopes = jax.jit(limits), jax.jit(jax.jacrev(limits))
    box = [(0.0, HALF), (0.0, 2 * HALF * math.cos(HIGH)), (0.0, CLOSED), (0.1, 20.0)]
    found = []
    for start in ((EYE, 0.0, 0.0, 4.0), (0.9, 0.8, 0.1, 3.0), (1.3, 1.2, 0.0, 3.0), (1.0, 0.0, 0.4, 3.0)):
        done = minimize(
            lambda x: x[3], start, jac=lambda x: np.eye(4)[3], bounds=box, method="SLSQP",
            constraints={"type": "ineq", "fun": limits, "jac": slopes},
            options={"maxiter": 300, "ftol": 1e-12},
        )  # fmt: skip
        if done.success:
            found.append(done.x)
    return min(found, key=lambda x: x[3])[:3]


def draw_forces(path: Path) -> None:
    """Cylinder force, feet and hinge over the stroke, with two pairs on the cylinder."""
    alpha = np.linspace(LOW, HIGH, 61)
    lift = driven(alpha)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
    left.plot(np.degrees(alpha), lift.force / 1e3, color=BLUE, label="cylinder, both pairs")
    for degrees, printed in PRINTED_FORCE.items():
        left.plot(degrees, printed / 1e3, "o", color=VERMILION, label="printed" if degrees == 45 else None)
    left.set(xlabel="bar angle [°]", ylabel="[kN]", ylim=(0, None), title="Cylinder force")
    right.plot(np.degrees(alpha), lift.hinge[0] / 1e3, color=BLUE, label="hinge, horizontal")
    right.plot(np.degrees(alpha), lift.hinge[1] / 1e3, color=BLUE, linestyle="--", label="hinge, vertical")
    right.plot(np.degrees(alpha), lift.feet[0] / 1e3, color=GREY, label="each foot, vertical")
    right.set(xlabel="bar angle [°]", ylabel="[kN]", title="Forces of one pair")
    for axes in (left, right):
        axes.legend(frameon=False)
    figure.savefig(path, dpi=120)


def draw_anchors(after: np.ndarray, path: Path) -> None:
    """The lift with both cylinders, low and high, and both forces over the stroke."""
    figure, (low, high, force) = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained", width_ratios=(1.3, 1, 1))
    alpha = jnp.linspace(LOW, HIGH, 121)
    for anchors, colour, label in ((AS_DRAWN, GREY, "original"), (after, BLUE, "optimised")):
        eye, x, y = anchors
        force.plot(np.degrees(alpha), PAIRS * np.asarray(course(anchors, alpha)[1]) / 1e3, color=colour, label=label)
        for axes, angle in ((low, LOW), (high, HIGH)):
            across, up = math.cos(angle), math.sin(angle)
            axes.plot([0, 2 * HALF * across], [0, 2 * HALF * up], color="black", linewidth=1)
            axes.plot([0, 2 * HALF * across], [2 * HALF * up, 0], color="black", linewidth=1)
            axes.plot([x, (HALF - eye) * across], [y, (HALF + eye) * up], "o-", color=colour, linewidth=3)
            axes.set(aspect="equal", xlabel="[m]", title=f"bars at {math.degrees(angle):.1f}°")
    force.set(xlabel="bar angle [°]", ylabel="[kN]", ylim=(0, None), title="Cylinder force, both pairs")
    force.legend(frameon=False)
    figure.savefig(path, dpi=120)


def print_table() -> None:
    """Our values beside the printed ones: 2P for two pairs, otherwise for one pair."""
    found = driven(ALPHA)
    print("".join(f"{head:>11s}" for head in ("angle [deg]", "beta [deg]", "printed", "2P [N]", "printed", "FE")))
    for i, degrees in enumerate(np.round(np.degrees(ALPHA), 1)):
        printed = (f"{table.get(degrees, ''):>11}" for table in (PRINTED_FORCE, PRINTED_FRAME))
        ours = f"{degrees:11.1f}{np.degrees(found.beta[i]):11.4f}{PRINTED_BETA[i]:11.3f}{found.force[i]:11.2f}"
        print(ours + "".join(printed))
    print("\n" + "".join(f"{head:>11s}" for head in ("angle [deg]", "R [N]", "T [N]", "Q [N]", "X [N]", "Y [N]")))
    for i, degrees in enumerate(np.round(np.degrees(ALPHA), 1)):
        row = (*found.feet[:, i], *found.hinge[:, i])
        print(f"{degrees:11.1f}" + "".join(f"{force + 0.0:11.2f}" for force in np.round(row, 6)))
    print(f"{'printed':>11s}" + "".join(f"{force:11.2f}" for force in PRINTED_JOINTS))
    near = PAIRS * float(course(AS_DRAWN, jnp.radians(jnp.array([11.1])))[1][0])
    print(f"2P at 11.1 degrees instead of 11.2 [N]: {near:.1f}")


def main(out: Path = HERE) -> None:
    """Print the tables and draw the figures."""
    lj.enable_x64()
    print_table()
    after = best()
    heads = ("eye [m]", 20), ("base [m]", 18), ("length [m]", 18), ("ratio", 8), ("peak 2P [N]", 14), ("work [J]", 12)
    print("\n" + "".join(f"{head:>{width}s}" for head, width in heads))
    for label, anchors in (("original", AS_DRAWN), ("optimised", after)):
        (short, long), top = driven(np.array([LOW, HIGH]), anchors).length, peak(anchors)
        spans = f"{anchors[0]:10.4f}{anchors[1]:10.4f}{anchors[2]:8.4f}{short:10.4f}{long:8.4f}"
        print(f"{label:10s}{spans}{long / short:8.4f}{top.value:14.2f}{work(anchors):12.2f}")
        print(f"{'':10s}the peak is at phase {top.angle:.2g} of the continuous stroke, error below {top.error:.0e} N")
    print(f"potential energy of the loads [J]: {2 * PAIRS * LOAD * 2 * HALF * (math.sin(HIGH) - math.sin(LOW)):.2f}")
    out.mkdir(parents=True, exist_ok=True)
    draw_forces(out / "forces.png")
    draw_anchors(after, out / "anchors.png")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
