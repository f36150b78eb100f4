"""The complete analysis of a working cycle in one call."""

from __future__ import annotations

import warnings
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._batches import PLACES
from linkjax._compile import compiled_soon, planned
from linkjax._numerics import safe_divide, taken, wrapped
from linkjax._results import Result, merge
from linkjax._types import Tracer, as_float
from linkjax._vec import Vec
from linkjax.analysis._blunt import continued, singular, without_joints
from linkjax.analysis._cycle import Checks, Cycle, Flywheels, Margins, explain, explain_start
from linkjax.analysis._missing import massless, only_what_exists
from linkjax.analysis._precision import FEWEST, fewest_digits
from linkjax.forces import Forces, driven_by_joint, forces_of_pose
from linkjax.groups import PointState, closed_to
from linkjax.kinematics import SCAN, Pose, Reversals, find_dead_centres, find_margins, find_strokes, scan_angles
from linkjax.loads import Instant
from linkjax.machine import Scene, check_scene, ready
from linkjax.measures import peak_names, table
from linkjax.mechanism import StructureError
from linkjax.motion import (
    At,
    AtNodes,
    Grid,
    Peak,
    Place,
    Regime,
    Steady,
    at_nodes,
    by_node,
    crank_at,
    flywheel_on,
    grid_of,
    peaks,
    primitive,
    steady_by_diffrax,
    steady_on,
    textbook_flywheel,
)
from linkjax.reduction import Reduced
from linkjax.sampling import Ahead, Sampler

MOTION = 10.0  # times the error of δ: the relative error of a force in the actual motion
FINE = 256  # nodes per turn, to integrate the inertia torque of a machine with a motion law
ENOUGH = 192  # crank angles that make a batch
LIGHTEST = 1e-6  # least reduced inertia divided by its mean; below it the crank would turn a thousand times faster


def analyse(
    scene: Scene,
    *,
    angles: Any = 360,
    nodes: int = 96,
    constant_speed: bool | None = None,
    method: Literal["quadrature", "diffrax"] = "quadrature",
    throw: bool = True,
) -> Cycle:
    """Analyse a working cycle: kinematics, reduction, actual motion, forces, peaks, flywheel, checks.

    `angles` is a number of uniform crank angles over the cycle or an array of crank angles (rad). `nodes` is the number
    of nodes of the cycle grid per crank turn. With `constant_speed` (default: that of the scene) the crank turns at
    constant nominal speed and the actual motion is not computed. `method` gives the actual motion: by quadrature of the
    energy equation, or by diffrax from the equation of motion; the latter has forward derivatives only (`jax.jvp`), and
    `motion.steady_by_diffrax` takes another adjoint.
    Raises `MachineError` (a ValueError) with group, angle, shortfall and remedy if the linkage cannot be assembled;
    with `throw=False`, and under jax transformations, `result` holds the code instead. If no actual motion exists (no
    inertia, or too low a speed), everything else is computed and `Cycle.missing` gives the reason. Raises
    `StructureError` for diffrax if the driver has a motion law, and ValueError for fewer than 8 nodes.
    """
    check_scene(scene)
    if nodes < 8:
        raise ValueError(f"nodes must be at least 8, but is {nodes}; 96 gives about ten digits")
    scene, angles = jax.tree.map(as_float, scene), _angles(scene, angles)
    if scene.speed.dtype == jnp.float32:
        warnings.warn(
            "linkjax computes in float32: at most about six digits of δ, fewer near singular positions, and checks "
            "near 1e-6; call linkjax.enable_x64() before loading the scene for full precision",
            stacklevel=2,
        )
    if scene.mechanism.prescribed and method == "diffrax":
        problem = "has a motion law: its motion is known, so there is no equation of motion to solve"
        raise StructureError(scene.mechanism.driving_link, problem, "use the quadrature, or delete the law")
    if method not in ("quadrature", "diffrax"):
        raise ValueError(f'method must be "quadrature" or "diffrax", but is {method!r}')
    constant_speed = scene.constant_speed if constant_speed is None else constant_speed
    cycle = only_what_exists(_analyse(scene, angles, nodes, constant_speed, method, throw))
    if throw and not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(cycle)):
        explain(cycle)
    if scene.speed.dtype == jnp.float32 and not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(cycle)):
        left = fewest_digits(cycle)
        if left < FEWEST:
            warnings.warn(
                f"float32 gives this machine about {max(left, 0.0):.1f} digits, by its margins and checks; call "
                "linkjax.enable_x64() before loading the scene",
                stacklevel=2,
            )
    return cycle


analyze = analyse


def compile_ahead(scene: Scene, *, angles: Any = 360, nodes: int = 96, method: str = "quadrature") -> None:
    """Start compiling what `analyse` needs for scenes of this topology, in other threads."""
    scene = ready(jax.tree.map(as_float, scene))
    _ahead(scene, _angles(scene, angles), nodes, method, _moves(scene, scene.constant_speed))


def _angles(scene: Scene, angles: Any) -> Array:
    """The crank angles (rad): uniform ones from their number, or those of an array."""
    if isinstance(angles, int | np.integer) and not isinstance(angles, bool):
        if angles < 1:
            raise ValueError(f"angles must be at least 1, but is {angles}; 360 gives whole degrees")
        return jnp.arange(int(angles), dtype=float) * (scene.cycle / int(angles))
    found = jnp.asarray(angles, dtype=float)
    if found.ndim != 1 or found.size == 0:
        raise ValueError(
            f"angles must be an integer or a list of crank angles in rad, but has the shape {found.shape}; "
            "write e.g. angles=360 or angles=jnp.linspace(0, 1, 50)"
        )
    return found


def _analyse(scene: Scene, angles: Array, nodes: int, constant_speed: bool, method: str, throw: bool) -> Cycle:
    """The analysis in stages. The actual motion is omitted at constant speed, and if nothing has a mass."""
    given, scene = scene, ready(scene)
    moves = _moves(scene, constant_speed)
    if not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((scene, angles))):
        if throw:
            explain_start(scene)
        _ahead(scene, angles, nodes, method, moves)
    found = _staged(Sampler(scene, _size(angles)), angles, nodes, method, moves)
    shown, motion, still = found.shown, found.motion, not constant_speed and found.motion is None
    return Cycle(
        scene=given, angles=angles, pose=shown.pose, transmission=shown.transmission, transmission_ends=found.spans,
        margins=found.limits, dead_centres=found.dead, strokes=found.covered, reduced=shown.reduced, steady=motion,
        speed=shown.speed[0] if moves else None, acceleration=shown.acceleration[0] if moves else None,
        time=shown.time, forces=None if still else shown.forces[-1 if constant_speed else 0],
        forces_constant_speed=shown.forces[-1], peaks=found.peaks[0] if moves else None,
        peaks_constant_speed=found.peaks[-1], rms_shaking_force_constant_speed=found.rms, flywheel=found.wheels,
        work=found.work, checks=found.checks, assembled=shown.assembled,
        result=merge(found.code, jnp.where(still, Result.NO_INERTIA, 0)), constant_speed=constant_speed, method=method,
        nodes=found.grid.size,
    )  # fmt: skip


def _ahead(scene: Scene, angles: Array, nodes: int, method: str, moves: bool) -> None:
    """Start compiling all stages at once, each from the shapes of the results before."""
    leaves, tree = jax.tree.flatten(scene)
    if not planned((tree, tuple((leaf.shape, leaf.dtype) for leaf in leaves), angles.size, nodes, method, moves)):
        _staged(Ahead(scene, _size(angles)), angles, nodes, method, moves)


def _size(angles: Array) -> int:
    """Places of a batch: as many as crank angles, so that these results are not padded."""
    return angles.size if ENOUGH <= angles.size <= 2 * PLACES else PLACES


def _moves(scene: Scene, constant_speed: bool) -> bool:
    """Whether the actual motion is computed: always with a motion law, otherwise unless the speed is constant, or
    nothing has a mass and no flywheel is required."""
    lifeless = massless(scene) and scene.target_delta is None
    return scene.mechanism.prescribed or not (constant_speed or lifeless)


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


def _staged(machine: Sampler, angles: Array, nodes: int, method: str, moves: bool) -> Stages:
    """All stages, each a program of its own; the machine is evaluated in batches."""
    scene, turns = machine.scene, machine.scene.cycle_turns
    scanned = machine.sample(scan_angles(turns, SCAN), gaps=True)
    grid = grid_of(machine, nodes, scanned, SCAN)
    at = at_nodes(machine, grid)
    motion, wheels = None, None
    if moves:
        motion = machine.run(_by_diffrax, scene, nodes=nodes) if method == "diffrax" else steady_on(machine, grid, at)
        target = scene.target_delta
        wheels = None if target is None else flywheel_on(machine, target, grid, at, motion.delta)
    regime = Regime(machine, grid, motion)
    shown = _shown(regime, angles)
    tops, rms = _peaks(regime, at)
    limits = find_margins(machine, turns, scanned.margins, SCAN)
    spans = _spans(machine, limits)
    dead = find_dead_centres(machine, turns, scanned.pose)
    covered = find_strokes(machine, dead, turns, scanned.pose)
    here = None if motion is None else at.here
    closing = _law_torque(machine) if moves and scene.mechanism.prescribed else None
    checks, code = machine.run(_checks, scene, grid, motion, here, closing, angles, shown, limits)
    work, wheels = machine.run(_totals, scene, motion, here, wheels) if moves else (None, None)
    return Stages(grid, motion, work, wheels, limits, dead, covered, spans, shown, tops, rms, checks, code)


class Shown(NamedTuple):
    """Results at the crank angles asked for; `forces`, `speed` and `acceleration` in the actual motion (if it exists)
    and at constant speed."""

    pose: Pose
    transmission: dict[str, Array]
    reduced: Reduced
    forces: tuple[Forces, ...]
    speed: tuple[Array, ...]
    acceleration: tuple[Array, ...]
    time: Array | None
    assembled: Array


@compiled_soon(static=("nodes",))
def _by_diffrax(scene: Scene, nodes: int) -> Steady:
    return steady_by_diffrax(scene, nodes)


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
    motion, shape (places, quantities, 2)."""

    forces: tuple[Forces, ...]
    speed: tuple[Array, ...]
    acceleration: tuple[Array, ...]
    vectors: Array


def _driven(regime: Regime, at: At) -> Driven:
    """The machine at many places in both motions, in one program."""
    machine = regime.machine
    return machine.run(_every_motion, machine.whole_design, regime.grid, regime.steady, at)


@compiled_soon
def _every_motion(scene: Scene, grid: Grid, steady: Steady | None, at: At) -> Driven:
    place, sample, active = at.place, at.sample, taken(grid.active, at.place.panel)
    motions = [crank_at(grid, None, scene.speed, place, sample.dynamics)]
    if steady is not None:
        motions.insert(0, crank_at(grid, steady, scene.speed, place, sample.dynamics))
    speed, acceleration = zip(*motions, strict=True)

    def one(phi, side, here, active, speed, acceleration):
        return forces_of_pose(scene, here, Instant(phi, side), active, speed, acceleration)

    every = jax.vmap(one, in_axes=(0, 0, 0, 0, 0, 0))
    both = jax.vmap(every, in_axes=(None, None, None, None, 0, 0))
    forces = both(sample.phi, sample.side, sample.pose, active, jnp.stack(speed), jnp.stack(acceleration))
    vectors = jnp.concatenate(list(table(scene, forces)), axis=1)
    each = tuple(jax.tree.map(lambda leaf, i=i: leaf[i], forces) for i in range(len(motions)))
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
    pose, transmission = at.sample.pose, at.sample.transmission
    return machine.cut(Shown(pose, transmission, reduced, forces, speed, acceleration, time, assembled), angles)


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
        begin = motion.clock.at(grid.place(jnp.zeros(())))
        time = wrapped(motion.clock.at(place) - begin, motion.period)
    return grid.loaded(dynamics, place.panel), assembled, time


def _peaks(regime: Regime, at: AtNodes) -> tuple[tuple[Peak, ...], Array]:
    """Peaks of all forces in the actual motion (if it exists) and at constant speed, and the root mean square of the
    shaking force at constant speed."""
    machine, motions = regime.machine, 1 if regime.steady is None else 2

    def vectors(regime, at):
        return _driven(regime, at).vectors

    found = vectors(regime, At(machine.padded(at.place), at.sample))
    at_nodes, rms = machine.run(_by_quantity, regime.grid, found, motions=motions)
    found = peaks(regime, vectors, at_nodes)
    return machine.run(_told, machine.scene, regime.steady, found, motions=motions), rms


@compiled_soon(static=("motions",))
def _by_quantity(grid: Grid, found: Array, motions: int) -> tuple[Array, Array]:
    at_nodes = by_node(grid, found)
    shaking = at_nodes[(motions - 1) * at_nodes.shape[0] // motions]  # the first quantity of the last motion
    weights = grid.half[:, None] * grid.rule.w[None]
    return at_nodes, jnp.sqrt(jnp.sum(weights * jnp.sum(shaking * shaking, axis=0)) / grid.length)


@compiled_soon(static=("motions",))
def _told(scene: Scene, motion: Steady | None, found: Peak, motions: int) -> tuple[Peak, ...]:
    """The peaks by motion: infinite where a group passes through a singular position, in the actual motion with the
    error of the motion."""
    names = peak_names(scene)
    count = len(names)
    boundless = jnp.tile(singular(scene.mechanism, names), motions)
    found = found._replace(value=jnp.where(boundless, jnp.inf, found.value))
    if motion is not None:  # in it, forces depend on the square of the speed and its slope
        inexact = jnp.where(jnp.arange(2 * count) < count, MOTION * motion.delta_error * found.value, 0.0)
        found = found._replace(error=found.error + inexact)
    return tuple(Peak(*(part[i * count : (i + 1) * count] for part in found)) for i in range(motions))


def _spans(machine: Sampler, limits: Margins) -> dict[str, Array]:
    """Transmission angles at the least margins, where they are extreme."""
    if not limits:
        return {}
    least = [side.angle for sides in limits.values() for side in sides.values()]
    angles = machine.sample(machine.run(_stacked, least), gaps=True).transmission
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


def _law_torque(machine: Sampler) -> tuple[Grid, Array]:
    """The inertia torque of a machine with a motion law at the nodes of a fine grid."""
    grid = grid_of(machine, FINE)
    at = at_nodes(machine, grid, edges=False)
    return grid, machine.run(_slope_torque, machine.scene, grid, at.sample.slope)


@compiled_soon
def _slope_torque(scene: Scene, grid: Grid, slope: Array) -> Array:
    return 0.5 * slope[: grid.size].reshape(grid.nodes.shape) * scene.speed**2


@compiled_soon
def _checks(
    scene: Scene,
    grid: Grid,
    motion: Steady | None,
    here: Reduced | None,
    closing: tuple[Grid, Array] | None,
    angles: Array,
    at: Shown,
    limits: Margins,
) -> tuple[Checks, Array]:
    """The checks of the analysis, and its result code."""
    bodies = _masses(at)
    motions = jax.tree.map(lambda *leaves: jnp.stack(leaves), *zip(at.forces, at.speed, at.acceleration, strict=True))
    found = jax.vmap(lambda given: _residuals(scene, at, bodies, *given))(motions)
    power, balance = (jnp.max(part) for part in found)
    none = {"loops": closed_to(power.dtype)}  # a singular value is zero only to rounding
    every = [m.value - none.get(side, 0.0) for sides in limits.values() for side, m in sides.items()]
    least = jnp.min(jnp.stack([jnp.ones(()), *every]))
    codes = [
        jnp.where(grid.overflow, Result.TOO_MANY_REVERSALS, 0),
        jnp.where(least > 0, 0, Result.CANNOT_BE_ASSEMBLED),
    ]
    if motion is None or here is None:
        return Checks(power, None, balance), merge(*codes)
    codes += [
        jnp.where(jnp.isinf(motion.delta_error), Result.INTEGRATION_FAILED, 0),
        jnp.where(motion.steady_state_margin > 0, 0, Result.NO_PERIODIC_REGIME),
        jnp.where(motion.min_inertia_ratio > LIGHTEST, 0, Result.NO_INERTIA),
    ]
    return Checks(power, _energy_closure(scene, motion, here, closing, angles, at, bodies), balance), merge(*codes)


class Masses(NamedTuple):
    """All masses of the links at the angles shown: mass (kg), inertia (kg m²), states of their centres, and rotation of
    their links; leaves of shape (masses, angles)."""

    mass: Array
    inertia: Array
    at: PointState
    w: Array
    e: Array


def _masses(at: Shown) -> Masses:
    pose = at.pose
    places = [(pose.points[place], pose.links[link]) for link, place, _ in pose.heavy()]
    mass, inertia = (jnp.stack(part) for part in zip(*(body for *_, body in pose.heavy()), strict=True))
    point = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(point for point, _ in places))
    return Masses(mass, inertia, point, *(jnp.stack([getattr(link, name) for _, link in places]) for name in "we"))


def _residuals(
    scene: Scene, at: Shown, bodies: Masses, forces: Forces, speed: Array, acceleration: Array
) -> tuple[Array, Array]:
    """Virtual power and force balance in one of the two motions, relative to the largest term of the sums, because in a
    balanced machine the sums themselves are zero. At a change point drive torque and frame forces come from these sums,
    so only the power is compared there, with the reduced model."""
    crank = at.pose.links[scene.mechanism.driving_link].w
    inertia, slope, torque = at.reduced[:3]
    parts = inertia * acceleration, 0.5 * slope * speed**2, -torque
    power, point = jnp.abs(forces.drive_torque - sum(parts)), bodies.at
    about = at.pose.points[scene.mechanism.groups[0].needs()[0]].r
    reach = jnp.max(_length(point.r - Vec(about.x[None], about.y[None])), axis=0, initial=0.0)
    square, slow = speed[None] ** 2, acceleration[None]
    pull = jnp.abs(bodies.mass * _length(point.ddr * square + point.dr * slow))
    spin = jnp.abs(bodies.inertia * (bodies.e * square + bodies.w * slow) * bodies.w)
    size = sum(jnp.abs(share) for share in at.reduced.by_load.values())
    size = size + scene.mechanism.flywheel.inertia * jnp.abs(acceleration * crank)
    size = size + jnp.sum(pull * _length(point.dr) + spin, axis=0)
    joints = [side for sides in forces.reactions.values() for side in sides.values()]
    sides = jnp.stack([jnp.stack([side.fx for side in joints]), jnp.stack([side.fy for side in joints])])
    sides = jnp.where(jnp.isnan(sides), 0.0, sides)  # joints at a change point
    heavy = jnp.max(jnp.maximum(jnp.sum(pull, axis=0), jnp.max(_length(Vec(*sides)), axis=0)))
    sources = [jnp.stack(part) for part in zip(forces.shaking, forces.weight, forces.loads, strict=True)]
    drive = jnp.zeros_like(power) if driven_by_joint(scene.mechanism) else crank * forces.drive_torque
    moments = jnp.concatenate([drive[None], sources[2]])
    turning = jnp.max(jnp.sum(jnp.abs(moments), axis=0) + reach * heavy)
    twist = jnp.max(jnp.abs(forces.frame.moment - jnp.sum(moments, axis=0)))
    rest = [forces.frame[k] - jnp.sum(sources[k], axis=0) for k in (0, 1)]
    balance = jnp.maximum(safe_divide(jnp.max(jnp.hypot(*rest)), heavy), safe_divide(twist, turning))
    return safe_divide(jnp.max(power), jnp.max(size)), balance


def _length(v: Vec) -> Array:
    return jnp.sqrt(v.squared())


def _energy_closure(
    scene: Scene, motion: Steady, here: Reduced, closing: tuple[Grid, Array] | None, angles: Array, at: Shown,
    bodies: Masses,
) -> Array:  # fmt: skip
    """Kinetic energy of the links, from their velocities, compared with the work of the loads, each integrated
    separately, and of the drive: of its constant torque, or of the torque that the motion law requires."""
    speed, grid = at.speed[0], motion.grid
    spin = at.pose.links[scene.mechanism.driving_link].w * speed
    kinetic = 0.5 * scene.mechanism.flywheel.inertia * spin**2
    energy = bodies.mass * bodies.at.dr.squared() + bodies.inertia * bodies.w**2
    kinetic = kinetic + 0.5 * jnp.sum(energy, axis=0) * speed**2
    torques = list(here.by_load.values())
    if closing is None:
        torques.append(jnp.broadcast_to(motion.mean_drive_torque, grid.nodes.shape))
    else:
        torques += [-torque for torque in torques]  # the drive balances the loads
    work = jnp.sum(_integrals(grid, jnp.stack(torques), angles), axis=0)
    if closing is not None:
        fine, torque = closing
        work = work + _integrals(fine, torque[None], angles)[0]
    closure = jnp.max(jnp.abs((kinetic - kinetic[0]) - (work - work[0])))
    return safe_divide(closure, jnp.max(kinetic))


def _integrals(grid: Grid, torques: Array, angles: Array) -> Array:
    """Integrals of torques given at the nodes, shape (torques, panels, n), from the first edge to the angles."""
    place = jax.vmap(grid.place)(angles)
    return jax.vmap(lambda torque: primitive(grid, torque).at(place))(torques)
