"""Steady-state motion for a constant balancing drive torque, by quadrature of the energy equation.

With torques that depend only on position, ½ J ω² = E₀ + W(φ) with W = ∫ (Q + T) dφ, so there is no differential
equation to solve. W is smooth between breakpoints and is interpolated; J is computed exactly wherever a speed is
needed.
Source: energy equation of a machine, Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 16.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import once, taken, wrapped
from linkjax._tree import node
from linkjax._types import Scalar
from linkjax.kinematics import pose
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.motion._error import AtEdges, delta_error
from linkjax.motion._extremum import newton
from linkjax.motion._flow import LEAST, SIGNS, Duty, Ends, Flow, Primitive, Spots, primitive
from linkjax.motion._grid import Grid, Place, grid_of
from linkjax.reduction import Reduced, loaded, of_crank, reduce_pose
from linkjax.sampling import Sample, Sampler


@node
class Steady:
    """Steady-state motion. Speeds in rad/s, angles in rad, torque in N m, energies in J, period in s.

    `delta_error` bounds the absolute error of `delta`, the coefficient of speed fluctuation (None where it was not
    asked for). `steady_state_margin` is the least kinetic energy divided by ½ J̄ ω_m², minus the least value of a
    steady-state motion (1e-6): if it is negative, no steady-state motion exists at this mean speed, and
    `min_mean_speed` is the lowest mean speed that has one. `min_inertia_ratio` is the least reduced inertia divided by
    its mean. Where the reduced inertia is zero the speed is unbounded, and the values are those of a machine with
    `inertia_floor` (kg m²) there. `excess_work` is the largest excess work, max W - min W.
    """

    work: Primitive
    clock: Primitive
    energy: Array
    mean_drive_torque: Array
    period: Array
    mean_speed: Array
    delta: Array
    delta_error: Any
    max_speed: Array
    min_speed: Array
    angle_of_max: Array
    angle_of_min: Array
    steady_state_margin: Array
    angle_of_min_work: Array
    min_mean_speed: Array
    min_inertia_ratio: Array
    angle_of_min_inertia: Array
    inertia_floor: Array
    excess_work: Array
    evaluations: int | None = eqx.field(static=True)

    @property
    def grid(self) -> Grid:
        """The cycle grid."""
        return self.work.grid

    def at(self, scene: Scene | ReadyScene, place: Place) -> tuple[Array, Array]:
        """Crank speed (rad/s) and acceleration (rad/s²) of a scene at one place of the grid."""
        made = ready(scene)
        return self.crank(made.scene.speed, reduced_in(made, self.grid, place.phi, place.panel), place)

    def crank(self, nominal: Scalar, here: Reduced, place: Place) -> tuple[Array, Array]:
        """Crank speed (rad/s) and acceleration (rad/s²) at places of the grid, with the reduced model there and the
        `nominal` speed (rad/s)."""
        if self.grid.prescribed:
            return nominal * jnp.ones_like(place.phi), jnp.zeros_like(place.phi)
        inertia = jnp.maximum(here.inertia, self.inertia_floor)
        floor = LEAST * 0.5 * inertia * nominal**2
        speed = jnp.sqrt(2 * jnp.maximum(self.energy + self.work.at(place), floor) / inertia)
        return speed, (here.torque + self.mean_drive_torque - 0.5 * here.slope * speed**2) / inertia


def steady_motion(scene: Scene | ReadyScene, nodes: int = 96) -> Steady:
    """Steady-state motion of a scene, with about `nodes` nodes per crank turn on the cycle grid.

    Never raises: if no steady-state motion exists, `steady_state_margin` is negative and every value is finite.
    """
    machine = Sampler(ready(scene))
    grid = grid_of(machine, nodes)
    return steady_on(machine, grid, at_nodes(machine, grid))


class AtNodes(NamedTuple):
    """The machine at the nodes: places and samples, first of the nodes, then of the edges if they were asked for; the
    reduced model, shape (panels, n); and what the error of δ needs of the edges."""

    place: Place
    sample: Sample
    here: Reduced
    edges: AtEdges | None


def at_nodes(machine: Sampler, grid: Grid, edges: bool = True, gaps: bool = False) -> AtNodes:
    """The machine at every node of the grid, and at the `edges` of the panels for the error of δ; with margins and
    transmission angles if `gaps`."""
    place = machine.run(node_places, grid, edges=edges)
    sample = machine.sample(place.phi, place.side, gaps=gaps)
    return AtNodes(place, sample, *machine.run(_node_values, grid, sample.dynamics, edges=edges))


@compiled_soon(static=("edges",))
def node_places(grid: Grid, edges: bool) -> Place:
    """The nodes, then the first edge of every panel."""
    nodes = jax.tree.map(jnp.ravel, grid.node_places())
    if not edges:
        return nodes
    number = jnp.arange(grid.panels, dtype=jnp.int32)
    first = Place(number, jnp.full(grid.panels, -1.0), grid.edges[:-1], grid.middle)
    return Place(*(jnp.concatenate(pair) for pair in zip(nodes, first, strict=True)))


@compiled_soon(static=("edges",))
def _node_values(grid: Grid, dynamics: tuple, edges: bool) -> tuple[Reduced, AtEdges | None]:
    shape = grid.nodes.shape
    inertia, slope, shares = jax.tree.map(lambda leaf: leaf[: grid.size].reshape(shape), dynamics)
    order = jnp.broadcast_to(grid.order[:, None], (*shape, len(grid.loads)))
    here = of_crank(loaded(inertia, slope, shares, grid.loads, order), grid.prescribed)
    here = here._replace(inertia=once(here.inertia), slope=once(here.slope), torque=once(here.torque))
    if not edges:
        return here, None
    number = jnp.arange(grid.panels, dtype=jnp.int32)
    rest = jax.tree.map(lambda leaf: leaf[grid.size :], dynamics)
    after, before = grid.reduced(rest, number), grid.reduced(rest, jnp.roll(number, 1))
    return here, AtEdges(after.inertia, after.torque, before.torque)


def reduced_in(made: ReadyScene, grid: Grid, phi: Array, panel: Array) -> Reduced:
    """The reduced model that determines the motion of the crank, at a crank angle (rad) in a panel of the grid."""
    at, here = made.instant(phi, grid.middle[panel]), pose(made.mechanism, phi)
    return of_crank(reduce_pose(made.scene, at, here, grid.order[panel]), grid.prescribed)


def node_values(scene: Scene | ReadyScene, grid: Grid) -> Reduced:
    """Reduced inertia, slope and torque at every node, shape (panels, n)."""
    return at_nodes(Sampler(ready(scene)), grid, edges=False).here


def duty_of(scene: Scene) -> Duty:
    """What a scene asks of its crank."""
    return Duty(scene.speed, scene.cycle, scene.mean, scene.mechanism.prescribed)


def steady_on(machine: Sampler, grid: Grid, at: AtNodes) -> Steady:
    """Steady-state motion from the node values; see `steady_motion`."""
    begun = machine.run(begin, duty_of(machine.scene), grid, at.here, 0.0)
    return conclude(machine, begun, at.edges)


class Begun(NamedTuple):
    """The work over the cycle, the energy constant for the wanted time mean, the time, and guesses of the extremes with
    their places."""

    flow: Flow
    energy: Array
    clock: Primitive
    spots: Spots
    place: Place


def conclude(machine: Sampler, begun: Begun, edges: AtEdges | None) -> Steady:
    """The motion that follows from the work over the cycle and the energy constant for the wanted time mean."""
    flow, energy, clock, spots, place = begun
    ends, light = _extremes(machine, flow, energy, spots, place)
    if machine.scene.mean == "time":
        return machine.run(_concluded, flow, energy, clock, ends, light, spots, None, edges, rounds=1)
    for _ in range(2):  # energy and extremes depend on each other: quadratic convergence
        energy, spots, place = machine.run(_midrange, flow, energy, ends)
        ends, light = _extremes(machine, flow, energy, spots, place)
    slow, _ = _extremes(machine, flow, *machine.run(_least, flow))
    return machine.run(_concluded, flow, energy, clock, ends, light, spots, slow, edges, rounds=4)


def fluctuation(machine: Sampler, begun: Begun) -> Any:
    """δ alone."""
    if machine.scene.mean != "time":
        return conclude(machine, begun, None).delta
    flow, energy, _, spots, place = begun
    return machine.run(_fluctuation, flow, _extremes(machine, flow, energy, spots, place)[0])


def _extremes(machine: Sampler, flow: Flow, energy: Any, spots: Spots, place: Place) -> tuple[Ends, Any]:
    """The extremes of the speed, and the least reduced inertia with its angle, in two rounds of evaluations."""
    first = machine.sample(place.phi, place.side, fixed=True)
    moved = machine.run(_moved, flow, energy, spots[:3], first.dynamics)
    return machine.run(_ended, flow, energy, moved, machine.sample(moved.place.phi, moved.place.side).dynamics)


@compiled_soon
def begin(duty: Duty, grid: Grid, here: Reduced, added: Scalar) -> Begun:
    """`added` is a flywheel inertia (kg m²) that the machine does not have."""
    here = here._replace(inertia=here.inertia + added)
    drive = -jnp.sum(grid.half[:, None] * grid.rule.w[None] * here.torque) / duty.cycle
    flow = Flow.of(duty, grid, here, primitive(grid, here.torque + drive), drive, added)
    energy = flow.energy_for_time_mean()
    clock = primitive(grid, 1 / flow.speed(energy + flow.at_nodes, here.inertia))
    return Begun(flow, energy, clock, *spotted(flow, energy))


def spotted(flow: Flow, energy: Array) -> tuple[Spots, Place]:
    """Guesses of the extremes, with their places."""
    spots = jax.lax.stop_gradient(flow).spots(jax.lax.stop_gradient(energy))
    return spots, flow.grid.at(spots.panel, spots.x)


class Moved(NamedTuple):
    """Bends at the guesses of the extremes, the steps of Newton's method from them, the slopes before, and the new
    places."""

    bend: Array
    move: Array
    tilt: Array
    place: Place


@compiled_soon
def _moved(flow: Flow, energy: Array, spots: tuple[Array, Array, Array], dynamics: tuple) -> Moved:
    fixed, energy = jax.lax.stop_gradient((flow, energy))
    panel, x, bend = spots
    here = fixed.reduced(dynamics, panel)
    slope = fixed.tilt(panel, x, energy, here)[1]
    slope = jnp.concatenate([slope[:-1], (taken(fixed.grid.half, panel) * here.slope)[-1:]])
    move = newton(x, jnp.asarray(SIGNS, x.dtype) * slope, bend)
    move = jnp.concatenate([jax.lax.stop_gradient(move[:-1]), move[-1:]])
    return Moved(bend, move, slope, flow.grid.at(panel, x + move))


@compiled_soon
def _ended(flow: Flow, energy: Array, moved: Moved, dynamics: tuple) -> tuple[Ends, tuple[Array, Array]]:
    """The extremes, and the least reduced inertia with its angle."""
    return flow.ends(*moved, energy, flow.reduced(dynamics, moved.place.panel))


@compiled_soon
def _fluctuation(flow: Flow, ends: Ends) -> Array:
    fastest, slowest = flow.speeds(ends)
    return (fastest - slowest) / flow.duty.speed


@compiled_soon
def _midrange(flow: Flow, energy: Array, ends: Ends) -> tuple[Array, Spots, Place]:
    energy = flow.energy_for_midrange(energy, ends)
    return energy, *spotted(flow, energy)


@compiled_soon
def _least(flow: Flow) -> tuple[Array, Spots, Place]:
    """The energy with which the crank only just rotates fully."""
    energy = flow.least_energy()
    return energy, *spotted(flow, energy)


@compiled_soon(static=("rounds",))
def _concluded(
    flow: Flow, energy: Array, clock: Primitive, ends: Ends, light: tuple[Array, Array], spots: Spots,
    slow: Ends | None, edges: AtEdges | None, rounds: int,
) -> Steady:  # fmt: skip
    """The motion; `slow` are the extremes at the lowest mean speed where it is the mean of the extremes."""
    duty, grid = flow.duty, flow.grid
    if duty.mean == "midrange":
        new = flow.energy_for_midrange(energy, ends)
        ends, energy = ends._replace(height=ends.height + (new - energy) / ends.inertia), new
        clock = primitive(grid, 1 / flow.speed(energy + flow.at_nodes, flow.inertia))
    fastest, slowest = flow.speeds(ends)
    error = None if edges is None else delta_error(flow, energy, ends, edges, spots)
    period = flow.period(energy)
    mean = duty.cycle / period if duty.mean == "time" else 0.5 * (fastest + slowest)
    (most, least), angle = flow.work.extremes()
    bare = LEAST * flow.scale - least  # the energy with which the crank only just rotates fully
    lowest = duty.cycle / flow.period(bare) if slow is None else 0.5 * jnp.sum(flow.speeds(slow))
    top, bottom = wrapped(ends.place.phi, duty.cycle)
    drive = flow.drive
    if duty.prescribed:  # inertia does no net work over a cycle
        shares = sum(flow.here.by_load.values(), jnp.zeros_like(flow.here.torque))
        drive = -jnp.sum(flow.weights * shares) / duty.cycle
        error = None if error is None else jnp.zeros_like(drive)
    return Steady(
        flow.work, clock, energy, drive, period, mean, (fastest - slowest) / duty.speed,
        None if error is None else jax.lax.stop_gradient(error), fastest, slowest, top, bottom,
        (energy + least) / flow.scale - LEAST, wrapped(angle[1], duty.cycle), lowest,
        light[0], wrapped(light[1], duty.cycle), flow.floor, most - least,
        grid.evaluations + grid.size + 8 * rounds + grid.half.size + 2,
    )  # fmt: skip
