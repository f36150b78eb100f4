"""Crank angles where the motion itself has a kink: the power in a lossy transmission changes its direction, the motor
passes a knot of its characteristic, or the force of a guide with friction changes its side. At constant speed, only the
first and the last. Panels also end around places where the force of a pin with friction almost vanishes.

They depend on the motion, and the motion on the grid whose panels should end there. So both are found in turn. A kink
that is off by d from the end of a panel costs d² where the slope of the torque jumps, as with a lossy transmission, and
d³ at a knot, where only its curvature does. No derivative passes through them, as torques are continuous there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide, safe_sqrt, taken
from linkjax._vec import Vec
from linkjax.forces import JointFriction, has_linear_reactions
from linkjax.friction import pairs
from linkjax.kinematics import Pose
from linkjax.machine import ReadyScene, Scene
from linkjax.motion._by_speed import on_pose, speed_dependent, torques_of, whole
from linkjax.motion._driven import moving_at_nodes
from linkjax.motion._edges import KINK, REACH, SAME, Candidates, Kinks, has_width, nearest, together
from linkjax.motion._flow import Begun, Flow
from linkjax.motion._grid import GRID_SCAN, Grid, Place, grid_of
from linkjax.motion._guess import guessed, rubbing_joints, unknown
from linkjax.motion._nodes import AtNodes, at_nodes
from linkjax.motion._panels import series_sum
from linkjax.motion._speed_extremes import repeated
from linkjax.reduction import Reduced
from linkjax.sampling import Sample, Sampler

CHANGES = 6  # the most kinks of one cause per crank turn
MINIMA = 2  # for one of these, the lowest minima of the force of a pin
# the least places per crank turn where the force of a pin almost vanishes; and joints with friction for one of them
LEAST_SOFT, SOFT = 2, 2
BESIDE = 3  # for one of these, more such places: they have no ends of their own, but extra panels
ALIKE = 0.2  # of the distance: places of pins that differ by less are one
AROUND = 1.0, 8.0, 64.0  # times the distance of the singularity there: how far from such a place panels end
# rounds of finding the motion and its kinks: at knots alone, with friction, and with a lossy transmission
ROUNDS, RUBBED_ROUNDS, LOSSY_ROUNDS = 1, 2, 3
IDLE = 1e-11  # of the largest force of a guide: a force that is less throughout is a rounding error
NEARLY = (
    1e-5  # relative: the last step of Newton's method for a motion whose kinks are wanted, of which the square counts
)
AGAIN = 1  # repeats of the motion in every round, where the mean of the extremes is wanted
NOISE = 1e-13  # of the largest value: less than this below zero counts as zero
HALVINGS = 40  # bisections of a step between nodes: 1e-12 of it; a force may be least at a kink, where all of it counts
JUMP = 1e-3  # of the largest value: a greater step at the end of a panel is a jump, where panels end anyway


def kinked(scene: Scene) -> bool:
    """Whether the steady-state motion of a scene may have kinks of its own."""
    return speed_dependent(scene) and bool(_causes(scene) or scene.friction)


def grid_with_kinks(
    machine: Sampler, nodes: int, scanned: Sample | None = None, points: int = GRID_SCAN,
    breaks: tuple[float, ...] = (), start: Any = None, moves: bool = True, added: Any = 0.0, still: bool = True,
) -> Grid:  # fmt: skip
    """The grid of a machine as by `grid_of`, whose panels also end at the kinks of its own steady-state motion, if it
    `moves`: the one near the speed `start` (rad/s) at the first edge, if given, and with a flywheel inertia `added`
    (kg m²) that the machine does not have. And they end at its kinks at constant speed, or in the motion that a law
    gives; not if that is not asked for, without `still`, and the machine is traced (otherwise every grid of a machine
    has the same programs)."""
    scene, motor = machine.scene, machine.scene.motor
    loses, rubs = motor is not None and motor.transmission.loses, guide_kinks(scene)
    given, kinks = (machine, nodes, scanned, points, breaks), moves and kinked(scene)
    still = still or not (kinks and machine.traced)
    if not (kinks or loses or scene.friction):
        return grid_of(*given)
    # the first grid has panels for the kinks, so that one program serves every round and the motion itself
    most = CHANGES * scene.cycle_turns
    soft = max(LEAST_SOFT, -(-len(scene.friction) // SOFT)) * scene.cycle_turns if scene.friction else 0
    motions = kinks + still
    more = most * (still * loses + motions * rubs + kinks * len(_causes(scene))) + motions * soft * 2 * len(AROUND)
    seen = motions * (1 + BESIDE) * soft
    found = Kinks(jnp.full(more, jnp.inf), Candidates(jnp.zeros(seen), jnp.full(seen, jnp.inf)))
    grid, none = grid_of(*given, found), jax.tree.map(lambda part: part[:0], found)
    at = at_nodes(machine, grid, edges=kinks)

    def at_constant_speed(machine: Sampler, grid: Grid, at: AtNodes) -> Any:
        ends = none
        if not still:
            return ends
        if loses:
            poses = at.sample.pose if on_pose(scene) else None
            turning = machine.run(_still, whole(machine), grid, at.here, at.sample.dynamics[1], poses, most=most)
            ends = none._replace(ends=turning)
        return machine.run(_joined, ends, _rubbing(machine, grid, at, None, most, soft)) if scene.friction else ends

    rounds = LOSSY_ROUNDS if loses else RUBBED_ROUNDS if scene.friction else ROUNDS
    if kinks:
        grid = machine.run(unknown, grid, joints=rubbing_joints(scene))

    def moved(machine: Sampler, grid: Grid, at: AtNodes, ratio: Any, scanned: Sample | None) -> tuple[Any, Grid, Any]:
        found = at_constant_speed(machine, grid, at)
        if not kinks:
            return found, grid_of(machine, nodes, scanned, points, breaks, found), ratio
        begun, _, ratio = repeated(machine, grid, at, added, start, ratio, AGAIN, NEARLY)
        own = machine.run(_kinks, begun.flow, begun.energy, found.ends, turns=scene.cycle_turns)
        found = found._replace(ends=own)
        if scene.friction:
            found = machine.run(_joined, found, _rubbing(machine, grid, at, begun, most, soft))
        new = grid_of(machine, nodes, scanned, points, breaks, found)
        return found, machine.run(guessed, begun.flow, begun.energy, new), ratio

    if machine.traced and rounds > 1:  # one program for all rounds, without derivatives
        fixed = Sampler(machine.still)
        known, grid = jax.lax.stop_gradient((scanned, grid))

        def again(_: Any, state: tuple[Kinks, Grid, Array]) -> tuple[Kinks, Grid, Array]:
            return moved(fixed, state[1], at_nodes(fixed, state[1], edges=kinks), state[2], known)

        found, grid, _ = jax.lax.fori_loop(0, rounds, again, (found, grid, jnp.ones(())))
        return dataclasses.replace(grid_of(*given, found), guess=grid.guess)
    ratio: Any = 1.0
    for number in range(rounds):
        at = at_nodes(machine, grid, edges=kinks) if number else at
        found, grid, ratio = moved(machine, grid, at, ratio, scanned)
    return grid


def guide_kinks(scene: Scene) -> int:
    """How many numbers there are at whose zeros the friction of a joint has a kink."""
    by_joint = {each.joint: each for each in scene.friction}
    return sum(by_joint[pair.joint.name].kinks for pair in pairs(scene.mechanism, scene.friction))


def _rubbing(machine: Sampler, grid: Grid, at: AtNodes, begun: Begun | None, most: int, soft: int) -> Any:
    """The kinks of friction, in a motion, or at constant speed without one."""
    if has_linear_reactions(machine.mechanism):
        given = whole(machine), grid, at.here, at.sample.pose
        return machine.run(_changes_at_nodes, *given, begun, most=most, soft=soft)
    if begun is None:
        speed, rate = machine.run(_nominal, grid, machine.scene.speed)
    else:
        speed, rate = machine.run(_crank, begun.flow, begun.energy)
    place, pose, active = machine.run(_nodes_alone, grid, at.place, at.sample.pose)
    forces = machine.cut(machine.forces(place.phi, place.side, pose, active, speed, rate, fixed=True), place.phi)
    return machine.run(_changes_of_forces, grid, forces.friction, most=most, soft=soft)


@compiled_soon(static=("most", "soft"))
def _changes_at_nodes(
    made: ReadyScene, grid: Grid, here: Reduced, pose: Pose, begun: Begun | None, most: int, soft: int
) -> Kinks:  # fmt: skip
    torques = torques_of(made)
    moving = moving_at_nodes(grid, torques, pose)
    assert moving is not None
    if begun is None:
        speed = made.scene.speed * jnp.ones_like(grid.nodes)
        rubbed = torques.with_friction(here, moving, speed)[1]
        assert rubbed is not None
        near = rubbed.near
    else:
        flow = begun.flow
        assert flow.driven is not None
        speed, near = flow.speed(begun.energy + flow.at_nodes, flow.inertia), flow.driven.near
    contacts = jax.vmap(torques.contacts)(moving, speed)  # frictions are the same in all panels
    loads = jax.vmap(lambda reactions, near: reactions(*near))(contacts.reactions, near)
    rows, squares = [], []
    for i, pair in enumerate(pairs(made.scene.mechanism, made.scene.friction)):
        (fx, fy, moment), axis = (part[:, i] for part in loads), moving.basis.axes[i]
        rows.append(() if axis is None else pair.friction.switches(axis.cross(Vec(fx, fy)), moment))
        squares.append(fx * fx + fy * fy if axis is None else None)
    return _rubs_change(grid, rows, squares, most, soft)


@compiled_soon(static=("most", "soft"))
def _changes_of_forces(
    grid: Grid, friction: dict[str, dict[str, JointFriction]], most: int, soft: int
) -> Kinks:  # fmt: skip
    every = [one for sides in friction.values() for one in sides.values()]
    return _rubs_change(grid, [one.switches for one in every], [one.square for one in every], most, soft)


@compiled_soon
def _nodes_alone(grid: Grid, place: Place, pose: Pose) -> tuple[Place, Pose, Array]:
    """Places and poses of the nodes, and the loads that act there."""
    place, pose = jax.tree.map(lambda leaf: leaf[: grid.size], (place, pose))
    return place, pose, taken(grid.active, place.panel)


@compiled_soon
def _joined(one: Kinks, other: Kinks) -> Kinks:
    return jax.tree.map(lambda *both: jnp.concatenate(both), one, other)


@compiled_soon
def _nominal(grid: Grid, speed: Array) -> tuple[Array, Array]:
    return jnp.full(grid.size, speed), jnp.zeros(grid.size)


@compiled_soon
def _crank(flow: Flow, energy: Array) -> tuple[Array, Array]:
    """Crank speed (rad/s) and acceleration (rad/s²) at the nodes."""
    speed = flow.speed(energy + flow.at_nodes, flow.inertia)
    return speed.ravel(), ((flow.here.torque - 0.5 * flow.here.slope * speed**2) / flow.inertia).ravel()


def _rubs_change(
    grid: Grid, switches: Sequence[tuple[Array, ...]], squares: Sequence[Array | None], most: int, soft: int
) -> Kinks:  # fmt: skip
    """Where the friction of guides has a kink, and around the nearest of so many places where forces of pins almost
    vanish; and more such places."""
    found = [row for one in switches for row in _no_noise(one)]
    ends = [jnp.zeros(0)]
    if found:
        rows = jax.lax.stop_gradient(jnp.stack(found)).reshape((-1, *grid.nodes.shape))
        ends.append(jax.vmap(lambda row: sign_changes(grid, row, most).angles(grid))(rows).ravel())
    squares = [square for square in squares if square is not None]
    seen = soft + BESIDE * soft
    least = Candidates(jnp.zeros(seen), jnp.full(seen, jnp.inf))
    if squares:
        rows = jax.lax.stop_gradient(jnp.stack(squares)).reshape((-1, *grid.nodes.shape))
        places = jax.vmap(lambda row: _almost_zero(grid, row, MINIMA * most))(rows)
        largest = jnp.max(rows, axis=(1, 2))
        loaded = (largest > IDLE**2 * jnp.max(largest))[:, None]  # else all of its minima are rounding errors
        places = places._replace(distance=jnp.where(loaded, places.distance, jnp.inf))
        least, _ = nearest(together(least, _once(*(part.ravel() for part in places))), seen)
    least = least._replace(angle=jnp.where(jnp.isfinite(least.distance), least.angle, 0.0))
    return Kinks(jnp.concatenate([*ends, _around(Candidates(*(part[:soft] for part in least))).ravel()]), least)


def _once(angle: Array, distance: Array) -> Candidates:
    """Places and their distances; of those that are alike, as of pins of one rod, the nearest alone."""
    number = np.arange(angle.size)
    gap = jnp.abs(jnp.where(jnp.isfinite(angle), angle, 0.0)[:, None] - angle[None])
    same = distance[None] == distance[:, None]
    before = (distance[None] < distance[:, None]) | (same & (number[None] < number[:, None]))
    alike = (gap < SAME + ALIKE * distance[None]) & (distance[:, None] < SAME + (1 + ALIKE) * distance[None])
    return Candidates(angle, jnp.where(jnp.any(before & alike, axis=1), jnp.inf, distance))


def _around(soft: Candidates) -> Float[Array, "places ends"]:
    """Crank angles on either side of places where a force almost vanishes: close to a singularity at the distance d the
    size of the force is far from a polynomial, and less so at 8 d and 64 d. Where it vanishes, the place itself."""
    sizes = np.asarray([sense * size for size in AROUND for sense in (-1.0, 1.0)])
    one = np.where(np.arange(sizes.size) == 0, 0.0, np.inf)
    off = jnp.where((soft.distance < KINK)[:, None], one[None], soft.distance[:, None] * sizes[None])
    return jnp.where(jnp.abs(off) < REACH, soft.angle[:, None] + off, jnp.inf)


def _no_noise(rows: tuple[Array, ...]) -> list[Array]:
    """Numbers of one guide, all of them forces (N); those that are rounding errors beside the others are zero."""
    largest = [jnp.max(jnp.abs(row)) for row in rows]
    return [
        jnp.where(own > IDLE * jnp.max(jnp.stack(largest)), row, 0.0) for own, row in zip(largest, rows, strict=True)
    ]


def _almost_zero(grid: Grid, square: Float[Array, "panels n"], most: int) -> Candidates:
    """Minima of a function that is not negative, and how far from them it has its zeros in the complex plane (rad)."""
    rule = grid.rule
    slope = jnp.asarray(rule.slope_at_points[1:-1, : grid.n] @ rule.series)
    first, second = square @ slope.T, square @ slope.T @ slope.T
    found = sign_changes(grid, first, most, square)
    value, bend = (
        series_sum(taken(part @ jnp.asarray(rule.series.T), found.panel), found.x) for part in (square, second)
    )
    distance = taken(grid.half, found.panel) * safe_sqrt(safe_divide(2 * value, bend))
    return Candidates(found.angles(grid), jnp.where(found.used & (bend > 0), distance, jnp.inf))


@compiled_soon(static=("most",))
def _still(
    scene: Scene | ReadyScene, grid: Grid, here: Reduced, slope: Array, pose: Pose | None, most: int
) -> Float[Array, " kinks"]:  # fmt: skip
    """Crank angles (rad) where the torque on a crank of constant speed changes its sign."""
    torques = torques_of(scene)
    nominal = (scene.scene if isinstance(scene, ReadyScene) else scene).speed
    every = torques.loaded(here, moving_at_nodes(grid, torques, pose), nominal * jnp.ones_like(grid.nodes))
    own = 0.5 * slope[: grid.size].reshape(grid.nodes.shape) * nominal**2
    torque = jax.lax.stop_gradient(own - sum(every.by_load.values(), jnp.zeros_like(own)))
    return sign_changes(grid, torque, most).angles(grid)


def _causes(scene: Scene) -> tuple[Any, ...]:
    """What may cause kinks: None for the direction of power, and knots of the motor's characteristic."""
    motor = scene.motor
    return () if motor is None else (*(None,) * motor.transmission.loses, *motor.motor.knots())


@compiled_soon(static=("turns",))
def _kinks(flow: Flow, energy: Array, still: Array, turns: int) -> Float[Array, " kinks"]:
    """Crank angles of the kinks (rad) after those that are `still` there; infinite where there are fewer."""
    flow, energy = jax.lax.stop_gradient((flow, energy))
    assert flow.driven is not None
    motor = flow.driven.torques.motor
    if motor is None:
        return still
    speed = flow.speed(energy + flow.at_nodes, flow.inertia)
    rate = (flow.here.torque - 0.5 * flow.here.slope * speed**2) / flow.inertia
    values = [motor.shaft_torque(speed, rate)] if motor.transmission.loses else []
    values += [motor.motor_speed(speed) - knot for knot in motor.motor.knots()]
    if not values:
        return still
    found = jax.vmap(lambda each: sign_changes(flow.grid, each, CHANGES * turns).angles(flow.grid))(jnp.stack(values))
    return jnp.concatenate([still, found.ravel()])


class Changes(NamedTuple):
    """Where a function changes its sign: panels and coordinates in them, and which of these slots are used."""

    panel: Int[Array, " slots"]
    x: Float[Array, " slots"]
    used: Bool[Array, " slots"]

    def angles(self, grid: Grid) -> Float[Array, " slots"]:
        """The crank angles (rad); infinite ones are not used."""
        return jnp.where(self.used, taken(grid.middle, self.panel) + taken(grid.half, self.panel) * self.x, jnp.inf)


def sign_changes(
    grid: Grid, values: Float[Array, "panels n"], most: int, height: Float[Array, "panels n"] | None = None
) -> Changes:
    """Where a function known at the nodes changes its sign, in order. With `height`, of which it is the slope: the
    lowest of its minima."""
    rule, size = grid.rule, jnp.max(jnp.abs(values))
    first, last = jnp.moveaxis(values @ jnp.asarray(rule.ends.T), -1, 0)
    # one value at an edge, so that a root at an edge is found once: the two panels' own values there differ by rounding
    gap = last - jnp.roll(first, -1)
    joined = jnp.where(jnp.abs(gap) < JUMP * size, 0.5 * gap, 0.0)
    last, first = last - joined, first + jnp.roll(joined, 1)
    every = jnp.concatenate([first[:, None], values, last[:, None]], axis=1)
    negative = every < -NOISE * size  # in a dwell there is rounding alone
    wide = has_width(grid.half, grid.length)[:, None]
    if height is None:
        flat = (wide & (negative[:, :-1] != negative[:, 1:])).ravel()
        place = jnp.sort(jnp.where(flat, jnp.arange(flat.size), flat.size))[:most]
        used, place = place < flat.size, jnp.minimum(place, flat.size - 1)
    else:
        flat = (wide & negative[:, :-1] & ~negative[:, 1:]).ravel()
        beside = jnp.pad(height, ((0, 0), (1, 1)), constant_values=jnp.inf)
        low = jnp.minimum(beside[:, :-1], beside[:, 1:]).ravel()
        place = jnp.argsort(jnp.where(flat, low, jnp.inf))[:most]
        used = taken(flat, place)
    panel, step = place // (grid.n + 1), place % (grid.n + 1)
    x = np.concatenate([[-1.0], rule.x, [1.0]])
    low, high = taken(jnp.asarray(x), step), taken(jnp.asarray(x), step + 1)
    series = taken(values @ jnp.asarray(rule.series.T), panel)
    sign = jnp.where(taken(negative[:, :-1].ravel(), place), -1.0, 1.0)

    def halve(_: Any, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        middle = 0.5 * (ends[0] + ends[1])
        left = sign * series_sum(series, middle) > 0
        return jnp.where(left, middle, ends[0]), jnp.where(left, ends[1], middle)

    low, high = jax.lax.fori_loop(0, HALVINGS, halve, (low, high))
    return Changes(panel, 0.5 * (low + high), used)
