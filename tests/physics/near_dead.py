"""Groups close to a singular position, by linkjax and with 160 digits, with the unavoidable effect of rounding.

`condition` is the effect of one relative rounding error in each number of the design and in the crank angle on a
result, by differences of the 160-digit solution: no program that starts from float64 numbers can guarantee an error
much below unit roundoff times that.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mpmath
import numpy as np

import linkjax as lj
from linkjax import PRP, RPR, RRP, RRR, Crank, Flywheel, Guide, Link, Mechanism, Vec
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.groups import AbstractGroup
from linkjax.kinematics import pose
from linkjax.machine import ReadyScene, ready
from tests.physics import newton_euler, oracle
from tests.physics.twins import all_loosely

CASES = ("stretched", "folded", "left", "pivot", "pivot, offset", "parallel")
PASSING = ("passing stretched", "passing folded")
PHI = 0.83
HALF = np.finfo(float).eps / 2  # size of a rounding error
DIGITS, STEP = 160, "1e-45"
PARTS = ("position", "coefficients", "reactions")


def near(case: str, distance: float) -> lj.Scene:
    """A machine whose group is this far from its singular position (relative to the lengths in its margin) at `PHI`.

    In the passing variant the crank is nearest to the position there, and rotates on. (A PRP or an RPP has no such
    position with two coinciding assembly modes: their parallel guides intersect at infinity. Slot and guide of an RPP
    are on one link, so its angle is constant, and a singular position depends on the design alone.)"""

    def body(length: float, mass: float) -> Link:
        return Link(length=length, mass=mass, inertia=0.02 * mass, centre=Vec(0.4 * length + 0.01, 0.02))

    pin, phase = 0.13 * complex(math.cos(PHI), math.sin(PHI)), 0.0
    fixed, links = {"A": Vec(0.0, 0.0)}, {"crank": body(0.13, 1.0)}
    if case.endswith(("stretched", "folded")):  # (l1 + l2 - r) / (l1 + l2) or (r - l1 + l2) / (l1 + l2) is the distance
        far, long = complex(0.41, -0.07), case.endswith("stretched")
        if case in PASSING:
            phase = math.atan2(far.imag, far.real) + (math.pi if long else 0.0) - PHI
            r = abs(far) + (0.13 if long else -0.13)
        else:
            r = abs(far - pin)
        one = 0.4 * r if long else 1.7 * r
        two = r / (1 - distance) - one if long else (one * (1 + distance) - r) / (1 - distance)
        fixed["F"] = Vec(far.real, far.imag)
        links |= {"one": body(one, 1.3), "two": body(two, 0.8)}
        group: Any = RRR(("one", "two"), "B", "F", "G", 1)
    elif case == "left":
        height = 0.09
        offset = (pin * complex(math.cos(0.3), -math.sin(0.3))).imag - height
        links |= {"one": body(height / (1 - distance), 1.3), "two": body(0.0, 0.8)}
        group = RRP("one", "two", "B", "D", Guide("A", 0.3, offset))
    elif case.startswith("pivot"):
        offset = 0.07 if case == "pivot, offset" else 0.0
        away = (distance * 0.3 + offset) * complex(math.cos(2.1), math.sin(2.1))
        fixed["P"] = Vec((pin - away).real, (pin - away).imag)
        links |= {"one": body(0.3, 1.3), "two": body(0.0, 0.8)}
        group = RPR("one", "two", "B", "P", "E", offset=offset)
    else:
        fixed["P"] = Vec(0.1, 0.25)
        links |= {"one": body(0.0, 1.3), "two": body(0.0, 0.8)}
        group = PRP(("one", "two"), "M", (Guide("P", 0.4, 0.02), Guide("B", 0.4 - PHI + distance, -0.01, "crank")))
    mechanism = Mechanism(fixed, links, [Crank("crank", "A", "B", phase=phase), group], Flywheel(0.1))
    return lj.Scene(mechanism, gravity=Vec(0.5, -9.81))


def figures(scene: lj.Scene | ReadyScene, group: AbstractGroup, phi: jax.Array) -> dict[str, jax.Array]:
    """Solution of the equations of a group: positions, first and second coefficients, reactions at 1 rad/s."""
    here = pose(scene.mechanism, phi)
    forces = kinetostatics(scene, phi, jnp.ones(()), jnp.zeros(()))
    pins, links = [here.points[p] for p in group.brings()], [here.links[name] for name in group.link_names()]
    sides = [forces.reactions[j.name][j.link] for j in group.joints()]
    return {
        "position": jnp.stack([x for v in [p.r for p in pins] + [link.u for link in links] for x in (v.x, v.y)]),
        "coefficients": jnp.stack(
            [x for p in pins for v in (p.dr, p.ddr) for x in (v.x, v.y)] + [x for one in links for x in (one.w, one.e)]
        ),
        "reactions": jnp.stack([x for side in sides for x in (side.fx, side.fy, side.moment)]),
    }


def exact(scene: lj.Scene, leaves: list, phi) -> dict[str, list]:
    """The same from numbers of any precision, by other equations: angles, differences, Newton-Euler equations."""
    mechanism = jax.tree.unflatten(jax.tree.structure(scene.mechanism), leaves)
    group, here = mechanism.groups[-1], oracle.exact(mechanism, phi, DIGITS, STEP)
    forces = newton_euler.solve(oracle.with_numbers(scene, mechanism), phi, 1, 0, mpmath, here).reactions
    pins, links = [here.points[p] for p in group.brings()], [here.links[name] for name in group.link_names()]
    sides = [forces[j.name, j.link] for j in group.joints()]
    return {
        "position": oracle.parts([each.r for each in (*pins, *links)]),
        "coefficients": oracle.parts([v for p in pins for v in (p.v, p.a)]) + [x for u in links for x in (u.v, u.a)],
        "reactions": [x for force, couple in sides for x in (force.real, force.imag, couple)],
    }


def vectors(scene: lj.Scene) -> dict[str, list[int]]:
    """For every component of the parts, the number of its vector."""
    group = scene.mechanism.groups[-1]
    pins, links, joints = len(group.brings()), len(group.link_names()), len(group.joints())
    return {
        "position": [k // 2 for k in range(2 * (pins + links))],
        "coefficients": [k // 2 for k in range(4 * pins)] + [2 * pins + k for k in range(2 * links)],
        "reactions": [2 * (k // 3) + (k % 3 == 2) for k in range(3 * joints)],
    }


def together(values: np.ndarray, numbers: list[int]) -> np.ndarray:
    """For every component the largest of its vector: a direction along x has a small y, known with the same error."""
    return np.asarray([max(v for v, k in zip(values, numbers, strict=True) if k == number) for number in numbers])


class Judged(NamedTuple):
    """Errors of the components of a result; the effect of one relative rounding on each vector, and its size."""

    error: np.ndarray
    condition: np.ndarray
    size: np.ndarray

    def excess(self) -> float:
        """Largest error relative to the effect of half a rounding unit in every number and in the result."""
        allowed = HALF * (self.condition + self.size)
        there = allowed > 1e-40 * np.max(allowed)  # otherwise exactly zero, except for the differences in the reference
        assert np.all(self.error[~there] <= 1e-40 * np.max(allowed))
        return float(np.max(self.error[there] / allowed[there], initial=0.0))


def direction(leaves: list) -> list[float]:
    """Changes of all numbers, for derivatives, by their `scale`."""
    return [math.cos(1.0 + 2.7 * k) for k, _ in enumerate(leaves)]


def scale(leaf) -> Any:
    """The scale of the change of a number: the number itself or, if it is zero, another one."""
    return leaf if leaf else mpmath.mpf("0.125")


@compiled_soon(static=("loose",))
def computed(
    scene: lj.Scene, phi: jax.Array, loose: bool = False
) -> tuple[dict[str, jax.Array], dict[str, jax.Array], jax.Array]:
    """The results, their derivatives along `direction`, and one of them in reverse mode; with the group in closed form
    or, as links and joints, by Newton's method."""
    leaves, tree = jax.tree.flatten(scene.mechanism)
    moves = [jnp.where(leaf == 0, 0.125, leaf) * c for leaf, c in zip(leaves, direction(leaves), strict=True)]

    def of(leaves):
        made = jax.tree.unflatten(tree, leaves)
        there = ready(scene.with_mechanism(all_loosely(made) if loose else made))
        return figures(there, made.groups[-1], phi)

    values, slopes = jax.jvp(of, (leaves,), (moves,))
    back = jax.grad(lambda leaves: of(leaves)["position"][0])(leaves)
    return values, slopes, sum((jnp.vdot(a, b) for a, b in zip(back, moves, strict=True)), jnp.zeros(()))


def judged(case: str, distance: float) -> dict[str, Judged]:
    """Position, coefficients, reactions and gradients of all three at this distance from a singular position; in the
    passing variant by Newton's method, which must be guided past it."""
    return judge(near(case, distance), distance, case in PASSING)


def judge(scene: lj.Scene, distance: float = 1.0, loose: bool = False) -> dict[str, Judged]:
    """The same for a scene whose numbers must change by the relative `distance` to become singular."""
    values, slopes, back = jax.device_get(computed(scene, jnp.asarray(PHI), loose=loose))
    got = {**values, "gradients": np.concatenate([*(slopes[part] for part in PARTS), back[None]])}
    with mpmath.workdps(DIGITS):
        leaves = [mpmath.mpf(float(leaf)) for leaf in jax.tree.leaves(scene.mechanism)]
        moves, phi, t = direction(leaves), mpmath.mpf(PHI), mpmath.mpf(distance) * mpmath.mpf("1e-12")

        def everything(leaves, phi):
            found = exact(scene, leaves, phi)
            ends = [
                exact(scene, [x + s * t * mpmath.mpf(c) * scale(x) for x, c in zip(leaves, moves, strict=True)], phi)
                for s in (1, -1)
            ]
            slope = {part: [(a - b) / (2 * t) for a, b in zip(ends[0][part], ends[1][part], strict=True)]
                     for part in found}  # fmt: skip
            every = [x for part in PARTS for x in slope[part]]
            return {**found, "gradients": [*every, slope["position"][0]]}

        here = everything(leaves, phi)
        others = [everything(leaves, phi * (1 + t))]
        others += [everything([*leaves[:i], x + t * scale(x), *leaves[i + 1 :]], phi) for i, x in enumerate(leaves)]
        rounded = [others[0], *(o for o, x in zip(others[1:], leaves, strict=True) if x)]  # zero is not rounded

        def felt_by(others, part):
            return np.asarray([float(sum(abs(o[part][k] - e) for o in others) / t) for k, e in enumerate(here[part])])

        felt = {part: felt_by(rounded, part) for part in here}
        # the numbers of the direction are rounded, too, and a derivative is linear in them
        linear = {part: felt_by(others, part) for part in PARTS}
    felt["gradients"] += np.concatenate([*linear.values(), linear["position"][:1]])
    ids = vectors(scene)
    of_slopes = [(part, k) for part in PARTS for k in ids[part]]
    ids["gradients"] = [of_slopes.index(each) for each in of_slopes] + [len(of_slopes)]
    return {
        part: Judged(
            np.asarray([float(abs(float(g) - e)) for g, e in zip(got[part], truth, strict=True)]),
            together(felt[part], ids[part]),
            together(np.asarray([float(abs(e)) for e in truth]), ids[part]),
        )
        for part, truth in here.items()
    }
