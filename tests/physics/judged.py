# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# pyright: reportOptionalMemberAccess=false, reportReturnType=false
"""A batch of random machines, checked: closure, coefficients, reactions and gradients by independent methods, with the
error that the condition number of the problem allows.

The condition number of a result is its largest relative change for a relative change of the numbers of the machine and
its state. It is found by changing all of them in the NumPy oracle. Every number is changed in proportion to itself: an
angle or an offset that happens to be small is assumed to be known with the same relative accuracy, and a zero is exact.
This is the strictest choice possible. Sizes are the largest of a kind in a machine: of all points, of all links, of all
joints. The error of a result may be 1e-14 times its condition number, plus 1e-12, relative to its size.

Gradients are those of two weighted sums of results, each kind relative to its size: without and with the reactions. The
size of a gradient is its norm, where every slope is multiplied by its number. Its condition number is taken as the
largest of the kinds in the sum, which is not more than its own: that of d^-p is p / d, that of its slope (p + 1) / d.
The reference is a difference along one random direction, with 80 digits.

In mpmath the positions are closed by angles, coefficients are differences, the drive torque is that of virtual power,
and reactions solve the Newton-Euler equations of all links simultaneously, for all kinds of groups including those of
higher class, all drivers, gears, belts and racks.
"""

from __future__ import annotations

import contextlib
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mpmath
import numpy as np

from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.groups import PRP, RPP, RPR, RRP, Crank, Gear, General, LinearDriver, Pinion, Rack
from linkjax.kinematics import Prepared, plain, pose, prepared
from linkjax.machine import ReadyScene
from tests.physics import newton_euler, oracle
from tests.physics.random_machines import Batch

PLACES = ("position", "direction", "velocity", "acceleration", "turn", "turning")
REACTIONS = ("force", "moment")
KINDS = (*PLACES, "drive", *REACTIONS)
SUMMED = {"gradient": (*PLACES, "drive"), "gradient with reactions": KINDS}
CLOSURE = ("closure", "links and guides")
PER_CONDITION, BESIDES = 1e-14, 1e-12
CHANGE, CHANGES = 1e-9, 12


class Verdict(NamedTuple):
    """Errors relative to the tolerance, by kind and method, for every machine of a batch; condition numbers by kind."""

    over: dict[tuple[str, str], np.ndarray]
    condition: dict[str, np.ndarray]


def moving(mechanism) -> list[str]:
    """Points that move."""
    pins = [p for g in mechanism.groups for p in g.brings()]
    own = [p for link in mechanism.links.values() for p in (link.centre_name, *link.point_names())]
    return sorted(set(pins + own) - set(mechanism.fixed))


# ---- linkjax


def results(scene, phi, speed, acceleration, keys) -> dict[str, jax.Array]:
    """Results of linkjax, a vector for each kind."""
    here = pose(scene.mechanism, phi)
    forces = kinetostatics(scene, phi, speed, acceleration)
    points = [here.points[p] for p in moving(plain(scene.mechanism))]
    links = [here.links[name] for name in sorted(here.links)]
    joints = [forces.reactions[joint][link] for joint, link in keys]
    return {
        "position": _flat([p.r for p in points]),
        "direction": _flat([link.u for link in links]),
        "velocity": _flat([p.dr for p in points]),
        "acceleration": _flat([p.ddr for p in points]),
        "turn": jnp.stack([link.w for link in links]),
        "turning": jnp.stack([link.e for link in links]),
        "drive": forces.drive_torque[None],
        "force": jnp.stack([part for j in joints for part in (j.fx, j.fy)]),
        "moment": jnp.stack([j.moment for j in joints]),
    }


def _flat(vectors) -> jax.Array:
    return jnp.stack([part for v in vectors for part in (v.x, v.y)])


def _by_differentiation(mechanism, phi) -> dict[str, jax.Array]:
    """Coefficients from positions and directions alone, by nested forward mode."""

    def place(phi):
        here = pose(mechanism, phi)
        u = [here.links[name].u for name in sorted(here.links)]
        return _flat([here.points[p].r for p in moving(plain(mechanism))]), _flat(u)

    def slope(phi):
        return jax.jvp(place, (phi,), (jnp.ones_like(phi),))[1]

    (_, u), (v, du) = place(phi), slope(phi)
    a, ddu = jax.jvp(slope, (phi,), (jnp.ones_like(phi),))[1]
    n = jnp.stack([-u[1::2], u[0::2]])
    turn, turning = (n[0] * x[0::2] + n[1] * x[1::2] for x in (du, ddu))
    return {"velocity": v, "acceleration": a, "turn": turn, "turning": turning}


def weights(count: int) -> np.ndarray:
    """The weight of each entry of a vector in the scalar that is differentiated."""
    return np.cos(1.0 + 1.7 * np.arange(count))


def computed(scene, paths, phi, speed, acceleration, tangent, scales, keys):
    """For every design, with the reference paths of its groups of higher class: results, coefficients by nested
    differentiation, and of two weighted sums, the second of which includes reactions, the derivative along a tangent,
    forward and in reverse, with the size of the scaled gradient."""

    def one(scene, paths, phi, speed, acceleration, tangent, scales):
        def scalars(mechanism):
            found = results(ReadyScene(scene.with_mechanism(mechanism), paths), phi, speed, acceleration, keys)
            sums = {kind: found[kind] @ jnp.asarray(weights(found[kind].size)) / scales[kind] for kind in KINDS}
            return jnp.stack([sum(sums[kind] for kind in summed) for summed in SUMMED.values()]), found

        ahead = jax.jvp(scalars, (scene.mechanism,), (tangent,), has_aux=True)[1]
        _, pull, found = jax.vjp(scalars, scene.mechanism, has_aux=True)
        back = [jax.tree.leaves(pull(jnp.asarray(row))[0]) for row in np.eye(2)]
        along, at = jax.tree.leaves(tangent), jax.tree.leaves(scene.mechanism)
        each = [sum(jnp.sum(g * t) for g, t in zip(row, along, strict=True)) for row in back]
        size = [jnp.sqrt(sum(jnp.sum((g * d) ** 2) for g, d in zip(row, at, strict=True))) for row in back]
        nested = _by_differentiation(Prepared(scene.mechanism, paths), phi)
        return found, nested, (ahead, jnp.stack(each), jnp.stack(size))

    return jax.vmap(one)(scene, paths, phi, speed, acceleration, tangent, scales)


def valued(scene, paths, phi, speed, acceleration, keys):
    """For every design: results, and coefficients by nested differentiation."""

    def one(scene, paths, phi, speed, acceleration):
        made = ReadyScene(scene, paths)
        return results(made, phi, speed, acceleration, keys), _by_differentiation(made.mechanism, phi)

    return jax.vmap(one)(scene, paths, phi, speed, acceleration)


@jax.jit
def paths_of(mechanism):
    """The reference paths of all designs, one a group; they belong to no design's numbers."""
    return jax.vmap(prepared)(mechanism).paths


at_once, values_at_once = (compiled_soon(each, static=("keys",)) for each in (computed, valued))


# ---- by independent methods


def by_numpy(scene, phi, speed, acceleration) -> tuple[dict[str, np.ndarray], tuple]:
    """The same from the oracle in NumPy, and the keys of the reactions; the designs along the first axis."""
    here = oracle.rates(scene.mechanism, phi)
    forces = newton_euler.solve(scene, phi, speed, acceleration)
    points = [here.points[p] for p in moving(scene.mechanism)]
    links = [here.links[name] for name in sorted(here.links)]
    keys = tuple(sorted(forces.reactions))
    found = {
        "position": np.stack(oracle.parts([p.r for p in points]), -1),
        "direction": np.stack(oracle.parts([link.r for link in links]), -1),
        "velocity": np.stack(oracle.parts([p.v for p in points]), -1),
        "acceleration": np.stack(oracle.parts([p.a for p in points]), -1),
        "turn": np.stack([link.v for link in links], -1),
        "turning": np.stack([link.a for link in links], -1),
        "drive": forces.drive[..., None],
        "force": np.stack(oracle.parts([forces.reactions[key][0] for key in keys]), -1),
        "moment": np.stack([forces.reactions[key][1] for key in keys], -1),
    }
    return found, keys


def by_mpmath(scene, phi: float, speed: Any, acceleration: Any, digits: int = 50, step: str = "1e-13"):
    """One design with 50 digits: positions and coefficients, drive torque by virtual power, and the reactions by the
    Newton-Euler equations."""
    mechanism = scene.mechanism
    here = oracle.exact(mechanism, phi, digits, step)
    points = [here.points[p] for p in moving(mechanism)]
    links = [here.links[name] for name in sorted(here.links)]
    with mpmath.workdps(digits):
        power = oracle.reduction(scene, phi, mpmath, here)
        speed, acceleration = mpmath.mpf(speed), mpmath.mpf(acceleration)
        reactions = newton_euler.solve(scene, phi, speed, acceleration, mpmath, here).reactions
        sides = [reactions[key] for key in sorted(reactions)]
        return {
            "position": oracle.parts([p.r for p in points]),
            "direction": oracle.parts([link.r for link in links]),
            "velocity": oracle.parts([p.v for p in points]),
            "acceleration": oracle.parts([p.a for p in points]),
            "turn": [link.v.real for link in links],
            "turning": [link.a.real for link in links],
            "drive": [power.inertia * acceleration + power.slope * speed**2 / 2 - power.torque],
            "force": oracle.parts([force for force, _ in sides]),
            "moment": [moment for _, moment in sides],
        }


def _slopes_by_mpmath(batch: Batch, i: int, tangent, scales) -> list[float]:
    """Derivatives of both weighted sums along the tangent: differences of values with 80 digits."""
    scene, at = batch.one(i), (float(x[i]) for x in (batch.phi, batch.speed, batch.acceleration))
    phi, speed, acceleration = at
    along, values = jax.tree.map(lambda leaf: float(leaf[i]), tangent), []
    with mpmath.workdps(80):
        h = mpmath.mpf("1e-10")
        for sign in (1, -1):
            there = jax.tree.map(lambda d, t, s=sign: mpmath.mpf(float(d)) + s * h * t, scene.mechanism, along)
            there = oracle.with_numbers(scene, there)
            found = by_mpmath(there, phi, speed, acceleration, 80, "1e-18")
            sums = {kind: sum(w * x for w, x in zip(weights(len(v)), v, strict=True)) / float(scales[kind][i])
                    for kind, v in found.items()}  # fmt: skip
            values.append([sum(sums[kind] for kind in summed) for summed in SUMMED.values()])
        return [float((ahead - behind) / (2 * h)) for ahead, behind in zip(*values, strict=True)]


# ---- comparisons


def sizes(truth: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The largest of each kind, for each design; one where all are zero. Links that hardly turn are measured by the
    motion of their points."""
    found = {kind: np.max(np.abs(values), axis=-1) for kind, values in truth.items()}
    found["turn"] = np.maximum(found["turn"], found["velocity"] / found["position"])
    found["turning"] = np.maximum(found["turning"], found["acceleration"] / found["position"])
    return {kind: np.where(most > 0, most, 1.0) for kind, most in found.items()}


def conditions(batch: Batch, truth: dict[str, np.ndarray], rng) -> dict[str, np.ndarray]:
    """Condition number of every kind of result: the largest over some simultaneous changes of all numbers."""
    count = len(batch.phi)

    def many(x):
        return np.repeat(np.asarray(x, dtype=float)[None], CHANGES, 0).reshape(-1)

    def changed(x):  # a zero is exact
        return many(x) * (1 + CHANGE * rng.choice((-1.0, 1.0), CHANGES * count))

    scene = jax.tree.map(changed, batch.scene)
    with np.errstate(invalid="ignore"):
        there, _ = by_numpy(scene, changed(batch.phi), changed(batch.speed), changed(batch.acceleration))
    found, most = {}, sizes(truth)
    for kind, value in truth.items():
        apart = there[kind].reshape((CHANGES, count, -1)) - value
        found[kind] = np.nanmax(np.max(np.abs(apart), -1), 0) / (CHANGE * most[kind])
        assert np.all(np.isfinite(found[kind])), f"{batch.name}: no change of numbers left it assembled"
    return found


def judged(
    batch: Batch, rng: np.random.Generator, compiled: bool = False, exact: int = 999, slopes: int = 999
) -> Verdict:
    """All comparisons of a batch; some of its designs with 50 digits, and their derivatives, or without derivatives.
    Compiled or, since that takes minutes for a long chain of groups, step by step."""
    state = batch.phi, batch.speed, batch.acceleration
    truth, keys = by_numpy(batch.scene, *state)
    condition = conditions(batch, truth, rng)
    scales = sizes(truth)
    tangent = jax.tree_util.tree_map_with_path(
        lambda at, d: 0 * d if "reference_length" in jax.tree_util.keystr(at) else d * rng.normal(size=d.shape),
        batch.scene.mechanism,
    )
    paths = jax.device_get(paths_of(batch.scene.mechanism))
    program = at_once if compiled else computed
    with contextlib.nullcontext() if compiled else jax.disable_jit():
        if slopes:
            found, nested, slope = jax.device_get(program(batch.scene, paths, *state, tangent, scales, keys=keys))
        else:
            (found, nested), slope = jax.device_get(values_at_once(batch.scene, paths, *state, keys=keys)), ()
    over = {CLOSURE: closure(batch, found)}

    def compare(kind: str, road: str, known):
        off = np.max(np.abs(found[kind][: len(known)] - known), -1) / scales[kind][: len(known)]
        over[kind, road] = off / (PER_CONDITION * condition[kind][: len(known)] + BESIDES)

    for road, others in (("NumPy", truth), ("nested jvp", nested)):
        for kind, known in others.items():
            compare(kind, road, known)
    known = [by_mpmath(batch.one(i), *(float(x[i]) for x in state)) for i in range(len(batch.phi))[:exact]]
    for kind in KINDS:
        compare(kind, "mpmath", np.asarray([[float(x) for x in each[kind]] for each in known]))
    if not slopes:
        return Verdict(over, condition)
    some = range(len(batch.phi))[:slopes]
    known = np.asarray([_slopes_by_mpmath(batch, i, tangent, scales) for i in some]).T
    for name, true, ahead, back, size in zip(SUMMED, known, *(np.asarray(x).T for x in slope), strict=True):
        condition[name] = np.max([condition[kind] for kind in SUMMED[name]], axis=0)
        allowed = size * (PER_CONDITION * condition[name] + BESIDES)
        over[name, "forward and reverse"] = np.abs(ahead - back) / allowed
        over[name, "mpmath"] = np.abs(back[: len(some)] - true) / allowed[: len(some)]
    return Verdict(over, condition)


def closure(batch: Batch, found: dict[str, np.ndarray]) -> np.ndarray:
    """Closure errors of links and guides in the computed positions, relative to the size and to 1e-13."""
    mechanism = batch.scene.mechanism
    here = oracle.numbers(mechanism)
    places, directions = (v[:, 0::2] + 1j * v[:, 1::2] for v in (found["position"], found["direction"]))
    points = here.fixed | dict(zip(moving(mechanism), places.T, strict=True))
    u = dict(zip(sorted(mechanism.links), directions.T, strict=True)) | {"frame": 1.0}
    gaps = []

    def on_guide(guide, point: str, block: str):
        along = np.exp(1j * guide.along) * u[guide.on]
        gaps.append(((points[point] - points[guide.through]) / along).imag - guide.offset)
        gaps.append(reach * np.abs(u[block] - along))

    reach = np.max([np.abs(z) + 0 * batch.phi for z in (*points.values(), *here.length.values())], 0)
    for g, pins in zip(mechanism.groups, here.pins, strict=True):
        for link, (origin, far) in pins.items():
            gaps.append(reach * (np.abs(u[link]) - 1))
            if far is not None:
                gaps.append(np.abs(points[far] - points[origin]) - here.length[link])
                gaps.append(np.abs(points[far] - points[origin] - here.length[link] * here.axis[link] * u[link]))
            gaps += [np.abs(points[p] - points[origin] - at * u[link]) for p, at in here.bodies[link].places.items()]
        if isinstance(g, Crank):
            angle = g.sense * batch.phi if g.law is None else oracle.prescribed(g.law, batch.phi)
            gaps.append(reach * np.abs(u[g.link] * here.axis[g.link] - np.exp(1j * (g.phase + angle))))
        elif isinstance(g, LinearDriver):
            on_guide(g.guide, g.end, g.link)
        elif isinstance(g, RRP):
            on_guide(g.guide, g.end, g.block)
        elif isinstance(g, PRP):
            for block, slot in zip(g.blocks, g.slots, strict=True):
                on_guide(slot, g.meet, block)
        elif isinstance(g, RPR):
            gaps.append(((points[g.from_] - points[g.about]) / u[g.link]).imag - g.offset)
        elif isinstance(g, RPP):
            on_guide(g.guide, g.end, g.link)
            gaps.append(((points[g.from_] - points[g.end]) / u[g.block]).imag - g.offset)
            gaps.append(reach * np.abs(u[g.block] - u[g.link] * np.exp(1j * g.slot)))
        elif isinstance(g, Gear | Pinion | Rack):
            gaps += [reach * np.abs(gap) for gap in in_gear(g, batch, points, u)]
            if isinstance(g, Rack):
                on_guide(g.guide, g.end, g.link)
        elif isinstance(g, General):
            for link, pins in g.members:
                places = oracle.in_axes(g, mechanism)[link]
                gaps += [np.abs(points[p] - points[pins[0]] - places[p] * u[link]) for p in pins]
            for slot in g.slots:
                on_guide(slot.guide, dict(g.members)[slot.block][0], slot.block)
            gaps += [] if g.drive is None else [driven(g, batch.phi, points, u, reach)]
    return np.max(np.abs(gaps), 0) / (1e-13 * reach)


def driven(g: General, phi, points, u, reach) -> np.ndarray:
    """The closure error of the drive inside a group."""
    wanted, slot = oracle.stands(g.drive, phi), g.driven_slot()
    if slot is None:
        return reach * np.abs(u[g.drive.link] / u[g.drive.on] - np.exp(1j * (g.drive.phase + wanted)))
    guide, block = g.slots[slot].guide, dict(g.members)[g.drive.link][0]
    return ((points[block] - points[guide.through]) / (np.exp(1j * guide.along) * u[guide.on])).real - wanted


def in_gear(g, batch: Batch, points, u) -> list[np.ndarray]:
    """The closure errors of gears, as differences of unit vectors: of crank, planet and gears that follow the crank."""
    crank = batch.scene.mechanism.groups[0]
    turned = crank.sense * batch.phi if crank.law is None else oracle.prescribed(crank.law, batch.phi)
    counted = {"frame": 0.0, "crank": crank.phase + turned}
    for each in batch.scene.mechanism.groups:
        if isinstance(each, Gear):
            counted[each.link] = oracle.wheels.mesh_angle(each, lambda name: counted[name], np.asarray)
        elif isinstance(each, Pinion):
            ahead = ((points[each.at] - points[each.pivot]) / u[each.to]).real
            counted[each.link] = each.phase + each.side * ahead / each.radius
    if isinstance(g, Rack):
        ahead = ((points[g.end] - points[g.guide.through]) / u[g.link]).real
        return [np.abs(ahead - g.start - g.side * g.radius * counted[g.to]) / np.maximum(np.abs(ahead), g.radius)]
    return [u[g.link] - np.exp(1j * counted[g.link])]


def histogram(verdicts: list[Verdict]) -> list[str]:
    """Machines by decades of error relative to the tolerance, a line for each kind: the worst of all methods, then the
    worst of each; and the largest condition number."""
    edges = np.asarray([-np.inf, -4, -3, -2, -1, 0, np.inf])
    count, exact = (sum(len(v.over[road]) for v in verdicts) for road in (CLOSURE, ("position", "mpmath")))
    heads = "".join(f"{text:>7}" for text in ("<1e-4", "<1e-3", "<0.01", "<0.1", "<1", ">1", "cond."))
    lines = [
        f"{count} machines, {exact} of them with 50 digits, by decades of the error over what is allowed:",
        "".ljust(23) + heads + "  the worst",
    ]
    for kind in dict.fromkeys(kind for v in verdicts for kind, _ in v.over):
        roads: dict[str, list[np.ndarray]] = {}
        for road, each in ((road, each) for v in verdicts for (k, road), each in v.over.items() if k == kind):
            roads.setdefault(road, []).append(each)
        machines = [_most([each for (k, _), each in v.over.items() if k == kind]) for v in verdicts]
        with np.errstate(divide="ignore"):
            counts = np.histogram(np.log10(np.concatenate(machines)), edges)[0]
        condition = np.concatenate([v.condition.get(kind, np.zeros(0)) for v in verdicts])
        most = f"{np.max(condition):.0e}" if condition.size else ""
        worst = sorted(((np.max(np.concatenate(each)), road) for road, each in roads.items()), reverse=True)
        lines.append(kind.ljust(23) + "".join(f"{c:>7}" for c in (*counts, most)) + "  "
                     + ", ".join(f"{ratio:.1e} {road}" for ratio, road in worst))  # fmt: skip
    return lines


def _most(roads: list[np.ndarray]) -> np.ndarray:
    """The worst of all methods for every machine; some methods were used for the first machines only."""
    found = np.zeros(max((len(each) for each in roads), default=0))
    for each in roads:
        found[: len(each)] = np.maximum(found[: len(each)], each)
    return found
