"""The stages of an analysis: each is a program of its own, and the machine is evaluated in batches."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._batches import joined
from linkjax._compile import compiled_soon
from linkjax._numerics import taken, wrapped
from linkjax._search import MOTION_SCAN, scan_angles
from linkjax.analysis._blunt import continued, singular, without_joints
from linkjax.analysis._checks import Shown, checks_of
from linkjax.analysis._cycle import Checks, Flywheels, Margins
from linkjax.analysis._friction import RubbedOver, rubbed_over, rubbing_at, without_locked
from linkjax.analysis._loads import OnGrid
from linkjax.analysis._motor import MotorRun, motor_run
from linkjax.forces import Forces, forces_of_pose, meshes
from linkjax.kinematics import Pose, Reversals, find_dead_centres, find_margins, find_strokes
from linkjax.machine import ReadyScene, Scene
from linkjax.measures import peak_names, signed_rows, table
from linkjax.motion import (
    TIED,
    At,
    AtNodes,
    Grid,
    Peak,
    Place,
    Regime,
    Steady,
    all_loads,
    at_nodes,
    at_speed,
    by_node,
    crank_at,
    flywheel_on,
    grid_of,
    grid_with_kinks,
    node_places,
    on_pose,
    peaks,
    steady_by_diffrax,
    steady_on,
    textbook_flywheel,
    whole,
    with_kinks,
)
from linkjax.reduction import Reduced
from linkjax.sampling import Sample, Sampler

ROUNDING = 64.0  # units of rounding of the period: a time this close to zero is zero
MOTION = 10.0  # times the error of δ: the relative error of a force in the actual motion
FINE = 256  # nodes per turn, to integrate the inertia torque of a machine with a motion law


class Stages(NamedTuple):
    """The results of all stages of an analysis; those of an actual motion are None without one."""

    grid: Grid
    motion: Steady | None
    work: dict[str, Array] | None
    wheels: Flywheels | None
    limits: Margins
    dead: dict[str, Reversals]
    covered: dict[str, Array]
    spans: dict[str, Array]
    shown: Shown
    peaks: tuple[Peak, ...]
    rms: Array
    checks: Checks
    code: Array
    motor: MotorRun | None
    on_grid: OnGrid
    rubs: tuple[RubbedOver, ...]


def staged(machine: Sampler, angles: Array, nodes: int, method: str, moves: bool) -> Stages:
    """All stages, each a program of its own; the machine is evaluated in batches."""
    scene, turns = machine.scene, machine.scene.cycle_turns
    scanned = machine.sample(scan_angles(turns, MOTION_SCAN), gaps=True)

    def grid_with(added: Any) -> Grid:
        return grid_with_kinks(machine, nodes, scanned, MOTION_SCAN, moves=moves, added=added)

    grid = grid_with(0.0)
    at = at_nodes(machine, grid)
    motion, wheels = None, None
    if moves:
        if method == "diffrax":
            motion = machine.run(_by_diffrax, machine.ready, nodes=nodes)
            grid, at = motion.grid, at_nodes(machine, motion.grid)
        else:
            motion = steady_on(machine, grid, at)
        target = scene.target_delta
        if target is not None:
            wheels = flywheel_on(machine, target, grid, at, grid_with, motion.delta).inertia
    regime = Regime(machine, grid, motion)
    shown = _shown(regime, angles)
    tops, rms, rubs = _peaks(regime, at)
    limits = find_margins(machine, turns, scanned.margins, MOTION_SCAN)
    spans = _spans(machine, limits)
    dead = find_dead_centres(machine, turns, scanned.pose)
    covered = find_strokes(machine, dead, turns, scanned.pose)
    loaded = all_loads(machine, grid, at, motion)
    here = None if motion is None else loaded
    closing = _law_torque(machine) if moves and scene.mechanism.prescribed else None
    checks, code = machine.run(checks_of, scene, grid, motion, here, closing, angles, shown, limits)
    work, wheels = machine.run(_totals, scene, motion, here, wheels) if moves else (None, None)
    moved = shown.forces[0], shown.speed[0], shown.acceleration[0]
    motor = motor_run(machine, grid, at, motion, angles, shown.pose, moved)
    on_grid = OnGrid(grid, loaded, at.sample.dynamics[1])
    given = (grid, motion, work, wheels, limits, dead, covered, spans, shown, tops, rms, checks, code, motor)
    return Stages(*given, on_grid, rubs)


@compiled_soon(static=("nodes",))
def _by_diffrax(made: ReadyScene, nodes: int) -> Steady:
    return steady_by_diffrax(made, nodes)


@compiled_soon
def _totals(scene: Scene, motion: Steady, here: Reduced, wheel: Array | None) -> tuple[dict[str, Array], Flywheels]:
    """Work of the drive, of weight and of each load per cycle (J), and the flywheels."""
    grid, given, target = motion.grid, scene.mechanism.flywheel.inertia, scene.target_delta
    weights = grid.half[:, None] * grid.rule.w[None]
    work = {name: jnp.sum(weights * share) for name, share in here.by_load.items()}
    textbook = None if target is None else textbook_flywheel(motion, target)
    return {"drive": motion.mean_drive_torque * grid.length, **work}, Flywheels(given, wheel, textbook)


class Driven(NamedTuple):
    """The machine at many places, in the actual motion (if it exists) and at constant nominal speed: forces, crank
    speed (rad/s) and acceleration (rad/s²), each a tuple of them; and the vectors whose peaks are looked for, motion by
    motion, shape (quantities, 2, places)."""

    forces: tuple[Forces, ...]
    speed: tuple[Array, ...]
    acceleration: tuple[Array, ...]
    vectors: Array


def _driven(regime: Regime, at: At) -> Driven:
    """The machine at many places in both motions, in one program."""
    machine = regime.machine
    parts = machine.parts(_every_motion, (machine.whole_design, regime.grid, regime.steady), (at.place, at.sample))
    together = joined([part._replace(vectors=()) for part in parts])
    return together._replace(vectors=joined([part.vectors for part in parts], axis=-1))


@compiled_soon
def _every_motion(made: ReadyScene, grid: Grid, steady: Steady | None, place: Place, sample: Sample) -> Driven:
    scene, active = made.scene, taken(grid.active, place.panel)
    motions = [crank_at(grid, None, scene.speed, place, sample.dynamics, None)]
    if steady is not None:
        motions.insert(0, crank_at(grid, steady, scene.speed, place, sample.dynamics, sample.pose))
    speed, acceleration = zip(*motions, strict=True)

    def one(phi, side, here, active, speed, acceleration):
        return forces_of_pose(scene, here, made.instant(phi, side, speed), active, speed, acceleration)

    every = jax.vmap(one, in_axes=(0, 0, 0, 0, 0, 0))
    both = jax.vmap(every, in_axes=(None, None, None, None, 0, 0))
    forces = both(place.phi, place.side, sample.pose, active, jnp.stack(speed), jnp.stack(acceleration))
    each = tuple(jax.tree.map(lambda leaf, i=i: leaf[i], forces) for i in range(len(motions)))
    vectors = jnp.concatenate([table(scene, one) for one in each])
    return Driven(each, speed, acceleration, vectors)


def _shown(regime: Regime, angles: Array) -> Shown:
    """All results at the crank angles."""
    machine, grid = regime.machine, regime.grid
    at = regime.at(machine.run(_place, grid, angles))
    forces, speed, acceleration, _ = _driven(regime, at)
    reduced, assembled, time = machine.run(
        _at_angles, grid, regime.steady, at.place, at.sample.dynamics, at.sample.margins
    )
    if continued(machine.mechanism):
        forces = tuple(machine.run(_without_joints, machine.scene, at.sample.pose, each) for each in forces)
    pose, transmission, rubs = at.sample.pose, at.sample.transmission, ()
    if machine.scene.friction:
        given = machine.whole_design, grid
        each = [(at.place, pose, *moved) for moved in zip(forces, speed, acceleration, strict=True)]
        rubs = tuple(joined(machine.parts(rubbing_at, given, moved)) for moved in each)
        forces = tuple(machine.run(without_locked, each) for each in forces)
    every = (reduced,)
    if on_pose(machine.scene):
        steady = regime.steady
        constants = (None,) * len(speed)
        if steady is not None and steady.driven is not None:
            constants = (steady.driven.constant, *constants[1:])
        given = (whole(machine), grid, at.place, pose, reduced)
        every = tuple(machine.run(_with_speed, *given, *each) for each in zip(speed, constants, strict=True))
    return machine.cut(Shown(pose, transmission, every, forces, speed, acceleration, time, assembled, rubs), angles)


@compiled_soon
def _place(grid: Grid, angles: Array) -> Place:
    return jax.vmap(grid.place)(angles)


@compiled_soon
def _without_joints(scene: Scene, here: Pose, forces: Forces) -> Forces:
    return without_joints(scene.mechanism, here, forces)


@compiled_soon
def _at_angles(
    grid: Grid, motion: Steady | None, place: Place, dynamics: tuple, margins: Any
) -> tuple[Reduced, Array, Array | None]:
    """The reduced model at the angles shown, whether the mechanism can be assembled there, and the time (s)."""
    least = [margin.value for sides in margins.values() for margin in sides.values()]
    assembled = jnp.all(jnp.stack([*least, jnp.ones_like(place.phi)]) > 0, axis=0)
    time = None
    if motion is not None:
        late = motion.clock.at(place) - motion.clock.at(grid.place(jnp.zeros(())))
        time = within(late, motion.period)
    return grid.loaded(dynamics, place.panel), assembled, time


@compiled_soon
def _with_speed(
    scene: Scene | ReadyScene, grid: Grid, place: Place, pose: Pose, reduced: Reduced, speed: Array,
    constant: Array | None,
) -> Reduced:  # fmt: skip
    """The reduced model with the loads that depend on the speed, and friction."""
    return at_speed(scene, grid, place, pose, reduced, speed, constant)


def within(late: Array, period: Array) -> Array:
    """A delay (s) within a period; zero where it is only a rounding error, which may be negative: not a period."""
    rounding = ROUNDING * jnp.finfo(late.dtype).eps * period
    return jnp.where(jnp.abs(late) < rounding, 0.0, wrapped(late, period))


def _peaks(regime: Regime, at: AtNodes) -> tuple[tuple[Peak, ...], Any, Any]:
    """Peaks of all forces in the actual motion (if it exists) and at constant speed, the root mean square of the
    shaking force at constant speed, and `rubbed_over`, of no motion without friction."""
    machine, motions = regime.machine, 1 if regime.steady is None else 2
    if meshes(machine.mechanism) or machine.scene.friction:
        each = [regime, Regime(machine, regime.grid)][:motions]
        regime = with_kinks(each, [one.at(at.place, at.sample) for one in each])[0]
        nodes = regime.at(machine.run(node_places, regime.grid, edges=False))
    else:
        nodes = regime.at(at.place, at.sample)

    rows, driven = signed_rows(machine.scene), _driven(regime, nodes)
    found = driven.vectors
    rubs = machine.run(rubbed_over, regime.grid, driven.forces) if machine.scene.friction else ()
    at_nodes, raised, rms = machine.run(_by_quantity, regime.grid, found, motions=motions, rows=rows)

    def looked(regime, at):
        return machine.run(_looked, _driven(regime, at).vectors, raised, motions=motions, rows=rows)

    found = peaks(regime, looked, at_nodes)
    locked = tuple(each.locks for each in rubs)
    return machine.run(_told, machine.ready, regime.steady, found, raised, locked, motions=motions), rms, rubs


class Raised(NamedTuple):
    """Numbers with a sign, (motions, numbers): the sign of the one of largest magnitude, and an amount above all."""

    sign: Array
    above: Array


@compiled_soon(static=("motions", "rows"))
def _by_quantity(grid: Grid, found: Array, motions: int, rows: tuple[int, ...]) -> tuple[Array, Raised, Array]:
    """The vectors whose greatest length is looked for, at the nodes; and the root mean square of the shaking force."""
    at_nodes = by_node(grid, found)
    shaking = at_nodes[(motions - 1) * at_nodes.shape[0] // motions]  # the first quantity of the last motion
    weights = grid.half[:, None] * grid.rule.w[None]
    rms = jnp.sqrt(jnp.sum(weights * jnp.sum(shaking * shaking, axis=0)) / grid.length)
    numbers = at_nodes.reshape((motions, -1, *at_nodes.shape[1:]))[:, np.asarray(rows), 0]
    high, low = jnp.max(numbers, axis=(2, 3)), jnp.min(numbers, axis=(2, 3))
    above = 2 * jnp.maximum(jnp.abs(high), jnp.abs(low))
    raised = Raised(jnp.where(high >= -low, 1.0, -1.0), jnp.where(above > 0, above, 1.0))
    return _looked.function(at_nodes, raised, motions, rows), raised, rms


@compiled_soon(static=("motions", "rows"))
def _looked(vectors: Array, raised: Raised, motions: int, rows: tuple[int, ...]) -> Array:
    """The vectors whose greatest length is looked for: numbers with a sign raised above zero, where theirs is that of
    the largest magnitude; and then the same with the other sign, motion by motion."""
    every = vectors.reshape((motions, -1, *vectors.shape[1:]))
    own = every[:, np.asarray(rows)]
    shape = (*raised.sign.shape, *[1] * (vectors.ndim - 2))
    sign, above = raised.sign.reshape(shape), raised.above.reshape(shape)
    sides = [own.at[:, :, 0].set(above + way * own[:, :, 0]) for way in (sign, -sign)]
    both = jnp.concatenate([every.at[:, np.asarray(rows)].set(sides[0]), sides[1]], axis=1)
    return both.reshape((-1, *vectors.shape[1:]))


@compiled_soon(static=("motions",))
def _told(
    made: ReadyScene, motion: Steady | None, found: Peak, raised: Raised, locked: tuple[Array, ...], motions: int
) -> tuple[Peak, ...]:
    """The peaks by motion, in the order of `peak_names`: infinite where a group passes through a singular position, or
    friction locks the machine, in the actual motion with the error of the motion."""
    names, rows, told = peak_names(made.scene), signed_rows(made.scene), []
    boundless = singular(made.mechanism, names)
    forced = np.asarray(["_shaking_" not in name for name in names])
    size = found.value.size // motions
    for number in range(motions):
        own = Peak(*(part[number * size : (number + 1) * size] for part in found))
        every = _by_name(own, names, rows, raised.sign[number], raised.above[number])
        lost = boundless | (forced & locked[number]) if locked else boundless
        every = every._replace(value=jnp.where(lost, jnp.inf, every.value))
        if motion is not None and number == 0:  # in it, forces depend on the square of the speed and its slope
            every = every._replace(error=every.error + MOTION * motion.delta_error * jnp.abs(every.value))
        told.append(every)
    return tuple(told)


def _by_name(found: Peak, names: list[str], rows: tuple[int, ...], sign: Array, above: Array) -> Peak:
    """The peaks of one motion by name: of numbers with a sign the largest magnitude, the largest and smallest value."""
    base: dict[str, int] = {}
    which = [base.setdefault(name.partition("_")[2], len(base)) for name in names]
    ends = [np.asarray(each, np.int32) for each in (rows, range(found.value.size - len(rows), found.value.size))]
    one, other = (Peak(*(part[end] for part in found)) for end in ends)
    one = one._replace(value=sign * (one.value - above))
    other = other._replace(value=sign * (above - other.value))
    up = sign > 0
    sides = {"peak": _larger(one, other), "max": _of(up, one, other), "min": _of(up, other, one)}
    every = Peak(*(part[np.asarray(which, np.int32)] for part in found))
    for way, own in sides.items():
        places = [names.index(f"{way}_{row}") for row, at in base.items() if at in rows]
        every = Peak(*(part.at[np.asarray(places)].set(new) for part, new in zip(every, own, strict=True)))
    return every


def _of(first: Array, one: Peak, other: Peak) -> Peak:
    return Peak(*(jnp.where(first, a, b) for a, b in zip(one, other, strict=True)))


def _larger(one: Peak, other: Peak) -> Peak:
    """The peaks of larger magnitude, of numbers that have one of either sign."""
    one, other = (each._replace(value=jnp.abs(each.value)) for each in (one, other))
    first = one.value >= other.value
    both = _of(first, one, other)
    equal = jnp.minimum(one.value, other.value) >= (1 - TIED) * both.value
    return both._replace(tied=jnp.where(equal, jnp.where(first, other.angle, one.angle), both.tied))


def _spans(machine: Sampler, limits: Margins) -> dict[str, Any]:
    """Transmission angles at the least margins, where they are extreme."""
    if not limits:
        return {}
    least = [side.angle for sides in limits.values() for side in sides.values()]
    angles = machine.sample(machine.run(_stacked, least), dynamics=False, gaps=True).transmission
    counts = tuple((group, len(sides)) for group, sides in limits.items())
    return machine.run(_by_group, angles, counts=counts)


@compiled_soon
def _stacked(angles: list[Array]) -> Array:
    return jnp.stack(angles)


@compiled_soon(static=("counts",))
def _by_group(angles: dict[str, Array], counts: tuple[tuple[str, int], ...]) -> dict[str, Array]:
    found, first = {}, 0
    for group, count in counts:
        found |= {group: angles[group][first : first + count]} if group in angles else {}
        first += count
    return found


def _law_torque(machine: Sampler) -> tuple[Grid, Any]:
    """The inertia torque of a machine with a motion law at the nodes of a fine grid."""
    grid = grid_of(machine, FINE)
    at = at_nodes(machine, grid, edges=False)
    return grid, machine.run(_slope_torque, machine.scene, grid, at.sample.dynamics)


@compiled_soon
def _slope_torque(scene: Scene, grid: Grid, dynamics: tuple) -> Array:
    return 0.5 * dynamics[1][: grid.size].reshape(grid.nodes.shape) * scene.speed**2
