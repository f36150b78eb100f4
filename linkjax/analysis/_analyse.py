"""The complete analysis of a working cycle in one call."""

from __future__ import annotations

import functools
import warnings
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide, wrapped
from linkjax._results import Result, merge
from linkjax._types import Tracer, as_float
from linkjax._vec import Vec
from linkjax.analysis._blunt import singular, without_joints
from linkjax.analysis._cycle import Checks, Cycle, Flywheels, Margins, explain, explain_start
from linkjax.analysis._missing import massless, only_what_exists
from linkjax.analysis._precision import FEWEST, fewest_digits
from linkjax.forces import Forces, driven_by_joint
from linkjax.groups import closed_to
from linkjax.kinematics import (
    Pose,
    Reversals,
    assembly_margins,
    dead_centres,
    margins,
    pose,
    strokes,
    transmission_angles,
)
from linkjax.machine import Scene, check_scene, ready
from linkjax.measures import every_motion, peak_names, table
from linkjax.mechanism import StructureError
from linkjax.motion import (
    Grid,
    Peak,
    Regime,
    Steady,
    flywheel_on,
    make_grid,
    node_values,
    peaks,
    primitive,
    steady_by_diffrax,
    steady_on,
    textbook_flywheel,
)
from linkjax.reduction import Reduced, reduced_model

MOTION = 10.0  # times the error of δ: the relative error of a force in the actual motion
FINE = 256  # nodes per turn, to integrate the inertia torque of a machine with a motion law
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
    _compile_ahead(scene, _angles(scene, angles), nodes, method, _moves(scene, scene.constant_speed))


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
    """The analysis in a few jitted parts: one large program would take several times as long to compile. The actual
    motion is omitted at constant speed, and if nothing has a mass."""
    given, scene = scene, ready(scene)
    moves = _moves(scene, constant_speed)
    if not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((scene, angles))):
        if throw:
            explain_start(scene)
        _compile_ahead(scene, angles, nodes, method, moves)
    motion, here, work, wheels = None, None, None, None
    if moves:
        motion, here, work = _motion(scene, nodes, method)
        wheels = _flywheels(scene, motion, here)
    regime = Regime(scene, _grid(scene, nodes) if motion is None else motion.grid, motion)
    at_nodes, at = _everywhere(regime, angles)
    tops, rms = _peaks(regime, at_nodes)
    limits, dead, covered, spans = _limits(scene)
    checks, code = _checks(regime, here, angles, at, limits)
    still = not constant_speed and motion is None
    return Cycle(
        scene=given, angles=angles, pose=at.pose, transmission=at.transmission, transmission_ends=spans, margins=limits,
        dead_centres=dead, strokes=covered, reduced=at.reduced, steady=motion,
        speed=at.speed[0] if moves else None, acceleration=at.acceleration[0] if moves else None, time=at.time,
        forces=None if still else at.forces[-1 if constant_speed else 0], forces_constant_speed=at.forces[-1],
        peaks=tops[0] if moves else None, peaks_constant_speed=tops[-1], rms_shaking_force_constant_speed=rms,
        flywheel=wheels, work=work, checks=checks, assembled=at.assembled,
        result=merge(code, jnp.where(still, Result.NO_INERTIA, 0)), constant_speed=constant_speed, method=method,
        nodes=regime.grid.size,
    )  # fmt: skip


def _moves(scene: Scene, constant_speed: bool) -> bool:
    """Whether the actual motion is computed: always with a motion law, otherwise unless the speed is constant, or
    nothing has a mass and no flywheel is required."""
    lifeless = massless(scene) and scene.target_delta is None
    return scene.mechanism.prescribed or not (constant_speed or lifeless)


def _compile_ahead(scene: Scene, angles: Array, nodes: int, method: str, moves: bool) -> None:
    """Start compiling all parts at once, each from the shapes of the previous results; the longest part first."""
    motion, here = None, None
    if moves:
        motion, here, _ = _motion.ahead(scene, nodes, method)
    regime = Regime(scene, _grid.ahead(scene, nodes) if motion is None else motion.grid, motion)
    at_nodes, at = _everywhere.ahead(regime, angles)
    _peaks.ahead(regime, at_nodes)
    if motion is not None:
        _flywheels.ahead(scene, motion, here)
    limits, *_ = _limits.ahead(scene)
    _checks.ahead(regime, here, angles, at, limits)


class Everywhere(NamedTuple):
    """Results at many places; `forces`, `speed` and `acceleration` in the actual motion (if it exists) and at constant
    speed."""

    pose: Pose
    transmission: dict[str, Array]
    reduced: Reduced
    forces: tuple[Forces, ...]
    speed: tuple[Array, ...]
    acceleration: tuple[Array, ...]
    time: Array | None
    assembled: Array


@compiled_soon(static=("nodes",))
def _grid(scene: Scene, nodes: int) -> Grid:
    return make_grid(scene, nodes)


@compiled_soon(static=("nodes", "method"))
def _motion(scene: Scene, nodes: int, method: str) -> tuple[Steady, Reduced, dict[str, Array]]:
    if method == "diffrax":
        motion = steady_by_diffrax(scene, nodes)
        here = node_values(scene, motion.grid)
    else:
        grid = make_grid(scene, nodes)
        here = node_values(scene, grid)
        motion = steady_on(scene, grid, here)
    weights = motion.grid.half[:, None] * motion.grid.rule.w[None]
    work = {name: jnp.sum(weights * share) for name, share in here.by_load.items()}
    return motion, here, {"drive": motion.mean_drive_torque * scene.cycle, **work}


@compiled_soon
def _everywhere(regime: Regime, angles: Array) -> tuple[Array, Everywhere]:
    """Forces at the nodes, and all results at the angles, from one evaluation of the mechanism."""
    scene, grid, motion = regime.scene, regime.grid, regime.steady
    shown = jax.vmap(grid.place)(angles)
    nodes = jax.tree.map(jnp.ravel, grid.node_places())
    places = jax.tree.map(lambda a, b: jnp.concatenate([a, b]), nodes, shown)

    def at(place):
        forces, speed, acceleration = every_motion(regime, place)
        least = [m.value for sides in margins(scene.mechanism, place.phi).values() for m in sides.values()]
        return Everywhere(
            pose(scene.mechanism, place.phi), transmission_angles(scene.mechanism, place.phi),
            reduced_model(scene, place.phi, regime.side(place)), _each(forces), _each(speed), _each(acceleration),
            None if motion is None else motion.clock.at(place),
            jnp.all(jnp.stack([*least, jnp.ones_like(place.phi)]) > 0),
        )  # fmt: skip

    every = jax.vmap(at)(places)
    count = grid.size
    both = [table(scene, jax.tree.map(lambda leaf: leaf[:count], forces)) for forces in every.forces]
    at_angles = jax.tree.map(lambda leaf: leaf[count:], every)
    told = tuple(without_joints(scene.mechanism, at_angles.pose, forces) for forces in at_angles.forces)
    at_angles = at_angles._replace(forces=told)
    time = None
    if motion is not None and at_angles.time is not None:
        time = wrapped(at_angles.time - motion.clock.at(grid.place(jnp.zeros(()))), motion.period)
    at_nodes = jnp.moveaxis(jnp.concatenate(both, axis=1), 0, -1)
    at_nodes = at_nodes.reshape((*at_nodes.shape[:2], *grid.nodes.shape))
    return at_nodes, at_angles._replace(time=time)


@compiled_soon
def _peaks(regime: Regime, at_nodes: Array) -> tuple[tuple[Peak, ...], Array]:
    """Peaks of all forces in the actual motion (if it exists) and at constant speed, and the root mean square of the
    shaking force at constant speed."""
    scene, grid, motion = regime.scene, regime.grid, regime.steady

    def rows(regime, place):
        forces, _, _ = every_motion(regime, place)
        return table(scene, forces).reshape((-1, 2))

    found, names = peaks(regime, rows, at_nodes), peak_names(scene)
    count, motions = len(names), found.value.size // len(names)
    boundless = jnp.tile(singular(scene.mechanism, names), motions)
    found = found._replace(value=jnp.where(boundless, jnp.inf, found.value))
    if motion is not None:  # in it, forces depend on the square of the speed and its slope
        inexact = jnp.where(jnp.arange(2 * count) < count, MOTION * motion.delta_error * found.value, 0.0)
        found = found._replace(error=found.error + inexact)
    weights = grid.half[:, None] * grid.rule.w[None]
    shaking = at_nodes[count * (motions - 1) + names.index("shaking_force")]
    rms = jnp.sqrt(jnp.sum(weights * jnp.sum(shaking * shaking, axis=0)) / scene.cycle)
    return tuple(Peak(*(part[i * count : (i + 1) * count] for part in found)) for i in range(motions)), rms


@compiled_soon
def _limits(scene: Scene) -> tuple[Margins, dict[str, Reversals], dict[str, Array], dict[str, Array]]:
    """Least margins, dead centres, strokes, and transmission angles at the least margins, where they are extreme."""
    mechanism, turns = scene.mechanism, scene.cycle_turns
    limits = assembly_margins(mechanism, turns)
    at = {group: jnp.stack([least.angle for least in sides.values()]) for group, sides in limits.items()}
    turned = {group: jax.vmap(lambda phi: transmission_angles(mechanism, phi))(phi) for group, phi in at.items()}
    spans = {group: angles[group] for group, angles in turned.items() if group in angles}
    dead = dead_centres(mechanism, turns)
    return limits, dead, strokes(mechanism, dead, turns), spans


def _each(tree) -> tuple:
    """The motions separately; `every_motion` computes them along an axis."""
    count = len(jax.tree.leaves(tree)[0])
    return tuple(jax.tree.map(lambda leaf, i=i: leaf[i], tree) for i in range(count))


@compiled_soon
def _flywheels(scene: Scene, motion: Steady, here: Reduced) -> Flywheels:
    given, target = scene.mechanism.flywheel.inertia, scene.target_delta
    if target is None:
        return Flywheels(given, None, None)
    return Flywheels(given, flywheel_on(scene, target, motion.grid, here), textbook_flywheel(motion, target))


@compiled_soon
def _checks(
    regime: Regime, here: Reduced | None, angles: Array, at: Everywhere, limits: Margins
) -> tuple[Checks, Array]:
    """The checks of the analysis, and its result code."""
    scene, motion = regime.scene, regime.steady
    found = [_residuals(scene, at, i) for i in range(len(at.forces))]
    power, balance = (functools.reduce(jnp.maximum, part) for part in zip(*found, strict=True))
    none = {"loops": closed_to(power.dtype)}  # a singular value is zero only to rounding
    every = [m.value - none.get(side, 0.0) for sides in limits.values() for side, m in sides.items()]
    least = jnp.min(jnp.stack([jnp.ones(()), *every]))
    codes = [
        jnp.where(regime.grid.overflow, Result.TOO_MANY_REVERSALS, 0),
        jnp.where(least > 0, 0, Result.CANNOT_BE_ASSEMBLED),
    ]
    if motion is None or here is None:
        return Checks(power, None, balance), merge(*codes)
    codes += [
        jnp.where(jnp.isinf(motion.delta_error), Result.INTEGRATION_FAILED, 0),
        jnp.where(motion.steady_state_margin > 0, 0, Result.NO_PERIODIC_REGIME),
        jnp.where(motion.min_inertia_ratio > LIGHTEST, 0, Result.NO_INERTIA),
    ]
    return Checks(power, _energy_closure(scene, motion, here, angles, at), balance), merge(*codes)


def _residuals(scene: Scene, at: Everywhere, i: int) -> tuple[Array, Array]:
    """Virtual power and force balance in one of the two motions, relative to the largest term of the sums, because in a
    balanced machine the sums themselves are zero. At a change point drive torque and frame forces come from these sums,
    so only the power is compared there, with the reduced model."""
    forces, speed, acceleration = at.forces[i], at.speed[i], at.acceleration[i]
    forces = jax.tree.map(lambda x: jnp.where(jnp.isnan(x), 0.0, x), forces)  # joints at a change point
    crank = at.pose.links[scene.mechanism.driving_link].w
    inertia, slope, torque = at.reduced[:3]
    parts = inertia * acceleration, 0.5 * slope * speed**2, -torque
    power, reach = jnp.abs(forces.drive_torque - sum(parts)), jnp.zeros_like(speed)
    about = at.pose.points[scene.mechanism.groups[0].needs()[0]].r
    heavy, size = jnp.zeros_like(speed), sum(jnp.abs(share) for share in at.reduced.by_load.values())
    size = size + scene.mechanism.flywheel.inertia * jnp.abs(acceleration * crank)
    for link, place, body in at.pose.heavy():
        point, turn = at.pose.points[place], at.pose.links[link]
        pull = body.mass * _length(point.ddr * speed**2 + point.dr * acceleration)
        spin = jnp.abs(body.inertia * (turn.e * speed**2 + turn.w * acceleration) * turn.w)
        heavy, size = heavy + jnp.abs(pull), size + jnp.abs(pull) * _length(point.dr) + spin
        reach = jnp.maximum(reach, _length(point.r - about))
    joints = [side for sides in forces.reactions.values() for side in sides.values()]
    heavy = jnp.max(functools.reduce(jnp.maximum, [side.magnitude for side in joints], heavy))
    sources = forces.shaking, forces.weight, forces.loads
    rest = [forces.frame[k] - sum(source[k] for source in sources) for k in (0, 1)]
    drive = jnp.zeros_like(power) if driven_by_joint(scene.mechanism) else crank * forces.drive_torque
    moments = drive, *(source.moment for source in sources)
    turning = jnp.max(sum(jnp.abs(moment) for moment in moments) + reach * heavy)
    twist = jnp.max(jnp.abs(forces.frame.moment - sum(moments)))
    balance = jnp.maximum(safe_divide(jnp.max(jnp.hypot(*rest)), heavy), safe_divide(twist, turning))
    return safe_divide(jnp.max(power), jnp.max(size)), balance


def _length(v: Vec) -> Array:
    return jnp.sqrt(v.squared())


def _energy_closure(scene: Scene, motion: Steady, here: Reduced, angles: Array, at: Everywhere) -> Array:
    """Kinetic energy of the links, from their velocities, compared with the work of the loads, each integrated
    separately, and of the drive: of its constant torque, or of the torque that the motion law requires."""
    speed, grid = at.speed[0], motion.grid
    spin = at.pose.links[scene.mechanism.driving_link].w * speed
    kinetic = 0.5 * scene.mechanism.flywheel.inertia * spin**2
    for name, place, body in at.pose.heavy():
        v, w = at.pose.points[place].dr * speed, at.pose.links[name].w * speed
        kinetic = kinetic + 0.5 * (body.mass * v.squared() + body.inertia * w * w)
    torques = [(grid, torque) for torque in here.by_load.values()]
    if scene.mechanism.prescribed:
        torques += [(grid, -torque) for torque in here.by_load.values()]  # the drive balances the loads
        grid = make_grid(scene, FINE)
        slope = jax.vmap(lambda phi: reduced_model(scene, phi).slope)(grid.nodes.ravel()).reshape(grid.nodes.shape)
        torques.append((grid, 0.5 * slope * scene.speed**2))
    else:
        torques.append((grid, jnp.broadcast_to(motion.mean_drive_torque, grid.nodes.shape)))
    work = jnp.zeros_like(speed)
    for grid, torque in torques:
        series = primitive(grid, torque)
        work = work + jax.vmap(lambda phi, grid=grid, series=series: series.at(grid.place(phi)))(angles)
    closure = jnp.max(jnp.abs((kinetic - kinetic[0]) - (work - work[0])))
    return safe_divide(closure, jnp.max(kinetic))
