# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# pyright: reportOptionalMemberAccess=false, reportReturnType=false
"""A batch of random machines, judged: closure, coefficients, reactions and gradients by other roads, each error beside
what the problem's own condition allows.

The condition number of a result is the largest change of it, of its size, for a relative change of the numbers of the
machine, found by changing all of them in the NumPy oracle. Sizes are the largest of a kind in a machine: of all points,
of all links, of all joints. A result may be off by 1e-14 times its condition number, and 1e-12, of its size.
"""

from __future__ import annotations

import contextlib
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import mpmath
import numpy as np

from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.groups import PRP, RPP, RPR, RRP, Crank, Gear, General, Pinion, Rack, Slide, with_path
from linkjax.kinematics import pose, prepared
from linkjax.loads import Force, OpposingForce, Torque
from tests.physics import newton_euler, oracle
from tests.physics.random_machines import Batch

PLACES = ("position", "direction", "velocity", "acceleration", "turn", "turning")
KINDS = (*PLACES, "drive", "force", "moment")
PER_CONDITION, BESIDES = 1e-14, 1e-12
CHANGE, CHANGES = 1e-9, 12


class Verdict(NamedTuple):
    """Errors over what is allowed, by the name of the comparison, for every machine of a batch; and the condition
    numbers."""

    over: dict[str, np.ndarray]
    condition: dict[str, np.ndarray]


def moving(mechanism) -> list[str]:
    """Points that move."""
    pins = [p for g in mechanism.groups for p in g.brings()]
    own = [p for link in mechanism.links.values() for p in (link.centre_name, *link.point_names())]
    return sorted(set(pins + own) - set(mechanism.fixed))


# ---- linkjax


def results(scene, phi, speed, acceleration, keys) -> dict[str, jax.Array]:
    """What linkjax finds, a vector for each kind."""
    here = pose(scene.mechanism, phi)
    forces = kinetostatics(scene, phi, speed, acceleration)
    points = [here.points[p] for p in moving(scene.mechanism)]
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
        return _flat([here.points[p].r for p in moving(mechanism)]), _flat(u)

    def slope(phi):
        return jax.jvp(place, (phi,), (jnp.ones_like(phi),))[1]

    (_, u), (v, du) = place(phi), slope(phi)
    a, ddu = jax.jvp(slope, (phi,), (jnp.ones_like(phi),))[1]
    n = jnp.stack([-u[1::2], u[0::2]])
    turn, turning = (n[0] * x[0::2] + n[1] * x[1::2] for x in (du, ddu))
    return {"velocity": v, "acceleration": a, "turn": turn, "turning": turning}


def weights(count: int) -> np.ndarray:
    """How much each entry of a vector counts in the scalar that is differentiated."""
    return np.cos(1.0 + 1.7 * np.arange(count))


def computed(scene, paths, phi, speed, acceleration, tangent, scales, keys):
    """For every design, with the reference paths of its general groups: results, coefficients by nested
    differentiation, and of two weighted sums, the second of which counts reactions too, the derivative along a tangent,
    forward and in reverse, with the size of the scaled gradient."""

    def one(scene, paths, phi, speed, acceleration, tangent, scales):
        def scalars(mechanism):
            found = results(scene.with_mechanism(with_paths(mechanism, paths)), phi, speed, acceleration, keys)
            sums = {kind: found[kind] @ jnp.asarray(weights(found[kind].size)) / scales[kind] for kind in KINDS}
            most = sum(sums[kind] for kind in KINDS if kind not in ("force", "moment"))
            return jnp.stack([most, most + sums["force"] + sums["moment"]]), found

        ahead = jax.jvp(scalars, (scene.mechanism,), (tangent,), has_aux=True)[1]
        _, pull, found = jax.vjp(scalars, scene.mechanism, has_aux=True)
        back = [jax.tree.leaves(pull(jnp.asarray(row))[0]) for row in np.eye(2)]
        along, at = jax.tree.leaves(tangent), jax.tree.leaves(scene.mechanism)
        each = [sum(jnp.sum(g * t) for g, t in zip(row, along, strict=True)) for row in back]
        size = [jnp.sqrt(sum(jnp.sum((g * d) ** 2) for g, d in zip(row, at, strict=True))) for row in back]
        nested = _by_differentiation(with_paths(scene.mechanism, paths), phi)
        return found, nested, (ahead, jnp.stack(each), jnp.stack(size))

    return jax.vmap(one)(scene, paths, phi, speed, acceleration, tangent, scales)


def valued(scene, paths, phi, speed, acceleration, keys):
    """For every design: results, and coefficients by nested differentiation."""

    def one(scene, paths, phi, speed, acceleration):
        scene = scene.with_mechanism(with_paths(scene.mechanism, paths))
        return results(scene, phi, speed, acceleration, keys), _by_differentiation(scene.mechanism, phi)

    return jax.vmap(one)(scene, paths, phi, speed, acceleration)


def with_paths(mechanism, paths):
    """The mechanism with reference paths of its general groups, which belong to no design's numbers."""
    groups = tuple(with_path(g, paths[i]) if i in paths else g for i, g in enumerate(mechanism.groups))
    return eqx.tree_at(lambda m: m.groups, mechanism, groups) if paths else mechanism


@jax.jit
def paths_of(mechanism):
    """The reference paths of all designs, by the number of the group."""
    found = jax.vmap(prepared)(mechanism).groups
    return {i: g.path for i, g in enumerate(found) if isinstance(g, General)}


at_once, values_at_once = (compiled_soon(each, static=("keys",)) for each in (computed, valued))


# ---- by other roads


def by_numpy(scene, phi, speed, acceleration) -> tuple[dict[str, np.ndarray], tuple]:
    """The same from the oracle in NumPy, and the keys of the reactions; the designs along the first axis."""
    here = oracle.rates(scene.mechanism, phi)
    forces = newton_euler.solve(scene, phi, speed, acceleration)
    points = [here.points[p] for p in moving(scene.mechanism)]
    links = [here.links[name] for name in sorted(here.links)]
    keys = tuple(sorted(forces.reactions))
    found = {
        "position": _parts([p.r for p in points]),
        "direction": _parts([link.r for link in links]),
        "velocity": _parts([p.v for p in points]),
        "acceleration": _parts([p.a for p in points]),
        "turn": np.stack([link.v for link in links], -1),
        "turning": np.stack([link.a for link in links], -1),
        "drive": forces.drive[..., None],
        "force": _parts([forces.reactions[key][0] for key in keys]),
        "moment": np.stack([forces.reactions[key][1] for key in keys], -1),
    }
    return found, keys


def _parts(values) -> np.ndarray:
    return np.stack([part for z in values for part in (z.real, z.imag)], -1)


def by_mpmath(scene, phi: float, speed: float, acceleration: float, digits: int = 50, step: str = "1e-13"):
    """One design with 50 digits: places and coefficients, and the drive torque by virtual power."""
    mechanism = scene.mechanism
    here = oracle.exact(mechanism, phi, digits, step)
    points = [here.points[p] for p in moving(mechanism)]
    links = [here.links[name] for name in sorted(here.links)]
    with mpmath.workdps(digits):
        return {
            "position": _split([p.r for p in points]),
            "direction": _split([link.r for link in links]),
            "velocity": _split([p.v for p in points]),
            "acceleration": _split([p.a for p in points]),
            "turn": [link.v.real for link in links],
            "turning": [link.a.real for link in links],
            "drive": [_virtual_power(scene, here, mpmath.mpf(speed), mpmath.mpf(acceleration))],
        }


def _split(values) -> list:
    return [part for z in values for part in (z.real, z.imag)]


def _virtual_power(scene, here: oracle.Rates, speed, acceleration):
    """What the drive must give for the change of kinetic energy, less what weights and loads give."""
    n, mechanism = oracle.reader(mpmath), scene.mechanism
    shaft, wheel = here.links[mechanism.crank], n(mechanism.flywheel.inertia)
    inertia, half_slope, given = wheel * shaft.v**2, wheel * shaft.v * shaft.a, mpmath.mpf(0)
    gravity = n(scene.gravity.x) + 1j * n(scene.gravity.y)
    for name, b in oracle.numbers(mechanism, mpmath).bodies.items():
        s, turn = here.points[next(iter(b.places))], here.links[name]
        inertia += b.mass * abs(s.v) ** 2 + b.inertia * turn.v**2
        half_slope += b.mass * (s.v.conjugate() * s.a).real + b.inertia * turn.v * turn.a
        given += b.mass * (gravity.conjugate() * s.v).real
    for load in scene.loads:
        if isinstance(load, Torque):
            given += n(load.torque) * here.links[load.link].v
        elif isinstance(load, Force):
            given += ((n(load.force.x) - 1j * n(load.force.y)) * here.points[load.point].v).real
        else:
            assert isinstance(load, OpposingForce)
            given -= n(load.magnitude) * abs(here.points[load.point].v)
    return (inertia * acceleration + half_slope * speed**2 - given).real


def _slope_by_mpmath(batch: Batch, i: int, tangent, scales) -> float:
    """Derivative of the weighted sum, without reactions, along the tangent: a difference of values with 80 digits."""
    scene, at = batch.one(i), (float(x[i]) for x in (batch.phi, batch.speed, batch.acceleration))
    phi, speed, acceleration = at
    along, values = jax.tree.map(lambda leaf: float(leaf[i]), tangent), []
    with mpmath.workdps(80):
        h = mpmath.mpf("1e-10")
        for sign in (1, -1):
            there = jax.tree.map(lambda d, t, s=sign: mpmath.mpf(float(d)) + s * h * t, scene.mechanism, along)
            there = _with(scene, there)
            found = by_mpmath(there, phi, speed, acceleration, 80, "1e-18")
            sums = [sum(w * x for w, x in zip(weights(len(v)), v, strict=True)) / float(scales[kind][i])
                    for kind, v in found.items()]  # fmt: skip
            values.append(sum(sums))
        return float((values[0] - values[1]) / (2 * h))


def _with(scene, mechanism):
    """The scene with another mechanism, whose numbers are no arrays."""
    leaves, tree = jax.tree.flatten(scene)
    inside = len(jax.tree.leaves(scene.mechanism))
    return jax.tree.unflatten(tree, [*jax.tree.leaves(mechanism), *leaves[inside:]])


# ---- comparisons


def sizes(truth: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The largest of each kind, for each design; one where all are zero. Links that hardly turn are measured by what
    their points move."""
    found = {kind: np.max(np.abs(values), axis=-1) for kind, values in truth.items()}
    found["turn"] = np.maximum(found["turn"], found["velocity"] / found["position"])
    found["turning"] = np.maximum(found["turning"], found["acceleration"] / found["position"])
    return {kind: np.where(most > 0, most, 1.0) for kind, most in found.items()}


def conditions(batch: Batch, truth: dict[str, np.ndarray], rng) -> dict[str, np.ndarray]:
    """Condition number of every kind of result: the largest over some changes of all numbers at once."""
    count = len(batch.phi)

    def many(x):
        return np.repeat(np.asarray(x, dtype=float)[None], CHANGES, 0).reshape(-1)

    def changed(x):
        x = np.asarray(x, dtype=float)
        reach = np.maximum(np.abs(x), np.sqrt(np.mean(x**2)))
        return many(x) + CHANGE * many(reach) * rng.choice((-1.0, 1.0), CHANGES * count)

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
    """All comparisons of a batch; so many of its designs with 50 digits, and their derivatives, or no derivatives at
    all. Compiled or, since that takes minutes for a long chain of groups, step by step."""
    state = batch.phi, batch.speed, batch.acceleration
    truth, keys = by_numpy(batch.scene, *state)
    condition = conditions(batch, truth, rng)
    scales = sizes(truth)
    tangent = jax.tree_util.tree_map_with_path(
        lambda at, d: 0 * d if "reference_length" in jax.tree_util.keystr(at) else d * rng.normal(size=d.shape),
        batch.scene.mechanism,
    )
    general = any(isinstance(g, General) for g in batch.scene.mechanism.groups)
    paths = jax.device_get(paths_of(batch.scene.mechanism)) if general else {}
    program = at_once if compiled else computed
    with contextlib.nullcontext() if compiled else jax.disable_jit():
        if slopes:
            found, nested, slope = jax.device_get(program(batch.scene, paths, *state, tangent, scales, keys=keys))
        else:
            (found, nested), slope = jax.device_get(values_at_once(batch.scene, paths, *state, keys=keys)), ()
    over = {"closure": closure(batch, found)}

    def compare(name: str, kind: str, value, known, only: slice = slice(None)):
        off = np.max(np.abs(value[only] - known), -1) / scales[kind][only]
        over[name] = off / (PER_CONDITION * condition[kind][only] + BESIDES)

    for kind in nested:
        compare(f"{kind} by nested jvp", kind, found[kind], nested[kind])
    for kind in KINDS:
        compare(f"{kind} by NumPy", kind, found[kind], truth[kind])
    some = slice(0, exact)
    known = [by_mpmath(batch.one(i), *(float(x[i]) for x in state)) for i in range(len(batch.phi))[some]]
    for kind in known[0] if known else ():
        name = "drive by virtual power" if kind == "drive" else f"{kind} by mpmath"
        compare(name, kind, found[kind], np.asarray([[float(x) for x in each[kind]] for each in known]), some)
    worst = np.max([condition[kind] for kind in KINDS], axis=0)
    allowed = PER_CONDITION * worst + BESIDES
    if not slopes:
        return Verdict(over, condition | {"gradient": worst})
    ahead, back, size = (np.asarray(x).T for x in slope)
    for name, row in (("gradient", 0), ("gradient with reactions", 1)):
        over[f"{name}: forward and reverse"] = np.abs(ahead - back)[row] / (size[row] * allowed)
    some = range(len(batch.phi))[:slopes]
    known = np.asarray([_slope_by_mpmath(batch, i, tangent, scales) for i in some])
    over["gradient by mpmath"] = np.abs(back[0, : len(some)] - known) / (size[0] * allowed)[: len(some)]
    return Verdict(over, condition | {"gradient": worst})


def closure(batch: Batch, found: dict[str, np.ndarray]) -> np.ndarray:
    """What links and guides leave open in the positions that were found, of the size and of 1e-13."""
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
            angle = g.turns * batch.phi if g.law is None else oracle.prescribed(g.law, batch.phi)
            gaps.append(reach * np.abs(u[g.link] * here.axis[g.link] - np.exp(1j * (g.phase + angle))))
        elif isinstance(g, Slide):
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
    """What the drive inside a group leaves open."""
    wanted, slot = oracle.stands(g.drive, phi), g.driven_slot()
    if slot is None:
        return reach * np.abs(u[g.drive.link] / u[g.drive.on] - np.exp(1j * (g.drive.phase + wanted)))
    guide, block = g.slots[slot].guide, dict(g.members)[g.drive.link][0]
    return ((points[block] - points[guide.through]) / (np.exp(1j * guide.along) * u[guide.on])).real - wanted


def in_gear(g, batch: Batch, points, u) -> list[np.ndarray]:
    """What wheels leave open, as differences of unit vectors: of crank, planet and wheels that follow the crank."""
    crank = batch.scene.mechanism.groups[0]
    turned = crank.turns * batch.phi if crank.law is None else oracle.prescribed(crank.law, batch.phi)
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


def histogram(verdicts: list[Verdict]) -> str:
    """Machines by decades of error over what is allowed, a line for each comparison; and of the condition numbers."""
    edges = np.asarray([-np.inf, -5, -4, -3, -2, -1, 0, np.inf])
    lines = ["error over what is allowed, decades".ljust(44) + "".join(
        f"{text:>7}" for text in ("<1e-5", "1e-4", "1e-3", "1e-2", "1e-1", "1", ">1", "worst"))]  # fmt: skip
    for name in {name: None for v in verdicts for name in v.over}:
        every = np.concatenate([v.over[name] for v in verdicts if name in v.over])
        with np.errstate(divide="ignore"):
            counts = np.histogram(np.log10(every), edges)[0]
        lines.append(name.ljust(44) + "".join(f"{c:>7}" for c in counts) + f" {np.max(every):.1e}")
    lines.append("condition numbers, decades".ljust(44) + "".join(f"{f'1e{k}':>7}" for k in range(1, 9)) + "  worst")
    for kind in verdicts[0].condition:
        every: Any = np.concatenate([v.condition[kind] for v in verdicts])
        counts = np.histogram(np.log10(np.maximum(every, 1)), [0, 1, 2, 3, 4, 5, 6, 7, 99])[0]
        lines.append(kind.ljust(44) + "".join(f"{c:>7}" for c in counts) + f" {np.max(every):.1e}")
    return "\n".join(lines)
