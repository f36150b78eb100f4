"""Groups close to a dead position, computed by linkjax and with 160 digits, and how far rounding must spoil them.

`condition` is what one relative rounding in each number of the design and in the crank angle can do to a result, by
differences of the 160-digit solution: no program that starts from float64 numbers can promise an error much below
unit roundoff times that.
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
from linkjax.kinematics import pose
from tests.physics import newton_euler, oracle

CASES = ("stretched", "folded", "left", "pivot", "pivot, offset", "parallel")
PHI = 0.83
HALF = np.finfo(float).eps / 2  # what a rounding may do
DIGITS, STEP = 160, "1e-45"
PARTS = ("position", "coefficients", "reactions")


def near(case: str, distance: float) -> lj.Scene:
    """A machine whose group is this far from its dead position (of the lengths its margin is measured by) at `PHI`."""

    def body(length: float, mass: float) -> Link:
        return Link(length=length, mass=mass, inertia=0.02 * mass, centre=Vec(0.4 * length + 0.01, 0.02))

    pin = 0.13 * complex(math.cos(PHI), math.sin(PHI))
    fixed, links = {"A": Vec(0.0, 0.0)}, {"crank": body(0.13, 1.0)}
    if case in ("stretched", "folded"):  # (l1 + l2 - r) / (l1 + l2) or (r - l1 + l2) / (l1 + l2) is the distance
        far = complex(0.41, -0.07)
        r = abs(far - pin)
        one = 0.4 * r if case == "stretched" else 1.7 * r
        two = r / (1 - distance) - one if case == "stretched" else (one * (1 + distance) - r) / (1 - distance)
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
    mechanism = Mechanism(fixed, links, [Crank("crank", "A", "B"), group], Flywheel(0.1))
    return lj.Scene(mechanism, gravity=Vec(0.5, -9.81))


def figures(scene: lj.Scene, phi: jax.Array) -> dict[str, jax.Array]:
    """What the group's equations give: places, first and second coefficients, reactions at 1 rad/s."""
    here, group = pose(scene.mechanism, phi), scene.mechanism.groups[-1]
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
    """The same from numbers of any precision, by other equations: angles, differences, Newton and Euler's."""
    mechanism = jax.tree.unflatten(jax.tree.structure(scene.mechanism), leaves)
    group, h = mechanism.groups[-1], mpmath.mpf(STEP)
    before, here, after = (oracle.assemble(mechanism, phi + k * h, mpmath) for k in (-1, 0, 1))

    def rates(name: str) -> tuple[Any, Any]:
        ahead, behind = after[0][name] - here[0][name], here[0][name] - before[0][name]
        return (ahead + behind) / (2 * h), (ahead - behind) / h**2

    def turning(name: str) -> tuple[Any, Any]:
        ahead, behind = mpmath.arg(after[1][name] / here[1][name]), mpmath.arg(here[1][name] / before[1][name])
        return (ahead + behind) / (2 * h), (ahead - behind) / h**2

    names, pins = group.link_names(), group.brings()
    places = [here[0][p] for p in pins] + [here[1][name] for name in names]
    moves = [v for p in pins for v in rates(p)]
    return {
        "position": [x for z in places for x in (z.real, z.imag)],
        "coefficients": [x for z in moves for x in (z.real, z.imag)] + [x for name in names for x in turning(name)],
        "reactions": _reactions(mechanism, complex(scene.gravity.x, scene.gravity.y), here, rates, turning),
    }


def _reactions(mechanism, gravity, here, rates, turning) -> list:
    """Joint forces of the last group: the six equations of its two links."""
    names, (points, directions) = mechanism.groups[-1].link_names(), here
    every = [j for j in newton_euler.joints(mechanism) if j.link in names or j.by in names]
    bodies = oracle.numbers(mechanism, mpmath).bodies
    matrix, right = mpmath.zeros(6, 6), mpmath.zeros(6, 1)
    centre = {name: next(iter(bodies[name].places)) for name in names}
    units = [((1j * directions[j.link], 0), (0j, 1)) if j.guide else ((1 + 0j, 0), (1j, 0)) for j in every]
    for column, (force, couple, j) in enumerate((*one, j) for j, two in zip(every, units, strict=True) for one in two):
        for name, sign in ((j.link, 1), (j.by, -1)):
            if name in names:
                row, arm = 3 * names.index(name), points[j.point] - points[centre[name]]
                f: Any = sign * mpmath.mpc(force)  # pyright: ignore[reportArgumentType]
                for k, part in enumerate((f.real, f.imag, (mpmath.conj(arm) * f).imag + sign * couple)):
                    matrix[row + k, column] += part
    for i, name in enumerate(names):
        force = bodies[name].mass * (rates(centre[name])[1] - gravity)
        for k, part in enumerate((force.real, force.imag, bodies[name].inertia * turning(name)[1])):
            right[3 * i + k] = part
    x = mpmath.lu_solve(matrix, right)
    found = {}
    for k, (j, two) in enumerate(zip(every, units, strict=True)):
        force = x[2 * k] * two[0][0] + x[2 * k + 1] * two[1][0]
        for name, sign in ((j.link, 1), (j.by, -1)):
            found[j.name, name] = sign * force, sign * (x[2 * k + 1] if j.guide else mpmath.mpf(0))
    rows = [found[j.name, j.link] for j in mechanism.groups[-1].joints()]
    return [x for force, couple in rows for x in (mpmath.mpc(force).real, mpmath.mpc(force).imag, couple)]


def vectors(scene: lj.Scene) -> dict[str, list[int]]:
    """For every component of the parts, the number of the vector that it belongs to."""
    group = scene.mechanism.groups[-1]
    pins, links, joints = len(group.brings()), len(group.link_names()), len(group.joints())
    return {
        "position": [k // 2 for k in range(2 * (pins + links))],
        "coefficients": [k // 2 for k in range(4 * pins)] + [2 * pins + k for k in range(2 * links)],
        "reactions": [2 * (k // 3) + (k % 3 == 2) for k in range(3 * joints)],
    }


def together(values: np.ndarray, numbers: list[int]) -> np.ndarray:
    """For every component the largest of its vector: a direction along x has a y that is small, and no better known."""
    return np.asarray([max(v for v, k in zip(values, numbers, strict=True) if k == number) for number in numbers])


class Judged(NamedTuple):
    """Errors of the components of a result; what one relative rounding everywhere does to each vector, and its size."""

    error: np.ndarray
    condition: np.ndarray
    size: np.ndarray

    def excess(self) -> float:
        """Largest error over what half a unit of rounding in every number and in the result does."""
        allowed = HALF * (self.condition + self.size)
        there = allowed > 1e-40 * np.max(allowed)  # else exactly zero, but for the differences behind the truth
        assert np.all(self.error[~there] <= 1e-40 * np.max(allowed))
        return float(np.max(self.error[there] / allowed[there], initial=0.0))


def direction(leaves: list) -> list[float]:
    """Changes of all numbers, for derivatives, of their `scale`."""
    return [math.cos(1.0 + 2.7 * k) for k, _ in enumerate(leaves)]


def scale(leaf) -> Any:
    """What a number is changed in proportion to: itself, or, where it is zero, something."""
    return leaf if leaf else mpmath.mpf("0.125")


@compiled_soon
def computed(scene: lj.Scene, phi: jax.Array) -> tuple[dict[str, jax.Array], dict[str, jax.Array], jax.Array]:
    """The figures, their derivatives along `direction`, and one of them in reverse mode."""
    leaves, tree = jax.tree.flatten(scene.mechanism)
    moves = [jnp.where(leaf == 0, 0.125, leaf) * c for leaf, c in zip(leaves, direction(leaves), strict=True)]

    def of(leaves):
        return figures(scene.with_mechanism(jax.tree.unflatten(tree, leaves)), phi)

    values, slopes = jax.jvp(of, (leaves,), (moves,))
    back = jax.grad(lambda leaves: of(leaves)["position"][0])(leaves)
    return values, slopes, sum((jnp.vdot(a, b) for a, b in zip(back, moves, strict=True)), jnp.zeros(()))


def judged(case: str, distance: float) -> dict[str, Judged]:
    """Position, coefficients, reactions and gradients of all three this near to a dead position."""
    return judge(near(case, distance), distance)


def judge(scene: lj.Scene, distance: float = 1.0) -> dict[str, Judged]:
    """The same of a scene whose numbers must change by the `distance`, relatively, to make another of it."""
    values, slopes, back = jax.device_get(computed(scene, jnp.asarray(PHI)))
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
        rounded = [others[0], *(o for o, x in zip(others[1:], leaves, strict=True) if x)]  # zero is no rounded number

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
