"""A scissor lift: printed forces beside ours, then the cylinder's anchors chosen for the smallest peak force.

Run: python -m studies.scissor_lift.study [OUT]       tables on the screen, two figures in OUT (default: here)
"""

import math
import sys
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize

import linkjax as lj
from linkjax.forces import kinetostatics
from linkjax.kinematics import prepared

HERE = Path(__file__).parent
HALF, EYE, LOAD, PAIRS = 1.47, 0.5, 3125.0, 2
LOW, HIGH = math.radians(11.2), math.radians(45.0)
CLOSED = 2 * HALF * math.sin(LOW)  # height of the lowered platform
RATIO = 1.8  # of the cylinder's greatest to its least length
ALPHA = np.radians([11.2, 15, 20, 25, 30, 35, 40, 45])
PRINTED_BETA = (21.907, 28.554, 36.472, 43.442, 49.541, 54.885, 59.595, 63.785)
PRINTED_FORCE = {11.2: 66530.0, 45.0: 27448.0}  # two pairs
AS_DRAWN = np.array([EYE, 0.0, 0.0])
BLUE, VERMILION, GREY = "#0072B2", "#D55E00", "#8a8a8a"


class Driven(NamedTuple):
    """The lift as its cylinder drives it, one pair of bars: angles (rad), cylinder length (m), force, reactions (N)."""

    alpha: np.ndarray
    beta: np.ndarray
    length: np.ndarray
    force: np.ndarray
    feet: np.ndarray  # at the fixed foot with the cylinder's bearing: along and across; at the roller: across
    hinge: np.ndarray  # on the brace, along and across


def by_cylinder(alpha: np.ndarray) -> Driven:
    """Forces of the built-in scene, whose drive is the cylinder, where the bars stand at these angles."""
    scene = lj.load("scissor-lift")
    ends = cylinder(LOW), cylinder(HIGH)
    swing = np.clip(1 - 2 * (cylinder(alpha) - ends[0]) / (ends[1] - ends[0]), -1, 1)
    mechanism = prepared(scene.mechanism)

    def at(phi):
        return lj.pose(mechanism, phi), kinetostatics(scene.with_mechanism(mechanism), phi, scene.speed, 0 * phi)

    here, forces = jax.jit(jax.vmap(at))(jnp.asarray(np.arccos(swing)))
    push, foot, barrel = (
        forces.reactions[joint][link] for joint, link in (("rod.drive", "rod"), ("O", "bar"), ("O", "barrel"))
    )
    roller, hinge = forces.reactions["roller.guide"]["roller"], forces.reactions["C"]["brace"]
    bar, axis, eye = here.links["bar"].u, here.links["barrel"].u, here.points["E"].r
    return Driven(
        np.arctan2(bar.y, bar.x), np.arctan2(axis.y, axis.x), np.hypot(eye.x, eye.y), np.hypot(push.fx, push.fy),
        np.array([foot.fx + barrel.fx, foot.fy + barrel.fy, roller.fy]), np.array([hinge.fx, hinge.fy]),
    )  # fmt: skip


def cylinder(alpha):
    """Length of the cylinder as drawn, pin to pin."""
    return np.hypot((HALF - EYE) * np.cos(alpha), (HALF + EYE) * np.sin(alpha))


def by_bar(eye) -> lj.Scene:
    """The same lift turned by its bar: the crank angle is the bar's, and the cylinder's eye a point of the brace."""
    links = {
        "bar": lj.Link(length=2 * HALF, points={"C": lj.Vec(HALF, 0.0)}),
        "brace": lj.Link(length=HALF, points={"E": lj.Vec(-eye, 0.0), "U": lj.Vec(-HALF, 0.0)}),
        "roller": lj.Link(),
    }
    groups = [lj.Crank("bar", "O", "T"), lj.RRP("brace", "roller", "C", "R", lj.Guide("O"))]
    loads = tuple(lj.Force(link, link, end, force=lj.Vec(0.0, -LOAD)) for link, end in (("bar", "T"), ("brace", "U")))
    return lj.Scene(lj.Mechanism({"O": lj.Vec(0.0, 0.0)}, links, groups), loads, speed=0.1)


def lengths(anchors, alpha):
    """Cylinder length (m), its slope over the bar's angle, and the torque that holds the bar (N m), one pair.

    `anchors`: the eye's distance above the centre hinge on the brace, and the base's place on the frame.
    """
    eye, x, y = anchors
    scene = by_bar(eye)
    at = lj.pose(scene.mechanism, alpha).points["E"]
    off = at.r - lj.Vec(x, y)
    length = jnp.sqrt(off.squared())
    return length, off.dot(at.dr) / length, -lj.reduce(scene, alpha).torque


@jax.jit
def course(anchors, alpha):
    """Cylinder length and force of one pair over the bar's angle."""
    length, slope, torque = jax.vmap(lengths, (None, 0))(anchors, alpha)
    return length, torque / slope


def best(points: int = 60) -> np.ndarray:
    """Anchors of the smallest peak force: SLSQP on the greatest force, with gradients of every angle's share."""
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
    """Cylinder force, feet and hinge over the stroke, two pairs on the cylinder."""
    alpha = np.linspace(LOW, HIGH, 61)
    lift = by_cylinder(alpha)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
    left.plot(np.degrees(alpha), PAIRS * lift.force / 1e3, color=BLUE, label="cylinder, both pairs")
    for degrees, printed in PRINTED_FORCE.items():
        left.plot(degrees, printed / 1e3, "o", color=VERMILION, label="printed" if degrees == 45 else None)
    left.set(xlabel="bar angle [°]", ylabel="[kN]", ylim=(0, None), title="Cylinder force")
    right.plot(np.degrees(alpha), lift.hinge[0] / 1e3, color=BLUE, label="hinge, along")
    right.plot(np.degrees(alpha), lift.hinge[1] / 1e3, color=BLUE, linestyle="--", label="hinge, across")
    right.plot(np.degrees(alpha), lift.feet[1] / 1e3, color=GREY, label="each foot, across")
    right.set(xlabel="bar angle [°]", ylabel="[kN]", title="Forces of one pair")
    for axes in (left, right):
        axes.legend(frameon=False)
    figure.savefig(path, dpi=120)


def draw_anchors(after: np.ndarray, path: Path) -> None:
    """The lift with both cylinders, low and high, and both forces over the stroke."""
    figure, (low, high, force) = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained", width_ratios=(1.3, 1, 1))
    alpha = jnp.linspace(LOW, HIGH, 121)
    for anchors, colour, label in ((AS_DRAWN, GREY, "as drawn"), (after, BLUE, "chosen")):
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


def main(out: Path = HERE) -> None:
    """Print the tables, draw the figures."""
    lj.enable_x64()
    lift = by_cylinder(ALPHA)
    heads = ("angle [deg]", 12), ("beta [deg]", 12), ("printed", 10), ("2P [N]", 12), ("printed", 10)
    print("".join(f"{head:>{width}s}" for head, width in (*heads, ("hinge X", 12), ("hinge Y", 12))))
    for i, degrees in enumerate(np.degrees(ALPHA)):
        printed = PRINTED_FORCE.get(round(float(degrees), 1))
        told = f"{np.degrees(lift.beta[i]):12.4f}{PRINTED_BETA[i]:10.3f}{PAIRS * lift.force[i]:12.2f}"
        print(f"{degrees:12.1f}{told}{printed or '':>10}{lift.hinge[0, i]:12.2f}{lift.hinge[1, i]:12.2f}")
    print(f"feet [N]: along {lift.feet[0, -1]:.1e}, across {lift.feet[1, -1]:.3f} and {lift.feet[2, -1]:.3f}")
    near = PAIRS * float(course(AS_DRAWN, jnp.radians(jnp.array([11.1])))[1][0])
    print(f"2P at 11.1 degrees instead of 11.2 [N]: {near:.1f}")
    after, alpha = best(), jnp.linspace(LOW, HIGH, 2001)
    heads = ("eye [m]", 20), ("base [m]", 18), ("length [m]", 18), ("ratio", 8), ("peak 2P [N]", 14), ("work [J]", 12)
    print("\n" + "".join(f"{head:>{width}s}" for head, width in heads))
    for label, anchors in (("as drawn", AS_DRAWN), ("chosen", after)):
        length, force = course(anchors, alpha)
        spans = f"{anchors[0]:10.4f}{anchors[1]:10.4f}{anchors[2]:8.4f}{float(length[0]):10.4f}{float(length[-1]):8.4f}"
        ends = f"{float(length[-1] / length[0]):8.4f}{PAIRS * float(force.max()):14.2f}"
        print(f"{label:10s}{spans}{ends}{PAIRS * float(jnp.trapezoid(force, length)):12.2f}")
    print(f"what the loads gain [J]: {2 * PAIRS * LOAD * 2 * HALF * (math.sin(HIGH) - math.sin(LOW)):.2f}")
    out.mkdir(parents=True, exist_ok=True)
    draw_forces(out / "forces.png")
    draw_anchors(after, out / "anchors.png")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
