"""The steady-state motion under torques that depend on the speed: a motor, dampers, resistances."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide, taken
from linkjax.kinematics import Pose
from linkjax.machine import ReadyScene, Scene
from linkjax.motion._by_speed import BySpeed, Driven, FrictionTorque, moving_at, near_by, on_pose, torques_of, whole
from linkjax.motion._collocation import CLOSED, Orbit, Panels, gained, implicit, lasting, settled
from linkjax.motion._edges import has_width
from linkjax.motion._flow import LEAST, Begun, Duty, Flow, duty_of, inertia_floor, primitive, spotted
from linkjax.motion._grid import Grid
from linkjax.motion._guess import Guess
from linkjax.motion._nodes import AtEdges, AtNodes
from linkjax.motion._seek import Sought, follow, near, seek
from linkjax.reduction import Moving, Reduced
from linkjax.sampling import Sampler

STARTS = np.geomspace(0.02, 4.0, 33)  # speeds, relative to the nominal one, from which a motor's cycle is followed
FEWER = 4  # the work of friction is estimated at every fourth of these
HALVINGS = 40  # of an interval of speeds with a periodic motion
NEAR = 1e-6  # relative: the gain over a cycle that is nearly periodic


class Given(NamedTuple):
    """What holds at all nodes: torques that depend on the speed, the least kinetic energy (J), and the wanted mean of
    the time per crank angle (s/rad)."""

    torques: BySpeed
    least: Array
    pace: Array


class Nodes(NamedTuple):
    """The machine at the nodes: the reduced model without the loads that depend on the speed, what these need, and the
    reduced inertia with the rotor (kg m²), above zero."""

    here: Reduced
    moving: Moving | None
    inertia: Array


def _rate(
    given: Given, at: Nodes, energy: Array, constant: Array, near: Any, linearised: bool = False
) -> tuple[Array, Any]:  # fmt: skip
    speed, torques = _speed(given, at, energy), given.torques
    loaded, rubbed = torques.with_friction(at.here, at.moving, speed, constant, near, linearised)
    return torques.rise(loaded, speed, jnp.zeros_like(energy)), None if rubbed is None else rubbed.near


def _linearised(given: Given, at: Nodes, energy: Array, constant: Array, near: Any) -> tuple[Array, Any]:
    """The same, for Newton's method with energies and frictions as unknowns."""
    return _rate(given, at, energy, constant, near, linearised=True)


def _smooth_rate(given: Given, at: Nodes, energy: Array, constant: Array, near: Any) -> tuple[Array, Any]:
    """The same without friction."""
    return _rate(given._replace(torques=dataclasses.replace(given.torques, rough=None)), at, energy, constant, near)


def _speed(given: Given, at: Nodes, energy: Array) -> Array:
    return jnp.sqrt(2 * jnp.maximum(energy, given.least) / at.inertia)


def _lack(panels: Panels, energy: Array) -> Array:
    """The mean time per crank angle relative to the wanted one, minus one."""
    slowness = 1 / _speed(panels.given, panels.data, energy)
    return jnp.sum(panels.weights * slowness) / (jnp.sum(panels.weights) * panels.given.pace) - 1


def begun_by_speed(
    machine: Sampler, grid: Grid, at: AtNodes, added: Any = 0.0, ratio: Any = 1.0, start: Any = None,
    small: float = CLOSED,
) -> tuple[Begun, AtEdges | None]:  # fmt: skip
    """The motion from the values at the nodes; and the edges, if known. `added` is a flywheel inertia (kg m²) that the
    machine does not have; without a motor the time mean of the speed is the wanted one times `ratio`. With the speed
    `start` (rad/s) at the first edge, the motion of a motor is the one near it, stable or not. It is found up to a step
    of Newton's method as `small` as this, relative, and without `start` from the guess of the grid, if there is one."""
    pose = at.sample.pose if on_pose(machine.scene) else None
    numbers = (jnp.asarray(each, float) if isinstance(each, int | float) else each for each in (added, ratio, small))
    given = (duty_of(machine.scene), whole(machine), grid, at.here, at.sample.dynamics, pose, *numbers, start)
    return machine.run(_begun, *given, edges=at.edges is not None)


class Solved(NamedTuple):
    """A periodic solution, or the nearest motion; whether it was found, the number of stable ones, and the gain of
    energy (J) over the cycle."""

    orbit: Orbit
    found: Array
    number: Array
    gain: Array


def _solved(panels: Panels, speed: Array, start: Array | None, guess: Guess | None, small: Array) -> Solved:
    fixed, none = jax.lax.stop_gradient(panels), jnp.zeros_like(speed)
    nominal = 0.5 * fixed.data.inertia * jax.lax.stop_gradient(speed) ** 2
    if panels.given.torques.motor is None:
        slopes, frictions = fixed.closer(None).rates(_rate, nominal)
        constant = -jnp.sum(fixed.weights * slopes) / jnp.sum(fixed.weights)
        orbit = settled(_linearised, fixed.closer(frictions), (nominal, nominal[:, 0], constant), _lack, small)
        nodes, edges, constant = implicit(_rate, panels.closer(orbit.near), orbit.state, _lack)
        return Solved(
            orbit._replace(nodes=nodes, edges=edges, constant=constant), orbit.solved, jnp.ones((), int), none
        )
    if start is None:
        kept = _sought(fixed, nominal, guess, small)
    else:
        kept = near(_linearised, fixed, nominal[0, 0] * (start / speed) ** 2)
    orbit, stopped, good = kept.orbit, kept.stopped, kept.orbit.solved
    still, lack = _at_constant_speed(panels, nominal)
    panels = panels.closer(orbit.near)
    nodes, edges, _ = implicit(_rate, panels, orbit.state, None)
    nodes = jnp.where(good, nodes, jnp.where(stopped, still, orbit.nodes))
    edges = jnp.where(good, edges, jnp.where(stopped, still[:, 0], orbit.edges))
    gain = jnp.where(stopped, lack, gained(_rate, panels, orbit.state))
    return Solved(orbit._replace(nodes=nodes, edges=edges), good, kept.number, gain)


def _at_constant_speed(panels: Panels, nominal: Array) -> tuple[Array, Array]:
    """For a machine whose motion comes to rest: the energies (J) at the nodes at the constant speed at which most is
    gained, and what is missing there, negative: the gain over the cycle, or where that is positive, the kinetic energy
    that is short within the cycle."""
    fixed = jax.lax.stop_gradient(panels)
    squares = jnp.asarray(STARTS) ** 2
    gains = _gains_at(fixed, squares, nominal)
    nodes = taken(squares, jnp.argmax(gains)) * nominal
    gain = panels.weights * panels.slopes(_rate, nodes)
    short = jnp.min(nodes.ravel() + jnp.cumsum(gain.ravel()))
    return nodes, jnp.minimum(jnp.where(jnp.sum(gain) < 0, jnp.sum(gain), short), -LEAST * panels.unit)


def _sought(panels: Panels, nominal: Array, guess: Guess | None, small: Array) -> Sought:
    """The stable motion nearest to the nominal one, with the energies `nominal` (J) at the nodes; without derivatives.

    Without a `guess` the gain over a cycle at constant speed shows where a periodic motion is. Where it shows one that
    is stable, and Newton's method finds it, no cycle is followed: five times as fast. Otherwise all starting energies
    are tried.
    """
    squares = jnp.asarray(STARTS) ** 2

    def estimated(state: tuple) -> tuple:
        gains = _gains_at(panels, squares, jnp.where(state[0], 1.0, nominal))  # not moved out of a loop, see below
        falls = (gains[:-1] > 0) & (gains[1:] <= 0)
        first = jnp.argmax(falls)
        low, high = squares[first], squares[first + 1]
        share = safe_divide(gains[first], gains[first] - gains[first + 1])
        return jnp.asarray(True), (low + share * (high - low)) * jnp.ones_like(nominal), jnp.sum(falls), state[3]

    if guess is None:
        none = jnp.asarray(False)
        _, square, number, known = estimated((none, jnp.ones_like(nominal), jnp.zeros((), int), none))
    else:
        begin = (guess.known, guess.squares, guess.number, guess.known)
        _, square, number, known = jax.lax.while_loop(lambda state: ~state[0], estimated, begin)
        panels = panels.closer(jax.tree.map(lambda leaf: jnp.where(known, leaf, 0.0), guess.near))
    begin = square * nominal
    orbit = settled(_linearised, panels, (begin, begin[:, 0], jnp.zeros_like(panels.unit)), None, small)
    good = lasting(panels, orbit) & (known | (number == 1))
    begin = Sought(orbit._replace(solved=good), jnp.where(known, number, 1), jnp.asarray(False))

    def search(state):  # it depends on the state, otherwise XLA moves it out of the loop, and it always runs
        starts = nominal[0, 0] * jnp.where(state[0], 1.0, squares)
        return jnp.asarray(True), seek(_linearised, panels, starts, nominal[0, 0])

    return jax.lax.while_loop(lambda state: ~state[0], search, (good, begin))[1]


def _gains_at(panels: Panels, squares: Array, nominal: Array) -> Array:
    """The gain of energy (J) over the cycle at constant speeds, by their `squares` relative to the nominal speed. The
    work of friction is an estimate from reactions without it: this is only a guess of the motion."""

    estimated = panels.near is not None

    def gain(square):
        return jnp.sum(panels.weights * panels.slopes(_smooth_rate if estimated else _rate, square * nominal))

    def lost(square):
        def one(data: Nodes, energy: Array) -> Array:
            return panels.given.torques.estimate(data.here, data.moving, _speed(panels.given, data, energy))

        return jnp.sum(panels.weights * jax.vmap(one)(panels.data, square * nominal))

    gains = jax.vmap(gain)(squares)
    if not estimated:
        return gains
    few = squares[::FEWER]
    return gains + jnp.interp(jnp.log(squares), jnp.log(few), jax.vmap(lost)(few))


def _panels(
    duty: Duty, scene: Scene | ReadyScene, grid: Grid, here: Reduced, pose: Pose | None, added: Any, ratio: Any
) -> Panels:
    """The equation of motion on the panels of the grid."""
    torques, weights = torques_of(scene), grid.half[:, None] * grid.rule.w[None]
    here = here._replace(inertia=here.inertia + added)
    total = here.inertia + torques.rotor
    inertia = jnp.maximum(total, inertia_floor(jnp.sum(weights * total) / duty.cycle))
    unit = 0.5 * duty.speed**2 * jnp.sum(weights * inertia) / duty.cycle
    given = Given(torques, LEAST * LEAST * unit, 1 / (duty.speed * ratio))
    data = Nodes(here, moving_at_nodes(grid, torques, pose), inertia)
    return Panels(grid.half, given, data, unit, _first_frictions(data), grid.n, torques.rough is not None)


def _first_frictions(data: Nodes) -> Any:
    """Frictions and accelerations from which those at the nodes are found; None without friction, or with meshes."""
    basis = None if data.moving is None else data.moving.basis
    return None if basis is None else (jnp.zeros_like(basis.senses), jnp.zeros_like(data.inertia))


def periodic_starts(machine: Sampler, grid: Grid, at: AtNodes, speeds: np.ndarray) -> np.ndarray:
    """Crank speeds (rad/s) at the first edge with which periodic motions begin, between the increasing `speeds` there:
    those of stable and unstable motions."""
    pose = at.sample.pose if on_pose(machine.scene) else None
    given = (duty_of(machine.scene), whole(machine), grid, at.here, pose)
    gain = np.asarray(machine.run(_gains, *given, jnp.asarray(speeds)))
    crossings = [
        machine.run(_crossing, *given, *map(jnp.asarray, speeds[i : i + 2]))
        for i in np.flatnonzero((gain[:-1] > 0) != (gain[1:] > 0))
    ]
    return np.asarray([float(speed) for speed, closed in crossings if closed])  # not where a motion comes to rest


@compiled_soon
def _gains(duty: Duty, scene: Scene | ReadyScene, grid: Grid, here: Reduced, pose: Pose | None, speeds: Array) -> Array:
    """The gain of energy (J) over one cycle from each speed at the first edge."""
    panels = _panels(duty, scene, grid, here, pose, 0.0, 1.0)
    starts = 0.5 * panels.data.inertia[0, 0] * speeds**2
    return jax.vmap(lambda start: follow(_rate, panels, start).end - start)(starts)


@compiled_soon
def _crossing(
    duty: Duty, scene: Scene | ReadyScene, grid: Grid, here: Reduced, pose: Pose | None, low: Array, high: Array
) -> tuple[Array, Array]:
    """The speed between two of which one gains and one loses, and whether the cycle from there closes."""
    panels = _panels(duty, scene, grid, here, pose, 0.0, 1.0)
    half = 0.5 * panels.data.inertia[0, 0]

    def gain(speed):
        start = half * speed**2
        return follow(_rate, panels, start).end / start - 1

    rises = gain(low) > 0

    def halve(_, ends):
        middle = 0.5 * (ends[0] + ends[1])
        same = (gain(middle) > 0) == rises
        return jnp.where(same, middle, ends[0]), jnp.where(same, ends[1], middle)

    low, high = jax.lax.fori_loop(0, HALVINGS, halve, (low, high))
    return low, jnp.abs(gain(low)) < NEAR


@compiled_soon(static=("edges",))
def _begun(
    duty: Duty, scene: Scene | ReadyScene, grid: Grid, here: Reduced, dynamics: tuple, pose: Pose | None, added: Array,
    ratio: Array, small: Array, start: Array | None, edges: bool,
) -> tuple[Begun, AtEdges | None]:  # fmt: skip
    guess, grid = grid.guess, dataclasses.replace(grid, guess=None)
    panels = _panels(duty, scene, grid, here, pose, added, ratio)
    torques, data = panels.given.torques, panels.data
    orbit, found, number, gain = _solved(panels, duty.speed, start, guess, small)
    panels = panels.closer(orbit.near)
    once = jnp.ones_like(orbit.nodes)
    rise, change = jax.jvp(lambda e: panels.slopes(_rate, e, orbit.constant), (orbit.nodes,), (once,))
    rise, multiplier = rise + orbit.constant, jnp.exp(jnp.sum(panels.weights * change))
    speeds = _speed(panels.given, data, orbit.nodes)
    full, rubbed = torques.with_friction(data.here, data.moving, speeds, orbit.constant, panels.near)
    frictions = None
    if rubbed is not None:
        # without a width a panel may be the very place where all forces vanish, so that nothing is left to judge by
        found &= jnp.all(rubbed.moves | ~has_width(grid.half, grid.length)[:, None])
        frictions = _where_it_moves(rubbed, small)
    multiplier = jnp.where(found, multiplier, 1.0)  # without a motion it may be infinite
    mean = -jnp.sum(panels.weights * full.torque) / duty.cycle
    driven = Driven(torques, orbit.constant, mean, multiplier, orbit.multiplier, found, number, gain, frictions)
    inside = full._replace(inertia=data.here.inertia + torques.rotor, torque=rise)
    flow = Flow.of(duty, grid, inside, primitive(grid, rise), jnp.zeros_like(mean), added + torques.rotor, driven)
    energy = orbit.edges[0]
    clock = primitive(grid, 1 / flow.speed(energy + flow.at_nodes, flow.inertia))
    ends = _edges(grid, flow, driven, dynamics, pose, added, orbit.edges) if edges else None
    return Begun(flow, energy, clock, *spotted(flow, energy)), ends


def _where_it_moves(rubbed: FrictionTorque, small: Array) -> Any:
    """Frictions and accelerations at the nodes, zero where friction locks the machine, as far as that is known for a
    motion up to steps as `small` as this; without derivatives."""
    if rubbed.near is None:
        return None
    c, rate = jax.lax.stop_gradient(rubbed.near)
    moves = (rubbed.moves | (small > CLOSED)) & jnp.isfinite(rate) & jnp.all(jnp.isfinite(c), axis=1)
    return jnp.where(moves[:, None], c, 0.0), jnp.where(moves, rate, 0.0)


def moving_at_nodes(grid: Grid, torques: BySpeed, pose: Pose | None) -> Moving | None:
    """What loads that depend on the speed need at the nodes, whose pose comes first in `pose`."""
    if pose is None:
        return None
    shape = grid.nodes.shape
    own = jax.tree.map(lambda leaf: leaf[: grid.size].reshape((*shape, *leaf.shape[1:])), pose)
    panel = jnp.broadcast_to(jnp.arange(grid.panels, dtype=jnp.int32)[:, None], shape)
    return moving_at(torques, grid, own, grid.nodes, panel, taken(grid.order, panel))


def _edges(
    grid: Grid, flow: Flow, driven: Driven, dynamics: tuple, pose: Pose | None, added: Array, energy: Array
) -> AtEdges:
    """Inertia and torques at every panel's first edge, with the energies (J) there."""
    number = jnp.arange(grid.panels, dtype=jnp.int32)
    rest, there = jax.tree.map(lambda leaf: leaf[grid.size : grid.size + grid.panels], (dynamics, pose))
    sides = []
    for panel, x in ((number, -1.0), (jnp.roll(number, 1), 1.0)):
        here = grid.reduced(rest, panel)
        here = here._replace(inertia=here.inertia + added)
        inertia = jnp.maximum(here.inertia + driven.torques.rotor, flow.floor)
        moving = None
        if there is not None:
            moving = moving_at(driven.torques, grid, there, grid.edges[:-1], panel)
            moving = near_by(moving, grid, driven.near, panel, jnp.full(grid.panels, x))
        sides.append(driven.rise(here, moving, flow.speed(energy, inertia)))
    return AtEdges(here.inertia - added, *sides)
