# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
"""Named linkages whose groups are of higher class, and a cylinder between two moving links, by independent methods.

Here a linkage is a set of loops: sums of arms turned by the angles of links, closed by SciPy from one crank angle to
the next. Rates solve the first and second derivatives of the loops. A reaction follows from virtual power: the joint
is separated by a small displacement while the crank is fixed, and the work of the joint on this displacement is the
work of all weights, loads and inertia elsewhere.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from scipy.optimize import fsolve

import linkjax as lj
from linkjax import Force, Guide, Harmonic, Link, Torque, Vec
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.groups import Drive, Slot
from linkjax.kinematics import pose
from linkjax.mechanism import linkage, structure

ANGLES = np.arange(12) * (2 * math.pi / 12)
STEPS = 15  # of the walk from one of them to the next
SPEED, GAIN = 12.0, 60.0  # rad/s, rad/s²
STROKE = 0.55, 0.42  # m, of the cylinder


class Named(NamedTuple):
    """Positions of points at crank angle zero (the frame's first), the pins of links, crank first, the loops that close
    them, each from a point of the frame to another, link by link, and the expected formula."""

    fixed: dict[str, complex]
    sketch: dict[str, complex]
    links: dict[str, str]
    loops: tuple[str, ...]
    formula: str


# In Stephenson's chain two links have three joints each; two bars join them one by one, and two in series. II is fixed
# at one of those in series, III at a link with three joints; driven from the far side, by one of those in series, III
# is no four-bar with a dyad. In the double butterfly, of eight links, four have three joints, two and two of these are
# pinned to each other, and no loop has less than five links; it is fixed at one of the four.
LINKAGES = {
    "Stephenson II": Named(
        {"A": 0j, "D": 0.7 + 0.06j},
        {"B": 0.09 + 0j, "C": 0.12 + 0.09j, "E": 0.49 + 0.22j, "F": 0.15 + 0.53j, "G": 0.46 + 0.62j},
        {"crank": "ABC", "bar": "BE", "link": "CF", "plate": "EFG", "rocker": "DG"},
        ("A crank B bar E plate G rocker D", "A crank C link F plate G rocker D"),
        "I1(0,1) → III3(2,3,4,5)",
    ),
    "Stephenson II, driven from the other side": Named(
        {"A": 0j, "D": 0.6 - 0.3j},
        {"B": 0.06 + 0j, "C": 0.47 + 0.31j, "E": 0.54 + 0.26j, "F": 0.13 + 0.22j, "G": 0.37 + 0.64j},
        {"crank": "AB", "rocker": "DCE", "bar": "CF", "link": "EG", "plate": "BFG"},
        ("A crank B plate F bar C rocker D", "A crank B plate G link E rocker D"),
        "I1(0,1) → IV2(2,3,4,5)",
    ),
    "Stephenson III, driven from the far side": Named(
        {"A": 0j, "C": 0.06 - 0.18j, "D": 0.83 - 0.06j},
        {"B": 0.05 + 0j, "E": 0.12 + 0.53j, "F": 0.54 + 0.23j, "G": 0.54 + 0.39j},
        {"crank": "AB", "bar": "BE", "plate": "EFG", "rocker": "CF", "lever": "DG"},
        ("A crank B bar E plate F rocker C", "A crank B bar E plate G lever D"),
        "I1(0,1) → III3(2,3,4,5)",
    ),
    "double butterfly": Named(
        {"A": 0j, "C": 0.75 - 0.04j, "D": 0.6 - 0.23j},
        {"B": 0.04 + 0j, "E": 0.4 + 0.19j, "F": 0.07 + 0.55j, "G": 0.48 + 0.53j, "H": 0.91 + 0.41j, "I": 0.59 + 0.12j,
         "J": 0.32 - 0.1j},
        {"crank": "AB", "left": "BEF", "right": "CGH", "middle": "EIJ", "top": "FG", "side": "HI", "foot": "DJ"},
        ("A crank B left F top G right C", "A crank B left E middle I side H right C",
         "A crank B left E middle J foot D"),
        "I1(0,1) → V3(2,3,4,5,6,7)",
    ),
}  # fmt: skip


def scene(named: Named) -> lj.Scene:
    """The linkage drawn by links and joints, with loads."""
    at, links = named.fixed | named.sketch, {}
    for number, (name, pins) in enumerate(named.links.items()):
        axis = at[pins[1]] - at[pins[0]]
        more = {p: (at[p] - at[pins[0]]) * abs(axis) / axis for p in pins[2:]}
        centre = 0.4 * abs(axis) + 0.02 + 0.01j * (number - 2)
        links[name] = Link(length=abs(axis), mass=1.0 + 0.3 * number, inertia=0.004 + 0.002 * number,
                           centre=Vec(centre.real, centre.imag), pins=tuple(pins),
                           points={p: Vec(z.real, z.imag) for p, z in more.items()})  # fmt: skip
    last, plate = list(named.links)[-1], next(p for p in reversed(named.links.values()) if len(p) == 3)
    worked = next(name for name, pins in named.links.items() if pins == plate)
    loads = Torque("rub", last, torque=3.0), Force("push", worked, plate[2], force=Vec(20.0, -35.0))
    fixed, sketch = ({p: (z.real, z.imag) for p, z in places.items()} for places in (named.fixed, named.sketch))
    made = linkage(fixed, links, Drive("crank"), sketch=sketch)
    return lj.Scene(made, loads, Vec(0.3, -9.81), SPEED)


class Turned(NamedTuple):
    """Directions of all links, with the first and second derivatives of their angles."""

    u: np.ndarray
    w: np.ndarray
    e: np.ndarray


class Loops:
    """The linkage by its loops. `x` are the angles of all links except the crank, in their order."""

    def __init__(self, named: Named, scene: lj.Scene):
        self.named, self.scene, self.links = named, scene, list(named.links)
        self.loops = [loop.split() for loop in named.loops]
        self.arms: dict[str, dict[str, complex]] = {}
        for name, pins in named.links.items():
            link = scene.mechanism.links[name]
            more = {p: complex(at.x, at.y) for p, at in link.points.items()}
            centre = complex(link.centre.x, link.centre.y)
            self.arms[name] = {pins[0]: 0j, pins[1]: complex(link.length), **more, f"S{name}": centre}
        drawn = named.fixed | named.sketch
        self.x = np.array([np.angle(drawn[pins[1]] - drawn[pins[0]]) for pins in named.links.values()])[1:]

    def sums(self, way: list[str], terms: np.ndarray) -> complex:
        """The arms of a path, each times the term of its link."""
        steps = zip(way[0::2], way[1::2], way[2::2], strict=False)
        return sum(
            (self.arms[link][to] - self.arms[link][at]) * terms[self.links.index(link)] for at, link, to in steps
        )

    def way_to(self, point: str, link: str) -> list[str]:
        """From the frame to a point of a link, along a loop."""
        loop = next(loop for loop in self.loops if link in loop)
        return [*loop[: loop.index(link) + 1], point]

    def left(self, x, phi: float) -> np.ndarray:
        terms = np.exp(1j * np.append(phi, x))
        gaps = [self.named.fixed[way[0]] + self.sums(way, terms) - self.named.fixed[way[-1]] for way in self.loops]
        return np.ravel([(gap.real, gap.imag) for gap in gaps])

    def close(self, phi: float) -> np.ndarray:
        """The angles of all links, from the present configuration."""
        self.x, told, _, _ = fsolve(self.left, self.x, (phi,), full_output=True, xtol=1e-13)
        assert np.max(np.abs(told["fvec"])) < 1e-13
        return np.append(phi, self.x)

    def solved(self, terms, right: list[complex]) -> np.ndarray:
        """Rates of the angles for which the loops move by the right-hand side."""
        columns = [[self.sums(way, 1j * terms * one) for way in self.loops] for one in np.eye(len(self.links))[1:]]
        matrix = np.array([[part for z in column for part in (z.real, z.imag)] for column in columns]).T
        return np.linalg.solve(matrix, np.ravel([(z.real, z.imag) for z in right]))

    def at(self, phi: float) -> Turned:
        """Directions, and rates of the first and the second order."""
        angles = self.close(phi)
        u = np.exp(1j * angles)
        first = np.eye(len(angles))[0]
        first[1:] = self.solved(u, [-self.sums(way, 1j * u * first) for way in self.loops])
        second = np.zeros(len(angles))
        second[1:] = self.solved(u, [self.sums(way, u * first**2) for way in self.loops])
        return Turned(u, first, second)

    def point(self, here: Turned, point: str, link: str) -> tuple[complex, complex, complex]:
        """A point of a link with its rates."""
        way, (u, w, e) = self.way_to(point, link), here
        start = self.named.fixed[way[0]]
        return start + self.sums(way, u), self.sums(way, 1j * u * w), self.sums(way, u * (1j * e - w**2))

    def forces(self, here: Turned) -> dict[str, tuple[complex, float]]:
        """Force and couple of weight, loads and inertia on every link, at its centre."""
        found, gravity = {}, complex(self.scene.gravity.x, self.scene.gravity.y)
        for k, name in enumerate(self.links):
            link, (s, v, a) = self.scene.mechanism.links[name], self.point(here, f"S{name}", name)
            force = float(link.mass) * (gravity - a * SPEED**2 - v * GAIN)
            couple = -float(link.inertia) * (here.e[k] * SPEED**2 + here.w[k] * GAIN)
            for load in (load for load in self.scene.loads if load.link == name):
                if isinstance(load, Force):
                    push, arm = complex(load.force.x, load.force.y), self.point(here, load.point, name)[0] - s
                    force, couple = force + push, couple + (arm.conjugate() * push).imag
                else:
                    assert isinstance(load, Torque)
                    couple += float(load.torque)
            found[name] = force, couple
        return found

    def power(self, here: Turned, forces, turns: np.ndarray, moves: dict[str, complex]) -> float:
        """Power of these forces for given rotations of links and displacements of their centres."""
        found = 0.0
        for k, (name, (force, couple)) in enumerate(forces.items()):
            v = self.sums(self.way_to(f"S{name}", name), 1j * here.u * turns) + moves.get(name, 0j)
            found += (force.conjugate() * v).real + couple * turns[k]
        return found

    def reaction(self, here: Turned, forces, joint: str, link: str) -> complex:
        """On a link at a joint: it is separated from all others there, along x and y."""

        def shifted(way: list[str], by: complex) -> complex:
            """The additional displacement of the end of a path."""
            ends = [(way[i - 1] if i else "", way[i + 1] if i + 1 < len(way) else "") for i in range(0, len(way), 2)]
            return sum(by * ((on == link) - (off == link))
                       for (off, on), at in zip(ends, way[0::2], strict=True) if at == joint)  # fmt: skip

        found = []
        for by in (1 + 0j, 1j):
            turns = np.append(0.0, self.solved(here.u, [-shifted(way, by) for way in self.loops]))
            moves = {name: shifted(self.way_to(f"S{name}", name), by) for name in self.links}
            found.append(-self.power(here, forces, turns, moves))
        return complex(*found)


@compiled_soon
def everything(scene, angles):
    return jax.vmap(
        lambda phi: (pose(scene.mechanism, phi), kinetostatics(scene, phi, scene.speed, jnp.asarray(GAIN)))
    )(angles)


def near(got, truth, size: float | None = None) -> None:
    """SciPy closes the loops to 1e-13, and rates are about ten times as sensitive; of the largest in the turn."""
    size = float(np.max(np.abs(truth))) if size is None else size
    np.testing.assert_allclose(got, truth, rtol=0, atol=1e-11 * size)


@pytest.mark.parametrize(
    "name", [n if n == "Stephenson II" else pytest.param(n, marks=pytest.mark.slow) for n in LINKAGES]
)
def test_linkages_by_name(name):
    """Directions, first and second coefficients, points, drive torque and every reaction, over the whole turn."""
    named, machine = LINKAGES[name], scene(LINKAGES[name])
    assert structure(machine.mechanism).formula(numbers=True) == named.formula
    here, forces = jax.device_get(everything(machine, jnp.asarray(ANGLES)))
    loops, truth = Loops(named, machine), []
    for k, phi in enumerate(ANGLES):
        for angle in np.linspace(phi - ANGLES[1], phi, STEPS + 1)[1:] if k else ():
            loops.close(angle)
        truth.append(loops.at(phi))
    for i, link in enumerate(named.links):
        state = here.links[link]
        near(np.asarray(state.u.x) + 1j * np.asarray(state.u.y), [at.u[i] for at in truth])
        near(state.w, [at.w[i] for at in truth], max(np.max(np.abs(at.w)) for at in truth))
        near(state.e, [at.e[i] for at in truth], max(np.max(np.abs(at.e)) for at in truth))
    owners = {p: link for link, pins in named.links.items() for p in (*pins, f"S{link}") if p not in named.fixed}
    for point, link in ((p, link) for p, link in owners.items() if p in here.points):
        known = [loops.point(at, point, link) for at in truth]
        for part, order in (("r", 0), ("dr", 1), ("ddr", 2)):
            got = getattr(here.points[point], part)
            near(np.asarray(got.x) + 1j * np.asarray(got.y), [each[order] for each in known])
    acting = [loops.forces(at) for at in truth]
    near(forces.drive_torque, [-loops.power(at, on, at.w, {}) for at, on in zip(truth, acting, strict=True)])
    most = max(np.max(np.hypot(side.fx, side.fy)) for sides in forces.reactions.values() for side in sides.values())
    assert set(forces.reactions) == {p for pins in named.links.values() for p in pins}
    for joint, sides in forces.reactions.items():
        for link, side in sides.items():
            known = [loops.reaction(at, on, joint, link) for at, on in zip(truth, acting, strict=True)]
            near(np.asarray(side.fx) + 1j * np.asarray(side.fy), known, most)
            near(side.moment, 0 * ANGLES, most)


def loader() -> lj.Scene:
    """A four-bar moved by a cylinder between its lever and its rocker: both ends of the cylinder move."""
    links = {
        "lever": Link(length=0.5, mass=3.0, inertia=0.06, centre=Vec(0.22, 0.03), pins=("A", "B", "K"),
                      points={"K": Vec(0.2, -0.06)}),
        "coupler": Link(length=0.45, mass=2.0, inertia=0.04, centre=Vec(0.2, 0.05), pins=("B", "C"),
                        points={"T": Vec(0.6, 0.2)}),
        "rocker": Link(length=0.6, mass=2.5, inertia=0.05, centre=Vec(0.3, -0.02), pins=("D", "C", "L"),
                       points={"L": Vec(0.42, 0.05)}),
        "barrel": Link(length=0.15, mass=1.5, inertia=0.02, centre=Vec(0.1, 0.01), pins=("K", "H")),
        "rod": Link(mass=0.9, inertia=0.01, centre=Vec(-0.12, 0.0), pins=("L",)),
    }  # fmt: skip
    at = four_bar(mpmath.mpf("0.9"))
    sketch = {p: (float(z.real), float(z.imag)) for p, z in at.items() if p in "BCKL"}
    sketch["H"] = tuple(0.6 * np.asarray(sketch["K"]) + 0.4 * np.asarray(sketch["L"]))
    made = linkage({"A": (0.0, 0.0), "D": (0.55, 0.05)}, links, Drive("rod", "barrel", law=Harmonic(*STROKE)),
                   [Slot("rod", Guide("K", on="barrel"))], sketch)  # fmt: skip
    loads = Force("weight", "coupler", "T", force=Vec(15.0, -400.0)), Torque("rub", "rocker", torque=-6.0)
    return lj.Scene(made, loads, Vec(0.2, -9.81), 2.0)


def four_bar(lever) -> dict[str, Any]:
    """Points and directions of the loader by the angle of its lever, in closed form."""
    b, d = mpmath.mpf("0.5") * mpmath.expj(lever), mpmath.mpc("0.55", "0.05")
    span = d - b
    corner = mpmath.acos((mpmath.mpf("0.45") ** 2 + abs(span) ** 2 - mpmath.mpf("0.6") ** 2)
                         / (2 * mpmath.mpf("0.45") * abs(span)))  # fmt: skip
    u = {"lever": mpmath.expj(lever), "coupler": span / abs(span) * mpmath.expj(corner)}
    c = b + mpmath.mpf("0.45") * u["coupler"]
    u["rocker"] = (c - d) / mpmath.mpf("0.6")
    k, end = mpmath.mpc("0.2", "-0.06") * u["lever"], d + mpmath.mpc("0.42", "0.05") * u["rocker"]
    u["barrel"] = u["rod"] = (end - k) / abs(end - k)
    return {"A": mpmath.mpc(0), "B": b, "C": c, "D": d, "K": k, "L": end, **u}


def moved(phi) -> dict[str, Any]:
    """The same by the crank angle: the lever is where the cylinder has its prescribed length."""
    start, stop = (mpmath.mpf(end) for end in STROKE)
    length = (start + stop) / 2 + (start - stop) / 2 * mpmath.cos(phi)
    lever = mpmath.findroot(
        lambda x: abs(four_bar(x)["L"] - four_bar(x)["K"]) - length, (mpmath.mpf(1), mpmath.mpf(1.5))
    )
    return {**four_bar(lever), "length": length}


def cylinder_by_mpmath(machine: lj.Scene, phi: float) -> dict[str, Any]:
    """Every quantity of `moved` with its rates (of a direction those of its angle), by differences of 50 digits; and
    the force of the cylinder, whose power balances that of all other forces."""
    with mpmath.workdps(50):
        h = mpmath.mpf("1e-15")
        before, here, after = (moved(mpmath.mpf(phi) + k * h) for k in (-1, 0, 1))
        found: dict[str, Any] = {}
        for name, z in here.items():
            if name in machine.mechanism.links:
                ahead, behind = mpmath.arg(after[name] / z), mpmath.arg(z / before[name])
            else:
                ahead, behind = after[name] - z, z - before[name]
            found[name] = z, (ahead + behind) / (2 * h), (ahead - behind) / h**2

        def point(start: str, link: str, at: Vec):
            """A point of a link, from the origin of its axes."""
            (p, v, a), (u, w, e) = found[start], found[link]
            arm = mpmath.mpc(float(at.x), float(at.y)) * u
            return p + arm, v + 1j * w * arm, a + (1j * e - w**2) * arm

        speed, power = mpmath.mpf(float(machine.speed)), mpmath.mpf(0)
        origins = {"lever": "A", "coupler": "B", "rocker": "D", "barrel": "K", "rod": "L"}
        for name, start in origins.items():
            link, (_, w, e) = machine.mechanism.links[name], found[name]
            _, v, a = point(start, name, link.centre)
            weight = mpmath.mpc(float(machine.gravity.x), float(machine.gravity.y))
            acceleration, spin = a * speed**2 + v * GAIN, e * speed**2 + w * GAIN
            power += float(link.mass) * ((weight - acceleration).conjugate() * v).real - float(link.inertia) * spin * w
        weight, rub = machine.loads
        assert isinstance(weight, Force) and isinstance(rub, Torque)
        tip = point("B", "coupler", machine.mechanism.links["coupler"].points["T"])
        power += (mpmath.mpc(float(weight.force.x), -float(weight.force.y)) * tip[1]).real
        power += float(rub.torque) * found["rocker"][1]
        return {**found, "T": tip, "torque": -power, "push": -power / found["length"][1]}


@pytest.mark.slow
def test_a_cylinder_between_two_moving_links():
    """Positions, coefficients, and the cylinder force by virtual power, against the four-bar in closed form."""
    machine, angles = loader(), ANGLES + 0.2
    here, forces = jax.device_get(everything(machine, jnp.asarray(angles)))
    truth = [cylinder_by_mpmath(machine, float(phi)) for phi in angles]

    def known(name: str, order: int = 0) -> np.ndarray:
        return np.array([complex(at[name][order]) for at in truth])

    for p in "BCKLT":
        for part, order in (("r", 0), ("dr", 1), ("ddr", 2)):
            got = getattr(here.points[p], part)
            near(np.asarray(got.x) + 1j * np.asarray(got.y), known(p, order))
    for link in machine.mechanism.link_names:
        state = here.links[link]
        near(np.asarray(state.u.x) + 1j * np.asarray(state.u.y), known(link))
        near(state.w, known(link, 1).real)
        near(state.e, known(link, 2).real)
    sides = forces.reactions["rod.drive"]
    assert set(sides) == {"rod", "barrel"}
    push = np.array([float(at["push"]) for at in truth]) * known("rod")
    for link, sign in (("rod", 1), ("barrel", -1)):
        near(np.asarray(sides[link].fx) + 1j * np.asarray(sides[link].fy), sign * push)
    near(forces.drive_torque, np.array([float(at["torque"]) for at in truth]))
